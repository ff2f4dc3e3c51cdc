"""The impact laws: description, promises kept, and reachable impulses of each."""

import sys

from thesis_lib.contact import LAWS, LAWS_IN_SPACE, Law, Promise, circular_cone, slip_hodograph
from thesis_lib.foundation.markdown import docstring, table


def text() -> str:
    """All laws in the order of the thesis's Table 3.1, then others."""
    defined = [law for law in LAWS.values() if not law.as_published]
    return "\n\n".join([promises_table(), _in_space(), *map(_entry, defined)])


def published_twin(law: Law) -> Law | None:
    """The same law as in its authors' code, if that differs."""
    return LAWS.get(f"{law.name}_as_published")


def promises_table() -> str:
    """A row for each promise, a column for each law: kept, or the share of random impacts that break it."""
    rows = [[promise.value, *(_kept(law, promise) for law in LAWS.values())] for promise in Promise]
    return table(["promise", *(law.title for law in LAWS.values())], rows)


def _kept(law: Law, promise: Promise) -> str:
    if promise in law.promises:
        return "kept"
    return f"{100 * law.breaks[promise]:.3g} %" if promise in law.breaks else "not known"


def _in_space() -> str:
    """The promises of laws in space, and the equations that they share there."""
    laws = [LAWS[name] for name in LAWS_IN_SPACE]
    shares = [law.breaks_in_space for law in laws]
    rows = [
        [promise.value, *(f"{100 * s[promise]:.3g} %" if promise in s else "kept" for s in shares)]
        for promise in Promise
    ]
    promises = table(["promise", *(law.title for law in laws)], rows)
    shared = (
        f"### {module.__name__.rpartition('.')[2]}.py\n\n{docstring(module)}"
        for module in (circular_cone, slip_hodograph)
    )
    said = "With `inertia=` in place of `k_g=` these laws resolve impacts in space; random ones break"
    return "\n\n".join([f"## In space\n\n{said}\n\n{promises}", *shared])


def _entry(law: Law) -> str:
    module = sys.modules[law.impulse.__module__]
    published = published_twin(law)
    names = f"`{law.name}`" + (f" and `{published.name}`" if published else "")
    unit = f" μ of the latter has the unit {published.mu_unit}." if published and published.mu_unit != "1" else ""
    shown = f"Impulses that {law.title} can give to one impact, inside the energy ellipse, for all μ and ε from 0 to 1"
    picture = f"![{shown}](pictures/laws/{law.name}.png)"
    return f"## {law.title}\n\n{docstring(module)}\n\nIn code: {names}.{unit}\n\n{picture}"
