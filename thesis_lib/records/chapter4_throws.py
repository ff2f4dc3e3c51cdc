"""Figures 4-3, 4-4, 4-7, 4-9 and 4-10: single throws of the die and the beliefs over them."""

from thesis_lib.records.chapter4_dice import PARTICLES, THROWING
from thesis_lib.records.record import Figure, Tolerance
from thesis_lib.records.rows import DataFrame, lies, row_of, value
from thesis_lib.statistics.wording import listed, number

BELIEVED = "compliant_residual"  # the model whose beliefs figures 4-4 and 4-10 draw

FIGURE_4_3 = Figure(
    name="figure_4_3",
    job=THROWING,
    title="A measured throw about its first contacts, with outlines drawn from the belief over it",
    caption="""Outlines at its start, and after each of its first two contacts. The belief is that of the law fitted
to training contacts with its residual.

What to look for: how the outlines spread from one contact to the next.""",
    keys="trial series",
    tolerances={"t x y theta": PARTICLES},
    columns={
        "t": ("s", "measured: since the first sample; belief: since the start"),
        "series": ("", "measured, or belief after that many contacts"),
        "theta": ("rad", "body angle"),
    },
)


@Figure.found_by(
    job=THROWING,
    title="Belief over the horizontal distance of the same throw, from its start to rest",
    caption="""At its start, after the first and the second contact, and at rest. Each panel has its own range, and
its standard deviation is written in it.

What to look for: how the standard deviation grows from one contact to the next, and whether one peak becomes
several.""",
    keys="state",
    tolerances={"distance density std": PARTICLES},
    columns={
        "density": ("1", "probability density per side"),
        "std": ("1", "standard deviation of the distance, in sides"),
        "state": ("", "start, after the first contact, after the second contact, at rest"),
    },
)
def figure_4_4(drawn: DataFrame) -> str:
    """How the belief over one throw widens."""
    spread = drawn.drop_duplicates("state").set_index("state")["std"].rename({"start": "at the start"})
    steps = [f"{number(std, digits=2)} {state}" for state, std in spread.items()]
    grown = float(f"{spread.iloc[-1] / spread.iloc[0]:.0e}")
    return (
        f"The standard deviation of the horizontal position is, in sides, {listed(steps)}: it grows about "
        f"{grown:,.0f} times."
    )


FIGURE_4_7 = Figure(
    name="figure_4_7",
    job=THROWING,
    title="Outlines of one measured throw from the hand to rest",
    keys="trial",
    tolerances={"t x y theta": Tolerance("measured poses; only rounding", abs=1e-08)},
    columns={"theta": ("rad", "body angle")},
)

FIGURE_4_9 = Figure(
    name="figure_4_9",
    job=THROWING,
    title="A throw that is hard and one that is easy to predict, about their first contact",
    caption="They are chosen by the width of the belief at rest, not by the error.",
    keys="trial case",
    tolerances={"t x y theta after_first": PARTICLES},
    columns={"theta": ("rad", "body angle"), "after_first": ("1", "1 after the first contact")},
)


@Figure.found_by(
    job=THROWING,
    title="Belief over the resting position of the throws of figure 4-9",
    caption="""With the end that the law alone predicts, and the measured end.

What to look for: whether the measured end lies where the belief is dense, also for the hard throw, where the law alone
names one place only.""",
    reads=("figure_4_10.csv", "dice_difficulty.csv"),
    keys="case",
    tolerances={"distance density law measured std": PARTICLES},
    columns={
        "law": ("1", "end by the law alone, in sides from the start"),
        "measured": ("1", "measured end, in sides from the start"),
        "density": ("1", "probability density per side"),
        "std": ("1", "standard deviation of the belief, in sides"),
    },
)
def figure_4_10(drawn: DataFrame, difficulty: DataFrame) -> str:
    """Where the measured ends lie in the two beliefs, and whether a belief's width ranks throws by difficulty."""
    ends = [_end(drawn[drawn["case"] == case], case) for case in ("hard", "easy")]
    rank = row_of(difficulty, model=BELIEVED, spread="spread_rest")
    words = (
        "wide beliefs go with small errors",
        "the width of a belief does not tell large errors from small ones",
        "wide beliefs go with large errors",
    )
    return (
        f"{ends[0]} {ends[1]} Over all held-out throws {lies(rank, 0.0, words)}: rank correlation "
        f"{value(rank, 'rank_correlation')}."
    )


def _end(case: DataFrame, name: str) -> str:
    first = case.iloc[0]
    below = float(case.loc[case["distance"] <= first["measured"], "density"].sum() / case["density"].sum())
    inside = "inside" if 0.025 <= below <= 0.975 else "outside"
    return (
        f"The {name} throw (belief's standard deviation {number(first['std'], digits=2)} sides) ends {inside} the "
        f"central 95 % of its belief, {number(abs(first['measured'] - first['law']), digits=2)} sides from where the "
        "law alone puts it."
    )
