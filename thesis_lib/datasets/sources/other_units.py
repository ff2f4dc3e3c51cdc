"""Other units of a recording, with which bodies fall by gravity.

A unit of length that is wrong by a factor c makes a fall by c g, one of time by g/c².  The true unit of time is the one
that gives the rate of a camera; those of length are tried.
"""

from collections.abc import Mapping

import numpy as np

from thesis_lib.datasets.sources.tables.options import SI, UNITS
from thesis_lib.datasets.space.falling_body import RARELY, falling
from thesis_lib.datasets.space.motion import PAUSE, Motion
from thesis_lib.statistics.wording import listed, plural

CAMERAS = (10.0, 1e4)  # Hz
SURELY_NONE = 1.0  # Hz, below which nothing that falls is recorded
INCH = 0.0254  # m


def other_units(
    motion: Motion, piece: np.ndarray, gravity: float, given: Mapping[str, str] | None
) -> tuple[str, list[str], np.ndarray | None] | None:
    """What the units look like, the options that state them, and the direction of the fall (3,) if one is found.

    Args:
        piece: (n,) number of the recording or trial of each sample.
        gravity: in m/s².
        given: units of --units by quantity; None for a recording without this option.

    Returns:
        None if the motion does not fall better in other units.
    """
    rate = 1.0 / float(np.median(np.diff(motion.t)))
    time, factor = _unit_of_time(rate, (given or SI).get("time", SI["time"]))
    pieces = np.cumsum(np.diff(piece, prepend=piece[0]) != 0)
    t = factor * motion.t + PAUSE * pieces if time else motion.t
    found = falling(t, motion.position, gravity, _scales((given or SI).get("length", SI["length"])))
    number = found[2] if found else 0
    looks = [f"the times look like {time} ({rate / factor:.4g} Hz, not {rate:.3g} Hz)"] if time else []
    if found is None or number < RARELY * (pieces[-1] + 1):
        sure = time and rate < SURELY_NONE
        return (listed(looks), _options(given, "", time), None) if sure else None
    unit, down, _ = found
    if unit:
        looks.append(f"the lengths look like {unit}")
    if not looks:
        return None
    seen = f"{listed(looks)}: then there {'is' if number == 1 else 'are'} {plural(number, 'free flight')}"
    return seen, _options(given, unit, time), down


def _unit_of_time(rate: float, read: str) -> tuple[str, float]:
    """The unit of time that gives the rate of a camera, and its size in the unit as read; "" and 1 for this itself."""
    low, high = CAMERAS
    if not low <= rate < high:
        for unit, (quantity, size) in UNITS.items():
            factor = size / UNITS[read][1]
            if quantity == "time" and low <= rate / factor < high:
                return unit, factor
    return "", 1.0


def _scales(read: str) -> dict[str, float]:
    """Units that lengths may really have, as factors to the lengths that were read in the unit `read`."""
    if read == "px":
        return {"": 1.0}
    sizes = {
        unit: size for unit, (quantity, size) in UNITS.items() if quantity == "length" and unit not in ("px", read)
    }
    return {"": 1.0} | {unit: size / UNITS[read][1] for unit, size in (sizes | {"inches": INCH}).items()}


def _options(given: Mapping[str, str] | None, length: str, time: str) -> list[str]:
    """The options that state the units by quantity: those given, replaced by `length` and `time` if these are named."""
    if given is None:
        return []
    units = {**given, **({"length": length} if length else {}), **({"time": time} if time else {})}
    inches = units.get("length") == "inches" and units.pop("length")
    order = [units[quantity] for quantity in SI if quantity in units]
    return [f"--units {','.join(order)}"] * bool(order) + [f"--scale {1.0 / INCH:.6g}"] * bool(inches)
