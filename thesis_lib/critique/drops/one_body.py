"""Refuse data that are not of one planar rigid body, and name the trials concerned.

For any contact law one rigid body satisfies two relations at each impact: its lowest point touches, and the impulse
acts there.  With a wrong size s, a displaced centre of mass d (body frame) and a wrong k² they read

    g = y + r_y − h       = −s r_y  + d · ∂g,                 ∂g = (sin θ, cos θ)
    τ = k² Δω − r × Δv    = δ k² Δω − d · ∂τ,                 ∂τ = (Δv_y c − Δv_x s, −Δv_y s − Δv_x c)

A surface that slopes by α in the picture adds α x to g, and shifts the contact point along the body, which changes τ.
Two bodies have two sets of coefficients, and each *trial* belongs to one body.  Alternating fit and assignment finds
them.  They count as two if they reduce the scatter by `shrink` and nearly every trial clearly belongs to one.  A
quantity that drifts, wears, or varies with place or angle is spread evenly instead: two sets then halve its scatter and
leave trials in between.  Noise alone is split, too, if few trials have one impact each, so data that one body explains
within the noise count as one body.

g and τ are fitted in units of their noise.  The limits (`OneBody` of the settings) were tried on every cause of
`simulate/rig/hidden_causes.py`.  De Veaux (1989) describes a mixture of regressions with one group per trial.
"""

from dataclasses import dataclass

import numpy as np

from thesis_lib.bodies.shapes import Polygon
from thesis_lib.critique.drops.settings import OneBody
from thesis_lib.critique.likelihood.observations import Observations
from thesis_lib.foundation.errors import UserError
from thesis_lib.statistics.spread import robust_std

WILD = 5.0  # standard deviations at which residuals are clipped
ROUNDS = 20
PIECES = 12  # runs of trials that are listed
TURN = 1e-4  # rad, for the change of the contact point with the angle


@dataclass(frozen=True)
class Groups:
    """A split into two bodies: mask `second` over `trials`, coefficients (2, p), scatter with one and two bodies.

    `margin` is the difference of χ² between the bodies, by trial.
    """

    trials: np.ndarray
    second: np.ndarray
    coefficients: np.ndarray
    one: float
    two: float
    margin: np.ndarray
    noise_known: bool

    def told_apart(self, limits: OneBody) -> bool:
        """Whether the data show two bodies."""
        enough = limits.smallest <= self.second.mean() <= 1.0 - limits.smallest
        explained = not self.noise_known or self.two < limits.near_noise < self.one
        sharp = np.mean(self.margin < limits.clear) <= limits.unclear and self.one > limits.shrink * self.two
        return bool(enough and explained and sharp)


def refuse_what_is_not_one_body(name: str, o: Observations, limits: OneBody) -> None:
    """Raise a UserError if the motion in `o` is not planar, or its trials are of two bodies."""
    if not len(o) or not o.space.is_plane:
        return
    gravity, stray = o.rig.gravity, o.found.noise.stray * [1.0, 1.0, o.rig.k_g]
    for value, what in ((stray[0], "sideways (x)"), (stray[2], "in rotation (theta, at the radius of gyration)")):
        if o.arcs and gravity and value > limits.sideways * gravity:
            raise UserError(
                f"{name} is not a planar free motion between impacts: in flight the body accelerates {what} by "
                f"{value:.2g} m/s² (one sigma), {value / gravity:.0%} of gravity; a body that flies in the plane of "
                "the camera does not. The body leaves its plane or tumbles out of it, x is not measured along the "
                "surface, or something holds it. Film along the surface, and keep the body in its plane."
            )
    for kind, groups in (("touch", touch_groups(o)), ("balance", balance_groups(o))):
        if groups is not None and groups.told_apart(limits):
            raise UserError(_two_bodies(name, kind, groups, o))


def _two_bodies(name: str, kind: str, groups: Groups, o: Observations) -> str:
    a, b = groups.coefficients
    sign = 1.0 if kind == "touch" else -1.0  # s, but δ = 1 − k²/k²_believed
    sizes = f"{1.0 + sign * a[0]:.3g} and {1.0 + sign * b[0]:.3g} times"
    offset = 1e3 * float(np.hypot(*(b[1:3] - a[1:3])))
    differ = f"centres of mass {offset:.2g} mm apart"
    if kind == "touch":
        what = f"at impact their centres are at different heights (sizes {sizes} that of dataset.yaml, {differ})"
    else:
        what = f"they turn differently under the same impulse (k² {sizes} that of dataset.yaml, {differ})"
    first, second = (_runs(groups.trials[mask]) for mask in (~groups.second, groups.second))
    return (
        f"{name} contains two bodies, or one that was changed: {np.sum(~groups.second)} trials (trial {first}) and "
        f"{groups.second.sum()} trials (trial {second}) each fit one body, but not the same: {what}. Two bodies leave "
        f"{groups.one / groups.two:.0f} times less scatter. Make a dataset of each group, with its own dataset.yaml; "
        "if it was the same body, the camera or the surface was moved between them."
    )


def _runs(trials: np.ndarray) -> str:
    """'0-49, 52' of ascending trial numbers; the first `PIECES` pieces."""
    ends = np.flatnonzero(np.diff(trials, append=trials[-1] + 2) != 1)
    starts = np.r_[0, ends[:-1] + 1]
    pieces = [f"{trials[i]}-{trials[j]}" if j > i else f"{trials[i]}" for i, j in zip(starts, ends)]
    return ", ".join(pieces[:PIECES]) + (", ..." if len(pieces) > PIECES else "")


def touch_groups(o: Observations) -> Groups | None:
    """Groups of trials by the heights at impact."""
    impacts = o.found.impacts
    theta = impacts.q[:, 2]
    r_x, r_y = o.rig.shape.contact_point(theta).T
    gap = impacts.q[:, 1] + r_y - o.rig.height
    std = np.ones(len(gap))
    if impacts.cov is not None:
        std = np.sqrt(impacts.cov[:, 1, 1] + r_x**2 * impacts.cov[:, 2, 2])
    if o.arcs:
        table = o.found.arcs.set_index(["trial", "impact"]).loc[list(zip(impacts.trial, impacts.impact))]
        gap, std = table["gap"].to_numpy(float), table["gap_std"].to_numpy(float)
    x = impacts.q[:, 0] - impacts.q[:, 0].mean()
    X = np.stack([-r_y, np.sin(theta), np.cos(theta), *([] if o.rig.walls else [x])], axis=1)
    return two_groups(impacts.trial, gap, X, std, o.noise_known)


def balance_groups(o: Observations) -> Groups | None:
    """Groups of trials by the balance of angular momentum."""
    impacts, k2 = o.found.impacts, o.rig.k_g**2
    theta, (dv_x, dv_y, d_omega) = impacts.q[:, 2], impacts.dv.T
    r_x, r_y = o.rig.shape.contact_point(theta).T
    couple = k2 * d_omega - r_x * dv_y + r_y * dv_x
    std = np.ones(len(couple))
    if impacts.cov is not None:
        variance = np.einsum("nii->ni", impacts.cov)
        v_x, v_y, v_omega = (variance[:, 3:6] + variance[:, 6:9]).T
        tilt = r_y * dv_y + r_x * dv_x
        std = np.sqrt(k2**2 * v_omega + r_x**2 * v_y + r_y**2 * v_x + tilt**2 * variance[:, 2])
    c, s = np.cos(theta), np.sin(theta)
    slope = [y * dv_x - x * dv_y for x, y in _slid(o, theta)]
    X = np.column_stack([k2 * d_omega, -(c * dv_y - s * dv_x), -(-s * dv_y - c * dv_x), *slope])
    return two_groups(impacts.trial, couple, X, std, o.noise_known)


def _slid(o: Observations, theta: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Shift of the contact point along the body (x, y), each (n,) in m per rad of slope of the surface.

    [] for polygons: their contact points are corners.
    """
    if isinstance(o.rig.shape, Polygon):
        return []
    behind, (x, y), ahead = (o.rig.shape.contact_point(theta + h).T for h in (-TURN, 0.0, TURN))
    turned_x, turned_y = (ahead - behind) / (2.0 * TURN)
    return [(-y - turned_x, x - turned_y)]


def two_groups(
    trial: np.ndarray, value: np.ndarray, X: np.ndarray, std: np.ndarray, noise_known: bool
) -> Groups | None:
    """Best two sets of coefficients of value (n,) on X (n, p) with noise std (n,), by trial; None: too few trials."""
    trials, of = np.unique(trial, return_inverse=True)
    if len(trials) < 2 * X.shape[1] + 4 or not np.isfinite(std).all() or (std <= 0.0).any():
        return None
    y, X = value / std, X / std[:, None]
    residual = y - X @ _fit(y, X, np.ones(len(y), bool))
    scale = float(robust_std(residual, axis=None))
    mean, size, raw = (
        np.bincount(of, values) / np.bincount(of)
        for values in (residual, np.minimum(np.abs(residual), WILD * scale), y)
    )
    number = np.arange(len(trials))
    starts = [number >= len(trials) // 2, number % 2 == 1, mean > np.median(mean), size > np.median(size)]
    starts += [raw > np.quantile(raw, share) for share in (0.3, 0.5, 0.7)]
    tries = (_alternate(trials, of, y, X, second, scale, noise_known) for second in starts)
    return min((groups for groups in tries if groups), key=lambda groups: groups.two, default=None)


def _alternate(
    trials: np.ndarray,
    of: np.ndarray,
    y: np.ndarray,
    X: np.ndarray,
    second: np.ndarray,
    scale_of_one: float,
    noise_known: bool,
) -> Groups | None:
    for _ in range(ROUNDS):
        masks = (~second[of], second[of])
        if min(mask.sum() for mask in masks) <= 2 * X.shape[1]:
            return None
        sets = [_fit(y, X, mask) for mask in masks]
        residual = np.stack([y - X @ c for c in sets])
        nearest = np.where(second[of], residual[1], residual[0])
        scale = max(float(robust_std(nearest, axis=None)), 1e-9 * scale_of_one, 1e-300)
        square = np.minimum(np.abs(residual) / scale, WILD) ** 2
        cost = np.stack([np.bincount(of, row) for row in square])
        new = cost[1] < cost[0]
        if (new == second).all():
            break
        second = new
    return Groups(trials, second, np.array(sets), scale_of_one, scale, np.abs(cost[0] - cost[1]), noise_known)


def _fit(y: np.ndarray, X: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Coefficients (p,) by least absolute values (reweighted least squares), robust to wild impacts."""
    y, X = y[rows], X[rows]
    X = X / (scale := np.sqrt(np.mean(X**2, axis=0)) + 1e-300)
    weight = np.ones(len(y))
    for _ in range(6):
        weighted = (X * weight[:, None]).T
        c = np.linalg.lstsq(weighted @ X, weighted @ y, rcond=1e-9)[0]
        distance = np.abs(y - X @ c)
        weight = 1.0 / np.maximum(distance, 0.1 * np.median(distance) + 1e-12)
    return c / scale
