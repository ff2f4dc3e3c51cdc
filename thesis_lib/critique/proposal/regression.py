"""Sparse regression: which few terms, of all, would explain what a fitted model leaves?

With z the whitened residuals of the fitted model and X their slopes in the terms, both after the slopes of the fitted
parameters are projected out, orthogonal matching pursuit chooses the columns that explain z best, one after the other.
Columns that depend on each other make one choice fragile.  So it is repeated on halves of the trials, and terms count
by the share of halves in which they were chosen (stability selection).

Sources: Pati, Rezaiifar and Krishnaprasad 1993, doi:10.1109/ACSSC.1993.342465 (orthogonal matching pursuit);
Meinshausen and Bühlmann 2010, doi:10.1111/j.1467-9868.2010.00740.x (stability selection).
"""

from collections.abc import Sequence

import numpy as np

from thesis_lib.critique.drops.world import Drops
from thesis_lib.critique.likelihood.fit import Fit
from thesis_lib.critique.proposal.effect_file import effect_of
from thesis_lib.critique.proposal.terms import Term
from thesis_lib.critique.selection.scan import Scan, orthonormal, scan

HALVES = 40  # halves of the trials
CHOSEN = 2  # terms chosen in each
TRIED = 60  # terms that gain most are what the halves choose from


def regress(
    world: Drops, fitted: Fit, terms: Sequence[Term], rng: np.random.Generator
) -> tuple[Scan, dict[str, float]]:
    """Score tests of all terms at `fitted`, whose null counts all that were tried, and how often each is chosen.

    The latter is the share of the halves by name of the term, the largest first.
    """
    slopes = world.slopes(fitted, [effect_of(term) for term in terms])
    tests = scan(slopes, world.resamples, rng)
    names = sorted(tests.gain, key=lambda name: -tests.gain[name])[:TRIED]
    Q = orthonormal(slopes.fitted)
    X = np.concatenate([slopes.candidates[name] for name in names], axis=1)
    X, z = (part - Q @ (Q.T @ part) for part in (X, slopes.residual))
    # the trial of each whitened residual: impacts first, then flights
    o = world.observations
    of_flights = np.repeat(o.flights.trial, o.flights.variance.shape[1])
    trial = np.concatenate([np.repeat(o.trial, (len(z) - len(of_flights)) // len(o)), of_flights])
    share = {name: count / HALVES for name, count in _chosen(X, -z, trial, names, rng).items()}
    return tests, dict(sorted(share.items(), key=lambda pair: (-pair[1], -tests.gain[pair[0]])))


def _chosen(
    X: np.ndarray, y: np.ndarray, trial: np.ndarray, names: Sequence[str], rng: np.random.Generator
) -> dict[str, int]:
    """How often each of the columns X (N, p) is chosen for y (N,) on halves of the trials."""
    from sklearn.linear_model import orthogonal_mp_gram

    trials, of = np.unique(trial, return_inverse=True)
    norm = np.linalg.norm(X, axis=0)
    keep = np.flatnonzero(norm > 0.0)
    X = X[:, keep] / norm[keep]
    counts: dict[str, int] = dict.fromkeys(names, 0)
    for _ in range(HALVES):
        half = np.zeros(len(trials), bool)
        half[rng.permutation(len(trials))[: len(trials) // 2]] = True
        rows = half[of]
        scale = np.linalg.norm(X[rows], axis=0) + 1e-300
        part = X[rows] / scale
        chosen = orthogonal_mp_gram(part.T @ part, part.T @ y[rows], n_nonzero_coefs=min(CHOSEN, len(keep)))
        for column in np.flatnonzero(chosen):
            counts[str(names[int(keep[column])])] += 1
    return counts
