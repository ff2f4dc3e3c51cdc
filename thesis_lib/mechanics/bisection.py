"""Where along a motion something changes, as a touch or its end, by bisection for many bodies at once."""

from collections.abc import Callable
from typing import Any

import numpy as np


def bisected(
    holds: Callable[[Any], Any], yes: np.ndarray | float, no: np.ndarray | float, halvings: int
) -> tuple[np.ndarray, np.ndarray]:
    """The ends (n,) of intervals in which a condition changes, halved so many times.

    It `holds` (n,) at `yes`, which may be the upper end, and not at `no`; both are (n,), or numbers.
    """
    for _ in range(halvings):
        middle = 0.5 * (yes + no)
        at = holds(middle)
        yes, no = np.where(at, middle, yes), np.where(at, no, middle)
    return np.asarray(yes), np.asarray(no)
