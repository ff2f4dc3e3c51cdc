"""Observations of impacts and flights with covariance: the data of the critique.

A straight line is fitted separately to the samples on each side of each impact (`datasets/flights/lines.py`), because
the continuity of the arcs at the impact is itself tested.  The lines give pose and velocity at the impact for *any*
acceleration of a model (gravity, drag, tilt, ...).  Long flights also give their acceleration (`flights`).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import pandas as pd

from thesis_lib.bodies.walls import Wall, in_wall_frame, turns
from thesis_lib.contact.space import velocity_error
from thesis_lib.critique.likelihood.beside import Beside
from thesis_lib.critique.likelihood.flights import Flights, flights_of, no_flights
from thesis_lib.critique.likelihood.supports import supports_of
from thesis_lib.datasets.flights.lines import NODES, side_lines
from thesis_lib.datasets.flights.parabolas import later
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.frames import surface_frames
from thesis_lib.datasets.format.header import Header, unseen_spin
from thesis_lib.datasets.format.samples import ArcSettings, Samples
from thesis_lib.datasets.impacts.detect import FoundImpacts, find_impacts
from thesis_lib.datasets.impacts.episodes import clearance_in_plane, find_episodes
from thesis_lib.effects.effect import ORIGIN, Effect, Reference, Rig
from thesis_lib.mechanics.frame import Frame
from thesis_lib.mechanics.inertia import in_world
from thesis_lib.mechanics.space import PLANE, Space
from thesis_lib.mechanics.state import State

UNKNOWN = 100.0  # factor on the sigma of a spin or a gap that makes it uninformative
UPRIGHT = 1e-9  # in the direction of gravity: smaller differences are rounding
OF_STEPS = 1e-3  # relative to gravity: a step Δ in a simulation with damping c changes accelerations by the part c Δ/2
LONGEST_WAIT = 0.03  # s from the last sample before an episode to its touch
LATE = 8e-3  # s by which noise may delay the last hit of an episode
FOR_MODELS, OF_SAMPLES = ("trial", "surface", "t", "span", "value", "slope", "bow", "offset"), ("nodes", "weights")
ROWS = (*FOR_MODELS, *OF_SAMPLES, "impact", "hits", "cov", "t_std")


@dataclass(frozen=True)
class Observations:
    """n impacts and m flights of one dataset; axis `side` is before and after, axis `channel` x, y, θ.

    Attributes:
        rig: believed body and rig.
        trial, t: (n,), t in s; for an episode the instant of the first touch.
        surface: (n,) number of the wall that was hit, which defines the frame of the states; 0 on a single surface.
        impact, hits: (n,) number of the (first) hit in its trial, and number of detected hits.
        span: (n,) s from `t` to the instant of the state after, within the flight after the last hit; 0 for a single
            hit, where both instants coincide.
        value, slope, bow, nodes, weights: as in `datasets/flights/lines.py`; `value` does not contain NaN.
        cov: (n, 2, 3, 2, 2) covariance of (value, slope), by side and channel; in space (n, 2, 12, 12), of the value
            and slope of each channel in turn, because the turns about the axes are correlated.
        t_std: (n,) standard deviation of the instant t_c, s.
        offset: (n, 2) contact point of the dataset minus contact point of the shape, m; zero for trajectories.
        arcs: whether there are trajectories, which measure the poses before and after separately.
        flights: accelerations of flights; may be empty.
        supports: further evidence in addition to impacts, such as rests; each with at least one row.
        noise_known: whether `cov` is measured or stated; else only the scatter is known.
        found: result of the detection; its impacts are these n.
        spin: rad/s, one sigma of the spin before an impact if it was not measured and the states contain 0; else 0.
        touch_std: m, one sigma of an uninformative gap of a simulation that checks contacts once per step; else 0.
        written: effects that lead from these states to the states in the file, if the file was read differently.
    """

    rig: Rig
    trial: np.ndarray
    surface: np.ndarray
    impact: np.ndarray
    hits: np.ndarray
    t: np.ndarray
    span: np.ndarray
    value: np.ndarray
    slope: np.ndarray
    bow: np.ndarray
    cov: np.ndarray
    nodes: np.ndarray
    weights: np.ndarray
    t_std: np.ndarray
    offset: np.ndarray
    arcs: bool
    flights: Flights
    noise_known: bool
    found: FoundImpacts
    spin: float = 0.0
    touch_std: float = 0.0
    supports: tuple[Beside, ...] = ()
    written: tuple[Effect, ...] = ()

    @property
    def beside(self) -> tuple[Beside, ...]:
        """All evidence in addition to impacts: flights first (possibly empty), then supports."""
        return (self.flights, *self.supports)

    def __len__(self) -> int:
        return len(self.trial)

    @property
    def space(self) -> Space:
        """The plane or space in which the body moves."""
        return self.rig.space

    def norm(self, dv: np.ndarray) -> np.ndarray:
        """Kinetic norm (..., n) in m/s of changes of the motions (..., n, d + turns), with the believed inertia.

        √(|δv|² + k² δω²), in space √(|δv|² + δωᵀ G δω).
        """
        if self.space.is_plane:
            return velocity_error(dv, self.rig.k_told)
        return np.sqrt(np.einsum("...ni,nij,...nj->...n", dv, self.metric, dv))

    def as_speeds(self, dv: np.ndarray) -> np.ndarray:
        """Changes of the motions (n, d + turns) in m/s, in coordinates in which their Euclidean length is `norm`."""
        if self.space.is_plane:
            return dv * [1.0, 1.0, self.rig.k_told]
        return np.einsum("nji,nj->ni", np.linalg.cholesky(self.metric), dv)

    @property
    def metric(self) -> np.ndarray:
        """Quadratic forms (n, d + turns, d + turns) of changes of the motions that give the squares of `norm`."""
        d, rig = self.space.dimension, self.rig
        form = np.tile(np.diag(np.repeat([1.0, rig.k_told**2], [d, self.space.turns])), (len(self), 1, 1))
        if rig.tensor is not None:
            form[:, d:, d:] = np.moveaxis(in_world(rig.tensor, self.value[:, 0, d:].T), -1, 0)
        return form

    def lines(self, side: int) -> State:
        """States with the value and slope of the lines before (0) or after (1) the impacts."""
        t = self.t if side == 0 else self.t + self.span
        surface = self.surface if self.rig.walls else None
        return State.of(self.value[:, side], self.slope[:, side], self.trial, t, surface, self.space)

    @property
    def blocks(self) -> list[tuple[list[int], np.ndarray]]:
        """Independent groups of c channels, each with its covariance (n, side, 2c, 2c)."""
        if self.space.is_plane:
            return [([channel], self.cov[:, :, channel]) for channel in range(3)]
        return [(list(range(self.space.motions)), self.cov)]

    @property
    def steps(self) -> np.ndarray:
        """Standard deviation of each datum, (n, side, channel, value or slope); small where it is unknown."""
        variance = np.concatenate(
            [np.einsum("nsii->nsi", cov).reshape(*cov.shape[:2], -1, 2) for _, cov in self.blocks], axis=2
        )
        std = np.sqrt(variance)
        return np.where(std > 0.0, std, 1e-6)

    @cached_property
    def noisy(self) -> list:
        """Last results of `Comparison.noisy`: models, their values, and the residuals."""
        return []

    def select(self, trials: np.ndarray) -> "Observations":
        """Impacts and flights of the given trials."""
        rows = np.flatnonzero(np.isin(self.trial, trials))
        supports = tuple(part for beside in self.supports if len(part := beside.of_trials(trials)))
        return replace(self.rows(rows), flights=self.flights.of_trials(trials), supports=supports)

    @property
    def middle(self) -> Reference:
        """Mean place, time and trial number of the impacts, rounded to a millimetre, a millisecond and a trial.

        With walls, x is the place along one of them, and is not averaged.
        """
        if not len(self):
            return ORIGIN
        x = 0.0 if self.rig.walls else float(self.value[:, 0, 0].mean())
        y = 0.0 if self.space.is_plane else round(float(self.value[:, 0, 1].mean()), 3)
        return Reference(round(x, 3), round(float(self.t.mean()), 3), float(round(self.trial.mean())), y)

    def counted_from(self, reference: Reference) -> "Observations":
        """Copy with another reference of the effects."""
        return replace(self, rig=replace(self.rig, reference=reference))

    @property
    def single(self) -> "Observations":
        """Impacts that are single hits, with all flights."""
        return self if not self.span.any() else self.rows(np.flatnonzero(self.span == 0.0))

    def rows(self, rows: np.ndarray) -> "Observations":
        """Impacts at `rows` (indices), with all flights and the whole result of the detection."""
        return replace(self, **{name: getattr(self, name)[rows] for name in ROWS})

    def followed_by(self, others: "Sequence[Observations]") -> "Observations":
        """These impacts and flights, then the impacts and flights of others on the same rig, as input of a model."""
        parts = [self, *others]
        arrays = {name: np.concatenate([getattr(o, name) for o in parts]) for name in FOR_MODELS + OF_SAMPLES}
        return replace(self, **arrays, flights=self.flights.joined([o.flights for o in parts]))

    def tiled(self, copies: int, with_samples: bool) -> "Observations":
        """Impacts repeated `copies` times, as input of a model; `nodes` and `weights` only if `with_samples`."""
        names = FOR_MODELS + OF_SAMPLES * with_samples
        return replace(self, **{name: np.concatenate([getattr(self, name)] * copies) for name in names})

    def part(self, rows: slice, with_samples: bool) -> "Observations":
        """Impacts at `rows`, as input of a model, without copying arrays."""
        return replace(self, **{name: getattr(self, name)[rows] for name in FOR_MODELS + OF_SAMPLES * with_samples})


def observe(
    dataset: Dataset, settings: ArcSettings | None = None, episodes: bool = True, channels: Sequence[str] = ()
) -> Observations:
    """Observations of a dataset, from trajectories with detected impacts, otherwise from impacts.csv.

    `episodes`: include hits in such quick succession that the flight between is not observed
    (`datasets.impacts.episodes`); `channels`: further evidence, "rest" and "slide" (`supports`).
    """
    rig, header = rig_of(dataset), dataset.header
    found = find_impacts(dataset, settings)
    if found.samples is None:
        return _from_impacts(found, rig)
    single = replace(_from_samples(found.samples, found, rig), supports=supports_of(found, header, channels))
    if rig.walls:
        single = _on_floors(single, rig.walls)
    if not rig.has_angle:
        speed = np.hypot(*found.impacts.v_pre[:, :2].T)
        single = without_angle(single, unseen_spin(speed, header))
    # hits of two walls at the same time are left out
    if not episodes or rig.walls or not rig.has_angle:
        return single
    settings = (settings or ArcSettings()).model_copy(update={"guard": found.guard})
    return _with_episodes(single, found.samples, header, settings)


def rig_of(dataset: Dataset, surface: int = 0) -> Rig:
    """Rig as stated in dataset.yaml; in space, in the frame of the surface with the given number."""
    if dataset.space.is_plane:
        walls = dataset.header.surfaces or ()
        return Rig(dataset.shape, dataset.k_g, dataset.gravity, dataset.height, walls, dataset.has_angle)
    header, g = dataset.in_space, dataset.gravity
    frame = surface_frames(header)[surface]
    falls = frame.vectors_in(np.array(header.gravity)[:, None])[:, 0]
    down = falls / g if g and np.abs(falls / g + [0.0, 0.0, 1.0]).max() > UPRIGHT else None
    body = header.body
    shape, tensor = body.solid.about(body.centre), body.inertia_per_mass
    tracked = header.tracked and Frame(np.array(header.tracked.position) - body.centre, header.tracked.attitude)
    return Rig(shape, dataset.k_g, g, 0.0, (), dataset.has_angle, ORIGIN, tensor, down, tracked, frame.attitude)


def single_hits(n: int, space: Space = PLANE) -> dict[str, Any]:
    """Default arrays of n impacts: single hits on one surface, with the contact point of the shape."""
    arrays = {"surface": np.zeros(n, int), "hits": np.ones(n, int), "offset": np.zeros((n, space.dimension))}
    return arrays | {"span": np.zeros(n), "t_std": np.zeros(n)}


def as_stated(q: np.ndarray, motion: np.ndarray, t: np.ndarray, space: Space = PLANE) -> dict[str, Any]:
    """Arrays of stated impacts: poses q (n, ·), motions (n, 2, d + turns) before and after, t (n,) in s or NaN."""
    n, known = len(q), t[np.isfinite(t)]
    arrays = {"t": np.where(np.isfinite(t), t, float(known.mean()) if len(known) else 0.0)}
    arrays |= {"value": np.stack([q, q], axis=1), "slope": motion, "bow": np.zeros((n, 2, 2))}
    arrays |= {"nodes": np.zeros((n, 2, NODES)), "weights": np.zeros((n, 2, 2, NODES))}
    return single_hits(n, space) | arrays


def _from_impacts(found: FoundImpacts, rig: Rig) -> Observations:
    impacts = found.impacts
    n = len(impacts)
    cov = np.zeros((n, 2, 3, 2, 2))
    if impacts.cov is not None:
        variance = np.einsum("nii->ni", impacts.cov)
        cov[:, 0, :, 0, 0] = cov[:, 1, :, 0, 0] = variance[:, 0:3]
        cov[:, 0, :, 1, 1], cov[:, 1, :, 1, 1] = variance[:, 3:6], variance[:, 6:9]
    arrays = as_stated(impacts.q, np.stack([impacts.v_pre, impacts.v_post], axis=1), impacts.t)
    arrays |= {name: getattr(impacts, name) for name in ("trial", "surface", "impact")} | {"cov": cov}
    arrays["offset"] = impacts.r - rig.shape.contact_point(impacts.q[:, 2])
    known = impacts.cov is not None
    return Observations(rig, **arrays, arcs=False, flights=no_flights(), noise_known=known, found=found)


def _from_samples(samples: Samples, found: FoundImpacts, rig: Rig) -> Observations:
    impacts, arcs = found.impacts, found.used_arcs
    # a window that the detection shortened at a curved arc stays short
    most = arcs[["n_pre", "n_post"]].to_numpy()
    edges, variance = found.hits.edges(impacts.trial, impacts.t, found.guard), found.noise.variance(bool(rig.walls))
    lines = side_lines(samples, impacts.trial, impacts.t, edges, most, variance)
    arrays: dict[str, Any] = single_hits(len(impacts)) | vars(lines)
    arrays |= {name: getattr(impacts, name) for name in ("trial", "surface", "impact", "t")}
    arrays["t_std"] = arcs["t_std"].to_numpy()
    finite = np.isfinite(arrays["cov"]).all(axis=(1, 2, 3, 4)) & np.isfinite(arrays["value"]).all(axis=(1, 2))
    rows = np.flatnonzero(finite)
    flights = flights_of(found.parabolas)
    if found.step:
        flights = replace(flights, variance=flights.variance + (OF_STEPS * rig.gravity) ** 2)
    return Observations(
        rig,
        **{name: array[rows] for name, array in arrays.items()},
        arcs=True,
        flights=flights,
        noise_known=True,
        found=replace(found, impacts=impacts.select(rows)),
        touch_std=UNKNOWN * found.step * float(np.abs(impacts.v_pre[:, 1]).max(initial=0.0)) if found.step else 0.0,
    )


def _on_floors(o: Observations, walls: Sequence[Wall]) -> Observations:
    """Observations with impacts in the frames of the walls that were hit; flights keep the axes of the recording."""
    wall = o.surface
    value = np.stack([in_wall_frame(walls, wall, o.value[:, side]) for side in (0, 1)], axis=1)
    slope = np.einsum("nij,nsj->nsi", turns(walls, wall), o.slope)
    return replace(o, value=value, slope=slope)


def without_angle(o: Observations, spin: float) -> Observations:
    """Observations with unknown angle and unknown spin after an impact; `spin` is one sigma of the spin before.

    The unknown spin is a nuisance parameter: predictions are averaged over it; their covariance includes its effect.
    """
    value, cov, variance = o.value.copy(), o.cov.copy(), o.flights.variance.copy()
    if not o.space.is_plane:
        cov[:, :, 6:] = cov[:, :, :, 6:] = 0.0
        cov[:, :, [6, 8, 10], [6, 8, 10]], cov[:, 1, [7, 9, 11], [7, 9, 11]] = 1.0, (UNKNOWN * spin) ** 2
        variance[:, [*range(3, 6), *range(9, variance.shape[1])]] = UNKNOWN**2  # angular accelerations
        return replace(o, cov=cov, flights=replace(o.flights, variance=variance), spin=spin)
    value[:, :, 2] = 0.0
    cov[:, :, 2] = np.diag([1.0, (UNKNOWN * spin) ** 2])
    cov[:, 0, 2, 1, 1] = 0.0
    variance[:, 2] = UNKNOWN**2
    return replace(o, value=value, cov=cov, flights=replace(o.flights, variance=variance), spin=spin)


def _with_episodes(single: Observations, samples: Samples, header: Header, settings: ArcSettings) -> Observations:
    """Single hits and episodes, sorted by trial and time; hits in episodes are not listed as left out any more."""
    found, rig = single.found, single.rig
    names = ["trial", "impact"]
    all_hits = found.arcs[[*names, "t", "gap"]].merge(found.left_out[[*names, "reason"]], how="left", on=names)
    all_hits = all_hits.fillna({"reason": ""}).sort_values(["trial", "t"], ignore_index=True)
    clearance = clearance_in_plane(samples, found.noise, header)
    table = find_episodes(samples, all_hits, found.noise, header.gravity, clearance, settings)
    if not len(table):
        return single
    trial, start, end = (table[name].to_numpy() for name in ("trial", "start", "end"))
    most = table[["n_pre", "n_post"]].to_numpy()
    open_ends = np.full(len(table), np.inf)
    edges = np.stack([-open_ends, later(start), -later(-end), open_ends], axis=1)
    t = _touch(samples, trial, start, edges, most, rig)
    # a hit that the model predicts slightly late, because of a noisy start, must precede the state after
    middle = samples.position(trial, end) + (most[:, 1] - 1) // 2
    end = np.minimum(end + LATE, samples.t[middle])
    before, after = (side_lines(samples, trial, at, edges, most, found.noise.variance(False)) for at in (t, end))
    episodes = single_hits(len(table)) | vars(before.with_after(after))
    episodes |= {"trial": trial, "impact": table["impact"].to_numpy(), "t": t, "span": end - t}
    episodes["hits"] = (table["last"] - table["impact"] + 1).to_numpy()
    return with_episodes(single, episodes, table)


def with_episodes(single: Observations, episodes: Mapping[str, np.ndarray], table: pd.DataFrame) -> Observations:
    """Single hits and `episodes`, by trial and time; hits in the `table` of episodes no longer count as left out."""
    trial, t, left_out = episodes["trial"], episodes["t"], single.found.left_out
    order = np.lexsort((np.concatenate([single.t, t]), np.concatenate([single.trial, trial])))
    arrays = {name: np.concatenate([getattr(single, name), episodes[name]])[order] for name in ROWS}
    held = {(i, k) for i, first, last in table[["trial", "impact", "last"]].to_numpy() for k in range(first, last + 1)}
    out = np.array([pair not in held for pair in zip(left_out["trial"], left_out["impact"])], bool)
    still_out = left_out[out]
    return replace(single, **arrays, found=replace(single.found, left_out=still_out.reset_index(drop=True)))


def _touch(
    samples: Samples, trial: np.ndarray, start: np.ndarray, edges: np.ndarray, most: np.ndarray, rig: Rig
) -> np.ndarray:
    """Instants (n,) in s at which the believed body touches the believed surface if the flight before continues."""
    lines = side_lines(samples, trial, start, edges, most, np.ones(3))
    a = np.array([0.0, -rig.gravity, 0.0])
    value, slope = (
        getattr(lines, name)[:, 0] - lines.bow[:, 0, k, None] * a for k, name in enumerate(("value", "slope"))
    )
    tau = np.arange(0.0, LONGEST_WAIT, 1e-4)
    y = value[:, 1:2] + slope[:, 1:2] * tau - 0.5 * rig.gravity * tau**2
    theta = value[:, 2:] + slope[:, 2:] * tau
    below = rig.shape.gap(y, theta, rig.height) < 0.0
    return start + tau[np.where(below.any(axis=1), below.argmax(axis=1), 0)]
