"""Readable names of laws, effects, parameters and features, with handy units."""

from collections.abc import Mapping

from thesis_lib.critique.contacts.bases import BASES
from thesis_lib.critique.drops.criticise import DropsCritique
from thesis_lib.effects import EFFECTS

FEATURE_LABEL = {
    "v_t": "tangential velocity $v_t$",
    "v_n": "normal velocity $v_n$",
    "omega": r"angular velocity $\omega$",
    "r_x": "contact point $r_x$",
    "theta": r"body angle $\theta$",
    "x": "position $x$",
    "trial": "number of the release",
    "wall": "wall",
    "t": "time $t$",
    "y": "position $y$",
    "omega_t": r"spin along the slip $\omega_t$",
    "omega_b": r"spin across the slip $\omega_b$",
    "omega_n": r"spin about the normal $\omega_n$",
    "r_t": "contact point $r_t$",
    "r_b": "contact point $r_b$",
}
_NAMES = "mu epsilon eps phi theta omega eta zeta rho tau alpha beta gamma kappa"
GREEK: dict[str, str] = dict(zip(_NAMES.split(), "μεεφθωηζρταβγκ"))


def plain(label: str) -> str:
    """A label of a figure without its mathematical notation."""
    return label.replace("$", "").replace(r"\omega", "ω").replace(r"\theta", "θ")


def handy_unit(size: float, unit: str) -> tuple[float, str]:
    """Factor and unit for a length, an angle or a time of this size: below 0.1 in mm, mrad and ms."""
    small = unit in ("m", "rad", "s") and 0.0 < abs(size) < 0.1
    return (1e3, f"m{unit}") if small else (1.0, unit)


def symbol(name: str) -> str:
    """A parameter's name with Greek letters: c_mu as c_μ."""
    return "_".join(GREEK.get(part, part) for part in name.split("_"))


def law_title(name: str) -> str:
    """Title of a law, or its name if it has none."""
    return BASES[name].title if name in BASES else name


def effect_title(name: str) -> str:
    """Title of an effect, or its name if the effect is unknown."""
    return EFFECTS[name].title if name in EFFECTS else name.replace("_", " ")


def counted_from(name: str, reference: Mapping[str, float], found: Mapping[str, Mapping]) -> str:
    """Text on the origin of an effect, and on its places in coordinates of the dataset; "" if it has no origin.

    Example: "counted from x = 3.02 m, x_1 at x = 3.07 m".  `reference` and the parameters `found` as in diagnosis.json.
    """
    effect = EFFECTS.get(name)
    if effect is None or not reference:
        return ""
    words = {"x": "x = {:g} m", "y": "y = {:g} m", "t": "t = {:.12g} s", "trial": "release {:.0f}"}
    keys = [*effect.along, *(["y"] if "x" in effect.along and "y" in reference else [])]
    starts = [words[key].format(reference[key]) for key in keys]
    places = [
        f"{symbol(p.name)} at {words[p.along].format(reference[p.along] + found[p.name]['value'])}"
        for p in {p.name: p for p in (*effect.parameters, *effect.own_in_space)}.values()
        if p.along and p.name in found
    ]
    return ", ".join([f"counted from {' and '.join(starts)}", *places]) if starts else ""


def new_law(critique: DropsCritique, i: int) -> str:
    """Title of the law of the i-th model of the ladder if it differs from the model before, else ''."""
    before, here = (critique.ladder[j][1].model.law.name for j in (max(i - 1, 0), i))
    return law_title(here) if here != before else ""


def rung_title(critique: DropsCritique, i: int) -> str:
    """Label of the i-th model of the ladder: the base law, or the added effect and a change of law."""
    if i == 0:
        return law_title(critique.discovery.base)
    law = new_law(critique, i)
    return f"+ {effect_title(critique.ladder[i][0])}" + (f", law now {law}" if law else "")


def addition_title(one: Mapping) -> str:
    """Title of an effect or a law in `additions`."""
    return (effect_title if one["kind"] == "effect" else law_title)(one["name"])


def origin_text(one: Mapping) -> str:
    """The file or package from which one of `additions` came."""
    return one["file"] if "file" in one else f"the package {one['package']} {one.get('version', '')}".rstrip()
