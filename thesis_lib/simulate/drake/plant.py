"""A planar body over a plate as a Drake diagram with compliant point contact, integrated in continuous time.

    world ── carriage (a moving or vibrating plate only) ── pad ── skid (tangential compliance only) ── half-space
    world ── PlanarJoint ── body (sphere at each corner, or ellipsoid) ── loose mass on two springs

The plane is Drake's world x-y plane with gravity along −y.  The contact is Drake's: a spring between half-space and
body with Hunt-Crossley dissipation d, and Coulomb friction with one coefficient, regularised below a slip of
`STICTION`.  The contact point of a penetrating ellipsoid is off its lowest point by up to an eighth of the depth.
Restitution comes either from the pad (`viscoelastic_pad`), whose dampers would force time steps of 0.1 µs on a flight
(which therefore has a separate diagram), or, without a pad, from Drake's own dissipation (`hunt_crossley`), in point
contact or in hydroelastic contact (`hydroelastic`).  Every cause is a property of the rig or the body:

| cause                               | in the plant                                                             |
|-------------------------------------|--------------------------------------------------------------------------|
| tilt, camera_slope, gravity_error   | gravity vector on the body; the parts that carry the plate are weightless |
| com_offset, inertia_error           | position of the shape in the frame of the centre of mass; inertia        |
| size_error, corner_radius           | geometry of the body                                                     |
| surface_height                      | height of the pad                                                        |
| plate_velocity, plate_amplitude     | a carriage of `HEAVY` body masses that coasts, or swings on a spring     |
| tangential_compliance               | a spring and a damper along the plate, on the pad                        |
| hunt_crossley                       | d of Drake's contact, over its spring's share of the total deformation   |
| linear_drag, spin_damping           | damping of the PlanarJoint                                               |
| quadratic_drag, magnus              | generalised force, computed from the velocity by a symbolic system       |
| loose_mass                          | a point mass on two sliding joints with springs and dampers in the body  |

Sources: R. Tedrake and the Drake development team, Drake, https://drake.mit.edu (MultibodyPlant, "compliant contact");
Hunt and Crossley 1975, doi 10.1115/1.3423596.
"""

# Drake's type stubs accept only ndarray[float64], although lists and other arrays work, and lack the types of ports
# pyright: reportArgumentType=false, reportCallIssue=false, reportAttributeAccessIssue=false, reportReturnType=false
# the mass is known: bodies without a mass are rejected earlier
# pyright: reportOptionalOperand=false, reportOperatorIssue=false

from dataclasses import dataclass

import numpy as np
from pydrake.geometry import AddContactMaterial, Ellipsoid, HalfSpace, ProximityProperties, Sphere
from pydrake.math import RigidTransform
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, ContactModel, CoulombFriction, MultibodyPlant
from pydrake.multibody.tree import (
    ModelInstanceIndex,
    PlanarJoint,
    PrismaticJoint,
    PrismaticSpring,
    RigidBody,
    SpatialInertia,
    UnitInertia,
)
from pydrake.symbolic import Expression, sqrt
from pydrake.symbolic import Variable as SymbolicVariable
from pydrake.systems.framework import Diagram, DiagramBuilder, LeafSystem, TriggerType
from pydrake.systems.primitives import LogVectorOutput, SymbolicVectorSystem, VectorLogSink

from thesis_lib.bodies.body import Body
from thesis_lib.bodies.shapes import Polygon
from thesis_lib.simulate.compliant.forces import SHARP, TrueBody
from thesis_lib.simulate.drake.hunt_crossley import Spring
from thesis_lib.simulate.drake.hydroelastic import HydroelasticBody, solid_shape
from thesis_lib.simulate.drake.viscoelastic_pad import Pad, design
from thesis_lib.simulate.rig.hidden_causes import CompliantContact, HiddenCauses

# m/s; slip below which friction is reduced: a tenth of the rig's velocity resolution
STICTION = 2e-3
HEAVY = 1e6  # mass of the carriage in body masses: an impact changes its velocity by a millionth of the body's Δv
SKID_SHARE = 0.03  # of the body's mass; a lighter skid needs more time steps and changes little
Surface = Pad | Spring | HydroelasticBody  # contact model of the plate
_X, _Y = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])


@dataclass(frozen=True)
class DropPlant:
    """A diagram for drops, in flight or in contact."""

    diagram: Diagram
    plant: MultibodyPlant  # finalized
    joint: PlanarJoint  # joint of the body; the body's frame is at the true centre of mass
    moving: ModelInstanceIndex  # body and loose mass; positions begin with the body's x, y, θ
    carriage: PrismaticJoint | None  # joint of a moving or vibrating plate
    log: VectorLogSink | None  # log of the plant's state at every step; None with a plate


def pad_of(body: Body, contact: CompliantContact, m: HiddenCauses, epsilon: float) -> Pad:
    """Pad of restitution `epsilon` under the true body; UserError if no pad dissipates so much energy."""
    r_x = body.shape.contact_point(np.linspace(0.0, 2.0 * np.pi, 721))[:, 0]
    k2 = body.radius_of_gyration**2 * (1.0 + m.inertia_error)
    lever = ((1.0 + m.size_error) * np.abs(r_x).max()) ** 2 / k2
    return design(epsilon, contact.contact_time, body.mass, 1.0 / (1.0 + lever))


def drop_plant(
    body: Body,
    contact: CompliantContact,
    m: HiddenCauses,
    gravity: float,
    surface: Surface | None = None,
    air: LeafSystem | None = None,
) -> DropPlant:
    """Diagram of one body in flight, or in contact with the plate.

    `body` and `gravity` (m/s²) are as believed; only the friction of `contact` is used.  Without a `surface` there
    is a log of the flight instead of a plate.  `air` is a system that computes a generalised force from the plant's
    state; None: the drag and lift in `m`.
    """
    builder = DiagramBuilder()
    if surface is None:
        plant = builder.AddSystem(MultibodyPlant(time_step=0.0))
    else:
        plant, _ = AddMultibodyPlantSceneGraph(builder, time_step=0.0)
        soft = isinstance(surface, HydroelasticBody)
        plant.set_contact_model(ContactModel.kHydroelastic if soft else ContactModel.kPoint)
    moving, plate = plant.AddModelInstance("moving"), plant.AddModelInstance("plate")

    true = TrueBody(body, m, gravity)
    shell, inertia = true.shell, true.inertia
    # only the moment about z matters in the plane; equal moments satisfy Drake's triangle inequality
    solid = SpatialInertia(shell, np.zeros(3), UnitInertia(*[inertia / shell] * 3))
    frame = plant.AddRigidBody("body", moving, solid)
    drag = np.array([m.linear_drag * shell, m.linear_drag * shell, m.spin_damping * inertia])
    joint = plant.AddJoint(PlanarJoint("plane", plant.world_frame(), frame.body_frame(), damping=drag))
    if m.loose_mass:
        _add_loose_mass(plant, moving, frame, true.mass, m)
    carriage = None
    if surface is not None:
        of_body, of_plate = _properties(surface, contact, m)
        if isinstance(surface, HydroelasticBody):
            middle = RigidTransform([*-true.com, 0.0])
            plant.RegisterCollisionGeometry(frame, middle, solid_shape(body, true.grown), "solid", of_body)
        else:
            _add_shape(plant, frame, true, of_body)
        carriage, carrier = _add_carriage(plant, plate, true.mass, m)
        if isinstance(surface, Pad):
            carrier = _add_layers(plant, plate, carrier, true.mass, surface, m)
        if m.tangential_compliance:
            carrier = _add_skid(plant, plate, carrier, body, surface, m)
        pose = HalfSpace.MakePose(_Y, np.array([0.0, m.surface_height, 0.0]))
        plant.RegisterCollisionGeometry(carrier, pose, HalfSpace(), "surface", of_plate)

    plant.mutable_gravity_field().set_gravity_vector([*true.gravity, 0.0])
    plant.set_gravity_enabled(plate, False)
    plant.Finalize()
    plant.set_stiction_tolerance(STICTION)
    if air is None and (m.quadratic_drag or m.magnus):
        air = _air(plant, joint, shell, m)
    if air is not None:
        builder.AddSystem(air)
        builder.Connect(plant.get_state_output_port(), air.get_input_port())
        builder.Connect(air.get_output_port(), plant.get_applied_generalized_force_input_port())
    log = None
    if surface is None:
        log = LogVectorOutput(plant.get_state_output_port(), builder, {TriggerType.kPerStep})
    return DropPlant(builder.Build(), plant, joint, moving, carriage, log)


def _properties(
    surface: Surface, contact: CompliantContact, m: HiddenCauses
) -> tuple[ProximityProperties, ProximityProperties]:
    """Contact properties of the body's shape and of the plate."""
    if isinstance(surface, HydroelasticBody):
        return surface.properties(contact, soft=True), surface.properties(contact, soft=False)
    if isinstance(surface, Spring):
        stiffness, dissipation = surface.stiffness, surface.dissipation
    else:
        # Drake's d multiplies the rate of its own spring, which is only a share of the approach of body and plate
        stiffness, share = surface.k_contact, 1.0 / (surface.k_contact * surface.softness)
        dissipation = m.hunt_crossley / share
    # Drake puts the springs of both geometries in series, and keeps equal d and μ
    properties = point_contact(2.0 * stiffness, dissipation, contact.mu)
    return properties, properties


def point_contact(stiffness: float, dissipation: float, mu: float) -> ProximityProperties:
    """Properties of a geometry in point contact: stiffness in N/m, Hunt and Crossley's d in s/m, and friction."""
    properties = ProximityProperties()
    AddContactMaterial(
        dissipation=dissipation, point_stiffness=stiffness, friction=CoulombFriction(mu, mu), properties=properties
    )
    return properties


def _add_shape(plant: MultibodyPlant, frame: RigidBody, true: TrueBody, properties: ProximityProperties) -> None:
    grown = true.grown
    if isinstance(true.shape, Polygon):
        radius = true.hidden.corner_radius or SHARP
        solid, centres = Sphere(radius), true.corners(radius)
    else:
        a, b = true.shape.semi_axes
        solid = Sphere(grown * a) if a == b else Ellipsoid(grown * a, grown * b, grown * max(a, b))
        centres = -true.com[None]
    for i, centre in enumerate(centres):
        pose = RigidTransform([*centre, 0.0])
        plant.RegisterCollisionGeometry(frame, pose, solid, f"corner_{i}", properties)


def _add_loose_mass(
    plant: MultibodyPlant, instance: ModelInstanceIndex, frame: RigidBody, mass: float, m: HiddenCauses
) -> None:
    loose = mass * m.loose_mass
    w = 2.0 * np.pi * m.loose_frequency
    slider = plant.AddRigidBody("slider", instance, _point(1e-3 * loose))
    inner = plant.AddRigidBody("loose", instance, _point(0.999 * loose))
    for name, parent, child, axis in (("loose_x", frame, slider, _X), ("loose_y", slider, inner, _Y)):
        joint = PrismaticJoint(
            name, parent.body_frame(), child.body_frame(), axis, damping=2.0 * m.loose_damping * w * loose
        )
        plant.AddForceElement(PrismaticSpring(plant.AddJoint(joint), 0.0, w**2 * loose))


def _add_carriage(
    plant: MultibodyPlant, instance: ModelInstanceIndex, mass: float, m: HiddenCauses
) -> tuple[PrismaticJoint | None, RigidBody]:
    if not (m.plate_velocity or m.plate_amplitude):
        return None, plant.world_body()
    heavy = HEAVY * mass
    carriage = plant.AddRigidBody("carriage", instance, _ball(heavy))
    axis = _X if m.plate_velocity else _Y
    joint = plant.AddJoint(PrismaticJoint("carriage", plant.world_frame(), carriage.body_frame(), axis))
    if m.plate_amplitude:
        plant.AddForceElement(PrismaticSpring(joint, 0.0, heavy * (2.0 * np.pi * m.plate_frequency) ** 2))
    return joint, carriage


def _add_layers(
    plant: MultibodyPlant, instance: ModelInstanceIndex, carrier: RigidBody, mass: float, pad: Pad, m: HiddenCauses
) -> RigidBody:
    """Add the layers of a pad on its carrier; return the top layer."""
    plate, skid = carrier, (SKID_SHARE * mass if m.tangential_compliance else 0.0)
    for i, (k, c) in reversed(list(enumerate(pad.layers))):
        # the skid sits on the top layer; its mass is part of that layer's mass
        layer = plant.AddRigidBody(f"layer_{i}", instance, _ball(pad.mass - (0.0 if i else skid)))
        joint = PrismaticJoint(f"layer_{i}", plate.body_frame(), layer.body_frame(), _Y, damping=c)
        plant.AddForceElement(PrismaticSpring(plant.AddJoint(joint), 0.0, k))
        plate = layer
    return plate


def _add_skid(
    plant: MultibodyPlant,
    instance: ModelInstanceIndex,
    plate: RigidBody,
    body: Body,
    surface: Pad | Spring,
    m: HiddenCauses,
) -> RigidBody:
    """Add a light plate that moves along the surface on a spring and a damper."""
    softness = surface.softness if isinstance(surface, Pad) else 1.0 / surface.stiffness
    top = plant.AddRigidBody("skid", instance, _ball(SKID_SHARE * body.mass))
    k = 1.0 / (softness * m.tangential_compliance)
    lever = (body.shape.extent / body.radius_of_gyration) ** 2
    damping = 2.0 * m.tangential_damping * np.sqrt(k * body.mass / (1.0 + lever))
    joint = PrismaticJoint("skid", plate.body_frame(), top.body_frame(), _X, damping=damping)
    plant.AddForceElement(PrismaticSpring(plant.AddJoint(joint), 0.0, k))
    return top


def _ball(mass: float) -> SpatialInertia:
    return SpatialInertia(mass, np.zeros(3), UnitInertia(1.0, 1.0, 1.0))  # arbitrary: these bodies do not rotate


def _air(plant: MultibodyPlant, joint: PlanarJoint, mass: float, m: HiddenCauses) -> LeafSystem:
    """System that computes quadratic drag and the Magnus force from the plant's state."""
    state = [SymbolicVariable(f"s{i}") for i in range(plant.num_multibody_states())]
    start = joint.velocity_start()
    first = plant.num_positions() + start
    vx, vy, omega = state[first : first + 3]
    resistance = m.quadratic_drag * sqrt(vx * vx + vy * vy)
    force = np.array([Expression(0.0)] * plant.num_velocities())
    force[start] = mass * (-resistance * vx - m.magnus * omega * vy)
    force[start + 1] = mass * (-resistance * vy + m.magnus * omega * vx)
    # Drake fails on the state derivative of a system without state: add a constant state
    idle = SymbolicVariable("idle")
    return SymbolicVectorSystem(state=[idle], input=state, dynamics=[Expression(0.0)], output=force)


def _point(mass: float) -> SpatialInertia:
    return SpatialInertia(mass, np.zeros(3), UnitInertia(0.0, 0.0, 0.0))
