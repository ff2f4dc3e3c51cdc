"""Command line of the proof: run cases, print the table, find the size of an effect."""

import argparse
import sys
import tempfile
from pathlib import Path

from thesis_lib.critique.proof.cases import RATIO, SEEDS, SOURCES, STORE, Case, pairs, run, truths
from thesis_lib.critique.proof.sizes import find_size, stored_factor
from thesis_lib.critique.proof.summary import report
from thesis_lib.effects import EFFECTS
from thesis_lib.foundation.errors import UserError


def main(arguments: list[str] | None = None) -> int:
    """Command line: run cases, or print the table."""
    parser = argparse.ArgumentParser(
        prog="python -m thesis_lib.critique.proof", description="Run the proof, or print its table."
    )
    commands = parser.add_subparsers(dest="command", required=True)
    go = commands.add_parser("run", help="criticise datasets with hidden effects; stored results are kept")
    go.add_argument("--source", nargs="+", choices=SOURCES, default=SOURCES)
    go.add_argument(
        "--truths", nargs="+", default=["all"], metavar="NAME", help="effects, causes, nothing, all, or pairs"
    )
    go.add_argument("--seeds", type=int, default=1, help="datasets of each (1)")
    go.add_argument("--first", type=int, default=0, help="offset of the first seed (0)")
    go.add_argument("--drops", type=int, default=150)
    go.add_argument("--noise", type=float, default=1.0, help="times the rig's (1)")
    go.add_argument("--ratio", type=float, default=RATIO, help="misfit over the noise floor (3)")
    go.add_argument(
        "--development", action="store_true", help="tuning seeds; results are printed, not stored"
    )
    table = commands.add_parser(
        "table", help="the stored results against the targets, the misses, the confusion table"
    )
    table.add_argument(
        "--csv", type=Path, metavar="DIR", help="write summary.csv, misses.csv and confusion.csv there too"
    )
    size = commands.add_parser(
        "size",
        help="find the size of an effect at which the misfit is 3 times the floor again (half a minute)",
    )
    size.add_argument("effect", choices=tuple(EFFECTS))
    size.add_argument("--seed", type=int, default=7, help="development seed (7)")
    options = parser.parse_args(arguments)
    if options.command == "size":
        found = find_size(options.effect, RATIO, options.seed)
        print(f"{options.effect}: {found:g}, stored {stored_factor(options.effect):g} (factor on its scales)")
        return 0
    if options.command == "table":
        try:
            print(report(STORE, options.csv), end="")
        except UserError as error:
            print(error, file=sys.stderr)
            return 1
        return 0
    store = Path(tempfile.mkdtemp()) if options.development else STORE
    for i in range(options.first, options.first + options.seeds):
        seed = i if options.development else SEEDS + i
        for source in options.source:
            wanted = [*truths(source), *pairs(source)] if "all" not in options.truths else truths(source)
            if "pairs" in options.truths:
                wanted = pairs(source)
            for truth in wanted:
                if {"all", "pairs", truth} & set(options.truths):
                    case = Case(source, truth, seed, options.drops, options.noise, options.ratio)
                    result = run(case, store)
                    print(source, truth, seed, result["verdict"], result.get("steps"), flush=True)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
