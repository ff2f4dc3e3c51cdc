"""Errors of a model, channel by channel, on data that it was not fitted to.

The error of an impact is the kinetic norm of the velocity after impact in m/s (`Observations.norm`); the other channels
(`thesis_lib/critique/likelihood/channels.py`) are in units of noise.  The noise floor is the error of a
perfect model whose inputs and outcome are measured with noise: the mean kinetic norm of draws from the residual's
covariance S.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from thesis_lib.critique.likelihood.channels import CHANNELS, IMPACT, Channel, Misfits, present, worst_of_noise
from thesis_lib.critique.likelihood.comparison import Comparison
from thesis_lib.critique.likelihood.fit import Fit
from thesis_lib.critique.likelihood.observations import Observations
from thesis_lib.critique.likelihood.whitening import Whitening
from thesis_lib.critique.selection.settings import SearchSettings
from thesis_lib.statistics.spread import OF_MEDIAN

FLOOR_SEED = 0
FLOOR_DRAWS = 64  # per impact; the mean over 100 impacts then has an error of 1 %
OF_NORM = 0.56  # as `OF_MEDIAN`, for norms of three components
Scores = tuple[np.ndarray, np.ndarray]  # trials and log scores in nats, (m,) each


@dataclass(frozen=True)
class Judgement:
    """Result of one model on data that it was not fitted to.

    Attributes:
        trial: (n,) of each impact; score: (n,) log scores in nats.
        beside: trials and log scores of measurements beside impacts, by channel.
        error: (n,) kinetic norm, m/s.
        sigmas: mean square in units of noise, by channel except impact; NaN if absent.
        floor: noise floor of `error`, m/s; excess: median error over that of noise alone; NaN if the noise is unknown.
        integrated: whether the contact was integrated, so that `sigmas` hold at its end; an impulse moves nothing.
    """

    trial: np.ndarray
    score: np.ndarray
    beside: Mapping[str, Scores]
    error: np.ndarray
    sigmas: dict[str, float]
    floor: float
    excess: float
    integrated: bool = False

    @property
    def _scores(self) -> list[Scores]:
        return [(self.trial, self.score), *self.beside.values()]

    @property
    def trials(self) -> np.ndarray:
        return np.unique(np.concatenate([trial for trial, _ in self._scores]))

    @property
    def units(self) -> int:
        return len(self.score)

    @property
    def total(self) -> float:
        return float(sum(score.sum() for _, score in self._scores))

    def by_trial(self, trials: np.ndarray) -> np.ndarray:
        total = np.zeros(len(trials))
        for trial, score in self._scores:
            np.add.at(total, np.searchsorted(trials, trial), score)
        return total

    def misfit(self, channel: str) -> tuple[float, float]:
        """Error in a channel and its floor, in the channel's unit; NaN if absent."""
        if channel == IMPACT.name:
            return float(self.error.mean()), self.floor if np.isfinite(self.floor) else 0.0
        return float(np.sqrt(self.sigmas.get(channel, np.nan))), 1.0

    def over_noise(self) -> dict[str, tuple[float, float]]:
        """Median misfit over that of noise, and its relative standard error, by channel."""
        sizes = {name: len(trial) for name, (trial, _) in self.beside.items()}
        found = {IMPACT.name: (self.excess, OF_NORM)}
        found |= {name: (float(np.sqrt(square)), OF_MEDIAN) for name, square in self.sigmas.items()}
        return {
            name: (misfit, std / np.sqrt(max(sizes.get(name, self.units), 1))) for name, (misfit, std) in found.items()
        }


def misfits(fitted: Fit, o: Observations) -> Misfits:
    """Residuals of a model for each hit."""
    return _misfits(fitted, o, fitted.on(o))[1]


def _misfits(fitted: Fit, o: Observations, here: Comparison) -> tuple[Whitening, Misfits]:
    R, S = here.noisy.value, here.covariance(o.t_std)
    whitening = Whitening(fitted.model, o, here.covariance(), fitted.sigma_m, (fitted.values, R))
    names = [beside.channel for beside in o.beside]
    return whitening, Misfits(o, R, whitening.S, S, dict(zip(names, whitening(fitted.values)[1:])))


def judge(fitted: Fit, o: Observations) -> Judgement:
    """Judge a model on observations that it was not fitted to."""
    here = fitted.on(o)
    whitening, left = _misfits(fitted, o, here)
    R, S, sigmas = left.R, left.sharp, {}
    for name in present(left.beside):
        z = CHANNELS[name].in_sigmas(left)
        sigmas[name] = np.nan if z is None else CHANNELS[name].mean_square(z, left)
        if z is not None and not o.space.is_plane:
            sigmas[name] /= worst_of_noise(*z.shape)
    m = o.space.motions
    error = o.norm(here.left_over(R[:, :m]))
    floor, excess = np.nan, np.nan
    if o.noise_known:
        L = np.linalg.cholesky(S[:, :m, :m] + 1e-18 * np.eye(m))
        # the same draws for every model: equal residuals then have equal floors
        unit = np.random.default_rng(FLOOR_SEED).standard_normal((FLOOR_DRAWS, len(o), m))
        drawn = np.einsum("nij,dnj->dni", L, unit)
        noise = o.norm(here.left_over(drawn))
        floor, excess = float(noise.mean()), float(np.median(error) / np.median(noise))
    score, *others = whitening.log_scores(fitted.values)
    beside = {b.channel: (b.trial, scores) for b, scores in zip(o.beside, others)}
    return Judgement(o.trial, score, beside, error, sigmas, floor, excess, here.dynamics.integrated)


def joined(parts: Sequence[Judgement]) -> Judgement:
    """Joint judgement of all folds; misfits are averaged over their impacts."""

    def mean(values: list[float | None]) -> float:
        known = [(value, float(part.units)) for value, part in zip(values, parts) if value is not None]
        return float(np.average([value for value, _ in known], weights=[units for _, units in known]))

    def all_of(name: str) -> Scores:
        found = [part.beside[name] for part in parts if name in part.beside]
        return np.concatenate([trial for trial, _ in found]), np.concatenate([score for _, score in found])

    names = dict.fromkeys(name for part in parts for name in part.sigmas)
    return Judgement(
        **{name: np.concatenate([getattr(part, name) for part in parts]) for name in ("trial", "score", "error")},
        beside={name: all_of(name) for name in dict.fromkeys(name for part in parts for name in part.beside)},
        sigmas={name: mean([part.sigmas.get(name) for part in parts]) for name in names},
        floor=mean([part.floor for part in parts]),
        excess=mean([part.excess for part in parts]),
        integrated=parts[0].integrated,
    )


def channel_is_material(better: Judgement, worse: Judgement, channel: str, settings: SearchSettings) -> bool:
    """Whether the held-out error of a channel falls by an amount that matters."""
    (before, floor), (after, _) = worse.misfit(channel), better.misfit(channel)
    return bool(np.isfinite(before)) and settings.matters(before, after, floor)


def is_buried(judged: Judgement, least: float) -> bool:
    """Whether the median error exceeds `least` times noise, but the mean error is less than `least` floors.

    A few episodes with an outcome that is sensitive to their start then dominate the means.
    """
    error, floor = judged.misfit(IMPACT.name)
    return judged.excess > least and error < least * floor


def spoilt_channels(judged: Judgement, than: Judgement, settings: SearchSettings) -> tuple[str, ...]:
    """Channels in which one model errs more than another one by an amount that matters.

    A misfit below noise does not count, because a better model may predict a larger one, as for episodes sensitive to
    their start.  Poses and gaps at impact are compared only if both contacts are integrated, or neither.
    """
    noise = replace(than, sigmas={name: max(square, 1.0) for name, square in than.sigmas.items()})
    error, floor = judged.misfit(IMPACT.name)

    def counts(channel: Channel) -> bool:
        if channel is IMPACT and error <= floor:
            return False
        return judged.integrated == than.integrated or not channel.of_contact

    return tuple(
        name for name, c in CHANNELS.items() if counts(c) and channel_is_material(noise, judged, name, settings)
    )
