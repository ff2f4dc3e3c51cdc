"""Irreducible error (floor) of any model: how much of the remaining error depends on the state before impact?

Two estimates, from the residuals e_i = (δv_x, δv_y, k δω) of a fitted model at n impacts.

- *Learned*: a forest of extremely randomised trees (Geurts, Ernst and Wehenkel 2006) predicts e from all data known
  before the impact, on trials that it was not fitted to.  The part that it removes is not noise.
- *Pairs*: two impacts at nearly the same state have e_i − e_j = noise_i − noise_j, plus an effect of the remaining
  difference of the states.  The mean of |e_i − e_j| / √2 over the nearest pairs bounds the error of a perfect model
  from above, closely if the pairs are near.  The noise need not be known.

A residual learner with a larger error than either is not at the floor.

Source of the forest: doi:10.1007/s10994-006-6226-1.
"""

from dataclasses import dataclass

import numpy as np

from thesis_lib.contact.space import velocity_error
from thesis_lib.critique.drops.features import features
from thesis_lib.critique.likelihood.fit import Fit
from thesis_lib.critique.likelihood.observations import Observations
from thesis_lib.statistics.bootstrap import bootstrap_mean

FOLDS = 5
TREES, LEAF = 150, 3  # impacts in the smallest leaf; 2 to 10 learn the same within its interval
NEAREST = 0.05  # share of the impacts, those with the nearest neighbours
LENGTH = 0.3  # m along the surface that counts as 1 m/s of velocity between neighbours; restitution by place is slow
TURN = 1.0  # rad of angle that counts as 1 m/s
DRAWS = 999


@dataclass(frozen=True)
class Floor:
    """Mean errors in m/s: of the model, of the model with the learned correction, of the nearest pairs.

    `gain` is the fall of the error by the correction, with its 95 % interval from a bootstrap over trials; `pairs` is
    None with fewer than `FEWEST` pairs.
    """

    error: float
    learned: float
    gain: tuple[float, float, float]
    pairs: float | None


FEWEST = 10


def floor(fitted: Fit, observations: Observations, rng: np.random.Generator) -> Floor:
    """Both estimates from the single hits of `observations`, preferably trials that the model was not fitted to."""
    o = observations.single
    E = o.as_speeds(fitted.on(o).velocity_left)
    error, rest = velocity_error(E, 1.0), velocity_error(E - _learned(_state(fitted, o), E, o.trial, rng), 1.0)
    fall = error - rest
    low, high = bootstrap_mean(fall, o.trial, DRAWS, rng)
    scatter = _pairs(fitted, o, E)
    return Floor(
        float(error.mean()),
        float(rest.mean()),
        (float(fall.mean()), low, high),
        float(scatter.mean()) if len(scatter) >= FEWEST else None,
    )


def _state(fitted: Fit, o: Observations) -> np.ndarray:
    """All data known before n impacts, (n, p)."""
    table = features(fitted, o)
    before = fitted.on(o).before
    gap = before.y + o.rig.shape.contact_point(before.theta)[:, 1]
    turned = [np.cos(before.theta), np.sin(before.theta), np.cos(2.0 * before.theta), np.sin(2.0 * before.theta)]
    return np.column_stack([table.to_numpy(float), before.vx, before.vy, before.y, gap, *turned])


def _learned(X: np.ndarray, E: np.ndarray, trial: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Predictions (n, 3) of E (n, 3) from X (n, p), each by a forest that has not seen its trial."""
    from sklearn.ensemble import ExtraTreesRegressor

    trials, of = np.unique(trial, return_inverse=True)
    fold, seed = rng.permutation(np.arange(len(trials)) % FOLDS)[of], int(rng.integers(2**31))
    learned = np.zeros_like(E)
    for k in range(FOLDS):
        if not (fold == k).any():
            continue
        forest = ExtraTreesRegressor(TREES, min_samples_leaf=LEAF, random_state=seed, n_jobs=1)
        learned[fold == k] = forest.fit(X[fold != k], E[fold != k]).predict(X[fold == k])
    return learned


def _pairs(fitted: Fit, o: Observations, E: np.ndarray) -> np.ndarray:
    """|e_i − e_j| / √2 in m/s of the nearest pairs, each once."""
    from scipy.spatial import KDTree

    here = fitted.on(o)
    true = here.dynamics.to_true(here.before)
    place = np.stack([true.x / LENGTH, np.cos(true.theta) / TURN, np.sin(true.theta) / TURN], axis=1)
    S = np.concatenate([true.v * [1.0, 1.0, o.rig.k_told], place], axis=1)
    if len(S) < 2:
        return np.zeros(0)
    distance, nearest = (np.asarray(part)[:, 1] for part in KDTree(S).query(S, k=2))
    close = np.flatnonzero(distance <= np.quantile(distance, NEAREST))
    pairs = np.unique(np.sort(np.stack([close, nearest[close]], axis=1), axis=1), axis=0)
    return velocity_error(E[pairs[:, 0]] - E[pairs[:, 1]], 1.0) / np.sqrt(2.0)
