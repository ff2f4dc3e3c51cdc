"""Causes that can be hidden in tosses of a body in space: in the body, around it, and in the camera.

A cause has the name, the parameters and the meaning of an effect: true minus believed value.  It is implemented
independently of the effects, to keep the hidden code separate from the fitted code.  Causes in body, marker, table and
gravity change the rig from the stated one (`true_rig`); causes in the air push the body (`air`); causes in the camera
change the reported motion of the tracked frame T (`filmed`), in the axes of the recording W.

| on paper | in code                       | unit       |                                                       |
|----------|-------------------------------|------------|-------------------------------------------------------|
|          | `hidden`                      |            | sizes by effect and parameter: {"com_offset.c_x": 2e-3} |
| q        | `attitude`                    | 1          | unit quaternions (4, n) of T, axes of T into W        |
| v, ω     | `velocity`, `spin`            | m/s, rad/s | of T, axes of W                                       |
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from thesis_lib.bodies.mesh import Mesh
from thesis_lib.bodies.solids import Edged
from thesis_lib.datasets.format.frames import surface_frames
from thesis_lib.datasets.format.header import SpaceHeader
from thesis_lib.foundation.errors import UserError
from thesis_lib.mechanics.inertia import principal_axes
from thesis_lib.mechanics.space import (
    conjugate,
    cross,
    multiplied,
    of_rotation_matrix,
    of_rotation_vector,
    rotated,
    rotation_matrix,
)
from thesis_lib.mechanics.state import State
from thesis_lib.statistics.wording import listed

Hidden = Mapping[str, float]
READINGS = ("conjugate", "scalar_last", "sign_of_x", "sign_of_y", "sign_of_z")  # sizes 1, 2, … of `misread_rotation`


@dataclass(frozen=True)
class CauseInSpace:
    """A cause: sizes of its effect's parameters that a critique of 60 tosses should detect, with unit and meaning."""

    sizes: Mapping[str, float]
    unit: str
    meaning: str


CAUSES_IN_SPACE: Mapping[str, CauseInSpace] = {
    "com_offset": CauseInSpace({"c_x": 2e-3}, "m", "true minus believed centre of mass, axes of the shape"),
    "wrong_inertia": CauseInSpace({"d_I": 0.2}, "1", "all moments of inertia times 1 + d_I"),
    "inertia_ratios": CauseInSpace({"a_y": 0.15, "a_z": 0.0}, "1", "I_yy and I_zz of the principal axes times 1 + a"),
    "inertia_axes": CauseInSpace(
        {"b_x": 0.0, "b_y": 0.0, "b_z": 0.15}, "rad", "the principal axes are rotated by exp(b), axes of the shape"
    ),
    "wrong_size": CauseInSpace({"s": 0.03}, "1", "all lengths of the shape times 1 + s"),
    "rounded_corners": CauseInSpace({"rho": 3e-3}, "m", "edge radius in excess of the stated one"),
    "marker_offset": CauseInSpace(
        {"d_x": 2e-3}, "m", "true minus stated origin of the tracked frame, axes of the shape"
    ),
    "angle_offset": CauseInSpace({"d_ry": 0.03}, "rad", "the tracked frame is rotated on the body by exp(d)"),
    "surface_height": CauseInSpace({"h": 1.5e-3}, "m", "true minus stated height of the table, along its normal"),
    "curved_surface": CauseInSpace(
        {"kappa": 0.15, "x_0": 0.0, "y_0": 0.0}, "1/m", "the table is a bowl, lowest at (x_0, y_0) from its point"
    ),
    "moving_surface": CauseInSpace({"V_x": 0.2, "V_y": 0.0}, "m/s", "velocity of the table along its axes"),
    "anisotropic_friction": CauseInSpace(
        {"a_c": 0.3, "a_s": 0.0}, "1", "friction μ (1 + a) along t_1, μ (1 − a) across; a_s: along the diagonals"
    ),
    "orientation_dependent_contact_time": CauseInSpace(
        {"a_x": 0.0, "a_y": 0.0, "a_z": 0.5}, "1", "contact time times exp(a·u), u towards the table, axes of the shape"
    ),
    "position_dependent_contact_time": CauseInSpace(
        {"g_tau_x": 1.5, "g_tau_y": 0.0}, "1/m", "contact time times (1 − 2 g·x)^(−1/2), x on the table from its point"
    ),
    "surface_tilt": CauseInSpace({"phi_x": 0.04}, "rad", "gravity is g (sin φ_x, sin φ_y, …) in the axes of the table"),
    "wrong_gravity": CauseInSpace({"dg": -0.3}, "m/s²", "true minus believed gravity, along believed gravity"),
    "linear_drag": CauseInSpace({"c_v": 0.25, "c_w": 0.0}, "1/s", "a = −c_v v, α = −c_w ω"),
    "spin_damping": CauseInSpace({"c_w": 0.5}, "1/s", "α = −c_w ω"),
    "quadratic_drag": CauseInSpace({"c_q": 0.15}, "1/m", "a = −c_q |v| v"),
    "magnus": CauseInSpace({"k_m": 0.03}, "1", "a = k_m ω × v"),
    "length_scale": CauseInSpace({"s_L": 0.02}, "1", "measured lengths from the table's point times 1 + s_L"),
    "rotation_scale": CauseInSpace({"s_R": 0.02}, "1", "measured angular rates times 1 + s_R, from the first frame on"),
    "time_lag": CauseInSpace({"lag": 4e-3}, "s", "delay of orientation relative to position"),
    "camera_pose": CauseInSpace(
        {"b_x": 0.0, "b_y": 0.02}, "rad", "measured axes rotated by exp(b) about the table's point"
    ),
    "lens": CauseInSpace(
        {"k_1": 0.3, "c_u": 0.0, "c_v": 0.0},
        "1/m²",
        "x and y of W from the table's point + (c_u, c_v) times 1 + k_1 r², r: the distance in x and y",
    ),
    "mirrored_rotation": CauseInSpace(
        {"mirrored_axis": 1.0}, "1", "R is reported as M R M; 1, 2, 3: M mirrors the x, y, z axis of W"
    ),
    "misread_rotation": CauseInSpace({"reading": 1.0}, "1", f"1 to {len(READINGS)}: {listed(READINGS)}"),
}


def sizes_of(name: str, size: float | None = None) -> dict[str, float]:
    """Sizes of a cause by effect and parameter, {} for "nothing"; `size`: of the first that is not 0, others then 0.

    Raises:
        UserError: there is no such cause.
    """
    if name == "nothing":
        return {}
    if name not in CAUSES_IN_SPACE:
        raise UserError(f"--hidden {name}: with --space it is {listed(['nothing', *CAUSES_IN_SPACE], 'or')}.")
    sizes = dict(CAUSES_IN_SPACE[name].sizes)
    if size is not None:
        sizes = {**dict.fromkeys(sizes, 0.0), next(p for p in sizes if sizes[p]): size}
    return {f"{name}.{p}": value for p, value in sizes.items()}


def text_of_space() -> str:
    """Causes that can be hidden in space, with size and meaning, one per line."""
    lines = ["with --space (size of the first parameter that is not 0):"]
    for name, cause in CAUSES_IN_SPACE.items():
        size = next(value for value in cause.sizes.values() if value)
        lines.append(f"  {name:<34} {size:g}{'' if cause.unit == '1' else f' {cause.unit}'}   {cause.meaning}")
    return "\n".join(lines)


def true_rig(header: SpaceHeader, hidden: Hidden) -> SpaceHeader:
    """True body, tracked frame, table and gravity of a rig for which the dataset states `header`.

    Raises:
        UserError: the shape has no edges that could be rounded.
    """
    body, tracked, get = header.body, header.tracked, _getter(hidden)
    shape = body.shape
    axes = principal_axes(body.inertia_per_mass)
    principal = np.diag(axes.T @ body.inertia_per_mass @ axes) * (1.0 + get("wrong_inertia.d_I"))
    principal = principal * (1.0 + np.array([0.0, get("inertia_ratios.a_y"), get("inertia_ratios.a_z")]))
    axes = rotation_matrix(of_rotation_vector(_vector(get, "inertia_axes.b_"))) @ axes
    tensor = (body.mass or 1.0) * (axes * principal) @ axes.T
    if s := get("wrong_size.s"):  # about the centre of mass, which keeps its place in the tracked frame
        shape = shape.scaled(1.0 + s)
    grown = s * body.centre
    if rho := get("rounded_corners.rho"):
        if not isinstance(shape, Edged | Mesh):
            raise UserError(f"--hidden rounded_corners: a {body.shape.kind} has no edges.")
        shape = shape.rounded(shape.edge_radius + rho)
    (frame,) = surface_frames(header)
    g, (t_1, t_2, n) = np.linalg.norm(header.gravity), frame.vectors_out(np.eye(3)).T
    gravity = np.array(header.gravity) * (1.0 + (get("wrong_gravity.dg") / g if g else 0.0))
    sin_x, sin_y = np.sin([get("surface_tilt.phi_x"), get("surface_tilt.phi_y")])
    if sin_x or sin_y:
        gravity = g * (sin_x * t_1 + sin_y * t_2 - np.sqrt(1.0 - sin_x**2 - sin_y**2) * n)
    assert tracked is not None
    turned = multiplied(of_rotation_vector(_vector(get, "angle_offset.d_r")), tracked.attitude)
    names = ("xx", "yy", "zz", "xy", "xz", "yz")
    content = {
        "schema": 2,
        "body": {
            "shape": shape,
            "mass": body.mass or 1.0,
            "center_of_mass": tuple(body.centre + grown + _vector(get, "com_offset.c_")),
            "inertia": {name: tensor["xyz".index(name[0]), "xyz".index(name[1])] for name in names},
        },
        "tracked": {
            "position": tuple(np.array(tracked.position) + grown + _vector(get, "marker_offset.d_")),
            "quaternion": tuple(turned),
        },
        "surface": {"point": tuple(frame.origin + get("surface_height.h") * n), "normal": tuple(n)},
        "gravity": tuple(gravity),
    }
    return SpaceHeader.model_validate(content)


def air(hidden: Hidden, velocity: np.ndarray, spin: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Acceleration and angular acceleration (3, n) in m/s², rad/s² due to the air, for velocity and spin (3, n)."""
    get = _getter(hidden)
    speed = np.sqrt((velocity**2).sum(axis=0))
    a = -(get("linear_drag.c_v") + get("quadratic_drag.c_q") * speed) * velocity
    return a + get("magnus.k_m") * cross(spin, velocity), -(get("linear_drag.c_w") + get("spin_damping.c_w")) * spin


def filmed(true: State, header: SpaceHeader, hidden: Hidden) -> State:
    """Poses of the tracked frame as a faulty camera reports them, from true motions in W; rows by trial and time."""
    get, (frame,) = _getter(hidden), surface_frames(header)
    about, q = frame.origin[:, None], true.attitude
    if lag := get("time_lag.lag"):
        q = multiplied(of_rotation_vector(-lag * true.spin), q)
    place = true.position
    if (b := _vector(get, "camera_pose.b_")).any():
        turn = of_rotation_vector(b)[:, None]
        place, q = about + rotated(turn, place - about), multiplied(np.broadcast_to(turn, q.shape), q)
    if k_1 := get("lens.k_1"):
        off = place - about
        off[:2] -= np.array([[get("lens.c_u")], [get("lens.c_v")]])
        off[2] = 0.0
        place = place + k_1 * (off**2).sum(axis=0) * off
    place = about + (1.0 + get("length_scale.s_L")) * (place - about)
    if s_R := get("rotation_scale.s_R"):
        q = _rates_scaled(q, true.trial, 1.0 + s_R)
    if axis := round(get("mirrored_rotation.mirrored_axis")):
        M = np.diag(np.where(np.arange(3) == axis - 1, -1.0, 1.0))
        R = np.einsum("ij,jkn,kl->iln", M, rotation_matrix(q), M)
        q = np.stack([of_rotation_matrix(one) for one in np.moveaxis(R, -1, 0)], axis=1)
    if reading := round(get("misread_rotation.reading")):
        q = _misread(q, READINGS[reading - 1])
    return true.changed(position=place, attitude=q)


def _rates_scaled(q: np.ndarray, trial: np.ndarray, factor: float) -> np.ndarray:
    """Attitudes (4, n) whose rotations from frame to frame, about axes of W, are `factor` times those of q."""
    made = q.copy()
    step = multiplied(q[:, 1:], conjugate(q[:, :-1]))
    step = step * np.where(step[:1] < 0.0, -1.0, 1.0)
    half = np.arctan2(np.sqrt((step[1:] ** 2).sum(axis=0)), step[0])
    turn = of_rotation_vector(2.0 * factor * half * step[1:] / np.maximum(np.sin(half), 1e-300))
    for i in np.flatnonzero(trial[1:] == trial[:-1]):
        made[:, i + 1] = multiplied(turn[:, i], made[:, i])
    return made


def _misread(q: np.ndarray, reading: str) -> np.ndarray:
    w, *xyz = q
    if reading == "conjugate":
        return conjugate(q)
    if reading == "scalar_last":  # written x, y, z, w and read as w, x, y, z
        return np.stack([*xyz, w])
    sign = np.where(np.array(["w", "x", "y", "z"]) == reading[-1], -1.0, 1.0)
    return sign[:, None] * q


def _getter(hidden: Hidden):
    return lambda name: float(hidden.get(name, 0.0))


def _vector(get, name: str) -> np.ndarray:
    return np.array([get(f"{name}{axis}") for axis in "xyz"])
