"""The verdict and what to do, in a few sentences from the content of diagnosis.json.

Their order: what the body does that no impact law does, faults of the measurement and possible ones, impacts left out,
the verdict, effects that only stand in for a cause, effects switched on by hand without support in the data, single
impacts with large errors, and what to do next.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from thesis_lib.contact.compliant.normal_force import NormalForce
from thesis_lib.critique.contacts.bases import BASES
from thesis_lib.critique.drops.words import NAMED, OFF_WALL, alternatives_listed, feature_text, reasons_listed
from thesis_lib.critique.likelihood.channels import CHANNELS
from thesis_lib.critique.results.clock_and_size import said
from thesis_lib.critique.selection.settings import SearchSettings, search_ended
from thesis_lib.datasets.flights.parabolas import bent_sentence
from thesis_lib.effects import EFFECTS
from thesis_lib.statistics.wording import bounded, listed, number

SEEN = 3.0  # standard errors above 0 of a contact time that the summary mentions
BELOW = 0.9  # of the noise floor: an error that is smaller than chance in some 50 impacts makes it
ABOVE_NOISE = 1.25  # times the error of noise alone: said, be it too little for a verdict
UNRECORDED = (
    "Look for what changed from one to the next (the spot that was hit, its material, dirt, wear), and record it."
)
MUCH_LEFT_OUT = 0.2  # share of the impacts above which the summary mentions it


def summary(content: Mapping) -> list[str]:
    """Sentences for a reader; `content` is diagnosis.json without its summary."""
    clearing = [e for e in content["effects"] if e["clears"]]
    by_hand = [e for e in content["effects"] if not e["clears"]]
    faults = [e for e in clearing if e["family"] == "measurement"]
    sentences = [*content.get("remarks", ()), *_low_pass(content), *_faults(clearing, faults), *much_left_out(content)]
    verdict = {"adequate": _adequate, "effects": _effects, "unexplained": _unexplained}[content["verdict"]]
    first, *rest = verdict(content, clearing, faults, by_hand)
    more = [*map(stands_in, [e for e in clearing if e["stand_in"]])]
    more += said([e for e in clearing if not e["stand_in"]])
    more += [*map(at_its_end, filter(is_at_end, clearing)), *map(rejected, content["rejected"])]
    more += [*_friction(content), *_contact_time(content), *_by_hand(content, clearing, by_hand)]
    rest = [*above_noise(content), *rest, *search_ended(content["search"], "critique.settings")]
    return [*sentences, first, *more, *_origins(content), *_worst(content["error"]), *rest]


def at_its_end(effect: Mapping) -> str:
    """What is said of an effect that would grow beyond the values that are believed possible."""
    ends = listed([f"{name} {bounded(p)}" for name, p in effect["parameters"].items() if p.get("bound")])
    return (
        f"“{EFFECTS[effect['name']].title}” is at an end of its range ({ends}), so it may stand in for another cause."
    )


def rejected(effect: Mapping) -> str:
    """Why an effect that was found on the training trials is left out, as a sentence."""
    rises = [
        f"{CHANNELS[name].short} from {number(one['ends'][0])} to {number(one['ends'][1])} "
        + ("m/s" if one["unit"] == "m/s" else "standard deviations of noise")
        for name, one in effect["rises"].items()
    ]
    does = f"raises the error of {listed(rises)} on" if rises else "lowers no error by an amount that matters on"
    title = EFFECTS[effect["name"]].title
    return f"“{title}” was found on the training trials, but {does} the held-out ones, so it is left out."


def above_noise(content: Mapping) -> list[str]:
    """Errors that are more than noise, but too small for a verdict."""
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


def is_at_end(effect: Mapping) -> bool:
    """Whether the data only bound the size of an effect."""
    return any(p.get("bound") for p in effect["parameters"].values())


def _is_sound(content: Mapping) -> bool:
    """Whether nothing that is left speaks against the numbers of the final model.

    What is left in a law alone is significant now and then, and too small to matter; beside effects it may be theirs.
    """
    rest, effects = content["remaining"], content["effects"]
    doubtful = rest.get("significant") and bool(effects)
    return not (rest["structured"] or doubtful or any(map(is_at_end, effects)))


def stands_in(effect: Mapping) -> str:
    """Why an effect is no cause, as a sentence."""
    why, title = effect["stand_in"], EFFECTS[effect["name"]].title
    said = f"“{title}” stands in for something else: it contradicts the stated {why['denies']} by "
    said += f"{why['standard_errors']:.2g} standard errors"
    if not why["instead"]:
        return f"{said}, so its cause has no name here."
    names = alternatives_listed([EFFECTS[name].title for name in why["instead"]])
    return f"{said}; these data cannot tell it from “{names}”, which contradicts nothing that is stated."


def possible_faults(effect: Mapping) -> list[str]:
    """Measurement effects that the data cannot tell from `effect`; none if it is one itself."""
    if effect["family"] == "measurement":
        return []
    return [n for n in effect["indistinguishable_from"] if n in EFFECTS and EFFECTS[n].family == "measurement"]


def _faults(found: Sequence[Mapping], faults: Sequence[Mapping]) -> list[str]:
    sentences = []
    if faults:
        doubtful = any(EFFECTS[n].family != "measurement" for e in faults for n in e["indistinguishable_from"])
        sentences.append(
            f"The measurements {'may be' if doubtful else 'look'} faulty: {listed([_named(e) for e in faults])}; "
            "correct the camera or its calibration before reading anything else here as physics."
        )
    for effect in found:
        if names := possible_faults(effect):
            sentences.append(
                f"The measurements may be faulty: these data cannot tell “{EFFECTS[effect['name']].title}” from "
                f"“{alternatives_listed([EFFECTS[name].title for name in names])}”; rule that out before reading it "
                "as physics."
            )
    return sentences


def _low_pass(content: Mapping) -> list[str]:
    if "low_pass" not in content:
        return []
    cutoff = content["low_pass"]["cutoff"]
    return [
        f"The samples were smoothed by a low-pass filter of about {cutoff['value']:.0f} Hz (± {cutoff['std']:.0f} Hz); "
        "those that it rounded are not used, so it does not pass for a long contact, but it costs the shorter flights."
    ]


def much_left_out(content: Mapping) -> list[str]:
    """How many impacts and flights were left out, if these are many."""
    share, flights = content["left_out"]["share"], content["left_out"].get("flights", {"bent": 0, "n": 0})
    bent = [text] if (text := bent_sentence(flights["bent"], flights["n"])) else []
    if share <= MUCH_LEFT_OUT:
        return bent
    why = reasons_listed({name: n for name, n in content["left_out"]["reasons"].items() if name != OFF_WALL})
    said = "the verdict holds" if content["verdict"] else "all holds"
    return [f"{100 * share:.0f} % of the detected impacts were left out ({why}), so {said} for the others only.", *bent]


def _adequate(content: Mapping, found: Sequence, faults: Sequence, by_hand: Sequence) -> list[str]:
    error, law = content["error"], _law(content, "base_model")
    most = " for most impacts" if error["worst"] else ""
    if by_hand:
        # no other effect was tried, so that nothing is known about them
        return [
            f"{law} is adequate{most} as far as was tested: its held-out error is {_speed(error['base'])}"
            f"{_floor(error)}, and other effects than those that you chose were not tried."
        ]
    nothing = "" if above_noise(content) else "Nothing needs to be added; "
    return [
        f"{law} is adequate{most}: no effect in the library lowers its held-out error of {_speed(error['base'])}"
        f"{_floor(error)} by an amount that matters.",
        f"{nothing}{'the' if nothing else 'The'} report lists how small an effect these data could have shown.",
    ]


def _effects(content: Mapping, found: Sequence, faults: Sequence, by_hand: Sequence) -> list[str]:
    law, then = _law(content, "base_model"), _law(content, "augmented_model")
    physics, fall = [e for e in found if e not in faults], _fall(content, found)
    if physics:
        many = any(len(e["indistinguishable_from"]) > NAMED for e in physics)
        lacks = "leaves something out, and these data cannot tell what" if many else "leaves out"
        first = f"{law} {lacks}: {listed([_named(e) for e in physics])}; {_with(content, found)} {fall}."
    else:
        most = "describes most impacts" if content["error"]["worst"] else "is enough"
        first = f"With this put right, {then} {most}: {fall}."
    if not any(e["indistinguishable_from"] for e in found):
        if not _is_sound(content):
            rest = content["remaining"]
            left = "What is left still depends on the state before impact "
            left += f"(p = {rest['p_value']:.2g}), though by too little to matter."
            first_of_all = "Try model.json on drops of your own before you use it for predictions."
            return [first, *[left] * rest["significant"], first_of_all]
        if any((e.get("could_be") or {}).get("causes") for e in found):
            return [first, "Find out which of its causes it is before you use model.json for predictions."]
        return [first, "Use model.json, which holds all of this, for predictions."]
    if content["next_experiment"]["states"]:
        return [first, "To tell the named candidates apart, measure at the states listed under the next experiment."]
    return [first, "What would tell the named candidates apart stands under the next experiment."]


def _unexplained(content: Mapping, found: Sequence, faults: Sequence, by_hand: Sequence) -> list[str]:
    error, remaining = content["error"], content["remaining"]
    physics = [_named(e) for e in found if e not in faults and not e["stand_in"]]
    replaced = [EFFECTS[e["name"]].title for e in found if e["stand_in"]]
    beyond = f"; its held-out error is {_speed(error['base'])}{_floor(error)}"
    if found:
        besides = listed(physics) or ("that fault" if faults else "")
        taken = f"with {listed(replaced)} as a stand-in" if len(replaced) == len(found) else _with(content, found)
        beyond = f"{besides and f' beyond {besides}'}; {taken} {_fall(content, found)}"
    if remaining.get("stays_down") and not remaining["structured"]:
        speed = _speed(remaining["stays_down"]["speed"])
        besides = f", with {listed([_named(e) for e in found])}," if found else ""
        return [
            f"{_law(content, 'augmented_model')}{besides} holds for the impacts that rebound, with a held-out error of "
            f"{_speed(error['augmented'])}{_floor(error)}, and for none below {speed}: no law or effect of the library "
            "has a restitution that ends at a speed."
        ]
    tried = "that your choice of effects does not explain" if by_hand else "that no effect in the library explains"
    sentences = [f"{_law(content, 'base_model')} misses something {tried}{beyond}."]
    channels = [CHANNELS[name].text for name in remaining["channels"] if name != "impact"]
    if channels:
        sentences.append(f"Far more than noise is left in {listed(channels)}.")
    if replaced and not remaining["structured"]:
        again = listed(sorted({e["stand_in"]["denies"] for e in found if e["stand_in"]}))
        return [*sentences, f"Measure the {again} again, or look for what acts in its place on these impacts."]
    if remaining.get("energy_gain"):
        return [*sentences, "What is left may be nothing else than the energy that impacts add: mend that first."]
    if remaining["restitution"]:
        return [*sentences, restitution_differs(remaining["restitution"]), UNRECORDED]
    on = listed([f"the {feature_text(name)}" for name in remaining["depends_on"]])
    sentences.append(
        (f"What is left depends on {on}: look there" if on else "Look at what is left")
        + " for a cause that the library does not hold, or learn it as a residual."
    )
    return sentences


def restitution_differs(differs: Mapping) -> str:
    """What is known of restitution that is no number."""
    low, high, by = f"{differs['low']:.2f}", f"{differs['high']:.2f}", differs["differs_by"]
    return f"Restitution ({low} to {high}) differs from {by} to {by} and with nothing that is recorded."


def _contact_time(content: Mapping) -> list[str]:
    model = content["augmented_model"]
    if not _is_sound(content):
        return []  # it may have made up for what is missing
    tau, epsilon = (model["parameters"].get(name, {"value": 0.0, "std": 0.0}) for name in ("tau", "epsilon"))
    if tau["std"] is None or tau["value"] <= SEEN * tau["std"]:
        return []
    force = BASES[model["name"]].force or NormalForce()
    loss = force.loss(np.asarray(epsilon["value"]))
    per_tau = float(force.duration(loss) / force.centroid(loss))
    value, std = per_tau * 1e3 * tau["value"], per_tau * 1e3 * tau["std"]
    return [f"Contacts last about {value:.2g} ms (standard error {std:.1g} ms), which the model takes into account."]


def _friction(content: Mapping) -> list[str]:
    """What no slip says of friction."""
    mu = content["augmented_model"]["parameters"]["mu"]
    if mu.get("bound") != "lower" or mu["value"] <= mu["range"][0]:
        return []
    return [
        f"No impact goes on slipping, so the data give only a bound of friction: mu {bounded(mu)}, the largest ratio "
        "of impulses; predictions stick beyond it."
    ]


def _by_hand(content: Mapping, found: Sequence[Mapping], by_hand: Sequence[Mapping]) -> list[str]:
    if not by_hand:
        return []
    names = listed([EFFECTS[e["name"]].title for e in by_hand])
    it, error = "them" if len(by_hand) > 1 else "it", content["error"]
    whys = {why_not(e, it) for e in by_hand}
    why = whys.pop() if len(whys) == 1 else listed([f"{EFFECTS[e['name']].title}: {why_not(e)}" for e in by_hand])
    change = f": with {it} the held-out error is {_speed(error['augmented'])}, without {_speed(error['base'])}"
    if found:  # other effects share in the change of the error
        change = ""
    return [f"Switched on by you: {names}; {why}{change}."]


def why_not(effect: Mapping, it: str = "it") -> str:
    """Why an effect that was switched on by hand is not among those that were found."""
    return {
        "chance": f"these data do not ask for {it}",
        "immaterial": f"{it} can be seen, but no error falls by an amount that matters",
        "spoils": f"with {it} another error rises by an amount that matters",
    }[effect.get("fails") or "chance"]


def _origins(content: Mapping) -> list[str]:
    """What of the verdict is not the library's, and where it is from."""
    named = {("law", content[key]["name"]) for key in ("base_model", "augmented_model")}
    for effect in content["effects"]:
        named |= {("effect", name) for name in (effect["name"], *effect["indistinguishable_from"])}
    told = [one for one in content.get("additions", ()) if (one["kind"], one["name"]) in named]
    return [f"“{addition_title(one)}” is not of the library but from {origin_text(one)}." for one in told]


def addition_title(one: Mapping) -> str:
    """Title of an effect or a law in `additions`."""
    library: Mapping = EFFECTS if one["kind"] == "effect" else BASES
    return library[one["name"]].title if one["name"] in library else one["name"]


def origin_text(one: Mapping) -> str:
    """The file or package from which one of `additions` came."""
    return one["file"] if "file" in one else f"the package {one['package']} {one.get('version', '')}".rstrip()


def _worst(error: Mapping) -> list[str]:
    if not error["worst"]:
        return []
    at = ["" if r["t"] is None or np.isnan(r["t"]) else f" at {r['t']:.3f} s" for r in error["worst"]]
    rows = [f"trial {r['trial']}{when} ({_speed(r['error'])})" for r, when in zip(error["worst"], at)]
    times = error["augmented"] / error["noise_floor"]
    return [
        f"The mean held-out error is {times:.2g} times the noise floor though half of the impacts lie near it: single "
        f"impacts go wrong, the worst in {listed(rows)}; look at their samples, and if these are sound, at what sets "
        "these impacts apart."
    ]


def _with(content: Mapping, found: Sequence[Mapping]) -> str:
    """With it / with all of it, and with which law."""
    taken = "with it" if len(found) == 1 else "with all of it"
    law, then = _law(content, "base_model"), _law(content, "augmented_model")
    return taken if law == then else f"{taken}, and {then} as the law,"


def _fall(content: Mapping, found: Sequence[Mapping]) -> str:
    """Change of the misfits, those with a material change first."""
    error = content["error"]
    settings = SearchSettings()
    ends = f"{settings.change(error['base'], error['augmented'], error['noise_floor'], _speed)}{_floor(error)}"
    shown = {channel for effect in found for channel in effect["material_in"]}
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
        return f" (below the noise floor, estimated as {_speed(floor)})"
    return f" (noise floor {_speed(floor)})"


def _named(effect: Mapping) -> str:
    title = EFFECTS[effect["name"]].title
    if effect["stand_in"] and effect["stand_in"]["instead"]:
        likely = [EFFECTS[name].title for name in effect["stand_in"]["instead"]]
        return f"{alternatives_listed(likely)} (fitted as {title})"
    others = [EFFECTS[name].title for name in effect["indistinguishable_from"]]
    return title + (f" (or {alternatives_listed(others)}, which these data cannot tell apart)" if others else "")


def _speed(value: float) -> str:
    return f"{value:.3g} m/s"
