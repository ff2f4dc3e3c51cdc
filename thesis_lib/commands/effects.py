"""`thesis-lib effects`: list effects, check user-defined ones, and write a template for a new effect.

Also the option --effects of other commands: user-defined effects and laws from files and installed packages.
"""

import argparse
import json
import re
import sys
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from thesis_lib.foundation.command_line import FAILED, Parser, command
from thesis_lib.foundation.errors import UserError

if TYPE_CHECKING:
    from thesis_lib.effects.effect import Parameter
    from thesis_lib.extensions.contract import CheckResult

DESCRIPTION = """\
List every candidate effect, including those of installed packages: equation, parameters with unit and bounds, source.

An effect or an impact law of your own is a Python file, in any folder without data. --new writes a template, --check
applies the checks that all effects and laws of the library pass (one line per check; checks that fail for the same
reason share a line), and critique, predict and simulate load it with --effects FILE.py. Such a file is a program that
runs with your permissions: read files from others before you run them.

Exit code: 0; 1 if a check fails; 2 if a file cannot be loaded, or a name in it is taken.
"""
EXAMPLES = """\
examples:
  thesis-lib effects
  thesis-lib effects --json | jq '.[].name'
  thesis-lib effects --new sticky_corners                    writes sticky_corners.py, which does nothing yet
  thesis-lib effects --check sticky_corners.py               would the critique accept it?
  thesis-lib critique data/my_drops --effects sticky_corners.py
"""
OPTION = (
    "Python file with effects or laws of your own, which are added to the library; it runs with your permissions, so "
    "read files from others first; may be given several times"
)


def add_option(parser: argparse.ArgumentParser) -> None:
    """Add the option --effects FILE.py to a command."""
    parser.add_argument("--effects", action="append", dest="files", metavar="FILE.py", default=[], help=OPTION)


def load_additions(files: Sequence[str], data: Iterable[str | Path] = ()) -> list[dict[str, str]]:
    """Load effects and laws of installed packages and files; return a list for JSON.  A note precedes each file's run.

    Files must not lie in the folders `data`.  UserError as in `thesis_lib.extensions.loading.load`.
    """
    from thesis_lib.extensions.loading import load

    for path in files:
        if not path.endswith(".py") and not Path(path).exists():
            raise UserError(f"--effects {path}: no such file. Give a Python file; a name goes behind --effect.")
    return load(files, data=data, say=note)


def note(text: str) -> None:
    """Print a note to stderr that a user should read before the event, even with --quiet."""
    print(f"note: {text}", file=sys.stderr, flush=True)


@command
def effects(argv: Sequence[str] | None = None) -> int:
    parser = Parser(prog="thesis-lib effects", description=DESCRIPTION, epilog=EXAMPLES)
    what = parser.add_mutually_exclusive_group()
    what.add_argument("--check", nargs="+", metavar="FILE.py", help="run these files and check what they hold")
    what.add_argument("--new", metavar="NAME", help="write NAME.py, a template of an effect that passes the checks")
    parser.add_argument("--json", action="store_true", help="print JSON instead of text")
    args = parser.parse_args(argv)
    if args.new is not None:
        return _new(args.new, args.json)
    if args.check:
        return _check(args.check, args.json)
    load_additions([])
    print(effects_json() if args.json else effects_text())
    return 0


def _new(name: str, as_json: bool) -> int:
    from thesis_lib.extensions.template import write_template

    path = write_template(name, Path(f"{name}.py"))
    if as_json:
        print(json.dumps({"written": str(path)}))
    else:
        print(f"written to {path}; fill it in, then: thesis-lib effects --check {path}")
    return 0


def _check(files: Sequence[str], as_json: bool) -> int:
    from thesis_lib.extensions.loading import read_file, results
    from thesis_lib.extensions.registry import add, require_free

    rows: list[dict[str, str]] = []
    for path in files:
        loaded = read_file(path, say=note)
        require_free(loaded)
        for kind, name, outcomes in results(loaded):
            rows += [{"file": path, "kind": kind, "name": name} | vars(outcome) for outcome in outcomes]
            if not as_json:
                print("\n".join([f"{path}: the {kind} {name}", *_lines(outcomes)]))
        if not any(row["verdict"] == "FAIL" for row in rows):
            add(loaded)  # the next file must be compatible with it
    failed = sum(row["verdict"] == "FAIL" for row in rows)
    to_do = sum(row["verdict"] == "to do" for row in rows)
    if as_json:
        print(json.dumps(rows, indent=1, ensure_ascii=False))
    elif failed:
        print(f"{failed} of {len(rows)} checks fail")
    else:
        print(f"{len(rows) - to_do} of {len(rows)} checks pass" + (", the other needs an equation first" * bool(to_do)))
    return FAILED if failed else 0


def _lines(outcomes: Sequence["CheckResult"]) -> Iterator[str]:
    """One line per check; a fault found by several checks is printed once, with the number of further checks."""
    reasons = [re.sub(r" \(\S+, line \d+\)$", "", outcome.reason) for outcome in outcomes]
    for i, (outcome, reason) in enumerate(zip(outcomes, reasons)):
        if reason and reason in reasons[:i]:
            continue
        more = reasons.count(reason) - 1 if reason else 0
        why = f": {outcome.reason}" if reason else ""
        also = f"; {more} more check{'s fail' if more > 1 else ' fails'} in the same way" if more else ""
        yield f"  {outcome.verdict:<5} {outcome.check}{why}{also}"


def effects_text() -> str:
    """List of all candidate effects by family: equation, parameters with bounds and unit, source."""
    from thesis_lib.effects import EFFECTS
    from thesis_lib.extensions.registry import origin_of

    family, lines = None, []
    for effect in EFFECTS.values():
        if effect.family != family:
            family = effect.family
            lines.append(family.replace("_", " "))
        needs = " (needs trajectories)" if effect.needs_trajectories else ""
        lines += [f"  {effect.name}: {effect.title}{needs}", f"      {effect.equation}"]
        lines += [f"      {_bounds(p)}" for p in effect.parameters]
        if effect.equation_in_space:
            lines.append(f"      in space: {effect.equation_in_space}")
        if effect.own_in_space:
            lines += [f"      {_bounds(p)}" for p in effect.own_in_space]
        if effect.reference:
            lines.append(f"      source: {effect.reference}")
        if origin := origin_of("effect", effect.name):
            lines.append(f"      not part of the library; from {origin}")
    lines.append("\nTo add one of your own: thesis-lib effects --new NAME")
    return "\n".join(lines)


def _bounds(p: "Parameter") -> str:
    """Name, bounds, unit and null of a parameter."""
    if p.discrete is not None:
        return f"{p.name}: {p.null:g} or {p.discrete:g}"
    unit = "" if p.unit == "1" else f" {p.unit}"
    return f"{p.name}: {p.low:g} to {p.high:g}{unit}, absent at {p.of or format(p.null, 'g')}"


def effects_json() -> str:
    """The list of `effects_text` as JSON."""
    from thesis_lib.effects import EFFECTS
    from thesis_lib.effects.effect import parameters_in
    from thesis_lib.extensions.registry import origin_of
    from thesis_lib.mechanics.space import SPACE

    keys = ("name", "family", "title", "equation", "equation_in_space", "needs_trajectories", "reference")
    listed = []
    for effect in EFFECTS.values():
        entry = {key: getattr(effect, key) for key in keys}
        in_space = parameters_in(effect, SPACE) if SPACE.dimension in effect.dimensions else ()
        entry |= {"parameters": [vars(p) for p in effect.parameters], "channels": list(effect.channels)}
        entry["parameters_in_space"] = [vars(p) for p in in_space]
        if origin := origin_of("effect", effect.name):
            entry["origin"] = origin.content()
        listed.append(entry)
    return json.dumps(listed, indent=1, ensure_ascii=False, allow_nan=False)
