"""Command line of the proof of the critique of mechanisms.

python -m thesis_lib.critique.mechanisms run
python -m thesis_lib.critique.mechanisms table
"""

import functools
from collections.abc import Sequence

from thesis_lib.critique.mechanisms.proof import CAUSES, ENGINES, NOTHING, STORE, cases, compute, read, report, told
from thesis_lib.foundation.command_line import command, run_or_table

DEVELOPMENT = 100  # first of the seeds for tuning


@command
def main(argv: Sequence[str] | None = None) -> int:
    about = "The proof of the critique of mechanisms: causes hidden in recordings made by MuJoCo and by Drake."
    how = "record and criticise; goes on where it stopped (10 minutes in all)"
    of_table = "print the stored results, with every miss"
    parser, _, run = run_or_table("python -m thesis_lib.critique.mechanisms", about, how, of_table)
    run.add_argument("--nothing", type=int, default=NOTHING, help="recordings with nothing hidden (%(default)s)")
    run.add_argument("--causes", type=int, default=CAUSES, help="recordings with each cause (%(default)s)")
    run.add_argument("--engine", nargs="+", choices=ENGINES, default=ENGINES)
    run.add_argument("--truths", nargs="+", metavar="NAME", help="only these")
    run.add_argument("--again", action="store_true", help="compute stored rows again")
    run.add_argument("--development", action="store_true", help="tuning seeds; results are printed, not stored")
    options = parser.parse_args(argv)
    if options.command == "table":
        print(report(read()), end="")
        return 0
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
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
