"""Findings of chapter 4: the words follow the numbers, on tables whose right words are known."""

import pandas as pd
import pytest
from finding_of import finding, table

from thesis_lib.thesis.records.chapter4 import LEARNERS, OVER_BOUND, THROWERS


def ratios(std: float = 0.01, hoc: float = 1.2, **over: float) -> pd.DataFrame:
    """learning_ratios.csv; a model that is not named lies at twice the bound."""
    rows = [(statement, 450, over.get(name, 2.0), std) for statement, name in OVER_BOUND.items()]
    rows.append(("best_post_hoc_over_rigid", 450, hoc, std))
    return table("statement n value std", *rows)


def errors(wrench: list[float]) -> pd.DataFrame:
    """learning_errors.csv of impacts whose bound is 1 m/s."""
    rows = [
        (model, trial, 0, value)
        for model, values in (("wrench_x1", wrench), ("irb_bound", [1.0] * len(wrench)))
        for trial, value in enumerate(values)
    ]
    return table("model trial impact error", *rows)


def rungs(floor: float | None = None, **means: float) -> pd.DataFrame:
    """figure_named_physics.csv with intervals of ± 0.1 m/s."""
    names = ("law", "law_wrench", "effects", "effects_wrench", "irb_bound")
    rows = [("a", name, 450.0, means[name], means[name] - 0.1, means[name] + 0.1) for name in names]
    if floor is not None:
        rows.append(("a", "noise_floor", float("nan"), floor, float("nan"), float("nan")))
    return table("panel model n mean low high", *rows)


def throws(**quantities: dict[str, tuple[float, float]]) -> pd.DataFrame:
    """dice.csv from value and half width of the interval, by quantity and model."""
    rows = [
        (model, quantity, value, value - half, value + half)
        for quantity, models in quantities.items()
        for model, (value, half) in models.items()
    ]
    return table("model quantity value low high", *rows)


def coverage(low: float, high: float, passes: tuple[int, int, int]) -> pd.DataFrame:
    rows = [
        ("law", "roll", level, 0.5 * (low + high), low, high, held) for level, held in zip((0.5, 0.8, 0.95), passes)
    ]
    return table("model kind level coverage low high passes", *rows)


def test_names_are_those_of_the_legends() -> None:
    from thesis_lib.thesis.figures.chapter4.dice import MODEL_STYLE
    from thesis_lib.thesis.figures.chapter4.errors import LEARNER_STYLE

    assert {name: LEARNER_STYLE[name].label for name in LEARNERS} == LEARNERS
    assert {name: style[2] for name, style in MODEL_STYLE.items()} == THROWERS


@pytest.mark.parametrize(
    ("of", "wrench", "words"),
    [
        (
            {"wrench_x1": 0.3, "residual_wrench": 0.4},
            [0.5, 0.5, 0.5, 2.0],
            ["below the bound are wrench, X1 and law + wrench residual.", "wrench, X1: 0.30 ± 0.01", "On 75"],
        ),
        # within two standard errors of the bound it is not below it
        ({"std": 0.1, "wrench_x1": 0.85}, [2.0], ["none is below it", "On none of the held-out impacts"]),
        ({"hoc": 1.2}, [2.0], ["Rigid, X1 errs less than Best Post Hoc"]),
        ({"hoc": 1.01}, [2.0], ["Rigid, X1 is indistinguishable from Best Post Hoc"]),
        ({"hoc": 0.8}, [2.0], ["Rigid, X1 errs more than Best Post Hoc"]),
        ({}, [0.5, float("nan")], ["On 50"]),  # an impact without a solution is none below the bound
    ],
)
def test_learned_models_against_the_bounds(of: dict, wrench: list[float], words: list[str]) -> None:
    said = finding("figure_4_5", ratios(**of), errors(wrench))
    assert all(word in said for word in words), said


@pytest.mark.parametrize(
    ("last", "reached", "word"),
    [
        (0.2, 100, "falls from 1.00 to 0.20 (0.10 to 0.30) m/s and is level from 100 impacts on"),
        (0.9, 450, "goes, within its intervals, from 1.00 to 0.90 (0.80 to 1.00)"),
        (2.0, 100, "rises from 1.00"),
        (0.2, 450, "and is not level before"),
    ],
)
def test_curves_fall_only_beyond_their_intervals(last: float, reached: int, word: str) -> None:
    models = ("rigid_x1", "wrench_x1", "residual_wrench")
    rows = [(name, n, m, m - 0.1, m + 0.1) for name in models for n, m in ((10, 1.0), (450, last))]
    level = [(name, reached, reached, reached) for name in models]
    levels = table("model n_converged n_converged_low n_converged_high", *level)
    said = finding("figure_4_6", table("model n mean low high", *rows), levels)
    assert said.count(word) == len(models), said


@pytest.mark.parametrize(
    ("floor", "means", "words"),
    [
        (
            0.05,
            {"law": 1.0, "law_wrench": 0.7, "effects": 0.3, "effects_wrench": 0.25},
            ("less than the law alone", "less than that residual", "indistinguishable from what was named alone")
            + ("0.50 times the IRB Bound", "5.00 times the noise floor."),
        ),
        (
            None,  # the noise is not known
            {"law": 1.0, "law_wrench": 0.4, "effects": 0.9, "effects_wrench": 0.4},
            ("more than that residual", "less than what was named alone"),
        ),
    ],
)
def test_named_effects_against_a_learned_wrench(floor, means, words) -> None:
    said = finding("figure_named_physics", rungs(floor, **means, irb_bound=0.5))
    assert all(word in said for word in words), said
    assert ("noise" in said) == (floor is not None)


def test_scatter_and_bias_at_rest() -> None:
    dice = throws(
        mean={"law": (1.0, 0.2), "residual_wrench": (0.1, 0.2), "compliant": (0.0, 0.1)},
        std={"law": (2.0, 0.1), "residual_wrench": (1.0, 0.1), "compliant": (0.8, 0.1)},
    )
    said = finding("figure_4_8", dice)
    assert "wrench residual is less than that of the law alone" in said
    assert said.endswith("leave out zero for law alone.")
    assert "compliant contact 0.00 (−0.10 to 0.10) ± 0.800, the least scatter" in said
    assert "(thesis −0.97 ± 4.44)" in said
    dice.loc[(dice["model"] == "residual_wrench") & (dice["quantity"] == "std"), "high"] = 1.95
    assert "wrench residual is indistinguishable from that of the law alone" in finding("figure_4_8", dice)


def test_nearest_model_and_its_limit() -> None:
    models = {
        "median_abs": {"law": (1.0, 0.1), "residual_wrench": (0.8, 0.1), "compliant": (0.5, 0.1)},
        "face_right": {"law": (0.25, 0.05), "residual_wrench": (0.4, 0.05), "compliant": (0.5, 0.05)},
        "face_right_certain": {"law": (0.3, 0.05)},
        "limit_std": {"law": (0.1, 0.0), "compliant": (0.2, 0.0)},
        "limit_face": {"law": (0.9, 0.0), "compliant": (0.8, 0.0)},
    }
    said = finding("dice", throws(**models))
    assert "Nearest comes the compliant contact: it misses the end by 0.50 (0.40 to 0.60)" in said
    assert "not significantly different" not in said
    assert "by 0.20 sides and keeps 80" in said
    models["median_abs"]["compliant"] = (0.85, 0.1)
    models["median_abs"]["residual_wrench"] = (0.9, 0.1)
    assert "indistinguishable from the law alone" in finding("dice", throws(**models))
    models["median_abs"]["law"] = (0.5, 0.1)
    assert "No model misses by less." in finding("dice", throws(**models))


@pytest.mark.parametrize(
    ("low", "high", "passes", "word"),
    [
        (0.75, 0.85, (1, 1, 1), "as many as stated, at the other levels too (law alone"),
        (0.75, 0.85, (0, 1, 1), "as many as stated, but not at every other level"),
        (0.6, 0.7, (0, 0, 0), "too few"),
        (0.85, 0.95, (0, 0, 1), "too many"),
    ],
)
def test_width_of_beliefs(low: float, high: float, passes: tuple[int, int, int], word: str) -> None:
    assert word in finding("figure_calibration", coverage(low, high, passes))


def contacts(measured: float, model: float) -> pd.DataFrame:
    """Ten first contacts over 1 m, with slopes per metre and a little scatter."""
    x = pd.Series(range(10)) / 10.0
    scatter = pd.Series([0.002, -0.002] * 5)
    rows = {"first": 1, "x": x, "measured": 0.5 + measured * x + scatter, "model": 0.5 + model * x + scatter}
    return pd.DataFrame(rows)


@pytest.mark.parametrize(
    ("measured", "model", "words"),
    [
        (0.2, 0.0, ("rises along the surface: 0.0199", "less than the measured one")),
        (-0.2, 0.0, ("falls along the surface: −0.02", "more than the measured one")),
        (0.2, 0.2, ("rises along the surface", "indistinguishable from the measured one")),
        (0.0, 0.0, ("neither rises nor falls for sure", "indistinguishable from the measured one")),
    ],
)
def test_slopes_of_restitution(measured: float, model: float, words: tuple[str, str]) -> None:
    said = finding("figure_restitution", contacts(measured, model))
    assert all(word in said for word in words), said
    two = contacts(measured, model).head(2)
    assert "too little for a slope: 2 first contacts" in finding("figure_restitution", two)


def test_the_budget_says_what_each_contact_costs_the_best_model() -> None:
    budget = table(
        "model contact std face_right std_start face_start",
        ("law", 0, 2.0, 0.2, 2.0, 0.2),
        ("compliant", 0, 0.9, 0.45, 0.9, 0.45),
        ("compliant", 1, 0.4, 0.8, 0.95, 0.43),
        ("nearest", 0, 0.83, 0.26, 0.83, 0.26),
        ("pairs", 0, 0.7, 0.3, 0.7, 0.3),
    )
    said = finding("figure_budget", budget)
    assert "The compliant contact names 45 % of the faces from the release, with a scatter of 0.90 sides" in said
    assert "80 % and 0.40 sides from contact 1 (43 % and 0.95 from their release)" in said
    assert "the nearest throws name 26 % and scatter by 0.83 sides; of pairs that start alike 30 %" in said


@pytest.mark.parametrize(
    ("measured", "inside", "low", "word"),
    [
        (0.5, "inside", 0.1, "wide beliefs go with large errors"),
        (3.5, "outside", -0.1, "does not tell large errors from small"),
        (-3.5, "outside", -0.9, "does not tell large errors from small"),
    ],
)
def test_ends_in_their_beliefs(measured: float, inside: str, low: float, word: str) -> None:
    grid = [0.1 * i - 4.0 for i in range(81)]
    rows = [(case, x, float(abs(x) < 1.0), 2.0, measured, 0.6) for case in ("hard", "easy") for x in grid]
    rank = ("compliant_residual", "spread_rest", "error", 0.3, low, 0.5)
    drawn = table("case distance density law measured std", *rows)
    said = finding("figure_4_10", drawn, table("model spread of rank_correlation low high", rank))
    assert f"ends {inside} the central 95" in said
    assert word in said


def test_growth_of_the_belief() -> None:
    drawn = pd.DataFrame({"state": ["start", "start", "at rest"], "std": [0.001, 0.001, 1.2]})
    said = finding("figure_4_4", drawn)
    assert "0.0010 at the start and 1.2 at rest" in said
    assert "about 1,000 times" in said
