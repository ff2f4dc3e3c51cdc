"""Routh's impulse path, used by the laws that apply Coulomb's law along it (Wang-Mason, Mirtich).

With the normal impulse p as "time", the contact velocity changes by dv_C/dp = M_C⁻¹ (−s μ, 1) while the contact slips
with sign s.  When slip ends, the contact sticks, dc_t/dp = −K_tn / K_tt, if |K_tn| ≤ μ K_tt; else slip reverses.

| symbol | in code      | unit | meaning                                                     |
|--------|--------------|------|-------------------------------------------------------------|
| p_s    | `p_slip`     | N s  | normal impulse at which the first slip ends (∞ if it never does) |
| p_c    | `p_c`        | N s  | normal impulse at maximum compression, v_n = 0              |
| b, b₂  | `b`, `b2`    | 1/kg | dv_n/dp during the first slip and after it                  |
| −s μ   | `slope`      | 1    | dc_t/dp during the first slip                               |
| r₂     | `slope2`     | 1    | dc_t/dp after the first slip                                |

Sources: Routh 1860; Wang and Mason, J. Appl. Mech. 59 (1992), doi:10.1115/1.2893771.
"""

from typing import NamedTuple

import numpy as np

from thesis_lib.mechanics.contact import Contact


class SlipPath(NamedTuple):
    """Path quantities of n impacts (see the module's table); `v_slip` is v_n when the first slip ends."""

    slope: np.ndarray
    slope2: np.ndarray
    b: np.ndarray
    b2: np.ndarray
    p_slip: np.ndarray
    v_slip: np.ndarray
    p_c: np.ndarray


def slip_path(space: Contact, mu: np.ndarray, mu_after: np.ndarray | None = None) -> SlipPath:
    """Path quantities of each impact; p_c always exists, because det M_C⁻¹ > 0 implies b₂ > 0.

    `mu_after` (n,) is the coefficient of friction after the first slip has ended; default `mu` (n,).
    """
    mu_after = mu if mu_after is None else mu_after
    slope = -np.copysign(mu, space.v_t)
    a = space.K_tn + slope * space.K_tt  # dv_t/dp
    b = space.K_nn + slope * space.K_tn
    p_slip = space.v_t / -a
    # slip ends only if friction slows it; v_t = ±0 counts as ended unless slip of that sign grows
    p_slip = np.where(a * np.copysign(1.0, space.v_t) < 0.0, p_slip, np.inf)
    sticks = np.abs(space.K_tn) <= mu_after * space.K_tt
    slope2 = np.where(sticks, space.K_tn / -space.K_tt, -np.copysign(mu_after, space.K_tn))
    b2 = space.K_nn + slope2 * space.K_tn
    v_slip = space.v_n + b * p_slip
    p_c = np.where(v_slip >= 0.0, space.v_n / -b, p_slip - v_slip / b2)
    return SlipPath(slope, slope2, b, b2, p_slip, v_slip, p_c)


def tangential_impulse(path: SlipPath, p_f: np.ndarray) -> np.ndarray:
    """Tangential impulse c_t (n,) in N s at the final normal impulse `p_f` (n,) in N s."""
    first = np.minimum(path.p_slip, p_f)
    return path.slope * first + path.slope2 * (p_f - first)
