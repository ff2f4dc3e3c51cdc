"""`python -m thesis_lib figures`: every figure is listed, found by any of its names, and has a rule that makes it."""

import re
from pathlib import Path

import pytest

from thesis_lib.__main__ import main
from thesis_lib.foundation.errors import UserError
from thesis_lib.report.figure_list import find_figure, listed_figures

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture
def figures(monkeypatch):
    monkeypatch.chdir(ROOT)
    return listed_figures()


def test_every_figure_has_a_caption_a_title_and_a_rule_that_makes_it(figures):
    rules = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "workflow/rules").glob("*.smk"))
    for figure in figures:
        number = figure.name
        assert figure.title and not re.search(r"[*{}]|thesis\.", figure.title), number
        for dataset in figure.files:
            text = figure.caption_text(dataset)
            assert "{%" not in text and "**" not in text and "``" not in text, number
        assert f'"{number.removeprefix("table_").replace("_", "-")}"' in rules or number in rules, number


def test_captions_are_those_of_the_figure_and_the_dataset(figures):
    names = [figure.name for figure in figures]
    assert names.index("3-8") < names.index("3-10") < names.index("4-1")
    for name, caption in (("3-8", "figure_3_8"), ("paired", "jenga_paired"), ("hidden", "hidden_effects")):
        assert find_figure(name, figures).caption.stem == caption
    eight = find_figure("3-8", figures)
    assert "Figure 3-8 of the thesis (drops)." in eight.caption_text("drops")
    assert eight.caption_text("drops") != eight.caption_text("planar_dice").replace("planar_dice", "drops")


@pytest.mark.parametrize("asked", ["3-8", "3.8", "Figure 3-8", "figure_3_8.png", "fig. 3.8"])
def test_a_figure_is_found_by_any_of_its_names(asked, figures):
    assert find_figure(asked, figures).name == "3-8"


def test_an_unknown_figure_is_refused_with_those_that_are_alike(figures, capsys):
    with pytest.raises(UserError, match=r"no figure '3-88'; did you mean 3-8"):
        find_figure("3-88", figures)
    assert main(["figures", "3-8", "--dataset", "moon"]) == 2
    assert "it has planar_impact, planar_dice, drops" in capsys.readouterr().err


def test_the_list_and_one_figure_as_text(figures, tmp_path, capsys):
    made = tmp_path / "chapter3/drops/figure_3_8.png"
    made.parent.mkdir(parents=True)
    made.touch()
    assert main(["figures", "--results", str(tmp_path)]) == 0
    text = capsys.readouterr().out
    assert f"{tmp_path}/chapter3/{{planar_impact,planar_dice,drops}}/figure_3_8.png" in text
    assert "not made yet: planar_impact, planar_dice\n" in text
    assert main(["figures", "3-8", "--results", str(tmp_path)]) == 0
    text = capsys.readouterr().out
    assert f"{made}\n    snakemake --cores 2 results/chapter3/drops/figure_3_8.png\n" in text
    assert "of the thesis (drops)" in text  # the dataset whose picture is there


def test_figures_outside_the_repository_say_where_to_run(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["figures"]) == 2
    assert "root folder of the repository" in capsys.readouterr().err


def test_what_a_run_found_stands_below_the_caption(figures, tmp_path):
    eight = find_figure("3-8", figures)
    assert "Found in this run" not in eight.caption_text("drops", tmp_path)
    finding = tmp_path / "chapter3/drops/figure_3_8.txt"
    finding.parent.mkdir(parents=True)
    finding.write_text("The bound is 0.004 m/s.\n")
    assert eight.caption_text("drops", tmp_path).endswith("Found in this run: The bound is 0.004 m/s.")
