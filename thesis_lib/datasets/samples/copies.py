"""Pictures that repeat the one before: video converted to a higher rate, recorders of screens, trackers that hold.

Of a body that moves, two pictures in a row are never equal in all digits.  Where they are, the second is a copy of the
first, and its pose is wrong by what the body moved since.  Copies are left out, as lost frames are.

A body at rest repeats itself, and so does a slow one whose pose has few digits.  A copy is therefore believed only
where the body moves by `STEPS` digits both before and after it, at most `LONGEST` times in a row.  And there must be
enough of them, a share `SHARE` of the pictures between motions that no noise makes: coarse digits repeat by chance at
the turning point of a bounce.
"""

import numpy as np

from thesis_lib.datasets.format.samples import Samples, noise_from_differences

SIGMAS = 6.0  # of the noise of a sample, 4 of that of a step
STEPS = 3  # of the last digit; slower motion may repeat its digits
LONGEST = 5  # copies in a row
SHARE = 0.02  # of the pictures in motion; chance stays below a third of that
FEWEST = 5


def without_copies(samples: Samples) -> tuple[Samples, str]:
    """The samples without copies, and a sentence that says so; the same samples and "" where there are none."""
    keep, said = originals(samples)
    return (samples.select(keep) if said else samples), said


def originals(samples: Samples) -> tuple[np.ndarray, str]:
    """Mask (N,) of the samples that are no copies, and a sentence that says so; all and "" where there are none."""
    n = len(samples)
    if n < 3:
        return np.ones(n, bool), ""
    q = samples.q
    # the least difference between two values that occur; a constant column never moves by any
    digit = np.array([np.diff(np.unique(column)).min(initial=np.inf) for column in q.T])
    same_trial = samples.trial[1:] == samples.trial[:-1]
    equal = same_trial & (q[1:] == q[:-1]).all(axis=1)
    # groups of equal rows: first and last row of each
    first = np.flatnonzero(np.r_[True, ~equal])
    last = np.r_[first[1:], n] - 1
    step, length = np.abs(q[first[1:]] - q[last[:-1]]), last - first
    between_trials = samples.trial[first[1:]] != samples.trial[last[:-1]]

    def amid(least: np.ndarray, end: bool) -> np.ndarray:
        """Mask of the groups before and after which the body moves by more than `least` (3,); the trial may `end`."""
        moves = np.where(between_trials, end, (step > least).any(axis=1))
        return np.r_[end, moves] & np.r_[moves, end] & (length <= LONGEST)

    sigma = np.nan_to_num(noise_from_differences(samples.select(first)))
    moving = amid(STEPS * digit, True)
    clearly = amid(STEPS * digit + SIGMAS * sigma, False)
    copies, pictures = int(length[clearly].sum()), int((length + 1)[clearly].sum())
    if copies < max(FEWEST, SHARE * pictures):
        return np.ones(n, bool), ""
    keep = np.ones(n, bool)
    keep[1:] = ~(equal & np.repeat(moving, length + 1)[1:])
    rate, share = 1.0 / float(np.median(np.diff(samples.t)[same_trial])), copies / pictures
    return keep, (
        f"{100.0 * share:.2g} % of the pictures of the moving body ({copies} of {pictures}) repeat the one before, "
        f"digit for digit, as in video converted to a higher rate ({rate:.3g} pictures a second made of "
        f"{rate * (1.0 - share):.3g}): the copies are left out as lost frames. Export the pictures as they were taken."
    )
