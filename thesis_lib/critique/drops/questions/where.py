"""Find where a model fails: short rules over the state before impact, with p-values that count all rules tried.

    z_i = e_i / √(trace of the kinetic covariance of e_i)

is the error of impact i over that predicted by noise and mean scatter, so a region of large noise is not mistaken for
one of failure.  A rule is one interval of one feature, or two.  Its score is the rank sum of z inside against
outside.  Its p-value is the share of permutations of z in which *any* rule scores as high.  Flights have their own
rules and p-values over the state at mid-flight.

Rules are found on all impacts, because there are few.  A region's errors are those of held-out impacts if at least
`FEWEST_HELD_OUT` lie inside and as many outside (`on`: "held_out"), else of all ("all").
"""

import itertools
from dataclasses import dataclass

import numpy as np
import pandas as pd

from thesis_lib.critique.drops.criticise import DropsCritique
from thesis_lib.critique.drops.features import FEATURES, features
from thesis_lib.critique.drops.questions.class_tests import class_tests
from thesis_lib.critique.drops.questions.flight_residuals import (
    FLIGHT_UNITS,
    flight_features,
    misfit,
    relative_residuals,
)
from thesis_lib.critique.likelihood.fit import Fit
from thesis_lib.foundation.files import six_digits

PERMUTATIONS = 499
LEVEL = 0.05  # largest corrected p-value of a reported rule
SMALLEST, LARGEST = 0.05, 0.6  # share of the impacts inside a rule
MOST_REGIONS = 3
FEWEST_HELD_OUT = 30  # inside and outside a region, for errors of held-out impacts
OVERLAP = 0.1  # largest share of a region inside earlier ones
SIMPLER = 0.9  # a rule of one feature replaces one of two if its score reaches this share
MOST_IMPACTS = 3000  # a random part of larger sets is used
TAILS = (0.1, 0.2, 1 / 3, 0.5, 2 / 3, 0.8, 0.9)  # quantiles at which one-feature rules are cut
MIDDLES = ((0.2, 0.4), (0.4, 0.6), (0.6, 0.8), (0.25, 0.75))
COARSE = (0.2, 1 / 3, 0.5, 2 / 3, 0.8)  # the same for rules of two features
# sign and magnitude of these may matter separately
_SIGNED = ("v_t", "omega", "r_x", "theta", "v_x", "v_y", "omega_t", "omega_b", "omega_n", "r_t", "r_b")
_UNITS = {**FLIGHT_UNITS, **{name: unit for name, (unit, _) in FEATURES.items()}}


@dataclass(frozen=True)
class Condition:
    """low < feature < high in the feature's unit, or of its magnitude if `absolute`; `wall` is the name of a wall."""

    feature: str
    absolute: bool
    low: float | None
    high: float | None
    wall: str = ""

    @property
    def text(self) -> str:
        if self.wall:
            return f"the wall is {self.wall}"
        name = f"|{self.feature}|" if self.absolute else self.feature
        unit = _UNITS[self.feature]

        def amount(x: float) -> str:
            return f"{x:g}" if unit == "1" or x == 0 else f"{x:g} {unit}"

        if self.low is None:
            return f"{name} < {amount(self.high)}"  # pyright: ignore[reportArgumentType]
        if self.high is None:
            return f"{name} > {amount(self.low)}"
        return f"{self.low:g} < {name} < {amount(self.high)}"

    def inside(self, table: pd.DataFrame) -> np.ndarray:
        """Mask (n,) of the rows that satisfy it."""
        x = table[self.feature].to_numpy(float)
        x = np.abs(x) if self.absolute else x
        low = -np.inf if self.low is None else self.low
        return (x > low) & (x < (np.inf if self.high is None else self.high))


Rule = tuple[Condition, ...]


def where(critique: DropsCritique, rng: np.random.Generator | None = None) -> dict:
    """Content of where.json: regions before and after the effects, and tests of whole classes of models."""
    rng = rng or np.random.default_rng(0)
    # separate streams: later draws must not depend on whether there are flights
    flight_rng = rng.spawn(1)[0]

    def regions_of(fitted: Fit) -> dict:
        impacts = impact_regions(critique, fitted, rng)
        return {"regions": impacts, "flight_regions": flight_regions(critique, fitted, flight_rng)}

    base, final = critique.ladder[0][1], critique.ladder[-1][1]
    names = [step.effect.name for step in critique.discovery.steps]
    after = {"effects": names} | regions_of(final) if names else None
    content = {"schema": 1, "dataset": critique.dataset, "model": critique.discovery.base} | regions_of(base)
    return six_digits(content | {"after": after, "class_tests": class_tests(base, critique.observations.single)})


def impact_regions(critique: DropsCritique, fitted: Fit, rng: np.random.Generator) -> list[dict]:
    """Regions of the state before impact in which `fitted` errs more than elsewhere; errors in m/s."""
    o, m = critique.observations, critique.space.motions
    here = fitted.on(o)
    error, S = o.norm(here.velocity_left), here.covariance(o.t_std)[:, :m, :m]
    z = error / np.sqrt(np.einsum("nij,nij->n", S, o.metric) + m * fitted.sigma_m**2)
    return regions(features(fitted, o), error, z, np.isin(o.trial, critique.held_out.trial), rng)


def flight_regions(critique: DropsCritique, fitted: Fit, rng: np.random.Generator) -> list[dict]:
    """Regions of the state at mid-flight with larger errors, in units of noise."""
    flights, rig = critique.observations.flights, critique.observations.rig
    if not len(flights):
        return []
    z = misfit(relative_residuals(fitted, flights, rig))
    held_out = np.isin(flights.state.trial, critique.held_out.trial)
    return regions(flight_features(fitted, flights, rig), z, z, held_out, rng, unit="1")


def regions(
    table: pd.DataFrame,
    error: np.ndarray,
    z: np.ndarray,
    held_out: np.ndarray,
    rng: np.random.Generator,
    unit: str = "m/s",
) -> list[dict]:
    """Up to `MOST_REGIONS` regions in which errors are larger than elsewhere, worst first.

    `table` has features of n impacts or flights; error (n,) in `unit`, z (n,) over its expectation, held_out (n,) mask.
    """
    known = np.flatnonzero(np.isfinite(z))
    if len(known) > MOST_IMPACTS:
        known = np.sort(rng.choice(known, MOST_IMPACTS, replace=False))
    error, z, held_out, table = error[known], z[known], held_out[known], table.iloc[known]
    rules, masks = _rules(table)
    if not rules:
        return []
    score, null = _scores(z, masks, rng)
    score = score * np.where([len(rule) == 1 for rule in rules], 1.0, SIMPLER)
    worst, taken = [], np.zeros(len(z), bool)
    for i in np.argsort(-score, kind="stable"):
        inside = masks[i]
        plain = score[i] / (1.0 if len(rules[i]) == 1 else SIMPLER)
        p_value = float((1 + np.sum(null >= plain)) / (1 + len(null)))
        if p_value > LEVEL or len(worst) == MOST_REGIONS:
            break
        enough = min(np.sum(held_out & inside), np.sum(held_out & ~inside)) >= FEWEST_HELD_OUT
        judged = held_out if enough else np.ones(len(z), bool)
        (mean_in, sigmas_in), (mean_out, sigmas_out) = (
            (float(error[part & judged].mean()), float(z[part & judged].mean())) for part in (inside, ~inside)
        )
        # a region must also err more in `unit`: relative to a smaller noise alone it costs the user nothing
        if np.mean(taken[inside]) > OVERLAP or mean_in <= mean_out:
            continue
        taken |= inside
        worst.append(
            {
                "rule": " and ".join(condition.text for condition in rules[i]),
                "conditions": [{k: v for k, v in vars(one).items() if k != "wall" or v} for one in rules[i]],
                "support": float(inside.mean()),
                "n": int(inside.sum()),
                "on": "held_out" if enough else "all",
                "error_inside": mean_in,
                "error_outside": mean_out,
                "ratio": mean_in / mean_out if mean_out > 0 else None,
                "sigmas_inside": sigmas_in,
                "sigmas_outside": sigmas_out,
                "unit": unit,
                "p_value": p_value,
            }
        )
    return worst


def _scores(z: np.ndarray, masks: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Standardised rank sum of each rule (rules,), and the largest of any rule in each permutation."""
    n = len(z)
    ranks = pd.Series(z).rank().to_numpy()
    ranks = (ranks - ranks.mean()) / (ranks.std(ddof=1) or 1.0)
    count = masks.sum(axis=1)
    scale = np.sqrt(count * (n - count) / n)
    shuffled = rng.permuted(np.tile(ranks, (PERMUTATIONS, 1)), axis=1)
    M = masks.astype(np.float32)
    null = (M @ shuffled.T.astype(np.float32) / scale[:, None].astype(np.float32)).max(axis=0)
    return masks @ ranks / scale, null


def _rules(table: pd.DataFrame) -> tuple[list[Rule], np.ndarray]:
    """All rules with enough support, and their masks (rules, n)."""
    if table.empty:
        return [], np.zeros((0, 0), bool)
    named = [Condition("wall", False, i - 0.5, i + 0.5, wall) for i, wall in enumerate(table.attrs.get("walls", ()))]
    fine, coarse = ({condition.text: condition for condition in named} for _ in range(2))
    for feature in table.columns.drop("wall", errors="ignore"):
        x = table[feature].to_numpy(float)
        for absolute in (True,) if feature == "v_n" else (False, True) if feature in _SIGNED else (False,):
            values = np.abs(x) if absolute else x
            if np.ptp(values) <= 0:
                continue
            signed = feature in _SIGNED and not absolute
            fine |= _conditions(feature, absolute, values, signed, TAILS, MIDDLES)
            coarse |= _conditions(feature, absolute, values, signed, COARSE, ())
    rules: list[Rule] = [(condition,) for condition in fine.values()]
    rules += [(a, b) for a, b in itertools.combinations(coarse.values(), 2) if a.feature != b.feature]
    members = {condition.text: condition.inside(table) for condition in {**fine, **coarse}.values()}
    masks = np.array([np.logical_and.reduce([members[c.text] for c in rule]) for rule in rules], bool)
    if not rules:
        return [], masks
    support = masks.mean(axis=1)
    good = np.flatnonzero((support >= SMALLEST) & (support <= LARGEST))
    return [rules[i] for i in good], masks[good]


def _conditions(
    feature: str, absolute: bool, x: np.ndarray, signed: bool, quantiles: tuple, middles: tuple
) -> dict[str, Condition]:
    """Tails and middles at quantiles of x by their text, with thresholds rounded to two digits for readers."""

    def cut(q: float) -> float:
        return float(f"{np.quantile(x, q):.2g}")

    cuts = [cut(q) for q in quantiles] + ([0.0] if signed else [])
    limits = [*((None, c) for c in cuts), *((c, None) for c in cuts)]
    limits += [(cut(a), cut(b)) for a, b in middles if cut(a) < cut(b)]
    return {c.text: c for c in (Condition(feature, absolute, low, high) for low, high in limits)}
