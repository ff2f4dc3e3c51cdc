"""Slips that end while they are watched, as of a body that then moves with the surface, at rest or carried along.

A parabola is fitted to the place over a time T.  A slip that falls by D and is 0 from t_s < T on has, with
s = 2 t/T − 1 and z = 2 t_s/T − 1,

    speed in the middle  v = (3/8) D T I_1,    I_1 = ∫ (z − s)(1 − s²) ds      from −1 to z          (1)
    acceleration         a = (15/4) D I_2,     I_2 = ∫ (z − s)(s − s³) ds,

the coefficients of Legendre's polynomials of its path.  One that ends at T or later has v ≥ D T/2 and a = −D.

On a friction pyramid the difference of both components of the slip falls so, too, and friction is then shared.
"""

import numpy as np

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
