"""Tables of games in docs/findings.md, from the stored study of chapter 5 and of its switches."""

from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from thesis_lib.foundation.markdown import table
from thesis_lib.statistics.wording import MINUS

if TYPE_CHECKING:
    import pandas as pd

STORE = Path(__file__).resolve().parents[2] / "config" / "reference" / "chapter5"
SHOWN = 100  # samples of the learners that others are compared with, as in the thesis
TITLES = {"hma": "HMA", "mor": "MOR", "ppo": "PPO", "hma_one_shot": "HMA in one shot"}
FIRST = (("hma", SHOWN), ("rule", 0), ("network", SHOWN), ("mor", SHOWN), ("mor", 10 * SHOWN))
OTHERS = (("hma_one_shot", SHOWN), ("ppo", 20_000), ("oracle", 0))
LEARNERS = ("hma", "mor", "network")
MATCHES = {
    "nobody has it": ("hma_without_cost", "mor", "network"),
    "all have it": ("hma", "mor_with_cost", "network_with_cost"),
}


def who_plays() -> str:
    """Extractions of each policy, and how many more HMA brings out on the same towers."""
    rows = []
    for key in (*FIRST, *OTHERS):
        row: Any = _curve().loc[key]
        more = "" if key == ("hma", SHOWN) else lead("hma", SHOWN, *key)
        extractions = f"{_interval(row, 'mean', 'low', 'high')}, n = {row['n']:.0f}"
        rows.append((title(key[0]), f"{key[1]:,}", extractions, more))
    return table(("who plays", "samples", "extractions", f"HMA ({SHOWN}) brings out more"), rows)


def by_samples() -> str:
    """Extractions of learners by the number of samples, and HMA's lead at each."""
    sizes = sorted(size for policy, size in _curve().index if policy == "hma")
    rows = [(f"{size:,}", *means((name, size) for name in LEARNERS), *leads(LEARNERS, size)) for size in sizes]
    return table(("samples", *map(title, LEARNERS), *(f"HMA − {title(name)}" for name in LEARNERS[1:])), rows)


def even_matches() -> str:
    """Matches in which nobody, or everybody, has the cost of a block that does not move."""
    rows = [(who, *means((name, SHOWN) for name in names), *leads(names, SHOWN)) for who, names in MATCHES.items()]
    head = ("cost of a block that does not move", *map(title, LEARNERS))
    return table((*head, *(f"HMA − {title(name)}" for name in LEARNERS[1:])), rows)


def crossed() -> str:
    """Extractions where each learner plays each tower from each training set, and HMA's lead over the others there."""
    played: Any = _read("crossed_games").query("refused == 0").groupby("policy")["extractions"].mean()
    rows = [(title("hma"), f"{played['hma']:.1f}", "", "", "")]
    for row in _read("crossed_leads").to_dict("records"):
        name, spread = row["rival"], (row["std_tower"], row["std_set"])
        luck = [f"{value:.1f}" for value in spread]
        rows.append((title(name), f"{played[name]:.1f}", _interval(row, "difference", "low", "high"), *luck))
    head = ("who plays", "extractions", f"HMA ({SHOWN}) brings out more", "its spread by tower", "by training set")
    return table(head, rows)


def switches() -> str:
    """Extractions with each switch of the set-up, and what it changes on the same towers."""
    stored = _read("switch_effects")
    policies, rows = list(dict.fromkeys(stored["policy"])), []
    for name, part in stored.groupby("switch", sort=False):
        own = part.set_index("policy")
        cells = [_with_change(own.loc[policy]) if policy in own.index else "" for policy in policies]
        rows.append((str(name).replace("_", " "), *cells))
    return table(("as in the thesis", *(f"{title(name)}; change" for name in policies)), rows)


def title(policy: str) -> str:
    """A policy's name in these tables."""
    return TITLES.get(policy, policy)


def means(keys: Iterable[tuple[str, int]]) -> list[str]:
    """Mean ± standard error of each (policy, samples)."""
    return [_mean(_curve().loc[key]) for key in keys]


def leads(names: tuple[str, ...], size: int) -> list[str]:
    """How many more blocks the first policy brings out than each other at this number of samples."""
    return [lead(names[0], size, name, size) for name in names[1:]]


def lead(policy: str, size: int, rival: str, rival_size: int) -> str:
    """How many more blocks a policy brings out than a rival on the same towers, with 95 % interval."""
    stored: Any = _read("study_paired").set_index(["policy", "size", "rival", "rival_size"])
    return _interval(stored.loc[(policy, size, rival, rival_size)], "difference", "low", "high")


def _curve() -> "pd.DataFrame":
    return _read("study_curve").set_index(["policy", "size"])


@cache
def _read(name: str) -> "pd.DataFrame":
    import pandas as pd

    return pd.read_csv(STORE / f"{name}.csv")


def _mean(row: Any) -> str:
    return f"{row['mean']:.1f} ± {row['std']:.1f}".translate(MINUS)


def _with_change(row: Any) -> str:
    change = f"; {_interval(row, 'difference', 'difference_low', 'difference_high')}" if row["n_paired"] > 0 else ""
    return _mean(row) + change


def _interval(row: Any, value: str, low: str, high: str) -> str:
    return f"{row[value]:.1f} ({row[low]:.1f} to {row[high]:.1f})".translate(MINUS)
