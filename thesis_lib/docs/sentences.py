"""Numbers in sentences of README and docs/, from stored tables: `config/sentences.yaml` says which comes from where.

    docs/findings.md:
      - says: m/I from the published impacts is {ratio} ± {std} 1/m² once the rotation is mirrored
        from: config/figures/default/planar_impact/figure_measured_ratio.csv
        where: variant == 'mirrored_rotation'
        numbers:
          ratio: {column: ratio, as: ",.0f"}
          std: {column: std, as: ",.0f"}

The words stand on the page once, with a number in the place of each brace; line breaks do not count.  `from` is a file
of the repository, or a name in `TABLES`.  `where`, and after it that of a number, are pandas queries.  They leave one
row, or `take` says what is made of several.  Minus signs are typographic.

A table under `results/` is read from its copy in `config/results/`, which `python -m thesis_lib.docs --results results`
makes after a run at the default scale (`keep_results`).
"""

import re
from collections.abc import Callable, Mapping
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from pydantic import Field, RootModel

from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.files import write_text
from thesis_lib.foundation.settings import Section
from thesis_lib.ledger.reading import load_yaml, validate

if TYPE_CHECKING:
    import pandas as pd

ROOT = Path(__file__).resolve().parents[2]
STORE = ROOT / "config" / "sentences.yaml"
KEPT = ROOT / "config"  # results/chapter2/x.csv is kept as config/results/chapter2/x.csv
_LARGEST = 100_000  # bytes of a table that is kept
_NUMBER = r"([−-]?\d[\d,]*(?:\.\d+)?)"
_BRACE = re.compile(r"\{(\w+)\}")


class Number(Section):
    """One number of a sentence."""

    column: str = Field(description="of the table, or an expression of columns")
    where: str = Field("", description="pandas query, beside that of the sentence")
    from_: str = Field("", alias="from", description="another table than that of the sentence")
    take: Literal["", "count", "sum", "mean", "median", "min", "max"] = Field("", description="of several rows")
    times: float = Field(1.0, description="factor, as 100 for per cent")
    as_: str = Field(alias="as", description="Python's format, as .2f")


class Sentence(Section):
    """Words of a page with numbers in braces."""

    says: str = Field(description="the words, numbers in braces by name")
    from_: str = Field("", alias="from", description="file of the repository, or name of a table")
    where: str = Field("", description="pandas query, for all numbers")
    numbers: dict[str, Number] = Field(description="by name")


class _Sentences(RootModel[dict[str, list[Sentence]]]):
    """The content of config/sentences.yaml."""


def _recovered() -> "pd.DataFrame":
    from thesis_lib.critique.proof.results import recovered

    return recovered().query("contact_time >= 3e-4 and drops == 150")


def _outcomes() -> "pd.DataFrame":
    from thesis_lib.critique.proof.results import outcomes

    return outcomes()


def _fitted() -> "pd.DataFrame":
    from thesis_lib.critique.proof.direct_fits import parameters

    return parameters()


def _mechanisms() -> "pd.DataFrame":
    from thesis_lib.critique.mechanisms.proof import read, within

    return within(read())


def _claims() -> "pd.DataFrame":
    import pandas as pd

    from thesis_lib.ledger.expected import read_expected
    from thesis_lib.ledger.format import read_ledger

    stored = read_expected(ROOT / "config" / "claims_expected.yaml")["default"]
    claims = read_ledger(ROOT / "config" / "claims").claims
    rows = [(claim.id, stored.get(claim.id, "without data"), claim.weak is not None) for claim in claims]
    return pd.DataFrame(rows, columns=["id", "status", "weak"])


TABLES: dict[str, Callable[[], "pd.DataFrame"]] = {
    "real contacts: parameters": _recovered,  # `critique.proof.results.recovered`, of the table of real contacts
    "proof: outcomes": _outcomes,  # `critique.proof.results.outcomes`
    "direct fits: parameters": _fitted,  # `critique.proof.direct_fits.parameters`
    "arm and wheel: parameters": _mechanisms,  # `critique.mechanisms.proof.within`
    "claims": _claims,  # id, status at the default scale, weak
}


@lru_cache
def _table(name: str) -> "pd.DataFrame":
    if name in TABLES:
        return TABLES[name]()
    import pandas as pd

    path = ((KEPT if name.startswith("results/") else ROOT) / name).resolve()
    if not path.is_relative_to(ROOT) or not path.is_file():
        kept = "; a table of results/ is kept by python -m thesis_lib.docs --results results"
        raise UserError(f"{STORE.name}: {name!r} is no file of the repository, and none of {', '.join(TABLES)}{kept}.")
    return pd.read_csv(path)


def read_sentences(path: Path = STORE) -> dict[str, list[Sentence]]:
    """Sentences by page; UserError with every mistake in the file, and its line."""
    return validate(_Sentences, load_yaml(path), path).root


def results_named(sentences: Mapping[str, list[Sentence]]) -> list[str]:
    """Tables of results/ that the sentences read, by name."""
    of_page = (sentence for listed in sentences.values() for sentence in listed)
    names = {name for s in of_page for name in (s.from_, *(number.from_ for number in s.numbers.values()))}
    return sorted(name for name in names if name.startswith("results/"))


def keep_results(results: Path, kept: Path = KEPT, store: Path = STORE) -> list[Path]:
    """Copy the tables that sentences read from a run's folder `results`; returns the copies that changed.

    A table that the run does not have, as its dataset is absent, keeps its copy.  UserError if there is no copy either,
    or if a table is too large to be kept.
    """
    changed = []
    for name in results_named(read_sentences(store)):
        source, copy = results / name.removeprefix("results/"), kept / name
        if not source.is_file():
            if not copy.is_file():
                raise UserError(f"{store.name} reads {name}, and {source} does not exist; run the rule that makes it.")
            continue
        content = source.read_bytes()
        if len(content) > _LARGEST:
            raise UserError(f"{source} has {len(content):,} bytes; a table to be kept has at most {_LARGEST:,}.")
        if not copy.is_file() or copy.read_bytes() != content:
            write_text(content.decode("utf-8"), copy)
            changed.append(copy)
    _table.cache_clear()
    return changed


def value(sentence: Sentence, number: Number) -> str:
    """The number as text; UserError if its rows are not one row, or what `take` makes of them is none."""
    rows = _table(number.from_ or sentence.from_)
    try:
        for query in filter(None, (sentence.where, number.where)):
            rows = rows.query(query)
        column = rows.eval(number.column)
    except (KeyError, ValueError, SyntaxError, NameError) as error:
        raise UserError(f"{STORE.name}: {sentence.says!r}: {type(error).__name__}: {error}") from None
    if not number.take and len(column) != 1:
        raise UserError(f"{STORE.name}: {sentence.says!r}: {number.where!r} leaves {len(column)} rows, not one.")
    found = float(getattr(column, number.take)() if number.take else column.iloc[0])
    return format(number.times * found, number.as_).replace("-", "−")


def with_numbers(page: str, name: str, sentences: Mapping[str, list[Sentence]]) -> str:
    """The page with the numbers of its sentences; UserError if a sentence is not on it exactly once."""
    for sentence in sentences.get(name, ()):
        parts = _BRACE.split(sentence.says)
        words = [r"\s+".join(re.escape(word) for word in re.split(r"\s+", text)) for text in parts[::2]]
        if unknown := set(parts[1::2]) ^ set(sentence.numbers):
            raise UserError(f"{STORE.name}: {sentence.says!r} and its numbers do not agree on {', '.join(unknown)}.")
        found = list(re.finditer(_NUMBER.join(words), page))
        if len(found) != 1:
            raise UserError(f"{STORE.name}: {name} has {len(found)} times the words {sentence.says!r}, not once.")
        for i in reversed(range(len(parts) // 2)):
            begin, end = found[0].span(i + 1)
            page = page[:begin] + value(sentence, sentence.numbers[parts[2 * i + 1]]) + page[end:]
    return page
