"""A body in space that is tossed on a level surface, and how a camera records it.

Between hits the motion is that of `mechanics.free_motion`; a hit is one impulse at the lowest point, by an impact law
that lives in space.  A toss ends after `HITS` hits, or when the body has no speed left: what follows is rest.
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from thesis_lib.bodies.solids import Solid
from thesis_lib.contact import LAWS
from thesis_lib.datasets.format.frames import surface_frames, tracked_of_body
from thesis_lib.datasets.format.header import SpaceHeader
from thesis_lib.datasets.format.table_forms import POSE_IN_SPACE, V_POST_IN_SPACE, V_PRE_IN_SPACE
from thesis_lib.mechanics.contact import contact_at, velocity_change
from thesis_lib.mechanics.frame import Frame
from thesis_lib.mechanics.free_motion import flown
from thesis_lib.mechanics.inertia import mobility
from thesis_lib.mechanics.space import SPACE, of_rotation_vector
from thesis_lib.mechanics.state import State

HITS = 4
LOOK = 1e-3  # s between the poses in which a touch is looked for
FINER, TIMES = 65, 3  # poses between two of them, and how often: a touch is known to 4 ns
LONGEST = 1.2  # s
SLOWEST = 0.3  # m/s of the contact point towards the surface, below which a toss ends
AFTER = 0.1  # s that are recorded after the last hit


@dataclass(frozen=True)
class Tosses:
    """What the camera saw, and the hits as they were: trial, t, pose of the body and motions, as in impacts.csv."""

    trajectories: pd.DataFrame
    hits: pd.DataFrame


def simulate_tosses(
    header: SpaceHeader | dict,
    trials: int,
    rng: np.random.Generator,
    law: str = "anitescu_potra_newton",
    mu: float = 0.25,
    epsilon: float = 0.5,
    rate: float = 240.0,
    spin: float = 8.0,
    noise: tuple[float, float] = (2e-4, 3e-3),
) -> Tosses:
    """Tosses of the body of `header`, or of what dataset.yaml says, on its surface.

    Args:
        law, mu, epsilon: of the hits; `law` is a key of `LAWS` that lives in space.
        rate: Hz.
        spin: rad/s, one sigma of each component at the release.
        noise: one sigma of each coordinate in m, and of each component of a small turn in rad.

    Raises:
        UserError: the header does not say where the tracked frame is.
    """
    header = SpaceHeader.model_validate(header)
    (frame,) = surface_frames(header)
    down = frame.vectors_in(np.array(header.gravity)[:, None])
    solid, G = header.body.solid.about(header.body.centre), header.body.inertia_per_mass
    samples, hits = [], []
    for trial in range(trials):
        height = solid.extent + rng.uniform(0.1, 0.3)
        place = np.array([*rng.uniform(-0.1, 0.1, 2), height])
        velocity = np.array([*rng.uniform(-0.7, 0.7, 2), rng.uniform(-1.0, 0.5)])
        pose = np.concatenate([place[:, None], of_rotation_vector(2.0 * rng.standard_normal((3, 1)))])
        motion = np.concatenate([velocity, spin * rng.standard_normal(3)])[:, None]
        start, made = 0.0, []
        while len(made) < HITS:
            touch = _touch(solid, pose, motion, G, down, LONGEST - start)
            end = LONGEST if touch is None else start + touch
            t = np.arange(np.ceil(start * rate), np.ceil(min(end, start + LONGEST) * rate)) / rate
            samples.append((trial, t, flown(pose, motion, G, down, t - start).pose[:, :, 0]))
            if touch is None:
                break
            path = flown(pose, motion, G, down, np.array([touch]))
            pose, before = path.pose[:, 0], path.motion[:, 0]
            motion = _after(solid, pose, before, G, law, mu, epsilon)
            if motion is None:
                break
            made.append((trial, end, pose[:, 0], before[:, 0], motion[:, 0]))
            start = end
        if len(made) == HITS and motion is not None:
            t = np.arange(np.ceil(start * rate), np.ceil((start + AFTER) * rate)) / rate
            ends = _touch(solid, pose, motion, G, down, AFTER)
            t = t if ends is None else t[t < start + ends]
            samples.append((trial, t, flown(pose, motion, G, down, t - start).pose[:, :, 0]))
        hits += made
    return Tosses(recorded(samples, header, frame, rng, noise), _table(hits, frame))


def stated_hits(head: dict, trials: int, seed: int = 0) -> pd.DataFrame:
    """Hits of tosses as impacts.csv has them: of the tracked frame, in axes of the recording, without noise."""
    header = SpaceHeader.model_validate(head)
    made = simulate_tosses(header, trials, np.random.default_rng(seed)).hits
    table = {"trial": made["trial"], "impact": made.groupby("trial").cumcount(), "t": made["t"]}
    for names in (V_PRE_IN_SPACE, V_POST_IN_SPACE):
        motion, pose = made[list(names)].to_numpy(), made[list(POSE_IN_SPACE)].to_numpy()
        states = tracked_of_body(State.of(pose, motion, made["trial"], made["t"], space=SPACE), header)
        table |= dict(zip(POSE_IN_SPACE, states.pose)) | dict(zip(names, states.motion))
    return pd.DataFrame(table)


def _touch(
    solid: Solid, pose: np.ndarray, motion: np.ndarray, G: np.ndarray, a: np.ndarray, longest: float
) -> float | None:
    """Time in s until the body touches the surface on its way down, None if it does not within `longest`."""

    def gap(tau: np.ndarray) -> np.ndarray:
        path = flown(pose, motion, G, a, tau).pose[:, :, 0]
        return path[2] + solid.lowest(path[3:])[2]

    tau = np.arange(0.0, longest, LOOK)
    heights = gap(tau)
    below = np.flatnonzero((heights[1:] < 0.0) & (np.diff(heights) < 0.0))
    if not len(below):
        return None
    low, high = tau[below[0]], tau[below[0] + 1]
    for _ in range(TIMES):
        finer = np.linspace(low, high, FINER)
        first = int((gap(finer) < 0.0).argmax())
        if not first:  # another corner went below before
            return float(low)
        low, high = finer[first - 1], finer[first]
    return float(low)


def _after(
    solid: Solid, pose: np.ndarray, motion: np.ndarray, G: np.ndarray, law: str, mu: float, epsilon: float
) -> np.ndarray | None:
    """Motion (6, 1) after the hit; None if the contact point hardly approaches."""
    r = solid.lowest(pose[3:])
    contact = contact_at(SPACE, motion[:3], motion[3:], r, mobility(SPACE, G, pose[3:]))
    if contact.v_n[0] > -SLOWEST:
        return None
    impulse = LAWS[law].impulse(contact, np.array([mu]), np.array([epsilon]))
    return motion + velocity_change(impulse, r, contact.mobility)


def recorded(
    samples: list, header: SpaceHeader, frame: Frame, rng: np.random.Generator, noise: tuple[float, float]
) -> pd.DataFrame:
    """What the camera saw of parts of a motion: (trial, t, pose of the body on the surface) each."""
    trial = np.concatenate([np.full(len(t), trial) for trial, t, _ in samples])
    t, pose = np.concatenate([t for _, t, _ in samples]), np.concatenate([pose for *_, pose in samples], axis=1)
    true = State(pose, np.zeros((6, len(t))), trial, t, None, SPACE)
    seen = tracked_of_body(frame.shown(true), header)
    attitude = SPACE.attitude_after(seen.attitude, noise[1] * rng.standard_normal((3, len(t))))
    place = seen.position + noise[0] * rng.standard_normal((3, len(t)))
    return pd.DataFrame({"trial": trial, "t": t} | dict(zip(POSE_IN_SPACE, np.concatenate([place, attitude]))))


def _table(hits: list, frame: Frame) -> pd.DataFrame:
    """The hits, in axes of the world: pose and velocity of the centre of mass, attitude of the body."""
    trial, t, pose, before, after = (np.array(part) for part in zip(*hits))
    columns = {"trial": trial, "t": t}
    for motion, names in ((before, V_PRE_IN_SPACE), (after, V_POST_IN_SPACE)):
        state = frame.shown(State(pose.T, motion.T, trial, t, None, SPACE))
        columns |= dict(zip(POSE_IN_SPACE, state.pose)) | dict(zip(names, state.motion))
    return pd.DataFrame(columns)
