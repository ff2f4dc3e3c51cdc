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
    rate: float = 250.0,
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
    head += ["Capture Frame Rate", f"{rate:.6f}", "Export Frame Rate", f"{rate:.6f}"]
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


def write_vicon(
    recorded: Take, path: Path, kind: str = "XYZ", lost: float = 0.0, delimiter: str = ",", others: bool = False
) -> Path:
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
        axes, units, values = axes + ["TX", "TY", "TZ"], units + ["mm"] * 3, np.c_[turn, place]
        if others:
            names, axes, units = names + ["rod:rod", *[""] * (len(axes) - 1)], 2 * axes, 2 * units
            values = np.c_[values, np.full_like(values, 0.5)]
        block("Segments", names, axes, units, values)
    markers = [place + rotation.apply(1e3 * offset) for offset in MARKERS]
    names = [cell for k in range(len(MARKERS)) for cell in (f"plate:m{k + 1}", "", "")]
    block(
        "Trajectories",
        names,
        ["X", "Y", "Z"] * len(MARKERS),
        ["mm"] * 3 * len(MARKERS),
        np.concatenate(markers, axis=1),
    )
    path.write_text("\n".join(lines).replace(",", delimiter) + "\n")
    return path


def write_bag(
    recorded: Take, path: Path, message: str = "PoseStamped", stamped: bool = True, lost: float = 0.0
) -> Path:
    """A bag of ROS, by the ending of `path`: .bag (ROS 1), .mcap, .db3 (ROS 2); returns the file, of .db3 the folder.

    `message`: PoseStamped and Odometry on /plate, TFMessage and TransformStamped with the frames plate and rod.
    """
    from rosbags.rosbag1 import Writer as OldWriter
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    old = path.suffix == ".bag"
    store = get_typestore(Stores.ROS1_NOETIC if old else Stores.ROS2_HUMBLE)
    if old:
        store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", "tf2_msgs/msg/TFMessage"))
    types = store.types
    name = {"Odometry": "nav_msgs/msg/Odometry", "TFMessage": "tf2_msgs/msg/TFMessage"}.get(
        message, f"geometry_msgs/msg/{message}"
    )

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
        pose = types["geometry_msgs/msg/Pose"](position=point(p), orientation=turn(q))
        if message == "Pose":
            return pose
        if message == "PoseStamped":
            return types[name](header=header(ns, number), pose=pose)
        if message == "Odometry":
            whole = types["geometry_msgs/msg/PoseWithCovariance"](pose=pose, covariance=np.zeros(36))
            still = types["geometry_msgs/msg/Twist"](
                linear=point(np.zeros(3), "Vector3"), angular=point(np.zeros(3), "Vector3")
            )
            moves = types["geometry_msgs/msg/TwistWithCovariance"](twist=still, covariance=np.zeros(36))
            return types[name](header=header(ns, number), child_frame_id="plate", pose=whole, twist=moves)
        both = []
        for child, place, rotation in (("plate", p, q), ("rod", np.ones(3), np.array([0.0, 0.0, 0.0, 1.0]))):
            shift = types["geometry_msgs/msg/Transform"](translation=point(place, "Vector3"), rotation=turn(rotation))
            kind = types["geometry_msgs/msg/TransformStamped"]
            both.append(kind(header=header(ns, number), child_frame_id=child, transform=shift))
        return types[name](transforms=both) if message == "TFMessage" else both[0]

    gone, start = recorded.lose(lost), 1_772_000_000_000_000_000
    folder = path.with_suffix("")
    kind = StoragePlugin.SQLITE3 if path.suffix == ".db3" else StoragePlugin.MCAP
    rng = np.random.default_rng(1)
    with OldWriter(path) if old else Writer(folder, version=9, storage_plugin=kind) as writer:
        connection = writer.add_connection("/tf" if message == "TFMessage" else "/plate", name, typestore=store)
        for number in np.flatnonzero(~gone):
            ns = start + round(1e9 * recorded.t[number])
            content = made(ns, int(number), recorded.position[number], recorded.quaternion[number])
            raw = store.serialize_ros1(content, name) if old else store.serialize_cdr(content, name)
            writer.write(connection, ns + int(rng.integers(2_000_000, 2_600_000)), raw)
    if old:
        return path
    return folder / f"{folder.name}.mcap" if path.suffix == ".mcap" else folder
