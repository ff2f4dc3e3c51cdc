"""Contacts in space resolved by a physics engine instead of the integration in `pressing`.

Contact points, inertia, coefficients and accelerations in flight are those of the model with its effects, for each body
separately.  An engine therefore supports every effect except those that change the impulse or the force itself.
"""

import numpy as np

from thesis_lib.bodies.solids import UP
from thesis_lib.contact.compliant.compiled import SPEED
from thesis_lib.critique.contacts.contact_time import DAMPING_RATIO, IMPEDANCE
from thesis_lib.critique.contacts.engine_contact import DEFAULT, LATE, LONGEST, SHORTEST
from thesis_lib.critique.contacts.pressing import Pressed, Touching
from thesis_lib.engines.in_space import LEAST as SHARP
from thesis_lib.engines.in_space import PressInSpace, TouchPoints, pressed
from thesis_lib.engines.parameters import drake_numbers
from thesis_lib.mechanics.space import SPACE

OVER = 8.0  # contact times; a body that is still on the surface after them stays there
LEAST = 1e-3  # least ε
ALIKE = 9  # decimals in which bodies must agree to share an engine


def in_engine(touching: Touching) -> Pressed:
    """Motion of bodies in space in the engine of the model's law, from first contact until they leave the surface."""
    dynamics, frame, at = touching.dynamics, touching.frame, touching.at
    engine = dynamics.model.law.engine
    n, outline, force = len(frame), touching.shape.minkowski, dynamics.model.law.force
    assert force is not None  # every law in `STAND_INS` has one
    gap, mu, loss, length = touching.points
    (G, _, couple), tiled = touching.turning, frame.tiled(len(gap))
    down = SPACE.turned_back(tiled.attitude, -np.repeat(UP, len(tiled), axis=1))
    to_middle = SPACE.turned_back(tiled.attitude, at.r) - outline.radius * down
    stretched = outline.squares[:, None] * down
    to_middle -= stretched / np.maximum(np.sqrt((down * stretched).sum(axis=0)), 1e-12)
    centres = to_middle.reshape(3, -1, n)
    R = np.stack([SPACE.turned_back(frame.attitude, np.repeat(axis[:, None], n, axis=1)) for axis in np.eye(3)], axis=1)
    inertia = np.einsum("ian,abn,jbn->ijn", R, G, R)
    first, each = gap.argmin(axis=0), np.arange(n)
    lasting = force.duration(loss) * length / SPEED
    coefficients = np.stack([mu, np.clip(force.restitution(loss), LEAST, 1.0), np.clip(lasting, SHORTEST, LONGEST)])
    coefficients = coefficients[:, first, each]
    shift, motion, elapsed = np.zeros((n, 6)), np.zeros((n, 6)), np.zeros(n)
    values = (np.ravel(dynamics.values.get(p.name, p.null))[:n] for p in (DAMPING_RATIO, IMPEDANCE))
    friction = np.stack([np.broadcast_to(value, n) for value in values])
    push = np.concatenate([touching.falling[:, :3].T, couple])
    alike = np.concatenate([inertia.reshape(9, n) / np.trace(inertia).mean(), friction])
    if not engine.startswith("mujoco"):  # only MuJoCo has coefficients and points for each body
        alike = np.concatenate([alike, coefficients, centres.reshape(-1, n)])
    _, group = np.unique(np.round(alike, ALIKE), axis=1, return_inverse=True)
    for k in range(group.max(initial=-1) + 1):
        rows = np.flatnonzero(group.ravel() == k)
        points = TouchPoints(centres[..., rows], outline.squares, max(outline.radius, SHARP))
        made = _engine(
            engine, points, inertia[..., rows[0]], push[:, rows], coefficients[:, rows], friction[:, rows[0]]
        )
        after, elapsed[rows] = pressed(made, frame.select(rows), OVER * coefficients[2, rows])
        shift[rows] = SPACE.difference(after.pose, frame.pose[:, rows]).T
        motion[rows] = after.v
    elapsed = np.minimum(elapsed, LATE)  # the arc after a longer contact is observed
    return Pressed(shift, motion, elapsed, np.zeros((3, len(gap), n)))


def _engine(
    name: str,
    points: TouchPoints,
    inertia: np.ndarray,
    push: np.ndarray,
    coefficients: np.ndarray,
    friction: np.ndarray,
) -> PressInSpace:
    """Engine with bodies that share `friction` (impratio, impedance); arrays as in `engines/in_space.py`."""
    at_default = name.endswith(DEFAULT)
    if name.startswith("mujoco"):
        from thesis_lib.engines.mujoco_in_space import AT_DEFAULT, MujocoInSpace, MujocoSurface

        impratio, impedance = friction.tolist()
        surface = MujocoSurface("elliptic", max(impratio, 1.0), (impedance, impedance))
        return MujocoInSpace(points, inertia, push, coefficients, AT_DEFAULT if at_default else surface)
    from thesis_lib.engines.drake_in_space import DrakeInSpace

    mu, epsilon, lasting = coefficients[:, 0].tolist()
    # ε and contact time of the law refer to 1 m/s
    numbers = drake_numbers(mu, epsilon, lasting, mass=1.0, speed=SPEED)
    return DrakeInSpace(points, inertia, push, lasting, numbers)
