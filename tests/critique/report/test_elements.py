"""Pieces of the report: numbers with their uncertainty, names as people write them, tables."""

from report_pages import Page

from thesis_lib.critique.drops.words import feature_text, plain_rule, reasons_listed
from thesis_lib.report.elements import amount, estimate, interval, paragraph, percent, plus_minus
from thesis_lib.report.elements import table as html_table


def test_rows_head_their_table_and_no_rows_give_no_table():
    page = Page(html_table("c & d", ("a", "b"), [("x", "1 < 2")], numeric=(1,)))
    assert "c & d" in page.text and "1 < 2" in page.text
    assert [attrs["scope"] for attrs in page.all("th")] == ["col", "col", "row"]
    assert html_table("c", ("a",), []) == ""


def test_numbers_show_their_uncertainty():
    assert estimate(0.2496, 0.0023) == "0.2496 [0.2451, 0.2541]"
    assert estimate(0.11994, 3e-5) == "0.11994 [0.11988, 0.12000]"
    assert estimate(1.0, 0.0, "rad") == "1.00 rad"
    assert estimate(4.995e-4, 1.3e-6, "m") == "0.4995 [0.4970, 0.5020] mm"
    assert estimate(1.8e-6, 1.2e-6, "m") == "0.0018 [−0.0006, 0.0042] mm"
    assert amount(0.0358, "rad") == "35.8 mrad"
    assert plus_minus(0.24961, 0.00233) == "0.2496 ± 0.0046"
    assert interval(0.10859, 0.15625, "m/s") == "[0.109, 0.156] m/s"
    assert interval(float("nan"), 1.0) == ""
    assert amount(None, "m/s") == "unknown"
    assert [percent(x) for x in (0.0, 1e-5, 0.0123, 0.5, 1.0)] == ["0 %", "less than 0.1 %", "1.2 %", "50 %", "100 %"]


def test_rules_and_reasons_are_written_as_people_write_them():
    assert plain_rule({"rule": "theta < -0.5 rad and |omega| > 3 rad/s"}) == "θ < −0.5 rad and |ω| > 3 rad/s"
    counts = {"second_hit": 50, "not_ballistic": 49, "lost_frames": 1}
    said = "50 × second hit too near to tell apart; 49 × no free flight on a side (held, rolling, bad track); "
    assert reasons_listed(counts) == said + "1 for other reasons"
    assert reasons_listed({}) == ""
    assert feature_text("theta") == "body angle (theta)" and feature_text("mood") == "mood"


def test_a_number_and_its_unit_stay_on_one_line():
    assert paragraph("an error of 0.03 m/s, 3.2 % more") == "<p>an error of 0.03\u00a0m/s, 3.2\u00a0% more</p>"
    assert paragraph("in 5 minutes") == "<p>in 5 minutes</p>"
