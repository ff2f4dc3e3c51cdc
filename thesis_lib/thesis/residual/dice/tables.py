"""Tables of the study of dice: errors and scores by throw and by model, and rank correlations with the error.

    error      = (x measured − x expected)/side,  x expected the mean of the belief
    face right = the side that is down is the most likely side of the belief
    score      = log p(x, side) of the true end under the belief, x in sides            (`belief.RestBelief`)
    bimodality = (s² + 1)/κ of the errors, with their skewness s and kurtosis κ: 5/9 for a uniform distribution, 1 for
                 two points, 1/3 for a normal distribution; Pfister et al., doi 10.3389/fpsyg.2013.00700

Intervals are the central 95 % of a bootstrap over throws.  foundation/columns.yaml defines every column.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy.stats import kurtosis, skew, spearmanr

from thesis_lib.contact.space import velocity_error
from thesis_lib.datasets.format.impacts import Impacts
from thesis_lib.foundation.randomness import streams
from thesis_lib.statistics.bootstrap import central_95, resampled
from thesis_lib.thesis.residual.dice.data import MeasuredContacts, ThrowReleases
from thesis_lib.thesis.residual.dice.fit import touch_down
from thesis_lib.thesis.residual.dice.models import Thrower, contact_residuals
from thesis_lib.thesis.residual.dice.settings import DiceStudySettings
from thesis_lib.thesis.residual.throwing.belief import RestBelief
from thesis_lib.thesis.residual.throwing.calibration import crps, pit_of_gaussian, pit_of_samples, pit_of_student
from thesis_lib.thesis.residual.throwing.contact_map import ContactMap
from thesis_lib.thesis.residual.throwing.throw import Throws

FINEST = 1e-8  # (m/s)², keeps the covariance regular for a law without scatter
PLAIN = "law"  # model whose single end is compared with the beliefs of the others


@dataclass(frozen=True)
class HeldOutThrows:
    """Held-out throws of one model."""

    thrower: Thrower
    x: np.ndarray  # x, face: (n, M) position in m and side of the particles
    face: np.ndarray
    certain: Throws  # the same throws without uncertainty
    after_first: np.ndarray  # (n,) spread of the velocity after the first contact in the kinetic norm, m/s


def contact_pits(thrower: Thrower, contacts: MeasuredContacts, settings: DiceStudySettings) -> pd.DataFrame:
    """Table of PITs of held-out contacts for a law with scatter or a contact map: trial, model, pit, misfit.

    Velocities `duration` after the first touch are compared in the kinetic metric.  `pit` is the χ² probability in
    three dimensions, or Student's t for a contact map (`calibration`); `misfit` is the distance from the mean in m/s.
    """
    model = thrower.model
    rows, q, v, residual, c_n = contact_residuals(model, contacts, settings)
    scale = velocity_error(v, model.k_g)[:, None]
    metric = np.array([1.0, 1.0, model.k_g])
    away = residual[:, 3:] * scale
    if isinstance(thrower.contact, ContactMap):
        mean, std = thrower.contact.missed(q, v)
        away = away - mean[:, 3:] * scale
        pit = pit_of_student(away / (std[:, 3:] * scale), thrower.contact.freedom)
    else:
        # the scatter was estimated as a share of c_n at the centre, in this metric
        share = np.sqrt(np.diag(thrower.contact.relative)) / metric
        cov = ((share * np.maximum(c_n, settings.slowest)[:, None]) ** 2)[:, :, None] * np.eye(3)
        pit = pit_of_gaussian(away, cov + FINEST * np.eye(3))
    return pd.DataFrame(
        {"trial": contacts.trial[rows], "model": thrower.name, "pit": pit, "misfit": np.linalg.norm(away, axis=1)}
    )


def impact_pits(thrower: Thrower, impacts: Impacts) -> pd.DataFrame:
    """Table of PITs of held-out isolated impacts for a learned impact: trial, model, pit, misfit, as in `contact_pits`.

    The impulse's covariance, noise included, is mapped through the dynamics (equation 4.14).  For a rigid learner it
    has rank two, so only the velocities that an impulse through the contact point can reach are compared.
    """
    out = thrower.contact.trained.predict(impacts, covariance=True, noise=True)
    # in the kinetic metric; otherwise spin that no impulse through the point can cause would leak into the impulse
    metric = np.array([1.0, 1.0, impacts.k_g])
    A = np.linalg.pinv(metric[:, None] * out.jacobian)
    away = np.einsum("nij,nj->ni", A, (impacts.v_post - out.v_post) * metric)
    known = np.isfinite(away).all(1)
    pit = np.full(len(impacts), np.nan)
    pit[known] = pit_of_gaussian(away[known], out.covariance[known])
    misfit = velocity_error(impacts.v_post - out.v_post, impacts.k_g)
    return pd.DataFrame({"trial": impacts.trial, "model": thrower.name, "pit": pit, "misfit": misfit})


def throw_rows(outcome: HeldOutThrows, releases: ThrowReleases, side: float, rng: np.random.Generator) -> pd.DataFrame:
    """Table with a row per held-out throw; see foundation/columns.yaml."""
    model = outcome.thrower.model
    face = model.face(releases.end[:, 2])
    x = releases.end[:, 0]
    beliefs = [RestBelief(a / side, b, len(model.body.faces)) for a, b in zip(outcome.x, outcome.face)]
    scores = [belief.log_likelihood(end / side, f) for belief, end, f in zip(beliefs, x, face)]
    turn = 2.0 * np.pi / len(model.body.faces)
    at_touch = touch_down(model, releases)[1][:, 2]
    return pd.DataFrame(
        {
            "trial": releases.trial,
            "model": outcome.thrower.name,
            "error": (x - outcome.x.mean(1)) / side,
            "error_certain": (x - outcome.certain.q[:, 0]) / side,
            "face_right": [int(b.most_likely_face == f) for b, f in zip(beliefs, face)],
            "face_right_certain": (outcome.certain.face == face).astype(int),
            "face_probability": [b.face_probability[f] for b, f in zip(beliefs, face)],
            "log_score": [s[0] for s in scores],
            "log_score_face": [s[1] for s in scores],
            "crps": crps(x / side, outcome.x / side),
            "pit": pit_of_samples(x, outcome.x, rng),
            "spread_rest": outcome.x.std(1) / side,
            "spread_first": outcome.after_first,
            "first_slope": np.abs((at_touch + 0.5 * turn) % turn - 0.5 * turn),
            "contacts": outcome.certain.contacts,
            "settled": outcome.certain.settled.astype(int),
        }
    )


def easy_and_hard(throws: pd.DataFrame, model: str) -> tuple[int, int]:
    """Trials at the 5 % and 95 % quantiles of the belief's spread at rest; outcomes are not used."""
    part = throws[throws["model"] == model].sort_values(["spread_rest", "trial"])
    away = len(part) // 20
    return int(part["trial"].iloc[away]), int(part["trial"].iloc[-1 - away])


def summary(throws: pd.DataFrame, limit: pd.DataFrame, bootstrap: int, rng: np.random.Generator) -> pd.DataFrame:
    """Table per model and quantity, with a 95 % bootstrap interval over throws; `limit_…`: limits due to noise."""
    rows, stream = [], streams(rng)

    def add(model: object, quantities: dict[str, tuple[np.ndarray, Callable]]) -> None:
        for name, (values, statistic) in quantities.items():
            interval = spread(values, statistic, bootstrap, stream(model, name))
            rows.append((model, name, float(statistic(values)), *interval))

    for model, part in throws.groupby("model", sort=False):
        error, certain = part["error"].to_numpy(), part["error_certain"].to_numpy()
        quantities = {
            "mean": (error, np.mean),
            "std": (error, np.std),
            "median_abs": (np.abs(error), np.median),
            "face_right": (part["face_right"].to_numpy(float), np.mean),
            "bimodality": (error, _bimodality),
            "bimodality_certain": (certain, _bimodality),
            "mean_certain": (certain, np.mean),
            "std_certain": (certain, np.std),
            "face_right_certain": (part["face_right_certain"].to_numpy(float), np.mean),
            "log_score": (part["log_score"].to_numpy(), np.mean),
            "crps": (part["crps"].to_numpy(), np.mean),
            "wide_over_narrow": (part["spread_rest"].to_numpy(), _wide_over_narrow),
        }
        add(model, quantities)
    for model, pair in _beside_plain(throws).items():
        add(model, {"mean_size_beyond_law": (pair, _beyond)})
    for model, part in limit.groupby("model", sort=False):
        still, kept = part["spread"].to_numpy(), part["face_kept"].to_numpy()
        add(model, {"limit_std": (still, np.median), "limit_face": (kept, np.mean)})
    return pd.DataFrame(rows, columns=["model", "quantity", "value", "std", "low", "high"])


def _wide_over_narrow(width: np.ndarray) -> float:
    """Ratio of the 95 % and 5 % quantiles of the widths of beliefs, as for the throws of figure 4-10."""
    low, high = np.quantile(width, [0.05, 0.95])
    return float(high / low)


def _bimodality(error: np.ndarray) -> float:
    return float((skew(error) ** 2 + 1.0) / kurtosis(error, fisher=False))


def _beyond(pair: np.ndarray) -> float:
    """Absolute mean of the first column minus the absolute mean of the second."""
    return float(np.abs(pair[:, 0].mean()) - np.abs(pair[:, 1].mean()))


def _beside_plain(throws: pd.DataFrame) -> dict[str, np.ndarray]:
    """By model, errors (n, 2) of its throws, and of the single ends of the same throws by the plain law."""
    plain = throws[throws["model"] == PLAIN].set_index("trial")["error_certain"]
    others = throws[throws["model"] != PLAIN].groupby("model", sort=False)
    return {model: np.column_stack([part["error"], plain.loc[part["trial"]]]) for model, part in others}


def difficulty(throws: pd.DataFrame, bootstrap: int, rng: np.random.Generator) -> pd.DataFrame:
    """Rank correlations over throws, with intervals, between measures of difficulty and the actual error.

    `spread` is correlated with the absolute error (`of` = error), and the spread at rest also with the distance of
    the belief's mean from the plain law's single end (`of` = law).
    """

    def spearman(pair: np.ndarray) -> float:
        return float(spearmanr(*pair.T)[0])

    rows, stream = [], streams(rng)

    def add(model: object, column: str, of: str, pair: np.ndarray, *key: object) -> None:
        pair = pair[np.isfinite(pair).all(1)]
        interval = spread(pair, spearman, bootstrap, stream(model, column, *key))
        rows.append((model, column, of, spearman(pair), *interval, len(pair)))

    ends = _beside_plain(throws)
    for model, part in throws.groupby("model", sort=False):
        for column in ("spread_first", "spread_rest", "first_slope"):
            add(model, column, "error", np.column_stack([part[column], part["error"].abs()]))
        if model in ends:
            apart = np.abs(np.diff(ends[model], axis=1))
            add(model, "spread_rest", "law", np.column_stack([part["spread_rest"], apart]), "law")
    return pd.DataFrame(rows, columns=["model", "spread", "of", "rank_correlation", "std", "low", "high", "n"])


def spread(
    values: np.ndarray, statistic: Callable, bootstrap: int, rng: np.random.Generator
) -> tuple[float, float, float]:
    """Bootstrap standard error of a statistic of rows and its 95 % interval; NaN for fewer than two replicates."""
    if bootstrap < 2:
        return np.nan, np.nan, np.nan
    drawn = resampled(values, statistic, bootstrap, rng)
    return float(drawn.std(ddof=1)), *central_95(drawn)
