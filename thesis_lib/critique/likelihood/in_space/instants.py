"""Detection of hits in the samples of a recording in space: noise of the samples, and instants of the hits.

The centre of mass of a free body moves on a parabola for any rotation; hits are therefore detected as in the plane, in
its three coordinates (`datasets.impacts.spikes`).  The instant of a hit is where the arcs before and after are
closest,

    t_c = −m·Δv / |Δv|²,    m = p⁺ − p⁻ at the origin of t_c

| on paper | in code | unit   | shape  |                                                                  |
|----------|---------|--------|--------|------------------------------------------------------------------|
| p        |         | m      | (N, 3) | believed centre of mass, in the order t_1, n, t_2 for detection   |
|          | `noise` | m, rad |        | one sigma of a coordinate of p, and of each component of a turn   |
"""

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from thesis_lib.bodies.solids import Sphere
from thesis_lib.datasets.checks.in_space import reading_of
from thesis_lib.datasets.checks.jumps import LOST, out_and_back
from thesis_lib.datasets.flights.drag import drag_in_space
from thesis_lib.datasets.flights.lines import Windows, lines_through, sides_of, windows_around
from thesis_lib.datasets.flights.low_pass import ARC, Corners
from thesis_lib.datasets.flights.rounding import ENOUGH, Kinks, guard_of
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.header import Header, SpaceHeader
from thesis_lib.datasets.format.samples import ArcSettings, Samples, noise_from_differences
from thesis_lib.datasets.format.table_forms import POSITION, QUATERNION
from thesis_lib.datasets.impacts.episodes import MOST_SKIPPED, end_off_line
from thesis_lib.datasets.impacts.spikes import detect
from thesis_lib.datasets.samples.copies import originals
from thesis_lib.datasets.samples.stamps import times_of_pictures
from thesis_lib.effects.as_written import RELABELLINGS, AsWritten
from thesis_lib.foundation.errors import UserError
from thesis_lib.mechanics.space import SPACE, cross
from thesis_lib.mechanics.state import State
from thesis_lib.statistics.spread import MAD_TO_STD

MEANS, SMOOTHED = 3, 2.0  # samples in a mean, and ratio to the noise of single samples that indicates a filter
ROUNDS = 4  # iterations for the instant of a hit; after the first, each moves it by at most a tenth of a frame


def readable(dataset: Dataset) -> tuple[pd.DataFrame, tuple[AsWritten, ...], tuple[str, ...]]:
    """Rows of a dataset that can be used to detect hits, in order; how quaternions must be read, if not as written; and
    sentences for the user on changed or omitted rows.

    UserError if the orientation is missing for a body other than a ball.
    """
    table = dataset.trajectories
    assert table is not None
    turned, told = np.isfinite(table["qw"].to_numpy(float)), []
    if dataset.has_angle and not turned.all():
        told.append(
            f"{np.sum(~turned)} of {len(turned)} rows have no orientation and are not used to detect hits and flights"
        )
        table = table[turned]
    _require_turns(dataset)
    table, changed = _as_taken(table.iloc[np.lexsort((table["t"], table["trial"]))], dataset.in_space)
    told += changed
    if dataset.has_angle:
        flipped = out_and_back(*(table[names].to_numpy(float) for names in ("trial", "t", list(QUATERNION))))
        if flipped.any():
            told.append(
                f"in {np.sum(flipped)} of {len(flipped)} rows the orientation has jumped and soon jumps back, as if a "
                "tag were read in its other pose; these rows are not used to detect hits and flights"
            )
            table = table[~flipped]
    if dataset.has_angle and dataset.gravity and (name := reading_of(table, RELABELLINGS, dataset.gravity)):
        q, P = table[list(QUATERNION)].to_numpy(float), RELABELLINGS[name]
        told.append(f"the quaternions as written contradict free flight; hits and flights are detected with {name}")
        return table.assign(**dict(zip(QUATERNION, (q @ P).T))), (AsWritten(P),), tuple(told)
    return table, (), tuple(told)


def with_attitudes_later(table: pd.DataFrame, lag: float) -> pd.DataFrame:
    """Rows, by trial and time, with attitudes a time `lag` in s later, interpolated between two samples; rows for which
    this is impossible are omitted."""
    trial, t, q = table["trial"].to_numpy(), table["t"].to_numpy(float), table[list(QUATERNION)].to_numpy(float).T
    number, step = np.unique(trial, return_inverse=True)[1], np.diff(t)
    length = float(np.ptp(t)) + 2.0 * abs(lag) + 1.0
    row = number * length + t - t.min()
    first = np.clip(np.searchsorted(row, row + lag, side="right") - 1, 0, len(row) - 2)
    share = (row + lag - row[first]) / np.maximum(row[first + 1] - row[first], 1e-12)
    most = LOST * float(np.median(step[number[1:] == number[:-1]]))
    seen = (number[first] == number) & (number[first + 1] == number) & (step[first] < most)
    seen &= (share >= 0.0) & (share <= 1.0)
    before, after = q[:, first[seen]], q[:, first[seen] + 1]
    between = SPACE.attitude_after(before, share[seen] * SPACE.turn_between(before, after))
    return table[seen].assign(**dict(zip(QUATERNION, between)))


def _as_taken(table: pd.DataFrame, header: SpaceHeader) -> tuple[pd.DataFrame, tuple[str, ...]]:
    """Rows without repeated pictures, at the times at which pictures were taken; sentences for the user on changes."""
    trial, pose = table["trial"].to_numpy(), table[[*POSITION, *QUATERNION]].to_numpy(float)
    pose = pose[:, np.isfinite(pose).all(axis=0)]
    samples = Samples(trial, table["t"].to_numpy(float), pose, np.unique(trial, return_inverse=True)[1])
    keep, copied = originals(samples)
    samples, table = replace(samples.select(keep), q=samples.q[keep, :3]), table[keep]
    # pictures taken at a lower rate than stated may have late time stamps
    if found := times_of_pictures(samples, None if copied else header.rate, lengths=3):
        sure, t, stamped = found
        return table[sure].assign(t=t), tuple(filter(None, (copied, stamped)))
    return table, (copied,) * bool(copied)


def _require_turns(dataset: Dataset) -> None:
    """Raise UserError if the orientation is missing but required."""
    header = dataset.in_space
    if dataset.has_angle:
        return
    assert header.tracked is not None
    at = np.array(header.tracked.position)
    if not isinstance(header.body.solid, Sphere) or np.abs(header.body.centre).max() > 0.0:
        raise UserError(
            f"{dataset.name}: without orientation, hits can be found only for a ball with a central centre of mass."
        )
    if np.abs(at - header.body.centre).max() > 0.0:
        raise UserError(
            f"{dataset.name}: without orientation the centre of mass is unknown, because it is not the tracked point. "
            "Omit `tracked` if the tracked point is the middle of the ball."
        )


def noise_of_samples(samples: Samples, states: State, header: SpaceHeader) -> tuple[tuple[float, float], bool]:
    """One sigma of the centre of mass in m and of a turn in rad, and whether it is an estimate for smoothed samples.

    The result is the stated noise, but at least the noise that the samples show.  Noise smoothed by a filter is
    replaced by white noise with the same effect on lines.
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
            arm = np.linalg.norm(header.body.centre - np.array(header.tracked.position))  # lever of errors of turns
            stated_position = np.sqrt(np.mean(np.square(stated.position)) + 2.0 / 3.0 * (arm * rotation) ** 2)
            position = max(position, float(stated_position))
    return (max(position, 1e-7), max(rotation, 1e-7)), is_smoothed and stated is None


def _noise_of_means(samples: Samples, size: int) -> float:
    """Noise of a coordinate in m from means of `size` neighbours, times √size: unchanged for white noise."""
    first = np.flatnonzero(np.diff(samples.run, prepend=-1))
    within = np.arange(len(samples)) - np.repeat(first, np.diff(np.r_[first, len(samples)]))
    starts = np.flatnonzero((within % size == 0)[: len(samples) - size + 1])
    rows = starts[samples.run[starts] == samples.run[starts + size - 1], None] + np.arange(size)
    means = replace(samples.select(rows[:, 0]), t=samples.t[rows].mean(axis=1), q=samples.q[rows].mean(axis=1))
    return float(np.sqrt(size * np.nanmean(noise_from_differences(means) ** 2)))


@dataclass(frozen=True)
class FoundHits:
    """n hits found in samples.

    | on paper | in code    | unit | shape     |                                                  |
    |----------|------------|------|-----------|--------------------------------------------------|
    |          | `at`       | 1    | (n,)      | rows of the last samples before the hits         |
    | t_c      | `t`        | s    | (n,)      | instants, from the middle `t_0` of their windows |
    |          | `t_std`    | s    | (n,)      | their standard deviations                        |
    |          | `side`     | 1    | (n, 2, W) | samples used before and after, 0 or 1            |
    | Δv       | `dv`       | m/s  | (n, 3)    | changes of the velocity                          |
    """

    samples: Samples
    windows: Windows
    at: np.ndarray
    t: np.ndarray
    t_std: np.ndarray
    side: np.ndarray
    dv: np.ndarray

    @property
    def trial(self) -> np.ndarray:
        """Trials (n,) of the hits."""
        return self.samples.trial[self.at]

    @property
    def instant(self) -> np.ndarray:
        """Instants (n,) of the hits in s."""
        return self.t + self.windows.t_0

    def guard(self, sigma: float, settings: ArcSettings, gravity: float) -> float:
        """Time in s around a hit within which samples with the noise `sigma` in m are rounded; 0 if none are.

        It is estimated from first hits: a body that hits again may have touched unseen in between.  The curvature due
        to drag is removed first.
        """
        size, chosen, seen = (self.dv**2).sum(axis=1), np.diff(self.trial, prepend=-1) != 0, "before"
        if chosen.sum() < ENOUGH:
            chosen, seen = size >= np.median(size) if len(size) else chosen, "both"
        kinks = Kinks(self.at, self.instant, self.dv, chosen)
        samples = replace(self.samples, air=drag_in_space(self.samples, sigma, gravity))
        return guard_of(kinks, samples, np.full(3, sigma), settings, seen)

    def corners(self, alone: np.ndarray, gravity: float) -> Corners:
        """Hits as corners between two arcs that fall with `gravity` in m/s²; only hits that are `alone` (n,) have long
        arcs."""
        long = alone & (self.side.sum(2).min(1) >= ARC)
        lines = lines_through(self.side, *_falls(self.windows, self.t, gravity))
        place = self.windows.q_0 + lines.value.mean(axis=1)
        return Corners(self.at, self.instant, place, lines.slope[:, 0], lines.slope[:, 1], long)


def _falls(windows: Windows, t: np.ndarray, gravity: float) -> tuple[np.ndarray, np.ndarray]:
    """Times (n, W) in s from the instants `t` (n,), and positions (n, W, 3) in m minus the free fall since then."""
    tau = windows.t - t[:, None]
    return tau, windows.q + 0.5 * gravity * (tau**2)[..., None] * [0.0, 1.0, 0.0]


def find_hits(samples: Samples, clock: Header, sigma: float, settings: ArcSettings) -> FoundHits:
    """Hits found in samples with the noise `sigma` in m; `clock` is the header of the recording for the detection."""
    at = detect(samples, clock, np.full(3, sigma), settings)
    # otherwise the instant of a hit near another one could diverge, and leave a sample on the wrong side of the hit
    windows = windows_around(samples, at, settings.max_window, beyond=0)
    t, side, lines, dv = np.zeros(len(at)), np.zeros((len(at), 2, windows.t.shape[1])), None, np.zeros((len(at), 3))
    for _ in range(ROUNDS):
        side = sides_of(windows, t, settings, None)
        tau, falls = _falls(windows, t, clock.gravity)
        for way, used in ((1, side[:, 0]), (-1, side[:, 1])):
            for _ in range(MOST_SKIPPED):  # the next hit may have occurred earlier than detected
                used *= 1.0 - end_off_line(used, tau, falls, np.full(3, sigma), way)
        lines = lines_through(side, tau, falls)
        dv, miss = lines.slope[:, 1] - lines.slope[:, 0], lines.value[:, 1] - lines.value[:, 0]
        t = np.clip(t - (miss * dv).sum(1) / np.maximum((dv * dv).sum(1), 1e-9), windows.low, windows.high)
    assert lines is not None
    unit = 1.0 / np.maximum(lines.count, 1.0) + lines.mean**2 / np.where(lines.spread > 0.0, lines.spread, np.inf)
    t_std = sigma * np.sqrt(unit.sum(1)) / np.maximum(np.linalg.norm(dv, axis=1), 1e-9)
    return FoundHits(samples, windows, at, t, t_std, side, dv)


def turning_pull(states: State, arm: np.ndarray) -> np.ndarray:
    """Acceleration ω × (ω × r) (3, N) in m/s² of a tracked point at r = `arm` (3, N) in m from the centre of mass, with
    the spin from the neighbouring samples; 0 at the ends of trials.

    A filter smooths the position of the tracked point, which turns about the centre of mass.
    """
    inner = np.flatnonzero(states.trial[2:] == states.trial[:-2]) + 1
    turn = SPACE.turn_between(states.attitude[:, inner - 1], states.attitude[:, inner + 1])
    spin = np.zeros_like(arm)
    spin[:, inner] = turn / (states.t[inner + 1] - states.t[inner - 1])
    return cross(spin, cross(spin, arm))


def between_samples(states: State, samples: Samples, at: np.ndarray, t: np.ndarray) -> State:
    """States (n,) at the samples `at` (n,), with attitudes interpolated to the instants `t` (n,) in s after them."""
    first, last = states.attitude[:, at], states.attitude[:, at + 1]
    share = np.clip((t - samples.t[at]) / (samples.t[at + 1] - samples.t[at]), 0.0, 1.0)
    attitude = SPACE.attitude_after(first, share * SPACE.turn_between(first, last))
    return State(states.pose[:, at], states.motion[:, at], samples.trial[at], t, None, SPACE).changed(attitude=attitude)


def first_sample(samples: Samples) -> np.ndarray:
    """Time (N,) in s of the first sample of each sample's trial."""
    first = np.flatnonzero(np.r_[True, samples.trial[1:] != samples.trial[:-1]])
    return np.repeat(samples.t[first], np.diff(np.r_[first, len(samples)]))
