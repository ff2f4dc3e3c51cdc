"""The simulated motions in the figures of chapter 2, chosen by stated criteria.

| scene          | figure | motion, and the criterion by which it is chosen                                           |
|----------------|--------|-------------------------------------------------------------------------------------------|
| `falling_rod`  | 2-2    | start from a grid for which the left end sticks, then the right end slides, for longest   |
| `landing_disk` | 2-4    | a disk thrown flat, from flight to rolling, with its noisy states and a window of m steps |
| `tipping_block`| 2-5    | a block that rocks over its corner, always in contact, with its noisy states              |
| `traces`       | 2-9    | the farthest of a few random drops, to keep its outlines apart                            |
| `reaching_arm` | 2-1    | the arm's lowest start, with the disk moved until it touches both arm and ground          |

Sources: thesis figures 2-1 to 2-9; the falling rod is taken from D. E. Stewart, J. C. Trinkle, Int. J. Numer. Methods
Eng. 39 (1996), doi 10.1002/(SICI)1097-0207(19960815)39:15<2673::AID-NME972>3.0.CO;2-I.
"""

from dataclasses import dataclass
from enum import IntEnum
from itertools import product

import numpy as np
from pydantic import Field

from thesis_lib.bodies.shapes import Polygon
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.settings import Section
from thesis_lib.simulate.mechanisms.motions import (
    DEFAULT,
    Chapter2Bodies,
    Kind,
    arm_disk,
    block,
    disk,
    ellipse,
    releases,
    rod,
    wheel,
)
from thesis_lib.simulate.mechanisms.noise_snr import NoisyStates, add_noise
from thesis_lib.simulate.stepping.arm_disk import ArmDisk
from thesis_lib.simulate.stepping.multibody import Mechanism, PlanarFreeBody
from thesis_lib.simulate.stepping.stepping import SimulatedMotion, simulate

SLIPS = 1e-6  # m/s; slip of a sliding contact; sticking contacts of a record only move by rounding errors, 1e-13


class Mode(IntEnum):
    """Mode of a contact during a step."""

    OPEN = 0
    STICKS = 1
    SLIDES = 2


class SceneSettings(Section):
    """Settings of the figures; all are our own choices, as the thesis gives no numbers for these figures."""

    rod_mu: float = Field(0.3, ge=0, description="low enough for a visible slide of the right end")
    rod_epsilon: float = Field(0.0, ge=0, le=1, description="as in the rod's source: an end that lands stays down")
    rod_height: float = Field(1.2, gt=0, description="m, centre at release; the figure is two rod lengths high")
    rod_theta: tuple[float, ...] = Field((1.1, 1.2, 1.3), description="rad; left end down")
    rod_vx: tuple[float, ...] = Field((0.0, 0.5, 1.0, 1.5), description="m/s")
    rod_omega: tuple[float, ...] = Field((-1.0, 0.0), description="rad/s; falls to the right")
    rod_steps: int = Field(200, ge=1, description="1 s: until the rod lies still")
    disk_height: float = Field(1.1, gt=0, description="m, centre at release; flight takes as long as rolling")
    disk_vx: float = Field(4.0, description="m/s; makes the picture wider than high")
    disk_steps: int = Field(130, ge=2, description="0.65 s, half of it flight")
    window: int = Field(60, ge=2, description="m of figure 2-4, as long as the flight, about the touchdown")
    snr_db: float = Field(20.0, description="dB; noise of table 2.1 that is visible at the scale of the figure")
    tip_theta: float = Field(0.6, gt=0, lt=np.pi / 4, description="rad, start of the tipping block")
    tip_steps: int = Field(150, ge=2, description="0.75 s, until it has landed on its side")
    candidates: int = Field(20, ge=1, description="number of drops from which the plotted trace is chosen")
    wheel_steps: int = Field(500, ge=1, description="2.5 s: five spokes of steady rolling")


SCENES = SceneSettings()


@dataclass(frozen=True)
class RodFall:
    """A rod whose left end lands and sticks and whose right end lands later and slides."""

    body: PlanarFreeBody  # its pairs are the left and the right end
    record: SimulatedMotion
    modes: np.ndarray  # (m, 2) `Mode` of the ends in each step
    lands: tuple[int, int]  # steps in which left and right end first touch


@dataclass(frozen=True)
class NoisyMotion:
    """A motion, its noisy states, and a window start..stop-1 of its steps."""

    body: PlanarFreeBody
    record: SimulatedMotion
    observed: NoisyStates
    start: int
    stop: int


def contact_modes(record: SimulatedMotion) -> np.ndarray:
    """`Mode` (m, p) of each contact pair in each step: open without a normal force, else determined by J_t v_{k+1}."""
    v_t = np.einsum("kpv,kv->kp", record.J_t, record.v[1:])
    closed = np.where(np.abs(v_t) > SLIPS, Mode.SLIDES, Mode.STICKS)
    return np.where(record.c_n > 0.0, closed, Mode.OPEN)


def falling_rod(settings: Chapter2Bodies = DEFAULT, scenes: SceneSettings = SCENES) -> RodFall:
    """Simulate the fall of figure 2-2.

    Of the starts for which the left end lands first and sticks and the right end slides on landing, the first with the
    largest min(uninterrupted steps that the left end sticks after landing, steps that the right end slides) is used.

    Raises:
        UserError: no start of the grid moves in this way.
    """
    body = rod(settings)
    best: tuple[int, RodFall] | None = None
    for theta, vx, omega in product(scenes.rod_theta, scenes.rod_vx, scenes.rod_omega):
        q, v = np.array([0.0, scenes.rod_height, theta]), np.array([vx, 0.0, omega])
        record = simulate(body, q, v, None, settings.h, scenes.rod_steps, scenes.rod_mu, scenes.rod_epsilon)
        modes = contact_modes(record)
        closed = modes != Mode.OPEN
        if not (record.solved and closed.any(axis=0).all()):
            continue
        left, right = (int(step) for step in closed.argmax(axis=0))
        sticks = int(np.argmin(np.append(modes[left:right, 0] == Mode.STICKS, False)))
        slides = int((modes[right:, 1] == Mode.SLIDES).sum())
        lies_right = np.cos(record.q[right, 2]) > 0.0  # otherwise the rod fell over backwards
        if left < right and lies_right and modes[right, 1] == Mode.SLIDES and sticks > 0:
            score = min(sticks, slides)
            if best is None or score > best[0]:
                best = score, RodFall(body, record, modes, (left, right))
    if best is None:
        raise UserError(
            "No start of the falling rod lands with its left end, sticks, and slides when its right end lands; widen "
            "rod_theta, rod_vx or rod_omega, or lower rod_mu."
        )
    return best[1]


def landing_disk(
    rng: np.random.Generator, settings: Chapter2Bodies = DEFAULT, scenes: SceneSettings = SCENES
) -> NoisyMotion:
    """Simulate the disk of figure 2-4: thrown without spin, it lands without rebound and rolls; window about landing.

    Raises:
        UserError: the disk does not land early enough for the window, or does not roll at its end.
    """
    body = disk(settings)
    q, v = np.array([0.0, scenes.disk_height, 0.0]), np.array([scenes.disk_vx, 0.0, 0.0])
    record = simulate(body, q, v, None, settings.h, scenes.disk_steps, settings.mu, 0.0)
    modes = contact_modes(record)[:, 0]
    lands = int(np.argmax(modes != Mode.OPEN))
    start = lands - scenes.window // 2
    stop = start + scenes.window
    if not (start >= 0 and stop <= record.steps and modes[stop - 1] == Mode.STICKS):
        raise UserError(
            f"The disk does not go from flight to rolling within a window of {scenes.window} of its {record.steps} "
            f"steps (first contact: step {lands}); change disk_height, disk_steps or window."
        )
    return NoisyMotion(body, record, add_noise(record, scenes.snr_db, rng), start, stop)


def tipping_block(
    rng: np.random.Generator, settings: Chapter2Bodies = DEFAULT, scenes: SceneSettings = SCENES
) -> NoisyMotion:
    """Simulate the block of figure 2-5: released at rest on one corner, it tips over it, always in contact."""
    body = block(settings)
    q = np.array([0.0, 0.0, scenes.tip_theta])
    q[1] = -body.contacts(q).phi.min()
    record = simulate(body, q, np.zeros(3), None, settings.h, scenes.tip_steps, settings.mu, 0.0)
    return NoisyMotion(body, record, add_noise(record, scenes.snr_db, rng), 0, record.steps)


def traces(
    rng: np.random.Generator, settings: Chapter2Bodies = DEFAULT, scenes: SceneSettings = SCENES
) -> dict[str, tuple[PlanarFreeBody, SimulatedMotion]]:
    """Simulate the motions of figure 2-9: "block", "ellipse", "wheel, high friction" and "wheel, low friction".

    Of a few random drops, the drop whose centre travels farthest is shown.  The wheel starts at its median speed.
    """
    shown: dict[str, tuple[PlanarFreeBody, SimulatedMotion]] = {}
    drops: dict[Kind, PlanarFreeBody] = {"block": block(settings), "ellipse": ellipse(settings)}
    for kind, body in drops.items():
        starts = zip(*releases(kind, scenes.candidates, rng, settings))
        records = [
            simulate(body, q, v, None, settings.h, settings.steps, settings.mu, settings.epsilon) for q, v in starts
        ]
        solved = [record for record in records if record.solved]
        shown[kind] = body, max(solved, key=lambda record: float(np.ptp(record.q[:, 0])))
    rolling, w = wheel(settings), settings.wheel
    q, v = rolling.standing(0.0, float(w.omega.quantile(0.5)))  # pyright: ignore[reportArgumentType]
    for name, mu in (("high", w.mu), ("low", w.mu_low)):
        record = simulate(rolling, q, v, None, settings.h, scenes.wheel_steps, mu, w.epsilon)
        shown[f"wheel, {name} friction"] = rolling, record
    return shown


def reaching_arm(settings: Chapter2Bodies = DEFAULT) -> tuple[ArmDisk, np.ndarray]:
    """The arm of figure 2-1 and a configuration q (5,) in which the disk touches both the ground and link 2."""
    arm, a = arm_disk(settings), settings.arm
    first, incline = a.link_1.low, a.incline.low  # link 2 then touches the disk at the largest distance from the joint
    q = np.array([first, incline - first, 0.0, a.disk_radius, 0.5])
    elbow = arm.joints(q[None])[0][0]
    # below link 2 at a distance of one radius from its line: (P - elbow)' (sin β, -cos β) = R
    q[2] = elbow[0] + (a.disk_radius + (q[3] - elbow[1]) * np.cos(incline)) / np.sin(incline)
    return arm, q


def falling_polygon() -> tuple[PlanarFreeBody, np.ndarray]:
    """The "planar object" of figure 2-3, here an irregular pentagon (our choice), and its pose (3,)."""
    corners = ((-0.42, -0.32), (0.38, -0.38), (0.52, 0.12), (0.08, 0.44), (-0.46, 0.24))
    return PlanarFreeBody(Polygon(vertices=corners), 1.0, 0.1), np.array([1.2, 0.95, 0.3])


def schematic_poses(settings: Chapter2Bodies = DEFAULT) -> dict[str, tuple[Mechanism, np.ndarray]]:
    """Mechanisms of the schematics (figures 2-1, 2-3, 2-6 to 2-8), each with the configuration shown."""
    rolling = wheel(settings)
    return {
        "arm": reaching_arm(settings),
        "polygon": falling_polygon(),
        "block": (block(settings), np.array([0.0, 1.05 * settings.side, 0.35])),
        "ellipse": (ellipse(settings), np.array([0.0, 1.05 * settings.semi_axes[0], 0.5])),
        "wheel": (rolling, rolling.standing(np.pi / rolling.spokes, -1.0, 5)[0]),
    }
