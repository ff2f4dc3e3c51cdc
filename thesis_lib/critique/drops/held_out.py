"""Judge a model on data that it was not fitted to: K-fold over trials, or held-out trials.

The error of an impact is the kinetic norm √(δv_x² + δv_y² + (k δω)²) of the velocity after impact in m/s.  The other
channels need trajectories.  Their misfit is the root mean square of the worst component in units of noise: flight
(acceleration), meet (pose) and touch (gap).

The noise floor is the error of a perfect model whose inputs and outcome are measured with noise: the mean kinetic norm
of draws from the residual's covariance S.
"""

from dataclasses import dataclass

import numpy as np

from thesis_lib.contact.space import velocity_error
from thesis_lib.critique.drops.fit import Fit, fit, log_scores
from thesis_lib.critique.drops.observations import Observations
from thesis_lib.critique.drops.residuals import flight_residuals, impact_residuals, residual_covariance
from thesis_lib.critique.selection.settings import SearchSettings
from thesis_lib.statistics.spread import robust_std

CHANNELS = ("impact", "flight", "meet", "touch")
FLOOR_SEED = 0
FLOOR_DRAWS = 64  # per impact; the mean over 100 impacts then has an error of 1 %


@dataclass(frozen=True)
class Judgement:
    """Held-out result of one model.

    Attributes:
        trial, flight_trial: trial of each impact (n,) and flight (f,).
        score, flight_score: log scores in nats, (n,) and (f,).
        error: (n,) kinetic norm, m/s.
        sigmas: mean square in units of noise, by channel "flight", "meet", "touch"; NaN if absent.
        floor: noise floor of `error`, m/s; excess: median error over that of noise alone; NaN if the noise is unknown.
    """

    trial: np.ndarray
    flight_trial: np.ndarray
    score: np.ndarray
    flight_score: np.ndarray
    error: np.ndarray
    sigmas: dict[str, float]
    floor: float
    excess: float

    @property
    def trials(self) -> np.ndarray:
        """Numbers of the trials with an impact or a flight, ascending."""
        return np.unique(np.concatenate([self.trial, self.flight_trial]))

    @property
    def units(self) -> int:
        """Number of impacts."""
        return len(self.score)

    @property
    def total(self) -> float:
        """Log score in nats."""
        return float(self.score.sum() + self.flight_score.sum())

    def by_trial(self, trials: np.ndarray) -> np.ndarray:
        """Log score in nats of each of `trials`, impacts and flights together."""
        total = np.zeros(len(trials))
        for trial, score in ((self.trial, self.score), (self.flight_trial, self.flight_score)):
            np.add.at(total, np.searchsorted(trials, trial), score)
        return total


def judge(fitted: Fit, observations: Observations) -> Judgement:
    """Judge a fitted model on observations that it was not fitted to."""
    model, values, o = fitted.model, fitted.values, observations
    score, flight_score = log_scores(model, values, o, fitted.sigma_m)
    R = impact_residuals(model, values, o)
    S = residual_covariance(model, values, o, o.t_std)
    sigmas = dict.fromkeys(CHANNELS[1:], np.nan)
    flight = flight_residuals(model, values, o.flights, o.rig)
    if len(flight):
        sigmas["flight"] = _robust_mean_square(flight / np.sqrt(o.flights.variance))
    if o.arcs:
        std = np.sqrt(np.einsum("nii->ni", S))
        sigmas["meet"] = _robust_mean_square(R[:, 3:6] / std[:, 3:6])
        sigmas["touch"] = _robust_mean_square(R[:, 6:] / std[:, 6:])
    error = velocity_error(R[:, :3], o.rig.k_g)
    floor, excess = np.nan, np.nan
    if o.noise_known:
        L = np.linalg.cholesky(S[:, :3, :3] + 1e-18 * np.eye(3))
        # the same draws for every model: equal residuals then have equal floors
        unit = np.random.default_rng(FLOOR_SEED).standard_normal((FLOOR_DRAWS, len(o), 3))
        draws = np.einsum("nij,dnj->dni", L, unit)
        noise = velocity_error(draws, o.rig.k_g)
        floor, excess = float(noise.mean()), float(np.median(error) / np.median(noise))
    return Judgement(
        o.trial,
        o.flights.state.trial,
        score,
        flight_score,
        error,
        {k: float(v) for k, v in sigmas.items()},
        floor,
        excess,
    )


def cross_validate(fitted: Fit, observations: Observations, folds: np.ndarray) -> Judgement:
    """Judge by K-fold; `folds` holds the fold of each trial of `np.unique(observations.trial)`."""
    trials = np.unique(observations.trial)
    parts = []
    for k in np.unique(folds):
        others = observations.select(trials[folds != k])
        refitted = fit(fitted.model, others, fitted.values, rounds=1)
        parts.append(judge(refitted, observations.select(trials[folds == k])))
    weights = np.array([len(part.score) for part in parts], float)
    channels = parts[0].sigmas

    def mean(values: list[float]) -> float:
        return float(np.average(values, weights=weights))

    return Judgement(
        **{
            name: np.concatenate([getattr(part, name) for part in parts])
            for name in ("trial", "flight_trial", "score", "flight_score", "error")
        },
        sigmas={name: mean([part.sigmas[name] for part in parts]) for name in channels},
        floor=mean([part.floor for part in parts]),
        excess=mean([part.excess for part in parts]),
    )


def is_material(
    with_effect: Judgement, without: Judgement, channels: tuple[str, ...], settings: SearchSettings
) -> bool:
    """Whether an effect lowers a held-out error of one of its channels by an amount that matters."""
    for channel in channels:
        if channel == "impact":
            before, after = float(without.error.mean()), float(with_effect.error.mean())
            floor = without.floor if np.isfinite(without.floor) else 0.0
        else:
            # root mean squares in units of noise, with floor 1
            before, after = np.sqrt(without.sigmas[channel]), np.sqrt(with_effect.sigmas[channel])
            floor = 1.0
        if np.isfinite(before) and settings.matters(before, after, floor):
            return True
    return False


def _robust_mean_square(z: np.ndarray) -> float:
    """Robust mean square, from the median, of the worst component of z (n, c).

    The median ignores a few flights with an undetected hit; the worst component shows a wrong gravity despite x and θ.
    """
    return float(np.max(robust_std(z)) ** 2)
