"""Other causes of a fitted gravity or size: a wrong clock or length scale, and a wrong size from which k was computed.

*Clock and scale.*  Frames taken at the rate f but counted at the rate f_b have the times t f/f_b, so accelerations
look larger by (f_b/f)²; lengths too large by a factor 1 + s make accelerations larger by 1 + s.  Free fall is known
everywhere on Earth, so a different g gives either error,

    f/f_b = √(g/g'),   1 + s = g'/g,    g' the gravity that the flights show, g the gravity of the place.

Impacts do not depend on the units of time and length: if the size and the radius of gyration of the body have the same
wrong unit, every impact law predicts the same.

*Size.*  `datasets init` computes the radius of gyration from the shape if none is given.  A body larger by a factor
1 + s then has k larger by 1 + s, too: 1 + d_I = (1 + s)².
"""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from thesis_lib.bodies.body import Body
from thesis_lib.bodies.shapes import Disk
from thesis_lib.datasets.format.header import Header, SpaceHeader
from thesis_lib.statistics.wording import number, percent

ON_EARTH = (9.78, 9.83)  # m/s², from the equator to the poles at sea level (WGS 84: 9.7803 to 9.8322)
BELIEVED = (9.7, 9.9)  # m/s²: a dataset that states such a gravity means free fall
SEEN = 2.0  # standard errors beyond `ON_EARTH` from which gravity cannot be free fall
AGREE = 3.0  # standard errors within which inertia goes with the square of the size
DERIVED = 1e-6  # relative: `datasets init` writes at least six digits


def could_be(name: str, effects: Sequence[Mapping], header: Header | SpaceHeader | None) -> dict | None:
    """Other possible causes of the effect `name`, for diagnosis.json; None if none is known.

    `effects` are those of diagnosis.json: name, parameters.
    """
    parameters = {effect["name"]: effect["parameters"] for effect in effects}
    # a bound has no standard error
    if header is None or any(p["std"] is None for p in parameters[name].values()):
        return None
    if name == "wrong_gravity":
        return _clock_and_scale(parameters[name]["dg"], float(np.linalg.norm(header.gravity)), header.rate)
    return _size(parameters, header.body) if name == "wrong_size" and isinstance(header, Header) else None


def _clock_and_scale(dg: Mapping, gravity: float, believed: float | None) -> dict | None:
    low, high = ON_EARTH
    fitted = gravity + dg["value"]
    if not BELIEVED[0] <= gravity <= BELIEVED[1] or fitted <= 0.0:
        return None
    if low - SEEN * dg["std"] <= fitted <= high + SEEN * dg["std"]:
        return None
    there = float(np.clip(gravity, low, high))
    clock = float(np.sqrt(there / fitted))  # counted seconds per true second
    rate = None if believed is None else believed * clock
    causes = ["clock", "scale", *["buoyancy"] * (fitted < there)]
    found = {"gravity": fitted, "clock": clock - 1.0, "rate": rate, "believed_rate": believed}
    return {"causes": causes} | found | {"scale": fitted / there - 1.0}


def _size(parameters: Mapping[str, Mapping], body: Body) -> dict | None:
    derived = body.shape.radius_of_gyration
    if abs(body.radius_of_gyration / derived - 1.0) > DERIVED:
        return None
    s, inertia = parameters["wrong_size"]["s"], parameters.get("wrong_inertia")
    factor = 1.0 + s["value"]
    is_same = False
    if inertia is not None and (d_I := inertia["d_I"])["std"] is not None:
        error = np.hypot(d_I["std"], 2.0 * factor * s["std"])
        is_same = bool(abs(1.0 + d_I["value"] - factor**2) <= AGREE * error)
    radius = body.shape.radius * factor if isinstance(body.shape, Disk) else None
    return {"causes": [], "size": factor, "radius": radius, "explains": ["wrong_inertia"] * is_same}


def said(effects: Sequence[Mapping]) -> Iterator[str]:
    """Sentences on other possible causes of effects of diagnosis.json."""
    for effect in effects:
        if (other := effect.get("could_be")) is not None:
            yield (_clock_said if effect["name"] == "wrong_gravity" else _size_said)(other)


def _clock_said(other: Mapping) -> str:
    low, high = ON_EARTH
    slow, large = other["clock"] < 0.0, other["scale"] > 0.0
    clock = f"a clock that is {percent(abs(other['clock']))} too {'slow' if slow else 'fast'}"
    if other["rate"] is not None:
        change = f"{percent(abs(other['clock']))} {'fewer' if slow else 'more'}"
        clock = f"frames taken at {other['rate']:.4g} Hz rather than {other['believed_rate']:.4g} ({change})"
    causes = "the clock or the scale" if large else "the clock, the scale or, for a light body, buoyancy"
    return (
        f"Free fall is {low} to {high} m/s² everywhere on Earth, so {number(other['gravity'], 4)} m/s² points to "
        f"{causes}: {clock}, or all lengths {percent(abs(other['scale']))} too {'large' if large else 'small'}, "
        "including those of the body, would look the same."
    )


def _size_said(other: Mapping) -> str:
    off = other["size"] - 1.0
    again = f"--shape disk:{number(other['radius'], 4)}"
    if other["radius"] is None:
        again = f"the lengths of --shape times {number(other['size'], 4)}"
    one = "; wrong size and wrong inertia are this one cause" if other["explains"] else ""
    return (
        f"The body is {percent(abs(off))} {'larger' if off > 0.0 else 'smaller'} than its stated shape, from which its "
        f"radius of gyration was computed, so this is off by as much{one}: run datasets init again with {again}."
    )
