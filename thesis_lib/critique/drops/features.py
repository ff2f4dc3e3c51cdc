"""Features on which the error of an impact may depend, and a test whether it does.

A Gaussian process with one length scale per feature (ARD) is fitted to the residuals of one half of the trials.  Its
leave-one-out predictions on the other half estimate the learnable part of the error.  For the p-value the residuals of
the second half are permuted over its impacts.

The process is scikit-learn's: residuals are clipped, so one noise level holds for all.  The learners of chapter 4 have
their own process, in which wild impacts have more noise (`thesis_lib/learners/gaussian_process.py`).
"""

import warnings

import numpy as np
import pandas as pd

from thesis_lib.critique.likelihood.fit import Fit
from thesis_lib.critique.likelihood.observations import Observations
from thesis_lib.critique.selection.world import Remaining
from thesis_lib.effects.effect import Rig
from thesis_lib.mechanics.space import SPACE
from thesis_lib.mechanics.state import State
from thesis_lib.statistics.spread import robust_std

MOST = 160  # impacts per half: the fit costs n³, and 160 show a structure that matters
PERMUTATIONS = 199
RELEVANT = 3.0  # standard deviations: a feature with a longer length scale does not matter
CONSTANT = 1e-9  # in units of `FEATURES`: a smaller spread is rounding, as of the contact point of a ball
FEATURES = {
    "v_t": ("m/s", "tangential velocity of the contact point before impact"),
    "v_n": ("m/s", "normal velocity of the contact point before impact"),
    "omega": ("rad/s", "angular velocity before impact"),
    "r_x": ("m", "contact point ahead of the centre of mass"),
    "theta": ("rad", "body angle, within half a turn"),
    "x": ("m", "position along the surface"),
    "trial": ("1", "number of the release"),
    "wall": ("1", "number of the wall, from 0"),
    "t": ("s", "time since the first sample"),
    "y": ("m", "position across, along the second axis of the surface"),
    "omega_t": ("rad/s", "angular velocity about the direction of slip"),
    "omega_b": ("rad/s", "angular velocity about the axis across the slip"),
    "omega_n": ("rad/s", "angular velocity about the normal"),
    "r_t": ("m", "contact point ahead of the centre of mass, along the slip"),
    "r_b": ("m", "contact point beside the centre of mass, across the slip"),
}


def features(fitted: Fit, observations: Observations) -> pd.DataFrame:
    """Features of n impacts, columns and units as in `FEATURES`; t only for trajectories, wall only between walls.

    Without omega and theta if the angle is not measured.
    """
    here = fitted.on(observations)
    true = here.dynamics.to_true(here.before)
    if not observations.space.is_plane:
        return _in_space(true, observations)
    r = observations.rig.shape.contact_point(true.theta)
    table = pd.DataFrame(
        {
            "v_t": true.vx - r[:, 1] * true.omega,
            "v_n": true.vy + r[:, 0] * true.omega,
            "omega": true.omega,
            "r_x": r[:, 0],
            "theta": within_half_a_turn(true.theta),
            "x": true.x,
            "trial": observations.trial.astype(float),
        }
    )
    if not observations.rig.has_angle:
        table = table.drop(columns=["omega", "theta"])
    if observations.rig.walls:
        table["wall"] = observations.surface.astype(float)
        table.attrs["walls"] = [wall.name for wall in observations.rig.walls]
    if observations.arcs:
        table["t"] = observations.t
    return table


def _in_space(true: State, o: Observations) -> pd.DataFrame:
    """Features in space, along the axes of the slip: a turn of everything about the normal does not change them."""
    r = o.rig.lowest(true)
    axes = slip_axes(true, o.rig)
    (slip, _, v_n), spin, arm = (
        np.einsum("ijn,jn->in", axes, u) for u in (SPACE.velocity_at(true.velocity, true.spin, r), true.spin, r)
    )
    names = ("v_t", "v_n", "omega_t", "omega_b", "omega_n", "r_t", "r_b", "x", "y", "trial", "t")
    columns = (slip, v_n, *spin, *arm[:2], *true.position[:2], o.trial.astype(float), o.t)
    return pd.DataFrame(dict(zip(names, columns)))


def slip_axes(state: State, rig: Rig) -> np.ndarray:
    """Axes (3, 3, n) as rows: along the slip, across it, and along the normal."""
    v = SPACE.velocity_at(state.velocity, state.spin, rig.lowest(state))
    speed, zero = np.maximum(np.hypot(v[0], v[1]), 1e-12), np.zeros(len(state))
    cos, sin = v[0] / speed, v[1] / speed
    return np.stack([np.stack([cos, sin, zero]), np.stack([-sin, cos, zero]), np.stack([zero, zero, zero + 1.0])])


def _errors(fitted: Fit, o: Observations) -> np.ndarray:
    """Residuals (n, d + turns) of the velocity after impact in m/s, in space along the axes of the slip."""
    here = fitted.on(o)
    if o.space.is_plane:
        return o.as_speeds(here.velocity_left)
    axes, R = slip_axes(here.dynamics.to_true(here.before), o.rig), here.velocity_left
    parts = (R[:, :3].T, o.rig.k_g * R[:, 3:].T)
    return np.concatenate([np.einsum("ijn,jn->ni", axes, part) for part in parts], axis=1)


def within_half_a_turn(theta: np.ndarray) -> np.ndarray:
    """Angles (n,) in rad from −π/2 to π/2."""
    return np.remainder(theta + 0.5 * np.pi, np.pi) - 0.5 * np.pi


def remaining(fitted: Fit, observations: Observations, rng: np.random.Generator) -> Remaining:
    """Test the residuals of the velocity after impact for structure; errors in m/s.

    With fewer than two impacts in either half of the trials, no structure is found and the p-value is 1.
    """
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

    trials = rng.permutation(np.unique(observations.trial))
    first = np.flatnonzero(np.isin(observations.trial, trials[: len(trials) // 2]))[:MOST]
    second = np.flatnonzero(np.isin(observations.trial, trials[len(trials) // 2 :]))[:MOST]
    if min(len(first), len(second)) < 2:
        left = _length(_errors(fitted, observations)).mean() if len(observations) else 0.0
        return Remaining(1.0, float(left), float(left), ())
    table = features(fitted, observations)
    X = table.to_numpy(float)
    spread = X.std(axis=0)
    used = spread > CONSTANT
    names, X = ([name for name, use in zip(table.columns, used) if use], (X - X.mean(axis=0))[:, used] / spread[used])
    Y = _errors(fitted, observations)
    # a Gaussian process would fit single wild impacts only
    Y = Y - np.median(Y, axis=0)
    limit = 5.0 * robust_std(Y) + 1e-12
    Y = np.clip(Y, -limit, limit)
    scales, learned, draws = [], np.zeros((len(second), Y.shape[1])), np.zeros((PERMUTATIONS, len(second), Y.shape[1]))
    order = np.argsort(rng.random((PERMUTATIONS, len(second))), axis=1)
    for c in range(Y.shape[1]):
        scale = Y[first, c].std() or 1.0
        kernel = ConstantKernel(0.5, (1e-4, 1e2)) * RBF(np.full(len(names), 2.0), (0.3, 1e3)) + WhiteKernel(  # pyright: ignore[reportArgumentType]
            0.5, (1e-3, 10.0)
        )
        process = GaussianProcessRegressor(kernel, normalize_y=False, alpha=1e-8)
        with warnings.catch_warnings():
            # a length scale at its upper bound is a valid result: the feature does not matter
            warnings.simplefilter("ignore", ConvergenceWarning)
            process.fit(X[first], Y[first, c] / scale)
        K = process.kernel_(X[second])  # pyright: ignore[reportCallIssue]
        inverse = np.linalg.inv(K + 1e-8 * np.eye(len(second)))
        diagonal = np.diag(inverse)
        y = Y[second, c]
        learned[:, c] = y - (inverse @ y) / diagonal
        draws[:, :, c] = y[order] - (inverse @ y[order].T / diagonal[:, None]).T
        signal = process.kernel_.k1.k1.constant_value  # pyright: ignore[reportAttributeAccessIssue]
        scales.append(signal * scale**2 / process.kernel_.k1.k2.length_scale**2)  # pyright: ignore[reportAttributeAccessIssue]
    before, after = (float(_length(error).mean()) for error in (Y[second], Y[second] - learned))
    null = _length(Y[second][order] - draws).mean(axis=1)
    p_value = float((1 + np.sum(null <= after)) / (1 + PERMUTATIONS))
    relevance = np.sum(scales, axis=0)
    ranked = [names[i] for i in np.argsort(-relevance) if relevance[i] > relevance.max() / RELEVANT**2]
    return Remaining(p_value, before, after, tuple(ranked[:4]))


def _length(vectors: np.ndarray) -> np.ndarray:
    """Lengths (...) of vectors (..., m)."""
    return np.sqrt((vectors**2).sum(axis=-1))
