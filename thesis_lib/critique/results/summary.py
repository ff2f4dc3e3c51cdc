"""The verdict and what to do, in a few sentences from the content of diagnosis.json.

Their order: certain and possible faults of the measurement, the verdict with the sizes of the missing effects, what to
do, motion that no impact law describes, impacts left out, effects that are only proxies for a cause, effects switched
on by hand without support in the data, single impacts with large errors.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from thesis_lib.contact.compliant.normal_force import NormalForce
from thesis_lib.critique.contacts.bases import BASES
from thesis_lib.critique.drops.words import AWAY, NAMED, feature_text, reasons_listed
from thesis_lib.critique.likelihood.channels import CHANNELS
from thesis_lib.critique.results.clock_and_size import said
from thesis_lib.critique.results.effect_sentences import (
    at_its_end,
    effects_found,
    faults,
    is_at_end,
    is_fault,
    named,
    rejected,
    sized,
    speed,
    stands_in,
    switched_on,
    what_to_do,
)
from thesis_lib.critique.results.titles import addition_title, origin_text
from thesis_lib.critique.selection.settings import SearchSettings, search_ended
from thesis_lib.datasets.flights.parabolas import bent_sentence
from thesis_lib.effects import EFFECTS
from thesis_lib.statistics.wording import bounded, listed

SEEN = 3.0  # a contact time so many standard errors above 0 is mentioned
BELOW = 0.9  # share of the noise floor; chance in some 50 impacts does not bring an error below it
ABOVE_NOISE = 1.25  # times the error of noise alone; mentioned from here on, even if too little for a verdict
UNRECORDED = (
    "Look for what changed from one to the next (the spot that was hit, its material, dirt, wear), and record it."
)
MUCH_LEFT_OUT = 0.2  # share of the impacts; if more are left out, the summary mentions it


def headline(content: Mapping, settings: SearchSettings) -> list[str]:
    """Sentences on the verdict and its data alone, for places with little room; arguments as for `summary`."""
    return [*faults(content), _judged(content, settings)[0], *_of_which_data(content)]


def _of_which_data(content: Mapping) -> list[str]:
    return [*content.get("remarks", ()), *_low_pass(content), *much_left_out(content)]


def summary(content: Mapping, settings: SearchSettings) -> list[str]:
    """All sentences of the summary; `content` is diagnosis.json without it, `settings` those of the critique."""
    found = effects_found(content)
    more = [*map(stands_in, [e for e in found if e["stand_in"]]), *said([e for e in found if not e["stand_in"]])]
    more += [*map(at_its_end, filter(is_at_end, found)), *map(rejected, content["rejected"])]
    more += [*_friction(content), *_contact_time(content), *switched_on(content), *_origins(content)]
    more += [*worst(content["error"]), *above_noise(content)]
    first = [*faults(content), *_judged(content, settings), *_of_which_data(content)]
    return [*first, *more, *search_ended(content["search"], "critique.settings")]


def _judged(content: Mapping, settings: SearchSettings) -> list[str]:
    """The verdict in a sentence, and what to do."""
    of_verdict = {"adequate": _adequate, "effects": _effects, "unexplained": _unexplained}
    first, *others = of_verdict[content["verdict"]](content, _fall(content, settings))
    return [first[0].upper() + first[1:], *others]


def above_noise(content: Mapping) -> list[str]:
    """Sentence on errors that exceed the noise but are too small to affect the verdict."""
    error, far = content["error"], content["remaining"]["channels"]
    floor = error["noise_floor"]
    ratios = {} if error["worst"] or not floor else {"impact": error["augmented"] / floor}
    ratios |= {name: error[name]["augmented"] for name in CHANNELS if error.get(name)}
    small = [
        f"{CHANNELS[name].short} ({ratio:.2g} times)"
        for name, ratio in ratios.items()
        if np.isfinite(ratio) and ratio >= ABOVE_NOISE and name not in far
    ]
    if not small:
        return []
    return [f"More than noise, though less than counts as unexplained, is left in {listed(small)}."]


def _is_sound(content: Mapping) -> bool:
    """Whether no remaining error casts doubt on the parameters of the final model.

    The remaining error of a law alone may be significant yet too small to matter; beside effects it may be theirs.
    """
    rest, effects = content["remaining"], content["effects"]
    doubtful = rest.get("significant") and bool(effects)
    return not (rest["structured"] or doubtful or any(map(is_at_end, effects)))


def _low_pass(content: Mapping) -> list[str]:
    if "low_pass" not in content:
        return []
    cutoff = content["low_pass"]["cutoff"]
    return [
        f"The samples were smoothed by a low-pass filter of about {cutoff['value']:.0f} Hz (± {cutoff['std']:.0f} Hz); "
        "distorted samples are not used, so the filter is not mistaken for a long contact, but short flights are lost."
    ]


def much_left_out(content: Mapping) -> list[str]:
    """Sentences on the impacts and flights that were left out, if these are many."""
    share, flights = content["left_out"]["share"], content["left_out"].get("flights", {"bent": 0, "n": 0})
    bent = [text] if (text := bent_sentence(flights["bent"], flights["n"])) else []
    if share <= MUCH_LEFT_OUT:
        return bent
    why = reasons_listed({name: n for name, n in content["left_out"]["reasons"].items() if name not in AWAY})
    said = "the verdict holds" if content["verdict"] else "all holds"
    return [f"{100 * share:.0f} % of the detected impacts were left out ({why}), so {said} for the others only.", *bent]


def _adequate(content: Mapping, _: str) -> list[str]:
    error, law = content["error"], _law(content, "base_model")
    most = " for most impacts" if error["worst"] else ""
    if effects_found(content, clears=False):
        # no other effect was tried, so nothing is known about the others
        return [
            f"{law} is adequate{most} as far as was tested: its held-out error is {speed(error['base'])}"
            f"{_floor(error)}, and effects other than those that you chose were not tried."
        ]
    if not content["search"]["tried"]:
        return [f"The held-out error of {law} is {speed(error['base'])}{_floor(error)}; no effect was tried."]
    nothing = "" if above_noise(content) else "Nothing needs to be added; "
    return [
        f"{law} is adequate{most}: no effect in the library lowers its held-out error of {speed(error['base'])}"
        f"{_floor(error)} by an amount that matters.",
        f"{nothing}{'the' if nothing else 'The'} report lists how small an effect these data could have shown.",
    ]


def _effects(content: Mapping, fall: str) -> list[str]:
    law, then, found = _law(content, "base_model"), _law(content, "augmented_model"), effects_found(content)
    physics = [e for e in found if not is_fault(e)]
    if physics:
        many = any(len(e["indistinguishable_from"]) > NAMED for e in physics)
        lacks = "leaves something out, but these data do not show what" if many else "leaves out"
        first = f"{law} {lacks}: {sized(physics)}; {_with(content, found)} {fall}."
    else:
        most = "describes most impacts" if content["error"]["worst"] else "is enough"
        first = f"With this put right, {then} {most}: {fall}."
    if not any(e["indistinguishable_from"] for e in found):
        if not _is_sound(content):
            rest = content["remaining"]
            left = "The remaining error still depends on the state before impact "
            left += f"(p = {rest['p_value']:.2g}), though by too little to matter."
            first_of_all = "Try model.json on drops of your own before you use it for predictions."
            return [first, *[left] * rest["significant"], first_of_all]
        if any((e.get("could_be") or {}).get("causes") for e in found):
            return [first, "Find out which of the possible causes it is before you use model.json for predictions."]
        return [first, what_to_do(found)]
    if content["next_experiment"]["states"]:
        return [first, "To tell the named candidates apart, measure at the states listed under the next experiment."]
    return [first, "The next experiment describes how to tell the named candidates apart."]


def _unexplained(content: Mapping, fall: str) -> list[str]:
    error, remaining, found = content["error"], content["remaining"], effects_found(content)
    physics = [named(e) for e in found if not is_fault(e) and not e["stand_in"]]
    replaced = [EFFECTS[e["name"]].title for e in found if e["stand_in"]]
    beyond = f"; its held-out error is {speed(error['base'])}{_floor(error)}"
    if found:
        besides = listed(physics) or ("that fault" if any(is_fault(e) and not e["stand_in"] for e in found) else "")
        taken = f"with {listed(replaced)} as a stand-in" if len(replaced) == len(found) else _with(content, found)
        beyond = f"{besides and f' beyond {besides}'}; {taken} {fall}"
    if remaining.get("elsewhere") and not remaining["structured"]:
        besides = f" with {listed([named(e) for e in found])}" if found else ""
        model, left = _law(content, "augmented_model"), f"{speed(error['augmented'])}{_floor(error)}"
        return [
            struck_elsewhere(remaining["elsewhere"]),
            f"For the other hits {model}{besides} holds, with a held-out error of {left}.",
            "Look at the videos of these trials, and leave them out or record what was hit.",
        ]
    if remaining.get("stays_down") and not remaining["structured"]:
        limit = speed(remaining["stays_down"]["speed"])
        besides = f", with {listed([named(e) for e in found])}," if found else ""
        return [
            f"{_law(content, 'augmented_model')}{besides} holds for the impacts that rebound, with a held-out error of "
            f"{speed(error['augmented'])}{_floor(error)}, but for none below {limit}: no law or effect in the library "
            "has a restitution that vanishes below a speed."
        ]
    tried = content["search"]["tried"]
    misses = f"{_law(content, 'base_model')} misses something"
    if not tried:
        sentences = [f"{misses}, and no effect was tried{beyond}."]
    elif effects_found(content, clears=False):
        sentences = [f"{misses} that your choice of effects does not explain{beyond}."]
    else:
        sentences = [f"{misses} that no effect in the library explains{beyond}."]
    channels = [CHANNELS[name].text for name in remaining["channels"] if name != "impact"]
    if channels:
        sentences.append(f"Far more than noise is left in {listed(channels)}.")
    if replaced and not remaining["structured"]:
        again = listed(sorted({e["stand_in"]["denies"] for e in found if e["stand_in"]}))
        return [*sentences, f"Measure the {again} again, or look for another cause that acts on these impacts."]
    if remaining.get("energy_gain"):
        return [*sentences, "The remaining error may come from energy gained at impacts alone: correct that first."]
    if remaining["restitution"]:
        return [*sentences, restitution_differs(remaining["restitution"]), UNRECORDED]
    if not tried:
        return [*sentences, "Let the critique look for the effect that is missing."]
    on = listed([f"the {feature_text(name)}" for name in remaining["depends_on"]])
    if remaining.get("elsewhere"):
        sentences.append(struck_elsewhere(remaining["elsewhere"]))
    sentences.append(
        (f"The remaining error depends on {on}: look there" if on else "Search the remaining error")
        + " for a cause that is not in the library, or learn it as a residual."
    )
    return sentences


def struck_elsewhere(hits: Mapping) -> str:
    """Sentence on hits on an object other than the surface."""
    shown = [f"trial {one['trial']} at {one['t']:.3f} s" for one in hits["first"]]
    more = hits["hits"] - len(shown)
    return (
        f"In {hits['trials']} of {hits['of']} trials the body is hit by something that is not the surface, a hand or "
        f"another object: {listed([*shown, f'{more} more'] if more else shown)}."
    )


def restitution_differs(differs: Mapping) -> str:
    """Sentence on restitution that differs between trials or impacts without an effect that explains it."""
    low, high, by = f"{differs['low']:.2f}", f"{differs['high']:.2f}", differs["differs_by"]
    return f"Restitution ({low} to {high}) differs from {by} to {by} but depends on nothing that is recorded."


def _contact_time(content: Mapping) -> list[str]:
    model = content["augmented_model"]
    if not _is_sound(content):
        return []  # it may have compensated for a missing effect
    tau, epsilon = (model["parameters"].get(name, {"value": 0.0, "std": 0.0}) for name in ("tau", "epsilon"))
    if tau["std"] is None or tau["value"] <= SEEN * tau["std"]:
        return []
    per_tau = (BASES[model["name"]].force or NormalForce()).lasting(epsilon["value"])
    value, std = per_tau * 1e3 * tau["value"], per_tau * 1e3 * tau["std"]
    return [f"Contacts last about {value:.2g} ms (standard error {std:.1g} ms), which the model takes into account."]


def _friction(content: Mapping) -> list[str]:
    """Sentence on friction if no impact still slips at its end."""
    mu = content["augmented_model"]["parameters"]["mu"]
    if mu.get("bound") != "lower" or mu["value"] <= mu["range"][0]:
        return []
    return [
        f"No impact still slips at its end, so friction has only a bound: mu {bounded(mu)}, the largest ratio of "
        "impulses; beyond it, predictions stick."
    ]


def _origins(content: Mapping) -> list[str]:
    """Sentences with the origin of named laws and effects that are not part of the library."""
    named = {("law", content[key]["name"]) for key in ("base_model", "augmented_model")}
    for effect in content["effects"]:
        named |= {("effect", name) for name in (effect["name"], *effect["indistinguishable_from"])}
    told = [one for one in content.get("additions", ()) if (one["kind"], one["name"]) in named]
    return [f"“{addition_title(one)}” is not part of the library but from {origin_text(one)}." for one in told]


def worst(error: Mapping) -> list[str]:
    """Sentence on single impacts with large errors, if these and not the median raise the mean above the noise."""
    if not error["worst"]:
        return []
    at = ["" if r["t"] is None or np.isnan(r["t"]) else f" at {r['t']:.3f} s" for r in error["worst"]]
    rows = [f"trial {r['trial']}{when} ({speed(r['error'])})" for r, when in zip(error["worst"], at)]
    times = error["augmented"] / error["noise_floor"]
    return [
        f"The mean held-out error is {times:.2g} times the noise floor, but half of the impacts lie near it: single "
        f"impacts are predicted badly, the worst in {listed(rows)}; check their samples and, if these are sound, in "
        "what these impacts differ from the others."
    ]


def _with(content: Mapping, found: Sequence[Mapping]) -> str:
    """The words “with it” or “with all of it”, and the law if it changes."""
    taken = "with it" if len(found) == 1 else "with all of it"
    law, then = _law(content, "base_model"), _law(content, "augmented_model")
    return taken if law == then else f"{taken}, and {then} as the law,"


def _fall(content: Mapping, settings: SearchSettings) -> str:
    """Clause on the change of the held-out errors, material changes first."""
    error = content["error"]
    ends = f"{settings.change(error['base'], error['augmented'], error['noise_floor'], speed)}{_floor(error)}"
    shown = {channel for effect in effects_found(content) for channel in effect["material_in"]}
    falls = [
        f"of {CHANNELS[name].short} {settings.change(m['base'], m['augmented'], 1.0, '{:.3g}'.format)}"
        for name in CHANNELS
        if name in shown and (m := error.get(name)) and settings.matters(m["base"], m["augmented"], 1.0)
    ]
    if not falls:
        return f"the held-out error {ends}"
    misfits = f"the misfit {listed(falls, 'and that')} standard deviations of noise"
    if "impact" in shown:
        return f"the held-out error {ends}, and {misfits}"
    return f"{misfits}, while the held-out error of the velocity after impact {ends}"


def _law(content: Mapping, key: str) -> str:
    return BASES[content[key]["name"]].title


def _floor(error: Mapping) -> str:
    floor = error["noise_floor"]
    if floor is None or not np.isfinite(floor):
        return " (noise unknown)"
    if error["augmented"] < BELOW * floor:
        return f" (below the noise floor, estimated as {speed(floor)})"
    return f" (noise floor {speed(floor)})"
