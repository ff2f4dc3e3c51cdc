"""Statuses: a wrong number deviates, what cannot be compared is an error, and neither ever passes."""

import math

import pytest

from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.files import write_table
from thesis_lib.thesis.ledger.evaluate import evaluate
from thesis_lib.thesis.ledger.format import Ledger
from thesis_lib.thesis.ledger.result import COLUMNS, ClaimStatus, refuse_errors, render_page, summary_line, to_table

PRESENT = {"planar_impact": True, "drops": True}
ABS = {"kind": "abs", "tolerance": 0.01, "reason": "rounding"}
LAWS = {"coded": "as_published"}


def run(claims, results, present=PRESENT):
    return evaluate(Ledger.model_validate({"schema": 1, "claims": claims}), results, present)


def one(claim, results, present=PRESENT):
    return run([claim], results, present)[0]


def test_all_kinds_are_reproduced(entries, results):
    found = run(entries, results)
    assert [(r.claim.check.kind, r.status) for r in found] == [
        (r.claim.check.kind, ClaimStatus.REPRODUCED) for r in found
    ]
    refuse_errors(found)


# each kind's value moved until its check must break; the comment gives the check
WRONG = [
    ("abs", "0.065,0.002", "0.0721,0.002"),  # |0.0721 − 0.062| > 0.01
    ("rel", "0.065,0.002", "0.0652,0.002"),  # |0.0652 − 0.062| > 0.05 · 0.062 = 0.0031
    ("interval", "0.065,0.002", "0.065,0.0014"),  # 0.003 > 2 · 0.0014
    ("greater", "0.065,0.002", "0.065,0.0051"),  # 0.015 < 3 · 0.0051
    ("less", "0.065,0.002", "0.3,0.002"),  # 0.3 is not less than 0.3
    ("ordering", "0.084", "0.064"),  # newton below mirtich
    ("argmax", "0.084", "0.111"),  # newton ties with whittaker
    ("argmin", "0.084", "0.064"),  # newton below mirtich
    ("true", "3,true", "3,false"),
]


@pytest.mark.parametrize(("kind", "old", "new"), WRONG)
def test_a_wrong_number_deviates(entries, results, edit_table, kind, old, new):
    edit_table(old, new)
    result = {r.claim.check.kind: r for r in run(entries, results)}[kind]
    assert result.status is ClaimStatus.DEVIATES
    assert result.finding
    assert result.reason.endswith("reason unknown")


def test_by_how_much(make_claim, results):
    result = one(make_claim("x", ABS, 0.05, note="The authors' code is viscous."), results)
    assert result.status is ClaimStatus.DEVIATES
    assert result.difference == pytest.approx(0.015, rel=1e-12)
    assert result.relative_difference == pytest.approx(0.3, rel=1e-12)
    assert result.std == 0.002
    assert result.reason == "differs from the published value by +0.015 (+30 %); The authors' code is viscous."


def test_the_note_is_silent_when_reproduced(make_claim, results):
    assert one(make_claim("x", ABS, 0.06, note="The authors' code is viscous."), results).reason == ""


def test_the_edge_of_a_tolerance_is_inside(make_claim, results, edit_table):
    """0.13 − 0.12 is 0.01 and some last bits in binary fractions."""
    edit_table("0.065,", "0.13,")
    assert 0.13 - 0.12 > 0.01
    assert one(make_claim("x", ABS, 0.12), results).status is ClaimStatus.REPRODUCED


def test_rounding_widens_an_interval(make_claim, results):
    narrow = {"kind": "interval", "k": 1, "reason": "one sigma"}
    assert one(make_claim("x", narrow, 0.062), results).status is ClaimStatus.DEVIATES
    assert one(make_claim("x", {**narrow, "rounding": 0.001}, 0.062), results).status is ClaimStatus.REPRODUCED


@pytest.mark.parametrize(
    ("check", "status"),
    [
        ({"rows": ["mirtich", "newton", "whittaker"]}, "reproduced"),
        ({"rows": ["whittaker", "newton", "mirtich"]}, "deviates"),
        ({"rows": ["whittaker", "newton", "mirtich"], "order": "descending"}, "reproduced"),
        ({"rows": [["newton", "mirtich"], "whittaker"]}, "reproduced"),
        ({"rows": ["mirtich", "whittaker"]}, "reproduced"),
        # steps 0.019 and 0.027 with standard errors 0.0036 and 0.005: 5.3 and 5.4 of them
        ({"rows": ["mirtich", "newton", "whittaker"], "k": 5.2, "reason": "x"}, "reproduced"),
        ({"rows": ["mirtich", "newton", "whittaker"], "k": 5.35, "reason": "x"}, "deviates"),
    ],
)
def test_orderings(make_claim, results, check, status):
    result = one(make_claim("x", {"kind": "ordering", "key": "law", **check}, where=LAWS), results)
    assert result.status == status, result.finding


def test_an_ordering_tells_what_it_found(make_claim, results):
    check = {"kind": "ordering", "key": "law", "rows": ["newton", "mirtich", "whittaker"]}
    result = one(make_claim("x", check, where=LAWS), results)
    assert result.published == "newton < mirtich < whittaker"
    assert result.ours == "mirtich (0.065) < newton (0.084) < whittaker (0.111)"
    assert result.finding == "mirtich (0.065) is not above newton (0.084)"


@pytest.mark.parametrize(
    ("check", "status"),
    [
        ({"kind": "argmax", "row": "whittaker"}, "reproduced"),
        ({"kind": "argmax", "row": "newton"}, "deviates"),
        ({"kind": "argmax", "row": "whittaker", "k": 6, "reason": "x"}, "deviates"),
        ({"kind": "argmin", "row": "whittaker"}, "deviates"),
        ({"kind": "argmin", "row": "law of nobody"}, "error"),
    ],
)
def test_extremes(make_claim, results, check, status):
    result = one(make_claim("x", {"key": "law", **check}, where=LAWS), results)
    assert result.status == status, result.finding


def test_an_extreme_of_one_row_is_an_error(make_claim, results):
    check = {"kind": "argmax", "key": "law", "row": "mirtich"}
    assert "only row" in one(make_claim("x", check), results).finding


@pytest.mark.parametrize(
    ("where", "rows"), [({"n": 1718}, 1), ({"n": 1e-3}, 1), ({"n": 100, "coded": "as_defined"}, 1), ({"n": 100}, 2)]
)
def test_rows_are_selected_by_numbers_too(make_claim, results, where, rows):
    wide = {"kind": "less", "threshold": 1, "reason": "all are"}
    result = one(make_claim("x", wide, where=where), results)
    assert result.status is (ClaimStatus.REPRODUCED if rows == 1 else ClaimStatus.ERROR)


def test_rows_are_selected_by_flags(make_claim, results):
    assert one(make_claim("x", ABS, 0.111, where={"converged": False}), results).status is ClaimStatus.REPRODUCED


@pytest.mark.parametrize("cell", ["nan", "NaN", "", "inf", "-inf", "none", "0.065 kg"])
@pytest.mark.parametrize("kind", ["abs", "rel", "interval", "greater", "less", "ordering", "argmax", "argmin"])
def test_nan_and_text_never_pass(entries, results, edit_table, kind, cell):
    edit_table("0.065,", f"{cell},")
    result = {r.claim.check.kind: r for r in run(entries, results)}[kind]
    assert result.status is ClaimStatus.ERROR
    assert "not a finite number" in result.finding


@pytest.mark.parametrize("cell", ["nan", "", "maybe", "2"])
def test_a_flag_must_be_a_flag(entries, results, edit_table, cell):
    edit_table("3,true", f"3,{cell}")
    assert run(entries, results)[-1].status is ClaimStatus.ERROR


@pytest.mark.parametrize("std", ["nan", "", "-0.002"])
@pytest.mark.parametrize("kind", ["interval", "greater"])
def test_a_bad_standard_error_never_passes(entries, results, edit_table, kind, std):
    edit_table("0.065,0.002", f"0.065,{std}")
    assert {r.claim.check.kind: r for r in run(entries, results)}[kind].status is ClaimStatus.ERROR


@pytest.mark.parametrize(
    ("source", "words"),
    [
        ({"file": "chapter3/missing.csv"}, "missing.csv does not exist"),
        ({"column": "sigma"}, "no column 'sigma'; it has law, coded"),
        ({"std_column": "sigma"}, "no column 'sigma'"),
        ({"where": {"author": "fazeli"}}, "no column 'author'"),
        ({"where": {"law": "nobody"}}, "no row with law = nobody"),
        ({"where": {"law": "mirtich"}}, "2 rows with law = mirtich; one is wanted"),
        ({"where": {}}, "4 rows"),
    ],
)
def test_a_source_that_is_not_one_cell_is_an_error(make_claim, results, source, words):
    entry = make_claim("x", ABS, 0.062)
    entry["source"].update(source)
    result = one(entry, results)
    assert result.status is ClaimStatus.ERROR
    assert words in result.finding


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "it is empty"),
        (b"law,mu\nmirtich,0.062,7\n", "line 2 has 3 cells instead of 2"),
        (b"law,mu,mu\nmirtich,0.062,7\n", "two columns have the same name"),
        (b"law,mu\n\xff,0.062\n", "is not a CSV table"),
    ],
)
def test_a_damaged_table_is_an_error(make_claim, results, content, words):
    (results / "chapter3" / "table.csv").write_bytes(content)
    result = one(make_claim("x", ABS, 0.062), results)
    assert result.status is ClaimStatus.ERROR
    assert words in result.finding


def test_ordered_rows_must_each_be_there_once(make_claim, results):
    check = {"kind": "ordering", "key": "law", "rows": ["mirtich", "whittaker"]}
    assert "2 rows with law = mirtich" in one(make_claim("x", check, where={}), results).finding
    check["rows"] = ["mirtich", "nobody"]
    assert "no rows with" in one(make_claim("x", check, where=LAWS), results).finding


def test_one_error_does_not_hide_another(make_claim, results):
    claims = [make_claim(name, ABS, 0.062, column=name) for name in ("first", "second")]
    found = [*run(claims, results), one(make_claim("good", ABS, 0.062), results)]
    with pytest.raises(UserError) as caught:
        refuse_errors(found)
    text = str(caught.value)
    assert "2 claims could not be compared" in text
    assert "table_3_1.first" in text
    assert "table_3_1.second" in text
    assert "table_3_1.good" not in text


def test_an_absent_dataset_is_neutral(make_claim, results):
    entry = make_claim("x", ABS, 0.062)
    entry["source"]["file"] = "chapter3/missing.csv"  # is not even looked for
    result = one(entry, results, {"planar_impact": False})
    assert result.status is ClaimStatus.NO_DATA
    assert result.finding == "needs the dataset planar_impact"
    refuse_errors([result])


def test_a_dataset_that_the_run_does_not_know_is_an_error(make_claim, results):
    """A misspelt dataset must not make a claim neutral for ever."""
    result = one(make_claim("x", ABS, 0.062, needs=["planar_imapct"]), results)
    assert result.status is ClaimStatus.ERROR
    assert "planar_imapct" in result.finding


def test_the_table(entries, results, tmp_path):
    found = run([*entries, {**entries[0], "id": "a.b", "published": 1}], results)
    table = to_table(found)
    assert tuple(table.columns) == tuple(COLUMNS)
    assert table["difference"].iloc[0] == "0.003"
    assert table["published"].iloc[5] == "mirtich < {newton, whittaker}"
    assert table["published"].iloc[3] == "> 0.05"
    assert table["status"].iloc[-1] == "deviates"
    assert summary_line(found) == "10 claims: 9 reproduced, 1 deviates, 0 without data."
    write_table(to_table(found), tmp_path / "one.csv")
    two = run([*entries, {**entries[0], "id": "a.b", "published": 1}], results)
    write_table(to_table(two), tmp_path / "two.csv")
    assert (tmp_path / "one.csv").read_bytes() == (tmp_path / "two.csv").read_bytes()
    assert b"nan" not in (tmp_path / "one.csv").read_bytes()


def test_agreement_that_says_little_is_counted_apart_and_shown(entries, results):
    weak = [{**entries[0], "weak": "anything passes"}, {**entries[0], "id": "a.b", "published": 1, "weak": "too"}]
    found = run([*entries[1:], *weak], results)
    assert to_table(found)["weak"].tolist()[-2:] == ["anything passes", "too"]
    assert "9 reproduced, 1 deviates, 0 without data. Of those reproduced 1 says little: " in summary_line(found)
    page = render_page(found)
    assert page.count("Says little: ") == 1 and "Says little: anything passes." in page  # one that deviates says enough


def test_what_the_quick_scale_cannot_tell_is_not_decided_there(entries, results):
    noisy = {**entries[0], "quick": "10 impacts are too few"}
    missing = {**noisy, "id": "a.b", "source": {**noisy["source"], "file": "missing.csv"}}
    ledger = Ledger.model_validate({"schema": 1, "claims": [noisy, missing]})
    quick, error = evaluate(ledger, results, PRESENT, "quick")
    assert (quick.status, quick.reason, quick.ours) == (ClaimStatus.UNDECIDED, "10 impacts are too few", "0.065")
    assert error.status is ClaimStatus.ERROR
    assert summary_line([quick]) == "1 claim: 0 reproduced, 0 deviate, 0 without data, 1 not decided at this scale."
    assert evaluate(ledger, results, PRESENT, "default")[0].status is ClaimStatus.REPRODUCED
    assert "10 impacts are too few" in render_page([quick])


def test_a_threshold_is_its_own_reference(make_claim, results):
    result = one(make_claim("x", {"kind": "greater", "threshold": 0.1, "reason": "half"}, 0.2), results)
    assert result.difference == pytest.approx(-0.035)
    assert result.published == "0.2"
    assert math.isclose(result.relative_difference, -0.35)
