"""Measured data for tests: found beside the repository, skipped elsewhere (they may not be redistributed)."""

from collections.abc import Callable
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
SEARCH = (ROOT / "data" / "measured", ROOT.parent / "shared" / "data")


def _measured_folder(name: str) -> Path:
    """Folder of a measured set, as published or converted; skips the test where there is none."""
    from thesis_lib.datasets.sources.published import find_measured

    folder = find_measured(name, SEARCH)
    if folder is None:
        pytest.skip(
            f"measured data {name} not present "
            f"(python -m thesis_lib datasets fetch {name.replace('_', '-')} gets them)"
        )
    return folder


@pytest.fixture(scope="session")
def raw_folder() -> Callable[[str], Path]:
    """name -> folder with the files as published; skips the test where there is none."""

    def find(name: str) -> Path:
        folder = _measured_folder(name)
        if (folder / "dataset.yaml").is_file():
            from thesis_lib.datasets.sources.published import find_source

            folder = next(filter(None, (find_source(name, base) for base in SEARCH)), None)
            if folder is None:
                pytest.skip(f"only the converted set {name} is here, not the files as published")
        return folder

    return find


def _converted(name: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    from thesis_lib.datasets.sources.published import convert_published

    folder = _measured_folder(name)
    if (folder / "dataset.yaml").is_file():
        return folder
    return convert_published(name, folder, tmp_path_factory.mktemp("measured") / name)


@pytest.fixture(scope="session")
def planar_impact_dir(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The measured ellipse impacts as a dataset folder (do not write into it)."""
    return _converted("planar_impact", tmp_path_factory)


@pytest.fixture(scope="session")
def planar_dice_dir(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The measured dice throws as a dataset folder (do not write into it)."""
    return _converted("planar_dice", tmp_path_factory)
