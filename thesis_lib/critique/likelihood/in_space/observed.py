"""Result of a pass over a recording in space: its hits, and the motion before and after each of them."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import pandas as pd

from thesis_lib.bodies.solids import Sphere
from thesis_lib.critique.likelihood.flights import Flights
from thesis_lib.critique.likelihood.in_space.clear_flights import Poses, jumps, seen_beside, under_gravity
from thesis_lib.critique.likelihood.in_space.episodes import ELSEWHERE, OFF_SURFACE, add_episodes
from thesis_lib.critique.likelihood.in_space.flights import flights_in_space
from thesis_lib.critique.likelihood.in_space.ground import of_shape
from thesis_lib.critique.likelihood.in_space.instants import FoundHits, between_samples, first_sample
from thesis_lib.critique.likelihood.in_space.lag import lag_warning
from thesis_lib.critique.likelihood.in_space.left_out import hops_unseen, rolls
from thesis_lib.critique.likelihood.in_space.recording import TossRecording
from thesis_lib.critique.likelihood.observations import Observations, single_hits
from thesis_lib.critique.likelihood.supports import supports_in_space
from thesis_lib.datasets.flights.beside_hits import fit_windows
from thesis_lib.datasets.flights.lines import SideLines
from thesis_lib.datasets.flights.low_pass import LowPass, low_pass_of
from thesis_lib.datasets.flights.parabolas import Hits
from thesis_lib.datasets.flights.rounding import rounding_warning
from thesis_lib.datasets.format.samples import ArcSettings
from thesis_lib.datasets.impacts.found import Away, found_in_space, ordinals
from thesis_lib.datasets.space.flights import too_slow
from thesis_lib.effects.effect import Rig
from thesis_lib.effects.whole_tosses import WholeTosses
from thesis_lib.mechanics.contact import contact_at
from thesis_lib.mechanics.inertia import mobility
from thesis_lib.mechanics.space import SPACE
from thesis_lib.mechanics.state import State
from thesis_lib.statistics.spread import robust_std

SPREAD = 3.0  # robust standard deviations of the gap at hits
UPWARDS = 5  # index of the slope of n among values and slopes of all channels
SURE = 3.0  # standard errors for a significant push of the surface


@dataclass(frozen=True)
class HitWindows:
    """Samples before and after n hits: `reason` (n,) why a hit cannot be used ("" if it can); `at_end` (n,) whether its
    samples are too few because an end of the trial, not another hit, is near; for the m `rows` of hits with enough
    samples, the numbers `index` (m, W) of the samples, their poses (m, W, 7), times `tau` (m, W) in s from the hit, the
    mask `used` (m, 2, W), and the fitted lines."""

    reason: np.ndarray
    at_end: np.ndarray
    rows: np.ndarray
    index: np.ndarray
    pose: np.ndarray
    tau: np.ndarray
    used: np.ndarray
    fitted: SideLines

    @classmethod
    def of(
        cls, found: FoundHits, recording: TossRecording, noise: tuple[float, float], settings: ArcSettings
    ) -> "HitWindows":
        at, side, windows = found.at, found.side, found.windows
        reason = np.full(len(at), "", object)
        beside = np.stack([np.r_[False, windows.same_trial], np.r_[windows.same_trial, False]], axis=1)[: len(at)]
        few = side.sum(2) < settings.min_window_in_space
        short, at_end = few.any(1), few.any(1) & ~(few & beside).any(1)
        # `second_hit` marks candidates for episodes, which include hits at an end of their trial
        reason[short] = np.where(beside.any(1), "second_hit", "window_too_short")[short]
        rows, reach = np.flatnonzero(reason == ""), np.arange(-settings.max_window, settings.max_window + 2)
        index = np.clip(at[rows, None] + reach, 0, len(found.samples) - 1)
        pose, tau = np.moveaxis(recording.states.pose[:, index], 0, -1), windows.t[rows] - found.t[rows, None]
        used = side[rows] > 0.0
        fitted = fit_windows(pose, tau, used, np.asarray(recording.rig.tensor), noise)
        return cls(reason, at_end, rows, index, pose, tau, used, fitted)

    @property
    def usable(self) -> np.ndarray:
        """Mask (m,) of hits without a reason."""
        return self.reason[self.rows] == ""

    @property
    def reported(self) -> np.ndarray:
        """Reasons (n,) for the user."""
        return np.where(self.at_end & (self.reason == "second_hit"), "window_too_short", self.reason)

    def leave_out(self, which: np.ndarray, why: str) -> None:
        """Set the reason `why` for the hits in the mask `which` (m,) that do not have a reason yet."""
        self.reason[self.rows[which & self.usable]] = why


@dataclass(frozen=True)
class Observed:
    """Hits of a recording, with the motion before and after them.

    Attributes:
        settings: settings with the guard that rounded samples require (`rounded`).
        noise: one sigma of a position in m and of a component of a turn in rad.
        found, windows: the n hits, and the samples around the m hits with enough samples.
        grown, slack: results of `has_another_hit`.
        lag: lag in s of orientations behind positions.
    """

    recording: TossRecording
    settings: ArcSettings
    noise: tuple[float, float]
    found: FoundHits
    windows: HitWindows
    grown: np.ndarray
    slack: np.ndarray
    lag: float
    rounded: bool

    @cached_property
    def since(self) -> np.ndarray:
        """Times (n,) in s of the hits, from the first sample of their trials."""
        return self.found.instant - first_sample(self.recording.samples)[self.found.at]

    @cached_property
    def sides(self) -> tuple[State, State]:
        """Poses and motions (m) before and after, under believed gravity."""
        fitted, rows, rig = self.windows.fitted, self.windows.rows, self.recording.rig
        lines = (
            State.of(fitted.value[:, i], fitted.slope[:, i], self.found.trial[rows], self.since[rows], space=SPACE)
            for i in (0, 1)
        )
        before, after = (under_gravity(line, fitted.bow[:, i], rig) for i, line in enumerate(lines))
        return before, after

    @cached_property
    def off_by(self) -> np.ndarray:
        """Gap (m,) in m to the surface on which bodies touch."""
        return self.recording.looks.gap(self.sides[0])

    @property
    def of_push(self) -> np.ndarray:
        """Standard error (m,) in m/s of the change of velocity along the normal; similar along the surface."""
        return np.sqrt(self.grown[0] * self.windows.fitted.cov[:, :, UPWARDS, UPWARDS].sum(axis=1))

    def leave_out(self) -> None:
        """Set the reason of hits that cannot be used."""
        windows, rig, (before, after) = self.windows, self.recording.rig, self.sides
        fitted, off_by = windows.fitted, self.off_by
        if len(off_by):  # a wrong believed geometry shifts all of them equally
            windows.leave_out(np.abs(off_by - np.median(off_by)) > OFF_SURFACE * rig.shape.extent, ELSEWHERE)
        windows.leave_out(contact_velocity(before, rig)[2] >= 0.0, "no_approach")
        slower, (down, up) = fitted.bow[:, 1, 1] - fitted.bow[:, 0, 1], fitted.slope[:, :, 2].T
        push = up - down - rig.fall(before)[2] * slower
        windows.leave_out(push < SURE * self.of_push, "no_push")
        if self.rounded:
            alone = np.flatnonzero(windows.usable)
            met, left = before.select(alone), after.select(alone)
            speeds = np.stack([-contact_velocity(met, rig)[2], contact_velocity(left, rig)[2]], axis=1)
            hopped = np.zeros(len(off_by), bool)
            hopped[alone] = hops_unseen(-off_by[alone], speeds, of_shape(rig.shape, met), self.settings.guard)
            windows.leave_out(hopped, "second_hit")
        if isinstance(self.recording.dataset.in_space.body.solid, Sphere):
            bounces, reason = np.flatnonzero(windows.usable), windows.reason
            speeds = np.stack([-before.velocity[2], after.velocity[2]], axis=1)[bounces]
            rolling = rolls(speeds, windows.rows[bounces], self.found.trial)
            reason[rolling & np.isin(reason, ("", "second_hit"))] = "no_bounce"

    @cached_property
    def touching(self) -> State:
        """Poses and motions before the usable hits."""
        return self.sides[0].select(np.flatnonzero(self.windows.usable))

    @cached_property
    def sunk(self) -> np.ndarray:
        """Depth in m of the states `touching` below the believed surface."""
        return -self.recording.rig.gap(self.touching)

    @cached_property
    def approach(self) -> np.ndarray:
        """|v_n|/√K_nn in m/s of the contact points of `touching`."""
        state, rig = self.touching, self.recording.rig
        of_turns = mobility(SPACE, np.asarray(rig.tensor), state.attitude)
        at = contact_at(SPACE, state.velocity, state.spin, rig.lowest(state), of_turns)
        return np.abs(at.v_n) / np.sqrt(at.K_nn)

    @cached_property
    def heights(self) -> tuple[float, float]:
        """Lowest and highest gap in m at which bodies touch, with the believed geometry."""
        gap = self.off_by[self.windows.usable]
        if not len(gap):
            return -np.inf, -np.inf
        middle, spread = float(np.median(gap)), SPREAD * float(robust_std(gap - np.median(gap)))
        return middle - spread, middle + spread

    @cached_property
    def hits(self) -> Hits:
        return Hits(self.found.trial, self.found.instant, self.windows.reason == "")

    @cached_property
    def flights(self) -> Flights:
        recording, highest = self.recording, self.heights[1]
        return flights_in_space(
            recording.states, recording.times, self.hits, recording.looks, self.noise, highest, self.settings.guard
        )

    @cached_property
    def lasting(self) -> float:
        """Apparent duration in s of contacts."""
        return max(float(np.median(self.sunk / self.approach)), 0.0) if len(self.sunk) else 0.0

    @cached_property
    def low_pass(self) -> LowPass | None:
        """Filter that rounds corners, as known or as estimated from these hits; None if there is none."""
        recording = self.recording
        if not self.rounded or recording.soft is not None or recording.known.low_pass is not None:
            return recording.known.low_pass
        bent = self.flights.acceleration[:, 2]
        gravity = -float(np.median(bent)) if len(bent) else recording.dataset.gravity
        corners, sigma = self.found.corners(self.windows.reason == "", gravity), np.full(3, self.noise[0])
        guard, interval = self.settings.guard, recording.interval
        return low_pass_of(corners, recording.samples, sigma, gravity, guard, interval, self.lasting)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Sentences for the user."""
        recording, lags = self.recording, self.recording.known.lags
        warnings = (*recording.warnings, *lag_warning(sum(lags) + self.lag, 2.0 * self.lasting, bool(lags)))
        if self.rounded and recording.soft is None:
            guards = self.settings.guard, recording.known.guard
            warnings += rounding_warning(*guards, self.lasting, recording.interval, self.low_pass)
        return tuple(filter(None, (*warnings, too_slow(recording.dataset.rate))))

    @property
    def away(self) -> Away:
        """Hits that are not on the surface."""
        windows, rows = self.windows, np.flatnonzero(self.windows.reason[self.windows.rows] == ELSEWHERE)
        used, (before, after) = windows.used[rows], self.sides
        middle = (used * windows.tau[rows, None]).sum(axis=2) / used.sum(axis=2)
        return Away(before.select(rows), after.select(rows), middle, self.of_push[rows])

    @cached_property
    def table(self) -> pd.DataFrame:
        """All hits by trial and time, with the reasons why they are left out."""
        trial = self.found.trial
        return pd.DataFrame(
            {"trial": trial, "impact": ordinals(trial), "t": self.found.instant, "reason": self.windows.reason}
        )

    @cached_property
    def poses(self) -> Poses:
        recording, (place, turn) = self.recording, self.noise * np.sqrt(self.grown)
        return Poses(recording.samples, recording.states, recording.looks, (place, turn), float(self.slack.max()))

    @cached_property
    def nearby(self) -> pd.DataFrame:
        return seen_beside(self.poses, self.table, self.heights[1] if len(self.sunk) else 0.0, self.settings)

    def single(self) -> Observations:
        """Observations of single hits."""
        recording, windows, kept = self.recording, self.windows, self.windows.usable
        found, rows, sigma = self.found, windows.rows[kept], np.repeat(np.sqrt(self.grown), 6)
        detected = between_samples(recording.states, recording.samples, found.at, found.instant)
        jump_of = jumps(self.poses, self.table, self.nearby)
        reason, impact, header = windows.reported, ordinals(found.trial), recording.dataset.in_space
        supports = ()
        if recording.dataset.has_angle:
            supports = supports_in_space(recording.states, recording.samples, self.hits, recording.rig, self.noise)
        return Observations(
            rig=replace(recording.rig, recorded=WholeTosses.of(recording.states, found.trial, self.since)),
            trial=found.trial[rows],
            impact=impact[rows],
            t=self.since[rows],
            **single_hits(len(rows), SPACE) | {"t_std": found.t_std[rows]},
            **{name: getattr(windows.fitted, name)[kept] for name in ("value", "slope", "bow", "nodes", "weights")},
            cov=windows.fitted.cov[kept] * np.outer(sigma, sigma),
            arcs=True,
            flights=self.flights,
            supports=supports,
            noise_known=True,
            found=replace(
                found_in_space(header, detected, impact, reason, jump_of, self.poses.noise),
                low_pass=self.low_pass,
                soft=recording.soft,
                away=self.away,
                warnings=self.warnings,
            ),
            written=recording.written,
        )

    def with_episodes(self) -> Observations:
        """Observations of all usable single hits and episodes."""
        windows, kept = self.windows, self.windows.usable
        used, inner = windows.used[kept], self.recording.samples.t[windows.index[kept]]
        # times of the last used sample before and the first after
        start = np.where(used[:, 0], inner, -np.inf).max(axis=1, initial=-np.inf)
        end = np.where(used[:, 1], inner, np.inf).min(axis=1, initial=np.inf)
        n_pre, n_post = used.sum(axis=2).T
        beside_single = pd.DataFrame({"start": start, "end": end, "n_pre": n_pre, "n_post": n_post})
        return add_episodes(self.single(), self.poses, self.table, beside_single, self.nearby, self.heights)


def contact_velocity(state: State, rig: Rig) -> np.ndarray:
    """Velocity (3, n) in m/s of the lowest point of the believed body."""
    return SPACE.velocity_at(state.velocity, state.spin, rig.lowest(state))
