"""Which effects of a model the file of an engine can express, in which element, and why it cannot express others."""

from thesis_lib.effects import EFFECTS
from thesis_lib.effects.effect import equation_in
from thesis_lib.mechanics.space import Space

GEOMETRY = "geometry of the body"
# effects that every format can express
_EVERYWHERE = {
    "com_offset": "centre of mass of the inertia",
    **dict.fromkeys(("wrong_inertia", "inertia_ratios", "inertia_axes"), "inertia"),
    "wrong_size": GEOMETRY,
    "rounded_corners": "round collision geometry at the corners",
    "surface_height": "height of the surface",
    "surface_tilt": "tilt of the surface",
}
_IGNORED = "gravity of the world, which Drake ignores: set it in the plant"
_NO_GRAVITY = "URDF has no gravity: set it where you load the file"
_DRAG = "no element of the format damps translation and rotation of a free body with separate coefficients"
_AIR = {
    "mjcf": "MuJoCo's fluid forces act on an ellipsoid around the body, with five coefficients; not written",
    "sdf": "SDF and Drake have no air",
    "urdf": "URDF and Drake have no air",
}
_RESTITUTION = "the format has one restitution for a pair of bodies, by stiffness and damping"
_FRICTION = "the format has one coefficient of friction for a pair of bodies, at all places and speeds"
_TIME = "the format has one stiffness for a pair of bodies"
_WHY = {
    "adhesion": "contacts of the engine push and never pull",
    "anisotropic_friction": "friction may differ between two axes in the format, not between left and right on one",
    "contact_torque": "the engine's rolling friction is limited by its friction cone, or absent",
    "tangential_compliance": "the engine's contact has no spring along the surface",
    "tangential_restitution": "the engine's friction stops slip and does not reverse it",
    "contact_point_offset": "the engine determines the contact point from the geometry",
    "soft_body": "point contact acts at a rigid surface; a soft solid needs hydroelastic contact, which is not written",
    "moving_surface": "a velocity is a state, not part of a model file: set the surface velocity in your simulation",
    **dict.fromkeys(("linear_drag", "spin_damping"), _DRAG),
    **dict.fromkeys(
        ("wear", "later_friction", "later_restitution"), "a file has constant numbers, which cannot change between hits"
    ),
    "sliding_friction": "the format has one coefficient of friction for hits and slides",
    "torsional_friction": "a point contact of Drake has no couple about its normal",
    "curved_surface": "the surface is a plane: put a height field or a mesh in its place by hand",
    **dict.fromkeys(
        ("orientation_dependent_restitution", "position_dependent_restitution", "velocity_dependent_restitution"),
        _RESTITUTION,
    ),
    **dict.fromkeys(
        ("orientation_dependent_friction", "position_dependent_friction", "velocity_dependent_friction"), _FRICTION
    ),
    **dict.fromkeys(
        (*("orientation_dependent_contact_time", "position_dependent_contact_time"), "velocity_dependent_contact_time"),
        _TIME,
    ),
    "surface_patch": "one surface has one friction and one restitution: add a geometry for the patch by hand",
}
_ELLIPSE = "the engine chooses the axes of the friction ellipse, or its friction is isotropic"
_CAMERA = "a fault of the camera, not of body or surface: correct the recorded states before you compare"


def written(name: str, target: str, space: Space) -> str:
    """Return which element of a format expresses an effect; "" if none can."""
    is_gravity = name == "wrong_gravity" or (name == "surface_tilt" and not space.is_plane)
    if is_gravity and target != "mjcf":
        return _IGNORED if target == "sdf" else ""
    if name == "torsional_friction" and target == "mjcf":
        return "torsional friction of the geoms"
    return "gravity" if is_gravity else _EVERYWHERE.get(name, "")


def reason(name: str, target: str, space: Space) -> str:
    """Return the reason why a format cannot express an effect."""
    effect = EFFECTS[name]
    if effect.family == "measurement":
        return _CAMERA
    if name in ("wrong_gravity", "surface_tilt"):
        return _NO_GRAVITY
    if name in ("quadratic_drag", "magnus"):
        return _AIR[target]
    if name == "anisotropic_friction" and not space.is_plane:
        return _ELLIPSE
    return _WHY.get(name, f"the format has no element for {equation_in(effect, space)}")
