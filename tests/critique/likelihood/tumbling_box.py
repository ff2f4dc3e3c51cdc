"""Corner hits of a tumbling box in space, filmed: the truth is known, and the windows beside the hits are fitted."""

from types import SimpleNamespace

import numpy as np

from thesis_lib.bodies.solids import Box
from thesis_lib.contact import LAWS
from thesis_lib.critique.likelihood.flights import no_flights
from thesis_lib.critique.likelihood.observations import Observations
from thesis_lib.datasets.flights.beside_hits import fit_windows
from thesis_lib.effects.effect import Rig
from thesis_lib.mechanics.contact import contact_at, velocity_change
from thesis_lib.mechanics.free_motion import flown
from thesis_lib.mechanics.inertia import mobility
from thesis_lib.mechanics.space import SPACE, of_rotation_vector

BOX = Box(half_extents=(0.03, 0.02, 0.01))
G = np.diag([0.02**2 + 0.01**2, 0.03**2 + 0.01**2, 0.03**2 + 0.02**2]) / 3.0  # of a homogeneous box
GRAVITY, RATE, FRAMES = 9.81, 250.0, 12
NOISE = (2e-4, 3e-3)  # m and rad
MU, EPSILON = 0.25, 0.5
RIG = Rig(BOX, float(np.sqrt(np.trace(G) / 3.0)), GRAVITY, 0.0, tensor=G)
FALL = np.array([[0.0], [0.0], [-GRAVITY]])


def corner_hits(
    n: int,
    rng: np.random.Generator,
    c=(0.0, 0.0, 0.0),
    d_I: float = 0.0,
    law: str = "anitescu_potra_newton",
    a=(0.0, 0.0),
) -> Observations:
    """Hits of a box whose centre of mass is at c (m) and whose inertia is 1 + d_I times the believed one.

    About y and z it is 1 + a times as large, again.
    """
    inertia = (1.0 + d_I) * G * np.array([1.0, 1.0 + a[0], 1.0 + a[1]])
    attitude = of_rotation_vector(rng.standard_normal((3, 4 * n)) * 2.0)
    C, lowest = SPACE.turned(attitude, np.array(c)[:, None]), BOX.lowest(attitude)
    r = lowest - C
    spin = rng.standard_normal((3, 4 * n)) * 8.0
    velocity = np.concatenate([rng.uniform(-1.0, 1.0, (2, 4 * n)), -rng.uniform(1.0, 2.5, (1, 4 * n))])
    hit = contact_at(SPACE, velocity, spin, r, mobility(SPACE, inertia, attitude))
    rows = np.flatnonzero(hit.v_n < -0.5)[:n]
    hit, attitude, C, r = hit[rows], attitude[:, rows], C[:, rows], r[:, rows]
    before = np.concatenate([velocity, spin])[:, rows]
    impulse = LAWS[law].impulse(hit, np.full(n, MU), np.full(n, EPSILON))
    after = before + velocity_change(impulse, r, hit.mobility)
    place = np.concatenate([rng.uniform(-0.1, 0.1, (2, n)), -lowest[2:, rows]]) + C  # of the centre of mass

    phase = rng.uniform(0.0, 1.0, n)
    tau = (np.arange(-FRAMES, FRAMES)[:, None] + phase) / RATE  # (2 FRAMES, n), none at the impact itself
    start, sampled = np.concatenate([place, attitude]), np.empty((7, 2 * FRAMES, n))
    for motion, part in ((before, tau < 0.0), (after, tau >= 0.0)):
        path = flown(start, motion, inertia, FALL, tau).pose
        path[:3] -= SPACE.turned(path[3:].reshape(4, -1), np.array(c)[:, None]).reshape(path[:3].shape)  # tracked point
        sampled = np.where(part, path, sampled)
    turn = NOISE[1] * rng.standard_normal((3, 2 * FRAMES * n))
    seen = SPACE.attitude_after(sampled[3:].reshape(4, -1), turn).reshape(4, 2 * FRAMES, n)
    place = sampled[:3] + NOISE[0] * rng.standard_normal(sampled[:3].shape)
    pose = np.moveaxis(np.concatenate([place, seen]), 0, -1).swapaxes(0, 1)  # (n, W, 7)
    used = np.stack([tau.T < 0.0, tau.T >= 0.0], axis=1)
    windows = fit_windows(pose, tau.T, used, G, NOISE)
    return Observations(
        rig=RIG,
        trial=np.arange(n),
        surface=np.zeros(n, int),
        impact=np.zeros(n, int),
        hits=np.ones(n, int),
        t=np.zeros(n),
        span=np.zeros(n),
        **vars(windows),
        t_std=np.zeros(n),
        offset=np.zeros((n, 3)),
        arcs=True,
        flights=no_flights(SPACE),
        noise_known=True,
        found=SimpleNamespace(arcs_air=None),
    )
