"""`thesis-lib datasets init`: convert a rig's logs into a dataset."""

import argparse
from dataclasses import fields
from pathlib import Path

from thesis_lib.commands.described import described
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.progress import Progress

DESCRIPTION = """\
Convert a rig's logs into a dataset folder, then check it. The log format is detected by file extension and first line:

  tables                     text with a header line: trial,t,x,y,theta under any names, in any units; a disk may lack
                             theta. Delimiter, decimal commas, encoding, lines above the header and a row of units
                             below it are detected and listed in a note (Excel, Tracker, LabVIEW, TUM, rostopic echo -p)
  tables of a video tracker  points of DeepLabCut and similar programs (POINT.x, POINT.y, likelihood) give the pose
  tables with quaternions    the same with z and four columns of a quaternion: --quaternion xyzw or wxyz; if several
                             bodies are named in a column or in column names (box_x, hand_x), --body selects one
  tables of points           x, y, z and no angle: a ball, whose spin stays unknown
  OptiTrack Motive           CSV export of rigid bodies, or of the markers of one; also the older format (version 1.1)
  Vicon Nexus, Tracker       CSV export of segments, or of trajectories of the markers of one body
  Qualisys Track Manager     TSV export of bodies (6D), or of markers (3D)
  C3D                        markers named body:marker, rotations, or one marker for a ball (pip install ezc3d)
  torch tensors              .pt files, or a folder of them, one toss each; --columns refers to columns by their number,
                             1 to c (pip install torch)
  ROS bags                   .bag, .mcap, .db3 or a folder of these: PoseStamped, PoseArray, PointStamped, Odometry,
                             TransformStamped, TFMessage, NamedPoseArray, RigidBodies, AlvarMarkers and more
                             (needs no ROS, but: pip install rosbags)

All formats except the first two record motion in space, and it stays in space for a shape in space. For a planar shape
the plane of motion is estimated from the free flights, or given; the energy of motion out of the plane is stored for
each impact, and trials with more than 5 % are left out. Rotations that fit only in another convention (another order, a
left-handed frame) are rejected, with the option to use. If the flights show that timestamps are arrival times of data,
times from the frame numbers replace them. One long recording is cut into drops: check cuts.png in DIR.
"""
EXAMPLES = """\
examples:
  one log with all runs, millimetres and degrees:
    thesis-lib datasets init log.csv -o data/my_drops --units mm,deg \\
        --columns "trial=run,t=time_s,x=X,y=Z,theta=angle" --shape square:0.06
  one file per run, no time column, y pointing down in the camera's image:
    thesis-lib datasets init runs/*.csv -o data/my_drops --per-trial-files --rate 250 \\
        --columns "x=u,y=-v,theta=-phi" --shape ellipse:0.035,0.025
  pixels of a camera: 900 per metre, the surface at v = 800, and a ball without an angle:
    thesis-lib datasets init track.txt -o data/my_drops --units px --scale 900 --origin 300,800 \\
        --columns "x=u,y=-v" --shape disk:0.03
  points on the body, tracked by DeepLabCut at 120 frames a second:
    thesis-lib datasets init videos/*.csv -o data/my_drops --per-trial-files --rate 120 --scale 450/0.5 \\
        --origin 320,410 --body corner1,corner2 --shape rect:0.08,0.05
  a puck on a level table, seen from above, between two cushions:
    thesis-lib datasets init puck.csv -o data/my_puck --shape disk:0.04 \\
        --wall south:0,-0.4,0,1 --wall east:0.6,0,-1,0
  one long log in a plane, to be cut into drops:
    thesis-lib datasets init log.csv -o data/my_drops --cut --shape disk:0.03
  a log with quaternions, scalar first, y up:
    thesis-lib datasets init log.csv -o data/my_drops --quaternion wxyz --up y --units mm \\
        --columns "t=time,q1=q0,q2=q1,q3=q2,q4=q3" --shape square:0.06
  a motion capture take with several bodies, whose plate moves across the room's x axis:
    thesis-lib datasets init take.csv -o data/my_drops --body plate --plane x --shape square:0.06
  a ball tracked in space in centimetres, z up:
    thesis-lib datasets init ball.csv -o data/my_drops --units cm --up z --shape disk:0.02
  a box that tumbles in space, with quaternions, z up:
    thesis-lib datasets init toss.csv -o data/my_tosses --quaternion xyzw --shape box:0.1,0.08,0.06
  tosses as torch tensors, positions in half widths of 0.0524 m, then the quaternion, 148 rows per second:
    thesis-lib datasets init tosses/ -o data/cube --columns "x=1,y=2,z=3,q1=4,q2=5,q3=6,q4=7" \\
        --quaternion wxyz --rate 148 --scale 1/0.0524 --shape box:0.1048,0.1048,0.1048
  a ROS bag, the frame "plate" of /tf:
    thesis-lib datasets init drops.mcap -o data/my_drops --body /tf:plate --shape square:0.06
"""


def add_init(commands: argparse._SubParsersAction) -> None:
    """Add `init` to the commands of `datasets`."""
    init = commands.add_parser(
        "init",
        help="convert a rig's logs into a dataset: tables, motion capture, ROS bags",
        description=DESCRIPTION,
        epilog=EXAMPLES,
    )
    init.add_argument("files", nargs="+", metavar="FILE")
    init.add_argument("-o", "--out", required=True, metavar="DIR", help="dataset folder to write")
    units = "units of a table: m|mm|cm|px, rad|deg, s|ms|us|ns; default: as stated in the table, else m,rad,s"
    init.add_argument("--units", default="", help=units)
    init.add_argument("--columns", default="", help="OURS=YOURS,…; a minus sign before YOURS flips an axis")
    scale = "pixels per metre, or PX/M: pixels of a ruler and its length in m"
    init.add_argument("--scale", metavar="PX", help=f"scale of a table in pixels: {scale}")
    zero = "point that becomes x = 0, y = 0, in the coordinates of the table; default: 0,0"
    init.add_argument("--origin", metavar="U,V", help=zero)
    order = "order of quaternions in a table with columns x, y, z, and qx, qy, qz, qw, or q1, q2, q3, q4 in this order"
    init.add_argument("--quaternion", choices=["xyzw", "wxyz"], help=order)
    left = "rotations refer to a left-handed frame, or rotate the world into the body"
    init.add_argument("--left-handed", action="store_true", help=left)
    sequence = (
        "sequence of Euler angles in an export: XYZ about body axes in this order, xyz about fixed axes, or helical"
    )
    init.add_argument("--rotation", metavar="SEQ", help=f"{sequence}; default: as stated in the export, else XYZ")
    init.add_argument("--up", metavar="AXIS", help="upward axis in space: z, -y, …; default: y for OptiTrack, else z")
    normal = "normal of the plane of a motion in space: x, -y, … or X,Y,Z; default: estimated from the free flights"
    init.add_argument("--plane", metavar="AXIS", help=normal)
    body = (
        "body in an export or a table, marker, topic of a bag, or topic:name within it; for a video tracker the points "
    )
    init.add_argument("--body", metavar="NAME", help=f"{body}of the body, as P,Q,…; default: all")
    frame = "centre of mass (m) and angle of the shape (degrees) in the tracked frame, seen in the plane"
    init.add_argument("--frame", metavar="X,Y,ANGLE", help=f"{frame}; default: 0,0,0")
    tracked = "for a shape in space: estimated from flights, hits and rests (default), or the frame of the shape"
    init.add_argument("--tracked", choices=["shape"], help=f"pose of the tracked frame, {tracked}")
    cut = "cut each file into drops, or use it as one trial; default: cut motions in space without trial names"
    init.add_argument("--cut", action=argparse.BooleanOptionalAction, help=cut)
    shape = "ellipse:A,B | disk:R | square:SIDE | rect:W,H | polygon:'x1,y1;x2,y2;…' in m; for a body whose motion in "
    shape += "space is kept: box:X,Y,Z | sphere:R | ellipsoid:A,B,C | cylinder:R,H | capsule:R,H | mesh:FILE,SCALE"
    init.add_argument("--shape", required=True, help=shape)
    init.add_argument("--mass", type=float, help="kg; optional")
    init.add_argument("--k-g", type=float, help="radius of gyration in m; default: uniform lamina of the shape")
    radii = "m, about the axes of a shape in space; default: as for a uniform density"
    init.add_argument("--radii-of-gyration", metavar="X,Y,Z", help=radii)
    center = "m, in the axes of a shape in space; default: uniform density, with --radii-of-gyration the middle"
    init.add_argument("--center-of-mass", metavar="X,Y,Z", help=center)
    homogeneous = "the density is uniform, and the size is known to U (relative, one sigma, such as 0.002): effects "
    homogeneous += "that contradict the resulting inertia are reported as stand-ins (proxies), not as causes"
    init.add_argument("--homogeneous", type=float, metavar="U", dest="size_uncertainty", help=homogeneous)
    init.add_argument("--rate", type=float, help="frame rate in Hz; needed if the log has no times or counts frames")
    gravity = "m/s², component in the plane; default: 9.81, in a tilted plane less, with --wall 0"
    init.add_argument("--gravity", type=float, help=gravity)
    height = "m along up, after conversion; default: 0, in space the height estimated from hits and rests"
    init.add_argument("--surface-height", type=float, help=height)
    wall = "straight wall instead of the surface: its name, a point in m after conversion, and its normal towards "
    wall += "the body; give the option once per wall"
    init.add_argument("--wall", action="append", default=[], metavar="NAME:X,Y,NX,NY", help=wall)
    init.add_argument("--delimiter", help="between cells, such as ';' or '\\t'; default: detected")
    init.add_argument("--decimal", choices=[".", ","], metavar="MARK", help="decimal mark, . or ,; default: detected")
    init.add_argument("--per-trial-files", action="store_true", help="each file is one trial")
    init.add_argument("--force", action="store_true", help="replace a dataset that is already in DIR")


def convert_logs(args: argparse.Namespace) -> int:
    """Convert logs into a dataset, write and check it, and print a summary; UserError if the logs are unusable."""
    from thesis_lib.datasets.format.write import write_dataset
    from thesis_lib.datasets.sources.logs import convert
    from thesis_lib.datasets.sources.tables.options import Reading, parse_columns, parse_delimiter, parse_numbers
    from thesis_lib.datasets.sources.tables.rig_options import RigOptions, parse_shape, parse_wall

    out = Path(args.out)
    same = ("mass", "k_g", "size_uncertainty", "rate", "gravity", "surface_height")
    walls = tuple(map(parse_wall, args.wall))
    believed: dict = {name: getattr(args, name) for name in same} | {"walls": walls}
    for name in ("radii_of_gyration", "center_of_mass"):
        if (text := getattr(args, name)) is not None:
            mistake = f"--{name.replace('_', '-')}: '{text}' is not X,Y,Z in m."
            believed[name] = tuple(parse_numbers(text, 3, mistake))
    rig = RigOptions(parse_shape(args.shape), **believed)
    given: dict = {item.name: getattr(args, item.name) for item in fields(Reading)}
    given |= {"columns": parse_columns(args.columns), "delimiter": parse_delimiter(args.delimiter)}
    reading = Reading(**given)
    with Progress(out.resolve().name) as say:
        conversion = convert(args.files, out.resolve().name, rig, reading, say)
        say("writing the dataset")
        write_dataset(conversion.dataset, out, float_format=None)
    if conversion.cuts:  # a picture to check, and the energy out of the plane at each impact
        from thesis_lib.figures.cuts import draw_cuts
        from thesis_lib.figures.style import save_figure
        from thesis_lib.foundation.files import write_result

        write_result(conversion.cuts.impacts, out / "impacts_in_space.csv")
        save_figure(*draw_cuts(conversion.cuts), out / "cuts")
    for kind, texts in (("note", conversion.notes), ("warning", conversion.warnings)):
        for text in texts:
            print(f"{kind}: {text}")
    try:
        with Progress(out.resolve().name) as say:
            say("checking the dataset")
            text = described(out)
        print(text)
    except UserError as error:
        raise UserError(f"{out} was written, but it is not usable yet.\n{error}") from None
    print(
        f"written to {out}. Next: add a description and, if you know it, the noise to {out / 'dataset.yaml'}, "
        f"then run thesis-lib datasets check {out}"
    )
    return 0
