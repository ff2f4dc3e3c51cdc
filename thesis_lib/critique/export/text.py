"""Numbers and comments of an engine's file: where each number comes from, and what the file could not hold."""

import textwrap
from collections.abc import Iterable, Sequence

import numpy as np

from thesis_lib.critique.export.solid import NO_MASS, NO_TIME, ExportedBody
from thesis_lib.critique.results.saved_model import SavedModel, SavedParameter
from thesis_lib.foundation.terminal import visible
from thesis_lib.statistics.wording import bounded

WIDTH = 110  # characters of a comment's line


def n(*values: float | np.ndarray) -> str:
    """Numbers as they stand in a file: nine digits, no negative zero."""
    flat = np.concatenate([np.ravel(value) for value in values])
    return " ".join(f"{value + 0.0:.9g}" for value in np.where(np.abs(flat) < 1e-15, 0.0, flat))


def comment(lines: Iterable[str], indent: str = "") -> str:
    """An XML comment; what would end it early is broken up, what does not print is escaped."""
    safe = [" ".join(visible(line).split("\n")).replace("--", "- -").rstrip("-") for line in lines]
    wrapped = [part for line in safe for part in textwrap.wrap(line, WIDTH, subsequent_indent="    ") or [""]]
    return "\n".join([f"{indent}<!--", *(f"{indent}  {line}".rstrip() for line in wrapped), f"{indent}-->"])


def story(solid: ExportedBody, engine: Sequence[str]) -> list[str]:
    """Where the numbers come from, what was left out; `engine` says how the contact's numbers are made."""
    return [*provenance(solid), *engine, "", *said_of_effects(solid)]


def only_bounds(model: SavedModel) -> list[str]:
    """What the drops give only a bound of, and what was written in its place."""
    return [
        f"{name}: {bounded(p.model_dump())}; {model.values[name]:g} is used"
        for name, p in model.parameters.items()
        if p.bound is not None
    ]


def _sized(p: SavedParameter) -> str:
    if p.bound is not None:
        return bounded(p.model_dump(), "" if p.unit == "1" else p.unit)
    return f"= {p.value:g}" + ("" if p.std is None else f" +/- {p.std:g}") + ("" if p.unit == "1" else f" {p.unit}")


def provenance(solid: ExportedBody) -> list[str]:
    """Where each number comes from."""
    m = solid.model
    fitted = ", ".join(f"{name} {_sized(p)}" for name, p in m.parameters.items())
    mass = "as given" if solid.mass_known else f"{NO_MASS:g} kg, as no mass was given"
    time = "from the fitted tau" if solid.time_known else f"{NO_TIME:g} s, as impacts alone show none"
    when = "at any speed" if solid.speed is None else f"at {solid.speed:g} m/s"
    return [
        f"Written by python -m thesis_lib export from a model of {m.dataset or 'drops'}: {m.law.replace('_', ' ')}"
        + (f" with {', '.join(m.effects)}" if m.effects else ""),
        f"fitted: {fitted}",
        "",
        "axes: the plane of the drops is x-z; theta turns about -y; units m, kg, s, rad",
        "origin of the body: the believed centre of mass, as in the dataset",
        f"shape: as in dataset.yaml{' times 1 + wrong_size.s' if 'wrong_size' in m.effects else ''}",
        f"depth along y: {solid.depth:g} m, stated, not measured",
        f"mass: {mass}",
        f"inertia: about y m k^2 with k = {solid.k_g:.6g} m"
        + (" (fitted)" if "wrong_inertia" in m.effects else " (as in dataset.yaml)")
        + "; the others as of a uniform solid, scaled alike",
        f"centre of mass: {'fitted (com_offset)' if 'com_offset' in m.effects else 'as believed'}",
        f"friction: mu = {solid.mu:g}, fitted",
        f"restitution: {solid.epsilon:g}, fitted, of a central impact {when}",
        f"contact time: {solid.contact_time:.6g} s, {time}",
        f"surface: height {solid.height:g} m, tilt {solid.tilt:g} rad; gravity {solid.gravity:g} m/s^2",
    ]


def said_of_effects(solid: ExportedBody) -> list[str]:
    """The effects that the file holds, and those that it cannot."""
    held = [f"  {name}: {where}" for name, where in solid.expressed] or ["  (none)"]
    left = [f"  {name}: {why}" for name, why in solid.left_out] or ["  (nothing)"]
    return ["effects in this file:", *held, "could not be expressed:", *left]
