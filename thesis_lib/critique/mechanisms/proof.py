"""The proof of the critique of mechanisms: causes hidden in recordings that MuJoCo and Drake made (`simulate.engines`).

The engines' contacts take time and creep, the sensors count, lag and ripple; the critique's equations have none of
it.  A recording is right if the verdict is exact:

    nothing hidden          adequate
    a cause                 effects: this one and no other, or with at most two that cannot be told from it
    outside the library     unexplained

config/proof/mechanisms.csv holds a row per recording:

| column                             | unit | meaning                                                        |
|------------------------------------|------|----------------------------------------------------------------|
| mechanism, engine, truth, seed     |      | the recording                                                  |
| trials                             |      | usable ones                                                    |
| verdict, named                     |      | of the critique; groups of effects as "a/b + c"                |
| before, after                      | 1    | held-out misfit, in units of noise                             |
| remaining_p, sensor_excess         | 1    | p-value of the remaining misfit; errors of sensors over stated |
| parameters                         |      | "name=true:found:std" of each, joined by ";", if named         |
| code, made                         |      | hash of the code that made the row, empty: unknown; date       |
"""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from thesis_lib.critique.mechanisms.critique import GROUP, criticise_recording
from thesis_lib.critique.mechanisms.study import OUTSIDE, true_sizes
from thesis_lib.foundation.markdown import table
from thesis_lib.foundation.randomness import generator
from thesis_lib.foundation.rows import STAMP, Rows, stamp
from thesis_lib.simulate.chapter2.hidden_forces import TRUTHS, HiddenSizes, MechanismKind
from thesis_lib.simulate.engines.recording import simulate_recording
from thesis_lib.simulate.engines.settings import EngineName
from thesis_lib.statistics.intervals import wilson

if TYPE_CHECKING:
    import pandas as pd

SEEDS = 1100  # the table's begin here; those below 1000 are for development
ENGINES: tuple[EngineName, ...] = ("mujoco", "drake")
NOTHING, CAUSES = 10, 3  # recordings of each mechanism and engine
KEY = ("mechanism", "engine", "truth", "seed")
COLUMNS = (
    *(*KEY, "trials", "verdict", "named", "before", "after", "remaining_p", "sensor_excess", "parameters"),
    *STAMP,
)
PATH = Path(__file__).resolve().parents[3] / "config" / "proof" / "mechanisms.csv"
STORE = Rows(PATH, COLUMNS, KEY, "python -m thesis_lib.critique.mechanisms run", digits=4)
WITHIN = 1.96  # standard errors


@dataclass(frozen=True)
class MechanismCase:
    """One recording."""

    mechanism: MechanismKind
    engine: EngineName
    truth: str
    seed: int


def cases(nothing: int = NOTHING, causes: int = CAUSES, first: int = SEEDS) -> list[MechanismCase]:
    """All recordings of the table: `nothing` without and `causes` with each cause, of each mechanism and engine."""
    return [
        MechanismCase(kind, engine, truth, first + i)
        for kind in TRUTHS
        for engine in ENGINES
        for truth in TRUTHS[kind]
        for i in range(nothing if truth == "nothing" else causes)
    ]


def compute(case: MechanismCase) -> dict[str, object]:
    """Record and criticise; a row of the table."""
    sizes = HiddenSizes()
    recording = simulate_recording(case.truth, case.mechanism, case.truth, case.engine, seed=case.seed)
    # not from the recording's digest: its last digits depend on the processor
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
        "named": " + ".join("/".join((step.effect.name, *step.alternatives)) for step in critique.steps),
        "before": critique.ladder[0][0],
        "after": critique.ladder[-1][0],
        "remaining_p": critique.remaining.p_value,
        "sensor_excess": critique.sensor_excess[0],
        "parameters": ";".join(f"{n}={':'.join(f'{x:.6g}' for x in numbers)}" for n, numbers in found.items()),
        **stamp(__file__),
    }


def is_exact(truth: str, verdict: str, named: str) -> bool:
    """Whether verdict and names are right; see the module's docstring."""
    if truth in ("nothing", OUTSIDE):
        return verdict == ("adequate" if truth == "nothing" else "unexplained")
    groups = [group.split("/") for group in named.split(" + ")]
    return verdict == "effects" and len(groups) == 1 and truth in groups[0] and len(groups[0]) <= GROUP


def read(store: Rows = STORE) -> "pd.DataFrame":
    """The stored rows, and a column `right`; UserError if there are none, or other columns."""
    rows = store.table()
    return rows.assign(right=[is_exact(*row) for row in zip(rows["truth"], rows["verdict"], rows["named"])])


def told(row: dict) -> str:
    """What a row found, in words."""
    right = "right" if is_exact(row["truth"], row["verdict"], row["named"]) else "WRONG"
    misfit = f"{row['before']:.4g} → {row['after']:.4g}, sensors {row['sensor_excess']:.4g}"
    return f"{right}, {row['verdict']}, {row['named'] or 'nothing named'}, {misfit}, {row['parameters']}"


def report(rows: "pd.DataFrame") -> str:
    """Shares by mechanism and engine with 95 % intervals, by cause, all misses, and parameters in their interval."""
    shares, nothing = [], rows["truth"] == "nothing"
    for label, part in (("nothing", rows[nothing]), ("a cause", rows[~nothing])):
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
    inside = within(rows)["inside"]
    low, high = wilson(int(inside.sum()), len(inside))
    lines += [
        "",
        f"Parameters in their 95 % interval: {100 * inside.mean():.1f} % ({100 * low:.1f} to {100 * high:.1f} %) "
        f"of {len(inside)}.",
    ]
    return "\n".join(lines) + "\n"


def _share(rows: "pd.DataFrame") -> tuple[str, str, str]:
    right, n = int(rows["right"].sum()), len(rows)
    low, high = wilson(right, n)
    return f"{100 * right / n:.3g} %", f"{100 * low:.3g} to {100 * high:.3g} %", f"{n}"


def within(rows: "pd.DataFrame") -> "pd.DataFrame":
    """A row per parameter of a hidden cause: its error in standard errors, and whether it lies in its 95 % interval."""
    import pandas as pd

    parts = (part.split("=")[1].split(":") for text in rows["parameters"] for part in text.split(";") if part)
    errors = [(float(found) - float(true)) / float(std) for true, found, std in parts]
    return pd.DataFrame({"error": errors, "inside": [abs(error) <= WITHIN for error in errors]})
