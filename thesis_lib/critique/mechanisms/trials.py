"""Measured trials of a mechanism, as the window equations take them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from thesis_lib.critique.mechanisms.settings import EquationWindowSettings
from thesis_lib.critique.mechanisms.steps import Velocities
from thesis_lib.simulate.chapter2.noise_snr import add_noise
from thesis_lib.simulate.stepping.stepping import SimulatedMotion


@dataclass(frozen=True)
class Trial:
    """Measured motion: q, v (m+1, nv), f_ext (m, nv), and the noise `sigma` (2, nv) of q and v.

    Attributes:
        velocities: where v comes from, see `steps`.
        jitter: s, one sigma of the instant of a sample.
        mixed: by coordinate, (m+1, m+1) weights with which q was interpolated from noisy samples.
    """

    h: float
    q: np.ndarray
    v: np.ndarray
    f_ext: np.ndarray
    sigma: np.ndarray
    velocities: Velocities = "time_stepping"
    jitter: float = 0.0
    mixed: Mapping[int, np.ndarray] = field(default_factory=dict)


def measured(
    records: Sequence[SimulatedMotion], snr_db: float, rng: np.random.Generator, settings: EquationWindowSettings
) -> tuple[Trial, ...]:
    """Trials as measured at this signal-to-noise ratio; infinite: exact states."""
    trials = []
    for record in records:
        noisy = add_noise(record, snr_db, rng)
        sigma = noisy.sigma
        if not np.isfinite(snr_db):
            spread = np.stack([record.q.std(axis=0), record.v.std(axis=0)])
            sigma = spread * 10.0 ** (-settings.exact_db / 20.0)
        trials.append(Trial(record.h, noisy.q, noisy.v, record.f_ext, sigma))
    return tuple(trials)
