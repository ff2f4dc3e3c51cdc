"""Measurement noise with a given signal-to-noise ratio on simulated states (thesis 2.4, table 2.1).

    σ_i² = var(channel i) / 10^(SNR/10)

Each coordinate of q and v of each record is a channel; var is its variance over the record.  A constant channel gets no
noise.
"""

from dataclasses import dataclass

import numpy as np

from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.stepping.stepping import SimulatedMotion


@dataclass(frozen=True)
class NoisyStates:
    """Noisy states q, v (m+1, nv) of a record.

    `sigma` (2, nv) holds the true standard deviations σ of the noise on q and v, which an estimator does not need.
    """

    q: np.ndarray
    v: np.ndarray
    sigma: np.ndarray


def add_noise(record: SimulatedMotion, snr_db: float, rng: np.random.Generator) -> NoisyStates:
    """Add Gaussian noise at `snr_db` in dB to q and v of a record, independent in every sample and channel.

    Raises:
        UserError: the ratio is NaN or minus infinity, or the record contains a step that was not solved.
    """
    if np.isnan(snr_db) or snr_db == -np.inf:
        raise UserError(f"A signal-to-noise ratio is a number in dB, or infinite for no noise; got {snr_db}.")
    if not (np.isfinite(record.q).all() and np.isfinite(record.v).all()):
        raise UserError(
            "Noise cannot be added to a record with a step that was not solved. Check its status, and omit the record "
            "or cut it with `SimulatedMotion.window`."
        )
    sigma = np.stack([record.q.std(axis=0), record.v.std(axis=0)]) * 10.0 ** (-snr_db / 20.0)
    noise = rng.standard_normal((2, *record.q.shape)) * sigma[:, None, :]
    return NoisyStates(record.q + noise[0], record.v + noise[1], sigma)
