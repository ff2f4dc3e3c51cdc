"""Propose the next releases: the most informative states just before impact.

`shows` "difference": states at which two models differ most, even after their parameters are fitted to impacts there.
They are the final model and its nearest rival: an alternative that these data cannot tell from a chosen effect, or else
the unused candidate with the largest score test.  A refitted rival follows the other model as far as it can, so a large
difference of the present predictions may mean nothing.  With the whitened difference d_i of the velocities after impact
in state i, slopes J_i of one model by its parameters, and its information I from the data at hand, impacts in the
states A add, if the other model is true,

    min_δ ½ (Σ_A |d_i − J_i δ|² + δᵀ I δ)    nats to the difference of their log scores.

States are chosen one by one, `REPEATS` impacts each; each adds most to the sum of this over either model being true
(the T-optimum of Atkinson and Fedorov 1975, doi 10.1093/biomet/62.1.57).  Whitening is by the median covariance S of
the final model's residual, scatter included.  The size reported for a state is the remaining |d_i − J_i δ|, the smaller
of the two.  Effects that are on or off are not ranked by score test: a first-order test does not hold for a step.

`shows` "misfit": an error remains that no effect explains.  The states are those around which the final model's root
mean square misfit is largest, in units of noise.

Proposed states lie within `REACH` times the range of the states before the first impacts of the measured trials.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from thesis_lib.critique.contacts.kinds import bind
from thesis_lib.critique.contacts.model import inward
from thesis_lib.critique.drops.criticise import DropsCritique
from thesis_lib.critique.drops.words import NAMED
from thesis_lib.critique.likelihood.channels import CHANNELS, FLIGHT, IMPACT
from thesis_lib.critique.likelihood.fit import SLOPE_STEP, Fit, fit
from thesis_lib.effects import EFFECTS
from thesis_lib.effects.effect import Effect, Rig
from thesis_lib.mechanics.state import State
from thesis_lib.statistics.wording import listed

DRAWS = 400
REACH = 1.3  # range of proposed states over that of measured ones
FEWEST, MOST = 3, 5
APART = 0.35  # least distance of two states in four dimensions, in widths of the ranges
LITTLE = 1e-6  # information on a parameter that the data do not determine, per square of its step
REPEATS = 4  # impacts in each state for which states are chosen
CLEAR = 3.0  # least difference in standard deviations
TOO_MANY = 10.0  # times the impacts at hand: more repeats are not proposed
WORTHWHILE = 0.5  # least difference of a further state, over the largest
CLIP = 10.0  # times the median misfit: limits the weight of a wild impact
NEIGHBOURS = 10  # measured impacts around a state over which misfits are averaged
OF_STATE = ("vx", "vy", "omega", "theta")
PLACED = (*OF_STATE, "x")  # of a state, if the place of the impact matters
CHECKS = {  # how to find a fault of the measurement without an impact
    "sensor_drift": "Film a mark that is fixed beside the surface: in the picture it moves only if the camera drifts.",
    "length_scale": "Film a ruler in the plane of motion.",
    "mirrored_rotation": "Turn the body counter-clockwise by hand and look at the sign of its angle.",
    "angle_offset": "Film the body at rest in a pose whose angle is known.",
    "marker_offset": "Turn the body about its centre by hand: the tracked point must stay where it is.",
    "time_lag": "Swing the body about a fixed pin: position and angle must turn back at the same instant.",
}
IN_SPACE = CHECKS | {  # how to check a candidate in space without an impact
    "length_scale": "Film a ruler in several directions.",
    "mirrored_rotation": "Turn the body by hand about one of its axes and look at the sign of the rotation.",
    "angle_offset": "Lay the body on one of its faces on a levelled surface and look at its measured orientation.",
    "camera_pose": "Film a plumb line: it shows the direction of gravity in the frame of the camera.",
    "lens": "Film a straight rod near the edges of the picture: it must look straight.",
    "surface_tilt": "Lay a spirit level on the surface.",
    "surface_height": "Lay the body on the surface and compare its measured height with its shape.",
    "curved_surface": "Lay a straight edge on the surface.",
    "moving_surface": "Film a mark on the surface during a hit.",
    "wrong_size": "Measure the body with a caliper.",
    "rounded_corners": "Measure the radius of the corners with a gauge.",
    "com_offset": "Balance the body on an edge to find its centre of mass.",
    "wrong_inertia": "Hang the body as a pendulum: its period shows its moment of inertia.",
    "inertia_ratios": "Hang the body as a pendulum about several axes: the periods show its moments of inertia.",
    "wrong_gravity": "Film a ruler and a clock: an error of either changes the acceleration in flight.",
}
MEASURE_IT = "Measure one of them without an impact."


def next_experiment(critique: DropsCritique, rng: np.random.Generator) -> dict:
    """Keys `why`, `states` (vx, vy in m/s, omega in rad/s, theta in rad), and `shows` and `sigmas` of the states.

    If a candidate depends on the place of the impact, states also have x in m.
    """
    if not critique.space.is_plane:
        return _in_space(critique)
    if critique.is_structured:
        return _unexplained(critique, rng)
    final = critique.ladder[-1][1]
    if critique.observations.rig.walls:
        return _nothing("Between walls no states are proposed: hit each wall slowly and fast, squarely and obliquely.")
    first_try: dict = {}
    for step in critique.discovery.steps:
        for name in step.alternatives[:NAMED] if step.clears else ():
            tried = tell_apart(critique, final, step.effect, EFFECTS[name], rng)
            if tried["states"]:
                return tried
            first_try = first_try or tried
    if first_try:
        return first_try
    gain = {
        name: gain
        for name, gain in critique.discovery.last_scan.gain.items()
        if "impact" in EFFECTS[name].channels and all(p.discrete is None for p in EFFECTS[name].parameters)
    }
    if not gain:
        return _nothing("No other effect can be tested with impacts of this rig.")
    effect = EFFECTS[max(gain, key=lambda name: gain[name])]
    rival = fit(final.model.with_effect(effect), critique.training, final.values, rounds=1)
    why = f"No other effect is needed; “{effect.title}” is the one that these data rule out least."
    return _compared(critique, final, rival, why, rng)


def _in_space(critique: DropsCritique) -> dict:
    """Checks without an impact that distinguish the first effect with alternatives from these."""
    for step in critique.discovery.steps:
        if step.clears and step.alternatives:
            names = (step.effect.name, *step.alternatives[:NAMED])
            titles = listed([f"“{EFFECTS[name].title}”" for name in names])
            checks = [IN_SPACE[name] for name in names if name in IN_SPACE]
            return _nothing(" ".join([f"These data do not decide between {titles}.", *(checks or [MEASURE_IT])]))
    return _nothing("Releases are proposed for motions in a plane only.")


def tell_apart(critique: DropsCritique, final: Fit, chosen: Effect, other: Effect, rng: np.random.Generator) -> dict:
    """States at which the `chosen` effect of the model `final` and another differ most, as from `next_experiment`."""
    kept_effects = tuple(effect for effect in final.effects if effect.name != chosen.name)
    model = replace(final.model, effects=(*kept_effects, other))
    kept = {k: v for k, v in final.values.items() if k in model.parameters}
    why = f"These data cannot tell “{chosen.title}” from “{other.title}”."
    checks = [CHECKS[effect.name] for effect in (chosen, other) if effect.name in CHECKS]
    if "impact" not in chosen.channels and "impact" not in other.channels:
        return _nothing(" ".join([why, "Neither changes an impact, so no release can tell them apart.", *checks]))
    return _compared(critique, final, fit(model, critique.training, kept), why, rng, checks)


def _compared(
    critique: DropsCritique, final: Fit, rival: Fit, why: str, rng: np.random.Generator, checks: Sequence[str] = ()
) -> dict:
    """States at which two models differ most, or the reason why there are none."""
    states, pairs = _differences(critique, final, rival, rng)
    advice = " ".join(["", *checks])
    rows, differences = _design(states, pairs)
    if not len(rows) or differences.max() <= 0:
        return _nothing(f"{why} No release within reach would decide it: their predictions after impact agree.{advice}")
    largest = differences[0]
    repeats = (CLEAR / largest) ** 2
    if repeats > TOO_MANY * len(critique.observations):
        return _nothing(
            f"{why} No release within reach would decide it: their predictions after impact differ by at most "
            f"{largest:.2g} standard deviations of noise and scatter.{advice}"
        )
    often = "a single one decides" if repeats <= 1 else f"about {int(np.ceil(repeats))} impacts there would decide"
    why = (
        f"{why} At these states before impact the two predictions differ by up to {largest:.2g} standard deviations of "
        f"noise and scatter in a single impact, whatever their parameters: {often}.{advice}"
    )
    return _proposed(why, "difference", states[rows], differences)


def _proposed(why: str, shows: str | None, states: np.ndarray, sigmas: np.ndarray) -> dict:
    # three digits are finer than a hand or a launcher sets
    set_points = [{name: float(f"{x:.3g}") + 0.0 for name, x in zip(PLACED, state)} for state in states]
    return {"why": why, "shows": shows, "states": set_points, "sigmas": sigmas.tolist()}


def _nothing(why: str) -> dict:
    return _proposed(why, None, np.zeros((0, 4)), np.zeros(0))


def _unexplained(critique: DropsCritique, rng: np.random.Generator) -> dict:
    """States around which the remaining misfit is largest."""
    final, channels = critique.ladder[-1][1], critique.misfit_channels
    why = "Something is left that no effect explains, so that no comparison of named effects is proposed."
    if critique.observations.rig.walls:
        return _nothing(why)
    if channels == (FLIGHT.name,) and not critique.is_learnable:
        return _nothing(f"{why} It is in {FLIGHT.text}: film longer flights, of bodies that turn slowly and quickly.")
    drawn, measured = _reachable(critique, final, rng)
    if not len(drawn):
        return _nothing(why)
    misfit = _misfits(critique, final, channels)
    width = np.where(np.ptp(drawn, axis=0) > 0, np.ptp(drawn, axis=0), 1.0)
    apart = drawn[:, None] - measured[None]
    apart[..., 3] = _within_a_turn(apart[..., 3])
    near = np.argsort(np.sum((apart / width) ** 2, axis=2), axis=1, kind="stable")[:, :NEIGHBOURS]
    nearby = np.sqrt(np.mean(misfit[near] ** 2, axis=1))
    rows = _pick(drawn, nearby)
    when = set(critique.remaining.depends_on) & {"trial", "t"} if critique.is_learnable else set()
    repeat = "Repeat one of them from the first trial to the last, too: the remaining error depends on the time."
    why = (
        f"{why} The misfit is largest around these states before impact, up to {nearby[rows[0]]:.2g} times what noise "
        "would give: measure each several times, to see what repeats." + f" {repeat}" * bool(when)
    )
    return _proposed(why, "misfit", drawn[rows], nearby[rows])


def _misfits(critique: DropsCritique, final: Fit, channels: tuple[str, ...]) -> np.ndarray:
    """Root mean square residual (n,) of each impact in units of noise, over the misfitted `channels`."""
    o = critique.observations
    R = final.on(o).R
    std = np.sqrt(np.einsum("nii->ni", final.on(o).covariance(o.t_std)))
    if not o.noise_known:  # the scatter replaces the unknown noise
        std = np.ones_like(std) * np.maximum(np.std(R, axis=0), 1e-12)
    columns = {name: CHANNELS[name].columns(o.space) for name in (*channels, IMPACT.name)}
    used = [columns[name] for name in channels if columns[name]] or [columns[IMPACT.name]]
    z = np.concatenate([(R / std)[:, part] for part in used], axis=1)
    return np.minimum(np.sqrt(np.mean(z**2, axis=1)), CLIP * np.sqrt(np.mean(np.median(z**2, axis=0))))


@dataclass(frozen=True)
class _Refit:
    """Data of a refit to differences: whitened d (n, 3) in n states, slopes J (n, 3, p), information (p, p)."""

    d: np.ndarray
    J: np.ndarray
    information: np.ndarray

    def best(self, rows: Sequence[int]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """δ (p,) after `REPEATS` impacts in each of the states `rows`, and the sums Σ JᵀJ + I and Σ Jᵀd behind it."""
        J, d = self.J[list(rows)], self.d[list(rows)]
        M = self.information + REPEATS * np.einsum("nij,nik->jk", J, J)
        b = REPEATS * np.einsum("nij,ni->j", J, d)
        return np.linalg.solve(M, b), M, b

    def gains(self, rows: Sequence[int]) -> np.ndarray:
        """Nats (n,) that the states `rows` and one more would add."""
        _, M, b = self.best(rows)
        M = M + REPEATS * np.einsum("nij,nik->njk", self.J, self.J)
        b = b + REPEATS * np.einsum("nij,ni->nj", self.J, self.d)
        squares = REPEATS * (np.sum(self.d[list(rows)] ** 2) + np.sum(self.d**2, axis=1))
        return 0.5 * (squares - np.einsum("nj,nj->n", b, np.linalg.solve(M, b[..., None])[..., 0]))

    def left(self, rows: Sequence[int]) -> np.ndarray:
        """|d − J δ| in the states `rows`."""
        delta, *_ = self.best(rows)
        return np.linalg.norm(self.d[list(rows)] - self.J[list(rows)] @ delta, axis=1)


def _differences(
    critique: DropsCritique, final: Fit, rival: Fit, rng: np.random.Generator
) -> tuple[np.ndarray, tuple[_Refit, ...]]:
    """Candidate states (n, 4 or 5) as in `PLACED`, and there the rival's refit to the final model, and the reverse."""
    o = critique.observations
    rig = o.rig
    drawn, _ = _reachable(critique, final, rng)
    before = final.on(o).before
    x, trial, t = (np.full(len(drawn), np.median(values)) for values in (before.x, o.trial, o.t))
    y = rig.height - rig.shape.contact_point(drawn[:, 3])[:, 1]
    state = State.of(np.column_stack([x, y, drawn[:, 3]]), drawn[:, :3], trial, t)
    if any(_depends_on_place(fitted, state, before, rig) for fitted in (final, rival)):
        low, high = np.quantile(before.x[np.unique(o.trial, return_index=True)[1]], [0.01, 0.99])
        state = state.moved(x=low + (high - low) * rng.random(len(drawn)))
        drawn = np.column_stack([drawn, state.x])
    # a median, because single impacts at a kink of the law would dominate a mean
    S = np.median(final.on(o).covariance(o.t_std)[:, :3, :3], axis=0)
    S = S + final.sigma_m**2 * np.diag([1.0, 1.0, 1.0 / rig.k_g**2])
    whiten = np.linalg.inv(np.linalg.cholesky(S)).T
    made = [_slopes(fitted, state, rig) for fitted in (final, rival)]
    usable = np.all([np.isfinite(v).all(axis=1) & np.isfinite(J).all(axis=(1, 2)) for v, J, _ in made], axis=0)
    refits = [
        _Refit((other - v)[usable] @ whiten, np.einsum("nij,ik->nkj", J[usable], whiten), information)
        for (other, *_), (v, J, information) in (made, made[::-1])
    ]
    return drawn[usable], tuple(refits)


def _depends_on_place(fitted: Fit, state: State, measured: State, rig: Rig) -> bool:
    """Whether the velocity after impact depends on where on the surface the body lands."""
    places = (state.moved(x=np.full_like(state.x, x)) for x in np.quantile(measured.x, [0.1, 0.5, 0.9]))
    made = np.stack([bind(fitted.model, fitted.values, rig).predict(place).v for place in places])
    return bool(np.ptp(np.nan_to_num(made), axis=0).max(initial=0.0) > 0.0)


def _slopes(fitted: Fit, state: State, rig: Rig) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Velocities after impact (n, 3), their slopes (n, 3, p) by the parameters in standard errors, and I (p, p)."""
    model, values, std = fitted.model, fitted.values, np.sqrt(np.diag(fitted.covariance))
    free = model.fitted_parameters
    # over a standard error, so that a kink between sticking and sliding counts as far as the parameters reach it
    sizes = [float(np.clip(h, SLOPE_STEP * p.scale, p.scale)) for p, h in zip(free.values(), std)]
    steps = [inward(p, values[name], h) for (name, p), h in zip(free.items(), sizes)]
    v = bind(model, values, rig).predict(state).v
    moved = [bind(model, {**values, name: values[name] + h}, rig).predict(state).v for name, h in zip(free, steps)]
    J = np.stack([(one - v) / np.sign(h) for one, h in zip(moved, steps)], axis=2)
    covariance = fitted.covariance / np.outer(sizes, sizes)
    return v, J, np.linalg.pinv(covariance, hermitian=True) + LITTLE * np.eye(len(sizes))


def _design(states: np.ndarray, refits: Sequence[_Refit]) -> tuple[np.ndarray, np.ndarray]:
    """Rows of the states to measure (k,), and remaining differences in standard deviations (k,), largest first."""
    width = np.ptp(states, axis=0) if len(states) else np.ones(states.shape[1])
    unit = states / np.where(width > 0, width, 1.0)
    chosen: list[int] = []
    free = np.ones(len(states), bool)
    while free.any() and len(chosen) < MOST:
        gain = np.where(free, sum(refit.gains(chosen) for refit in refits), -np.inf)
        chosen.append(int(gain.argmax()))
        free &= np.linalg.norm(unit - unit[chosen[-1]], axis=1) >= APART
    if not chosen:
        return np.zeros(0, int), np.zeros(0)
    left = np.min([refit.left(chosen) for refit in refits], axis=0)
    order = np.argsort(-left, kind="stable")
    rows, left = np.array(chosen)[order], left[order]
    keep = max(FEWEST, int(np.sum(left >= WORTHWHILE * left[0])))
    return rows[:keep], left[:keep]


def _within_a_turn(theta: np.ndarray) -> np.ndarray:
    return np.remainder(theta + np.pi, 2.0 * np.pi) - np.pi


def _reachable(critique: DropsCritique, final: Fit, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """States in reach of the rig (n, 4), drawn evenly, and those of the measured impacts (m, 4), as in `OF_STATE`."""
    o = critique.observations
    rig = o.rig
    before = final.on(o).before
    measured = np.stack([getattr(before, name) for name in OF_STATE], axis=1)
    # a release sets its first impact only; the spin after a bounce is beyond most hands and launchers
    first = measured[np.unique(o.trial, return_index=True)[1]]
    first[:, 3] = _within_a_turn(first[:, 3])
    low, high = np.quantile(first, [0.01, 0.99], axis=0)
    half = 0.5 * REACH * (high - low)
    low, high = 0.5 * (low + high) - half, 0.5 * (low + high) + half
    low[3], high[3] = max(low[3], -np.pi), min(high[3], np.pi)
    drawn = low + (high - low) * rng.random((DRAWS, 4))
    r = rig.shape.contact_point(drawn[:, 3])
    v_n = drawn[:, 1] + r[:, 0] * drawn[:, 2]
    r_of_first = rig.shape.contact_point(first[:, 3])
    slowest, fastest = np.quantile(-(first[:, 1] + r_of_first[:, 0] * first[:, 2]), [0.1, 0.99])
    # a dropped body hits about as hard as the measured ones
    drawn = drawn[(drawn[:, 1] < 0.0) & (-v_n > slowest) & (-v_n < REACH * fastest)]
    return drawn, measured


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
