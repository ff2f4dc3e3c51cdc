"""Kinds of contact: how a model gets from the measured states before contacts to those after them.

| kind            | of a law                                    | a single hit                                        |
|-----------------|---------------------------------------------|-----------------------------------------------------|
| `ByImpulse`     | any                                         | its impulse where the arcs meet; the pose stays     |
| `Integrated`    | with a force, where contacts take time      | its force, or its engine, from touch until it is off |
| `EngineInstant` | that is an engine, where they take none     | the engine's of impacts as stated, else `ByImpulse` |

What is not one hit is played (`episodes`): the hits of an episode in turn, with flight between; corners that press at
once are integrated with springs, or by the engine.  Where a contact is integrated, single hits are played as well.
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

BRIEF = 2e-5  # s: least τ at which fits of integrated contacts start; below `SHORTEST` there is no slope along τ
STRUCK = 1e-9  # m/s or rad/s: rounding changes velocities by less
FAR = 3.0  # scales from the null; no fit of an integrated contact comes back from there, that of an impulse law does


@dataclass(frozen=True)
class Prediction:
    """Prediction of n impacts by a model, from the measured states before them.

    Attributes:
        v: (n, 3) velocity after, m/s and rad/s.
        touch: (n,) gap in m that is left where the arcs meet, or where an integrated contact does not begin; NaN where
            a contact was integrated and `q` says where the body is; None of impacts as stated.
        q: (n, 3) poses after, m and rad, NaN where they are those before; None if all are.
    """

    v: np.ndarray
    touch: np.ndarray | None = None
    q: np.ndarray | None = None

    def each(self, change: Callable[[np.ndarray], np.ndarray]) -> "Prediction":
        """The prediction with each of its arrays changed."""
        touch, q = (array if array is None else change(array) for array in (self.touch, self.q))
        return Prediction(change(self.v), touch, q)


class ByImpulse(Dynamics):
    """Single hits by the law's impulse; the base of all kinds."""

    def press(self, true: State, left: np.ndarray | float = 0.0) -> tuple[State, np.ndarray]:
        in_an_engine = bool(self.model.law.engine)
        if in_an_engine and true.space.is_plane:
            return press_in_engine(self, true)
        return press(self, true, left, in_engine if in_an_engine else None)

    def stated(self, before: State, offset: np.ndarray) -> Prediction:
        """Of impacts that are stated with the velocities before and after, at one pose; `offset` as in `predict`."""
        return Prediction(self.predict(before, offset).v)

    def between_flights(self, before: State, span: np.ndarray, offset: np.ndarray) -> Prediction:
        """Of what flights before and after show; `span` (n,) in s as in `Observations`, 0 of a single hit."""
        n, rows = len(before), np.flatnonzero(span == 0.0)
        v, touch, q = np.empty((n, before.space.motions)), np.zeros(n), None
        if not self.integrated:
            single, own = before.select(rows), self.select(rows)
            after, depth = own.strike(single, offset[rows])
            v[rows], touch[rows] = after.v, own.gap(own.to_true(single)) + depth
        for played, ends in self.played(before, span):
            q = np.full((n, before.space.poses), np.nan) if q is None else q
            v[played], q[played] = ends.v, ends.q
        if self.integrated:  # a body that meets nothing is where it was before: its gap is all that is left to compare
            single = before.select(rows)
            struck = (np.abs(v[rows] - single.v) > STRUCK).any(axis=1)
            touch[rows] = np.where(struck, np.nan, self.select(rows).gap(self.select(rows).to_true(single)))
        return Prediction(v, touch, q)

    def played(self, before: State, span: np.ndarray) -> Iterator[tuple[np.ndarray, State]]:
        """Rows of what is played, and their measured states at the end."""
        for single in (True, False) if self.integrated else (False,):
            rows = np.flatnonzero((span == 0.0) == single)
            if len(rows):
                yield rows, self.select(rows).end(before.select(rows), span[rows], single)

    def end(self, before: State, span: np.ndarray, single: bool = False) -> State:
        """Measured states (n,) `span` (n,) in s after measured states at the first touch; `single`: of one hit."""
        return self.to_measured(Played(self, self.to_true(before), span, 1 if single else MOST_HITS).after)

    def off(self, touch: State) -> State:
        """True states at the end of contacts that take time, from true states at their touch (`episodes.contact`)."""
        return contact(self, touch)


class Integrated(ByImpulse):
    """Contacts integrated under the law's force, or as a physics engine has them."""

    integrated = True


class EngineInstant(ByImpulse):
    """An engine where contacts are taken as instants."""

    def stated(self, before: State, offset: np.ndarray) -> Prediction:
        return Prediction(self.to_measured(self.press(self.to_true(before))[0]).v)


def kind_of(model: Model) -> type[ByImpulse]:
    """The kind of the model's contacts."""
    if model.is_compliant:
        return Integrated
    return EngineInstant if model.law.engine else ByImpulse


def bind(model: Model, values: Mapping[str, Any], rig: Rig) -> ByImpulse:
    """Dynamics of the model at these values, numbers or arrays (n,) with one for each body, by its kind of contact."""
    return kind_of(model)(model, values, rig)


# how a fit of an integrated contact starts and ends: steps along slopes do not lead everywhere


def forerunner(model: Model) -> Model:
    """A model whose fit finds a start: an integrated contact that takes no time has no slope along its time."""
    return replace(model, law=replace(model.law, impulse=mirtich.impulse, force=None))


def admitted(values: Mapping[str, float]) -> dict[str, float]:
    """Start values, moved to where there are slopes."""
    start, ratio = {**values, "tau": max(values["tau"], BRIEF)}, DAMPING_RATIO
    if start.get(ratio.name, 0.0) > 5.0 * ratio.null:
        start[ratio.name] = ratio.null  # so strong a damper is rigid friction, whatever the ratio
    return start


def reaches(p: Parameter) -> bool:
    """Whether a fit comes back from the starts that an effect declares, if they are wrong."""
    return any(abs(x - p.null) <= FAR * p.scale for x in p.starts)


def withdrawn(values: Mapping[str, float]) -> dict[str, float]:
    """Values to try again from, where a step may have gone too far to come back; {}: none."""
    # friction so sharp, or damped so strongly, is Coulomb's: there is no slope
    tolerance, ratio = STICTION_TOLERANCE, DAMPING_RATIO
    if values.get(tolerance.name, tolerance.null) < 0.5 * tolerance.null:
        return {tolerance.name: tolerance.null}
    return {ratio.name: ratio.scale} if values.get(ratio.name, ratio.null) > 2.0 * ratio.null else {}
