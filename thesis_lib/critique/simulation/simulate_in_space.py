"""Tosses in space simulated with a saved model, as its camera reports them.

They begin in given states, in the states of a dataset (`first_flight`), or in states drawn as for the proof
(`thesis_lib/simulate/tosses/world.py`).  Scatter beyond noise is not drawn.
"""

import warnings
from collections.abc import Callable, Mapping

import numpy as np
import pandas as pd

from thesis_lib.critique.results.saved_in_space import NOT_OF_THE_RIG, SavedSpaceModel, require_rotations
from thesis_lib.critique.simulation.first_flight import MeasuredTosses, first_flight
from thesis_lib.critique.simulation.tosses import reported, toss
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.frames import surface_frames, tracked_of_body
from thesis_lib.datasets.format.header import SpaceHeader
from thesis_lib.datasets.format.table_forms import POSE_IN_SPACE, V_PRE_IN_SPACE
from thesis_lib.foundation.errors import UserError
from thesis_lib.mechanics.frame import on_body
from thesis_lib.mechanics.space import SPACE
from thesis_lib.mechanics.state import State
from thesis_lib.simulate.tosses.own import STRAIGHT
from thesis_lib.simulate.tosses.world import TossedWorld, released

RATE, DURATION = 240.0, 1.2  # Hz, s
NOISE = {"position": 2e-4, "rotation": 3e-3}  # m, rad
INSIDE = 0.01  # body extents below the surface; resting bodies seem to be a fraction of that below it, by noise
V_IN_SPACE = tuple(name.removesuffix("_pre") for name in V_PRE_IN_SPACE)


def simulate_in_space(
    model: SavedSpaceModel,
    n: int | None = None,
    *,
    states: pd.DataFrame | None = None,
    like: Dataset | None = None,
    duration: float | None = None,
    noise: Mapping[str, float] | None = NOISE,
    rng: np.random.Generator,
    say: Callable[[str], None] = lambda text: None,
    warn: Callable[[str], None] = warnings.warn,
) -> Dataset:
    """Simulate tosses, numbered from 0, and return their trajectories; `warn` gets a warning of bodies that begin in
    the surface.

    Args:
        n: number of tosses; None: 60, or all first flights recorded in `like`.
        states: trial, pose of the tracked frame and its motion (`V_IN_SPACE`), one row per toss, as measured; no
            noise is then added.
        like: dataset from which first flights, noise, rate and duration are taken.
        duration: s.
        noise: position in m, rotation in rad; only without `states` and `like`.

    Raises:
        UserError: columns are missing or not numeric, or `like` has no trajectories in space, or no first flight.
    """
    dynamics, trials, rate = model.dynamics, None, RATE
    if states is not None:
        columns = given(states)
        true, noise = dynamics.to_true(model.measured(columns)), None
        trials, gap = columns["trial"].astype(int), dynamics.gap(true)
        if len(deep := np.flatnonzero(gap < -INSIDE * model.believed.shape.extent)):
            most = deep[gap[deep].argmin()]
            warn(
                f"{len(deep)} of {len(gap)} toss(es) begin in the surface, toss {trials[most]} by {-gap[most]:.3g} m; "
                "check height, orientation and unit of length."
            )
    elif like is not None:
        if like.space.is_plane or like.trajectories is None:
            what = "is in a plane (schema 1)" if like.space.is_plane else "has impacts without trajectories"
            raise UserError(f"{like.name} {what}; --like of a model in space needs tosses in space (schema 2).")
        say(f"looking for the first flights of {like.name}")
        tosses = MeasuredTosses.of(like, model, like.trials)
        begun = first_flight(tosses.bound(model), tosses)
        rows = np.arange(min(n or len(tosses.flight), len(tosses.flight)))
        true = tosses.bound(model).to_true(begun.state.select(rows))
        noise = dict(zip(("position", "rotation"), begun.noise.tolist()))
        rate, duration = like.rate or RATE, duration or float(np.median(tosses.times.max(axis=0)))
    else:
        at = released(TossedWorld(header_of(model, {})), n or 60, rng)
        true = on_body(at, model.rig.body.centre, np.array(STRAIGHT))
    true = State(true.pose, true.motion, np.arange(len(true)), np.zeros(len(true)), None, SPACE)
    times = np.arange(round((duration or DURATION) * rate) + 1)[:, None] / rate + np.zeros(len(true))
    say(f"simulating {len(true)} tosses of {times[-1, 0]:.2f} s")
    seen = reported(dynamics, toss(dynamics, true, times))
    shown = tracked_of_body(surface_frames(model.rig)[0].shown(seen), model.rig)
    pose = np.array(shown.pose)
    if noise:
        pose[:3] += noise["position"] * rng.standard_normal(pose[:3].shape)
        pose[3:] = SPACE.attitude_after(pose[3:], noise["rotation"] * rng.standard_normal(pose[:3].shape))
    pose[3:] *= np.where(pose[3:4] < 0.0, -1.0, 1.0)
    table = pd.DataFrame({"trial": shown.trial, "t": times.ravel()} | dict(zip(POSE_IN_SPACE, pose)))
    if trials is not None:
        table["trial"] = trials[table["trial"]]
    effects = ", ".join(model.effects) or "no effects"
    text = f"simulated, not measured: {len(true)} tosses by {model.law} with {effects}"
    header = header_of(model, {"description": text, "rate": rate} | ({"noise": dict(noise)} if noise else {}))
    return Dataset("simulated", header, table.sort_values(["trial", "t"], ignore_index=True))


def given(states: pd.DataFrame) -> dict[str, np.ndarray]:
    """Return the columns of given states; velocities may have the names of pre-impact velocities in impacts.csv."""
    states = states.rename(columns=dict(zip(V_PRE_IN_SPACE, V_IN_SPACE)))
    states = states if "trial" in states else states.assign(trial=np.arange(len(states)))
    needed = ("trial", *POSE_IN_SPACE, *V_IN_SPACE)
    if missing := [name for name in needed if name not in states]:
        raise UserError(f"The states lack the column(s) {', '.join(missing)}; required are {', '.join(needed)}.")
    numbers = states[list(needed)].apply(pd.to_numeric, errors="coerce")
    if bad := [name for name in needed if not np.isfinite(numbers[name]).all()]:
        raise UserError(
            f"The column(s) {', '.join(bad)} of the states have cells that are empty or not a finite number."
        )
    if not len(numbers) or numbers["trial"].duplicated().any():
        raise UserError("The states must have one row for each toss, with a different number in trial.")
    require_rotations(numbers)
    columns = {name: numbers[name].to_numpy(float) for name in needed} | {"t": np.zeros(len(numbers))}
    return {name + "_pre" * (name in V_IN_SPACE): column for name, column in columns.items()}


def header_of(model: SavedSpaceModel, more: dict) -> SpaceHeader:
    """Return the dataset.yaml of the body and experimental set-up that the model assumes."""
    rig = model.rig.model_dump(mode="json", by_alias=True, exclude=NOT_OF_THE_RIG | {"reference", "mesh_sha256"})
    rig["body"]["shape"] = model.rig.body.shape
    return SpaceHeader.model_validate(rig | more)
