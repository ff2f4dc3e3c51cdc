"""A term as the text of an effect file, and the effect that this text defines.

The critique fits and judges the very code that it writes: `effect_of` runs the text.  The text consists of the words of
`terms` and of numbers alone, never of the content of a dataset.
"""

from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np

from thesis_lib.critique.proposal.terms import Term
from thesis_lib.effects import Effect

# size a at which a term with φ near 1 matters, and the largest one in a fit
SCALES = {"epsilon": (0.2, 3.0), "mu": (0.4, 10.0), "direction": (0.05, 1.0), "couple": (0.1, 2.0)}
LARGE = {"place": 10.0, "squared_spin": 0.3}  # usual size of factors that are far from 1

PLACE = "from thesis_lib.effects.contact_place import along_surface\n"
DRIVER = "from thesis_lib.effects.driven_path import driven\n"
HEAD = '''\
"""{title}.

{equations}

Proposed by the critique because no named effect fitted.

| on paper | in code | unit | shape |                                          |
|----------|---------|------|-------|------------------------------------------|
| a        | `a`     | 1    |       | size of the term; 0: without the term    |

{symbols}
{found}
"""

# A formula that these data support, not yet a law: read it, give it a name, edit it, and look for its cause.
#   thesis-lib effects --check FILE.py
#   thesis-lib critique DATA --effects FILE.py

import numpy as np

{imports}from thesis_lib.effects.effect import Effect, Parameter
'''

CLASS = """

class {camel}(Effect):
    name = "{name}"
    family = "contact_law"
    title = "{title}"
    equation = "{equation}"
    reference = "proposed by sparse regression on measured impacts; no source yet"
    parameters = (Parameter("a", "1", null=0.0, low={low:g}, high={high:g}, scale={scale:g}),)
    breaks_mirror = {breaks}
{along}
{hook}
"""

COEFFICIENTS = """\
    def coefficients(self, mu, epsilon, contact, state, p, rig):
{lines}
        phi = {phi}
        return {returned}\
"""

PATH = """\
    def impulse(self, impulse, contact, state, p, rig):
        if not np.any(p["a"]):
            return impulse
{lines}

        def {role}(v_t, omega):  # at each moment of the impact
            return {returned}

        return driven(impulse, contact, state.omega, {role}={role})\
"""

RETURNED = {
    "epsilon": 'mu, np.clip(epsilon * (1.0 + p["a"] * phi), 0.0, 1.0)',
    "mu": 'np.maximum(mu * (1.0 + p["a"] * phi), 0.0), epsilon',
}
# argument of the driven path, and its value
DRIVEN = {
    "mu": ("factor", '1.0 + p["a"] * {phi}'),
    "direction": ("sideways", 'p["a"] * {phi}'),
    "couple": ("couple", 'p["a"] * rig.k_g * {phi}'),
}
# code that defines the variables of a factor, in the order in which it is written
VARIABLES = {
    "v_t": "v_t = contact.v_t",
    "v_n": "v_n = contact.v_n",
    "v": "v = np.maximum(np.hypot(contact.v_t, contact.v_n), 1e-3)  # m/s",
    "omega": "omega = state.omega",
    "k": "k = rig.k_g",
    "r_x": "r_x = rig.lowest(state)[0]",
    "beta": "at = rig.lowest(state)\n        beta = np.arctan2(at[1], at[0]) - state.theta",
    "x": "x = along_surface(state, rig)",
    "trial": "trial = state.trial - rig.reference.trial",
}
MEANINGS = {
    "v_t": "v_t, v_n: velocity of the contact point along and into the surface; v = √(v_t² + v_n²); v_0 = 1 m/s.",
    "omega": "ω: angular velocity; k: radius of gyration.",
    "r_x": "r_x: contact point ahead of the centre of mass; k: radius of gyration.",
    "beta": "β: polar angle of the contact point in the axes of the body.",
    "x": "x: place of the contact point from the middle of the measured impacts; k: radius of gyration.",
    "trial": "i: number of the release, from the middle of the measured ones.",
}


def source(terms: Sequence[Term], found: str = "") -> str:
    """Text of a file with an effect for each term; `found`: results of the critique, in plain words."""
    used = {name for term in terms for name in term.variables}
    used |= {"v_t"} if used & {"v", "v_n"} else set()
    symbols = [text for name, text in MEANINGS.items() if name in used]
    if any(term.follows and term.variables & {"v_t", "omega"} for term in terms):
        symbols.append("Slip and ω are those of each moment of the impact; v is that before it.")
    head = (
        HEAD.format(
            title=";\n".join(capital(term.title) for term in terms),
            equations="\n".join(f"    {term.equation}" for term in terms),
            symbols="\n".join(symbols),
            found=f"\n{found}" if found else "",
            imports=PLACE * ("x" in used) + DRIVER * any(term.follows for term in terms),
        )
        .replace('\n\n\n"""', '\n"""')
        .replace('\n\n"""', '\n"""')
    )
    names = [_camel(term) for term in terms]
    last = f"EFFECT = {names[0]}()\n" if len(names) == 1 else f"EFFECTS = ({', '.join(f'{n}()' for n in names)})\n"
    return head + "".join(map(_class, terms)) + "\n\n" + last


def _class(term: Term) -> str:
    scale, high = SCALES[term.target]
    for factor in term.factors:
        scale, high = (value / LARGE.get(factor.name, 1.0) for value in (scale, high))
    used = [name for name in VARIABLES if name in term.variables]
    if term.follows:
        role, value = DRIVEN[term.target]
        lines = [VARIABLES[name] for name in used if name not in ("v_t", "omega")]
        body = PATH.format(lines=_block(lines), role=role, returned=value.format(phi=term.code))
    else:
        lines = [VARIABLES[name] for name in used]
        body = COEFFICIENTS.format(lines=_block(lines), phi=term.code, returned=RETURNED[term.target])
    about = {"camel": _camel(term), "name": term.name, "title": term.title, "equation": term.equation}
    counted = ", ".join(f'"{name}"' for name in term.along)
    about["along"] = f"    along = ({counted}{',' if len(term.along) == 1 else ''})\n" if counted else ""
    return CLASS.format(**about, low=-high, high=high, scale=scale, breaks=term.breaks_mirror, hook=body)


def capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def _block(lines: Sequence[str]) -> str:
    return "\n".join(f"        {line}" for line in lines)


def _camel(term: Term) -> str:
    return "".join(word.capitalize() for word in term.name.split("_"))


@cache
def effect_of(term: Term) -> Effect:
    """The effect of a term, as defined by the file that `source` writes."""
    namespace: dict = {"__name__": __name__}
    exec(compile(source([term]), f"<{term.name}>", "exec"), namespace)
    return namespace["EFFECT"]


def phi(term: Term, values: Mapping[str, Any]) -> np.ndarray:
    """φ (n,) of a term from its variables by name; only the code of its factors is run."""
    return eval(term.code, {"np": np}, dict(values))
