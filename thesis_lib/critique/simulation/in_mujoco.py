"""Whole tosses in a user's MJCF file: a body over the plane of the file is tossed from measured initial states.

The body must have the frame of the shape; the plane is the surface of the model.  Axes along the surface follow from
`Frame.of_surface`, with the x axis of the file instead of the recording.  A hit is a frame in which the velocity of the
centre of mass changes by more than `REST`, apart from gravity.
"""

# MuJoCo's type stubs lack the names that its compiled modules define
# pyright: reportAttributeAccessIssue=false

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np

from thesis_lib.critique.contacts.kinds import ByImpulse
from thesis_lib.critique.results.saved_in_space import SavedSpaceModel
from thesis_lib.critique.simulation.law_drops import REST
from thesis_lib.critique.simulation.tosses import Tosses
from thesis_lib.engines.parameters import MujocoNumbers, of_mujoco
from thesis_lib.foundation.errors import UserError, first_line
from thesis_lib.mechanics.frame import Frame, on_body
from thesis_lib.mechanics.space import SPACE
from thesis_lib.mechanics.state import State
from thesis_lib.simulate.mujoco.contact import COARSEST

STRAIGHT = np.array([1.0, 0.0, 0.0, 0.0])


class TossesInFile:
    """A body in an MJCF file, which represents the body of a model."""

    def __init__(self, path: str | Path, body: str | None, model: SavedSpaceModel) -> None:
        """`body`: its name; None: the only body with a free joint.

        UserError if MuJoCo cannot read the file, if no such body is free, or if there is not exactly one plane.
        """
        try:
            self.engine = mujoco.MjModel.from_xml_path(str(path))
        except ValueError as error:
            raise UserError(f"{path}: MuJoCo cannot read it ({first_line(error)}).") from error
        free = self.engine.jnt_bodyid[self.engine.jnt_type == mujoco.mjtJoint.mjJNT_FREE]
        named = {self.engine.body(i).name: i for i in free}
        known = f"its free bodies: {', '.join(filter(None, named)) or 'none with a name'}"
        if body is None and len(free) != 1:
            raise UserError(f"{path} has {len(free)} bodies with a free joint; name the one to toss (--body); {known}.")
        if body is not None and body not in named:
            raise UserError(f"{path}: there is no body {body!r} with a free joint; {known}.")
        number = free[0] if body is None else named[body]
        joint = self.engine.body_jntadr[number]
        planes = np.flatnonzero(self.engine.geom_type == mujoco.mjtGeom.mjGEOM_PLANE)
        if len(planes) != 1:
            raise UserError(f"{path} has {len(planes)} planes; it needs exactly one, the table.")
        self.path, self.model, self.inside = path, model, self.engine.body_ipos[number].copy()
        at, of = self.engine.jnt_qposadr[joint], self.engine.jnt_dofadr[joint]
        self.pose, self.motion = slice(at, at + 7), slice(of, of + 6)
        data = mujoco.MjData(self.engine)
        mujoco.mj_forward(self.engine, data)
        table = Frame.of_surface(data.geom_xpos[planes[0]].copy(), data.geom_xmat[planes[0]].reshape(3, 3)[:, 2])
        believed = np.array([[0.0], [0.0], [model.values.get("surface_height.h", 0.0)]])
        self.surface = replace(table, origin=table.origin - table.vectors_out(believed)[:, 0])
        touching = (self.engine.geom_contype != 0) | (self.engine.geom_conaffinity != 0)
        geoms = np.flatnonzero(touching & (self.engine.body_rootid[self.engine.geom_bodyid] == number))
        self.contact_time = min((self._contact_time(int(geom), int(planes[0])) for geom in geoms), default=np.inf)

    @property
    def coarse(self) -> str:
        """Warning of a timestep that is too coarse for the contact; "" if it is fine enough."""
        step, finest = self.engine.opt.timestep, self.contact_time / COARSEST
        if round(self.contact_time / step) >= COARSEST:
            return ""
        said = f"timestep {step:.3g} s is coarse for its contact, which lasts {self.contact_time:.2g} s"
        return f"{self.path}: {said}: hits may gain energy. It needs {finest:.2g} s or less."

    def toss(self, dynamics: ByImpulse, start: State, times: np.ndarray) -> Tosses:
        """Simulate tosses as `tosses.toss` does; UserError if the simulation becomes unstable."""
        centre, step = self.model.rig.body.centre, self.engine.opt.timestep
        begun = self.surface.shown(on_body(start, -centre, STRAIGHT))
        data, (k, n) = mujoco.MjData(self.engine), times.shape
        pose, motion, hits = np.empty((7, k, n)), np.empty((6, k, n)), np.zeros((k, n), int)
        for i in range(n):
            mujoco.mj_resetData(self.engine, data)
            spin = SPACE.turned_back(begun.attitude[:, i : i + 1], begun.spin[:, i : i + 1])[:, 0]
            data.qpos[self.pose], data.qvel[self.motion] = begun.pose[:, i], [*begun.velocity[:, i], *spin]
            done, before = 0, self._momentum(data)
            for j, t in enumerate(times[:, i]):
                steps = max(int(t / step) - done, 0)
                if steps:
                    mujoco.mj_step(self.engine, data, steps)
                now, done = self._momentum(data), done + steps
                hits[j, i] = np.linalg.norm(now - before - steps * step * self.engine.opt.gravity) > REST
                before, pose[:, j, i], motion[:, j, i] = now, data.qpos[self.pose], data.qvel[self.motion]
            if any(warning.number for warning in data.warning):
                raise UserError(f"{self.path}: the simulation becomes unstable; use a smaller timestep.")
        pose, motion = pose.reshape(7, -1), motion.reshape(6, -1)
        motion[3:] = SPACE.turned(pose[3:], motion[3:])
        pose = SPACE.shift(pose, (times.ravel() - (times.ravel() / step).astype(int) * step) * motion)
        moved = State(pose, motion, np.tile(start.trial, k), np.tile(start.t, k) + times.ravel(), None, SPACE)
        true = on_body(self.surface.seen(moved), centre, STRAIGHT)
        return Tosses(true, hits.cumsum(axis=0), np.zeros(n, bool))

    def _contact_time(self, geom: int, plane: int) -> float:
        """Return T in s of a central contact of a geom with the plane, in one point."""
        both = [geom, plane]
        first, second = self.engine.geom_priority[both]
        if first != second:
            both = [geom if first > second else plane]
        weight = self.engine.geom_solmix[both] / self.engine.geom_solmix[both].sum()
        solref, solimp = self.engine.geom_solref[both], weight @ self.engine.geom_solimp[both]
        mixed = weight @ solref if (solref > 0.0).all() else solref.min(axis=0)
        return of_mujoco(MujocoNumbers(tuple(mixed), tuple(solimp), 1.0, 1.0))[2]

    def _momentum(self, data: mujoco.MjData) -> np.ndarray:
        """Return the velocity (3,) in m/s of the centre of mass."""
        velocity, spin = np.split(data.qvel[self.motion], 2)
        return velocity + SPACE.turned(data.qpos[self.pose][3:, None], np.cross(spin, self.inside)[:, None])[:, 0]
