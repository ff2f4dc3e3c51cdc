"""The README's table holds what the benchmarks wrote, and nothing outside its markers changes."""

import os

import pandas as pd

from benchmarks.results import Results
from benchmarks.table import BEGIN, END, main


def written(folder):
    results = Results("laws")
    results.add("mirtich, batched", 12.3456789, "million a second", "a | b")
    results.add("what could not be measured", float("nan"))
    results.write(folder / "laws.csv")
    other = Results("zeta")
    other.add("ratio", 1234.5678)
    other.write(folder / "zeta.csv")
    return folder


def test_rows_are_rounded_and_kept_in_order(tmp_path):
    rows = pd.read_csv(written(tmp_path) / "laws.csv")
    assert list(rows["value"][:1]) == [12.35] and rows["value"].isna().tolist() == [False, True]


def test_table_replaces_what_stands_between_its_markers(tmp_path, capsys):
    readme = tmp_path / "README.md"
    readme.write_text(f"above\n{BEGIN}\nold\n{END}\nbelow\n")
    assert main([str(written(tmp_path)), "--write", str(readme)]) == 0
    text = readme.read_text()
    assert text.startswith(f"above\n{BEGIN}\nMeasured on ") and text.endswith(f"{END}\nbelow\n") and "old" not in text
    assert "| laws | mirtich, batched | 12.3 | million a second | a \\| b |" in text
    assert "| laws | what could not be measured |  |  |  |" in text
    assert text.index("| laws |") < text.index("| zeta | ratio | 1,235 |")
    os.utime(tmp_path / "laws.csv", (1.7636e9, 1.7636e9))  # 2025-11-20
    os.utime(tmp_path / "zeta.csv", (1.76375e9, 1.76375e9))
    assert main([str(tmp_path), "--write", str(readme)]) == 0 and "2025-11-20 to 2025-11-21" in readme.read_text()
    again = readme.read_text()
    assert main([str(tmp_path), "--write", str(readme)]) == 0 and readme.read_text() == again


def test_file_without_markers_is_left_alone(tmp_path, capsys):
    readme = tmp_path / "README.md"
    readme.write_text(f"above\n{END}\n{BEGIN}\n")
    assert main([str(written(tmp_path)), "--write", str(readme)]) == 1
    assert BEGIN in capsys.readouterr().err and readme.read_text() == f"above\n{END}\n{BEGIN}\n"


def test_folder_without_benchmarks_is_named(tmp_path, capsys):
    assert main([str(tmp_path)]) == 1
    assert str(tmp_path) in capsys.readouterr().err
