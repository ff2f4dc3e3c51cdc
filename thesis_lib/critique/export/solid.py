"""The body in space that a planar model stands for: what its file says, where each number is from, what is left out.

The plane of the drops is the x-z plane of the body: planar (x, y) is (x, z), θ turns about −y, and the body is `depth`
deep along y.  Drops show one moment of inertia, m k² about y.  The other two are those of a uniform solid of this shape
and depth, all scaled by one factor so that the moment about y is right; so they always belong to some body.

| on paper | in code          | unit  | shape  |                                                              |
|----------|------------------|-------|--------|--------------------------------------------------------------|
| k        | `k_g`            | m     |        | true radius of gyration about y                              |
| c        | `com`            | m     | (2,)   | true centre of mass in the frame of the body                 |
| I        | `inertia`        | kg m² | (3, 3) | about the centre of mass, in the axes of the body            |
| T        | `contact_time`   | s     |        | of a central contact                                         |
| φ, H     | `tilt`, `height` | rad, m |       | of the surface; its normal is (sin φ, 0, cos φ)              |
"""

from dataclasses import dataclass

import numpy as np

from thesis_lib.bodies.shapes import Disk, Ellipse, Polygon, Shape
from thesis_lib.contact.compliant.compiled import SPEED
from thesis_lib.contact.compliant.normal_force import HuntCrossley
from thesis_lib.critique.contacts.contact_time import CONTACT_TIME, DAMPING_RATIO, IMPEDANCE, duration
from thesis_lib.critique.export.effects import reason, written
from thesis_lib.critique.results.saved_model import SavedModel
from thesis_lib.foundation.errors import UserError

NO_MASS = 1.0  # kg, of a model whose mass nobody gave
NO_TIME = 1e-3  # s, of a contact whose time no trajectory shows
LEAST = 0.01  # ε below which no damper of an engine goes
MOST_DEPTH = 100.0  # m
ALIGNED = 1e-9  # m, how far corners may be from those of a box


@dataclass(frozen=True)
class ExportedBody:
    """A body over its surface; `speed` in m/s is that of ε, None if ε holds at any; `damping_ratio` and `impedance`
    None: not fitted.

    `expressed` and `left_out` say, by name, what the file holds and what it cannot.
    """

    model: SavedModel
    shape: Shape
    depth: float
    mass: float
    mass_known: bool
    k_g: float
    com: np.ndarray
    corner_radius: float
    mu: float
    epsilon: float
    contact_time: float
    time_known: bool
    speed: float | None
    damping_ratio: float | None
    impedance: float | None
    gravity: float
    tilt: float
    height: float
    expressed: tuple[tuple[str, str], ...]
    left_out: tuple[tuple[str, str], ...]

    @property
    def box(self) -> tuple[np.ndarray, np.ndarray] | None:
        """Centre and half sides (2,) in m of a rectangle along the axes of the body; None for other shapes."""
        if not isinstance(self.shape, Polygon) or len(self.shape.corners) != 4:
            return None
        corners = self.shape.corners
        low, high = corners.min(axis=0), corners.max(axis=0)
        off = np.minimum(np.abs(corners - low), np.abs(corners - high)).max()
        return (0.5 * (low + high), 0.5 * (high - low)) if off < ALIGNED else None

    @property
    def inertia(self) -> np.ndarray:
        """I (3, 3) in kg m² about the centre of mass."""
        S = _second_moments(self.shape, self.depth)
        S *= self.k_g**2 / (S[0, 0] + S[2, 2])
        return self.mass * (np.trace(S) * np.eye(3) - S)

    @property
    def centre(self) -> np.ndarray:
        """The centre of mass (3,) in m."""
        return np.array([self.com[0], 0.0, self.com[1]])

    @property
    def normal(self) -> np.ndarray:
        """The surface's normal (3,)."""
        return np.array([np.sin(self.tilt), 0.0, np.cos(self.tilt)])


def solid(model: SavedModel, target: str, mass: float | None = None, depth: float | None = None) -> ExportedBody:
    """The body of a model for the format `target`.

    Args:
        mass: kg; None: `NO_MASS`, as a model knows only the radius of gyration.
        depth: m along y; None: the longest extent in the plane.

    Raises:
        UserError: mass or depth is not positive, or the contact has no restitution left.
    """
    for name, value, most in (("mass", mass, np.inf), ("depth", depth, MOST_DEPTH)):
        if value is not None and not 0.0 < value < most:
            raise UserError(f"--{name} must be a positive number{'' if most == np.inf else ' in m'}; got {value}.")
    values = model.values

    def of(name: str) -> float:
        return values.get(name, 0.0)

    shape = _grown(model.rig.shape, 1.0 + of("wrong_size.s"))
    longest = 2.0 * _half_width(shape)
    time, speed = _contact_time(model)
    expressed = tuple((name, said) for name in model.effects if (said := written(name, target)))
    left_out = [(name, reason(name, target)) for name in model.effects if not written(name, target)]
    if "stiction_tolerance" in values:
        left_out.append(("stiction_tolerance", "a property of Drake's plant: plant.set_stiction_tolerance(...)"))
    if DAMPING_RATIO.name in values and target != "mjcf":
        left_out.append((DAMPING_RATIO.name, "the friction of a convex program; Drake's is Coulomb's"))
        left_out.append((IMPEDANCE.name, "MuJoCo's alone: Drake's spring and damper do not know the mass behind them"))
    if model.scatter:
        left_out.append(("scatter", f"{model.scatter:g} m/s after impact that no effect explains"))
    return ExportedBody(
        model=model,
        shape=shape,
        depth=depth or longest,
        mass=mass or NO_MASS,
        mass_known=mass is not None,
        k_g=model.rig.radius_of_gyration * float(np.sqrt(1.0 + of("wrong_inertia.d_I"))),
        com=np.array([of("com_offset.c_x"), of("com_offset.c_y")]),
        corner_radius=of("rounded_corners.rho"),
        mu=of("mu"),
        epsilon=max(of("epsilon"), LEAST),
        contact_time=time or NO_TIME,
        time_known=bool(time),
        speed=speed,
        damping_ratio=values.get(DAMPING_RATIO.name),
        impedance=values.get(IMPEDANCE.name),
        gravity=model.rig.gravity + of("wrong_gravity.dg"),
        tilt=of("surface_tilt.phi"),
        height=model.rig.height + of("surface_height.h"),
        expressed=expressed,
        left_out=tuple(left_out),
    )


def _contact_time(model: SavedModel) -> tuple[float, float | None]:
    """T in s of a central contact (0 if unknown), and the speed in m/s at which ε and T hold (None: any)."""
    tau, epsilon = model.values.get(CONTACT_TIME.name, 0.0), max(model.values["epsilon"], LEAST)
    force = model.model.law.force
    speed = SPEED if isinstance(force, HuntCrossley) else None
    if not tau or force is None:
        return duration(tau, epsilon), speed
    loss = np.atleast_1d(force.loss(np.array([epsilon])))
    return tau * float((force.duration(loss) / force.centroid(loss))[0]), speed


def _grown(shape: Shape, factor: float) -> Shape:
    if isinstance(shape, Ellipse):
        a, b = shape.semi_axes
        return Ellipse(semi_axes=(factor * a, factor * b))
    if isinstance(shape, Disk):
        return Disk(radius=factor * shape.radius)
    corners = [(float(x), float(y)) for x, y in factor * shape.corners]
    return Polygon(vertices=tuple(corners))


def _half_width(shape: Shape) -> float:
    if isinstance(shape, Ellipse):
        return max(shape.semi_axes)
    return shape.radius if isinstance(shape, Disk) else 0.5 * float(np.ptp(shape.corners, axis=0).max())


def _second_moments(shape: Shape, depth: float) -> np.ndarray:
    """∫ x xᵀ over the uniform solid per its volume (3, 3) in m², about its centroid."""
    S = np.zeros((3, 3))
    if isinstance(shape, Ellipse):
        a, b = shape.semi_axes
        return np.diag([a * a, 0.25 * depth * depth, b * b]) / 5.0
    S[1, 1] = depth * depth / 12.0
    if isinstance(shape, Disk):
        S[0, 0] = S[2, 2] = 0.25 * shape.radius**2
        return S
    # over triangles from the first corner: the mean of x xᵀ is (Σ v vᵀ + s sᵀ)/12 with s = Σ v
    p = shape.corners - shape.centroid
    area, plane = 0.0, np.zeros((2, 2))
    for one, two in zip(p, np.roll(p, -1, axis=0)):
        part = 0.5 * (one[0] * two[1] - one[1] * two[0])
        both = one + two
        area += part
        plane += part * (np.outer(one, one) + np.outer(two, two) + np.outer(both, both)) / 12.0
    S[np.ix_([0, 2], [0, 2])] = plane / area
    return S
