"""Results of the study of dice: tables over all splits, and the throws in figures.

    value = mean over splits;   std, low, high: means over splits of bootstrap values within one split
    std_splits = standard deviation of the value over splits

Splits share throws, so their mean is hardly more certain than one split: `std` is that of one split, and `std_splits`
shows the effect of the choice of training throws.  Coverages count held-out throws of all splits, with intervals from
the bootstrap over throws.  Figures of single throws and of one belief use the first split.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from thesis_lib.foundation.randomness import streams
from thesis_lib.residual.dice.data import MeasuredContacts
from thesis_lib.residual.dice.fit import DiceModel, contact_path, touch_down
from thesis_lib.residual.dice.readings import readings
from thesis_lib.residual.dice.settings import DiceStudySettings
from thesis_lib.residual.dice.study import DiceStudy, first_contacts
from thesis_lib.residual.dice.tables import easy_and_hard
from thesis_lib.residual.dice.widths import belief_widths
from thesis_lib.residual.throwing.calibration import coverage_table, pit_histogram
from thesis_lib.residual.throwing.flight import fly
from thesis_lib.residual.throwing.settings import ThrowSettings

BELIEVED = "compliant_residual"  # the model whose beliefs are drawn
PLAIN = "law"
COMPLIANT = "compliant"
SAMPLES = 200  # of a drawn belief
ASKEW = 0.75  # 24 degrees from a side: the neighbour touches much later, if at all
FAST = 0.5  # m/s; slower contacts give poor estimates of restitution


@dataclass(frozen=True)
class Examples:
    """An easy and a hard held-out throw of the first split, chosen by the belief alone; distances in sides."""

    easy: int
    hard: int
    samples: pd.DataFrame  # contact, t, x, y, theta of the hard throw's belief
    rest: np.ndarray  # its x at rest in m
    beliefs: pd.DataFrame  # case, and distance at rest from the start, of both throws
    marks: pd.DataFrame  # case, law and measured end


def dice_tables(studies: Sequence[DiceStudy], rng: np.random.Generator) -> dict[str, pd.DataFrame]:
    """Tables of all splits by file name; `dice` is the summary.  `rng` is for the bootstrap of the coverages."""
    throws = stacked(studies, lambda s: s.throws)
    pits = stacked(studies, lambda s: s.contact_pits)
    stream = streams(rng)
    coverages = [
        coverage_table(
            part["pit"].to_numpy(), central=central, groups=part["trial"].to_numpy(), rng=stream(kind, model)
        ).assign(model=model, kind=kind)
        for kind, table, central in (("roll", throws, True), ("contact", pits, False))
        for model, part in table.groupby("model", sort=False)
    ]
    first = ["model", "kind"]
    coverage = pd.concat(coverages, ignore_index=True)
    difficulty, first_contact = stacked(studies, lambda s: s.difficulty), stacked(studies, lambda s: s.first_table)
    counts = [pd.DataFrame({"counted": list(s.counts), "count": list(s.counts.values())}) for s in studies]
    return {
        "dice": over_splits(stacked(studies, lambda s: s.table), ["model", "quantity"], "value"),
        "dice_throws": throws,
        "dice_limit": stacked(studies, lambda s: s.limit),
        "dice_difficulty": over_splits(difficulty, ["model", "spread"], "rank_correlation"),
        "dice_rates": stacked(studies, lambda s: s.rates),
        "dice_parameters": stacked(studies, lambda s: s.parameters),
        "dice_laws": stacked(studies, lambda s: s.laws),
        "dice_calibration": coverage[first + [name for name in coverage.columns if name not in first]],
        "dice_first_contact": over_splits(first_contact, ["model", "belief", "quantity"], "value"),
        "dice_first_contact_throws": stacked(studies, lambda s: s.first),
        "dice_budget": _budget(stacked(studies, lambda s: s.budget)),
        "dice_counts": stacked(counts, lambda table: table),
    }


def tables_of_a_split(
    study: DiceStudy, side: float, settings: DiceStudySettings, rng: np.random.Generator
) -> dict[str, pd.DataFrame]:
    """How the beliefs of model `BELIEVED` widen, and the law with other parameters, by file name; `side` in m."""
    held = study.releases.select(~np.isin(study.releases.trial, study.train))
    believed, plain = study.outcomes[BELIEVED].thrower, study.outcomes[PLAIN].thrower.model
    return {
        "dice_widths": belief_widths(believed, held, side, settings, rng),
        "dice_readings": readings(plain, study.releases, side, settings.throw),
    }


def _budget(table: pd.DataFrame) -> pd.DataFrame:
    """Means over splits of a table of the budget, the order of models kept."""
    return table.drop(columns="split").groupby(["model", "contact"], sort=False).mean().reset_index()


def stacked(studies: Sequence, table: Callable[..., pd.DataFrame]) -> pd.DataFrame:
    """A table of all splits, with `split` as first column."""
    parts = [table(study).assign(split=i) for i, study in enumerate(studies)]
    return pd.concat([part[["split", *part.columns[:-1]]] for part in parts], ignore_index=True)


def over_splits(table: pd.DataFrame, keys: list[str], value: str) -> pd.DataFrame:
    """Means over splits of `value`, its standard error and interval; spread over splits and their number."""
    groups = table.groupby(keys, sort=False)
    mean = groups[[value, "std", "low", "high"]].mean()
    mean["std_splits"] = groups[value].std(ddof=1)
    mean["splits"] = groups[value].count()
    return mean.reset_index()


def calibration(throws: pd.DataFrame, coverage: pd.DataFrame) -> tuple[pd.DataFrame, pd.DataFrame]:
    """PIT histograms of resting positions in the first split, whose throws are all different, and coverages."""
    first_split = throws[throws["split"] == 0]
    histograms = [
        pit_histogram(part["pit"].to_numpy()).assign(model=model)
        for model, part in first_split.groupby("model", sort=False)
    ]
    return pd.concat(histograms, ignore_index=True), coverage[coverage["kind"] == "roll"]


def held_out_restitution(study: DiceStudy, settings: DiceStudySettings) -> pd.DataFrame:
    """Restitution against place of held-out contacts, measured and by the compliant contact (`restitution`)."""
    held = study.contacts.select(~np.isin(study.contacts.trial, study.train))
    return restitution(study.outcomes[COMPLIANT].thrower.model, held, settings.throw)


def restitution(model: DiceModel, contacts: MeasuredContacts, settings: ThrowSettings) -> pd.DataFrame:
    """Restitution e_n = −v_n⁺/v_n⁻ at the touching corner against its place x (m), measured and by the fitted contact.

    A row per contact: trial, first (0 or 1), x, speed (m/s of approach), measured, model.  Flights after a contact are
    traced back to the touch.  Contacts of one corner only, far from landing flat and faster than `FAST`.
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
    """Throws that the figures show, and the beliefs of model `BELIEVED` about them; `side` in m."""
    believed, plain = study.outcomes[BELIEVED], study.outcomes[PLAIN]
    held = study.releases.select(~np.isin(study.releases.trial, study.train))
    easy, hard = easy_and_hard(study.throws, BELIEVED)
    beliefs, marks, rest = [], [], {}
    for case, trial in (("hard", hard), ("easy", easy)):
        row = int(np.flatnonzero(held.trial == trial)[0])
        start, rest[case] = held.q[row, 0], believed.x[row]
        beliefs.append(pd.DataFrame({"case": case, "distance": (rest[case] - start) / side}))
        ends = (plain.certain.q[row, 0], held.end[row, 0])
        marks.append((case, *((x - start) / side for x in ends)))
    samples = first_contacts(believed.thrower, held, hard, SAMPLES, settings, rng)
    ends = pd.DataFrame(marks, columns=["case", "law", "measured"])
    return Examples(easy, hard, samples, rest["hard"], pd.concat(beliefs, ignore_index=True), ends)
