"""`thesis-lib critique`: one dataset or recording, two side by side, or many."""

import argparse
import json
import os
import sys
from collections.abc import Sequence
from pathlib import Path

from thesis_lib.commands.effects import add_option, load_additions
from thesis_lib.foundation import SEED
from thesis_lib.foundation.command_line import FAILED, INTERRUPTED, Parser, command
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.forked import MOST, cores, sharing
from thesis_lib.foundation.progress import Progress

STAGES = {  # share of the run time that has passed when a stage begins, for the example of the README
    "fitting": 0.06,
    "step 1: trying": 0.09,
    "step 2: trying": 0.35,
    "step 3: trying": 0.5,
    "judging": 0.55,
    "writing": 0.57,
}
DESCRIPTION = """\
Fit all impact laws to a dataset, find where the best law fails, identify the missing physical effects, and add them.
Effects are selected on 70 % of the trials; all reported errors are for the other 30 %. 300 drops take half a minute.
For the recording of a mechanism (an arm that pushes a disk, a rimless wheel), the critique identifies the force that
is missing from the assumed equations of motion.

Fewer than 30 usable impacts in 10 trials give restitution with its standard error, and friction, but no verdict.

  one PATH              a dataset of drops, or a recording: find the deficits of its model
  two PATHs             two datasets, or two folders that a critique wrote, side by side
  --batch PATH...       any number of datasets, each on its own, and an index of them

Files written into DIR:
  report.html      start here: the verdict and its derivation, with figures
  diagnosis.json   the same for programs: verdict (adequate, effects, unexplained, or null), effects, remaining errors
  model.json       the law with its effects, for thesis-lib predict
  candidates.csv   the effects that were tried, the gain of each alone, and the evidence against it
  choices.csv      the error for each choice among the effects found and their closest rival (in the plane)
  comparison.csv, ladder.csv, budget.csv, errors.csv, impacts.csv (in the plane), where.json, and the figures
  DIR_proposal.py  next to DIR, if no known effect fits and a term is proposed: an effect file for --effects
  models.csv       with --models: laws and simulators side by side
  for a recording: report.html, diagnosis.json, misfit.csv, mechanism_residuals.csv, and the figure
With --batch, DIR holds such a folder and a log for each dataset, and
  index.html       start here: one line per dataset with verdict, effects and errors, or the reason of a failure
  batch.csv        the same as a table; batch.json: for programs

Exit code: 0; 1 if a dataset of a batch failed; 2 if the command or the dataset is wrong; 130 if interrupted (Ctrl-C).
"""
EXAMPLES = """\
A dataset is a folder with dataset.yaml and trajectories.csv or impacts.csv, a recording is a folder with recording.yaml
and states.csv; thesis-lib datasets writes one from a rig's logs, or an example, and checks it.

examples:
  thesis-lib critique data/my_drops -o results/critique/my_drops
  thesis-lib critique data/my_drops --effect tangential_restitution --effect surface_tilt
  thesis-lib critique data/my_drops --effects my_effects.py     tests an effect of your own, too
  thesis-lib critique data/my_drops --models laws,mujoco,drake   which simulator predicts it best?
  thesis-lib critique data/my_drops --json | jq .verdict
  thesis-lib critique data/before data/after -o results/critique/repair
  thesis-lib critique results/critique/before results/critique/after       finished runs
  thesis-lib critique --batch data/rigs -o results/rigs --jobs 8
  thesis-lib critique data/wheel -o results/critique/wheel       a recording with recording.yaml
"""


def build_parser() -> Parser:
    parser = Parser(prog="thesis-lib critique", description=DESCRIPTION, epilog=EXAMPLES)
    paths = (
        "folder of a dataset (dataset.yaml and trajectories.csv or impacts.csv) or of a recording (recording.yaml and "
        "states.csv); with --batch also a folder of such folders"
    )
    out = "folder to write; default: results/critique/<name of the dataset>, for a batch results/critique"
    effect = (
        "use this effect instead of the automatic selection; for a recording, test only this effect; may be given "
        "several times"
    )
    printed = "print diagnosis.json (for a batch batch.json) instead of text"
    parser.add_argument("paths", nargs="+", metavar="PATH", help=paths)
    parser.add_argument("-o", "--out", metavar="DIR", help=out)
    parser.add_argument("--effect", action="append", dest="effects", metavar="NAME", help=effect)
    add_option(parser)
    compared = (
        "compare these models, each fitted without and with the selected effects: laws, mujoco, drake, "
        "drake_hydroelastic, bullet (needs PyBullet); in space laws, mujoco, drake; separated by commas (takes a "
        "minute or more, drake_hydroelastic several)"
    )
    parser.add_argument("--models", metavar="LIST", help=compared)
    proposed = (
        "file for the term that is proposed if the verdict is unexplained; the search also runs if --effect is given; "
        "default: <DIR>_proposal.py next to DIR"
    )
    parser.add_argument("--propose", metavar="FILE.py", help=proposed)
    first = "use only the first N trials, for a first look at a large dataset"
    parser.add_argument("--trials", type=int, metavar="N", help=first)
    parser.add_argument("--seed", type=int, default=SEED, help="seed of splits and resamples; default: %(default)s")
    shared = (
        "number of processes, or with --batch of datasets at a time; default: number of cores, "
        f"for one dataset at most {MOST}"
    )
    parser.add_argument("--jobs", type=int, metavar="N", help=shared)
    parser.add_argument("--json", action="store_true", help=printed)
    parser.add_argument("-q", "--quiet", action="store_true", help="print no progress to stderr")
    batch = parser.add_argument_group(
        "many datasets",
        "A dataset that is refused, crashes, hangs or takes all memory does not stop the others. The same command "
        "resumes a batch: finished datasets are skipped unless data, settings or code have changed.",
    )
    batch.add_argument("--batch", action="store_true", help="criticise each dataset on its own")
    limit = "seconds per dataset; default: %(default)g"
    batch.add_argument("--time-limit", type=float, default=3600.0, metavar="S", help=limit)
    batch.add_argument("--memory-limit", type=float, metavar="GB", help="memory per dataset; default: no limit")
    return parser


@command
def critique(argv: Sequence[str] | None = None) -> int:
    args = build_parser().parse_args(argv)
    if args.seed < 0:
        raise UserError(f"--seed must be 0 or more, got {args.seed}.")
    for name in ("jobs", "trials", "time_limit", "memory_limit"):
        value = getattr(args, name)
        if value is not None and not value > 0:
            raise UserError(f"--{name.replace('_', '-')} must be above 0, got {value:g}.")
    args.jobs = args.jobs or (cores() if args.batch else min(cores(), MOST))
    args.effects = args.effects and tuple(dict.fromkeys(args.effects))
    if args.models is not None:
        from thesis_lib.critique.engines.compare import read_models

        if args.batch or len(args.paths) > 1:
            raise UserError("--models compares models on one dataset; give one, without --batch.")
        args.models = read_models(args.models)
    if args.propose is not None:
        _require_place(args.propose, args)
    if args.trials is not None and args.batch:
        raise UserError("--trials takes the first trials of one dataset; leave out --batch.")
    args.additions = load_additions(args.files, args.paths)
    if args.batch:
        return _batch(args)
    if len(args.paths) > 2:
        raise UserError(
            f"critique takes one dataset, or two to compare; {len(args.paths)} were given. To criticise each on its "
            "own, add --batch."
        )
    return _one(args) if len(args.paths) == 1 else _compare(args)


def _require_place(path: str, args: argparse.Namespace) -> None:
    """Reject a path for the proposal that could not be loaded with --effects or that exists already."""
    from thesis_lib.extensions.loading import require_outside_of_data

    if args.batch or len(args.paths) > 1:
        raise UserError("--propose names the file of one proposal; give one dataset, without --batch.")
    if not path.endswith(".py"):
        raise UserError(f"--propose {path}: the proposal is a Python file; give it a name that ends in .py.")
    require_outside_of_data(path, args.paths)
    if os.path.lexists(path):
        raise UserError(f"--propose {path}: that file exists already and stays as it is; choose another name.")


def _one(args: argparse.Namespace) -> int:
    from thesis_lib.commands.comparison import is_run
    from thesis_lib.critique.printed import diagnosis_text
    from thesis_lib.critique.proposal.results import proposal_path

    path = args.paths[0]
    if is_run(path):
        raise UserError(f"{path} was written by a critique; give the dataset, or a second run to compare it with.")
    content, folder = _run(path, args.out, args)
    if args.json:
        print(json.dumps(content, indent=1, sort_keys=True, ensure_ascii=False, allow_nan=False))
    else:
        print(diagnosis_text(content))
        print(f"\nwritten to {folder}; open {folder / 'report.html'}")
        if content.get("proposal"):
            file = Path(args.propose or proposal_path(folder).with_name(content["proposal"]["file"]))
            print(f"proposed: {file}; add it with  thesis-lib critique {path} --effects {file}")
    return 0


def _run(path: str, out: str | Path | None, args: argparse.Namespace) -> tuple[dict, Path]:
    with Progress(path, quiet=args.quiet, stages=STAGES) as say:
        say("loading")
        from thesis_lib.critique.run import criticise
        from thesis_lib.datasets.read import read_dataset
        from thesis_lib.datasets.recordings.recording import is_recording

        for option, asked in (("--effects adds effects", args.files), ("--trials takes trials", args.trials)):
            if asked and is_recording(path):
                raise UserError(f"{path} is the recording of a mechanism; {option} of drops. Leave it out.")
        # unlike Path.resolve, realpath survives a loop of links, which reading then refuses
        folder = Path(out) if out else Path("results/critique") / Path(os.path.realpath(path)).name
        if os.path.realpath(folder) == os.path.realpath(path):
            raise UserError(f"-o {folder} is the dataset itself; choose another folder.")
        options = {"effects": args.effects, "models": args.models or (), "propose": args.propose and True}
        data = path if args.trials is None else read_dataset(path).first_trials(args.trials)
        found = criticise(data, **options, jobs=args.jobs, seed=args.seed, say=say)
        with sharing(args.jobs):
            return found.save(folder, proposal=args.propose), folder


def _batch(args: argparse.Namespace) -> int:
    from thesis_lib.commands.batch import batch_text, find_datasets, run_batch

    def say(text: str) -> None:
        if not args.quiet:
            print(text, file=sys.stderr, flush=True)

    paths, others = find_datasets(args.paths)
    if others:
        say(f"skipped, because they are not datasets: {', '.join(map(str, others))}")
    out = Path(args.out or "results/critique")
    memory = None if args.memory_limit is None else args.memory_limit * 1e9
    options = {"effects": args.effects, "files": args.files, "additions": args.additions}
    options |= {"jobs": args.jobs, "memory_limit": memory}
    try:
        batch = run_batch(paths, out, args.seed, time_limit=args.time_limit, say=say, **options)
    except KeyboardInterrupt:
        print("interrupted; run the same command again to resume", file=sys.stderr)
        return INTERRUPTED
    if args.json:
        print((out / "batch.json").read_text(encoding="utf-8"), end="")
    else:
        print(batch_text(batch, out))
    return FAILED if batch.failed else 0


def _compare(args: argparse.Namespace) -> int:
    from thesis_lib.commands.comparison import compare, comparison_text, is_run, read_run
    from thesis_lib.foundation.files import write_result

    names = [Path(path).resolve().name for path in args.paths]
    if names[0] == names[1]:
        names = [f"{name}_{letter}" for name, letter in zip(names, "ab")]
    out = Path(args.out or "results/critique")
    contents = [
        read_run(path) if is_run(path) else _run(path, out / name, args)[0] for path, name in zip(args.paths, names)
    ]
    table = compare(*contents)
    if args.out:
        write_result(table, out / "compare.csv")
    if args.json:
        print(table.to_json(orient="records", indent=1, force_ascii=False))
        return 0
    for name, content in zip(names, contents):
        print(f"{name}: {' '.join(content.get('summary', [content['verdict']]))}")
    print("\n" + comparison_text(table, *names))
    return 0
