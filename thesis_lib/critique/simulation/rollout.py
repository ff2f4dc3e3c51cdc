"""Whole tosses as a model predicts them from how they begin, against measured ones: the numbers of the field.

With Δp and Δθ between predicted and measured pose of a frame, w the body's width (mean over its axes) and h = w/2:

| group       | key                     | of a toss                                              | over tosses  |
|-------------|-------------------------|--------------------------------------------------------|--------------|
| contactnets | pos_int_percent         | mean of abs(Δp) / w, %                                 | mean         |
|             | angle_int_deg           | mean of abs(Δθ), degrees                               | mean         |
|             | penetration_int_percent | mean of how deep the predicted sharp body is sunk / w, % | mean       |
| acosta      | loss, median            | mean of abs(Δp)² / h + mean of Δθ², from `BEFORE`      | mean, median |
|             |                         | frames before it may touch on                          |              |
| benchmark   | position_m, angle_rad   | means of abs(Δp) and abs(Δθ)                           | mean         |
| final_face  | share                   | the same face is down at the end                       | mean         |

The floor is the same of two draws of what the first flights leave open, simulated by the model: an error of the initial
state alone.  Intervals of 95 % resample tosses.

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
BIN = 0.02  # s of a point of the curve against time
FEWEST = 3  # tosses of such a point


@dataclass(frozen=True)
class Rollout:
    """Errors of predicted tosses (`of_frames`) and those of the floor, by frame and by toss."""

    frames: pd.DataFrame
    floor_frames: pd.DataFrame
    tosses: pd.DataFrame
    floor: pd.DataFrame

    def content(self, start: str, rng: np.random.Generator) -> dict:
        """The groups of numbers, with the floor in the same form."""
        floor = {"floor": summary(self.floor, start, rng)}
        return six_digits(summary(self.tosses, start, rng) | floor)

    def curve(self, by: str) -> pd.DataFrame:
        """Mean errors and their 95 % intervals of the model and of the floor, by "t" (s) or by "hits"."""
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
    """The tosses of these trials as the model predicts them from their `start`, one of `STARTS`.

    Raises:
        UserError: no first flight is seen.
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
    """The numbers of each toss where something else `moves` the body from the states in which the model has it begin.

    Raises:
        UserError: as of `roll_out`, and what `moves` raises.
    """
    measured, dynamics, begun = _begun(model, dataset, trials, start, say)
    say("simulating")
    return missed(model, dynamics, begun.state, measured, moves)


def missed(
    model: SavedSpaceModel, dynamics: ByImpulse, start: State, measured: MeasuredTosses, moves: Moves = toss
) -> pd.DataFrame:
    """The numbers of each toss that begins in the measured states `start`."""
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
    """A row for each frame that is `seen`, by toss and time: trial, t (s), hits, place (m), turn (rad), depth (m) of
    the predicted body, `low` (whether the measured one may touch), and `face`, whether the same one is down."""
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
    """The numbers of the module's table for each toss, a row by trial."""
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
    """Means (of "median" the median) over tosses by group, each with n, interval and start; of no value None."""
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
    """`summary` of the differences of two models on the same tosses, first less second."""
    return six_digits(summary(first - second.reindex(first.index), start, rng))


def width(model: SavedSpaceModel) -> float:
    """Mean width in m of the body along its axes."""
    ends = [model.rig.body.solid.support(sign * np.eye(3)) for sign in (1.0, -1.0)]
    return float(np.trace(ends[0] - ends[1]) / 3.0)


def face_down(model: SavedSpaceModel, state: State) -> np.ndarray:
    """Number (n,) of the flat face, or of the axis of a smooth body, that looks down the most."""
    down = SPACE.turned_back(state.attitude, np.array([[0.0], [0.0], [-1.0]]))
    return (model.rig.body.solid.faces @ down).argmax(axis=0)
