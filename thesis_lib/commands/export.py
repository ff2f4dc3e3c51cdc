"""`python -m thesis_lib export`: a fitted model as a file of MuJoCo, Drake or another reader of MJCF, SDF, URDF."""

import sys
from collections.abc import Sequence
from pathlib import Path

from thesis_lib.foundation.command_line import Parser, command
from thesis_lib.foundation.errors import UserError

FORMATS = ("mjcf", "sdf", "urdf")
EXPORT = """\
Write what a critique found as a file of a simulator: body, inertia, centre of mass, friction, contact, surface.

The plane of the drops becomes x-z, with z up; the body is --depth deep along y. An ellipse is an ellipsoid, a polygon a
prism, a disk a cylinder. Comments in the file say where each number comes from. What the format cannot hold is listed
there and here, by name.

With --patch, the numbers go into a body of your own model instead: inertia, centre of mass, friction and contact (mass
with --mass). Geometry, surface, options and comments stay as they are. MJCF is read by MuJoCo; the
contact in SDF and URDF stands in elements that Drake reads.
"""
EXAMPLES = """\
examples:
  python -m thesis_lib export out/model.json --to mjcf -o block.xml --mass 0.05 --depth 0.02
  python -m thesis_lib export out/model.json --to sdf -o block.sdf --mass 0.05
  python -m thesis_lib export out/model.json --to mjcf --patch robot.xml --body block -o better.xml
  python -m thesis_lib export out/model.json --to urdf --patch block.urdf --body block --surface table -o better.urdf
"""


@command
def main(argv: Sequence[str] | None = None) -> int:
    parser = Parser(prog="python -m thesis_lib export", description=EXPORT, epilog=EXAMPLES)
    parser.add_argument("model", metavar="MODEL.json")
    parser.add_argument("--to", choices=FORMATS, required=True, help="format of the file")
    parser.add_argument("-o", "--out", metavar="FILE", required=True, help="file to write")
    parser.add_argument("--mass", type=float, metavar="KG", help="default: 1 kg, with --patch that of the file")
    parser.add_argument("--depth", type=float, metavar="M", help="across the plane; default: the longest extent in it")
    parser.add_argument("--patch", metavar="FILE", help="your model, which stays as it is unless -o names it")
    parser.add_argument("--body", metavar="NAME", help="body (MJCF) or link in the file to be patched")
    parser.add_argument("--surface", metavar="NAME", default="", help="its link under the body gets the contact, too")
    parser.add_argument("--plane", metavar="AXES", default="xz", help="of the body to be patched; default: %(default)s")
    points = "in which an edge of it touches; default: 1 or 2, by its geometry"
    parser.add_argument("--points", type=int, metavar="N", help=points)
    parser.add_argument("-q", "--quiet", action="store_true", help="nothing on stderr but errors")
    args = parser.parse_args(argv)
    if bool(args.patch) != bool(args.body):
        raise UserError("--patch FILE and --body NAME belong together: the file, and the body in it.")
    if args.surface and not args.patch:
        raise UserError("--surface NAME is for --patch; a new file has its own surface.")
    if Path(args.out).is_dir():
        raise UserError(f"{args.out} is a folder; give -o a file.")
    from thesis_lib.critique.export.export import exported, patched, write
    from thesis_lib.critique.results.load_model import load_model

    model, size = load_model(args.model), {"mass": args.mass, "depth": args.depth}
    model.require_plane("export")
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
