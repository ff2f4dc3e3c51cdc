"""Which effect of a model an engine's file can hold, how, and why not the others."""

from thesis_lib.effects import EFFECTS

FORMATS = ("mjcf", "sdf", "urdf")
GEOMETRY = "geometry of the body"
# what every format holds
_EVERYWHERE = {
    "com_offset": "centre of mass of the inertia",
    "wrong_inertia": "inertia",
    "wrong_size": GEOMETRY,
    "rounded_corners": "round collision geometry at the corners",
    "surface_height": "height of the surface",
    "surface_tilt": "tilt of the surface",
    "wrong_gravity": "gravity",
}
_NOT_IN = {("urdf", "wrong_gravity"): "URDF has no gravity: set it where you load the file"}
_DRAG = "no element of the format damps a free body with one number for its way and another for its spin"
_AIR = {
    "mjcf": "MuJoCo's forces of a fluid act on an ellipsoid around the body with five coefficients; not written",
    "sdf": "SDF and Drake have no air",
    "urdf": "URDF and Drake have no air",
}
_RESTITUTION = "the format has one restitution for a pair of bodies, by stiffness and damping"
_FRICTION = "the format has one coefficient of friction for a pair of bodies, at all places and speeds"
_TIME = "the format has one stiffness for a pair of bodies"
_WHY = {
    "adhesion": "contacts of the engine push and never pull",
    "anisotropic_friction": "friction may differ between two axes in the format, not between left and right on one",
    "contact_torque": "rolling friction of the engine takes its couple from the cone of its friction, or is absent",
    "tangential_compliance": "the engine's contact has no spring along the surface",
    "tangential_restitution": "the engine's friction ends slip and returns none",
    "contact_point_offset": "the engine finds the contact point from the geometry",
    "soft_body": "a point contact acts at the surface of one geometry; a soft solid is hydroelastic, not written here",
    "moving_surface": "a velocity is a state, not a property of a model: give the surface its velocity when you run it",
    "linear_drag": _DRAG,
    "wear": "a file says what is, not how it changes from drop to drop",
    **dict.fromkeys(
        ("orientation_dependent_restitution", "position_dependent_restitution", "velocity_dependent_restitution"),
        _RESTITUTION,
    ),
    **dict.fromkeys(("position_dependent_friction", "velocity_dependent_friction"), _FRICTION),
    **dict.fromkeys(
        (*("orientation_dependent_contact_time", "position_dependent_contact_time"), "velocity_dependent_contact_time"),
        _TIME,
    ),
    "surface_patch": "one surface has one friction and one restitution: add a geometry for the patch by hand",
}
_CAMERA = "a fault of the camera, not of body or surface: correct the recorded states before you compare"


def written(name: str, target: str) -> str:
    """Where the file of a format holds an effect; "" if it cannot."""
    if (target, name) == ("sdf", "wrong_gravity"):
        return "gravity of the world, which Drake ignores: set it in the plant"
    return "" if (target, name) in _NOT_IN else _EVERYWHERE.get(name, "")


def reason(name: str, target: str) -> str:
    """Why the file of a format cannot hold an effect."""
    effect = EFFECTS[name]
    if effect.family == "measurement":
        return _CAMERA
    if (target, name) in _NOT_IN:
        return _NOT_IN[target, name]
    if name in ("quadratic_drag", "magnus"):
        return _AIR[target]
    return _WHY.get(name, f"the format has no element for {effect.equation}")
