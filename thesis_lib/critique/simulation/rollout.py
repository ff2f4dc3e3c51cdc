"""Errors of whole tosses that a model predicts from their initial states, in the error measures of the literature.

Δp and Δθ are the differences of predicted and measured pose in a frame, w the mean width of the body, and h = w/2:

| group       | key                     | for one toss                                           | over tosses  |
|-------------|-------------------------|--------------------------------------------------------|--------------|
| contactnets | pos_int_percent         | mean of abs(Δp) / w, %                                 | mean         |
|             | angle_int_deg           | mean of abs(Δθ), degrees                               | mean         |
|             | penetration_int_percent | mean penetration depth of the predicted sharp body / w, % | mean      |
| acosta      | loss, median            | mean of abs(Δp)² / h + mean of Δθ², starting `BEFORE`  | mean, median |
|             |                         | frames before the first possible touch                 |              |
| benchmark   | position_m, angle_rad   | means of abs(Δp) and abs(Δθ)                           | mean         |
| final_face  | share                   | 1 if the same face is down at the end, else 0          | mean         |

The floor is the same error between two simulations by the model, from initial states drawn within the uncertainty of
the first flights: the error due to the initial state alone.  95 % intervals are by resampling of tosses.

Sources: S. Pfrommer, M. Halm and M. Posa, ContactNets, arXiv:2009.11193; B. Acosta, W. Yang and M. Posa, Validating
robotics simulators on real-world impacts, arXiv:2110.00541.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from thesis_lib.bodies.solids import Edged, Sphere
from thesis_lib.critique.contacts.kinds import ByImpulse
from thesis_lib.critique.results.saved_in_space import SavedSpaceModel
from thesis_lib.critique.simulation.first_flight import MeasuredTosses, Start, first_flight, first_frame
from thesis_lib.critique.simulation.tosses import Tosses, reported, toss
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.foundation.files import six_digits
from thesis_lib.mechanics.space import SPACE
from thesis_lib.mechanics.state import State
from thesis_lib.statistics.bootstrap import central_95, resampled
from thesis_lib.statistics.intervals import clustered_mean

GROUPS = {
    "contactnets": ("pos_int_percent", "angle_int_deg", "penetration_int_percent"),
    "acosta": ("loss", "median"),
    "benchmark": ("position_m", "angle_rad"),
    "final_face": ("share",),
}
Moves = Callable[[ByImpulse, State, np.ndarray], Tosses]  # as `toss`
STARTS = {"first_flight": first_flight, "first_frame": first_frame}
BEFORE = 3  # frames
DRAWS = 2000
BIN = 0.02  # s, bin width of the curve against time
FEWEST = 3  # smallest number of tosses in a bin


@dataclass(frozen=True)
class Rollout:
    """Errors of predicted tosses (`of_frames`) and of the floor, by frame and by toss."""

    frames: pd.DataFrame
    floor_frames: pd.DataFrame
    tosses: pd.DataFrame
    floor: pd.DataFrame

    def content(self, start: str, rng: np.random.Generator) -> dict:
        """Return the groups of error measures, with the floor in the same form."""
        floor = {"floor": summary(self.floor, start, rng)}
        return six_digits(summary(self.tosses, start, rng) | floor)

    def curve(self, by: str) -> pd.DataFrame:
        """Return mean errors of model and floor with 95 % intervals, by "t" (s) or by "hits"."""
        rows = []
        for what, frames in (("model", self.frames), ("floor", self.floor_frames)):
            bins = np.round(frames["t"] / BIN) * BIN if by == "t" else frames["hits"]
            for value, part in frames.groupby(bins):
                if part["trial"].nunique() >= FEWEST:
                    means = [
                        clustered_mean(part[name].to_numpy(), part["trial"].to_numpy()) for name in ("place", "turn")
                    ]
                    rows.append((what, value, *means[0], *means[1]))
        ends = [f"{name}{end}" for name in ("place", "turn") for end in ("", "_low", "_high")]
        return pd.DataFrame(rows, columns=["what", by, *ends])


def roll_out(
    model: SavedSpaceModel,
    dataset: Dataset,
    trials: Sequence[int],
    rng: np.random.Generator,
    start: str = "first_flight",
    say: Callable[[str], None] = lambda text: None,
) -> Rollout:
    """Predict the tosses of these trials with the model from their `start`, one of `STARTS`.

    Raises:
        UserError: no first flight is recorded.
    """
    measured, dynamics, begun = _begun(model, dataset, trials, start, say)
    paths = []
    for i, state in enumerate((begun.state, begun.drawn(rng), begun.drawn(rng))):
        say(f"simulating, {i + 1} of 3")
        tosses = toss(dynamics, dynamics.to_true(state), measured.times)
        paths.append((reported(dynamics, tosses), tosses.hits))
    (predicted, hits), (one, of_one), (other, _) = paths
    frames = of_frames(model, predicted, measured.states, measured.times, measured.seen, hits)
    floor = of_frames(model, one, other, measured.times, measured.seen, of_one)
    return Rollout(frames, floor, of_tosses(model, frames), of_tosses(model, floor))


def rolled_out_by(
    moves: Moves,
    model: SavedSpaceModel,
    dataset: Dataset,
    trials: Sequence[int],
    start: str = "first_flight",
    say: Callable[[str], None] = lambda text: None,
) -> pd.DataFrame:
    """Return the error measures of each toss if the simulator `moves` starts from the initial states of the model.

    Raises:
        UserError: as for `roll_out`, and errors of `moves`.
    """
    measured, dynamics, begun = _begun(model, dataset, trials, start, say)
    say("simulating")
    return missed(model, dynamics, begun.state, measured, moves)


def missed(
    model: SavedSpaceModel, dynamics: ByImpulse, start: State, measured: MeasuredTosses, moves: Moves = toss
) -> pd.DataFrame:
    """Return the error measures of each toss that begins in the measured states `start`."""
    tosses = moves(dynamics, dynamics.to_true(start), measured.times)
    path = reported(dynamics, tosses)
    return of_tosses(model, of_frames(model, path, measured.states, measured.times, measured.seen, tosses.hits))


def _begun(
    model: SavedSpaceModel, dataset: Dataset, trials: Sequence[int], start: str, say: Callable[[str], None]
) -> tuple[MeasuredTosses, ByImpulse, Start]:
    measured = MeasuredTosses.of(dataset, model, trials)
    dynamics = measured.bound(model)
    say(f"fitting {len(measured.flight)} first flights")
    return measured, dynamics, STARTS[start](dynamics, measured)


def of_frames(
    model: SavedSpaceModel, predicted: State, measured: State, times: np.ndarray, seen: np.ndarray, hits: np.ndarray
) -> pd.DataFrame:
    """Return one row for each frame that is `seen`, by toss and time: trial, t (s), hits, place (m), turn (rad), depth
    (m) of the predicted body, `low` (whether the measured body may touch), `face` (whether the same face is down)."""
    off = SPACE.difference(predicted.pose, measured.pose)
    shape = model.rig.body.solid
    sharp = (shape.rounded(0.0) if isinstance(shape, Edged) else shape).about(model.rig.body.centre)
    depth = np.maximum(-(predicted.height + sharp.lowest(predicted.attitude)[2]), 0.0)
    columns = {
        "trial": measured.trial,
        "t": times.ravel(),
        "hits": hits.ravel(),
        "place": np.sqrt((off[:3] ** 2).sum(axis=0)),
        "turn": np.sqrt((off[3:] ** 2).sum(axis=0)),
        "depth": depth,
        "low": measured.height <= sharp.extent,
        "face": np.equal(*(face_down(model, state) for state in (predicted, measured))),
    }
    return pd.DataFrame(columns)[seen.ravel()].sort_values(["trial", "t"], ignore_index=True)


def of_tosses(model: SavedSpaceModel, frames: pd.DataFrame) -> pd.DataFrame:
    """Return the error measures in the table of this module for each toss, one row per trial."""
    w, rows = width(model), {}
    for trial, of in frames.groupby("trial"):
        place, turn = of["place"].to_numpy(), of["turn"].to_numpy()
        late = slice(max(int(of["low"].to_numpy().argmax()) - BEFORE, 0), None)
        loss = (place[late] ** 2).mean() / (0.5 * w) + (turn[late] ** 2).mean()
        rows[trial] = {
            "pos_int_percent": 100.0 * place.mean() / w,
            "angle_int_deg": np.degrees(turn.mean()),
            "penetration_int_percent": 100.0 * of["depth"].mean() / w,
            "loss": loss,
            "median": loss,
            "position_m": place.mean(),
            "angle_rad": turn.mean(),
            "share": np.nan if isinstance(model.rig.body.solid, Sphere) else float(of["face"].iloc[-1]),
        }
    return pd.DataFrame.from_dict(rows, orient="index")


def summary(tosses: pd.DataFrame, start: str, rng: np.random.Generator) -> dict:
    """Return means (median for "median") over tosses by group, each with n, interval and start; None without values."""
    content = {}
    for group, keys in GROUPS.items():
        values = tosses[list(keys)].dropna()
        own, intervals = {}, {}
        for key in keys if len(values) else ():
            of = np.median if key == "median" else np.mean
            column = values[key].to_numpy()
            own[key] = float(of(column))
            intervals[key] = central_95(resampled(column, lambda drawn, of=of: float(of(drawn)), DRAWS, rng))
        content[group] = {**dict.fromkeys(keys), **own, "n": len(values), "interval": intervals, "start": start}
    return content


def compared(first: pd.DataFrame, second: pd.DataFrame, start: str, rng: np.random.Generator) -> dict:
    """Return the `summary` of the differences of two models on the same tosses, first minus second."""
    return six_digits(summary(first - second.reindex(first.index), start, rng))


def width(model: SavedSpaceModel) -> float:
    """Return the mean width in m of the body along its axes."""
    ends = [model.rig.body.solid.support(sign * np.eye(3)) for sign in (1.0, -1.0)]
    return float(np.trace(ends[0] - ends[1]) / 3.0)


def face_down(model: SavedSpaceModel, state: State) -> np.ndarray:
    """Return the index (n,) of the flat face, or of the axis of a smooth body, that points down most."""
    down = SPACE.turned_back(state.attitude, np.array([[0.0], [0.0], [-1.0]]))
    return (model.rig.body.solid.faces @ down).argmax(axis=0)
