"""Our own engine of tosses: a spring and a damper at every contact point (`compiled`)."""

from dataclasses import dataclass

import numpy as np

from thesis_lib.mechanics.frame import on_body
from thesis_lib.mechanics.space import SPACE
from thesis_lib.mechanics.state import State
from thesis_lib.simulate.tosses.causes import HIT, LATER, SUPPORTED
from thesis_lib.simulate.tosses.compiled import OnBalls, _damping, toss
from thesis_lib.simulate.tosses.world import STRAIGHT, TossedWorld


@dataclass(frozen=True)
class OwnTosses:
    """Our own integrator as the engine of tosses, with `steps` time steps per duration of a central contact."""

    steps: int = 400

    def moves(self, world: TossedWorld, release: State, times: np.ndarray) -> State:
        own, n = self._world(world), len(release)
        to_centre = world.rig.body.centre
        centre = on_body(release, to_centre, STRAIGHT)
        poses = np.empty((*times.shape, 7))
        for i in range(n):
            place, attitude, velocity, spin = (
                part[:, i].copy() for part in (centre.position, centre.attitude, centre.velocity, centre.spin)
            )
            toss(own, place, attitude, velocity, spin, times[i], poses[i])
        trial = np.repeat(np.arange(n), times.shape[1])
        moved = State.of(poses.reshape(-1, 7), np.full((len(trial), 6), np.nan), trial, times.ravel(), space=SPACE)
        return on_body(moved, -to_centre, STRAIGHT)

    def _world(self, world: TossedWorld) -> OnBalls:
        balls, radius = world.balls
        ratio = _damping(world.epsilon)
        # duration ω T of a central contact without pull
        phase = 2.0 * np.arccos(ratio) / np.sqrt(1.0 - ratio**2) if ratio < 1.0 else 2.0
        tensor = world.mass * world.rig.body.inertia_per_mass
        return OnBalls(
            balls=np.ascontiguousarray(balls - world.rig.body.centre),
            radius=radius,
            mass=world.mass,
            tensor=np.ascontiguousarray(tensor),
            inverse=np.ascontiguousarray(np.linalg.inv(tensor)),
            easiest=1.0 / float(np.linalg.eigvalsh(tensor)[0]),
            gravity=np.array(world.rig.gravity),
            height=world.height,
            mu=world.mu,
            epsilon=world.epsilon,
            stiffness=world.mass * (phase / world.contact_time) ** 2,
            dt=world.contact_time / self.steps,
            drag=(world.of("linear_drag.c_v"), world.of("quadratic_drag.c_q")),
            magnus=world.of("magnus.k_m"),
            spin_damping=world.of("linear_drag.c_w") + world.of("spin_damping.c_w"),
            lever=world.of("contact_torque.m_r"),
            spinning=world.of("torsional_friction.m_t"),
            restitution_by_speed=world.of("velocity_dependent_restitution.c"),
            friction_by_speed=(world.of("velocity_dependent_friction.s"), world.of("velocity_dependent_friction.v_s")),
            restitution_by_place=world.vector("position_dependent_restitution.g_eps_", "xy"),
            friction_by_place=world.vector("position_dependent_friction.g_mu_", "xy"),
            restitution_by_face=world.vector("orientation_dependent_restitution.a_"),
            friction_by_face=world.vector("orientation_dependent_friction.a_"),
            later=(world.of("later_restitution.d"), world.of("later_friction.d")),
            sliding=world.of("sliding_friction.d_mu"),
            bowl=(world.of("curved_surface.kappa"), *world.vector("curved_surface.", ("x_0", "y_0"))),
            ellipse=(world.of("anisotropic_friction.a_c"), world.of("anisotropic_friction.a_s")),
            moving=(world.of("moving_surface.V_x"), world.of("moving_surface.V_y")),
            time_by_place=world.vector("position_dependent_contact_time.g_tau_", "xy"),
            time_by_face=world.vector("orientation_dependent_contact_time.a_"),
            times=(LATER, SUPPORTED, HIT),
        )
