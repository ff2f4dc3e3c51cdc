"""Mirtich: incremental friction along the impulse path with Stronge's energetic restitution.

W(p) = ∫ v_n dp is the work of the normal impulse, W_c < 0 at maximum compression.  The impact ends when restitution
has returned the work ε² |W_c|, that is, at W = (1 − ε²) W_c.

As defined, on the path of Coulomb's law (slip_path.py):
    the first slip lasts to the end       c_n = (1 + ε) p_c
    it ends before, at p_s with v_n = u   c_n = p_s + (−u + √(u² + 2 b₂ ((1 − ε²) W_c − W_s))) / b₂,
                                          W_s = v_n p_s + b p_s²/2,
                                          W_c = W_s − u²/(2 b₂) if u < 0 (in compression), else −v_n²/(2 b).

In space the direction of slip turns along the path (slip_hodograph.py).

As published (the authors' code): the tangential rate is *viscous*, dc_t/dp = −μ v_t instead of −μ sign(v_t), and
μ has the unit s/m.  With κ = μ K_tt the slip is v_t(p) = v_t φ₀ + K_tn φ₁, φ₀ = exp(−κ p), φ_{i+1} = ∫ φ_i dp.

Sources: Mirtich, PhD thesis, Berkeley 1996; Stronge, Proc. R. Soc. A 431 (1990), doi:10.1098/rspa.1990.0125;
thesis section 3.3.2.
"""

from collections.abc import Callable

import numpy as np

from thesis_lib.contact import slip_hodograph
from thesis_lib.contact.law import Law, Promise
from thesis_lib.contact.slip_path import slip_path, tangential_impulse
from thesis_lib.mechanics.contact import Contact

SERIES_BELOW = 1e-3  # in κp: four terms of the series are then exact to rounding
EPS = np.finfo(float).eps
MAX_STEPS = 100  # Newton needs about 8; bisection alone would need 50 to reach rounding error
RELATIVE_STEP = 1e-11  # relative to the unknown, above most rounding errors; Newton's step squares the error


def impulse(
    space: Contact, mu: np.ndarray, epsilon: np.ndarray, mu_after: np.ndarray | None = None
) -> tuple[np.ndarray, ...]:
    """Impulse (c_t, c_n) or (c_t1, c_t2, c_n), each (n,) in N s, at the end of restitution.

    `mu_after` is explained in `slip_path`.
    """
    if space.dimension == 3:
        return slip_hodograph.impulse(space, mu, epsilon, slip_hodograph.Restitution.STRONGE, mu_after)
    path = slip_path(space, mu, mu_after)
    p, u = path.p_slip, path.v_slip
    c_n = (1.0 + epsilon) * path.p_c
    slip_ends = p < c_n
    # after the first slip: v_n = u + b₂ d and W = W_s + u d + b₂ d²/2 at p = p_s + d
    W_s = p * (space.v_n + 0.5 * path.b * p)
    in_compression = u < 0.0
    half_u2 = 0.5 * u * u
    W_c = np.where(in_compression, W_s - half_u2 / path.b2, space.v_n * space.v_n / (-2.0 * path.b))
    # v_n at the end, b₂ (c_n − p_s) + u; equals ε √(−2 b₂ W_c) if slip ends in compression
    gained = np.where(in_compression, -epsilon * epsilon * W_c, (1.0 - epsilon * epsilon) * W_c - W_s)
    v_end = np.sqrt(2.0 * np.maximum(path.b2 * gained + np.where(in_compression, 0.0, half_u2), 0.0))
    c_n = np.where(slip_ends, p + (v_end - u) / path.b2, c_n)
    return tangential_impulse(path, c_n), c_n


def impulse_as_published(space: Contact, mu: np.ndarray, epsilon: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Impulse (c_t, c_n), each (n,) in N s, by the authors' code: viscous tangential rate; μ in s/m."""
    kappa = mu * space.K_tt

    def integrals(p: np.ndarray, count: int) -> list[np.ndarray]:
        # φ₀ = e^{−κp} and its first `count` repeated integrals over p; by power series where κp is small
        x = kappa * p
        lost = np.expm1(-x)
        phi = [1.0 + lost]
        with np.errstate(divide="ignore", invalid="ignore"):
            for part in (-lost, p, 0.5 * p * p)[:count]:
                phi.append((part - phi[-1] if len(phi) > 1 else part) / kappa)
        if np.any(small := x < SERIES_BELOW):
            x, p = x[small], np.broadcast_to(p, small.shape)[small]
            x2 = x * x
            x3 = x2 * x
            phi[1][small] = p * (1 - x / 2 + x2 / 6 - x3 / 24)
            phi[2][small] = p * p * (1 / 2 - x / 6 + x2 / 24 - x3 / 120)
            if count > 2:
                phi[3][small] = p * p * p * (1 / 6 - x / 24 + x2 / 120 - x3 / 720)
        return phi

    def slip(v_t: np.ndarray, p: np.ndarray, orders: tuple[int, ...]) -> list[np.ndarray]:
        # slip that starts at v_t: v_t(p) = v_t φ₀ + K_tn φ₁ (order 0), its integral (1), its double integral (2)
        phi = integrals(p, orders[-1] + 1)
        return [v_t * phi[i] + space.K_tn * phi[i + 1] for i in orders]

    def v_n(p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        v_t, slid = slip(space.v_t, p, (0, 1))
        return space.v_n + space.K_nn * p - mu * space.K_tn * slid, space.K_nn - mu * space.K_tn * v_t

    frictionless = -space.v_n / space.K_nn
    p_c = increasing_root(v_n, 0.0 * (frictionless + kappa), frictionless + 0.0 * kappa)
    v_c, slid, slid_twice = slip(space.v_t, p_c, (0, 1, 2))
    W_c = p_c * (space.v_n + 0.5 * space.K_nn * p_c) - mu * space.K_tn * slid_twice

    # integrate restitution from p_c, where v_n = 0: from p = 0, rounding would hide a small ε
    def missing_work(d: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        slid, slid_twice = slip(v_c, d, (1, 2))
        work = 0.5 * space.K_nn * d * d - mu * space.K_tn * slid_twice + epsilon * epsilon * W_c
        return work, space.K_nn * d - mu * space.K_tn * slid

    d = increasing_root(missing_work, 0.0 * (p_c + epsilon), epsilon * p_c, EPS * p_c)
    return -mu * (slid + slip(v_c, d, (1,))[0]), p_c + d


LAW = Law(
    name="mirtich",
    title="Mirtich",
    impulse=impulse,
    promises=frozenset(Promise),
    dimensions=frozenset({2, 3}),
    breaks_in_space={Promise.STICKS: 0.00133},  # turning slip can outlast the impact
    reference="Mirtich 1996; Stronge 1990, doi:10.1098/rspa.1990.0125",
)

LAW_AS_PUBLISHED = Law(
    name="mirtich_as_published",
    title="Mirtich (as published)",
    impulse=impulse_as_published,
    promises=frozenset({Promise.NON_PENETRATION, Promise.NO_ENERGY_GAIN, Promise.FRICTIONLESS, Promise.PLASTIC}),
    breaks={
        Promise.FRICTION_CONE: 0.192,
        Promise.HOMOGENEOUS: 1.0,
        Promise.CENTRAL: 0.978,
        Promise.STICKS: 1.0,  # the remaining slip falls only as 1/μ
    },
    reference="authors' code, github.com/mcubelab/planar-impact-dataset",
    mu_unit="s/m",
)


def increasing_root(
    function: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]],
    low: np.ndarray,
    start: np.ndarray,
    floor: float | np.ndarray = 0.0,
) -> np.ndarray:
    """Roots (n,) above `low` of functions that are negative before and positive after their root; NaN where not found.

    `function` returns values and slopes, each (n,).  A step smaller than `floor` ends the search.
    """
    p, high = start, np.full(np.shape(start), np.inf)
    for _ in range(MAX_STEPS):
        f, slope = function(p)
        low, high = np.where(f < 0.0, p, low), np.where(f < 0.0, high, p)
        newton = p - f / slope
        inside = (newton >= low) & (newton <= high)
        middle = np.where(np.isfinite(high), 0.5 * (low + high), 2.0 * p)
        step = np.where(f == 0.0, 0.0, np.where(inside, newton, middle) - p)
        p = p + step
        moved = np.abs(step) > RELATIVE_STEP * p + floor
        if not np.any(moved):
            return p
    return np.where(moved, np.nan, p)  # becomes NO_SOLUTION
