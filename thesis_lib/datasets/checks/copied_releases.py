"""Releases that are not independent: equal, cut, resampled, mirrored or moved copies of one recording.

If one copy is used for training and another is held out, the two parts are not independent.  Heights above the surface
do not change when a release is moved along it, mirrored or turned about its normal; and a copy shares the noise of its
original, unlike any second release.  Heights are compared around the strongest kick of each release:

    d = min over δ of |h_i(s) − h_j(s + δ) − const|,    a copy if the typical d is below `SHARED` σ

with σ the noise of one height; heights of independent releases differ by √2 σ even where their motions are equal.
Bodies at rest are all alike, and a camera sees a body at rest with less noise: samples at rest are not compared.
"""

from collections.abc import Sequence

import numpy as np

from thesis_lib.datasets.format.validate import first_of
from thesis_lib.statistics.spread import MAD_TO_STD

BEFORE, AFTER, STEPS = 12, 48, 61  # samples compared before and after the kick, and points of a common grid
COARSE = 20.0  # σ, and
NEAR = 3e-3  # m: heights that differ by more on a common grid are not copies
KICK = 0.5  # m/s, smallest upward kick
SHARED = 0.8  # σ; a copy at the same times differs by rounding, one at times between them by part of the noise
MOVES = 30.0  # σ by which heights must vary in the window: bodies at rest are all alike
RESTS = 0.1  # m/s: rate of the height below which a sample counts as at rest, in both releases
ROUNDS = 3  # iterations for the shift in time
FLOOR = 1e-7  # m, least noise


def copies_text(pairs: Sequence[tuple[int, int]]) -> str:
    """Message on pairs of an original and its copy."""
    shown = first_of([f"{copy} of {original}" for original, copy in pairs], 5)
    count = len({copy for _, copy in pairs})
    what = "1 release is a copy of another" if count == 1 else f"{count} releases are copies of others"
    return f"{what}, cut, resampled, mirrored or moved: trial {shown}"


def copied_releases(trial: np.ndarray, t: np.ndarray, height: np.ndarray) -> list[tuple[int, int]]:
    """Pairs of a trial and its copy, from heights (n,) in m along the normal at times (n,) in s, by trial and time."""
    numbers, first = np.unique(trial, return_index=True)
    ends = [*first[1:], len(t)]
    kicked = [(number, t[a:b], height[a:b], _kick(t[a:b], height[a:b])) for number, a, b in zip(numbers, first, ends)]
    kept = [(number, s - s[at], h, slice(at - BEFORE, at + AFTER)) for number, s, h, at in kicked if at]
    if len(kept) < 2:
        return []
    noise = np.abs(np.concatenate([_off_neighbours(s[rows], h[rows]) for _, s, h, rows in kept]))
    sigma = max(float(np.median(noise)) * MAD_TO_STD, FLOOR)
    low, high = max(s[rows][0] for _, s, _, rows in kept), min(s[rows][-1] for _, s, _, rows in kept)
    common = np.array([np.interp(np.linspace(low, high, STEPS), s, h) for _, s, h, _ in kept])
    common -= common.mean(axis=1, keepdims=True)
    moving = np.flatnonzero(common.std(axis=1) > MOVES * sigma)
    pairs = []
    for k, i in enumerate(moving[:-1]):
        others = moving[k + 1 :]
        off = np.sqrt(np.mean((common[others] - common[i]) ** 2, axis=1))
        for j in others[off < max(COARSE * sigma, NEAR)]:
            if _apart(kept[i][1:3], kept[j][1:3]) < SHARED * sigma:
                pairs.append((int(kept[i][0]), int(kept[j][0])))
    return pairs


def _kick(t: np.ndarray, height: np.ndarray) -> int:
    """Index of the sample at the strongest upward kick; 0 for a release that is too short or has no kick."""
    if len(t) < BEFORE + AFTER + 2:
        return 0
    slope = np.diff(height) / np.diff(t)
    jump = slope[2:] - slope[:-2]  # over two samples, so that a kick between two samples counts fully
    at = int(np.argmax(jump[BEFORE - 2 : len(t) - AFTER - 2])) + BEFORE
    return at if jump[at - 2] > KICK else 0  # parabolas alone are all alike


def _off_neighbours(t: np.ndarray, height: np.ndarray) -> np.ndarray:
    """Heights (n − 4,) less the cubic through two samples on each side, over what noise of 1 m would leave there."""
    times, heights = (np.lib.stride_tricks.sliding_window_view(array, 5) for array in (t, height))
    times = np.delete(times, 2, axis=1) - times[:, [2]]
    own, others = times[:, :, None], times[:, None, :]
    with np.errstate(divide="ignore"):
        weight = np.where(np.eye(4, dtype=bool), 1.0, others / (others - own)).prod(axis=2)
    off = heights[:, 2] - np.einsum("nj,nj->n", weight, np.delete(heights, 2, axis=1))
    return off / np.sqrt(1.0 + (weight**2).sum(axis=1))


def _apart(one: tuple[np.ndarray, np.ndarray], other: tuple[np.ndarray, np.ndarray]) -> float:
    """Distance d in m of two releases, a robust median: near the kick an interpolated copy is off by more."""
    (s, h), (s_other, h_other) = one, other
    slope, own, shift, size = np.gradient(h_other, s_other), np.gradient(h, s), 0.0, np.inf
    for _ in range(ROUNDS):
        at = s + shift
        inner = (at >= s_other[0]) & (at <= s_other[-1])
        inner &= np.maximum(np.abs(own), np.abs(np.interp(at, s_other, slope))) > RESTS
        if inner.sum() < STEPS // 2:
            return np.inf
        off = h[inner] - np.interp(at[inner], s_other, h_other)
        off -= np.median(off)
        size = MAD_TO_STD * float(np.median(np.abs(off)))
        usual = np.abs(off) <= 3.0 * size
        v = np.interp(at[inner], s_other, slope)[usual]
        v = v - v.mean()
        shift += float(off[usual] @ v) / max(float(v @ v), 1e-12)
    return size
