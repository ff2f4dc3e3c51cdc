"""Three small critiques, made once: nothing hidden, a mechanism hidden in drops, a law injected into impacts."""

import numpy as np
import pytest
from hidden_effects import ANISOTROPY, E_T, injected_impacts, simulated

from thesis_lib.critique.criticise import Critique, criticise
from thesis_lib.datasets.dataset import Dataset


@pytest.fixture(scope="session")
def nothing_hidden() -> Critique:
    return criticise(simulated("nothing_hidden", 1), rng=np.random.default_rng(0))


@pytest.fixture(scope="session")
def hidden_drops() -> Critique:
    """Friction that depends on the direction, hidden in trajectories."""
    return criticise(
        simulated("hidden_drops", 1, friction_anisotropy=ANISOTROPY), rng=np.random.default_rng(0)
    )


@pytest.fixture(scope="session")
def impacts_dataset() -> Dataset:
    """Tangential restitution, injected into impacts without trajectories."""
    return injected_impacts(
        "hidden_impacts", 80, 3, "tangential_restitution", {"tangential_restitution.e_t": E_T}
    )


@pytest.fixture(scope="session")
def hidden_impacts(impacts_dataset: Dataset) -> Critique:
    return criticise(impacts_dataset, rng=np.random.default_rng(0))
