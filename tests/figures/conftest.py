"""The small study, made once."""

from types import SimpleNamespace

import pytest
from small_study import small_study


@pytest.fixture(scope="session")
def study() -> SimpleNamespace:
    return small_study()
