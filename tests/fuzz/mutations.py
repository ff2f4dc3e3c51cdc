"""Ways to spoil an input: bytes, cells, nodes of YAML and JSON.  A sample is a folder as {file name: bytes}."""

import io
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import yaml

Sample = dict[str, bytes]

CELLS = (
    *("", " ", "nan", "NaN", "inf", "-inf", "1e400", "1e308", "-1e308", "1e-320", "0", "-1", "-0.0", "0x10", "1_000"),
    *("9" * 30, "9" * 5000, "9007199254740993", "1,5", "1;5", "true", "null", "None", "~", "0.1 m", "1+2j"),
    *("2020-99-99", '"', '""', "'", "[", "{", "*a", "&a 1", "!!python/object/apply:os.system ['touch stray']"),
    *("!!int ''", "<<: 1", "../../etc/passwd", "/etc/passwd", "/dev/zero", "\x1b[31m", "\x00", "\u202e", "é"),
    *("\U0001f600" * 50, "a" * 200_000, "=cmd|' /C calc'!A0", "$(touch stray)", "<script>", "%s%n", "\r", "\n\n"),
    *("\t", "---", "...", "#"),
)
VALUES = (
    *(None, True, False, 0, -1, 1, 2**63, 10**40, 0.5, 1e308, -1e308, 5e-324),
    *(float("nan"), float("inf"), -float("inf"), "", "x", "nan", "1e3", "../../etc/passwd", "/dev/zero", "\x1b[31m"),
    *("é\u202e", "a" * 100_000, "{dataset}", "{0.__class__}", [], {}, [[]], [{}], {"": 0}, {"a": {"a": {}}}),
    *([1, "a", None], [float("nan")] * 3, list(range(1000))),
)


def mutate(sample: Sample, rng: np.random.Generator) -> Sample:
    """One file of the sample spoilt in one to three ways."""
    spoilt = dict(sample)
    name = str(rng.choice(sorted(sample)))
    for _ in range(rng.integers(1, 4)):
        ways = [*BYTES, *BYTES, *WAYS.get(Path(name).suffix, ()), *WAYS.get(Path(name).suffix, ())]
        spoilt[name] = ways[rng.integers(len(ways))](spoilt[name], rng)
    if rng.random() < 0.03:  # fields in the wrong file
        other = str(rng.choice(sorted(sample)))
        spoilt[name], spoilt[other] = spoilt[other], spoilt[name]
    if rng.random() < 0.03:
        del spoilt[name]
    return spoilt


def _two(data: bytes, rng: np.random.Generator) -> tuple[int, int]:
    a, b = sorted(rng.integers(0, len(data) + 1, 2).tolist())
    return a, min(b, a + int(rng.choice([1, 4, 64, 4096])))


def flip(data: bytes, rng: np.random.Generator) -> bytes:
    spoilt = bytearray(data)
    for _ in range(rng.integers(1, 9)):
        if spoilt:
            spoilt[rng.integers(len(spoilt))] ^= 1 << rng.integers(8)
    return bytes(spoilt)


def truncate(data: bytes, rng: np.random.Generator) -> bytes:
    return data[: rng.integers(0, len(data) + 1)]


def insert(data: bytes, rng: np.random.Generator) -> bytes:
    at = rng.integers(0, len(data) + 1)
    return data[:at] + rng.bytes(int(rng.choice([1, 3, 16, 1000]))) + data[at:]


def remove(data: bytes, rng: np.random.Generator) -> bytes:
    a, b = _two(data, rng)
    return data[:a] + data[b:]


def repeat(data: bytes, rng: np.random.Generator) -> bytes:
    a, b = _two(data, rng)
    return data[:b] + data[a:b] * int(rng.choice([1, 2, 50])) + data[b:]


def zero(data: bytes, rng: np.random.Generator) -> bytes:
    a, b = _two(data, rng)
    return data[:a] + bytes(b - a) + data[b:]


def number(data: bytes, rng: np.random.Generator) -> bytes:
    """An integer of a binary format, such as a length, becomes extreme."""
    width = int(rng.choice([2, 4, 8]))
    at = int(rng.integers(0, max(1, len(data) - width)))
    value = [b"\xff" * width, bytes(width), b"\x7f" * width, (2**31 - 1).to_bytes(8, "little")[:width]]
    return data[:at] + value[rng.integers(4)] + data[at + width :]


def encoding(data: bytes, rng: np.random.Generator) -> bytes:
    text = data.decode("utf-8", "replace")
    kinds: list[Callable[[], bytes]] = [
        lambda: text.encode("utf-16"),
        lambda: b"\xef\xbb\xbf" + data,
        lambda: b"\xef\xbb\xbf" * 2 + data,
        lambda: text.encode("utf-32-le"),
        lambda: (text + "é").encode("latin-1", "replace"),
        lambda: data.replace(b"\n", b"\r\n"),
        lambda: data.replace(b"\n", b"\r"),
        lambda: b"".join(bytes([byte, 0]) for byte in data[:2000]),
    ]
    return kinds[rng.integers(len(kinds))]()


def nothing(data: bytes, rng: np.random.Generator) -> bytes:
    return [b"", b"\n", b"\x00", rng.bytes(200)][rng.integers(4)]


def token(data: bytes, rng: np.random.Generator) -> bytes:
    """One word or number of a text becomes another thing."""
    text = data.decode("utf-8", "replace")
    a = int(rng.integers(0, len(text) + 1))
    separators = " ,:\n[]{}\"'"
    while a > 0 and text[a - 1] not in separators:
        a -= 1
    b = a
    while b < len(text) and text[b] not in separators:
        b += 1
    return (text[:a] + CELLS[rng.integers(len(CELLS))] + text[b:]).encode("utf-8", "replace")


def lines(data: bytes, rng: np.random.Generator) -> bytes:
    """Lines swapped, dropped, doubled or indented."""
    rows = data.split(b"\n")
    i, j = rng.integers(0, len(rows), 2)
    way = rng.integers(4)
    if way == 0:
        rows[i], rows[j] = rows[j], rows[i]
    elif way == 1:
        del rows[i]
    elif way == 2:
        rows.insert(j, rows[i])
    else:
        rows[i] = b"  " + rows[i]
    return b"\n".join(rows)


def columns(data: bytes, rng: np.random.Generator) -> bytes:
    """Columns of a CSV swapped, dropped, doubled, renamed or filled with one cell."""
    rows = [line.split(",") for line in data.decode("utf-8", "replace").split("\n")]
    i, j = rng.integers(0, max(1, len(rows[0])), 2)
    way, cell = rng.integers(5), CELLS[rng.integers(len(CELLS))][:2000]
    for n, row in enumerate(rows):
        if max(i, j) >= len(row) or row == [""]:
            continue
        if way == 0:
            row[i], row[j] = row[j], row[i]
        elif way == 1:
            del row[i]
        elif way == 2:
            row.insert(j, row[i])
        elif (way == 3 and n == 0) or (way == 4 and n > 0):
            row[i] = cell
    return "\n".join(",".join(row) for row in rows).encode("utf-8", "replace")


def _spoil_tree(tree: object, rng: np.random.Generator) -> object:
    """One node of nested mappings and lists replaced, dropped, renamed or wrapped."""
    places: list[tuple[dict | list, object]] = []

    def walk(node: object) -> None:
        items = node.items() if isinstance(node, dict) else enumerate(node) if isinstance(node, list) else ()
        for key, value in list(items):
            places.append((node, key))
            walk(value)

    walk(tree)
    value = VALUES[rng.integers(len(VALUES))]
    if not places:
        return value
    parent, key = places[rng.integers(len(places))]
    way = rng.integers(5)
    if way <= 1:
        parent[key] = value
    elif way == 2:
        del parent[key]
    elif way == 3 and isinstance(parent, dict):
        parent[CELLS[rng.integers(len(CELLS))][:100]] = parent.pop(key)
    else:
        parent[key] = [parent[key]] if rng.random() < 0.5 else {"a": parent[key]}
    return tree


def json_tree(data: bytes, rng: np.random.Generator) -> bytes:
    try:
        tree = json.loads(data)
    except (ValueError, RecursionError):
        return flip(data, rng)
    return json.dumps(_spoil_tree(tree, rng), ensure_ascii=False).encode("utf-8", "replace")


def yaml_tree(data: bytes, rng: np.random.Generator) -> bytes:
    try:
        tree = yaml.CSafeLoader(data[:20_000]).get_single_data()
        return yaml.dump(_spoil_tree(tree, rng), Dumper=yaml.CSafeDumper, allow_unicode=True).encode()
    except Exception:  # spoilt before
        return flip(data, rng)


def parquet_columns(data: bytes, rng: np.random.Generator) -> bytes:
    """A column of another type, in a file that is Parquet all the same."""
    try:
        table = pd.read_parquet(io.BytesIO(data))
    except Exception:  # spoilt before
        return flip(data, rng)
    name, n = str(rng.choice(table.columns)), len(table)
    fill: list[object] = [
        ["text"] * n,
        [None] * n,
        [[1.0, 2.0]] * n,
        [{"a": 1}] * n,
        pd.date_range("2020-01-01", periods=n),
        pd.to_timedelta(np.arange(n), unit="s"),
        pd.Categorical(["a"] * n),
        [True] * n,
        [b"\xff\x00"] * n,
        np.full(n, np.inf),
        np.full(n, 2**64 - 1, dtype=np.uint64),
        np.full(n, np.nan),
        np.full(n, 1e308),
    ]
    table[name] = fill[rng.integers(len(fill))]
    if rng.random() < 0.2:
        table = table.drop(columns=name)
    out = io.BytesIO()
    table.iloc[: int(rng.choice([0, 1, n, n]))].to_parquet(out, index=bool(rng.random() < 0.1))
    return out.getvalue()


BYTES = (flip, truncate, insert, remove, repeat, zero, number, encoding, nothing)
WAYS: dict[str, tuple] = {
    ".csv": (token, token, lines, columns, columns, columns),
    ".yaml": (token, token, lines, yaml_tree, yaml_tree, yaml_tree, yaml_tree),
    ".json": (token, token, lines, json_tree, json_tree, json_tree, json_tree),
    ".parquet": (parquet_columns, number, number),
    ".txt": (token, lines),
}
