"""Numbers as written to JSON files: six significant digits, null for NaN and infinity."""

import math
from typing import Any

import numpy as np


def six_digits(value: Any) -> Any:
    """`value` with every float rounded to six significant digits and NaN or infinity as None.

    Six digits are finer than any measurement here, and coarser than differences between processors.
    """
    if isinstance(value, dict):
        return {str(key): six_digits(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [six_digits(item) for item in value]
    if isinstance(value, bool | np.bool_):
        return bool(value)
    if isinstance(value, int | np.integer):
        return int(value)
    if isinstance(value, float | np.floating):
        return float(f"{value:.6g}") + 0.0 if math.isfinite(value) else None
    return value
