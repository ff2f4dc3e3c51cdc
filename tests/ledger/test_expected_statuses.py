"""Committed statuses: a change in either direction is found, data not present is neutral."""

from pathlib import Path

import pandas as pd
import pytest

from thesis_lib.foundation.errors import UserError
from thesis_lib.thesis.ledger.expected import compare_with_expected, read_expected, update_expected
from thesis_lib.thesis.ledger.format import read_ledger

ROOT = Path(__file__).resolve().parents[2]
ABSENT = {"planar_impact": False}
CHECK = {"kind": "abs", "tolerance": 0.01, "reason": "rounding"}


@pytest.fixture
def run(make_claim, judged):
    def run(present=None, published=0.062, names=("x",), **more):
        return judged([make_claim(name, CHECK, published, **more) for name in names], present)

    return run


FOUND = {
    "reproduced": {},
    "deviates": {"published": 1},
    "data not present": {"present": ABSENT},
    "error": {"column": "missing"},
}


@pytest.mark.parametrize(
    ("found", "committed", "text"),
    [
        ("reproduced", "reproduced", None),
        ("deviates", "deviates", None),
        ("deviates", "reproduced", "was reproduced, now deviates (differs from the published value by -0.935"),
        ("reproduced", "deviates", "was deviates, now reproduced"),
        ("data not present", "reproduced", None),
        ("data not present", "deviates", None),
        ("data not present", "", None),
        *(("error", status, "could not be compared") for status in ("reproduced", "deviates", "error")),
        ("reproduced", "", "add the line `table_3_1.x: reproduced`"),
    ],
)
def test_a_change_in_either_direction_is_found(run, found, committed, text):
    expected = {"quick": {"table_3_1.x": committed} if committed else {}, "default": {"table_3_1.x": "reproduced"}}
    changes = compare_with_expected(run(**FOUND[found]), expected, "quick")
    assert [(change.expected, change.found) for change in changes] == [(committed, found)] * (text is not None)
    assert all(text in change.text for change in changes)


def test_a_status_without_a_claim_fails(run):
    expected = {"quick": {"table_3_1.x": "reproduced", "table_3_1.gone": "reproduced"}}
    (change,) = compare_with_expected(run(), expected, "quick")
    assert change.id == "table_3_1.gone"
    assert "no longer in the ledger" in change.text


def test_update_then_compare(run, tmp_path):
    path = tmp_path / "expected.yaml"
    assert read_expected(path) == {}
    assert update_expected(path, run(names=("x", "y")), "quick") == [
        "table_3_1.x: new → reproduced",
        "table_3_1.y: new → reproduced",
    ]
    assert compare_with_expected(run(names=("x", "y")), read_expected(path), "quick") == []
    before = path.read_bytes()
    assert update_expected(path, run(names=("y", "x")), "quick") == []
    assert path.read_bytes() == before

    update_expected(path, run(published=1), "default")
    assert read_expected(path)["quick"]["table_3_1.x"] == "reproduced"  # other scales stay
    assert update_expected(path, run(published=1), "quick") == [
        "table_3_1.x: reproduced → deviates",
        "table_3_1.y: reproduced → removed",
    ]


def test_update_without_data_keeps_what_is_committed(run, tmp_path):
    path = tmp_path / "expected.yaml"
    update_expected(path, run(), "quick")
    assert update_expected(path, run(ABSENT), "quick") == []
    assert read_expected(path)["quick"] == {"table_3_1.x": "reproduced"}


def test_update_refuses_errors(run, tmp_path):
    path = tmp_path / "expected.yaml"
    with pytest.raises(UserError, match=r"table_3_1\.x"):
        update_expected(path, run(column="missing"), "quick")
    assert not path.exists()


@pytest.mark.parametrize(
    "text",
    [
        "schema: 1\nexpected: {quick: {a.b: error}}\n",
        "schema: 1\nexpected: {quick: {a.b: data not present}}\n",
        "schema: 1\nexpected: {quik: {a.b: reproduced}}\n",
        "schema: 1\nexpected: {quick: {a.b: reproduced, a.b: deviates}}\n",
    ],
)
def test_a_bad_file_is_refused(tmp_path, text):
    path = tmp_path / "expected.yaml"
    path.write_text(text)
    with pytest.raises(UserError, match=r"expected\.yaml"):
        read_expected(path)


def test_means_of_table_2_1_that_no_error_at_all_would_pass_say_little():
    stored = pd.read_csv(ROOT / "config/figures/default/common/figure_table_2_1.csv")
    rows = stored.set_index(["shape", "method", "snr"])["mean_error_std"]
    statuses = read_expected(ROOT / "config/claims_expected.yaml")["default"]
    means = [
        claim
        for claim in read_ledger(ROOT / "config/claims").claims
        if claim.id.startswith("table_2_1.") and ".mean." in claim.id and statuses[claim.id] == "reproduced"
    ]
    for claim in means:
        std = rows[tuple(claim.source.where[name] for name in rows.index.names)]
        zero_passes = abs(claim.published) <= claim.check.k * std + claim.check.rounding
        assert bool(claim.weak) == zero_passes, claim.id
    assert sum(bool(claim.weak) for claim in means) < len(means)
