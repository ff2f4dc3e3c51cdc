"""Repeated pictures, as in video converted to a higher rate, screen recordings, or trackers that hold the last pose.

Two consecutive pictures of a moving body are never equal in all digits.  If they are, the second is a copy of the
first, and its pose is wrong by the motion since.  Copies are left out, like lost frames.

The pose of a body at rest repeats, and so does that of a slow body if it has few digits.  A copy is therefore accepted
only if the body moves by `STEPS` digits both before and after it, at most `LONGEST` times in a row.  Copies must also
be frequent, a share `SHARE` of the pictures in motions clearly above the noise: coarse digits repeat by chance at the
turning point of a bounce.  Copies at even steps are those of a video; others those of a tracker that lost the body.
"""

import numpy as np

from thesis_lib.datasets.format.samples import Samples, noise_from_differences

SIGMAS = 6.0  # of the noise of a sample, 4 of that of a step
STEPS = 3  # of the last digit; slower motion may repeat its digits
LONGEST = 5  # copies in a row
SHARE = 0.02  # of the pictures in motion; chance stays below a third of that
FEWEST = 5
EVEN = (
    0.5  # of the steps between copied pictures, which are even in converted video; a tracker loses a body at any time
)


def without_copies(samples: Samples) -> tuple[Samples, str]:
    """The samples without copies, and a message on the copies; the same samples and "" if there are none."""
    keep, said = originals(samples)
    return (samples.select(keep) if said else samples), said


def originals(samples: Samples) -> tuple[np.ndarray, str]:
    """Mask (N,) of the samples that are not copies, and a message on the copies; all and "" if there are none."""
    n = len(samples)
    if n < 3:
        return np.ones(n, bool), ""
    q = samples.q
    # the least difference between two values of a column; a constant column never moves
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
    said = (
        f"{100.0 * share:.2g} % of the pictures of the moving body ({copies} of {pictures}) repeat the previous one, "
        "digit for digit, "
    )
    if _in_step(first[moving & (length > 0)], share):
        return keep, said + (
            "as in video converted to a higher rate, or a tracker that is logged faster than it measures "
            f"({rate:.3g} pictures a second made of {rate * (1.0 - share):.3g}): the copies are left out as lost "
            "frames. Export the pictures as they were taken."
        )
    return keep, said + (
        "now and then, as from a tracker that holds its last pose where it loses the body: the copies are left out as "
        "lost frames; there is nothing to do."
    )


def _in_step(rows: np.ndarray, share: float) -> bool:
    """Whether pictures that are copied, the indices `rows` (k,), follow at even steps, as in a change of rate.

    `share` of the copies among the pictures.  The steps are then k or k + 1; one less or more allows for copies of slow
    bodies, which are not found and lower the share.
    """
    usual = int(1.0 / min(share, 1.0 - share))
    step = np.diff(rows)
    return len(step) == 0 or float(np.mean(np.abs(step - usual) <= 1)) > EVEN
