"""Results of the proof held against the targets, and those that miss by name."""

from pathlib import Path

import pandas as pd
import pytest
from stored_proof import OUTSIDE, error, figure_of, many, parameter, put, refuse

from thesis_lib.statistics.intervals import wilson
from thesis_lib.studies.proof.cases import Case, truths
from thesis_lib.studies.proof.results import confusion, misses
from thesis_lib.studies.proof.store import NOTHING
from thesis_lib.studies.proof.summary import TARGETS, report, summary, tables

LAWS_RIGHT, MECHANISMS_RIGHT, SMALL, ADEQUATE, PAIRS, UNEXPLAINED, COVERAGE, MISFIT = (
    target.figure for target in TARGETS
)


class TestSummary:
    def test_without_results_every_figure_is_not_run(self, tmp_path):
        table = summary(tmp_path)
        assert set(table["met"]) == {"not run"} and (table["n"] == 0).all() and table["measured"].isna().all()
        assert list(dict.fromkeys(table["figure"])) == [target.figure for target in TARGETS]
        assert "not run" in report(tmp_path)

    @pytest.mark.parametrize(
        ("right", "met"), [(100, "aim"), (99, "aim"), (98, "at least"), (95, "at least"), (94, "missed")]
    )
    def test_a_share_meets_its_aim_its_least_or_neither(self, tmp_path, right, met):
        many(tmp_path, "law", "wear", right, 100 - right)
        row = figure_of(tmp_path, LAWS_RIGHT, "law")
        assert (row["n"], row["measured"], row["met"]) == (100, right / 100, met)
        assert (row["low"], row["high"]) == pytest.approx(wilson(right, 100))
        assert row["group_size"] == 1.0

    def test_mechanisms_are_pooled_and_each(self, tmp_path):
        many(tmp_path, "mechanism", "tilt", 9, 1)
        many(tmp_path, "drake", "tilt", 2, 8)
        measured = {s: figure_of(tmp_path, MECHANISMS_RIGHT, s) for s in ("mechanism + drake", "mechanism", "drake")}
        assert [row["measured"] for row in measured.values()] == pytest.approx([0.55, 0.9, 0.2])
        assert [row["met"] for row in measured.values()] == ["missed", "at least", "missed"]
        assert figure_of(tmp_path, LAWS_RIGHT, "law")["met"] == "not run"

    def test_other_sizes_drops_and_noises_do_not_count(self, tmp_path):
        for size in ({"ratio": 6.0}, {"ratio": 1.5}, {"noise": 5.0}, {"drops": 300}):
            many(tmp_path, "mechanism", "tilt", 3, 0, **size)
        assert set(summary(tmp_path)["met"]) == {"not run"}
        many(tmp_path, "mechanism", "tilt", 3, 1, drops=50)
        assert figure_of(tmp_path, SMALL, "mechanism")["measured"] == 0.75
        assert figure_of(tmp_path, MECHANISMS_RIGHT, "mechanism")["met"] == "not run"
        assert len(confusion(tmp_path)) == 5

    def test_each_kind_has_its_own_figure(self, tmp_path):
        put(tmp_path, Case("law", NOTHING, 1000), groups=[])
        put(tmp_path, Case("mechanism", OUTSIDE, 1000), groups=[], verdict="unexplained")
        put(tmp_path, Case("law", "wear+magnus", 1000), groups=[["wear"], ["magnus", "tilt"]])
        table = summary(tmp_path)
        run = table[table["n"] > 0]
        assert run[["figure", "source"]].to_numpy().tolist() == [
            [ADEQUATE, "law"],
            [PAIRS, "all"],
            [PAIRS, "law"],
            [UNEXPLAINED, "mechanism + drake"],
            [UNEXPLAINED, "mechanism"],
        ]
        assert (run["met"] == "aim").all()
        assert figure_of(tmp_path, PAIRS, "law")["group_size"] == 1.5

    def test_says_how_many_datasets_were_planned(self, tmp_path):
        table = summary(tmp_path).set_index(["figure", "source"])["n_asked"]
        singles = [name for name in truths("mechanism") if Case("mechanism", name, 0).kind == "single"]
        assert table[MECHANISMS_RIGHT, "mechanism"] == 10 * len(singles)
        assert table[ADEQUATE, "law"] == 200 and table[SMALL, "mechanism"] == 24
        assert table[PAIRS, "all"] == 100 and table[UNEXPLAINED, "mechanism + drake"] == 30

    @pytest.mark.parametrize(
        ("covered", "width", "met"),
        [(95, 1.1, "aim"), (95, 1.31, "missed"), (100, 1.1, "at least"), (91, 1.1, "at least"), (89, 1.1, "missed")],
    )
    def test_coverage_counts_only_with_narrow_intervals(self, tmp_path, covered, width, met):
        for i in range(100):
            values = parameter(1.0 if i < covered else 3.0, width)
            put(tmp_path, Case("law", "wear", 1000 + i), parameters=values)
        row = figure_of(tmp_path, COVERAGE, "law")
        assert (row["measured"], row["n"], row["met"]) == (covered / 100, 100, met)
        assert f"{width:.2f}" in row["note"]

    @pytest.mark.parametrize(("after", "met"), [(1.04, "aim"), (1.1, "at least"), (1.3, "missed")])
    def test_the_misfit_is_the_median_over_single_effects(self, tmp_path, after, met):
        for i in range(9):
            put(tmp_path, Case("law", "wear", 1000 + i), **error(after=after if i else 0.9))
        for i in range(3):
            put(tmp_path, Case("law", "wrong_inertia", 1000 + i), **error(after=4.0))
        put(tmp_path, Case("law", NOTHING, 1000), groups=[], **error(after=0.1))
        row = figure_of(tmp_path, MISFIT, "law")
        assert row["measured"] == pytest.approx(after) and row["met"] == met and row["n"] == 12
        assert "worst wrong_inertia 4.00" in row["note"]
        assert row["note"].startswith("75 % of" if after <= 1.2 else "8 % of")


@pytest.fixture
def mixed(tmp_path) -> Path:
    """A store with a bit of everything."""
    store = tmp_path / "store"
    many(store, "law", "tangential_restitution", 3, 0)
    many(store, "law", "wear", 2, 1, ratio=6.0)
    many(store, "law", "wear", 3, 0, drops=50)
    for i in range(3):
        values = parameter(0.5 * i)
        put(store, Case("law", "wear", 1000 + i), groups=[["wear", "wrong_size"]], parameters=values)
    put(store, Case("law", "wear", 1003), groups=[["wrong_size"], ["magnus", "wear"]])
    put(store, Case("law", NOTHING, 1000), groups=[])
    put(store, Case("law", "wear+magnus", 1007), groups=[["wear"]])
    put(store, Case("mechanism", OUTSIDE, 1001), groups=[["adhesion"]])
    refuse(store, Case("drake", "tilt", 1002), "no impact was found")
    return store


class TestMisses:
    def test_every_wrong_dataset_of_the_table_is_named(self, mixed):
        table = misses(mixed).set_index(["source", "truth", "seed"])
        assert set(table.index) == {
            ("law", "wear", 1003),
            ("law", "wear+magnus", 1007),
            ("mechanism", OUTSIDE, 1001),
            ("drake", "tilt", 1002),
        }
        assert table.loc[("law", "wear", 1003), "named"] == "wrong_size + magnus/wear"
        assert table.loc[("drake", "tilt", 1002), "why"] == "no impact was found"

    def test_none_where_all_is_right(self, tmp_path):
        many(tmp_path, "law", "wear", 4, 0)
        assert misses(tmp_path).empty


class TestReport:
    def test_is_readable_in_120_columns_and_holds_everything(self, mixed):
        text = report(mixed)
        assert max(map(len, text.splitlines())) <= 120
        for part in ("not run", "missed", "1003", "no impact was found", OUTSIDE, "wear+magnus"):
            assert part in text
        for target in TARGETS:
            assert target.figure[:50] in text
        assert f"Truth against verdict (medians; 95 % intervals): {len(confusion(mixed))}" in text

    def test_writes_the_tables(self, mixed, tmp_path):
        report(mixed, tmp_path / "csv")
        assert sorted(path.name for path in (tmp_path / "csv").iterdir()) == [
            "confusion.csv",
            "misses.csv",
            "real_contacts.csv",
            "summary.csv",
        ]
        for name, table in tables(mixed).items():
            pd.testing.assert_frame_equal(
                pd.read_csv(tmp_path / "csv" / f"{name}.csv", keep_default_na=False, na_values=[""])[["source"]],
                table[["source"]],
            )
