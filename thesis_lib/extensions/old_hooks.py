"""Effects written for the hooks of an earlier version: one error message shows each hook rewritten.

Hooks now take one contact and one state, components first, which contain the arguments of earlier versions:

| before                                                        | now                                              |
|---------------------------------------------------------------|--------------------------------------------------|
| `space` of coefficients, contact_time                         | `contact`                                        |
| impulse(impulse, space, mu, epsilon, r, state, p, rig)        | impulse(impulse, contact, state, p, rig)         |
| mu, epsilon, r of impulse                                     | `contact.mu`, `contact.epsilon`, `contact.r`     |
| contact_point(r_x, r_y, …) -> (r_x, r_y)                      | contact_point(r, …) -> r (2, n)                  |
| radius_of_gyration(k_g, p)                                    | inertia(G, p), of G = k_g²                       |
| Impulse(c_t, c_n, tau), impulse.tau                           | Impulse.planar(c_t, c_n, couple), impulse.couple |
| a[:, i] of acceleration, jump[:, i] of meet                   | a[i], jump[i]                                    |
"""

import inspect
import re
import textwrap
from collections.abc import Collection

from thesis_lib.effects.effect import Effect

SAME_NAMES = ("coefficients", "contact_time", "impulse", "contact_point")
RENAMED = {"radius_of_gyration": "inertia"}
# hooks whose arguments have the same names as before, but with rows and columns exchanged
BY_ROW = ("acceleration", "meet")
_BY_ROW = re.compile(r"\[\s*(?:\.\.\.|:)\s*,\s*\d+\s*\]|axis\s*=\s*-?1|\.T\b|column_stack")


def rewritten(effect: Effect, failing: Collection[str]) -> str:
    """Code that replaces the hooks of `effect` written for earlier versions; "" if there are none.

    `failing` names the hooks that fail: among hooks with unchanged argument names only these are considered.
    """
    found = []
    for name in (*SAME_NAMES, *RENAMED):
        hook = type(effect).__dict__.get(name) or getattr(type(effect), name, None)
        if hook is None or getattr(Effect, name, None) is hook:
            continue
        if name in RENAMED or _arguments(hook) != _arguments(getattr(Effect, name)):
            found.append(_rewritten(name, hook))
    for name in BY_ROW:
        hook = getattr(type(effect), name)
        if name in failing and hook is not getattr(Effect, name) and _BY_ROW.search(_source(hook)):
            found.append(_rewritten(name, hook))
    return "\n".join(found)


def _arguments(hook: object) -> list[str]:
    return list(inspect.signature(hook).parameters)  # pyright: ignore[reportArgumentType]


def _source(hook: object) -> str:
    try:
        return textwrap.dedent(inspect.getsource(hook))  # pyright: ignore[reportArgumentType]
    except (OSError, TypeError):
        return ""


def _rewritten(name: str, hook: object) -> str:
    """Source of a hook for this version, as far as words can be replaced; only its head if there is no source."""
    new = RENAMED.get(name, name)
    head = f"def {new}({', '.join(_arguments(getattr(Effect, new)))}):"
    body = re.sub(r"^\s*def \w+\(.*?\)[^:\n]*:[ \t]*\n?", "", _source(hook), count=1, flags=re.S)
    if not body.strip():
        return head
    return f"{head}\n{textwrap.indent(textwrap.dedent(_words(name, body)).strip(chr(10)), '    ')}"


def _words(name: str, body: str) -> str:
    """Body of a hook with the names of this version."""
    body = re.sub(r"\bspace\b", "contact", body)
    body = re.sub(r"\bImpulse\(", "Impulse.planar(", body)
    body = re.sub(r"\bimpulse\.tau\b", "impulse.couple", body)
    body = re.sub(r"\btau=(?=impulse\.couple)", "couple=", body)
    first = ""
    if name == "impulse":
        used = [part for part in ("mu", "epsilon") if re.search(rf"\b{part}\b", body)]
        first = "".join(f"{part} = contact.{part}\n" for part in used)
        first += "r = contact.r\n" if re.search(r"\br\b", body) else ""
    elif name == "contact_point":
        first = "r_x, r_y = r\n"
        body = re.sub(r"return ([^\n]+)", r"return np.stack((\1))", body)
    elif name == "radius_of_gyration":
        first = "k_g = np.sqrt(G)\n"
        body = re.sub(r"return ([^\n]+)", r"return (\1) ** 2", body)
    else:
        body = re.sub(r"\b(a|jump)\[(?:\.\.\.|:),\s*(\d)\]", r"\1[\2]", body)
        body = re.sub(r",\s*axis\s*=\s*-?1\s*\)", ")", body)
    return textwrap.indent(first, _indent(body)) + body


def _indent(body: str) -> str:
    lines = [line for line in body.split("\n") if line.strip()]
    return lines[0][: len(lines[0]) - len(lines[0].lstrip())] if lines else ""
