"""The command that prints a chapter's tables."""

import re

import pandas as pd
import pytest

from thesis_lib.foundation.columns import explain
from thesis_lib.foundation.files import write_table
from thesis_lib.thesis.commands.tables import CHAPTERS, chapters, tables


def test_every_chapter_with_tables_can_be_asked_for():
    assert tuple(chapters()) == CHAPTERS


def test_values_and_meanings_are_printed(tmp_path, capsys):
    for k, shown in enumerate(chapters()["chapter2"]):
        row = {column: [1000 * k + i] for i, column in enumerate(shown["columns"].split())}
        write_table(pd.DataFrame(row), tmp_path / shown["file"])
    assert tables(["chapter2", "--results", str(tmp_path)]) == 0
    said = capsys.readouterr().out
    for k, shown in enumerate(chapters()["chapter2"]):
        assert shown["title"] in said
        assert re.search(r"\s+".join(str(1000 * k + i) for i in range(len(shown["columns"].split()))), said)
        for meaning in explain(shown["file"].split("/")[-1].removesuffix(".csv"), shown["columns"].split())["meaning"]:
            assert meaning in said


@pytest.mark.parametrize("chapter", CHAPTERS)
def test_missing_results_are_said_with_the_command_that_makes_them(chapter, tmp_path, capsys):
    assert tables([chapter, "--results", str(tmp_path)]) == 2
    assert f"snakemake --cores 2 {chapter}" in capsys.readouterr().err
