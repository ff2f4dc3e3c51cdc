"""The small study, made once."""

import pytest
from small_study import Study, small_study


@pytest.fixture(scope="session")
def study() -> Study:
    return small_study()
