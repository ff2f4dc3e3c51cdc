"""Friction that changes along the path of an impact: what another μ of the second slip does to the impulse.

Shared by effects in which μ depends on the slip; not an effect itself.  The difference of two of Stronge's impulse
paths is added to the impulse of whatever law is in use, so that the law itself keeps its say on everything else.
"""

import numpy as np

from thesis_lib.contact.mirtich import impulse as path_impulse
from thesis_lib.contact.space import ContactSpace
from thesis_lib.effects.effect import Impulse


def second_slip(
    impulse: Impulse, space: ContactSpace, mu: np.ndarray, mu_after: np.ndarray, epsilon: np.ndarray
) -> Impulse:
    """The impulse with `mu_after` (n,) in place of `mu` (n,) once the first slip has ended."""
    with np.errstate(all="ignore"):
        changed, plain = path_impulse(space, mu, epsilon, mu_after), path_impulse(space, mu, epsilon)
    d_t, d_n = (np.where(np.isfinite(a - b), a - b, 0.0) for a, b in zip(changed, plain))
    return Impulse(impulse.c_t + d_t, impulse.c_n + d_n, impulse.tau)
