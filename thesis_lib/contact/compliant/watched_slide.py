"""Slips that end while they are watched, as of a body that then moves with the surface, at rest or carried along.

A parabola is fitted to the place over a time T.  A slip that falls by D and is 0 from t_s < T on has, with
s = 2 t/T − 1 and z = 2 t_s/T − 1,

    speed in the middle  v = (3/8) D T I_1,    I_1 = ∫ (z − s)(1 − s²) ds      from −1 to z          (1)
    acceleration         a = (15/4) D I_2,     I_2 = ∫ (z − s)(s − s³) ds,

the coefficients of Legendre's polynomials of its path.  One that ends at T or later has v ≥ D T/2 and a = −D.

On a friction pyramid the difference of both components of the slip falls so, too, and friction is then shared.  Where
an ellipse limits friction a slip turns as it falls; it is followed in steps, from the first slip with which a parabola
has the middle that it has:

    v = (3/4) ∫ v(s) (1 − s²) ds,    a = (15/2 T) ∫ v(s) (s − s³) ds                                 (2)
"""

import numpy as np

STEPS, ROUNDS = 40, 8  # along a slip on an ellipse, and to its first value
_Z = np.linspace(-1.0, 1.0, 201)
_W = _Z + 1.0  # both integrals over w = z + 1
_I_1 = _W**3 / 3.0 - _W**4 / 12.0
_I_2 = -(_W**3) / 3.0 + _W**4 / 4.0 - _W**5 / 20.0


def share_of_slide(speed: np.ndarray, slowing: np.ndarray, span: np.ndarray | float) -> np.ndarray:
    """−a/D (n,) by which a parabola sees slips fall, 1 if they last throughout and 0 if there is none.

    Args:
        speed: (n,) m/s, the slip in the middle of the parabola.
        slowing: (n,) m/s², D while it lasts.
        span: (n,) s, T.
    """
    lost = slowing * span
    middle = speed / np.where(lost > 0.0, lost, 1.0)
    z_share = np.interp(8.0 / 3.0 * middle, _I_1, -3.75 * _I_2)
    return np.where(lost > 0.0, z_share, 1.0)


def on_ellipse(slip: np.ndarray, limit: np.ndarray, pull: np.ndarray, span: np.ndarray | float) -> np.ndarray:
    """Acceleration (2, n) in m/s² that a parabola sees where friction takes the most energy within an ellipse.

    Args:
        slip: (2, n) m/s, in the middle of the parabola.
        limit: (2, 2, n) m/s², M of the friction −M² v / |M v|.
        pull: (2, n) m/s², of all else.
        span: (n,) s; 0 is an instant.
    """
    span = np.broadcast_to(np.asarray(span, float), slip.shape[1:])
    speed, a = np.hypot(*slip), _slowed(slip, limit, pull)
    slowing = -(a * slip).sum(axis=0) / np.maximum(speed, 1e-9)
    lost = np.maximum(slowing * span, 1e-12)
    # of a slip that does not turn
    lasts = np.interp(8.0 / 3.0 * speed / lost, _I_1, 0.5 * _W)
    first = slip * (np.where(speed < 0.5 * lost, lost * lasts, speed + 0.5 * lost) / np.maximum(speed, 1e-9))
    h, reach = 0.05 * np.maximum(speed, 1e-3), np.ones_like(speed)  # wide, as slips stop at the end of a step
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
    """Acceleration (2, n) of slips (2, n) on an ellipse."""
    of_slip = np.einsum("ijn,jn->in", limit, v)
    return pull - np.einsum("ijn,jn->in", limit, of_slip / np.maximum(np.hypot(*of_slip), 1e-9))


def _parabola(
    first: np.ndarray, limit: np.ndarray, pull: np.ndarray, span: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Velocity in the middle, and acceleration, (2, n) each, of parabolas over slips that begin with `first`."""
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
