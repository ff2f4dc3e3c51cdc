"""Recording of a body in space, prepared for the detection of hits with the results of earlier passes.

A pass ends when it finds something that the detection must take into account (delayed orientations, a filter, longer
contacts, a surface that is not at the believed position); a new pass then starts with this knowledge.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from thesis_lib.critique.likelihood.in_space.ground import Ground, SeenRig
from thesis_lib.critique.likelihood.in_space.instants import (
    noise_of_samples,
    readable,
    turning_pull,
    with_attitudes_later,
)
from thesis_lib.critique.likelihood.observations import rig_of
from thesis_lib.datasets.checks.in_space import one_clock
from thesis_lib.datasets.checks.lasting_contacts import LastingContacts, lasting_contacts
from thesis_lib.datasets.flights.low_pass import LowPass
from thesis_lib.datasets.flights.rounding import sampling_interval
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.frames import body_states, surface_frames, tracked_states
from thesis_lib.datasets.format.header import Header
from thesis_lib.datasets.format.samples import ArcSettings, Samples, make_samples
from thesis_lib.effects.as_written import AsStamped
from thesis_lib.effects.effect import Rig
from thesis_lib.mechanics.state import State

MOST_LAGS = 6  # iterations for the lag of orientations; each one more than halves it
TO_PLANE = [0, 2, 1]  # t_1, n, t_2: the detection uses the second coordinate as height


@dataclass(frozen=True)
class Known:
    """Results of earlier passes.

    Attributes:
        guard: s, least dead time: samples nearer to a hit are assigned to no flight.
        lags: successive corrections in s of the lag of orientations behind positions.
        low_pass: filter that has lowered all free falls.
        ground: surface on which bodies touch, if it differs from the believed surface.
    """

    guard: float
    lags: tuple[float, ...] = ()
    low_pass: LowPass | None = None
    ground: Ground | None = None

    @property
    def seeks_lags(self) -> bool:
        """Whether further corrections of the lag of orientations are allowed."""
        return len(self.lags) < MOST_LAGS

    def is_late(self, lag: float, guard: float) -> bool:
        """Whether the `lag` in s of orientations is to be corrected; the first time only if it exceeds `guard`."""
        return self.seeks_lags and abs(lag) > (0.0 if self.lags else guard)

    def with_lag(self, lag: float, interval: float) -> "Known":
        """Copy with a further lag; the guard excludes interpolated attitudes between samples on both sides of a hit."""
        return replace(self, lags=(*self.lags, lag), guard=max(self.guard, interval))


@dataclass(frozen=True)
class TossRecording:
    """Samples of a body in space, in the frame of the surface.

    Attributes:
        dataset: dataset, completed by the pose of the tracked frame if it had to be determined.
        settings: settings of the detection, with the known guard.
        rig: believed rig; `looks` also has the ground for the detection of hits.
        states: (N,) states of the centre of mass.
        lever: (3, N) m, from the centre of mass to the tracked point.
        samples: positions for the detection of hits; `clock` is their header.
        times, interval: (N,) s, increasing over all trials; s between two samples.
        noise: one sigma of a position in m and of a component of a turn in rad; `smoothed`: samples hide it.
        soft: contacts too long for impulses.
        warnings: sentences for the user.
        written: effects that describe how the columns of the file are written.
    """

    dataset: Dataset
    settings: ArcSettings
    known: Known
    rig: Rig
    states: State
    lever: np.ndarray
    samples: Samples
    clock: Header
    times: np.ndarray
    noise: tuple[float, float]
    smoothed: bool
    soft: LastingContacts | None
    warnings: tuple[str, ...]
    written: tuple

    @classmethod
    def of(cls, dataset: Dataset, settings: ArcSettings, known: Known) -> "TossRecording":
        """Recording of a dataset whose pose in the tracked frame is known."""
        header, settings = dataset.in_space, settings.model_copy(update={"guard": known.guard})
        whole, written, warnings = readable(dataset)
        if late := sum(known.lags):
            whole, written = with_attitudes_later(whole, late), (*written, AsStamped(late))
        (frame,) = surface_frames(header)
        tracked, rig = tracked_states(whole), rig_of(dataset)
        states = frame.seen(body_states(tracked, header))
        lever = frame.seen(tracked).position - states.position
        if known.low_pass is not None:
            pull = rig.fall(states)[:3] + turning_pull(states, lever)
            states = states.changed(states.position - 0.5 * known.low_pass.second_moment * pull)
            lever = frame.seen(tracked).position - states.position
        clock = Header.model_validate(  # header that the planar detection requires; the third coordinate is in m, too
            {"schema": 1, "body": {"shape": {"kind": "disk", "radius": 2.0}, "radius_of_gyration": 1.0}}
            | {"gravity": dataset.gravity, "rate": dataset.rate}
        )
        samples = make_samples(states.trial, states.t, states.position[TO_PLANE].T, clock, settings)
        noise, smoothed = noise_of_samples(samples, states, header)
        soft = lasting_contacts(samples, rig.gap(states), noise[0], dataset.gravity, tumbles=True)
        warnings = warnings if soft is None else (*warnings, soft.sentence())
        parts = (rig, states, lever, samples, clock, one_clock(whole)[1], noise, smoothed, soft, warnings, written)
        return cls(dataset, settings, known, *parts)

    @cached_property
    def interval(self) -> float:
        return sampling_interval(self.samples)

    @cached_property
    def looks(self) -> SeenRig:
        return SeenRig(**vars(self.rig), ground=self.known.ground)
