"""Inputs made by people who mean ill: bombs by kind of file, and what else can lie under the name of a file."""

import io
import os
import socket
import zipfile
from collections.abc import Callable
from pathlib import Path


def _bomb_yaml(levels: int = 10, each: int = 10) -> bytes:
    rows = ["a0: &a0 [x]"] + [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * each)}]" for i in range(1, levels)]
    return "\n".join(rows).encode()


def _bomb_merge() -> bytes:
    rows = ["a0: &a0 {k: 1}"] + [f"a{i}: &a{i} {{<<: [{', '.join([f'*a{i - 1}'] * 10)}]}}" for i in range(1, 12)]
    return "\n".join(rows).encode()


def _cells(rows: int, row: bytes) -> Callable[[bytes], bytes]:
    return lambda data: data.split(b"\n")[0] + b"\n" + row * rows


# what files of these kinds have been made of by people who meant ill: (old content) -> new content
BOMBS: dict[str, tuple[Callable[[bytes], bytes], ...]] = {
    ".yaml": (
        lambda data: _bomb_yaml(),
        lambda data: _bomb_merge(),
        lambda data: data + b"\n" + _bomb_yaml(8, 8),
        lambda data: b"a: &a [*a]",
        lambda data: b"a: &a {b: *a}\n<<: *a",
        lambda data: b"[" * 100_000,
        lambda data: b"{a: " * 10_000 + b"}" * 10_000,
        lambda data: b"\n".join(b" " * i + b"a:" for i in range(900)),
        lambda data: b"".join(b"k%d: 1\n" % i for i in range(70_000)),
        lambda data: b"".join(b"k%d: 1\n" % i for i in range(1_000_000)),
        lambda data: b"a: " + b"x" * 900_000,
        lambda data: b"- " * 50_000,
        lambda data: b"? " * 50_000,
        lambda data: b"a: " + b"9" * 100_000,
        lambda data: b"!!python/object/apply:os.system ['touch stray']",
        lambda data: data + b"\nx: !!python/name:os.system",
        lambda data: b"a: !!timestamp x\nb: !!int ''\nc: !!bool x\nd: !!binary '\xc3\xa9'",
        lambda data: b"%YAML 9.9\n---\na: 1",
        lambda data: data + b"\n---\n" + data,
        lambda data: b"1:2:3:4:5: 190:20:30.15\n? [a, {b: c}]\n: 1",
    ),
    ".json": (
        lambda data: b"[" * 200_000,
        lambda data: b'{"a":' * 100_000 + b"1" + b"}" * 100_000,
        lambda data: b'{"a": ' + b"9" * 100_000 + b"}",
        lambda data: b'{"a": 1, "a": 2}',
        lambda data: b"{" + b",".join(b'"k%d": 1' % i for i in range(1_000_000)) + b"}",
        lambda data: b'{"a": "' + b"x" * 5_000_000 + b'"}',
        lambda data: b'"\\ud800"',
        lambda data: b"NaN",
        lambda data: data.replace(b": ", b": -Infinity, ", 1),
    ),
    ".csv": (
        lambda data: b",".join(b"c%d" % i for i in range(1_000_000)) + b"\n",
        lambda data: data.split(b"\n")[0] + b"," * 300_000 + b"\n",
        lambda data: data + b"1," * 1_000_000 + b"\n",
        lambda data: data + b"x" * 3_000_000,
        lambda data: data + b'"' + b"x" * 300_000,
        _cells(1_000_000, b"\n"),
        _cells(500_000, b",,,,\n"),
        _cells(100_000, b"a,b,c,d,e\n"),
        _cells(100_000, b"0,nan,inf,1e400,-1\n"),
        lambda data: data.replace(b"\n", b"\n\x00"),
        lambda data: data + b"\xff\xfe\n",
    ),
}


def archive(*members: tuple[str, bytes], lie: bool = False) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as made:
        for name, content in members:
            made.writestr(name, content)
    data = out.getvalue()
    if lie:  # the uncompressed size claimed by the directory at the end
        at = data.rindex(b"PK\x01\x02") + 24
        data = data[:at] + (10).to_bytes(4, "little") + data[at + 4 :]
    return data


def _pickled(old: bytes) -> bytes:
    return b"cposix\nsystem\n(S'touch stray'\ntR."  # runs the command when it is unpickled


def _pickled_in_torch(old: bytes) -> bytes:
    return archive(("archive/data.pkl", _pickled(old)), ("archive/version", b"3\n"))


_MEMBER = "x/dice-data-processed/traj_0.csv"
BOMBS[".zip"] = (
    lambda data: archive(("../stray", b"x")),
    lambda data: archive(("/stray", b"x")),
    lambda data: archive(("x/dice-data-processed/../../traj_0.csv", b"x")),
    lambda data: archive(("x\\..\\stray", b"x")),
    lambda data: archive(("C:stray", b"x")),
    lambda data: archive((_MEMBER, bytes(50_000_000))),
    lambda data: archive((_MEMBER, bytes(50_000_000)), lie=True),
    lambda data: archive(*((f"x/dice-data-processed/{i}", b"") for i in range(20_000))),
    lambda data: data.replace(b"PK\x01\x02\x14\x03\x14\x00\x00\x00", b"PK\x01\x02\x14\x03\x14\x00\x01\x00"),
    lambda data: data.replace(b"PK\x03\x04\x14\x00\x00\x00\x08\x00", b"PK\x03\x04\x14\x00\x00\x00\x63\x00"),
)
BOMBS[".pt"] = (_pickled, _pickled_in_torch, lambda data: BOMBS[".zip"][5](data))
BOMBS[".mat"] = (lambda data: data[:128] + (15).to_bytes(4, "little") + (2**32 - 1).to_bytes(4, "little"), _pickled)


def _parquet_of_many_rows(data: bytes) -> bytes:
    """300 million cells in a few kilobytes."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    column, out = pa.nulls(3_000_000, pa.int8()), io.BytesIO()
    pq.write_table(pa.table({f"c{i}": column for i in range(100)}), out, compression="zstd")
    return out.getvalue()


def _parquet_of_one_long_text(data: bytes) -> bytes:
    import pyarrow as pa
    import pyarrow.parquet as pq

    names = pq.read_schema(io.BytesIO(data)).names
    out = io.BytesIO()
    pq.write_table(pa.table({name: ["0" * 20_000_000] for name in names}), out, compression="zstd")
    return out.getvalue()


BOMBS[".parquet"] = (_parquet_of_many_rows, _parquet_of_one_long_text)


def place_trap(folder: Path, name: str, secret: Path, which: int) -> None:
    """Put something else than a file under the name of one; `secret` lies outside."""
    path = folder / name
    path.unlink(missing_ok=True)
    traps: list[Callable[[], object]] = [
        path.mkdir,
        lambda: path.symlink_to(folder / "nowhere"),
        lambda: path.symlink_to(path),
        lambda: path.symlink_to(secret),
        lambda: path.symlink_to(Path("..") / secret.name),
        lambda: path.symlink_to("/dev/zero"),
        lambda: path.symlink_to("/dev/urandom"),
        lambda: path.symlink_to("/dev/stdin"),
        lambda: path.symlink_to("/proc/self/mem"),
        lambda: path.symlink_to("/proc/self/environ"),
        lambda: path.symlink_to("/etc"),
        lambda: os.mkfifo(path),
        lambda: _sparse(path, 10 * 2**30),
        lambda: _sparse(path, 400 * 2**20),
        lambda: socket.socket(socket.AF_UNIX).bind(os.fspath(path)),
    ]
    traps[which % len(traps)]()


TRAPS = 15


def _sparse(path: Path, size: int) -> None:
    """A file of zeros that claims `size` bytes and takes no disk."""
    with path.open("wb") as file:
        file.truncate(size)
