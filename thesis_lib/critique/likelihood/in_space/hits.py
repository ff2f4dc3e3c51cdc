"""Observations of a body in space, from the samples of its trajectories.

Everything is seen in the frame (t_1, t_2, n) of the surface.  The instant of a hit is where the arcs of the centre of
mass come closest (`instants`); pose and motion beside it are those of `beside_hits`: lines for the place, torque-free
motion for the attitude.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd

from thesis_lib.bodies.solids import Sphere
from thesis_lib.critique.likelihood.in_space.clear_flights import Poses, jumps, seen_beside
from thesis_lib.critique.likelihood.in_space.episodes import ELSEWHERE, HARD, OFF_SURFACE, add_episodes
from thesis_lib.critique.likelihood.in_space.flights import flights_in_space, noise_of_flights
from thesis_lib.critique.likelihood.in_space.given import given_in_space
from thesis_lib.critique.likelihood.in_space.ground import Ground, SeenRig, of_shape
from thesis_lib.critique.likelihood.in_space.instants import (
    FoundHits,
    between_samples,
    find_hits,
    first_sample,
    noise_of_samples,
    readable,
    turning_pull,
    with_attitudes_later,
)
from thesis_lib.critique.likelihood.in_space.lag import LATE, REST, lag_in_flight, lag_of_attitudes, lag_warning
from thesis_lib.critique.likelihood.in_space.left_out import has_another_hit, hops_unseen, off_free_motion, rolls
from thesis_lib.critique.likelihood.observations import Observations, rig_of, without_angle
from thesis_lib.critique.likelihood.supports import supports_in_space
from thesis_lib.datasets.checks.in_space import one_clock
from thesis_lib.datasets.checks.lasting_contacts import lasting_contacts
from thesis_lib.datasets.checks.tracked_pose import settled
from thesis_lib.datasets.flights.beside_hits import fit_windows
from thesis_lib.datasets.flights.lines import SideLines
from thesis_lib.datasets.flights.low_pass import LowPass, low_pass_of
from thesis_lib.datasets.flights.parabolas import Hits
from thesis_lib.datasets.flights.rounding import contact_guard, rounding_warning, sampling_interval
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.frames import body_states, surface_frames, tracked_states
from thesis_lib.datasets.format.header import Header
from thesis_lib.datasets.format.samples import ArcSettings, make_samples
from thesis_lib.datasets.impacts.found import Away, found_in_space, ordinals
from thesis_lib.datasets.impacts.spin import unseen_spin
from thesis_lib.datasets.space.flights import too_slow
from thesis_lib.effects.as_written import AsStamped
from thesis_lib.effects.effect import Rig
from thesis_lib.effects.whole_tosses import WholeTosses
from thesis_lib.foundation.errors import UserError
from thesis_lib.mechanics.contact import contact_at
from thesis_lib.mechanics.inertia import mobility
from thesis_lib.mechanics.space import SPACE
from thesis_lib.mechanics.state import State
from thesis_lib.statistics.spread import robust_std

FEWEST = 3  # samples on either side of a hit
SPREAD = 3.0  # robust standard deviations of the gap at hits
UPWARDS = 5  # of values and slopes of all channels: the slope of n
SURE = 3.0  # standard errors by which a surface pushes a body away
MOST_LAGS = 6  # steps to the lag of orientations; each one leaves less than half of it
CLEARLY = 1.1  # of the guard, by which contacts last longer
TO_PLANE = [0, 2, 1]  # t_1, n, t_2: detection takes the second coordinate as the height


@dataclass(frozen=True)
class Known:
    """What earlier looks at the same samples have found.

    Attributes:
        lags: times in s by which orientations come later than positions, each after those before it.
        low_pass: a filter that has lowered all free falls.
        ground: where bodies touch, if it is elsewhere than believed.
    """

    lags: tuple[float, ...] = ()
    low_pass: LowPass | None = None
    ground: Ground | None = None


NOTHING = Known()


def observe_in_space(
    dataset: Dataset, settings: ArcSettings | None = None, episodes: bool = True, known: Known = NOTHING
) -> Observations:
    """Observations of the hits of a dataset in space, as impacts.csv states them, else as trajectories show them.

    What cannot be used has a reason in `found`.

    `episodes`: also hits that follow each other too quickly to see the flight between (`episodes_in_space`).
    `known`: what earlier looks at the same samples have found.

    Raises:
        UserError: there are several surfaces, the tracked frame is unknown and cannot be found, or a body other
            than a ball has no orientation.
    """
    if dataset.impacts is not None and len(dataset.impacts):
        return given_in_space(dataset)
    if dataset.trajectories is None:
        raise UserError(f"{dataset.name} has neither trajectories.csv nor impacts.csv; give at least one of them.")
    if len(dataset.in_space.planes) > 1:
        raise UserError(
            f"{dataset.name}: hits in space are found on one surface, and there are several. Give the one that is hit "
            "as `surface`; tosses onto another one are a dataset of their own."
        )
    dataset, settings = settled(dataset), settings or ArcSettings(min_window=FEWEST)
    header, given = dataset.in_space, settings
    whole, written, told = readable(dataset)
    if late := sum(known.lags):
        whole, written = with_attitudes_later(whole, late), (*written, AsStamped(late))
    (frame,) = surface_frames(header)
    tracked, rig = tracked_states(whole), rig_of(dataset)
    states = frame.seen(body_states(tracked, header))
    if (low_pass := known.low_pass) is not None:
        pull = rig.fall(states)[:3] + turning_pull(states, frame.seen(tracked).position - states.position)
        states = states.changed(states.position - 0.5 * low_pass.second_moment * pull)
    clock = Header.model_validate(  # what detection asks of a dataset in the plane: a third coordinate is in m, too
        {"schema": 1, "body": {"shape": {"kind": "disk", "radius": 2.0}, "radius_of_gyration": 1.0}}
        | {"gravity": dataset.gravity, "rate": dataset.rate}
    )
    samples = make_samples(states.trial, states.t, states.position[TO_PLANE].T, clock, settings)
    noise, smoothed = noise_of_samples(samples, states, header)
    times, interval = one_clock(whole)[1], sampling_interval(samples)
    if (soft := lasting_contacts(samples, rig.gap(states), noise[0], dataset.gravity, tumbles=True)) is not None:
        told += (soft.sentence(),)

    def again(least: float, **found: Any) -> Observations:
        changed = given.model_copy(update={"guard": max(given.guard, least)})
        return observe_in_space(dataset, changed, episodes, replace(known, **found))

    def is_late(lag: float, guard: float) -> bool:
        return abs(lag) > (0.0 if known.lags else guard) and len(known.lags) < MOST_LAGS

    if dataset.has_angle and len(known.lags) < MOST_LAGS:
        lag = lag_in_flight(samples, states, frame.seen(tracked).position - states.position, dataset.gravity)
        if abs(lag) > max(given.guard, LATE, 1.5 * interval):
            return again(interval, lags=(*known.lags, lag))
    found, G = find_hits(samples, clock, noise[0], settings), header.body.inertia_per_mass
    guard = found.guard(noise[0], settings, dataset.gravity)
    if rounded := guard > max(settings.guard, 1.5 * interval):  # of one interval is that of one side
        # attitudes that come late let the believed centre of mass sway, as if corners were rounded
        lag = lag_of_attitudes(_beside(found, states, G, noise, settings)[-1]) if dataset.has_angle else 0.0
        if is_late(lag, settings.guard):
            return again(interval, lags=(*known.lags, lag))
        settings = settings.model_copy(update={"guard": guard})
    if smoothed:
        hits = Hits(found.trial, found.instant, np.ones(len(found.at), bool))
        noise = noise_of_flights(states, times, hits, rig, noise, settings.guard)
    if smoothed or rounded:
        found = find_hits(samples, clock, noise[0], settings)
    at, trial, instant = found.at, found.trial, found.instant
    reason, index, pose, tau, used, fitted = _beside(found, states, G, noise, settings)
    rows = np.flatnonzero(reason == "")
    lag = lag_of_attitudes(fitted, REST if known.lags else LATE) if dataset.has_angle else 0.0
    if is_late(lag, settings.guard):
        # an attitude between two samples is of neither flight where there was a hit between them
        return again(interval, lags=(*known.lags, lag))
    told += lag_warning(late + lag)
    second_hit, grown, slack = has_another_hit(
        *off_free_motion(fitted, pose, tau, used, G, dataset.gravity, noise, lag)
    )
    reason[rows[second_hit]] = "second_hit"
    since = instant - first_sample(samples)[at]
    lines, later = (
        State.of(fitted.value[:, side], fitted.slope[:, side], trial[rows], since[rows], space=SPACE) for side in (0, 1)
    )
    first, second = (_under_gravity(of, fitted.bow[:, side], rig) for side, of in enumerate((lines, later)))
    looks = SeenRig(**vars(rig), ground=known.ground)
    sunk, off_by = -rig.gap(first), looks.gap(first)
    # geometry that is believed wrongly moves all of them alike
    elsewhere = (
        np.abs(off_by - np.median(off_by)) > OFF_SURFACE * rig.shape.extent if len(off_by) else np.zeros(0, bool)
    )
    leaves = contact_velocity(first, rig)[2] >= 0.0
    push = (
        fitted.slope[:, 1, 2] - fitted.slope[:, 0, 2] - rig.fall(lines)[2] * (fitted.bow[:, 1, 1] - fitted.bow[:, 0, 1])
    )
    of_push = np.sqrt(grown[0] * fitted.cov[:, :, UPWARDS, UPWARDS].sum(axis=1))
    unpushed = push < SURE * of_push
    for which, why in ((elsewhere, ELSEWHERE), (leaves, "no_approach"), (unpushed, "no_push")):
        reason[rows[which & (reason[rows] == "")]] = why
    if rounded:
        alone = np.flatnonzero(reason[rows] == "")
        met = first.select(alone)
        speeds = np.stack([-contact_velocity(met, rig)[2], contact_velocity(second.select(alone), rig)[2]], axis=1)
        hopped = hops_unseen(-off_by[alone], speeds, of_shape(rig.shape, met), settings.guard)
        reason[rows[alone[hopped]]] = "second_hit"
    if isinstance(header.body.solid, Sphere):
        bounces = np.flatnonzero(reason[rows] == "")
        speeds = np.stack([-first.velocity[2], second.velocity[2]], axis=1)[bounces]
        reason[rolls(speeds, rows[bounces], trial) & np.isin(reason, ("", "second_hit"))] = "no_bounce"
    kept = reason[rows] == ""
    touching_first = first.select(np.flatnonzero(kept))
    lasts = contact_guard(sunk[kept], approach_speed(touching_first, rig), of_shape(rig.shape, touching_first))
    if lasts > CLEARLY * settings.guard:
        return again(lasts)
    if dataset.has_angle and known.ground is None and (ground := Ground.seen(rig, touching_first)) is not None:
        return again(0.0, ground=ground)
    hits = Hits(trial, instant, reason == "")
    flights = flights_in_space(states, times, hits, looks, noise, _touching(off_by[kept])[1], settings.guard)
    if rounded and soft is None:
        lasting = max(float(np.median(sunk[kept] / approach_speed(touching_first, rig))), 0.0) if kept.any() else 0.0
        gravity = -float(np.median(flights.acceleration[:, 2])) if len(flights) else dataset.gravity
        corners, sigma = found.corners(reason == "", gravity), np.full(3, noise[0])
        seen_filter = low_pass_of(corners, samples, sigma, gravity, settings.guard, interval, lasting)
        if low_pass is None and seen_filter is not None and seen_filter.moves_parabolas:
            return again(0.0, low_pass=seen_filter, ground=None)
        low_pass = low_pass or seen_filter
        told += rounding_warning(settings.guard, given.guard, lasting, interval, low_pass)
    inner = samples.t[index[kept]]  # of the samples used: the last before and the first after
    edges = {
        "start": np.where(used[kept, 0], inner, -np.inf).max(axis=1, initial=-np.inf),
        "end": np.where(used[kept, 1], inner, np.inf).min(axis=1, initial=np.inf),
    }
    away = np.flatnonzero(reason[rows] == ELSEWHERE)
    middle = (used[away] * tau[away, None]).sum(axis=2) / used[away].sum(axis=2)
    counts = dict(zip(("n_pre", "n_post"), used[kept].sum(axis=2).T))
    detected = between_samples(states, samples, at, instant)
    rows, sigma = rows[kept], np.repeat(np.sqrt(grown), 6)
    rig = replace(rig, recorded=WholeTosses.of(states, trial, since))
    seen, touching = (noise[0] * sigma[0], noise[1] * sigma[-1]), _touching(off_by[kept])
    all_hits = pd.DataFrame({"trial": trial, "impact": ordinals(trial), "t": instant, "reason": reason})
    poses = Poses(samples, states, looks, seen, float(slack.max()))
    nearby = seen_beside(poses, all_hits, touching[1] if kept.any() else 0.0, settings)
    single = Observations(
        rig=rig,
        trial=trial[rows],
        surface=np.zeros(len(rows), int),
        impact=ordinals(trial)[rows],
        hits=np.ones(len(rows), int),
        t=since[rows],
        span=np.zeros(len(rows)),
        **{name: getattr(fitted, name)[kept] for name in ("value", "slope", "bow", "nodes", "weights")},
        cov=fitted.cov[kept] * np.outer(sigma, sigma),
        t_std=found.t_std[rows],
        offset=np.zeros((len(rows), 3)),
        arcs=True,
        flights=flights,
        supports=supports_in_space(states, samples, hits, rig, noise) if dataset.has_angle else (),
        noise_known=True,
        found=replace(
            found_in_space(header, detected, ordinals(trial), reason, jumps(poses, all_hits, nearby), seen),
            low_pass=low_pass,
            soft=soft,
            away=Away(first.select(away), second.select(away), middle),
            warnings=tuple(filter(None, (*told, too_slow(dataset.rate)))),
        ),
        written=written,
    )
    if not dataset.has_angle:
        return without_angle(single, unseen_spin(np.linalg.norm(beside(single, 0).velocity, axis=0), header))
    if not episodes:
        return single
    return add_episodes(single, poses, all_hits, pd.DataFrame(edges | counts), nearby, touching)


def _beside(
    found: FoundHits, states: State, G: np.ndarray, noise: tuple[float, float], settings: ArcSettings
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, SideLines]:
    """Why hits (n,) have too few samples beside them, "" where they have enough, and of those m the rows (m, W) of the
    samples, their poses (m, W, 7), times (m, W) in s from the hit, which are used (m, 2, W), and what fits them."""
    at, side, windows = found.at, found.side, found.windows
    reason = np.full(len(at), "", object)
    near = np.r_[False, windows.same_trial] | np.r_[windows.same_trial, False] if len(at) else np.zeros(0, bool)
    short = side.sum(2).min(1) < settings.min_window
    reason[short] = np.where(near[short], "second_hit", "window_too_short")
    rows, reach = np.flatnonzero(reason == ""), np.arange(-settings.max_window, settings.max_window + 2)
    index = np.clip(at[rows, None] + reach, 0, len(found.samples) - 1)
    pose, tau = np.moveaxis(states.pose[:, index], 0, -1), windows.t[rows] - found.t[rows, None]
    used = side[rows] > 0.0
    return reason, index, pose, tau, used, fit_windows(pose, tau, used, G, noise)


def _touching(gap: np.ndarray) -> tuple[float, float]:
    """Lowest and highest gap in m at which the body touches, of gaps (n,) at hits by the geometry that is believed."""
    if not len(gap):
        return -np.inf, -np.inf
    middle, spread = float(np.median(gap)), SPREAD * float(robust_std(gap - np.median(gap)))
    return middle - spread, middle + spread


def beside(o: Observations, side: int) -> State:
    """Poses and motions at the hits, before (0) or after (1), under the believed acceleration."""
    return _under_gravity(o.lines(side), o.bow[:, side], o.rig)


def _under_gravity(lines: State, bow: np.ndarray, rig: Rig) -> State:
    """Poses and motions of lines (`lines`) with a bow (n, 2), under the believed acceleration."""
    a, (b_0, b_1) = rig.fall(lines)[:3], bow.T
    return lines.changed(position=lines.position - a * b_0, velocity=lines.velocity - a * b_1)


def contact_velocity(state: State, rig: Rig) -> np.ndarray:
    """Velocity (3, n) in m/s of the lowest point of the believed body."""
    return SPACE.velocity_at(state.velocity, state.spin, rig.lowest(state))


def approach_speed(state: State, rig: Rig) -> np.ndarray:
    """|v_n|/√K_nn (n,) in m/s of the contact points of believed bodies."""
    of_turns = mobility(SPACE, np.asarray(rig.tensor), state.attitude)
    at = contact_at(SPACE, state.velocity, state.spin, rig.lowest(state), of_turns)
    return np.abs(at.v_n) / np.sqrt(at.K_nn)


def hard_hits(o: Observations) -> pd.DataFrame:
    """The hits at corners, edges and faces of the believed hull that change the motion by more than `HARD`, or by
    nobody knows how much: trial, impact, kind, and the row of the observation that holds them, −1 if none does."""
    assert o.found.contacts is not None
    first = np.repeat(np.arange(len(o)), o.hits)
    number = np.arange(len(first)) - np.repeat(np.cumsum(o.hits) - o.hits, o.hits)
    held = pd.DataFrame({"trial": o.trial[first], "impact": o.impact[first] + number, "row": first})
    table = o.found.contacts.merge(held, how="left", on=["trial", "impact"]).fillna({"row": -1}).astype({"row": int})
    alone = np.flatnonzero((table["row"] >= 0) & (o.span[table["row"]] == 0.0)) if len(o) else []
    table.loc[alone, "jump"] = jump(o)[table["row"].to_numpy()[alone]]
    return table[(table["kind"] != "") & ~(table["jump"] <= HARD)].drop(columns="jump")


def jump(o: Observations) -> np.ndarray:
    """√(|Δv|² + Δωᵀ G Δω) (n,) in m/s of each hit, G the believed inertia per mass."""
    return o.norm(beside(o, 1).v - beside(o, 0).v)
