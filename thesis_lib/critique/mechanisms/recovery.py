"""Base inertial parameters and contact forces of a mechanism, without and with the effects that were found.

The critique believes the inertial parameters.  Here they are identified together with the parameters p of the effects,

    min |z(Θ, p)|²,    ∂z/∂Θ = Σ_k N_k' h Y_b,k whitened,    ∂z/∂p = -U,

over all windows; where the misfit is beyond noise, standard errors grow with it.  An effect that the model lacks hides
in Θ̂, and comes out of it when it is added.  A payload is no force but a change of π, which nothing can tell from other
changes of π: with it found, the parameters are the believed ones and m_p π_1, and nothing is fitted again.

Contact forces are those which the believed parameters, the known forces and Q leave to the contacts,

    c = (J M⁻¹ J')⁺ J M⁻¹ (Y π − f − Q)

| on paper | in code  | unit  | shape  | meaning                                         |
|----------|----------|-------|--------|-------------------------------------------------|
| Θ        | `value`  | kg... | (r,)   | base parameters, named as sums in `names`       |
| c        | returned | N     | (n, p) | normal and tangential forces of the window steps|

Source: thesis section 2.3.2, steps 1 and 3.
"""

from dataclasses import dataclass

import numpy as np

from thesis_lib.critique.mechanisms.effects import PAYLOAD
from thesis_lib.critique.mechanisms.fit import ForceFit, total_force
from thesis_lib.critique.mechanisms.windows import WeakForm
from thesis_lib.identify.base_parameters.combinations import BaseParameters, base_parameters
from thesis_lib.simulate.stepping.stepping import Record

IMPACT = 10.0  # times the median normal force of a pair: such steps are impacts and not counted


@dataclass(frozen=True)
class Identified:
    """Base parameters: `value` with standard errors `std` and what was `believed`, each (r,); `base` defines them."""

    base: BaseParameters
    columns: np.ndarray
    value: np.ndarray
    std: np.ndarray
    believed: np.ndarray

    @property
    def names(self) -> tuple[str, ...]:
        """(r,) each base parameter as a sum."""
        return self.base.base_names

    def of(self, parameters: np.ndarray) -> np.ndarray:
        """Base parameters (r,) of all inertial parameters (4 b,)."""
        return self.base.theta(parameters[self.columns])


def identify_parameters(weak: WeakForm, fitted: ForceFit) -> Identified:
    """Base inertial parameters with the effects of `fitted` (none: without), which was fitted to `weak`.

    Raises:
        UserError: no parameter has any effect in these windows.
    """
    model, m = weak.model, weak.motion
    Y = model.regressor(m.q, m.v, m.a)
    columns = np.array([model.names.index(name) for name in model.identified])
    # what contact forces take up is not identified by the rest
    free = np.einsum("krv,kvj->krj", weak.basis, Y[:, :, columns])
    base = base_parameters(free, model.identified)
    believed = base.theta(model.parameters[columns])
    if PAYLOAD.name in fitted.values:
        step = base.theta(model.payload[columns])
        m_p, std = float(fitted.values[PAYLOAD.name][0]), float(fitted.std[PAYLOAD.name][0])
        return Identified(base, columns, believed + m_p * step, np.abs(step) * std, believed)
    # together with the effects' parameters, whose columns U are -∂z/∂p, from what is believed and was found
    B = np.concatenate([weak.gathered(Y[:, :, columns[base.columns]]), -fitted.columns], axis=1)
    scale = np.linalg.norm(B, axis=0)
    B, r = B / scale, base.rank
    change = -np.linalg.lstsq(B, fitted.z, rcond=None)[0]
    rest = fitted.z + B @ change
    # where the model fails, its scatter and not the noise says how far the estimate may be off
    scatter = max(1.0, float(np.sqrt(rest @ rest / max(len(rest) - len(change), 1))))
    std = scatter * np.sqrt(np.diag(np.linalg.inv(B.T @ B))) / scale
    return Identified(base, columns, believed + (change / scale)[:r], std[:r], believed)


def force_error(
    weak: WeakForm, records: tuple[Record, ...], fitted: ForceFit | None
) -> tuple[float, np.ndarray, np.ndarray]:
    """Relative rms error of contact forces against those of the simulation.

    Args:
        weak: window equations of exact states of `records`.
        records: that were simulated, with their true contact forces.
        fitted: effects; None for the believed model alone.

    Returns:
        Error over all contact steps but impacts, 1; estimated and true forces (n, 2, p), NaN where not counted.
    """
    force = total_force(weak, fitted.effects, fitted.values) if fitted else np.zeros_like(weak.f)
    estimate = np.stack(weak.contact_forces(force), axis=1)
    true = np.array([(records[i].c_n[k], records[i].c_t[k]) for i, k in zip(weak.step_trial, weak.step)])
    normal = true[:, 0]
    touching = normal > 0.0
    typical = np.array(
        [np.median(column[on]) if on.any() else 0.0 for column, on in zip(normal.T, touching.T)]
    )
    counted = touching & (normal <= IMPACT * typical)
    counted = np.broadcast_to(counted[:, None], true.shape)
    difference = (estimate - true)[counted]
    error = float(np.sqrt(np.mean(difference**2) / np.mean(true[counted] ** 2)))
    return error, np.where(counted, estimate, np.nan), np.where(counted, true, np.nan)
