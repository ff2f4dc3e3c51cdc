"""Selection of one body in a recording, and its rows or columns in a table of motions in space.

| form of the table              | a body is                                                                       |
|--------------------------------|---------------------------------------------------------------------------------|
| one row for each body          | named, or numbered, in a column beside the time: `t,name,x,y,z,qx,…`            |
| all bodies in a row            | columns with a common prefix or suffix: `box_x,box_y,…,hand_x,…`, `x.box,y.box,…` |
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import pandas as pd

from thesis_lib.datasets.format.validate import first_of
from thesis_lib.datasets.sources.tables.log_table import Log
from thesis_lib.foundation.errors import UserError

SHOWN = 20  # names in an error
NUMBER = r"[0-9]{1,6}(\.0*)?"  # of a body, as programs write it
OFTEN = 0.1  # of the rows have the time of another, where numbers name bodies
MOST = 50  # bodies in a table; a column with more values does not name bodies


def choose_body(path: Path, bodies: Sequence[str], body: str | None, column: str = "") -> str:
    """Full name of the selected body: the only one, or the one named `body`; the end of its name suffices.

    `column`: that of a table which holds the names, for the message.

    UserError if there is none, or there are several.
    """
    shown = first_of([name or "(no name)" for name in bodies], SHOWN)
    if body is None and len(bodies) == 1:
        return bodies[0]
    ways = (
        lambda name: name == body,
        lambda name: re.split("[:/]", name)[-1] == body,
        lambda name: name.endswith(body) and not name.isdigit(),  # 1 is not 11
    )
    found = next(filter(None, ([name for name in bodies if way(name)] for way in ways)), []) if body else []
    if len(found) == 1:
        return found[0]
    if body is None:
        where = f" (column {column})" if column else ""
        raise UserError(f"{path} has {len(bodies)} bodies{where}: {shown}. Choose one with --body NAME.")
    raise UserError(f"{path} has no body '{body}' (or several whose names end in it). It has: {shown}.")


def one_body(
    log: Log, source: Mapping[str, tuple[str, float]], body: str | None
) -> tuple[Log, Mapping[str, tuple[str, float]]]:
    """The rows of one body, and its columns and signs by our names; both unchanged if the table has a single body.

    UserError if there are several bodies, and `body` does not name one of them.
    """
    named = {ours: name for ours, (name, _) in source.items() if ours not in ("trial", "t")}
    if not any(log.has(name) for name in named.values()) and (groups := _groups(log, list(named.values()))):
        chosen = groups[choose_body(log.path, list(groups), body)]
        return log, {**source, **{ours: (chosen[name], source[ours][1]) for ours, name in named.items()}}
    beside = [log.find(name) for name, _ in source.values()]
    for column in log.cells.columns.difference(beside, sort=False):
        if _names_bodies(log, column, [name for name in (source["trial"][0], source["t"][0]) if log.has(name)]):
            label = log.text(column).str.strip()
            if body is None and (label != label.shift()).sum() == label.nunique():
                raise UserError(
                    f"{log.path}: the same times occur for each {column} ({', '.join(label.unique()[:SHOWN])}). If "
                    f"these are bodies, choose one with --body NAME; if they are tosses, give --columns trial={column}."
                )
            chosen = choose_body(log.path, list(label.unique()), body, column)
            return replace(log, cells=log.cells[(label == chosen).to_numpy()]), source
    if body is not None:
        raise UserError(f"{log.path} is a table of one body: leave --body out, or name the columns with --columns.")
    return log, source


def _groups(log: Log, names: Sequence[str]) -> dict[str, dict[str, str]]:
    """For each body, the columns named as `names` with the name of the body before or after them."""
    found: dict[str, dict[str, str]] = {}
    for pattern in ("(.+?)[._ :/-]?{}", "{}[._ :/-]?(.+)"):
        for name in names:
            for column in map(str, log.cells.columns):
                if match := re.fullmatch(pattern.format(re.escape(name)), column):
                    found.setdefault(match[1], {})[name] = column
        if whole := {body: columns for body, columns in found.items() if len(columns) == len(names)}:
            return whole
    return {}


def _names_bodies(log: Log, column: str, when: Sequence[str]) -> bool:
    """Whether times repeat in a table, but not among the rows with the same value of a column.

    Whole numbers may also count trials, with a block of rows and a clock for each.  They are names, as of tags, only if
    they take turns, and rows of equal times are frequent and follow one another.
    """
    label = log.text(column).str.strip()
    if not when or not 1 < label.nunique() <= MOST:
        return False
    times = pd.DataFrame({str(i): log.text(name).to_numpy() for i, name in enumerate(when)})
    again = times.duplicated()
    if not again.any() or times.assign(body=label.to_numpy()).duplicated().any():
        return False
    if label.str.contains("[^0-9.]").any():
        return True
    if not label.str.fullmatch(NUMBER).all() or (label != label.shift()).sum() == label.nunique():
        return False
    return bool(again.mean() > OFTEN) and again.equals((times == times.shift()).all(axis=1))
