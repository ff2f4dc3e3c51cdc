"""Coulomb's law along the path of an impact in space, where the direction of slip turns (Routh, Darboux, Keller).

With the normal impulse p as "time" the slip x and the normal velocity of the contact point move by

    dx/dp = k − μ K_tt x/|x|,    v_n = v_n0 + α·(x − x_0) + S p,    α = K_tt⁻¹ k,  S = K_nn − k·α,

until the impact ends, or slip does.  Slip that has ended sticks, dc/dp = −α, if |α| ≤ μ, else it goes on in the one
direction in which it grows (`circular_cone`); from there on all is straight, and in closed form.

While it slips with g = dV/dp, V = |x|, and turns with dθ/dp = f/V, a Runge-Kutta step of order 4 is as long as x
allows: a turn by 0.1 rad, or a quarter of the slip.  Slip is straight once its direction keeps itself (f = 0) and, if
it does so only nearly, is drawn to it; the plane is the case in which it is straight from the beginning.  So no slip
has to be regularised: sticking is exact, and the impulse is homogeneous in the velocity.  In random impacts the impulse
is off by 1e-7 of the contact speed in the median, 1.4e-4 at most; 28 steps are made on average, 240 at most.

The impact ends at p_f, with p_c at the end of compression, v_n = 0:

| restitution | ends where                               |
|-------------|------------------------------------------|
| Newton's    | v_n = −ε v_n0                            |
| Poisson's   | p = (1 + ε) p_c                          |
| Stronge's   | ∫ v_n dp from p_c = ε² times that before |

Sources: Routh, Dynamics of a System of Rigid Bodies, 1860; Keller, J. Appl. Mech. 53 (1986), doi:10.1115/1.3171712;
Bhatt and Koechling, J. Appl. Mech. 62 (1995), p. 893; Stronge, Proc. R. Soc. A 431 (1990),
doi:10.1098/rspa.1990.0125.
"""

import enum
from dataclasses import dataclass

import numpy as np

from thesis_lib.contact.circular_cone import cone_point, principal
from thesis_lib.mechanics.contact import Contact

STEPS = 240
TURN = 0.1  # rad a step: what the errors above belong to; they fall with its fourth power
SHORTER = 0.4  # of that turn, by which slip may change instead: a quarter of it
KEPT_DIRECTION = 1e-13  # of the rates: rounding, as that of an impact in a plane
LEFT_TO_TURN = 1e-10  # rad
NO_SLIP = 1e-12  # of the contact speed
REFINEMENTS = 40  # Newton steps, bracketed, to the end of a phase within a step; some 4 are needed
FOUND = 1e-11  # of the step; Newton squares it


class Restitution(enum.StrEnum):
    """What ends an impact."""

    NEWTON = "v_n = −ε v_n0"
    POISSON = "p = (1 + ε) p_c"
    STRONGE = "W = (1 − ε²) W_c"


@dataclass
class _Paths:
    """N impacts, vectors (2, N) in principal axes of K_tt: what stays, then where each stands."""

    k: np.ndarray
    κ: np.ndarray  # principal values of K_tt
    friction: np.ndarray  # μ κ
    α: np.ndarray
    S: np.ndarray
    C: np.ndarray  # v_n = α·x + S p + C
    ε: np.ndarray
    v_n0: np.ndarray
    x: np.ndarray  # slip
    p: np.ndarray
    W: np.ndarray  # ∫ v_n dp within the phase
    p_c: np.ndarray  # NaN in compression
    W_c: np.ndarray

    def __getitem__(self, rows: np.ndarray) -> "_Paths":
        return _Paths(*(array[..., rows] for array in vars(self).values()))

    def put(self, rows: np.ndarray, other: "_Paths") -> None:
        """Where the impacts at `rows` stand, as `other` has it."""
        for name in ("x", "p", "W", "p_c", "W_c"):
            getattr(self, name)[..., rows] = getattr(other, name)

    def v_n(self, x: np.ndarray, p: np.ndarray) -> np.ndarray:
        return self.α[0] * x[0] + self.α[1] * x[1] + self.S * p + self.C

    def rate(self, x: np.ndarray) -> np.ndarray:
        """dx/dp (2, N)."""
        return self.k - self.friction * (x / np.sqrt(x[0] * x[0] + x[1] * x[1]))

    def b(self, rate: np.ndarray) -> np.ndarray:
        """dv_n/dp (N,)."""
        return self.α[0] * rate[0] + self.α[1] * rate[1] + self.S

    def stepped(self, h: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Slip, p and W after the normal impulse h (N,)."""
        x, half = self.x, 0.5 * h
        r1 = self.rate(x)
        r2 = self.rate(x + half * r1)
        r3 = self.rate(x + half * r2)
        r4 = self.rate(x + h * r3)
        middle = r2 + r3
        # ∫ v_n dp by the same stages; S p is exact
        v_n = self.v_n(x + (h / 6.0) * (r1 + middle), self.p + half)
        return x + (h / 6.0) * (r1 + 2.0 * middle + r4), self.p + h, self.W + h * v_n

    def missing(self, rule: Restitution, x: np.ndarray, p: np.ndarray, W: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What is negative until the phase ends, and its derivative by p."""
        v_n, b = self.v_n(x, p), self.b(self.rate(x))
        match rule:
            case Restitution.NEWTON:
                value, slope = v_n + self.ε * self.v_n0, b
            case Restitution.POISSON:
                value, slope = p - (1.0 + self.ε) * self.p_c, np.ones_like(p)
            case Restitution.STRONGE:
                value, slope = W + self.ε * self.ε * self.W_c, v_n
        compression = np.isnan(self.p_c)
        return np.where(compression, v_n, value), np.where(compression, b, slope)


@np.errstate(all="ignore")  # what has no finite end is not finite
def impulse(
    contact: Contact, mu: np.ndarray, epsilon: np.ndarray, rule: Restitution, mu_after: np.ndarray | None = None
) -> tuple[np.ndarray, ...]:
    """Impulse (c_t1, c_t2, c_n), each (n,) in N s, at the end of restitution.

    `mu_after` (n,) is the coefficient once the first slip has ended, `mu` (n,) if not given.
    """
    K, v = contact.K, contact.v
    mu_after = mu if mu_after is None else mu_after
    parts = np.broadcast_arrays(mu, epsilon, mu_after, *v, K[0][0], K[0][1], K[1][1], K[0][2], K[1][2], K[2][2])
    shape = parts[0].shape
    μ, ε, μ_after, v_1, v_2, v_n, K_11, K_12, K_22, k_1, k_2, K_nn = (part.ravel() for part in parts)
    axes = principal(K_11, K_12, K_22)
    κ = np.stack([axes.first, axes.second])
    k, x = np.stack(axes.into((k_1, k_2))), np.stack(axes.into((v_1, v_2)))
    α, zero = k / κ, np.zeros_like(v_n)
    C = v_n - (α * x).sum(axis=0)
    S = K_nn - (k * α).sum(axis=0)
    paths = _Paths(k, κ, μ * κ, α, S, C, ε, v_n, x.copy(), zero, zero.copy(), zero + np.nan, zero + np.nan)
    ended = _slip(paths, rule)
    c, c_n = _straight(paths, x, μ_after, rule)
    slid = (paths.x - x - k * paths.p) / κ
    c, c_n = np.where(ended, slid, c), np.where(ended, paths.p, c_n)
    return tuple(part.reshape(shape) for part in (*axes.back((c[0], c[1])), c_n))


def _slip(paths: _Paths, rule: Restitution) -> np.ndarray:
    """Follow the first slip until it is straight, or the impact ends; whether the impact has ended (N,)."""
    ended = np.zeros(len(paths.p), dtype=bool)
    speed = np.hypot(np.hypot(*paths.x), paths.v_n0)
    rows = np.arange(len(ended))
    for _ in range(STEPS):
        now = paths[rows]
        V = np.hypot(*now.x)
        u_1, u_2 = now.x / V
        r_1, r_2 = now.rate(now.x)
        g, f = u_1 * r_1 + u_2 * r_2, u_1 * r_2 - u_2 * r_1
        # df/dθ: negative where the direction is drawn to the one that keeps itself
        drawn = -g - now.friction[0] * u_2 * u_2 - now.friction[1] * u_1 * u_1
        rates = np.hypot(*now.k) + now.friction[0]
        straight = (np.abs(f) <= KEPT_DIRECTION * rates) | ((drawn < 0.0) & (np.abs(f) <= LEFT_TO_TURN * -drawn))
        turns = (NO_SLIP * speed[rows] < V) & ~straight  # NaN does not turn
        rows, now = rows[turns], now[turns]
        if not len(rows):
            break
        h = TURN * V / np.maximum(np.abs(f), SHORTER * np.maximum(np.abs(g), np.abs(drawn)))
        now.x, now.p, now.W, over = _step(now, h[turns], rule)
        compressed = over & np.isnan(now.p_c)
        now.W_c, now.p_c = np.where(compressed, now.W, now.W_c), np.where(compressed, now.p, now.p_c)
        now.W = np.where(compressed, 0.0, now.W)
        paths.put(rows, now)
        ends = over & ~(compressed & (now.ε > 0.0))
        ended[rows[ends]] = True
        rows = rows[~ends]
    return ended


def _step(paths: _Paths, h: np.ndarray, rule: Restitution) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Slip, p and W after a step of h (N,), or where the phase ends within it, and whether it does (N,)."""
    x, p, W = paths.stepped(h)
    over = paths.missing(rule, x, p, W)[0] >= 0.0
    rows = np.flatnonzero(over)
    low, high, step = np.zeros_like(h), h.copy(), h.copy()
    for _ in range(REFINEMENTS):
        if not len(rows):
            break
        now = paths[rows]
        value, slope = now.missing(rule, x[:, rows], p[rows], W[rows])
        early, at = value < 0.0, step[rows]
        low[rows], high[rows] = np.where(early, at, low[rows]), np.where(early, high[rows], at)
        newton = at - value / slope
        inside = (newton >= low[rows]) & (newton <= high[rows])
        step[rows] = np.where(inside, newton, 0.5 * (low[rows] + high[rows]))
        x[:, rows], p[rows], W[rows] = now.stepped(step[rows])
        rows = rows[np.abs(step[rows] - at) > FOUND * h[rows]]
    return x, p, W, over


def _straight(paths: _Paths, x_0: np.ndarray, mu_after: np.ndarray, rule: Restitution) -> tuple[np.ndarray, np.ndarray]:
    """Tangential (2, N) and normal (N,) impulse at the end of paths that are straight from where they stand."""
    k, κ = paths.k, paths.κ
    V = np.hypot(*paths.x)
    slips = V > 0.0
    u = np.where(slips, paths.x / V, 0.0)
    # the rest of the first slip: for the normal impulse L, with dV/dp = g and dv_n/dp = b; then b_2
    rate = k - paths.friction * u
    g, b = np.where(slips, (u * rate).sum(axis=0), -1.0), np.where(slips, paths.b(rate), 1.0)
    L = np.where(g < 0.0, V / -g, np.inf)
    slope_2 = np.stack(cone_point((κ[0], κ[1]), (k[0], k[1]), mu_after))
    b_2 = paths.b(k + κ * slope_2)
    # compression, if it has not ended
    v, compression = paths.v_n(paths.x, paths.p), np.isnan(paths.p_c)
    v_L = v + b * L
    in_first = v_L >= 0.0
    W_c = paths.W + np.where(in_first, v * v / (-2.0 * b), L * (v + 0.5 * b * L) - v_L * v_L / (2.0 * b_2))
    d = np.where(compression, np.where(in_first, v / -b, L - v_L / b_2), 0.0)
    p_c, W_c = np.where(compression, paths.p + d, paths.p_c), np.where(compression, W_c, paths.W_c)
    # restitution from there: v_n = v, the first slip lasts on for L − d
    v, W = np.where(compression, 0.0, v), np.where(compression, 0.0, paths.W)
    rest = np.maximum(L - d, 0.0)
    v_L = v + b * rest
    match rule:
        case Restitution.NEWTON:
            wanted = -paths.ε * paths.v_n0
            more = np.where(v_L >= wanted, (wanted - v) / b, rest + (wanted - v_L) / b_2)
        case Restitution.POISSON:
            more = (1.0 + paths.ε) * p_c - (paths.p + d)
        case Restitution.STRONGE:
            work = -paths.ε * paths.ε * W_c - W
            first, left = _until(work, v, b), work - rest * (v + 0.5 * b * rest)
            more = np.where((first >= 0.0) & (first <= rest), first, rest + _until(left, v_L, b_2))
    d = d + more
    # slip x = x_0 + K_tt c + k p, and `slope_2` once it has ended
    still, slipped = d >= L, np.minimum(d, L)
    x = np.where(still, 0.0, paths.x + u * (g * slipped))
    c = (x - x_0 - k * (paths.p + slipped)) / κ + slope_2 * (d - slipped)
    return c, paths.p + d


def _until(work: np.ndarray, v: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Normal impulse d ≥ 0 at which v d + b d²/2 = work."""
    return np.where(np.abs(work) > 0.0, 2.0 * work / (v + np.sqrt(v * v + 2.0 * b * work)), 0.0)
