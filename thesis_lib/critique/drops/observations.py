"""Observations of impacts and flights with covariance: the data of the critique.

A straight line is fitted to the samples on either side of each impact separately (`lines`), because how the arcs meet
is itself to be tested.  The lines give pose and velocity at the impact for *any* acceleration of a model (gravity,
drag, tilt, ...).  Flights that are long enough also give their acceleration (`flights`).
"""

from dataclasses import dataclass, replace

import numpy as np

from thesis_lib.critique.drops.flights import NO_FLIGHTS, Flights, measured_flights
from thesis_lib.critique.drops.lines import NODES, Hits, side_lines
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.samples import ArcSettings, Samples
from thesis_lib.datasets.impacts.detect import FoundImpacts, find_impacts
from thesis_lib.effects.effect import Rig


@dataclass(frozen=True)
class Observations:
    """n impacts and m flights of one dataset; sides are before and after, channels x, y, θ.

    Attributes:
        rig: believed body and rig.
        trial, t: (n,), t in s.
        value, slope, bow, nodes, weights: as in `lines`; `value` has no NaN.
        cov: (n, 2, 3, 2, 2) covariance of (value, slope), by side and channel.
        t_std: (n,) standard deviation of the instant t_c, s.
        offset: (n, 2) contact point of the dataset minus that of the shape, m; zero for trajectories.
        arcs: whether there are trajectories, which measure the poses before and after separately.
        flights: accelerations, or none.
        noise_known: whether `cov` is measured or stated; else only the scatter is known.
        found: result of the detection; its impacts are these n.
    """

    rig: Rig
    trial: np.ndarray
    t: np.ndarray
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

    def __len__(self) -> int:
        return len(self.trial)

    def select(self, trials: np.ndarray) -> "Observations":
        """Impacts and flights of the given trials."""
        rows = np.flatnonzero(np.isin(self.trial, trials))
        flights = self.flights.select(np.flatnonzero(np.isin(self.flights.state.trial, trials)))
        arrays = {
            name: getattr(self, name)[rows]
            for name in ("trial", "t", "value", "slope", "bow", "cov", "nodes", "weights", "t_std", "offset")
        }
        return replace(self, **arrays, flights=flights)

    def tiled(self, copies: int, with_samples: bool) -> "Observations":
        """The impacts repeated `copies` times; without samples `nodes` and `weights` are not repeated."""
        names = ("trial", "t", "value", "slope", "bow", "offset") + (("nodes", "weights") if with_samples else ())
        return replace(self, **{name: np.concatenate([getattr(self, name)] * copies) for name in names})


def observe(dataset: Dataset, settings: ArcSettings | None = None) -> Observations:
    """Observations from trajectories with detected impacts, or else from impacts.csv."""
    found = find_impacts(dataset, settings)
    rig = Rig(dataset.shape, dataset.k_g, dataset.gravity, dataset.height)
    return _from_impacts(found, rig) if found.samples is None else _from_samples(found.samples, found, rig)


def _from_impacts(found: FoundImpacts, rig: Rig) -> Observations:
    impacts = found.impacts
    n = len(impacts)
    cov = np.zeros((n, 2, 3, 2, 2))
    if impacts.cov is not None:
        variance = np.einsum("nii->ni", impacts.cov)
        cov[:, 0, :, 0, 0] = cov[:, 1, :, 0, 0] = variance[:, 0:3]
        cov[:, 0, :, 1, 1], cov[:, 1, :, 1, 1] = variance[:, 3:6], variance[:, 6:9]
    return Observations(
        rig=rig,
        trial=impacts.trial,
        t=np.where(np.isfinite(impacts.t), impacts.t, 0.0),
        value=np.stack([impacts.q, impacts.q], axis=1),
        slope=np.stack([impacts.v_pre, impacts.v_post], axis=1),
        bow=np.zeros((n, 2, 2)),
        cov=cov,
        nodes=np.zeros((n, 2, NODES)),
        weights=np.zeros((n, 2, 2, NODES)),
        t_std=np.zeros(n),
        offset=impacts.r - rig.shape.contact_point(impacts.q[:, 2]),
        arcs=False,
        flights=NO_FLIGHTS,
        noise_known=impacts.cov is not None,
        found=found,
    )


def _from_samples(samples: Samples, found: FoundImpacts, rig: Rig) -> Observations:
    impacts = found.impacts
    table = found.arcs.sort_values(["trial", "t"])
    hits = Hits(table["trial"].to_numpy(), table["t"].to_numpy(), table["used"].to_numpy(bool))
    # a window that detection cut short at a bent arc stays short
    most = found.used_arcs[["n_pre", "n_post"]].to_numpy()
    lines = side_lines(samples, hits, impacts.trial, impacts.t, most)
    variance = found.noise.used**2 * found.noise.colour
    cov = lines.unit_cov[:, :, None] * variance[None, None, :, None, None]
    rows = np.flatnonzero(np.isfinite(cov).all(axis=(1, 2, 3, 4)) & np.isfinite(lines.value).all(axis=(1, 2)))
    return Observations(
        rig=rig,
        trial=impacts.trial[rows],
        t=impacts.t[rows],
        **{name: getattr(lines, name)[rows] for name in ("value", "slope", "bow", "nodes", "weights")},
        cov=cov[rows],
        t_std=found.used_arcs["t_std"].to_numpy()[rows],
        offset=np.zeros((len(rows), 2)),
        arcs=True,
        flights=measured_flights(samples, hits, variance),
        noise_known=True,
        found=replace(found, impacts=impacts.select(rows)),
    )
