"""Energy gain at impacts, and bodies that turn round off the surface: effects of the time step of a simulation.

A simulation that detects contacts once per step Δ finds them at any gap up to v_n Δ, so that for all speeds

    φ_n / |v_n| is spread between 0 and Δ (or −Δ),

whereas a wrong height of the surface gives a single φ_n.  Energy changes, as the velocity is reversed at the wrong gap.
"""

import numpy as np

from thesis_lib.datasets.flights.arcs import ArcFits
from thesis_lib.datasets.flights.rounding import approach
from thesis_lib.datasets.format.header import Header
from thesis_lib.datasets.format.impacts import Impacts
from thesis_lib.datasets.format.samples import ArcSettings
from thesis_lib.datasets.impacts.quality import contact_measures
from thesis_lib.statistics.spread import robust_mean, robust_std

FEWEST = 8  # impacts
MOSTLY = 0.75  # share of the impacts that gain; with ε = 1 half of them do by chance
MATERIAL = 1e-3  # relative gain in energy that is worth a sentence
CLEAR = 3.0  # standard errors
ONE_SIDE = 0.9  # share of the gaps with one sign
SCATTER = 0.3  # of the gaps over their median: 0 for a wrong height, 0.74 for gaps spread evenly from 0
# quantiles of φ_n / |v_n|: 10 % over 50 %, and 50 % over 90 %; evenly spread from 0 to Δ they are 0.2 and 0.56, where a
# wrong height gives 1 and 1 at one speed, and a long tail of slow hits at many
NEAR_NONE, EVENLY = 0.5, 0.4
OF_NOISE = 5.0  # sigmas of the gaps
EDGE = 0.95  # quantile that stands for the largest


def energy_gain(impacts: Impacts) -> float:
    """Median of α − 1, the relative energy gain, if most `impacts` gain by more than chance; else 0."""
    gain = contact_measures(impacts).alpha - 1.0
    gain = gain[np.isfinite(gain)]
    if len(gain) < FEWEST or np.mean(gain > 0.0) < MOSTLY:
        return 0.0
    typical, std = robust_mean(gain)
    return typical if typical > max(MATERIAL, CLEAR * std) else 0.0


def gain_sentence(impacts: Impacts, gain: float, step: float) -> str:
    """Sentence on growing energy and its causes; `gain` is from `energy_gain`, `step` in s from `contact_step`."""
    seen = " (the gaps at impact look like that)" if step else ""
    growing = np.sum(contact_measures(impacts).alpha > 1.0)
    return (
        f"Energy grows at {growing} of {len(impacts)} impacts, by {100.0 * gain:.2g} % in the median (contact-space "
        f"energy; {50.0 * gain:.2g} % of the speed); no impact law with ε ≤ 1 can do that. Contacts may be detected "
        f"once per step of a simulation{seen}, the surface may move, or lengths or times of the two sides differ."
    )


def contact_step(fits: ArcFits, header: Header, settings: ArcSettings) -> float:
    """Step Δ in s, if the gaps at impacts are spread from 0 to v_n Δ instead of being 0; else 0."""
    v_n, _ = approach(fits, header)
    rows = (fits.n_side >= settings.min_window).all(1) & fits.converged & (v_n < 0.0)
    if rows.sum() < FEWEST or np.median(np.abs(fits.gap[rows])) < settings.touch_limit:
        return 0.0
    gap = fits.gap[rows]
    if robust_std(gap - np.median(gap)) < SCATTER * np.abs(np.median(gap)):
        return 0.0
    wait, noise = gap / -v_n[rows], fits.gap_std[rows] / -v_n[rows]
    few, half, most = np.quantile(np.abs(wait), (0.1, 0.5, 0.9))
    one_side = np.mean(np.sign(wait) == np.sign(np.median(wait))) >= ONE_SIDE
    if not one_side or few > NEAR_NONE * half or half < EVENLY * most or half < OF_NOISE * np.median(noise):
        return 0.0
    return float(np.quantile(np.abs(wait), EDGE))


def step_sentence(step: float, v_n: np.ndarray) -> str:
    """Sentence on a body that turns round off the surface, and on the cause; `v_n` (n,) in m/s before impact."""
    return (
        f"The body turns round off the surface (no_touch), by the distance it flies in 0 to {1e3 * step:.2g} ms, up to "
        f"{np.quantile(np.abs(v_n), EDGE) * step:.2g} m: contacts are detected once per step of a simulation. No "
        "height of the surface closes these gaps; a shorter step, or one that ends at the touch, does."
    )
