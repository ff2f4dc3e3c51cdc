"""An impact by our laws against one step of MuJoCo and of Drake on the same body in contact, per impact.

    python -m benchmarks.engines [-n STATES] [--rounds R] [--quick] [-o FILE.csv]

The chapter's ellipse touches a plane at n states (pose, velocity before impact).  What each includes:

- ours, batched: contact space, checks, impulse, velocity after and status of all states in one call; the contact point
  is given;
- ours, one call an impact: the same call with one row, what calling it from a loop in Python costs;
- MuJoCo: state set, `mj_step` of 1 ms called from Python: collision with the plane, contact force, integration; and
  `rollout`, which does the same for all states in C;
- Drake: state set, one discrete update of 1 ms of the diagram, called from Python: collision with the plane (FCL),
  contact force (SAP), next state.

The engines' contact is compliant: their step moves the impact on by 1 ms, it need not end there, and has no coefficient
of restitution.  The body has three degrees of freedom in all of them (two slides and a hinge in MuJoCo, a planar joint
in Drake) and is an ellipsoid over a plane or half-space.  CPU time on one core, timed in turn, medians over the rounds.
"""

import logging
from collections.abc import Callable

import numpy as np

from benchmarks.impacts import AXES, BODY, PARAMETERS, falling_ellipses
from benchmarks.results import Results, alternately, at_least, benchmark_parser, ratio
from thesis_lib.contact import LAWS

DEPTH = 1e-5  # m by which the body is in the plane, so that every engine sees the contact
STEP = 1e-3  # s
LAW_NAMES = ("anitescu_potra_newton", "mirtich")  # the engines' kind of law; the slowest of ours
BATCH = 10_000
INCLUDES = {
    "one call an impact": "the same law, a row a call",
    "mj_step from Python": "one step of 1 ms with collision and integration, called from Python",
    "rollout in C": "the same for all states in one call",
    "discrete update from Python": "one step of 1 ms with collision and integration, called from Python",
}


def states(rng: np.random.Generator, n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Poses q (n, 3) on the plane y = 0, velocities (n, 3) that approach it, contact points (n, 2)."""
    theta, v, r = falling_ellipses(rng, n)
    q = np.stack([np.zeros(n), -r[:, 1] - DEPTH, theta], axis=1)
    return q, v, r


def mujoco_model():
    """The ellipse over a plane, in MuJoCo's x-z plane, with its default solver."""
    import mujoco

    inertia = BODY["mass"] * BODY["k_g"] ** 2
    a, b = AXES
    return mujoco.MjModel.from_xml_string(f"""
        <mujoco>
          <option timestep="{STEP}"/>
          <worldbody>
            <geom type="plane" size="1 1 0.1" friction="{PARAMETERS["mu"]} 0 0"/>
            <body>
              <joint type="slide" axis="1 0 0"/>
              <joint type="slide" axis="0 0 1"/>
              <joint type="hinge" axis="0 -1 0"/>
              <inertial pos="0 0 0" mass="{BODY["mass"]}" diaginertia="{inertia} {inertia} {inertia}"/>
              <geom type="ellipsoid" size="{a} {a} {b}" friction="{PARAMETERS["mu"]} 0 0"/>
            </body>
          </worldbody>
        </mujoco>""")


def mujoco_calls(q: np.ndarray, v: np.ndarray) -> dict[str, Callable[[], object]]:
    """One step from every state, stepped from Python and by MuJoCo's own batch."""
    import mujoco
    from mujoco import rollout

    model = mujoco_model()
    data = mujoco.MjData(model)

    def one_by_one() -> None:
        for pose, velocity in zip(q, v):
            data.qpos[:] = pose
            data.qvel[:] = velocity
            mujoco.mj_step(model, data)
            if data.ncon != 1:
                raise RuntimeError("MuJoCo saw no contact in a state that touches")

    start = np.concatenate([np.zeros((len(q), 1)), q, v], axis=1)  # time, q, v

    def batch() -> None:
        rollout.rollout(model, data, start, nstep=1)

    return {"MuJoCo, mj_step from Python": one_by_one, "MuJoCo, rollout in C": batch}


def drake_call(q: np.ndarray, v: np.ndarray) -> Callable[[], object]:
    """One discrete update from every state."""
    from pydrake.geometry import AddContactMaterial, Ellipsoid, HalfSpace, ProximityProperties
    from pydrake.math import RigidTransform
    from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, ContactModel, CoulombFriction
    from pydrake.multibody.tree import PlanarJoint, SpatialInertia, UnitInertia
    from pydrake.systems.framework import DiagramBuilder

    # it warns that half-spaces do not deform; nothing here does
    logging.getLogger("drake").setLevel(logging.ERROR)
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, time_step=STEP)
    plant.SetUseSampledOutputPorts(False)  # else a step stores its contact forces too
    plant.set_contact_model(ContactModel.kPoint)
    inertia = SpatialInertia(BODY["mass"], np.zeros(3), UnitInertia(*[BODY["k_g"] ** 2] * 3))
    body = plant.AddRigidBody("ellipse", inertia)
    plant.AddJoint(PlanarJoint("plane", plant.world_frame(), body.body_frame(), damping=np.zeros(3)))
    plant.mutable_gravity_field().set_gravity_vector([0.0, -9.81, 0.0])
    properties = ProximityProperties()
    mu = PARAMETERS["mu"]
    AddContactMaterial(friction=CoulombFriction(mu, mu), point_stiffness=1e5, properties=properties)
    up = HalfSpace.MakePose([0.0, 1.0, 0.0], np.zeros(3))
    plant.RegisterCollisionGeometry(plant.world_body(), up, HalfSpace(), "ground", properties)
    solid = Ellipsoid(*AXES, max(AXES))
    plant.RegisterCollisionGeometry(body, RigidTransform(), solid, "ellipse", properties)
    plant.Finalize()
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    own = plant.GetMyMutableContextFromRoot(context)
    after = diagram.AllocateDiscreteVariables()
    both = np.concatenate([q, v], axis=1)

    def one_by_one() -> None:
        for state in both:
            plant.SetPositionsAndVelocities(own, state)
            diagram.CalcForcedDiscreteVariableUpdate(context, after)

    one_by_one()
    if not after.get_vector(0).value()[4] > both[-1, 4]:
        raise RuntimeError("Drake's step did not push the body up: the state was not in contact")
    return one_by_one


def measure(n: int, rounds: int, seconds: float, results: Results) -> None:
    """Add microseconds an impact of each way and its multiple of ours, batched."""
    q, v, r = states(np.random.default_rng(0), n)
    _, v_many, r_many = states(np.random.default_rng(1), BATCH)
    calls: dict[str, Callable[[], object]] = {}
    counts: dict[str, int] = {}
    for name in LAW_NAMES:
        law = LAWS[name]

        def batched(law=law) -> None:
            law(v_many, r_many, **BODY, **PARAMETERS)

        def singly(law=law) -> None:
            for i in range(n):
                law(v[i : i + 1], r[i : i + 1], **BODY, **PARAMETERS)

        calls |= {f"{name}, batched": batched, f"{name}, one call an impact": singly}
        counts |= {f"{name}, batched": BATCH}
    calls |= mujoco_calls(q, v)
    calls["Drake, discrete update from Python"] = drake_call(q, v)
    times = {name: one / counts.get(name, n) for name, one in alternately(calls, rounds, seconds).items()}
    ours = [f"{name}, batched" for name in LAW_NAMES]
    print(f"{'one impact':42s}{'µs':>10s}" + "".join(f"{'/ ' + name:>26s}" for name in LAW_NAMES))
    for name, one in times.items():
        results.add(name, float(np.median(one)) * 1e6, "µs an impact")
        ratios = [ratio(times, name, own) for own in ours]
        if name not in ours:
            results.add(f"{name} / {ours[-1]}", ratios[-1], "1", INCLUDES[name.split(", ")[-1]])
        print(f"{name:42s}{np.median(one) * 1e6:10.3f}" + "".join(f"{value:26.1f}" for value in ratios))


def main(arguments: list[str] | None = None) -> None:
    """Command line."""
    parser = benchmark_parser("engines", "One impact by our laws against one step of MuJoCo and of Drake.")
    parser.add_argument("-n", type=at_least(1), default=500, metavar="STATES", help="states for the engines (500)")
    parser.add_argument("--rounds", type=at_least(1), default=7)
    options = parser.parse_args(arguments)
    n, rounds, seconds = (20, 2, 0.0) if options.quick else (options.n, options.rounds, 0.1)
    results = Results("engines")
    measure(n, rounds, seconds, results)
    results.write(options.out)


if __name__ == "__main__":
    main()
