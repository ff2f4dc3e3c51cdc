"""What every benchmark has in common: its options, its rows, and how two ways to do a thing are timed.

Rows are benchmark, measure, value, unit, note; `--out results/benchmarks/<name>.csv` writes them, and
`python -m benchmarks.table` makes the README's table of all such files.
"""

import argparse
import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pandas as pd

from thesis_lib.foundation.files import write_table

COLUMNS = ["benchmark", "measure", "value", "unit", "note"]
MAX_CALLS = 1_000_000  # in one round: an empty function would be called for ever


@dataclass
class Results:
    """The rows of one benchmark; `add` takes them in the order in which the table shows them."""

    benchmark: str
    rows: list[dict] = field(default_factory=list)

    def add(self, measure: str, value: float, unit: str = "1", note: str = "") -> None:
        """Keep a value to four digits; what could not be measured (NaN) stays an empty cell with its note."""
        rounded = float(f"{value:.4g}") if math.isfinite(value) else math.nan
        self.rows.append(dict(zip(COLUMNS, (self.benchmark, measure, rounded, unit, note))))

    def write(self, path: Path | None) -> None:
        """Write the rows as CSV, if a path is given."""
        if path is not None:
            write_table(pd.DataFrame(self.rows, columns=COLUMNS), path)


def benchmark_parser(name: str, description: str) -> argparse.ArgumentParser:
    """Parser with the options that all benchmarks have: --quick and --out."""
    parser = argparse.ArgumentParser(prog=f"python -m benchmarks.{name}", description=description)
    parser.add_argument("--quick", action="store_true", help="tiny sizes: does it run, not how fast")
    parser.add_argument("-o", "--out", type=Path, metavar="FILE.csv", help="write the rows as CSV too")
    return parser


def at_least(least: int) -> Callable[[str], int]:
    """Type of an option: a whole number that is not less."""

    def number(text: str) -> int:
        if (value := int(text)) < least:
            raise argparse.ArgumentTypeError(f"{value} is less than {least}")
        return value

    return number


def alternately(calls: Mapping[str, Callable[[], object]], rounds: int, seconds: float = 0.0) -> dict[str, np.ndarray]:
    """CPU seconds (rounds,) of one call of each, measured round by round in turn.

    Each is called once before, and in each round as often as fills `seconds`: what else the machine does then slows
    all of them alike, and the ratio of two is taken within a round.
    """
    often = {}
    for name, call in calls.items():
        call()
        start = time.process_time()
        call()
        once = max(time.process_time() - start, 1e-7)
        often[name] = int(np.clip(seconds / once, 1, MAX_CALLS))
    times = {name: np.empty(rounds) for name in calls}
    for i in range(rounds):
        for name, call in calls.items():
            start = time.process_time()
            for _ in range(often[name]):
                call()
            times[name][i] = (time.process_time() - start) / often[name]
    return times


def ratio(times: Mapping[str, np.ndarray], slower: str, faster: str) -> float:
    """Median over the rounds of how many times as long `slower` takes."""
    return float(np.median(times[slower] / times[faster]))


def exponent(n: Sequence[float], seconds: Sequence[float]) -> tuple[float, float]:
    """Exponent p of seconds = a nᵖ, and half of its 95 % interval (NaN for two points)."""
    from scipy.stats import linregress, t

    line = linregress(np.log(n), np.log(seconds))
    freedom = len(n) - 2
    return float(line.slope), float(t.ppf(0.975, freedom) * line.stderr) if freedom > 0 else np.nan
