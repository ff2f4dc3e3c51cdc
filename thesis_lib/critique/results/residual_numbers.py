"""Residuals of impacts for plots: errors, their parts in the contact frame, impulses in the energy disc.

| on paper | in code | unit | shape | |
|---|---|---|---|---|
| δv = (δv_x, δv_y, δω) | | m/s, rad/s | (n, 3) | velocity after impact, measured minus predicted |
| (δv_t, δv_n, δτ/k) | `contact_residuals` | m/s | (n, 3) | of the contact point, and the couple over m k |
| z | `energy_disc` | 1 | (n, 2) | impulse in the energy ellipse, mapped to the unit disc |

With M_C⁻¹ = L Lᵀ, the energy disc maps the impulse c to Lᵀ (c + M_C v_C) / √(v_Cᵀ M_C v_C).  It is turned so that "no
impulse" is at (0, −1) and complete reversal of v_C at (0, 1), and mirrored so that impulses against the slip are on the
right.  The centre is the dead stop, the circle keeps all energy, and the squared radius is the remaining share of the
contact-space energy (thesis, equations 3.5 and 3.6).
"""

import numpy as np

from thesis_lib.contact.space import contact_space, measured_impulse, residual_couple, velocity_error
from thesis_lib.critique.drops.planar.unknown_spin import velocity_left
from thesis_lib.critique.drops.questions.class_tests import velocities
from thesis_lib.critique.likelihood.fit import Fit
from thesis_lib.critique.likelihood.observations import Observations
from thesis_lib.statistics.spread import robust_std


def impact_errors(fitted: Fit, observations: Observations) -> np.ndarray:
    """Kinetic error (n,) in m/s of each impact."""
    return velocity_error(velocity_left(fitted.on(observations)), observations.rig.k_told)


def contact_residuals(fitted: Fit, observations: Observations) -> np.ndarray:
    """Error (n, 3) in m/s of the contact-frame velocity after impact, measured minus predicted.

    Without an angle that of the centre, less what an unknown spin accounts for.
    """
    if not observations.rig.has_angle:
        return velocity_left(fitted.on(observations))
    R, k_g = fitted.on(observations).R[:, :3], observations.rig.k_g
    *_, r = velocities(fitted, observations)
    couple = residual_couple(R, r, mass=1.0, k_g=k_g) / k_g
    return np.stack([R[:, 0] - r[:, 1] * R[:, 2], R[:, 1] + r[:, 0] * R[:, 2], couple], axis=1)


def energy_disc(fitted: Fit, observations: Observations) -> np.ndarray:
    """Measured impulses (n, 2) in the unit disc of the energy ellipse."""
    v_pre, v_post, r = velocities(fitted, observations)
    size = {"mass": 1.0, "k_g": observations.rig.k_g}
    space = contact_space(v_pre, r, **size)
    l_tt = np.sqrt(space.K_tt)
    l_nt, l_nn = space.K_tn / l_tt, np.sqrt(space.det) / l_tt

    def mapped(c_t: np.ndarray, c_n: np.ndarray) -> np.ndarray:
        return np.stack([l_tt * c_t + l_nt * c_n, l_nn * c_n], axis=-1)

    centre = mapped(*space.impulse_to(0.0, 0.0))
    away = mapped(*measured_impulse(v_post - v_pre, r, **size)) - centre
    radius = np.linalg.norm(centre, axis=1)
    up = centre / radius[:, None]
    along = np.sum(away * up, axis=1)
    across = away[:, 0] * up[:, 1] - away[:, 1] * up[:, 0]
    return np.stack([-np.sign(space.v_t) * across, along], axis=1) / radius[:, None]


def dependence(values: np.ndarray, feature: np.ndarray, bins: int = 8) -> float:
    """Share of the variance of `values` (n,), clipped at five robust std, that quantile bins of `feature` explain.

    The share (bins − 1)/(n − 1) that bins explain by chance is subtracted.
    """
    centre = np.median(values)
    spread = robust_std(values - centre)
    values = np.clip(values - centre, -5.0 * spread, 5.0 * spread)
    total = values.var()
    label = bin_of(feature, bins)
    m = label.max(initial=0) + 1
    if total == 0.0 or m < 2 or len(values) <= m:
        return 0.0
    count = np.bincount(label, minlength=m)
    mean = np.bincount(label, values, m) / np.maximum(count, 1)
    explained = np.sum(count * (mean - values.mean()) ** 2) / (len(values) * total)
    chance = (m - 1) / (len(values) - 1)
    return float(max((explained - chance) / (1.0 - chance), 0.0))


def bin_of(feature: np.ndarray, bins: int) -> np.ndarray:
    """Quantile bin (n,) of each value, from 0; equal values share a bin."""
    edges = np.unique(np.quantile(feature, np.linspace(0.0, 1.0, bins + 1)[1:-1]))
    label = np.searchsorted(edges, feature, side="right")
    return np.unique(label, return_inverse=True)[1]
