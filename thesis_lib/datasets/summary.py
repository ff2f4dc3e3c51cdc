"""What a dataset holds, as numbers and as text: the answer of the check command."""

import numpy as np

from thesis_lib.datasets.dataset import Dataset
from thesis_lib.datasets.impacts import STATE

UNIT = {"t": "s", "x": "m", "y": "m", "theta": "rad", "vx": "m/s", "vy": "m/s", "omega": "rad/s"}


def summarise(dataset: Dataset) -> dict:
    """Counts, ranges, body and warnings of a dataset, ready for JSON."""
    header = dataset.header
    result: dict = {
        "dataset": dataset.name,
        "description": header.description,
        "trials": len(dataset.trials),
        "body": header.body.model_dump(mode="json", exclude_none=True),
        "surface_height": dataset.height,
        "gravity": dataset.gravity,
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
            "range": _ranges(poses, ("x", "y", "theta")),
        }
    if (impacts := dataset.impacts) is not None:
        result["impacts"] = {
            "rows": len(impacts),
            "contact_points": "given" if "r_x" in impacts else "from shape and theta",
            "covariance": "cov_x_x" in impacts,
            "flagged": int((impacts["flags"] != "").sum()) if "flags" in impacts else 0,
            "range": _ranges(impacts, STATE),
        }
    return result


def _ranges(table, names) -> dict[str, list[float]]:
    return {name: [float(np.min(table[name])), float(np.max(table[name]))] for name in names}


def summary_text(dataset: Dataset) -> str:
    """`summarise` for reading."""
    facts, body = summarise(dataset), dataset.header.body
    lines = [f"dataset     {facts['dataset']}", f"trials      {facts['trials']}"]
    mass = "mass not given" if body.mass is None else f"mass {body.mass:g} kg"
    lines.append(
        f"body        {body.shape.kind}, reaches {body.shape.extent:.4g} m from its centre; {mass}; radius of gyration "
        f"{body.radius_of_gyration:.4g} m (a uniform lamina has {body.shape.radius_of_gyration:.4g} m)"
    )
    lines.append(f"surface     at y = {dataset.height:g} m; gravity {dataset.gravity:g} m/s²")
    noise = facts["noise"]
    units = {"position": "m", "angle": "rad", "velocity": "m/s", "angular_velocity": "rad/s"}
    stated = ", ".join(f"{name} {value:g} {units[name]}" for name, value in noise.items()) if noise else ""
    lines.append(f"noise       {stated or 'not stated'}")
    if (part := facts.get("trajectories")) is not None:
        low, high = part["samples_per_trial"]
        shortest, longest = part["duration"]
        lines.append(
            f"poses       {part['samples']} samples, {low} to {high} a trial, {shortest:.3g} to {longest:.3g} s, "
            f"{part['rate']:.6g} Hz"
        )
        lines += _range_lines(part["range"])
    if (part := facts.get("impacts")) is not None:
        lines.append(
            f"impacts     {part['rows']}; contact points {part['contact_points']}; "
            f"covariance {'given' if part['covariance'] else 'not given'}; {part['flagged']} flagged"
        )
        lines += _range_lines(part["range"])
    for i, problem in enumerate(dataset.warnings, 1):
        lines.append(f"warning {i}: {problem}")
    lines.append(
        "The dataset is valid." if not dataset.warnings else "The dataset is valid, with the warnings above."
    )
    return "\n".join(lines)


def _range_lines(ranges: dict[str, list[float]]) -> list[str]:
    return [
        f"  {name:<10}{low:12.4g} … {high:<12.4g}{UNIT[name.split('_')[0]]}"
        for name, (low, high) in ranges.items()
    ]
