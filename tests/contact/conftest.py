"""Random impacts for the tests of the impact laws."""

import pytest

from thesis_lib.extensions import law_contract
from thesis_lib.extensions.impact_draws import ImpactDraws


@pytest.fixture(scope="session")
def draw() -> ImpactDraws:
    return law_contract.reference()


@pytest.fixture(scope="session")
def central() -> ImpactDraws:
    return law_contract.reference(central=True)
