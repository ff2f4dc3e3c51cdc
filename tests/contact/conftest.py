"""Random impacts for the tests of the impact laws."""

import numpy as np
import pytest

from thesis_lib.extensions import law_contract
from thesis_lib.extensions.impact_draws import ImpactDraws


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(20180608)


@pytest.fixture(scope="session")
def draw() -> ImpactDraws:
    return law_contract.reference()


@pytest.fixture(scope="session")
def central() -> ImpactDraws:
    return law_contract.reference(central=True)
