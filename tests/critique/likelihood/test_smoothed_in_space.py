"""Samples in space that a filter smoothed, and contacts that last several samples: what is left out, and the noise."""

import numpy as np
import pytest

from thesis_lib.critique.likelihood.hits_in_space import observe_in_space
from thesis_lib.simulate.tosses.drawn import NOTHING, SpaceCase, make
from thesis_lib.simulate.tosses.own import OwnTosses


def observed(**drawn):
    """The hits of a ball in our own simulator, with what is `drawn` in place of what the seed draws."""
    usual = {"tosses": 40, "rate": 240.0, "contact_time": 4e-4, "position": 2e-4, "rotation": 2e-3}
    case = SpaceCase("own", NOTHING, 5)
    with pytest.MonkeyPatch.context() as patch:
        for name, value in (usual | drawn).items():
            patch.setitem(case.drawn, name, value)
        return observe_in_space(make(case, OwnTosses()), episodes=False)


@pytest.mark.slow
def test_noise_of_smoothed_samples_is_that_before_the_filter():
    # 50 Hz leave neighbours that differ by a fifth of the noise
    plain, smooth = observed(), observed(filter="zero_phase_butterworth", cutoff=50.0, irregular=0.0)
    assert any("as if the samples were smoothed" in text for text in smooth.found.warnings)
    assert not plain.found.warnings
    spread = [np.sqrt(np.median(np.einsum("nsii->nsi", o.cov)[:, 0, [1, 7]], axis=0)) for o in (plain, smooth)]
    assert np.all(spread[1] > 0.8 * spread[0]) and np.all(spread[1] < 2.0 * spread[0])  # velocity and spin
    assert len(smooth) > 0.7 * len(plain) and len(smooth.flights) > 0.7 * len(plain.flights)


@pytest.mark.slow
def test_samples_within_a_long_contact_belong_to_no_flight():
    short, long = observed(rate=500.0), observed(rate=500.0, contact_time=3e-3)
    nearest = [np.abs(o.nodes).min(axis=(1, 2)) for o in (short, long)]
    assert np.quantile(nearest[0], 0.1) < 1.2e-3 < np.min(nearest[1])
