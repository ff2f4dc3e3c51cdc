"""The proof of the critique of mechanisms: causes hidden in recordings made by MuJoCo and Drake (`simulate.engines`).

The engines' contacts last and creep, and the sensors quantise, lag and ripple; the critique's equations contain none of
this.  The result for a recording is right if the verdict is exact:

    nothing hidden          adequate
    a cause                 effects: this cause alone, or in a group with at most two indistinguishable effects
    outside the library     unexplained

config/proof/mechanisms.csv holds a row per recording:

| column                             | unit | meaning                                                        |
|------------------------------------|------|----------------------------------------------------------------|
| mechanism, engine, truth, seed     |      | the recording                                                  |
| trials                             |      | number of usable trials                                        |
| verdict, named                     |      | of the critique; groups of effects as "a/b + c"                |
| before, after                      | 1    | held-out misfit, in units of noise                             |
| remaining_p, sensor_excess         | 1    | p-value of the remaining misfit; sensor errors over the stated |
| parameters                         |      | "name=true:found:std" of a named cause's, joined by ";"        |
| code, made                         |      | hash of the code that made the row, empty: unknown; date       |
"""

from dataclasses import dataclass

import pandas as pd

from thesis_lib.critique.mechanisms.critique import criticise_recording
from thesis_lib.critique.mechanisms.study import OUTSIDE, true_sizes
from thesis_lib.foundation.markdown import table
from thesis_lib.foundation.randomness import generator
from thesis_lib.foundation.rows import Rows
from thesis_lib.simulate.engines.recording import simulate_recording
from thesis_lib.simulate.engines.settings import EngineName
from thesis_lib.simulate.mechanisms.hidden_forces import TRUTHS, HiddenSizes, MechanismKind
from thesis_lib.studies.proof.store import (
    NOTHING,
    groups_in,
    groups_of,
    is_exact,
    numbers_in,
    numbers_of,
    share,
    stored,
)

SEEDS = 1100  # first seed of the table; seeds below 1000 are for development
ENGINES: tuple[EngineName, ...] = ("mujoco", "drake")
FOUND = ("trials", "verdict", "named", "before", "after", "remaining_p", "sensor_excess", "parameters")
ROWS = stored("mechanisms", ("mechanism", "engine", "truth", "seed"), FOUND, "mechanisms run", digits=4)
WITHIN = 1.96  # standard errors


@dataclass(frozen=True)
class MechanismCase:
    """One recording of the table."""

    mechanism: MechanismKind
    engine: EngineName
    truth: str
    seed: int


def cases(nothing: int = 10, causes: int = 3, first: int = SEEDS) -> list[MechanismCase]:
    """All recordings of the table: for each mechanism and engine `nothing` without a cause and `causes` with each."""
    return [
        MechanismCase(kind, engine, truth, first + i)
        for kind in TRUTHS
        for engine in ENGINES
        for truth in TRUTHS[kind]
        for i in range(nothing if truth == NOTHING else causes)
    ]


def compute(case: MechanismCase) -> dict[str, object]:
    """Simulate the recording of a case and criticise it; return a row of the table."""
    sizes = HiddenSizes()
    recording = simulate_recording(case.truth, case.mechanism, case.truth, case.engine, seed=case.seed)
    # not seeded by the recording's digest, since the last digits of the recording depend on the processor
    rng = generator(case.seed, "mechanism proof", case.mechanism, case.engine, case.truth)
    critique = criticise_recording(recording, rng)
    values, std = critique.fitted.values, critique.fitted.std
    found = {}
    if case.truth in values:
        names = [p.name for e in critique.candidates if e.name == case.truth for p in e.parameters]
        true = true_sizes(case.mechanism, case.truth, sizes)
        found = {n: (true[n], x, s) for n, x, s in zip(names, values[case.truth], std[case.truth])}
    return {
        **vars(case),
        "trials": len(recording.trials),
        "verdict": critique.verdict,
        "named": groups_in(critique.steps),
        "before": critique.ladder[0][0],
        "after": critique.ladder[-1][0],
        "remaining_p": critique.remaining.p_value,
        "sensor_excess": critique.sensor_excess[0],
        "parameters": numbers_in(found, 6),
    }


def is_right(truth: str, verdict: str, named: str) -> bool:
    """Return whether verdict and named effects are right, as defined in the module's docstring."""
    return is_exact(verdict, {NOTHING: [], OUTSIDE: [()]}.get(truth, [(truth,)]), groups_of(named))


def read(store: Rows = ROWS) -> pd.DataFrame:
    """The stored rows with a column `right`; UserError if there are no rows or the columns are wrong."""
    rows = store.table()
    return rows.assign(right=[is_right(*row) for row in zip(rows["truth"], rows["verdict"], rows["named"])])


def told(row: dict) -> str:
    """A row in words."""
    right = "right" if is_right(row["truth"], row["verdict"], row["named"]) else "WRONG"
    misfit = f"{row['before']:.4g} → {row['after']:.4g}, sensors {row['sensor_excess']:.4g}"
    return f"{right}, {row['verdict']}, {row['named'] or 'nothing named'}, {misfit}, {row['parameters']}"


def as_markdown(rows: pd.DataFrame | None = None) -> str:
    """Shares of right verdicts with 95 % intervals, counts by cause, all misses, and coverage of the parameters."""
    rows = read() if rows is None else rows
    shares, nothing = [], rows["truth"] == NOTHING
    for label, part in ((NOTHING, rows[nothing]), ("a cause", rows[~nothing])):
        for (mechanism, engine), some in part.groupby(["mechanism", "engine"]):
            shares.append((label, engine, mechanism, *_share(some)))
        shares.append((label, "both", "both", *_share(part)))
    lines = [table(("hidden", "engine", "mechanism", "right", "95 % interval", "recordings"), shares)]
    lines += ["", "Right of all, by cause:", ""]
    for (mechanism, truth), some in rows.groupby(["mechanism", "truth"]):
        by = ", ".join(f"{engine} {int(r['right'].sum())} of {len(r)}" for engine, r in some.groupby("engine"))
        lines.append(f"    {mechanism:<6} {truth:<24} {by}")
    misses = rows[~rows["right"]]
    lines += ["", f"Misses: {len(misses)}", ""]
    lines += [
        f"    {r.mechanism} {r.engine} {r.truth} {r.seed}: {r.verdict}, {r.named or 'nothing named'} "
        f"({r.before:g} → {r.after:g}, sensors {r.sensor_excess:g})"
        for r in misses.itertuples()
    ]
    of, low, high, n = share(within(rows)["inside"]).values()
    inside = f"{100 * of:.1f} % ({100 * low:.1f} to {100 * high:.1f} %) of {n}"
    lines += ["", f"Parameters in their 95 % interval: {inside}."]
    return "\n".join(lines)


def _share(rows: pd.DataFrame) -> tuple[str, str, str]:
    of, low, high, n = share(rows["right"]).values()
    return f"{100 * of:.3g} %", f"{100 * low:.3g} to {100 * high:.3g} %", f"{n}"


def within(rows: pd.DataFrame) -> pd.DataFrame:
    """A row per parameter of a hidden cause: its error in standard errors, and whether it lies in its 95 % interval."""
    found = (values for text in rows["parameters"] for values in numbers_of(text).values())
    errors = pd.Series([(value - true) / std for true, value, std in found], dtype=float)
    return pd.DataFrame({"error": errors, "inside": errors.abs() <= WITHIN})
