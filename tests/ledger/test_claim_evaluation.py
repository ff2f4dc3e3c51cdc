"""Statuses: a wrong number deviates, what cannot be compared is an error, and neither ever passes."""

import pytest

from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.files import write_table
from thesis_lib.thesis.ledger.format import CUBE
from thesis_lib.thesis.ledger.result import (
    COLUMNS,
    ClaimStatus,
    decided_line,
    refuse_errors,
    render_page,
    summary_line,
    to_table,
)

ABS = {"kind": "abs", "tolerance": 0.01, "reason": "rounding"}
ORDER = {"kind": "ordering", "key": "law"}
LAWS = {"coded": "as_published"}
ALL = ["mirtich", "newton", "whittaker"]
ONE_SIGMA = {"kind": "interval", "k": 1, "reason": "one sigma"}
BELOW_1 = {"kind": "less", "threshold": 1, "reason": "all are"}


@pytest.fixture
def one(make_claim, judged):
    """The result of one claim about the table."""
    return lambda check, published=None, **more: judged([make_claim("x", check, published, **more)])[0]


def of_kind(found, kind):
    return next(result for result in found if result.claim.check.kind == kind)


def test_all_kinds_are_reproduced(entries, judged):
    found = judged(entries)
    assert len(found) == 9 and {r.status for r in found} == {ClaimStatus.REPRODUCED}
    refuse_errors(found)


# each kind's value moved until its check must break; the comment gives the check
WRONG = [
    ("abs", "0.065,0.002", "0.0721,0.002"),  # |0.0721 − 0.062| > 0.01
    ("rel", "0.065,0.002", "0.0652,0.002"),  # |0.0652 − 0.062| > 0.05 · 0.062 = 0.0031
    ("interval", "0.065,0.002", "0.065,0.0014"),  # 0.003 > 2 · 0.0014
    ("greater", "0.065,0.002", "0.043,0.002"),  # 0.05 − 0.043 > 3 · 0.002
    ("less", "0.065,0.002", "0.3,0.002"),  # 0.3 is not less than 0.3
    ("ordering", "0.084", "0.064"),  # newton below mirtich
    ("argmax", "0.084", "0.111"),  # newton ties with whittaker
    ("argmin", "0.084", "0.064"),  # newton below mirtich
    ("true", "3,true", "3,false"),
]


@pytest.mark.parametrize(("kind", "old", "new"), WRONG)
def test_a_wrong_number_deviates(entries, judged, edit_table, kind, old, new):
    edit_table(old, new)
    result = of_kind(judged(entries), kind)
    assert result.status is ClaimStatus.DEVIATES
    assert result.reason == f"{result.finding}; reason unknown" and result.finding


def test_by_how_much(one):
    result = one(ABS, 0.05, note="The authors' code is viscous.")
    assert result.status is ClaimStatus.DEVIATES
    assert (result.difference, result.relative_difference) == pytest.approx((0.015, 0.3), rel=1e-12)
    assert result.std == 0.002
    assert result.reason == "differs from the published value by +0.015 (+30 %); The authors' code is viscous."
    assert one(ABS, 0.06, note="The authors' code is viscous.").reason == ""
    threshold = one({"kind": "greater", "threshold": 0.1, "reason": "half"}, 0.2)  # is its own reference
    assert (threshold.difference, threshold.relative_difference) == pytest.approx((-0.035, -0.35))
    assert threshold.published == "0.2"


def test_the_edge_of_a_tolerance_is_inside(one, edit_table):
    """0.13 − 0.12 is 0.01 and some last bits in binary fractions."""
    edit_table("0.065,", "0.13,")
    assert 0.13 - 0.12 > 0.01
    assert one(ABS, 0.12).status is ClaimStatus.REPRODUCED


@pytest.mark.parametrize(
    ("check", "published", "where", "status"),
    [
        (ONE_SIGMA, 0.062, None, "deviates"),
        ({**ONE_SIGMA, "rounding": 0.001}, 0.062, None, "reproduced"),
        ({**ORDER, "rows": ALL}, None, LAWS, "reproduced"),
        ({**ORDER, "rows": ALL[::-1]}, None, LAWS, "deviates"),
        ({**ORDER, "rows": ALL[::-1], "order": "descending"}, None, LAWS, "reproduced"),
        ({**ORDER, "rows": [["newton", "mirtich"], "whittaker"]}, None, LAWS, "reproduced"),
        ({**ORDER, "rows": ["mirtich", "whittaker"]}, None, LAWS, "reproduced"),
        # steps 0.019 and 0.027 with standard errors 0.0036 and 0.005: 5.3 and 5.4 of them
        ({**ORDER, "rows": ALL, "k": 5.2, "reason": "x"}, None, LAWS, "reproduced"),
        ({**ORDER, "rows": ALL, "k": 5.35, "reason": "x"}, None, LAWS, "not decided: the noise is too large to decide"),
        ({**ORDER, "rows": ALL[::-1], "k": 5.2, "reason": "x"}, None, LAWS, "deviates"),
        ({**ORDER, "rows": ["mirtich", "whittaker"]}, None, {}, "error: 2 rows with law = mirtich"),
        ({**ORDER, "rows": ["mirtich", "nobody"]}, None, LAWS, "error: no rows with"),
        ({"kind": "argmax", "key": "law", "row": "whittaker"}, None, LAWS, "reproduced"),
        ({"kind": "argmax", "key": "law", "row": "newton"}, None, LAWS, "deviates"),
        ({"kind": "argmax", "key": "law", "row": "whittaker", "k": 6, "reason": "x"}, None, LAWS, "not decided"),
        ({"kind": "argmax", "key": "law", "row": "newton", "k": 6, "reason": "x"}, None, LAWS, "not decided"),
        ({"kind": "argmax", "key": "law", "row": "newton", "k": 5, "reason": "x"}, None, LAWS, "deviates"),
        # 0.05 below 0.065 by 7.5 standard errors
        ({"kind": "greater", "threshold": 0.05, "k": 8, "reason": "x"}, None, None, "not decided"),
        ({"kind": "less", "threshold": 0.05, "k": 8, "reason": "x"}, None, None, "not decided"),
        ({"kind": "less", "threshold": 0.05, "k": 7, "reason": "x"}, None, None, "deviates"),
        ({"kind": "argmin", "key": "law", "row": "whittaker"}, None, LAWS, "deviates"),
        ({"kind": "argmin", "key": "law", "row": "law of nobody"}, None, LAWS, "error: no rows with"),
        ({"kind": "argmax", "key": "law", "row": "mirtich"}, None, None, "error: only row"),
        # rows are selected by numbers and flags, too
        (BELOW_1, None, {"n": 1718}, "reproduced"),
        (BELOW_1, None, {"n": 1e-3}, "reproduced"),
        (BELOW_1, None, {"n": 100, "coded": "as_defined"}, "reproduced"),
        (BELOW_1, None, {"n": 100}, "error: 2 rows"),
        (ABS, 0.111, {"converged": False}, "reproduced"),
    ],
)
def test_checks(one, check, published, where, status):
    result = one(check, published, where=where)
    status, _, words = status.partition(": ")
    assert result.status == status and words in result.finding, result.finding


def test_an_ordering_tells_what_it_found(one):
    result = one({**ORDER, "rows": ["newton", "mirtich", "whittaker"]}, where=LAWS)
    assert result.published == "newton < mirtich < whittaker"
    assert result.ours == "mirtich (0.065) < newton (0.084) < whittaker (0.111)"
    assert result.finding == "mirtich (0.065) is not above newton (0.084)"


NUMERIC = ("abs", "rel", "interval", "greater", "less", "ordering", "argmax", "argmin")


@pytest.mark.parametrize(
    ("kinds", "old", "new", "words"),
    [
        *((NUMERIC, "0.065,", f"{cell},", "not a finite") for cell in ("nan", "NaN", "", "inf", "-inf", "0.065 kg")),
        *((("true",), "3,true", f"3,{cell}", "neither true nor false") for cell in ("nan", "", "maybe", "2")),
        *((("interval", "greater"), "0.065,0.002", f"0.065,{std}", "mu_std is") for std in ("nan", "", "-0.002")),
    ],
)
def test_what_is_no_number_no_flag_or_no_standard_error_never_passes(
    entries, judged, edit_table, kinds, old, new, words
):
    edit_table(old, new)
    found = judged(entries)
    for kind in kinds:
        result = of_kind(found, kind)
        assert result.status is ClaimStatus.ERROR and words in result.finding, kind


@pytest.mark.parametrize(
    ("source", "words"),
    [
        ({"file": "chapter3/missing.csv"}, "missing.csv does not exist"),
        ({"column": "sigma"}, "no column 'sigma'; it has law, coded"),
        ({"std_column": "sigma"}, "no column 'sigma'"),
        ({"where": {"author": "fazeli"}}, "no column 'author'"),
        ({"where": {"law": "nobody"}}, "no row with law = nobody"),
        ({"where": {"law": "mirtich"}}, "2 rows with law = mirtich; exactly one is needed"),
        ({"where": {}}, "4 rows"),
    ],
)
def test_a_source_that_is_not_one_cell_is_an_error(make_claim, judged, source, words):
    entry = make_claim("x", ABS, 0.062)
    entry["source"].update(source)
    (result,) = judged([entry])
    assert result.status is ClaimStatus.ERROR and words in result.finding


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "it is empty"),
        (b"law,mu\nmirtich,0.062,7\n", "line 2 has 3 cells instead of 2"),
        (b"law,mu,mu\nmirtich,0.062,7\n", "two columns have the same name"),
        (b"law,mu\n\xff,0.062\n", "is not a CSV table"),
    ],
)
def test_a_damaged_table_is_an_error(one, results, content, words):
    (results / "chapter3" / "table.csv").write_bytes(content)
    result = one(ABS, 0.062)
    assert result.status is ClaimStatus.ERROR and words in result.finding


def test_one_error_does_not_hide_another(make_claim, judged):
    claims = [make_claim(name, ABS, 0.062, column=name) for name in ("first", "second")]
    with pytest.raises(UserError, match="2 claims could not be compared") as caught:
        refuse_errors(judged([*claims, make_claim("good", ABS, 0.062)]))
    assert [name in str(caught.value) for name in ("first", "second", "good")] == [True, True, False]


def test_an_absent_dataset_is_neutral_and_an_unknown_one_an_error(make_claim, judged):
    """A misspelt dataset must not make a claim neutral for ever."""
    entry = make_claim("x", ABS, 0.062)
    entry["source"]["file"] = "chapter3/missing.csv"  # is not even looked for
    found = judged([entry], {"planar_impact": False})
    assert (found[0].status, found[0].finding) == (ClaimStatus.NO_DATA, "needs the dataset planar_impact")
    refuse_errors(found)
    (misspelt,) = judged([make_claim("x", ABS, 0.062, needs=["planar_imapct"])])
    assert misspelt.status is ClaimStatus.ERROR and "planar_imapct" in misspelt.finding


def test_the_table(entries, judged, tmp_path):
    found = judged([*entries, {**entries[0], "id": "a.b", "published": 1}])
    table = to_table(found)
    assert tuple(table.columns) == tuple(COLUMNS)
    assert table["difference"].iloc[0] == "0.003"
    assert table["published"].iloc[5] == "mirtich < {newton, whittaker}"
    assert table["published"].iloc[3] == "> 0.05"
    assert table["status"].iloc[-1] == "deviates"
    assert summary_line(found) == "10 claims: 9 reproduced, 1 deviates, 0 without data."
    write_table(table, tmp_path / "one.csv")
    assert b"nan" not in (tmp_path / "one.csv").read_bytes()


def test_agreement_that_says_little_is_counted_apart_and_shown(entries, judged):
    weak = [{**entries[0], "weak": "anything passes"}, {**entries[0], "id": "a.b", "published": 1, "weak": "too"}]
    found = judged([*entries[1:], *weak])
    assert to_table(found)["weak"].tolist()[-2:] == ["anything passes", "too"]
    assert "9 reproduced, 1 deviates, 0 without data. Of those reproduced, 1 is weak evidence: " in summary_line(found)
    page = render_page(found)
    # one that deviates says enough
    assert page.count("Weak evidence: ") == 2 and "Weak evidence: anything passes." in page


def test_what_the_quick_scale_cannot_tell_is_not_decided_there(entries, judged):
    noisy = {**entries[0], "quick": "10 impacts are too few"}
    missing = {**noisy, "id": "a.b", "source": {**noisy["source"], "file": "missing.csv"}}
    quick, error = judged([noisy, missing], scale="quick")
    assert (quick.status, quick.reason, quick.ours) == (ClaimStatus.UNDECIDED, "10 impacts are too few", "0.065")
    assert error.status is ClaimStatus.ERROR
    assert summary_line([quick]) == "1 claim: 0 reproduced, 0 deviate, 0 without data, 1 not decided."
    assert judged([noisy], scale="default")[0].status is ClaimStatus.REPRODUCED
    assert "10 impacts are too few" in render_page([quick])


def test_the_head_counts_what_the_results_decide(entries, judged):
    first = entries[0]
    changed = (
        {"weak": "anything passes"},
        {"weak": "too", "published": 1},
        {"quick": "too few"},
        {"needs": ["absent"]},
        {"chapter": CUBE},
        {"source": {**first["source"], "file": "missing.csv"}},
    )
    present = {"planar_impact": True, "absent": False}
    more = [{**first, "id": f"a.{name}", **changes} for name, changes in zip("bcdefg", changed)]
    found = judged([first, *more], present, scale="quick")
    assert decided_line(found[:1]) == "Of 1 statements of the thesis these results confirm 1 and contradict 0."
    line = decided_line(found)
    assert line == (
        "Of 6 statements of the thesis these results confirm 1 and contradict 1. 4 stay open: a wrong result could "
        "agree as well with 1, noise hides 1, data are missing for 1, an error stopped 1."
    )
    assert line in render_page(found)
