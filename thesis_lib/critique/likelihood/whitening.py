"""Whitened residuals of a model, and their likelihood under Student's t distribution.

    log score of an impact   log t_ν(R; 0, S),   ν = 8, in m dimensions
    log score beside impacts the same, for example of a flight in 3 dimensions (`beside`)

The t distribution limits the influence of single impacts; for Gaussian residuals it loses 2 % of efficiency.  The
scatter σ_m that neither noise nor model explains is added to S: it adds σ_m² D to the velocities after impact, with
D = diag(1, 1, 1/k²), in space diag(1, 1, 1, 1/k², 1/k², 1/k²).
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.special import gammaln

from thesis_lib.critique.contacts.kinds import bind, kind_of
from thesis_lib.critique.contacts.model import Model
from thesis_lib.critique.likelihood.comparison import SHARED, Comparison
from thesis_lib.critique.likelihood.levenberg_marquardt import Weighted
from thesis_lib.critique.likelihood.observations import Observations
from thesis_lib.foundation.forked import each
from thesis_lib.mechanics.state import State

NU = 8.0
BESIDE_STATES = ("span", "offset")  # arrays of the observations that a prediction needs in addition to the states
Parts = tuple[np.ndarray, ...]
OfFlights = tuple[tuple[State, State], np.ndarray]  # states at impact, whitened residuals of flights
KEPT = 2  # cached points: the current one of a search, and its next try
SIGMA_LOW, SIGMA_HIGH = 1e-5, 3.0  # m/s, range of σ_m


class Whitening:
    """Whitened residuals of a model at fixed S and σ_m.

    `known` are values with their residuals (n, m).  States at impact and residuals of flights are cached for the last
    few values of the parameters on which they depend.
    """

    def __init__(
        self,
        model: Model,
        observations: Observations,
        S: np.ndarray,
        sigma_m: float,
        known: tuple[Mapping[str, float], np.ndarray] | None = None,
    ) -> None:
        self.model, self.observations, self.S, self.sigma_m = model, observations, S, sigma_m
        L = np.linalg.cholesky(S + _scatter(observations, sigma_m))
        self._inverse = np.linalg.inv(L)
        self._log_det = 2.0 * np.log(np.einsum("nii->ni", L)).sum(1)
        self._kept: dict[tuple, OfFlights] = {}
        self.known = known
        self._whole: tuple[Whitening, np.ndarray] | None = None  # whole of a part, and its trials

    def of(self, trials: np.ndarray) -> "Whitening":
        """Whitening of some trials; if all such parts request the same points, `together` predicts the whole once."""
        rows = np.isin(self.observations.trial, trials)
        part = Whitening(self.model, self.observations.select(trials), self.S[rows], self.sigma_m)
        part._whole = self, trials
        return part

    def _part(self, z: Parts, trials: np.ndarray) -> Parts:
        """Whitened residuals of some trials, selected from the residuals z of all trials."""
        o = self.observations
        parts = [part[np.isin(of.trial, trials)] for part, of in zip(z, (o, *o.beside))]
        return *parts[:2], *filter(len, parts[2:])

    @classmethod
    def at(cls, model: Model, values: Mapping[str, float], observations: Observations) -> "Whitening":
        """Whitening with the covariance and the most probable σ_m of the model at `values`."""
        noisy = Comparison(model, values, observations).noisy
        S = noisy.covariance()
        sigma_m = most_probable_scatter(noisy.value, S, observations)
        return cls(model, observations, S, sigma_m, (dict(values), noisy.value))

    def settled(self, values: Mapping[str, float]) -> "Whitening":
        """Copy with the σ_m that is most probable at `values`."""
        R = Comparison(self.model, values, self.observations).R
        sigma_m = most_probable_scatter(R, self.S, self.observations)
        return Whitening(self.model, self.observations, self.S, sigma_m, (dict(values), R))

    def __call__(self, values: Mapping[str, float]) -> Parts:
        """Whitened residuals of impacts (n, m), flights (f, 3), and all further evidence in addition to impacts."""
        return self.many([values])[0]

    def many(self, points: Sequence[Mapping[str, float]]) -> list[Parts]:
        """Whitened residuals, as returned by a call, for each of several sets of values."""
        return together([(self, points)])[0]

    def stacked(self, values: Mapping[str, float]) -> np.ndarray:
        """All whitened residuals as one vector (N,), impacts first."""
        return np.concatenate([part.ravel() for part in self(values)])

    def log_scores(self, values: Mapping[str, float]) -> Parts:
        """Log score in nats of each impact (n,), each flight (f,), and all further evidence in addition to impacts."""
        of_impacts, *others = self(values)
        beside = (log_t(z, np.log(b.variance).sum(1)) for z, b in zip(others, self.observations.beside))
        return log_t(of_impacts, self._log_det), *beside


Request = tuple[Whitening, Sequence[Mapping[str, float]]]


def together(requests: Sequence[Request]) -> list[list[Parts]]:
    """Whitened residuals of one model, for each request at each of its sets of values.

    All impacts are predicted in one call, which takes less than twice the time of one of its many parts.
    """
    of, points = [whitening._whole for whitening, _ in requests], requests[0][1]
    if (
        len(of) > 1
        and of[0]
        and all(part and part[0] is of[0][0] for part in of)
        and all(p == points for _, p in requests)
    ):
        z = of[0][0].many(points)
        return [[whole._part(at, trials) for at in z] for whole, trials in filter(None, of)]
    found, missing = {}, []
    for i, (whitening, points) in enumerate(requests):
        for k, values in enumerate(points):
            known = whitening.known
            if known is not None and known[0] == values:
                found[i, k] = known[1]
            else:
                missing.append((i, k, whitening, values))
    flights = _beside(requests)
    for alike in _of_one_choice(missing):
        model = alike[0][2].model
        R = shared_residuals(model, [(w.observations, flights[i, k][0], values) for i, k, w, values in alike])
        found |= {(i, k): part for (i, k, _, _), part in zip(alike, R)}

    def all_parts(i: int, k: int, w: Whitening, values: Mapping[str, float]) -> Parts:
        o = w.observations
        supports = (beside.whitened(bind(w.model, values, o.rig)) for beside in o.supports)
        return (w._inverse @ found[i, k][:, :, None])[:, :, 0], flights[i, k][1], *supports

    return [[all_parts(i, k, w, at) for k, at in enumerate(points)] for i, (w, points) in enumerate(requests)]


def shared_residuals(
    model: Model, points: Sequence[tuple[Observations, tuple[State, State], Mapping[str, float]]]
) -> list[np.ndarray]:
    """Result of `residuals`, computed in parallel by several processes if contacts in space are integrated.

    The division into parts is fixed, because the last digits depend on it.
    """
    size = max(1, SHARED // max(len(points[0][0]), 1))
    if model.space.is_plane or not kind_of(model).integrated or len(points) <= size:
        return residuals(model, points)
    parts = [points[i : i + size] for i in range(0, len(points), size)]
    return [R for part in each(lambda part: residuals(model, part), parts) for R in part]


def residuals(
    model: Model, points: Sequence[tuple[Observations, tuple[State, State], Mapping[str, float]]]
) -> list[np.ndarray]:
    """Residuals (n, m) at each point (observations, states at impact, values); discrete values must agree."""
    parts, states, values = zip(*points)
    sizes = [len(o) for o in parts]
    all_of = replace(parts[0], **{name: np.concatenate([getattr(o, name) for o in parts]) for name in BESIDE_STATES})
    before, after = (State.joined(list(side)) for side in zip(*states))
    R = Comparison(model, _by_impact(values, sizes), all_of, (before, after)).R
    return np.split(R, np.cumsum(sizes)[:-1])


def _beside(requests: Sequence[Request]) -> dict[tuple[int, int], OfFlights]:
    """States at impact and whitened residuals of flights, for each request at each of its sets of values.

    Results that are not cached are computed in one call, as for the impacts.
    """
    keys = {}  # values on which states at impact and flights depend
    for i, (w, points) in enumerate(requests):
        keys |= {(i, k): (i, tuple(at[p] for p in w.model.flight_parameters)) for k, at in enumerate(points)}
    known: dict[tuple, OfFlights] = {}
    missing: dict[tuple, tuple] = {}
    for (i, k), key in keys.items():
        w, points = requests[i]
        if key[1] in w._kept:
            known[key] = w._kept[key[1]]
        elif key not in missing:
            missing[key] = (*key, w, points[k])
    for alike in _of_one_choice(list(missing.values())):
        whitenings, points = zip(*(one[2:] for one in alike))
        parts = [w.observations for w in whitenings]
        of_all = parts[0] if len(parts) == 1 else parts[0].followed_by(parts[1:])
        model, sizes, of_flights = whitenings[0].model, [len(o) for o in parts], [len(o.flights) for o in parts]
        here = Comparison(model, _by_impact(points, sizes), of_all)
        z = of_all.flights.whitened(bind(model, _by_impact(points, of_flights), of_all.rig))
        ends, ends_of_flights = np.cumsum(sizes), np.cumsum(of_flights)
        for one, end, n, last, m in zip(alike, ends, sizes, ends_of_flights, of_flights):
            rows = np.arange(end - n, end)
            known[one[:2]] = (here.before.select(rows), here.after.select(rows)), z[last - m : last]
    for key in keys.values():
        kept = requests[key[0]][0]._kept
        kept.pop(key[1], None)
        while len(kept) >= KEPT:
            del kept[next(iter(kept))]
        kept[key[1]] = known[key]  # at the end: the least recently used entry is deleted first
    return {at: known[key] for at, key in keys.items()}


def _of_one_choice(missing: Sequence[tuple]) -> list[list[tuple]]:
    """Missing points, grouped by discrete parameters, which must agree for all impacts of a call."""
    parts: dict[tuple, list[tuple]] = {}
    for one in missing:
        *_, whitening, values = one
        chosen = tuple(values[name] for name, p in whitening.model.parameters.items() if p.discrete is not None)
        parts.setdefault(chosen, []).append(one)
    return list(parts.values())


def _by_impact(points: Sequence[Mapping[str, float]], sizes: Sequence[int]) -> dict[str, Any]:
    """Values for all impacts: a number if the points agree, else an array with each point's value `sizes` times."""
    by_name = {name: [values[name] for values in points] for name in points[0]}
    return {name: v[0] if len(set(v)) == 1 else np.repeat(v, sizes) for name, v in by_name.items()}


def robust(z: np.ndarray) -> np.ndarray:
    """Residuals transformed such that their squares add up to −2 log t_ν, except for a constant."""
    m = z.shape[1]
    d2 = np.einsum("nm,nm->n", z, z)
    scale = (NU + m) * np.log1p(d2 / NU) / np.where(d2 > 0, d2, 1.0)
    return z * np.sqrt(np.where(d2 > 0, scale, 1.0))[:, None]


def weight(z: np.ndarray) -> np.ndarray:
    """Square roots (n, 1) of the t distribution's weights, for whitened residuals (n, m)."""
    return np.sqrt((NU + z.shape[1]) / (NU + np.einsum("nm,nm->n", z, z)))[:, None]


def weighted(parts: Parts, prior: np.ndarray) -> Weighted:
    """Cost −2 log t_ν, except for a constant, residuals and weights, including a normal prior (k,)."""
    z = np.concatenate([*(part.ravel() for part in parts), prior])
    roots = np.concatenate([*(np.repeat(weight(part), part.shape[1]) for part in parts), np.ones(len(prior))])
    return Weighted(transformed(parts, prior).cost, z, roots)


def transformed(parts: Parts, prior: np.ndarray) -> Weighted:
    """Cost as in `weighted`, with unit weights and residuals whose squares add up to the cost."""
    z = np.concatenate([*(robust(part).ravel() for part in parts), prior])
    return Weighted(float(z @ z), z, np.ones_like(z))


def log_t(z: np.ndarray, log_det: np.ndarray) -> np.ndarray:
    m = z.shape[1]
    d2 = np.einsum("nm,nm->n", z, z)
    constant = gammaln(0.5 * (NU + m)) - gammaln(0.5 * NU) - 0.5 * m * np.log(NU * np.pi)
    return constant - 0.5 * log_det - 0.5 * (NU + m) * np.log1p(d2 / NU)


def _scatter(observations: Observations, sigma_m: float) -> np.ndarray:
    """Covariance σ_m² D (m, m); with episodes (n, m, m): the scatter after their first hit also moves the pose."""
    space = observations.space
    d, m = space.dimension, space.motions
    variance = np.zeros(2 * m + 1 if observations.arcs else m)
    variance[:d], variance[d:m] = sigma_m**2, (sigma_m / observations.rig.k_g) ** 2
    scatter, span = np.diag(variance), observations.span
    if not span.any():
        return scatter
    scatter = np.tile(scatter, (len(span), 1, 1))
    for i in range(m):
        scatter[:, m + i, m + i] = span**2 * variance[i]
        scatter[:, i, m + i] = scatter[:, m + i, i] = span * variance[i]
    return scatter


def most_probable_scatter(R: np.ndarray, S: np.ndarray, observations: Observations) -> float:
    """Most probable σ_m in m/s for residuals R (n, m) with the covariance S (n, m, m).

    In coordinates in which the scatter affects velocities only, and conditional on the other components, an impact has
    d² = d_0² + Σ e_i²/(λ_i + σ²) and log det S = Σ log(λ_i + σ²) + const, with λ_i eigenvalues of the conditional S.
    """
    space, m, far = observations.space, R.shape[1], np.zeros(len(R))
    v = space.motions
    if m > v:
        span = observations.span[:, None]
        R, S = R.copy(), S.copy()
        R[:, v : 2 * v] -= span * R[:, :v]
        S[:, v : 2 * v] -= span[:, None] * S[:, :v]
        S[:, :, v : 2 * v] -= span[:, None] * S[:, :, :v]
        others, across = R[:, v:, None], S[:, v:, :v]
        solved = np.linalg.solve(S[:, v:, v:], np.concatenate([others, across], axis=2))
        far = np.einsum("nij,nij->n", others, solved[:, :, :1])
        given = np.swapaxes(across, 1, 2) @ solved
        R, S = R[:, :v] - given[:, :, 0], S[:, :v, :v] - given[:, :, 1:]
    unit = np.repeat([1.0, observations.rig.k_g], [space.dimension, space.turns])
    variance, axes = np.linalg.eigh(S * np.outer(unit, unit))
    variance, square = np.maximum(variance, 0.0), (np.swapaxes(axes, 1, 2) @ (unit * R)[:, :, None])[:, :, 0] ** 2

    def loss(log_sigma: float) -> float:
        total = variance + np.exp(2.0 * log_sigma)
        d2 = far + (square / total).sum(axis=1)
        return float(0.5 * np.log(total).sum() + 0.5 * (NU + m) * np.log1p(d2 / NU).sum())

    bounds = (np.log(SIGMA_LOW), np.log(SIGMA_HIGH))
    best = minimize_scalar(loss, bounds=bounds, method="bounded", options={"xatol": 0.05})
    return float(np.exp(best.x))


def given_the_others(R: np.ndarray, S: np.ndarray) -> np.ndarray:
    """Last residual of R (n, m) given the others, in standard deviations (n, 1); their covariance is S (n, m, m).

    For the gap given the poses, with an unknown instant of impact in S, this is the gap where the model's flights meet,
    independent of the detected instant.
    """
    last = np.linalg.inv(S)[:, -1]
    return np.einsum("ni,ni->n", last, R)[:, None] / np.sqrt(last[:, -1:])
