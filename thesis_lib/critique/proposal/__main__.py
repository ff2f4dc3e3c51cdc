"""Command line of the proof of proposals.

python -m thesis_lib.critique.proposal run [--seeds 3] [--nothing 20]
python -m thesis_lib.critique.proposal table
"""

import sys
from collections.abc import Sequence

from thesis_lib.critique.proposal.proof import STORE, as_markdown, cases, compute, told
from thesis_lib.foundation.command_line import command, run_or_table


@command
def main(argv: Sequence[str] | None = None) -> int:
    about = "Drops with a law that no effect names: is the right term proposed, and none where none is hidden?"
    run = "compute what is not stored yet, 10 to 60 s of CPU each; goes on where it was stopped"
    parser, _, running = run_or_table("python -m thesis_lib.critique.proposal", about, run, "print the shares")
    running.add_argument("--seeds", type=int, default=3, help="of each hidden law; default: %(default)s")
    running.add_argument("--nothing", type=int, default=20, help="sets with nothing hidden; default: %(default)s")
    options = parser.parse_args(argv)
    if options.command == "table":
        print(as_markdown())
    else:
        STORE.compute(cases(options.seeds, options.nothing), compute, print, told)
    return 0


if __name__ == "__main__":
    sys.exit(main())
