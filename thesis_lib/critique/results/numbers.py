"""What the pictures and the page of the critique show, as numbers: errors, intervals, residuals and coordinates.

| on paper | in code | unit | shape | |
|---|---|---|---|---|
| δv = (δv_x, δv_y, δω) | | m/s, rad/s | (n, 3) | velocity after impact, measured minus predicted |
| (δv_t, δv_n, δτ/k) | `contact_residuals` | m/s | (n, 3) | of the contact point, and the couple over m k |
| z | `energy_disc` | 1 | (n, 2) | impulse in the energy ellipse, mapped to the unit disc |

The energy disc: with M_C⁻¹ = L Lᵀ the impulse c is mapped to Lᵀ (c + M_C v_C) / √(v_Cᵀ M_C v_C), turned so that "no
impulse" lies at (0, −1) and complete reversal of v_C at (0, 1), and mirrored so that impulses against the slip lie to
the right.  The centre is the dead stop, the circle keeps all energy, and the squared radius is the share of the
contact-space energy that is left (thesis, equations 3.5 and 3.6).
"""

from collections.abc import Mapping

import numpy as np
import pandas as pd

from thesis_lib.statistics.spread import robust_std
from thesis_lib.statistics.intervals import Z95, clustered_mean
from thesis_lib.contact import LAWS
from thesis_lib.contact.space import contact_space, measured_impulse, residual_couple, velocity_error
from thesis_lib.critique.drops.criticise import Critique
from thesis_lib.critique.drops.features import FEATURES
from thesis_lib.critique.drops.fit import Fit
from thesis_lib.critique.drops.model import BASE_PARAMETERS
from thesis_lib.critique.drops.residuals import impact_residuals, states_at_impact
from thesis_lib.critique.drops.observations import Observations
from thesis_lib.effects import EFFECTS

MOVED, MATERIAL = 3.0, 0.02  # standard errors and share by which a parameter must move to have compensated
FEATURE_LABEL = {
    "v_t": "tangential velocity $v_t$",
    "v_n": "normal velocity $v_n$",
    "omega": r"angular velocity $\omega$",
    "r_x": "contact point $r_x$",
    "theta": r"body angle $\theta$",
    "x": "position $x$",
    "trial": "number of the release",
    "t": "time $t$",
}
CHANNELS = ("flight", "meet", "touch")
GREEK = {
    "mu": "μ",
    "epsilon": "ε",
    "eps": "ε",
    "phi": "φ",
    "theta": "θ",
    "omega": "ω",
    "eta": "η",
    "zeta": "ζ",
    "rho": "ρ",
    "tau": "τ",
    "alpha": "α",
    "beta": "β",
    "gamma": "γ",
    "kappa": "κ",
}


def handy_unit(size: float, unit: str) -> tuple[float, str]:
    """Factor and unit in which a length or an angle of this size reads well: below 0.1 in mm and mrad."""
    small = unit in ("m", "rad") and 0.0 < abs(size) < 0.1
    return (1e3, f"m{unit}") if small else (1.0, unit)


def symbol(name: str) -> str:
    """A parameter's name with Greek letters, in plain text: c_mu as c_μ."""
    return "_".join(GREEK.get(part, part) for part in name.split("_"))


def law_title(name: str) -> str:
    """Title of a law, or its name where it has none."""
    return LAWS[name].title if name in LAWS else name


def effect_title(name: str) -> str:
    """Title of an effect, or its name where it is not in the library (any more)."""
    return EFFECTS[name].title if name in EFFECTS else name.replace("_", " ")


def new_law(critique: Critique, i: int) -> str:
    """Title of the law at the i-th rung of the ladder if it is another one than at the rung before, else ''."""
    before, here = (critique.ladder[j][1].model.law.name for j in (max(i - 1, 0), i))
    return law_title(here) if here != before else ""


def rung_title(critique: Critique, i: int) -> str:
    """Label of the i-th rung of the ladder: the base law, or what was added and whether the law changed with it."""
    if i == 0:
        return law_title(critique.discovery.base)
    law = new_law(critique, i)
    return f"+ {effect_title(critique.ladder[i][0])}" + (f", law now {law}" if law else "")


def unit_of(feature: str) -> str:
    """Unit of a feature as axes show it, '' for pure numbers."""
    unit = FEATURES[feature][0] if feature in FEATURES else "1"
    return "" if unit == "1" else unit


def ladder_table(critique: Critique, tables: Mapping[str, pd.DataFrame] | None = None) -> pd.DataFrame:
    """Held-out error after each added effect: columns label, error, error_low, error_high (m/s), flight, meet, touch.

    The last three are in units of noise.  Rows are those of `tables["ladder"]` where there is one, so that page,
    picture and table agree.
    """
    columns = ["label", "error", "error_low", "error_high", *CHANNELS]
    given = (tables or {}).get("ladder")
    if given is not None:
        return given[columns].reset_index(drop=True)
    rows = []
    for label, _, judged in critique.ladder:
        sigma = [float(np.sqrt(judged.sigmas[name])) for name in CHANNELS]
        rows.append((label, *clustered_mean(judged.error, judged.trial), *sigma))
    return pd.DataFrame(rows, columns=columns)


def law_errors(critique: Critique) -> tuple[pd.DataFrame, np.ndarray]:
    """Held-out error and score of each law without effects, best first, and Best Post Hoc's error of each impact.

    Columns: model, error, error_low, error_high (m/s), gain, gain_low, gain_high (nats an impact, law minus base law).
    """
    base = critique.laws[critique.discovery.base]
    trials = np.unique(np.concatenate([base.trial, base.flight_trial]))
    n = len(base.score)
    rows = []
    for name, judged in critique.laws.items():
        mean, low, high = clustered_mean(judged.error, judged.trial)
        difference = judged.by_trial(trials) - base.by_trial(trials)
        gain = float(difference.sum() / n)
        m = len(trials)
        half = Z95 * np.sqrt(m * difference.var(ddof=1)) / n if m > 1 else np.nan
        rows.append((name, mean, low, high, gain, gain - half, gain + half))
    table = pd.DataFrame(
        rows, columns=["model", "error", "error_low", "error_high", "gain", "gain_low", "gain_high"]
    )
    best = np.min(np.stack([judged.error for judged in critique.laws.values()]), axis=0)
    return table.sort_values("error", kind="stable", ignore_index=True), best


def impact_errors(fitted: Fit, observations: Observations) -> np.ndarray:
    """Kinetic error (n,) in m/s of each impact."""
    R = impact_residuals(fitted.model, fitted.values, observations)[:, :3]
    return velocity_error(R, observations.rig.k_g)


def contact_residuals(fitted: Fit, observations: Observations) -> np.ndarray:
    """Error (n, 3) of the velocity after impact in the contact frame, measured minus predicted, m/s."""
    o = observations
    R = impact_residuals(fitted.model, fitted.values, o)[:, :3]
    before, _ = states_at_impact(fitted.model, fitted.values, o)
    r = o.rig.shape.contact_point(before.theta) + o.offset
    couple = residual_couple(R, r, mass=1.0, k_g=o.rig.k_g) / o.rig.k_g
    return np.stack([R[:, 0] - r[:, 1] * R[:, 2], R[:, 1] + r[:, 0] * R[:, 2], couple], axis=1)


def energy_disc(fitted: Fit, observations: Observations) -> np.ndarray:
    """Measured impulses in the unit disc of the energy ellipse, (n, 2); see the module's docstring."""
    o = observations
    before, after = states_at_impact(fitted.model, fitted.values, o)
    v_pre = np.stack([before.vx, before.vy, before.omega], axis=1)
    v_post = np.stack([after.vx, after.vy, after.omega], axis=1)
    r = o.rig.shape.contact_point(before.theta) + o.offset
    space = contact_space(v_pre, r, mass=1.0, k_g=o.rig.k_g)
    l_tt = np.sqrt(space.K_tt)
    l_nt, l_nn = space.K_tn / l_tt, np.sqrt(space.det) / l_tt

    def mapped(c_t: np.ndarray, c_n: np.ndarray) -> np.ndarray:
        return np.stack([l_tt * c_t + l_nt * c_n, l_nn * c_n], axis=-1)

    centre = mapped(*space.impulse_to(0.0, 0.0))
    away = mapped(*measured_impulse(v_post - v_pre, r, mass=1.0, k_g=o.rig.k_g)) - centre
    radius = np.linalg.norm(centre, axis=1)
    up = centre / radius[:, None]
    along = np.sum(away * up, axis=1)
    across = away[:, 0] * up[:, 1] - away[:, 1] * up[:, 0]
    return np.stack([-np.sign(space.v_t) * across, along], axis=1) / radius[:, None]


def parameter_table(critique: Critique) -> pd.DataFrame:
    """Each parameter at each step of the ladder: columns label, parameter, unit, value, std."""
    rows = []
    for label, fitted, _ in critique.ladder:
        declared = fitted.model.parameters
        for name, p in declared.items():
            rows.append((label, name, p.unit, fitted.values[name], fitted.std[name]))
    return pd.DataFrame(rows, columns=["label", "parameter", "unit", "value", "std"])


BASE_NAMES = tuple(p.name for p in BASE_PARAMETERS)


def dependence(values: np.ndarray, feature: np.ndarray, bins: int = 8) -> float:
    """Share of the variance of `values` (n,) that the means within quantile bins of `feature` explain.

    Less what bins explain by chance, (bins − 1)/(n − 1); values are clipped at five robust standard deviations.
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


def compensations(critique: Critique) -> pd.DataFrame:
    """By how much each base parameter moved from the first rung to the last: columns parameter, before, after, sigmas.

    `sigmas` is in standard errors of the two values together.  No rows where the law changed: μ and ε of different laws
    mean different things.
    """
    first, last = critique.ladder[0][1], critique.ladder[-1][1]
    rows = []
    if first.model.law.name != last.model.law.name:
        return pd.DataFrame(rows, columns=["parameter", "before", "after", "sigmas"])
    for name in first.values:
        if name in last.values:
            std = float(np.hypot(first.std[name], last.std[name]))
            moved = last.values[name] - first.values[name]
            rows.append((name, first.values[name], last.values[name], moved / std if std > 0 else np.nan))
    return pd.DataFrame(rows, columns=["parameter", "before", "after", "sigmas"])


def compensated(critique: Critique) -> pd.DataFrame:
    """The rows of `compensations` in which a parameter moved surely and by an amount that matters."""
    table = compensations(critique)
    return table[(table["sigmas"].abs() > MOVED) & (_share_moved(table) > MATERIAL)]


def moved_little(critique: Critique) -> pd.DataFrame:
    """The rows of `compensations` in which a parameter moved surely, but by no amount that matters."""
    table = compensations(critique)
    return table[(table["sigmas"].abs() > MOVED) & (_share_moved(table) <= MATERIAL)]


def _share_moved(table: pd.DataFrame) -> pd.Series:
    return (table["after"] - table["before"]).abs() / table["before"].abs()
