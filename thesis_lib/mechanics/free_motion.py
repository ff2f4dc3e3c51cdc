"""Free flight of n rigid bodies, in the plane or in space: a parabola, and Euler's motion without torque.

In space the angular momentum per mass L = R G Rᵀ ω is constant, so that the attitude alone has to be integrated,

    Ṙ = [ω] R,    ω = W L,    W = R G⁻¹ Rᵀ,

by a commutator-free Lie-group method of order 4, whose steps are turns; it keeps L and the length of the quaternion.
Small changes φ of the attitude, dω₀ of the first spin and L₀ of that follow

    φ̇ = W (dL + L × φ),    dL = R₀ G R₀ᵀ dω₀,

and are integrated with it.  A turn of the first attitude *and* spin turns the whole motion, so the columns of the first
attitude are 1 + Φ [ω₀], Φ those of the first spin.

| on paper | in code | unit       | shape               |                                                     |
|----------|---------|------------|---------------------|-----------------------------------------------------|
| q₀       | `pose`  | m, rad     | (d + attitude, n)   | pose at time 0                                      |
| v₀       | `motion`| m/s, rad/s | (d + turns, n)      | velocity and spin at time 0, axes of the world      |
| G        | `G`     | m²         | as in `inertia`     | inertia per mass, axes of the body; not used in the plane |
| a        | `a`     | m/s²       | (d, n) or (d, 1)    | acceleration, gravity for example                   |
| τ        | `tau`   | s          | (k, n), (k, 1), (k,)| times, in any order, of either sign                 |

Sources: Celledoni, Marthinsen and Owren, Future Gener. Comput. Syst. 19 (2003), doi:10.1016/S0167-739X(02)00161-9 (the
method); Goldstein, Classical Mechanics, chapter 5 (torque-free motion).
"""

from typing import NamedTuple

import numpy as np

from thesis_lib.mechanics.inertia import in_world
from thesis_lib.mechanics.space import PLANE, SPACE, conjugate, cross, multiplied, of_rotation_vector, rotated

STEP = 0.06  # rad a step: some 1e-10 rad each, 1e-6 of a column a turn
TURN = 1.0  # rad a step where 1e-5 rad do: for what is within millimetres of the centre of mass
MOST_STEPS = 100_000  # a flight that turns further is an error in its data


class Flight(NamedTuple):
    """Poses (d + attitude, k, n) and motions (d + turns, k, n) of n bodies at k times."""

    pose: np.ndarray
    motion: np.ndarray


class Columns(NamedTuple):
    """Derivatives of the poses at k times by the first pose, the motion and a constant acceleration.

    Small turns are rotation vectors about axes of the world.  Every component of the position depends on its own first
    value, velocity and acceleration alone, with the columns 1, τ and τ²/2; so does the angle in the plane.

    Attributes:
        tau: (k, n) in s.
        by_attitude: (3, 3, k, n) turn by the first turn, None in the plane (where it is 1).
        by_spin: (3, 3, k, n) turn by the first spin in s, None in the plane (where it is τ).
    """

    tau: np.ndarray
    by_attitude: np.ndarray | None = None
    by_spin: np.ndarray | None = None

    @property
    def place(self) -> np.ndarray:
        """(3, k, n): 1, τ and τ²/2."""
        return np.stack([np.ones_like(self.tau), self.tau, 0.5 * self.tau * self.tau])

    def matrix(self) -> np.ndarray:
        """All columns, (d + turns, 2 (d + turns) + d, k, n): by pose, motion and acceleration, in this order."""
        space = PLANE if self.by_spin is None else SPACE
        d, m = space.dimension, space.motions
        columns = np.zeros((m, 2 * m + d, *self.tau.shape))
        for i in range(m if space.is_plane else d):
            columns[i, [i, m + i]] = self.place[:2]
        for i in range(d):
            columns[i, 2 * m + i] = self.place[2]
        if not space.is_plane:
            columns[d:, d:m], columns[d:, m + d : 2 * m] = self.by_attitude, self.by_spin
        return columns


def attitudes(
    attitude: np.ndarray, spin: np.ndarray, G: np.ndarray, tau: np.ndarray, step: float = STEP
) -> tuple[np.ndarray, np.ndarray]:
    """Attitudes (4, k, n) and spins (3, k, n) in rad/s in space at times `tau`, of torque-free motion.

    Args:
        attitude: (4, n) at time 0, unit quaternions.
        spin: (3, n) at time 0, axes of the world, rad/s.
        G: (3, 3) or (3, 3, n) inertia per mass in m², axes of the body.
        tau: (k, n), (k, 1) or (k,) in s; where it is not finite, the results are NaN.
        step: largest turn in rad of a step of the integration.

    Raises:
        ValueError: a body turns by more than `MOST_STEPS` steps.
    """
    q, spins, _ = _integrated(attitude, spin, G, _grid(tau, attitude.shape[1]), step)
    return q, spins


def flown(pose: np.ndarray, motion: np.ndarray, G: np.ndarray | float, a: np.ndarray, tau: np.ndarray) -> Flight:
    """Poses and motions at times `tau`, under a constant acceleration and without torque; as in the module's table.

    Raises:
        ValueError: as `attitudes`.
    """
    space = _space_of(pose)
    tau, d = _grid(tau, pose.shape[1]), space.dimension
    v, a = motion[:d, None], np.asarray(a)[:, None]
    place, velocity = pose[:d, None] + tau * (v + 0.5 * tau * a), v + tau * a
    if space.is_plane:
        spin = np.broadcast_to(motion[d:, None], (1, *tau.shape))
        turned = pose[d:, None] + tau * spin
    else:
        turned, spin = attitudes(pose[d:], motion[d:], np.asarray(G), tau)
    return Flight(np.concatenate([place, turned]), np.concatenate([velocity, spin]))


def columns(pose: np.ndarray, motion: np.ndarray, G: np.ndarray | float, tau: np.ndarray) -> Columns:
    """Derivatives of the poses of `flown` by what it starts from; they do not depend on the acceleration.

    Raises:
        ValueError: as `attitudes`.
    """
    space = _space_of(pose)
    tau, d = _grid(tau, pose.shape[1]), space.dimension
    if space.is_plane:
        return Columns(tau)
    *_, by_spin = _integrated(pose[d:], motion[d:], np.asarray(G), tau, STEP, with_columns=True)
    # Φ [ω₀] has the rows Φ_i × ω₀
    by_attitude = cross(by_spin.swapaxes(0, 1), motion[d:, None, None]).swapaxes(0, 1)
    by_attitude[[0, 1, 2], [0, 1, 2]] += 1.0
    return Columns(tau, by_attitude, by_spin)


def _integrated(
    q: np.ndarray, spin: np.ndarray, G: np.ndarray, tau: np.ndarray, step: float, with_columns: bool = False
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Attitudes (4, k, n), spins (3, k, n), and derivatives Φ (3, 3, k, n) of the attitudes; (3, 0, k, n) without."""
    k, n = tau.shape
    motion = _TorqueFree(q, spin, G, with_columns)
    attitudes, derivatives = np.empty((4, k, n)), np.empty((3, 3 if with_columns else 0, k, n))
    bodies = np.arange(n)
    for sign in (1.0, -1.0):  # onwards from time 0, then backwards
        ahead = sign * tau
        if sign < 0.0 and not (ahead > 0.0).any():
            break
        target = np.where(ahead > 0.0, ahead, 0.0)
        now, state = np.zeros(n), motion.start
        for row in np.argsort(target, axis=0):
            span = target[row, bodies] - now
            turn = motion.rate * span
            steps = int(np.ceil(np.max(turn, where=np.isfinite(turn), initial=0.0) / step))
            if steps > MOST_STEPS:
                raise ValueError(
                    f"a flight turns by {steps * step:.3g} rad between two times: are spins and times right?"
                )
            for _ in range(steps):
                state = motion.after(state, sign * span / steps)
            now = now + span
            there = ahead[row, bodies] >= 0.0 if sign > 0.0 else ahead[row, bodies] > 0.0
            attitudes[:, row[there], bodies[there]] = state[0][:, there]
            derivatives[:, :, row[there], bodies[there]] = state[1][:, :, there]
    attitudes[:, ~np.isfinite(tau)] = np.nan
    return attitudes, motion.spin_at(attitudes), derivatives


class _TorqueFree:
    """The equations of torque-free motion; a state is an attitude (4, n) and its derivatives Φ (3, 3 or 0, n)."""

    def __init__(self, q: np.ndarray, spin: np.ndarray, G: np.ndarray, with_columns: bool) -> None:
        self.inverse = np.linalg.inv(np.moveaxis(G, (0, 1), (-2, -1)))  # (3, 3) or (n, 3, 3)
        D = in_world(G, q)
        self.L = np.einsum("ijn,jn->in", D, spin)
        self.D = D if with_columns else D[:, :0]
        self.start = q, np.zeros_like(self.D)
        # least principal moment g: g |ω|² ≤ ω·G ω, which is constant
        least = np.linalg.eigvalsh(self.inverse)[..., -1]
        self.rate = np.sqrt(np.maximum((self.L * spin).sum(axis=0), 0.0) * least)

    def spin_at(self, q: np.ndarray) -> np.ndarray:
        """ω (3, ..., n) = W L at attitudes (4, ..., n)."""
        return self._W(q, self.L if q.ndim == 2 else self.L[:, None])

    def after(self, state: tuple[np.ndarray, np.ndarray], h: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The state after a step of h (n,) in s."""
        q, P = state
        k1, p1 = self._rates(q, P)
        q2 = _turned(q, 0.5 * h * k1)
        k2, p2 = self._rates(q2, P + 0.5 * h * p1)
        k3, p3 = self._rates(_turned(q, 0.5 * h * k2), P + 0.5 * h * p2)
        k4, p4 = self._rates(_turned(q2, h * (k3 - 0.5 * k1)), P + h * p3)
        middle = 2.0 * (k2 + k3)
        first, second = (3.0 * k1 + middle - k4) * (h / 12.0), (3.0 * k4 + middle - k1) * (h / 12.0)
        return _turned(_turned(q, first), second), P + (h / 6.0) * (p1 + 2.0 * (p2 + p3) + p4)

    def _rates(self, q: np.ndarray, P: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """ω (3, n) and Φ̇ = W (D + L × Φ)."""
        if not P.shape[1]:
            return self._W(q, self.L), P
        L = self.L[:, None]
        both = self._W(q[:, None], np.concatenate([L, self.D + cross(L, P)], axis=1))
        return both[:, 0], both[:, 1:]

    def _W(self, q: np.ndarray, u: np.ndarray) -> np.ndarray:
        """W u (3, ..., n) of vectors u (3, ..., n)."""
        in_body = rotated(conjugate(q), u)
        if self.inverse.ndim == 2:
            slow = (self.inverse @ in_body.reshape(3, -1)).reshape(in_body.shape)
        else:
            slow = np.einsum("nij,j...n->i...n", self.inverse, in_body)
        return rotated(q, slow)


def _turned(q: np.ndarray, turn: np.ndarray) -> np.ndarray:
    return multiplied(of_rotation_vector(turn), q)


def _grid(tau: np.ndarray, n: int) -> np.ndarray:
    """Times (k, n) of times (k, n), (k, 1) or (k,)."""
    tau = np.asarray(tau, dtype=float)
    return np.broadcast_to(tau[:, None] if tau.ndim == 1 else tau, (len(tau), n))


def _space_of(pose: np.ndarray):
    return PLANE if len(pose) == PLANE.poses else SPACE
