"""Figures 5-2 to 5-4, 5-7 and 5-8: the hierarchical model and its abstractions."""

from itertools import groupby

from thesis_lib.records.chapter5_play import INTERVAL, STICK_SLIP
from thesis_lib.records.record import GEOMETRY, Figure, Job
from thesis_lib.records.rows import DataFrame, Row, compared, counted, lies, row_of, share, value
from thesis_lib.statistics.wording import listed, number, percent

EFFECTS = {"glued": "glue between blocks", "slippery": "a slippery layer", "heavy_tool": "a heavier pusher"}
ABSTRACTIONS = 4  # thesis, figure 5-8
SURE = 0.95  # belief above which an abstraction counts as settled
CHANCE = 0.5  # balanced accuracy of a guess
MODEL = Job("ch5_model", "chapter5")
SHOWCASE = Job("ch5_showcase", "chapter5")
HIDDEN = Job("ch5_hidden", "chapter5")
DIAGRAM = {  # of all hand-drawn diagrams
    "job": Job("ch5_diagrams", "chapter5"),
    "keys": "panel series",
    "tolerances": {"x y": GEOMETRY},
    "columns": {
        "panel": ("", "part of the picture, as lettered or titled in it"),
        "series": ("", "what is drawn: a part, a plate or box (two corners), or `a to b`, an arrow (start, end)"),
        "x": ("1", "place in the picture"),
        "y": ("1", "place in the picture"),
    },
}


FIGURE_5_2 = Figure(
    name="figure_5_2",
    title="A pusher at a block that is too heavy to move, and at one that is light enough",
    caption="""The same action, two behaviours that a force reading tells apart before the pose does.

What to look for: the force, which rises at once against the heavy block and stays low against the light one.""",
    **DIAGRAM,
)

FIGURE_5_3 = Figure(
    name="figure_5_3",
    title="Plate notation of the hierarchical model",
    caption="""Abstraction c of a push, states s, actions a, observations z, weights of each abstraction's network.""",
    **DIAGRAM,
)

FIGURE_5_4 = Figure(
    name="figure_5_4",
    title="Architecture of the robot's software",
    caption="Sensing, inference on the learned physics, game play, control.",
    **DIAGRAM,
)

FIGURE_5_5C = Figure(
    name="figure_5_5c", title="Structure of the mixture of regressions and of the hierarchical model", **DIAGRAM
)


@Figure.found_by(
    job=MODEL,
    title="Learned forces over the friction cone, and resistance against height",
    caption="""(A) Forces that the learned model predicts for held-out pushes, over the friction cone of the finger.
(B) Resistance against the height of the block.

What to look for: readings outside the friction cone (A), which would be unphysical, and how resistance changes with
height (B).""",
    reads=("model_summary.csv",),
    not_compared=STICK_SLIP,
    columns={
        "panel": ("", "A: friction cone, B: height"),
        "abstraction": ("", "name of the abstraction"),
        "f_n": ("N", "force along the push; A: predicted, B: measured"),
        "f_t": ("N", "predicted force across the push"),
        "inside": ("1", "1: inside the friction cone, sensor noise allowed for"),
        "height_mm": ("mm", "height of the block above the base of the tower"),
        "f_n_pred": ("N", "what the model predicts for f_n"),
    },
)
def figure_5_7(summary: DataFrame) -> str:
    """How many predicted forces lie inside the friction cone, and whether resistance falls with height."""
    inside, force, predicted = (
        row_of(summary, quantity=name) for name in ("inside_cone", "height_correlation", "height_correlation_predicted")
    )
    words = ("falls", "neither falls nor rises for sure", "rises")
    return (
        f"{share(inside)} of the forces predicted for {counted(inside['n'], 'held-out push', 'es')} lie inside the "
        f"friction cone. With the height of the block the measured force "
        f"{lies(force, 0.0, words)}, rank correlation {value(force)}; the predicted one "
        f"{lies(predicted, 0.0, words)}, {value(predicted)}."
    )


@Figure.found_by(
    job=SHOWCASE,
    title="Belief along a push of a stuck and of an easy block",
    caption="""Force, displacement and belief over abstractions: lines are the exact filter, marks the No-U-Turn
sampler on the same readings.

What to look for: how early along the push the belief settles on one abstraction, and whether the sampler's marks lie on
the filter's lines.""",
    reads=("figure_5_8.csv", "showcase_runs.csv"),
    not_compared=STICK_SLIP,
    columns={
        "case": ("", "stuck or easy: the block pushed"),
        "step": ("1", "step of 1 mm within the push"),
        "abstraction": ("", "name of the abstraction"),
        "belief": ("1", "its probability given the readings so far, by the bank of filters"),
        "belief_nuts": ("1", "the same by the No-U-Turn sampler; empty where it was not run"),
        "f_n": ("N", "force along the push as read"),
        "x": ("mm", "displacement of the block as read"),
        "f_n_pred": ("N", "force that the abstraction predicted for this reading"),
        "x_pred": ("mm", "displacement that the abstraction predicted for this reading"),
    },
)
def figure_5_8(beliefs: DataFrame, runs: DataFrame) -> str:
    """The abstraction on which the belief settles along each push, and the distance of sampler and filter."""
    cases = [_settled(beliefs[beliefs["case"] == case], case) for case in ("stuck", "easy")]
    return (
        f"Belief above {percent(SURE)}: {'; '.join(cases)}. The sampler's probabilities differ from the filter's by at "
        f"most {number(runs['belief_apart'].max(), digits=1)} (R-hat of its chains up to {runs['r_hat'].max():.2f})."
    )


def _settled(beliefs: DataFrame, case: str) -> str:
    leads = beliefs.loc[beliefs.groupby("step")["belief"].idxmax()].sort_values("step")
    leads = leads[leads["belief"] > SURE]
    last = beliefs["step"].max()
    parts = []
    for name, rows in groupby(leads.itertuples(), key=lambda row: row.abstraction):
        steps = [row.step for row in rows]
        parts.append(f"“{name}” from step {steps[0]}" + (" on" if steps[-1] == last else f" to {steps[-1]}"))
    return f"the {case} block is {listed(parts)}" if parts else f"the {case} block is never one abstraction"


@Figure.found_by(
    job=MODEL,
    title="What each abstraction looks like",
    caption="""Typical force, its rise, motion of the block, lag and motion of the tower per step, and the share of
held-out pushes in it whose hidden label is stuck.

What to look for: the abstraction with high force and little motion: its share of stuck pushes says how well it stands
for being stuck.""",
    reads=("figure_abstractions.csv", "model_agreement.csv"),
    not_compared=STICK_SLIP,
    columns={
        "abstraction": ("", "name of the abstraction, given by a rule from its means"),
        "size": ("1", "samples learned from"),
        "set": ("", "number of the training set"),
        "share": ("1", "share of the samples that the abstraction holds for"),
        "force": ("N", "typical push force of the abstraction (mean of its asinh)"),
        "rise": ("N/mm", "mean change of the push force per step of 1 mm"),
        "move": ("1", "mean displacement of the block per step of 1 mm"),
        "lag": ("1", "mean lag of the block behind the pusher, as a share of the advance plus 3 mm"),
        "drag": ("1", "mean displacement of the tower per step of 1 mm"),
        "stuck_share": ("1", "share of the held-out pushes in it whose hidden label is stuck"),
        "stuck": (
            "1",
            "1: counts as stuck (moves less than half of the advance, or drags the tower), found without truth",
        ),
    },
)
def figure_abstractions(looks: DataFrame, agreement: DataFrame) -> str:
    """Which abstractions mean stuck, and how well they separate stuck from free pushes."""
    first = looks.iloc[0]
    shares = [
        f"“{row['abstraction']}”{' (counts as stuck)' if row['stuck'] == 1 else ''} {percent(row['stuck_share'])}"
        for _, row in looks[looks["stuck_share"].notna()].iterrows()
    ]
    row = row_of(agreement, size=first["size"], set=first["set"])
    return (
        f"From {first['size']:,.0f} samples the model forms {counted(len(looks), 'abstraction')} (thesis: "
        f"{ABSTRACTIONS}). Of the held-out pushes in each, so many are stuck in truth: {', '.join(shares)}; of all, "
        f"{percent(row['n_stuck'] / (row['n_stuck'] + row['n_free']))}. That count tells stuck from free with a "
        f"balanced accuracy of {value(row, 'balanced_accuracy')}, {lies(row, CHANCE)} that of a guess."
    )


@Figure.found_by(
    job=HIDDEN,
    title="Error of the learned model on towers with an effect that it has never seen",
    caption="""Before and after it learned a new abstraction from the pushes that failed its predictive check.

What to look for: how far the error falls back towards that on known towers once the new abstraction is learned.""",
    reads=("unseen_summary.csv", "unseen_errors.csv"),
    not_compared=STICK_SLIP,
    columns={
        "panel": ("", "error: one-step errors; blocks: which blocks fail the predictive check"),
        "effect": ("", "what the tower has that was not learned"),
        "stage": ("", "before or relearned"),
        "group": (
            "",
            "affected: blocks with the effect, others; or all pushes, and those failing the predictive check",
        ),
        "error": ("1", "mean |reading - prediction| over the spread of training's changes"),
        **INTERVAL,
        "n": ("1", "pushes that went into the value, or to the block"),
        "block": ("1", "number of the block, 3 layer + place, from the bottom"),
        "failed": ("1", "of the pushes to the block, those that fail the predictive check"),
        "abstraction": ("", "abstraction that comes nearest in most of them; empty if none fails"),
    },
)
def figure_unseen(summary: DataFrame, errors: DataFrame) -> str:
    """Which effects the predictive check notices, and how relearning changes the error there."""
    effects = summary.assign(
        text=[f"{_effect(row)} (p = {number(row['p_value'], digits=2)})" for _, row in summary.iterrows()]
    )
    noticed, missed = (list(effects.loc[effects["new_abstraction"] == flag, "text"]) for flag in (1, 0))
    verdict = "The predictive check "
    verdict += f"notices {listed(noticed)}" if noticed else f"does not notice {listed(missed)}"
    verdict += f", but not {listed(missed)}" if noticed and missed else ""
    changes = [_relearned(row, errors) for _, row in summary[summary["new_abstraction"] == 1].iterrows()]
    return " ".join([f"{verdict}.", *changes])


def _effect(row: Row) -> str:
    return EFFECTS.get(row["effect"]) or row["effect"].replace("_", " ")


def _relearned(row: Row, errors: DataFrame) -> str:
    affected = errors[(errors["effect"] == row["effect"]) & (errors["group"] == "affected")]
    if not row["relearned_samples"] > 0:
        return f"Too little failed to relearn {_effect(row)}."
    before, after = (row_of(affected, stage=stage) for stage in ("before", "relearned"))
    return (
        f"Where there is {_effect(row)}, the error is {value(after, 'error')} spreads of a change once "
        f"{counted(row['relearned_samples'], 'sample')} were relearned, {compared(after, before)} the "
        f"{value(before, 'error')} before."
    )
