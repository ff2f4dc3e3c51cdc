"""What is said of chapter 2: the words turn where the numbers do."""

import pandas as pd
import pytest
from finding_of import finding, table

from thesis_lib.thesis.figures.chapter2.impact import NAMES
from thesis_lib.thesis.identify.impacts.measured_ratio import gather
from thesis_lib.thesis.ledger.format import read_ledger
from thesis_lib.thesis.records import chapter2


def test_the_thesis_is_quoted_as_in_the_ledger():
    published = {claim.id: claim.published for claim in read_ledger("config/claims").claims}
    assert published["figure_2_12.arm.ours"] == chapter2.THESIS_FORCES


def test_every_hypothesis_of_the_figure_has_a_name():
    assert set(chapter2.HYPOTHESES) == set(NAMES)


def modes(left: list[str], right: list[str]) -> pd.DataFrame:
    rows = [
        ("modes", end, 0.1 * i, mode)
        for end, own in (("left end", left), ("right end", right))
        for i, mode in enumerate(own)
    ]
    return table("panel series t mode", *rows)


def test_an_end_of_the_rod_lands_once_and_its_first_mode_is_timed():
    said = finding("figure_2_2", modes(["open", "sticks", "sticks", "slides", "sticks"], ["open"] * 5))
    assert said == "The left end lands at 0.100 s and sticks for 0.200 s. The right end does not land."


def landing(rank: int, rank_mass_known: int, panel: str) -> dict:
    return {"panel": panel, "series": "square", "rank": rank, "rank_mass_known": rank_mass_known, "sigma_1": 0.8 * rank}


def test_what_a_landing_determines_is_read_from_the_ranks():
    said = finding("figure_2_5", pd.DataFrame([landing(0, 0, "c"), landing(1, 1, "d")]))
    flat, tilted = said.split("landing tilted")
    assert "no combination" in flat
    assert flat.rstrip("; ").endswith("not I either")
    assert "a combination" in tilted
    assert tilted.endswith("I as well.")


@pytest.mark.parametrize(
    ("angles", "trend"),
    [((1.0, 2.0, 3.0), "more with more mass"), ((3.0, 2.0, 1.0), "less with"), ((1.0, 3.0, 2.0), "in no order")],
)
def test_the_trend_with_mass_is_that_of_the_angles(angles, trend):
    motions = pd.DataFrame({"mass": [0.1, 0.5, 2.0], "t": 4.0, "theta": [-a for a in angles]})
    said = finding("figure_2_10", motions)
    assert trend in said
    assert said.endswith("2.00 rad apart, 67 % of the largest angle.")


def test_steps_without_force_do_not_count_as_covered():
    """Of four steps with a force one is off by more than two standard errors; the fifth carries none."""
    truth, fit = [1.0, 1.0, 1.0, 1.0, 0.0], [1.01, 1.01, 1.01, 1.05, 0.0]
    series = {"truth": truth, "fit": fit, "plain": [0.5] * 5}
    rows = [(1, name, "rolling", i, value, 0.01) for name, of in series.items() for i, value in enumerate(of)]
    summary = table("method within_2_std", ("plain", float("nan")), ("fit", 0.9))
    said = finding("figure_2_11", table("spoke series kind t force_or_impulse std", *rows), summary)
    assert "by 50 %" in said
    assert "in 75 % of the contact steps shown, and in 90 % for" in said


@pytest.mark.parametrize(
    ("arm", "ground", "word"), [(0.1, 0.2, "within"), (0.1, 0.3, "partly within"), (0.3, 0.4, "beyond")]
)
def test_forces_are_judged_by_the_thesis(arm, ground, word):
    errors = (("arm", arm), ("ground", ground))
    rows = [(pair, "normal", t, 10.0, 10.0 * (1 + error), 0.0) for pair, error in errors for t in (0.0, 1.0)]
    said = finding("figure_2_12", table("pair component t true estimate plain", *rows))
    assert f"all steps, {word} the thesis's 20 %" in said
    assert f"normal force at the ground, {10 * (1 + ground):.1f} N instead of 10.0 N" in said


def noise_rows(**methods: list[float]) -> pd.DataFrame:
    """Errors over the bound by method, one a noise level, of 200 drops: their standard error is a twentieth."""
    rows = [("block", name, 10 * i, 200, value) for name, values in methods.items() for i, value in enumerate(values)]
    return table("shape method snr n error_over_bound", *rows)


def test_errors_are_told_apart_from_the_bound_by_their_drops():
    said = finding("figure_table_2_1", noise_rows(arcs=[1.0, 1.09, 1.15, 0.85], plain=[5.0, 50.0, 7.0, 8.0]))
    assert "of 4 errors 1 lie above it, 1 below, and 2 are indistinguishable" in said
    assert "by 5.0 to 50 times" in said


@pytest.mark.parametrize(
    ("std", "word", "cases"), [(0.3, "indistinguishable from zero", "0 of 2"), (0.2, "above zero", "1 of 2")]
)
def test_a_bias_is_told_apart_by_its_standard_error(std, word, cases):
    errors = (("arcs", 10, 0.0), ("arcs", 40, 0.5), ("plain", 10, -9.0), ("plain", 40, 9.0))
    rows = [("block", *row, std, -0.35) for row in errors]
    said = finding("table_2_1", table("shape method snr mean_error mean_error_std thesis", *rows))
    assert f", {word}, by 9.0" in said
    assert "At 40 dB" in said
    assert f"in {cases} cases by maximum likelihood, in 2 of 2 by the plain program" in said


@pytest.mark.parametrize(
    ("failed", "wrong", "words"),
    [
        (3, 1, "Most failures: arm with disk 3 of 3. Wrong claims of success: 1 of 110"),
        (0, 0, "Most failures: none. Wrong claims of success: 0 of 110"),
    ],
)
def test_failures_are_those_of_one_mechanism_or_none(failed, wrong, words):
    rows = [("qp", "block", 10, 10, 10, 0), ("2.14", "block", 50, 50, 50, 0)]
    rows.append(("2.14", "arm_disk", 50, 50 - failed, 50, wrong))
    said = finding("programs", table("name mechanism n_starts n_success n_claims n_false_claims", *rows))
    assert f"qp 10 of 10; 2.14 {100 - failed} of 100. {words}" in said


def impulse_rows(coverage: float, mean_error: float) -> pd.DataFrame:
    row = {"method": "arcs", "unit": "N s", "n": 100, "mean": 1.0, "mean_error_std": 0.01, "std": 0.1}
    row |= {"thesis_mean_error": -12.12, "thesis_std": 31.59, "coverage_95": coverage, "mean_error": mean_error}
    return pd.DataFrame([row | {"reference": name} for name in ("true_c_n", "peak_true", "peak_sensor")])


@pytest.mark.parametrize(
    ("coverage", "held", "mean_error", "bias"),
    [
        (0.92, "as stated", 0.015, "indistinguishable from zero"),
        (0.90, "fewer than stated", 0.03, "above zero"),
        (1.00, "more than stated", -0.03, "below zero"),
    ],
)
def test_coverage_is_judged_by_the_number_of_impacts(coverage, held, mean_error, bias):
    """Of 100 intervals of 95 % between 91 and 99 hold the truth."""
    said = finding("impact_force_summary", impulse_rows(coverage, mean_error))
    assert f"hold the truth, {held}." in said
    assert f"its mean error is {bias}" in said
    assert "(thesis: −12.1 N, 31.6 N)" in said


def ratio_row(variant: str, ratio: float, misfit: float, status: str = "ok") -> dict:
    row = {"dataset": "planar_dice", "variant": variant, "ratio": ratio, "low": ratio - 50.0, "high": ratio + 50.0}
    return row | {"published": 1000.0, "scale": misfit, "velocity_noise": float("nan"), "status": status}


def test_a_hypothesis_that_holds_the_header_does_not_hide_its_misfit():
    rows = [ratio_row("as_published", 900.0, 4.0), ratio_row("mirrored_rotation", 1010.0, 20.0)]
    rows += [ratio_row("angle_offset", 1200.0, 2.0), ratio_row("rounded_corners", 1000.0, 1.0, "not converged")]
    said = finding("measured_ratio", pd.DataFrame(rows))
    assert "900 (850 to 950) 1/m² under the data as they are, below the header. The" in said
    assert "under angle offset, which leaves the least misfit, above the header; " in said
    assert said.endswith("in the interval of rotation mirrored (misfit 10 times the least).")


def test_without_a_better_hypothesis_the_data_stand_alone():
    there = pd.DataFrame([ratio_row("as_published", 1020.0, 1.0)])
    said = finding("measured_ratio", there)
    assert "the data as they are, which leaves the least misfit, indistinguishable from the header" in said
    assert said.endswith("in the interval of the data as they are.")
    failed = pd.DataFrame([ratio_row("as_published", 1.0, 1.0, "not converged")])
    assert "No measured dataset" in finding("measured_ratio", failed)
    assert finding("measured_ratio", gather([there], ["planar_impact"])).endswith("planar_impact: data not present.")


def hidden_row(truth: str, right: float, before: float, after: float, snr: float = 40.0) -> dict:
    row = {"mechanism": "arm", "truth": truth, "snr_db": snr, "datasets": 4, "right": right}
    return row | {"force_error_before": before, "force_error_after": after}


@pytest.mark.parametrize(("after", "change"), [(0.001, "fall"), (0.02, "rise")])
def test_what_is_hidden_is_counted_and_forces_are_those_of_the_noisiest_data(after, change):
    rows = [hidden_row("nothing", 0.75, 0.0, 0.0), hidden_row("payload", 1.0, 0.01, after)]
    rows += [hidden_row("payload", 1.0, 0.5, 0.5, snr=60.0)]
    said = finding("figure_hidden", pd.DataFrame(rows))
    assert said.startswith("The critique is right on 11 of 12 (")
    assert "with nothing hidden on 3 of 4" in said
    assert "cogging" not in said
    assert f"At 40 dB the errors of contact forces {change} with the effect that was found from 1.0 %" in said
