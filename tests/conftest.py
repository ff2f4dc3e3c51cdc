"""One thread a process, measured data, and which tests share a process.

Measured data are not ours to pass on: tests that need them are skipped where they are neither in data/measured nor,
as published, in the folder that the variable PUBLISHED_DATA names.
"""

import argparse
import os
import re
import zlib

# as in the pipeline, and before numpy reads it; on a busy machine threads of BLAS and torch wait for each other
os.environ["OMP_NUM_THREADS"] = "1"

import thesis_lib  # noqa: F401 -- asks for the common kernels

# isort: split
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parent.parent
SEARCH = [ROOT / "data" / "measured", *map(Path, filter(None, [os.environ.get("PUBLISHED_DATA")]))]
# fixtures: tests that use them are marked `measured`
MEASURED = {"raw_folder", "planar_impact_dir", "planar_dice_dir", "contactnets_cube_dir"}
# these share critiques that take longest: one process makes them (tests/critique/conftest.py, test_contact_time.py)
TOGETHER = tuple(f"tests/critique/{room}/" for room in ("commands", "drops", "report", "results", "selection"))


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: object) -> object:
    """With several processes a file stays in one, and `TOGETHER` too; files with slow tests start first."""
    from xdist.scheduler.loadfile import LoadFileScheduling

    class ByFile(LoadFileScheduling):
        def _split_scope(self, nodeid: str) -> str:
            return TOGETHER[0] if nodeid.startswith(TOGETHER) else super()._split_scope(nodeid)

    config.option.loadscopereorder = False  # by number of tests
    return ByFile(config, log)


def _part(text: str) -> tuple[int, int]:
    """(K, N) of "K/N"; raises ArgumentTypeError."""
    if not (found := re.fullmatch(r"([1-9]\d*)/([1-9]\d*)", text)) or int(found[1]) > int(found[2]):
        raise argparse.ArgumentTypeError(f"{text!r} is not K/N with K from 1 to N, as in 1/3")
    return int(found[1]), int(found[2])


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--slow-part", type=_part, metavar="K/N", help="of the slow tests the K-th of N parts; together N parts are all"
    )


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    for item in items:
        if MEASURED & set(getattr(item, "fixturenames", ())):
            item.add_marker("measured")
    if part := config.getoption("slow_part"):
        k, n = part
        other = {i for i in items if i.get_closest_marker("slow") and zlib.crc32(i.nodeid.encode()) % n != k - 1}
        config.hook.pytest_deselected(items=list(other))
        items[:] = [item for item in items if item not in other]
    if "PYTEST_XDIST_WORKER" in os.environ:
        slow = {item.path for item in items if item.get_closest_marker("slow")}
        items.sort(key=lambda item: item.path not in slow)


@pytest.fixture
def rng() -> np.random.Generator:
    """A fixed stream for each test."""
    return np.random.default_rng(20180612)


def _measured(name: str, converted: bool = True) -> Path:
    """Folder of a measured set, as published or, where allowed, converted; skips the test where there is none."""
    from thesis_lib.datasets.sources.published import find_source

    for base in SEARCH:
        if converted and (base / name / "dataset.yaml").is_file():
            return base / name
        if (folder := find_source(name, base)) is not None:
            return folder
    fetch = f"thesis-lib datasets fetch {name.replace('_', '-')}"
    pytest.skip(f"measured data {name} not present ({fetch} gets them)")


@pytest.fixture(scope="session")
def raw_folder() -> Callable[[str], Path]:
    """name -> folder with the files as published; skips the test where there is none."""
    return lambda name: _measured(name, converted=False)


def _converted(name: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    from thesis_lib.datasets.sources.published import convert_published

    folder = _measured(name)
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


@pytest.fixture(scope="session")
def contactnets_cube_dir(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The measured tosses of a cube as a dataset folder (do not write into it)."""
    return _converted("contactnets_cube", tmp_path_factory)
