"""A planar body over a plate as a MuJoCo model, with the hidden causes that MuJoCo's elements can produce.

    world ── slide x, slide y, hinge z ── body (sphere at each corner, or ellipsoid) ── loose mass on two slides
    world ── plane;  a moving plate: a carriage on a slide, with a box

The plane is MuJoCo's world x-y plane with gravity along −y.  One pair of geoms per corner has the contact's parameters
(`contact`), condim 3 and the elliptic cone.  MuJoCo finds the lowest point of an ellipsoid from its support function;
an ellipse therefore touches a plane in one exact point, and a box within the tolerance of the collision detection.

| cause                                | in the model                                                         |
|--------------------------------------|----------------------------------------------------------------------|
| tilt, camera_slope, gravity_error    | gravity vector; the carriage of the plate is weightless              |
| com_offset, inertia_error            | position of the shape in the frame of the centre of mass; inertia    |
| size_error, corner_radius            | geometry of the body                                                 |
| surface_height                       | height of the plane or of the box                                    |
| plate_velocity, plate_amplitude      | a carriage of `HEAVY` body masses that coasts, or swings on a spring |
| restitution_..., stiffness_..., wear | solref of each pair, set before each contact                         |
| friction_slope, friction_patch, ...  | friction of each pair, set before each contact                       |
| linear_drag, spin_damping            | damping of the joints                                                |
| quadratic_drag, magnus               | MuJoCo's fluid forces on a sphere without added mass                 |
| fluid_density                        | the same on the body's ellipsoid: drag by pose, lift, added mass     |
| loose_mass                           | a point mass on two slides with springs and dampers in the body      |

Source: MuJoCo's documentation, "Computation" (constraint model) and "Fluid forces" (ellipsoid model).
"""

# MuJoCo's type stubs lack the contents of its compiled modules
# pyright: reportAttributeAccessIssue=false

import mujoco
import numpy as np

from thesis_lib.bodies.body import Body
from thesis_lib.bodies.shapes import Polygon
from thesis_lib.simulate.compliant.forces import SHARP, TrueBody
from thesis_lib.simulate.mujoco.causes import MujocoCauses
from thesis_lib.simulate.mujoco.contact import MujocoContact, solref

HEAVY = 1e6  # mass of the carriage in body masses: an impact changes its velocity by a millionth of the body's Δv
DEEP = 0.5  # m, half the thickness of the box
WIDE = 20.0  # m, half the length of the box
AIR = 1.2  # kg/m³, density of the fluid around the sphere; its coefficients then give the required drag


def drop_model(body: Body, contact: MujocoContact, m: MujocoCauses, gravity: float) -> mujoco.MjModel:
    """The model of one body over the plate; `body` and `gravity` (m/s²) are as believed.

    Positions are x, y, θ (m, rad), then x, y of a loose mass relative to the body, then the carriage.  Friction and
    solref of the pairs do not include causes that depend on drop or place.
    """
    model = mujoco.MjModel.from_xml_string(_xml(body, contact, m, gravity))
    # no added mass of the sphere that represents drag and Magnus force
    model.geom_fluid[model.geom("air").id, 6:] = 0.0
    for pair in range(model.npair):
        model.pair_solref[pair] = solref(contact.epsilon, contact.contact_time, share(model, contact))
    return model


def share(model: mujoco.MjModel, contact: MujocoContact) -> float:
    """Ratio d'/d (1) of a deep central impact, from MuJoCo's estimate of the inverse mass."""
    body = model.body("body").id
    mass = model.body_subtreemass[body]
    estimate = model.body_invweight0[body, 0] + model.body_invweight0[model.geom("plate").bodyid[0], 0]
    d = contact.solimp[1]
    return float(1.0 / (d + (1.0 - d) * estimate * mass))


def _xml(body: Body, contact: MujocoContact, m: MujocoCauses, gravity: float) -> str:
    true = TrueBody(body, m, gravity)
    shell, inertia = true.shell, true.inertia
    geoms, corners = _geoms(true, m)
    pairs = "".join(
        f'<pair geom1="plate" geom2="corner{i}" condim="3" friction="{_n(contact.mu, contact.mu, 0, 0, 0)}" '
        f'solimp="{_n(*contact.solimp)}"/>'
        for i in range(corners)
    )
    return f"""<mujoco>
    <compiler angle="radian" inertiafromgeom="false"/>
    <option timestep="{_n(contact.dt)}" integrator="RK4" cone="elliptic" impratio="{_n(contact.impratio)}"
        gravity="{_n(*true.gravity, 0.0)}"
        density="{_n(m.fluid_density or AIR)}"
        tolerance="1e-12" iterations="100" ccd_tolerance="1e-10" ccd_iterations="200" viscosity="0"/>
    <worldbody>
        {_plate(m) if not m.moving_plate else ""}
        <body name="body">
            <joint type="slide" axis="1 0 0" damping="{_n(m.linear_drag * shell)}"/>
            <joint type="slide" axis="0 1 0" damping="{_n(m.linear_drag * shell)}"/>
            <joint type="hinge" axis="0 0 1" damping="{_n(m.spin_damping * inertia)}"/>
            <inertial pos="0 0 0" mass="{_n(shell)}" diaginertia="{_n(inertia, inertia, inertia)}"/>
            {geoms}{_air(body, shell, m)}{_loose(true.mass, m) if m.loose_mass else ""}
        </body>
        {_carriage(true.mass, m) if m.moving_plate else ""}
    </worldbody>
    <contact>{pairs}</contact>
</mujoco>"""


def _geoms(true: TrueBody, m: MujocoCauses) -> tuple[str, int]:
    """Geoms of the body that touch the plate, named corner0, ..., and their number."""
    grown, com, shape = true.grown, true.com, true.shape
    # the fluid acts on the ellipsoid only on request, as two models of drag would add up
    fluid = ' fluidshape="ellipsoid"' if m.fluid_density else ""
    if not isinstance(shape, Polygon):
        a, b = shape.semi_axes
        size = f'type="ellipsoid" size="{_n(grown * a, grown * b, grown * max(a, b))}"'
        return f'<geom name="corner0" {size} pos="{_n(*-com, 0.0)}" contype="0" conaffinity="0"{fluid}/>', 1
    radius = m.corner_radius or SHARP
    centres = true.corners(radius)
    spheres = "".join(
        f'<geom name="corner{i}" type="sphere" size="{_n(radius)}" pos="{_n(*centre, 0.0)}" contype="0" '
        'conaffinity="0"/>'
        for i, centre in enumerate(centres)
    )
    if fluid:
        half = np.abs(grown * np.array(shape.vertices)).max(axis=0)
        spheres += (
            f'<geom name="hull" type="ellipsoid" size="{_n(*half, half.max())}" pos="{_n(*-com, 0.0)}" '
            f'contype="0" conaffinity="0"{fluid}/>'
        )
    return spheres, len(centres)


def _air(body: Body, mass: float, m: MujocoCauses) -> str:
    """A sphere at the centre of mass on which MuJoCo's fluid exerts the forces m c |v| v and m s ω × v.

    MuJoCo's forces on a sphere of radius r are ρ C_D π r² |v| v (blunt drag) and ρ C_M (4/3) π r³ ω × v (Magnus).
    """
    density, radius = m.fluid_density or AIR, body.shape.extent
    drag = m.quadratic_drag * mass / (density * np.pi * radius**2)
    lift = m.magnus * mass / (density * 4.0 / 3.0 * np.pi * radius**3)
    return (
        f'<geom name="air" type="sphere" size="{_n(radius)}" contype="0" conaffinity="0" fluidshape="ellipsoid" '
        f'fluidcoef="{_n(drag, 0, 0, 0, lift)}"/>'
    )


def _loose(mass: float, m: MujocoCauses) -> str:
    loose, w = mass * m.loose_mass, 2.0 * np.pi * m.loose_frequency
    spring = f'stiffness="{_n(w**2 * loose)}" damping="{_n(2.0 * m.loose_damping * w * loose)}"'
    point = 1e-12 * loose  # kg m²: MuJoCo requires an inertia above 0
    return (
        f'<body name="loose"><joint type="slide" axis="1 0 0" {spring}/><joint type="slide" axis="0 1 0" {spring}/>'
        f'<inertial pos="0 0 0" mass="{_n(loose)}" diaginertia="{_n(point, point, point)}"/></body>'
    )


def _plate(m: MujocoCauses) -> str:
    height = f'pos="{_n(0.0, m.surface_height, 0.0)}"'
    return f'<geom name="plate" type="plane" size="1 1 1" zaxis="0 1 0" {height} contype="0" conaffinity="0"/>'


def _carriage(mass: float, m: MujocoCauses) -> str:
    heavy = HEAVY * mass
    spring = f'stiffness="{_n(heavy * (2.0 * np.pi * m.plate_frequency) ** 2)}"' if m.plate_amplitude else ""
    return (
        f'<body name="carriage" gravcomp="1"><joint type="slide" axis="{"0 1 0" if m.plate_amplitude else "1 0 0"}" '
        f'{spring}/><inertial pos="0 0 0" mass="{_n(heavy)}" diaginertia="{_n(heavy, heavy, heavy)}"/>'
        f'<geom name="plate" type="box" size="{_n(WIDE, DEEP, WIDE)}" pos="{_n(0.0, m.surface_height - DEEP, 0.0)}" '
        'contype="0" conaffinity="0"/></body>'
    )


def _n(*values: float) -> str:
    return " ".join(f"{value:.17g}" for value in values)
