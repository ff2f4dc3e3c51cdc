"""Effects fitted to the window equations of a mechanism.

With all parameters of a set of effects refitted, U_c = -∂z/∂p_c,

    p̂ = argmin |z(0) - U p|²,    cov p̂ = (U'U)⁻¹,    log score = -|z|²/2 + const.

Effects are linear in their parameters but for gravity's direction and where they need contact forces, which depend on
the other effects: a few linear fits, each at the last one's values, cover that.

| on paper | in code   | unit  | shape    | meaning                              |
|----------|-----------|-------|----------|--------------------------------------|
| z        | `z`       | 1     | (N,)     | whitened residual generalised forces |
| U        | `columns` | 1/p   | (N, n_p) |                                      |
| p̂        | `values`  |       | (n_p,)   | by effect                            |
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

    @property
    def base(self) -> str:
        """Of all fits the equations of motion as believed."""
        return BASE

    @property
    def score(self) -> float:
        """Log score in nats, but for a constant."""
        return float(-0.5 * (self.z @ self.z))


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


def solve(U: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Least squares with columns of unit norm."""
    scale = np.linalg.norm(U, axis=0)
    scale[scale == 0.0] = 1.0
    return np.linalg.lstsq(U / scale, z, rcond=RANK)[0] / scale
