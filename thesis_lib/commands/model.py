"""`thesis-lib predict`, `simulate` and `export`: use of the model that a critique wrote.

Predictions and simulated drops, and the model as a file for MuJoCo, Drake or other readers of MJCF, SDF, URDF.
"""

import json
import sys
from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from thesis_lib.commands.effects import add_option, load_additions
from thesis_lib.foundation.command_line import Parser, command
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.progress import Progress

if TYPE_CHECKING:
    from thesis_lib.critique.results.saved_model import SavedModel
    from thesis_lib.datasets.format.dataset import Dataset

LONGEST = 60.0  # s, longest duration of a toss
PREDICT = """\
Predict the velocity after impact with the law and the effects in a model.json.

STATES.csv holds one impact per row, as measured when the body first touches:

  x,y,theta,vx,vy,omega          m, m, rad, m/s, m/s, rad/s
  0.00,0.031,0.30,0.8,-2.1,5.0

The output adds vx_post, vy_post, omega_post and status (ok, not_approaching, no_solution). They refer to the end of the
contact: in a model with a contact time (tau) about a millisecond later, when the body has rotated and sunk in.
Between walls (`surfaces` of dataset.yaml) a body hits the nearest wall towards which it moves.
A warning names rows in which the body is far above or below the surface.
In space the columns are as in impacts.csv of schema 2: x,y,z,qw,qx,qy,qz,vx_pre,…,wz_pre, of the tracked frame.
"""
PREDICT_EXAMPLES = """\
examples:
  thesis-lib predict out/model.json states.csv -o predicted.csv
  thesis-lib predict out/model.json states.csv | head -3
  thesis-lib predict out/model.json states.csv --effects my_effects.py     a model with an effect of your own
  thesis-lib predict out/model.json states.csv -o predicted.csv --json | jq .status
"""
SIMULATE = """\
Drop the body of a model.json on its surface. Law, contact time and effects act as in the critique, in our own simulator
or in Drake. The result is a dataset (dataset.yaml, trajectories.csv) like a measured one, with noise.

Releases are those of the proof study (slip both ways, 0.8 to 3.3 m/s, 0.3 mm and 3 mrad of noise at 250 Hz), or with
--like those of a dataset, with its noise, rate and duration. Scatter that the model cannot explain is left out.

In space our own simulator follows each toss until the body rests. Releases are random, with --like those of the first
flights of the dataset, or the rows of STATES.csv (without noise; the tracked frame, at the first sample):

  trial,x,y,z,qw,qx,qy,qz,vx,vy,vz,wx,wy,wz
"""
SIMULATE_EXAMPLES = """\
examples:
  thesis-lib simulate out/model.json -o data/simulated
  thesis-lib simulate out/model.json -o data/again --like data/my_drops --engine drake      the same releases
  thesis-lib simulate out/model.json states.csv -o data/tosses                 in space, from given states
  thesis-lib critique data/simulated                                           does it find the model again?
"""
FORMATS = ("mjcf", "sdf", "urdf")
EXPORT = """\
Write the result of a critique as a file for a simulator: body, inertia, centre of mass, friction, contact, surface.

The plane of the drops becomes x-z, with z up; the body extends by --depth along y. An ellipse becomes an ellipsoid, a
polygon a prism, a disk a cylinder. In space the axes are those of the recording, and the body has the frame of its
shape. Comments in the file give the source of each number. They list what the format cannot represent, as does stderr.

With --patch, the numbers are written into a body of your own model instead: inertia, centre of mass, friction and
contact (mass with --mass). Everything else, such as geometry, surface, options and comments, stays byte for byte.
MJCF is read by MuJoCo; the contact in SDF and URDF uses elements that Drake reads.
"""
EXPORT_EXAMPLES = """\
examples:
  thesis-lib export out/model.json --to mjcf -o block.xml --mass 0.05 --depth 0.02
  thesis-lib export out/model.json --to sdf -o block.sdf --mass 0.05
  thesis-lib export out/model.json --to mjcf --patch robot.xml --body block -o better.xml
  thesis-lib export out/model.json --to urdf --patch block.urdf --body block --surface table -o better.urdf
"""


@command
def predict(argv: Sequence[str] | None = None) -> int:
    parser = Parser(prog="thesis-lib predict", description=PREDICT, epilog=PREDICT_EXAMPLES)
    parser.add_argument("model", metavar="MODEL.json")
    parser.add_argument("states", metavar="STATES.csv")
    parser.add_argument("-o", "--out", metavar="OUT.csv", help="default: print to stdout")
    add_option(parser)
    printed = "print model, number of rows and count of each status as JSON; without -o also the predictions"
    parser.add_argument("--json", action="store_true", help=printed)
    args = parser.parse_args(argv)
    from thesis_lib.critique.results.saved_model import read_states
    from thesis_lib.foundation.files import FLOAT_FORMAT, write_table

    load_additions(args.files)
    model = load_named(args.model)
    table = model.predict(
        read_states(args.states), args.states, lambda said: print(f"warning: {said}", file=sys.stderr)
    )
    if args.out:
        write_table(table, args.out)
        print(f"{len(table)} predictions written to {args.out}", file=sys.stderr)
    if args.json:
        status = {name: int(count) for name, count in sorted(table["status"].value_counts().items())}
        content = {"law": model.law, "effects": list(model.effects), "n": len(table), "status": status}
        if args.out:
            content["written"] = args.out
        else:  # velocities are null if there is no solution
            after = table[[*model.found, "status"]]
            content["predictions"] = json.loads(after.to_json(orient="records", double_precision=9))
        print(json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False))
    elif not args.out:
        table.to_csv(sys.stdout, index=False, float_format=FLOAT_FORMAT, lineterminator="\n")
    return 0


@command
def simulate(argv: Sequence[str] | None = None) -> int:
    parser = Parser(prog="thesis-lib simulate", description=SIMULATE, epilog=SIMULATE_EXAMPLES)
    parser.add_argument("model", metavar="MODEL.json")
    parser.add_argument("states", metavar="STATES.csv", nargs="?", help="in space: initial states of the tosses")
    parser.add_argument("-o", "--out", metavar="DIR", required=True, help="folder of the new dataset")
    parser.add_argument("--drops", type=int, metavar="N", help="default: 50, in space 60, or all releases of --like")
    parser.add_argument("--duration", type=float, metavar="S", help="toss in space, s; default: 1.2, or as --like")
    parser.add_argument("--seed", type=int, default=0, help="seed of releases and noise; default: %(default)s")
    parser.add_argument("--engine", choices=("own", "drake"), default="own", help="simulator; default: %(default)s")
    add_option(parser)
    parser.add_argument("--like", metavar="DATASET", help="use releases, noise and rate of this dataset")
    parser.add_argument("-q", "--quiet", action="store_true", help="print only errors to stderr")
    args = parser.parse_args(argv)
    if args.seed < 0:
        raise UserError(f"--seed must be 0 or more, got {args.seed}.")
    folder = Path(args.out)
    taken = [name for name in ("dataset.yaml", "trajectories.csv", "impacts.csv") if (folder / name).exists()]
    if taken:
        raise UserError(f"{folder} already holds {taken[0]}, which may be measured data: choose another folder for -o.")
    load_additions(args.files, [args.like] if args.like else [])
    if args.drops is not None and args.drops < 1:
        raise UserError(f"The number of drops must be 1 or more, got {args.drops}.")
    with Progress(args.model, quiet=args.quiet) as say:
        say("loading")
        from thesis_lib.datasets.format.write import write_dataset
        from thesis_lib.datasets.read import read_dataset
        from thesis_lib.foundation.randomness import generator

        model = load_named(args.model)
        like = read_dataset(args.like) if args.like else None
        options = {"like": like, "rng": generator(args.seed, "simulate"), "say": say}
        made = (_drops if model.space.is_plane else _tosses)(model, args, options)
        write_dataset(made, folder)
    if not args.quiet:
        from thesis_lib.statistics.wording import plural

        samples = 0 if made.trajectories is None else len(made.trajectories)
        print(f"{plural(len(made.trials), 'drop')}, {samples} samples written to {folder}", file=sys.stderr)
    return 0


def _drops(model: "SavedModel", args: Namespace, options: dict) -> "Dataset":
    """Drops simulated with a planar model."""
    from thesis_lib.critique.simulation.simulate_model import simulate_model

    if args.states or args.duration is not None:
        raise UserError("STATES.csv and --duration are for models in space; --like DATASET gives planar releases.")
    if options["like"] and not options["like"].space.is_plane:
        raise UserError(f"{args.like} is in space (schema 2); --like of a planar model needs a planar dataset.")
    return simulate_model(model, args.drops, engine=args.engine, **options)


def _tosses(model: "SavedModel", args: Namespace, options: dict) -> "Dataset":
    """Tosses simulated with a model in space."""
    from thesis_lib.critique.results.saved_model import read_states
    from thesis_lib.critique.simulation.simulate_in_space import simulate_in_space

    if args.engine != "own":
        raise UserError(f"--engine {args.engine} is for planar models; for tosses in space give --engine own.")
    if args.states and (args.like or args.drops):
        raise UserError("STATES.csv gives the initial states of all tosses: leave --like and --drops out.")
    if args.duration is not None and not 0.0 < args.duration <= LONGEST:
        raise UserError(f"--duration must be above 0 and at most {LONGEST:g} s, got {args.duration:g}.")
    states = read_states(args.states) if args.states else None
    options["warn"] = lambda said: print(f"warning: {args.states or args.like}: {said}", file=sys.stderr)
    return simulate_in_space(model, args.drops, states=states, duration=args.duration, **options)  # pyright: ignore[reportArgumentType]


@command
def export(argv: Sequence[str] | None = None) -> int:
    parser = Parser(prog="thesis-lib export", description=EXPORT, epilog=EXPORT_EXAMPLES)
    parser.add_argument("model", metavar="MODEL.json")
    parser.add_argument("--to", choices=FORMATS, required=True, help="format of the file")
    parser.add_argument("-o", "--out", metavar="FILE", required=True, help="file to write")
    mass = "mass; default: 1 kg, in space as in dataset.yaml; with --patch as in the file"
    parser.add_argument("--mass", type=float, metavar="KG", help=mass)
    parser.add_argument("--depth", type=float, metavar="M", help="size across the plane; default: longest extent in it")
    parser.add_argument("--patch", metavar="FILE", help="your model; FILE stays unchanged unless -o names it")
    parser.add_argument(
        "--body", metavar="NAME", help="body (MJCF) or link (SDF: also MODEL::LINK) in the file to be patched"
    )
    parser.add_argument("--surface", metavar="NAME", default="", help="link of the surface; gets the contact, too")
    parser.add_argument("--plane", metavar="AXES", help="plane of motion in a planar body's own axes; default: xz")
    points = "number of points in which an edge of the body touches; default: 1 or 2, by its geometry"
    parser.add_argument("--points", type=int, metavar="N", help=points)
    add_option(parser)
    parser.add_argument("-q", "--quiet", action="store_true", help="print only errors to stderr")
    args = parser.parse_args(argv)
    if bool(args.patch) != bool(args.body):
        raise UserError("--patch FILE and --body NAME belong together: give both, the file and the body in it.")
    if args.surface and not args.patch:
        raise UserError("--surface NAME is for --patch; a new file has its own surface.")
    if Path(args.out).is_dir():
        raise UserError(f"{args.out} is a folder; give the name of a file to -o.")
    from thesis_lib.critique.export.export import exported, patched, write
    from thesis_lib.critique.results.load_model import load_model

    load_additions(args.files)
    model, size = load_model(args.model), {"mass": args.mass, "depth": args.depth}
    if args.patch:
        given = {"plane": args.plane, "points": args.points, "surface": args.surface}
        made = patched(model, args.to, args.patch, args.body, **given, **size)
    else:
        made = exported(model, args.to, **size)
    write(made, args.out)
    if not args.quiet:
        _say("changed" if args.patch else "effects in the file", made.held)
        _say("left as it was, or could not be expressed" if args.patch else "could not be expressed", made.left_out)
        print(f"written to {args.out}", file=sys.stderr)
    return 0


def _say(title: str, lines: Sequence[str]) -> None:
    print(f"{title}:", *(f"  {line}" for line in lines or ("(nothing)",)), sep="\n", file=sys.stderr)


def load_named(path: str) -> "SavedModel":
    """Load a model, with warnings about code that has changed since it was fitted."""
    from thesis_lib.critique.results.load_model import load_model
    from thesis_lib.critique.results.saved_model import changed_code

    model = load_model(path)
    for sentence in changed_code(model):
        print(f"warning: {path}: {sentence}", file=sys.stderr)
    return model
