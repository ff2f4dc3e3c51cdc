"""Maximum-likelihood fit of two ballistic arcs that meet at an impact, with covariance.

An impact is short (about 1 ms), so that just outside it the body flies freely: x and θ are linear and y is
parabolic in time with gravity known.  Samples have independent Gaussian noise.  All impacts are fitted at
once by Gauss-Newton; since every column of the Jacobian is a polynomial in τ on each side, the information
matrix follows from the moments Στ⁰ … Στ⁴ of the samples, and no Jacobian over samples is ever formed.

    q(t) = q_c ∓ d/2 + v∓ τ + (a∓ − (0, g, 0)) τ²/2,    τ = t − t_c        (− before, + after)
    0    = φ_n(q_c) + touch noise,      d = s |Δv| (1, 1, 1/k) u,   u ~ N(0, 1),    a∓ = stray w∓,  w∓ ~ N(0, 1)

| on paper   | in code           | unit          | shape     |                                                  |
|------------|-------------------|---------------|-----------|--------------------------------------------------|
| t_c        | `t`               | s             | (n,)      | instant of impact; may lie between samples       |
| q_c        | `q`               | m, m, rad     | (n, 3)    | pose at t_c                                      |
| v−, v+     | `v_pre`, `v_post` | m/s, rad/s    | (n, 3)    | velocities just before and after                 |
| d          |                   | m, m, rad     |           | offset between the arcs at t_c, see below        |
| s          | `spread`          | s             |           | one sigma of that offset, divided by |Δv|        |
| a−, a+     | `stray`           | m/s², rad/s²  | (3,)      | one sigma of accelerations beyond gravity        |
| σ          | `sigma`           | m, m, rad     | (3,)      | noise of each sample of x, y, θ                  |
| φ_n        | `gap`             | m             | (n,)      | distance of the body from the surface            |

Why d: impulses along different axes do not act at quite the same instant during a contact of 1 ms, so that
the arcs miss each other by a fraction of |Δv| × 1 ms.  That is nothing beside noise of 0.3 mm, but much beside
the 0.03 mm of a good tracker; with d = 0 the covariance would then be far too small.  `find_impacts` estimates
s from the data (0 where noise explains all).

Why a: air, guides and cables slow a measured body in flight.  A spin that changes by 1 rad/s between two hits
is not known to 0.1 rad/s at either of them, however good the fit of a line.  `find_impacts` estimates its size
from the arcs, too (0 where they are straight within noise).

The touch is a soft measurement with one sigma `touch_sigma`: it keeps t_c determined when |Δv| is small, and
is too weak beside 20 samples of decent noise to let a wrong surface height move the result.

Source: the idea (parabolas on either side, thesis section 3.4); the joint fit and its covariance are our own.
"""

from dataclasses import dataclass, fields

import numpy as np

from thesis_lib.datasets.format.header import Header
from thesis_lib.datasets.format.samples import ArcSettings, Samples
from thesis_lib.datasets.impacts.misfits import lines_through, misfits, norm, rank

_Q, _PRE, _POST, _U, _T = slice(0, 3), slice(3, 6), slice(6, 9), slice(9, 12), 12
_W_PRE, _W_POST = slice(13, 16), slice(16, 19)
_PARAMETERS = 19
# Steps are damped as by a prior of this sigma about the current value: it moves no converged result, but keeps
# the matrix regular where a side has no samples (such impacts are left out later).  m, m/s, -, s.
_DAMPING = np.array([10.0] * 3 + [1e3] * 3 + [1e3] * 3 + [1e6] * 3 + [1.0] + [1e6] * 6)
_SETTLE = 4  # iterations after which samples no longer change sides, so that the fit converges
_ITERATIONS = 12
_SIGNIFICANT = 4.0  # sigmas of a chi² (normal approximation): a few in 10 000 good arcs seem bent by chance
_WALK = 3  # samples by which t_c may leave where it was detected: the detector is that coarse for weak hits


@dataclass(frozen=True)
class ArcFits:
    """Two-arc fits of n detected impacts (used or not), ordered by trial and time.

    Attributes:
        at: (n,) index of the last sample before t.
        t, t_std: (n,) s, instant of impact and its standard error.
        q, v_pre, v_post: (n, 3); cov: (n, 9, 9), in the order of `impacts.STATE`, t_c marginalised.
        n_side: (n, 2) samples used before and after.
        ss: (n, 2, 3) residual sum of squares of free arcs on either side (m², m², rad²), stray acceleration
            taken off as far as its prior allows.
        ss_free, curvature: (n, 2, 3) the same with any acceleration (n_side − 3 degrees of freedom), and that
            acceleration in m/s² and rad/s²; bow2: (n, 2) s⁴, its variance is σ²/bow2 with white noise.
        chi2: (n, 2) the same in units of noise, summed over x, y, θ; 3 (n_side − 2) degrees of freedom.
        chi2_meet: (n,) rise of chi² when the free arcs are made to meet; 2 degrees of freedom.
        chi2_near: (n,) misfit of the worst of the two samples next to the impact on either side, from a line
            through the others; 3 degrees of freedom.
        chi2_rest: (n, 2) reduced chi² of the arcs without those two samples (NaN without degrees of freedom).
        fall: (n, 2) chi² by which free fall explains y better than support (no acceleration) does.
        miss, near: (n,) m, the same two misfits as distances in the kinetic metric √(x² + y² + (kθ)²).
        miss_noise: (n,) m, what noise alone gives for `miss` (root of its expected square).
        gap, gap_std: (n,) m, distance from the surface at t_c without the touch measurement.
        converged: (n,) the iteration came to rest within a few samples of the detected instant.
        lag1: (n, 3) lag-one product sum of the residuals over `ss_free`, both sides together.
    """

    at: np.ndarray
    t: np.ndarray
    t_std: np.ndarray
    q: np.ndarray
    v_pre: np.ndarray
    v_post: np.ndarray
    cov: np.ndarray
    n_side: np.ndarray
    ss: np.ndarray
    ss_free: np.ndarray
    curvature: np.ndarray
    bow2: np.ndarray
    chi2: np.ndarray
    chi2_meet: np.ndarray
    chi2_near: np.ndarray
    chi2_rest: np.ndarray
    fall: np.ndarray
    miss: np.ndarray
    miss_noise: np.ndarray
    near: np.ndarray
    gap: np.ndarray
    gap_std: np.ndarray
    converged: np.ndarray
    lag1: np.ndarray

    def __len__(self) -> int:
        return len(self.t)

    def put(self, rows: np.ndarray, other: "ArcFits") -> "ArcFits":
        """A copy whose `rows` (m indices) are those of `other`, m fits."""
        columns = {}
        for item in fields(self):
            columns[item.name] = getattr(self, item.name).copy()
            columns[item.name][rows] = getattr(other, item.name)
        return ArcFits(**columns)

    @property
    def reduced(self) -> np.ndarray:
        """Reduced chi² of the arcs (n, 2); NaN where an arc has no degrees of freedom."""
        dof = 3.0 * (self.n_side - 2)
        return np.where(dof > 0, self.chi2 / np.where(dof > 0, dof, 1.0), np.nan)


def fit_arcs(
    samples: Samples,
    at: np.ndarray,
    sigma: np.ndarray,
    header: Header,
    settings: ArcSettings,
    spread: float = 0.0,
    size: np.ndarray | None = None,
    colour: np.ndarray | float = 1.0,
    stray: np.ndarray | float = 0.0,
) -> ArcFits:
    """Fit two arcs around each detected instant.

    Args:
        samples: N poses, glitches already removed.
        at: (n,) ascending; impact i happens between samples at[i] and at[i] + 1, both of one trial.
        sigma: (3,) noise of x, y, θ in m, m, rad, all above 0.
        header: gives gravity, shape, surface height and radius of gyration.
        settings: see `ArcSettings`.
        spread: s, see the module's docstring.
        size: (n, 2) samples used at most before and after; settings.max_window if None.
        colour: (3,) factor on the variance of fitted values where the noise of neighbouring samples is
            correlated, 1 for white noise.  It enters all that is fitted, not the chi² of residuals.
        stray: (3,) one sigma of accelerations beyond gravity, m/s² and rad/s², see the module's docstring.
    """
    at = np.asarray(at, dtype=int)
    n, k_g, g = len(at), header.body.radius_of_gyration, header.gravity
    metric = np.array([1.0, 1.0, k_g])
    white = 1.0 / np.asarray(sigma, float) ** 2
    weight = white / colour
    index, inside = _windows(samples, at, settings.max_window)
    t_ref = 0.5 * (samples.t[at] + samples.t[at + 1])
    q_ref = 0.5 * (samples.q[at] + samples.q[at + 1])
    time = samples.t[index] - t_ref[:, None]  # relative values keep all digits in long records
    z = samples.q[index] - q_ref[:, None, :]
    low, high = _reach(samples, at, t_ref)
    same = samples.trial[at[1:]] == samples.trial[at[:-1]] if n else np.zeros(0, bool)

    stray = np.broadcast_to(np.asarray(stray, float), 3)
    size_p = _PARAMETERS if stray.any() else _T + 1  # without stray acceleration, w has nothing to do
    p = np.zeros((n, size_p))
    step = np.zeros((n, size_p))
    hessian = np.tile(np.eye(size_p), (n, 1, 1))
    side = np.zeros((n, 2, index.shape[1]))
    for iteration in range(_ITERATIONS):
        tau = time - p[:, _T, None]
        if iteration <= _SETTLE:
            # the neighbours' instants bound the window, too: their contact is no free flight either
            before, after = np.full(n, -np.inf), np.full(n, np.inf)
            instant = p[:, _T] + t_ref
            before[1:][same] = (instant[:-1] + settings.guard - t_ref[1:])[same]
            after[:-1][same] = (instant[1:] - settings.guard - t_ref[:-1])[same]
            usable = inside & (time > before[:, None]) & (time < after[:, None])
            side = np.stack([usable & (tau < -settings.guard), usable & (tau > settings.guard)], 1) * 1.0
            side *= rank(side) <= (settings.max_window if size is None else size[..., None])
        if iteration == 0:
            flight = z.copy()
            flight[..., 1] += 0.5 * g * tau**2
            lines = lines_through(side, tau, flight)
            p[:, _Q] = lines.value.mean(1)
            p[:, _PRE], p[:, _POST] = lines.slope[:, 0], lines.slope[:, 1]
        offset = spread * norm((p[:, _POST] - p[:, _PRE]) * metric)[:, None] / metric
        hessian, gradient = _normal_equations(p, side, tau, z, weight, g, offset, stray)
        pose = p[:, _Q] + q_ref
        r_x = header.body.shape.contact_point(pose[:, 2])[:, 0]
        gap = header.body.shape.gap(pose[:, 1], pose[:, 2], header.surface.height)
        # φ_n(q_c) = 0 ± touch_sigma, with ∂φ_n/∂q = J_n = (0, 1, r_x)
        jacobian = np.zeros((n, size_p))
        jacobian[:, 1], jacobian[:, 2] = 1.0, r_x
        hessian += jacobian[:, :, None] * jacobian[:, None, :] / settings.touch_sigma**2
        gradient -= jacobian * (gap / settings.touch_sigma**2)[:, None]
        step = np.linalg.solve(hessian, gradient[..., None])[..., 0]
        p = p + step
        p[:, _T] = np.clip(p[:, _T], low, high)
        # a step of 1e-5 sigma after the samples are settled: the next would be below rounding
        if iteration > _SETTLE and (step**2 * np.einsum("nii->ni", hessian) < 1e-10).all():
            break

    covariance = np.linalg.inv(hessian)
    passed = inside & (p[:, _T, None] >= time)
    left = np.arange(index.shape[1]) <= settings.max_window
    moved = (passed & ~left).sum(1) - (inside & left & ~passed).sum(1)
    pose = p[:, _Q] + q_ref
    gap = header.body.shape.gap(pose[:, 1], pose[:, 2], header.surface.height)
    gap_variance = np.einsum("np,npq,nq->n", jacobian, covariance, jacobian)
    # 1/var = 1/var_free + 1/touch²: undo the shrinking of the gap by the touch measurement
    share = np.clip(1.0 - gap_variance / settings.touch_sigma**2, 1e-6, 1.0)
    scale = 1.0 / np.sqrt(np.einsum("nii->ni", covariance))
    at_rest = (np.abs(step * scale) < 1e-2).all(1) & (p[:, _T] > low) & (p[:, _T] < high)
    return ArcFits(
        at=at + moved,
        t=p[:, _T] + t_ref,
        t_std=np.sqrt(covariance[:, _T, _T]),
        q=pose,
        v_pre=p[:, _PRE],
        v_post=p[:, _POST],
        cov=covariance[:, :9, :9],
        gap=gap / share,
        gap_std=np.sqrt(gap_variance / share),
        converged=at_rest,
        **misfits(side, time - p[:, _T, None], z, white, weight, metric, g, stray),
    )


def is_bent(fits: ArcFits, sigma: np.ndarray, limit: float) -> np.ndarray:
    """Mask (n, 2) of arcs that deviate from a parabola: reduced chi² above `limit`, and not by chance."""
    dof = 3.0 * np.maximum(fits.n_side - 2, 1)
    reduced = (fits.ss / np.asarray(sigma) ** 2).sum(2) / dof
    return (fits.n_side > 2) & (reduced > np.maximum(limit, 1.0 + _SIGNIFICANT * np.sqrt(2.0 / dof)))


def _windows(samples: Samples, at: np.ndarray, size: int) -> tuple[np.ndarray, np.ndarray]:
    """Indices (n, 2 size + 2) of the samples around each impact, and which are in its gap-free run."""
    last = len(samples) - 1
    index = at[:, None] + np.arange(-size, size + 2)
    inside = (index >= 0) & (index <= last)
    index = np.clip(index, 0, last)
    # each side is bounded by gaps; where a gap holds the impact itself, the two sides are different runs
    left = index <= at[:, None]
    inside &= samples.run[index] == np.where(left, samples.run[at][:, None], samples.run[at + 1][:, None])
    # a neighbouring candidate ends the window; its own two samples are sorted out by their times later
    before = np.r_[-1, at[:-1]] if len(at) else at
    after = np.r_[at[1:], last] + 1 if len(at) else at
    return index, inside & (index >= before[:, None]) & (index <= after[:, None])


def _reach(samples: Samples, at: np.ndarray, t_ref: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Bounds (n,) of t_c − t_ref: some samples either way, but within the trial and half-way to the next hit."""
    first = np.searchsorted(samples.trial, samples.trial[at], side="left")
    last = np.searchsorted(samples.trial, samples.trial[at], side="right") - 1
    half_way = at[:-1] + (np.diff(at) + 1) // 2
    low = np.maximum(np.maximum(at - _WALK, first), np.r_[0, half_way][: len(at)])
    high = np.minimum(np.minimum(at + 1 + _WALK, last), np.r_[half_way, len(samples)][: len(at)])
    # never less than the detected interval itself
    low, high = np.minimum(low, at), np.maximum(high, at + 1)
    return samples.t[low] - t_ref, samples.t[high] - t_ref


def _normal_equations(
    p: np.ndarray,
    side: np.ndarray,
    tau: np.ndarray,
    z: np.ndarray,
    weight: np.ndarray,
    gravity: float,
    offset: np.ndarray,
    stray: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Information matrix (n, P, P) and gradient (n, P) of the samples and of the priors on u and w."""
    n, size = p.shape
    sign = np.array([-0.5, 0.5])[None, :, None]
    start = p[:, None, _Q] + sign * (offset * p[:, _U])[:, None, :]
    velocity = np.stack([p[:, _PRE], p[:, _POST]], 1)
    acceleration = np.zeros((n, 2, 3))
    if size > _T + 1:
        acceleration = np.stack([p[:, _W_PRE], p[:, _W_POST]], 1) * stray
    acceleration[..., 1] -= gravity
    before, after = side[:, 0, :, None], side[:, 1, :, None]

    def on_side(value: np.ndarray) -> np.ndarray:
        return before * value[:, 0, None] + after * value[:, 1, None]

    residual = z - on_side(start) - on_side(velocity) * tau[..., None]
    residual -= on_side(acceleration) * (0.5 * tau * tau)[..., None]
    # column of parameter p on side s, component i is a + b τ + c τ²: coefficients (n, s, i, p, [a, b, c])
    order = 3 if size > _T + 1 else 2
    c = np.zeros((n, 2, 3, size, order))
    for i in range(3):
        c[:, :, i, i, 0] = 1.0
        c[:, 0, i, 3 + i, 1] = 1.0
        c[:, 1, i, 6 + i, 1] = 1.0
        c[:, :, i, 9 + i, 0] = sign[..., 0] * offset[:, None, i]
        c[:, :, i, _T, 0] = -velocity[:, :, i]  # ∂q/∂t_c = −(v + a τ)
        c[:, :, i, _T, 1] = -acceleration[:, :, i]
        if size > _T + 1:
            c[:, 0, i, 13 + i, 2] = 0.5 * stray[i]
            c[:, 1, i, 16 + i, 2] = 0.5 * stray[i]
    powers = [np.ones_like(tau)]
    for _ in range(2 * order - 2):
        powers.append(powers[-1] * tau)
    sums = side @ np.stack(powers, -1)
    moments = np.stack([sums[..., k : k + order] for k in range(order)], -1)
    weighted = (c @ moments[:, :, None]) * weight[None, None, :, None, None]
    rows = c.transpose(0, 3, 1, 2, 4).reshape(n, size, 6 * order)
    hessian = rows @ weighted.transpose(0, 1, 2, 4, 3).reshape(n, 6 * order, size)
    r = np.stack([side @ (residual * powers[k][..., None]) for k in range(order)], -1) * weight[:, None]
    gradient = (rows @ r.reshape(n, 6 * order, 1))[..., 0]
    hessian += np.diag(1.0 / _DAMPING[:size] ** 2)
    for unit in (_U, _W_PRE, _W_POST):  # u, w ~ N(0, 1)
        inner = np.arange(size)[unit]
        hessian[:, inner, inner] += 1.0
        gradient[:, inner] -= p[:, inner]
    return hessian, gradient
