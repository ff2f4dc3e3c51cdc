"""Stored copies of figures: a perturbed column, row, key or count is found, a perturbation inside tolerance is not."""

import numpy as np
import pandas as pd
import pytest

from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.files import write_table
from thesis_lib.thesis.ledger.figure_check import check_figure, check_figures, kept_rows, store_figure, update_figures
from thesis_lib.thesis.records.record import Figure, Job, Tolerance

ABS, REL = 1e-3, 0.02
TOLERANCES = {
    "error": Tolerance("solver tolerance", abs=ABS),
    "density": Tolerance("bandwidth search", rel=REL),
    "count": Tolerance("counts are exact"),
}
DROPS = Job("draw", "chapter3/{dataset}", datasets=("drops",))
PRESENT = {"drops": True, "dice": True}
N = 101


def data(n=N):
    i = np.arange(n)
    law = np.where(i % 2 == 0, "newton", "mirtich")
    return pd.DataFrame({"law": law, "i": i, "error": 0.3 + 0.01 * i, "density": 2.0 + np.sin(i), "count": 3 * i})


def write(table, path):
    write_table(table, path)
    return path


def record(name="figure_3_8", job=DROPS, **more):
    return Figure(name=name, job=job, title="x", keys="law i", tolerances=TOLERANCES, **more)


@pytest.fixture
def figure():
    return record()


@pytest.fixture
def compare(tmp_path, figure):
    """Store the data, check another table against it; returns what differs."""

    def compare(other, stored=None, spec=figure):
        store_figure(write(data() if stored is None else stored, tmp_path / "a.csv"), tmp_path / "copy.csv", spec)
        return check_figure(write(other, tmp_path / "b.csv"), tmp_path / "copy.csv", spec)

    return compare


def test_the_copy_is_small_and_keeps_both_ends(tmp_path, figure):
    store_figure(write(data(), tmp_path / "a.csv"), tmp_path / "copy.csv", figure)
    copy = pd.read_csv(tmp_path / "copy.csv")
    assert list(copy.columns) == ["row", "law", "i", "error", "density", "count"]
    assert len(copy) == 40
    assert copy["row"].iloc[0] == 0
    assert copy["row"].iloc[-1] == N - 1


@pytest.mark.parametrize(("total", "most"), [(1, 40), (39, 40), (40, 40), (41, 40), (80, 40), (5000, 40), (3, 2)])
def test_kept_rows_are_distinct_and_even(total, most):
    rows = kept_rows(total, most)
    assert len(rows) == min(total, most)
    assert rows[0] == 0
    assert rows[-1] == total - 1
    steps = np.diff(rows)
    assert total == 1 or steps.max() - steps.min() <= 1


def put(*cells):
    """A change of cells (row, column, value); a value may be a function of what is there."""

    def change(table):
        for row, column, value in cells:
            table.loc[row, column] = value(table.loc[row, column]) if callable(value) else value
        return table

    return change


ROWS = kept_rows(N, 40)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        # just beyond each column's tolerance, and just within
        (lambda t: t.assign(error=t["error"] + 1.01 * ABS), "column error: 40 of 40 rows differ; worst in row "),
        (lambda t: t.assign(density=t["density"] * (1 + 1.01 * REL)), "column density: 40 of 40 rows differ; worst"),
        (lambda t: t.assign(count=t["count"] + 1), "column count: 40 of 40 rows differ; worst"),
        (lambda t: t.assign(error=t["error"] - 0.99 * ABS, density=t["density"] * (1 + 0.99 * REL)), None),
        (lambda t: t.assign(error=t["error"] + 0.99 * ABS, density=t["density"] * (1 - 0.99 * REL)), None),
        (lambda t: t.assign(law=t["law"] + "x"), "column law: 40 of 40 rows differ"),
        (lambda t: t.assign(i=t["i"] + 1), "column i: 40 of 40 rows differ"),
        *(
            (put((row, column, lambda x: x + 5)), f"column {column}: 1 of 40 rows differ; worst in row {row}")
            for row in (0, ROWS[7], N - 1)
            for column in TOLERANCES
        ),
        (
            put((ROWS[3], "error", lambda x: x + 0.01), (ROWS[9], "error", lambda x: x + 0.02)),
            f"column error: 2 of 40 rows differ; worst in row {ROWS[9]}",
        ),
        *((lambda t, row=row: t.drop(index=row), "has 100 rows, the stored copy had 101") for row in (0, 50, N - 1)),
        (lambda t: data(N + 1), "has 102 rows"),
        (lambda t: t.assign(error=np.nan), "column error is NaN in every row"),
    ],
)
def test_what_differs_is_named_and_what_is_within_the_tolerance_passes(compare, change, text):
    found = compare(change(data()))
    assert len(found) == (text is not None)
    assert all(each.startswith(text) for each in found), found


def test_swapped_rows_fail(compare):
    other = data()
    other.iloc[[0, 1]] = other.iloc[[1, 0]].to_numpy()
    assert {"column law", "column i"} <= {text.split(":")[0] for text in compare(other)}


@pytest.mark.parametrize("value", [np.nan, np.inf])
@pytest.mark.parametrize("column", ["error", "density"])
def test_nan_and_an_infinity_agree_only_with_themselves(compare, column, value):
    """An infinite stored value times `rel` would allow everything."""
    odd = put((0, column, value))(data())
    assert compare(odd, stored=odd) == []
    for ours, stored in ((odd, data()), (data(), odd), (put((0, column, -np.inf))(data()), odd)):
        assert compare(ours, stored=stored)[0].startswith(f"column {column}")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda t: t.drop(columns="error"), "column error is missing"),
        (lambda t: t.drop(columns="law"), "column law is missing"),
        (lambda t: t.assign(speed=1.0), "column speed of"),
        (lambda t: t.assign(error="fast"), "has 'fast' in row 0, not a number"),
        (lambda t: t.iloc[:0], "has no rows"),
    ],
)
def test_a_table_of_another_form_is_neither_checked_nor_stored(compare, tmp_path, figure, change, words):
    assert words in compare(change(data()))[0]
    with pytest.raises(UserError, match="cannot be stored"):
        store_figure(tmp_path / "b.csv", tmp_path / "new.csv", figure)
    assert not (tmp_path / "new.csv").exists()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda t: t.drop(index=5), "not the evenly spaced copy"),
        (lambda t: t.iloc[::-1], "not the evenly spaced copy"),
        (lambda t: t.iloc[:0], "not the evenly spaced copy"),
        (lambda t: t.drop(columns="error"), "instead of"),
        (lambda t: t.assign(error="fast"), "text instead of a number"),
    ],
)
def test_a_copy_edited_by_hand_fails(tmp_path, figure, change, words):
    store_figure(write(data(), tmp_path / "a.csv"), tmp_path / "copy.csv", figure)
    write(change(pd.read_csv(tmp_path / "copy.csv")), tmp_path / "copy.csv")
    problems = check_figure(tmp_path / "a.csv", tmp_path / "copy.csv", figure)
    assert words in problems[0]
    assert "thesis-lib claims update" in problems[0]


@pytest.fixture
def folder(tmp_path):
    """A results folder with one figure."""
    write(data(), tmp_path / "results/chapter3/drops/figure_3_8.csv")
    (tmp_path / "results/chapter3/drops/figure_3_8.png").write_bytes(b"")
    return tmp_path


def statuses(folder, figures, present=PRESENT):
    table = check_figures(folder / "results", folder / "stored", figures, present)
    assert list(table.columns) == ["figure", "dataset", "status", "finding"]
    return {(row.figure, row.dataset): (row.status, row.finding) for row in table.itertuples()}


def test_check_figures(folder):
    status, finding = statuses(folder, [record()])["figure_3_8", "drops"]
    assert status == "error"
    assert "store it: thesis-lib claims update" in finding

    update_figures(folder / "results", folder / "stored", [record()], PRESENT)
    assert (folder / "stored/drops/figure_3_8.csv").is_file()
    assert statuses(folder, [record()])["figure_3_8", "drops"] == ("agrees", "")

    (folder / "results/chapter3/drops/figure_3_8.csv").unlink()
    status, finding = statuses(folder, [record()])["figure_3_8", "drops"]
    assert status == "error"
    assert "does not exist" in finding


def test_an_absent_dataset_is_neutral_and_an_unknown_one_an_error(folder):
    absent = {"drops": False}
    assert statuses(folder, [record()], absent)["figure_3_8", "drops"][0] == "data not present"
    assert update_figures(folder / "results", folder / "stored", [record()], absent) == []
    status, finding = statuses(folder, [record()], {})["figure_3_8", "drops"]
    assert status == "error" and "does not report on the dataset drops" in finding


def test_a_figure_without_dataset_is_common(folder):
    write(data(), folder / "results/chapter3/figure_3_2.csv")
    both = [record(), record("figure_3_2", Job("draw", "chapter3"))]
    update_figures(folder / "results", folder / "stored", both, PRESENT)
    assert (folder / "stored/common/figure_3_2.csv").is_file()
    assert {status for status, _ in statuses(folder, both).values()} == {"agrees"}


def test_a_picture_without_record_is_an_error(folder):
    update_figures(folder / "results", folder / "stored", [record()], PRESENT)
    for name in ("chapter3/drops/figure_3_9.png", "critique/drops/ladder.png"):
        (folder / "results" / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / "results" / name).write_bytes(b"")
    found = statuses(folder, [record()])
    status, finding = found["figure_3_9", "drops"]
    assert status == "error"
    assert "chapter3/drops/figure_3_9.png has no record" in finding
    assert ("ladder", "drops") not in found  # a picture of the critique
    uncompared = [record(), record("figure_3_9", not_compared="a photograph")]
    assert ("figure_3_9", "drops") not in statuses(folder, uncompared)


def test_a_copy_without_figure_is_an_error(folder):
    update_figures(folder / "results", folder / "stored", [record()], PRESENT)
    write(data(), folder / "stored/drops/figure_9_9.csv")
    assert "delete it" in statuses(folder, [record()])["figure_9_9", "drops"][1]


def test_update_writes_what_differs_and_leaves_the_rest(folder):
    (line,) = update_figures(folder / "results", folder / "stored", [record()], PRESENT)
    assert "figure_3_8.csv: new" in line
    copy = folder / "stored/drops/figure_3_8.csv"
    before = copy.read_bytes()

    other = data()
    other["error"] += 0.5 * ABS
    write(other, folder / "results/chapter3/drops/figure_3_8.csv")
    assert update_figures(folder / "results", folder / "stored", [record()], PRESENT) == []
    assert copy.read_bytes() == before

    other["error"] += ABS
    write(other, folder / "results/chapter3/drops/figure_3_8.csv")
    (line,) = update_figures(folder / "results", folder / "stored", [record()], PRESENT)
    assert "column error" in line
    assert statuses(folder, [record()])["figure_3_8", "drops"] == ("agrees", "")


def test_update_writes_nothing_if_one_figure_is_bad(folder):
    both = [record(job=Job("draw", "chapter3/{dataset}", datasets=("dice", "drops")))]
    with pytest.raises(UserError, match=r"dice/figure_3_8\.csv does not exist"):
        update_figures(folder / "results", folder / "stored", both, PRESENT)
    assert not (folder / "stored").exists()
