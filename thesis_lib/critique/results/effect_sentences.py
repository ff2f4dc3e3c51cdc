"""Sentences on single effects of diagnosis.json: their names and sizes, and objections to them."""

import math
from collections.abc import Mapping

from thesis_lib.critique.drops.words import alternatives_listed
from thesis_lib.critique.likelihood.channels import CHANNELS
from thesis_lib.critique.results.titles import handy_unit
from thesis_lib.effects import EFFECTS
from thesis_lib.effects.effect import parameters_in
from thesis_lib.mechanics.space import SPACE
from thesis_lib.statistics.wording import bounded, ends, estimate, formatted, listed, number

MOST_SIZES = 3  # in a sentence; the table has all of them


def effects_found(content: Mapping, clears: bool = True) -> list[Mapping]:
    """Effects that pass all tests or, without `clears`, those switched on by hand that fail one."""
    return [effect for effect in content["effects"] if effect["clears"] == clears]


def is_fault(effect: Mapping) -> bool:
    """Whether an effect is a fault of the measurement."""
    return effect["family"] == "measurement"


def is_at_end(effect: Mapping) -> bool:
    """Whether the data only bound the size of an effect."""
    return bool(_ends(effect))


def _ends(effect: Mapping) -> list[str]:
    of = EFFECTS[effect["name"]]
    open_end = {p.name for p in (*of.parameters, *of.own_in_space) if p.open_end}
    return [name for name, p in effect["parameters"].items() if p.get("bound") and name not in open_end]


def sizes(effect: Mapping) -> str:
    """Parameters that differ from their null values, with 95 % intervals: c_x = 0.498 (0.491 to 0.505) mm.

    The `MOST_SIZES` most certain ones; bounds, places and choices are not sizes.  "" if there is none.
    """
    of = EFFECTS[effect["name"]]
    declared = (*of.parameters, *parameters_in(of, SPACE))
    nulls = {p.name: p.null for p in declared if p.discrete is None and not p.along and not p.of}
    certain = {}
    for name, found in effect["parameters"].items():
        value, std = found["value"], found.get("std")
        if name not in nulls or found.get("bound") or not std or not math.isfinite(std):
            continue
        low, high = ends(value, std)
        if not low <= nulls[name] <= high:
            certain[name] = abs(value - nulls[name]) / std
    chosen = sorted(certain, key=lambda name: -certain[name])[:MOST_SIZES]
    said = []
    for name in filter(chosen.__contains__, certain):
        found = effect["parameters"][name]
        factor, unit = handy_unit(found["value"], found["unit"])
        size = estimate(factor * found["value"], factor * found["std"])
        said.append(f"{name} = {size}{f' {unit}' * (unit != '1')}")
    return listed(said)


def speed(value: float) -> str:
    """Text of a speed in m/s, with its unit."""
    return f"{value:.3g} m/s"


def at_its_end(effect: Mapping) -> str:
    """Sentence on an effect with a parameter at a limit of its plausible range."""
    ends = listed([f"{name} {bounded(effect['parameters'][name])}" for name in _ends(effect)])
    return (
        f"“{EFFECTS[effect['name']].title}” is at an end of its range ({ends}), so it may stand in for another cause."
    )


def unseen(effect: Mapping) -> str:
    """Sentence on parameters that these data cannot determine; "" if there are none."""
    said = []
    for direction in effect.get("unseen", ()):
        terms = [(formatted(part, "+.2f"), name) for name, part in zip(effect["parameters"], direction)]
        seen = [(part, name) for part, name in terms if part.strip("+0.")]
        said.append(seen[0][1] if len(seen) == 1 else " ".join(" ".join(term) for term in seen).removeprefix("+"))
    return f"These data cannot determine {listed(said)}, which is held at 0." if said else ""


def rejected(effect: Mapping) -> str:
    """Sentence on why an effect found on the training trials is left out."""
    rises = [
        f"{CHANNELS[name].short} from {number(one['ends'][0])} to {number(one['ends'][1])} "
        + ("m/s" if one["unit"] == "m/s" else "standard deviations of noise")
        for name, one in effect["rises"].items()
    ]
    does = f"raises the error of {listed(rises)} on" if rises else "lowers no error by an amount that matters on"
    title = EFFECTS[effect["name"]].title
    return f"“{title}” was found on the training trials, but {does} the held-out ones, so it is left out."


def stands_in(effect: Mapping) -> str:
    """Sentence on why an effect is not the cause, or may not be."""
    why, title = effect["stand_in"], EFFECTS[effect["name"]].title
    if why.get("explains") is not None:
        return (
            f"“{title}” may only stand in for the missing cause: of the errors that it lowers, the model explains "
            f"{100 * why['explains']:.0f} % of what exceeds the noise."
        )
    said = f"“{title}” stands in for something else: it contradicts the stated {why['denies']} by "
    said += f"{why['standard_errors']:.2g} standard errors"
    if not why["instead"]:
        return f"{said}, so the cause is not among the effects found here."
    names = alternatives_listed([EFFECTS[name].title for name in why["instead"]])
    return f"{said}; these data cannot tell it from “{names}”, which contradicts nothing that is stated."


def possible_faults(effect: Mapping) -> list[str]:
    """Measurement effects that the data cannot tell from `effect`; none if it is one itself."""
    if is_fault(effect):
        return []
    return [n for n in effect["indistinguishable_from"] if n in EFFECTS and EFFECTS[n].family == "measurement"]


def faults(content: Mapping) -> list[str]:
    """Faults of the measurement, and effects that may be such faults."""
    found, sentences = effects_found(content), []
    if measured := [effect for effect in found if is_fault(effect) and not effect["stand_in"]]:
        doubtful = any(EFFECTS[n].family != "measurement" for e in measured for n in e["indistinguishable_from"])
        sentences.append(
            f"The measurements {'may be' if doubtful else 'look'} faulty: {sized(measured)}; "
            "correct the camera or its calibration before reading anything else here as physics."
        )
    for effect in found:
        if not effect["stand_in"] and (names := possible_faults(effect)):
            sentences.append(
                f"The measurements may be faulty: these data cannot tell “{EFFECTS[effect['name']].title}” from "
                f"“{alternatives_listed([EFFECTS[name].title for name in names])}”; rule that out before reading it "
                "as physics."
            )
    return sentences


def switched_on(content: Mapping) -> list[str]:
    """Sentence on effects that were switched on by hand but fail a test."""
    if not (by_hand := effects_found(content, clears=False)):
        return []
    names = listed([EFFECTS[e["name"]].title for e in by_hand])
    it, error = "them" if len(by_hand) > 1 else "it", content["error"]
    whys = {why_not(e, it) for e in by_hand}
    why = whys.pop() if len(whys) == 1 else listed([f"{EFFECTS[e['name']].title}: {why_not(e)}" for e in by_hand])
    change = f": with {it} the held-out error is {speed(error['augmented'])}, without {speed(error['base'])}"
    if effects_found(content):  # other effects share in the change of the error
        change = ""
    return [f"Switched on by you: {names}; {why}{change}."]


def why_not(effect: Mapping, it: str = "it") -> str:
    """Reason why an effect that was switched on by hand is not among the effects found."""
    return {
        "chance": f"these data do not support {it}",
        "immaterial": f"these data show {it}, but no error falls by an amount that matters",
        "spoils": f"with {it} another error rises by an amount that matters",
    }[effect.get("fails") or "chance"]


def sized(effects: list[Mapping]) -> str:
    """Names of effects, each with its size."""
    return listed([f"{named(e)}{size and f', {size}'}" for e in effects for size in [sizes(e)]])


def what_to_do(effects: list[Mapping]) -> str:
    """Sentence on what to do about the effects found."""
    wrong = list(dict.fromkeys(EFFECTS[e["name"]].denies for e in effects))
    # in the plane, poses are those of the centre of mass, and dataset.yaml has no key for its displacement
    nowhere = any(e["name"] == "com_offset" and "c_z" not in e["parameters"] for e in effects)
    if all(wrong) and wrong:
        written = [what for what in wrong if not nowhere or what != EFFECTS["com_offset"].denies]
        also = " and" if written == wrong else f", the {listed(written)} also"
        file = f"{also} in dataset.yaml" if written else ""
        later = ", give --effect com_offset with further drops" if nowhere else ""
        return f"Correct the {listed(wrong)} in your simulator{file}{later}, or use model.json for predictions."
    return "Use model.json, which holds all of this, for predictions, or export it to your simulator."


def named(effect: Mapping) -> str:
    """Title of an effect, with the other effects that it may be instead."""
    of = EFFECTS[effect["name"]]
    found, declared = effect["parameters"], (*of.parameters, *of.own_in_space)
    chosen = [p.said(found[p.name]["value"]) for p in declared if p.words and p.name in found]
    title = f"{of.title}: {listed(chosen)}" if chosen else of.title
    if (effect.get("stand_in") or {}).get("instead"):
        likely = [EFFECTS[name].title for name in effect["stand_in"]["instead"]]
        return f"{alternatives_listed(likely)} (fitted as {title})"
    others = [EFFECTS[name].title for name in effect["indistinguishable_from"]]
    return title + (f" (or {alternatives_listed(others)}, which these data cannot tell apart)" if others else "")
