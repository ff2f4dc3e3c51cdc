"""Result files: whole or not at all, the same bytes for the same content, and errors that name the remedy."""

import ast
import os
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from thesis_lib.foundation.errors import CorruptFileError, UserError
from thesis_lib.foundation.files import atomic, read_json, read_table, write_json, write_table, write_text

ROOT = Path(__file__).resolve().parent.parent
WRITERS = {"to_csv", "to_parquet", "savefig", "np.save", "np.savez", "np.savez_compressed", "torch.save", "json.dump"}
WRITERS |= {"write_text", "write_bytes", "copyfile", "copy2"}
# what of these is allowed outside `with atomic(...)` in a module, because
ALLOWED = {
    "thesis_lib/commands/model.py": "to_csv",  # standard output
    "thesis_lib/foundation/rows.py": "to_csv",  # text for write_text, as in the next two
    "thesis_lib/studies/proof/direct_fits.py": "to_csv",
    "thesis_lib/studies/proof/measured.py": "to_csv",
    "thesis_lib/figures/style.py": "savefig",  # into memory, for the page and the file
    "thesis_lib/datasets/sources/motion_capture/own_process.py": "np.savez",  # into a pipe
    "thesis_lib/foundation/isolated.py": "write_text",  # into /proc
    "thesis_lib/foundation/provenance.py": "write_text",  # under a name of its own
    "thesis_lib/datasets/sources/fetch.py": "write_bytes",  # into a temporary folder
    "thesis_lib/datasets/sources/published_tosses.py": "write_bytes",  # into a temporary folder
}


@pytest.fixture
def table() -> pd.DataFrame:
    return pd.DataFrame({"trial": [2, 7], "mu": [1.0 / 3.0, np.nan], "law": ["mirtich", "wang_mason"]})


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


class TestAtomic:
    @pytest.mark.parametrize("failure", [RuntimeError, KeyboardInterrupt])
    def test_failure_keeps_the_old_file_and_leaves_nothing_behind(self, tmp_path, failure):
        target = tmp_path / "a.csv"
        target.write_text("old")
        with pytest.raises(failure), atomic(target) as tmp:
            tmp.write_text("half")
            raise failure
        assert target.read_text() == "old"
        assert names(tmp_path) == ["a.csv"]

    def test_target_appears_only_when_the_block_is_done(self, tmp_path):
        target = tmp_path / "deep" / "folder" / "a.csv"
        with atomic(target) as tmp:
            tmp.write_text("new")
            assert not target.exists()
            assert tmp.suffix == ".csv"  # writers choose the format by suffix
        assert target.read_text() == "new"
        assert names(target.parent) == ["a.csv"]

    def test_leftover_of_a_killed_run_is_overwritten(self, tmp_path):
        target = tmp_path / "a.csv"
        with atomic(target) as tmp:
            leftover = tmp
            tmp.write_text("first")
        leftover.write_text("left by kill -9")
        write_text("second", target)
        assert target.read_text() == "second"
        assert names(tmp_path) == ["a.csv"]

    def test_block_that_writes_nothing_is_an_error(self, tmp_path):
        with pytest.raises(FileNotFoundError), atomic(tmp_path / "a.csv"):
            pass


class TestTables:
    def test_round_trip(self, tmp_path, table):
        write_table(table, tmp_path / "a.csv")
        back = read_table(tmp_path / "a.csv", ["trial", "mu", "law"])
        # nine digits are kept
        pd.testing.assert_frame_equal(back, table, rtol=1e-8, check_dtype=False)

    @pytest.mark.parametrize("suffix", [".csv", ".parquet"])
    def test_equal_tables_give_equal_bytes(self, tmp_path, table, suffix):
        write_table(table, tmp_path / f"a{suffix}")
        write_table(table.copy().set_axis([5, 3]), tmp_path / f"b{suffix}")
        assert (tmp_path / f"a{suffix}").read_bytes() == (tmp_path / f"b{suffix}").read_bytes()

    def test_bytes_of_a_csv(self, tmp_path, table):
        write_table(table, tmp_path / "a.csv")
        assert (tmp_path / "a.csv").read_bytes() == (b"trial,mu,law\n2,0.333333333,mirtich\n7,,wang_mason\n")

    def test_missing_file_names_the_rule_to_run(self, tmp_path):
        path = tmp_path / "ensemble.csv"
        with pytest.raises(UserError, match="snakemake") as caught:
            read_table(path)
        assert str(path) in str(caught.value)
        assert not isinstance(caught.value, CorruptFileError)

    def test_missing_columns_are_all_named(self, tmp_path, table):
        write_table(table, tmp_path / "a.csv")
        with pytest.raises(CorruptFileError, match=r"column\(s\) epsilon, error;"):
            read_table(tmp_path / "a.csv", ["mu", "epsilon", "error"])


class TestJson:
    def test_round_trip_with_sorted_keys_and_readable_greek(self, tmp_path):
        write_json({"μ": 0.1, "a": [1, None]}, tmp_path / "a.json")
        write_json({"a": [1, None], "μ": 0.1}, tmp_path / "b.json")
        assert (tmp_path / "a.json").read_bytes() == (tmp_path / "b.json").read_bytes()
        assert "μ" in (tmp_path / "a.json").read_text(encoding="utf-8")
        assert read_json(tmp_path / "a.json") == {"a": [1, None], "μ": 0.1}

    def test_nan_is_refused_and_the_old_file_stays(self, tmp_path):
        write_json({"mu": 1.0}, tmp_path / "a.json")
        with pytest.raises(ValueError, match="not JSON compliant"):
            write_json({"mu": float("nan")}, tmp_path / "a.json")
        assert read_json(tmp_path / "a.json") == {"mu": 1.0}

    def test_missing_file(self, tmp_path):
        with pytest.raises(UserError, match="does not exist"):
            read_json(tmp_path / "none.json")


def test_text_has_unix_line_ends(tmp_path):
    write_text("μ\nε\n", tmp_path / "a.txt")
    assert (tmp_path / "a.txt").read_bytes() == "μ\nε\n".encode()


def test_results_have_the_mode_that_the_user_chose(tmp_path):
    before = os.umask(0o027)
    try:
        write_text("", tmp_path / "a.csv")
    finally:
        os.umask(before)
    assert (tmp_path / "a.csv").stat().st_mode & 0o777 == 0o640


def test_every_result_is_written_under_a_temporary_name_first():
    strays = []
    for path in [*(ROOT / "thesis_lib").rglob("*.py"), *(ROOT / "workflow/scripts").glob("*/*.py")]:
        tree, name = ast.parse(path.read_text(encoding="utf-8")), path.relative_to(ROOT).as_posix()
        safe = {
            id(inner)
            for node in ast.walk(tree)
            if isinstance(node, ast.With) and "atomic(" in "".join(ast.unparse(item) for item in node.items)
            for inner in ast.walk(node)
        }
        for node in ast.walk(tree):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and id(node) not in safe:
                words = ({node.func.attr, ast.unparse(node.func)} & WRITERS) - {ALLOWED.get(name)}
                strays += [f"{name}:{node.lineno} {word}" for word in words]
    assert strays == []
