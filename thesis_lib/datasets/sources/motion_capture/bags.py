"""Reading ROS bags without ROS: poses of a body in ROS 2 bags (.mcap, .db3, a folder of them) and ROS 1 bags (.bag).

A body is a topic of poses or points, or one of many in a topic, identified by name or number (`pose_messages`).  Times
are taken from message headers; messages without a header have only their time of arrival.  The known message types are
those of the package rosbags and those defined in `pose_messages`: definitions in a bag are compared with these, and
never turned into code.

Compressed data are unpacked only up to a limit; a chunk of an MCAP file must not exceed the size that it states.
"""

import re
import struct
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from thesis_lib.datasets.format.validate import first_of
from thesis_lib.datasets.sources.motion_capture.pose_messages import DEFINITIONS, KINDS, TRANSFORMS, Pose
from thesis_lib.datasets.sources.tables.several_bodies import choose_body
from thesis_lib.datasets.space.motion import Motion, unit
from thesis_lib.foundation.errors import UserError, first_line
from thesis_lib.foundation.regular_file import MissingFile, regular_size

SUFFIXES = (".bag", ".mcap", ".db3")
MAX_BAG = 20_000_000_000  # bytes; a bag may also hold pictures
MAX_CHUNK = 128_000_000  # bytes unpacked at once; recorders write much smaller chunks
MAX_POSES = 20_000_000
MAX_BODIES = 10_000
PACKAGE = "rosbags"
MAGIC = {
    ".bag": b"#ROSBAG V2.0\n",
    ".mcap": b"\x89MCAP0\r\n",
    ".db3": b"SQLite format 3\x00",
}  # first bytes of such files
OLD_TRANSFORMS = "tf/msg/tfMessage"  # the same content as `TRANSFORMS`
MAX_DEFINITION = 100_000  # characters


@dataclass
class _Body:
    """Samples of one body, in order of arrival."""

    parent: str = ""
    stamp: list[int] = field(default_factory=list)  # ns, of the header; 0 without a header
    arrival: list[int] = field(default_factory=list)  # ns
    poses: list[Pose] = field(default_factory=list)


def is_bag(path: Path) -> bool:
    """Whether a path is a bag: a file with such an ending, or a folder with such files."""
    return path.suffix.lower() in SUFFIXES or (path.is_dir() and bool(_storages(path)))


def read_bag(path: Path, body: str | None, warnings: list[str]) -> Motion:
    """The motion of `body` (by default the only one): a topic, or topic:frame for transforms; the end of it suffices.

    UserError if the package is not installed, the file is not a readable bag, or the body is not in it.
    """
    if find_spec(PACKAGE) is None:
        raise UserError(f"{path} is a bag of ROS; reading it needs a package: pip install {PACKAGE}.")
    bodies: dict[str, _Body] = {}
    topics: dict[str, str] = {}
    storages = _storages(path) if path.is_dir() else [path]
    for storage in storages:
        try:
            regular_size(storage, MAX_BAG)
        except MissingFile as error:
            raise UserError(f"{storage} does not exist; give the path of a bag.") from error
        with _named(storage):
            with storage.open("rb") as file:
                if not file.read(16).startswith(MAGIC[storage.suffix.lower()]):
                    raise ValueError("its first bytes are not those of such a file")
            _collect(storage, bodies, topics)
    others = first_of([f"{topic[:60]} ({kind})" for topic, kind in topics.items()], 20) or "nothing"
    if not bodies:
        kinds = ", ".join(dict.fromkeys(kind.split("/")[-1] for kind in KINDS))
        raise UserError(f"{path} has no messages of poses ({kinds}). Its topics are: {others}.")
    try:
        chosen = choose_body(path, list(bodies), body)
    except UserError as error:
        raise UserError(f"{error} Its topics are: {others}.") from None
    return _motion(path, chosen, bodies[chosen], warnings)


def _storages(folder: Path) -> list[Path]:
    try:
        return sorted(path for path in folder.iterdir() if path.suffix.lower() in (".mcap", ".db3"))
    except OSError:
        return []


@contextmanager
def _named(path: Path) -> Iterator[None]:
    """Turn any failure to read a bag into an error that names the file."""
    try:
        yield
    except UserError:
        raise
    # readers of damaged files raise errors of many kinds, MemoryError among them
    except Exception as error:
        raise UserError(
            f"{path} cannot be read as a bag ({first_line(error)}). Is it complete? Unpack bags that ROS 2 compressed "
            "by file or by message with 'ros2 bag convert'; repair bags without an index with 'rosbag reindex'."
        ) from error


@cache
def _types(old: bool):
    """The message types of ROS 1 or 2, from the package; creating them takes half a second."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if old else Stores.ROS2_HUMBLE)
    made = {}
    for name, text in DEFINITIONS.items():
        made |= get_types_from_msg(text, name)
    store.register({name: made[name] for name in made if name not in store.types})
    return store


def _collect(path: Path, bodies: dict[str, _Body], topics: dict[str, str]) -> None:
    """Add the poses of one file to `bodies`, and its topics to `topics`: name -> type and number of messages."""
    old = path.suffix.lower() == ".bag"
    store = _types(old)
    if old:
        from rosbags.rosbag1 import Reader

        reader, unpack = Reader(path), store.deserialize_ros1
    else:
        from rosbags.rosbag2.storage_mcap import McapReader
        from rosbags.rosbag2.storage_sqlite3 import Sqlite3Reader

        mcap = path.suffix.lower() == ".mcap"
        (_check_chunks if mcap else _check_database)(path)
        reader, unpack = (McapReader if mcap else Sqlite3Reader)(path), store.deserialize_cdr
    reader.open()
    try:
        if old:
            _bound_chunks(reader)
        kinds = {one.id: TRANSFORMS if one.msgtype == OLD_TRANSFORMS else one.msgtype for one in reader.connections}
        wanted = [one for one in reader.connections if kinds[one.id] in KINDS]
        topics |= {one.topic: f"{one.msgtype[:60]}, {one.msgcount} messages" for one in reader.connections}
        for one in wanted:
            kind = kinds[one.id]
            # ROS 1 states the MD5 sum of a definition, ROS 2 the definition
            if not (one.digest == store.generate_msgdef(kind)[1] if old else _same_fields(one, kind, store)):
                raise UserError(
                    f"{path}: {one.topic} has messages {one.msgtype} whose definition is not the standard one."
                )
        if not wanted:
            return
        count = 0
        for connection, arrival, raw in reader.messages(connections=wanted):
            kind = kinds[connection.id]
            for frame, parent, stamp, pose in KINDS[kind](unpack(raw, kind)):
                name = f"{connection.topic}:{frame}" if frame else connection.topic
                body = bodies.setdefault(name, _Body(parent))
                if body.parent != parent:
                    raise UserError(
                        f"{path}: {name} is given in the frame '{parent}' and in '{body.parent}'; record it in one."
                    )
                body.stamp.append(stamp)
                body.arrival.append(int(arrival))
                body.poses.append(pose)
                count += 1
            if count > MAX_POSES or len(bodies) > MAX_BODIES:
                raise UserError(
                    f"{path} has more than {MAX_POSES:,} poses or {MAX_BODIES:,} bodies; give a part of it."
                )
    finally:
        reader.close()


def _motion(path: Path, name: str, body: _Body, warnings: list[str]) -> Motion:
    stamp, arrival = np.array(body.stamp, dtype=np.int64), np.array(body.arrival, dtype=np.int64)
    ns = stamp
    if (stamp == 0).any():
        ns = arrival
        warnings.append(
            f"{path.name}: {name} has no time stamps, so its times are those of arrival, which are later "
            "than exposure and uneven; if possible, publish messages with a header"
        )
    ns, first = np.unique(ns, return_index=True)
    if len(first) < len(body.poses):
        warnings.append(
            f"{path.name}: {len(body.poses) - len(first)} messages of {name} left out because their times are repeated"
        )
    poses = np.array(body.poses)[first]
    with np.errstate(invalid="ignore"):
        poses[~(np.abs(poses) < 1e9)] = np.nan
    quaternion = poses[:, 3:]
    quaternion[~np.any(np.abs(quaternion) > 0.0, axis=1)] = np.nan  # ROS writes zeros if there is no rotation
    t = (ns - ns[0]) / 1e9
    if not np.isfinite(quaternion).all(axis=1).any():
        return Motion.of_point(name, str(path), t, poses[:, :3])
    return Motion(name, str(path), t, poses[:, :3], unit(quaternion, f"{path}, {name}"))


def _same_fields(connection, kind: str, store) -> bool:
    """Whether a message type of a ROS 2 bag has the standard fields of its name, as far as the bag states them."""
    from rosbags.interfaces import MessageDefinitionFormat
    from rosbags.typesys import get_types_from_msg

    definition = connection.msgdef
    if definition.format != MessageDefinitionFormat.MSG or len(definition.data) > MAX_DEFINITION:
        return True
    stated = get_types_from_msg(definition.data, kind)
    return all(fields == store.fielddefs[name][1] for name, (_, fields) in stated.items() if name in store.fielddefs)


def _bound_chunks(reader) -> None:
    """Limit the size to which a reader of ROS 1 bags unpacks a chunk to `MAX_CHUNK`."""
    import bz2

    import lz4.frame
    from rosbags.rosbag1.reader import decompressors

    def bounded(make: Callable) -> Callable[[bytes], bytes]:
        def unpack(data: bytes) -> bytes:
            result = make().decompress(data, MAX_CHUNK + 1)
            if len(result) > MAX_CHUNK:
                raise ValueError(f"a chunk of more than {MAX_CHUNK:,} bytes")
            return result

        return unpack

    makers = {decompressors["bz2"]: bz2.BZ2Decompressor, decompressors["lz4"]: lz4.frame.LZ4FrameDecompressor}
    for position, chunk in reader.chunks.items():
        if make := makers.get(chunk.decompressor):
            reader.chunks[position] = chunk._replace(decompressor=bounded(make))


def _check_database(path: Path) -> None:
    """ValueError if a database has anything but tables and indexes: views and computed columns may run without end."""
    import sqlite3

    if any(mark in str(path) for mark in "?#%"):
        raise ValueError("its path has one of the characters ? # %; rename it")
    database = sqlite3.connect(f"file:{path}?mode=ro&immutable=1", uri=True)
    try:
        made = database.execute("SELECT type, name, sql FROM sqlite_master LIMIT 1000").fetchall()
    finally:
        database.close()
    for kind, name, sql in made:
        computed = kind == "table" and re.search(r"\bAS\b|\bVIRTUAL\b", str(sql), re.IGNORECASE)
        if kind not in ("table", "index") or computed:
            raise ValueError(f"'{str(name)[:40]}' in it is not a plain table")


def _check_chunks(path: Path) -> None:
    """ValueError if a chunk of an MCAP file unpacks to more than `MAX_CHUNK`, or to more than it states.

    https://mcap.dev/spec: records of an opcode (1 byte), a length (8 bytes) and their content; a chunk has two times,
    the unpacked size (8 bytes each), a checksum (4), the compression (a string) and the data, each after its length.
    """
    import lz4.frame
    from rosbags.rosbag2.storage_mcap import zstd

    makers = {"zstd": zstd.ZstdDecompressor, "lz4": lz4.frame.LZ4FrameDecompressor}
    size = path.stat().st_size
    with path.open("rb") as file:
        file.seek(8)
        while file.tell() + 9 <= size:
            opcode, length = struct.unpack("<BQ", file.read(9))
            start = file.tell()
            if opcode == 0 or start + length > size:
                return  # the reader reports the error
            if opcode == 0x06 and length >= 32:
                _, _, unpacked, _, letters = struct.unpack("<QQQII", file.read(32))
                if unpacked > MAX_CHUNK or length > MAX_CHUNK:
                    raise ValueError(f"a chunk of {max(unpacked, length):,} bytes; the limit is {MAX_CHUNK:,}")
                if letters < 16:
                    make = makers.get(file.read(letters).decode("ascii", "replace"))
                    file.read(8)
                    data = file.read(max(0, start + length - file.tell()))
                    if make and len(make().decompress(data, max_length=unpacked + 1)) > unpacked:
                        raise ValueError(f"a chunk that unpacks to more than the {unpacked:,} bytes that it states")
            file.seek(start + length)
