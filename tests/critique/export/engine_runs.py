"""What an engine makes of free bodies in a file, and what it makes of the same planar states without one.

States are planar (x, y, θ) in the axes of the surface; a file has the plane of the drops as x-z, the surface tilted.
"""

from collections.abc import Iterable, Sequence

import mujoco
import numpy as np

from tests.critique.simulation import saved_models
from thesis_lib.bodies.body import Body
from thesis_lib.bodies.shapes import Ellipse, Polygon
from thesis_lib.critique.contacts.bases import BASES
from thesis_lib.critique.export.export import Exported
from thesis_lib.engines.drake_engine import DrakeEngine
from thesis_lib.engines.engine import impacts
from thesis_lib.engines.mujoco_engine import STEPS, MujocoEngine
from thesis_lib.engines.parameters import drake_numbers, of_drake
from thesis_lib.mechanics.bisection import bisected
from thesis_lib.mechanics.space import rotation_matrix
from thesis_lib.simulate.mujoco.contact import MujocoContact
from thesis_lib.simulate.rig.hidden_causes import CompliantContact, HiddenCauses

MASS, SPAN, LEAD = 0.05, 4.5e-3, 1.3e-4  # kg; s after the touch; s of flight before it
BODIES = {
    "ellipse": Body(shape=Ellipse(semi_axes=(0.035, 0.025)), mass=MASS, radius_of_gyration=0.019),
    "square": Body(
        shape=Polygon(vertices=((0.03, 0.03), (-0.03, 0.03), (-0.03, -0.03), (0.03, -0.03))),
        mass=MASS,
        radius_of_gyration=0.0245,
    ),
    "triangle": Body(
        shape=Polygon(vertices=((0.04, -0.018), (-0.01, 0.034), (-0.03, -0.016))), mass=MASS, radius_of_gyration=0.0205
    ),
}
TRUE = {"mu": 0.2, "epsilon": 0.6, "contact_time": 1.2e-3}
LAW = {"mujoco": "convex_contact", "drake": "hunt_crossley_contact"}
WIDE = 0.25  # rad from lying on a side: nearer, outcomes hang on which corner is first


def steep(body, theta):
    """Mask of angles at which the body is not about to lie down on a side."""
    if not isinstance(body.shape, Polygon):
        return np.ones(len(theta), bool)
    side = np.roll(body.shape.corners, -1, axis=0) - body.shape.corners
    off = np.abs(np.angle(np.exp(1j * (theta[:, None] + np.arctan2(side[:, 1], side[:, 0])))))
    return off.min(axis=1) > WIDE


def predicted(name, body, q, v, mu, epsilon, contact_time, c_x=0.0, c_y=0.0, impedance=0.01, **causes):
    """Velocities (n, 3) by the engine with these numbers."""
    causes = HiddenCauses(com_offset_x=c_x, com_offset_y=c_y, **causes)
    contact = {"mu": mu, "epsilon": epsilon, "contact_time": contact_time}
    if name == "mujoco":
        engine = MujocoEngine(
            body, len(q), contact=MujocoContact(**contact, impedance=impedance, steps=STEPS), causes=causes
        )
    else:
        engine = DrakeEngine(body, len(q), contact=CompliantContact(**contact), causes=causes)
    m, none, rows = engine.mechanics, np.zeros(len(q)), np.arange(len(q))
    low, _ = bisected(lambda s: m.gap(flown(m, q, v, s)[0], s, rows) >= 0.0, none, none + SPAN, 40)
    out = impacts(engine, *m.origin_state(*flown(m, q, v, low)))
    return m.origin_state(*flown(m, out.q, out.v, SPAN - low - out.t))[1]


def flown(mechanics, q, v, s):
    """States of the true centre of mass (n, 3) after flights of s (n,) from those of the origin."""
    (centre, rate), s = mechanics.centre_state(q, v), s[:, None]
    spin, g = v[:, 2:], mechanics.gravity
    return np.hstack([centre + s * rate + 0.5 * s**2 * g, q[:, 2:] + s * spin]), np.hstack([rate + s * g, spin])


def errors(body, v, w):
    return np.sqrt((((v - w) * [1.0, 1.0, body.radius_of_gyration]) ** 2).sum(axis=1))


def model_of(name, body, numbers, tilt=0.0, height=0.0, extra=None, ratio=10.0, impedance=0.01):
    """The model.json of an engine with these numbers."""
    mu, epsilon, T = (numbers[key] for key in ("mu", "epsilon", "contact_time"))
    law = BASES[LAW[name]]
    if name == "drake":  # the law's epsilon and time are those at 1 m/s
        mu, epsilon, T = of_drake(drake_numbers(mu, epsilon, T, mass=MASS), MASS, speed=1.0)
    loss = law.force.loss(np.array([epsilon]))
    values = {"mu": mu, "epsilon": epsilon, "tau": T * float((law.force.centroid(loss) / law.force.duration(loss))[0])}
    values |= {"com_offset.c_x": numbers.get("c_x", 0.0), "com_offset.c_y": numbers.get("c_y", 0.0)}
    values |= {"surface_tilt.phi": tilt, "damping_ratio": ratio, "impedance": impedance, **(extra or {})}
    return saved_models.model_of(height, body, law.name, **values)


# --- the file in its engine: a free body in space ---


def in_space(q, v, tilt, height):
    """Positions (n, 3), quaternions (n, 4), velocities and angular velocities (n, 3) of a body in the file's world."""
    along, normal = np.array([np.cos(tilt), 0.0, -np.sin(tilt)]), np.array([np.sin(tilt), 0.0, np.cos(tilt)])
    turn = 0.5 * (tilt - q[:, 2])
    zero = np.zeros(len(q))
    return (
        q[:, :1] * along + (q[:, 1:2] + height) * normal,
        np.column_stack([np.cos(turn), zero, np.sin(turn), zero]),
        v[:, :1] * along + v[:, 1:2] * normal,
        np.column_stack([zero, -v[:, 2], zero]),
    )


def in_plane(ends, tilt):
    """Planar velocities (n, 3) of bodies that `by_mujoco` and `by_drake` have moved; they have not left the plane."""
    v, w = (np.array(rows) for rows in list(zip(*ends))[2:])
    along, normal = np.array([np.cos(tilt), 0.0, -np.sin(tilt)]), np.array([np.sin(tilt), 0.0, np.cos(tilt)])
    out = np.abs(np.column_stack([v[:, 1], 0.02 * w[:, 0], 0.02 * w[:, 2]])).max(axis=1)
    assert np.quantile(out, 0.9) < 1e-3, "the body leaves its plane"
    return np.column_stack([v @ along, v @ normal, -w[:, 1]])


def by_mujoco(text: str, starts: Iterable[Sequence[np.ndarray]], span: float, body: str = "body"):
    """Place, quaternion, velocity and spin of each body `span` in s later, in axes of the world, from such `starts`."""
    model = mujoco.MjModel.from_xml_string(text)
    data, joint = mujoco.MjData(model), model.body(body).jntadr[0]
    at, of = model.jnt_qposadr[joint], model.jnt_dofadr[joint]
    for place, turn, speed, spin in starts:
        mujoco.mj_resetData(model, data)
        data.qpos[at : at + 7], data.qvel[of : of + 3] = [*place, *turn], speed
        data.qvel[of + 3 : of + 6] = rotation_matrix(turn[:, None])[..., 0].T @ spin  # in the axes of the body
        mujoco.mj_step(model, data, round(span / model.opt.timestep))
        pose, motion = data.qpos[at : at + 7].copy(), data.qvel[of : of + 6].copy()
        yield pose[:3], pose[3:], motion[:3], rotation_matrix(pose[3:, None])[..., 0] @ motion[3:]


def plant_of(path):
    """A simulator in continuous time of a file, and its plant."""
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, ContactModel
    from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator
    from pydrake.systems.framework import DiagramBuilder

    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, 0.0)
    Parser(plant).AddModels(str(path))
    plant.set_contact_model(ContactModel.kPoint)
    plant.Finalize()
    plant.set_stiction_tolerance(2e-3)
    simulator = Simulator(builder.Build())
    ResetIntegratorFromFlags(simulator, "runge_kutta3", 1e-3).set_target_accuracy(1e-4)
    return simulator, plant


def by_drake(path, starts: Iterable[Sequence[np.ndarray]], span: float, body: str = "body"):
    """The same of an SDF or URDF file."""
    from pydrake.common.eigen_geometry import Quaternion
    from pydrake.math import RigidTransform
    from pydrake.multibody.math import SpatialVelocity

    simulator, plant = plant_of(path)
    root = simulator.get_mutable_context()
    context, link = plant.GetMyMutableContextFromRoot(root), plant.GetBodyByName(body)
    for place, turn, speed, spin in starts:
        root.SetTime(0.0)
        at = RigidTransform(Quaternion(turn / np.linalg.norm(turn)), place)
        plant.SetFreeBodyPose(context, link, at)
        plant.SetFreeBodySpatialVelocity(context, link, SpatialVelocity(spin, speed))
        simulator.Initialize()
        simulator.AdvanceTo(span)
        pose, motion = plant.EvalBodyPoseInWorld(context, link), plant.EvalBodySpatialVelocityInWorld(context, link)
        yield pose.translation(), pose.rotation().ToQuaternion().wxyz(), motion.translational(), motion.rotational()


def inertia_in_mujoco(body) -> np.ndarray:
    """The tensor (3, 3) about the centre of mass of a body that MuJoCo has read, in its axes."""
    axes = rotation_matrix(np.array(body.iquat)[:, None])[..., 0]
    return axes * np.array(body.inertia) @ axes.T


def inertia_in_drake(plant, link: str) -> tuple[float, np.ndarray, np.ndarray]:
    """Mass, centre of mass (3,) and the tensor (3, 3) about it of a link that Drake has read."""
    read = plant.GetBodyByName(link).default_spatial_inertia()
    about = read.Shift(read.get_com()).CalcRotationalInertia().CopyToFullMatrix3()
    return read.get_mass(), read.get_com(), about


def require_told(made: Exported, without: Exported, effect: str) -> None:
    """An effect is in the file or left out, told on the terminal and in the comment; and what is in it changes it."""
    text, old = made.content.decode(), without.content.decode()
    held, left = ([line for line in lines if line.startswith(f"{effect}: ")] for lines in (made.held, made.left_out))
    assert len(held) + len(left) == 1 and (held or len(left[0]) > len(effect) + 20)
    assert f"{effect}: " in text[text.index("effects in this file") : text.index("-->")]
    assert bool(held) == (text[text.index("-->") :] != old[old.index("-->") :]), effect
