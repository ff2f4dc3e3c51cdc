"""The library is as it was after each test; a folder with a user's file."""

from pathlib import Path

import own_files
import pytest
from own_files import library  # noqa: F401 -- for all tests here


@pytest.fixture
def own_effect(tmp_path: Path) -> Path:
    path = tmp_path / "mine" / "my_effects.py"
    path.parent.mkdir()
    path.write_text(own_files.EFFECT, encoding="utf-8")
    return path
