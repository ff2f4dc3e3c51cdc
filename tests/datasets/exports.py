"""Recordings in space in the forms in which rigs leave them, written from the formats' published descriptions."""

from pathlib import Path

import numpy as np
import pandas as pd

from tests.datasets.in_space import Take


def _text(value: float, digits: int = 6) -> str:
    return "" if not np.isfinite(value) else f"{value:.{digits}f}"


def write_table(recorded: Take, path: Path, order: str = "xyzw", scale: float = 1.0, lost: float = 0.0) -> Path:
    """A table with a header line: t, x, y, z and the quaternion in an order, its columns named q0 to q3."""
    quaternion = recorded.quaternion[:, [3, 0, 1, 2]] if order == "wxyz" else recorded.quaternion
    values = np.c_[recorded.t, scale * recorded.position, quaternion]
    table = pd.DataFrame(values, columns=["time", "X", "Y", "Z", "q0", "q1", "q2", "q3"])
    table.loc[recorded.lose(lost), table.columns[1:]] = np.nan
    table.to_csv(path, index=False, float_format="%.7g")
    return path


def write_motive(
    recorded: Take,
    path: Path,
    rotation: str = "Quaternion",
    units: str = "Meters",
    lost: float = 0.0,
    others: bool = True,
) -> Path:
    """A CSV export of Motive 2 and 3 with the rigid body "plate"; with `others` a second body, and markers."""
    n, scale = len(recorded.t), {"Meters": 1.0, "Centimeters": 100.0, "Millimeters": 1e3}[units]
    if rotation == "Quaternion":
        turn, axes = recorded.quaternion, ["X", "Y", "Z", "W"]
    else:
        turn, axes = recorded.rotation.as_euler(rotation, degrees=True), list(rotation)
        turn, axes = turn[:, [axes.index(axis) for axis in "XYZ"]], ["X", "Y", "Z"]
    position = scale * recorded.position
    columns = [("Rigid Body", "plate", "1", "Rotation", axis, turn[:, i]) for i, axis in enumerate(axes)]
    columns += [("Rigid Body", "plate", "1", "Position", axis, position[:, i]) for i, axis in enumerate("XYZ")]
    columns += [("Rigid Body", "plate", "1", "Mean Marker Error", "", np.full(n, 2e-4 * scale))]
    if others:
        still = np.zeros((n, 7)) + [0.0, 0.0, 0.0, 1.0, *(scale * np.array([1.0, 2.0, 3.0]))]
        columns += [("Rigid Body", "frame", "2", "Rotation", axis, still[:, i]) for i, axis in enumerate("XYZW")]
        columns += [("Rigid Body", "frame", "2", "Position", axis, still[:, 4 + i]) for i, axis in enumerate("XYZ")]
        columns += [("Rigid Body", "frame", "2", "Mean Marker Error", "", np.zeros(n))]
        for k, place in enumerate(MARKERS):
            m = scale * (recorded.position + recorded.rotation.apply(place))
            name = f"plate:Marker{k + 1}"
            columns += [
                ("Rigid Body Marker", name, f"1.{k}", "Position", axis, m[:, i]) for i, axis in enumerate("XYZ")
            ]
    head = ["Format Version", "1.23", "Take Name", "Take 2026-03-01, drops", "Take Notes", ""]
    head += ["Capture Frame Rate", "250.000000", "Export Frame Rate", "250.000000"]
    head += ["Capture Start Time", "2026-03-01 03.27.28.000 PM", "Capture Start Frame", "0"]
    head += ["Total Frames in Take", str(n), "Total Exported Frames", str(n)]
    head += ["Rotation Type", rotation, "Length Units", units, "Coordinate Space", "Global"]
    lines = [",".join(f'"{cell}"' if "," in cell else cell for cell in head), ""]
    for label, i in (("Type", 0), ("Name", 1), ("ID", 2)):
        lines.append(",".join(["", label, *(column[i] for column in columns)]))
    lines.append(",".join(["", "", *(column[3] for column in columns)]))
    lines.append(",".join(["Frame", "Time (Seconds)", *(column[4] for column in columns)]))
    gone = recorded.lose(lost)
    for i in range(n):
        cells = [_text(column[5][i]) if not (gone[i] and column[1].startswith("plate")) else "" for column in columns]
        lines.append(",".join([str(i), f"{recorded.t[i]:.6f}", *cells]))
    path.write_text("\r\n".join([*lines, ""]), encoding="utf-8-sig")
    return path


MARKERS = np.array([[0.03, 0.01, 0.005], [-0.02, 0.025, 0.005], [-0.01, -0.03, 0.005], [0.02, -0.02, 0.012]])


def write_vicon(recorded: Take, path: Path, kind: str = "XYZ", lost: float = 0.0, delimiter: str = ",") -> Path:
    """An ASCII export of Nexus: a block of segments (with rotations of a `kind`), then one of markers.

    `kind` is XYZ, helical or quaternion; with "markers" the block of segments is left out.
    """
    n, gone, lines = len(recorded.t), recorded.lose(lost), []

    def block(name: str, names: list[str], axes: list[str], units: list[str], values: np.ndarray) -> None:
        lines.extend([name, "250", ",," + ",".join(names), "Frame,Sub Frame," + ",".join(axes), ",," + ",".join(units)])
        for i in range(n):
            cells = [_text(value) if not gone[i] else "" for value in values[i]]
            lines.append(",".join([str(i + 1), "0", *cells]))
        lines.append("")

    rotation, place = recorded.rotation, 1e3 * recorded.position
    if kind != "markers":
        turn, axes, units = {
            "XYZ": lambda: (rotation.as_euler("XYZ", degrees=True), ["RX", "RY", "RZ"], ["deg"] * 3),
            "helical": lambda: (rotation.as_rotvec(), ["RX", "RY", "RZ"], ["rad"] * 3),
            "quaternion": lambda: (rotation.as_quat(), ["RX", "RY", "RZ", "RW"], [""] * 4),
        }[kind]()
        names = ["plate:plate", *[""] * (len(axes) + 2)]
        block("Segments", names, axes + ["TX", "TY", "TZ"], units + ["mm"] * 3, np.c_[turn, place])
    markers = [place + rotation.apply(1e3 * offset) for offset in MARKERS]
    names = [cell for k in range(len(MARKERS)) for cell in (f"plate:m{k + 1}", "", "")]
    block("Trajectories", names, ["X", "Y", "Z"] * len(MARKERS), ["mm"] * len(names), np.concatenate(markers, axis=1))
    path.write_text("\n".join(lines).replace(",", delimiter) + "\n")
    return path


def write_qualisys(
    recorded: Take, path: Path, kind: str = "6D", times: bool = True, zeros: bool = False, lost: float = 0.0
) -> Path:
    """A TSV export of Qualisys: the bodies "rod" and "plate" (6D), or the markers of "plate" (3D).

    `times`: with columns Frame and Time; `zeros`: lost frames are zeros, not empty; "angles": 6D without Rot.
    """
    n, gone, place = len(recorded.t), recorded.lose(lost), 1e3 * recorded.position
    layout = ["X", "Y", "Z", "Roll", "Pitch", "Yaw", "Residual", *(f"Rot[{i}]" for i in range(9))]
    if kind == "3D":
        names = [f"plate:m{k + 1}" for k in range(len(MARKERS))]
        layout, columns = layout[:3], [place + recorded.rotation.apply(1e3 * offset) for offset in MARKERS]
    else:
        names, layout = ["rod", "plate"], layout if kind == "6D" else layout[:7]
        matrix = recorded.rotation.as_matrix().transpose(0, 2, 1).reshape(n, 9)
        moved = [place, recorded.rotation.as_euler("XYZ", degrees=True), np.full((n, 1), 0.3), matrix]
        still = np.r_[1e3, 2e3, 3e3, np.zeros(4), np.eye(3).ravel()]
        columns = [np.tile(still, (n, 1))[:, : len(layout)], np.concatenate(moved, axis=1)[:, : len(layout)]]
    head = [f"NO_OF_FRAMES\t{n}", "NO_OF_CAMERAS\t8", "FREQUENCY\t250", "DESCRIPTION\t--"]
    head += ["TIME_STAMP\t2024-05-04, 10:11:12.345\t11223.1", f"DATA_INCLUDED\t{'3D' if kind == '3D' else '6D'}"]
    head.append("\t".join(["MARKER_NAMES" if kind == "3D" else "BODY_NAMES", *names]))
    if kind != "3D":
        head.append(
            "\t".join(["Frame", "Time"] * times + [f"{name} " * (c == "X") + c for name in names for c in layout])
        )
    for i in range(n):
        cells = [str(i + 1), f"{i / 250.0:.5f}"] if times else []
        for name, values in zip(names, columns):
            there = not (gone[i] and name.startswith("plate"))
            cells += [_text(value) if there else "0.000" * zeros for value in values[i]]
        head.append("\t".join(cells))
    path.write_text("\n".join([*head, ""]))
    return path


def write_optitrack(recorded: Take, path: Path, left: bool = False, word: str = "rigidbody", lost: float = 0.0) -> Path:
    """An export of Tracking Tools or Motive 1, version 1.1: bodies "rod" (2) and "plate" (1), each with its row."""
    turned, place = recorded.rotation.as_quat(), recorded.position
    if left:
        turned, place = turned * [-1.0, -1.0, 1.0, 1.0], place * [1.0, 1.0, -1.0]
    lines = ['comment,"OptiTrack Export Data"', "lefthanded" if left else "righthanded", "info,version,1.1"]
    lines += [f"info,framecount,{len(turned)}", f"info,{word}count,2"]
    lines += [f'{word},"rod",2,3,0,0,0', f'{word},"plate",1,3,0']
    for i, gone in enumerate(recorded.lose(lost)):
        still = ["2", "1.0", "2.0", "3.0", "0", "0", "0", "1", "0", "0", "0"]
        seen = ["1", *(f"{value:.6f}" for value in (*place[i], *turned[i])), "0", "0", "0"]
        bodies = [still] if gone and i % 2 else [still, ["1", *["1.#QNAN"] * 10] if gone else seen]
        cells = ["frame", str(i), f"{recorded.t[i]:.6f}", str(len(bodies)), *(cell for body in bodies for cell in body)]
        lines += [",".join([*cells, "1", "0.1", "0.2", "0.3", "7"]), f"{word},{i},{recorded.t[i]:.6f},plate,1,0,0"]
    path.write_text("\n".join([*lines, ""]))
    return path


def write_c3d(recorded: Take, path: Path, kind: str = "markers", units: str = "mm", lost: float = 0.0) -> Path:
    """A C3D file of the markers of "plate" and one named "ball" at its origin; or with "rotations" of both bodies."""
    from ezc3d import c3d

    n, scale = len(recorded.t), {"mm": 1e3, "m": 1.0}[units]
    offsets = [*MARKERS, np.zeros(3)]
    places = np.stack([recorded.position + recorded.rotation.apply(offset) for offset in offsets])
    places[:, recorded.lose(lost)] = np.nan
    file = c3d()
    point = file["parameters"]["POINT"]
    point["RATE"]["value"], point["UNITS"]["value"] = [250.0], [units]
    point["LABELS"]["value"] = [*(f"plate:m{k + 1}" for k in range(len(MARKERS))), "ball"]
    file["data"]["points"] = np.concatenate([scale * places, np.ones((len(offsets), n, 1))], axis=2).transpose(2, 0, 1)
    if kind == "rotations":
        matrices = np.tile(np.eye(4)[:, :, None, None], (1, 1, 2, n))
        matrices[:3, :3, 0] = recorded.rotation.as_matrix().transpose(1, 2, 0)
        matrices[:3, 3, 0] = scale * recorded.position.T
        file.add_parameter("ROTATION", "LABELS", ["plate", "rod"])
        file["data"]["rotations"] = matrices
    file.write(str(path))
    return path


PUBLISHED = {  # messages of other packages, as these define them: type -> definition, those within it after a line of =
    "motion_capture_tracking_interfaces/msg/NamedPoseArray": """std_msgs/Header header
NamedPose[] poses
================================================================================
MSG: motion_capture_tracking_interfaces/NamedPose
string name
geometry_msgs/Pose pose""",
    "mocap4r2_msgs/msg/RigidBodies": """std_msgs/Header header
uint32 frame_number
mocap4r2_msgs/RigidBody[] rigidbodies
================================================================================
MSG: mocap4r2_msgs/RigidBody
string rigid_body_name
mocap4r2_msgs/Marker[] markers
geometry_msgs/Pose pose
================================================================================
MSG: mocap4r2_msgs/Marker
int8 USE_NAME = 0
int8 USE_INDEX = 1
int8 USE_BOTH = 2
int8 id_type
int32 marker_index
string marker_name
geometry_msgs/Point translation""",
    "ar_track_alvar_msgs/msg/AlvarMarkers": """std_msgs/Header header
ar_track_alvar_msgs/AlvarMarker[] markers
================================================================================
MSG: ar_track_alvar_msgs/AlvarMarker
std_msgs/Header header
uint32 id
uint32 confidence
geometry_msgs/PoseStamped pose""",
}


def write_bag(
    recorded: Take,
    path: Path,
    message: str = "PoseStamped",
    stamped: bool = True,
    lost: float = 0.0,
    late: float = 0.6e-3,
    published: dict[str, str] = PUBLISHED,
) -> Path:
    """A bag of ROS, by the ending of `path`: .bag (ROS 1), .mcap, .db3 (ROS 2); returns the file, of .db3 the folder.

    `message`: Pose, PoseStamped, Odometry and PointStamped on /plate, TFMessage and TransformStamped with the frames
    plate and rod, PoseArray and the `published` with both bodies (AlvarMarkers: 7 and 8).  Messages arrive 2 ms after
    exposure, and up to `late` s more.
    """
    from rosbags.rosbag1 import Writer as OldWriter
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    old = path.suffix == ".bag"
    store = get_typestore(Stores.ROS1_NOETIC if old else Stores.ROS2_HUMBLE)
    if old:
        store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", "tf2_msgs/msg/TFMessage"))
    for kind, text in published.items():
        store.register(get_types_from_msg(text, kind))
    types = store.types
    known = ["nav_msgs/msg/Odometry", "tf2_msgs/msg/TFMessage", *published]
    name = next((kind for kind in known if kind.endswith(f"/{message}")), f"geometry_msgs/msg/{message}")

    def time(ns: int):
        return types["builtin_interfaces/msg/Time"](sec=ns // 10**9, nanosec=ns % 10**9)

    def header(ns: int, number: int):
        more = {"seq": number} if old else {}
        return types["std_msgs/msg/Header"](stamp=time(ns if stamped else 0), frame_id="world", **more)

    def point(p, kind: str = "Point"):
        return types[f"geometry_msgs/msg/{kind}"](x=float(p[0]), y=float(p[1]), z=float(p[2]))

    def turn(q):
        return types["geometry_msgs/msg/Quaternion"](x=float(q[0]), y=float(q[1]), z=float(q[2]), w=float(q[3]))

    def made(ns: int, number: int, p, q):
        both = {"plate": (p, q), "rod": (np.ones(3), [0.0, 0.0, 0.0, 1.0])}
        pose = types["geometry_msgs/msg/Pose"]
        named = {n: pose(position=point(place), orientation=turn(turned)) for n, (place, turned) in both.items()}
        head, pose = header(ns, number), named["plate"]
        if message == "Pose":
            return pose
        if message == "PoseStamped":
            return types[name](header=head, pose=pose)
        if message == "Odometry":
            whole = types["geometry_msgs/msg/PoseWithCovariance"](pose=pose, covariance=np.zeros(36))
            zero = point(np.zeros(3), "Vector3")
            still = types["geometry_msgs/msg/Twist"](linear=zero, angular=zero)
            moves = types["geometry_msgs/msg/TwistWithCovariance"](twist=still, covariance=np.zeros(36))
            return types[name](header=head, child_frame_id="plate", pose=whole, twist=moves)
        if message == "Twist":
            return types[name](linear=point(p, "Vector3"), angular=point(p, "Vector3"))
        if message == "PointStamped":
            return types[name](header=head, point=point(p))
        if message == "PoseArray":
            return types[name](header=head, poses=list(named.values()))
        if message == "NamedPoseArray":
            one = types["motion_capture_tracking_interfaces/msg/NamedPose"]
            return types[name](header=head, poses=[one(name=n, pose=at) for n, at in named.items()])
        if message == "RigidBodies":
            one = types["mocap4r2_msgs/msg/RigidBody"]
            bodies = [one(rigid_body_name=n, markers=[], pose=at) for n, at in named.items()]
            return types[name](header=head, frame_number=number, rigidbodies=bodies)
        if message == "AlvarMarkers":
            one, empty = types["ar_track_alvar_msgs/msg/AlvarMarker"], types["geometry_msgs/msg/PoseStamped"]
            poses = [empty(header=header(0, 0), pose=at) for at in named.values()]
            markers = [one(header=head, id=7 + i, confidence=0, pose=pose) for i, pose in enumerate(poses)]
            return types[name](header=head, markers=markers)
        shift, kind = types["geometry_msgs/msg/Transform"], types["geometry_msgs/msg/TransformStamped"]
        moved = {n: shift(translation=point(at, "Vector3"), rotation=turn(turned)) for n, (at, turned) in both.items()}
        frames = [kind(header=head, child_frame_id=n, transform=by) for n, by in moved.items()]
        return types[name](transforms=frames) if message == "TFMessage" else frames[0]

    gone, start = recorded.lose(lost), 1_772_000_000_000_000_000
    folder = path.with_suffix("")
    kind = StoragePlugin.SQLITE3 if path.suffix == ".db3" else StoragePlugin.MCAP
    rng = np.random.default_rng(1)
    with OldWriter(path) if old else Writer(folder, version=9, storage_plugin=kind) as writer:
        connection = writer.add_connection("/tf" if message == "TFMessage" else "/plate", name, typestore=store)
        last = 0
        for number in np.flatnonzero(~gone):
            ns = start + round(1e9 * recorded.t[number])
            content = made(ns, int(number), recorded.position[number], recorded.quaternion[number])
            raw = store.serialize_ros1(content, name) if old else store.serialize_cdr(content, name)
            last = max(last + 1, ns + 2_000_000 + int(rng.integers(0, round(1e9 * late))))  # none overtakes another
            writer.write(connection, last, raw)
    if old:
        return path
    return folder / f"{folder.name}.mcap" if path.suffix == ".mcap" else folder
