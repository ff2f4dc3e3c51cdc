"""Observations of a body in space, from the samples of its trajectories.

Everything is seen in the frame (t_1, t_2, n) of the surface.  The centre of mass of a free body moves on a parabola,
whatever the body turns, so that hits are found as in the plane, in its three coordinates (`datasets.impacts.spikes`).
The instant of a hit is where the arcs before and after come closest,

    t_c = −m·Δv / |Δv|²,    m = p⁺ − p⁻ at the time from which t_c counts,

and pose and motion beside it are those of `beside_hits`: lines for the place, torque-free motion for the attitude.

| on paper | in code | unit | shape     |                                                                  |
|----------|---------|------|-----------|------------------------------------------------------------------|
| p        |         | m    | (N, 3)    | believed centre of mass, in the order t_1, n, t_2 for detection   |
|          | `noise` | m, rad |         | one sigma of a coordinate of p, and of each component of a turn   |
"""

from dataclasses import replace

import numpy as np
import pandas as pd
from scipy.stats import chi2

from thesis_lib.bodies.solids import Sphere
from thesis_lib.critique.likelihood.clear_flights import Poses, jumps, seen_beside
from thesis_lib.critique.likelihood.episodes_in_space import HARD, OFF_SURFACE, add_episodes
from thesis_lib.critique.likelihood.flights_in_space import flights_in_space, noise_of_flights
from thesis_lib.critique.likelihood.given_in_space import given_in_space
from thesis_lib.critique.likelihood.observations import Observations, rig_of, without_angle
from thesis_lib.critique.likelihood.supports import supports_in_space
from thesis_lib.datasets.checks.in_space import one_clock, reading_of
from thesis_lib.datasets.checks.tracked_pose import settled
from thesis_lib.datasets.flights.beside_hits import fit_windows, turns_off
from thesis_lib.datasets.flights.lines import SideLines, lines_through
from thesis_lib.datasets.flights.parabolas import Hits
from thesis_lib.datasets.flights.rounding import Kinks, contact_guard, guard_of, rounding_warning, sampling_interval
from thesis_lib.datasets.flights.windows import Windows, sides_of, windows_around
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.frames import body_states, surface_frames, tracked_states
from thesis_lib.datasets.format.header import Header, SpaceHeader
from thesis_lib.datasets.format.samples import ArcSettings, Samples, make_samples, noise_from_differences
from thesis_lib.datasets.format.table_forms import POSITION, QUATERNION
from thesis_lib.datasets.impacts.episodes import MOST_SKIPPED, end_off_line
from thesis_lib.datasets.impacts.found import found_in_space, ordinals
from thesis_lib.datasets.impacts.spikes import detect
from thesis_lib.datasets.impacts.spin import unseen_spin
from thesis_lib.datasets.samples.copies import originals
from thesis_lib.datasets.samples.stamps import times_of_pictures
from thesis_lib.datasets.space.flights import too_slow
from thesis_lib.effects.as_written import RELABELLINGS, AsWritten
from thesis_lib.effects.effect import Rig
from thesis_lib.effects.whole_tosses import WholeTosses
from thesis_lib.foundation.errors import UserError
from thesis_lib.mechanics.contact import contact_at
from thesis_lib.mechanics.inertia import mobility
from thesis_lib.mechanics.space import SPACE
from thesis_lib.mechanics.state import State
from thesis_lib.statistics.spread import MAD_TO_STD, MEDIAN, robust_std

FEWEST = 3  # samples on either side of a hit
IMPROBABLE = 1e-6  # of χ² without another hit in the window
CLEAN = 0.25  # share of the hits that have no other one in their window, at least
ROUNDS = 4  # steps to the instant of a hit; each one moves it by a tenth of a frame at most after the first
SPREAD = 3.0  # robust standard deviations of the gap at hits
MEANS, SMOOTHED = 3, 2.0  # samples in a mean, and how much more noise than that of samples shows a filter
UPWARDS = 5  # of values and slopes of all channels: the slope of n
SURE = 3.0  # standard errors by which a surface pushes a body away, and of a lag of the attitudes
CLEARLY = 1.1  # of the guard, by which contacts last longer
RISE = 0.15  # m/s between hits of a ball; a wrong centre of mass moves speeds by some 0.05 m/s
LATE = 1e-3  # s; arcs that air or a tilt bends meet some 0.2 ms beside the hit
TO_PLANE = [0, 2, 1]  # t_1, n, t_2: detection takes the second coordinate as the height


def observe_in_space(dataset: Dataset, settings: ArcSettings | None = None, episodes: bool = True) -> Observations:
    """Observations of the hits of a dataset in space, as impacts.csv states them, else as trajectories show them.

    What cannot be used has a reason in `found`.

    `episodes`: also hits that follow each other too quickly to see the flight between (`episodes_in_space`).

    Raises:
        UserError: there are several surfaces, the tracked frame is unknown and cannot be found, or a body that is no
            ball has no orientation.
    """
    if dataset.impacts is not None and len(dataset.impacts):
        return given_in_space(dataset)
    whole = dataset.trajectories
    if whole is None:
        raise UserError(f"{dataset.name} has neither trajectories.csv nor impacts.csv; give at least one of them.")
    if len(dataset.in_space.planes) > 1:
        raise UserError(
            f"{dataset.name}: hits in space are found on one surface, and there are several. Give the one that is hit "
            "as `surface`; tosses onto another one are a dataset of their own."
        )
    dataset = settled(dataset)
    turned, lost = np.isfinite(whole["qw"].to_numpy(float)), ()
    if dataset.has_angle and not turned.all():
        lost = (
            f"{np.sum(~turned)} of {len(turned)} rows have no orientation, and no hit or flight is found from them",
        )
        whole = whole[turned]
    header = dataset.in_space
    _require_turns(dataset)
    settings = settings or ArcSettings(min_window=FEWEST)
    whole, told = _as_taken(whole.iloc[np.lexsort((whole["t"], whole["trial"]))], header)
    written, read = (), ()
    if dataset.has_angle and dataset.gravity and (name := reading_of(whole, RELABELLINGS, dataset.gravity)):
        q, P = whole[list(QUATERNION)].to_numpy(float), RELABELLINGS[name]
        whole, written = whole.assign(**dict(zip(QUATERNION, (q @ P).T))), (AsWritten(P),)
        read = (f"as they are written, quaternions let no body fall freely; hits and flights are found with {name}",)
    (frame,) = surface_frames(header)
    states, rig = frame.seen(body_states(tracked_states(whole), header)), rig_of(dataset)
    clock = Header.model_validate(  # what detection asks of a dataset in the plane: a third coordinate is in m, too
        {"schema": 1, "body": {"shape": {"kind": "disk", "radius": 2.0}, "radius_of_gyration": 1.0}}
        | {"gravity": dataset.gravity, "rate": dataset.rate}
    )
    samples = make_samples(states.trial, states.t, states.position[TO_PLANE].T, clock, settings)
    noise, smoothed = _noise(samples, states, header)
    times = one_clock(whole)[1]
    at, windows, t, t_std, side, dv = _found(samples, clock, noise[0], settings)
    strong = (dv**2).sum(axis=1) >= np.median((dv**2).sum(axis=1)) if len(at) else np.zeros(0, bool)
    kinks = Kinks(at, t + windows.t_0, dv, strong)
    guard = guard_of(kinks, samples, np.full(3, noise[0]), settings, both=True)
    if guard > max(settings.guard, 1.5 * sampling_interval(samples)):  # of one interval is that of one side
        told += rounding_warning(guard, settings.guard, 0.0, sampling_interval(samples), None)
        settings = settings.model_copy(update={"guard": guard})
    if smoothed:
        hits = Hits(samples.trial[at], kinks.t, np.ones(len(at), bool))
        noise = noise_of_flights(states, times, hits, rig, noise, settings.guard)
    if smoothed or guard == settings.guard:
        at, windows, t, t_std, side, _ = _found(samples, clock, noise[0], settings)
    trial, reason = samples.trial[at], np.full(len(at), "", object)
    near = np.r_[False, windows.same_trial] | np.r_[windows.same_trial, False] if len(at) else np.zeros(0, bool)
    short = side.sum(2).min(1) < settings.min_window
    reason[short] = np.where(near[short], "second_hit", "window_too_short")
    rows = np.flatnonzero(reason == "")
    index = np.clip(at[rows, None] + np.arange(-settings.max_window, settings.max_window + 2), 0, len(samples) - 1)
    pose, tau = np.moveaxis(states.pose[:, index], 0, -1), windows.t[rows] - t[rows, None]
    used, G = side[rows] > 0.0, header.body.inertia_per_mass
    fitted = fit_windows(pose, tau, used, G, noise)
    lag = _lag(fitted)
    if abs(lag) > settings.guard:
        return observe_in_space(dataset, settings.model_copy(update={"guard": CLEARLY * abs(lag)}), episodes)
    told += lag_warning(lag)
    off, dof = _off_free_motion(fitted, pose, tau, used, G, dataset.gravity, noise, lag)
    # noise beyond what is believed shows in all hits, another hit in many: boxes that land on an edge rattle
    grown = np.maximum(np.quantile(off / dof, CLEAN, axis=0), 1.0) if len(rows) else np.ones(2)
    # a filter leaves as much noise in a line, but in fewer degrees of freedom
    free = np.quantile(off / chi2.ppf(CLEAN, dof), CLEAN, axis=0) if len(rows) else np.ones(2)
    off, dof = off / grown, dof * np.minimum(free, 1.0)
    reason[rows[(off > chi2.isf(IMPROBABLE, dof)).any(axis=1)]] = "second_hit"
    lines = State.of(fitted.value[:, 0], fitted.slope[:, 0], trial[rows], t[rows], space=SPACE)
    first = _under_gravity(lines, fitted.bow[:, 0], rig)
    off_by = rig.gap(first)
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
    for which, why in ((elsewhere, "off_surface"), (leaves, "no_approach"), (unpushed, "no_push")):
        reason[rows[which & (reason[rows] == "")]] = why
    if isinstance(header.body.solid, Sphere):
        bounces = np.flatnonzero(reason[rows] == "")
        second = State.of(fitted.value[:, 1], fitted.slope[:, 1], trial[rows], t[rows], space=SPACE)
        rebound = _under_gravity(second, fitted.bow[:, 1], rig).velocity[2]
        speeds = np.stack([-first.velocity[2], rebound], axis=1)[bounces]
        rises = np.zeros(len(at), int)
        rises[rows[bounces]] = _risen(speeds, trial[rows[bounces]])
        count = np.r_[0, rises.cumsum()]
        rolls = count[1:] > count[np.searchsorted(trial, trial)]  # from the first rise of its trial on
        reason[rolls & np.isin(reason, ("", "second_hit"))] = "no_bounce"
    kept = reason[rows] == ""
    lasts = contact_guard(-off_by[kept], approach_speed(first.select(np.flatnonzero(kept)), rig))
    if lasts > CLEARLY * settings.guard:
        return observe_in_space(dataset, settings.model_copy(update={"guard": lasts}), episodes)
    inner = samples.t[index[kept]]  # of the samples used: the last before and the first after
    edges = {
        "start": np.where(used[kept, 0], inner, -np.inf).max(axis=1, initial=-np.inf),
        "end": np.where(used[kept, 1], inner, np.inf).min(axis=1, initial=np.inf),
    }
    counts = dict(zip(("n_pre", "n_post"), used[kept].sum(axis=2).T))
    detected = _between_samples(states, samples, at, t + windows.t_0)
    rows, sigma = rows[kept], np.repeat(np.sqrt(grown), 6)
    since = t + windows.t_0 - _first_sample(samples)[at]
    rig = replace(rig, recorded=WholeTosses.of(states, trial, since))
    hits = Hits(trial, t + windows.t_0, reason == "")
    seen, touching = (noise[0] * sigma[0], noise[1] * sigma[-1]), _touching(off_by[kept])
    all_hits = pd.DataFrame({"trial": trial, "impact": ordinals(trial), "t": t + windows.t_0, "reason": reason})
    poses = Poses(samples, states, rig, seen)
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
        t_std=t_std[rows],
        offset=np.zeros((len(rows), 3)),
        arcs=True,
        flights=flights_in_space(states, times, hits, rig, noise, _touching(off_by[kept])[1], settings.guard),
        supports=supports_in_space(states, samples, hits, rig, noise) if dataset.has_angle else (),
        noise_known=True,
        found=replace(
            found_in_space(header, detected, ordinals(trial), reason, jumps(poses, all_hits, nearby), seen),
            warnings=tuple(filter(None, (*lost, *read, *told, too_slow(dataset.rate)))),
        ),
        written=written,
    )
    if not dataset.has_angle:
        return without_angle(single, unseen_spin(np.linalg.norm(beside(single, 0).velocity, axis=0), header))
    if not episodes:
        return single
    return add_episodes(single, poses, all_hits, pd.DataFrame(edges | counts), nearby, touching)


def _between_samples(states: State, samples: Samples, at: np.ndarray, t: np.ndarray) -> State:
    """States (n,) at the instants `t` (n,) in s between the samples `at` (n,) and the next ones, attitudes turned."""
    first, last = states.attitude[:, at], states.attitude[:, at + 1]
    share = np.clip((t - samples.t[at]) / (samples.t[at + 1] - samples.t[at]), 0.0, 1.0)
    attitude = SPACE.attitude_after(first, share * SPACE.turn_between(first, last))
    return State(states.pose[:, at], states.motion[:, at], samples.trial[at], t, None, SPACE).changed(attitude=attitude)


def _touching(gap: np.ndarray) -> tuple[float, float]:
    """Lowest and highest gap in m at which the body touches, of gaps (n,) at hits by the geometry that is believed."""
    if not len(gap):
        return -np.inf, -np.inf
    middle, spread = float(np.median(gap)), SPREAD * float(robust_std(gap - np.median(gap)))
    return middle - spread, middle + spread


def _as_taken(table: pd.DataFrame, header: SpaceHeader) -> tuple[pd.DataFrame, tuple[str, ...]]:
    """Rows without copies of pictures, at the times at which these were taken, and sentences on what was changed."""
    trial, pose = table["trial"].to_numpy(), table[[*POSITION, *QUATERNION]].to_numpy(float)
    pose = pose[:, np.isfinite(pose).all(axis=0)]
    samples = Samples(trial, table["t"].to_numpy(float), pose, np.unique(trial, return_inverse=True)[1])
    keep, copied = originals(samples)
    samples, table = replace(samples.select(keep), q=samples.q[keep, :3]), table[keep]
    # pictures that were taken at a lower rate than stated may have been shown late
    if found := times_of_pictures(samples, None if copied else header.rate, lengths=3):
        sure, t, stamped = found
        return table[sure].assign(t=t), tuple(filter(None, (copied, stamped)))
    return table, (copied,) * bool(copied)


def _require_turns(dataset: Dataset) -> None:
    """UserError for a body whose orientation must be seen, and is not."""
    header = dataset.in_space
    if dataset.has_angle:
        return
    assert header.tracked is not None
    at = np.array(header.tracked.position)
    if not isinstance(header.body.solid, Sphere) or np.abs(header.body.centre).max() > 0.0:
        raise UserError(
            f"{dataset.name}: without orientation only hits of a ball can be found, whose centre of mass is its middle."
        )
    if np.abs(at - header.body.centre).max() > 0.0:
        raise UserError(
            f"{dataset.name}: without orientation nobody knows where the centre of mass is, as it is not the tracked "
            "point. Leave `tracked` out if that is the middle of the ball."
        )


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


def _noise(samples: Samples, states: State, header: SpaceHeader) -> tuple[tuple[float, float], bool]:
    """One sigma of the centre of mass in m and of a turn in rad, and whether it is a guess for smoothed samples.

    As stated, and at least what the samples show.  Noise that a filter has smoothed is that of white noise with the
    same effect on lines.
    """
    same = (samples.run[2:] == samples.run[:-2])[:, None]
    turns = SPACE.turn_between(states.attitude[:, :-1], states.attitude[:, 1:]).T
    seen = np.abs(np.diff(turns, axis=0))[same[:, 0]]
    rotation = float(np.median(seen[seen > 0.0])) * MAD_TO_STD / np.sqrt(6.0) if (seen > 0.0).any() else 0.0
    position, smoothed = _noise_of_means(samples, 1), _noise_of_means(samples, MEANS)
    if is_smoothed := smoothed > SMOOTHED * position:
        position, rotation = smoothed, rotation * smoothed / position
    if (stated := header.noise) is not None:
        rotation = stated.rotation or rotation
        if stated.position is not None and header.tracked is not None:
            arm = np.linalg.norm(header.body.centre - np.array(header.tracked.position))  # across which a turn is one
            stated_position = np.sqrt(np.mean(np.square(stated.position)) + 2.0 / 3.0 * (arm * rotation) ** 2)
            position = max(position, float(stated_position))
    return (max(position, 1e-7), max(rotation, 1e-7)), is_smoothed and stated is None


def _noise_of_means(samples: Samples, size: int) -> float:
    """Noise of a coordinate in m by the means of `size` neighbours, times √size: the same for white noise."""
    first = np.flatnonzero(np.diff(samples.run, prepend=-1))
    within = np.arange(len(samples)) - np.repeat(first, np.diff(np.r_[first, len(samples)]))
    starts = np.flatnonzero((within % size == 0)[: len(samples) - size + 1])
    rows = starts[samples.run[starts] == samples.run[starts + size - 1], None] + np.arange(size)
    means = replace(samples.select(rows[:, 0]), t=samples.t[rows].mean(axis=1), q=samples.q[rows].mean(axis=1))
    return float(np.sqrt(size * np.nanmean(noise_from_differences(means) ** 2)))


def _found(
    samples: Samples, clock: Header, sigma: float, settings: ArcSettings
) -> tuple[np.ndarray, Windows, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """The samples before hits, their windows, and what `_instants` returns of these."""
    at = detect(samples, clock, np.full(3, sigma), settings)
    # the instant of a hit with another one near runs away, and would leave the flight beside it a sample behind the hit
    windows = windows_around(samples, at, settings.max_window, beyond=0)
    return at, windows, *_instants(windows, clock.gravity, sigma, settings)


def _instants(
    windows: Windows, gravity: float, sigma: float, settings: ArcSettings
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Instants (n,) in s from `t_0`, their standard deviation, the samples used (n, 2, W), 0 or 1, and the changes of
    velocity (n, 3) in m/s."""
    t, n = np.zeros(len(windows.t_0)), len(windows.t_0)
    side, lines, dv = np.zeros((n, 2, windows.t.shape[1])), None, np.zeros((n, 3))
    for _ in range(ROUNDS):
        side = sides_of(windows, t, settings, None)
        tau = windows.t - t[:, None]
        falls = windows.q + 0.5 * gravity * (tau**2)[..., None] * [0.0, 1.0, 0.0]
        for way, used in ((1, side[:, 0]), (-1, side[:, 1])):
            for _ in range(MOST_SKIPPED):  # the next hit may have come earlier than it was detected
                used *= 1.0 - end_off_line(used, tau, falls, np.full(3, sigma), way)
        lines = lines_through(side, tau, falls)
        dv, miss = lines.slope[:, 1] - lines.slope[:, 0], lines.value[:, 1] - lines.value[:, 0]
        t = np.clip(t - (miss * dv).sum(1) / np.maximum((dv * dv).sum(1), 1e-9), windows.low, windows.high)
    if lines is None:
        return t, t, side, dv
    unit = 1.0 / np.maximum(lines.count, 1.0) + lines.mean**2 / np.where(lines.spread > 0.0, lines.spread, np.inf)
    t_std = sigma * np.sqrt(unit.sum(1)) / np.maximum(np.linalg.norm(dv, axis=1), 1e-9)
    return t, t_std, side, dv


def _off_free_motion(
    fitted: SideLines,
    pose: np.ndarray,
    tau: np.ndarray,
    used: np.ndarray,
    G: np.ndarray,
    gravity: float,
    noise: tuple[float, float],
    lag: float,
) -> tuple[np.ndarray, np.ndarray]:
    """χ² (n, 2) by which places and turns miss free motion on both sides and its meeting, and degrees of freedom (n,).

    The places may not meet along Δv, which the instant takes up, and turns that come `lag` in s behind them meet later.
    """
    off, dof = np.zeros((len(tau), 2)), 3.0 * used.sum((1, 2)) - 10.0  # 12 parameters, 2 of the places meet
    if not len(tau):
        return off, off
    fall = 0.5 * gravity * np.array([0.0, 0.0, 1.0])
    places = lines_through(used * 1.0, tau, pose[:, :, :3] + fall * (tau**2)[..., None])
    off[:, 0] = (used[..., None] * places.residual**2).sum((1, 2, 3)) / noise[0] ** 2
    for side in (0, 1):
        off[:, 1] += turns_off(fitted, side, pose, tau, used, G) / noise[1] ** 2
    miss, dv = (part[:, 1] - part[:, 0] for part in (places.value, places.slope))
    aside = miss - (miss * dv).sum(1, keepdims=True) / np.maximum((dv * dv).sum(1, keepdims=True), 1e-9) * dv
    place = fitted.cov[:, :, [0, 2, 4], [0, 2, 4]].sum(axis=1).mean(axis=1)
    off[:, 0] += (aside**2).sum(axis=1) / place
    turn, spun = _turned(fitted)
    turn += lag * spun
    of_turn = fitted.cov[:, :, 6::2, 6::2].sum(axis=1)
    off[:, 1] += np.einsum("ni,nij,nj->n", turn, np.linalg.inv(of_turn), turn)
    return off, np.stack([dof, dof + 1.0], axis=1)


def _risen(speeds: np.ndarray, trial: np.ndarray) -> np.ndarray:
    """At which hits (n,) of a ball its speed across the surface (n, 2), before and after a hit, has risen.

    A ball bounces lower and lower, and then it rolls.  Where it is not tracked in its middle and its turns are misread,
    a ball that rolls seems to rise and to fall.
    """
    risen = np.zeros(len(speeds), bool)
    for one in np.unique(trial):
        here = np.flatnonzero(trial == one)
        series = speeds[here].ravel()
        rises = series[1:] - np.minimum.accumulate(series)[:-1] > RISE
        risen[here] = np.r_[False, rises].reshape(-1, 2).any(axis=1)
    return risen


def _turned(fitted: SideLines) -> tuple[np.ndarray, np.ndarray]:
    """Turns (n, 3) in rad from the attitudes before hits to those after, and changes (n, 3) of the spin in rad/s."""
    turn = SPACE.turn_between(fitted.value[:, 0, 3:].T, fitted.value[:, 1, 3:].T).T
    return turn, fitted.slope[:, 1, 3:] - fitted.slope[:, 0, 3:]


def _lag(fitted: SideLines) -> float:
    """Time in s by which attitudes change their course later than places do, 0 where that is not clear.

    Attitudes that come a time L late miss each other by −L Δω where the places meet.  Samples taken meanwhile belong to
    neither flight.
    """
    turn, spun = _turned(fitted)
    square = (spun**2).sum(axis=1)
    strong = square >= np.median(square) if len(square) else np.zeros(0, bool)
    if strong.sum() < FEWEST:
        return 0.0
    late = -(turn * spun).sum(axis=1)[strong] / np.maximum(square[strong], 1e-9)
    middle, error = float(np.median(late)), MEDIAN * float(robust_std(late - np.median(late))) / np.sqrt(strong.sum())
    return middle if abs(middle) > max(SURE * error, LATE) else 0.0


def lag_warning(lag: float) -> tuple[str, ...]:
    """A sentence for the user on attitudes that come `lag` in s behind the places, if they do."""
    if not lag:
        return ()
    where = "behind" if lag > 0.0 else "ahead of"
    return (
        f"At hits orientations come {1e3 * abs(lag):.2g} ms {where} positions, as if they had a clock or a filter of "
        "their own. Samples within that time of a hit belong to no flight and are not used.",
    )


def _first_sample(samples: Samples) -> np.ndarray:
    """Time (N,) in s of the first sample of each sample's trial."""
    first = np.flatnonzero(np.r_[True, samples.trial[1:] != samples.trial[:-1]])
    return np.repeat(samples.t[first], np.diff(np.r_[first, len(samples)]))
