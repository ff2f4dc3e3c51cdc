"""The stored results of the proof as two tables: a row a dataset, and a row a recovered parameter.

What counts as right, for a dataset in which

- nothing was hidden: the verdict `adequate`;
- one effect was hidden: it stands in the group that was named first;
- two effects were hidden (truth "a+b"): both stand in the groups that were named, each in a group of its own (one
  group that holds both says "one or the other");
- the cause lies outside the library: the verdict `unexplained`.

A group of more than `LARGEST_GROUP` effects counts as wrong, and so does a refusal.

The misfit over its floor is, of one dataset, the worst of those channels in which the hidden effect acts: the impacts'
error over the noise floor, and the misfits of flight and gap, which are in units of noise, so that their floor is 1.
(The gap's covariance is on the safe side: its misfit stays somewhat below 1 when nothing is hidden.)  Where no effect
is known to act, it is that of the impacts.  The poses' misfit ("meet") is not stored.

| on paper           | in code                                 | unit | a row of    |                                |
|--------------------|-----------------------------------------|------|-------------|--------------------------------|
| E/E₀ before, after | `before_over_floor`, `after_over_floor` | 1    | `outcomes`  | base law; with effects found   |
| z                  | `z`                                     | 1    | `recovered` | (found − true) / std           |
| σ/σ_CR             | `width`                                 | 1    | `recovered` | std over the Cramér-Rao bound  |

Source of the interval of a share: E. B. Wilson 1927, doi 10.1080/01621459.1927.10502953.
"""

from itertools import permutations
from pathlib import Path

import numpy as np
import pandas as pd

from thesis_lib.critique.proof.cases import NOTHING, SOURCES, STORE
from thesis_lib.effects import EFFECTS
from thesis_lib.foundation.errors import CorruptFileError
from thesis_lib.foundation.files import read_json
from thesis_lib.simulate.rig.hidden_causes import CAUSES

KINDS = ("single", NOTHING, "pair", "outside")
VERDICTS = ("adequate", "effects", "unexplained", "refused")
Z95 = 1.959963984540054  # half-width of a normal distribution's 95 % interval, in standard deviations
LARGEST_GROUP = 3  # effects that may be named together
CELL = ("source", "truth", "ratio", "drops", "noise")  # datasets that differ in nothing but the seed
OUTCOMES = (
    *CELL,
    "seed",
    "kind",
    "effect",
    "verdict",
    "named_first",
    "named",
    "group_size",
    "right",
    "error_before",
    "error_after",
    "floor",
    "before_over_floor",
    "after_over_floor",
    "why",
)
RECOVERED = (*CELL, "seed", "effect", "parameter", "z", "inside", "width")


def kind_of(source: str, truth: str) -> str:
    """One of `KINDS`.

    Raises:
        KeyError: no such effect or cause.
    """
    if truth == NOTHING:
        return NOTHING
    if "+" in truth:
        return "pair"
    return "single" if expected_effects(source, truth) else "outside"


def expected_effects(source: str, truth: str) -> tuple[str, ...]:
    """Effects that describe a single truth, the best first; none if it is outside the library.

    Raises:
        KeyError: no such effect or cause.
    """
    return (EFFECTS[truth].name,) if source == "law" else CAUSES[truth].effects


def outcomes(store: Path = STORE) -> pd.DataFrame:
    """A row per stored dataset, columns `OUTCOMES`, sorted; group_size and misfits are NaN where there are none.

    `effect` is the one that describes a single truth best, "" where there is none; `named` joins the effects of a group
    by "/", groups by " + "; `group_size` is that of the first group, for a pair the mean over groups.

    Raises:
        CorruptFileError: a stored result cannot be read, lacks something, or is about an unknown truth.
    """
    rows = [_outcome(result, path) for path, result in _results(store)]
    return _sorted(pd.DataFrame(rows, columns=list(OUTCOMES)), ["source", "kind", *CELL[1:], "seed"])


def recovered(store: Path = STORE) -> pd.DataFrame:
    """A row per parameter with a true value, in datasets whose model holds the hidden effect; columns `RECOVERED`.

    Raises:
        CorruptFileError: as in `outcomes`.
    """
    rows = []
    for path, r in _results(store):
        try:
            for name, p in sorted(r.get("parameters", {}).items()):
                if not p["std"]:
                    continue
                z = (p["found"] - p["true"]) / p["std"]
                width = p["std"] / p["fisher"] if p["fisher"] else np.nan
                rows.append((*(r[key] for key in (*CELL, "seed")), r["truth"], name, z, abs(z) <= Z95, width))
        except (KeyError, TypeError, ValueError, AttributeError, ArithmeticError) as error:
            raise _corrupt(path, error) from error
    return _sorted(pd.DataFrame(rows, columns=list(RECOVERED)), [*CELL, "seed", "parameter"])


def wilson(k: int, n: int) -> tuple[float, float]:
    """95 % Wilson interval of a share of `k` in `n`; (NaN, NaN) for n = 0."""
    if n == 0:
        return np.nan, np.nan
    # (k + z²/2 ± z √(k (n − k)/n + z²/4)) / (n + z²)
    centre = k + 0.5 * Z95**2
    half = Z95 * np.sqrt(k * (n - k) / n + 0.25 * Z95**2)
    return max(0.0, float((centre - half) / (n + Z95**2))), min(1.0, float((centre + half) / (n + Z95**2)))


def _sorted(table: pd.DataFrame, by: list[str]) -> pd.DataFrame:
    orders = {"source": SOURCES, "kind": KINDS}
    return table.sort_values(
        by,
        key=lambda column: column.map(orders[column.name].index) if column.name in orders else column,  # pyright: ignore[reportArgumentType]
        ignore_index=True,
    )


def _results(store: Path) -> list[tuple[Path, dict]]:
    found = [(path, read_json(path)) for path in sorted(Path(store).rglob("*.json"))]
    for path, r in found:
        for key in (*CELL, "seed", "verdict"):
            kind = str if key in ("source", "truth", "verdict") else int | float
            if not isinstance(r.get(key), kind):
                raise _corrupt(path, TypeError(f"{key} is missing or of another kind"))
    return found


def _outcome(r: dict, path: Path) -> dict:
    try:
        kind = kind_of(r["source"], r["truth"])
        effects = expected_effects(r["source"], r["truth"]) if kind == "single" else ()
        steps = r.get("steps") or []
        counted = steps[:1] if kind == "single" else steps
        row = {key: r[key] for key in (*CELL, "seed", "verdict")} | {
            "kind": kind,
            "effect": effects[0] if effects else "",
            "named_first": steps[0][0] if steps else "",
            "named": " + ".join("/".join(group) for group in steps),
            "group_size": float(np.mean([len(group) for group in counted])) if counted else np.nan,
            "right": _right(r, kind, counted),
            "why": r.get("why", ""),
        }
        return row | (_misfits(r["error"], effects) if r["verdict"] != "refused" else {})
    except (KeyError, TypeError, ValueError, AttributeError, ArithmeticError) as error:
        raise _corrupt(path, error) from error


def _right(r: dict, kind: str, counted: list[list[str]]) -> bool:
    if kind == NOTHING:
        return r["verdict"] == "adequate"
    if kind == "outside":
        return r["verdict"] == "unexplained"
    if r["verdict"] == "refused":
        return False
    apart = True
    if kind == "pair":
        one, other = (set(expected_effects(r["source"], name)) for name in r["truth"].split("+"))
        apart = any(one & set(a) and other & set(b) for a, b in permutations(counted, 2))
    return bool(r["right"]) and apart and all(len(group) <= LARGEST_GROUP for group in counted)


def _misfits(error: dict, effects: tuple[str, ...]) -> dict[str, float]:
    channels = {channel for name in effects for channel in EFFECTS[name].channels} or {"impact"}

    def worst(when: str) -> float:
        ratios = []
        if "impact" in channels:
            ratios.append(error[when] / error["floor"] if error["floor"] else np.nan)
        ratios += [error[f"{name}_{when}"] for name in ("flight", "touch") if name in channels]
        return max((float(x) for x in ratios if x is not None and np.isfinite(x)), default=np.nan)

    return {
        "error_before": error["base"],
        "error_after": error["augmented"],
        "floor": error["floor"],
        "before_over_floor": worst("base"),
        "after_over_floor": worst("augmented"),
    }


def _corrupt(path: Path, error: Exception) -> CorruptFileError:
    return CorruptFileError(
        f"{path} is no result of the proof as this version stores it ({type(error).__name__}: {error}); delete it and "
        "run it again with python -m thesis_lib.critique.proof run."
    )
