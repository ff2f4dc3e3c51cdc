"""Results of the study of dice: tables over all held-out parts, and throws for figures.

    value = over the held-out throws of all parts, each of which is held out once;   std, low, high: bootstrap over them
    std_splits = standard deviation over parts of the value within one

The bootstrap draws held-out throws and keeps the models as trained.  Other training throws would change little if
std_splits is at most √parts times `std`.  The budget is a mean over parts.  Figures of single throws and of one
predictive distribution use part 0.

Figure 4-4 shows how the belief (predictive distribution) of a throw widens with each contact, and the contacts' share
in it.  Held-out throws start from states drawn from the covariance of their start, once with uncertain contacts, once
without their uncertainty.  The width of a throw is the standard deviation of x over its particles, in sides:

    std, certain    median over throws of the width with uncertain contacts, and without
    ratio           median over throws of the width with, over the width without

Noise of the start grows by itself, as a thrown die is chaotic.  A wider belief thus does not show that contacts are
uncertain, but the ratio does: it is 1 if they add nothing, and √2 if they add half of the variance.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from thesis_lib.foundation.randomness import streams
from thesis_lib.thesis.residual.dice.data import MeasuredContacts, ThrowReleases
from thesis_lib.thesis.residual.dice.fit import DiceModel, contact_path, touch_down
from thesis_lib.thesis.residual.dice.models import Thrower, perturbed, throw_starts
from thesis_lib.thesis.residual.dice.readings import readings
from thesis_lib.thesis.residual.dice.settings import DiceStudySettings
from thesis_lib.thesis.residual.dice.study import DiceStudy
from thesis_lib.thesis.residual.dice.tables import PLAIN, difficulty, easy_and_hard, spread, summary
from thesis_lib.thesis.residual.throwing.calibration import coverage_table, pit_histogram
from thesis_lib.thesis.residual.throwing.flight import fly
from thesis_lib.thesis.residual.throwing.propagation import Sampled
from thesis_lib.thesis.residual.throwing.settings import ThrowSettings

BELIEVED = "compliant_residual"  # the model whose beliefs are shown
COMPLIANT = "compliant"
SAMPLES = 200  # number of samples of a belief in a figure
ASKEW = 0.75  # 24 degrees from a side: the next corner touches much later, if at all
FAST = 0.5  # m/s; slower contacts give poor estimates of restitution
STATES = ("start", "first contact", "second contact", "rest")
FEWEST = 5  # fewest particles with a contact for a width after it


@dataclass(frozen=True)
class Examples:
    """An easy and a hard held-out throw of the first part, chosen by the belief alone; distances are in sides."""

    easy: int
    hard: int
    samples: pd.DataFrame  # contact, t, x, y, theta of the hard throw's belief
    rest: np.ndarray  # its x at rest in m
    beliefs: pd.DataFrame  # case, and distance at rest from the start, of both throws
    marks: pd.DataFrame  # case, law and measured end


def dice_tables(
    studies: Sequence[DiceStudy], settings: DiceStudySettings, rng: np.random.Generator
) -> dict[str, pd.DataFrame]:
    """Tables over all parts by file name; `dice` is the summary.  `rng` is for the bootstraps."""
    stream = streams(rng)
    whole = {name: stacked([study.tables[name] for study in studies]) for name in studies[0].tables}
    coverages = [
        coverage_table(part["pit"].to_numpy(), part["trial"].to_numpy(), stream(kind, model), central=central).assign(
            model=model, kind=kind
        )
        for kind, table, central in (("roll", whole["throws"], True), ("contact", whole.pop("contact_pits"), False))
        for model, part in table.groupby("model", sort=False)
    ]
    coverage = pd.concat(coverages, ignore_index=True)
    whole["calibration"] = coverage[["model", "kind", *coverage.columns.drop(["model", "kind"])]]
    budgets = whole["budget"].drop(columns="split").groupby(["model", "contact"], sort=False)
    whole["budget"] = budgets.mean().reset_index()

    def summarised(summarise: Callable, *names: str) -> tuple[pd.DataFrame, list[pd.DataFrame]]:
        """Summary of the tables of all throws, with the spread over summaries of parts; and the latter."""

        def of(tables: dict[str, pd.DataFrame], *key: object) -> pd.DataFrame:
            return summarise(*(tables[name] for name in names), settings.bootstrap, stream(*key))

        parts = [of(study.tables, "part", summarise.__name__, i) for i, study in enumerate(studies)]
        return over_parts(of(whole, "all", summarise.__name__), parts), parts

    dice, parts = summarised(summary, "throws", "limit")
    whole["parts"] = stacked(parts)
    whole["difficulty"], _ = summarised(difficulty, "throws")
    return {"dice": dice} | {f"dice_{name}": table for name, table in whole.items()}


def tables_of_part(
    study: DiceStudy, side: float, settings: DiceStudySettings, rng: np.random.Generator
) -> dict[str, pd.DataFrame]:
    """Tables by file name: widths of beliefs of model `BELIEVED`, and throws by the law alone; `side` in m."""
    believed, plain = study.outcomes[BELIEVED].thrower, study.outcomes[PLAIN].thrower.model
    return {
        "dice_widths": belief_widths(believed, study.held.releases, side, settings, rng),
        "dice_readings": readings(plain, study.releases, side, settings.throw),
    }


def belief_widths(
    thrower: Thrower, held: ThrowReleases, side: float, settings: DiceStudySettings, rng: np.random.Generator
) -> pd.DataFrame:
    """Table with a row per state: throws, std, certain and ratio, each with standard error (bootstrap over throws).

    `side` in m.  A throw counts if at least `FEWEST` of its particles have the contact, with and without uncertainty.
    """
    start_rng, contact_rng, bootstrap_rng = rng.spawn(3)
    q, v = perturbed(held, settings.particles, start_rng)

    def widths(contact: Sampled) -> np.ndarray:
        """Widths (states, throws), NaN where too few particles have the contact."""
        out = throw_starts(thrower.model, contact, q, v, settings.throw, contact_rng)
        x = np.stack([q[:, 0], out.snapshot_q[0, :, 0], out.snapshot_q[1, :, 0], out.q[:, 0]])
        x = x.reshape(len(STATES), len(held), -1) / side
        enough = np.isfinite(x).sum(axis=2) >= FEWEST
        found = np.full(enough.shape, np.nan)
        found[enough] = np.nanstd(x[enough], axis=1)
        return found

    wide, narrow, rows = widths(thrower.contact), widths(thrower.certain), []
    for i, state in enumerate(STATES):
        known = np.isfinite(wide[i]) & np.isfinite(narrow[i])
        row: dict[str, object] = {"state": state, "throws": int(known.sum())}
        for name, values in (("std", wide[i]), ("certain", narrow[i]), ("ratio", wide[i] / narrow[i])):
            error = spread(values[known], np.median, settings.bootstrap, bootstrap_rng)[0]
            row |= {name: float(np.median(values[known])), f"{name}_error": error}
        rows.append(row)
    return pd.DataFrame(rows)


def stacked(parts: Sequence[pd.DataFrame]) -> pd.DataFrame:
    """Stack the tables of all parts, with `split`, the number of the part, as first column."""
    return pd.concat(parts, keys=range(len(parts)), names=["split"]).reset_index("split").reset_index(drop=True)


def over_parts(whole: pd.DataFrame, parts: Sequence[pd.DataFrame]) -> pd.DataFrame:
    """Add to the summary of all throws the standard deviation of its value over the parts, and their number.

    Columns before the value identify a row; the value is followed by std, low and high.
    """
    columns = list(whole.columns[: whole.columns.get_loc("high") + 1])
    *keys, value = columns[: columns.index("std")]
    groups = pd.concat(parts, ignore_index=True).groupby(keys, sort=False)[value]
    of_parts = pd.DataFrame({"std_splits": groups.std(ddof=1), "splits": groups.count()}).reset_index()
    return whole[columns].merge(of_parts, on=keys, how="left", validate="one_to_one")


def calibration(throws: pd.DataFrame, coverage: pd.DataFrame) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Histograms of the probability integral transform (PIT) of resting positions, and coverages."""
    histograms = [
        pit_histogram(part["pit"].to_numpy()).assign(model=model) for model, part in throws.groupby("model", sort=False)
    ]
    return pd.concat(histograms, ignore_index=True), coverage[coverage["kind"] == "roll"]


def restitution(model: DiceModel, contacts: MeasuredContacts, settings: ThrowSettings) -> pd.DataFrame:
    """Restitution e_n = −v_n⁺/v_n⁻ at the touching corner against its position x (m), measured and modelled.

    A row per contact: trial, first (0 or 1), x, speed (m/s of approach), measured, model.  Flights after a contact are
    traced back to the touch.  Only contacts of one corner are used, far from flat and faster than `FAST`.
    """
    t, at, _, r, approach = touch_down(model, contacts)
    shown = (np.abs(np.sin(2.0 * at[:, 2])) > ASKEW) & (approach > FAST) & (t < contacts.span)
    start_q, start_v, span = model.seen(contacts.q)[shown], contacts.v[shown], contacts.span[shown]
    ends = {
        "measured": (contacts.q_after[shown] - [0.0, 0.0, model.d_theta], contacts.v_after[shown]),
        "model": contact_path(model, start_q, start_v, span, settings),
    }
    table = pd.DataFrame({"trial": contacts.trial[shown], "first": contacts.first[shown].astype(int)})
    table["x"], table["speed"] = at[shown, 0] + r[shown, 0], approach[shown]
    for name, (end_q, end_v) in ends.items():
        _, after = fly(model.body, end_q, end_v, t[shown] - span)
        table[name] = (after[:, 1] + r[shown, 0] * after[:, 2]) / approach[shown]
    return table.sort_values(["first", "x", "trial"], kind="stable").reset_index(drop=True)


def examples(study: DiceStudy, side: float, settings: DiceStudySettings, rng: np.random.Generator) -> Examples:
    """Choose the throws that the figures show, with the beliefs of model `BELIEVED`; `side` in m."""
    believed, plain, held = study.outcomes[BELIEVED], study.outcomes[PLAIN], study.held.releases
    easy, hard = easy_and_hard(study.tables["throws"], BELIEVED)
    beliefs, marks, rest = [], [], {}
    for case, trial in (("hard", hard), ("easy", easy)):
        row = int(np.flatnonzero(held.trial == trial)[0])
        start, rest[case] = held.q[row, 0], believed.x[row]
        beliefs.append(pd.DataFrame({"case": case, "distance": (rest[case] - start) / side}))
        ends = (plain.certain.q[row, 0], held.end[row, 0])
        marks.append((case, *((x - start) / side for x in ends)))
    samples = _first_contacts(believed.thrower, held.select(held.trial == hard), settings, rng)
    ends = pd.DataFrame(marks, columns=["case", "law", "measured"])
    return Examples(easy, hard, samples, rest["hard"], pd.concat(beliefs, ignore_index=True), ends)


def _first_contacts(
    thrower: Thrower, release: ThrowReleases, settings: DiceStudySettings, rng: np.random.Generator
) -> pd.DataFrame:
    """Samples of the belief over one throw: contact (0: start, 1, 2, ...), t (s), x, y (m), theta (rad), trial.

    Rows are at the end of their contact; particles at rest before it are left out.
    """
    q, v = perturbed(release, SAMPLES, rng)
    out = throw_starts(thrower.model, thrower.contact, q, v, settings.throw, rng)
    parts = [np.column_stack([np.zeros((SAMPLES, 2)), q])]
    for i, (pose, t) in enumerate(zip(out.snapshot_q, out.snapshot_t), start=1):
        parts.append(np.column_stack([np.full(SAMPLES, i), t, pose + [0.0, 0.0, thrower.model.d_theta]]))
    table = pd.DataFrame(np.vstack(parts), columns=["contact", "t", "x", "y", "theta"]).dropna()
    return table.assign(contact=table["contact"].astype(int), trial=release.trial[0])
