"""Content of diagnosis.json: the verdict, missing effects, what the data leave open, and what to measure next.

`diagnosis` lists all keys; these need an explanation (see also detectable.py, next_experiment.py):

| where           | key                 | meaning                                                                     |
|-----------------|---------------------|-----------------------------------------------------------------------------|
|                 | verdict             | null if there are too few impacts (`few_diagnosis` in findings.py)          |
|                 | augmented_model     | law and (μ, ε) with effects; the law may differ from that of base_model     |
|                 | headline            | sentences of the summary on verdict and data alone                          |
|                 | parameters          | a bound: std null, `bound` lower or upper, `used` in predictions, `range`   |
|                 | laws                | each law without effects: parameters, held-out error and its 95 % interval  |
|                 | additions           | effects and laws from outside the library, used or not, with their origin   |
|                 | remarks             | motion of the body that no impact law describes; absent if none             |
| reference       | x, t, trial         | m, s, number of a release: origin of the effects, to which mu, epsilon and  |
|                 |                     | tau refer; middle of the training impacts in coordinates of the dataset     |
| effects         | clears              | whether it passes the thresholds; an effect switched on by hand may fail    |
|                 | fails               | null, or the test it fails: chance, immaterial, spoils (another error)      |
|                 | material_in         | channels whose held-out misfit it lowers materially                         |
|                 | stand_in            | null, or why it is not, or may not be, the cause: see `drops/stand_ins.py`  |
|                 | unseen              | directions of its parameters that these data cannot show; absent if none    |
|                 | could_be            | null, or other `causes`: for gravity the error of `clock` and `scale`       |
|                 |                     | (relative) and the true `rate` in Hz; for a size from which k was computed, |
|                 |                     | `size` (true over assumed), `radius` in m, effects that it `explains` too   |
| rejected        | rises               | of an effect that the held-out trials reject: errors that it raises, by     |
|                 |                     | channel, with their two `ends`, without and with the effect                 |
| search          | limit, value        | null, or the setting at which the search ended although more may be found   |
| error           | noise_floor_single  | noise floor of the single hits alone                                        |
|                 | <which>_interval    | 95 % of `base` and `augmented`, by bootstrap over trials, as in ladder.csv  |
|                 | irb_bound_augmented | with geometry, inertia and camera of the effects                            |
|                 | meet, touch         | misfit of poses and of the gap at impact, in the same form as `flight`      |
|                 | by_contact          | in space: errors at corners, edges and faces; `dimensions` is 3 then        |
|                 | worst               | largest errors, if these and not the median raise the mean above the floor  |
| left_out        | flights             | number `bent` of all `n` flights that are not parabolas and are not used    |
| remaining       | channels            | channels with a misfit far above noise                                      |
|                 | significant         | whether part of it can be learned, even if that is too small to matter      |
|                 | depends_on          | states from which a part of it can be learned; empty if there is none       |
|                 | restitution         | null, or range of ε if it alone differs between trials or impacts, and      |
|                 |                     | depends on nothing that is recorded                                         |
|                 | energy_gain         | median relative gain of energy at impacts, 0 unless most impacts gain       |
|                 | stays_down          | null, or hits that stay down: `thesis_lib/datasets/impacts/stays_down.py`   |
|                 | elsewhere           | null, or hits on an object other than the surface: `trials` of all `of`,    |
|                 |                     | number of `hits`, `first` ones: thesis_lib/critique/drops/elsewhere.py      |
"""

from dataclasses import asdict

import numpy as np
import pandas as pd

from thesis_lib.bodies.solids import CONTACT_KINDS
from thesis_lib.critique.drops.criticise import DropsCritique
from thesis_lib.critique.drops.judgement import channel_is_material, judge, spoilt_channels
from thesis_lib.critique.drops.questions.detectable import detectable
from thesis_lib.critique.drops.questions.next_experiment import next_experiment
from thesis_lib.critique.drops.words import AWAY
from thesis_lib.critique.likelihood.channels import CHANNELS
from thesis_lib.critique.likelihood.fit import Fit
from thesis_lib.critique.likelihood.in_space.hits import hard_hits
from thesis_lib.critique.likelihood.observations import Observations
from thesis_lib.critique.results.clock_and_size import could_be
from thesis_lib.critique.results.summary import headline, summary
from thesis_lib.critique.results.tables import DRAWS, ladder, left_out_impacts
from thesis_lib.critique.selection.discovery import Rejected, paired_gain
from thesis_lib.extensions.registry import contents
from thesis_lib.foundation.files import six_digits
from thesis_lib.foundation.randomness import generator
from thesis_lib.statistics.bootstrap import bootstrap_mean

WORST = 5  # impacts that are listed if single ones dominate the mean


def diagnosis(critique: DropsCritique, rng: np.random.Generator, rungs: pd.DataFrame | None = None) -> dict:
    """Content of diagnosis.json, rounded to six digits.

    `rng` draws intervals and trial states; `rungs`: table of the ladder, computed here if None.
    """
    discovery, remaining = critique.discovery, critique.remaining
    base, final, found = critique.ladder[0][1], critique.ladder[-1][1], critique.observations.found
    differs, limit = critique.restitution_differs, discovery.limit
    content = {
        "schema": 1,
        "dataset": critique.dataset,
        "n_impacts": len(critique.observations),
        "n_trials": len(np.unique(critique.observations.trial)),
        "verdict": critique.verdict,
        "base_model": {"name": discovery.base, "parameters": parameters(base)},
        "augmented_model": {"name": final.model.law.name, "parameters": parameters(final)},
        "effects": [_effect(critique, i, rng) for i in range(len(discovery.steps))],
        "rejected": [_rejected(critique, one) for one in discovery.rejected],
        "search": {
            "limit": None if limit is None else "max_effects",
            "value": limit,
            "tried": discovery.first is not None,
        },
        "error": _error(critique),
        "remaining": {
            "structured": critique.is_structured,
            "channels": list(critique.misfit_channels),
            "p_value": remaining.p_value,
            "significant": remaining.p_value <= critique.settings.alpha,
            "depends_on": list(remaining.depends_on) if critique.is_learnable else [],
            "restitution": None
            if differs is None
            else dict(zip(("differs_by", "low", "high"), differs)) | {"unit": "1"},
            "energy_gain": found.gain,
            "stays_down": None if found.down is None else asdict(found.down),
            "elsewhere": None if critique.elsewhere is None else critique.elsewhere.content(),
            "error": remaining.error_before,
            "error_without_it": remaining.error_after,
            "stand_ins": list(critique.stand_ins),
        },
        "not_testable": [{"name": name, "why": why} for name, why in discovery.not_testable.items()],
        "left_out": left_out(critique.observations),
        "detectable": detectable(critique),
        "next_experiment": next_experiment(critique, rng),
    }
    if not critique.space.is_plane:
        content["dimensions"] = critique.space.dimension
        content["error"]["by_contact"] = by_contact(critique)
    header = None if critique.source is None else critique.source.header
    for effect in content["effects"]:
        effect["could_be"] = could_be(effect["name"], content["effects"], header)
    if (low_pass := found.low_pass) is not None:
        content["low_pass"] = low_pass.content()
    if remarks := found.remarks:
        content["remarks"] = list(remarks)
    rungs = ladder(critique, rng) if rungs is None else rungs
    for key, row in (("base_interval", rungs.iloc[0]), ("augmented_interval", rungs.iloc[-1])):
        content["error"][key] = [float(row["error_low"]), float(row["error_high"])]
    seed = int(rng.integers(2**63))  # one stream per law: a further law changes no other interval
    content["laws"] = {name: _law(critique, name, generator(seed, name)) for name in critique.laws}
    # the base law's error has one interval, that of the ladder
    content["laws"][discovery.base]["interval"] = content["error"]["base_interval"]
    if added := contents():
        content["additions"] = added
    settings = critique.settings
    content |= {"headline": headline(content, settings), "summary": summary(content, settings)}
    # six digits are too few for dates and clocks
    return six_digits(content) | {"reference": critique.training.rig.reference.content(critique.space)}


def parameters(fitted: Fit, of: str = "") -> dict[str, dict]:
    """Parameters by short name: of the effect `of` (its name and a dot) or, without one, of the law."""
    return {
        name.removeprefix(of): fitted.content(name)
        for name in fitted.model.parameters
        if (name.startswith(of) if of else "." not in name)
    }


def _law(critique: DropsCritique, name: str, rng: np.random.Generator) -> dict:
    """Results of one law without effects, to compare runs that chose different laws."""
    fitted = critique.discovery.bases[name]
    judged = critique.laws[name]
    return {
        "parameters": parameters(fitted),
        "error": float(judged.error.mean()),
        "interval": list(bootstrap_mean(judged.error, judged.trial, DRAWS, rng)),
        "unit": "m/s",
    }


def _effect(critique: DropsCritique, i: int, rng: np.random.Generator) -> dict:
    step, (_, final, judged) = critique.discovery.steps[i], critique.ladder[-1]
    name = step.effect.name
    without, s = critique.without[name], critique.settings
    gain, low, high = paired_gain(judged, without, rng)
    unseen = step.effect.unseen(critique.observations.rig)
    return {
        "name": name,
        "family": step.effect.family,
        "parameters": parameters(final, f"{name}."),
        "clears": step.clears,
        "fails": step.fails,
        "material_in": [channel for channel in CHANNELS if channel_is_material(judged, without, channel, s)],
        "gain": {"held_out_log_score_per_impact": gain, "interval": [low, high], "p_value": step.p_value},
        "indistinguishable_from": list(step.alternatives),
        "stand_in": asdict(critique.stand_ins[name]) if name in critique.stand_ins else None,
        **({"unseen": unseen.tolist()} if len(unseen) else {}),
    }


def _rejected(critique: DropsCritique, one: Rejected) -> dict:
    """An effect that the held-out trials reject, with the errors that rise."""
    rises = {}
    for channel in spoilt_channels(one.judged, one.than, critique.settings):
        ends = [j.misfit(channel)[0] for j in (one.than, one.judged)]
        rises[channel] = {"unit": CHANNELS[channel].unit, "ends": ends}
    return {"name": one.step.effect.name, "rises": rises}


def _error(critique: DropsCritique) -> dict:
    (_, _, before), (_, fitted, after) = critique.ladder[0], critique.ladder[-1]
    base, augmented, floor = float(before.error.mean()), float(after.error.mean()), after.floor
    single = critique.held_out.single
    of_single = floor if len(single) == len(critique.held_out) else np.nan
    if 0 < len(single) < len(critique.held_out):
        of_single = judge(fitted, single).floor
    misfits: dict = dict.fromkeys(before.sigmas)
    for name in misfits:
        if np.isfinite(before.sigmas[name]):
            ends = {"base": np.sqrt(before.sigmas[name]), "augmented": np.sqrt(after.sigmas[name])}
            misfits[name] = {"unit": "sigma", **ends, "noise_floor": 1.0}
    share = min((base - augmented) / (base - floor), 1.0) if base > floor else None
    bounds = {"irb_bound": critique.irb, "irb_bound_augmented": critique.irb_augmented}
    errors = {"unit": "m/s", "base": base, "augmented": augmented, "noise_floor": floor, "explained_share": share}
    errors |= {"noise_floor_single": of_single}
    return errors | bounds | {"no_impact": critique.no_impact, "worst": _worst(critique)} | misfits


def by_contact(critique: DropsCritique) -> dict:
    """Held-out errors of hits at corners, edges and faces of a hull in space, m/s; {} of a smooth body.

    The kinds are those of the assumed sharp hull (`bodies.solids.contact_kind`); hits up to `HARD` do not count.
    `used_share` is the share of all these hits that is used, singly or in episodes, and n the number of held-out hits
    used.  A hit in an episode has the error of its episode.
    """
    (_, _, before), (_, fitted, after) = critique.ladder[0], critique.ladder[-1]
    o, held_out = critique.observations, critique.held_out
    hits, judged = (hard_hits(part) for part in (o, held_out))
    found = {}
    for kind in CONTACT_KINDS if len(hits) else ():
        rows = judged["row"][(judged["kind"] == kind) & (judged["row"] >= 0)].to_numpy()
        used = hits["row"][hits["kind"] == kind] >= 0
        ends = {"base": before.error[rows].mean(), "augmented": after.error[rows].mean()} if len(rows) else {}
        ends |= {"noise_floor": judge(fitted, held_out.rows(rows)).floor} if len(rows) else {}
        none = dict.fromkeys(("base", "augmented", "noise_floor"))
        share = float(used.mean()) if len(used) else None
        found[kind] = none | {name: float(x) for name, x in ends.items()} | {"n": len(rows), "used_share": share}
    return found


def _worst(critique: DropsCritique) -> list[dict]:
    """Held-out impacts with the largest errors, if these raise the mean, but not the median, far above the floor."""
    judged, limit = critique.ladder[-1][2], critique.settings.excess_scatter
    # a comparison with an unknown floor is false
    if not (judged.error.mean() > limit * judged.floor and judged.excess <= limit):
        return []
    o = critique.held_out
    rows = np.argsort(-judged.error, kind="stable")[:WORST]
    t = o.t if o.arcs else np.full(len(o), np.nan)
    return [{"trial": int(o.trial[i]), "t": float(t[i]), "error": float(judged.error[i]), "unit": "m/s"} for i in rows]


def left_out(observations: Observations) -> dict:
    """Share and reasons of the detected impacts that are not used, and the number of flights that are not."""
    table = left_out_impacts(observations)
    reasons = {str(k): int(v) for k, v in sorted(table["reason"].value_counts().items())}
    # hits away from the walls do not count: they concern no impact at a wall
    missing = len(table) - sum(reasons.get(reason, 0) for reason in AWAY)
    total = missing + len(observations)
    bent = len(observations.flights.bent)
    flights = {"bent": bent, "n": bent + len(observations.flights)}
    return {"share": missing / total if total else 0.0, "reasons": reasons, "flights": flights}
