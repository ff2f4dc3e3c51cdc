"""Effects fitted to the window equations of a mechanism, and score tests of those that are not in the model.

With all parameters of a set of effects refitted, U_c = -∂z/∂p_c,

    p̂ = argmin |z(0) - U p|²,    cov p̂ = (U'U)⁻¹,    log score = -|z|²/2 + const,
    gain_c = |P_c z|²/2,         P_c the projector on U_c after the columns in the model are projected out.

The null of the gains is the largest of any candidate on unit noise, so that p counts how many were tried.  Of a
candidate c that stands where s = P z is at work, on this design,

    expected loss = |s|² (1 - cos²)/2,    cos = |P_c s| / |s|.

Effects are linear in their parameters but for gravity's direction and where they need contact forces, which depend on
the other effects: a few linear fits, each at the last one's values, cover that.

| on paper | in code   | unit  | shape    | meaning                              |
|----------|-----------|-------|----------|--------------------------------------|
| z        | `z`       | 1     | (N,)     | whitened residual generalised forces |
| U        | `columns` | 1/p   | (N, n_p) |                                      |
| p̂        | `values`  |       | (n_p,)   | by effect                            |

Source: as `score_test`; C. R. Rao, Proc. Camb. Phil. Soc. 44 (1948), doi 10.1017/S0305004100023987 (score test).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from thesis_lib.critique.mechanisms.effects import MechanismEffect
from thesis_lib.critique.mechanisms.windows import WeakForm

ROUNDS = 3  # linear fits
_RANK = 1e-8  # of the largest singular value: columns below it are combinations of others


@dataclass(frozen=True)
class ForceFit:
    """Effects fitted to the window equations of a set of trials.

    Attributes:
        effects: in the order of selection.
        values, std: by effect, (n_p,) parameters and standard errors.
        z: (N,) whitened residual with the effects.
        columns: (N, sum n_p) U.
    """

    effects: tuple[MechanismEffect, ...]
    values: dict[str, np.ndarray]
    std: dict[str, np.ndarray]
    z: np.ndarray
    columns: np.ndarray


@dataclass(frozen=True)
class ForceScan:
    """Score tests of candidates, with the attributes of `score_test.Scan` and the columns of its effects.

    Attributes:
        gain: nats, by candidate; null: (draws,) the largest gain of all candidates in noise alone.
        basis: (N, n_p) orthonormal, of the columns that each candidate adds; shift: (N,) P z, the share of z in them.
        information: (n_p, n_p) of the candidate's parameters, the effects that are on being fitted too.
    """

    gain: dict[str, float]
    null: np.ndarray
    basis: dict[str, np.ndarray]
    shift: dict[str, np.ndarray]
    information: dict[str, np.ndarray]

    def p_value(self, gain: float) -> float:
        """Share of null draws with a gain at least as large, with the draw itself counted."""
        return float((1 + np.sum(self.null >= gain)) / (1 + len(self.null)))

    def lost(self, truth: str, other: str) -> float:
        """Expected loss of log score in nats if `other` stands where `truth` acts."""
        s = self.shift[truth]
        caught = self.basis[other].T @ s
        return float(0.5 * (s @ s - caught @ caught))

    def cosine(self, truth: str, other: str) -> float:
        """|P_other s| / |s| of the shift s of `truth`."""
        s = self.shift[truth]
        return float(np.linalg.norm(self.basis[other].T @ s) / max(np.linalg.norm(s), 1e-300))


def total_force(
    weak: WeakForm, effects: Sequence[MechanismEffect], values: Mapping[str, np.ndarray]
) -> np.ndarray:
    """Force (n, nv) of effects with given parameters, contact forces that they need included."""
    force = np.zeros_like(weak.f)
    motion = weak.motion
    for _ in range(2 if any(e.needs_normal for e in effects) else 1):
        motion = weak.with_normals(force) if force.any() else weak.motion
        force = sum((e.force(weak.model, motion, values[e.name]) for e in effects), np.zeros_like(weak.f))
    return force


def columns_of(
    weak: WeakForm,
    effect: MechanismEffect,
    effects: Sequence[MechanismEffect] = (),
    values: Mapping[str, np.ndarray] | None = None,
) -> np.ndarray:
    """U (N, n_p): what a unit of each parameter changes in -z, where `effects` with `values` act already."""
    values = values or {}
    motion = weak.with_normals(total_force(weak, effects, values)) if effects else weak.motion
    here = values.get(effect.name, np.array([p.null for p in effect.parameters]))
    base = effect.force(weak.model, motion, here)
    slopes = []
    for j, scale in enumerate(effect.scales):
        there = here.copy()
        there[j] += scale
        slopes.append((effect.force(weak.model, motion, there) - base) / scale)
    return weak.gathered(np.stack(slopes, axis=2))


def fit_effects(weak: WeakForm, effects: Sequence[MechanismEffect]) -> ForceFit:
    """Fit all parameters of `effects` to all rows of `weak`."""
    values = {e.name: np.array([p.null for p in e.parameters]) for e in effects}
    z, U = weak.residual(np.zeros_like(weak.f)), np.zeros((len(weak.trial), 0))
    std: dict[str, np.ndarray] = {}
    for _ in range(ROUNDS if effects else 0):
        U = np.concatenate([columns_of(weak, e, effects, values) for e in effects], axis=1)
        z = weak.residual(total_force(weak, effects, values))
        change = solve(U, z)
        at = 0
        spread = np.sqrt(np.diag(np.linalg.pinv(U.T @ U)))
        for e in effects:
            n = len(e.parameters)
            values[e.name] = values[e.name] + change[at : at + n]
            std[e.name] = spread[at : at + n]
            at += n
    if effects:
        z = weak.residual(total_force(weak, effects, values))
    return ForceFit(tuple(effects), values, std, z, U)


def scan_effects(
    weak: WeakForm,
    fitted: ForceFit,
    candidates: Sequence[MechanismEffect],
    resamples: int,
    rng: np.random.Generator,
) -> ForceScan:
    """Score tests of candidates at a fitted model."""
    Q = _basis(fitted.columns)
    z = fitted.z - Q @ (Q.T @ fitted.z)
    gain, basis, shift, information = {}, {}, {}, {}
    for e in candidates:
        U = columns_of(weak, e, fitted.effects, fitted.values)
        U = U - Q @ (Q.T @ U)
        B = _basis(U)
        part = B @ (B.T @ z)
        gain[e.name], basis[e.name], shift[e.name] = float(0.5 * part @ part), B, part
        information[e.name] = U.T @ U
    null = np.zeros(resamples)
    if basis:
        joint = _basis(np.concatenate(list(basis.values()), axis=1))
        draws = rng.standard_normal((joint.shape[1], resamples))
        null = np.max([0.5 * ((B.T @ joint @ draws) ** 2).sum(axis=0) for B in basis.values()], axis=0)
    return ForceScan(gain, null, basis, shift, information)


def solve(U: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Least squares with columns of unit norm."""
    scale = np.linalg.norm(U, axis=0)
    scale[scale == 0.0] = 1.0
    return np.linalg.lstsq(U / scale, z, rcond=_RANK)[0] / scale


def _basis(U: np.ndarray) -> np.ndarray:
    """Orthonormal basis of columns, without directions that are rounding."""
    scale = np.linalg.norm(U, axis=0)
    U = U[:, scale > 0] / scale[scale > 0]
    if U.shape[1] == 0:
        return np.zeros((len(U), 0))
    left, values, _ = np.linalg.svd(U, full_matrices=False)
    return left[:, values > _RANK * values[0]]
