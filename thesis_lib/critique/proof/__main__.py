"""Command line of the proof: run cases, check stored rows, print the table, find the size of an effect.

python -m thesis_lib.critique.proof run --seeds 10 --source law --truths com_offset
python -m thesis_lib.critique.proof check --sample 10 --stamp
python -m thesis_lib.critique.proof table
python -m thesis_lib.critique.proof contacts
python -m thesis_lib.critique.proof size com_offset
python -m thesis_lib.critique.proof run --source mujoco --shape square --contact-time 1 --truths nothing
python -m thesis_lib.critique.proof run-table --jobs 2
python -m thesis_lib.critique.proof size com_offset_x --source mujoco --shape square
python -m thesis_lib.critique.proof next --questions 24
"""

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from thesis_lib.critique.proof.by_contact import as_markdown
from thesis_lib.critique.proof.cases import BODIES, CORNERED, OF_SOURCE, RATIO, SEEDS, SOURCES, Case, pairs, truths
from thesis_lib.critique.proof.cause_sizes import find_cause_size
from thesis_lib.critique.proof.check import ages, check, check_sample, rows_to_check
from thesis_lib.critique.proof.compute import compute
from thesis_lib.critique.proof.headline import as_markdown as headline_table
from thesis_lib.critique.proof.next_drops import QUESTIONS
from thesis_lib.critique.proof.next_drops import run as run_questions
from thesis_lib.critique.proof.next_drops_table import as_markdown as next_experiment
from thesis_lib.critique.proof.plan import WORLDS, headline, run
from thesis_lib.critique.proof.results import outcomes, recovered
from thesis_lib.critique.proof.sizes import find_size, require_checkout, store_cause_size, stored_factor
from thesis_lib.critique.proof.store import put_row, read_rows
from thesis_lib.critique.proof.summary import report
from thesis_lib.foundation.command_line import FAILED, Parser, command
from thesis_lib.foundation.errors import UserError

SAMPLE = 2  # rows; about 20 s of CPU time each


@command
def main(argv: Sequence[str] | None = None) -> int:
    """Run a command and return the exit code: 1 if a row differs."""
    options = _parser().parse_args(argv)
    require_checkout()
    if options.command == "run":
        _run(options)
    elif options.command == "run-table":
        cases = [case for case in headline() if case.source in options.source]
        return 0 if run(cases, options.jobs, lambda line: print(line, flush=True), again=options.again) else FAILED
    elif options.command == "check":
        print(ages())
        arguments_of = {"stamp": options.stamp, "tell": lambda line: print(line, flush=True)}
        if options.all:
            return 0 if check(rows_to_check(None, options.source), **arguments_of) else FAILED
        return 0 if check_sample(options.sample, options.source, **arguments_of) else FAILED
    elif options.command == "contacts":
        print(as_markdown(outcomes(), recovered()), end="")
    elif options.command == "headline":
        print(headline_table())
    elif options.command == "table":
        print(report(folder=options.csv), end="")
    elif options.command == "next":
        run_questions(options.questions, lambda line: print(line, flush=True))
        print(next_experiment(), flush=True)
    else:
        _size(options)
    return 0


def _size(options: argparse.Namespace) -> None:
    known = truths(options.source)[1:]
    if unknown := set(options.name) - set(known):
        raise UserError(f"The source {options.source} hides no {unknown.pop()!r}; known are {', '.join(known)}.")
    for name in options.name or known:
        if options.source == "law":
            factor = find_size(name, RATIO, options.seed)
            print(f"{name}: {factor:g} (factor on its scales), stored {stored_factor(name):g}", flush=True)
            continue
        shape = "square" if name in CORNERED else options.shape or "ellipse"
        case = Case(options.source, name, options.seed, shape=shape, contact_time=_seconds(options.contact_time))
        try:
            found = find_cause_size(case)
        except UserError as error:
            if options.name:
                raise
            print(error, flush=True)
            continue
        print(f"{name}, {shape}: {found:g}, stored {case.size(name):g}", flush=True)
        if options.store:
            store_cause_size(options.source, shape, name, found)


def _seconds(milliseconds: float | None) -> float:
    return OF_SOURCE if milliseconds is None else 1e-3 * milliseconds


def _run(options: argparse.Namespace) -> None:
    time = _seconds(options.contact_time)
    cases = [
        Case(source, truth, seed, options.drops, options.noise, options.ratio, shape or "", time)
        for seed in range(options.first, options.first + options.seeds)
        for source in options.source
        for truth in _chosen(source, options.truths)
        for shape in options.shape or [None]
        if not (shape == "ellipse" and CORNERED & set(truth.split("+")))
    ]
    if not cases:
        raise UserError(f"No truth of {', '.join(options.source)} is called {' or '.join(options.truths)}.")
    for case in cases:
        case = case if options.development else replace(case, seed=SEEDS + case.seed)
        if not options.development and case in read_rows(case.source):
            continue
        row = compute(case)
        if not options.development:
            put_row(row)
        print(f"{case}: {row.verdict}, {row.named or row.why or 'nothing named'}", flush=True)


def _chosen(source: str, names: Sequence[str]) -> list[str]:
    """Truths of a source by name; "all" adds all single ones and "pairs" all pairs."""
    single, double = truths(source), pairs(source)
    chosen = {*names, *(single if "all" in names else ()), *(double if "pairs" in names else ())}
    return [truth for truth in [*single, *double] if truth in chosen]


def _parser() -> Parser:
    parser = Parser(
        prog="python -m thesis_lib.critique.proof",
        description="The proof of the critique: effects and causes hidden on purpose and looked for.",
    )
    commands = parser.add_subparsers(dest="command", required=True)
    run = commands.add_parser("run", help="criticise datasets with hidden effects; stored results are kept")
    run.add_argument("--source", nargs="+", choices=SOURCES, default=SOURCES)
    named = "effects, causes, nothing, all, or pairs"
    run.add_argument("--truths", nargs="+", default=["all"], metavar="NAME", help=named)
    run.add_argument("--seeds", type=int, default=1, help="datasets of each (1)")
    run.add_argument("--first", type=int, default=0, help="offset of the first seed (0)")
    run.add_argument("--drops", type=int, default=150)
    run.add_argument("--noise", type=float, default=1.0, help="times the rig's (1)")
    run.add_argument("--ratio", type=float, default=RATIO, help="misfit over the noise floor (3)")
    run.add_argument("--shape", nargs="+", choices=tuple(BODIES), help="ellipse, but a square where corners matter")
    run.add_argument("--contact-time", type=float, metavar="MS", help="of a central impact, ms; that of the source")
    run.add_argument("--development", action="store_true", help="tuning seeds; results are printed, not stored")
    commands.add_parser("headline", help="right verdicts by the world that made the drops, as a table in Markdown")
    whole = "compute what is missing of the headline table, some hours; goes on where it was stopped"
    worlds = [source for sources in WORLDS.values() for source in sources]
    table_of = commands.add_parser("run-table", help=whole)
    table_of.add_argument("--source", nargs="+", choices=worlds, default=worlds)
    table_of.add_argument("--jobs", type=int, default=1, help="processes at a time (1)")
    table_of.add_argument("--again", action="store_true", help="then compute rows of older code again")
    older = "say which stored rows are older than the code, and compute some of them again"
    again = commands.add_parser("check", help=older)
    again.add_argument("--source", nargs="+", choices=SOURCES, default=SOURCES)
    again.add_argument("--sample", type=int, default=SAMPLE, help=f"rows to compute again, 20 s each ({SAMPLE})")
    every = "all that are older than the code: over night; goes on with --stamp"
    again.add_argument("--all", action="store_true", help=every)
    again.add_argument("--stamp", action="store_true", help="store what was computed where the verdict agrees")
    commands.add_parser(
        "contacts", help="contacts as long as real ones, as a table in Markdown, with every miss by name"
    )
    table = commands.add_parser("table", help="the stored results against the targets, the misses, the confusion table")
    files = "write summary.csv, real_contacts.csv, misses.csv and confusion.csv there too"
    table.add_argument("--csv", type=Path, metavar="DIR", help=files)
    worth = (
        "do the states that the critique proposes settle questions with fewer drops than random ones? (10 s a question)"
    )
    following = commands.add_parser("next", help=worth)
    wanted = f"questions that 50 random drops leave open; stored ones count ({QUESTIONS})"
    following.add_argument("--questions", type=int, default=QUESTIONS, help=wanted)
    found = "find the size of an effect or cause at which the misfit is 3 times the floor again (half a minute)"
    size = commands.add_parser("size", help=found)
    size.add_argument("name", nargs="*", help="effects of the source law, causes of another one (all)")
    size.add_argument("--source", choices=SOURCES, default="law", help="other than law: some minutes (law)")
    size.add_argument("--shape", choices=tuple(BODIES), help="of a cause's body (ellipse)")
    size.add_argument("--contact-time", type=float, metavar="MS", help="of a cause, ms; that of the source")
    size.add_argument("--store", action="store_true", help="put sizes of causes into config/proof_sizes.json")
    size.add_argument("--seed", type=int, default=7, help="development seed (7)")
    return parser


if __name__ == "__main__":
    raise SystemExit(main())
