"""Causes that can be hidden in drops in MuJoCo: common causes that MuJoCo's elements can produce, and its own.

MuJoCo's spring and damper are linear, its friction has one coefficient for all speeds and both directions, its contact
does not adhere, and it has no spring along the surface.  The couple of its rolling friction shares one cone with the
friction force and nearly vanishes for a sliding body; it therefore differs from the cause `rolling_lever`.
"""

from pydantic import Field

from thesis_lib.simulate.rig.hidden_causes import CAUSES, Cause, HiddenCauses

# causes for which MuJoCo has no element with the same meaning
WITHOUT_ELEMENT = (
    *("tangential_compliance", "hunt_crossley", "stribeck", "friction_anisotropy", "rolling_lever", "adhesion_energy"),
    "plate_curvature",
)
# causes for which friction or solref of the pairs is changed before each contact
BY_PLACE = (
    *("orientation_restitution", "soft_spot", "wear", "friction_slope", "restitution_slope", "stiffness_slope"),
    *(f"{what}_{shape}" for what in ("restitution", "friction") for shape in ("patch", "bump", "step")),
    "stiffness_patch",
)
OWN = {"fluid_density": Cause((), 10.0)}  # causes that only MuJoCo can simulate
SUPPORTED: tuple[str, ...] = (*(name for name in CAUSES if name not in WITHOUT_ELEMENT), *OWN)


class MujocoCauses(HiddenCauses):
    """Hidden causes of drops in MuJoCo; at its default, a cause is absent."""

    fluid_density: float = Field(
        0.0, ge=0, le=2000, description="of a fluid around the body's ellipsoid: drag that depends on pose, lift, kg/m³"
    )

    @property
    def moving_plate(self) -> bool:
        """Whether the plate needs a carriage."""
        return bool(self.plate_velocity or self.plate_amplitude)

    @property
    def by_place(self) -> bool:
        """Whether restitution, friction or stiffness depends on the drop or on the place of contact."""
        return any(getattr(self, name) for name in BY_PLACE)
