"""`thesis-lib figures`: every figure is listed and found by any of its names."""

import pytest

from thesis_lib.__main__ import main
from thesis_lib.foundation.errors import UserError
from thesis_lib.thesis.commands.tables import find_figure


def test_captions_are_those_of_the_dataset():
    eight = find_figure("3-8")
    assert "Figure 3-8 of the thesis (drops)." in eight.text("drops")
    assert eight.text("drops") != eight.text("planar_dice").replace("planar_dice", "drops")


@pytest.mark.parametrize("asked", ["3-8", "3.8", "Figure 3-8", "figure_3_8.png", "fig. 3.8"])
def test_a_figure_is_found_by_any_of_its_names(asked):
    assert find_figure(asked).name == "figure_3_8"


def test_an_unknown_figure_is_refused_with_those_that_are_alike(capsys):
    with pytest.raises(UserError, match=r"no figure '3-88'; did you mean '3-8'"):
        find_figure("3-88")
    assert main(["figures", "3-8", "--dataset", "moon"]) == 2
    assert "it has planar_impact, planar_dice, drops" in capsys.readouterr().err


def test_the_list_and_one_figure_as_text(tmp_path, capsys):
    made = tmp_path / "chapter3/drops/figure_3_8.png"
    made.parent.mkdir(parents=True)
    made.touch()
    assert main(["figures", "--results", str(tmp_path)]) == 0
    text = capsys.readouterr().out
    assert f"{tmp_path}/chapter3/{{planar_impact,planar_dice,drops}}/figure_3_8.png" in text
    assert f"{tmp_path}/chapter4/planar_dice/figure_4_8.png" in text
    assert "not made yet: planar_impact, planar_dice\n" in text
    assert main(["figures", "3-8", "--results", str(tmp_path)]) == 0
    text = capsys.readouterr().out
    assert f"{made}\n    snakemake --cores 2 results/chapter3/drops/figure_3_8.png\n" in text
    assert "of the thesis (drops)" in text  # the dataset whose picture is there


def test_what_a_run_found_stands_below_the_caption(tmp_path):
    eight = find_figure("3-8")
    assert "Found in this run" not in eight.text("drops", tmp_path)
    finding = tmp_path / "chapter3/drops/figure_3_8.txt"
    finding.parent.mkdir(parents=True)
    finding.write_text("The bound is 0.004 m/s.\n")
    assert eight.text("drops", tmp_path).endswith("Found in this run: The bound is 0.004 m/s.")
