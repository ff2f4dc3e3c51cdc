"""Tosses as recorded by a camera: its own axes, a tracked frame anywhere on the body, noise, filters, lost frames."""

import numpy as np
import pandas as pd
from pydantic import Field

from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.frames import surface_frames
from thesis_lib.datasets.format.header import SpaceHeader
from thesis_lib.datasets.format.table_forms import POSE_IN_SPACE
from thesis_lib.foundation.settings import Section
from thesis_lib.mechanics.frame import on_body
from thesis_lib.mechanics.space import SPACE, multiplied, of_rotation_vector
from thesis_lib.mechanics.state import State
from thesis_lib.simulate.rig.causes_in_space import filmed
from thesis_lib.simulate.rig.smoothing import smoothed
from thesis_lib.simulate.rig.tracker import FilterName, lost_poses
from thesis_lib.simulate.tosses.world import TossedWorld, TossEngine, released

LAG = "time_lag.lag"  # applied here by simulating the orientation at earlier times
FLIP = (0.0, 0.7, 0.0)  # rad, rotation vector between the two ambiguous poses of a tag, in its axes
START = 0.02  # s after the release, start of the recording; longer than any lag


class CameraInSpace(Section):
    """Settings of the recording of tosses; rate and noise are in the header."""

    seconds: float = Field(1.0, gt=0, le=10, description="s per toss")
    irregular: float = Field(
        0.0, ge=0, lt=0.5, description="largest deviation of a frame's time from regular, as a share of 1/rate"
    )
    stamps: float = Field(0.0, ge=0, le=1e-3, description="s, one sigma of the errors of time stamps")
    dropped: float = Field(0.0, ge=0, lt=1, description="share of frames that are not written")
    bursts: float = Field(0.0, ge=0, le=1, description="share of tosses in which a run of `burst_length` is lost")
    burst_length: int = Field(6, ge=1, description="number of frames in such a run")
    flips: float = Field(0.0, ge=0, lt=1, description="share of frames in which a tag is read in its other pose")
    filter: FilterName = Field("none", description="filter that smooths the poses before they are written")
    cutoff: float = Field(40.0, gt=0, description="Hz, at which the filter's gain is 1/√2")


def film(
    name: str, world: TossedWorld, engine: TossEngine, camera: CameraInSpace, tosses: int, rng: np.random.Generator
) -> Dataset:
    """Simulate and record `tosses` releases; the dataset has the header as its owner believes it."""
    header, rate = world.header, world.header.rate or 240.0
    release_rng, frame_rng, noise_rng, lost_rng = rng.spawn(4)
    release = released(world, tosses, release_rng)
    frames = round((camera.seconds - START) * rate)
    off = camera.irregular * frame_rng.uniform(-1.0, 1.0, (tosses, frames))
    taken = START + (np.arange(frames) + off) / rate
    states = _seen(world, engine, release, taken)
    stamped = np.maximum.accumulate(taken + camera.stamps * frame_rng.standard_normal(taken.shape), axis=1)
    poses = _with_noise(states, header, noise_rng).reshape(7, tosses, frames)
    if camera.flips:
        other = multiplied(poses[3:], of_rotation_vector(np.array(FLIP))[:, None, None])
        poses[3:] = np.where(lost_rng.random(taken.shape) < camera.flips, other, poses[3:])
    if camera.filter != "none":
        poses = _filtered(poses, camera, rate)
    lost = lost_poses(taken.shape, camera.dropped, camera.bursts, camera.burst_length, lost_rng)
    poses[3:] *= np.where(poses[3:4] < 0.0, -1.0, 1.0)
    trial = np.broadcast_to(np.arange(tosses)[:, None], taken.shape)
    columns = {"trial": trial[~lost], "t": stamped[~lost]} | {k: part[~lost] for k, part in zip(POSE_IN_SPACE, poses)}
    return Dataset(name, header, pd.DataFrame(columns))


def _seen(world: TossedWorld, engine: TossEngine, release: State, taken: np.ndarray) -> State:
    """Tracked poses in the axes of the recording at times (n, k), without noise, one toss after the other."""
    rig, (frame,) = world.rig, surface_frames(world.header)
    assert rig.tracked is not None
    lag, hidden = world.of(LAG), {name: size for name, size in world.hidden.items() if name != LAG}
    states = engine.moves(world, release, taken)
    seen = on_body(states, np.array(rig.tracked.position), rig.tracked.attitude)
    if lag:
        older = engine.moves(world, release, taken - lag)
        seen = seen.changed(attitude=on_body(older, np.zeros(3), rig.tracked.attitude).attitude)
    return filmed(frame.shown(seen), world.header, hidden)


def _with_noise(states: State, header: SpaceHeader, rng: np.random.Generator) -> np.ndarray:
    """Poses (7, n) with the noise stated in the header."""
    noise, size = header.noise, len(states)
    position, rotation = (noise.position or (0.0,) * 3, noise.rotation or 0.0) if noise else ((0.0,) * 3, 0.0)
    place = states.position + np.array(position)[:, None] * rng.standard_normal((3, size))
    return np.concatenate([place, SPACE.attitude_after(states.attitude, rotation * rng.standard_normal((3, size)))])


def _filtered(poses: np.ndarray, camera: CameraInSpace, rate: float) -> np.ndarray:
    """Smoothed poses (7, n, k); quaternions are smoothed by component, after sign changes have been removed."""
    q = poses[3:]
    signs = np.sign((q[..., 1:] * q[..., :-1]).sum(axis=0))
    q = q * np.concatenate([np.ones((q.shape[1], 1)), np.cumprod(signs, axis=1)], axis=1)
    rows = np.moveaxis(np.concatenate([poses[:3], q]), 0, -1)
    made = np.moveaxis(smoothed(rows, camera.filter, camera.cutoff, rate), -1, 0)
    return np.concatenate([made[:3], made[3:] / np.linalg.norm(made[3:], axis=0)])
