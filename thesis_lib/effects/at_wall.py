"""Effects of one wall among several: "which wall differs?"

An effect of `AT_ONE_WALL` acts only at impacts on one wall, whose name is appended to the name of the effect:
`velocity_dependent_restitution_at_north`.  Besides effects of the library there are three that are defined at one wall
only, where a parameter of the law differs from its value at the other walls,

    ε ← clip(ε (1 + d), 0, 1),    μ ← μ (1 + d),    τ ← τ (1 + d)        at that wall

If the restitution at that wall depends on speed, its value at 1 m/s may differ, too.

A state has the number of its wall (`State.surface`).

| on paper | in code | unit | shape |                                      |
|----------|---------|------|-------|--------------------------------------|
| d        | `d`     | 1    |       | relative change at the wall          |
"""

from collections.abc import Iterable, Iterator

import numpy as np

from thesis_lib.bodies.walls import Wall
from thesis_lib.effects.effect import Effect, Impulse, Parameter, Rig
from thesis_lib.effects.surface_height import SurfaceHeight
from thesis_lib.effects.velocity_dependent_friction import VelocityDependentFriction
from thesis_lib.effects.velocity_dependent_restitution import SPEED, VelocityDependentRestitution

_BETWEEN = "_at_"


class OtherRestitution(Effect):
    name = "other_restitution"
    family = "surface"
    title = "another restitution"
    equation = "ε = ε₀ (1 + d)"
    parameters = (Parameter("d", "1", null=0.0, low=-1.0, high=3.0, scale=0.1),)
    reference = "definition of the restitution"

    def coefficients(self, mu, epsilon, contact, state, p, rig):
        return mu, np.clip(epsilon * (1.0 + p["d"]), 0.0, 1.0)


class OtherRestitutionBySpeed(VelocityDependentRestitution):
    """Velocity-dependent restitution of one wall, whose value at 1 m/s differs from the other walls, too."""

    includes = ("other_restitution",)
    equation = "ε = ε₀ (1 + d) (|v_n| / 1 m/s)^−p exp(−c (|v_n| − 1 m/s))"
    parameters = (*OtherRestitution.parameters, *VelocityDependentRestitution.parameters)

    def coefficients(self, mu, epsilon, contact, state, p, rig):
        at_1 = np.clip(epsilon * (1.0 + p["d"]), 0.0, 1.0) * np.exp(p["c"] * SPEED)
        return super().coefficients(mu, at_1, contact, state, p, rig)


class OtherFriction(Effect):
    name = "other_friction"
    family = "surface"
    title = "another friction"
    equation = "μ = μ₀ (1 + d)"
    parameters = (Parameter("d", "1", null=0.0, low=-1.0, high=10.0, scale=0.2),)
    reference = "Coulomb 1785"

    def coefficients(self, mu, epsilon, contact, state, p, rig):
        return np.maximum(mu * (1.0 + p["d"]), 0.0), epsilon


class OtherContactTime(Effect):
    name = "other_contact_time"
    family = "surface"
    title = "another contact time"
    equation = "τ = τ₀ (1 + d)"
    parameters = (Parameter("d", "1", null=0.0, low=-1.0, high=10.0, scale=0.5),)
    channels = ("touch",)
    needs_contact_time = True
    reference = "definition of the contact time"

    def contact_time(self, tau, contact, state, p, rig):
        return np.maximum(tau * (1.0 + p["d"]), 0.0)


AT_ONE_WALL: dict[str, Effect] = {
    effect.name: effect
    for effect in (
        OtherRestitution(),
        OtherRestitutionBySpeed(),
        OtherFriction(),
        VelocityDependentFriction(),
        OtherContactTime(),
        SurfaceHeight(),
    )
}


class AtWall(Effect):
    """The effect `of`, acting only at impacts on `wall`; it may override only hooks that this class has."""

    family = "surface"

    def __init__(self, of: Effect, wall: str) -> None:
        self.of, self.wall = of, wall
        self.name, self.title = f"{of.name}{_BETWEEN}{wall}", f"{of.title} at the wall {wall}"
        self.equation, self.parameters, self.channels = f"{of.equation} at {wall}", of.parameters, of.channels
        self.needs_contact_time = of.needs_contact_time
        self.rank, self.reference = of.rank, of.reference
        self.includes = tuple(f"{name}{_BETWEEN}{wall}" for name in of.includes)

    def applies_to(self, rig: Rig) -> bool:
        return len(rig.walls) > 1 and any(wall.name == self.wall for wall in rig.walls)

    def coefficients(self, mu, epsilon, contact, state, p, rig):
        here, there = self._here(state, rig), self.of.coefficients(mu, epsilon, contact, state, p, rig)
        return np.where(here, there[0], mu), np.where(here, there[1], epsilon)

    def impulse(self, impulse, contact, state, p, rig):
        here, there = self._here(state, rig), self.of.impulse(impulse, contact, state, p, rig)
        pairs = ((there.c_t, impulse.c_t), (there.c_n, impulse.c_n), (there.couple, impulse.couple))
        return Impulse.planar(*(np.where(here, a, b) for a, b in pairs))

    def sliding(self, mu, contact, state, p, rig):
        return np.where(self._here(state, rig), self.of.sliding(mu, contact, state, p, rig), mu)

    def contact_time(self, tau, contact, state, p, rig):
        return np.where(self._here(state, rig), self.of.contact_time(tau, contact, state, p, rig), tau)

    def gap(self, gap, state, p, rig):
        return np.where(self._here(state, rig), self.of.gap(gap, state, p, rig), gap)

    def _here(self, state, rig):
        return state.surface == [wall.name for wall in rig.walls].index(self.wall)


def effects_at(walls: Iterable[Wall]) -> Iterator[AtWall]:
    """Every effect of `AT_ONE_WALL` at every wall."""
    for wall in walls:
        for effect in AT_ONE_WALL.values():
            yield AtWall(effect, wall.name)


def effect_at_wall(name: object) -> AtWall | None:
    """Effect at one wall with this name; None for other names."""
    if not isinstance(name, str) or _BETWEEN not in name:
        return None
    of, _, wall = name.partition(_BETWEEN)
    return AtWall(AT_ONE_WALL[of], wall) if of in AT_ONE_WALL and wall.isidentifier() else None
