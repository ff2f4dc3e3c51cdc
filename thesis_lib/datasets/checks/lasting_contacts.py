"""Contacts that last: the body sinks into the surface, reverses there, and leaves it many samples later.

A body also crosses a surface that is stated too high, but its path then has a corner, and its depth does not depend on
its speed.  In a soft contact the depth grows with the speed, and the force is spread over the time T inside.  Two
neighbouring samples then contain, of the change of velocity inside,

    nearly all   at a corner,        less than π Δt/T   under a half-sine force.
"""

from dataclasses import dataclass

import numpy as np
from scipy.stats import theilslopes

from thesis_lib.datasets.format.samples import Samples

LONGER = 0.01  # s; the arcs allow for shorter contacts
FEWEST = 6  # contacts
DEEP, OF_NOISE = 2e-3, 5.0  # m and sigmas: depth that is not noise
OFTEN = 0.5  # share of deep contacts among those clear of the noise; dice dip in now and then
WITHIN = 4  # samples inside: fewer do not show the path there
SPREAD = 0.8  # share of the change of velocity in two neighbouring samples; a corner has 0.95 and more
BY_SPEED = 0.5  # share of the depth that is proportional to the speed
MOST = 400  # contacts that are examined: pairs of them are compared


@dataclass(frozen=True)
class LastingContacts:
    """Number of contacts, their median time inside in s, the largest depth in m, the share of all samples inside."""

    count: int
    duration: float
    depth: float
    share: float

    def sentence(self) -> str:
        """Message on contacts that last: what they are, why impulses do not describe them, and what to do."""
        lasts = f"{self.duration:.2g} s" if self.duration >= 0.095 else f"{1e3 * self.duration:.2g} ms"
        return (
            f"Contacts last about {lasts}: {self.count} times the body sinks into the surface, up to "
            f"{1e3 * self.depth:.3g} mm deep, and comes out again ({self.share:.0%} of all samples lie inside). The "
            "contact is soft, like that of foam or of a simulator with a weak spring. An impact law treats a contact "
            "as an impulse at an instant between free flights, which does not hold here. Make the contact stiffer, so "
            "that it lasts a few milliseconds, or model its force over time instead."
        )


def lasting_contacts(
    samples: Samples, gap: np.ndarray, sigma: float, gravity: float, tumbles: bool = False
) -> LastingContacts | None:
    """Contacts longer than `LONGER`; None if there are few, or if a wrong height of the surface explains them.

    `gap` (N,) is the gap of each sample in m, `sigma` its noise; `gravity` in m/s².  The lowest point of a body that
    `tumbles` reverses without a force: its depth must then grow with the speed.
    """
    inside, t, n = gap < 0.0, samples.t, len(samples)
    joined = np.r_[False, samples.run[1:] == samples.run[:-1]][:n]
    first = np.flatnonzero(inside & joined & ~np.r_[True, inside[:-1]][:n])
    leaves = np.flatnonzero(~inside & joined & np.r_[False, inside[:-1]][:n])
    if not len(first) or not len(leaves):
        return None
    end = leaves[np.minimum(np.searchsorted(leaves, first), len(leaves) - 1)]
    whole = (end > first) & (samples.run[np.minimum(end, n - 1)] == samples.run[first])
    first, end = first[whole], end[whole]
    if not len(first):
        return None
    depth = -np.minimum.reduceat(gap, np.column_stack([first, end]).ravel())[::2]
    speed = (gap[first - 1] - gap[first]) / (t[first] - t[first - 1])
    came = t[first] + gap[first] / speed
    went = t[end] - gap[end] * (t[end] - t[end - 1]) / (gap[end] - gap[end - 1])
    clear = depth > OF_NOISE * float(np.nan_to_num(sigma))
    deep = clear & (depth > DEEP)
    if deep.sum() < max(FEWEST, OFTEN * clear.sum()):
        return None
    first, end, depth, speed, took = (a[deep] for a in (first, end, depth, speed, went - came))
    if np.median(end - first) < 2 or np.median(took) <= LONGER:
        return None
    some = np.unique(np.linspace(0, len(first) - 1, MOST).astype(int))
    by_speed = _by_speed(speed[some], depth[some])
    if not by_speed and (tumbles or not _spread_out(t, gap, first[some], end[some], gravity)):
        return None
    return LastingContacts(len(first), float(np.median(took)), float(depth.max()), float(inside.mean()))


def _by_speed(speed: np.ndarray, depth: np.ndarray) -> bool:
    """Whether the depth of contacts grows with their speed, which a wrong height of the surface does not explain."""
    if np.ptp(speed) == 0.0 or np.ptp(depth) == 0.0:
        return False
    slope, _, low, _ = np.array(theilslopes(depth, speed)).tolist()
    return low > 0.0 and slope * float(np.median(speed)) > BY_SPEED * float(np.median(depth))


def _spread_out(t: np.ndarray, gap: np.ndarray, first: np.ndarray, end: np.ndarray, gravity: float) -> bool:
    """Whether the velocity changes over the whole contact, not at a corner, in contacts of `WITHIN` samples or more."""
    long = end - first >= WITHIN
    if long.sum() < FEWEST:
        return False
    shares = []
    for i, j in zip(first[long], end[long]):
        velocity = np.diff(gap[i - 1 : j + 1]) / np.diff(t[i - 1 : j + 1])
        change = np.diff(velocity) + gravity * 0.5 * (t[i + 1 : j + 1] - t[i - 1 : j - 1])
        shares.append((change[1:] + change[:-1]).max() / max(change.sum(), 1e-12))
    return float(np.median(shares)) < SPREAD
