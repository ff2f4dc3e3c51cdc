"""HTML elements of a critique's page: numbers, sentences, tables and pictures."""

import base64
import re
from collections.abc import Collection, Iterable, Mapping, Sequence

import numpy as np
from markupsafe import Markup
from matplotlib.figure import Figure

from thesis_lib.critique.results.titles import handy_unit, symbol
from thesis_lib.figures.style import png_of
from thesis_lib.pages import element
from thesis_lib.statistics.intervals import Z95
from thesis_lib.statistics.wording import bounded, carried, fixed, number

_UNIT = re.compile(r"(?<=[\d\]]) (?=(?:%|m/s|mm|mrad|rad|rad/s|m|1/s|s|nats|sigma)(?![\w]))")


def paragraph(*sentences: str, kind: str = "") -> Markup:
    """Return sentences as one paragraph; empty without sentences."""
    text = " ".join(filter(None, map(str.strip, sentences)))
    return element("paragraph", _bound(text), kind) if text else Markup()


def _bound(text: str) -> str:
    """Return the text without line breaks between numbers and their units."""
    return _UNIT.sub("\u00a0", text)


def bullets(items: Iterable[str]) -> Markup:
    """Return a list; empty without items."""
    shown = list(items)
    return element("bullets", shown) if shown else Markup()


def table(caption: str, columns: Sequence[str], rows: Iterable[Sequence[str]], numeric: Collection[int] = ()) -> Markup:
    """Return a table in a scrolling frame; empty without rows.

    The first cell of a row is its heading; `numeric` columns are aligned right.
    """
    cells = [[str(first), *(_bound(str(cell)) for cell in rest)] for first, *rest in rows]
    return element("table", caption, columns, cells, numeric) if cells else Markup()


def picture(figure: Figure, caption: str, png: bytes | None = None) -> Markup:
    """Return a figure as an embedded PNG (`png` None: drawn here); title and caption form the alternative text."""
    title = " ".join(figure.get_suptitle().split())
    data = base64.b64encode(png or png_of(figure)).decode("ascii")
    width, height = (round(96 * inches) for inches in figure.get_size_inches())
    return element("picture", data, f"{title}. {caption}" if title else caption, width, height, caption)


def amount(value: float | None, unit: str = "", digits: int = 3) -> str:
    """Return a number with its unit; "unknown" without a value."""
    if value is None or not np.isfinite(value):
        return "unknown"
    factor, unit = handy_unit(value, unit)
    return f"{number(factor * value, digits)} {'' if unit == '1' else unit}".strip()


def interval(low: float | None, high: float | None, unit: str = "") -> str:
    """Return a 95 % interval in brackets, to the digits in which its ends differ; '' if it is unknown."""
    if low is None or high is None or not (np.isfinite(low) and np.isfinite(high)):
        return ""
    ends = [fixed(end, carried(high - low)) if high > low else number(end) for end in (low, high)]
    return f"[{ends[0]}, {ends[1]}]{'' if unit in ('', '1') else f' {unit}'}"


def estimate(value: float, std: float, unit: str = "") -> str:
    """Return a value with its 95 % interval and unit; without uncertainty, the value only."""
    if not np.isfinite(std) or std == 0.0:
        return amount(value, unit)
    low, high = value - Z95 * std, value + Z95 * std
    scale, unit = handy_unit(max(abs(low), abs(high)), unit)
    value, low, high = scale * value, scale * low, scale * high
    return f"{fixed(value, carried(high - low))} {interval(low, high, unit)}"


def sized(p: Mapping) -> str:
    """Return the value of a parameter of diagnosis.json with its 95 % interval, or its bound."""
    if not p.get("bound"):
        return estimate(p["value"], np.nan if p["std"] is None else p["std"], p["unit"])
    scale, unit = handy_unit(p["value"], p["unit"])
    scaled = {**p, "value": scale * p["value"], "range": [scale * end for end in p["range"]]}
    return bounded(scaled, "" if unit == "1" else unit)


def fitted(name: str, p: Mapping) -> str:
    """Return a parameter of diagnosis.json with its interval or bound: c_μ = 0.12 [0.10, 0.14], μ at least 0.3."""
    return f"{symbol(name)} {'' if p.get('bound') else '= '}{sized(p)}"


def plus_minus(value: float, std: float) -> str:
    """Return a value and half its 95 % interval, to two digits of the half-width."""
    half = Z95 * std
    if not np.isfinite(half) or half <= 0.0:
        return number(value)
    return f"{fixed(value, carried(half))} ± {fixed(half, carried(half))}"


def percent(share: float | None) -> str:
    """Return a share in per cent, with one decimal if it is small."""
    if share is None or not np.isfinite(share):
        return "unknown"
    if 0.0 < abs(share) < 0.0005:
        return "less than 0.1 %"
    return f"{100.0 * share:.1f} %" if 0.0 < abs(share) < 0.095 else f"{100.0 * share:.0f} %"
