"""Fit all parameters of a model under the measured noise, and score it.

The fit is an iteratively reweighted Gauss-Newton method (Levenberg-Marquardt) on whitened residuals, with the weights
(ν + m)/(ν + d²) of the t distribution (`whitening`).  At fixed S it maximises the likelihood; S and σ_m are updated
between rounds.
"""

from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import product, zip_longest

import numpy as np

from thesis_lib.critique.contacts.contact_time import CONTACT_TIME
from thesis_lib.critique.contacts.kinds import BRIEF, admitted, forerunner, kind_of, reaches, withdrawn
from thesis_lib.critique.contacts.model import Model, inward
from thesis_lib.critique.likelihood.bounds import SLOPE_STEP, Bound, doubtful, profiled, slip_is_known
from thesis_lib.critique.likelihood.comparison import Comparison
from thesis_lib.critique.likelihood.levenberg_marquardt import ENOUGH, NEAR, levenberg_marquardt
from thesis_lib.critique.likelihood.observations import Observations
from thesis_lib.critique.likelihood.sandwich import sandwich
from thesis_lib.critique.likelihood.whitening import (
    Parts,
    Whitening,
    residuals,
    robust,
    together,
    transformed,
    weight,
    weighted,
)
from thesis_lib.effects.effect import Effect
from thesis_lib.foundation.errors import UserError

ROUNDS = 3  # updates of S, σ_m and weights; the third changes parameters by less than a tenth of their standard error
MOST_TRIES = 4  # starts of a fit; for a discrete parameter all its values, in space the best initial ones
# initial factors on `SLOPE_STEP` for integrated contacts in space: narrow differences would measure the jumps of single
# episodes, where one more corner hits, and not the trend.  The first is a fifth of a parameter's scale
WIDER = (200.0, 40.0, 8.0)
SHAPES = 2  # number of an effect's shapes (starting values) that are fitted, the best by score test
ENOUGH_SINGLE = 30  # single hits that suffice for a first fit without episodes
# one sigma of the systematic error of a model with contact times, relative to an effect's size.  Of the first 144
# parameters of the headline (MuJoCo, Drake, our own simulator) 90 % were in their intervals without it, 95 % with it
OF_MODEL = 0.006
Noise = tuple[np.ndarray, float]  # S (n, m, m) without scatter, and σ_m in m/s
NO_PRIOR = np.zeros(0)
FLAT = 3.0  # nats; friction that gains less than this over universal sticking has a lower bound only


@dataclass(frozen=True)
class Fit:
    """A fitted model.

    Attributes:
        values: parameter values by full name.
        score: log score of the training data, nats; n: number of impacts.
        whitening: residuals at the last S and σ_m.
        seen: impacts from which bounds are determined, possibly more than were fitted; None: the fitted impacts.
    """

    model: Model
    values: dict[str, float]
    score: float
    n: int
    whitening: Whitening = field(repr=False)
    seen: Observations | None = field(default=None, repr=False)

    @property
    def sigma_m(self) -> float:
        """Scatter beyond noise, m/s."""
        return self.whitening.sigma_m

    def on(self, observations: Observations) -> Comparison:
        """Comparison of the fitted model with observations."""
        return Comparison(self.model, self.values, observations)

    @cached_property
    def _sandwich(self) -> tuple[np.ndarray, np.ndarray]:
        free = self.model.fitted_parameters
        least = np.array([SLOPE_STEP * p.scale for p in free.values()])
        found = sandwich(self.whitening, self.values, least)
        if not kind_of(self.model).integrated:
            return found
        # wider steps reduce the influence of jumps of episodes
        return sandwich(self.whitening, self.values, np.fmax(np.sqrt(np.diag(found[0])), least))

    @property
    def covariance(self) -> np.ndarray:
        """Covariance (p, p) of the fitted parameters, in order, from the scatter of impacts; `std` includes more."""
        return self._sandwich[0]

    @cached_property
    def std(self) -> dict[str, float]:
        """Standard errors by full parameter name; 0 for discrete parameters, NaN where there is only a bound.

        They include noise, model errors that vary from trial to trial (`sandwich`), and `OF_MODEL`.
        """
        errors = {name: np.nan if isinstance(said, Bound) else said for name, said in self._profiles.items()}
        scatter = self._curvatures | errors
        if self.values.get(CONTACT_TIME.name, 0.0) > BRIEF:
            for name, p in self.model.fitted_parameters.items():
                if "." in name and not p.along:
                    size = self.values[name] - p.absent_at(self.values)
                    scatter[name] = float(np.hypot(scatter[name], OF_MODEL * size))
        return scatter

    @property
    def bounds(self) -> dict[str, Bound]:
        """Bounds by full name, for parameters that the data limit from one side only (`bounds`)."""
        return {name: said for name, said in self._profiles.items() if isinstance(said, Bound)}

    @cached_property
    def _curvatures(self) -> dict[str, float]:
        errors = self._sandwich[1].tolist()
        return dict.fromkeys(self.values, 0.0) | dict(zip(self.model.fitted_parameters, errors))

    @cached_property
    def _profiles(self) -> dict[str, Bound | float]:
        """Bounds or standard errors from the profile, for parameters whose standard error may be meaningless."""
        free, whitening = self.model.fitted_parameters, self.whitening
        names = [name for name, p in free.items() if doubtful(p, self.values[name], self._curvatures[name])]
        if names and self.seen is not None:
            whitening = Whitening(self.model, self.seen, self.on(self.seen).covariance(), self.sigma_m)
        said = {name: profiled(whitening, self.values, name) for name in names}
        o = whitening.observations
        unseen = o.spin > 0.0 and not slip_is_known(self.on(o))
        return said | ({"mu": Bound("lower", free["mu"].low)} if unseen else {})

    def content(self, name: str) -> dict:
        """Entry of a parameter in a file: value, std and unit.

        A bound also has its kind, the range that was searched, and the value used in predictions.
        """
        p, bound = self.model.parameters[name], self.bounds.get(name)
        if bound is None:
            return {"value": self.values[name], "std": self.std[name], "unit": p.unit}
        said = {"value": bound.value, "std": None, "unit": p.unit, "bound": bound.kind}
        return said | {"used": self.values[name], "range": [p.low, p.high]}

    @property
    def base(self) -> str:
        """Name of the law."""
        return self.model.law.name

    @property
    def effects(self) -> tuple[Effect, ...]:
        """Effects in the order in which they were selected."""
        return self.model.effects


def fit(
    model: Model,
    observations: Observations,
    start: Mapping[str, float] | None = None,
    rounds: int = ROUNDS,
    noise: Noise | None = None,
) -> Fit:
    """Fit all parameters from `start` (nulls if absent) and from every start that the last effect declares or finds.

    `noise` is the noise of a fit without the last effect, sufficient for a first round in which the effect is small.

    UserError if there are no impacts.
    """
    if not len(observations):
        raise UserError(
            f"There are no impacts to fit {model.law.title} to: none were found, or all were left out "
            "(thesis-lib datasets check DATASET lists them with reasons)."
        )
    return _Search(model, observations).best(start or {}, rounds, noise)


def seeing(fitted: Fit, observations: Observations) -> Fit:
    """Copy of the fit with parameter bounds from the given impacts, which include the fitted impacts.

    If none of the fitted impacts slips, but another impact does, the model is fitted to all of them.
    """
    if fitted.values["mu"] == fitted.model.parameters["mu"].high:
        start = {name: value for name, value in fitted.values.items() if name not in ("mu", "epsilon")}
        again = fit(fitted.model, observations, start)
        if again.values["mu"] < fitted.values["mu"]:
            return again
    return replace(fitted, seen=observations)


def fit_each(
    model: Model,
    tasks: Sequence[tuple[Observations, Mapping[str, float]]],
    rounds: int = ROUNDS,
    noise: Sequence[Noise | None] = (),
    most: int | None = None,
) -> list[Fit]:
    """Fit each of several observations of one rig from its own start; the fits advance together step by step.

    `noise` is the noise in the first round of each fit, if known.  Only the `most` fits with the best start continue.
    """
    return _step_by_step(
        [
            _fitting(model, observations, start, rounds, known)
            for (observations, start), known in zip_longest(tasks, noise)
        ],
        most,
    )


def fit_parts(whitening: Whitening, start: Mapping[str, float], parts: Sequence[np.ndarray]) -> list[Fit]:
    """Refit the model of a fit to each of several subsets of its trials, starting from its result.

    S is kept from all trials, and only σ_m is updated: in space S takes as long as a fit, and hardly differs.
    """
    return _step_by_step([_fitting_part(whitening.of(trials), start) for trials in parts])


Search = Generator[tuple[Whitening, list[dict[str, float]]], list[Parts], Fit]


def _step_by_step(each: Sequence[Search], most: int | None = None) -> list[Fit]:
    """Results of several searches that share their calls; only of the `most` with the best start."""
    fits: dict[int, Fit] = {}
    searches = dict(enumerate(each))
    asked = {i: next(search) for i, search in searches.items()}
    while asked:
        answers = dict(zip(asked, together(list(asked.values()))))
        if most is not None and len(asked) > most:  # the first residuals, of one point each
            costs = {i: np.nan_to_num(weighted(z, NO_PRIOR).cost, nan=np.inf) for i, (z,) in answers.items()}
            asked = {i: asked[i] for i in sorted(sorted(costs, key=costs.__getitem__)[:most])}
        for i in list(asked):
            try:
                asked[i] = searches[i].send(answers[i])
            except StopIteration as end:
                fits[i] = end.value
                del asked[i]
    return [fits[i] for i in sorted(fits)]


def _fitting(
    model: Model, observations: Observations, start: Mapping[str, float], rounds: int, noise: Noise | None
) -> Search:
    """Fit from one start: a generator that yields the points it needs and receives their whitened residuals."""
    values = {name: float(start.get(name, p.null)) for name, p in model.parameters.items()}
    for k in range(rounds):
        given = noise if k == 0 else None
        whitening = Whitening(model, observations, *given) if given else Whitening.at(model, values, observations)
        wider = WIDER if jumps(model) and len(observations.single) < ENOUGH_SINGLE else ()
        values = yield from _round(whitening, values, ENOUGH if rounds > 1 else NEAR, wider)
    return _fitted(Whitening.at(model, values, observations), values)


def _fitting_part(whitening: Whitening, start: Mapping[str, float]) -> Search:
    """Fit from one start in a single round, at known S."""
    values = yield from _round(whitening, start, NEAR)
    return _fitted(whitening.settled(values), values)


def _round(
    whitening: Whitening, values: Mapping[str, float], enough: float, wider: Sequence[float] = ()
) -> Generator[tuple[Whitening, list[dict[str, float]]], list[Parts], dict[str, float]]:
    """Most probable values at known S and σ_m, from initial values."""
    model, free = whitening.model, whitening.model.fitted_parameters
    low, high = (np.array([getattr(p, bound) for p in free.values()]) for bound in ("low", "high"))
    step = np.array([SLOPE_STEP * p.scale for p in free.values()])
    x = np.clip([values[name] for name in free], low, high)
    unseen = model.unseen(whitening.observations.rig)  # directions held at 0
    left = transformed if model.space.is_plane else weighted  # planar fits end near the noise: both are fast
    search = levenberg_marquardt(x, low, high, step, enough, wider)
    points = next(search)
    while points:
        found = yield whitening, [{**values, **dict(zip(free, point.tolist()))} for point in points]
        try:
            points = search.send([left(z, unseen @ point) for z, point in zip(found, points)])
        except StopIteration as end:
            x, points = end.value, []
    return {**values, **dict(zip(free, x.tolist()))}


def _fitted(whitening: Whitening, values: dict[str, float]) -> Fit:
    """Fit with the final `values`."""
    model, observations = whitening.model, whitening.observations
    score = float(sum(part.sum() for part in whitening.log_scores(values)))
    return Fit(model, values, score, len(observations), whitening)


def jumps(model: Model) -> bool:
    """Whether the predictions for episodes are discontinuous in the parameters by more than the noise."""
    return kind_of(model).integrated and not model.space.is_plane


class _Search:
    """Fits of one model to observations from all promising starts."""

    def __init__(self, model: Model, observations: Observations) -> None:
        self.model, self.observations, self.integrated = model, observations, kind_of(model).integrated
        # parameters of the effect that was added last
        self.sizes = {
            f"{effect.name}.{p.name}": p for effect in model.effects[-1:] for p in model.parameters_of(effect)
        }

    def best(self, start: Mapping[str, float], rounds: int, noise: Noise | None) -> Fit:
        """Best fit; see `fit`."""
        o, most = self.observations, self.model.parameters["mu"].high
        if self.integrated and "tau" not in start:
            start = fit(forerunner(self.model), o, start, rounds=1).values
        tries = self._with_sizes(self._with_friction(admitted(start) if self.integrated else dict(start)))
        if not self.sizes.keys() & start.keys() and self.sizes and tries[0].get("mu") == most:
            # contacts that stick without the effect may slip with it
            tries = [t | basin for t in tries[:2] for basin in ({}, self._basins(o, t)[0])]
        if "mu" not in tries[0]:
            # single hits find the basin: episodes are strongly nonlinear far from the optimal (μ, ε)
            simple = o.single if len(o.single) >= ENOUGH_SINGLE else o
            tries = [t | basin for t in tries for basin in self._basins(simple, t)]
            tries = [self._best_of([(simple, t) for t in tries], 1, most=self._most).values]
        # the noise of a fit without the last effect is valid while the effect is small
        tries = tries[: max(MOST_TRIES, *(len(p.options) for p in self.sizes.values()), 0)]
        small = [all(abs(t[name] - p.null) <= p.scale for name, p in self.sizes.items()) for t in tries]
        first = [noise if is_small else None for is_small in small]
        found = self._best_of([(o, t) for t in tries], rounds, first, self._most)
        if rounds > 1 or "mu" not in start:
            found = self._stuck(found, most)
        back = withdrawn(found.values) if self.integrated else {}
        again = fit_each(self.model, [(o, found.values | back)], rounds) if back else []
        return max(found, *again, key=lambda fitted: fitted.score) if again else found

    @property
    def _most(self) -> int | None:
        """Number of starts that are fitted to the end: the best for a discrete parameter in space, else all (None)."""
        is_discrete = any(p.discrete is not None for p in self.sizes.values())
        return MOST_TRIES if is_discrete and not self.model.space.is_plane else None

    def _best_of(
        self, tasks: Sequence, rounds: int, noise: Sequence[Noise | None] = (), most: int | None = None
    ) -> Fit:
        """Best of the fits that `fit_each` returns."""
        # a wrongly read rotation may have the score NaN
        return max(
            fit_each(self.model, tasks, rounds, noise, most),
            key=lambda fitted: np.nan_to_num(fitted.score, nan=-np.inf),
        )

    def _with_friction(self, start: dict[str, float]) -> dict[str, float]:
        """`start` with the best starting values of missing friction parameters.

        Only in space, where engines have their usual impedance: a fit from near 0 ends below it.
        """
        free = [p for p in self.model.of_friction if p.name not in start and p.starts]
        if "mu" not in start or self.model.space.is_plane:
            return start
        values = {name: p.null for name, p in self.model.parameters.items()} | start
        o = self.observations.single if len(self.observations.single) >= ENOUGH_SINGLE else self.observations
        for p in free:
            options = ({**values, p.name: x} for x in (p.null, *p.starts))
            start = {**start, p.name: min(options, key=lambda at: _cost(o, Comparison(self.model, at, o).R))[p.name]}
        return start

    def _with_sizes(self, start: dict[str, float]) -> list[dict[str, float]]:
        """Starts with added parameters of the last effect if `start` does not contain them."""
        is_new = not self.sizes.keys() & start.keys()
        tries = self._best_shapes(start) if is_new and self.sizes else []
        tries = tries or [start]
        for key, p in self.sizes.items():
            if key in tries[0]:  # known already
                continue
            if p.discrete is not None:
                tries = [{**t, key: option} for t in tries for option in p.options]
            else:
                # away from the null, where the derivatives of many effects vanish
                either_side = (p.null + p.scale, p.null - p.scale)
                starts = p.starts[:2] if not self.integrated or reaches(p) else ()
                options = starts or either_side[: 2 if p.low < p.null < p.high else 1]
                tries = [{**t, key: float(np.clip(x, p.low, p.high))} for t in tries for x in options]
        return tries

    def _best_shapes(self, start: Mapping[str, float]) -> list[dict[str, float]]:
        """Starts at the best `shapes` of the last effect, other parameters from their score test; [] without shapes.

        If `start` lacks (μ, ε), the model without the effect is fitted first.
        """
        model, o, effect = self.model, self.observations, self.model.effects[-1]
        shapes = effect.shapes(o.lines(0), o.rig)
        if not shapes:
            return []
        smaller = replace(model, effects=model.effects[:-1])
        if "mu" not in start:
            start = fit(smaller, o, start, rounds=1).values
        at = {name: p.null for name, p in model.parameters.items()} | dict(start)
        whitening = Whitening.at(model, at, o)
        here = whitening(at)

        free = [(name, inward(p, at[name], SLOPE_STEP * p.scale)) for name, p in smaller.fitted_parameters.items()]
        sizes = {name: p for name, p in self.sizes.items() if p.name not in shapes[0]}
        shaped = [at | {f"{effect.name}.{name}": value for name, value in shape.items()} for shape in shapes]
        moves = [(at, *move) for move in free]
        moves += [(values, name, p.scale) for values in shaped for name, p in sizes.items()]
        moved = whitening.many([{**values, name: values[name] + step} for values, name, step in moves])
        columns = [
            np.concatenate([(weight(z) * (m - z) / step).ravel() for z, m in zip(here, there)])
            for there, (_, _, step) in zip(moved, moves)
        ]
        residual = np.concatenate([(weight(z) * z).ravel() for z in here])
        fitted, of_shapes = columns[: len(free)], iter(columns[len(free) :])
        found = []
        for values in shaped:
            A = np.stack(fitted + [next(of_shapes) for _ in sizes], axis=1)
            x = np.linalg.lstsq(A, -residual, rcond=None)[0]
            best = {
                name: float(np.clip(p.null + d, p.low, p.high)) for (name, p), d in zip(sizes.items(), x[len(fitted) :])
            }
            found.append((float(np.sum((residual + A @ x) ** 2)), values | best))
        return [values for _, values in sorted(found, key=lambda pair: pair[0])[:SHAPES]]

    def _stuck(self, found: Fit, most: float) -> Fit:
        """The fit or, if the data are consistent with sticking throughout, the fit with the largest μ."""
        if found.values["mu"] == most:
            return found
        here, sticking = found.whitening.many([found.values, {**found.values, "mu": most}])
        costs = [sum(float(np.sum(robust(part) ** 2)) for part in z) for z in (here, sticking)]
        if not 0.5 * (costs[1] - costs[0]) < FLAT:
            return found
        stuck = fit_each(self.model, [(self.observations, {**found.values, "mu": most})], 1)[0]
        return stuck if stuck.values["mu"] == most and stuck.score > found.score - FLAT else found

    def _basins(self, o: Observations, start: Mapping[str, float]) -> list[dict[str, float]]:
        """Starts (μ, ε): the best on a grid by `_cost`, and two with less friction, where more contacts slide."""
        values = {name: p.null for name, p in self.model.parameters.items()} | dict(start)
        here = Comparison(self.model, values, o)
        states = here.before, here.after

        def best(pairs: Sequence[tuple[float, float]]) -> tuple[float, float]:
            points = [(o, states, {**values, "mu": mu, "epsilon": epsilon}) for mu, epsilon in pairs]
            costs = [_cost(o, R) for R in residuals(self.model, points)]
            return min(zip(costs, pairs), key=lambda found: found[0])[1]

        mu, epsilon = best(list(product((0.02, 0.05, 0.1, 0.2, 0.4, 0.8), (0.2, 0.4, 0.6, 0.8))))
        mu, _ = best([(mu * 2.0 ** (i / 4.0), epsilon) for i in range(-4, 5)])
        return [{"mu": factor * mu, "epsilon": epsilon} for factor in (1.0, 0.5, 0.2)]


def _cost(o: Observations, R: np.ndarray) -> float:
    """Mean error in velocity over the better 90 % of the impacts in m/s, from their residuals (n, m).

    A median would ignore μ if more than half of them stick, and a fit cannot leave a μ at which all stick.
    """
    k, d, m = o.rig.k_told, o.space.dimension, o.space.motions
    size = np.abs(R)
    error = np.sort(size[:, :d].sum(axis=1) + k * size[:, d:m].sum(axis=1))
    return float(error[: max(1, round(0.9 * len(error)))].mean())
