"""Drops as a world for the search: laws as bases, testable effects, impacts and flights as data.

Columns of the score test are secants over a parameter's `scale`, because some effects have no slope at their null.
They include the weights of the t distribution, so that a bad impact counts as little as in the fit.
"""

from collections.abc import Mapping, Sequence
from typing import Self

import numpy as np

from thesis_lib.contact import CANDIDATE_LAWS, LAWS
from thesis_lib.critique.drops.fit import NU, ROUNDS, Fit, Whitening, fit
from thesis_lib.critique.drops.held_out import Judgement, cross_validate, is_material, judge
from thesis_lib.critique.drops.model import BASE_PARAMETERS, Model
from thesis_lib.critique.drops.observations import Observations
from thesis_lib.critique.drops.residuals import residual_covariance
from thesis_lib.critique.drops.synthetic import synthesise
from thesis_lib.critique.selection.search import Discovery
from thesis_lib.critique.selection.settings import SearchSettings
from thesis_lib.critique.selection.world import Slopes, World
from thesis_lib.effects import EFFECTS, Effect


class Drops(World[Effect, Fit, Judgement]):
    """Impacts and flights of some trials; `rivals` laws are tried with the first effect."""

    unit = "impact"

    def __init__(self, observations: Observations, rivals: int = 1) -> None:
        self.observations, self.rivals = observations, rivals
        self.bases = CANDIDATE_LAWS
        self.trials = np.unique(observations.trial)
        self.candidates, self.not_testable = testable_effects(observations)

    def fit(
        self, base: str, effects: tuple[Effect, ...], start: Mapping[str, float] | None = None, *, quick: bool = False
    ) -> Fit:
        return fit(Model(LAWS[base], effects), self.observations, start, rounds=1 if quick else ROUNDS)

    def judge(self, fitted: Fit) -> Judgement:
        return judge(fitted, self.observations)

    def cross_validate(self, fitted: Fit, folds: np.ndarray) -> Judgement:
        return cross_validate(fitted, self.observations, folds)

    def is_material(self, better: Judgement, worse: Judgement, candidate: Effect, settings: SearchSettings) -> bool:
        return is_material(better, worse, candidate.channels, settings)

    def start_with(self, fitted: Fit, candidate: Effect) -> Mapping[str, float]:
        if all(p.discrete is None for p in candidate.parameters):
            return fitted.values
        # a mirrored axis inverts the contact: (μ, ε) fitted without it are a bad start
        of_law = {p.name for p in BASE_PARAMETERS}
        return {name: value for name, value in fitted.values.items() if name not in of_law}

    def drawn(self, fitted: Fit, rng: np.random.Generator) -> Self:
        synthetic = synthesise(fitted.model, fitted.values, self.observations, rng, fitted.sigma_m)
        return type(self)(synthetic, self.rivals)

    def slopes(self, fitted: Fit, candidates: Sequence[Effect]) -> Slopes:
        S = residual_covariance(fitted.model, fitted.values, self.observations)
        here = Whitening(fitted.model, self.observations, S, fitted.sigma_m)
        z, f = here(fitted.values)
        weight = np.concatenate([_weights(z), _weights(f)])
        base = np.concatenate([z.ravel(), f.ravel()])
        columns = []
        for name, p in fitted.model.parameters.items():
            if p.discrete is None:
                step = 1e-3 * p.scale
                step = step if fitted.values[name] + step <= p.high else -step
                values = {**fitted.values, name: fitted.values[name] + step}
                columns.append(weight * (_stacked(here, values) - base) / step)
        of_candidates = {}
        for effect in candidates:
            with_it = Whitening(fitted.model.with_effect(effect), self.observations, S, fitted.sigma_m)
            nulls = {f"{effect.name}.{p.name}": p.null for p in effect.parameters}
            secants = []
            for p in effect.parameters:
                step = p.scale if p.null + p.scale <= p.high else -p.scale
                step = step if p.discrete is None else p.discrete - p.null
                values = {**fitted.values, **nulls, f"{effect.name}.{p.name}": p.null + step}
                secants.append(weight * (_stacked(with_it, values) - base) / step)
            of_candidates[effect.name] = np.stack(secants, axis=1)
        return Slopes(weight * base, np.stack(columns, axis=1), of_candidates, unit_noise=False)


DropsDiscovery = Discovery[Effect, Fit, Judgement]


def testable_effects(observations: Observations) -> tuple[dict[str, Effect], dict[str, str]]:
    """Testable effects by name, and by name why the others cannot be tested."""
    testable, why_not = {}, {}
    for name, effect in EFFECTS.items():
        if not effect.applies_to(observations.rig):
            why_not[name] = f"does not apply to a body of shape {observations.rig.shape.kind}"
        elif effect.needs_trajectories and not observations.arcs:
            why_not[name] = "no trajectories"
        else:
            testable[name] = effect
    return testable, why_not


def _stacked(whitening: Whitening, values: Mapping[str, float]) -> np.ndarray:
    """All whitened residuals as one vector (N,), impacts first."""
    return np.concatenate([part.ravel() for part in whitening(values)])


def _weights(z: np.ndarray) -> np.ndarray:
    """Square roots of the t distribution's weights, (n m,), for whitened residuals (n, m)."""
    if not len(z):
        return np.zeros(0)
    m = z.shape[1]
    d2 = np.einsum("nm,nm->n", z, z)
    return np.repeat(np.sqrt((NU + m) / (NU + d2)), m)
