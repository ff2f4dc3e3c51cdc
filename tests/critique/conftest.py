"""Three small critiques and a report, made once.

Nothing is hidden, a mechanism is hidden in drops, a law is injected into impacts; the report is of the second.
"""

import copy

import numpy as np
import pandas as pd
import pytest
from hidden_effects import ANISOTROPY, E_T, injected_impacts, simulated
from report_pages import DIAGNOSIS, leave_page_out, page_of

from thesis_lib.critique.drops.criticise import DropsCritique, criticise_drops
from thesis_lib.critique.drops.questions.where import where
from thesis_lib.critique.result import OfDrops
from thesis_lib.critique.results.tables import tables
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.figures.critique.pictures import pictures

LONG = {"nothing_hidden", "hidden_drops"}  # fixtures: critiques of about 10 s


@pytest.hookimpl(tryfirst=True)  # before tests are chosen by their marks
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if LONG & set(getattr(item, "fixturenames", ())):
            item.add_marker(pytest.mark.slow)


@pytest.fixture
def without_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Critiques are saved without their pictures, which take longer than all else that is saved."""
    monkeypatch.setattr("thesis_lib.figures.critique.pictures.pictures", lambda *args: {})


@pytest.fixture
def without_page(monkeypatch: pytest.MonkeyPatch) -> None:
    leave_page_out(monkeypatch)


@pytest.fixture(scope="session")
def nothing_hidden() -> DropsCritique:
    return criticise_drops(simulated("nothing_hidden", 1), rng=np.random.default_rng(0))


@pytest.fixture(scope="session")
def hidden_drops() -> DropsCritique:
    """Friction that depends on the direction, hidden in trajectories."""
    return criticise_drops(simulated("hidden_drops", 1, friction_anisotropy=ANISOTROPY), rng=np.random.default_rng(0))


@pytest.fixture(scope="session")
def impacts_dataset() -> Dataset:
    """Tangential restitution, injected into impacts without trajectories."""
    return injected_impacts("hidden_impacts", 80, 3, "tangential_restitution", {"tangential_restitution.e_t": E_T})


@pytest.fixture(scope="session")
def hidden_impacts(impacts_dataset: Dataset) -> DropsCritique:
    return criticise_drops(impacts_dataset, rng=np.random.default_rng(0))


@pytest.fixture(scope="session")
def of_impacts(hidden_impacts: DropsCritique) -> OfDrops:
    return OfDrops(hidden_impacts, np.random.default_rng(0))


@pytest.fixture(scope="session")
def drops_regions(hidden_drops: DropsCritique) -> dict:
    """Where the critique of hidden drops fails."""
    return where(hidden_drops, np.random.default_rng(0))


@pytest.fixture(scope="session")
def drops_tables(hidden_drops: DropsCritique) -> dict[str, pd.DataFrame]:
    return tables(hidden_drops, np.random.default_rng(0))


@pytest.fixture(scope="session")
def nothing_tables(nothing_hidden: DropsCritique) -> dict[str, pd.DataFrame]:
    return tables(nothing_hidden, np.random.default_rng(0))


@pytest.fixture(scope="session")
def made(hidden_drops, drops_regions, drops_tables):
    """Critique of hidden drops, where it fails, its tables and its pictures."""
    return hidden_drops, drops_regions, drops_tables, pictures(hidden_drops, drops_tables, drops_regions)


@pytest.fixture(scope="session")
def html(made):
    """The page of the made-up diagnosis with those pictures."""
    return page_of(made, copy.deepcopy(DIAGNOSIS))
