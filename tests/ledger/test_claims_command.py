"""The command line: check, update and page, their exit statuses and what they print."""

import pandas as pd
import pytest

from thesis_lib.foundation.files import write_table
from thesis_lib.thesis.commands.claims import main
from thesis_lib.thesis.records import catalogue
from thesis_lib.thesis.records.record import Figure, Job, Tolerance

FIGURE = Figure(
    name="figure_3_8",
    job=Job("draw", "chapter3/{dataset}", datasets=("planar_impact",)),
    title="x",
    tolerances={"error": Tolerance("solver tolerance", abs=0.01)},
)


@pytest.fixture
def command(tmp_path, results, write_ledger, entries, monkeypatch):
    """Run the command line on the synthetic results; returns the exit status."""
    write_ledger(entries)
    monkeypatch.setattr(catalogue, "figures", lambda: [FIGURE])
    figure = results / "chapter3" / "planar_impact" / "figure_3_8.csv"
    write_table(pd.DataFrame({"error": [0.1, 0.2, 0.3]}), figure)

    def command(name, scale="quick"):
        arguments = [name, "--results", results, "--ledger", tmp_path / "claims.yaml"]
        arguments += ["--scale", scale] if scale else []
        if name != "page":
            arguments += ["--expected", tmp_path / "expected.yaml", "--stored", tmp_path / "stored"]
        return main(list(map(str, arguments)))

    return command


def test_update_then_check(command, capsys):
    assert command("check") == 1
    text = capsys.readouterr().out
    assert "9 changed" in text
    assert "store it: thesis-lib claims update" in text
    assert "claims update --scale quick" in text

    assert command("update") == 0
    text = capsys.readouterr().out
    assert "table_3_1.abs: new → reproduced" in text
    assert "figure_3_8.csv: new" in text

    assert command("check") == 0
    text = capsys.readouterr().out
    assert "9 claims: 9 reproduced, 0 deviate, 0 without data." in text
    assert "no change" in text
    assert "1 agrees" in text

    assert command("update") == 0
    assert capsys.readouterr().out == "Nothing to update.\n"


FIGURE_FILE, TABLE, DATASETS = "chapter3/planar_impact/figure_3_8.csv", "chapter3/table.csv", "datasets/present.json"


@pytest.mark.parametrize(
    ("files", "status", "words"),
    [
        (
            {TABLE: ("0.065,0.002", "0.0721,0.002")},
            1,
            ["table_3_1.abs: was reproduced, now deviates", "published 0.062, ours 0.0721"],
        ),
        ({FIGURE_FILE: ("0.2\n", "0.22\n")}, 1, ["figure_3_8 (planar_impact): column error: 1 of 3 rows differ"]),
        ({TABLE: None}, 1, ["table_3_1.abs: could not be compared"]),
        (
            {TABLE: None, FIGURE_FILE: None, DATASETS: ('true, "trials', 'false, "trials')},
            0,
            ["9 without data", "1 data not present"],
        ),
    ],
)
def test_check_fails_when_something_changes_or_nothing_is_compared_but_not_without_the_data(
    command, results, capsys, files, status, words
):
    command("update")
    for name, change in files.items():
        path = results / name
        path.write_text(path.read_text().replace(*change)) if change else path.unlink()
    capsys.readouterr()
    assert command("check") == status
    said = capsys.readouterr().out
    assert all(word in said for word in words)


def test_update_is_all_or_nothing(command, results, tmp_path, capsys):
    (results / "chapter3" / "table.csv").unlink()
    assert command("update") == 2
    assert "9 claims could not be compared" in capsys.readouterr().err
    assert not (tmp_path / "stored").exists()
    assert not (tmp_path / "expected.yaml").exists()


def test_page(command, results, capsys):
    assert command("page") == 0
    assert "Claims ledger" in (results / "claims.html").read_text(encoding="utf-8")
    assert len(pd.read_csv(results / "claims.csv")) == 9
    of_quick = (results / "claims.html").read_bytes()
    (results / "provenance.json").write_text('{"scale": "quick"}', encoding="utf-8")
    assert command("page", scale=None) == 0
    assert (results / "claims.html").read_bytes() == of_quick

    (results / "chapter3" / "table.csv").unlink()
    assert command("page") == 2  # the page still shows what is wrong
    assert "could not be compared" in capsys.readouterr().err
    assert "! error" in (results / "claims.html").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ('{"planar_impact": true}', "should look like"),
        ('{"planar_impact": {"present": "yes"}}', "should look like"),
        ("[]", "expected keys and values"),
        ("{", "not valid JSON"),
        (None, "does not exist"),
    ],
)
def test_a_bad_list_of_datasets_is_one_readable_error(command, results, capsys, content, words):
    path = results / "datasets" / "present.json"
    path.unlink() if content is None else path.write_text(content)
    assert command("check") == 2
    captured = capsys.readouterr()
    assert words in captured.err
    assert "Traceback" not in captured.err
