"""Text of numbers and judgements in sentences: rounded as their uncertainty allows, with unit and sign."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from thesis_lib.statistics.intervals import Z95, wilson

NBSP = "\N{NO-BREAK SPACE}"
MINUS = str.maketrans("-", "−")
RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def number(value: float | None, digits: int = 3, unit: str = "") -> str:
    """Text of `value` to `digits` significant digits with its unit: 0.0831 m/s, −12.0 %, 1,240; "unknown" if None.

    Numbers below 10⁻⁴ and from 10⁶ on are written as powers of ten.
    """
    if value is None or not math.isfinite(value):
        return "unknown"
    mantissa, power = f"{value:.{digits - 1}e}".split("e")  # of the rounded value: 9.996 is 10.0
    size = int(power)
    if value == 0:
        text = "0"
    elif -4 <= size < 6:
        text = f"{value:,.{max(0, digits - 1 - size)}f}"
    else:
        text = f"{mantissa}·10{str(size).translate(RAISED)}"
    return text.translate(MINUS) + (f"{NBSP}{unit}" if unit else "")


def formatted(value: Any, as_: str) -> str:
    """Text of a value in Python's format `as_`, with a typographic minus sign, and none for zero."""
    sign = "+" * as_.startswith("+")
    return format(value, f"{sign}z{as_.removeprefix('+')}" if isinstance(value, float) else as_).translate(MINUS)


def interval(value: float, low: float, high: float, unit: str = "") -> str:
    """Text of a value with its interval, to the digits in which the bounds differ: 0.083 (0.079 to 0.087) m/s."""
    width = abs(high - low)
    if not math.isfinite(value) or not math.isfinite(width) or width == 0.0:
        return number(value, unit=unit)
    shown = [fixed(x, carried(width)) for x in (value, low, high)]
    return f"{shown[0]} ({shown[1]} to {shown[2]})" + (f"{NBSP}{unit}" if unit else "")


def carried(width: float) -> int:
    """Number of decimals for values known within an interval of this `width` > 0: two digits of the width."""
    return max(0, 1 - math.floor(math.log10(width)))


def fixed(value: float, decimals: int) -> str:
    """Text of a number with so many decimals, as −1,240.50; one that rounds to zero has no sign."""
    return f"{value:z,.{decimals}f}".translate(MINUS)


def estimate(value: float, std: float, unit: str = "") -> str:
    """Text of a normal estimate with its 95 % interval, as of `interval`, from the standard error `std`."""
    return interval(value, *ends(value, std), unit)


def bounded(p: Mapping[str, Any], unit: str = "") -> str:
    """Text of a parameter of diagnosis.json that the data only bound, in `unit`: at least 0.057."""
    if p["bound"] == "lower" and p.get("range") and p["value"] <= p["range"][0]:
        return "not shown by these data"
    return f"at {'least' if p['bound'] == 'lower' else 'most'} {number(p['value'], 2)} {unit}".rstrip()


def ends(value: Any, std: Any) -> tuple[Any, Any]:
    """The 95 % interval of an estimate with a normal error, or of each in a column of them."""
    return value - Z95 * std, value + Z95 * std


def side(low: float, high: float, of: float, words: tuple[str, str, str]) -> str:
    """The word for an interval below, around or above the value `of`; NaN bounds count as around it."""
    below, around, above = words
    return below if high < of else above if low > of else around


def percent(share: float, digits: int = 2) -> str:
    """Text of a share in per cent, 0.123 -> 12 %.  Only a share of 1 is 100 %: 0.9963 -> 99.6 %."""
    while 0.0 < share < 1.0 and float(f"{100.0 * share:.{digits - 1}e}") >= 100.0 and digits < 9:
        digits += 1
    return number(100.0 * share, 3 if share == 1.0 else digits, "%")


def listed(names: Sequence[str], last: str = "and") -> str:
    """Text of a list of names: a; a and b; a, b and c; "" without names."""
    *first, end = names or [""]
    return f"{', '.join(first)} {last} {end}" if first else end


def plural(n: int, name: str) -> str:
    """Text of n things with a regular plural: 1 trial, 12 trials."""
    return f"{n} {name}{'' if n == 1 else 's'}"


def times(ratio: float) -> str:
    """Text of a ratio: 0.30 times, 1.04 times, 41 times."""
    return f"{number(ratio, digits=3 if 1.0 <= ratio < 10.0 else 2)} times"


def count(k: float, n: float) -> str:
    """Text of k cases of n with the 95 % Wilson interval of the share: 118 of 120 (94 to 100 %)."""
    k, n = round(k), round(n)
    if n == 0:
        return "none of none"
    low, high = (100.0 * end for end in wilson(k, n))
    return f"{k:,} of {n:,} ({low:.0f} to {high:.0f}{NBSP}%)"
