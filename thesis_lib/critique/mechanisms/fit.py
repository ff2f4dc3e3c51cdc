"""Fit effects to the window equations of a mechanism: z (N,) residuals, U = -∂z/∂p (N, n_p).

    p̂ = argmin |z(0) - U p|²,    cov p̂ = (U'U)⁻¹,    log score = -|z|²/2 + const.

The direction of gravity is not linear in its parameter, nor are effects that need contact forces, which depend on the
other effects.  So the linear fit is repeated, each time at the last values.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from thesis_lib.critique.mechanisms.effects import MechanismEffect
from thesis_lib.critique.mechanisms.windows import WeakForm
from thesis_lib.critique.selection.scan import RANK

BASE = "believed"
ROUNDS = 3  # linear fits


@dataclass(frozen=True)
class ForceFit:
    """Effects fitted to the window equations of a set of trials.

    Attributes:
        values, std: by effect, (n_p,) parameters and standard errors.
        z: (N,) whitened residual with the effects.
        columns: (N, sum n_p) U.
    """

    effects: tuple[MechanismEffect, ...]
    values: dict[str, np.ndarray]
    std: dict[str, np.ndarray]
    z: np.ndarray
    columns: np.ndarray

    @property
    def base(self) -> str:
        """The only base: the believed equations of motion."""
        return BASE

    @property
    def score(self) -> float:
        """Log score in nats, up to a constant."""
        return float(-0.5 * (self.z @ self.z))


def total_force(weak: WeakForm, effects: Sequence[MechanismEffect], values: Mapping[str, np.ndarray]) -> np.ndarray:
    """Force (n, nv) in N or N m of `effects` at `values`, with the contact forces that they cause."""
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
    """U (N, n_p): change of -z per unit of each parameter, with `effects` at `values` already acting."""
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
    """Fit all parameters of `effects` to `weak`."""
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


def solve(U: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Least squares with columns of unit norm."""
    scale = np.linalg.norm(U, axis=0)
    scale[scale == 0.0] = 1.0
    return np.linalg.lstsq(U / scale, z, rcond=RANK)[0] / scale
