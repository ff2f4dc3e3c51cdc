"""Output of a proposal: its part of diagnosis.json, sentences for a reader, and the file.

| key of `proposal` | meaning                                                                                       |
|-------------------|-----------------------------------------------------------------------------------------------|
|                   | null if no term passed the test                                                               |
| terms             | name, title, equation, parameters, gain by K-fold with p-value, indistinguishable terms       |
|                   | `share_of_halves`: of the halves of the trials in which sparse regression chose the term      |
| law, effects      | of the model with the terms: its law, and the effects of the library that it still needs      |
| parameters        | of that model, by full name                                                                   |
| gain              | on held-out trials, over the critique's final model                                           |
| error             | held-out error: of the critique's final model, with the proposal, of noise alone              |
| tried             | number of terms that were tried, which the p-values count                                     |
| limit             | null, or the setting max_terms at which the search for terms ended although more may be found |
| file              | name of the effect file                                                                       |
"""

from collections.abc import Mapping
from pathlib import Path

from thesis_lib.critique.drops.criticise import DropsCritique
from thesis_lib.critique.proposal.effect_file import source
from thesis_lib.critique.proposal.propose import Proposal
from thesis_lib.critique.proposal.terms import testable_terms
from thesis_lib.critique.results.effect_sentences import speed
from thesis_lib.critique.selection.settings import SearchSettings
from thesis_lib.datasets.format.folder import holds_data
from thesis_lib.foundation.files import six_digits, write_text
from thesis_lib.statistics.wording import bounded, listed, number

UNTESTABLE = "terms_in_v_t_omega_and_beta"  # as it stands under `not_testable` of diagnosis.json
MOST_NAMES = 99  # files with different content in one folder
MOST_SAID = 3  # indistinguishable terms that are named


def content_of(proposal: Proposal | None, file: str) -> dict | None:
    """The part of diagnosis.json, rounded to six digits."""
    if proposal is None:
        return None
    fitted = proposal.fitted
    parameters = {name: fitted.content(name) for name in fitted.model.parameters}
    terms = [
        {
            "name": one.term.name,
            "title": one.term.title,
            "equation": one.term.equation,
            "parameters": {"a": parameters[f"{one.term.name}.a"]},
            "gain": {
                "held_out_log_score_per_impact": one.step.gain[0],
                "interval": list(one.step.gain[1:]),
                "p_value": one.step.p_value,
            },
            "indistinguishable_from": list(one.step.alternatives),
            "share_of_halves": one.share,
        }
        for one in proposal.terms
    ]
    gain, low, high = proposal.held_out_gain
    errors = {"before": float(proposal.before.error.mean()), "after": float(proposal.after.error.mean())}
    return six_digits(
        {
            "terms": terms,
            "law": fitted.base,
            "effects": [effect.name for effect in proposal.kept],
            "parameters": parameters,
            "gain": {"held_out_log_score_per_impact": gain, "interval": [low, high]},
            "error": {"unit": "m/s", **errors, "noise_floor": proposal.after.floor},
            "tried": proposal.tried,
            "limit": proposal.limit,
            "file": file,
        }
    )


def with_proposal(content: Mapping, proposal: Proposal | None, file: str, critique: DropsCritique) -> dict:
    """`content` of diagnosis.json after a search for terms; `file`: name of the effect file, "" without one."""
    why = "theta is not measured: the unknown spin can explain any error that depends on it"
    untold = [] if critique.observations.rig.has_angle else [{"name": UNTESTABLE, "why": why}]
    told = {**content, "proposal": content_of(proposal, file), "not_testable": [*content["not_testable"], *untold]}
    return {**told, "summary": [*content["summary"], *sentences(told, critique.settings)]}


def sentences(d: Mapping, settings: SearchSettings) -> list[str]:
    """Sentences for the summary; `d` is the content of diagnosis.json with the key `proposal`."""
    found = d["proposal"]
    if found is None:
        has_angle = all(one["name"] != UNTESTABLE for one in d.get("not_testable", ()))
        targets = "restitution, friction, a sideways impulse or a couple" if has_angle else "restitution or friction"
        return [
            f"Of {len(testable_terms(has_angle))} terms that could be added to {targets}, none passes the test of an "
            "effect, so none is proposed."
        ]
    error, terms = found["error"], found["terms"]
    named = [f"{one['equation']} with {sized(one)} ({one['title']})" for one in terms]
    worst = max(one["gain"]["p_value"] for one in terms)
    floor = error["noise_floor"]
    beside = f" (noise floor {number(floor)} m/s)" if floor is not None and floor == floor else ""
    many = "terms" if len(terms) > 1 else "term"
    fall = f"the held-out error {settings.change(error['before'], error['after'], floor, speed)}{beside}"
    same = [name for one in terms for name in one["indistinguishable_from"]]
    doubt = [f"These data cannot tell it from {listed(same[:MOST_SAID])}."] if same else []
    ended = f"The search for terms ended at max_terms = {found['limit']}, although the error exceeds the noise; "
    ended += "critique.settings.max_terms in the configuration, or max_terms of the settings in Python, allows more."
    where = "Critique.save(folder) writes it as an effect file to read, rename and edit, which --effects adds."
    if file := found["file"]:
        where = f"{file}, beside the folder, contains it as an effect to read, rename and edit, and critique DATA "
        where += f"--effects {file} adds it."
    return [
        f"Proposed {many}: {listed(named)}; of {found['tried']} that were tried, p = {number(worst, 2)}; with "
        f"{'them' if len(terms) > 1 else 'it'} {fall}.",
        *doubt,
        *[ended] * (found["limit"] is not None),
        f"This is a formula for the missing effect, not its cause: {where}",
    ]


def sized(term: Mapping) -> str:
    """a = value ± standard error, or its bound."""
    a = term["parameters"]["a"]
    return f"a = {number(a['value'])} ± {number(a['std'], 1)}" if a["std"] is not None else f"a {bounded(a)}"


def text_of(proposal: Proposal, settings: SearchSettings) -> str:
    """The text of the effect file, with the results of the critique."""
    found = [
        f"Found: {one.term.name}: {sized({'parameters': {'a': proposal.fitted.content(f'{one.term.name}.a')}})}, "
        f"p = {one.step.p_value:.2g} among {proposal.tried} terms."
        for one in proposal.terms
    ]
    before, after = proposal.before.error.mean(), proposal.after.error.mean()
    change = settings.change(float(before), float(after), proposal.after.floor, speed)
    found.append(f"With it the held-out error {change}.")
    return source([one.term for one in proposal.terms], "\n".join(found))


def proposal_path(folder: str | Path) -> Path:
    """The effect file beside the folder of a critique, or further up, because no code is loaded from data folders."""
    folder = Path(folder).resolve()
    outside = next(place for place in (folder, *folder.parents) if not any(map(holds_data, place.parents)))
    return outside.with_name(f"{folder.name}_proposal.py")


def write_source(proposal: Proposal, path: Path, settings: SearchSettings) -> Path:
    """Write the effect file; a file with other text, perhaps a user's edits, stays, and another name is taken."""
    text = text_of(proposal, settings)
    for i in range(1, MOST_NAMES):
        free = path if i == 1 else path.with_name(f"{path.stem}_{i}.py")
        if not free.exists() or free.read_text(encoding="utf-8", errors="replace") == text:
            break
    free.parent.mkdir(parents=True, exist_ok=True)
    write_text(text, free)
    return free
