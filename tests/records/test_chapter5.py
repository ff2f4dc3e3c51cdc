"""Findings of chapter 5: the words follow the numbers, also where one tower or no attempt leaves them open."""

import pandas as pd
import pytest
from finding_of import finding, table

from thesis_lib.thesis.records import chapter5

NAN = float("nan")
NEEDED = table("policy of size", ("mor", "hma", 100))
CURVE = "policy size mean low high n"


def pairs(*rows: tuple[str, int, float, float, float, int]) -> pd.DataFrame:
    return table("rival rival_size difference low high n", *rows).assign(policy="hma", size=100)


def success(before: tuple[int, float], after: tuple[int, float], published: float = 0.5) -> pd.DataFrame:
    """study_success.csv with attempts and shares of extraction; intervals are two standard errors wide."""
    rows = []
    for phase, (n, share) in (("exploration", before), ("learned", after)):
        std = (share * (1.0 - share) / n) ** 0.5 if n else 0.35
        low, high = (share - 2 * std, share + 2 * std) if n else (NAN, NAN)
        rows.append((phase, "all", "extract", n, share if n else NAN, std, low, high, published))
    return table("phase position action attempts share std low high published", *rows)


def test_names_are_those_of_the_legend() -> None:
    from thesis_lib.thesis.figures.chapter5.study import GOAL, POLICY_STYLE

    assert {name: style[3] for name, style in POLICY_STYLE.items()} == chapter5.POLICIES
    assert chapter5.GOAL == GOAL


def test_the_threshold_is_the_one_that_was_fixed() -> None:
    from thesis_lib.jenga.tower.settings import MovableSettings

    assert MovableSettings().threshold_mm == chapter5.THRESHOLD


@pytest.mark.parametrize(
    ("mean", "half", "n", "word"),
    [
        (10.0, 2.0, 5, "below the 21"),
        (20.0, 2.0, 5, "indistinguishable from the 21"),
        (25.0, 2.0, 5, "above the 21"),
        (10.0, NAN, 1, "the mean of 1 tower, too few to compare with the 21"),
    ],
)
def test_extractions_against_the_goal(mean: float, half: float, n: int, word: str) -> None:
    curve = table(CURVE, ("hma", 100, mean, mean - half, mean + half, n), ("rule", 0, 5.0, 4.0, 6.0, n))
    assert word in finding("figure_5_5b", curve, NEEDED)


def test_the_best_of_the_other_policies_is_named() -> None:
    curve = table(
        CURVE,
        ("hma", 100, 10.0, 9.0, 11.0, 5),
        ("hma", 1000, 20.0, 19.0, 21.0, 5),
        ("network", 100, 8.0, 7.0, 9.0, 5),
        ("ppo", 20000, 3.0, 2.0, 4.0, 5),
        ("oracle", 0, 11.0, 10.0, 12.0, 5),
    )
    said = finding("figure_5_5b", curve, NEEDED)
    assert "with as many, network 8.0 (7.0 to 9.0)" in said
    assert said.endswith("of the other policies oracle extracts most, 11.0 (10.0 to 12.0).")


def test_rivals_are_grouped_by_what_their_intervals_say() -> None:
    said = finding(
        "figure_paired",
        pairs(
            ("network", 100, 2.0, 1.0, 3.0, 19),
            ("mor", 100, 1.0, -1.0, 3.0, 5),
            ("oracle", 0, -2.0, -3.0, -1.0, 5),
            ("ppo", 1000, 9.0, 4.0, 14.0, 5),
            ("ppo", 20000, 6.0, 2.0, 10.0, 5),
        ),
        NEEDED,
    )
    assert "On the same 5 to 19 towers" in said
    assert "more blocks than network by 2.0 (1.0 to 3.0) and PPO with 1,000 to 20,000 samples by at least 6.0" in said
    assert "a number indistinguishable from that of MOR" in said
    assert "fewer blocks than oracle by 2.0 (1.0 to 3.0)" in said


def test_one_tower_tells_no_policies_apart() -> None:
    said = finding("figure_paired", pairs(("rule", 0, -9.0, NAN, NAN, 1)), NEEDED)
    assert said.startswith("One tower tells no policies apart.")
    assert "rule −9" in said


@pytest.mark.parametrize(
    ("before", "after", "word"),
    [(0.5, 0.9, "more often"), (0.86, 0.9, "not significantly different"), (0.9, 0.5, "less often")],
)
def test_extraction_before_and_after_learning(before: float, after: float, word: str) -> None:
    assert f": {word}." in finding("figure_5_6", success((100, before), (100, after)))


def test_shares_of_the_thesis_outside_our_intervals() -> None:
    said = finding("figure_5_6", success((100, 0.5), (100, 0.9)))
    assert "1 of 2 shares of the thesis's real robot lie outside our intervals" in said
    assert "over all blocks ours is higher for extract (learned)" in said


def test_no_extraction_was_tried() -> None:
    said = finding("figure_5_6", success((0, NAN), (4, 0.5)))
    assert said.startswith("Not both phases came so far")
    assert "none of 1 share" in said


@pytest.mark.parametrize(
    ("low", "high", "word"),
    [(-0.7, -0.3, "force falls,"), (-0.2, 0.2, "neither falls nor rises for sure"), (0.1, 0.5, "force rises,")],
)
def test_resistance_with_height(low: float, high: float, word: str) -> None:
    rows = [("inside_cone", 0.99, 0.98, 1.0)]
    rows += [(name, 0.5 * (low + high), low, high) for name in ("height_correlation", "height_correlation_predicted")]
    assert word in finding("figure_5_7", table("quantity value low high", *rows).assign(n=65))


def test_a_belief_that_changes_its_mind() -> None:
    steps = {"hard move": [0.6, 0.99, 0.99, 0.01], "no move": [0.4, 0.01, 0.01, 0.99]}
    rows = [
        (case, step, name, belief if case == "stuck" else 0.5)
        for case in ("stuck", "easy")
        for name, beliefs in steps.items()
        for step, belief in enumerate(beliefs, start=1)
    ]
    runs = table("belief_apart r_hat", (0.01, 1.0), (0.2, 1.3))
    said = finding("figure_5_8", table("case step abstraction belief", *rows), runs)
    assert "stuck block is “hard move” from step 2 to 3 and “no move” from step 4 on" in said
    assert "the easy block is never one abstraction" in said
    assert "at most 0.2 (R-hat of its chains up to 1.30)" in said


def test_a_pair_that_did_not_come_out_is_not_the_one_shown() -> None:
    rows = [(0, 1, 8, 0, 40.0, 0), (0, 1, 8, 1, 1.0, 1), (0, 2, 8, 0, 9.0, 1), (0, 2, 8, 1, 12.0, 1)]
    said = finding("figure_5_9", table("tower block edge steered stray out", *rows))
    assert "ends 12" in said
    assert "nearer in 1;" in said
    assert "and 2 and 1 blocks came out" in said


@pytest.mark.parametrize(
    ("mean", "half", "word"),
    [
        (0.45, 0.03, "indistinguishable from the thesis"),
        (0.40, 0.03, "below the thesis"),
        (0.6, 0.03, "above the thesis"),
        (0.3, NAN, "too few to compare with the thesis"),
    ],
)
def test_share_of_movable_blocks(mean: float, half: float, word: str) -> None:
    rows = [("test", t, m, m - half, m + half, 19) for t, m in ((2.0, 0.9), (1.0, mean), (0.5, 0.1))]
    rows.append(("development", 1.0, 0.47, 0.46, 0.48, 5))
    said = finding("figure_movable", table("set threshold_mm mean low high n", *rows))
    assert word in said
    assert "threshold of 0.5 mm they are 10" in said


def test_abstractions_that_do_no_better_than_a_guess() -> None:
    looks = table("size set abstraction stuck stuck_share", (100, 0, "no move", 1, 0.9), (100, 0, "no block", 0, NAN))
    columns = "size set balanced_accuracy low high n_stuck n_free"
    agreement = table(columns, (100, 0, 0.55, 0.45, 0.65, 30, 10), (100, -1, 0.9, 0.8, 1.0, 30, 10))
    said = finding("figure_abstractions", looks, agreement)
    assert "“no move” (counts as stuck) 90" in said
    assert "no block" not in said
    assert "indistinguishable from that of a guess" in said


def unseen(new: tuple[int, int], samples: int = 34) -> pd.DataFrame:
    rows = [("glued", 0.25, new[0], 0 if not new[0] else samples), ("heavy_tool", 0.04, new[1], samples)]
    return table("effect p_value new_abstraction relearned_samples", *rows)


def unseen_errors(after: float) -> pd.DataFrame:
    rows = [
        (effect, stage, "affected", error, error - 0.1, error + 0.1)
        for effect in ("glued", "heavy_tool")
        for stage, error in (("before", 1.0), ("relearned", after))
    ]
    return table("effect stage group error low high", *rows)


@pytest.mark.parametrize(
    ("after", "word"),
    [(0.5, "less than the 1.00"), (0.9, "indistinguishable from the 1.00"), (1.5, "more than the 1.00")],
)
def test_error_after_relearning(after: float, word: str) -> None:
    said = finding("figure_unseen", unseen((0, 1)), unseen_errors(after))
    assert "notices a heavier pusher (p = 0.040), but not glue between blocks (p = 0.25)." in said
    assert word in said


def test_nothing_noticed_and_nothing_to_relearn() -> None:
    none = finding("figure_unseen", unseen((0, 0)), unseen_errors(1.0))
    assert none == (
        "The predictive check does not notice glue between blocks (p = 0.25) and a heavier pusher (p = 0.040)."
    )
    few = finding("figure_unseen", unseen((0, 1), samples=0), unseen_errors(1.0))
    assert "Too little failed to relearn a heavier pusher" in few
