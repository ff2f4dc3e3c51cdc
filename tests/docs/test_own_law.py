"""A file with a LAW in thesis_lib/contact is found by itself, and refused if its name is not that of the file."""

from pathlib import Path

import pytest

import thesis_lib.contact as package
from thesis_lib.contact import CANDIDATE_LAWS, SIX_LAWS

FILE = """
from dataclasses import replace
from thesis_lib.contact.mirtich import LAW as MIRTICH
LAW = replace(MIRTICH, name="{name}")
"""


def test_without_files_of_ones_own_the_critique_has_the_six():
    assert set(SIX_LAWS) <= set(CANDIDATE_LAWS) <= set(package.LAWS)
    assert set(CANDIDATE_LAWS) - set(SIX_LAWS) == set(package._further_laws())


def test_a_law_of_ones_own_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(package, "__path__", [*package.__path__, str(tmp_path)])
    (tmp_path / "found_law.py").write_text(FILE.format(name="found_law"))
    assert package._further_laws()["found_law"].title == "Mirtich"
    (tmp_path / "misnamed_law.py").write_text(FILE.format(name="another_law"))
    with pytest.raises(ImportError, match="give it the name of its file"):
        package._further_laws()
