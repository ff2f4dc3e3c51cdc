"""Wang-Mason: Routh's impulse path with Poisson's restitution, c_n = (1 + ε) p_c.

The five modes of the paper (sliding, C- and R-sticking, C- and R-reversed) are segments of a single path.  In space
the direction of slip turns along the path (slip_hodograph.py).

Source: Wang and Mason, J. Appl. Mech. 59 (1992), doi:10.1115/1.2893771; thesis section 3.3.2.
"""

import numpy as np

from thesis_lib.contact import slip_hodograph
from thesis_lib.contact.law import Law, Promise
from thesis_lib.contact.slip_path import slip_path, tangential_impulse
from thesis_lib.mechanics.contact import Contact


def impulse(space: Contact, mu: np.ndarray, epsilon: np.ndarray) -> tuple[np.ndarray, ...]:
    """Impulse (c_t, c_n) or (c_t1, c_t2, c_n), each (n,) in N s, at the end of restitution."""
    if space.dimension == 3:
        return slip_hodograph.impulse(space, mu, epsilon, slip_hodograph.Restitution.POISSON)
    path = slip_path(space, mu)
    c_n = (1.0 + epsilon) * path.p_c
    return tangential_impulse(path, c_n), c_n


LAW = Law(
    name="wang_mason",
    title="Wang-Mason",
    impulse=impulse,
    promises=frozenset(Promise),
    dimensions=frozenset({2, 3}),
    # turning slip can press the contact down again after p_c, and can outlast the impact for any μ
    breaks_in_space={Promise.NON_PENETRATION: 1e-4, Promise.STICKS: 0.00133},
    reference="Wang and Mason 1992, doi:10.1115/1.2893771",
)
