"""One long recording cut into drops: chains of free flights with impacts between them.

A drop begins with a free flight that ends at the surface.  It continues through impacts, as long as the next flight
begins soon, or the body neither rests nor is lifted before it.  It ends shortly after its last flight, or with it if
the body is caught in the air.  Motions by hand between drops are not flights.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from thesis_lib.datasets.space.flights import SHORTEST, Track, inner, inner_samples

CONTACT = 0.15  # s between flights of one drop, whatever happens: hits in quick succession, rolling over a corner
REST = 0.1  # s for which a body is still only at rest, or in a hand
TAIL = 0.1  # s kept after the last flight: its impact, and how the body comes to rest
STILL, SETTLES, RESTS = 0.02, 3.0, 0.5  # m/s, speed limit of a rest; s, longest time until it; s of it that are kept
NEAR = 0.25  # extents of the body above the surface that count as contact, as height and angle are uncertain
IN_THE_AIR = "ends above the surface (caught, or out of view)"
SPATIAL = "leaves the plane"


@dataclass(frozen=True, eq=False)
class Drop:
    """Samples [start, stop) of a recording and the flights within.

    `lands`: the last flight ends with an impact; `left_out`: reason why the drop is left out, "" if it is not.
    """

    trial: int
    start: int
    stop: int
    flights: tuple[slice, ...]
    lands: bool = True
    left_out: str = ""


@dataclass(frozen=True, eq=False)
class Cuts:
    """Pieces of a recording, for the picture and the table of its impacts."""

    t: np.ndarray  # (n,) s since its start
    height: np.ndarray  # (n,) m, lowest point of the body above the surface
    drops: tuple[Drop, ...]
    impacts: pd.DataFrame  # trial, impact, t, energy_out_before, energy_out_after, left_out


def cut_drops(track: Track, height: np.ndarray, flights: Sequence[slice], extent: float) -> list[Drop]:
    """The drops of a recording, numbered in order of time; `height` (n,) in m is the height of the lowest point.

    `extent` is that of the body in m.  A flight that ends in the air without an impact before it is left out.
    """
    t, step = track.t, float(np.median(np.diff(track.t)))
    chains: list[tuple[list[slice], bool]] = []
    for flight in flights:
        soon = slice(flight.stop - 1, int(np.searchsorted(t, t[flight.stop - 1] + CONTACT)))
        pause = float(np.max(np.diff(t[soon]), initial=step))
        v = track.v[flight]
        last = v[np.isfinite(v).all(axis=1)][-1:]
        lands = np.min(height[soon]) < NEAR * extent + 2.0 * pause * np.linalg.norm(last)
        if chains and chains[-1][1] and _goes_on(track, height, chains[-1][0][-1], flight, flights, extent):
            chains[-1] = ([*chains[-1][0], flight], lands)
        else:
            chains.append(([flight], lands))
    drops = []
    for trial, (chain, lands) in enumerate(chains):
        last = chain[-1].stop
        later = [flight.start for flight in flights if flight.start >= last]
        stop = min([int(np.searchsorted(t, t[last - 1] + TAIL)), *later]) if lands else last
        reason = "" if lands or len(chain) > 1 else IN_THE_AIR
        drops.append(Drop(trial, chain[0].start, stop, tuple(chain), lands, reason))
    return drops


def _goes_on(
    track: Track, height: np.ndarray, last: slice, flight: slice, flights: Sequence[slice], extent: float
) -> bool:
    """Whether a flight belongs to the same drop as the one before it, `last`, which ends at the surface.

    Flights are found without their ends and only if they are long enough: between two of them a body may hop or rock.
    It stays as low as such a hop, does not come to rest, and flies no higher than before by more than its size.
    """
    t, a, b = track.t, last.stop - 1, flight.start
    if t[b] - t[a] < CONTACT:
        return True
    between, fall = slice(a, b + 1), np.nanmedian(track.a[inner_samples(flights, track)], axis=0)
    g, step = float(np.linalg.norm(fall)), float(np.median(np.diff(t)))
    hop = g * ((2 * track.half + SHORTEST) * step) ** 2 / 8.0
    high = height[between] > extent + hop
    lifted = high[int(np.argmin(high)) :].any()  # once it is low; the end of its fall may not have been found
    if t[b] - t[a] > SETTLES or np.max(np.diff(t[between])) > CONTACT or lifted:
        return False
    still = np.linalg.norm(track.v[between], axis=1) < STILL
    edges = np.flatnonzero(np.diff(np.r_[False, still, False].astype(int)))
    if any(t[a + end - 1] - t[a + first] > REST for first, end in zip(edges[::2], edges[1::2])):
        return False
    ends = (inner(last, track).stop - 1, inner(flight, track).start)
    before, after = (float(track.v[at] @ track.v[at]) / (2.0 * g) + height[at] for at in ends)
    return bool(after < before + extent)


def until_rest(drops: Sequence[Drop], track: Track, height: np.ndarray, extent: float) -> list[Drop]:
    """The drops, extended by the final rest if the body comes to rest on the surface before it is taken away.

    `height` and `extent` as in `cut_drops`.
    """
    t = track.t
    speed = np.linalg.norm(track.v, axis=1)
    with np.errstate(invalid="ignore"):
        still = (speed < STILL) & (np.abs(height) < NEAR * extent)
    longer = []
    for drop, following in itertools.zip_longest(drops, drops[1:]):
        end = len(t) if following is None else following.start
        end = min(end, int(np.searchsorted(t, t[drop.stop - 1] + SETTLES)))
        first = drop.stop + int(np.argmax(still[drop.stop : end])) if still[drop.stop : end].any() else end
        # not if a hand lifts the body first
        if drop.lands and first < end and not np.any(height[drop.stop : first] > extent):
            moves = np.flatnonzero(~still[first:end])
            last = int(np.searchsorted(t, t[first] + RESTS))
            drop = replace(drop, stop=min(first + int(moves[0]) if len(moves) else end, last))
        longer.append(drop)
    return longer


def whole_pieces(piece: np.ndarray, flights: Sequence[slice]) -> list[Drop]:
    """A drop for each run of equal numbers in `piece` (n,), for recordings that state their trials."""
    edges = np.r_[0, np.flatnonzero(np.diff(piece)) + 1, len(piece)]
    drops = []
    for a, b in itertools.pairwise(edges):
        within = tuple(flight for flight in flights if a <= flight.start and flight.stop <= b)
        drops.append(Drop(int(piece[a]), int(a), int(b), within))
    return drops


def impact_shares(
    drops: Sequence[Drop], t: np.ndarray, out: np.ndarray, total: np.ndarray, most: float
) -> tuple[list[Drop], pd.DataFrame]:
    """The drops, marked if they leave the plane, and the share of energy out of it before and after each impact.

    `out`, `total` (n,) are E_out and E of the samples (NaN where unknown).  A drop with a share of more than `most` in
    one of its flights is left out.
    """
    judged, rows = [], []
    for drop in drops:
        shares = [_share(out[flight], total[flight]) for flight in drop.flights]
        worst = max((share for share in shares if np.isfinite(share)), default=0.0)
        reason = drop.left_out or (SPATIAL if worst > most else "")
        judged.append(replace(drop, left_out=reason))
        for i, flight in enumerate(drop.flights[: None if drop.lands else -1]):
            after = shares[i + 1] if i + 1 < len(shares) else np.nan
            hit = t[flight.stop - 1] - t[drop.start]
            rows.append([drop.trial, i, hit, shares[i], after, reason])
    columns = ["trial", "impact", "t", "energy_out_before", "energy_out_after", "left_out"]
    return judged, pd.DataFrame(rows, columns=columns)


def _share(out: np.ndarray, total: np.ndarray) -> float:
    whole = np.isfinite(out) & np.isfinite(total)
    energy = float(np.sum(total[whole]))
    return float(np.sum(out[whole])) / energy if energy > 0.0 else float("nan")
