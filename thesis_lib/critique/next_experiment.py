"""Which release to measure next: states just before impact at which two models differ most, in units of noise.

The two models are the final one and its nearest rival: an alternative that these data cannot tell from a chosen effect,
else the unused candidate with the largest score test.  The difference of their predictions of the velocity after
impact, d, counts as √(dᵀ S⁻¹ d) with S the mean covariance of the final model's residual, scatter included.  States lie
within reach of the rig: `REACH` times the range of those before the first impacts of the trials measured.
"""

import numpy as np

from thesis_lib.critique.criticise import Critique
from thesis_lib.critique.fit import Fit, fit
from thesis_lib.critique.model import residual_covariance, states_at_impact
from thesis_lib.effects import EFFECTS
from thesis_lib.effects.effect import State

DRAWS = 400
REACH = 1.3  # states may lie this much beyond those measured
FEWEST, MOST = 3, 5
APART = 0.35  # least distance of two states, in widths of the ranges over four dimensions
CLEAR = 3.0  # standard deviations that a difference must reach to be believed
WORTHWHILE = 0.5  # of the largest difference: a further state must have it
CHANNELS = ("vx", "vy", "omega", "theta")


def next_experiment(critique: Critique, rng: np.random.Generator) -> dict:
    """`why` in plain words, `states` (vx, vy, omega, theta just before impact) and `sigmas`, their differences."""
    final = critique.ladder[-1][1]
    chosen = _rival(critique)
    if chosen is None:
        return {"why": "No other effect can be tested with impacts of this rig.", "states": [], "sigmas": []}
    rival, why = chosen
    states, differences = _states(critique, final, rival, rng)
    if not len(states) or differences.max() <= 0:
        return {
            "why": f"{why} No release within reach would tell: their predictions after impact agree.",
            "states": [],
            "sigmas": [],
        }
    rows = _pick(states, differences)
    largest = differences[rows[0]]
    repeats = int(np.ceil((CLEAR / largest) ** 2))
    often = "a single one tells" if repeats == 1 else f"about {repeats} impacts there would tell"
    return {
        "why": f"{why} At these states before impact the two predictions differ by up to {largest:.2g} standard "
        f"deviations of noise and scatter in a single impact: {often}.",
        "states": [dict(zip(CHANNELS, map(_set_point, states[i]))) for i in rows],
        "sigmas": [float(differences[i]) for i in rows],
    }


def _rival(critique: Critique) -> tuple[Fit, str] | None:
    final, scan = critique.ladder[-1][1], critique.discovery.last_scan
    for step in critique.discovery.steps:
        for name in step.alternatives:
            if "impact" not in EFFECTS[name].channels and "impact" not in step.effect.channels:
                continue
            model = final.model.without(step.effect.name).with_effect(EFFECTS[name])
            kept = {k: v for k, v in final.values.items() if k in model.parameters}
            return (
                fit(model, critique.training, kept),
                f"These data cannot tell “{step.effect.title}” from “{EFFECTS[name].title}”.",
            )
    ranked = [
        name
        for name in sorted(scan.gain, key=lambda name: -scan.gain[name])
        if "impact" in EFFECTS[name].channels
    ]
    if not ranked:
        return None
    effect = EFFECTS[ranked[0]]
    return (
        fit(final.model.with_effect(effect), critique.training, final.values),
        f"Of the effects that the data do not ask for, “{effect.title}” comes nearest.",
    )


def _states(
    critique: Critique, final: Fit, rival: Fit, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Candidate states (n, 4) as in `CHANNELS`, and by how many sigmas the models differ there (n,)."""
    o = critique.observations
    rig = o.rig
    before, _ = states_at_impact(final.model, final.values, o)
    measured = np.stack([getattr(before, name) for name in CHANNELS], axis=1)
    # a release decides its first impact; the spin that bodies have after a bounce is beyond most hands and launchers
    measured = measured[np.unique(o.trial, return_index=True)[1]]
    # bodies turn many times: only the angle within a turn is a state
    measured[:, 3] = np.remainder(measured[:, 3] + np.pi, 2.0 * np.pi) - np.pi
    low, high = np.quantile(measured, [0.01, 0.99], axis=0)
    half = 0.5 * REACH * (high - low)
    low, high = 0.5 * (low + high) - half, 0.5 * (low + high) + half
    low[3], high[3] = max(low[3], -np.pi), min(high[3], np.pi)
    drawn = low + (high - low) * rng.random((DRAWS, 4))
    r = rig.shape.contact_point(drawn[:, 3])
    v_n = drawn[:, 1] + r[:, 0] * drawn[:, 2]
    seen = rig.shape.contact_point(measured[:, 3])
    slowest, fastest = np.quantile(-(measured[:, 1] + seen[:, 0] * measured[:, 2]), [0.1, 0.99])
    # a body that is dropped falls, and hits about as hard as those that were measured
    drawn = drawn[(drawn[:, 1] < 0.0) & (-v_n > slowest) & (-v_n < REACH * fastest)]
    state = State(
        x=np.full(len(drawn), np.median(before.x)),
        y=rig.height - rig.shape.contact_point(drawn[:, 3])[:, 1],
        theta=drawn[:, 3],
        vx=drawn[:, 0],
        vy=drawn[:, 1],
        omega=drawn[:, 2],
        trial=np.full(len(drawn), np.median(o.trial)),
        t=np.full(len(drawn), np.median(o.t)),
    )
    one, two = (fitted.model.predict(state, fitted.values, rig) for fitted in (final, rival))
    d = np.stack([one.vx - two.vx, one.vy - two.vy, one.omega - two.omega], axis=1)
    # the median keeps single impacts at a kink of the law from making all others look alike
    S = np.median(residual_covariance(final.model, final.values, o, o.t_std)[:, :3, :3], axis=0)
    S = S + final.sigma_m**2 * np.diag([1.0, 1.0, 1.0 / rig.k_g**2])
    difference = np.sqrt(np.maximum(np.einsum("ni,ij,nj->n", d, np.linalg.inv(S), d), 0.0))
    return drawn, np.nan_to_num(difference)


def _pick(states: np.ndarray, differences: np.ndarray) -> list[int]:
    """Rows of well separated states, largest difference first."""
    width = np.ptp(states, axis=0)
    unit = states / np.where(width > 0, width, 1.0)
    chosen: list[int] = []
    for i in np.argsort(-differences, kind="stable"):
        if len(chosen) == MOST:
            break
        if len(chosen) >= FEWEST and differences[i] < WORTHWHILE * differences[chosen[0]]:
            break
        if all(np.linalg.norm(unit[i] - unit[j]) >= APART for j in chosen):
            chosen.append(int(i))
    return chosen


def _set_point(value: float) -> float:
    """Three digits: finer than a hand or a launcher sets."""
    return float(f"{value:.3g}") + 0.0
