"""Causes that can be hidden in drops of MuJoCo: those of all simulators that its elements can produce, and its own.

MuJoCo's spring and damper are linear, its friction knows one coefficient at all speeds in both directions, its contact
does not stick, and it has no spring along the surface.  Its rolling friction takes its couple out of the same cone as
the friction force, so that a body that slides feels next to none: that is another cause than `rolling_lever`.
"""

from pydantic import Field

from thesis_lib.simulate.rig.hidden_causes import CAUSES, Cause, HiddenCauses

# causes without an element in MuJoCo: nothing there has the same meaning
WITHOUT_ELEMENT = (
    *("tangential_compliance", "hunt_crossley", "stribeck", "friction_anisotropy", "rolling_lever", "adhesion_energy"),
    "plate_curvature",
)
# causes that change friction or solref of the pairs before each contact
BY_PLACE = (
    *("orientation_restitution", "soft_spot", "wear", "friction_slope", "restitution_slope", "stiffness_slope"),
    *(f"{what}_{shape}" for what in ("restitution", "friction") for shape in ("patch", "bump", "step")),
    "stiffness_patch",
)
OWN = {"fluid_density": Cause((), 10.0)}  # causes that only MuJoCo makes
SUPPORTED: tuple[str, ...] = (*(name for name in CAUSES if name not in WITHOUT_ELEMENT), *OWN)


class MujocoCauses(HiddenCauses):
    """Hidden causes of drops in MuJoCo; the defaults are their absence."""

    fluid_density: float = Field(
        0.0, ge=0, le=2000, description="of a fluid that flows around the body's ellipsoid: drag by pose, lift, kg/m³"
    )

    @property
    def moving_plate(self) -> bool:
        """Whether the plate needs a carriage."""
        return bool(self.plate_velocity or self.plate_amplitude)

    @property
    def by_place(self) -> bool:
        """Whether restitution, friction or stiffness depends on the drop or on the place of the contact."""
        return any(getattr(self, name) for name in BY_PLACE)
