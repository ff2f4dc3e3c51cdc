"""Measured trials, and the state, acceleration and known force of each step as weighted sums of neighbouring samples.

A step needs q, v, v̇ and the known force f at one instant.  How they follow from samples depends on the source of the
velocities (`sampling` in recording.yaml):

    time_stepping   q_k, v_k, (v_{k+1} - v_k) / h, f_k                       exact for a time-stepping simulation
    measured        means of samples k and k+1, (v_{k+1} - v_k) / h, f_k     midpoint rule, second order in h
    derived         (q_{k+1} - 2 q_k + q_{k-1}) / h², (f_{k-1} + f_k) / 2, and q and v of a parabola through seven
                    samples

Velocities computed from positions carry no independent noise, and filters delay them.  So `derived` uses positions
alone.  f acts from its sample to the next; a second difference therefore contains the mean of two values of f.  The
parabola separates the noise of q_k in the contact directions from the same noise in v̇, because the product of both
would act like a force.  It is wider than a second difference and rounds off impacts, which is a second-order error.

A second difference divides an impact between two steps according to its instant, as it should.  The midpoint rule does
not resolve the instant; `windows` adds the resulting error to the noise.

A window weights its steps by the kernel that is best for its noise: uniform for time stepping, (1 - s²) for noisy
velocities and (1 - s²)² for noisy positions, |s| <= 1 in the window: least-squares fits of a line and of a parabola.

Sources: A. Savitzky, M. J. E. Golay, Anal. Chem. 36 (1964), doi 10.1021/ac60214a047; D. A. Messenger, D. M. Bortz,
Multiscale Model. Simul. 19 (2021), doi 10.1137/20M1343166 (test functions).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from thesis_lib.critique.mechanisms.settings import EquationWindowSettings
from thesis_lib.simulate.mechanisms.noise_snr import add_noise
from thesis_lib.simulate.stepping.stepping import SimulatedMotion

Velocities = Literal["measured", "derived", "time_stepping"]
Stencil = tuple[tuple[str, int, float], ...]  # ("q" or "v", sample relative to k, weight)
_HALF = 3  # samples of the parabola on each side
_PARABOLA = (-2.0, 3.0, 6.0, 7.0, 6.0, 3.0, -2.0)  # divided by 21: weights for the value in the middle


@dataclass(frozen=True)
class Trial:
    """Measured motion: q, v (m+1, nv), f_ext (m, nv), and the noise `sigma` (2, nv) of q and v.

    Attributes:
        velocities: source of v, see the docstring of this module.
        jitter: s, standard deviation of the instant of a sample.
        mixed: by coordinate, (m+1, m+1) weights with which q was interpolated from noisy samples.
    """

    h: float
    q: np.ndarray
    v: np.ndarray
    f_ext: np.ndarray
    sigma: np.ndarray
    velocities: Velocities = "time_stepping"
    jitter: float = 0.0
    mixed: Mapping[int, np.ndarray] = field(default_factory=dict)


@dataclass(frozen=True)
class StepRule:
    """How steps follow from samples.

    Attributes:
        q, v, a: stencils of state and acceleration.
        f: (sample, weight) of the known force.
        df: (sample, weight) of its time derivative, in 1/s.
        before, after: samples that a step needs on each side of k.
        power: exponent of the kernel (1 - s²)^power.
        is_blind_to_instants: whether the instant of an impact within a step causes a first-order error.
    """

    q: Stencil
    v: Stencil
    a: Stencil
    f: tuple[tuple[int, float], ...]
    df: tuple[tuple[int, float], ...]
    before: int
    after: int
    power: int
    is_blind_to_instants: bool = False

    def of(self, stencil: Stencil, q: np.ndarray, v: np.ndarray, k: np.ndarray) -> np.ndarray:
        """Return the weighted sum (n, nv) of a stencil at steps k (n,) from samples q and v (m, nv)."""
        samples = {"q": q, "v": v}
        return sum((w * samples[name][k + j] for name, j, w in stencil), np.zeros((len(k), q.shape[1])))

    def kernel(self, length: int) -> np.ndarray:
        """Return the weights (length,) of the steps of a window."""
        s = 2.0 * (np.arange(length) + 0.5) / length - 1.0
        return (1.0 - s**2) ** self.power


def rule_of(velocities: Velocities, h: float) -> StepRule:
    """Return the rule for samples taken every h seconds."""
    a = (("v", 1, 1.0 / h), ("v", 0, -1.0 / h))
    if velocities == "time_stepping":
        return StepRule((("q", 0, 1.0),), (("v", 0, 1.0),), a, ((0, 1.0),), ((0, 0.0),), 0, 1, 0)
    if velocities == "measured":
        q, v = ((("q", 0, 0.5), ("q", 1, 0.5)), (("v", 0, 0.5), ("v", 1, 0.5)))
        return StepRule(q, v, a, ((0, 1.0),), ((-1, -0.5 / h), (1, 0.5 / h)), 1, 2, 1, True)
    around = range(-_HALF, _HALF + 1)
    value = tuple(("q", j, w / 21.0) for j, w in zip(around, _PARABOLA))
    slope = tuple(("q", j, j / (28.0 * h)) for j in around)
    second = (("q", 1, 1.0 / h**2), ("q", 0, -2.0 / h**2), ("q", -1, 1.0 / h**2))
    f, df = ((-1, 0.5), (0, 0.5)), ((-1, -1.0 / h), (0, 1.0 / h))
    return StepRule(value, slope, second, f, df, _HALF, _HALF + 1, 2)


def may_touch(phi: np.ndarray, reach: np.ndarray) -> np.ndarray:
    """Return (m-1, p) whether each pair may touch between samples k and k+1, from gaps and margins (m, p) in m.

    Between samples a gap may close as fast as before, or have opened as fast as afterwards.
    """
    change = np.diff(phi, axis=0)
    ahead, back = np.array(phi), np.array(phi)
    ahead[1:] += np.minimum(change, 0.0)
    back[:-1] -= np.maximum(change, 0.0)
    near = np.minimum(phi, np.minimum(ahead, back)) <= reach
    return near[:-1] | near[1:]


def interpolation(m: int, shift: float) -> np.ndarray:
    """Return (m, m) weights that give the signal `shift` samples later, by cubic interpolation; ends extrapolated."""
    W = np.zeros((m, m))
    at = np.arange(m) + shift
    first = np.clip(np.floor(at).astype(int) - 1, 0, m - 4)
    x = at - first
    for i in range(4):
        others = [j for j in range(4) if j != i]
        W[np.arange(m), first + i] = np.prod([(x - j) / (i - j) for j in others], axis=0)
    return W


def measured(
    records: Sequence[SimulatedMotion], snr_db: float, rng: np.random.Generator, settings: EquationWindowSettings
) -> tuple[Trial, ...]:
    """Return trials as measured at the signal-to-noise ratio `snr_db`; infinite: exact states."""
    trials = []
    for record in records:
        noisy = add_noise(record, snr_db, rng)
        sigma = noisy.sigma
        if not np.isfinite(snr_db):
            spread = np.stack([record.q.std(axis=0), record.v.std(axis=0)])
            sigma = spread * 10.0 ** (-settings.exact_db / 20.0)
        trials.append(Trial(record.h, noisy.q, noisy.v, record.f_ext, sigma))
    return tuple(trials)
