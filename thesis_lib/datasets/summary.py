"""Summary of a dataset and of the impacts detected in it, as numbers and as text, for the check command."""

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np

from thesis_lib.datasets.checks.in_space import MotionFacts, motion_facts
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.header import SpaceHeader
from thesis_lib.datasets.format.impacts import STATE
from thesis_lib.datasets.format.table_forms import POSITION, V_POST_IN_SPACE, V_PRE_IN_SPACE
from thesis_lib.datasets.impacts.detect import FoundImpacts, find_impacts
from thesis_lib.datasets.impacts.found import MIN_IMPACTS, MIN_TRIALS, are_enough
from thesis_lib.datasets.read import read_dataset
from thesis_lib.statistics.wording import plural

SHOWN = 5  # largest number of trials named in a line
UNIT = {"t": "s", "theta": "rad", "omega": "rad/s"}
UNIT |= {axis: "m" for axis in "xyz"} | {f"v{axis}": "m/s" for axis in "xyz"} | {f"w{axis}": "rad/s" for axis in "xyz"}


def check_dataset(path: str | Path) -> tuple[Dataset, FoundImpacts | None]:
    """The dataset in the folder `path`, and the impacts detected in its trajectories (None without).

    Trajectories are searched even if there is an impacts.csv, which a critique then uses unchanged.  A DatasetError
    lists all faults.
    """
    dataset = read_dataset(path)
    if dataset.trajectories is None or not dataset.space.is_plane:
        return dataset, None
    return dataset, find_impacts(replace(dataset, impacts=None))


def summarise(dataset: Dataset, detection: FoundImpacts | None = None, hits: dict | None = None) -> dict:
    """Counts, ranges, body and warnings of a dataset, and the impacts detected in its trajectories, ready for JSON.

    `hits`: in space, the hits that a critique would use (`thesis_lib.commands.described.hits_told`).
    """
    header, in_plane = dataset.header, dataset.space.is_plane
    result: dict = {
        "dataset": dataset.name,
        **({} if in_plane else {"dimensions": 3}),
        "description": header.description,
        "trials": len(dataset.trials),
        "body": header.body.model_dump(mode="json", exclude_none=True),
        **({"surface_height": dataset.height} if in_plane else _surroundings(dataset.in_space)),
        "gravity": header.gravity,
        "noise": None if header.noise is None else header.noise.model_dump(exclude_none=True),
        "warnings": [vars(problem) for problem in dataset.warnings],
    }
    if (poses := dataset.trajectories) is not None:
        by_trial = poses.groupby("trial")["t"]
        count, last = by_trial.size(), by_trial.max() - by_trial.min()
        result["trajectories"] = {
            "samples": len(poses),
            "samples_per_trial": [int(count.min()), int(count.max())],
            "duration": [float(last.min()), float(last.max())],
            "rate": dataset.rate,
            "range": _ranges(
                poses, ("x", "y", "theta" if in_plane else "z")[: 2 if not dataset.has_angle and in_plane else 3]
            ),
        }
        if not in_plane:
            result["motion"] = _motion(motion_facts(poses, dataset.in_space), len(poses))
    if (impacts := dataset.impacts) is not None:
        result["impacts"] = {
            "rows": len(impacts),
            "contact_points": "given"
            if "r_x" in impacts
            else f"from shape and {'theta' if in_plane else 'orientation'}",
            "covariance": "cov_x_x" in impacts,
            "flagged": int((impacts["flags"] != "").sum()) if "flags" in impacts else 0,
            "range": _ranges(impacts, STATE if in_plane else (*POSITION, *V_PRE_IN_SPACE, *V_POST_IN_SPACE)),
        }
    if detection is not None:
        result["detection"] = detection.summary()
    if hits is not None:
        result["detection"] = hits
    return result


def _surroundings(header: SpaceHeader) -> dict:
    """Tracked frame and surfaces as stated in dataset.yaml, with unit normals (defaults filled in)."""
    content = header.model_dump(mode="json", include={"tracked"})
    names = [surface.name for surface in header.surfaces or ()] or ["surface"]
    planes = zip(names, header.planes)
    return content | {"surfaces": {name: {"point": p.tolist(), "normal": n.tolist()} for name, (p, n) in planes}}


def _motion(facts: MotionFacts, samples: int) -> dict:
    """Observed gravity, faults of the poses, and beginning and end of the trials, from the samples."""
    return {
        "flights": facts.flights,
        "fall": None if facts.fall is None else facts.fall.tolist(),
        "lost_orientation": facts.lost_orientation,
        "jumps": len(facts.turned.rows) / samples,
        "between_jumps": facts.turned.share,
        "jumps_of_place": len(facts.moved.rows) / samples,
        "reading": facts.reading or "as stated",
        "held": len(facts.held),
        "held_until": facts.held,
        "in_the_air": len(facts.in_the_air),
        "in_the_air_at": facts.in_the_air,
    }


def _ranges(table, names) -> dict[str, list[float]]:
    return {name: [float(np.min(table[name])), float(np.max(table[name]))] for name in names}


def summary_text(dataset: Dataset, detection: FoundImpacts | None = None, hits: dict | None = None) -> str:
    """The summary as text, one line per subject."""
    facts, body, in_plane = summarise(dataset, detection), dataset.header.body, dataset.space.is_plane
    lines = [f"dataset     {facts['dataset']}", f"trials      {facts['trials']}"]
    shape = dataset.shape if in_plane else dataset.in_space.body.solid.about(dataset.in_space.body.centre)
    mass = "mass not given" if body.mass is None else f"mass {body.mass:g} kg"
    lines.append(
        f"body        {body.shape.kind}, reaches {shape.extent:.4g} m from its "
        f"centre{'' if in_plane else ' of mass'}; {mass}; radius of "
        f"gyration {body.radius_of_gyration:.4g} m "
        + (f"(a uniform lamina has {body.shape.radius_of_gyration:.4g} m)" if in_plane else "(mean of three axes)")
    )
    names = ", ".join(wall.name for wall in dataset.header.surfaces or ())
    where = f"{'walls' if in_plane else 'surfaces'} {names}" if names else f"at y = {dataset.height:g} m"
    if not in_plane and not names:
        where = "through ({:.4g}, {:.4g}, {:.4g}) m, normal ({:.3f}, {:.3f}, {:.3f})".format(
            *np.ravel(dataset.in_space.planes) + 0.0
        )
    lines.append(f"surface     {where}; gravity {dataset.gravity:g} m/s²")
    noise = facts["noise"]
    units = {"position": "m", "angle": "rad", "rotation": "rad", "velocity": "m/s", "angular_velocity": "rad/s"}
    stated = [
        f"{name} {' '.join(f'{v:g}' for v in np.ravel(value))} {units[name]}" for name, value in (noise or {}).items()
    ]
    lines.append(f"noise       {', '.join(stated) or 'not stated'}")
    if (part := facts.get("trajectories")) is not None:
        low, high = part["samples_per_trial"]
        shortest, longest = part["duration"]
        lines.append(
            f"poses       {part['samples']} samples, {low} to {high} per trial, {shortest:.3g} to {longest:.3g} s, "
            f"{part['rate']:.6g} Hz"
        )
        lines += _range_lines(part["range"])
    if (part := facts.get("motion")) is not None:
        fall = "" if part["fall"] is None else ", which fall by ({:.3g}, {:.3g}, {:.3g}) m/s²".format(*part["fall"])
        lost = f"orientation lost in {part['lost_orientation']:.1%} of the samples, jumps at {part['jumps']:.1%}"
        lines.append(f"flights     {part['flights']}{fall}; {lost}")
        held, caught = _named(part["held_until"].items(), "until"), _named(part["in_the_air_at"].items(), "at")
        begin, end = (f"{word}{'s' * (part[key] == 1)}" for word, key in (("begin", "held"), ("end", "in_the_air")))
        releases = {
            "held": f"{begin} before the release of the body{held}",
            "in_the_air": f"{end} in the air: caught, out of view, or beyond the table's edge{caught}",
        }
        said = [f"{plural(part[key], 'trial')} {text}" for key, text in releases.items() if part[key]]
        lines += [f"{head:<12}{text}" for head, text in zip(("releases", ""), said)]
    if (part := facts.get("impacts")) is not None:
        lines.append(
            f"impacts     {part['rows']}; contact points {part['contact_points']}; "
            f"covariance {'given' if part['covariance'] else 'not given'}; {part['flagged']} flagged"
        )
        lines += _range_lines(part["range"])
    if detection is not None and (part := facts.get("detection")) is not None:
        lines += _detection_lines(part, noise or {}, given=dataset.impacts is not None)
    lines += _hit_lines(hits) if hits is not None else _verdict_lines(dataset, detection)
    warnings = [*dataset.warnings, *(detection.warnings if detection else ()), *(hits or {}).get("warnings", ())]
    lines += [f"warning {i}: {problem}" for i, problem in enumerate(warnings, 1)]
    lines.append("The dataset is valid." if not warnings else "The dataset is valid, with the warnings above.")
    return "\n".join(lines)


def _range_lines(ranges: dict[str, list[float]]) -> list[str]:
    return [
        f"  {name:<10}{low:12.4g} … {high:<12.4g}{UNIT[name.split('_')[0]]}" for name, (low, high) in ranges.items()
    ]


def _verdict_lines(dataset: Dataset, detection: FoundImpacts | None) -> list[str]:
    """Line on too few impacts for a verdict; no line if there are enough, or no impact at all."""
    if dataset.impacts is not None:
        trial, more = dataset.impacts["trial"].to_numpy(), []
    elif detection is not None:
        # hits in quick succession may be used together, as an episode
        trial, out = detection.impacts.trial, detection.left_out
        more = out.loc[out["reason"] == "second_hit", "trial"].tolist()
    else:
        return []
    if not len(trial) or are_enough(len(trial) + len(more), len({*trial.tolist(), *more})):
        return []
    trials = len(np.unique(trial))
    line = _no_verdict(len(trial), trials)
    if trials == 1 and len(trial) >= MIN_TRIALS and not dataset.header.surfaces:  # between walls nothing is cut
        line += "; if it is a long log of several drops, datasets init --cut makes each drop a trial"
    return [line]


def _no_verdict(impacts: int, trials: int) -> str:
    return (
        f"critique    restitution and friction only, no verdict: {plural(impacts, 'usable impact')} in "
        f"{plural(trials, 'trial')}; {MIN_IMPACTS} in {MIN_TRIALS} are needed"
    )


def _hit_lines(hits: dict) -> list[str]:
    """Lines on the tracked frame of a body in space, and on its hits that a critique can use."""
    lines = [f"tracked     {hits['tracked']}"] if hits["tracked"] else []
    if "why" in hits:
        return [*lines, f"critique    none: {hits['why']}"]
    n, kinds = hits["hits"], hits["by_contact"]
    weak = n - sum(kinds.values())
    kinds = _counts(kinds | {"weak": weak} if any(kinds.values()) and weak else kinds)
    episodes = f", as {hits['used']} single hits and episodes" if n != hits["used"] else ""
    lines.append(
        f"hits        {n} can be used in {plural(hits['trials'], 'trial')}{f' ({kinds})' if kinds else ''}{episodes}"
    )
    lines += [f"  left out  {reason} {sum(of.values())} ({_counts(of)})" for reason, of in hits["left_out"].items()]
    if elsewhere := hits["elsewhere"]:
        off = f"{plural(len(elsewhere), 'hit')} off the surface"
        lines.append(f"  elsewhere {off}, by a hand or another body{_named(elsewhere, 'at')}")
    return lines if are_enough(hits["used"], hits["trials"]) else [*lines, _no_verdict(hits["used"], hits["trials"])]


def _counts(of: dict[str, int]) -> str:
    return ", ".join(f"{name} {count}" for name, count in of.items())


def _named(times: Iterable[tuple[int, float]], word: str) -> str:
    """Trials with their times in s, in brackets, at most `SHOWN` of them; "" if there are none."""
    said = [f"trial {trial} {word} {t:.3g} s" for trial, t in times]
    more = f", and {len(said) - SHOWN} more" if len(said) > SHOWN else ""
    return f" ({', '.join(said[:SHOWN])}{more})" if said else ""


def _detection_lines(part: dict, stated: dict, given: bool) -> list[str]:
    left_out, flagged = (
        f"{sum(of.values())} ({_counts(of)})" if of else "0" for of in (part["left_out"], part["flagged"])
    )
    quick = "second_hit" in part["left_out"]
    lines = [
        f"detection   {plural(part['used'], 'impact')} of the trajectories can be used"
        + (" (impacts.csv is used instead)" if given else ""),
        f"  left out  {left_out}"
        + ("; a critique also uses hits in quick succession, as episodes" if quick and not given else ""),
        f"  flags     {flagged}",
    ]
    if part["glitches"]:
        lines.append(f"  glitches  {plural(part['glitches'], 'sample')}, treated as lost frames")
    source = {"arcs": "the arcs", "differences": "third differences", "header": "dataset.yaml"}
    shares = [
        f"{name} {'unknown' if value is None else f'{value:.3g} {unit}'}"
        + (f" (stated {stated[name]:g})" if name in stated else "")
        for (name, value), unit in zip(part["noise"].items(), ("m", "rad"))
        if value != 0.0  # 0 marks an angle that is not measured
    ]
    lines.append(f"  noise     {', '.join(shares)}; from {source[part['noise_source']]}")
    return lines
