"""Mass-to-inertia ratio m/I of a measured body from single impacts, by errors in variables, for any contact law.

One impulse (c_t, c_n) at the contact point r, without a couple, changes the velocities of a planar body such that

    Δω = (m/I) L,     L = r_x Δv_y − r_y Δv_x,     m/I = 1/k².                                             (1)

Both sides are measured: regression of Δω on L is biased towards 0, of L on Δω towards infinity.  If the errors of both
sides are independent, the truth lies between the two results (Frisch).  For noise known up to a factor, maximum
likelihood over the unknown true states is, to first order in the noise,

    minimise  Σ ρ(u_i / s),    u_i = g_i / σ_i(p),    g_i = Δω_i − (m/I) L_i,    σ_i² = ∇g_i' C_i ∇g_i,     (2)

p = (m/I, parameters of the measurement hypothesis).  ρ = u² is weighted total least squares; Tukey's biweight is as
consistent under normal noise (E[∂u/∂p | u] does not depend on u) and ignores outliers.  s is the median deviation of u.
Intervals are percentiles of a bootstrap over trials.

A dataset without stated noise and without trajectories is assumed to have equal velocity noise in the kinetic metric
(σ_ω = σ_v / k with k as published, θ exact; our choice, since this ratio prefers no direction).  χ² then cannot test
(1); `lower` and `upper`, the two regressions, bound the result for any other ratio.

(1) determines only m/I × r: if body lengths are too large by a factor, m/I is too small by the same factor.

Variants are hypotheses about the measurement, named as in the critique: the camera's angle (mirrored_rotation, on or
off; angle_offset) and the contact point (rounded_corners).  Their parameters are estimated with m/I.

Sources: thesis section 2.5; W. A. Fuller, Measurement Error Models, Wiley 1987, doi 10.1002/9780470316665, sections
1.1 and 2.3; P. J. Huber, E. M. Ronchetti, Robust Statistics, Wiley 2009, doi 10.1002/9780470434697.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from scipy import stats

from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.impacts import Impacts
from thesis_lib.datasets.impacts.detect import find_impacts
from thesis_lib.datasets.impacts.quality import has_flag
from thesis_lib.effects import EFFECTS
from thesis_lib.effects.effect import Rig
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.randomness import streams
from thesis_lib.mechanics.state import State
from thesis_lib.statistics.spread import robust_std
from thesis_lib.thesis.identify.impacts.drop_spread import spreads
from thesis_lib.thesis.identify.impacts.settings import MeasuredRatio

EARLIER = "earlier_vy_post"  # planar_impact only, see `thesis_lib.datasets.sources.published`
EARLIER_VY_POST = -3.0 * 9.81 / 250.0  # m/s, first publication minus second
SMOOTH: tuple[tuple[str, ...], ...] = ((), ("mirrored_rotation",), ("mirrored_rotation", "angle_offset"))
CORNERED: tuple[tuple[str, ...], ...] = (
    (),
    ("mirrored_rotation",),
    ("angle_offset",),
    ("rounded_corners",),
    ("angle_offset", "rounded_corners"),
)
AS_PUBLISHED = "as_published"
TUKEY = 4.685  # tuning constant of the biweight: 95 % efficient for normal noise; beyond it, weights are 0
MIN_IMPACTS = 8
BENT = "arc_deviation"  # flags impacts whose arcs differ from free flight; other flags, which need k or μ, are not used
_ITERATIONS = 30
_CONVERGED = 1e-3  # standard errors
_CONVERGED_RESAMPLED = 0.05  # the same in the bootstrap: adds 0.1 % to a spread
_TURN = 1e-6  # rad, step of the finite difference of r with respect to θ
COLUMNS = (
    *("dataset", "variant", "ratio", "std", "low", "high", "published", "lower", "upper"),
    *("n", "n_left_out", "n_outliers", "scale", "velocity_noise", "chi2", "dof", "p_value"),
    *("drop_spread", "sample_spread", "d_theta", "d_theta_std", "rho", "rho_std", "status"),
)


@dataclass(frozen=True)
class RatioFit:
    """Result of fitting (2) to n impacts."""

    p: np.ndarray  # (1 + extra,) m/I in 1/m², then the parameters of the variant
    u: np.ndarray  # (n,) residuals of (1) over the noise
    sigma: np.ndarray  # (n,) standard deviation of the noise in (1), rad/s
    weight: np.ndarray  # (n,) weights of the biweight, 0 for outliers
    scale: float  # median deviation of u; 1 if the noise explains the residuals
    converged: bool


class ImpactLink:
    """Relation (1) for n impacts, under a hypothesis about the measurement.

    `variant` names effects in `SMOOTH` and `CORNERED`.

    Raises:
        UserError: poses or velocities are not finite.
    """

    def __init__(self, impacts: Impacts, rig: Rig, variant: tuple[str, ...] = ()):
        if not (np.isfinite(impacts.dv).all() and np.isfinite(impacts.q).all()):
            raise UserError("m/I cannot be estimated: poses or velocities of some impacts are not finite. Remove them.")
        self.rig = rig
        effects = [EFFECTS[name] for name in variant]
        self.free = [(e, e.parameters[0]) for e in effects if e.parameters[0].discrete is None]
        # a contact point given by the dataset refers to the dataset's angle
        self.offset = impacts.r - rig.shape.contact_point(impacts.q[:, 2])
        self.has_cov = impacts.cov is not None
        self.cov = _equal_noise(len(impacts), rig.k_g) if impacts.cov is None else impacts.cov
        self.theta = impacts.q[:, 2]
        self.dv, self.trial = impacts.dv, impacts.trial
        if "mirrored_rotation" in variant:
            sign = np.array([1.0, 1.0, -1.0] * 3)
            self.theta, self.dv = -self.theta, self.dv * sign[:3]
            self.cov = self.cov * sign * sign[:, None]
            self.offset = np.zeros_like(self.offset)

    def select(self, rows: np.ndarray) -> "ImpactLink":
        """Return the impacts at `rows`, which may repeat."""
        other = object.__new__(ImpactLink)
        other.__dict__.update(self.__dict__)
        for name in ("offset", "theta", "dv", "cov", "trial"):
            setattr(other, name, getattr(self, name)[rows])
        return other

    @property
    def start(self) -> np.ndarray:
        """Starting value of p: m/I from the medians of both sides of (1), other parameters as in the dataset."""
        extra = [parameter.null for _, parameter in self.free]
        p = np.array([0.0, *extra])
        lever, spin = self.sides(p)
        sign = np.sign(spin)
        p[0] = np.median(spin * sign) / max(np.median(lever * sign), 1e-12)
        return p

    def contact(self, p: np.ndarray, turn: float = 0.0) -> np.ndarray:
        """Contact point r (n, 2) in m, with the body rotated further by `turn` in rad."""
        effects = [(effect, {parameter.name: value}) for (effect, parameter), value in zip(self.free, p[1:])]
        theta = self.theta + turn
        zero = np.zeros_like(theta)
        state = State.planar(zero, zero, theta, zero, zero, zero, self.trial, zero)
        for effect, values in effects:
            state = effect.to_true(state, values, self.rig)
        r = self.rig.lowest(state) + self.offset.T
        for effect, values in effects:
            r = effect.contact_point(r, state, values, self.rig)
        return r.T

    def sides(self, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Lever L (n,) in m²/s and Δω (n,) in rad/s."""
        r = self.contact(p)
        return r[:, 0] * self.dv[:, 1] - r[:, 1] * self.dv[:, 0], self.dv[:, 2]

    def relation(self, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Residual g (n,) of (1) in rad/s and its gradient ∇g (n, 9) with respect to `impacts.STATE`."""
        r = self.contact(p)
        dr = (self.contact(p, _TURN) - self.contact(p, -_TURN)) / (2.0 * _TURN)
        lever, turned = (a[:, 0] * self.dv[:, 1] - a[:, 1] * self.dv[:, 0] for a in (r, dr))
        zero, ones = np.zeros(len(r)), np.ones(len(r))
        by_v = np.stack([p[0] * r[:, 1], -p[0] * r[:, 0], ones], axis=-1)
        return self.dv[:, 2] - p[0] * lever, np.column_stack([zero, zero, -p[0] * turned, -by_v, by_v])

    def residual(self, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Normalised residuals u and noise σ of (2), (n,) each."""
        g, gradient = self.relation(p)
        sigma = np.sqrt(np.einsum("ni,nij,nj->n", gradient, self.cov, gradient))
        return g / sigma, sigma


def _equal_noise(n: int, k_g: float) -> np.ndarray:
    """Covariance (n, 9, 9) up to a factor: velocities equally uncertain in the kinetic metric, poses exact."""
    speed = [1.0, 1.0, 1.0 / k_g**2]
    return np.tile(np.diag([0.0, 0.0, 0.0, *speed, *speed]), (n, 1, 1))


def fit_ratio(link: ImpactLink, start: np.ndarray | None = None, tolerance: float = _CONVERGED) -> RatioFit:
    """Minimise (2) by reweighted Gauss-Newton steps until a step is below `tolerance` standard errors.

    `start` (1 + extra,) is `link.start` by default.

    Raises:
        UserError: fewer than `MIN_IMPACTS` impacts.
    """
    if len(link.theta) < MIN_IMPACTS:
        raise UserError(
            f"m/I cannot be estimated from {len(link.theta)} impacts; at least {MIN_IMPACTS} must be measured."
        )
    p = np.array(link.start if start is None else start, dtype=float)
    low = np.array([1e-9, *(parameter.low for _, parameter in link.free)])
    high = np.array([np.inf, *(parameter.high for _, parameter in link.free)])
    step_of = np.array([1e-5 * abs(p[0]), *(1e-4 * parameter.scale for _, parameter in link.free)])
    converged = False
    for _ in range(_ITERATIONS):
        u, _ = link.residual(p)
        scale, weight = _weights(u)
        J = np.column_stack(
            [(link.residual(p + step)[0] - u) / step.sum() for step in np.diag(step_of)]
        )  # (n, 1 + extra)
        information = (J * weight[:, None]).T @ J
        step = _bounded_step(information, (J * weight[:, None]).T @ u, low - p, high - p)
        p = p + step
        if np.all(np.abs(step) * np.sqrt(np.diag(information)) < tolerance * scale):
            converged = True
            break
    u, sigma = link.residual(p)
    scale, weight = _weights(u)
    return RatioFit(p, u, sigma, weight, scale, converged)


def _bounded_step(information: np.ndarray, slope: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Newton step within bounds: parameters that would leave are set to their bound, and the others are solved for."""
    step = np.linalg.lstsq(information, -slope, rcond=None)[0]
    stopped = (step < low) | (step > high)
    if stopped.any():
        step = np.clip(step, low, high)
        rest = ~stopped
        pull = slope[rest] + information[np.ix_(rest, stopped)] @ step[stopped]
        step[rest] = np.linalg.lstsq(information[np.ix_(rest, rest)], -pull, rcond=None)[0]
        step = np.clip(step, low, high)
    return step


def _weights(u: np.ndarray) -> tuple[float, np.ndarray]:
    scale = float(robust_std(u))
    return scale, np.clip(1.0 - (u / (TUKEY * max(scale, 1e-300))) ** 2, 0.0, None) ** 2


def bootstrap(link: ImpactLink, fit: RatioFit, count: int, rng: np.random.Generator) -> np.ndarray:
    """Estimates p (count, 1 + extra) from resamplings of the trials with replacement."""
    trials, of = np.unique(link.trial, return_inverse=True)
    order = np.argsort(of, kind="stable")
    members = np.split(order, np.cumsum(np.bincount(of))[:-1])
    draws = rng.integers(len(trials), size=(count, len(trials)))
    return np.array(
        [
            fit_ratio(link.select(np.concatenate([members[i] for i in row])), fit.p, _CONVERGED_RESAMPLED).p
            for row in draws
        ]
    )


def regressions(lever: np.ndarray, spin: np.ndarray, weight: np.ndarray) -> tuple[float, float]:
    """Estimates of m/I in 1/m² by weighted regression of Δω on L, and of L on Δω; arguments (n,)."""
    cross = weight @ (lever * spin)
    return float(cross / (weight @ lever**2)), float((weight @ spin**2) / cross)


def measured_ratio(
    dataset: Dataset, rng: np.random.Generator, settings: MeasuredRatio, left_out: int = 0
) -> pd.DataFrame:
    """Table of m/I of a measured body, with a row (`COLUMNS`) per hypothesis about the measurement.

    `dataset` contains trajectories or impacts; `rng` is for the bootstrap; `left_out` is the number of impacts omitted
    when the impacts of `dataset` were found.

    Raises:
        UserError: too few impacts can be measured.
    """
    detected = find_impacts(dataset)
    bent = has_flag(detected.impacts, BENT)
    impacts = detected.impacts.select(~bent)
    left_out += int(bent.sum()) + len(detected.left_out)
    rig = Rig(dataset.shape, dataset.k_g, dataset.gravity, dataset.height)
    variants = CORNERED if EFFECTS["rounded_corners"].applies_to(rig) else SMOOTH
    stream = streams(rng)
    rows = [_row(impacts, rig, variant, stream(*variant), settings) for variant in variants]
    if dataset.name == "planar_impact":
        earlier = replace(impacts, v_post=impacts.v_post + [0.0, EARLIER_VY_POST, 0.0])
        row = _row(earlier, rig, ("mirrored_rotation",), stream(EARLIER), settings)
        rows.append(row | {"variant": f"{row['variant']}+{EARLIER}"})
    rows = [{"dataset": dataset.name, "n_left_out": left_out} | row for row in rows]
    return pd.DataFrame(rows, columns=list(COLUMNS))


def absent(name: str) -> pd.DataFrame:
    """Row of `measured_ratio` for a published set that is missing, with the command that downloads it."""
    status = f"not present; thesis-lib datasets fetch {name.replace('_', '-')} gets it"
    return pd.DataFrame([{"dataset": name, "variant": AS_PUBLISHED, "status": status}]).reindex(columns=list(COLUMNS))


def _row(
    impacts: Impacts, rig: Rig, variant: tuple[str, ...], rng: np.random.Generator, settings: MeasuredRatio
) -> dict[str, object]:
    link = ImpactLink(impacts, rig, variant)
    fit = fit_ratio(link)
    spread = bootstrap(link, fit, settings.bootstrap, rng)
    low, high = np.quantile(spread[:, 0], [0.5 * (1.0 - settings.level), 0.5 * (1.0 + settings.level)])
    inlier = fit.weight > 0.0
    chi2, dof = float(fit.u[inlier] @ fit.u[inlier]), int(inlier.sum()) - len(fit.p)
    sides = link.sides(fit.p)
    lower, upper = regressions(*sides, fit.weight / fit.sigma**2)
    row: dict[str, object] = {
        "variant": "+".join(variant) or AS_PUBLISHED,
        "ratio": fit.p[0],
        "std": spread[:, 0].std(ddof=1),
        "low": low,
        "high": high,
        "published": 1.0 / rig.k_g**2,
        "lower": lower,
        "upper": upper,
        "n": len(impacts),
        "n_outliers": int((~inlier).sum()),
        **spreads(*sides, link.trial, rng),
        "status": "ok" if fit.converged else "not converged",
    }
    if not link.has_cov:  # noise is known up to a factor, and (1) cannot be tested
        row["velocity_noise"] = fit.scale
    else:
        row |= {"scale": fit.scale, "chi2": chi2, "dof": dof, "p_value": float(stats.chi2.sf(chi2, max(dof, 1)))}
    for i, (_, parameter) in enumerate(link.free, start=1):
        row |= {parameter.name: fit.p[i], f"{parameter.name}_std": spread[:, i].std(ddof=1)}
    return row


def gather(tables: Sequence[pd.DataFrame], absent_names: Sequence[str]) -> pd.DataFrame:
    """Join tables of `measured_ratio` and the rows of missing published sets."""
    parts = [*tables, *(absent(name) for name in absent_names)]
    return pd.concat([part.dropna(axis=1, how="all") for part in parts]).reindex(columns=list(COLUMNS))
