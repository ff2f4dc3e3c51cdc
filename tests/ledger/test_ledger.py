"""The ledger's format: what is accepted, and that everything wrong is named at once with the claim's id."""

import re
from pathlib import Path

import pytest

from thesis_lib.foundation.errors import UserError
from thesis_lib.thesis.ledger.format import read_ledger

ROOT = Path(__file__).resolve().parents[2]
ABS = {"kind": "abs", "tolerance": 0.01, "reason": "rounding"}
ORDER = {"kind": "ordering", "key": "law", "rows": ["mirtich", "whittaker"]}


def refusal(path) -> str:
    with pytest.raises(UserError) as caught:
        read_ledger(path)
    return str(caught.value)


def test_a_claim_of_each_kind_is_read(write_ledger, entries):
    ledger = read_ledger(write_ledger(entries))
    kinds = [claim.check.kind for claim in ledger.claims]
    assert kinds == ["abs", "rel", "interval", "greater", "less", "ordering", "argmax", "argmin", "true"]
    assert ledger.claims[0].published == 0.062


def test_the_example_in_the_docstring_is_read(tmp_path):
    from thesis_lib.thesis.ledger import format as ledger

    example = ledger.__doc__.split("```yaml\n")[1].split("```")[0]
    (tmp_path / "claims.yaml").write_text(example, encoding="utf-8")
    first, second = read_ledger(tmp_path / "claims.yaml").claims
    assert first.id == "table_3_1.mirtich.mu.as_published" and first.chapter == second.chapter == 3
    assert second.check.k == 2 and second.note.startswith("the cost is flat")


@pytest.mark.parametrize(
    ("check", "published", "words"),
    [
        ({"kind": "abs", "tolerance": 0.01}, 0.062, "check.reason: the key is missing (why this tolerance"),
        ({"kind": "rel", "tolerance": 0.01, "reason": "  "}, 0.062, "check.reason"),
        ({"kind": "interval", "k": 2}, 0.062, "check.reason: the key is missing"),
        ({"kind": "greater", "threshold": 0, "k": 2}, None, "reason is missing: state why this k"),
        ({"kind": "greater", "threshold": 20}, 30, "reason is missing: state why the threshold is 20"),
        ({"kind": "less", "threshold": 151}, None, "reason is missing: state why the threshold is 151"),
        ({**ORDER, "k": 2}, None, "reason is missing: state why this k"),
        ({**ABS, "tolerance": 0}, 0.062, "check.tolerance is 0, but must be above 0"),
        ({**ABS, "tolerance": -1}, 0.062, "check.tolerance"),
        ({**ABS, "tolerance": float("nan")}, 0.062, "check.tolerance"),
        ({**ABS, "tolerance": float("inf")}, 0.062, "check.tolerance"),
        ({**ABS, "tolerance": True}, 0.062, "expected a number"),
        ({**ABS, "tolerence": 0.01}, 0.062, "check.tolerence: unknown key; did you mean 'tolerance'?"),
        ({**ABS, "kind": "about"}, 0.062, "check: kind is 'about', but must be abs or rel or interval"),
        (ABS, None, "published must be a number"),
        (ABS, "mirtich", "published must be a number"),
        (ABS, True, "published must be a number"),
        (ABS, float("nan"), "published is nan: a published number must be finite"),
        ({"kind": "rel", "tolerance": 0.1, "reason": "x"}, 0, "use kind abs"),
        ({"kind": "less", "threshold": 1}, "small", "published must be a number or left out"),
        (ORDER, ["whittaker", "mirtich"], "published contradicts check.rows"),
        ({**ORDER, "rows": ["mirtich"]}, None, "check.rows"),
        ({**ORDER, "rows": ["mirtich", []]}, None, "a group must not be empty"),
        ({**ORDER, "rows": ["mirtich", ["mirtich", "newton"]]}, None, "rows names a row twice"),
        ({**ORDER, "rows": ["mirtich", None]}, None, "text, a number, true or false"),
        ({"kind": "argmin", "key": "law", "row": "a"}, "b", "published contradicts check.row"),
        ({"kind": "true"}, False, "published can only be true"),
    ],
)
def test_a_bad_check_is_refused(write_ledger, make_claim, check, published, words):
    text = refusal(write_ledger([make_claim("x", check, published)]))
    assert "claim table_3_1.x" in text
    assert words in text


@pytest.mark.parametrize(
    ("check", "published", "text"),
    [
        ({"kind": "greater", "threshold": 0}, None, "greater than 0"),
        ({"kind": "greater", "threshold": 0.0}, 0, "greater than 0"),
        ({"kind": "greater", "threshold": 30}, 30, "greater than 30"),
        ({"kind": "less", "threshold": 151, "reason": "about 100"}, None, "less than 151: about 100"),
    ],
)
def test_a_threshold_that_is_stated_or_zero_needs_no_reason(write_ledger, make_claim, check, published, text):
    (claim,) = read_ledger(write_ledger([make_claim("x", check, published)])).claims
    assert claim.check.text() == text


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"notes": "a typo"}, "notes: unknown key"),
        ({"id": "no dots"}, "claim no dots: id"),
        ({"chapter": 0}, "chapter"),
        ({"statement": ""}, "statement"),
        ({"source": {"file": "../elsewhere.csv", "column": "mu"}}, "source.file"),
        ({"source": {"file": "/etc/table.csv", "column": "mu"}}, "source.file"),
        ({"source": {"file": "table.png", "column": "mu"}}, "source.file"),
        ({"source": {"file": "table.csv"}}, "source.column: the key is missing"),
        ({"source": {"file": "table.csv", "column": "mu", "where": {"law": None}}}, "source.where.law"),
        (
            {"source": {"file": "table.csv", "column": "mu", "were": {}}},
            "source.were: unknown key; did you mean 'where'?",
        ),
    ],
)
def test_a_bad_claim_is_refused(write_ledger, make_claim, change, words):
    assert words in refusal(write_ledger([{**make_claim("x", ABS, 0.062), **change}]))


@pytest.mark.parametrize("check", [{"kind": "interval", "k": 2, "reason": "x"}, {**ORDER, "k": 2, "reason": "x"}])
def test_standard_errors_need_their_column(write_ledger, make_claim, check):
    entry = make_claim("x", check, 0.062 if check["kind"] == "interval" else None)
    del entry["source"]["std_column"]
    assert "source.std_column is missing" in refusal(write_ledger([entry]))


def test_everything_wrong_is_listed_at_once(write_ledger, make_claim):
    first = make_claim("first", {"kind": "abs", "tolerance": 0.01}, 0.062)
    second = make_claim("second", ABS, 0.062, colour="blue")
    third = make_claim("third", ABS)
    text = refusal(write_ledger([first, second, third], extra=1))
    for words in (
        "4 mistakes",
        "claim table_3_1.first: check.reason: the key is missing",
        "claim table_3_1.second: colour: unknown key",
        "claim table_3_1.third: published must be a number",
        "extra: unknown key",
    ):
        assert words in text


def test_a_duplicated_id_alone_is_refused(write_ledger, make_claim):
    text = refusal(write_ledger([make_claim("x", ABS, 0.062), make_claim("x", ABS, 0.07)]))
    assert "claim table_3_1.x occurs more than once" in text


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("schema: 1\nclaims: [", "is not valid YAML"),
        ("schema: 1\nclaims: []\nclaims: []\n", "the key 'claims' occurs in line 2 and again in line 3"),
        ("schema: 2\nclaims: []\n", "schema"),
        ("claims: []\n", "schema: the key is missing"),
        ("", "the whole file"),
        ("- 1\n", "the whole file"),
        ("schema: 1\nclaims: 3\n", "claims"),
        ("schema: 1\nclaims: [3]\n", "claims[0] is 3"),
        (None, "does not exist"),
    ],
)
def test_a_bad_file_is_refused(tmp_path, text, words):
    path = tmp_path / "claims.yaml"
    if text is not None:
        path.write_text(text, encoding="utf-8")
    message = refusal(path)
    assert words in message
    assert "claims.yaml" in message


def test_an_exponent_without_a_dot_is_a_number(tmp_path, write_ledger, make_claim):
    """YAML 1.1 reads 1e-3 as text."""
    path = write_ledger([make_claim("x", ABS, 62.0)])
    path.write_text(path.read_text().replace("published: 62.0", "published: 62e-3").replace("0.01", "1e-2"))
    claim = read_ledger(path).claims[0]
    assert claim.published == 0.062
    assert claim.check.tolerance == 0.01


class TestSharedChecks:
    def test_claims_share_them_and_defaults_hold_where_nothing_else_is_said(self, write_ledger, make_claim):
        cost = "the cost is flat"
        shared = make_claim("shared", ABS, 0.062, note=cost, needs=["drops"])
        plain = make_claim("plain", {"kind": True}, note="a note of its own")
        for entry in (shared, plain):
            del entry["chapter"]
        del plain["needs"]
        path = write_ledger([shared, plain], defaults={"chapter": 4, "needs": ["planar_dice"]}, checks=[ABS])
        assert "*id" in path.read_text()  # an alias
        first, second = read_ledger(path).claims
        assert (first.check.tolerance, first.note, first.needs) == (0.01, cost, ["drops"])
        assert (second.note, second.needs, second.chapter) == ("a note of its own", ["planar_dice"], 4)

    def test_an_unknown_one_is_an_error_with_its_line(self, write_ledger, make_claim):
        path = write_ledger([make_claim("x", ABS, 0.062)], checks=[ABS])
        path.write_text(path.read_text().replace("*id001", "*rounding"))
        assert "undefined alias) in line " in refusal(path)

    @pytest.mark.parametrize("file", sorted((ROOT / "config/claims").glob("*.yaml")), ids=lambda file: file.stem)
    def test_all_are_used(self, file):
        text = file.read_text(encoding="utf-8")
        assert [name for name in re.findall(r"^  - &(\w+)", text, re.M) if f"*{name}" not in text] == []

    def test_a_bad_one_is_told_once_however_many_claims_share_it(self, write_ledger, make_claim):
        bad = {"kind": "abs", "tolerance": 0, "reason": "none"}
        path = write_ledger([make_claim(name, bad, 0.062) for name in ("x", "y", "z")], checks=[bad])
        assert "1 mistake:\n- line 5: checks[0].tolerance is 0, but must be above 0" in refusal(path)

    def test_a_bad_default_is_told_once(self, write_ledger, make_claim):
        claims = [make_claim(name, ABS, 0.062) for name in ("x", "y")]
        for claim in claims:
            del claim["chapter"]
        assert "1 mistake:" in refusal(write_ledger(claims, defaults={"chapter": 20}))

    def test_each_mistake_has_its_line(self, write_ledger, make_claim):
        path = write_ledger([make_claim("x", {**ABS, "tolerance": 0}, 0.062), make_claim("y", ABS)])
        lines = path.read_text().split("\n")
        tolerance = lines.index("    tolerance: 0") + 1
        assert f"- line {tolerance}: claim table_3_1.x: check.tolerance is 0, but must be above 0" in refusal(path)
        second = [i for i, line in enumerate(lines, 1) if line.startswith("- ")][1]
        assert f"- line {second}: claim table_3_1.y: published must be a number" in refusal(path)


class TestFolder:
    def test_files_are_one_ledger_in_the_order_of_their_names(self, tmp_path, write_ledger, make_claim):
        for name in ("b", "a"):
            write_ledger([make_claim(name, ABS, 0.062)], name=f"{name}.yaml")
        assert [claim.id for claim in read_ledger(tmp_path).claims] == ["table_3_1.a", "table_3_1.b"]

    def test_mistakes_of_all_files_are_listed(self, tmp_path, write_ledger, make_claim):
        for name in ("a", "b"):
            write_ledger([make_claim(name, ABS)], name=f"{name}.yaml")
        text = refusal(tmp_path)
        assert text.count("1 mistake") == 2 and "a.yaml" in text and "b.yaml" in text

    def test_an_id_stands_in_one_file(self, tmp_path, write_ledger, make_claim):
        for name in ("a", "b"):
            write_ledger([make_claim("x", ABS, 0.062)], name=f"{name}.yaml")
        assert "claim table_3_1.x occurs more than once" in refusal(tmp_path)

    def test_an_empty_one_is_refused(self, tmp_path):
        assert "contains no .yaml file of claims" in refusal(tmp_path)
