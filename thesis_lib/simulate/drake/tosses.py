"""Tosses of a body in space in Drake: a free body over a half-space, compliant point contact, in continuous time.

The contact is Drake's: at each point of the body that can touch a plane (`Solid.minkowski`) a spring with Hunt and
Crossley's dissipation, by which restitution falls with the speed, and Coulomb friction, regularised below a slip of
`STICTION`.  The end of a cylinder is a flat ellipsoid (`FLAT`).  Drake's plant has no properties that depend on the
place, face, number or slip of a hit, and no couples at the contact; such causes are not simulated here.
"""

# Drake's type stubs accept only ndarray[float64], although lists and other arrays work, and lack the types of ports
# pyright: reportArgumentType=false, reportCallIssue=false, reportAttributeAccessIssue=false, reportReturnType=false

import numpy as np
from pydrake.geometry import Ellipsoid, HalfSpace, Sphere
from pydrake.math import RigidTransform
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, ContactModel, MultibodyPlant
from pydrake.multibody.tree import SpatialInertia, UnitInertia
from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator
from pydrake.systems.framework import BasicVector, DiagramBuilder, LeafSystem

from thesis_lib.foundation.errors import UserError
from thesis_lib.mechanics.frame import on_body
from thesis_lib.mechanics.space import SPACE
from thesis_lib.mechanics.state import State
from thesis_lib.simulate.compliant.forces import SHARP
from thesis_lib.simulate.drake.clock import quiet
from thesis_lib.simulate.drake.hunt_crossley import spring
from thesis_lib.simulate.drake.plant import point_contact
from thesis_lib.simulate.rig.causes_in_space import air
from thesis_lib.simulate.tosses.causes import AIR, NOT_IN_DRAKE
from thesis_lib.simulate.tosses.world import STRAIGHT, TossedWorld
from thesis_lib.statistics.wording import listed

FLAT = 1e-3  # half the thickness of the end of a cylinder, over its radius
LONGEST = 2e-3  # s, longest time step; a longer one could skip a contact
STICTION = 1e-3  # m/s, slip below which friction is reduced
ACCURACY = 1e-5  # relative, of the integration


class DrakeTosses:
    """Drake as the engine of tosses."""

    def moves(self, world: TossedWorld, release: State, times: np.ndarray) -> State:
        if world.has(NOT_IN_DRAKE):
            raise UserError(f"Drake has no element for {listed(list(NOT_IN_DRAKE), 'or')}; use our own simulator.")
        plant, simulator = self._plant(world)
        root = simulator.get_mutable_context()
        context = plant.GetMyMutableContextFromRoot(root)
        to_centre = world.rig.body.centre
        centre = on_body(release, to_centre, STRAIGHT)
        poses, motions = np.empty((7, *times.shape)), np.empty((6, *times.shape))
        for i in range(len(release)):
            root.SetTime(0.0)  # in Drake, attitude comes before position and spin before velocity
            plant.SetPositions(context, np.roll(centre.pose[:, i], 4))
            plant.SetVelocities(context, np.roll(centre.motion[:, i], 3))
            simulator.Initialize()
            for k, t in enumerate(times[i]):
                simulator.AdvanceTo(t)
                poses[:, i, k] = np.roll(plant.GetPositions(context), 3)
                motions[:, i, k] = np.roll(plant.GetVelocities(context), 3)
        trial = np.repeat(np.arange(len(release)), times.shape[1])
        moved = State(poses.reshape(7, -1), motions.reshape(6, -1), trial, times.ravel(), None, SPACE)
        return on_body(moved, -to_centre, STRAIGHT)

    def _plant(self, world: TossedWorld) -> tuple[MultibodyPlant, Simulator]:
        rig, builder = world.rig, DiagramBuilder()
        plant, _ = AddMultibodyPlantSceneGraph(builder, 0.0)
        plant.set_contact_model(ContactModel.kPoint)
        plant.mutable_gravity_field().set_gravity_vector(np.array(rig.gravity))
        moments = UnitInertia(*rig.body.inertia_per_mass[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]])
        body = plant.AddRigidBody("body", SpatialInertia(world.mass, np.zeros(3), moments))
        touch = spring(world.epsilon, world.contact_time, world.mass)
        # used for both geometries: Drake puts their springs in series and keeps equal d and μ
        made_of = point_contact(2.0 * touch.stiffness, touch.dissipation, world.mu)
        place = RigidTransform([0.0, 0.0, world.height])
        plant.RegisterCollisionGeometry(plant.world_body(), place, HalfSpace(), "table", made_of)
        points = rig.body.solid.minkowski
        shape = Sphere(points.radius or SHARP)
        if points.squares.any():
            axes = np.sqrt(points.squares) + points.radius
            shape = Ellipsoid(*np.maximum(axes, FLAT * axes.max()))
        for i, point in enumerate((points.centres - rig.body.centre[:, None]).T):
            plant.RegisterCollisionGeometry(body, RigidTransform(point), shape, f"p{i}", made_of)
        plant.Finalize()
        plant.set_stiction_tolerance(STICTION)
        if world.has(AIR):
            pushing = builder.AddSystem(_Air(world))
            builder.Connect(plant.get_state_output_port(), pushing.get_input_port())
            builder.Connect(pushing.get_output_port(), plant.get_applied_generalized_force_input_port())
        with quiet():
            simulator = Simulator(builder.Build())
        integrator = ResetIntegratorFromFlags(simulator, "runge_kutta3", LONGEST)
        integrator.set_target_accuracy(ACCURACY)
        return plant, simulator


class _Air(LeafSystem):
    """Couple and force of the air on a free body, whose state is quaternion, position, spin and velocity."""

    def __init__(self, world: TossedWorld) -> None:
        super().__init__()
        self.hidden, self.mass = world.hidden, world.mass
        self.inertia = world.mass * world.rig.body.inertia_per_mass
        self.DeclareVectorInputPort("state", 13)
        self.DeclareVectorOutputPort("force", 6, self._push)

    def _push(self, context, output: BasicVector) -> None:
        state = np.ravel(self.get_input_port().Eval(context))
        attitude, spin, velocity = state[:4, None], state[7:10, None], state[10:, None]
        pushed, slowed = air(self.hidden, velocity, spin)
        couple = SPACE.turned(attitude, self.inertia @ SPACE.turned_back(attitude, slowed))
        output.SetFromVector(np.concatenate([couple[:, 0], self.mass * pushed[:, 0]]))
