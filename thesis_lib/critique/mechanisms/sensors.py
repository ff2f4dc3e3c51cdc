"""Sensor errors that a recording states: they are fitted with every model and do not count as a missing force.

    torque_delay    Q_i = -d τ̇_i                                     d ~ N(0, delay²): delay of the joint readings
    torque_offset   Q_i = o_i                                        o ~ N(0, torque_offset²)
    torque_ripple   Q_i = τ_i Σ_n a_n cos n q_i + b_n sin n q_i      a, b ~ N(0, torque_ripple² / HARMONICS)

Their priors are part of the likelihood.  An error larger than stated therefore shows: either as a missing force that
explains it better, or as sensors that are worse than stated.  The ripple is only assumed to repeat with each turn;
components that vary faster than HARMONICS times a turn average out over a window.

The delay of the camera is found beforehand, from geometry alone.  The gap is zero in contact; if the disk's pose is
read d later than the joints, the gap appears as d times the speed with which the disk alone would open it:

    d̂ = argmin Σ_k min(φ(q_joints(t_k), q_disk(t_k + d))², c²)

Gaps are cut off at c = `OUTLIER`, which removes the influence of samples in flight.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from thesis_lib.critique.mechanisms.effects import OFFSET, MechanismEffect, MotionSteps, at_joints, parameters
from thesis_lib.critique.mechanisms.model import BelievedModel
from thesis_lib.critique.mechanisms.steps import Trial, interpolation
from thesis_lib.datasets.recordings.header import Sampling

HARMONICS = 32  # per turn; a window of 0.2 s at 1 rad/s spans a thirtieth of a turn
OUTLIER = 2e-3  # m, beyond the noise of a gap
GRID = 41  # number of delays tried, from -delay to delay


def sensor_errors(sampling: Sampling, joints: int) -> tuple[MechanismEffect, ...]:
    """Return the torque errors of a mechanism with `joints` driven joints, with their priors."""
    if not joints:
        return ()
    each = range(1, joints + 1)
    of = {
        "sensor_delay": ("joints that are read late", "Q_i = −d τ̇_i", _delay, parameters("s", 1e-3, "d")),
        "sensor_offset": (
            *("offsets of the torques", "Q_i = o_i", OFFSET),
            parameters("N m", 0.01, *(f"o_{i}" for i in each)),
        ),
        "sensor_ripple": (
            *("ripple of the torques", "Q_i = τ_i ρ(q_i)", _ripple),
            parameters("1", 0.01, *(f"{ab}_{i}_{n}" for i in each for ab in "ab" for n in range(1, HARMONICS + 1))),
        ),
    }
    stated = (sampling.delay, sampling.torque_offset, sampling.torque_ripple / np.sqrt(HARMONICS))
    return tuple(
        MechanismEffect(name, "measurement", *what, prior=(sigma,) * len(what[-1]))
        for (name, what), sigma in zip(of.items(), stated)
        if sigma
    )


_delay = at_joints(lambda p, motion, n: -p[0] * motion.df[:, :n])


@at_joints
def _ripple(p: np.ndarray, motion: MotionSteps, joints: int) -> np.ndarray:
    angles = np.arange(1, HARMONICS + 1) * motion.q[:, :joints, None]
    waves = np.concatenate([np.cos(angles), np.sin(angles)], axis=2)
    share = np.einsum("kjh,jh->kj", waves, np.reshape(p, (joints, -1)))
    return motion.f[:, :joints] * share


def camera_delay(trials: Sequence[Trial], model: BelievedModel, delay: float) -> float:
    """Return the delay in s of the disk's pose after the joints, at most `delay`; 0 if no link can touch the disk."""
    pairs = [j for j, one in enumerate(_touches(model)) if one]
    if not pairs or not delay:
        return 0.0
    h = trials[0].h

    def misfit(d: float) -> float:
        total = 0.0
        for t in trials:
            m = len(t.q)
            q = np.array(t.q)
            at = np.arange(m) + d / h
            q[:, model.joints :] = interpolation(m, d / h) @ t.q[:, model.joints :]
            inside = (at >= 0) & (at <= m - 1)
            phi = model.mechanism.contacts_of(q[inside]).phi[:, pairs]
            total += np.minimum(phi**2, OUTLIER**2).sum() / inside.sum() * m
        return total

    grid = np.linspace(-delay, delay, GRID)
    best = grid[int(np.argmin([misfit(d) for d in grid]))]
    step = grid[1] - grid[0]
    # a parabola through three points about the minimum, where the set of gaps cut off no longer changes
    left, middle, right = (misfit(best + s * step) for s in (-1.0, 0.0, 1.0))
    bend = left - 2.0 * middle + right
    return float(best + (0.5 * step * (left - right) / bend if bend > 0 else 0.0))


def _touches(model: BelievedModel) -> np.ndarray:
    """Return (p,) whether each pair joins a driven link and the body that the camera sees."""
    q = np.full((1, len(model.coordinates)), 0.3)
    J = model.mechanism.contacts_of(q).J_n[0]
    return np.abs(J[:, : model.joints]).sum(axis=1) > 0.0


def aligned(trials: Sequence[Trial], model: BelievedModel, late: float) -> list[Trial]:
    """Return trials whose body poses, read `late` s later than the joints, are interpolated to the joints' instants.

    Samples that would need poses from outside a trial are removed at its ends.
    """
    if not late:
        return list(trials)
    out = []
    for t in trials:
        m, shift = len(t.q), late / t.h
        W = interpolation(m, shift)
        q = np.array(t.q)
        bodies = range(model.joints, q.shape[1])
        q[:, model.joints :] = W @ q[:, model.joints :]
        first, last = max(0, int(np.ceil(-shift))), m - max(0, int(np.ceil(shift)))
        # joints keep their samples; `mixed` maps all samples of a trial to the remaining samples
        kept = slice(first, last)
        mixed = dict.fromkeys(bodies, W[kept, kept])
        out.append(replace(t, q=q[kept], v=t.v[kept], f_ext=t.f_ext[first : last - 1], mixed=mixed))
    return out
