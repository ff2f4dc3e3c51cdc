"""Command line of the proof of the comparison of engines.

python -m thesis_lib.critique.engines run [--seeds 5] [--jobs 2]
python -m thesis_lib.critique.engines table
python -m thesis_lib.critique.engines measured data/measured/planar_dice [--trials 100]
"""

import sys
from collections.abc import Sequence

from thesis_lib.critique.engines.proof import STORE, as_markdown, cases, compute, told
from thesis_lib.foundation.command_line import command, run_or_table


@command
def main(argv: Sequence[str] | None = None) -> int:
    about = "Drops that MuJoCo or Drake made: is the engine recognised, and right?"
    run = "compute what is not stored yet, 40 s of CPU each; goes on where it was stopped"
    parser, commands, running = run_or_table("python -m thesis_lib.critique.engines", about, run, "print the shares")
    running.add_argument("--seeds", type=int, default=5, help="of each engine, shape and cause; default: %(default)s")
    running.add_argument("--jobs", type=int, default=1, help="datasets at a time; default: %(default)s")
    measured = commands.add_parser("measured", help="compare laws and engines on a measured set, and store the rows")
    measured.add_argument("folder")
    measured.add_argument("--trials", type=int, help="the first ones; default: all")
    options = parser.parse_args(argv)
    if options.command == "table":
        print(as_markdown())
    elif options.command == "measured":
        from thesis_lib.critique.engines.measured import as_markdown as side_by_side
        from thesis_lib.critique.engines.measured import compute as compare
        from thesis_lib.datasets.read import read_dataset
        from thesis_lib.foundation.progress import Progress

        dataset = read_dataset(options.folder).first_trials(options.trials)
        with Progress(dataset.name) as say:
            compare(dataset, say)
        print(side_by_side())
    else:
        STORE.compute(cases(options.seeds), compute, print, told, options.jobs)
    return 0


if __name__ == "__main__":
    sys.exit(main())
