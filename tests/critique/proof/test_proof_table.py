"""How stored results of the proof are counted, and what is refused of a store."""

from pathlib import Path

import numpy as np
import pytest
from stored_proof import FLOOR, cell, error, figure_of, parameter, put, refuse

from thesis_lib.foundation.errors import CorruptFileError
from thesis_lib.statistics.intervals import wilson
from thesis_lib.studies.proof.cases import Case
from thesis_lib.studies.proof.results import confusion, outcomes, recovered
from thesis_lib.studies.proof.summary import TARGETS

COVERAGE = next(target.figure for target in TARGETS if target.measure == "coverage")


def test_datasets_of_a_cell_are_counted(tmp_path):
    put(tmp_path, Case("law", "wear", 1000))
    put(tmp_path, Case("law", "wear", 1001), groups=[["wrong_size", "wear"]])
    put(tmp_path, Case("law", "wear", 1002), groups=[["magnus"], ["wear"]])
    put(tmp_path, Case("law", "wear", 1003), groups=[])
    row = cell(tmp_path, "law", "wear")
    assert (row["n"], row["right"]) == (4, 0.5)
    assert (row["right_low"], row["right_high"]) == pytest.approx(wilson(2, 4))
    assert row["group_size"] == pytest.approx(4.0 / 3.0)
    assert row["named_first"] == "magnus:1;wear:1;wrong_size:1"
    assert row["verdicts"] == "adequate:1;effects:3"
    assert outcomes(tmp_path)["wrong_names"].tolist() == [0, 0, 1, 0]


def test_a_refusal_is_counted_and_never_right(tmp_path):
    refuse(tmp_path, Case("law", "wear", 1000))
    put(tmp_path, Case("law", "wear", 1001))
    row = cell(tmp_path, "law", "wear")
    assert (row["right"], row["verdicts"]) == (0.5, "effects:1;refused:1")


class TestMisfits:
    @pytest.mark.parametrize(
        ("truth", "errors", "after"),
        [
            ("wear", error(after=1.1, flight_augmented=9.0), 1.1),  # acts on impacts only
            ("magnus", error(after=9.0, flight_augmented=1.2), 1.2),  # in flight only
            ("surface_height", error(after=9.0, flight_augmented=9.0, touch_augmented=0.8), 0.8),
            ("com_offset", error(after=1.1, flight_augmented=1.3), 1.3),  # both: the worse
            ("com_offset", error(after=1.4, flight_augmented=1.3), 1.4),
            ("com_offset", error(after=1.4, flight_augmented=np.nan), 1.4),  # no flights to judge by
        ],
    )
    def test_count_where_the_effect_acts(self, tmp_path, truth, errors, after):
        put(tmp_path, Case("law", truth, 1000), **errors)
        assert cell(tmp_path, "law", truth)["after_over_floor"] == pytest.approx(after)

    def test_of_a_cause_are_those_of_the_effect_that_describes_it(self, tmp_path):
        put(tmp_path, Case("mechanism", "gravity_error", 1000), **error(flight_base=4.0, flight_augmented=1.5))
        row = cell(tmp_path, "mechanism", "gravity_error")
        assert (row["before_over_floor"], row["after_over_floor"]) == (4.0, 1.5)

    def test_medians_over_datasets(self, tmp_path):
        for i, after in enumerate((1.0, 1.1, 5.0)):
            put(tmp_path, Case("law", "wear", 1000 + i), **error(after=after))
        row = cell(tmp_path, "law", "wear")
        assert row["after_over_floor"] == pytest.approx(1.1) and row["before_over_floor"] == pytest.approx(3.0)
        assert row["error_after"] == pytest.approx(1.1 * FLOOR) and row["floor"] == FLOOR


class TestParameters:
    def test_coverage_distance_and_width(self, tmp_path):
        for i, z in enumerate((0.5, -1.0, 1.9, -2.0)):
            put(tmp_path, Case("law", "wear", 1000 + i), parameters=parameter(z, 1.0 + 0.1 * i))
        row = cell(tmp_path, "law", "wear")
        assert (row["n_parameters"], row["coverage"]) == (4, 0.75)
        assert (row["coverage_low"], row["coverage_high"]) == pytest.approx(wilson(3, 4))
        assert row["z"] == pytest.approx(1.45) and row["width"] == pytest.approx(1.15)

    def test_an_unknown_bound_leaves_the_width_open(self, tmp_path):
        put(tmp_path, Case("law", "wear", 1000), parameters=parameter(0.1, np.nan))
        row = cell(tmp_path, "law", "wear")
        assert row["coverage"] == 1.0 and np.isnan(row["width"])
        # and what is not known to be narrow does not meet a target that asks for it
        assert figure_of(tmp_path, COVERAGE, "law")["met"] == "missed"

    def test_none_where_the_effect_was_not_named(self, tmp_path):
        put(tmp_path, Case("law", "wear", 1000), groups=[])
        row = cell(tmp_path, "law", "wear")
        assert row["n_parameters"] == 0 and np.isnan(row["coverage"]) and np.isnan(row["coverage_low"])
        assert recovered(tmp_path).empty


class TestBadStores:
    @pytest.fixture
    def table(self, tmp_path) -> Path:
        put(tmp_path, Case("law", "wear", 1000), parameters=parameter(1.0))
        return tmp_path / "law.csv"

    @pytest.mark.parametrize(
        ("old", "new"),
        [
            (",effects,", ","),  # a cell is missing
            (",effects,", ",perhaps,"),
            ("wear,3,", "phlogiston,3,"),
            (",300,", ",many,"),
            ("w=2:", "w=2:x:"),
            ("\nwear", "\n\0wear"),
        ],
    )
    def test_a_row_that_cannot_be_read_is_named(self, table, old, new):
        table.write_text(table.read_text().replace(old, new, 1))
        with pytest.raises(CorruptFileError, match=r"law\.csv, line [12], is not a row of this table"):
            outcomes(table.parent)

    def test_so_is_one_that_stands_twice_and_a_table_of_other_columns(self, table):
        header, row = table.read_text().splitlines()
        table.write_text("\n".join([header, row, row]))
        with pytest.raises(CorruptFileError, match=r"line 3, .* occurs twice"):
            outcomes(table.parent)
        table.write_text(header.replace("verdict", "opinion"))
        with pytest.raises(CorruptFileError, match="does not have the columns truth, ratio"):
            confusion(table.parent)
