"""Air drag on a body in flight, estimated from short pieces of its path before any hit is known.

A parabola is fitted to every piece of w samples.  A piece with a hit is not a parabola, and a piece in which the body
rests does not fall; the others give the acceleration beyond gravity at their mean velocity,

    r = −(c_v + c_q |v|) v + (c_l |v| + k_m ω) (−v_y, v_x) + constant,

a linear regression with bisquare weights.  The constant (a tilt, a wrong gravity) is not due to the air and is not
part of the result.  Linear or quadratic drag is used, whichever explains more; lift is added if it is as clear.  w is
chosen for precision: the variance of r falls with w⁵, but longer pieces contain more hits.
"""

from dataclasses import dataclass

import numpy as np

from thesis_lib.datasets.format.air import Air, AirInSpace
from thesis_lib.datasets.format.header import Header
from thesis_lib.datasets.format.samples import ArcSettings, Samples
from thesis_lib.statistics.spread import robust_std

SIZES = (8, 12, 16, 24, 32, 48)  # samples
FEWEST = 24  # pieces
PARABOLA = 2.0  # reduced chi² of a piece
CLEAR = 8.0  # standard errors of a coefficient; pieces with weak hits widen them, but not enough
REST = 0.5  # share of gravity with which a piece must fall to count as flight
FAST = 0.9  # quantile of the accelerations that must not bend the lines of the detector
SLOWED = 0.15  # largest lost share of the velocity; its second order is then 0.4 %
SHORTEST = 8  # samples
_BISQUARE, _ROUNDS = 4.685, 20


@dataclass(frozen=True)
class _Pieces:
    """m pieces of free flight: mean velocity v (m, 3), acceleration beyond gravity r (m, d), its noise (d,)."""

    v: np.ndarray
    r: np.ndarray
    noise: np.ndarray


def air_in(samples: Samples, sigma: np.ndarray, header: Header) -> Air | None:
    """Air forces that pieces of `samples` show clearly; None without gravity, at walls, or if there are none.

    `sigma` (3,) is the noise of x, y, θ in m, m, rad.
    """
    if header.gravity == 0.0 or header.surfaces is not None or not len(samples):
        return None
    pieces = _best_pieces(samples, sigma, header.gravity, 2)
    if pieces is None:
        return None
    lift = "k_m" if samples.q[:, 2].any() else "c_l"
    fits = {terms: _fit(pieces, terms) for drag in ("c_v", "c_q") for terms in ((drag,), (drag, lift))}
    for count in (2, 1):  # with lift, and without
        terms = min((terms for terms in fits if len(terms) == count), key=lambda terms: fits[terms].left)
        found = fits[terms]
        if np.all(np.abs(found.value) > CLEAR * found.std) and found.value[0] > 0.0:
            return Air(**dict(zip(terms, map(float, found.value))), scatter=found.scatter)
    return None


def drag_in_space(samples: Samples, sigma: float, gravity: float) -> AirInSpace | None:
    """Air drag that pieces of a path in space show clearly; None if there is none.

    `samples` have positions in m, the second coordinate upwards, with the noise `sigma` in m.
    """
    if gravity == 0.0 or not len(samples):
        return None
    pieces = _best_pieces(samples, np.full(3, sigma), gravity, 3)
    if pieces is None:
        return None
    fits = {term: _fit(pieces, (term,), AirInSpace) for term in ("c_v", "c_q")}
    term = min(fits, key=lambda term: fits[term].left)
    (value,), (std,) = fits[term].value, fits[term].std
    return AirInSpace(**{term: float(value)}) if value > CLEAR * std else None


def breaks_lines(air: Air, samples: Samples, sigma: np.ndarray, settings: ArcSettings) -> bool:
    """Whether the air bends free flights so much that the detector takes the bend for a hit."""
    v, interval = _steps(samples)
    w = max(settings.scales)
    size = np.quantile(np.hypot(*air.acceleration(v)[:, :2].T), FAST) if len(v) else 0.0
    jump = float(size) * w * interval
    noise = float(np.mean(sigma[:2])) / interval * np.sqrt(24.0 / (w * (w**2 - 1.0)))
    return jump > settings.min_jump and jump > settings.threshold * noise


def window_in(air: Air, samples: Samples, settings: ArcSettings) -> int:
    """Samples per side over which the air takes at most `SLOWED` of the velocity; the arcs are an expansion in it."""
    v, interval = _steps(samples)
    speed = np.maximum(np.hypot(*v[:, :2].T), 1e-9)
    rate = float(np.quantile(np.hypot(*air.acceleration(v)[:, :2].T) / speed, FAST)) if len(v) else 0.0
    most = int(SLOWED / max(rate * interval, 1e-9))
    return int(np.clip(most, min(SHORTEST, settings.max_window), settings.max_window))


def _steps(samples: Samples) -> tuple[np.ndarray, float]:
    """Velocities (m, 3) from sample to sample of a run, and the interval in s."""
    step = np.diff(samples.t)
    inside = (samples.run[1:] == samples.run[:-1]) & (step > 0.0)
    v = np.diff(samples.q, axis=0)[inside] / step[inside, None]
    return v, float(np.median(step[inside])) if inside.any() else 1.0


def air_sentence(air: Air) -> str:
    """Sentence on the effect of the air."""
    drag = f"air drag (quadratic, c_q = {air.c_q:.3g} 1/m)" if air.c_q else f"linear drag (c_v = {air.c_v:.3g} 1/s)"
    lift = f" and lift across the velocity (c_l = {air.c_l:.3g} 1/m)" if air.c_l else ""
    lift = f" and the Magnus effect (k_m = {air.k_m:.3g})" if air.k_m else lift
    said = f"In flight the body is slowed by {drag}{lift}, as estimated from its free flights; the arcs allow for it."
    if not air.c_l:
        return said
    return (
        f"{said} Lift depends on the spin, which is not measured: no effect of the library describes it, and effects "
        "named for the flights may be confounded with it."
    )


def _best_pieces(samples: Samples, sigma: np.ndarray, gravity: float, lengths: int) -> _Pieces | None:
    """The pieces of the most precise size; None if there are too few of every size."""
    found = [one for size in SIZES if len((one := _pieces(samples, sigma, gravity, size, lengths)).v) >= FEWEST]
    return max(found, key=lambda one: len(one.v) / float(np.mean(one.noise**2)), default=None)


def _pieces(samples: Samples, sigma: np.ndarray, gravity: float, size: int, lengths: int) -> _Pieces:
    first = np.arange(0, len(samples) - size + 1, size // 2)
    first = first[samples.run[first] == samples.run[first + size - 1]]
    index = first[:, None] + np.arange(size)
    t, q = samples.t[index], samples.q[index]
    middle = t.mean(1, keepdims=True)
    half = np.maximum(0.5 * (t[:, -1:] - t[:, :1]), 1e-12)
    basis = ((t - middle) / half)[..., None] ** np.arange(3)
    normal = np.einsum("nwi,nwj->nij", basis, basis)
    right = np.einsum("nwi,nwc->nic", basis, q - q[:, :1])
    fitted = np.linalg.solve(normal, right) if len(first) else np.zeros((0, 3, 3))
    rest = q - q[:, :1] - basis @ fitted
    measured = np.arange(3 if samples.q[:, 2].any() else 2)
    chi2 = ((rest / sigma)[..., measured] ** 2).sum((1, 2)) / (len(measured) * (size - 3.0))
    v, a = fitted[:, 1] / half, 2.0 * fitted[:, 2, :lengths] / half**2
    falls = a[:, 1] < -REST * gravity
    falls |= (np.abs(v[:, 1:2]) * half > 3.0 * sigma[1])[:, 0] & (np.abs(v[:, 1]) > gravity * half[:, 0])
    good = (chi2 < PARABOLA) & falls
    r = a + np.array([0.0, gravity, 0.0])[:lengths]
    scale = 2.0 / np.median(half[:, 0]) ** 2 * np.sqrt(np.median(np.linalg.inv(normal)[:, 2, 2])) if len(first) else 1.0
    return _Pieces(v[good], r[good], scale * sigma[:lengths])


@dataclass(frozen=True)
class _Fitted:
    """Coefficients, standard errors, robust residual sum of squares, and scatter beyond noise (one sigma, m/s²)."""

    value: np.ndarray
    std: np.ndarray
    left: float
    scatter: float


def _fit(pieces: _Pieces, terms: tuple[str, ...], kind: type[Air] = Air) -> _Fitted:
    """The regression of `pieces` on `terms` of a kind of air and a constant."""
    m, d = pieces.r.shape
    unit = [kind(**{name: 1.0}).acceleration(pieces.v)[:, :d] for name in terms]
    constant = [np.tile(row, (m, 1)) for row in np.eye(d)]
    columns = (np.stack([*unit, *constant], axis=-1) / pieces.noise[:, None]).reshape(d * m, -1)
    r = (pieces.r / pieces.noise).reshape(d * m)
    weight = np.ones(d * m)
    value, scale = np.zeros(columns.shape[1]), 1.0
    for _ in range(_ROUNDS):
        value = np.linalg.lstsq(columns * np.sqrt(weight)[:, None], r * np.sqrt(weight), rcond=None)[0]
        left = r - columns @ value
        scale = max(float(robust_std(left)), 1.0)
        weight = np.clip(1.0 - (left / (_BISQUARE * scale)) ** 2, 0.0, None) ** 2
    information = columns.T @ (columns * weight[:, None])
    # neighbouring pieces share half of their samples
    std = scale * np.sqrt(2.0 * np.diag(np.linalg.pinv(information)))
    left = r - columns @ value
    beyond = np.maximum(robust_std(left.reshape(m, d)) ** 2 - 1.0, 0.0)
    total = float((np.minimum(np.abs(left), _BISQUARE * scale) ** 2).sum())
    return _Fitted(value[: len(terms)], std[: len(terms)], total, float((np.sqrt(beyond) * pieces.noise).max()))
