"""Figures 5-5, 5-6 and 5-9: the tower, and how well each policy plays."""

import math
from collections.abc import Sequence

from thesis_lib.records.record import Figure, Job, Tolerance
from thesis_lib.records.rows import DataFrame, Row, counted, difference, lies, row_of, share, value
from thesis_lib.statistics.wording import listed, number, percent

POLICIES = {  # as in the legend of figure 5-5 B
    "hma": "HMA",
    "hma_without_cost": "HMA without “no move” cost",
    "hma_one_shot": "HMA in one shot",
    "mor": "MOR",
    "mor_with_cost": "MOR with “no move” cost",
    "network": "network",
    "network_with_cost": "network with “no move” cost",
    "ppo": "PPO",
    "oracle": "oracle",
    "rule": "rule",
    "exploration": "exploration",
    "always_push": "always push",
}
GOAL = 21  # extractions that the thesis expects on an untouched tower
MOVABLE = 0.47  # thesis, section 5.4.4
THRESHOLD = 1.0  # mm, fixed on development towers
TOWERS = Job("ch5_towers", "chapter5")
STUDY = Job("ch5_study", "chapter5")
SHOWCASE = Job("ch5_showcase", "chapter5")
INTERVAL = {"low": ("1", "lower end of its 95 % interval"), "high": ("1", "upper end of it")}
POSE = {
    "block": ("1", "number of the block, 3 layer + place, from the bottom"),
    **{name: ("m", "centre of the block") for name in "xyz"},
    "qw": ("1", "orientation, real part of the unit quaternion"),
    **{name: ("1", "orientation") for name in ("qx", "qy", "qz")},
}
AT_REST = "a tower at rest, to a tenth of its height tolerance: contacts settle with rounding"
STICK_SLIP = (
    "played in a simulation of stick and slip: rounding decides where a block slips, and with it every push that "
    "follows; config/reference has the study's numbers, tests/jenga holds what makes them"
)

FIGURE_5_5A = Figure(
    name="figure_5_5a",
    job=TOWERS,
    title="The simulated tower",
    caption="""54 blocks that differ in height only (drawn from the simulator's poses).""",
    keys="block",
    tolerances={"x y z": Tolerance(AT_REST, abs=2e-05), "qw qx qy qz": Tolerance(AT_REST, abs=0.002)},
    most_rows=60,
    columns=POSE,
)


@Figure.found_by(
    job=TOWERS,
    title="Share of reachable blocks that a straight trial push can move",
    caption="""Of the 45 reachable blocks, those that move without moving others, on development and on test towers,
and how their share depends on the threshold.

What to look for: how little the share changes about the threshold that is used; if it changed much, the choice would
make the result.""",
    reads=("movable_summary.csv",),
    keys="set tower threshold_mm",
    tolerances={
        "share": Tolerance("two blocks of 45 that move by just the threshold; none of a quick run's few", abs=0.05)
    },
    most_rows=80,
    columns={
        "set": ("", "development: towers that the threshold was fixed on; test: others"),
        "tower": ("1", "seed of the tower"),
        "threshold_mm": ("mm", "displacement of others up to which a block counts as movable"),
        "share": ("1", "share of the 45 reachable blocks that are movable"),
    },
)
def figure_movable(summary: DataFrame) -> str:
    """The share of movable blocks on test towers, and how it depends on the threshold."""
    test = summary[summary["set"] == "test"].sort_values("threshold_mm")
    row = row_of(test, threshold_mm=THRESHOLD)
    verdict = _known(row, MOVABLE)
    least, most = test.iloc[0], test.iloc[-1]
    return (
        f"On {counted(row['n'], 'test tower')} {share(row, 'mean')} of the blocks tried are movable at the threshold "
        f"of {THRESHOLD:g} mm, {verdict} the thesis's {percent(MOVABLE)}. "
        f"With a threshold of {least['threshold_mm']:g} mm they are {percent(least['mean'])}, with "
        f"{most['threshold_mm']:g} mm {percent(most['mean'])}."
    )


@Figure.found_by(
    job=STUDY,
    title="Consecutive extractions of each policy against its number of samples",
    caption="""Mean over test towers with 95 % intervals; policies without training are level lines. study_curve.csv
has the numbers, study_games.csv each game.

What to look for: policies whose intervals do not overlap, and the number of samples from which on they do not.""",
    reads=("study_curve.csv", "study_needed.csv"),
    not_compared=STICK_SLIP,
    columns={
        "policy": ("", "who plays; thesis: the 21 extractions that the thesis expects"),
        "size": ("1", "samples (pushes of 1 mm) learned from; 0: does not learn"),
        "mean": ("1", "consecutive extractions, mean over towers"),
        **INTERVAL,
        "n": ("1", "towers; 0: a published number"),
    },
)
def figure_5_5b(curve: DataFrame, needed: DataFrame) -> str:
    """Extractions of the hierarchical model, of the models with as many samples, and of the best other policy."""
    size = row_of(needed, of="hma")["size"]
    hma = row_of(curve, policy="hma", size=size)
    goal = _known(hma, GOAL)
    alike = (curve["size"] == size) & curve["policy"].isin(["mor", "network"])
    rivals = [f"{POLICIES[row['policy']]} {value(row, 'mean')}" for _, row in curve[alike].iterrows()]
    rest = f"; with as many, {listed(rivals)}" if rivals else ""
    others = curve[~alike & (curve["policy"] != "hma")]
    if len(others):
        best = others.loc[others["mean"].idxmax()]
        rest += f"; most of the other policies, {_policy(best['policy'], [best['size']])}: {value(best, 'mean')}"
    return (
        f"With {size:,.0f} samples HMA extracts {value(hma, 'mean')} blocks in a row, the mean of "
        f"{counted(hma['n'], 'tower')}, {goal} the {GOAL} that the thesis expects{rest}."
    )


@Figure.found_by(
    job=STUDY,
    title="Successes of push, extract and place, in exploration and with the learned model",
    caption="""Exploration with supervisor against the learned model, side and middle blocks, with 95 % intervals;
marks are the thesis's real robot.

What to look for: marks of the real robot that lie outside our intervals.""",
    reads=("study_success.csv",),
    not_compared=STICK_SLIP,
    columns={
        "phase": ("", "exploration (with the supervisor, before learning) or learned"),
        "position": ("", "all blocks, side or middle blocks"),
        "action": ("", "push, extract or place"),
        "attempts": ("1", "how often it was tried"),
        "successes": ("1", "of these, successes by the thesis's criterion"),
        "share": ("1", "successes over attempts"),
        **INTERVAL,
        "published": ("1", "share in the thesis, real robot"),
    },
)
def figure_5_6(success: DataFrame) -> str:
    """Successful extractions before and after learning, and the thesis's shares outside our intervals."""
    before, after = (
        row_of(success, phase=phase, position="all", action="extract") for phase in ("exploration", "learned")
    )
    tried = success[(success["attempts"] > 0) & success["published"].notna()]
    words = ("ours is lower for", "", "ours is higher for")
    sides = tried.assign(word=[lies(row, row["published"], words) for _, row in tried.iterrows()])
    outside = sides[sides["word"] != ""]
    of_all = [
        f"{word} {listed([f'{action} ({phase})' for action, phase in zip(rows['action'], rows['phase'])])}"
        for word, rows in outside[outside["position"] == "all"].groupby("word", sort=False)
    ]
    apart = f"{len(outside) or 'none'} of {counted(len(tried), 'share')} of the thesis's real robot lie"
    apart += f" outside our intervals{'; over all blocks ' if of_all else ''}{', '.join(of_all)}"
    if not min(before["attempts"], after["attempts"]) > 0:
        return f"Not both phases came so far as to try an extraction. Of what was tried, {apart}."
    change = difference(after, before, ("less often", "not told apart", "more often"), "share")
    return (
        f"Extraction succeeds in {share(after, 'share')} of the attempts with the learned model (thesis: "
        f"{percent(after['published'])}) and in {share(before, 'share')} in exploration (thesis: "
        f"{percent(before['published'])}): {change}. In all, {apart}."
    )


@Figure.found_by(
    job=STUDY,
    title="Extractions of the hierarchical model minus those of every other policy",
    caption="""On the same towers, block orders and noise, with 95 % intervals.

What to look for: intervals that leave out zero; the others are no differences that these games can show.""",
    reads=("study_paired.csv", "study_needed.csv"),
    not_compared=STICK_SLIP,
    columns={
        "policy": ("", "who plays"),
        "rival": ("", "whom it is compared with on the same towers, blocks in the same order"),
        "size": ("1", "samples that the policy learned from; 0: does not learn"),
        "rival_size": ("1", "samples that the rival learned from; 0: does not learn"),
        "difference": ("1", "consecutive extractions of the policy minus those of the rival, mean over towers"),
        **INTERVAL,
        "n": ("1", "towers that count"),
    },
)
def figure_paired(pairs: DataFrame, needed: DataFrame) -> str:
    """On the same towers: policies that the hierarchical model beats, that beat it, or that are not told apart."""
    size = row_of(needed, of="hma")["size"]
    comparisons = pairs[(pairs["policy"] == "hma") & (pairs["size"] == size)]
    fewest, most = comparisons["n"].min(), comparisons["n"].max()
    if most == 1:
        parts = [
            f"{_policy(row['rival'], [row['rival_size']])} {row['difference']:+.0f}"
            for _, row in comparisons.iterrows()
        ]
        return (
            f"One tower tells no policies apart. On it the extractions of HMA with {size:,.0f} samples minus those of "
            f"each other policy are: {', '.join(parts)}.".replace("-", "−")
        )
    words = ("fewer blocks than", "a number not told apart from that of", "more blocks than")
    judged = comparisons.assign(word=[lies(row, 0.0, words) for _, row in comparisons.iterrows()])
    parts = []
    for word, group in judged.groupby("word", sort=False):
        names = []
        for rival, rows in group.groupby("rival", sort=False):
            least = rows.loc[rows["difference"].abs().idxmin()]
            low, high = sorted(abs(least[name]) for name in ("low", "high"))
            ends = f"{abs(least['difference']):.1f} ({low:.1f} to {high:.1f})"
            by = "" if word == words[1] else f" by {'at least ' if len(rows) > 1 else ''}{ends}"
            names.append(_policy(str(rival), [n for n in rows["rival_size"] if n != size]) + by)
        parts.append(f"{word} {listed(names)}")
    towers = counted(most, "tower") if fewest == most else f"{fewest} to {most} towers"
    return f"On the same {towers} HMA with {size:,.0f} samples extracts {'; '.join(parts)}."


@Figure.found_by(
    job=SHOWCASE,
    title="A block that was pushed off its centre on purpose and then steered",
    caption="""Contact locations and headings chosen by model predictive control on the learned model, from above;
below, the same push gone on straight. Shown is the pair whose straight push strayed most; `showcase_steering.csv` has
them all.""",
    reads=("showcase_steering.csv",),
    not_compared=STICK_SLIP,
    columns={
        "steered": ("1", "1: model predictive control after the disturbance, 0: straight on at the centre"),
        "controlled": ("1", "1: after the disturbance, 0: pushed off the centre on purpose"),
        "step": ("1", "step of 1 mm within the push"),
        "advance": ("mm", "advance of the arm since first contact"),
        "x": ("mm", "block's displacement along the push"),
        "y": ("mm", "the same, across the push"),
        "yaw": ("mm", "its rotation times the radius of gyration (23 mm)"),
        "offset": ("mm", "contact location chosen for the next step, from the centre of the end face"),
        "heading": ("rad", "heading chosen for the next step, 0 along the block"),
        "shown": ("1", "1: drawn from above"),
    },
)
def figure_5_9(pairs: DataFrame) -> str:
    """Distances of the blocks' ends from the goal, steered and straight: the pair shown, and all pairs."""
    wide = pairs.pivot(index=["block", "edge"], columns="steered", values=["stray", "out"])
    straight, steered = (wide["stray"][name] for name in (0, 1))
    out = [int(wide["out"][name].sum()) for name in (1, 0)]
    # the figure shows the straight push that strayed most, among pairs of which both came out
    shown = straight[(wide["out"] == 1).all(axis=1)].idxmax()
    nearer = int((steered < straight).sum())
    return (
        f"In the pair shown the block ends {_mm(steered[shown])} from the goal when steered and {_mm(straight[shown])} "
        f"straight on. Of {counted(len(wide), 'pair')} of pushes the steered one ends nearer in {nearer or 'none'}; "
        f"the medians are {_mm(steered.median())} and {_mm(straight.median())}, and {out[0]} and {out[1]} blocks came "
        "out."
    )


def _mm(value: float) -> str:
    return number(value, 2, "mm")


FIGURE_GAME = Figure(
    name="figure_game",
    job=SHOWCASE,
    title="Frames of a recorded game of the hierarchical model on a development tower",
    not_compared=STICK_SLIP,
    columns=POSE | {"frame": ("1", "number of the picture, from 0")},
)


def _known(row: Row, of: float) -> str:
    """Where a row's interval lies relative to a value; a single tower has no interval."""
    return "too few to compare with" if math.isnan(row["low"]) else lies(row, of)


def _policy(name: str, sizes: Sequence[float]) -> str:
    """A policy's title, with its numbers of samples if there are any."""
    title = POLICIES.get(name, name.replace("_", " "))
    learned = [f"{size:,.0f}" for size in sorted(sizes) if size]
    return f"{title} with {' to '.join(dict.fromkeys([learned[0], learned[-1]]))} samples" if learned else title
