"""`python -m thesis_lib`: criticise contact models against measured drops, predict and simulate with the result."""

import argparse
import json
import os
import sys
from collections.abc import Sequence
from pathlib import Path

from thesis_lib.errors import UserError

SEED = 20190906  # the default of the configuration, so that both ways write the same bytes
EXAMPLES = """\
examples:
  python -m thesis_lib critique data/my_drops                      what is missing, written to results/critique/my_drops
  python -m thesis_lib critique data/my_drops -o out --effect surface_tilt     the model with this effect, and no other
  python -m thesis_lib critique data/before data/after             two datasets, side by side
  python -m thesis_lib effects                                     the physical effects that are looked for
  python -m thesis_lib predict out/model.json states.csv -o predicted.csv
  python -m thesis_lib simulate out/model.json -o data/simulated               drops as that model makes them

A dataset is a folder with dataset.yaml and trajectories.csv or impacts.csv; python -m thesis_lib.datasets makes one
from a rig's logs and checks it.
"""
CRITIQUE = """\
Fit all impact laws to a dataset, see where the best one fails, name the physical effects that are missing, and add
them. Effects are chosen on 70 % of the trials; every error told is that of the other 30 %.

What it writes into DIR:
  report.html      start here: the verdict and how it came about, with pictures
  diagnosis.json   the same for programs: verdict (adequate, effects or unexplained), effects, what could not be told
  model.json       the law with its effects, for python -m thesis_lib predict
  comparison.csv, ladder.csv, budget.csv, errors.csv, impacts.csv, where.json, and the pictures
"""
CRITIQUE_EXAMPLES = """\
examples:
  python -m thesis_lib critique data/my_drops -o results/critique/my_drops
  python -m thesis_lib critique data/my_drops --effect tangential_restitution --effect surface_tilt
  python -m thesis_lib critique data/my_drops --json -q | jq .verdict
  python -m thesis_lib critique data/before data/after -o results/critique/repair
  python -m thesis_lib critique results/critique/before results/critique/after       runs that are done already
"""
PREDICT_EXAMPLES = """\
STATES.csv holds one impact a row, just before it touches, as measured:

  x,y,theta,vx,vy,omega          m, m, rad, m/s, m/s, rad/s
  0.00,0.031,0.30,0.8,-2.1,5.0

and comes back with vx_post, vy_post, omega_post and status (ok, not_approaching, no_solution).
"""
SIMULATE = """\
Drop the body of a model.json on its surface: law and effects act as they do in the critique, in our own simulator or in
Drake. What comes out is a dataset (dataset.yaml, trajectories.csv) like a measured one, with noise.

Releases are those of the proof (both ways, 0.8 to 3.3 m/s, 0.3 mm and 3 mrad of noise at 250 Hz), or with --like those
of a dataset, with its noise, rate and duration. Scatter that the model could not explain is not simulated.
"""
SIMULATE_EXAMPLES = """\
examples:
  python -m thesis_lib simulate out/model.json -o data/simulated
  python -m thesis_lib simulate out/model.json -o data/again --like data/my_drops --engine drake      the same throws
  python -m thesis_lib critique data/simulated                                           does it find the model again?
"""


def build_parser() -> argparse.ArgumentParser:
    raw = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(
        prog="python -m thesis_lib",
        description="How far are contact models from your measurements, where do they fail, which physics is missing?",
        epilog=EXAMPLES,
        formatter_class=raw,
    )
    commands = parser.add_subparsers(
        dest="command", required=True, metavar="{critique,predict,simulate,effects}"
    )

    critique = commands.add_parser(
        "critique",
        help="criticise contact models against one dataset, or compare two",
        description=CRITIQUE,
        epilog=CRITIQUE_EXAMPLES,
        formatter_class=raw,
    )
    critique.add_argument(
        "paths",
        nargs="+",
        metavar="PATH",
        help="dataset folder; a second one (or two folders of runs) is compared",
    )
    critique.add_argument(
        "-o", "--out", metavar="DIR", help="default: results/critique/<name of the dataset>"
    )
    critique.add_argument(
        "--effect",
        action="append",
        dest="effects",
        metavar="NAME",
        help="switch this effect on instead of the automatic choice; may be given several times",
    )
    critique.add_argument(
        "--seed", type=int, default=SEED, help="of splits and resamples; default: %(default)s"
    )
    critique.add_argument("--json", action="store_true", help="print diagnosis.json instead of text")
    critique.add_argument("-q", "--quiet", action="store_true", help="no progress on stderr")

    predict = commands.add_parser(
        "predict",
        help="velocities after impact, by a model that a critique wrote",
        description="Predict the velocity after impact with the law and the effects in a model.json.",
        epilog=PREDICT_EXAMPLES,
        formatter_class=raw,
    )
    predict.add_argument("model", metavar="MODEL.json")
    predict.add_argument("states", metavar="STATES.csv")
    predict.add_argument("-o", "--out", metavar="OUT.csv", help="default: print to stdout")

    simulate = commands.add_parser(
        "simulate",
        help="drops as a model makes them, in our simulator or in Drake",
        description=SIMULATE,
        epilog=SIMULATE_EXAMPLES,
        formatter_class=raw,
    )
    simulate.add_argument("model", metavar="MODEL.json")
    simulate.add_argument("-o", "--out", metavar="DIR", required=True, help="folder of the new dataset")
    simulate.add_argument("--drops", type=int, metavar="N", help="default: 50, or all releases of --like")
    simulate.add_argument("--seed", type=int, default=0, help="of releases and noise; default: %(default)s")
    simulate.add_argument("--engine", choices=("own", "drake"), default="own", help="default: %(default)s")
    simulate.add_argument("--like", metavar="DATASET", help="releases, noise and rate as in this dataset")
    simulate.add_argument("-q", "--quiet", action="store_true", help="no progress on stderr")

    effects = commands.add_parser(
        "effects",
        help="list the physical effects that are looked for",
        description="List every candidate effect: equation, parameters with unit and bounds, and source.",
    )
    effects.add_argument("--json", action="store_true", help="print JSON instead of text")
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    args = build_parser().parse_args(argv)
    commands = {"critique": _critique, "predict": _predict, "simulate": _simulate, "effects": _effects}
    try:
        return commands[args.command](args)
    except UserError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except BrokenPipeError:  # the reader (head, less) has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except OSError as error:
        print(f"error: {error.filename or 'a file'}: {error.strerror or error}", file=sys.stderr)
        return 2


def _critique(args: argparse.Namespace) -> int:
    if len(args.paths) > 2:
        raise UserError(f"critique takes one dataset, or two to compare; {len(args.paths)} were given.")
    if args.seed < 0:
        raise UserError(f"--seed must be 0 or more, got {args.seed}.")
    if len(args.paths) == 2:
        return _compare(args)
    from thesis_lib.critique.compare import is_run

    if is_run(args.paths[0]):
        raise UserError(
            f"{args.paths[0]} was written by a critique; give the dataset, or a second run to compare it with."
        )
    content, folder = _run(args.paths[0], args.out, args)
    if args.json:
        print(json.dumps(content, indent=1, sort_keys=True, ensure_ascii=False, allow_nan=False))
    else:
        print(_summary_text(content))
        print(f"\nwritten to {folder}; open {folder / 'report.html'}")
    return 0


def _run(path: str, out: str | Path | None, args: argparse.Namespace) -> tuple[dict, Path]:
    from thesis_lib.critique.output import critique_folder
    from thesis_lib.datasets.read import read_dataset

    def say(text: str) -> None:
        if not args.quiet:
            print(f"{path}: {text}", file=sys.stderr, flush=True)

    dataset = read_dataset(path)
    folder = Path(out) if out else Path("results/critique") / dataset.name
    if folder.resolve() == Path(path).resolve():
        raise UserError(f"-o {folder} is the dataset itself; choose another folder.")
    effects = None if args.effects is None else tuple(dict.fromkeys(args.effects))
    return critique_folder(dataset, folder, args.seed, effects=effects, say=say), folder


def _compare(args: argparse.Namespace) -> int:
    from thesis_lib.columns import write_result
    from thesis_lib.critique.compare import compare, comparison_text, is_run, read_run

    names = [Path(path).resolve().name for path in args.paths]
    if names[0] == names[1]:
        names = [f"{name}_{letter}" for name, letter in zip(names, "ab")]
    contents = []
    for path, name in zip(args.paths, names):
        if is_run(path):
            contents.append(read_run(path))
        else:
            contents.append(_run(path, Path(args.out or "results/critique") / name, args)[0])
    table = compare(*contents)
    if args.out:
        write_result(table, Path(args.out) / "compare.csv")
    if args.json:
        print(table.to_json(orient="records", indent=1, force_ascii=False))
        return 0
    for name, content in zip(names, contents):
        print(f"{name}: {' '.join(content.get('summary', [content['verdict']]))}")
    print("\n" + comparison_text(table, *names))
    return 0


def _summary_text(content: dict) -> str:
    """The diagnosis for a terminal."""
    lines = [f"{content['dataset']}: {content['verdict']}", *(f"  {s}" for s in content["summary"])]
    error = content["error"]
    lines.append("")
    lines.append(f"  {content['n_impacts']} impacts of {content['n_trials']} trials; held-out error in m/s:")
    names = {"no_impact": "no impact", "base": "base law", "augmented": "with effects"}
    names |= {"noise_floor": "noise floor", "irb_bound": "IRB bound"}
    for key, name in names.items():
        value = error[key]
        lines.append(f"    {name:<14}{'unknown' if value is None else f'{value:.4g}'}")
    for key, p in content["augmented_model"]["parameters"].items():
        lines.append(f"    {key:<14}{_value(p)}")
    for effect in content["effects"]:
        for key, p in effect["parameters"].items():
            lines.append(f"    {effect['name']}.{key} = {_value(p)}")
        gain = effect["gain"]
        low, high = gain["interval"]
        lines.append(
            f"      gains {gain['held_out_log_score_per_impact']:.3g} nats an impact (95 %: {low:.3g} to {high:.3g}), "
            f"p = {gain['p_value']:.2g}"
        )
    step = content["next_experiment"]
    lines += ["", f"  next experiment: {step['why']}"]
    for state, sigmas in zip(step["states"], step["sigmas"]):
        lines.append(
            f"    vx {state['vx']:g} m/s, vy {state['vy']:g} m/s, omega {state['omega']:g} rad/s, "
            f"theta {state['theta']:g} rad ({sigmas:.2g} sigma)"
        )
    return "\n".join(lines)


def _value(p: dict) -> str:
    unit = "" if p["unit"] == "1" else f" {p['unit']}"
    return f"{p['value']:.4g} ± {p['std'] or 0.0:.2g}{unit}"


def _predict(args: argparse.Namespace) -> int:
    import pandas as pd

    from thesis_lib.critique.saved_model import load_model, predict
    from thesis_lib.files import FLOAT_FORMAT, write_table

    model = load_model(args.model)
    if not Path(args.states).is_file():
        raise UserError(f"There is no file {args.states}.")
    try:
        states = pd.read_csv(args.states)
    except (ValueError, UnicodeDecodeError) as error:
        raise UserError(f"{args.states} is not a CSV table: {error}") from error
    table = predict(model, states)
    if args.out:
        write_table(table, args.out)
        print(f"{len(table)} predictions written to {args.out}", file=sys.stderr)
    else:
        table.to_csv(sys.stdout, index=False, float_format=FLOAT_FORMAT, lineterminator="\n")
    return 0


def _simulate(args: argparse.Namespace) -> int:
    from thesis_lib.critique.saved_model import load_model
    from thesis_lib.critique.simulate_model import simulate_model
    from thesis_lib.datasets.read import read_dataset
    from thesis_lib.datasets.write import write_dataset
    from thesis_lib.randomness import generator

    def say(text: str) -> None:
        if not args.quiet:
            print(f"{args.model}: {text}", file=sys.stderr, flush=True)

    if args.seed < 0:
        raise UserError(f"--seed must be 0 or more, got {args.seed}.")
    folder = Path(args.out)
    taken = [name for name in ("dataset.yaml", "trajectories.csv", "impacts.csv") if (folder / name).exists()]
    if taken:
        raise UserError(
            f"{folder} already holds {taken[0]}, which may be measured: choose another folder for -o."
        )
    model = load_model(args.model)
    like = read_dataset(args.like) if args.like else None
    rng = generator(args.seed, "simulate")
    made = simulate_model(model, args.drops, engine=args.engine, like=like, rng=rng, say=say)
    write_dataset(made, folder)
    say(f"{len(made.trials)} drops, {len(made.trajectories)} samples written to {folder}")
    return 0


def _effects(args: argparse.Namespace) -> int:
    from thesis_lib.effects import EFFECTS

    if args.json:
        print(json.dumps([_described(effect) for effect in EFFECTS.values()], indent=1, ensure_ascii=False))
        return 0
    family = None
    for effect in EFFECTS.values():
        if effect.family != family:
            family = effect.family
            print(f"{family.replace('_', ' ')}")
        needs = " (needs trajectories)" if effect.needs_trajectories else ""
        print(f"  {effect.name}: {effect.title}{needs}")
        print(f"      {effect.equation}")
        for p in effect.parameters:
            unit = "" if p.unit == "1" else f" {p.unit}"
            if p.discrete is not None:
                print(f"      {p.name}: {p.null:g} or {p.discrete:g}")
            else:
                print(f"      {p.name}: {p.low:g} to {p.high:g}{unit}, absent at {p.null:g}")
        if effect.reference:
            print(f"      source: {effect.reference}")
    print(
        "\nTo add one, add a file to thesis_lib/effects; python -m thesis_lib critique then looks for it, too."
    )
    return 0


def _described(effect) -> dict:
    return {
        "name": effect.name,
        "family": effect.family,
        "title": effect.title,
        "equation": effect.equation,
        "parameters": [vars(p) for p in effect.parameters],
        "channels": list(effect.channels),
        "needs_trajectories": effect.needs_trajectories,
        "reference": effect.reference,
    }


if __name__ == "__main__":
    sys.exit(main())
