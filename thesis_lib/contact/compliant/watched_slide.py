"""Apparent acceleration of slips that end during the observation: the body then moves with the surface or rests.

A parabola is fitted to the position over a time T.  A slip that decreases at the rate D and is 0 from t_s < T on has,
with s = 2 t/T − 1 and z = 2 t_s/T − 1,

    speed in the middle  v = (3/8) D T I_1,    I_1 = ∫ (z − s)(1 − s²) ds      from −1 to z          (1)
    acceleration         a = (15/4) D I_2,     I_2 = ∫ (z − s)(s − s³) ds,

from the coefficients of the Legendre polynomials of its path.  A slip that lasts to T or longer has v ≥ D T/2, a = −D.

On a friction pyramid the difference of the two slip components decreases in the same way; friction is then shared.  If
an ellipse limits friction, the slip turns as it decreases.  It is then integrated in steps, from the initial slip for
which the parabola has the observed velocity in the middle:

    v = (3/4) ∫ v(s) (1 − s²) ds,    a = (15/2 T) ∫ v(s) (s − s³) ds                                 (2)
"""

import numpy as np

STEPS, ROUNDS = 40, 8  # steps along a slip on an ellipse, and iterations to its initial value
_Z = np.linspace(-1.0, 1.0, 201)
_W = _Z + 1.0  # both integrals in terms of w = z + 1
_I_1 = _W**3 / 3.0 - _W**4 / 12.0
_I_2 = -(_W**3) / 3.0 + _W**4 / 4.0 - _W**5 / 20.0


def share_of_slide(speed: np.ndarray, slowing: np.ndarray, span: np.ndarray | float) -> np.ndarray:
    """Apparent over true deceleration −a/D (n,) of slips under a parabola: 1 if they last throughout, 0 without slip.

    Args:
        speed: (n,) m/s, slip in the middle of the parabola.
        slowing: (n,) m/s², deceleration D of the slip while it lasts.
        span: (n,) s, duration T of the parabola.
    """
    lost = slowing * span
    middle = speed / np.where(lost > 0.0, lost, 1.0)
    z_share = np.interp(8.0 / 3.0 * middle, _I_1, -3.75 * _I_2)
    return np.where(lost > 0.0, z_share, 1.0)


def on_ellipse(slip: np.ndarray, limit: np.ndarray, pull: np.ndarray, span: np.ndarray | float) -> np.ndarray:
    """Apparent acceleration (2, n) in m/s² in a fitted parabola if friction dissipates the most within an ellipse.

    Args:
        slip: (2, n) m/s, in the middle of the parabola.
        limit: (2, 2, n) m/s², matrix M of the friction −M² v / |M v|.
        pull: (2, n) m/s², acceleration due to all other forces.
        span: (n,) s, duration of the parabola; 0 gives the instantaneous acceleration.
    """
    span = np.broadcast_to(np.asarray(span, float), slip.shape[1:])
    speed, a = np.hypot(*slip), _slowed(slip, limit, pull)
    slowing = -(a * slip).sum(axis=0) / np.maximum(speed, 1e-9)
    lost = np.maximum(slowing * span, 1e-12)
    # duration of a slip that does not turn
    lasts = np.interp(8.0 / 3.0 * speed / lost, _I_1, 0.5 * _W)
    first = slip * (np.where(speed < 0.5 * lost, lost * lasts, speed + 0.5 * lost) / np.maximum(speed, 1e-9))
    h, reach = 0.05 * np.maximum(speed, 1e-3), np.ones_like(speed)  # wide: slips stop at the end of a step
    middle, seen = _parabola(first, limit, pull, span)
    for _ in range(ROUNDS):
        moved = [_parabola(first + h * axis[:, None], limit, pull, span)[0] for axis in np.eye(2)]
        J = np.moveaxis((np.stack(moved, axis=1) - middle[:, None]) / h, -1, 0) + 0.05 * np.eye(2)
        step = np.linalg.solve(J, (slip - middle).T[..., None])[..., 0].T
        step *= reach * np.minimum(1.0, 0.5 * np.hypot(*first) / np.maximum(np.hypot(*step), 1e-12))
        there = _parabola(first + step, limit, pull, span)
        better = np.hypot(*(slip - there[0])) < np.hypot(*(slip - middle))
        first, middle, seen = (
            np.where(better, new, old) for new, old in zip((first + step, *there), (first, middle, seen))
        )
        reach = np.where(better, 1.0, 0.3 * reach)
    return np.where(span > 0.0, seen, a)


def _slowed(v: np.ndarray, limit: np.ndarray, pull: np.ndarray) -> np.ndarray:
    """Acceleration (2, n) of slips (2, n) with friction limited by an ellipse."""
    of_slip = np.einsum("ijn,jn->in", limit, v)
    return pull - np.einsum("ijn,jn->in", limit, of_slip / np.maximum(np.hypot(*of_slip), 1e-9))


def _parabola(
    first: np.ndarray, limit: np.ndarray, pull: np.ndarray, span: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Velocity in the middle and acceleration, (2, n) each, of parabolas fitted to slips that begin with `first`."""
    h, s = span / STEPS, np.linspace(-1.0, 1.0, STEPS + 1)
    holds = np.linalg.eigvalsh(np.moveaxis(limit, -1, 0))[:, 0] > np.hypot(*pull)
    v, path = first, [first]
    for _ in range(STEPS):
        half = v + 0.5 * h * _slowed(v, limit, pull)
        new = v + h * _slowed(half, limit, pull)
        stops = holds & (((half * v).sum(axis=0) <= 0.0) | ((new * v).sum(axis=0) <= 0.0))
        v = np.where(stops, 0.0, new)
        path.append(v)
    weights = np.full(STEPS + 1, 2.0 / STEPS)
    weights[[0, -1]] *= 0.5
    of_place = np.stack([0.75 * (1.0 - s**2), 7.5 * (s - s**3)]) * weights
    middle, slope = np.einsum("ks,scn->kcn", of_place, np.stack(path))
    return middle, slope / np.maximum(span, 1e-9)
