"""The catalogue of effects: description, parameters, and the picture of each."""

from importlib import import_module

from thesis_lib.effects import EFFECTS, Effect
from thesis_lib.effects.effect import FAMILIES, Parameter
from thesis_lib.foundation.markdown import code, docstring, table, with_links

CHANNELS = {
    "impact": "velocity after impact",
    "meet": "pose after impact against pose before",
    "touch": "gap between body and surface at impact",
    "flight": "acceleration between impacts",
    "slide": "deceleration of a body that slides on the surface",
}
KINDS = {
    "contact_law": "Contact law",
    "geometry": "Geometry of the body",
    "inertia": "Inertia",
    "surface": "Surface",
    "flight": "Flight",
    "measurement": "Measurement",
}
HEAD = ("parameter", "unit", "absent at", "limits", "a size that matters")


def text() -> str:
    """All effects, kind by kind."""
    parts = [table(("kind", "effects"), map(_overview, FAMILIES))]
    for family in FAMILIES:
        parts.append(f"## {KINDS[family]}")
        parts += [_entry(effect) for effect in EFFECTS.values() if effect.family == family]
    return "\n\n".join(parts)


def _overview(family: str) -> tuple[str, str]:
    names = [effect.name for effect in EFFECTS.values() if effect.family == family]
    return KINDS[family], ", ".join(f"[{name}](#{name})" for name in names)


def _entry(effect: Effect) -> str:
    changes = "; ".join(CHANNELS[channel] for channel in effect.channels)
    needs = " Needs trajectories." if effect.needs_trajectories else ""
    source = f" Source: {with_links(effect.reference)}." if effect.reference else ""
    about = docstring(import_module(f"thesis_lib.effects.{effect.name}"))
    parameters = table(HEAD, map(_parameter, effect.parameters))
    picture = f"![{picture_text(effect)}](pictures/effects/{effect.name}.png)"
    return f"### {effect.name}\n\n{about}\n\n{parameters}\n\nChanges: {changes}.{needs}{source}\n\n{picture}"


def _parameter(p: Parameter) -> tuple[str, str, str, str, str]:
    limits = f"{p.low:g} to {p.high:g}" if p.discrete is None else f"{p.null:g} or {p.discrete:g}"
    return code(p.name), p.unit, code(p.of) if p.of else f"{p.null:g}", limits, f"{size_that_matters(p):g}"


def size_that_matters(p: Parameter) -> float:
    """The value of the parameter in the pictures."""
    return p.null + p.scale if p.discrete is None else p.discrete


def sizes_text(effect: Effect) -> str:
    """The parameter values of the picture in words."""
    sizes = [f"{p.name} = {size_that_matters(p):g}{'' if p.unit == '1' else f' {p.unit}'}" for p in effect.parameters]
    return ", ".join(sizes)


def picture_text(effect: Effect) -> str:
    """Alternative text of the picture."""
    what, panels = "gap at impact", " over what it depends on most"
    if "impact" in effect.channels:
        over = "left over the contact velocity before impact, right against what else it depends on most"
        what, panels = "velocity after impact", f": {over}"
    elif "flight" in effect.channels:
        what, panels = "flight", ": left of the acceleration, right of the path over half a second"
    elif "slide" in effect.channels:
        what, panels = "deceleration in a slide", " over the speed before it"
    return f"Change of the {what} by {effect.title} ({sizes_text(effect)}){panels}"
