"""A square, random starts, and contacts that a model makes, for the tests of flights, throws and beliefs."""

import numpy as np

from thesis_lib.bodies.shapes import Polygon
from thesis_lib.effects.effect import Rig
from thesis_lib.thesis.residual.dice.data import MeasuredContacts
from thesis_lib.thesis.residual.dice.fit import DiceModel, contact_path
from thesis_lib.thesis.residual.throwing.flight import ThrownBody, first_touch, fly
from thesis_lib.thesis.residual.throwing.settings import ThrowSettings

HALF = 0.03
SQUARE = Polygon(vertices=((HALF, HALF), (-HALF, HALF), (-HALF, -HALF), (HALF, -HALF)))
RIG = Rig(SQUARE, 0.0245, 9.81, 0.0)
METRIC = np.array([1.0, 1.0, RIG.k_g])  # of velocities
BELIEVED = DiceModel(HALF, 0.0, 0.0, RIG.k_g, "mirtich", 0.1, 0.5, 9.81)
TRUTH = DiceModel(0.026, 0.002, 0.001, 0.0215, "mirtich", 0.11, 0.47, 9.81, d_theta=-0.03)


def thrown_square(rho: float = 0.0, c_v: float = 0.0, c_w: float = 0.0) -> ThrownBody:
    """The square of the rig, with corners rounded by `rho` (m) and linear drag (1/s)."""
    corners = np.array(SQUARE.vertices) * (1.0 - rho / HALF)
    return ThrownBody(corners, rho, RIG.k_g, RIG.gravity, RIG.height, c_v, c_w)


BODY = thrown_square()


def starts(n: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Any poses above the surface and velocities, (n, 3) each."""
    q = np.column_stack([rng.normal(size=n), rng.uniform(0.05, 0.2, n), rng.uniform(-3.0, 3.0, n)])
    v = np.column_stack([rng.normal(size=n), rng.uniform(-2.5, 2.0, n), rng.uniform(-25.0, 25.0, n)])
    return q, v


def throws(n: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Starts like those of the measured throws."""
    rng = np.random.default_rng(seed)
    q = np.column_stack([np.zeros(n), np.full(n, 0.155), rng.uniform(-3.0, 3.0, n)])
    v = np.column_stack([rng.uniform(-0.9, -0.3, n), rng.uniform(-2.5, -1.8, n), rng.uniform(-10, 10, n)])
    return q, v


def touching(n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Poses and velocities (n, 3) of such throws at their first touch, and contact points (n, 2)."""
    q, v = throws(n)
    t, corner = first_touch(BODY, q, v)
    q, v = fly(BODY, q, v, t)
    return q, v, BODY.contact_point(q[:, 2], corner)


def energy(q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Per unit mass (n,), with the height above the surface."""
    return 0.5 * ((v * METRIC) ** 2).sum(axis=1) + RIG.gravity * q[:, 1]


def made_contacts(model: DiceModel, n: int, twist: float = 0.0, span: float = 0.02) -> MeasuredContacts:
    """Contacts that a model makes, measured without noise; `twist` adds v_x and spin in proportion to the speed."""
    q, v = throws(n, seed=7)
    body = model.body
    t, _ = first_touch(body, q, v)
    before_q, before_v = fly(body, q, v, t - 0.003)
    spans = np.full(n, span)
    after_q, after_v = contact_path(model, before_q, before_v, spans, ThrowSettings())
    speed = np.linalg.norm(v * [1, 1, model.k_g], axis=1)
    extra = twist * speed * np.sin(4 * before_q[:, 2])
    after_v = after_v + extra[:, None] * [1.0, 0.0, 1.0 / model.k_g]
    turn = np.array([0.0, 0.0, model.d_theta])
    states = before_q + turn, before_v, after_q + turn, after_v
    return MeasuredContacts(np.arange(n), np.ones(n, bool), *states, spans, last_hit=np.full(n, 0.003))
