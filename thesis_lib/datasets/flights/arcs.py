"""Two ballistic arcs that meet at an impact: maximum-likelihood fit to the samples, with covariance.

An impact is short (about 1 ms).  Just outside it the body flies freely: x and θ are linear in time, y is a parabola of
known gravity.  Sample i, taken at τ_i = t_i − t_c, is modelled as

    q̂_i = q_c ∓ d/2 + v∓ τ_i + (a∓ − g e_y) τ_i²/2        (− before the impact, + after it)                   (1)

Both arcs start from the pose q_c, so that they meet at t_c except for a small offset d.  Offset and stray accelerations
are random, of known size; with u and w standard normal they are

    d = s |Δv| (1, 1, 1/k) u,        a∓ = s_a w∓,        Δv = v+ − v−  (norm √(Δv_x² + Δv_y² + (k Δω)²))       (2)

The 19 unknowns of an impact, p = (q_c, v−, v+, u, t_c, w−, w+), minimise

    χ² = Σ_i ‖(q_i − q̂_i)/σ‖² + (φ_n(q_c)/s_φ)² + ‖u‖² + ‖w−‖² + ‖w+‖².                                       (3)

Between walls φ_n is the gap to the wall that is hit: the nearest wall that can push the body in the direction of Δv.
The second term requires contact with the surface at t_c, which determines t_c even if |Δv| is small; compared with 20
samples of decent noise it is too weak for a wrong surface height to affect the result.

Gauss-Newton steps δ solve H δ = b, where H is the information matrix; its inverse is the covariance of p:

    H = Σ_i A_iᵀ W A_i + J_nᵀ J_n / s_φ² + diag(prior),    b = Σ_i A_iᵀ W (q_i − q̂_i) − J_nᵀ φ_n / s_φ² − prior p,   (4)

where W = diag(1/σ²), J_n = ∂φ_n/∂q = (0, 1, r_x) and A_i = ∂q̂_i/∂p.  By (1), the columns of A_i are

    ∂/∂q_c = 1,  ∂/∂v∓ = τ,  ∂/∂u = ∓ s |Δv| (1, 1, 1/k)/2,  ∂/∂t_c = −(v∓ + (a∓ − g e_y) τ),  ∂/∂w∓ = s_a τ²/2.   (5)

Each is a polynomial c_0 + c_1 τ + c_2 τ² on its side.  The sums in (4) therefore need only the moments Σ_i τ_i^k,
k = 0 … 4, of the samples on each side, and n impacts are fitted at once without a Jacobian over samples.

Where the air bends flights visibly (`samples.air`), its effect on a path at v∓ is first subtracted from the samples,
and its slope a'(v) τ²/2 is added to ∂/∂v∓.

Reason for d: impulses along different axes do not act at the same instant of a contact of 1 ms, so the arcs miss each
other by a fraction of |Δv| × 1 ms, which is large beside the 0.03 mm of a good tracker.  Reason for a: air, guides and
cables slow a body in flight.  `find_impacts` estimates s and s_a; each is 0 if noise explains everything.

Source: parabolas on either side, thesis section 3.4.  Joint fit and covariance are our own.
"""

from dataclasses import dataclass, fields

import numpy as np

from thesis_lib.bodies.walls import gap_slopes, gaps, struck_wall
from thesis_lib.datasets.flights.lines import Windows, lines_through, sides_of, windows_around
from thesis_lib.datasets.flights.misfits import misfits
from thesis_lib.datasets.format.air import Air
from thesis_lib.datasets.format.header import Header
from thesis_lib.datasets.format.samples import ArcSettings, Samples

# slices of the unknowns in p; w is absent without stray acceleration
_Q, _PRE, _POST, _U, _T = slice(0, 3), slice(3, 6), slice(6, 9), slice(9, 12), 12
_W_PRE, _W_POST = slice(13, 16), slice(16, 19)
_PARAMETERS = 19
# Damping of steps, a prior of this sigma about the current value (m, m/s, 1, s): H stays regular without samples
_DAMPING = np.array([10.0] * 3 + [1e3] * 3 + [1e3] * 3 + [1e6] * 3 + [1.0] + [1e6] * 6)
_SETTLE = 4  # iterations after which samples keep their sides, so that the fit converges
_ITERATIONS = 12
_NEAR_A_WALL = 0.5  # extents; walls may stand elsewhere than stated in dataset.yaml
_REST = 9.0  # chi² (3 sigmas) by which rest must beat free fall to be believed
_OFTEN = 0.3  # share of impacts that end at rest; dice, which rattle to rest, have 0.24
_SIGNIFICANT = 4.0  # sigmas of a chi² (normal approximation): a few in 10 000 good arcs seem bent by chance


@dataclass(frozen=True)
class ArcFits:
    """Two-arc fits of n detected impacts (used or not), ordered by trial and time.

    Misfits refer to free arcs, which need not meet; units are m and rad; two sides: before and after.
    """

    at: np.ndarray  # (n,) index of the last sample before t
    t: np.ndarray  # t, t_std: (n,) s, instant of impact t_c (may lie between samples) and its standard error
    t_std: np.ndarray
    q: np.ndarray  # q, v_pre, v_post: (n, 3) pose at t_c, velocities just before and after, m, rad; m/s, rad/s
    v_pre: np.ndarray
    v_post: np.ndarray
    cov: np.ndarray  # (n, 9, 9) in the order of `impacts.STATE`, t_c marginalised
    n_side: np.ndarray  # (n, 2) samples used
    ss: np.ndarray  # (n, 2, 3) residual sum of squares, less what stray acceleration explains within its prior
    ss_free: np.ndarray  # (n, 2, 3) the same with any acceleration (n_side − 3 degrees of freedom)
    curvature: np.ndarray  # (n, 2, 3) that acceleration in m/s² and rad/s²
    bow2: np.ndarray  # (n, 2) s⁴; for white noise the variance of `curvature` is σ²/bow2
    chi2: np.ndarray  # (n, 2) `ss` in units of noise, summed over x, y, θ; 3 (n_side − 2) degrees of freedom
    chi2_meet: np.ndarray  # (n,) rise of chi² when the arcs are made to meet; 2 degrees of freedom
    # (n,) misfit of the worse of the two samples next to the impact from a line through the others; 3 dof
    chi2_near: np.ndarray
    chi2_rest: np.ndarray  # (n, 2) reduced chi² of the arcs without those two samples (NaN without dof)
    fall: np.ndarray  # (n, 2) chi² by which free fall explains y better than support (no acceleration) does
    # miss, near: (n,) m, misfits of chi2_meet and chi2_near as distances in the kinetic metric √(x² + y² + (kθ)²)
    miss: np.ndarray
    miss_noise: np.ndarray  # (n,) m, root of the expected square of `miss` from noise alone
    near: np.ndarray
    gap: np.ndarray  # gap, gap_std: (n,) m, distance φ_n from the surface at t_c without the touch measurement
    gap_std: np.ndarray
    at_wall: np.ndarray  # (n,) whether both arcs come near a wall; True on one surface
    converged: np.ndarray  # (n,) whether the iteration converged within a few samples of the detected instant
    lag1: np.ndarray  # (n, 3) lag-one product sum of the residuals over `ss_free`, both sides together
    surface: np.ndarray  # (n,) number of the wall in whose frame the fit is; 0 as recorded, or on one surface

    def __len__(self) -> int:
        return len(self.t)

    def put(self, rows: np.ndarray, other: "ArcFits") -> "ArcFits":
        """A copy whose `rows` (m indices) are replaced by the m fits of `other`."""
        columns = {}
        for item in fields(self):
            columns[item.name] = getattr(self, item.name).copy()
            columns[item.name][rows] = getattr(other, item.name)
        return ArcFits(**columns)

    @property
    def resting(self) -> np.ndarray:
        """Mask (n,) of impacts on one side of which the body rests, by 3 sigmas."""
        return np.logical_or(self.fall[:, 0] < -_REST, self.fall[:, 1] < -_REST)

    @property
    def flying(self) -> "ArcFits":
        """Fits without those after which the body rests, if these are too many for medians to ignore; else all fits."""
        lands = (self.fall[:, 0] > _REST) & (self.fall[:, 1] < -_REST)
        if lands.sum() <= _OFTEN * len(self):
            return self
        return ArcFits(**{item.name: getattr(self, item.name)[~lands] for item in fields(self)})

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
    *,
    spread: float = 0.0,
    size: np.ndarray | None = None,
    colour: np.ndarray | float = 1.0,
    stray: np.ndarray | float = 0.0,
) -> ArcFits:
    """Fit two arcs around each of n detected instants in `samples` without glitches, as the module explains.

    Args:
        at: (n,) ascending; impact i happens between samples at[i] and at[i] + 1, both of one trial.
        sigma: (3,) noise σ of x, y, θ in m, m, rad, all above 0.
        spread: s, one sigma in s of the arcs' offset d over |Δv|.
        size: (n, 2) largest number of samples before and after; settings.max_window if None.
        colour: (3,) factor on the variance of fitted values, above 1 for correlated noise; not in chi² of residuals.
        stray: s_a (3,), one sigma of accelerations beyond gravity, m/s² and rad/s².
    """
    at = np.asarray(at, dtype=int)
    n, g = len(at), header.gravity
    metric = np.array([1.0, 1.0, header.body.radius_of_gyration])
    white = 1.0 / np.asarray(sigma, float) ** 2
    weight = white / colour
    stray = np.broadcast_to(np.asarray(stray, float), 3)
    windows = windows_around(samples, at, settings.max_window)

    p, at_wall = np.zeros((n, _PARAMETERS if stray.any() else _T + 1)), np.ones(n, bool)
    side = np.zeros((n, 2, windows.t.shape[1]))
    step, hessian, touch = np.zeros_like(p), np.tile(np.eye(p.shape[1]), (n, 1, 1)), np.zeros_like(p)
    for iteration in range(_ITERATIONS):
        tau = windows.t - p[:, _T, None]
        if iteration <= _SETTLE:
            side = sides_of(windows, p[:, _T], settings, size)
        if iteration == 0:
            # from lines through the samples of each side, gravity removed
            flight = windows.q.copy()
            flight[..., 1] += 0.5 * g * tau**2
            lines = lines_through(side, tau, flight)
            p[:, _Q], p[:, _PRE], p[:, _POST] = lines.value.mean(1), lines.slope[:, 0], lines.slope[:, 1]
            at_wall = _reaches_a_wall(p, windows, header)
        # d of equation 2, per unit of u
        offset = spread * np.linalg.norm((p[:, _POST] - p[:, _PRE]) * metric, axis=1)[:, None] / metric
        q = _parabolas(p, tau, windows.q, samples.air, g)
        hessian, gradient = _normal_equations(p, side, tau, q, weight, g, offset, stray, samples.air)
        gap, touch = _touch(p, windows, header)
        felt = touch * at_wall[:, None]
        hessian += felt[:, :, None] * felt[:, None, :] / settings.touch_sigma**2
        gradient -= felt * (gap / settings.touch_sigma**2)[:, None]
        step = np.linalg.solve(hessian, gradient[..., None])[..., 0]
        p = p + step
        p[:, _T] = np.clip(p[:, _T], windows.low, windows.high)
        # a step of 1e-5 sigma once the samples keep their sides: the next would be below rounding
        if iteration > _SETTLE and (step**2 * np.einsum("nii->ni", hessian) < 1e-10).all():
            break

    covariance = np.linalg.inv(hessian)
    gap = _touch(p, windows, header)[0]
    gap_variance = np.einsum("np,npq,nq->n", touch, covariance, touch)
    # 1/var = 1/var_free + 1/s_φ²: undo the shrinking of the gap by the touch term
    share = np.where(at_wall, np.clip(1.0 - gap_variance / settings.touch_sigma**2, 1e-6, 1.0), 1.0)
    scale = 1.0 / np.sqrt(np.einsum("nii->ni", covariance))
    t = p[:, _T]
    tau = windows.t - t[:, None]
    q = _parabolas(p, tau, windows.q, samples.air, g)
    return ArcFits(
        at=np.minimum(at + windows.moved(t), len(samples) - 2),
        t=t + windows.t_0,
        t_std=np.sqrt(covariance[:, _T, _T]),
        q=p[:, _Q] + windows.q_0,
        v_pre=p[:, _PRE],
        v_post=p[:, _POST],
        cov=covariance[:, :9, :9],
        gap=gap / share,
        gap_std=np.sqrt(gap_variance / share),
        at_wall=at_wall,
        surface=np.zeros(len(at), int),
        converged=(np.abs(step * scale) < 1e-2).all(1) & (t > windows.low) & (t < windows.high),
        **misfits(side, tau, q, white, weight, metric, g, stray, samples.air is not None),
    )


def is_bent(fits: ArcFits, sigma: np.ndarray, limit: float) -> np.ndarray:
    """Mask (n, 2) of arcs that deviate from a parabola: reduced chi² above `limit`, and not by chance."""
    return (fits.n_side > 2) & bends((fits.ss / np.asarray(sigma) ** 2).sum(2), fits.n_side, limit)


def bends(chi2: np.ndarray, count: np.ndarray, limit: float) -> np.ndarray:
    """Whether chi² of lines through `count` samples of x, y, θ shows a bend: above `limit` per dof, not by chance."""
    dof = 3.0 * np.maximum(count - 2.0, 1.0)
    return chi2 / dof > np.maximum(limit, 1.0 + _SIGNIFICANT * np.sqrt(2.0 / dof))


def _parabolas(p: np.ndarray, tau: np.ndarray, q: np.ndarray, air: Air | None, gravity: float) -> np.ndarray:
    """Poses q (n, W, 3) without the effect of the air since the impact, at the velocities in p."""
    return q if air is None else q - air.beyond(tau, p[:, _PRE], p[:, _POST], gravity)


def _reaches_a_wall(p: np.ndarray, windows: Windows, header: Header) -> np.ndarray:
    """Mask (n,) of impacts whose arcs both come near one wall within the bounds of t_c; others hit something else."""
    walls, shape = header.surfaces, header.body.shape
    if walls is None:
        return np.ones(len(p), bool)
    pose = p[:, _Q] + windows.q_0
    ahead = gaps(walls, shape, pose + p[:, _PRE] * windows.high[:, None])
    behind = gaps(walls, shape, pose + p[:, _POST] * windows.low[:, None])
    return np.any(np.maximum(ahead, behind) < _NEAR_A_WALL * shape.extent, axis=1)


def _touch(p: np.ndarray, windows: Windows, header: Header) -> tuple[np.ndarray, np.ndarray]:
    """Gap φ_n(q_c) (n,) in m and its derivative (n, P) by p: J_n = (0, 1, r_x) at q_c, else 0."""
    pose, shape = p[:, _Q] + windows.q_0, header.body.shape
    row = np.zeros_like(p)
    if (walls := header.surfaces) is not None:
        wall = struck_wall(walls, shape, pose, p[:, _POST] - p[:, _PRE])
        row[:, _Q] = gap_slopes(walls, shape, pose, wall)
        return gaps(walls, shape, pose)[np.arange(len(p)), wall], row
    row[:, 1], row[:, 2] = 1.0, shape.contact_point(pose[:, 2])[:, 0]
    return shape.gap(pose[:, 1], pose[:, 2], header.surface.height), row


def _normal_equations(
    p: np.ndarray,
    side: np.ndarray,
    tau: np.ndarray,
    q: np.ndarray,
    weight: np.ndarray,
    gravity: float,
    offset: np.ndarray,
    stray: np.ndarray,
    air: Air | None,
) -> tuple[np.ndarray, np.ndarray]:
    """H (n, P, P) and b (n, P) of equation 4 from samples and priors, without the touch.

    `p` (n, P) are the unknowns, P = 19, or 13 without stray acceleration; `side` (n, 2, W) is 1 for the samples used
    before and after, else 0; `tau` (n, W) in s and `q` (n, W, 3) are relative to t_c and q_0; `weight` (3,) is 1/σ²,
    `gravity` in m/s², `offset` (n, 3) is s |Δv| (1, 1, 1/k), one sigma of d, and `stray` (3,) s_a.  The effect of
    `air` is already removed from `q`.
    """
    n, size = p.shape
    with_stray = size > _T + 1
    # arcs of equation 1: start q_c ∓ d/2, velocity v∓ and acceleration a∓ − g e_y, each (n, 2, 3)
    sign = np.array([-0.5, 0.5])[None, :, None]
    start = p[:, None, _Q] + sign * (offset * p[:, _U])[:, None, :]
    velocity = np.stack([p[:, _PRE], p[:, _POST]], 1)
    acceleration = np.zeros((n, 2, 3))
    if with_stray:
        acceleration = np.stack([p[:, _W_PRE], p[:, _W_POST]], 1) * stray
    acceleration[..., 1] -= gravity

    # residuals q_i − q̂_i, (n, W, 3)
    before, after = side[:, 0, :, None], side[:, 1, :, None]

    def on_side(value: np.ndarray) -> np.ndarray:
        return before * value[:, 0, None] + after * value[:, 1, None]

    residual = q - on_side(start) - on_side(velocity) * tau[..., None]
    residual -= on_side(acceleration) * (0.5 * tau * tau)[..., None]

    # equation 5: coefficients of 1, τ, τ² in ∂(x, y, θ)/∂p, (n, side, channel, P, degree)
    degrees = 3 if with_stray or air is not None else 2
    if air is not None:
        acceleration = acceleration + air.acceleration(velocity)
    c = np.zeros((n, 2, 3, size, degrees))
    for i in range(3):
        c[:, :, i, i, 0] = 1.0  # ∂/∂q_c
        c[:, 0, i, 3 + i, 1] = 1.0  # ∂/∂v−
        c[:, 1, i, 6 + i, 1] = 1.0  # ∂/∂v+
        c[:, :, i, 9 + i, 0] = sign[..., 0] * offset[:, None, i]  # ∂/∂u
        c[:, :, i, _T, 0] = -velocity[:, :, i]  # ∂/∂t_c
        c[:, :, i, _T, 1] = -acceleration[:, :, i]
        if with_stray:
            c[:, 0, i, 13 + i, 2] = 0.5 * stray[i]  # ∂/∂w−
            c[:, 1, i, 16 + i, 2] = 0.5 * stray[i]  # ∂/∂w+
    if air is not None:
        slope = 0.5 * air.slope(velocity)
        c[:, 0, :, _PRE, 2], c[:, 1, :, _POST, 2] = slope[:, 0], slope[:, 1]

    # Σ_i A_iᵀ W A_i = c M cᵀ/σ² with the moments M_kl = Σ_i τ_i^(k+l) of each side
    powers = [np.ones_like(tau)]
    for _ in range(2 * degrees - 2):
        powers.append(powers[-1] * tau)
    sums = side @ np.stack(powers, -1)
    moments = np.stack([sums[..., k : k + degrees] for k in range(degrees)], -1)
    weighted = (c @ moments[:, :, None]) * weight[None, None, :, None, None]
    rows = c.transpose(0, 3, 1, 2, 4).reshape(n, size, 6 * degrees)
    hessian = rows @ weighted.transpose(0, 1, 2, 4, 3).reshape(n, 6 * degrees, size)
    # Σ_i A_iᵀ W (q_i − q̂_i) = c Σ_i τ_i^k (q_i − q̂_i)/σ²
    r = np.stack([side @ (residual * powers[k][..., None]) for k in range(degrees)], -1) * weight[:, None]
    gradient = (rows @ r.reshape(n, 6 * degrees, 1))[..., 0]

    # damping, and the priors u, w ~ N(0, 1)
    hessian += np.diag(1.0 / _DAMPING[:size] ** 2)
    for unit in (_U, _W_PRE, _W_POST):
        columns = np.arange(size)[unit]
        hessian[:, columns, columns] += 1.0
        gradient[:, columns] -= p[:, columns]
    return hessian, gradient
