"""A puck on a table between four cushions, recorded from above by a 120 Hz camera that cannot see its rotation.

Between the cushions the puck slides with Coulomb friction and decelerates with a = μ_table g along its motion,

    s(t) = v t − a t²/2,    v(t) = v − a t.

A contact with a cushion is integrated in time: a spring that is stiffer in unloading (Walton and Braun 1986), which
returns the share ε of the normal velocity, and friction μ N against the slip of the rim,

    m δ̈ = −N,    N = k_1 δ while δ grows,  N = k_1 δ_max − (k_1/ε²)(δ_max − δ) while it shrinks, never below 0,
    m v̇_t = −μ N tanh(u/u_0),    m k² ω̇ = R F_t,    u = v_t + R ω.

| on paper | in code    | unit  | shape |                                                          |
|----------|------------|-------|-------|----------------------------------------------------------|
| a        | `FRICTION` | m/s²  |       | deceleration on the table                                |
| δ        | `depth`    | m     | (n,)  | penetration of the rim into the cushion                  |
| u, u_0   | `slip`, `SLIP` | m/s | (n,) | slip of the rim, and slip that scales the smoothing     |
| k_1      |            | 1/s²  |       | stiffness per mass: (π/(2 T_load))², T_load from `CONTACT` |

None of this uses an impact law or code of the critique.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pandas as pd

from thesis_lib.bodies.walls import Wall
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.header import Header
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.randomness import generator
from thesis_lib.simulate.rig.hidden_causes import NO_SIZE

LENGTH, WIDTH = 1.2, 0.8  # m, between the cushions
RADIUS, MASS = 0.04, 0.05  # m, kg
RATE, NOISE, LOST = 120.0, 3e-4, 0.003  # Hz, m (one sigma), share of lost frames
DURATION = 1.6  # s, length of a recording
FRICTION = 0.25  # m/s²
MU, EPSILON = 0.12, 0.72
CONTACT = 1e-3  # s, duration of an elastic contact
SLIP, STEP = 2e-3, 2e-6  # m/s, s
SLOW = 0.05  # m/s: a slower puck counts as at rest
MOST_HITS = 40
CUSHIONS = (
    Wall(name="south", point=(0.0, -WIDTH / 2), normal=(0.0, 1.0)),
    Wall(name="north", point=(0.0, WIDTH / 2), normal=(0.0, -1.0)),
    Wall(name="west", point=(-LENGTH / 2, 0.0), normal=(1.0, 0.0)),
    Wall(name="east", point=(LENGTH / 2, 0.0), normal=(-1.0, 0.0)),
)
DESCRIPTION = "example: a puck between four cushions, simulated; the table may not be what dataset.yaml says"


@dataclass(frozen=True)
class Cushions:
    """Properties of the four cushions that hidden causes may change, as arrays (4,) by number of the cushion.

    Attributes:
        rise: increase of ε with the normal speed, s/m: ε (1 + rise (|v_n| − 1 m/s)).
        epsilon, mu: restitution and friction.
        out: distance in m by which the cushion is further out than stated in dataset.yaml.
    """

    rise: np.ndarray
    epsilon: np.ndarray
    mu: np.ndarray
    out: np.ndarray


@dataclass(frozen=True)
class HiddenInATable:
    """A hidden cause: the field of `Cushions` that it changes, the default change, and its meaning."""

    field: str
    size: float
    meaning: str


CAUSES = {
    "quick_cushion": HiddenInATable("rise", 0.12, "s/m, increase of the east cushion's restitution with speed"),
    "dead_cushion": HiddenInATable("epsilon", -0.08, "added to the restitution of the east cushion"),
    "rough_cushion": HiddenInATable("mu", 0.1, "added to the friction of the east cushion"),
    "shifted_cushion": HiddenInATable("out", 3e-3, "m, distance of the east cushion beyond its stated place"),
}
EAST = 3
Move = Callable[[np.ndarray, np.ndarray, np.ndarray, Cushions, np.ndarray], np.ndarray]
FLOAT_FORMAT = "%.6f"  # resolves a micrometre, far below the noise


def hidden_table(hidden: str, size: float | None = None) -> Cushions:
    """The cushions with a hidden cause of `CAUSES`, or "nothing"; UserError for unknown causes and impossible sizes."""
    table = Cushions(np.zeros(4), np.full(4, EPSILON), np.full(4, MU), np.zeros(4))
    if hidden == "nothing":
        if size is not None:
            raise UserError(NO_SIZE)
        return table
    if hidden not in CAUSES:
        known = ", ".join([*CAUSES, "nothing"])
        raise UserError(f"There is no hidden cause {hidden!r} of a puck; known are {known}.")
    cause = CAUSES[hidden]
    getattr(table, cause.field)[EAST] += cause.size if size is None else size
    in_range = 0.0 < table.epsilon[EAST] < 1.0 and 0.0 <= table.mu[EAST] <= 1.0
    if not (in_range and abs(table.rise[EAST]) <= 0.5 and abs(table.out[EAST]) <= 0.05):
        raise UserError(f"A size of {size:g} is not possible for {hidden} ({cause.meaning}).")
    return table


def simulate_puck(
    name: str, hidden: str, *, size: float | None = None, trials: int = 60, seed: int = 0, move: Move | None = None
) -> Dataset:
    """Simulate recordings of a puck with the cause `hidden` of `CAUSES`, or "nothing", as the table's owner has them.

    `move` simulates the motion: `slide` (the default), or a function of another simulator with the same arguments.

    Raises:
        UserError: the cause is unknown, its size impossible, or there are no trials.
    """
    if trials < 1:
        raise UserError(f"An example needs at least one trial; got {trials}.")
    if seed < 0:
        raise UserError(f"The seed must be 0 or more; got {seed}.")
    table, rng = hidden_table(hidden, size), generator(seed, "puck")
    q = np.column_stack([rng.uniform(-0.45, 0.45, trials) * LENGTH, rng.uniform(-0.4, 0.4, trials) * WIDTH])
    direction, speed = rng.uniform(0.0, 2.0 * np.pi, trials), rng.uniform(0.8, 3.0, trials)
    v = speed[:, None] * np.column_stack([np.cos(direction), np.sin(direction)])
    omega = 0.3 * speed / RADIUS * rng.standard_normal(trials)
    times = np.arange(int(DURATION * RATE)) / RATE
    path = (move or slide)(q, v, omega, table, times)
    seen = path + NOISE * rng.standard_normal(path.shape)
    poses = pd.DataFrame({"trial": np.repeat(np.arange(trials), len(times)), "t": np.tile(times, trials)})
    poses[["x", "y"]] = seen.reshape(-1, 2)
    kept = (rng.random(len(poses)) >= LOST) & np.isfinite(poses["x"].to_numpy())
    poses = poses[kept].reset_index(drop=True).assign(theta=0.0)
    return Dataset(name, believed_header(), poses, has_angle=False)


def believed_header() -> Header:
    """Header (dataset.yaml) as the owner of the table writes it."""
    body = {
        "shape": {"kind": "disk", "radius": RADIUS},
        "mass": MASS,
        "radius_of_gyration": float(f"{RADIUS / np.sqrt(2.0):.6g}"),
    }
    return Header.model_validate(
        {
            "schema": 1,
            "description": DESCRIPTION,
            "body": body,
            "surfaces": [wall.model_dump() for wall in CUSHIONS],
            "gravity": 0.0,
            "rate": RATE,
            "noise": {"position": NOISE},
        }
    )


def cushions_text() -> str:
    """Hidden causes of a puck with default size and meaning, one per line."""
    width = max(map(len, CAUSES))
    lines = [f"  {name:<{width}}  {cause.size:<8g} {cause.meaning}" for name, cause in CAUSES.items()]
    return "\n".join(["of a puck (--shape puck):", *lines])


def slide(q: np.ndarray, v: np.ndarray, omega: np.ndarray, table: Cushions, times: np.ndarray) -> np.ndarray:
    """Positions (n, T, 2) in m at `times` (T,) in s of pucks from q, v (n, 2) and spin omega (n,); NaN once at rest."""
    n = len(q)
    q, v, omega, now = q.copy(), v.copy(), omega.copy(), np.zeros(n)
    path = np.full((n, len(times), 2), np.nan)
    points = np.array([wall.point for wall in CUSHIONS]) - table.out[:, None] * np.stack([w.n for w in CUSHIONS])
    normals = np.stack([wall.n for wall in CUSHIONS])
    for _ in range(MOST_HITS):
        moving = np.flatnonzero((now < times[-1]) & (np.hypot(*v.T) > SLOW))
        if not len(moving):
            break
        speed = np.hypot(*v[moving].T)
        # distance to each cushion along the direction of motion
        gap = np.einsum("nwk,wk->nw", q[moving][:, None] - points, normals) - RADIUS
        closing = -(v[moving] @ normals.T) / speed[:, None]
        way = np.where(closing > 1e-9, np.maximum(gap, 0.0) / np.where(closing > 1e-9, closing, 1.0), np.inf)
        wall = way.argmin(axis=1)
        way = way[np.arange(len(moving)), wall]
        root = speed**2 - 2.0 * FRICTION * way
        stops = root <= SLOW**2
        flight = np.where(stops, (speed - SLOW) / FRICTION, (speed - np.sqrt(np.maximum(root, 0.0))) / FRICTION)
        for i, row in enumerate(moving):
            inside = (times >= now[row]) & (times <= now[row] + flight[i])
            tau = times[inside] - now[row]
            along = speed[i] * tau - 0.5 * FRICTION * tau**2
            path[row, inside] = q[row] + along[:, None] * v[row] / speed[i]
        left = speed - FRICTION * flight
        q[moving] += ((speed + left) / 2.0 * flight / speed)[:, None] * v[moving]
        v[moving] *= (left / speed)[:, None]
        now[moving] += flight
        v[moving[stops]] = 0.0
        hits, wall = moving[~stops], wall[~stops]
        if len(hits):
            _strike(hits, wall, [q, v, omega, now], table, times, path)
    return path


def _strike(
    rows: np.ndarray, wall: np.ndarray, states: list[np.ndarray], table: Cushions, times: np.ndarray, path: np.ndarray
) -> None:
    """Integrate the contacts of the pucks `rows` with the cushions `wall`; modify the states and the path."""
    q, v, omega, now = states
    normal = np.stack([one.n for one in CUSHIONS])[wall]
    tangent = np.column_stack([normal[:, 1], -normal[:, 0]])
    v_n, v_t = (np.einsum("nk,nk->n", v[rows], axis) for axis in (normal, tangent))
    spin = omega[rows].copy()
    epsilon = np.clip(table.epsilon[wall] * (1.0 + table.rise[wall] * (np.abs(v_n) - 1.0)), 0.05, 0.98)
    k_1 = (np.pi / CONTACT) ** 2  # a quarter period of loading is half of the elastic contact
    k_2, mu, k2 = k_1 / epsilon**2, table.mu[wall], RADIUS**2 / 2.0
    depth, most, along = np.zeros(len(rows)), np.zeros(len(rows)), np.zeros(len(rows))
    touching, elapsed = np.ones(len(rows), bool), np.zeros(len(rows))
    # samples within the contact
    first = np.searchsorted(times, now[rows], side="right")
    while touching.any():
        force = np.where(depth >= most, k_1 * depth, np.maximum(k_1 * most - k_2 * (most - depth), 0.0))
        force = np.where(touching, force, 0.0)
        drag = -mu * force * np.tanh((v_t + RADIUS * spin) / SLIP)
        v_n, v_t, spin = v_n + STEP * force, v_t + STEP * drag, spin + STEP * RADIUS * drag / k2
        depth = np.where(touching, depth - STEP * v_n, depth)
        most = np.maximum(most, depth)
        along += np.where(touching, STEP * v_t, 0.0)
        elapsed += STEP * touching
        for i in np.flatnonzero(touching & (first < len(times))):
            if times[first[i]] <= now[rows[i]] + elapsed[i]:
                path[rows[i], first[i]] = q[rows[i]] + along[i] * tangent[i] - depth[i] * normal[i]
                first[i] += 1
        # the spring is unloaded before the dent has recovered
        touching &= ~((v_n > 0.0) & (k_1 * most <= k_2 * (most - depth)))
    q[rows] += along[:, None] * tangent - depth[:, None] * normal
    v[rows] = v_n[:, None] * normal + v_t[:, None] * tangent
    omega[rows] = spin
    now[rows] += elapsed
