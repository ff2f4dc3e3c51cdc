"""What is measured of each impact and of each flight, with covariance: the data of the critique.

Around each impact a straight line is fitted to the samples on either side, separately: nothing is assumed about how
the arcs meet, because that is among the things to be criticised.  A line through a parabola with acceleration a has

    value(0) = q(t_c) + a b_0,    slope = v(t_c) + a b_1,     (b_0, b_1): the line through τ²/2

so that pose and velocity at the impact follow for *any* acceleration a model asks for (gravity, drag, tilt, ...).
Flights that are long enough also give their acceleration, from a parabola through all their samples.

| on paper     | in code            | unit          | shape      |                                             |
|--------------|--------------------|---------------|------------|---------------------------------------------|
| value, slope | `value`, `slope`   | m, rad; m/s, rad/s | (n, 2, 3) | of the lines before and after at t_c     |
| b_0, b_1     | `bow`              | s², s         | (n, 2, 2)  | see above                                   |
| C            | `cov`              |               | (n, 2, 3, 2, 2) | of (value, slope), by side and channel |
"""

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from numpy.polynomial.legendre import legvander

from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.samples import ArcSettings
from thesis_lib.datasets.impacts.detect import FoundImpacts, find_impacts
from thesis_lib.datasets.impacts.misfits import Lines, lines_through, rank
from thesis_lib.effects.effect import Rig, State

MIN_FLIGHT = 12  # samples: a shorter flight's acceleration is noise
MAX_CHI2 = 2.5  # reduced; a flight above it is no parabola: it holds a hit that was not seen
NODES = 8  # a path that turns by 2.5 rad in a window of 0.1 s is then a polynomial to 1e-6 of its size
GUARD = 1e-3  # s; samples this near to an impact may fall into the contact


@dataclass(frozen=True)
class Flights:
    """Accelerations of m flights between impacts: state at mid-flight, a (m, 3), its variance (m, 3), span (m,) s."""

    state: State
    acceleration: np.ndarray
    variance: np.ndarray
    span: np.ndarray

    def __len__(self) -> int:
        return len(self.acceleration)

    def select(self, rows: np.ndarray) -> "Flights":
        """The flights at `rows`."""
        return Flights(self.state.select(rows), self.acceleration[rows], self.variance[rows], self.span[rows])


@dataclass(frozen=True)
class Observations:
    """n impacts and m flights of one dataset.

    Attributes:
        rig: what is believed of body and rig.
        trial, t: (n,).
        value, slope, bow, cov: see the module's table; `value` is NaN-free.
        nodes, weights: (n, 2, `NODES`) s after impact, and (n, 2, 2, `NODES`): the line through the samples of any
            smooth path f(τ) has value and slope `weights @ f(nodes)`.  First and last node: ends of the samples used.
        t_std: (n,) s, how well t_c is known.
        offset: (n, 2) contact point as given by the dataset minus that of the shape, m (zero from trajectories).
        arcs: whether there are trajectories, so that poses before and after are measured separately.
        flights: accelerations, or none.
        noise_known: whether `cov` comes from measurements or statements; else only the scatter is known.
        found: what detection made of the dataset, for figures and tables; its impacts are these n.
    """

    rig: Rig
    trial: np.ndarray
    t: np.ndarray
    value: np.ndarray
    slope: np.ndarray
    bow: np.ndarray
    cov: np.ndarray
    nodes: np.ndarray
    weights: np.ndarray
    t_std: np.ndarray
    offset: np.ndarray
    arcs: bool
    flights: Flights
    noise_known: bool
    found: FoundImpacts

    def __len__(self) -> int:
        return len(self.trial)

    def select(self, trials: np.ndarray) -> "Observations":
        """Impacts and flights of the given trials."""
        rows = np.flatnonzero(np.isin(self.trial, trials))
        flights = self.flights.select(np.flatnonzero(np.isin(self.flights.state.trial, trials)))
        arrays = {
            name: getattr(self, name)[rows]
            for name in ("trial", "t", "value", "slope", "bow", "cov", "nodes", "weights", "t_std", "offset")
        }
        return replace(self, **arrays, flights=flights)

    def tiled(self, copies: int, with_samples: bool) -> "Observations":
        """The impacts `copies` times one after the other; without samples `nodes` and `weights` stay as they are."""
        names = ("trial", "t", "value", "slope", "bow", "offset") + (
            ("nodes", "weights") if with_samples else ()
        )
        arrays = {}
        for name in names:
            array = getattr(self, name)
            arrays[name] = np.tile(array, (copies, *(1,) * (array.ndim - 1)))
        return replace(self, **arrays)


def observe(dataset: Dataset, settings: ArcSettings | None = None) -> Observations:
    """Observations of a dataset, from its trajectories or else from its impacts.csv."""
    settings = settings or ArcSettings()
    found = find_impacts(dataset, settings)
    rig = Rig(dataset.shape, dataset.k_g, dataset.gravity, dataset.height)
    if dataset.trajectories is None or dataset.impacts is not None:
        return _from_impacts(found, rig)
    return _from_trajectories(dataset.trajectories, found, rig)


def _from_impacts(found: FoundImpacts, rig: Rig) -> Observations:
    impacts = found.impacts
    n = len(impacts)
    value = np.stack([impacts.q, impacts.q], axis=1)
    slope = np.stack([impacts.v_pre, impacts.v_post], axis=1)
    cov = np.zeros((n, 2, 3, 2, 2))
    if impacts.cov is not None:
        variance = np.einsum("nii->ni", impacts.cov)
        cov[:, 0, :, 0, 0] = cov[:, 1, :, 0, 0] = variance[:, 0:3]
        cov[:, 0, :, 1, 1], cov[:, 1, :, 1, 1] = variance[:, 3:6], variance[:, 6:9]
    none = np.zeros(0)
    return Observations(
        rig=rig,
        trial=impacts.trial,
        t=np.where(np.isfinite(impacts.t), impacts.t, 0.0),
        value=value,
        slope=slope,
        bow=np.zeros((n, 2, 2)),
        cov=cov,
        nodes=np.zeros((n, 2, NODES)),
        weights=np.zeros((n, 2, 2, NODES)),
        t_std=np.zeros(n),
        offset=impacts.r - rig.shape.contact_point(impacts.q[:, 2]),
        arcs=False,
        flights=Flights(State(*(none,) * 8), np.zeros((0, 3)), np.zeros((0, 3)), none),
        noise_known=impacts.cov is not None,
        found=found,
    )


def _from_trajectories(table: pd.DataFrame, found: FoundImpacts, rig: Rig) -> Observations:
    trial, t = table["trial"].to_numpy(), table["t"].to_numpy(float)
    q = table[["x", "y", "theta"]].to_numpy(float)
    order = np.lexsort((t, trial))
    order = order[~found.masked]
    trial, t, q = trial[order], t[order], q[order]
    sigma, colour = found.noise.used, found.noise.colour
    hits = found.arcs.sort_values(["trial", "t"])
    impacts = found.impacts
    # every detected hit bounds the windows, used or not
    before, after = _neighbours(hits["trial"].to_numpy(), hits["t"].to_numpy(), impacts.trial, impacts.t)
    # a window that detection has cut short, because the arc was bent, stays short
    size = found.arcs.loc[found.arcs["used"].astype(bool), ["n_pre", "n_post"]].to_numpy()
    lines = _side_lines(trial, t, q, impacts.trial, impacts.t, before, after, size)
    value, slope, bow, unit_cov, nodes, weights = lines
    cov = unit_cov[:, :, None] * (sigma**2 * colour)[None, None, :, None, None]
    t_std = found.arcs.loc[found.arcs["used"].astype(bool), "t_std"].to_numpy()
    where = hits["trial"].to_numpy(), hits["t"].to_numpy(), hits["used"].to_numpy(bool)
    flights = _flights(trial, t, q, *where, sigma**2 * colour)
    enough = np.isfinite(cov).all(axis=(1, 2, 3, 4)) & np.isfinite(value).all(axis=(1, 2))
    rows = np.flatnonzero(enough)
    return Observations(
        rig=rig,
        trial=impacts.trial[rows],
        t=impacts.t[rows],
        value=value[rows],
        slope=slope[rows],
        bow=bow[rows],
        cov=cov[rows],
        nodes=nodes[rows],
        weights=weights[rows],
        t_std=t_std[rows],
        offset=np.zeros((len(rows), 2)),
        arcs=True,
        flights=flights,
        noise_known=True,
        found=replace(found, impacts=impacts.select(rows)),
    )


def _neighbours(
    hit_trial: np.ndarray, hit_t: np.ndarray, trial: np.ndarray, t: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Instants of the hits before and after each impact in its trial (∓∞ without)."""
    # one sorted key over all hits: trials are integers, times below a span
    span = 2.0 * (np.abs(hit_t).max(initial=0.0) + 1.0)
    key = hit_trial * span + hit_t
    at = np.searchsorted(key, trial * span + t + 1e-9)
    before, after = np.full(len(t), -np.inf), np.full(len(t), np.inf)
    has = at - 2 >= 0
    same = has & (hit_trial[np.maximum(at - 2, 0)] == trial)
    before[same] = hit_t[at[same] - 2]
    has = at < len(hit_t)
    same = has & (hit_trial[np.minimum(at, len(hit_t) - 1)] == trial)
    after[same] = hit_t[at[same]]
    return before, after


def _side_lines(
    trial: np.ndarray,
    t: np.ndarray,
    q: np.ndarray,
    at_trial: np.ndarray,
    at_t: np.ndarray,
    before: np.ndarray,
    after: np.ndarray,
    size: np.ndarray,
) -> tuple[np.ndarray, ...]:
    """Lines on both sides: value, slope (n, 2, 3), bow (n, 2, 2), unit covariance (n, 2, 2, 2), nodes and weights."""
    span = 2.0 * (np.abs(t).max(initial=0.0) + 1.0)
    first = np.searchsorted(trial * span + t, at_trial * span + at_t)
    window = int(size.max(initial=1)) + 1
    index = np.clip(first[:, None] + np.arange(-window, window), 0, len(t) - 1)
    tau = t[index] - at_t[:, None]
    raw = first[:, None] + np.arange(-window, window)
    same = (trial[index] == at_trial[:, None]) & (raw == index)
    inside = same & (t[index] > before[:, None] + GUARD) & (t[index] < after[:, None] - GUARD)
    side = np.stack([inside & (tau < -GUARD), inside & (tau > GUARD)], axis=1).astype(float)
    side *= rank(side) <= size[:, :, None]
    lines = lines_through(side, tau, q[index])
    bow = lines_through(side, tau, 0.5 * tau[..., None] ** 2)
    usable = (lines.count >= 3) & (lines.spread > 0)
    spread = np.where(usable, lines.spread, np.nan)
    count = np.where(usable, lines.count, np.nan)
    unit = np.empty((len(at_t), 2, 2, 2))
    unit[..., 0, 0] = 1.0 / count + lines.mean**2 / spread
    unit[..., 1, 1] = 1.0 / spread
    unit[..., 0, 1] = unit[..., 1, 0] = -lines.mean / spread
    bows = np.concatenate([bow.value, bow.slope], axis=2)
    return lines.value, lines.slope, bows, unit, *_nodes(side, tau, lines)


def _nodes(side: np.ndarray, tau: np.ndarray, lines: Lines) -> tuple[np.ndarray, np.ndarray]:
    """Few nodes that do for smooth paths what all samples do: exact for polynomials of degree `NODES` − 1."""
    low = np.where(side > 0, tau[:, None], np.inf).min(axis=2, initial=np.inf)
    high = np.where(side > 0, tau[:, None], -np.inf).max(axis=2, initial=-np.inf)
    low, high = (np.where(np.isfinite(a), a, 0.0) for a in (low, high))
    half = np.maximum(0.5 * (high - low), 1e-9)
    middle = 0.5 * (low + high)
    unit = -np.cos(np.pi * np.arange(NODES) / (NODES - 1))
    # how value and slope of the line weigh each sample
    safe = np.maximum(lines.count, 1.0)[..., None]
    slope = (
        (tau[:, None] - lines.mean[..., None])
        * side
        / np.where(lines.spread > 0, lines.spread, 1.0)[..., None]
    )
    value = side / safe - slope * lines.mean[..., None]
    at = np.where(side > 0, (tau[:, None] - middle[..., None]) / half[..., None], 0.0)
    moments = np.einsum("nskw,nswl->nskl", np.stack([value, slope], axis=2), legvander(at, NODES - 1))
    weights = moments @ np.linalg.inv(legvander(unit, NODES - 1))
    return middle[..., None] + half[..., None] * unit, weights


def _flights(
    trial: np.ndarray,
    t: np.ndarray,
    q: np.ndarray,
    hit_trial: np.ndarray,
    hit_t: np.ndarray,
    used: np.ndarray,
    variance: np.ndarray,
) -> Flights:
    """Accelerations of the flights with at least `MIN_FLIGHT` samples, from parabolas through them.

    Only flights that a hit ends which is itself used: what follows the last hit of a trial may be a body at rest, and
    an instant that is not known well leaves samples of two flights in one.
    """
    span = 2.0 * (np.abs(t).max(initial=0.0) + 1.0)
    # number of hits before each sample, counted over all trials: constant in one flight of one trial
    flight = np.searchsorted(hit_trial * span + hit_t, trial * span + t)
    near = np.zeros(len(t), bool)
    for neighbour in (flight - 1, flight):
        known = (neighbour >= 0) & (neighbour < len(hit_t))
        i = np.clip(neighbour, 0, max(len(hit_t) - 1, 0))
        if len(hit_t):
            near |= known & (hit_trial[i] == trial) & (np.abs(hit_t[i] - t) < GUARD)
    keep = ~near
    trial, t, q, flight = trial[keep], t[keep], q[keep], flight[keep]
    _, label = np.unique(np.stack([trial, flight], 1), axis=0, return_inverse=True)
    label = np.ravel(label)
    m = label.max(initial=-1) + 1

    def total(values: np.ndarray) -> np.ndarray:
        return np.bincount(label, values, minlength=m)

    n = total(np.ones(len(t)))
    tau = t - (total(t) / np.maximum(n, 1))[label]
    powers = [total(tau**k) for k in range(5)]
    normal = np.array(
        [
            [powers[i + j] / (2.0 if j == 2 else 1.0) / (2.0 if i == 2 else 1.0) for j in range(3)]
            for i in range(3)
        ]
    )
    normal = np.moveaxis(normal, -1, 0)
    start = np.zeros(m, int)
    start[label[::-1]] = np.arange(len(label))[::-1]
    end = flight[start]  # number of the hit that ends the flight, if that is of the same trial
    ended = end < len(hit_t)
    ended[ended] = (hit_trial[end[ended]] == trial[start[ended]]) & used[end[ended]]
    good = (n >= MIN_FLIGHT) & ended
    rows = np.flatnonzero(good)
    inverse = np.linalg.inv(normal[rows])
    right = np.stack(
        [
            np.stack([total(tau**k / (2.0 if k == 2 else 1.0) * q[:, c])[rows] for k in range(3)], -1)
            for c in range(3)
        ],
        axis=-1,
    )
    fitted = inverse @ right  # (rows, [q, v, a], channel)
    # a flight that is no parabola at all holds a hit that was not seen; the rest of it says nothing
    row_of = np.full(m, -1)
    row_of[rows] = np.arange(len(rows))
    mine = row_of[label] >= 0
    i = row_of[label[mine]]
    shape = np.stack([np.ones(mine.sum()), tau[mine], 0.5 * tau[mine] ** 2], -1)
    residual = q[mine] - np.einsum("nk,nkc->nc", shape, fitted[i])
    chi2 = np.stack([np.bincount(i, residual[:, c] ** 2, len(rows)) for c in range(3)], -1) / variance
    straight = (chi2.sum(1) / (3.0 * (n[rows] - 3.0))) < MAX_CHI2
    rows, fitted, inverse = rows[straight], fitted[straight], inverse[straight]
    mid = (total(t) / np.maximum(n, 1))[rows]
    state = State.of(fitted[:, 0], fitted[:, 1], trial[start[rows]], mid)
    first, final = np.full(m, np.inf), np.full(m, -np.inf)
    np.minimum.at(first, label, t)
    np.maximum.at(final, label, t)
    return Flights(state, fitted[:, 2], inverse[:, 2, 2][:, None] * variance, (final - first)[rows])
