"""The same mechanisms in Drake's own compliant contact, as a source of motions that no complementarity problem made.

Drake's discrete plant with its SAP solver presses surfaces into each other with a stiffness k and a relaxation time τ,
and regularises stick; it has no coefficient of restitution.  Its forces are read out with the points where they act, so
that the balance of `stepping` holds to the solver's accuracy,

    M (v_{k+1} - v_k) = h (g + f_ext - C v_k + J_n' c_n + J_t' c_t),      M, C, g, J at (q_k, v_k),

with the rows J of pairs in contact taken at Drake's contact point, within the overlap.  φ ⟂ c_n does not hold,
φ is negative while a force acts: that is the model mismatch that this source is for.

Corners and ends are spheres of `SHARP` m; link 2 is a capsule of `THIN` m, by which its gap is smaller than that of the
segment.

| on paper | in code           | unit | meaning                           |
|----------|-------------------|------|-----------------------------------|
| k        | `stiffness`       | N/m  | of a pair                         |
| τ        | `relaxation_time` | s    | of a pair: damping over stiffness |
| μ        | `mu`              | 1    | of all pairs                      |

Sources: A. Castro et al., An unconstrained convex formulation of compliant contact, IEEE Trans. Robotics 39 (2023),
doi 10.1109/TRO.2022.3209077; R. Tedrake and the Drake development team, Drake, https://drake.mit.edu.
"""

# Drake's stubs take ndarray[float64] alone, where lists and other arrays work, too, and do not know what ports give
# pyright: reportArgumentType=false, reportCallIssue=false, reportAttributeAccessIssue=false, reportReturnType=false

from dataclasses import dataclass

import numpy as np
from pydrake.geometry import (
    AddContactMaterial,
    Capsule,
    CollisionFilterDeclaration,
    Ellipsoid,
    GeometryId,
    GeometrySet,
    HalfSpace,
    ProximityProperties,
    SceneGraph,
    Sphere,
)
from pydrake.geometry import Shape as Solid
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import (
    AddMultibodyPlantSceneGraph,
    ContactModel,
    CoulombFriction,
    DiscreteContactApproximation,
    MultibodyPlant,
)
from pydrake.multibody.tree import PlanarJoint, RigidBody, RotationalInertia, SpatialInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Diagram, DiagramBuilder

from thesis_lib.bodies.shapes import Ellipse
from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.stepping.arm_disk import ArmDisk
from thesis_lib.simulate.stepping.lcp import LcpStatus
from thesis_lib.simulate.stepping.multibody import Mechanism, PlanarFreeBody
from thesis_lib.simulate.stepping.stepping import SimulatedMotion, external_force

SHARP = 1e-6  # m; radius of the sphere that stands for a corner
THIN = 1e-4  # m; radius of the capsule that stands for link 2
STIFFNESS = 1e5  # N/m; 1 kg at rest sinks in by 0.1 mm
RELAXATION = 0.01  # s; two steps of 5 ms: an impact is dead, as Drake's discrete contact is at its best


@dataclass(frozen=True)
class _Scene:
    diagram: Diagram
    plant: MultibodyPlant
    pairs: dict[GeometryId, int]  # contact pair of each geometry but those that are in every pair
    upper: RigidBody  # body on which c_n acts along +n


def simulate_sap(
    mechanism: Mechanism,
    q0: np.ndarray,
    v0: np.ndarray,
    torque: np.ndarray | None,
    h: float,
    steps: int,
    mu: float,
    *,
    stiffness: float = STIFFNESS,
    relaxation_time: float = RELAXATION,
) -> SimulatedMotion:
    """Simulate `steps` steps of h s from (q0, v0) with Drake's compliant contact.

    Args:
        mechanism: a free body, a rimless wheel, or arm and disk.
        q0, v0: (nv,) initial state.
        torque: external force: None, (nv,) or (steps, nv), in N, N m.
        h, steps: as in `simulate`.
        mu: friction coefficient of all pairs.
        stiffness: N/m, of a pair.
        relaxation_time: s, of a pair.

    Returns:
        A record as from `simulate`; its residual is NaN, for there is no complementarity problem.

    Raises:
        UserError: the mechanism is of another kind, a number is out of its range, or the state is not finite.
    """
    f_ext = external_force(torque, steps, mechanism.nv)
    q0, v0 = np.array(q0, dtype=float), np.array(v0, dtype=float)
    for name, value in (("h", h), ("stiffness", stiffness), ("steps", steps)):
        if not 0.0 < value < np.inf:
            raise UserError(f"Drake's contact needs a positive {name}; got {value}.")
    if not (0.0 <= mu < np.inf and 0.0 <= relaxation_time < np.inf):
        raise UserError(f"Drake's contact needs mu and relaxation time >= 0; got {mu}, {relaxation_time} s.")
    if q0.shape != (mechanism.nv,) or v0.shape != q0.shape or not np.isfinite([q0, v0]).all():
        raise UserError(f"A simulation starts from {mechanism.nv} finite numbers each; got {q0} and {v0}.")

    scene = _scene(mechanism, h, mu, stiffness, relaxation_time)
    simulator = Simulator(scene.diagram)
    context = scene.plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    scene.plant.SetPositions(context, q0)
    scene.plant.SetVelocities(context, v0)
    simulator.Initialize()
    forces = scene.plant.get_applied_generalized_force_input_port()
    results = scene.plant.get_contact_results_output_port()
    q, v = np.empty((2, steps + 1, mechanism.nv))
    c_n, c_t = np.zeros((2, steps, len(mechanism.pairs)))
    q[0], v[0] = q0, v0
    touched = []
    for k in range(steps):
        forces.FixValue(context, f_ext[k])
        simulator.AdvanceTo((k + 1) * h)
        q[k + 1], v[k + 1] = scene.plant.GetPositions(context), scene.plant.GetVelocities(context)
        # what is reported after the step is the force that acted in it
        contact = results.Eval(context)
        for i in range(contact.num_point_pair_contacts()):
            touched.append((k, *_read(scene, contact.point_pair_contact_info(i))))

    rows = mechanism.contacts_of(q[:-1])
    J_n, J_t = rows.J_n.copy(), rows.J_t.copy()
    for k, pair, point, n, force in touched:
        J_n[k, pair], J_t[k, pair] = _rows_at(mechanism, q[k], pair, point, n)
        c_n[k, pair], c_t[k, pair] = force @ n, force @ np.array([n[1], -n[0]])
    return SimulatedMotion(
        h=float(h),
        q=q,
        v=v,
        f_ext=f_ext,
        phi=rows.phi,
        J_n=J_n,
        J_t=J_t,
        c_n=c_n,
        c_t=c_t,
        residual=np.full(steps, np.nan),
        status=np.full(steps, int(LcpStatus.SOLVED)),
    )


def _read(scene: _Scene, info: object) -> tuple[int, np.ndarray, np.ndarray, np.ndarray]:
    """Pair, contact point (2,), normal (2,) towards the upper body and force (2,) on it of one contact of Drake's."""
    upper_is_B = info.bodyB_index() == scene.upper.index()
    sign = 1.0 if upper_is_B else -1.0
    point_pair = info.point_pair()
    pair = next(scene.pairs[g] for g in (point_pair.id_A, point_pair.id_B) if g in scene.pairs)
    # Drake's normal points from B into A, its force acts on B
    return pair, info.contact_point()[:2], -sign * point_pair.nhat_BA_W[:2], sign * info.contact_force()[:2]


def _rows_at(
    mechanism: Mechanism, q: np.ndarray, pair: int, point: np.ndarray, n: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """J_n and J_t (nv,): velocity of the upper body at `point`, less that of the lower, along n and t."""

    def spin(origin: np.ndarray) -> np.ndarray:
        return np.array([origin[1] - point[1], point[0] - origin[0]])  # ẑ × (point - origin)

    velocity = np.zeros((2, mechanism.nv))
    velocity[:, -3:-1] = np.eye(2)
    velocity[:, -1] = spin(q[-3:-1])
    if isinstance(mechanism, ArmDisk) and pair == 0:
        velocity[:, 0], velocity[:, 1] = -spin(mechanism.base), -spin(mechanism.joints(q[None])[0][0])
    return n @ velocity, np.array([n[1], -n[0]]) @ velocity


def _scene(mechanism: Mechanism, h: float, mu: float, stiffness: float, relaxation_time: float) -> _Scene:
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, time_step=h)
    plant.set_contact_model(ContactModel.kPoint)
    plant.set_discrete_contact_approximation(DiscreteContactApproximation.kSap)
    plant.set_adjacent_bodies_collision_filters(False)  # else the body would not meet the ground it moves over
    properties = ProximityProperties()
    # given to both geometries of a pair: Drake puts their springs in series and adds their relaxation times
    AddContactMaterial(point_stiffness=2.0 * stiffness, friction=CoulombFriction(mu, mu), properties=properties)
    properties.AddProperty("material", "relaxation_time", 0.5 * relaxation_time)
    if isinstance(mechanism, ArmDisk):
        mechanism.add_bodies(plant)
        pairs, upper = _add_arm_shapes(plant, scene_graph, mechanism, properties)
    elif isinstance(mechanism, PlanarFreeBody):
        pairs, upper = _add_free_body(plant, mechanism, properties)
    else:
        raise UserError(
            f"Drake's contact is set up for free bodies, wheels and the arm with disk, not {type(mechanism).__name__}."
        )
    plant.Finalize()
    return _Scene(builder.Build(), plant, pairs, upper)


def _add_ground(plant: MultibodyPlant, properties: ProximityProperties) -> GeometryId:
    up = RigidTransform(RotationMatrix.MakeXRotation(-0.5 * np.pi))  # the half-space's z along the plane's y
    return plant.RegisterCollisionGeometry(plant.world_body(), up, HalfSpace(), "ground", properties)


def _add_arm_shapes(
    plant: MultibodyPlant, scene_graph: SceneGraph, arm: ArmDisk, properties: ProximityProperties
) -> tuple[dict[GeometryId, int], RigidBody]:
    length = arm.link_lengths[1]
    disk, link = plant.GetBodyByName("disk"), plant.GetBodyByName("link_2")
    ground = _add_ground(plant, properties)
    along = RigidTransform(RotationMatrix.MakeYRotation(0.5 * np.pi), [0.5 * length, 0.0, 0.0])
    capsule = plant.RegisterCollisionGeometry(link, along, Capsule(THIN, length), "link_2", properties)
    plant.RegisterCollisionGeometry(disk, RigidTransform(), Sphere(arm.disk_radius), "disk", properties)
    # in this mechanism the arm does not touch the ground
    apart = CollisionFilterDeclaration().ExcludeBetween(GeometrySet(ground), GeometrySet(capsule))
    scene_graph.collision_filter_manager().Apply(apart)
    return {capsule: 0, ground: 1}, disk


def _add_free_body(
    plant: MultibodyPlant, body: PlanarFreeBody, properties: ProximityProperties
) -> tuple[dict[GeometryId, int], RigidBody]:
    central = RotationalInertia(body.inertia, body.inertia, body.inertia)
    inertia = SpatialInertia.MakeFromCentralInertia(body.mass, np.zeros(3), central)
    frame = plant.AddRigidBody("body", inertia)
    plant.AddJoint(PlanarJoint("plane", plant.world_frame(), frame.body_frame(), damping=np.zeros(3)))
    g = body.gravity(np.zeros(3)) / body.mass
    plant.mutable_gravity_field().set_gravity_vector([g[0], g[1], 0.0])
    _add_ground(plant, properties)
    pairs = {}
    for i, (solid, place) in enumerate(_solids(body)):
        pose = RigidTransform([*place, 0.0])
        pairs[plant.RegisterCollisionGeometry(frame, pose, solid, body.pairs[i], properties)] = i
    return pairs, frame


def _solids(body: PlanarFreeBody) -> list[tuple[Solid, np.ndarray]]:
    """A solid of Drake's for each contact pair, and where it sits on the body, (2,) in m."""
    centre = np.zeros(2)
    if body.corners is not None:
        return [(Sphere(SHARP), corner) for corner in body.corners]
    if isinstance(body.shape, Ellipse):
        a, b = body.shape.semi_axes
        return [(Ellipsoid(a, b, max(a, b)), centre)]
    return [(Sphere(body.shape.radius), centre)]
