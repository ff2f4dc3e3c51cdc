"""Kinds of contact: how a model predicts the measured states after contacts from the measured states before.

| kind            | for                                           | single hit                                        |
|-----------------|-----------------------------------------------|---------------------------------------------------|
| `ByImpulse`     | any law                                       | impulse where the arcs meet; the pose is kept     |
| `Integrated`    | laws with a force, contacts of finite duration | force or engine, from touch until the body is off |
| `EngineInstant` | engines, instantaneous contacts               | engine for impacts as stated, else `ByImpulse`    |

An episode of several hits is simulated hit by hit, with flights in between (`episodes`); corners that press at the same
time are integrated with springs, or by the engine.  If contacts are integrated, single hits are simulated as well.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from thesis_lib.contact import mirtich
from thesis_lib.critique.contacts.contact_time import DAMPING_RATIO, STICTION_TOLERANCE
from thesis_lib.critique.contacts.dynamics import Dynamics
from thesis_lib.critique.contacts.engine_contact import press_in_engine
from thesis_lib.critique.contacts.engine_in_space import in_engine
from thesis_lib.critique.contacts.episodes import MOST_HITS, Played, contact
from thesis_lib.critique.contacts.model import Model
from thesis_lib.critique.contacts.pressing import press
from thesis_lib.effects.effect import Parameter, Rig
from thesis_lib.mechanics.state import State

BRIEF = 2e-5  # s: least initial τ in fits of integrated contacts; below `SHORTEST` the derivative by τ vanishes
STRUCK = 1e-9  # m/s or rad/s: larger than rounding errors of velocities
FAR = 3.0  # scales from the null; only fits of impulse laws return from farther starts, not of integrated contacts


@dataclass(frozen=True)
class Prediction:
    """Prediction of n impacts by a model, from the measured states before them.

    Attributes:
        v: (n, 3) velocity after, m/s and rad/s.
        touch: (n,) gap in m where the arcs meet, or where an integrated contact fails to begin; NaN if a contact was
            integrated, because `q` then gives the pose; None for impacts as stated.
        q: (n, 3) poses after, m and rad; NaN where the pose is unchanged; None if all are unchanged.
    """

    v: np.ndarray
    touch: np.ndarray | None = None
    q: np.ndarray | None = None

    def each(self, change: Callable[[np.ndarray], np.ndarray]) -> "Prediction":
        """Prediction with `change` applied to each array."""
        touch, q = (array if array is None else change(array) for array in (self.touch, self.q))
        return Prediction(change(self.v), touch, q)


class ByImpulse(Dynamics):
    """Dynamics with single hits resolved by the law's impulse; base class of all kinds."""

    def press(self, true: State, left: np.ndarray | float = 0.0) -> tuple[State, np.ndarray]:
        in_an_engine = bool(self.model.law.engine)
        if in_an_engine and true.space.is_plane:
            return press_in_engine(self, true)
        return press(self, true, left, in_engine if in_an_engine else None)

    def stated(self, before: State, offset: np.ndarray) -> Prediction:
        """Predict impacts that are given by velocities before and after, at one pose; `offset` as in `predict`."""
        return Prediction(self.predict(before, offset).v)

    def between_flights(self, before: State, span: np.ndarray, offset: np.ndarray) -> Prediction:
        """Predict impacts between observed flights; `span` (n,) in s as in `Observations`, 0 for a single hit."""
        n, rows = len(before), np.flatnonzero(span == 0.0)
        v, touch, q = np.empty((n, before.space.motions)), np.zeros(n), None
        if not self.integrated:
            single, own = before.select(rows), self.select(rows)
            after, depth = own.strike(single, offset[rows])
            v[rows], touch[rows] = after.v, own.gap(own.to_true(single)) + depth
        for played, ends in self.played(before, span):
            q = np.full((n, before.space.poses), np.nan) if q is None else q
            v[played], q[played] = ends.v, ends.q
        if self.integrated:  # a body without contact has not moved: only its gap can be compared
            single = before.select(rows)
            struck = (np.abs(v[rows] - single.v) > STRUCK).any(axis=1)
            touch[rows] = np.where(struck, np.nan, self.select(rows).gap(self.select(rows).to_true(single)))
        return Prediction(v, touch, q)

    def played(self, before: State, span: np.ndarray) -> Iterator[tuple[np.ndarray, State]]:
        """Yield rows that are simulated hit by hit, and their measured states at the end."""
        for single in (True, False) if self.integrated else (False,):
            rows = np.flatnonzero((span == 0.0) == single)
            if len(rows):
                yield rows, self.select(rows).end(before.select(rows), span[rows], single)

    def end(self, before: State, span: np.ndarray, single: bool = False) -> State:
        """Measured states (n,) `span` (n,) in s after measured states at the first touch; `single`: after one hit."""
        return self.to_measured(Played(self, self.to_true(before), span, 1 if single else MOST_HITS).after)

    def off(self, touch: State) -> State:
        """True states at the end of contacts of finite duration, from true states at touch (`episodes.contact`)."""
        return contact(self, touch)


class Integrated(ByImpulse):
    """Contacts integrated under the law's force, or by a physics engine."""

    integrated = True


class EngineInstant(ByImpulse):
    """Contacts resolved by a physics engine, treated as instantaneous."""

    def stated(self, before: State, offset: np.ndarray) -> Prediction:
        return Prediction(self.to_measured(self.press(self.to_true(before))[0]).v)


def kind_of(model: Model) -> type[ByImpulse]:
    """Class of dynamics for the contacts of the model."""
    if model.is_compliant:
        return Integrated
    return EngineInstant if model.law.engine else ByImpulse


def bind(model: Model, values: Mapping[str, Any], rig: Rig) -> ByImpulse:
    """Dynamics of the model, of its kind of contact, at the given values: numbers, or arrays (n,) with one per body."""
    return kind_of(model)(model, values, rig)


# start and end of fits of integrated contacts: gradient steps do not reach every optimum


def forerunner(model: Model) -> Model:
    """Model whose fit gives a start: an integrated contact of zero duration has no derivative by its duration."""
    return replace(model, law=replace(model.law, impulse=mirtich.impulse, force=None))


def admitted(values: Mapping[str, float]) -> dict[str, float]:
    """Start values, moved to where the derivatives do not vanish."""
    start, ratio = {**values, "tau": max(values["tau"], BRIEF)}, DAMPING_RATIO
    if start.get(ratio.name, 0.0) > 5.0 * ratio.null:
        start[ratio.name] = ratio.null  # so strong a damper acts as rigid friction for any ratio
    return start


def reaches(p: Parameter) -> bool:
    """Whether a fit recovers from the starting values that an effect declares, if they are wrong."""
    return any(abs(x - p.null) <= FAR * p.scale for x in p.starts)


def withdrawn(values: Mapping[str, float]) -> dict[str, float]:
    """Values for a restart if a step may have gone too far to recover from; {} if none is needed."""
    # such a small tolerance or large damping ratio gives Coulomb friction: the derivative vanishes
    tolerance, ratio = STICTION_TOLERANCE, DAMPING_RATIO
    if values.get(tolerance.name, tolerance.null) < 0.5 * tolerance.null:
        return {tolerance.name: tolerance.null}
    return {ratio.name: ratio.scale} if values.get(ratio.name, ratio.null) > 2.0 * ratio.null else {}
