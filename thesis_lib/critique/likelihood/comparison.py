"""Comparison of a model at given values with observations: predictions, residuals and their covariance due to noise.

The residual of an impact has three components, measured minus predicted velocity after impact ("impact").  Trajectories
add four: pose after minus before (3, "meet") and gap at impact (1, "touch").  The residual of an episode is measured
minus predicted velocity and pose where the flight after it begins; its touch is solved for: the last component is 0.
For a single hit with an integrated contact the pose is also predicted; the last component is then the distance between
the measured arcs where they should meet.
Evidence in addition to impacts has its own residuals (`beside`).

The covariance S (`covariance`) includes the noise of *all* data, also of the inputs of a law.  If the spin before an
impact was not measured, the prediction is the mean over the plausible spins (`SPINS`), and S includes the scatter due
to the spin.  An error in m/s must not include this scatter either.  With S_ω the scatter due to the spin, and R the
residual of the velocity,

    R − E[R(ω) | R] = (1 − S_ω S⁻¹) R = S_0 S⁻¹ R,    S = S_0 + S_ω,

is the remaining residual after removal of the most probable spin (`velocity_left`); it equals R if friction is at its
limit for any spin.  Episodes are nonlinear: which corner hits first may depend on a milliradian.  Their covariance is
of second order in the noise, and does not contain κ, because their touch is solved for.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.polynomial.hermite_e import hermegauss

from thesis_lib.critique.contacts.contact_time import TURNED
from thesis_lib.critique.contacts.dynamics import Dynamics
from thesis_lib.critique.contacts.kinds import ByImpulse, Prediction, bind
from thesis_lib.critique.contacts.model import Model
from thesis_lib.critique.likelihood.at_impact import state_beside
from thesis_lib.critique.likelihood.covariance import INSTANT, Noisy, copies_moved, noisy
from thesis_lib.critique.likelihood.observations import Observations
from thesis_lib.foundation.forked import each
from thesis_lib.mechanics.state import State

# nodes (turns, k) of an unknown spin in standard deviations, and their weights for a normal distribution (Gauss and
# Hermite), by dimension; in space about horizontal axes: a ball's spin about the normal does not affect friction
_NODES, _WEIGHTS = hermegauss(7)
_FEWER, _OF_FEWER = hermegauss(5)
SPINS = {2: _NODES[None], 3: np.array([*(axis.ravel() for axis in np.meshgrid(_FEWER, _FEWER)), np.zeros(25)])}
_OF_SPIN = {len(w): w / w.sum() for w in (_WEIGHTS, np.outer(_OF_FEWER, _OF_FEWER).ravel())}
_LEAST = 1e-18  # (m/s)²
SHARED = 1000  # impacts in one unit of work of parallel processes: a tenth of a second with integrated contacts
COPIES = 25  # of an episode in space, shifted to both sides along each principal axis of its noise
KEPT = 8  # cached points of observations: a fit ends where the next begins


class Comparison:
    """A model at given values, compared with observations; every result is computed once, on demand.

    `values` are numbers, or arrays (n,) with one entry per impact; `states` are the measured states just before and
    after impact; by default they are extrapolated with the model's flight.
    """

    def __init__(
        self,
        model: Model,
        values: Mapping[str, Any],
        observations: Observations,
        states: tuple[State, State] | None = None,
    ) -> None:
        self.dynamics, self.observations, self._states = bind(model, values, observations.rig), observations, states

    def on(self, observations: Observations) -> "Comparison":
        """Comparison of the same model with other observations."""
        return Comparison(self.dynamics.model, self.dynamics.values, observations)

    @cached_property
    def before(self) -> State:
        """Measured states just before impact."""
        return self._states[0] if self._states else state_beside(self.dynamics, self.observations, 0)

    @cached_property
    def after(self) -> State:
        """Measured states just after impact."""
        return self._states[1] if self._states else state_beside(self.dynamics, self.observations, 1)

    @property
    def at_impulse(self) -> tuple[State, State]:
        """Measured states before and after, with the pose that the body has reached when the impulse acts.

        The sense of rotation is that of the camera.
        """
        before, after = self.before, self.after
        if not (self.dynamics.model.takes_time and self.observations.arcs):
            return before, after
        turn = TURNED * self.dynamics.delay(self.dynamics.to_true(before)) * (after.spin - before.spin)
        first, last = (
            state.changed(attitude=state.space.attitude_after(state.attitude, turn)) for state in (before, after)
        )
        return first, last

    @cached_property
    def prediction(self) -> Prediction:
        """Prediction from the states before impact, averaged over the spin before if it is unknown."""
        if self.observations.spin:
            return self.by_spin.each(over_spins)
        return _predicted(self.dynamics, self.observations, self.before)

    @cached_property
    def by_spin(self) -> Prediction:
        """Predictions, each array (m, n, ...), at the unknown spins `SPINS` times their standard deviation."""
        o, before, spins = self.observations, self.before, SPINS[self.observations.space.dimension]
        m = spins.shape[1]
        rows = np.tile(np.arange(len(before)), m)
        spun = before.select(rows)
        spun = spun.changed(spin=spun.spin + o.spin * np.repeat(spins, len(before), axis=1))
        of_all = replace(o, span=o.span[rows], offset=o.offset[rows])
        found = _predicted(self.dynamics.select(rows), of_all, spun)
        return found.each(lambda array: array.reshape(m, len(before), *array.shape[1:]))

    @cached_property
    def R(self) -> np.ndarray:
        """Residuals (n, 7 or 3): impact (m/s, m/s, rad/s), meet (m, m, rad), touch (m)."""
        return compare(self.dynamics, self.before, self.after, self.prediction)

    @cached_property
    def of_spin(self) -> np.ndarray:
        """Covariance (n, 7 or 13, 7 or 13) of the residuals of single hits due to an unmeasured spin."""
        v, q, space = self.by_spin.v, self.by_spin.q, self.observations.space
        d, m = space.dimension, space.motions
        R = np.zeros((len(v), len(self.observations), 2 * m + 1))
        R[:, :, :m] = v - over_spins(v)
        if q is not None:
            moved = d + space.turns * space.is_plane  # the turn of a ball is not observed
            R[:, :, m : m + moved] = np.nan_to_num(q - over_spins(q))[:, :, :moved]
        return over_spins(R[..., :, None] * R[..., None, :])

    @property
    def velocity_left(self) -> np.ndarray:
        """Residual (n, d + turns) in m/s, rad/s of the velocity after impact that an unknown spin cannot explain."""
        return self.left_over(self.R[:, : self.observations.space.motions])

    def left_over(self, R: np.ndarray) -> np.ndarray:
        """Part of residuals R (..., n, d + turns) that an unknown spin cannot explain; R if the spin is measured."""
        return np.einsum("nij,...nj->...ni", self.what_is_left, R) if self.observations.spin else R

    @property
    def what_is_left(self) -> np.ndarray:
        """Matrices (n, d + turns, d + turns) that remove what an unknown spin explains, and the spin after impact."""
        o = self.observations
        d, m = o.space.dimension, o.space.motions
        if not o.spin:
            return np.tile(np.eye(m), (len(o), 1, 1))
        S = self.covariance(o.t_std)[:, :d, :d]
        S_0 = S - self.of_spin[:, :d, :d]
        left = np.zeros((len(o), m, m))
        left[:, :d, :d] = S_0 @ np.linalg.inv(S + _LEAST * np.eye(d))
        return left

    @cached_property
    def noisy(self) -> Noisy:
        """Residuals with their covariance due to noise; the observations cache the results of the last few points."""
        kept, model, values = self.observations.noisy, self.dynamics.model, self.dynamics.values
        if any(isinstance(value, np.ndarray) for value in values.values()):
            return self._noisy()
        found = next((known for of, at, known in kept if at == values and of == model), None)
        if found is None:
            found = self._noisy()
            kept.append((model, dict(values), found))
            del kept[:-KEPT]
        return found

    def _noisy(self) -> Noisy:
        o = self.observations
        if o.spin:
            found = self._of_single()
            return replace(found, noise=found.noise + self.of_spin)
        if not o.span.any():
            return self._of_single()
        m = 2 * o.space.motions + 1
        whole = Noisy(*(np.zeros((len(o), m) + (m,) * k) for k in (0, 1, 0)))
        parts = []
        for rows, of_part in ((o.span == 0.0, Comparison._of_single), (o.span != 0.0, Comparison._of_episodes)):
            count = 1
            if self.dynamics.integrated and not o.space.is_plane:  # slow: shared by parallel processes
                count += np.count_nonzero(rows) * COPIES // SHARED
            parts += [(some, of_part) for some in np.array_split(np.flatnonzero(rows), count) if len(some)]
        for (rows, _), found in zip(parts, each(lambda part: part[1](self.on(o.rows(part[0]))), parts)):
            whole.value[rows], whole.noise[rows], whole.by_instant[rows] = found.value, found.noise, found.by_instant
        return whole

    def covariance(self, instant: np.ndarray | float = INSTANT) -> np.ndarray:
        """Covariance S (n, m, m) of the residuals without σ_m; `instant` as in `Noisy.covariance`."""
        return self.noisy.covariance(instant)

    def _of_single(self) -> Noisy:
        """Residuals of single hits; copies that differ only after the hit share its prediction."""
        o, has_arc = self.observations, self.dynamics.model.has_arc
        n, moves, copies = len(o), 4 * o.space.motions, copies_moved(o, has_arc)
        after = self.on(copies.part(slice((moves + 2) * n), has_arc)).after
        given = self.on(copies.part(slice(moves * n, None), has_arc))
        # index of the state of each copy in `given` and `after`
        row = np.arange((moves + 2) * n)
        at = np.concatenate([np.tile(row[:n], moves), row])
        of = np.concatenate([row, np.tile(row[moves * n : (moves + 1) * n], moves)])
        prediction = given.prediction.each(lambda array: array[at])
        found = noisy(o, compare(self.dynamics, given.before.select(at), after.select(of), prediction))
        if o.touch_std:
            found.noise[:, -1, -1] += o.touch_std**2
        return found

    def _of_episodes(self) -> Noisy:
        """Residuals of episodes, the last component with unit variance.

        Residuals r± at one standard deviation ±σ_i along the principal axes i of the noise give, to second order,

            S = Σ_i (l_i l_iᵀ + 2 b_i b_iᵀ),    l_i = (r₊ − r₋)/2,    b_i = (r₊ + r₋)/2 − r_0
        """
        o, has_arc, space = self.observations, self.dynamics.model.has_arc, self.observations.space
        m, n = space.motions, len(o)
        copies, value, S = 4 * m + 1, np.zeros((n, 2 * m + 1)), np.zeros((n, 2 * m + 1, 2 * m + 1))
        S[:, -1, -1] = 1.0
        ends = []
        for side in (0, 1):
            moved = o.tiled(copies, has_arc)
            values, slopes = (array.reshape(copies, n, 2, -1)[:, :, side] for array in (moved.value, moved.slope))
            for j, step in enumerate(self._principal_steps(side)):
                for k, sign in ((2 * j, 1.0), (2 * j + 1, -1.0)):
                    values[k] = space.shift(values[k].T, sign * step[:, :, 0].T).T
                    slopes[k] += sign * step[:, :, 1]
            state = state_beside(self.dynamics, moved, side)
            if side == 0:
                state = self.dynamics.end(state, moved.span)
            here = state.select(np.arange((copies - 1) * n, copies * n))
            off = space.difference(state.pose, np.tile(here.pose, copies)).T
            r = np.concatenate([state.v, off], axis=1).reshape(copies, n, 2 * m)
            up, down, middle = r[0:-1:2], r[1:-1:2], r[-1]
            for part in (0.5 * (up - down), np.sqrt(2.0) * (0.5 * (up + down) - middle)):
                S[:, :-1, :-1] += np.einsum("inj,ink->njk", part, part)
            ends.append(here)
        value[:, :-1] = np.concatenate([ends[1].v - ends[0].v, space.difference(ends[1].pose, ends[0].pose).T], axis=1)
        return Noisy(value, S, np.zeros_like(value))

    def _principal_steps(self, side: int) -> Iterator[np.ndarray]:
        """Yield steps (n, channels, value or slope) of one standard deviation along each principal axis of the noise of
        one side."""
        o = self.observations
        for channels, cov in o.blocks:
            variance, axes = np.linalg.eigh(cov[:, side])
            for i in range(axes.shape[2]):
                step = np.zeros((len(o), o.space.motions, 2))
                sigma = np.sqrt(np.maximum(variance[:, i], 0.0))[:, None] * axes[:, :, i]
                step[:, channels] = sigma.reshape(len(o), -1, 2)
                yield step


def over_spins(values: np.ndarray) -> np.ndarray:
    """Mean (...) over `SPINS` of values (m, ...)."""
    return np.tensordot(_OF_SPIN[len(values)], values, axes=1)


def _predicted(dynamics: ByImpulse, o: Observations, before: State) -> Prediction:
    """Prediction from the states `before` impact."""
    return dynamics.between_flights(before, o.span, o.offset) if o.arcs else dynamics.stated(before, o.offset)


def compare(dynamics: Dynamics, before: State, after: State, prediction: Prediction) -> np.ndarray:
    """Residuals R of measured states `before` and `after` impacts, as in `Comparison.R`."""
    dv = after.v - prediction.v
    if prediction.touch is None:
        return dv
    space = after.space
    meet = space.difference(after.pose, before.pose).T - dynamics.jump(before, after)
    if prediction.q is not None:
        played = ~np.isnan(prediction.q[:, 0])
        meet[played] = space.difference(after.pose[:, played], prediction.q[played].T).T
    touch, rows = prediction.touch.copy(), np.flatnonzero(np.isnan(prediction.touch))
    if len(rows):
        touch[rows] = _apart(dynamics.select(rows), before.select(rows), after.select(rows))
    return np.concatenate([dv, meet, touch[:, None]], axis=1)


def _apart(dynamics: Dynamics, before: State, after: State) -> np.ndarray:
    """Distance (n,) in m of the measured arcs normal to the surface, where they should meet.

    It does not depend on integrated contacts; an impact law compares it instead of the pose after impact.  With the
    factor v_n⁻ / (v_n⁺ − v_n⁻), both sets of residuals have the same volume, and their likelihoods are comparable.  If
    an effect (a time lag) implies that the body does not separate, the factor is that for v_n⁺ = 0.
    """
    true = [dynamics.to_true(state) for state in (before, after)]
    gaps, rates = zip(*((dynamics.gap(state), dynamics.contact(state)[1].v_n) for state in true))
    apart = np.maximum(rates[1] - rates[0], np.abs(rates[0]))
    unit = np.divide(rates[0], apart, out=-np.ones_like(apart), where=apart > 0.0)
    return unit * (gaps[1] - gaps[0])
