"""Random impacts for the tests of the impact laws."""

import numpy as np
import pytest
from impact_draws import Impacts, reference_draw

N_REFERENCE = 20_000  # as in the published constraint summary that the rates are compared with


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(20180608)


@pytest.fixture(scope="session")
def draw() -> Impacts:
    return reference_draw(np.random.default_rng(1), N_REFERENCE)


@pytest.fixture(scope="session")
def central() -> Impacts:
    return reference_draw(np.random.default_rng(2), N_REFERENCE, central=True)
