"""Figure 4-8 and its tables: errors of each contact model in the resting position of dice."""

from thesis_lib.records.record import THROWN, Figure, Job, Table, Tolerance
from thesis_lib.records.rows import DataFrame, compared, counted, lies, row_of, share, value
from thesis_lib.statistics.wording import listed, number, percent

THROWERS = {  # as in the legend of figure 4-8
    "law": "law alone",
    "residual": "law + rigid residual",
    "residual_wrench": "law + wrench residual",
    "critique": "critique's law",
    "compliant": "compliant contact",
    "compliant_residual": "compliant contact + residual",
}
SHOWN_LEVEL = 0.8
FEWEST = 3  # points for a slope with an interval
# thesis, figure 4-8: mean and standard deviation of the error at rest; section 4.4: share of right sides
PUBLISHED = {"law": (-0.97, 4.44, 0.23), "residual_wrench": (0.83, 1.83, 0.43)}
THROWING = Job("ch4_dice", "chapter4/{dataset}", datasets=THROWN)
PARTICLES = Tolerance("seeded particles; a contact that goes the other way moves a few of them", abs=0.02, rel=0.1)


@Figure.found_by(
    job=THROWING,
    title="Densities of the error in resting position, for each contact model",
    caption="""Over all throws, each held out once, with mean and standard deviation. The error is measured minus
expected position, in sides of the die; the expected position is the mean of the belief. The thesis has 750 throws, of
which 500 are public.

What to look for: a narrow peak at zero. A peak beside zero is a bias, a second one a side of the die that is taken for
another.""",
    reads=("dice.csv",),
    keys="model",
    tolerances={"error density mean std beyond": PARTICLES},
    columns={
        "error": ("1", "measured minus expected resting position, in sides"),
        "mean": ("1", "of the model's errors"),
        "std": ("1", "of the model's errors"),
        "model": ("", "contact model thrown: see thesis_lib/residual/dice/study.py"),
        "density": ("1", "probability density per side"),
        "beyond": ("1", "share of errors beyond the axis"),
    },
)
def figure_4_8(dice: DataFrame) -> str:
    """Bias and scatter of each model's error at rest, against the thesis."""
    mean, std = (dice[dice["quantity"] == name].set_index("model") for name in ("mean", "std"))
    parts = [
        f"{_error(mean, std, model)} (thesis {m:g} ± {s})".replace("-", "−") for model, (m, s, _) in PUBLISHED.items()
    ]
    least = str(std["value"].idxmin())
    if least not in PUBLISHED:
        parts.append(f"{_error(mean, std, least)}, the least scatter")
    scatter = compared(std.loc["residual_wrench"], std.loc["law"])
    biased = [THROWERS[str(name)] for name, row in mean.iterrows() if lies(row, 0.0, ("biased", "", "biased"))]
    return (
        f"Mean error ± standard deviation, in sides: {'; '.join(parts)}. The scatter with the learned wrench residual "
        f"is {scatter} that of the law alone; the intervals of the mean leave out zero for "
        f"{listed(biased) if biased else 'no model'}."
    )


def _error(mean: DataFrame, std: DataFrame, model: str) -> str:
    return f"{THROWERS[model]} {value(mean.loc[model])} ± {number(std.loc[model, 'value'])}"


@Figure.found_by(
    job=THROWING,
    title="Calibration of the beliefs over resting positions on held-out throws",
    caption="""Histogram of the probability integral transform with the band that chance allows a right belief, and
coverage of central regions with 95 % intervals. dice_calibration.csv has the same for single contacts.

What to look for: bars within the band and coverage on the diagonal. Bars that rise at both ends are a belief that is
too narrow, bars that fall there one that is too wide.""",
    reads=("dice_calibration.csv",),
    keys="panel model",
    tolerances={"at value low high": PARTICLES},
    columns={
        "panel": ("", "pit or coverage"),
        "at": ("1", "PIT, or nominal level"),
        "value": ("1", "share of outcomes"),
        "model": ("", "contact model thrown: see thesis_lib/residual/dice/study.py"),
        "low": ("1", "lower end of 95 %: of what chance allows (pit), of the coverage"),
        "high": ("1", "upper end of it"),
    },
)
def figure_calibration(coverage: DataFrame) -> str:
    """Which models' beliefs over resting positions are as wide as their errors."""
    rolls = coverage[coverage["kind"] == "roll"]
    right, narrow, wide = "as many as stated, at the other levels too", "too few", "too many"
    uneven = "as many as stated, but not at every other level"
    groups: dict[str, list[str]] = {right: [], uneven: [], narrow: [], wide: []}
    for model, rows in rolls.groupby("model", sort=False):
        row = row_of(rows, level=SHOWN_LEVEL)
        group = lies(row, SHOWN_LEVEL, (narrow, uneven, wide))
        groups[right if rows["passes"].all() else group].append(f"{THROWERS[str(model)]} {share(row, 'coverage')}")
    parts = [f"{word} ({', '.join(models)})" for word, models in groups.items() if models]
    return f"Measured ends inside the central {percent(SHOWN_LEVEL)} of the belief: {'; '.join(parts)}."


@Figure.found_by(
    job=THROWING,
    title="Restitution of held-out contacts against the place of the contact on the surface",
    caption="""Measured, and by the compliant contact fitted to training contacts. Impact laws have one number for
it.

What to look for: a slope along the surface, which an impact law with one number for all places cannot follow.""",
    keys="first trial",
    tolerances={
        "x": Tolerance("contact point of the fitted body, whose search stops before it has settled wholly", abs=0.002),
        "measured": Tolerance("measured velocities, at a contact point of the fitted body", abs=0.03, rel=0.05),
        "model": Tolerance("a seeded search that stops before it has settled wholly", abs=0.05, rel=0.05),
    },
    most_rows=80,
    columns={
        "first": ("", "1: a throw's first contact; 0: a later one"),
        "x": ("m", "place of the contact on the surface"),
        "measured": ("1", "restitution at the contact point, measured"),
        "model": ("1", "the same by the fitted compliant contact"),
    },
)
def figure_restitution(contacts: DataFrame) -> str:
    """The slope of restitution along the surface, measured and modelled, over first contacts (one per throw)."""
    first = contacts[contacts["first"] == 1]
    if len(first) < FEWEST:
        return f"There is too little for a slope: {counted(len(first), 'first contact')}."
    measured, model = (_slope(first, name) for name in ("measured", "model"))
    verb = lies(measured, 0.0, ("falls", "neither rises nor falls for sure", "rises"))
    return (
        f"Over {counted(len(first), 'first contact')} measured restitution, about {first['measured'].median():.2f}, "
        f"{verb} along the surface: {value(measured)} per 10 cm. That of the compliant contact has a slope of "
        f"{value(model)} per 10 cm, {compared(model, measured)} the measured one."
    )


def _slope(contacts: DataFrame, column: str) -> dict[str, float]:
    """Least-squares slope of a column over x, per 10 cm, with its 95 % interval."""
    from scipy.stats import linregress, t

    line = linregress(contacts["x"], contacts[column])
    half = float(t.ppf(0.975, len(contacts) - 2)) * line.stderr
    return {"value": 0.1 * line.slope, "low": 0.1 * (line.slope - half), "high": 0.1 * (line.slope + half)}


@Figure.found_by(
    job=THROWING,
    title="Where a thrown die loses its face: throws that go on from before each of their contacts",
    caption="""Left the share of right faces (grey: chance), right the scatter of the resting position, of held-out
throws that each model carries on without uncertainty from the measured state before a contact; 0 is the release.
Squares and diamonds need no contact model: the nearest training throws, and the pairs of throws that start most alike.

What to look for: the contact after which the faces come right. What is lost before it is lost there; where a model is
as good as the throws that start most alike, the start does not tell more.""",
    reads=("dice_budget.csv",),
    keys="model contact",
    tolerances={"throws std std_error median_abs face_right face_error std_start face_start": PARTICLES},
    columns={
        "model": ("", "contact model thrown, or nearest, pairs: see thesis_lib/residual/dice/budget.py"),
        "contact": ("1", "before which the throw goes on; 0: the release"),
        "throws": ("1", "held-out throws, mean over parts; pairs: pairs of throws"),
        "std": ("1", "standard deviation of the error in resting position, in sides"),
        "std_error": ("1", "its standard error, bootstrap over throws"),
        "median_abs": ("1", "median of the error's absolute value, in sides"),
        "face_right": ("1", "share of throws that end on the predicted side"),
        "face_error": ("1", "its standard error, bootstrap over throws"),
        "std_start": ("1", "std of the same throws from their release"),
        "face_start": ("1", "face_right of the same throws from their release"),
    },
)
def figure_budget(budget: DataFrame) -> str:
    """What the first contacts of a throw cost its best model, and how well one can do without a model."""
    start = budget[(budget["contact"] == 0) & budget["model"].isin(list(THROWERS))].set_index("model")
    best = str(start["std"].idxmin())
    rows = budget[(budget["model"] == best) & (budget["contact"] > 0)]
    parts = [
        f"{percent(row['face_right'])} and {number(row['std'], digits=2)} sides from contact {row['contact']:.0f} "
        f"({percent(row['face_start'])} and {number(row['std_start'], digits=2)} from their release)"
        for _, row in rows.iterrows()
    ]
    nearest, pairs = (row_of(budget, model=name) for name in ("nearest", "pairs"))
    return (
        f"The {THROWERS[best]} names {percent(start.loc[best, 'face_right'])} of the faces from the release, with a "
        f"scatter of {number(start.loc[best, 'std'], digits=2)} sides; of throws that have the contact, "
        f"{listed(parts)}. Without a model, the nearest throws name {percent(nearest['face_right'])} and scatter by "
        f"{number(nearest['std'], digits=2)} sides; of pairs that start alike {percent(pairs['face_right'])} make as "
        f"many quarter turns, and they differ by {number(pairs['std'], digits=2)} sides over √2."
    )


@Table.found_by(
    job=THROWING,
    title="Thrown dice: how far each contact model misses the end",
    caption="""Each model is simulated to rest from the measured starts of held-out throws. Given are the error in
resting position in sides (mean, standard deviation, median of its size), share of throws on the right side, log score
of the true end, and continuous ranked probability score; the same without uncertainty (certain); and the limit, what
the noise of the start alone does to the end. Each throw is held out once; intervals are bootstraps over throws, and
std_splits is the spread over the held-out parts. 500 of the thesis's 750 throws are public; dice_counts.csv says how
many are used and why the others are not.

What to look for: how near a model comes to the limit, which no model can pass, and what it loses when its uncertainty
is left out.""",
)
def dice(table: DataFrame) -> str:
    """How near the models come to the measured ends, and to the limit set by the noise of the start."""

    def right(model: str, quantity: str = "face_right") -> str:
        return share(row_of(table, model=model, quantity=quantity))

    def missed(model: str) -> str:
        miss = value(row_of(table, model=model, quantity="median_abs"), unit="sides")
        return f"misses the end by {miss} and names the right side in {right(model)}"

    misses = table[table["quantity"] == "median_abs"].set_index("model")
    best = str(misses["value"].idxmin())
    sure = compared(misses.loc[best], misses.loc["law"], ("", ", not told apart from the law alone", ""))
    nearest = f"Nearest comes the {THROWERS[best]}: it {missed(best)}{sure}."
    limit, kept = (row_of(table, model=best, quantity=name)["value"] for name in ("limit_std", "limit_face"))
    alone, learned = (percent(PUBLISHED[model][2]) for model in ("law", "residual_wrench"))
    return (
        f"In the median over throws, the law alone {missed('law')}; without uncertainty it is right in "
        f"{right('law', 'face_right_certain')} (thesis: {alone}), and with a learned wrench residual in "
        f"{right('residual_wrench')} (thesis: {learned}). {nearest if best != 'law' else 'No model misses by less.'} "
        f"The noise of the measured start alone moves its ends by {number(limit, digits=2)} sides and keeps "
        f"{percent(kept)} of them on their side."
    )
