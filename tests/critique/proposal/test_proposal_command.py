"""Unexplained, proposed, written, added with --effects: the error falls; and where the file may not lie."""

import json
from pathlib import Path

import pytest
from hidden_effects import injected_impacts

from tests.extensions.own_files import library  # noqa: F401 -- effects that a test adds are forgotten after it
from thesis_lib.__main__ import main
from thesis_lib.critique.proposal.effect_file import effect_of
from thesis_lib.critique.proposal.results import proposal_path
from thesis_lib.critique.proposal.terms import all_terms
from thesis_lib.datasets.format.write import write_dataset

HIDDEN, SIZE = "restitution_by_obliquity", -0.4


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    effect = effect_of(next(term for term in all_terms() if term.name == HIDDEN))
    folder = tmp_path_factory.mktemp("drops") / "hidden"
    write_dataset(injected_impacts("hidden", 100, 3, effect, {f"{HIDDEN}.a": SIZE}), folder)
    return folder


@pytest.mark.slow
@pytest.mark.usefixtures("without_pictures")
def test_from_unexplained_to_a_law_that_has_a_form(
    data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert main(["critique", str(data), "-o", str(out), "-q"]) == 0
    told = capsys.readouterr().out
    first = json.loads((out / "diagnosis.json").read_text(encoding="utf-8"))
    file = tmp_path / "out_proposal.py"
    assert first["verdict"] == "unexplained" and first["proposal"]["terms"][0]["name"] == HIDDEN
    assert first["proposal"]["file"] == file.name and file == proposal_path(out)
    assert "ε = ε₀ (1 + a |v_t|/v)" in told and f"--effects {file}" in told
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "A term that is proposed" in page and "|v_t|/v" in page

    assert main(["effects", "--check", str(file)]) == 0
    assert main(["critique", str(data), "-o", str(tmp_path / "with"), "-q", "--effects", str(file)]) == 0
    second = json.loads((tmp_path / "with" / "diagnosis.json").read_text(encoding="utf-8"))
    assert second["verdict"] == "effects" and [effect["name"] for effect in second["effects"]] == [HIDDEN]
    assert second["effects"][0]["parameters"]["a"]["value"] == pytest.approx(SIZE, rel=0.05)
    assert second["error"]["augmented"] == pytest.approx(first["proposal"]["error"]["after"], rel=0.05)
    assert second["error"]["augmented"] < 0.5 * second["error"]["base"]
    assert "proposal" not in second


def test_a_file_in_a_folder_with_data_is_refused(data: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["critique", str(data), "--propose", str(data / "own.py"), "-q"]) == 2
    assert "a folder with data" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--propose", "own.txt"], "ends in .py"),
        (["--propose", "own.py", "--batch"], "give one dataset"),
        (["--propose", "there.py"], "exists already"),
    ],
)
def test_what_cannot_be_written_is_said_before_anything_is_computed(
    options: list[str],
    said: str,
    data: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "there.py").write_text("mine = 1\n", encoding="utf-8")
    assert main(["critique", str(data), *options, "-q"]) == 2
    assert said in capsys.readouterr().err
    assert (tmp_path / "there.py").read_text(encoding="utf-8") == "mine = 1\n"


def test_the_file_lies_beside_the_results(tmp_path: Path) -> None:
    assert proposal_path(tmp_path / "a" / "my_drops").name == "my_drops_proposal.py"
    assert proposal_path(tmp_path / "a" / "my_drops").parent == tmp_path / "a"
    (tmp_path / "drops").mkdir()
    (tmp_path / "drops" / "dataset.yaml").write_text("schema: 1\n")  # -o inside the dataset itself
    assert proposal_path(tmp_path / "drops" / "out" / "first") == tmp_path / "first_proposal.py"
