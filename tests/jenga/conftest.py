"""Tests of chapter 5, a folder a room; what several rooms share stands here and beside."""

import numpy as np
import pytest


@pytest.fixture(scope="session")
def learned():
    """The hierarchical learner, of 600 samples of made pushes."""
    from pushes_for_tests import FAST, make_samples

    from thesis_lib.jenga.learners.hma import Hma

    return Hma(FAST).fit(make_samples(600, np.random.default_rng(0))[0], np.random.default_rng(1))


@pytest.fixture(scope="session")
def held():
    """1500 samples of other pushes."""
    from pushes_for_tests import make_samples

    return make_samples(1500, np.random.default_rng(3))[0]
