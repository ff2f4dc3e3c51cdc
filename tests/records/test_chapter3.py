"""What is said of chapter 3: the words turn where the numbers do, for whichever laws and impacts a run has."""

import re

import pandas as pd
import pytest
from finding_of import finding, table

from thesis_lib.thesis.impact_study import statements
from thesis_lib.thesis.ledger.format import read_ledger
from thesis_lib.thesis.records import chapter3

NEWTON, POISSON = "anitescu_potra_newton", "anitescu_potra_poisson"


def said_in(rows: dict[str, tuple[float, float]]) -> pd.DataFrame:
    """statements.csv: value and standard error by "statement" or "statement:law"."""
    return table(
        "statement law value std",
        *((name.split(":")[0], name.partition(":")[2] or None, value, std) for name, (value, std) in rows.items()),
    )


def test_the_thesis_is_quoted_as_in_the_ledger():
    published = {claim.id: claim.published for claim in read_ledger("config/claims").claims}
    assert published["figure_3_7.convergence.all_followed"] == chapter3.CONVERGED
    assert chapter3.INCLINED_PLANE == statements.MU_INCLINED_PLANE
    fractions = [value for name, value in published.items() if re.fullmatch(r"table_3_2\.\w+\.as_published", name)]
    assert (min(fractions), max(fractions)) == chapter3.THESIS_RANGE


def test_laws_and_limits_are_those_of_the_statements():
    assert chapter3.STUDIED == statements.STUDIED
    assert chapter3.MU_ZERO == statements.MU_ZERO
    assert chapter3.MAPPED == statements.MAPPED


def test_a_law_without_code_of_its_own_stands_for_both_variants():
    coverage = pd.DataFrame(
        {"law": [NEWTON, "mirtich", "mirtich_as_published", "whittaker"], "share": [0.2, 0.1, 0.3, 0.25]}
    )
    said = finding("figure_3_3", coverage)
    assert "20 % (AP Newton) to 30 % (Mirtich) of the admissible set as published" in said
    assert "10 % (Mirtich) to 25 % (Whittaker) as defined: every law leaves out 70.0 %" in said


@pytest.mark.parametrize(
    ("between", "end"),
    [((-0.08, 0.01), "%, below zero."), ((-0.01, 0.01), "%, indistinguishable from zero."), (None, "on average.")],
)
def test_energy_between_impacts_is_told_apart_from_zero_by_its_interval(between, end):
    rows = {"energy_loss": (0.99, 0.01), "energy_taken": (0.4, 0.01)}
    said = finding("figure_3_6", said_in(rows | ({"energy_between": between} if between else {})))
    assert said.endswith(end) and ("flight" in said) == (between is not None)


def followed(k: int, mu: float = 0.1) -> pd.DataFrame:
    """Two subsets of one law, which differ except at the end."""
    rows = [(NEWTON, subset, n, mu * (1 + 0.5 * subset * (n < k))) for subset in (0, 1) for n in (50, k)]
    return table("law subset k mu", *rows)


@pytest.mark.parametrize(
    ("first", "last", "word"),
    [
        (100, 150, ", no later than the thesis's about 100."),
        (100, 400, ", for some laws later than the thesis's about 100."),
        (200, 400, ", later than the thesis's about 100."),
    ],
)
def test_convergence_is_judged_by_the_thesis(first, last, word):
    nan = float("nan")
    rows = {"local_minima": (1, nan), "convexity_violations": (0.1, nan)}
    rows |= {"converged_at:mirtich": (first, nan), f"converged_at:{NEWTON}": (last, nan), "converged_at": (last, nan)}
    said = finding("figure_3_7", followed(500), said_in(rows))
    assert f"from {first} (Mirtich) to {last} (AP Newton) impacts on, of 500 followed{word}" in said
    assert said.endswith("At 50 impacts the subsets' μ of AP Newton are 0.100 to 0.150, in the end 0.100.")


def test_a_short_run_does_not_judge_convergence():
    rows = {"local_minima": (2, 0), "convexity_violations": (0.1, 0), f"converged_at:{NEWTON}": (75, 0)}
    said = finding("figure_3_7", followed(75), said_in(rows))
    assert said.startswith("(a) The grid has 2 local minima")
    assert said.endswith("from 75 (AP Newton) impacts on, of 75 followed.")  # subsets agree there for sure


@pytest.mark.parametrize(
    ("mirrored", "word"),
    [
        ((0.1, 0.05), "falls to 0.10"),
        ((0.6, 0.05), "does not differ significantly, at 0.60"),
        ((0.9, 0.05), "rises to 0.90"),
    ],
)
def test_bounds_are_no_laws_and_the_mirrored_one_is_judged(mirrored, word):
    laws = ("mirtich", 1.0), (NEWTON, 1.5), ("mirtich_as_published", 2.0)
    summary = table("model mean", ("irb_bound", 0.5), ("best_post_hoc_as_defined", 0.6), *laws)
    said = finding("figure_3_8", summary, said_in({"irb_bound": (0.5, 0.05), "irb_bound_mirrored": mirrored}))
    assert "0.50 times the least mean error of a law (1.00 m/s, Mirtich)" in said
    assert "the largest is 2.00 m/s (published Mirtich), and Best Post Hoc has 0.600 m/s" in said
    assert f"the bound {word}" in said


def mapped(left: list[float], right: list[float]) -> pd.DataFrame:
    rows = [("impact", -1.0, error) for error in left] + [("impact", 1.0, error) for error in right]
    return table("series momentum_t error", *rows, ("map", -1.0, 99.0))


def test_sides_of_the_map_are_compared_by_their_impacts():
    near = said_in({f"small_momentum:{POISSON}": (1.05, 0.1)})
    said = finding("figure_3_9", mapped([2.0, 2.1, 1.9], [1.0, 1.1, 0.9]), near)
    assert "times that of the others, not significantly different; the thesis" in said
    assert said.endswith("it is 2.00 (1.75 to 2.25) times that on the right.")
    said = finding("figure_3_9", mapped([1.0, 2.0], [1.1, 1.9]), near)
    assert said.endswith("on the right, not significantly different.")


def test_a_map_with_one_side_is_not_compared():
    assert "Left" not in finding("figure_3_9", mapped([], [1.0, 1.1]), said_in({f"small_momentum:{POISSON}": (3, 0.1)}))


def single(mu: list[float], misfit: list[float]) -> pd.DataFrame:
    each = pd.DataFrame({"panel": "a", "series": "individual", "mu": mu, "misfit": misfit})
    return pd.concat([each, pd.DataFrame([{"panel": "a", "series": "ensemble", "mu": 0.1}])], ignore_index=True)


@pytest.mark.parametrize(("mean", "word"), [(-0.05, "below"), (0.01, "indistinguishable from"), (0.05, "above")])
def test_the_mean_of_single_parameters_is_told_apart_from_the_ensembles(mean, word):
    rows = {
        f"individual_minus_ensemble_mu:{NEWTON}": (mean, 0.01),
        f"epsilon_mode:{NEWTON}": (0.45, 0),
        f"epsilon_modes:{NEWTON}": (2, 0),
    }
    said = finding("figure_3_10", single([0.0, 0.1, 0.2], [4.0, 2.0, 2.0]), said_in(rows))
    assert said.startswith("1 of 3 (")
    assert "with 2.00 times the mean misfit of the others" in said
    assert f", is {word} the ensemble's 0.100" in said
    assert "2 peaks, the highest at 0.450" in said
    assert "misfit" not in finding("figure_3_10", single([0.1, 0.2], [1.0, 1.0]), said_in(rows))


@pytest.mark.parametrize(("share", "word"), [(0.1, "fewer"), (0.35, "not significantly different"), (0.7, "more")])
def test_reversals_are_compared_with_those_predicted(share, word):
    rows = {"beyond_sticking": (0.2, 0.02), "back_spin": (0.4, 0.02), f"predicted_back_spin:{NEWTON}": (share, 0.03)}
    none = said_in({**rows, f"predicted_beyond_sticking:{NEWTON}": (0.0, 0.01)})
    assert "no law predicts that" in finding("figure_3_11", none)
    assert finding("figure_3_11", none).endswith(f"%, {word}.")
    some = said_in(
        {**rows, "predicted_beyond_sticking:mirtich": (0.1, 0), f"predicted_beyond_sticking:{NEWTON}": (0.0, 0)}
    )
    assert "1 of 2 laws never predict that, Mirtich does most often (10" in finding("figure_3_11", some)


def parameters(mu: dict[str, float], std: float) -> pd.DataFrame:
    variants = ("as_published", "unweighted"), ("as_defined", "kinetic"), ("as_defined", "unweighted")
    rows = [(*of, law, value, std, 10 * value, 99 - value) for of in variants for law, value in mu.items()]
    return table("variant weighting law mu mu_std best worst", *rows)


@pytest.mark.parametrize(("std", "below"), [(0.01, 2), (0.05, 1)])
def test_friction_is_told_apart_from_the_inclined_planes(std, below):
    said = finding("table_3_1", parameters({NEWTON: 0.1, "whittaker": 0.25, "mirtich": 9.0}, std))
    assert (
        f"0.100 (AP Newton) to 0.250 (Whittaker), leaving out Mirtich, whose published μ has another unit: {below} of 2"
        in said
    )
    assert "it is 0.100 (AP Newton) to 9.00 (Mirtich). Among" in said
    assert "Mirtich is nearest most often" in said


def test_laws_with_the_same_share_are_named_together():
    variants = ("as_published", "unweighted"), ("as_published", "kinetic"), ("as_defined", "kinetic")
    laws = ((NEWTON, 0.4), ("whittaker", 0.4), ("mirtich", 0.2))
    rows = [(*of, law, limit, share) for of in variants for law, share in laws for limit in (0.00275, 0.0275)]
    said = finding("table_3_2", table("variant weighting law tolerance fraction", *rows))
    assert "20 % (Mirtich) to 40 % (AP Newton and Whittaker) of the impulses within 2.75 mm/s" in said
