"""Error budget of thrown dice: throws restarted at each measured contact, and two model-free estimates.

Contact model: held-out throws are continued from the measured state before their contact k (0: the release) to rest,
without uncertainty.  A fall of the error from k to k + 1 is due to contact k.  Not every throw has contact k, so each
row also has the error from the release of the same throws.

Without a model, from the state at the first touch (velocity, spin, and angle from the nearest side, but not the place
along the surface), with the mirror image of every throw included:

    nearest   mean displacement, and most frequent number of quarter turns, of the K nearest training throws
    pairs     difference of two throws, over √2, of the 50 pairs of all throws with the most similar starts; faces: the
              share of pairs with equally many quarter turns

Two throws with similar starts differ by chance, by the noise of their starts and by the distance between these.  The
error that noise and chance cause in any prediction from the first touch is therefore at most `pairs`.
"""

from collections.abc import Sequence

import numpy as np
import pandas as pd
from scipy.spatial.distance import pdist
from sklearn.neighbors import NearestNeighbors

from thesis_lib.foundation.randomness import streams
from thesis_lib.thesis.residual.dice.data import MeasuredContacts, ThrowReleases
from thesis_lib.thesis.residual.dice.fit import DiceModel, touch_down
from thesis_lib.thesis.residual.dice.models import Thrower, throw_starts
from thesis_lib.thesis.residual.dice.settings import DiceStudySettings
from thesis_lib.thesis.residual.dice.tables import spread

CONTACTS = 6  # restarts before contacts 0 to 5
NEIGHBOURS = (3, 5, 10, 20, 40)  # numbers tried on training throws
ALIKE = 50  # number of pairs; of 500 throws these start a quarter of a standard deviation apart
QUARTER = 0.5 * np.pi


def budget(
    throwers: Sequence[Thrower],
    training: ThrowReleases,
    held: ThrowReleases,
    contacts: MeasuredContacts,
    side: float,
    settings: DiceStudySettings,
    rng: np.random.Generator,
) -> pd.DataFrame:
    """Table per model and contact: throws, std, median_abs (sides), face_right; std_start, face_start from release.

    `contacts` belong to the held-out throws; `side` in m.  `std_error` and `face_error` are standard errors from a
    bootstrap over throws.
    """
    stream, rows = streams(rng), []

    def add(model: str, k: int, error: np.ndarray, right: np.ndarray, *at_start: np.ndarray) -> None:
        std_error, *_ = spread(error, np.std, settings.bootstrap, stream(model, k, "std"))
        face_error, *_ = spread(right, np.mean, settings.bootstrap, stream(model, k))
        values = (np.std(error), std_error, np.median(np.abs(error)), np.mean(right), face_error)
        start_error, start_right = at_start or (error, right)
        rows.append((model, k, len(error), *values, np.std(start_error), np.mean(start_right)))

    numbers = pd.Series(contacts.trial).groupby(contacts.trial).cumcount().to_numpy()
    for thrower in throwers:
        start = _ends(thrower, held.q, held.v, held, side, settings)
        add(thrower.name, 0, *start)
        for k in range(1, CONTACTS):
            part = contacts.select((numbers == k) & np.isin(contacts.trial, held.trial))
            of = np.searchsorted(held.trial, part.trial)
            if len(of) > 1:
                again = _ends(thrower, part.q, part.v, held.select(of), side, settings)
                add(thrower.name, k, *again, *(values[of] for values in start))
    body = throwers[0].model
    add("nearest", 0, *_nearest(body, training, held, side))
    add("pairs", 0, *_pairs(body, (training, held), side))
    columns = ["model", "contact", "throws", "std", "std_error", "median_abs", "face_right", "face_error"]
    return pd.DataFrame(rows, columns=[*columns, "std_start", "face_start"])


def _ends(
    thrower: Thrower, q: np.ndarray, v: np.ndarray, releases: ThrowReleases, side: float, settings: DiceStudySettings
) -> tuple[np.ndarray, np.ndarray]:
    """Error in sides and whether the face is right, (n,) each, of throws from (q, v) (n, 3)."""
    model = thrower.model
    out = throw_starts(model, thrower.certain, q, v, settings.throw, np.random.default_rng(0))
    right = out.face == model.face(releases.end[:, 2])
    return (releases.end[:, 0] - out.q[:, 0]) / side, right.astype(float)


def _touches(model: DiceModel, releases: ThrowReleases, side: float) -> tuple[np.ndarray, np.ndarray]:
    """Features (n, 5) of the first touch, and outcomes (n, 2): displacement from there in sides, quarter turns."""
    _, q, v, *_ = touch_down(model, releases)
    before = np.round(q[:, 2] / QUARTER)
    askew = q[:, 2] - QUARTER * before
    turns = np.round(releases.end[:, 2] / QUARTER) - before
    displacement = (releases.end[:, 0] - q[:, 0]) / side
    # the angle from a side is periodic: an edge that points down is reached from both sides
    features = [v[:, 0], v[:, 1], model.k_g * v[:, 2], np.sin(4.0 * askew) / 4.0, np.cos(4.0 * askew) / 4.0]
    return np.stack(features, axis=1), np.stack([displacement, turns], axis=1)


def _with_mirrored(features: np.ndarray, outcomes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return np.vstack([features, features * [-1.0, 1.0, -1.0, -1.0, 1.0]]), np.vstack([outcomes, -outcomes])


def _nearest(
    model: DiceModel, training: ThrowReleases, held: ThrowReleases, side: float
) -> tuple[np.ndarray, np.ndarray]:
    """Error in sides and whether the number of quarter turns is right, (n,) each, by the nearest training throws."""
    n = len(training)
    known, outcomes = _with_mirrored(*_touches(model, training, side))
    scale = known.std(axis=0)
    search = NearestNeighbors().fit(known / scale)
    # the throw itself and its mirror image must not predict it
    most = min(max(NEIGHBOURS), 2 * n - 2)
    _, order = search.kneighbors(known[:n] / scale, most + 2)
    others = np.array([row[row % n != i][:most] for i, row in enumerate(order)])
    sizes = [size for size in NEIGHBOURS if size <= most]
    off = [np.abs(outcomes[others[:, :size], 0].mean(axis=1) - outcomes[:n, 0]).mean() for size in sizes]
    features, ends = _touches(model, held, side)
    _, order = search.kneighbors(features / scale, sizes[int(np.argmin(off))])
    found = outcomes[order]
    turns = [np.unique(row, return_counts=True) for row in found[:, :, 1]]
    usual = np.array([values[np.argmax(counts)] for values, counts in turns])
    return ends[:, 0] - found[:, :, 0].mean(axis=1), ((usual - ends[:, 1]) % 4 == 0).astype(float)


def _pairs(model: DiceModel, parts: Sequence[ThrowReleases], side: float) -> tuple[np.ndarray, np.ndarray]:
    """Difference in sides over √2, and whether quarter turns are equal, of the pairs that start most alike."""
    features, outcomes = (np.vstack(rows) for rows in zip(*(_touches(model, part, side) for part in parts)))
    n = len(features)
    known, both = _with_mirrored(features, outcomes)
    first, second = np.triu_indices(2 * n, 1)
    away = pdist(known / known.std(axis=0))
    # each pair once, and no throw with its own mirror image
    distinct = (first < n) & (first % n < second % n)
    first, second, away = first[distinct], second[distinct], away[distinct]
    alike = np.argsort(away, kind="stable")[:ALIKE]
    apart = both[first[alike]] - both[second[alike]]
    return apart[:, 0] / np.sqrt(2.0), (apart[:, 1] % 4 == 0).astype(float)
