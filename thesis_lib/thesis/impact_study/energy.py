"""Energy of a body in flight and at impacts: the thesis's test of figure 3-6 on all trials of a dataset.

The total energy g (y − y_rest) + (v_x² + v_y² + k² ω²)/2 per unit mass should fall at an impact and be constant until
the next impact.  Each arc conserves its energy by construction, so the test compares two arcs, fitted to separate
samples at the two ends of a flight; flights too short for that are left out.  Both statements use all impacts, so
the test does not select its data.  The ellipse impacts cannot test the fall: the authors kept only drops whose
contact-space energy falls.
"""

import numpy as np
import pandas as pd

from thesis_lib.bodies.shapes import Shape
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.impacts import Impacts
from thesis_lib.datasets.format.samples import ArcSettings
from thesis_lib.statistics.intervals import mean_of, share_of

WINDOWS = 2 * ArcSettings().max_window  # samples of the two arcs of a flight; in a longer flight they share none
FEWEST = 5  # least number of flights that gives a useful standard error


def rest_height(shape: Shape, height: float = 0.0) -> float:
    """Height in m of the body frame in its lowest touching pose, the zero of potential energy."""
    turn = np.linspace(0.0, 2.0 * np.pi, 721)
    return height - float(np.max(shape.contact_point(turn)[:, 1]))


def total_energy(q: np.ndarray, v: np.ndarray, *, k_g: float, gravity: float, rest: float) -> np.ndarray:
    """Total energy (n,) in J/kg at poses q (n, 3; m, rad) and velocities v (n, 3; m/s, rad/s)."""
    return gravity * (q[:, 1] - rest) + 0.5 * np.sum((v * [1.0, 1.0, k_g]) ** 2, axis=1)


def flights(impacts: Impacts, longer_than: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Indices (first, next), (m,) each, of successive impacts of a trial that are more than `longer_than` s apart."""
    order = np.lexsort((impacts.impact, impacts.trial))
    a, b = order[:-1], order[1:]
    successive = (impacts.trial[a] == impacts.trial[b]) & (impacts.impact[b] == impacts.impact[a] + 1)
    with np.errstate(invalid="ignore"):  # unknown instants give no flight
        chosen = successive & (impacts.t[b] - impacts.t[a] > longer_than)
    return a[chosen], b[chosen]


def energy_statements(dataset: Dataset, impacts: Impacts) -> pd.DataFrame:
    """Rows on energy for `statements`, from all impacts of a dataset.

    energy_loss: share of impacts after which the total energy is lower; energy_taken: mean relative loss at an impact;
    energy_between: mean relative change over a flight (omitted if fewer than `FEWEST` are long enough).
    """
    terms = {"k_g": dataset.k_g, "gravity": dataset.gravity, "rest": rest_height(dataset.shape, dataset.height)}
    before = total_energy(impacts.q, impacts.v_pre, **terms)
    after = total_energy(impacts.q, impacts.v_post, **terms)
    rows = [
        ("energy_loss", "", *share_of(after < before), "1"),
        ("energy_taken", "", *mean_of((before - after) / before), "1"),
    ]
    if dataset.rate is not None:
        a, b = flights(impacts, longer_than=WINDOWS / dataset.rate)
        if len(a) >= FEWEST:
            rows.append(("energy_between", "", *mean_of(before[b] / after[a] - 1.0), "1"))
    return pd.DataFrame(rows, columns=["statement", "law", "value", "std", "unit"])
