"""`thesis-lib datasets`: fetch published sets, check data, convert logs, rotate tosses, make examples."""

import argparse
import json
from collections.abc import Sequence
from pathlib import Path

from thesis_lib.commands.described import described
from thesis_lib.commands.logs import add_init, convert_logs
from thesis_lib.foundation.command_line import WRONG, Parser, command
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.progress import Progress

EXAMPLES = """\
examples:
  thesis-lib datasets fetch planar-impact
  thesis-lib datasets fetch planar-dice --from published/fazeli_planar_dice
  thesis-lib datasets check data/my_drops
  thesis-lib datasets init log.csv -o data/my_drops --units mm,deg \\
      --columns "trial=run,t=time_s,x=X,y=Z,theta=angle" --shape square:0.06 --mass 0.05
  thesis-lib datasets example -o data/example --hidden com_offset_x
  thesis-lib datasets example -o data/wheel --mechanism wheel
"""
FETCH_EXAMPLES = """\
examples:
  thesis-lib datasets fetch planar-impact
  thesis-lib datasets fetch planar-dice --from published/fazeli_planar_dice       without network
  thesis-lib datasets fetch contactnets-cube       needs the package torch; any subset of its tosses is valid
"""
CHECK_EXAMPLES = """\
examples:
  thesis-lib datasets check data/my_drops
  thesis-lib datasets check data/my_drops --json | jq .detection.used
"""
TURN = """\
Rotate each toss about the normal of the surface, so that all are thrown along its first axis. Some recordings were
rotated about the vertical, toss by toss, before publication. Errors that are fixed in the room (axes that are not
perpendicular, a slope of the table, a lens) then have another direction in each toss, and no effect describes them. If
all tosses were thrown from one side, this restores the direction. datasets check reports if it is needed.
"""
TURN_EXAMPLES = """\
examples:
  thesis-lib datasets turn data/measured/contactnets_cube -o data/cube_along_throws
"""
EXAMPLE = """\
Simulate drops of a rig that differs slightly from its dataset.yaml: contact forces are integrated in time, poses are
sampled at 250 Hz with 0.3 mm and 3 mrad of noise, and one cause is hidden. The files do not name the hidden cause:
thesis-lib critique has to find it.

Files written into DIR:
  dataset.yaml, trajectories.csv   the dataset, as its owner assumes it to be
  new_impacts.csv                  first impacts of 40 further drops: x,y,theta,vx,vy,omega just before, for
                                   thesis-lib predict, and vx_seen,vy_seen,omega_seen just after, both
                                   without noise, so that a difference is the error of the model
With --mechanism a rimless wheel, or an arm that pushes a disk, is recorded instead of drops:
  recording.yaml, states.csv       a recording of its motion, as its owner assumes it to be
"""
EXAMPLE_EXAMPLES = """\
examples:
  thesis-lib datasets example -o data/example                       centre of mass 0.5 mm off
  thesis-lib datasets example -o data/tilted --hidden tilt --size 0.02
  thesis-lib datasets example -o data/fine --hidden nothing --seed 7
  thesis-lib datasets example -o data/soft --hidden nothing --shape square --contact-time 3
  thesis-lib datasets example -o data/other --engine mujoco         the same drops, with MuJoCo's own contact
  thesis-lib datasets example -o data/box --space --hidden com_offset        a box that tumbles in space
  thesis-lib datasets example -o data/puck --shape puck              one cushion differs from the others
  thesis-lib datasets example -o data/arm --mechanism arm --hidden payload --size 0.1
  thesis-lib datasets example -o data/wheel --mechanism wheel --hidden payload --engine mujoco

what can be hidden, its default size (about 3 times the error of a perfect model) and meaning:
"""


def build_parser() -> Parser:
    parser = Parser(
        prog="thesis-lib datasets",
        description="Datasets of measured drops (a folder with dataset.yaml and trajectories.csv or impacts.csv), and "
        "recordings of a mechanism (recording.yaml and states.csv).",
        epilog=EXAMPLES,
    )
    commands = parser.add_subparsers(dest="command", required=True, metavar="{fetch,check,init,turn,example}")

    fetch = commands.add_parser(
        "fetch",
        help="get a published measured set",
        description="Download a published measured set, check the SHA-256 of every file, and convert the set.",
        epilog=FETCH_EXAMPLES,
    )
    fetch.add_argument("name", choices=["planar-impact", "planar-dice", "contactnets-cube"])
    fetch.add_argument("--from", dest="source", metavar="DIR", help="local copy to use instead of a download")
    fetch.add_argument("--to", default="data/measured", metavar="DIR", help="parent of <name>/; default: %(default)s")

    check = commands.add_parser(
        "check",
        help="list the content of a dataset or a recording and its errors",
        description="Read a dataset or the recording of a mechanism, print its content and the impacts found in the "
        "trajectories of a dataset, and list all errors. Exit code: 0; 2 if there are errors.",
        epilog=CHECK_EXAMPLES,
    )
    check.add_argument("folder", metavar="DIR")
    check.add_argument("--json", action="store_true", help="print JSON instead of text")

    add_init(commands)

    turn = commands.add_parser(
        "turn",
        help="rotate the tosses of a dataset in space so that all are thrown along the same axis",
        description=TURN,
        epilog=TURN_EXAMPLES,
    )
    turn.add_argument("folder", metavar="DIR")
    turn.add_argument("-o", "--out", required=True, metavar="DIR", help="dataset folder to write")
    turn.add_argument("--force", action="store_true", help="replace a dataset that is already in the folder of -o")

    example = commands.add_parser(
        "example",
        help="simulate drops or a mechanism with a hidden cause, to try out the critique",
        description=EXAMPLE,
        add_help=False,
    )
    example.add_argument("-o", "--out", required=True, metavar="DIR", help="dataset folder to write")
    example.add_argument("--mechanism", choices=["arm", "wheel"], help="mechanism to record; default: a dropped body")
    space = (
        "a body that tumbles in space, with quaternions (schema 2); --shape box (default), sphere, "
        "ellipsoid, cylinder or capsule; --hidden nothing (default), or a cause listed below"
    )
    example.add_argument("--space", action="store_true", help=space)
    hidden = (
        "hidden cause, listed below; default: com_offset_x, for a puck quick_cushion (in MuJoCo dead_cushion), for a "
        "mechanism rolling_resistance"
    )
    example.add_argument("--hidden", metavar="NAME", help=hidden)
    engine = (
        "simulator: this program's own, MuJoCo, or Drake (for drops its point contact); default: own, with --space "
        "mujoco. A mechanism in MuJoCo or Drake is recorded with realistic sensors"
    )
    example.add_argument("--engine", choices=["own", "mujoco", "drake"], help=engine)
    example.add_argument("--size", type=float, help="size of the hidden cause, in its unit; default: see below")
    example.add_argument(
        "--drops", type=int, help="number of releases; default: 150, for a puck or in space 60, for a mechanism 16"
    )
    shape = "shape of the dropped body; default: ellipse. A puck slides over a table between cushions"
    example.add_argument("--shape", help=f"{shape} (ellipse, square or puck)")
    lasting = (
        "duration of a central impact at 2.5 m/s, at most 5 ms; default: 1 ms, as for hard plastic on metal, and 2 ms "
        "with --space; rubber takes 3 ms and more, and with 0.02 ms the body is nearly rigid"
    )
    example.add_argument("--contact-time", type=float, metavar="MS", help=lasting)
    filters = ["moving_average", "butterworth", "zero_phase_butterworth", "kalman_smoother"]
    example.add_argument("--filter", choices=filters, help="filter that smooths the poses of the drops; default: none")
    example.add_argument("--cutoff", type=float, help="frequency of filter gain 1/√2, Hz; default: 40")
    example.add_argument("--seed", type=int, default=0, help="seed of releases and noise; default: %(default)s")
    example.add_argument("--force", action="store_true", help="replace a dataset that is already in DIR")
    example.add_argument("-h", "--help", action=_ExampleHelp, nargs=0, help="show this and exit")
    return parser


class _ExampleHelp(argparse.Action):
    """Print the help with the list of hidden causes; only then is the simulator, which has the list, imported."""

    def __call__(self, parser, namespace, values, option_string=None) -> None:
        from thesis_lib.simulate.compliant.example import causes_text
        from thesis_lib.simulate.engines.recording import hidden_text
        from thesis_lib.simulate.rig.causes_in_space import text_of_space
        from thesis_lib.simulate.table.puck import cushions_text

        parts = causes_text(), text_of_space(), hidden_text(), cushions_text()
        parser.epilog = EXAMPLE_EXAMPLES + "\n".join(parts)
        parser.print_help()
        parser.exit()


@command
def main(argv: Sequence[str] | None = None) -> int:
    args = build_parser().parse_args(argv)
    writes = args.command in ("init", "turn", "example") and not args.force
    if writes and any(Path(args.out, name).exists() for name in ("dataset.yaml", "recording.yaml")):
        raise UserError(f"{args.out} already holds a dataset; choose another folder, or give --force to replace it.")
    chosen = {"fetch": _fetch, "check": _check, "init": convert_logs, "turn": _turn, "example": _example}
    return chosen[args.command](args)


def _fetch(args: argparse.Namespace) -> int:
    from thesis_lib.datasets.sources.fetch import fetch

    notes: list[str] = []
    with Progress(args.name) as say:
        folder = fetch(args.name, args.to, args.source, say=say, note=notes.append)
    print("\n".join((*notes, described(folder), f"written to {folder}")))
    return 0


def _check(args: argparse.Namespace) -> int:
    from thesis_lib.datasets.format.validate import DatasetError

    try:
        print(described(args.folder, args.json, compare=True))
    except DatasetError as error:
        if not args.json:
            raise
        problems = [vars(problem) for problem in error.problems]
        print(json.dumps({"valid": False, "dataset": error.name, "problems": problems}, ensure_ascii=False))
        return WRONG
    return 0


def _turn(args: argparse.Namespace) -> int:
    from dataclasses import replace

    from thesis_lib.datasets.format.write import write_dataset
    from thesis_lib.datasets.read import read_dataset
    from thesis_lib.datasets.sources.along_throws import along_throws

    dataset, out = read_dataset(args.folder), Path(args.out)
    turned = along_throws(dataset)
    write_dataset(replace(turned, name=out.resolve().name), out, float_format=None)
    print(f"{len(turned.trials)} of {len(dataset.trials)} tosses are now thrown along t_1\nwritten to {out}")
    return 0


def _example(args: argparse.Namespace) -> int:
    other = "--mechanism" if args.mechanism else "--space" if args.space else "a puck"
    out, args.engine = Path(args.out), args.engine or ("mujoco" if args.space else "own")
    given: dict = {"size": args.size, "seed": args.seed}
    write = _recording if args.mechanism else _tosses if args.space else _puck if args.shape == "puck" else _drops
    if args.shape not in (None, "ellipse", "square", "puck") and write is not _tosses:
        raise UserError(f"--shape {args.shape}: give ellipse, square or puck; bodies in space need --space.")
    own = ["shape"] if args.mechanism else []
    of_drops = (*own, *([] if args.space else ["contact_time"]), "filter", "cutoff")
    if write is not _drops and any(getattr(args, name) is not None for name in of_drops):
        from thesis_lib.statistics.wording import listed

        options = [f"--{name.replace('_', '-')}" for name in of_drops]
        raise UserError(f"{listed(options)} are for drops; leave them out with {other}.")
    if args.drops is not None:
        given["drops" if write in (_drops, _tosses) else "trials"] = args.drops
    further = write(args, out, given)
    print(f"{described(out)}\nwritten to {out}{further}. Next: thesis-lib critique {out}")
    return 0


def _drops(args: argparse.Namespace, out: Path, given: dict) -> str:
    """Write an example of drops; return a note on the file of further impacts, which the dataset does not contain."""
    from thesis_lib.simulate.compliant.example import NEW_IMPACTS, simulate_example, write_example

    given |= {"tracker": _tracker(args), "shape": args.shape or ""} | _drops_in(args.engine, args.contact_time)
    example = simulate_example(out.resolve().name, args.hidden or "com_offset_x", **given)
    write_example(example, out)
    return f", with {len(example.new_impacts)} further impacts in {out / NEW_IMPACTS}"


def _tosses(args: argparse.Namespace, out: Path, given: dict) -> str:
    from thesis_lib.datasets.format.write import write_dataset
    from thesis_lib.simulate.tosses.example import simulate_tosses

    _require_engine(args.engine)
    if args.engine == "mujoco":
        from thesis_lib.simulate.mujoco.tosses import MujocoTosses

        given["engine"] = MujocoTosses()
    if args.engine == "drake":
        from thesis_lib.simulate.drake.tosses import DrakeTosses

        given["engine"] = DrakeTosses()
    if args.contact_time is not None:
        given["contact_time"] = _contact_time(args.contact_time)
    shape, hidden = args.shape or "box", args.hidden or "nothing"
    write_dataset(simulate_tosses(out.resolve().name, shape, hidden, **given), out)
    return ""


def _puck(args: argparse.Namespace, out: Path, given: dict) -> str:
    from thesis_lib.datasets.format.write import write_dataset
    from thesis_lib.simulate.table.puck import FLOAT_FORMAT, simulate_puck

    if args.engine == "drake":
        raise UserError("A puck slides in our own simulator or in MuJoCo, not in Drake.")
    hidden = "quick_cushion"
    if args.engine == "mujoco":
        from thesis_lib.simulate.table.mujoco_puck import slide_in_mujoco

        given["move"], hidden = slide_in_mujoco, "dead_cushion"
    write_dataset(simulate_puck(out.resolve().name, args.hidden or hidden, **given), out, FLOAT_FORMAT)
    return ""


def _recording(args: argparse.Namespace, out: Path, given: dict) -> str:
    from thesis_lib.datasets.recordings.recording import write_recording
    from thesis_lib.simulate.engines.recording import simulate_recording

    hidden = args.hidden or "rolling_resistance"
    write_recording(simulate_recording(out.resolve().name, args.mechanism, hidden, args.engine, **given), out)
    return ""


def _tracker(args: argparse.Namespace):
    """Filter with which the drops of an example are recorded, or None for unfiltered poses."""
    from thesis_lib.simulate.rig.tracker import Tracker

    if args.filter is None:
        if args.cutoff is not None:
            raise UserError("--cutoff is an option of --filter: give both, or leave --cutoff out.")
        return None
    cutoff = 40.0 if args.cutoff is None else args.cutoff
    if not 1.0 <= cutoff < 125.0:
        raise UserError(f"--cutoff must be at least 1 Hz and below 125 Hz, half the rate; got {cutoff:g}.")
    return Tracker(filter=args.filter, cutoff=cutoff)


def _require_engine(engine: str) -> None:
    """Raise UserError if the engine is not installed."""
    from importlib.util import find_spec

    module, package = {"own": ("numpy", "numpy"), "mujoco": ("mujoco", "mujoco-core"), "drake": ("pydrake", "drake")}[
        engine
    ]
    if find_spec(module) is None:
        raise UserError(f"--engine {engine} needs a package: pip install {package}, or give --engine own.")


def _drops_in(engine: str, milliseconds: float | None) -> dict:
    """Arguments `engine` and `contact` for `simulate_example`; UserError if the engine is not installed."""
    lasting = _contact_time(1.0 if milliseconds is None else milliseconds)
    _require_engine(engine)
    if engine == "mujoco":
        from thesis_lib.simulate.mujoco.contact import MujocoContact
        from thesis_lib.simulate.mujoco.drops import DropsInMujoco

        return {"engine": DropsInMujoco(), "contact": MujocoContact(contact_time=lasting)}
    from thesis_lib.simulate.rig.hidden_causes import CompliantContact

    contact = {"contact": CompliantContact(contact_time=lasting)}
    if engine == "own":
        return contact
    from thesis_lib.simulate.drake.drops import DropsInDrake

    return contact | {"engine": DropsInDrake("point")}


def _contact_time(milliseconds: float) -> float:
    """Contact time in s; UserError if it is out of range."""
    if not 0.0 < milliseconds <= 5.0:
        raise UserError(f"--contact-time must be above 0 and at most 5 ms; got {milliseconds:g}.")
    return 1e-3 * milliseconds
