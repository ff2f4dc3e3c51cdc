"""Notebooks run, and show what is stored in them."""

import os
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient
from tutorial_runner import ROOT, compare

NOTEBOOKS = ROOT / "notebooks"


def test_each_notebook_is_tested_and_on_a_page():
    assert {path.stem for path in NOTEBOOKS.glob("*.ipynb")} == {"misfit_to_cause", "thrown_cube"}
    index = (ROOT / "docs" / "README.md").read_text(encoding="utf-8")
    assert all(f"../notebooks/{path.name}" in index for path in NOTEBOOKS.glob("*.ipynb"))


@pytest.mark.slow
def test_from_a_misfit_to_its_cause(tmp_path, monkeypatch):
    shows_what_is_stored("misfit_to_cause", tmp_path, monkeypatch)


@pytest.mark.slow
def test_the_cube_of_the_field(contactnets_cube_dir, tmp_path, monkeypatch):
    (tmp_path / "data" / "measured").mkdir(parents=True)
    (tmp_path / "data" / "measured" / "contactnets_cube").symlink_to(contactnets_cube_dir.resolve())
    shows_what_is_stored("thrown_cube", tmp_path, monkeypatch)


def shows_what_is_stored(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Run a notebook beside `data/`, and compare what its cells print, and which of them show a picture."""
    path = [str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])]
    for key, value in {"PYTHONPATH": os.pathsep.join(path), "OMP_NUM_THREADS": "1"}.items():
        monkeypatch.setenv(key, value)
    stored = nbformat.read(NOTEBOOKS / f"{name}.ipynb", as_version=4)
    ran = nbformat.read(NOTEBOOKS / f"{name}.ipynb", as_version=4)
    (tmp_path / "notebooks").mkdir()
    place = {"metadata": {"path": tmp_path / "notebooks"}}
    # a busy machine may send what one cell prints in two pieces
    NotebookClient(ran, timeout=1200, resources=place, coalesce_streams=True).execute()
    for was, now in zip(stored.cells, ran.cells, strict=True):
        if was.cell_type == "code":
            assert shown(was) or "along_throws(cube)" in was.source, f"nothing is stored of {was.source!r}"
            for said, printed in zip(shown(was), shown(now), strict=True):
                compare(said, printed)


def shown(cell: nbformat.NotebookNode) -> list[str]:
    """What a cell prints or shows: text, or that it is a picture."""
    parts = []
    for output in cell.outputs:
        data = output.get("data", {})
        parts.append("a picture" if "image/png" in data else data.get("text/plain", output.get("text", "")))
    return parts
