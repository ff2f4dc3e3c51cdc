"""The library is as it was after each test; a folder with a user's file."""

from collections.abc import Iterator
from pathlib import Path

import own_files
import pytest

from thesis_lib.contact import LAWS
from thesis_lib.effects import EFFECTS
from thesis_lib.extensions import registry


@pytest.fixture(autouse=True)
def library() -> Iterator[None]:
    kept = [(mapping, dict(mapping)) for mapping in (EFFECTS, LAWS, registry._ADDED)]
    yield
    for mapping, content in kept:  # in its order, which other tests see
        mapping.clear()
        mapping.update(content)


@pytest.fixture
def own_effect(tmp_path: Path) -> Path:
    path = tmp_path / "mine" / "my_effects.py"
    path.parent.mkdir()
    path.write_text(own_files.EFFECT, encoding="utf-8")
    return path
