"""Time lag of orientations behind positions, for example of a tracker with separate clocks or filters for them.

The lag is visible in two ways.  At a hit the attitudes change later than the positions (`lag_of_attitudes`).  In
flight the believed centre of mass, c = p − R o, leaves its parabola (`lag_in_flight`): a lag L moves it by

    R(t) o − R(t − L) o = L (R o)˙

The first method is more precise.  If the body turns far within the lag, however, a hit appears as two, one in position
and one in rotation; hits therefore do not reveal a lag of several samples.
"""

import numpy as np

from thesis_lib.critique.likelihood.in_space.left_out import turned
from thesis_lib.datasets.flights.lines import SideLines
from thesis_lib.datasets.format.samples import Samples
from thesis_lib.mechanics.space import rotation_matrix
from thesis_lib.mechanics.state import State
from thesis_lib.statistics.spread import MEDIAN, robust_std

FEWEST = 6  # hits needed to determine a lag
SUREST, ENOUGH = 0.2, 12  # fraction of the hits, with the best known changes of spin, and their sufficient number
SURE = 3.0  # standard errors by which a lag is significant
LATE, REST = 1e-3, 3e-4  # s, least lags; arcs bent by air or a tilt meet about 0.2 ms from the hit
EARLY = 0.4  # share of a contact by which the spin may change earlier than the velocity; simulated ones reach 0.3
LASTING = (0.12, 0.16, 0.22)  # s, pieces of flight, in which a body must turn; hits end them
SHORTEST, FEWEST_PIECES = 10, 25  # least samples of a piece, and pieces without a hit
FLIES = 0.5  # fraction of gravity by which the apparent acceleration of a free body may differ
MODES = 4  # powers of time beyond the parabola that describe the rotation of a body
CLEAN, LEAST_CLEAN = 0.25, 1.5  # fraction of the pieces without a hit, and ratio of misfits that indicates a hit
BISQUARE, ROUNDS = 4.0, 20  # ratio to the median misfit beyond which a piece has zero weight; iterations
EXACT = 1e-12  # m; misfit due to rounding
EXPLAINED, CLEAR = 0.5, 8.0  # fraction of the squares that a lag must explain, and its least significance in sigmas


def lag_in_flight(samples: Samples, states: State, arm: np.ndarray, gravity: float) -> float:
    """Lag in s of attitudes behind positions, from the paths of the believed centre of mass; 0 if not clear.

    `arm` (3, N) in m is the tracked point relative to that centre.  A wrong position of the tracked point on the body,
    which turns with the body, does not count as a lag.
    """
    step = np.diff(samples.t)[np.diff(samples.run) == 0]
    interval = float(np.median(step)) if len(step) else 1.0
    sizes = (round(lasts / interval) for lasts in LASTING)
    found = [_lag_of_pieces(samples, states, arm, gravity, size) for size in sizes if size >= SHORTEST]
    lag, std, share = max(filter(None, found), key=lambda one: one[2], default=(0.0, 1.0, 0.0))
    return lag if share > EXPLAINED and abs(lag) > CLEAR * std else 0.0


def _lag_of_pieces(
    samples: Samples, states: State, arm: np.ndarray, gravity: float, size: int
) -> tuple[float, float, float] | None:
    """Lag in s, its standard error, and the fraction of squares that it explains; None if there are too few pieces."""
    first = np.arange(0, len(samples) - size + 1, size // 2)
    index = first[samples.run[first] == samples.run[first + size - 1], None] + np.arange(size)
    t = samples.t[index]
    half = 0.5 * np.ptp(t, axis=1)[:, None]
    powers = ((t - t.mean(axis=1, keepdims=True)) / half)[..., None] ** np.arange(3 + MODES)
    a = 2.0 * np.einsum("nw,nw->n", np.linalg.pinv(powers[..., :3])[:, 2], states.position[2, index]) / half[:, 0] ** 2
    flies = np.abs(a + gravity) < FLIES * gravity
    index, powers, half = index[flies], powers[flies], half[flies]
    if len(index) < FEWEST_PIECES:
        return None
    # positions, their change by a lag, and by a shift of the tracked point; slopes are those of a polynomial, because
    # noise common to both sides of a regression would bias it
    course = np.einsum("nkw,anw->ank", np.linalg.pinv(powers), arm[:, index])
    slope = np.einsum("nwk,ank->anw", powers[..., :-1], course[..., 1:] * np.arange(1, 3 + MODES)) / half
    paths = np.stack([states.position[:, index], slope, *rotation_matrix(states.attitude[:, index]).swapaxes(0, 1)])
    basis = np.linalg.qr(powers)[0]
    smooth = np.einsum("nwk,acnw->acnk", basis, paths, optimize=True)
    rough = ((paths[0] - np.einsum("nwk,cnk->cnw", basis, smooth[0])) ** 2).mean(axis=(0, 2))
    clean = rough < LEAST_CLEAN**2 * np.quantile(rough, CLEAN)
    if clean.sum() < FEWEST_PIECES:
        return None
    y, *columns = np.moveaxis(smooth[:, :, clean, 3:], 2, 1).reshape(len(paths), clean.sum(), -1)
    X, left = np.stack(columns, axis=-1), y
    for _ in range(ROUNDS):
        misfit = np.sqrt((left**2).mean(axis=1))
        scale = max(float(np.median(misfit)), EXACT)
        weight = np.clip(1.0 - (misfit / (BISQUARE * scale)) ** 2, 0.0, None) ** 2
        inverse = np.linalg.pinv(np.einsum("n,nri,nrj->ij", weight, X, X))
        value = inverse @ np.einsum("n,nri,nr->i", weight, X, y)
        left = y - X @ value
    share = 1.0 - weight @ (left**2).sum(axis=1) / max(weight @ (y**2).sum(axis=1), EXACT**2)
    # neighbouring pieces have half of their samples in common
    return float(value[0]), float(scale * np.sqrt(2.0 * inverse[0, 0])), float(share)


def lag_of_attitudes(fitted: SideLines, least: float = LATE) -> float:
    """Lag in s of the change of attitudes at hits behind the change of positions; 0 if not clear or below `least`.

    With a lag L, the attitudes before and after differ by −L Δω where the positions meet; hits with the best known Δω
    are used.
    """
    turn, spun = turned(fitted)
    square = np.maximum((spun**2).sum(axis=1), 1e-9)
    # between quick hits windows are short, and samples of another flight hide a lag
    unsure = np.trace(fitted.cov[:, :, 7::2, 7::2].sum(axis=1), axis1=1, axis2=2) / square
    sure = np.argsort(unsure, kind="stable")[: max(round(SUREST * len(unsure)), ENOUGH)]
    if len(sure) < FEWEST:
        return 0.0
    late = -((turn * spun).sum(axis=1) / square)[sure]
    middle, error = float(np.median(late)), MEDIAN * float(robust_std(late - np.median(late))) / np.sqrt(len(sure))
    return middle if abs(middle) > max(SURE * error, least) else 0.0


def lag_warning(lag: float, lasts: float, shifted: bool) -> tuple[str, ...]:
    """Sentences for the user on a `lag` in s of attitudes behind positions; empty without a lag.

    `lasts`: s, apparent duration of contacts; `shifted`: whether the detection corrects the lag.
    """
    if not lag:
        return ()
    where, cause = "behind" if lag > 0.0 else "ahead of", ", as if they had a separate clock or filter."
    if 0.0 < -lag < EARLY * lasts:
        cause = f". Contacts of about {1e3 * lasts:.2g} ms can cause that, because friction acts early in them."
    done = " Hits and flights are detected with orientations shifted to the instants of positions; models are compared "
    done = f"{done}at the times in the file." if shifted else ""
    return (f"At hits orientations come {1e3 * abs(lag):.2g} ms {where} positions{cause}{done}",)
