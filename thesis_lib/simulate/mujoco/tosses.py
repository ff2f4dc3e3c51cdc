"""Tosses of a body in space in MuJoCo: a free joint over a plane, with the engine's own contacts.

MuJoCo has no friction that depends on the speed of the slip, and its rolling friction shares one cone with the friction
force; neither is simulated here.  Coefficients that depend on the place, the face, the speed or the number of the hit
are set while nothing touches, at most `PIECE` before the touch.

MuJoCo's contact begins with the step after the touch; the restitution therefore depends on the instant of touch within
a step: with 40 steps per contact it scatters by 1.4 %, which no contact model can predict.  Time steps during a hit are
therefore smaller by the factor `FINER`.
"""

# MuJoCo's type stubs lack the contents of its compiled modules
# pyright: reportAttributeAccessIssue=false

from dataclasses import dataclass
from typing import Literal

import mujoco
import numpy as np

from thesis_lib.bodies.solids import Box, Capsule, Cylinder, Ellipsoid, Hull, Solid, Sphere
from thesis_lib.foundation.errors import UserError
from thesis_lib.mechanics.space import SPACE, rotation_matrix
from thesis_lib.mechanics.state import State
from thesis_lib.simulate.mujoco.contact import solref
from thesis_lib.simulate.mujoco.outside import HAND, in_body, material, pushes, table
from thesis_lib.simulate.rig.causes_in_space import air
from thesis_lib.simulate.tosses.causes import AIR, HIT, LATER, NOT_IN_MUJOCO, SUPPORTED
from thesis_lib.simulate.tosses.world import TossedWorld
from thesis_lib.statistics.wording import listed

BY_TOUCH = (
    *("velocity_dependent_restitution", "position_dependent_restitution", "orientation_dependent_restitution"),
    *("position_dependent_friction", "orientation_dependent_friction"),
    *("later_restitution", "later_friction", "sliding_friction", "two_materials"),
)
PIECE = 5e-4  # s, interval in which the forces of the air and the coefficients are held constant
MESH = "hull"
STEP = 1e-4  # s, largest time step
FINER = 8  # number of steps during a hit that replace one step elsewhere
OVER = 2.0  # contact times from the start of a hit after which it is over


@dataclass(frozen=True)
class MujocoTosses:
    """MuJoCo as the engine of tosses: its friction cone, impratio, the impedance of solimp at the touch and at depth,
    and time steps per contact time while a body rests or slides."""

    cone: Literal["elliptic", "pyramidal"] = "elliptic"
    impratio: float = 10.0
    impedance: tuple[float, float] = (0.9, 0.95)
    steps: int = 40

    def moves(self, world: TossedWorld, release: State, times: np.ndarray) -> State:
        if world.has(NOT_IN_MUJOCO):
            raise UserError(f"MuJoCo has no element for {listed(list(NOT_IN_MUJOCO), 'or')}; use our own simulator.")
        step = min(world.contact_time / self.steps, STEP)
        model = mujoco.MjModel.from_xml_string(self._xml(world, step))
        data, follow = mujoco.MjData(model), _Changes(world, model)
        poses, motions, hand = [], [], pushes(world, len(release))
        spin = SPACE.turned_back(release.attitude, release.spin)
        for i in range(len(release)):
            mujoco.mj_resetData(model, data)
            follow.begin(hand[:, i])
            data.qpos[:7], data.qvel[:3], data.qvel[3:6] = release.pose[:, i], release.velocity[:, i], spin[:, i]
            done = 0
            for t in times[i]:
                done = follow.until(data, done, int(t / step), step)
                poses.append(data.qpos[:7].copy())
                motions.append(data.qvel[:6].copy())
        ahead = times.ravel() - (times / step).astype(int).ravel() * step
        pose, motion = np.array(poses).T, np.array(motions).T
        motion[3:] = SPACE.turned(pose[3:], motion[3:])
        trial = np.repeat(np.arange(len(release)), times.shape[1])
        return State(SPACE.shift(pose, ahead * motion), motion, trial, times.ravel(), None, SPACE)

    def _xml(self, world: TossedWorld, step: float) -> str:
        """The model as XML; its joint is at the origin of the shape's frame."""
        rig, turning = world.rig, world.of("torsional_friction.m_t")
        shell = world.mass * (1.0 - world.of("loose_mass.share"))
        moments = world.mass * rig.body.inertia_per_mass[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
        stiffness, damping = solref(world.epsilon, world.contact_time, 1.0)
        friction = f'condim="{4 if turning else 3}" friction="{world.mu:.12g} {turning or 1e-3:.12g} 0.0001"'
        return f"""<mujoco>
  <compiler balanceinertia="false"/>
  <option timestep="{step:.12g}" gravity="{_text(rig.gravity)}" integrator="implicitfast" cone="{self.cone}"
    impratio="{self.impratio:.12g}"/>
  <default><geom {friction} solref="{stiffness:.12g} {damping:.12g}" solimp="{_text(self.impedance)} 0.001"/></default>
  {_meshes(rig.body.solid)}
  <worldbody>
    <body><freejoint/>
      <inertial pos="{_text(rig.body.centre)}" mass="{shell:.12g}" fullinertia="{_text(moments)}"/>
      {_geoms(rig.body.solid)}{in_body(world)}
    </body>
    {table(world)}
  </worldbody>
</mujoco>"""


def _text(values) -> str:
    return " ".join(f"{value:.12g}" for value in values)


def _geoms(solid: Solid) -> str:
    """The geoms of the shape; if its edges are rounded, only the balls with which it can touch a plane."""
    points = solid.minkowski
    if isinstance(solid, Box | Hull) and points.radius:
        return "\n".join(
            f'<geom type="sphere" size="{points.radius:.12g}" pos="{_text(one)}"/>' for one in points.centres.T
        )
    if isinstance(solid, Hull):
        return f'<geom type="mesh" mesh="{MESH}"/>'
    if isinstance(solid, Box):
        size = solid.half_extents
    elif isinstance(solid, Ellipsoid):
        size = solid.semi_axes
    elif isinstance(solid, Sphere):
        size = (solid.radius,)
    elif isinstance(solid, Capsule | Cylinder):
        size = (solid.radius, solid.half_length)
    else:
        raise UserError("Tosses in MuJoCo need a box, sphere, ellipsoid, cylinder, capsule or hull.")
    return f'<geom type="{solid.kind}" size="{_text(size)}"/>'


def _meshes(solid: Solid) -> str:
    """The vertices of a sharp hull; MuJoCo moves the frame of a mesh to its centre, and back where the mesh is used."""
    if not isinstance(solid, Hull) or solid.edge_radius:
        return ""
    return f'<asset><mesh name="{MESH}" vertex="{_text(solid.corners.T.ravel())}"/></asset>'


class _Changes:
    """Quantities that must be set while a body moves: forces of the air, and coefficients of the next touch."""

    def __init__(self, world: TossedWorld, model) -> None:
        self.world, self.model = world, model
        self.in_air, self.by_touch = world.has((*AIR, "hand")), world.has(BY_TOUCH)
        self.outline = world.rig.body.solid.minkowski
        restitution, friction = "{}_dependent_restitution.".format, "{}_dependent_friction.".format
        self.by_speed = world.of(restitution("velocity") + "c")
        self.by_place = tuple(
            world.vector(stem, "xy") for stem in (restitution("position") + "g_eps_", friction("position") + "g_mu_")
        )
        self.by_face = tuple(world.vector(of("orientation") + "a_") for of in (restitution, friction))
        self.later = world.of("later_restitution.d"), world.of("later_friction.d")
        self.sliding = world.of("sliding_friction.d_mu")
        self.reach = float(world.rig.body.solid.extent)
        self.epsilon = world.epsilon  # restitution that is currently set in the model
        self.begin(np.zeros(3))

    def begin(self, hand: np.ndarray) -> None:
        """Begin a new toss, in which a hand pushes the body with this force (3,) in N."""
        self.hand = hand
        self.first = self.hit = -1.0
        self.fine_until = 0.0

    def until(self, data, done: int, wanted: int, step: float) -> int:
        """Advance `data` from `done` steps to `wanted` steps; return the number of steps done."""
        piece = max(1, int(PIECE / step))
        while done < wanted:
            t, part = done * step, min(piece, wanted - done)
            if self.in_air or self.by_touch:
                self._set(data, t)
            if self._hits_within(data, part * step):
                self.fine_until = t + part * step + OVER * self.world.contact_time
            finer = FINER if t < self.fine_until else 1
            self.model.opt.timestep = step / finer
            for _ in range(1 if finer == 1 else part * finer):
                mujoco.mj_step(self.model, data, part if finer == 1 else 1)
                if data.ncon and self.first < 0.0:  # a short contact may be over before the next `_set`
                    self.first = t
            done += part
        return done

    def _hits_within(self, data, time: float) -> bool:
        """Return whether a point of the body hits the surface, or may hit it within `time` in s."""
        _, spin, r = self._points(data)
        falling = -(data.qvel[2] + spin[0] * r[1] - spin[1] * r[0])
        gap = data.qpos[2] + r[2] - self.world.height
        bends = np.linalg.norm(self.world.rig.gravity) + spin @ spin * self.reach
        reached = gap < (np.maximum(falling, 0.0) + 0.5 * bends * time) * time
        return bool((reached & (falling + bends * time > HIT)).any())

    def _points(self, data) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """R (3, 3), ω (3,) in rad/s, and the points (3, p), in m from the body's origin, that may touch."""
        R = rotation_matrix(data.qpos[3:, None])[..., 0]
        points = self.outline.support(-R[2][:, None], np.arange(self.outline.centres.shape[1]))
        return R, R @ data.qvel[3:6], R @ points

    def _set(self, data, t: float) -> None:
        R, spin, r = self._points(data)
        if self.in_air:
            v = data.qvel[:3] + np.cross(spin, R @ self.world.rig.body.centre)
            pushed, slowed = air(self.world.hidden, v[:, None], spin[:, None])
            couple = R @ self.world.rig.body.inertia_per_mass @ R.T @ slowed[:, 0]
            data.xfrc_applied[1] = self.world.mass * np.concatenate([pushed[:, 0], couple])
            if HAND[0] <= t < HAND[1]:
                data.xfrc_applied[1, :3] += self.hand
        if self.by_touch:
            r = r[:, r[2].argmin()]
            speed = -(data.qvel[2] + spin[0] * r[1] - spin[1] * r[0])
            if data.ncon:
                self.hit = t if speed > HIT else self.hit
            else:
                self._set_coefficients(data.qpos[:2] + r[:2], max(speed, 0.0), -R[2], t)
            if self.sliding and t - self.hit > SUPPORTED and speed < HIT:
                self.model.geom_friction[:, 0] = max(self.world.mu + self.sliding, 0.0)

    def _set_coefficients(self, place: np.ndarray, speed: float, face: np.ndarray, t: float) -> None:
        later = float(self.first >= 0.0 and t - self.first > LATER)
        epsilon, mu = (
            of * share * (1.0 + by_place @ place) * (1.0 + by_face @ face) * (1.0 + later * more)
            for of, share, by_place, by_face, more in zip(
                (self.world.epsilon, self.world.mu),
                material(self.world, place),
                self.by_place,
                self.by_face,
                self.later,
            )
        )
        epsilon *= np.exp(-self.by_speed * speed)
        self.model.geom_friction[:, 0] = max(mu, 0.0)
        if epsilon != self.epsilon:
            self.epsilon = epsilon
            self.model.geom_solref[:] = solref(float(np.clip(epsilon, 0.02, 0.98)), self.world.contact_time, 1.0)
