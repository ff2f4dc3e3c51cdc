"""Numbers of a critique for plots and pages: errors of laws, parameters that changed, residuals of impacts.

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
import pandas as pd

from thesis_lib.contact.space import contact_space, measured_impulse, residual_couple
from thesis_lib.critique.contacts.contact_time import BASE_PARAMETERS, CONTACT_TIME
from thesis_lib.critique.drops.criticise import DropsCritique
from thesis_lib.critique.drops.features import slip_axes
from thesis_lib.critique.drops.judgement import Judgement
from thesis_lib.critique.drops.questions.class_tests import velocities
from thesis_lib.critique.likelihood.comparison import Comparison
from thesis_lib.critique.likelihood.fit import Fit
from thesis_lib.critique.likelihood.observations import Observations
from thesis_lib.mechanics.inertia import in_world
from thesis_lib.mechanics.space import SPACE
from thesis_lib.statistics.intervals import Z95, clustered_mean
from thesis_lib.statistics.spread import robust_std

MOVED, MATERIAL = 3.0, 0.02  # least change of a compensating parameter: standard errors, and share
BASE_NAMES = tuple(p.name for p in (*BASE_PARAMETERS, CONTACT_TIME))


def law_errors(critique: DropsCritique) -> tuple[pd.DataFrame, np.ndarray]:
    """Held-out error and score of each law without effects, best first, and Best Post Hoc's error (n,) in m/s.

    Columns: model, error, error_low, error_high (m/s), gain, gain_low, gain_high (nats per impact over the base law).
    """
    base = critique.laws[critique.discovery.base]
    rows = [
        (name, *clustered_mean(judged.error, judged.trial), *gain_an_impact(judged, base))
        for name, judged in critique.laws.items()
    ]
    table = pd.DataFrame(rows, columns=["model", "error", "error_low", "error_high", "gain", "gain_low", "gain_high"])
    best = np.min(np.stack([judged.error for judged in critique.laws.values()]), axis=0)
    return table.sort_values("error", kind="stable", ignore_index=True), best


def gain_an_impact(judged: Judgement, base: Judgement) -> tuple[float, float, float]:
    """Gain in log score per impact over the model `base`, in nats, with the 95 % interval over trials."""
    trials, n = base.trials, len(base.score)
    difference = judged.by_trial(trials) - base.by_trial(trials)
    gain, m = float(difference.sum() / n), len(trials)
    half = Z95 * np.sqrt(m * difference.var(ddof=1)) / n if m > 1 else np.nan
    return gain, gain - half, gain + half


def compensations(critique: DropsCritique) -> pd.DataFrame:
    """Change of each base parameter from the first to the last model: columns parameter, before, after, sigmas.

    `sigmas` is the change over the joint standard error.  Empty if the law changed: μ and ε of different laws differ.
    """
    first, last = critique.ladder[0][1], critique.ladder[-1][1]
    rows = []
    for name in first.values if first.model.law.name == last.model.law.name else ():
        if name in last.values and not np.isnan(first.std[name] + last.std[name]):
            std = float(np.hypot(first.std[name], last.std[name]))
            moved = last.values[name] - first.values[name]
            rows.append((name, first.values[name], last.values[name], moved / std if std > 0 else np.nan))
    return pd.DataFrame(rows, columns=["parameter", "before", "after", "sigmas"])


def compensated(critique: DropsCritique, material: bool = True) -> pd.DataFrame:
    """Rows of `compensations` with a significant change that is material or, if not `material`, immaterial."""
    table = compensations(critique)
    share = (table["after"] - table["before"]).abs() / table["before"].abs()
    return table[(table["sigmas"].abs() > MOVED) & ((share > MATERIAL) if material else (share <= MATERIAL))]


def impact_errors(fitted: Fit, observations: Observations) -> np.ndarray:
    """Kinetic error (n,) in m/s of each impact."""
    return observations.norm(fitted.on(observations).velocity_left)


def contact_residuals(fitted: Fit, observations: Observations) -> np.ndarray:
    """Error (n, 3) in m/s of the contact-frame velocity after impact, measured minus predicted.

    Without a measured angle, the error of the centre, less the part that the unknown spin explains.  In space (n, 4):
    along the slip before impact, across it, along the normal, and the length of the couple.
    """
    here = fitted.on(observations)
    if not observations.space.is_plane:
        return _in_space(here)
    if not observations.rig.has_angle:
        return here.velocity_left
    R, k_g = here.R[:, :3], observations.rig.k_g
    *_, r = velocities(fitted, observations)
    couple = residual_couple(R, r, mass=1.0, k_g=k_g) / k_g
    return np.stack([R[:, 0] - r[:, 1] * R[:, 2], R[:, 1] + r[:, 0] * R[:, 2], couple], axis=1)


def _in_space(here: Comparison) -> np.ndarray:
    o, (before, _) = here.observations, here.at_impulse
    if not o.rig.has_angle:
        left = np.einsum("ijn,jn->ni", slip_axes(before, o.rig), here.velocity_left[:, :3].T)
        return np.column_stack([left, np.zeros(len(o))])
    error, r = here.R[:, : SPACE.motions].T, o.rig.lowest(before)
    G = in_world(o.rig.tensor, before.attitude)  # pyright: ignore[reportArgumentType]
    of_point = SPACE.velocity_at(error[:3], error[3:], r)
    couple = np.einsum("ijn,jn->in", G, error[3:]) - SPACE.moment(r, error[:3])
    along = np.einsum("ijn,jn->ni", slip_axes(before, o.rig), of_point)
    return np.column_stack([along, np.linalg.norm(couple, axis=0) / o.rig.k_g])


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
