"""Numbers and judgements in sentences: digits that mean something, and words that turn where the interval does."""

import math

import pytest

from thesis_lib.statistics.wording import count, ends, estimate, interval, listed, number, percent, plural, side, times

NO_BREAK = "\N{NO-BREAK SPACE}"
WORDS = ("below", "around", "above")


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.08314, "0.0831"),
        (-12.04, "−12.0"),
        (9.996, "10.0"),  # the digits are those of the rounded value
        (1240.4, "1,240"),
        (0, "0"),
        (1.2e-15, "1.20·10⁻¹⁵"),
        (999_999.9, "1.00·10⁶"),
        (math.inf, "unknown"),
    ],
)
def test_numbers_have_three_digits(value, text):
    assert number(value) == text


def test_the_unit_does_not_leave_its_number():
    assert number(0.5, unit="m/s") == f"0.500{NO_BREAK}m/s"
    assert number(0.0, unit="%") == f"0{NO_BREAK}%"


def test_an_interval_shows_the_digits_in_which_its_ends_differ():
    assert interval(0.22841, 0.22104, 0.23512) == "0.228 (0.221 to 0.235)"
    assert interval(1469.5, 1180.2, 1758.4) == "1,470 (1,180 to 1,758)"
    assert interval(-0.0001, -0.1, 0.1) == "0.00 (−0.10 to 0.10)"  # what rounds to zero has no sign


@pytest.mark.parametrize("end", [0.5, math.nan, math.inf])
def test_without_a_width_the_value_stands_alone(end):
    assert interval(0.5, 0.5, end) == "0.500"


def test_an_estimate_has_the_interval_of_its_standard_error():
    assert ends(1.0, 0.1) == pytest.approx((0.804, 1.196), abs=1e-5)
    assert estimate(1.0, 0.1) == "1.00 (0.80 to 1.20)"


@pytest.mark.parametrize(
    ("low", "high", "word"),
    [
        (-0.2, -0.1, "below"),
        (-0.2, 0.1, "around"),
        (-0.1, 0.0, "around"),
        (0.1, 0.2, "above"),
        (math.nan, math.nan, "around"),
    ],
)
def test_the_word_turns_where_the_interval_does(low, high, word):
    assert side(low, high, 0.0, WORDS) == word


@pytest.mark.parametrize(
    ("share", "text"),
    [(0.123, "12"), (0.9963, "99.6"), (0.99999, "99.999"), (1.0, "100"), (0.0, "0"), (0.0005, "0.050")],
)
def test_only_all_is_a_hundred_percent(share, text):
    assert percent(share) == f"{text}{NO_BREAK}%"


def test_lists_read_like_sentences():
    assert [listed(list("abc")[:n]) for n in (1, 2, 3)] == ["a", "a and b", "a, b and c"]
    assert listed(["a", "b"], "or") == "a or b" and listed([]) == ""


def test_one_thing_is_singular():
    assert [plural(n, "free flight") for n in (0, 1, 2)] == ["0 free flights", "1 free flight", "2 free flights"]


def test_ratios_have_two_decimals_about_one():
    assert [times(x) for x in (0.301, 1.04, 41.2)] == ["0.30 times", "1.04 times", "41 times"]


def test_counts_have_wilsons_interval():
    # 0 of 10: z²/(n + z²) = 3.84/13.84
    assert count(0, 10) == f"0 of 10 (0 to 28{NO_BREAK}%)"
    assert count(1718, 1718) == f"1,718 of 1,718 (100 to 100{NO_BREAK}%)"
    assert count(0, 0) == "none of none"
