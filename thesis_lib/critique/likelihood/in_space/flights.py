"""Accelerations of flights in space, and their change: deviations from uniform translation and free rotation.

For the samples of a flight, with τ from its middle and T the time from the first to the last sample,

    p(τ) = p_0 + v τ + a τ²/2 + Δa τ³/(6 T)
    φ(τ) = Φ_q(τ) δφ + Φ_ω(τ) δω + α τ²/2 + Δα τ³/(6 T)

where φ turns the believed torque-free motion through the samples into the measured attitudes, and Φ are its derivatives
(`mechanics/free_motion.py`).  The terms are fitted consecutively: a is the acceleration of a parabola.  The path that a
model and its camera predict from the state in the middle is fitted in the same way; it need not be a parabola.  A wrong
centre of mass gives an acceleration that turns with the body, air one that changes: Δa distinguishes them from gravity.

In a flight, between hits, the believed centre of mass accelerates by gravity (`datasets/space/flights.py`).  A flight
with terms beyond τ³ that a displaced centre of mass cannot explain contains an undetected hit.

| on paper | in code        | unit        | shape   |                                                  |
|----------|----------------|-------------|---------|--------------------------------------------------|
| a, α, Δa, Δα | `acceleration` | m/s², rad/s² | (m, 12) | in this order, axes of the surface           |
|          | `of_place`     | 1/s²        | (m, 2, K)       | weights of a and Δa over places at `COURSE` |
|          | `of_turn`      | 1/s²        | (m, 6, 3, K)    | weights of α and Δα over turns from `reference` |
|          | `reference`    | 1           | (m, K, 4)       | attitudes of the believed motion at `COURSE`     |
"""

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.polynomial.legendre import legvander
from scipy.stats import chi2

from thesis_lib.critique.contacts.dynamics import COURSE, Dynamics
from thesis_lib.critique.likelihood.flights import Flights, no_flights
from thesis_lib.datasets.flights.beside_hits import fit_turning
from thesis_lib.datasets.flights.parabolas import MIN_FLIGHT, Hits
from thesis_lib.datasets.space.flights import find_flights, follow
from thesis_lib.effects.effect import Rig
from thesis_lib.mechanics.free_motion import attitudes, columns
from thesis_lib.mechanics.space import SPACE, rotation_matrix
from thesis_lib.mechanics.state import State
from thesis_lib.statistics.spread import OF_MEDIAN, robust_std

LASTS = 3e-3  # s from a hit within which samples may be in contact; at least one step
SHORTEST = 0.1  # s: in a shorter flight the body rises by less than 12 mm, and may rock on an edge
IMPROBABLE = 1e-6  # probability of a larger χ² of a flight without an undetected hit
UNSEEN = 0.1  # m, prior sigma of the centre of mass
ODD = 3.0  # ratio to the median misfit beyond which a flight is not used for the centre of mass
CHANCE = 3.0  # standard errors by which the observed noise may exceed the stated noise
LEAST = 1e-3  # least noise, relative to that of neighbouring samples; flights show more
FREE, TERMS, ALL = 2, 4, 6  # terms of a position: free motion; also the compared ones; also faster ones


@dataclass(frozen=True)
class SpaceFlights(Flights):
    """m flights in space; see the module's table.  `variance` (m, 12): the components are independent."""

    reference: np.ndarray
    of_place: np.ndarray
    of_turn: np.ndarray

    def residuals(self, dynamics: Dynamics) -> np.ndarray:
        """Measured minus predicted accelerations (m, 12), m/s² and rad/s²."""
        if not len(self):
            return self.acceleration
        n, k = len(self), len(COURSE)
        path = dynamics.course(dynamics.to_true(self.state), 0.5 * self.span)
        seen = dynamics.select(np.repeat(np.arange(n), k)).to_measured(path)
        turn = SPACE.turn_between(self.reference.reshape(-1, 4).T, seen.attitude).reshape(3, n, k)
        place = seen.position.reshape(3, n, k)
        return self.acceleration - _terms(self.of_place, self.of_turn, place, turn)


def _terms(of_place: np.ndarray, of_turn: np.ndarray, place: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """a, α, Δa, Δα (n, 12) from positions and turns (3, n, W) with their weights (n, 2, W) and (n, 6, 3, W)."""
    a = np.einsum("ntw,cnw->ntc", of_place, place)
    alpha = np.einsum("ncdw,dnw->nc", of_turn, turn).reshape(len(a), 2, 3)
    return np.concatenate([a, alpha], axis=2).reshape(len(a), 12)


@dataclass(frozen=True)
class _Samples:
    """W samples of n flights, padded with zeros: τ (n, W) in s, positions (n, W, 3), attitudes (n, W, 4).

    `used` (n, W) is the mask of actual samples, `middle` (n,) the clock in the middle of each flight.
    """

    rows: np.ndarray
    used: np.ndarray
    middle: np.ndarray
    span: np.ndarray
    tau: np.ndarray
    place: np.ndarray
    attitude: np.ndarray

    @classmethod
    def of(cls, states: State, clock: np.ndarray, flights: list[slice]) -> "_Samples":
        count = np.array([flight.stop - flight.start for flight in flights])
        used = np.arange(count.max()) < count[:, None]
        rows = np.array([flight.start for flight in flights])[:, None] + np.arange(count.max()) * used
        first, last = clock[rows[:, 0]], clock[rows[:, 0] + count - 1]
        middle = 0.5 * (first + last)
        tau = np.where(used, clock[rows] - middle[:, None], 0.0)
        place, attitude = (np.moveaxis(part[:, rows], 0, -1) for part in (states.position, states.attitude))
        return cls(rows, used, middle, last - first, tau, place * used[..., None], attitude)

    def powers(self) -> np.ndarray:
        """Columns (n, W, 6): 1, τ, τ²/2, τ³/(6 T), and the next two powers."""
        over = self.span[:, None, None] ** np.maximum(np.arange(ALL) - FREE, 0)
        return self.tau[..., None] ** np.arange(ALL) / ([1.0, 1.0, 2.0, 6.0, 24.0, 120.0] * over) * self.used[..., None]

    def at_course(self, weights: np.ndarray) -> np.ndarray:
        """Weights (n, ..., K) at `COURSE` equivalent to weights (n, ..., W) at the samples."""
        along = legvander(self.tau / (0.5 * self.span[:, None]), len(COURSE) - 1)
        along = along @ np.linalg.inv(legvander(COURSE, len(COURSE) - 1))
        return np.einsum("n...w,nwk->n...k", weights, along)


def flights_in_space(
    states: State,
    clock: np.ndarray,
    hits: Hits,
    rig: Rig,
    noise: tuple[float, float],
    low: float = -np.inf,
    guard: float = 0.0,
) -> Flights:
    """Flights between hits, with their accelerations.

    Args:
        states: measured poses (N,) of the believed body, in the axes of the surface, by trial and time.
        clock: (N,) s, increases over all trials, with a pause between trials.
        hits: all detected hits, at times as in `states`.
        noise: one sigma of a coordinate in m and of a component of a small turn in rad, at least.
        low: m, gap below which the body may touch: many contacts are too weak to be detected as hits.
        guard: s from a hit, within which samples are rounded.
    """
    flights = _between(states, clock, hits, rig, noise[0], low, guard)
    if not flights:
        return no_flights(SPACE)
    samples = _Samples.of(states, clock, flights)
    powers = samples.powers()
    Q, R = np.linalg.qr(powers)
    bent, sigma = _misfits(samples, Q, noise[0])
    unit = np.diagonal(R, axis1=1, axis2=2)[:, FREE:TERMS, None]
    of_place = np.swapaxes(Q[..., FREE:TERMS], 1, 2) / unit
    first = np.linalg.solve(R[:, :TERMS, :TERMS], np.swapaxes(Q[..., :TERMS], 1, 2) @ samples.place)
    turning = _turns(samples, powers[..., FREE:TERMS], Q, rig, noise[1])
    variance = np.concatenate([sigma**2 / unit[:, 0] ** 2, turning.variance[:, :3]], axis=1)
    variance = np.concatenate([variance, sigma**2 / unit[:, 1] ** 2, turning.variance[:, 3:]], axis=1)
    place = np.moveaxis(samples.place, -1, 0)
    trial, rows = states.trial[samples.rows[:, 0]], samples.rows[:, 0]
    begins = np.searchsorted(states.trial, trial)
    state = State(
        np.concatenate([first[:, 0].T, turning.attitude]),
        np.concatenate([first[:, 1].T, turning.spin]),
        trial,
        states.t[rows] - states.t[begins] + samples.middle - clock[rows],
        None,
        SPACE,
    )
    found = SpaceFlights(
        state,
        variance,
        _terms(of_place, turning.weights, place, turning.turns),
        samples.span,
        turning.reference,
        samples.at_course(of_place),
        samples.at_course(turning.weights),
        bent=trial[bent],
    )
    return found.select(np.flatnonzero(~bent))


def noise_of_flights(
    states: State, clock: np.ndarray, hits: Hits, rig: Rig, noise: tuple[float, float], guard: float
) -> tuple[float, float]:
    """One sigma of a coordinate in m and of a turn in rad, from the terms of flights beyond the compared ones.

    For smoothed samples it is the white noise with the same slow errors, which determine fits to many samples.
    Arguments as in `flights_in_space`.
    """
    flights = _between(states, clock, hits, rig, noise[0], -np.inf, guard)
    if not flights:
        return noise
    length = np.array([flight.stop - flight.start for flight in flights])
    flights = [flights[i] for i in np.flatnonzero(length >= np.median(length))]  # short flights do not show slow errors
    samples = _Samples.of(states, clock, flights)
    powers = samples.powers()
    Q, _ = np.linalg.qr(powers)
    further, least = powers[..., FREE:TERMS], LEAST * np.array(noise)
    found = _misfits(samples, Q, least[0])[1], _turns(samples, further, Q, rig, least[1]).sigma
    place, turn = (float(np.sqrt(np.mean(sigma**2))) for sigma in found)
    return place, turn


def _between(
    states: State, clock: np.ndarray, hits: Hits, rig: Rig, noise: float, low: float, guard: float
) -> list[slice]:
    """Rows of the flights between hits and above `low`, longer than `SHORTEST` with at least `MIN_FLIGHT` samples."""
    if not rig.gravity or len(clock) <= MIN_FLIGHT:
        return []
    label, number = np.full(len(clock), -1), hits.before(states.trial, states.t)
    track = follow(clock, states.position.T, rig.gravity, noise)
    for i, flight in enumerate(find_flights(track, rig.pull[:, 0])):
        label[flight] = i
    lasts = max(LASTS, guard, float(np.median(np.diff(clock))))
    for hit in (number - 1, number):
        label[np.abs(hits.instants(hit, states.trial, np.inf) - states.t) < lasts] = -1
    gap = rig.gap(states)
    change = 0.5 * np.abs(np.diff(gap)) * (np.diff(states.trial) == 0)  # to the lowest point between two samples
    label[gap - np.maximum(np.r_[change, 0.0], np.r_[0.0, change]) < low] = -1
    edges = np.flatnonzero(np.diff(label, prepend=-2, append=-2) | np.r_[0, np.diff(number), 0])
    return [
        slice(a, b)
        for a, b in itertools.pairwise(edges.tolist())
        if label[a] >= 0 and b - a >= MIN_FLIGHT and clock[b - 1] - clock[a] > SHORTEST
    ]


def _misfits(samples: _Samples, Q: np.ndarray, noise: float) -> tuple[np.ndarray, np.ndarray]:
    """Mask (n,) of flights with an undetected hit, and one sigma (3,) in m of a position."""
    axes = np.moveaxis(rotation_matrix(np.moveaxis(samples.attitude, -1, 0)), (0, 1), (2, 3))  # (n, W, 3, 3)
    axes = axes * samples.used[..., None, None]
    slow = Q[..., :TERMS]
    beyond = axes - np.einsum("nwt,nvt,nvij->nwij", slow, slow, axes, optimize=True)
    rest = samples.place - slow @ (np.swapaxes(slow, 1, 2) @ samples.place)
    kept = np.ones(len(rest), bool)
    for _ in range(2):  # a displaced centre of mass affects all flights equally
        normal = np.einsum("nwij,nwik->jk", beyond[kept], beyond[kept])
        c = np.linalg.solve(
            normal + (noise / UNSEEN) ** 2 * np.eye(3), np.einsum("nwij,nwi->j", beyond[kept], rest[kept])
        )
        left = rest - beyond @ c
        size = np.sqrt((left**2).sum(axis=(1, 2)) / samples.used.sum(axis=1))
        kept = size <= ODD * np.median(size)
    sigma = _seen(np.einsum("nwt,nwi->nti", Q[..., TERMS:], left), noise)
    off = (left**2 / sigma**2).sum(axis=(1, 2))
    dof = 3.0 * (samples.used.sum(axis=1) - TERMS)
    grown = max(float(np.median(off / dof)), 1.0)
    return off > grown * chi2.isf(IMPROBABLE, dof), sigma


def _seen(fast: np.ndarray, noise: float) -> np.ndarray:
    """One sigma (3,) of a sample from terms (n, t, 3) due to noise alone; the given `noise` if they agree with it."""
    values = fast.reshape(-1, 3)
    seen = robust_std(values)
    return np.where(seen > noise * (1.0 + CHANCE * OF_MEDIAN / np.sqrt(len(values))), seen, noise)


@dataclass(frozen=True)
class _Turns:
    """Turns (3, n, W) from the believed motion; attitude (4, n) and spin (3, n) in the middle; weights (n, 6, 3, W)
    and the variance (n, 6) of their results; attitudes (n, K, 4) of the believed motion at `COURSE`; one sigma (3,)
    in rad of a turn."""

    turns: np.ndarray
    attitude: np.ndarray
    spin: np.ndarray
    weights: np.ndarray
    variance: np.ndarray
    reference: np.ndarray
    sigma: np.ndarray


def _turns(samples: _Samples, further: np.ndarray, Q: np.ndarray, rig: Rig, noise: float) -> _Turns:
    """Turns of n flights; `further` (n, W, 2) are the terms beyond free motion."""
    G, tau, n = np.asarray(rig.tensor), samples.tau.T, len(samples.tau)
    q, spin, _ = fit_turning(samples.attitude, samples.tau, samples.used, G)
    believed, _ = attitudes(q, spin, G, tau)
    measured = np.swapaxes(np.moveaxis(samples.attitude, -1, 0), 1, 2)
    turns = np.swapaxes(SPACE.turn_between(believed, measured), 1, 2) * samples.used
    free = columns(q, spin, G, tau).transpose(3, 0, 2, 1) * samples.used[:, None, :, None]  # (n, 3, W, 6)
    more = np.einsum("nwt,ij->niwtj", further, np.eye(3)).reshape(*free.shape[:3], -1)
    P, R = np.linalg.qr(np.concatenate([free, more], axis=3).reshape(n, -1, 12))
    P = P.reshape(n, *free.shape[1:3], 12)
    found = np.einsum("niwt,inw->nt", P, turns)
    begun = np.linalg.solve(R, found[..., None])[:, :6, 0].T
    left = np.moveaxis(turns, 0, -1) - np.einsum("niwt,nt->nwi", P, found)
    sigma = _seen(np.einsum("nwt,nwi->nti", Q[..., TERMS:], left), noise)
    weights, variance = [], []
    for part in (slice(6, 9), slice(9, 12)):  # decorrelated
        inverse = np.linalg.inv(R[:, part, part])
        cov = inverse @ np.swapaxes(inverse, 1, 2)
        value, axes = np.linalg.eigh(cov)
        one = np.diagonal(cov, axis1=1, axis2=2)
        root = np.sqrt(one)[..., None] * (axes / np.sqrt(value)[:, None]) @ np.swapaxes(axes, 1, 2)
        weights.append(np.einsum("nab,niwb->naiw", root @ inverse, P[..., part]))
        variance.append(np.einsum("naiw,i->na", weights[-1] ** 2, sigma**2))
    at, _ = attitudes(q, spin, G, np.multiply.outer(COURSE, 0.5 * samples.span))
    return _Turns(
        turns,
        SPACE.attitude_after(q, begun[:3]),
        spin + begun[3:],
        np.concatenate(weights, axis=1),
        np.concatenate(variance, axis=1),
        np.moveaxis(at, 0, -1).swapaxes(0, 1),
        sigma,
    )
