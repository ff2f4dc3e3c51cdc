"""Observations of a body in space, from the samples of its trajectories.

All quantities are in the frame (t_1, t_2, n) of the surface.  A hit occurs at the instant at which the arcs of the
centre of mass are closest (`instants`); `beside_hits` gives pose and motion before and after it, by lines for the
position and torque-free motion for the attitude.
"""

from dataclasses import replace

import numpy as np
import pandas as pd

from thesis_lib.critique.likelihood.in_space.clear_flights import under_gravity
from thesis_lib.critique.likelihood.in_space.episodes import HARD
from thesis_lib.critique.likelihood.in_space.flights import noise_of_flights
from thesis_lib.critique.likelihood.in_space.given import given_in_space
from thesis_lib.critique.likelihood.in_space.ground import Ground, of_shape
from thesis_lib.critique.likelihood.in_space.instants import find_hits
from thesis_lib.critique.likelihood.in_space.lag import LATE, REST, lag_in_flight, lag_of_attitudes
from thesis_lib.critique.likelihood.in_space.left_out import has_another_hit, off_free_motion
from thesis_lib.critique.likelihood.in_space.observed import HitWindows, Observed
from thesis_lib.critique.likelihood.in_space.recording import Known, TossRecording
from thesis_lib.critique.likelihood.observations import Observations, without_angle
from thesis_lib.datasets.checks.tracked_pose import settled
from thesis_lib.datasets.flights.parabolas import Hits
from thesis_lib.datasets.flights.rounding import contact_guard
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.header import unseen_spin
from thesis_lib.datasets.format.samples import ArcSettings
from thesis_lib.foundation.errors import UserError
from thesis_lib.mechanics.state import State

CLEARLY = 1.1  # ratio of contact duration to guard from which the guard is too short


def observe_in_space(dataset: Dataset, settings: ArcSettings | None = None, episodes: bool = True) -> Observations:
    """Observations of the hits of a dataset in space, from impacts.csv if present, otherwise from trajectories.

    Hits that cannot be used have a reason in `found`.

    `episodes`: include hits in such quick succession that the flight between is not observed (`in_space.episodes`).

    Raises:
        UserError: there are several surfaces, the tracked frame is unknown and cannot be found, or the orientation is
            missing for a body other than a ball.
    """
    if dataset.impacts is not None and len(dataset.impacts):
        return given_in_space(dataset)
    if dataset.trajectories is None:
        raise UserError(f"{dataset.name} has neither trajectories.csv nor impacts.csv; give at least one of them.")
    if len(dataset.in_space.planes) > 1:
        raise UserError(
            f"{dataset.name}: hits in space can be detected on one surface only, but several are defined. Give the one "
            "that is hit as `surface`, and put tosses onto another one into a separate dataset."
        )
    dataset, settings = settled(dataset), settings or ArcSettings()
    seen: Observed | Known = Known(settings.guard)
    while isinstance(seen, Known):
        seen = _looked(TossRecording.of(dataset, settings, seen))
    if not dataset.has_angle:
        o = seen.single()
        return without_angle(o, unseen_spin(np.linalg.norm(beside(o, 0).velocity, axis=0), dataset.in_space))
    return seen.with_episodes() if episodes else seen.single()


def _looked(recording: TossRecording) -> "Observed | Known":
    """Result of one pass over a recording, or what must be known for the next pass."""
    known, settings, noise, interval = recording.known, recording.settings, recording.noise, recording.interval
    samples, gravity, has_angle = recording.samples, recording.dataset.gravity, recording.dataset.has_angle
    if has_angle and known.seeks_lags:
        lag = lag_in_flight(samples, recording.states, recording.lever, gravity)
        if abs(lag) > max(settings.guard, LATE, 1.5 * interval):
            return known.with_lag(lag, interval)
    found = find_hits(samples, recording.clock, noise[0], settings)
    guard = found.guard(noise[0], settings, gravity)
    if rounded := guard > max(settings.guard, 1.5 * interval):  # a guard of one interval is the allowance for one side
        # delayed attitudes make the believed centre of mass sway, as if corners were rounded
        lag = lag_of_attitudes(HitWindows.of(found, recording, noise, settings).fitted) if has_angle else 0.0
        if known.is_late(lag, settings.guard):
            return known.with_lag(lag, interval)
        settings = settings.model_copy(update={"guard": guard})
    if recording.smoothed:
        hits = Hits(found.trial, found.instant, np.ones(len(found.at), bool))
        noise = noise_of_flights(recording.states, recording.times, hits, recording.rig, noise, settings.guard)
    if recording.smoothed or rounded:
        found = find_hits(samples, recording.clock, noise[0], settings)
    windows = HitWindows.of(found, recording, noise, settings)
    lag = lag_of_attitudes(windows.fitted, REST if known.lags else LATE) if has_angle else 0.0
    if known.is_late(lag, settings.guard):
        return known.with_lag(lag, interval)
    G = np.asarray(recording.rig.tensor)
    off = off_free_motion(windows.fitted, windows.pose, windows.tau, windows.used, G, gravity, noise, lag)
    another, grown, slack = has_another_hit(*off)
    windows.leave_out(another, "second_hit")
    seen = Observed(recording, settings, noise, found, windows, grown, slack, lag, rounded)
    seen.leave_out()
    lasts = contact_guard(seen.sunk, seen.approach, of_shape(recording.rig.shape, seen.touching))
    if lasts > CLEARLY * settings.guard:
        return replace(known, guard=max(known.guard, lasts))
    if has_angle and known.ground is None and (ground := Ground.seen(recording.rig, seen.touching)) is not None:
        return replace(known, ground=ground)
    if known.low_pass is None and seen.low_pass is not None and seen.low_pass.moves_parabolas:
        return replace(known, low_pass=seen.low_pass, ground=None)
    return seen


def beside(o: Observations, side: int) -> State:
    """Poses and motions at the hits, before (0) or after (1), under the believed acceleration."""
    return under_gravity(o.lines(side), o.bow[:, side], o.rig)


def hard_hits(o: Observations) -> pd.DataFrame:
    """Hits at corners, edges and faces of the believed hull that change the motion by more than `HARD`, or by an
    unknown amount: trial, impact, kind, and the row of the observation that contains them (−1: none)."""
    assert o.found.contacts is not None
    first = np.repeat(np.arange(len(o)), o.hits)
    number = np.arange(len(first)) - np.repeat(np.cumsum(o.hits) - o.hits, o.hits)
    held = pd.DataFrame({"trial": o.trial[first], "impact": o.impact[first] + number, "row": first})
    table = o.found.contacts.merge(held, how="left", on=["trial", "impact"]).fillna({"row": -1}).astype({"row": int})
    alone = np.flatnonzero((table["row"] >= 0) & (o.span[table["row"]] == 0.0)) if len(o) else []
    table.loc[alone, "jump"] = jump(o)[table["row"].to_numpy()[alone]]
    return table[(table["kind"] != "") & ~(table["jump"] <= HARD)].drop(columns="jump")


def jump(o: Observations) -> np.ndarray:
    """Change of motion √(|Δv|² + Δωᵀ G Δω) (n,) in m/s at each hit, with the believed inertia per mass G."""
    return o.norm(beside(o, 1).v - beside(o, 0).v)
