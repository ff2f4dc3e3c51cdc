"""Arm and wheel in Drake, with Drake's own compliant point contact and regularised friction.

Contact is Drake's: a spring with Hunt and Crossley's dissipation, and Coulomb friction that is reduced below a slip of
`STICTION` (TAMSI).  Causes that Drake's plant can represent (damping of the joints, gravity, a payload) are set in the
plant; the others are generalised forces, updated every `CONTROL` seconds from Drake's state and contact forces:

    Coulomb friction   -f_i tanh(q̇_i / q̇_s)        cogging   A sin(n q_1)
    rolling resistance -c_rr ρ N tanh(ω / ω_s)      N: normal force of the ground, as reported by Drake

Source: R. Tedrake and the Drake development team, Drake, https://drake.mit.edu (MultibodyPlant, "compliant contact");
A. Castro et al., IEEE Robot. Autom. Lett. 5 (2020), doi 10.1109/LRA.2020.2964631 (TAMSI).
"""

# Drake's type stubs accept only ndarray[float64], although lists and other arrays work, and lack the types of ports
# pyright: reportArgumentType=false, reportCallIssue=false, reportAttributeAccessIssue=false, reportReturnType=false

from collections.abc import Sequence

import numpy as np
from pydrake.geometry import Box, CollisionFilterDeclaration, GeometrySet, HalfSpace, ProximityProperties, Sphere
from pydrake.math import RigidTransform
from pydrake.multibody.plant import (
    AddMultibodyPlantSceneGraph,
    ContactModel,
    DiscreteContactApproximation,
    MultibodyPlant,
)
from pydrake.multibody.tree import PlanarJoint, SpatialInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from thesis_lib.simulate.drake.plant import point_contact
from thesis_lib.simulate.engines.settings import (
    CONTROL,
    DISSIPATION,
    LINK_DEPTH,
    STEP,
    STICTION,
    TIP_RADIUS,
    EngineMotion,
)
from thesis_lib.simulate.mechanisms import motions as chapter2
from thesis_lib.simulate.mechanisms.hidden_forces import (
    HiddenSizes,
    MechanismKind,
    cogging,
    coulomb_joint_friction,
    loaded_arm,
)
from thesis_lib.simulate.mechanisms.motions import DEFAULT
from thesis_lib.simulate.stepping.arm_disk import spatial_inertia
from thesis_lib.simulate.stepping.stepping import SimulatedMotion

_UP = np.array([0.0, 1.0, 0.0])


def drake_motions(
    kind: MechanismKind, truth: str, plans: Sequence[SimulatedMotion], sizes: HiddenSizes, stiffness: float
) -> list[EngineMotion]:
    """Simulate the planned trials (start and torques) of a mechanism with the hidden cause `truth` in Drake."""
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, time_step=STEP)
    plant.set_contact_model(ContactModel.kPoint)
    plant.set_discrete_contact_approximation(DiscreteContactApproximation.kTamsi)
    if kind == "arm":
        _add_arm(plant, scene_graph, truth, sizes, stiffness)
    else:
        _add_wheel(plant, truth, sizes, stiffness)
    slope = DEFAULT.wheel.slope if kind == "wheel" else 0.0
    slope += sizes.tilt if truth == "gravity_direction" else 0.0
    plant.mutable_gravity_field().set_gravity_vector(DEFAULT.gravity * np.array([np.sin(slope), -np.cos(slope), 0.0]))
    plant.Finalize()
    plant.set_stiction_tolerance(STICTION)
    simulator = Simulator(builder.Build())
    ground = plant.GetBodyByName("ground").index()
    return [_run(simulator, plant, ground, _force(kind, truth, sizes), plan) for plan in plans]


def _run(simulator, plant: MultibodyPlant, ground, force, plan: SimulatedMotion) -> EngineMotion:
    """Simulate one trial; `force` returns a generalised force (nv,) from q, v and the ground's normal force."""
    context = simulator.get_mutable_context()
    context.SetTime(0.0)
    own = plant.GetMyMutableContextFromRoot(context)
    plant.SetPositionsAndVelocities(own, np.concatenate([plan.q[0], plan.v[0]]))
    port, contacts = plant.get_applied_generalized_force_input_port(), plant.get_contact_results_output_port()
    port.FixValue(own, plan.f_ext[0])
    simulator.Initialize()
    per_step, k = round(plan.h / CONTROL), 0
    q, v = [plan.q[0]], [plan.v[0]]
    for f in plan.f_ext:
        for _ in range(per_step):
            total = f
            if force is not None:
                total = f + force(q[-1], v[-1], _normal(contacts.Eval(own), ground))
            port.FixValue(own, total)
            k += 1
            simulator.AdvanceTo(k * CONTROL)
            q.append(plant.GetPositions(own))
            v.append(plant.GetVelocities(own))
    return EngineMotion.controlled(q, v)


def _normal(results, ground) -> float:
    """Normal force in N of the ground, summed over its contacts."""
    infos = [results.point_pair_contact_info(i) for i in range(results.num_point_pair_contacts())]
    return sum(abs(i.contact_force()[1]) for i in infos if ground in (i.bodyA_index(), i.bodyB_index()))


def _force(kind: MechanismKind, truth: str, sizes: HiddenSizes):
    """Force of a cause that Drake's plant cannot represent, or None."""
    known = {
        "coulomb_joint_friction": coulomb_joint_friction(sizes.coulomb, sizes.coulomb_speed),
        "cogging": cogging(sizes.cogging, sizes.cogging_periods),
    }.get(truth)
    if known is not None:
        return lambda q, v, N: known(0.0, q, v)
    if truth != "rolling_resistance":
        return None
    radius, last = (DEFAULT.arm.disk_radius, 4) if kind == "arm" else (DEFAULT.wheel.length, 2)
    resisted = -sizes.rolling * radius * np.eye(last + 1)[last]
    return lambda q, v, N: resisted * N * np.tanh(v[-1] / sizes.rolling_speed)


def _properties(mu: float, stiffness: float) -> ProximityProperties:
    # used for both geometries: Drake puts their springs in series
    return point_contact(2.0 * stiffness, DISSIPATION, mu)


def _add_ground(plant: MultibodyPlant, properties: ProximityProperties) -> None:
    # a separate body, to distinguish its contacts from those of the arm
    ground = plant.AddRigidBody("ground", SpatialInertia.SolidSphereWithMass(1.0, 1.0))
    plant.WeldFrames(plant.world_frame(), ground.body_frame())
    plant.RegisterCollisionGeometry(ground, HalfSpace.MakePose(_UP, np.zeros(3)), HalfSpace(), "ground", properties)


def _add_arm(plant: MultibodyPlant, scene_graph, truth: str, sizes: HiddenSizes, stiffness: float) -> None:
    """Add arm, disk and ground."""
    a, properties = DEFAULT.arm, _properties(DEFAULT.arm.mu, stiffness)
    true = loaded_arm(DEFAULT, sizes.payload) if truth == "payload" else DEFAULT
    chapter2.arm_disk(true).add_bodies(plant)
    if truth == "viscous_joint_friction":
        for i, b in enumerate(sizes.viscous):
            plant.GetJointByName(f"joint_{i + 1}").set_default_damping(b)
    length, depth = a.link_lengths[1], LINK_DEPTH
    place = RigidTransform([0.5 * length, 0.5 * depth, 0.0])
    link, disk = plant.GetBodyByName("link_2"), plant.GetBodyByName("disk")
    plant.RegisterCollisionGeometry(link, place, Box(length, depth, 0.2), "link", properties)
    plant.RegisterCollisionGeometry(disk, RigidTransform(), Sphere(a.disk_radius), "disk", properties)
    _add_ground(plant, properties)
    # the believed model has no contact between arm and ground
    both = (link, plant.GetBodyByName("ground"))
    apart = GeometrySet([geometry for body in both for geometry in plant.GetCollisionGeometriesForBody(body)])
    scene_graph.collision_filter_manager().Apply(CollisionFilterDeclaration().ExcludeWithin(apart))


def _add_wheel(plant: MultibodyPlant, truth: str, sizes: HiddenSizes, stiffness: float) -> None:
    """Add wheel and ground, in the axes of the slope."""
    w, made, properties = DEFAULT.wheel, chapter2.wheel(), _properties(DEFAULT.wheel.mu, stiffness)
    load = sizes.wheel_payload if truth == "payload" else 0.0
    mass, radius = w.mass + load, sizes.payload_radius
    com = load * radius / mass
    inertia = w.inertia + load * radius**2 - mass * com**2
    wheel = plant.AddRigidBody("wheel", spatial_inertia(mass, (com, 0.0), inertia))
    plant.AddJoint(PlanarJoint("plane", plant.world_frame(), wheel.body_frame(), damping=np.zeros(3)))
    tips = made.contact_points(np.zeros(1))[0] * (1.0 - TIP_RADIUS / w.length)
    for i, tip in enumerate(tips):
        pose = RigidTransform([*tip, 0.0])
        plant.RegisterCollisionGeometry(wheel, pose, Sphere(TIP_RADIUS), f"tip_{i}", properties)
    _add_ground(plant, properties)
