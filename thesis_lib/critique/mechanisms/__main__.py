"""Command line of the proof of the critique of mechanisms.

python -m thesis_lib.critique.mechanisms run
python -m thesis_lib.critique.mechanisms table
"""

import argparse
import functools
import sys

from thesis_lib.critique.mechanisms.proof import CAUSES, ENGINES, NOTHING, STORE, cases, compute, read, report, told
from thesis_lib.foundation.errors import UserError

DEVELOPMENT = 100  # first of the seeds for tuning


def main(arguments: list[str] | None = None) -> int:
    """Run a command and return the exit code: 1 for a `UserError`."""
    options = _parser().parse_args(arguments)
    try:
        if options.command == "table":
            print(report(read()), end="")
        else:
            _run(options)
    except UserError as error:
        print(error, file=sys.stderr)
        return 1
    return 0


def _run(options: argparse.Namespace) -> None:
    first = {"first": DEVELOPMENT} if options.development else {}
    chosen = [
        case
        for case in cases(options.nothing, options.causes, **first)
        if case.engine in options.engine and (not options.truths or case.truth in options.truths)
    ]
    if options.development:
        for case in chosen:
            print(f"{case}: {told(compute(case))}", flush=True)
    else:
        STORE.compute(chosen, compute, functools.partial(print, flush=True), told, again=options.again)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m thesis_lib.critique.mechanisms",
        description="The proof of the critique of mechanisms: causes hidden in recordings made by MuJoCo and by Drake.",
    )
    commands = parser.add_subparsers(dest="command", required=True)
    run = commands.add_parser("run", help="record and criticise; goes on where it stopped (10 minutes in all)")
    run.add_argument("--nothing", type=int, default=NOTHING, help="recordings with nothing hidden (%(default)s)")
    run.add_argument("--causes", type=int, default=CAUSES, help="recordings with each cause (%(default)s)")
    run.add_argument("--engine", nargs="+", choices=ENGINES, default=ENGINES)
    run.add_argument("--truths", nargs="+", metavar="NAME", help="only these")
    run.add_argument("--again", action="store_true", help="compute stored rows again")
    run.add_argument("--development", action="store_true", help="tuning seeds; results are printed, not stored")
    commands.add_parser("table", help="print the stored results, with every miss")
    return parser


if __name__ == "__main__":
    raise SystemExit(main())
