"""Free flights in a recording: stretches in which a body accelerates by gravity alone, without a contact.

    p(t + s) = p + v s + a s²/2      fitted to 2h + 1 samples around each, h as small as the noise allows; flight where
                                     |a − g| is small and the parabola fits
    ω        = Σ w_k Δφ_k / Δt       slope of a straight line through the angles of the same samples (Δφ_k: rotation
                                     from sample to sample, w_k ∝ k (2h + 1 − k))

Symbols: p, v, a, g (d,) in m, m/s, m/s², d 2 or 3; ω in rad/s.  A body moved by hand hardly ever moves like this.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from thesis_lib.foundation.errors import UserError

PRECISION = 0.1  # one sigma of |a|/g that the window is chosen for
NEAR_G = 0.3  # |a − g|/g of a flight; three sigmas
PARABOLA = 3.0  # a window fits if its rms residual is below so many times the noise
LARGEST = 0.05  # s, half of the longest window; a flight of a low bounce lasts a tenth of a second
SHORTEST = 3  # windows in a row that make a flight
GAP = 2.5  # median steps without a sample that end a flight
SAME_FLIGHT = 0.1  # s; longer gaps than that end a flight
NO_KICK = 0.2  # m/s between two parts of one flight; an impact changes the velocity by more
CHUNK = 20_000  # windows fitted at once
NOISE_FLOOR = 1e-7  # m


@dataclass(frozen=True, eq=False)
class Track:
    """Local fits to a motion of n samples: velocity v, acceleration a (n, d), NaN at samples without a whole window."""

    t: np.ndarray
    v: np.ndarray
    a: np.ndarray
    smooth: np.ndarray  # (n,) whether the parabola fits
    half: int  # samples on either side of a window's middle


def too_slow(rate: float | None) -> str:
    """Sentence on why a recording at `rate` (Hz) does not resolve single impacts; "" if it may."""
    if rate is None or not 0.0 < rate < 2.0 / LARGEST:
        return ""
    return (
        f"At {rate:.3g} Hz a flight has few samples, and two hits often lie within one step ({1e3 / rate:.0f} ms): "
        "this rate is too low to resolve single impacts."
    )


def follow(t: np.ndarray, position: np.ndarray, gravity: float, noise: float = NOISE_FLOOR) -> Track:
    """Local fits to positions (n, d) at times `t` (n,), with a window chosen for `gravity` in m/s².

    `noise`: least noise of a coordinate in m; neighbouring samples show less of it if a filter has smoothed them.
    """
    step = _step(t)
    noise = max(_noise(t, position, step), noise)
    half = 2
    longest = max(2, int(LARGEST / step))
    while half < longest and _deviation(half, noise, step) > PRECISION * gravity:
        half += 1
    v, a, rest = parabolas(t, position, half, step)
    with np.errstate(invalid="ignore"):
        return Track(t, v, a, rest < PARABOLA * noise, half)


def _step(t: np.ndarray) -> float:
    steps = np.diff(t)
    steps = steps[steps > 0.0]
    if len(steps) < 10:
        raise UserError("The recording has fewer than ten samples at increasing times.")
    return float(np.median(steps))


def _noise(t: np.ndarray, position: np.ndarray, step: float) -> float:
    """One sigma of a coordinate: the median residual of parabolas through five samples."""
    rest = parabolas(t, position, 2, step)[2]
    rest = rest[np.isfinite(rest)]
    return float(np.median(rest)) if len(rest) else 0.0


def _deviation(half: int, noise: float, step: float) -> float:
    """One sigma of the acceleration in m/s² that 2 half + 1 samples give."""
    n = 2.0 * half + 1.0
    return 2.0 * noise / step**2 * np.sqrt(180.0 / (n * (n**2 - 1.0) * (n**2 - 4.0)))


def parabolas(t: np.ndarray, position: np.ndarray, half: int, step: float, at: np.ndarray | None = None):
    """v (n, d), a (n, d) and the rms residual (n,) of parabolas around each sample; NaN across gaps and at the ends.

    `at`: indices of the samples around which parabolas are fitted; the others are NaN.
    """
    n, d = position.shape
    width = 2 * half + 1
    v, a, rest = np.full((n, d), np.nan), np.full((n, d), np.nan), np.full(n, np.nan)
    if n < width:
        return v, a, rest
    windows = np.lib.stride_tricks.sliding_window_view
    times, values = windows(t, width), windows(position, width, axis=0)
    unbroken = np.flatnonzero(windows(np.r_[np.inf, np.diff(t)], width)[:, 1:].max(axis=1) <= GAP * step)
    unbroken = unbroken if at is None else np.intersect1d(unbroken, at - half)
    for start in range(0, len(unbroken), CHUNK):
        which = unbroken[start : start + CHUNK]
        s = (times[which] - times[which, half, None]) / step
        basis = np.stack([np.ones_like(s), s, s**2], axis=-1)
        normal = np.einsum("nwi,nwj->nij", basis, basis)
        good = np.linalg.det(normal) > 1e-6
        which, s, basis, normal = which[good], s[good], basis[good], normal[good]
        y = values[which] - values[which][:, :, half, None]
        c = np.linalg.solve(normal, np.einsum("nwi,ndw->nid", basis, y))
        misfit = y - np.einsum("nwi,nid->ndw", basis, c)
        middle = which + half
        v[middle], a[middle] = c[:, 1] / step, 2.0 * c[:, 2] / step**2
        rest[middle] = np.sqrt(np.sum(misfit**2, axis=(1, 2)) / (d * (width - 3)))
    return v, a, rest


def find_flights(track: Track, gravity: np.ndarray) -> list[slice]:
    """Samples of each flight under `gravity` (d,) in m/s², in order of time.

    A flight with lost or wrong samples inside remains one flight if its velocities before and after them agree.
    """
    size = float(np.linalg.norm(gravity))
    with np.errstate(invalid="ignore"):
        free = track.smooth & (np.linalg.norm(track.a - gravity, axis=1) < NEAR_G * size)
    gaps = np.r_[True, np.diff(track.t) > GAP * _step(track.t)]
    edges = np.flatnonzero(np.diff(np.r_[False, free, False].astype(int)))
    flights: list[slice] = []
    for first, end in zip(edges[::2], edges[1::2]):
        inner = [first, *(i for i in range(first + 1, end) if gaps[i]), end]
        for a, b in itertools.pairwise(inner):
            if b - a >= SHORTEST:
                flights.append(slice(int(a) - track.half, int(b) + track.half))
    return _whole(flights, track, gravity)


def _whole(flights: list[slice], track: Track, gravity: np.ndarray) -> list[slice]:
    """Flights without overlap; two parts of the same parabola are joined."""
    result: list[slice] = []
    for flight in flights:
        if result and track.t[flight.start] - track.t[result[-1].stop - 1] < SAME_FLIGHT:
            before, after = inner(result[-1], track).stop - 1, inner(flight, track).start
            kick = track.v[after] - track.v[before] - gravity * (track.t[after] - track.t[before])
            if np.linalg.norm(kick) < NO_KICK:
                result[-1] = slice(result[-1].start, flight.stop)
                continue
            middle = (flight.start + result[-1].stop) // 2
            if flight.start < result[-1].stop:
                result[-1], flight = slice(result[-1].start, middle), slice(middle, flight.stop)
        result.append(flight)
    return [flight for flight in result if flight.stop - flight.start > 2 * track.half]


def inner(flight: slice, track: Track) -> slice:
    """The samples of a flight whose windows lie within the flight."""
    first, last = min(flight.start + track.half, flight.stop - 1), max(flight.stop - 1 - track.half, flight.start)
    return slice(first, last + 1)


def inner_samples(flights: Sequence[slice], track: Track) -> np.ndarray:
    """Indices of the samples whose windows lie within one of the flights."""
    parts = [np.arange(rows.start, rows.stop) for rows in (inner(flight, track) for flight in flights)]
    return np.concatenate(parts) if parts else np.zeros(0, int)


def smoothed_turning(turns: np.ndarray, t: np.ndarray, half: int) -> np.ndarray:
    """ω (n, m) in rad/s at each of n samples, from the rotations (n - 1, m) between them; NaN near the ends."""
    n, width = len(t), 2 * half + 1
    omega = np.full((n, turns.shape[1]), np.nan)
    if n < width:
        return omega
    k = np.arange(1.0, width)
    weight = k * (width - k)
    weight /= weight.sum()
    for column in range(turns.shape[1]):
        rate = turns[:, column] / np.maximum(np.diff(t), 1e-9)
        omega[half : n - half, column] = np.convolve(rate, weight, "valid")
    return omega
