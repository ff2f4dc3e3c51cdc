"""Command line of the proofs: run cases, recompute stored rows, print tables, find the size of an effect.

python -m thesis_lib.studies.proof run --seeds 10 --source law --truths com_offset
python -m thesis_lib.studies.proof check --sample 10 --stamp
python -m thesis_lib.studies.proof table
python -m thesis_lib.studies.proof contacts
python -m thesis_lib.studies.proof size com_offset
python -m thesis_lib.studies.proof run --source mujoco --shape square --contact-time 1 --truths nothing
python -m thesis_lib.studies.proof run-table --jobs 2
python -m thesis_lib.studies.proof size com_offset_x --source mujoco --shape square
python -m thesis_lib.studies.proof next --questions 24
python -m thesis_lib.studies.proof engines run --jobs 2
python -m thesis_lib.studies.proof mechanisms table
python -m thesis_lib.studies.proof space --only nothing box
python -m thesis_lib.studies.proof space --worlds --jobs 2
python -m thesis_lib.studies.proof lifted --jobs 2
python -m thesis_lib.studies.proof measured run data/measured/planar_dice --trials 150 --single
"""

import argparse
import functools
import inspect
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from thesis_lib.datasets.read import read_dataset
from thesis_lib.foundation.command_line import FAILED, Parser, command
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.progress import Progress
from thesis_lib.foundation.rows import Rows
from thesis_lib.studies.proof import direct_fits, engines, measured, measured_models, mechanisms, proposals, space
from thesis_lib.studies.proof.by_contact import as_markdown as by_contact
from thesis_lib.studies.proof.cases import BODIES, CORNERED, OF_SOURCE, RATIO, SEEDS, SOURCES, Case, pairs, truths
from thesis_lib.studies.proof.check import ages, check, check_sample, rows_to_check
from thesis_lib.studies.proof.compute import compute, run
from thesis_lib.studies.proof.find_size import find_size
from thesis_lib.studies.proof.headline import WORLDS, planned
from thesis_lib.studies.proof.headline import as_markdown as headline_table
from thesis_lib.studies.proof.next_drops import QUESTIONS
from thesis_lib.studies.proof.next_drops import as_markdown as next_experiment
from thesis_lib.studies.proof.next_drops import run as run_questions
from thesis_lib.studies.proof.results import outcomes, recovered
from thesis_lib.studies.proof.sizes import require_checkout, store_cause_size, stored_factor
from thesis_lib.studies.proof.store import STORE, put_missing, said_of
from thesis_lib.studies.proof.summary import report
from thesis_lib.thesis.identify.impacts import law_free, law_free_in_space

SAMPLE = 2  # rows; about 20 s of CPU time each
# proofs other than the proof on drops: meaning of the options that their function `cases` takes as numbers
COUNTED = {
    engines: {"seeds": "of each engine, shape and cause"},
    proposals: {"seeds": "of each hidden law", "nothing": "sets with nothing hidden"},
    mechanisms: {"nothing": "recordings with nothing hidden", "causes": "recordings with each cause"},
}
tell = functools.partial(print, flush=True)


@command
def main(argv: Sequence[str] | None = None) -> int:
    """Run a command and return the exit code: 1 if a row differs or could not be computed."""
    options = _parser().parse_args(argv)
    require_checkout()
    return FAILED if options.do(options) is False else 0


def _run(options: argparse.Namespace) -> bool:
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
        raise UserError(f"No truth of the source {', '.join(options.source)} is called {' or '.join(options.truths)}.")
    if not options.development:
        return run([replace(case, seed=SEEDS + case.seed) for case in cases], options.jobs, tell)
    for case in cases:
        tell(f"{case}: {said_of(compute(case))}")
    return True


def _chosen(source: str, names: Sequence[str]) -> list[str]:
    """Truths of a source with the given names; "all" adds all single truths, "pairs" all pairs."""
    single, double = truths(source), pairs(source)
    chosen = {*names, *(single if "all" in names else ()), *(double if "pairs" in names else ())}
    return [truth for truth in [*single, *double] if truth in chosen]


def _run_table(options: argparse.Namespace) -> bool:
    cases = [case for case in planned() if case.source in options.source]
    return run(cases, options.jobs, tell, again=options.again)


def _check(options: argparse.Namespace) -> bool:
    tell(ages())
    if options.all:
        return check(rows_to_check(None, options.source), stamp=options.stamp, tell=tell)
    return check_sample(options.sample, options.source, stamp=options.stamp, tell=tell)


def _next(options: argparse.Namespace) -> None:
    run_questions(options.questions, tell)
    tell(next_experiment())


def _size(options: argparse.Namespace) -> None:
    known = truths(options.source)[1:]
    if unknown := set(options.name) - set(known):
        raise UserError(f"The source {options.source} cannot hide {unknown.pop()!r}; choose from {', '.join(known)}.")
    for name in options.name or known:
        shape = "square" if name in CORNERED else options.shape or "ellipse"
        case = Case(options.source, name, options.seed, shape=shape, contact_time=_seconds(options.contact_time))
        try:
            found = find_size(case)
        except UserError as error:
            if options.name:
                raise
            tell(error)
            continue
        stored = stored_factor(name, 1.0) if options.source == "law" else case.size(name)
        tell(f"{name}, {shape}: {found:g}{' (factor on its scales)' * (options.source == 'law')}, stored {stored:g}")
        if options.store and options.source != "law":
            store_cause_size(options.source, shape, name, found)


def _seconds(milliseconds: float | None) -> float:
    return OF_SOURCE if milliseconds is None else 1e-3 * milliseconds


def _run_other(proof: Any, options: argparse.Namespace) -> bool:
    """Run another proof; rows of seeds below the first seed of its table are printed, not stored."""
    counts = {name: getattr(options, name) for name in (*COUNTED[proof], "first")}
    cases = [case for case in proof.cases(**counts) if not options.only or set(options.only) & set(vars(case).values())]
    if options.first < proof.SEEDS:
        for case in cases:
            tell(f"{case}: {proof.told(proof.compute(case))}")
        return True
    return _put(options, cases, proof.compute, proof.ROWS, proof.told)


def _put(options: argparse.Namespace, cases: list, compute: Callable, rows: Rows, told: Callable) -> bool:
    return put_missing(cases, compute, lambda case: rows, told, tell, jobs=options.jobs, again=options.again)


def _space(options: argparse.Namespace) -> bool:
    proof = options.proof
    if "only" in options:
        made = _put(options, space.chosen(proof, options.only), space.compute, proof.rows, said_of)
    else:
        made = _put(options, space.not_right(proof), space.compute_missed, proof.missed, space.told_missed)
    tell(space.as_markdown(proof))
    return made


def _lifted(options: argparse.Namespace) -> bool:
    cases = [space.Lifted(truth, shape) for truth, shape in space.LIFTED]
    made = _put(options, cases, space.compute_lifted, space.LIFTED_ROWS, space.told_lifted)
    tell(space.lifted_as_markdown())
    return made


def _run_measured(proof: Any, options: argparse.Namespace) -> None:
    dataset = read_dataset(options.folder).first_trials(options.trials)
    own = {"single": options.single} if proof is measured else {}
    with Progress(dataset.name) as say:
        proof.compute(dataset, say, effects=options.effects, **own)
    tell(proof.as_markdown())


def _run_fits(options: argparse.Namespace) -> None:
    direct_fits.compute(options.drops or direct_fits.SERIES, options.measured, tell)


def _law_free(options: argparse.Namespace) -> None:
    dataset = read_dataset(options.folder).first_trials(options.trials)
    if dataset.space.is_plane:
        tell(law_free.as_text(dataset))
    else:
        tell(law_free_in_space.as_text(dataset, STORE / law_free_in_space.ROWS.path if options.store else None))


def _parser() -> Parser:
    parser = Parser(
        prog="python -m thesis_lib.studies.proof",
        description="The proofs of the critique, which searches for effects and causes that are hidden on purpose.",
    )
    commands = parser.add_subparsers(required=True)

    def add(name: str, do: Callable[[argparse.Namespace], Any], about: str, to: Any = commands) -> Any:
        new = to.add_parser(name, help=about, description=about)
        new.set_defaults(do=do)
        return new

    def add_jobs(to: Any, again: str = "") -> None:
        to.add_argument("--jobs", type=int, default=1, help="processes at a time (1)")
        if again:
            to.add_argument("--again", action="store_true", help=f"recompute {again} afterwards")

    def add_set(to: Any) -> None:
        to.add_argument("folder")
        to.add_argument("--trials", type=int, help="use only that many trials, the first ones; default: all")

    run = add("run", _run, "criticise datasets with hidden effects; stored results are kept")
    run.add_argument("--source", nargs="+", choices=SOURCES, default=SOURCES)
    named = "effects, causes, nothing, all, or pairs"
    run.add_argument("--truths", nargs="+", default=["all"], metavar="NAME", help=named)
    run.add_argument("--seeds", type=int, default=1, help="number of datasets for each truth (1)")
    run.add_argument("--first", type=int, default=0, help="offset of the first seed (0)")
    run.add_argument("--drops", type=int, default=150)
    run.add_argument("--noise", type=float, default=1.0, help="factor on the noise of the rig (1)")
    run.add_argument("--ratio", type=float, default=RATIO, help="misfit over the noise floor (3)")
    run.add_argument("--shape", nargs="+", choices=tuple(BODIES), help="default: ellipse, or square if corners matter")
    run.add_argument("--contact-time", type=float, metavar="MS", help="of a central impact, ms (that of the source)")
    run.add_argument("--development", action="store_true", help="use tuning seeds; results are printed, not stored")
    add_jobs(run)
    right = "print the share of right verdicts for each simulator, as a table in Markdown"
    add("headline", lambda options: tell(headline_table()), right)
    whole = "compute the missing rows of the headline table (some hours); resumes after an interruption"
    worlds = [source for sources in WORLDS.values() for source in sources]
    table_of = add("run-table", _run_table, whole)
    table_of.add_argument("--source", nargs="+", choices=worlds, default=worlds)
    add_jobs(table_of, "rows of older code")
    older = "list which stored rows are older than the code, and recompute some of them"
    again = add("check", _check, older)
    again.add_argument("--source", nargs="+", choices=SOURCES, default=SOURCES)
    again.add_argument("--sample", type=int, default=SAMPLE, help=f"number of rows to recompute, 20 s each ({SAMPLE})")
    every = "recompute all rows that are older than the code (a night); resumes if --stamp is given"
    again.add_argument("--all", action="store_true", help=every)
    again.add_argument("--stamp", action="store_true", help="store the new row if the verdict agrees")
    real = "print the results for contacts of realistic duration in Markdown, with a list of all misses"
    add("contacts", lambda options: print(by_contact(outcomes(), recovered()), end=""), real)
    targets = "print the stored results against the targets, the misses and the confusion table"
    table = add("table", lambda options: print(report(folder=options.csv), end=""), targets)
    files = "also write summary.csv, real_contacts.csv, misses.csv and confusion.csv into this folder"
    table.add_argument("--csv", type=Path, metavar="DIR", help=files)
    worth = "test whether drops in the proposed states settle questions sooner than random drops (10 s a question)"
    wanted = f"number of questions that 50 random drops leave open, stored ones included ({QUESTIONS})"
    add("next", _next, worth).add_argument("--questions", type=int, default=QUESTIONS, help=wanted)
    found = "find again the size of an effect or cause at which the misfit is 3 times the noise floor (half a minute)"
    size = add("size", _size, found)
    size.add_argument("name", nargs="*", help="effects (source law) or causes (other sources); default: all")
    size.add_argument("--source", choices=SOURCES, default="law", help="sources other than law take minutes (law)")
    size.add_argument("--shape", choices=tuple(BODIES), help="of the body (ellipse)")
    size.add_argument("--contact-time", type=float, metavar="MS", help="of a cause, ms (that of the source)")
    size.add_argument("--store", action="store_true", help="store the sizes of causes in config/proof_sizes.json")
    size.add_argument("--seed", type=int, default=7, help="development seed (7)")

    def add_stored(proof: Any, do: Callable[[argparse.Namespace], Any], run: str) -> Any:
        name = proof.__name__.rpartition(".")[2].replace("_", "-")
        parts = commands.add_parser(name, help=proof.__doc__.splitlines()[0]).add_subparsers(required=True)
        add("table", lambda options: tell(proof.as_markdown()), "print the stored results", parts)
        return add("run", do, run, parts)

    for proof, counted in COUNTED.items():
        goes_on = "compute the rows that are not stored yet; resumes after an interruption"
        run = add_stored(proof, functools.partial(_run_other, proof), goes_on)
        defaults = inspect.signature(proof.cases).parameters
        for option, of in (counted | {"first": "first seed; results of earlier ones are printed, not stored"}).items():
            run.add_argument(f"--{option}", type=int, default=defaults[option].default, help=f"{of} (%(default)s)")
        run.add_argument("--only", nargs="+", metavar="NAME", help="run only these causes, shapes or simulators")
        add_jobs(run, "stored rows")
    compared, criticised = "compare laws and engines on a measured set", "criticise a measured set and store its row"
    for proof, about in ((measured_models, compared), (measured, criticised)):
        run = add_stored(proof, functools.partial(_run_measured, proof), about)
        add_set(run)
        run.add_argument("--effects", default="", help="effects to switch on instead of a search, separated by commas")
    run.add_argument("--single", action="store_true", help="single hits only, no episodes")
    how, series = "fit the models and store their rows; a minute or more each", tuple(direct_fits.SERIES)
    run = add_stored(direct_fits, _run_fits, how)
    run.add_argument("--drops", action="append", choices=series, help="may be repeated; default: all")
    run.add_argument("--measured", type=Path, default=Path("data/measured"), help="folder of the measured sets")
    of_lifted = add("lifted", _lifted, "planar sets lifted into space: compute missing rows, then print the table")
    of_space = add("space", _space, "bodies in space: compute missing rows, then print the table")
    of_missed = add("space-missed", _space, "gain of the hidden cause, switched on by hand, where `space` misses it")
    listing = add("space-list", lambda options: space.write_list(options.proof), "list the random draws of each set")
    of_space.add_argument(
        "--only", nargs="*", default=(), metavar="NAME", help="worlds, shapes or hidden causes to run (all)"
    )
    for one in (of_space, of_missed, listing):
        three = "three simulators, pairs of causes, and causes outside the library; default: the first proof in space"
        one.add_argument(
            "--worlds", dest="proof", action="store_const", const=space.IN_WORLDS, default=space.FIRST, help=three
        )
    for one in (of_space, of_missed, of_lifted):
        add_jobs(one, "stored rows")
    about = "results for measured throws of a body with faces that hold without any contact law"
    of_law_free = add("law-free", _law_free, about)
    add_set(of_law_free)
    of_law_free.add_argument(
        "--store", action="store_true", help="for a body in space: store the results in config/proof/law_free.csv"
    )
    return parser


if __name__ == "__main__":
    raise SystemExit(main())
