"""Rendering of README and pages of docs/ from Jinja templates in docs/templates/, with numbers from stored tables.

    {% set fits = table("results/chapter2/measured_ratio.csv", "variant == 'as_published'") %}
    m/I from the published impacts is {{ fits("ratio", ",.0f") }} ± {{ fits("std", ",.0f") }} 1/m²

`table(name, where)` gives the rows of a file of the repository, or of a table in `TABLES`, selected by a pandas query.
Called with a column (or an expression of columns) and a Python format, the result gives a number as text: the value in
its single row, or `take` (count, sum, mean, median, min, max) of several rows.  `where` selects among the rows, and
`times` is a factor, for example 100 for per cent.  `rows` is for loops, and the filter `as` formats a value.  Minus
signs are typographic.  `critique(name)` gives the contents of a diagnosis.json.

A table under `results/` is read from its copy in `config/results/`, which is updated by
`python -m thesis_lib.studies.docs --results results` after a run at the default scale (`keep_results`).
"""

import json
import re
from collections.abc import Callable
from functools import lru_cache
from importlib import import_module
from pathlib import Path
from typing import Any

import jinja2
import pandas as pd

from thesis_lib.contact import LAWS, LAWS_IN_SPACE, Promise
from thesis_lib.critique.likelihood.channels import CHANNELS
from thesis_lib.critique.results.titles import effect_title
from thesis_lib.effects import EFFECTS, effects_in
from thesis_lib.effects.effect import FAMILIES, parameters_in
from thesis_lib.foundation.columns import meanings
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.files import write_text
from thesis_lib.foundation.markdown import docstring, with_links
from thesis_lib.mechanics.space import PLANE, SPACE
from thesis_lib.report.elements import amount, fitted, symbol
from thesis_lib.statistics.wording import formatted
from thesis_lib.studies.docs.signatures import size_that_matters, sizes_text
from thesis_lib.studies.proof import direct_fits, mechanisms
from thesis_lib.studies.proof.results import outcomes, recovered
from thesis_lib.studies.proof.summary import summary
from thesis_lib.thesis.ledger.expected import read_expected
from thesis_lib.thesis.ledger.format import read_ledger

ROOT = Path(__file__).resolve().parents[3]
TEMPLATES = ROOT / "docs" / "templates"
KEPT = ROOT / "config"  # results/chapter2/x.csv is copied to config/results/chapter2/x.csv
_LARGEST = 100_000  # largest size of a copied table in bytes
_RESULTS = re.compile(r'"(results/[\w./]+\.(?:csv|json))"')


def _claims() -> pd.DataFrame:
    """Each claim with its chapter, its status at the default scale, and whether agreement is only weak evidence."""
    stored = read_expected(ROOT / "config" / "claims_expected.yaml")["default"]
    claims = read_ledger(ROOT / "config" / "claims").claims
    rows = [(c.id, c.chapter, stored.get(c.id, "without data"), c.weak is not None) for c in claims]
    return pd.DataFrame(rows, columns=["id", "chapter", "status", "weak"])


TABLES: dict[str, Callable[[], pd.DataFrame]] = {
    "real contacts: parameters": lambda: recovered().query("contact_time >= 3e-4 and drops == 150"),
    "proof: outcomes": outcomes,
    "proof: summary": summary,
    "direct fits: parameters": direct_fits.parameters,
    "direct fits: contacts": lambda: direct_fits.numbers("by_contact"),
    "direct fits: tosses": lambda: direct_fits.numbers("tosses"),
    "direct fits: refitted": lambda: direct_fits.numbers("refitted"),
    "arm and wheel: parameters": lambda: mechanisms.within(mechanisms.read()),
    "claims": _claims,
}


def stored_critique(name: str) -> dict:
    """The contents of a diagnosis.json, prepared for a page.

    `found`: title, sizes, channels and gain of each effect; `seen`: for each effect that was not selected, the smallest
    size that would have been detected; `unseen`: titles of the effects that would not have been detected at any size.
    """
    d = json.loads(_path(name).read_text(encoding="utf-8"))
    space = SPACE if d["dimensions"] == 3 else PLANE
    found = [
        {
            "name": e["name"],
            "title": effect_title(e["name"]),
            "sizes": "; ".join(fitted(parameter, p) for parameter, p in e["parameters"].items()),
            "channels": ", ".join(CHANNELS[channel].text for channel in e["material_in"]),
        }
        | e["gain"]
        for e in d["effects"]
    ]
    seen, unseen = [], []
    for e in d["detectable"]:
        if e["name"] in {one["name"] for one in found}:
            continue
        sizes = [
            "would show" if p.discrete is not None else f"{symbol(p.name)} {amount(e['smallest'][p.name], p.unit, 2)}"
            for p in parameters_in(EFFECTS[e["name"]], space)
            if e["smallest"][p.name] is not None
        ]
        (seen if sizes else unseen).append((effect_title(e["name"]), "; ".join(dict.fromkeys(sizes))))
    return d | {"found": found, "seen": seen, "unseen": [title for title, _ in unseen]}


def _path(name: str) -> Path:
    path = ((KEPT if name.startswith("results/") else ROOT) / name).resolve()
    if not path.is_relative_to(ROOT) or not path.is_file():
        kept = "; for a table of results/, first run python -m thesis_lib.studies.docs --results results"
        raise UserError(f"{name!r} is neither a file of the repository nor one of {', '.join(TABLES)}{kept}.")
    return path


@lru_cache
def _read(name: str) -> pd.DataFrame:
    return TABLES[name]() if name in TABLES else pd.read_csv(_path(name))


class StoredTable:
    """Rows of a table that give numbers as text (see the module's docstring)."""

    def __init__(self, name: str, where: str = "", rows: pd.DataFrame | None = None) -> None:
        rows = _read(name) if rows is None else rows
        self.name, self.rows = name, rows.query(where) if where else rows

    def only(self, **values: Any) -> "StoredTable":
        """The rows in which the named columns have these values."""
        return StoredTable(self.name, " and ".join(f"{name} == {value!r}" for name, value in values.items()), self.rows)

    def __call__(self, column: str, as_: str, where: str = "", take: str = "", times: float = 1.0) -> str:
        """The number as text; UserError if there is not exactly one row and `take` is not given."""
        found = (self.rows.query(where) if where else self.rows).eval(column)
        if not take and len(found) != 1:
            raise UserError(f"{self.name}: {where!r} leaves {len(found)} rows for {column!r}, not one.")
        return formatted(times * float(getattr(found, take)() if take else found.iloc[0]), as_)


KNOWN = {  # names that templates can use
    **{"table": StoredTable, "critique": stored_critique, "meanings": meanings, "with_links": with_links},
    "docstring": lambda module: docstring(import_module(module)),
    **{"LAWS": LAWS, "LAWS_IN_SPACE": LAWS_IN_SPACE, "Promise": Promise, "EFFECTS": EFFECTS, "FAMILIES": FAMILIES},
    "EFFECTS_IN": {space.dimension: effects_in(space) for space in (PLANE, SPACE)},
    **{"size_that_matters": size_that_matters, "sizes_text": sizes_text},
}


def filled(template: str, where: str) -> str:
    """The page rendered from a template; UserError, which names it as `where`, if a number or table is unavailable."""
    environment = jinja2.Environment(
        undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True
    )
    environment.filters.update({"as": formatted, "plain": "{:g}".format, "cell": lambda text: text.replace("|", "\\|")})
    try:
        return environment.from_string(template, KNOWN).render()
    except (UserError, jinja2.TemplateError, KeyError, ValueError, SyntaxError, NameError, AttributeError) as error:
        raise UserError(f"{where}: {type(error).__name__}: {error}") from error


def keep_results(results: Path, kept: Path = KEPT, templates: Path = TEMPLATES) -> list[Path]:
    """Copy the tables that templates read from a run's folder `results`; return the copies that changed.

    If the run lacks a table because its dataset is absent, the existing copy stays.  UserError if there is no copy
    either, or if a table is too large to be copied.
    """
    changed = []
    texts = [path.read_text(encoding="utf-8") for path in sorted(templates.rglob("*.md"))]
    for name in sorted({name for text in texts for name in _RESULTS.findall(text)}):
        source, copy = results / name.removeprefix("results/"), kept / name
        if not source.is_file():
            if not copy.is_file():
                raise UserError(f"{templates} reads {name}, but {source} does not exist; run the rule that makes it.")
            continue
        content = source.read_bytes()
        if len(content) > _LARGEST:
            raise UserError(f"{source} has {len(content):,} bytes; tables for pages may have at most {_LARGEST:,}.")
        if not copy.is_file() or copy.read_bytes() != content:
            write_text(content.decode("utf-8"), copy)
            changed.append(copy)
    _read.cache_clear()
    return changed
