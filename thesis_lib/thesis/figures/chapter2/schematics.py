"""Figures 2-1, 2-3, 2-6, 2-7, 2-8: schematics of mechanisms, drawn with the code's geometry (thesis 2.1, 2.3.1, 2.4).

Contact points, normals and gaps come from the mechanism's `contacts_of`.  For a free body its rows are
J_n = [0, 1, r_x] and J_t = [1, 0, -r_y] (2.20): the contact point is P = (x + r_x, y + r_y), its distance to contact
is φ_n = y + r_y, and its distance along the surface from the origin O is φ_t = x + r_x.

β is as in the formulas.  For a corner (2.19, 2.20) it is the clockwise angle from the body's -y axis to the corner:
P = (x, y) - l (sin(β - θ), cos(β - θ)).  For the ellipse it is the polar angle from the major axis to P, as in l(β)
(2.22); in (2.21), the angle is instead the parameter of (a cos β, b sin β).

l is the distance of P from the centre of mass in m.  Configurations q (nv,) are in m and rad.
"""

import numpy as np

from thesis_lib.figures.planar_drawing import Sketch, turned, unit, white_box
from thesis_lib.figures.style import BLUE, GREEN, GREY, INK, RED, Drawn, house_style, new_figure
from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.stepping.arm_disk import ArmDisk
from thesis_lib.simulate.stepping.multibody import PlanarFreeBody
from thesis_lib.simulate.stepping.rimless_wheel import RimlessWheel

DASHED = {"color": GREY, "linewidth": 0.8, "linestyle": (0, (5, 3))}


def outline_at(body: PlanarFreeBody, q: np.ndarray) -> np.ndarray:
    """Outline (n, 2) in m of a body at pose q (3,) in axes of the surface; for a wheel, hub and tips alternate."""
    if isinstance(body, RimlessWheel):
        points = np.stack([np.zeros_like(body.corners), body.corners], axis=1).reshape(-1, 2)
    else:
        points = body.shape.outline()
    return q[:2] + turned(points, q[2])


def closest_point(body: PlanarFreeBody, q: np.ndarray) -> tuple[np.ndarray, float]:
    """Point P (2,) in m of a body at pose q (3,) closest to the surface, and its gap φ_n in m."""
    q = np.asarray(q, dtype=float)
    contacts = body.contacts_of(q[None])
    pair = int(np.argmin(contacts.phi[0]))
    # J_n = [0, 1, r_x], J_t = [1, 0, -r_y]
    return q[:2] + [contacts.J_n[0, pair, 2], -contacts.J_t[0, pair, 2]], float(contacts.phi[0, pair])


@house_style
def figure_2_1(arm: ArmDisk, q: np.ndarray) -> Drawn:
    """Figure 2-1: two-link arm that pushes a disk; coordinates, torques and contact frames; q: (5,) in rad, m."""
    q = np.asarray(q, dtype=float)
    elbow, tip = (points[0] for points in arm.joints(q[None]))
    contacts = arm.contacts_of(q[None])
    centre, R = q[2:4], arm.disk_radius
    figure = new_figure(4.6, 2.4)
    sketch = Sketch(figure.add_subplot())
    left, right = arm.base[0] - 0.35, centre[0] + 3.0 * R
    sketch.ground(left, right, 0.07)
    sketch.fill("disk", centre + R * unit(np.linspace(0.0, 2.0 * np.pi, 121)).T)
    sketch.line("foot", np.array([[arm.base[0], 0.0], arm.base]), color=GREY, linewidth=4.0, zorder=1)
    for name, points in (("link 1", (arm.base, elbow)), ("link 2", (elbow, tip))):
        sketch.line(name, np.array(points), linewidth=3.0, color=INK, solid_capstyle="round", zorder=3)
    # joints, and the angles of the links relative to the horizontal and to link 1
    angles = ((arm.base, 0.0, "1", 0.38), (elbow, q[0], "2", 0.28))
    for joint, (origin, start, name, at) in enumerate(angles):
        sketch.point(f"joint {name}", origin, markersize=6, markerfacecolor="white", zorder=4)
        sketch.line(f"zero of q_{name}", np.array([origin, origin + 1.15 * at * unit(start)]), **DASHED)
        sketch.arc(f"q_{name}", origin, 0.75 * at, start, start + q[joint], BLUE)
        sketch.label(origin + at * unit(start + 0.4 * q[joint]), f"$q_{name}$", BLUE)
        # the arrow shows the joint of the torque, not its sign
        sketch.arc(f"torque {name}", origin, 0.11, start + 2.0, start + 5.2, RED)
        sketch.label(origin + np.array([-0.17, 0.1]), rf"$\tau_{name}$", RED)
    for pair, name in enumerate(arm.pairs):
        # the disk's columns of the normal row are the normal; the contact lies a radius plus a gap from the centre
        n = contacts.J_n[0, pair, 2:4]
        t = np.array([n[1], -n[0]])
        C = centre - (R + contacts.phi[0, pair]) * n
        length = 0.7 * R
        sketch.arrow(f"normal, {name}", C, length * n, GREEN)
        sketch.arrow(f"tangent, {name}", C, length * t, GREEN)
        sketch.point(f"contact, {name}", C, zorder=5)
        # clear of link 2
        along = -0.055 * n if name == "arm" else 0.055 * n
        sketch.label(C + 0.8 * length * n - 0.06 * t, rf"$\mathbf{{n}}_{pair + 1}$", GREEN)
        sketch.label(C + 0.9 * length * t + along, rf"$\mathbf{{t}}_{pair + 1}$", GREEN)
    sketch.point("centre", centre)
    sketch.label(centre + np.array([0.03, -0.06]), r"$(x,\ y)$", ha="left")
    sketch.line("mark on the disk", np.array([centre, centre + R * unit(q[4])]), linewidth=0.8)
    sketch.line("zero of theta", np.array([centre, centre + [1.45 * R, 0.0]]), **DASHED)
    sketch.arc("theta", centre, 1.25 * R, 0.0, q[4], BLUE)
    sketch.label(centre + 1.42 * R * unit(0.5 * q[4]), r"$\theta$", BLUE)
    sketch.axes_cross(np.array([left + 0.08, 0.0]), 0.16)
    return figure, sketch.table()


@house_style
def figure_2_3(body: PlanarFreeBody, q: np.ndarray) -> Drawn:
    """Figure 2-3: distances φ_n and φ_t from the origin O to the point P of a falling body closest to the surface.

    q: (3,) pose in m, rad, above the surface and to the right of the origin; the body is a polygon.

    Raises:
        UserError: the pose is not above the surface and right of the origin.
    """
    sketch, P, gap = _falling_body(3.9, body, q, origin=True)
    centre, size = np.asarray(q[:2], dtype=float), body.shape.extent
    sketch.line("above O", np.array([[0.0, 0.0], [0.0, 1.1 * P[1]]]), **DASHED)
    sketch.dimension("phi_t", np.array([0.0, P[1]]), P, RED)
    sketch.label((0.5 * P[0], P[1] + 0.12 * size), r"$\phi_t$", RED)
    _corner_angle(sketch, body, q, P)
    sketch.label(centre + size * np.array([-0.06, 0.16]), r"$(x,\ y)$")
    return sketch.ax.figure, sketch.table().assign(phi_n=gap, phi_t=P[0])


@house_style
def figure_2_6(body: PlanarFreeBody, q: np.ndarray) -> Drawn:
    """Figure 2-6: square in free fall; side a, angle θ, lowest corner at distance l and angle β (2.19, 2.20).

    q: (3,) pose in m, rad, above the surface.

    Raises:
        UserError: the body reaches into the surface.
    """
    sketch, P, gap = _falling_body(3.6, body, q)
    centre, size = np.asarray(q[:2], dtype=float), body.shape.extent
    _corner_angle(sketch, body, q, P)
    # the side that faces up and to the left
    outline = outline_at(body, q)
    side = min(range(len(outline) - 1), key=lambda i: (outline[i] + outline[i + 1] - 2.0 * centre) @ [1.0, -1.0])
    a, b = outline[side], outline[side + 1]
    away = 0.5 * (a + b) - centre
    shift = 0.14 * size * away / np.linalg.norm(away)
    sketch.dimension("side", a + shift, b + shift)
    sketch.label(0.5 * (a + b) + 1.9 * shift, "$a$")
    sketch.label(centre + size * np.array([-0.14, 0.16]), r"$m,\ I$", ha="right")
    return sketch.ax.figure, sketch.table().assign(phi_n=gap)


@house_style
def figure_2_7(body: PlanarFreeBody, q: np.ndarray) -> Drawn:
    """Figure 2-7: ellipse in free fall; semi-axes a and b, angle θ, lowest point at distance l(β) and angle β (2.22).

    q: (3,) pose in m, rad, above the surface.

    Raises:
        UserError: the body reaches into the surface.
    """
    sketch, P, gap = _falling_body(4.0, body, q)
    centre, theta = np.asarray(q[:2], dtype=float), float(q[2])
    major = unit(theta)
    minor = np.array([-major[1], major[0]])
    a, b = body.shape.semi_axes
    sketch.dimension("a", centre, centre - a * major)
    sketch.dimension("b", centre, centre + b * minor)
    sketch.label(centre - 0.55 * a * major + 0.14 * b * minor, "$a$")
    sketch.label(centre + 0.6 * b * minor - 0.12 * b * major, "$b$")
    # polar angle of P from the major axis
    to_P = P - centre
    beta = np.arctan2(to_P @ minor, to_P @ major)
    sketch.arc("beta", centre, 0.38 * b, theta, theta + beta, GREEN)
    sketch.label(centre + 0.56 * b * unit(theta + 0.5 * beta), r"$\beta$", GREEN)
    sketch.line("l", np.stack([centre, P]), color=GREEN)
    sketch.label(centre + 0.75 * to_P - 0.24 * b * np.array([1.0, -0.1]), r"$l(\beta)$", GREEN)
    return sketch.ax.figure, sketch.table().assign(phi_n=gap, beta=beta)


@house_style
def figure_2_8(wheel: RimlessWheel, q: np.ndarray) -> Drawn:
    """Figure 2-8: rimless wheel on its slope; length l of the spokes, angle between them, forces at the touching tips.

    q: (3,) pose of the hub in m, rad in the axes of the slope, on which one or two spokes stand.
    """
    q = np.asarray(q, dtype=float)
    contacts = wheel.contacts_of(q[None])
    touching = np.flatnonzero(np.abs(contacts.phi[0]) < 1e-6 * wheel.length)
    l, hub = wheel.length, q[:2]
    figure = new_figure(4.2, 3.1)
    sketch = Sketch(figure.add_subplot(), tilt=-wheel.slope)
    left, right = hub[0] - 1.7 * l, hub[0] + 2.0 * l
    sketch.ground(left, right, 0.16 * l)
    tips = hub + turned(wheel.corners, q[2])
    for i, tip in enumerate(tips):
        sketch.line(f"spoke {i}", np.stack([hub, tip]), linewidth=2.2, solid_capstyle="round")
    sketch.point("hub", hub, markersize=7)
    for number, i in enumerate(touching, start=1):
        # J_n = [0, 1, r_x], J_t = [1, 0, -r_y]
        tip = hub + [contacts.J_n[0, i, 2], -contacts.J_t[0, i, 2]]
        sketch.arrow(f"normal force {number}", tip, np.array([0.0, 0.5 * l]), RED)
        sketch.arrow(f"friction {number}", tip, np.array([-0.36 * l, 0.0]), RED)
        outward = 1.0 if tip[0] >= hub[0] else -1.0
        sketch.label(tip + l * np.array([0.18 * outward, 0.42]), f"$c_{{n,{number}}}$", RED)
        sketch.label(tip + l * np.array([-0.42, 0.12]), f"$c_{{t,{number}}}$", RED)
        sketch.point(f"contact {number}", tip, zorder=5)
    # the angle is shown between the two uppermost spokes, the length at the rearmost spoke
    along = turned(wheel.corners, q[2]) / l
    up = np.argsort(-along[:, 1], kind="stable")[:2]
    angles = sorted(float(np.arctan2(along[i, 1], along[i, 0])) for i in up)
    sketch.arc("angle between spokes", hub, 0.55 * l, *angles, BLUE)
    middle = 0.5 * sum(angles)
    sketch.label(hub + 0.74 * l * unit(middle), rf"$2\pi/{wheel.spokes}$", BLUE)
    back = int(np.argmin(along[:, 0]))
    across = np.array([along[back, 1], -along[back, 0]])
    sketch.dimension("length", hub + 0.1 * l * across, tips[back] + 0.1 * l * across)
    sketch.label(0.5 * (hub + tips[back]) + 0.22 * l * across, "$l$")
    sketch.label(hub + 0.55 * l * unit(middle - 2.0 * np.pi / wheel.spokes), r"$m,\ I$")
    # the angle of spoke 0 against the slope
    sketch.line("zero of theta", np.array([hub, hub + [1.45 * l, 0.0]]), **DASHED)
    zero = float(np.arctan2(along[0, 1], along[0, 0]))
    sketch.arc("theta", hub, 1.15 * l, 0.0, zero, BLUE)
    sketch.label(hub + 1.3 * l * unit(0.5 * zero), r"$\theta$", BLUE)
    # the slope against the horizontal, at its lower end
    foot = np.array([right, 0.0])
    level = foot - 1.6 * l * unit(wheel.slope)
    sketch.line("level", np.stack([foot, level]), **DASHED)
    sketch.arc("slope", foot, 1.15 * l, np.pi + wheel.slope, np.pi, BLUE)
    sketch.label(foot + 1.3 * l * unit(np.pi + 0.5 * wheel.slope), r"$\gamma$", BLUE, bbox=white_box(0.8))
    sketch.axes_cross(np.array([left + 0.15 * l, 0.0]), 0.4 * l)
    return figure, sketch.table()


def _falling_body(
    width: float, body: PlanarFreeBody, q: np.ndarray, *, origin: bool = False
) -> tuple[Sketch, np.ndarray, float]:
    """Draw a body above the surface with θ, P and φ_n, `width` inches wide; sketch, P (2,) and its gap in m."""
    q = np.asarray(q, dtype=float)
    P, gap = closest_point(body, q)
    if gap <= 0.0 or (origin and P[0] <= 0.0):
        raise UserError(f"The schematic needs a body above the surface, right of the origin; its P is {P} m.")
    centre, size = q[:2], body.shape.extent
    outline = outline_at(body, q)
    sketch = Sketch(new_figure(width, 3.0).add_subplot())
    left = min(outline[:, 0].min() - 0.3 * size, -0.45 * size if origin else np.inf)
    right = outline[:, 0].max() + 0.45 * size
    sketch.ground(left, right, 0.12 * size)
    sketch.fill("outline", outline)
    # body and surface axes, and the angle between them
    sketch.line("body axis x", np.array([centre, centre + 1.3 * size * unit(q[2])]), **DASHED)
    sketch.line("zero of theta", np.array([centre, centre + [1.3 * size, 0.0]]), **DASHED)
    sketch.arc("theta", centre, 1.15 * size, 0.0, q[2], BLUE)
    sketch.label(centre + 1.28 * size * unit(0.5 * q[2]), r"$\theta$", BLUE)
    foot = np.array([P[0], 0.0])
    sketch.dimension("phi_n", foot, P, RED)
    sketch.label(0.5 * (foot + P) + size * np.array([0.14, 0.0]), r"$\phi_n$", RED)
    sketch.point("centre of mass", centre)
    sketch.point("P", P, zorder=5)
    sketch.label(P + size * np.array([0.12, -0.06]), "$P$")
    if origin:
        sketch.axes_cross(np.zeros(2), 0.4 * size)
        sketch.point("O", np.zeros(2))
        sketch.label((-0.13 * size, 0.1 * size), "$O$")
    return sketch, P, gap


def _corner_angle(sketch: Sketch, body: PlanarFreeBody, q: np.ndarray, P: np.ndarray) -> None:
    """Draw β, clockwise from the body's -y axis to the corner P, and the distance l of P from the centre."""
    centre, size = np.asarray(q[:2], dtype=float), body.shape.extent
    down = float(q[2]) - 0.5 * np.pi
    to_P = P - centre
    beta = (down - float(np.arctan2(to_P[1], to_P[0]))) % (2.0 * np.pi)
    sketch.line("body axis -y", np.array([centre, centre + 0.85 * size * unit(down)]), **DASHED)
    sketch.arc("beta", centre, 0.4 * size, down, down - beta, GREEN)
    sketch.label(centre + 0.53 * size * unit(down - 0.5 * beta), r"$\beta$", GREEN)
    sketch.line("l", np.stack([centre, P]), color=GREEN)
    across = np.array([to_P[1], -to_P[0]]) / np.linalg.norm(to_P)
    sketch.label(centre + 0.5 * to_P + 0.1 * size * across, "$l$", GREEN)
