"""Anitescu-Potra with Poisson's restitution: two linear complementarity problems, compression and decompression.

As defined:
    compression     the plastic problem (Newton's law with ε = 0) gives c^c and v^c;
    decompression   the normal impulse is N = ε c_n^c + x with 0 ≤ x ⊥ v_n⁺ ≥ 0, and friction |T| ≤ μ N opposes the
                    final slip.  The solution has x = 0: T = −(v_t^c + K_tn N) / K_tt clipped to ±μ N.

(x = 0 because v_n⁺ = K_nn N + K_tn T > 0.  Friction presses the contact down only if T K_tn < 0.  If compression
ended in stick, |T| ≤ |K_tn| N / K_tt.  If it ended in slip of sign s, K_nn − s μ K_tn > 0: slip that keeps this sign
leaves v_n⁺ > 0, and slip that has reversed is driven by K_tn N alone, so that again |T| ≤ |K_tn| N / K_tt; and
K_nn − K_tn² / K_tt = det / K_tt > 0.)

As published (the authors' code): restitution scales the normal impulse only, c = (c_t^c, (1 + ε) c_n^c).  (The code
also re-solves the plastic problem if this penetrates, which cannot happen: v_n⁺ = K_nn ε c_n^c ≥ 0.)

Source: Anitescu and Potra, Nonlinear Dynamics 14 (1997), doi:10.1023/A:1008292328909; thesis section 3.3.2.
"""

import numpy as np

from thesis_lib.contact.anitescu_potra_newton import impulse_to_normal_velocity
from thesis_lib.contact.circular_cone import friction_at
from thesis_lib.contact.law import Law, Promise
from thesis_lib.mechanics.contact import Contact


def impulse(space: Contact, mu: np.ndarray, epsilon: np.ndarray) -> tuple[np.ndarray, ...]:
    """Impulse (c_t, c_n) or (c_t1, c_t2, c_n), each (n,) in N s, summed over compression and decompression."""
    if space.dimension == 3:
        return _in_space(space, mu, epsilon)
    c_t, c_n = impulse_to_normal_velocity(space, mu, -space.v_n)
    normal = epsilon * c_n
    limit = mu * normal
    v_t = space.v_t + space.K_tt * c_t + space.K_tn * (c_n + normal)
    tangential = np.minimum(np.maximum(v_t / -space.K_tt, -limit), limit)
    return c_t + tangential, c_n + normal


def _in_space(space: Contact, mu: np.ndarray, epsilon: np.ndarray) -> tuple[np.ndarray, ...]:
    *c_t, c_n = impulse_to_normal_velocity(space, mu, -space.v_n)
    normal = epsilon * c_n
    v_1, v_2, _ = space.velocity_after(*c_t, c_n + normal)
    t_1, t_2 = friction_at(space, (v_1, v_2), mu * normal)
    return c_t[0] + t_1, c_t[1] + t_2, c_n + normal


def impulse_as_published(space: Contact, mu: np.ndarray, epsilon: np.ndarray) -> tuple[np.ndarray, ...]:
    """Impulse (c_t, c_n), each (n,) in N s, of the authors' code."""
    c_t, c_n = impulse_to_normal_velocity(space, mu, -space.v_n)
    return c_t, (1.0 + epsilon) * c_n


LAW = Law(
    name="anitescu_potra_poisson",
    title="AP Poisson",
    impulse=impulse,
    promises=frozenset(Promise),
    dimensions=frozenset({2, 3}),
    reference="Anitescu and Potra 1997, doi:10.1023/A:1008292328909",
)

LAW_AS_PUBLISHED = Law(
    name="anitescu_potra_poisson_as_published",
    title="AP Poisson (as published)",
    impulse=impulse_as_published,
    promises=frozenset(Promise) - {Promise.NO_ENERGY_GAIN, Promise.CENTRAL},
    breaks={Promise.NO_ENERGY_GAIN: 0.0371, Promise.CENTRAL: 0.431},
    reference="authors' code, github.com/mcubelab/planar-impact-dataset",
)
