"""Evidence from bodies that rest or slide on the surface; where bodies rest does not depend on the impact law.

    rest    (φ_n at the angle θ_0 at which the body lies flat, θ − θ_0), for the true pose of the measured one
    slide   a − â,   â = a_t − μ_s a_n sgn(v_t),  a_t, a_n: acceleration in flight along and into the surface

In space the lean is the turn about t_1 and t_2 from the nearest stable pose to the true pose, and friction opposes the
velocity.  A wrongly read attitude appears as a large turn, because the model's pose determines the nearest stable pose.

`thesis_lib/datasets/impacts/supports.py` finds rests and slides.  Rests distinguish an angle offset from effects at
impacts, and a surface at another height from rounded corners, on which a body does not rest; slides show friction.  μ_s
is the friction of impacts unless the effect `sliding_friction` is included.

| on paper  | in code                 | unit    | shape  |                                               |
|-----------|-------------------------|---------|--------|-----------------------------------------------|
| φ_n, θ    | `residuals` of `Rests`  | m, rad  | (m, 2) | gap, and angle from lying flat                |
| a − â     | `residuals` of `Slides` | m/s²    | (m, 1) | along the surface                             |
|           | of `SpaceRests`, `SpaceSlides` |  | (m, 3), (m, 2) | the same in space                      |
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from thesis_lib.bodies.solids import UP
from thesis_lib.bodies.symmetry import Symmetry
from thesis_lib.critique.contacts.dynamics import Dynamics
from thesis_lib.critique.likelihood.beside import Accelerations, Beside
from thesis_lib.datasets.flights.parabolas import Hits
from thesis_lib.datasets.format.header import Header
from thesis_lib.datasets.format.samples import Samples
from thesis_lib.datasets.impacts.found import FoundImpacts
from thesis_lib.datasets.impacts.supports import find_rests, find_slides, resting_and_sliding
from thesis_lib.effects.effect import Rig
from thesis_lib.mechanics.space import SPACE
from thesis_lib.mechanics.state import State

_H = 1e-3  # s, step for the acceleration that a camera reports: its map is linear in the velocity


@dataclass(frozen=True)
class Rests(Beside):
    """Bodies at rest in the plane."""

    channel = "rest"

    def residuals(self, dynamics: Dynamics) -> np.ndarray:
        """Gap in m and lean in rad (m, 2)."""
        true = dynamics.to_true(self.state)
        flat = dynamics.rig.shape.lying(true.theta)
        return np.stack([dynamics.gap(true.moved(theta=flat)), true.theta - flat], axis=1)

    def less(self, residuals: np.ndarray) -> Self:
        """Copy, lowered and turned back by `residuals` (m, 2)."""
        lower = self.state.moved(y=self.state.y - residuals[:, 0], theta=self.state.theta - residuals[:, 1])
        return replace(self, state=lower)


@dataclass(frozen=True)
class Slides(Accelerations):
    """Bodies that slide without rotation; `acceleration` (m, 1) along the surface in m/s²."""

    channel = "slide"

    def residuals(self, dynamics: Dynamics) -> np.ndarray:
        """Acceleration measured minus predicted (m, 1) in m/s²."""
        true = dynamics.to_true(self.state)
        later = true.moved(vx=true.vx + _H * dynamics.sliding(true))
        seen_by_camera = (dynamics.to_measured(state).vx for state in (later, true))
        return self.acceleration - ((next(seen_by_camera) - next(seen_by_camera)) / _H)[:, None]


@dataclass(frozen=True)
class SpaceRests(Beside):
    """Bodies at rest in space, all of one solid."""

    symmetry: Symmetry

    channel = "rest"
    of_all = ("symmetry",)

    def residuals(self, dynamics: Dynamics) -> np.ndarray:
        """Gap in m and turns in rad (m, 3)."""
        true = dynamics.to_true(self.state)
        turn = true.turned(self.symmetry.leaning(SPACE.turned_back(true.attitude, UP).T).T)
        standing = true.changed(attitude=SPACE.attitude_after(true.attitude, -turn))
        return np.stack([dynamics.gap(standing), *turn[:2]], axis=1)

    def less(self, residuals: np.ndarray) -> Self:
        """Copy, lowered and turned back by `residuals` (m, 3)."""
        gap, *turn = residuals.T
        attitude = SPACE.attitude_after(self.state.attitude, -np.stack([*turn, 0.0 * gap]))
        position = self.state.position - gap * UP
        return replace(self, state=self.state.changed(position=position, attitude=attitude))


@dataclass(frozen=True)
class SpaceSlides(Slides):
    """Bodies that slide in space; `acceleration` (m, 2) along the surface in m/s², over `span` (m,) in s."""

    span: np.ndarray

    def residuals(self, dynamics: Dynamics) -> np.ndarray:
        """Acceleration measured minus predicted (m, 2) in m/s²."""
        true = dynamics.to_true(self.state)
        a = dynamics.sliding(true, self.span)
        later = true.changed(velocity=true.velocity + _H * np.concatenate([a, np.zeros_like(a[:1])]))
        seen = dynamics.to_measured(later).velocity - dynamics.to_measured(true).velocity
        return self.acceleration - seen[:2].T / _H


def supports_of(found: FoundImpacts, header: Header, channels: Sequence[str]) -> tuple[Beside, ...]:
    """Evidence of the given `channels` in planar trajectories of a body that falls onto a single surface."""
    if found.samples is None or header.surfaces is not None or not header.gravity:
        return ()
    parts = []
    for name in channels:
        find = find_slides if name == Slides.channel else find_rests
        one = find(found.samples, found.hits, header, found.noise.used)
        if one is not None:
            known = (one.state, one.variance)
            parts.append(Slides(*known, one.measured) if name == Slides.channel else Rests(*known))
    return tuple(parts)


def supports_in_space(
    states: State, samples: Samples, hits: Hits, rig: Rig, noise: tuple[float, float]
) -> tuple[Beside, ...]:
    """Rests and slides of the believed body in space, found by `resting_and_sliding`."""
    if not rig.gravity or not len(states):
        return ()
    symmetry = Symmetry(rig.shape, np.asarray(rig.tensor))  # pyright: ignore[reportArgumentType]
    rests, slides = resting_and_sliding(states, samples, hits, symmetry, noise)
    found = []
    if rests is not None:
        found.append(SpaceRests(rests.state, rests.variance, symmetry))
    if slides is not None:
        found.append(SpaceSlides(slides.state, slides.variance, slides.measured[:, :2], slides.measured[:, 2]))
    return tuple(found)
