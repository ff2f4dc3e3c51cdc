"""Bisection, for many bodies at once, of the instant at which a condition changes (a contact begins or ends)."""

from collections.abc import Callable
from typing import Any

import numpy as np


def bisected(
    holds: Callable[[Any], Any], yes: np.ndarray | float, no: np.ndarray | float, halvings: int
) -> tuple[np.ndarray, np.ndarray]:
    """Ends (n,) of the intervals in which a condition changes, after the given number of `halvings`.

    `holds` returns the condition (n,); it is true at `yes`, either end, and false at `no`; both (n,) or numbers.
    """
    for _ in range(halvings):
        middle = 0.5 * (yes + no)
        at = holds(middle)
        yes, no = np.where(at, middle, yes), np.where(at, no, middle)
    return np.asarray(yes), np.asarray(no)
