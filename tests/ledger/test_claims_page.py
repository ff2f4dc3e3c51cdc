"""The page: complete, escaped, well-formed, reproducible, without network; readable without its script."""

import re

import pytest

from tests.critique.report_pages import Page
from thesis_lib.thesis.ledger.result import render_page

CHECK = {"kind": "abs", "tolerance": 0.01, "reason": "rounding & noise"}


def ids_in(page: Page) -> set[str]:
    ids = [attrs["id"] for _, attrs in page.tags if "id" in attrs]
    assert len(ids) == len(set(ids))
    return set(ids)


@pytest.fixture
def found(entries, make_claim, judged):
    odd = '<script>alert("x")</script> & <b>bold</b>'
    claims = [
        *entries,
        make_claim("wrong", CHECK, 1.0, chapter=2, statement=f"Statement {odd}", note=f"Note {odd}", unit="m/s"),
        make_claim("absent", CHECK, 1.0, needs=["dice"], chapter=6),
        make_claim("broken", CHECK, 1.0, column="missing", location=f"Table {odd} | 3"),
    ]
    return judged(claims, {"planar_impact": True, "dice": False})


def test_it_is_well_formed_and_complete(found):
    page = Page(render_page(found, "quick"))
    assert "12 claims: 9 reproduced, 1 deviates, 1 without data, 1 could not be compared." in page.text
    statuses = ("✓ reproduced", "≠ deviates", "○ data not present", "! error", "quick")
    assert all(words in page.text for words in ("Chapter 2", "Chapter 3", "The measured cube", *statuses))
    assert len(ids_in(page)) == 12 + 1  # a row each, and the content
    assert page.text.index("Chapter 2") < page.text.index("Chapter 3") < page.text.index("The measured cube")
    assert "Chapter 6" not in page.text


def test_every_text_is_escaped(found):
    html = render_page(found)
    page = Page(html)
    tags = [tag for tag, _ in page.tags]
    assert "b" not in tags
    assert tags.count("script") == 1  # the filter's
    assert '<script>alert("x")</script>' in page.text  # shown, not run
    assert "&amp; noise" in html


def test_it_works_offline_and_for_readers_of_any_kind(found):
    html = render_page(found)
    assert not re.search(r"https?://|src=|@import|url\(", html)
    page = Page(html)
    tags = [tag for tag, _ in page.tags]
    assert tags.count("caption") == tags.count("table") == 3
    assert all(attrs.get("scope") in ("col", "row") for tag, attrs in page.tags if tag == "th")
    assert ("html", {"lang": "en"}) in page.tags
    targets = {attrs["href"][1:] for tag, attrs in page.tags if tag == "a"} - {"main"}
    assert targets == {"table_3_1.wrong", "table_3_1.broken"}  # what one should look at
    assert targets <= ids_in(page)


def test_links_to_one_place_of_the_thesis_can_be_told_apart(make_claim, judged):
    claims = [make_claim(name, CHECK, 1.0, location="section 3.3.2") for name in ("one", "two", "three")]
    html = render_page(judged(claims))
    links = re.findall(r"<li><a [^>]*>(.*?)</a></li>", html)
    assert len(links) == len(set(links)) == 3
    assert "table_<wbr>3_<wbr>1.two" in links[1]


def test_the_numbers_carry_their_units(found):
    html = render_page(found)
    assert "0.065 ± 0.002 m/s" in html
    assert "−0.935 m/s (−93.5\u00a0%)" in html


def test_a_share_is_shown_where_the_check_is_relative_or_fails(make_claim, judged):
    checks = {
        "near": {"kind": "abs", "tolerance": 2.0, "reason": "noise"},
        "above": {"kind": "greater", "threshold": 0.05, "reason": "the thesis says so"},
    }
    claims = [make_claim(name, check, 0.02 if name == "near" else None) for name, check in checks.items()]
    html = render_page(judged(claims))
    differences = re.findall(r'<td class="number">([^<]*)</td>\s*<td class="status reproduced"', html)
    assert differences == ["+0.045", "0.015 above 0.05"]


def test_what_says_little_comes_last(make_claim, judged):
    claims = [make_claim("weak", CHECK, 0.065, weak="a wrong law would pass, too"), make_claim("strong", CHECK, 0.065)]
    html = render_page(judged(claims))
    strong, between, weak = (
        html.index(part) for part in ('id="table_3_1.strong"', "Weak evidence: a wrong", 'id="table_3_1.weak"')
    )
    assert strong < between < weak


def test_an_empty_ledger_has_a_page():
    assert "0 claims" in render_page([])
