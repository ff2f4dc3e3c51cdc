"""`thesis-lib rollout`: whole tosses predicted by a model in space, compared with measured tosses."""

import json
import os
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from thesis_lib.commands.effects import add_option, load_additions
from thesis_lib.commands.model import load_named
from thesis_lib.foundation import SEED
from thesis_lib.foundation.command_line import Parser, command
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.progress import Progress

if TYPE_CHECKING:
    from thesis_lib.critique.results.saved_in_space import SavedSpaceModel
    from thesis_lib.critique.results.saved_model import SavedModel
    from thesis_lib.datasets.format.dataset import Dataset

ROLLOUT = """\
Simulate measured tosses with a model.json, from the initial state to the last frame, and compare all frames. Only
tosses held out by the critique (with --against, by both), unless --all. Each row is an error averaged over the frames
of a toss and then over tosses, with its 95 % interval. Δp and Δθ are the errors of position and rotation in a frame, w
the mean width of the body:

  contactnets pos_int_percent          |Δp| in % of w; these three are the metrics of ContactNets, arXiv:2009.11193
  contactnets angle_int_deg            |Δθ| in degrees
  contactnets penetration_int_percent  depth of the simulated body in the surface, in % of w
  acosta loss, acosta median           |Δp|²/(w/2) + Δθ² (m, rad) from three frames before the first possible touch, its
                                       mean and median over tosses: Acosta, Yang and Posa, arXiv:2110.00541
  benchmark position_m, angle_rad      |Δp| in m and |Δθ| in rad, for comparison with engines
  final_face share                     share of tosses that end on the measured face

The column floor is the difference between two simulations with the model, from initial states drawn within their
uncertainty. A fitted initial state may be more accurate than that; the error of the model is then below the floor.

With --fit the named parameters, first fitted to hits, are fitted to the whole tosses that the critique did not hold
out; the last column then compares both models on the held-out tosses.

With --mjcf the same tosses are also simulated with your own files, from the same initial states. A file needs a body
with a free joint, in whose frame the shape lies as in dataset.yaml, and exactly one plane. If a file has several free
bodies, --body names the one to toss: one name for all files, or one for each, in order.
"""
EXAMPLES = """\
examples:
  thesis-lib rollout out/model.json data/tosses
  thesis-lib rollout out/model.json data/tosses --start first_frame -o out
  thesis-lib rollout out/model.json data/tosses --against plain/model.json      which model is better?
  thesis-lib rollout out/model.json data/tosses --fit mu epsilon -o out/fitted
  thesis-lib rollout out/model.json data/tosses --mjcf mine.xml exported.xml
  thesis-lib rollout out/model.json data/tosses --mjcf scene.xml mine.xml --body box block
  thesis-lib rollout model.json data/tosses --all --json | jq .contactnets
"""
SAME_SHAPE = 0.01  # body extents by which shapes may differ; a corrected size differs by more
ERRORS = "errors.csv"  # in the folder of model.json: lists the trials that the critique held out


@command
def rollout(argv: Sequence[str] | None = None) -> int:
    parser = Parser(prog="thesis-lib rollout", description=ROLLOUT, epilog=EXAMPLES)
    parser.add_argument("model", metavar="MODEL.json")
    parser.add_argument("data", metavar="DATASET")
    start = "first_flight: fitted to it; first_frame: as stored, motion from three frames; default: %(default)s"
    parser.add_argument("--start", choices=("first_flight", "first_frame"), default="first_flight", help=start)
    parser.add_argument("--all", action="store_true", help="all tosses, including those that the model was fitted to")
    parser.add_argument("--against", metavar="MODEL.json", help="compare with another model, toss by toss")
    parser.add_argument(
        "--fit", metavar="NAME", nargs="+", default=[], help="parameters to fit to whole tosses, such as mu and epsilon"
    )
    parser.add_argument(
        "--mjcf", metavar="FILE", nargs="+", default=[], help="also simulate the tosses in MuJoCo with these files"
    )
    body = "body in the files of --mjcf, one name for all or one for each; default: the only free body"
    parser.add_argument("--body", metavar="NAME", nargs="+", default=[], help=body)
    parser.add_argument(
        "-o",
        "--out",
        metavar="DIR",
        help="write rollout.json, plots over time and hits, and with --fit model.json and errors.csv",
    )
    parser.add_argument("--json", action="store_true", help="print the content of rollout.json in place of the table")
    parser.add_argument("-q", "--quiet", action="store_true", help="print only errors to stderr")
    add_option(parser)
    args = parser.parse_args(argv)
    if len(args.body) not in ({0, 1, len(args.mjcf)} if args.mjcf else {0}):
        raise UserError(
            f"--body has {len(args.body)} names and --mjcf {len(args.mjcf)} files: give one name for all files, or one "
            "for each."
        )
    if args.fit and (args.all or args.against):
        raise UserError(
            "--fit compares the fitted model with the original one on the tosses that the critique held out: "
            "leave --all and --against out."
        )
    if args.out:
        _prepare(args.out, args.model, bool(args.fit))
    load_additions(args.files, [args.data])
    with Progress(args.model, quiet=args.quiet) as say:
        say("loading")
        import numpy as np
        import pandas as pd

        from thesis_lib.critique.simulation.rollout import compared, roll_out
        from thesis_lib.datasets.read import read_dataset
        from thesis_lib.foundation.files import write_json, write_table
        from thesis_lib.foundation.randomness import generator

        model, data = load_named(args.model), read_dataset(args.data)
        other = load_named(args.against) if args.against else None
        _require_tosses(data, {args.model: model} | ({args.against: other} if other else {}))
        trials = data.trials.tolist() if args.all else held_out(args.model, data)
        if other and not args.all:
            trials = also_held_out(trials, args.against, {model.dataset, data.name}, other)
        if args.fit:
            from thesis_lib.critique.simulation.to_tosses import fit_to_tosses

            others = [trial for trial in data.trials.tolist() if trial not in set(trials)]
            other = model
            model, ended = fit_to_tosses(model, data, others, args.fit, args.start, say)  # pyright: ignore[reportArgumentType]
        found = roll_out(model, data, trials, generator(SEED, "rollout"), args.start, say)  # pyright: ignore[reportArgumentType]
        content = {"model": str(model), "dataset": data.name, "held_out": not args.all}
        content |= found.content(args.start, generator(SEED, "rollout", "intervals"))
        if args.fit:
            content |= {"fitted": {name: model.values[name] for name in args.fit}, "search_ended": ended}
        if other:
            say("the other model")
            second = roll_out(other, data, trials, generator(SEED, "rollout"), args.start, say)  # pyright: ignore[reportArgumentType]
            rng = generator(SEED, "rollout", "differences")
            both = compared(found.tosses, second.tosses, args.start, rng)
            content["against"] = {"model": str(other), "difference": both}
        if args.mjcf:
            from thesis_lib.critique.simulation.in_mujoco import TossesInFile
            from thesis_lib.critique.simulation.rollout import rolled_out_by, summary
            from thesis_lib.foundation.files import six_digits

            content["files"] = {}
            names = args.body * len(args.mjcf) if len(args.body) == 1 else args.body or [None] * len(args.mjcf)
            for path, body in zip(args.mjcf, names, strict=True):
                say(path)
                scene = TossesInFile(path, body, model)  # pyright: ignore[reportArgumentType]
                if scene.coarse:
                    print(f"warning: {scene.coarse}", file=sys.stderr)
                tosses = rolled_out_by(scene.toss, model, data, trials, args.start, say)  # pyright: ignore[reportArgumentType]
                rng = generator(SEED, "rollout", "intervals")
                name = path if Path(path).name in content["files"] else Path(path).name
                content["files"][name] = six_digits(summary(tosses, args.start, rng))
        if args.out:
            from thesis_lib.figures.critique.rollout import draw_rollout
            from thesis_lib.figures.style import save_figure

            for by in ("t", "hits"):
                save_figure(*draw_rollout(found.curve(by)), Path(args.out) / f"rollout_by_{by}.png")
            write_json(content, Path(args.out) / "rollout.json")
            if args.fit:
                model.save(Path(args.out) / "model.json")
                kept = pd.DataFrame({"trial": data.trials, "held_out": np.isin(data.trials, trials).astype(int)})
                write_table(kept, Path(args.out) / ERRORS)  # so that this model, too, is judged on these tosses
    print(json.dumps(content, indent=1, ensure_ascii=False) if args.json else as_table(content))
    if args.out and not args.quiet:
        print(f"written to {args.out}", file=sys.stderr)
    return 0


def _prepare(out: str, model: str, fit: bool) -> None:
    """Make the folder before minutes of work; UserError if it cannot be written into or holds `model` itself."""
    folder = Path(out)
    if fit and folder.resolve() == Path(model).resolve().parent:
        raise UserError(f"-o {out} is the folder of {model}, which --fit would overwrite; give another folder.")
    folder.mkdir(parents=True, exist_ok=True)
    if not os.access(folder, os.W_OK):
        raise UserError(f"-o {out}: nothing can be written into this folder; give another one.")


def held_out(model: str, data: "Dataset") -> "Sequence[int]":
    """Trials of the dataset that were held out by the critique that wrote `model`.

    Raises:
        UserError: the held-out trials are not recorded, or the dataset has none of them.
    """
    import numpy as np

    table = Path(model).parent / ERRORS
    if not table.is_file():
        raise UserError(
            f"{table}, which lists the tosses that the critique held out, does not exist: give the model.json in the "
            "folder of its critique, or --all for all tosses."
        )
    trials = np.intersect1d(data.trials, _held_out_in(table))
    if not trials.size:
        raise UserError(f"{data.name} has no toss that {table} lists as held out; --all takes all tosses.")
    return trials.tolist()


def also_held_out(trials: "Sequence[int]", path: str, datasets: set[str], other: "SavedModel") -> "Sequence[int]":
    """Those of `trials` that the critique of the other model held out, too; warnings where this is not known.

    `datasets`: names of the dataset.  UserError if none is left.
    """
    table = Path(path).parent / ERRORS
    if other.dataset not in datasets or not table.is_file():
        where = (
            f"was fitted to {other.dataset or 'unnamed data'}"
            if other.dataset not in datasets
            else f"has no {ERRORS} beside it"
        )
        print(f"warning: {path} {where}: it may have been fitted to some of these tosses, too", file=sys.stderr)
        return trials
    known = set(_held_out_in(table))
    if not (both := [trial for trial in trials if trial in known]):
        raise UserError(f"No toss was held out by the critiques of both models ({table}); --all takes all tosses.")
    return both


def _held_out_in(table: Path) -> "Sequence[int]":
    """Trials that a table of errors lists as held out."""
    import pandas as pd

    errors = pd.read_csv(table)
    return errors["trial"][errors["held_out"] == 1].tolist() if "held_out" in errors else []


def as_table(content: Mapping) -> str:
    """Table of the errors: value and interval of the model, the floor, and the difference to the other model."""
    from thesis_lib.critique.simulation.rollout import GROUPS

    def cell(of: Mapping, key: str) -> str:
        if of[key] is None:
            return "-"
        low, high = of["interval"][key]
        return f"{of[key]:.3g} [{low:.3g}, {high:.3g}]"

    columns = {"model": content, "floor": content["floor"], **content.get("files", {})}
    if "against" in content:
        columns["minus the other"] = content["against"]["difference"]
    lines = [f"{content['model']}; {content['contactnets']['n']} tosses of {content['dataset']}"]
    lines += [f"{name} = {value:.4g}, fitted to the other tosses" for name, value in content.get("fitted", {}).items()]
    if not content.get("search_ended", True):
        lines.append("this fit stopped at its limit of evaluations: run it again from its model.json, which -o writes")
    lines.append("".join([f"{'':<38}", *(f"{name:<30}" for name in columns)]).rstrip())
    for group, keys in GROUPS.items():
        for key in keys:
            cells = (f"{cell(of[group], key):<30}" for of in columns.values())
            lines.append("".join([f"{f'{group} {key}':<38}", *cells]).rstrip())
    return "\n".join(lines)


def _require_tosses(data: "Dataset", models: "Mapping[str, SavedModel | SavedSpaceModel]") -> None:
    """Raise UserError unless all models, by file, and data are in space and the data have trajectories on one surface.

    A warning names models of a body with another shape.
    """
    for path, model in models.items():
        if model.space.is_plane:
            raise UserError(f"{path} is a model of a body in a plane; rollout is for models in space.")
    if data.space.is_plane:
        raise UserError(f"{data.name} is a dataset in a plane (schema 1); rollout is for tosses in space (schema 2).")
    if data.trajectories is None:
        raise UserError(f"{data.name} has impacts without trajectories; rollout compares all frames of tosses.")
    if len(data.in_space.planes) > 1:
        raise UserError(f"{data.name} has several surfaces; rollout is for tosses onto one surface.")
    import numpy as np

    own = data.in_space.body.solid
    turns = np.random.default_rng(SEED).standard_normal((4, 50))
    turns /= np.linalg.norm(turns, axis=0)
    for path, model in models.items():
        solid = model.rig.body.solid  # pyright: ignore[reportAttributeAccessIssue]
        off = float(np.abs(solid.lowest(turns)[2] - own.lowest(turns)[2]).max())
        if off > SAME_SHAPE * own.extent:
            said = f"has another shape than the body of {data.name}, by up to {off:.2g} m; its own is used"
            print(f"warning: the body of {path} {said}", file=sys.stderr)
