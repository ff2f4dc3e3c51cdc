"""Recordings of motions in space: small valid samples of each form, and what makes a dataset of them."""

import io
import sqlite3
import struct
import tempfile
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from tests.datasets import exports
from tests.datasets.in_space import Take, plane_axes
from tests.fuzz.mutations import Sample

RATE, RADIUS, G = 250.0, 0.03, 9.81
TABLES = {  # name of a table -> its columns and --quaternion; all other files hold a body
    "log.csv": ("t=time,x=X,y=Y,z=Z,q1=q0,q2=q1,q3=q2,q4=q3", "xyzw"),
    "ball.csv": ("t=time,x=X,y=Y,z=Z", None),
}


def small_take(up: str = "z", drops: int = 2) -> Take:
    """Drops of a disk, each held, falling, bouncing once and caught: exact parabolas, some 260 samples."""
    axes = plane_axes(up, tilt=0.0)
    flat = []
    for number in range(drops):
        fall, rise = np.arange(50) / RATE, np.arange(1, 58) / RATE
        y = RADIUS + G * fall[-1] ** 2 / 2 - G * fall**2 / 2
        bounce = RADIUS + 1.3 * rise - G * rise**2 / 2
        x, theta = 0.5 * fall, 0.3 + (8.0 + number) * fall
        after = np.c_[x[-1] + 0.3 * rise, bounce, theta[-1] + 4.0 * rise]
        path = np.r_[np.c_[x, y, theta], after]
        flat += [np.repeat(path[:1], 12, axis=0), path, np.repeat(path[-1:], 12, axis=0)]
    q = np.concatenate(flat)
    frame = Rotation.from_matrix(axes.T)
    rotation = frame * Rotation.from_rotvec(np.outer(q[:, 2], [0.0, 0.0, 1.0]))
    position = q[:, :2] @ axes[:2] + 1e-5 * np.random.default_rng(0).standard_normal((len(q), 3))
    return Take(np.arange(len(q)) / RATE, position, rotation, np.zeros(len(q)), q, axes)


def _bytes(write, name: str, *arguments) -> bytes:
    with tempfile.TemporaryDirectory() as made:
        path = Path(write(arguments[0], Path(made) / name, *arguments[1:]))
        if path.is_dir():
            (path,) = path.glob("*.db3")
        return path.read_bytes()


def motion_samples() -> list[Sample]:
    """Tables with quaternions, exports of motion capture."""
    z, y = small_take("z"), small_take("y")
    exported = (("Quaternion", "Millimeters"), ("XYZ", "Meters"))
    motive = [_bytes(exports.write_motive, "a.csv", y, *how) for how in exported]
    vicon = [_bytes(exports.write_vicon, "a.csv", z, kind) for kind in ("XYZ", "quaternion", "markers")]
    exported = (("6D", True), ("angles", False), ("3D", False))
    qualisys = [_bytes(exports.write_qualisys, "a.tsv", z, *how) for how in exported]
    table = _bytes(exports.write_table, "a.csv", z)
    samples = [{"log.csv": table}, {"ball.csv": table}, {"old.csv": _bytes(exports.write_optitrack, "a.csv", y)}]
    samples += [{"take.csv": data} for data in motive] + [{"trial.csv": data} for data in vicon]
    return samples + [{"drop.tsv": data} for data in qualisys]


def c3d_samples() -> list[Sample]:
    take = small_take("z")
    return [{"drop.c3d": _bytes(exports.write_c3d, "a.c3d", take, kind)} for kind in ("markers", "rotations")]


def tensor_samples() -> list[Sample]:
    """One toss a file: position and quaternion, in rows, or as the only one of many tosses."""
    import torch

    take, samples = small_take("z"), []
    for rows in (np.c_[take.position, take.quaternion], np.c_[take.position, take.quaternion][None]):
        content = io.BytesIO()
        torch.save(torch.tensor(rows), content)
        samples.append({"toss.pt": content.getvalue()})
    return samples


def bag_samples() -> list[Sample]:
    take = small_take("z")
    kinds = ((".bag", "TFMessage"), (".mcap", "PoseStamped"), (".db3", "Odometry"), (".mcap", "NamedPoseArray"))
    return [{f"drops{ending}": _bytes(exports.write_bag, f"a{ending}", take, message)} for ending, message in kinds]


def read_motion(folder: Path, out: Path, shape: str = f"disk:{RADIUS}") -> None:
    """`datasets init` on the one file of the folder, with the options that its form needs."""
    from thesis_lib.datasets.format.write import write_dataset
    from thesis_lib.datasets.sources.logs import convert
    from thesis_lib.datasets.sources.tables.options import Reading, parse_columns
    from thesis_lib.datasets.sources.tables.rig_options import RigOptions, parse_shape
    from thesis_lib.figures.cuts import draw_cuts

    # the file may be gone, or a trap: its name says how it is read
    (name,) = [path.name for path in folder.iterdir()] or ["log.csv"]
    options: dict = {"body": "plate"}
    if name in TABLES:
        columns, order = TABLES[name]
        options = {"quaternion": order, "columns": parse_columns(columns)}
    rate = None
    if name.endswith(".pt"):
        options = {"quaternion": "xyzw", "columns": parse_columns("x=1,y=2,z=3,q1=4,q2=5,q3=6,q4=7"), "cut": True}
        rate = RATE
    done = convert([folder / name], "made", RigOptions(parse_shape(shape), rate=rate), Reading(**options))
    write_dataset(done.dataset, out / "made")
    if done.cuts is not None:
        draw_cuts(done.cuts)


def read_in_space(folder: Path, out: Path) -> None:
    """The same with a body in space, which keeps its motion there."""
    ball = (folder / "ball.csv").exists()
    read_motion(folder, out, f"sphere:{RADIUS}" if ball else f"box:{2 * RADIUS},{2 * RADIUS},{2 * RADIUS}")


def _mcap_chunk(size: int, claimed: int, compression: bytes) -> bytes:
    """An MCAP file with one chunk of zeros that says it has `claimed` bytes (https://mcap.dev/spec)."""
    import lz4.frame
    from backports import zstd

    data = {b"zstd": zstd.compress, b"lz4": lz4.frame.compress}[compression](bytes(size))
    chunk = (
        struct.pack("<QQQII", 0, 1, claimed, 0, len(compression)) + compression + struct.pack("<Q", len(data)) + data
    )
    magic = b"\x89MCAP0\r\n"
    header = struct.pack("<I4sI0s", 4, b"ros2", 0, b"")
    footer = struct.pack("<QQI", 0, 0, 0)
    records = ((0x01, header), (0x06, chunk), (0x0F, struct.pack("<I", 0)), (0x02, footer))
    return magic + b"".join(struct.pack("<BQ", code, len(record)) + record for code, record in records) + magic


def _database(*statements: str) -> bytes:
    base = (
        "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT, "
        "offered_qos_profiles TEXT)",
        "INSERT INTO topics VALUES(1, '/plate', 'geometry_msgs/msg/Pose', 'cdr', '')",
    )
    with tempfile.TemporaryDirectory() as made:
        path = Path(made) / "a.db3"
        database = sqlite3.connect(path)
        for statement in (*base, *statements):
            database.execute(statement)
        database.commit()
        database.close()
        return path.read_bytes()


_MESSAGES = "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB"
_ENDLESS = "WITH RECURSIVE c(x) AS (SELECT 1 UNION ALL SELECT x + 1 FROM c) SELECT max(x) AS schema_version FROM c"
BAG_BOMBS = {
    ".mcap": (
        lambda data: _mcap_chunk(400_000_000, 10, b"zstd"),
        lambda data: _mcap_chunk(400_000_000, 400_000_000, b"lz4"),
        lambda data: _mcap_chunk(100, 2**62, b"zstd"),
        lambda data: data[:8] + struct.pack("<BQ", 1, 2**63) + data[17:],
    ),
    ".db3": (
        lambda data: _database(_MESSAGES + ")", f"CREATE VIEW schema AS {_ENDLESS}"),
        lambda data: _database(
            _MESSAGES.replace("data BLOB", "data BLOB AS (zeroblob(900000000))") + ")",
            "INSERT INTO messages(topic_id, timestamp) VALUES(1, 1)",
        ),
    ),
    ".bag": (
        lambda data: data.replace(b"conn_count=", b"conn_count=\xff\xff\xff\xff", 1),
        lambda data: b"#ROSBAG V2.0\n" + struct.pack("<I", 2**32 - 1),
    ),
}
