"""Estimates of base inertial parameters and contact forces of a mechanism, without and with the effects found.

The critique keeps the believed inertial parameters.  Here they are identified together with the effects' parameters p,

    min |z(Θ, p)|²,    ∂z/∂Θ = Σ_k N_k' h Y_b,k whitened,    ∂z/∂p = -U,

over all windows; Θ (r,) are base parameters.  Standard errors grow with a misfit beyond noise.  A missing effect biases
Θ̂; adding this effect removes the bias.  A payload changes π itself and cannot be separated from other changes of π: if
a payload is found, the parameters are the believed parameters plus m_p π_1, without a further fit.

Contact forces follow from the believed parameters, the known forces and Q,

    c = (J M⁻¹ J')⁺ J M⁻¹ (Y π − f − Q)

Source: thesis section 2.3.2, steps 1 and 3.
"""

from dataclasses import dataclass

import numpy as np

from thesis_lib.critique.mechanisms.effects import PAYLOAD
from thesis_lib.critique.mechanisms.windows import WeakForm
from thesis_lib.critique.mechanisms.world import ForceFit, total_force
from thesis_lib.simulate.mechanisms.base_parameters import BaseParameters, base_parameters
from thesis_lib.simulate.stepping.stepping import SimulatedMotion

IMPACT = 10.0  # times a pair's median normal force: steps above it are impacts and are skipped


@dataclass(frozen=True)
class Identified:
    """Base parameters (r,) as defined by `base`: their `value`, standard error `std`, and `believed` value."""

    base: BaseParameters
    columns: np.ndarray
    value: np.ndarray
    std: np.ndarray
    believed: np.ndarray

    def of(self, parameters: np.ndarray) -> np.ndarray:
        """Return the base parameters (r,) that correspond to the inertial parameters (4 b,)."""
        return self.base.theta(parameters[self.columns])


def identify_parameters(weak: WeakForm, fitted: ForceFit) -> Identified:
    """Identify the base inertial parameters together with the effects of `fitted`, which was fitted to `weak`.

    Raises:
        UserError: no parameter affects these windows.
    """
    model, m = weak.model, weak.motion
    Y = model.regressor(m.q, m.v, m.a)
    columns = np.array([model.names.index(name) for name in model.identified])
    # directions that contact forces absorb are not identified
    free = np.einsum("krv,kvj->krj", weak.basis, Y[:, :, columns])
    base = base_parameters(free, model.identified)
    believed = base.theta(model.parameters[columns])
    if PAYLOAD.name in fitted.values:
        step = base.theta(model.payload[columns])
        m_p, std = float(fitted.values[PAYLOAD.name][0]), float(fitted.std[PAYLOAD.name][0])
        return Identified(base, columns, believed + m_p * step, np.abs(step) * std, believed)
    # fitted jointly with the effects' parameters, whose columns are -U, from the believed and fitted values
    B = np.concatenate([weak.gathered(Y[:, :, columns[base.columns]]), -fitted.columns], axis=1)
    r, (own, units) = base.rank, fitted.prior
    B = np.concatenate([B, np.concatenate([np.zeros((len(own), r)), -units], axis=1)])
    z = np.concatenate([fitted.z, own])
    scale = np.linalg.norm(B, axis=0)
    B = B / scale
    change = -np.linalg.lstsq(B, z, rcond=None)[0]
    rest = z + B @ change
    # the errors of a wrong model follow from its scatter, not from the noise
    scatter = max(1.0, float(np.sqrt(rest @ rest / max(len(rest) - len(change), 1))))
    std = scatter * np.sqrt(np.diag(np.linalg.inv(B.T @ B))) / scale
    return Identified(base, columns, believed + (change / scale)[:r], std[:r], believed)


def force_error(weak: WeakForm, record: SimulatedMotion, fitted: ForceFit) -> tuple[float, np.ndarray, np.ndarray]:
    """Return the relative rms error of contact forces against the simulation, over all contact steps except impacts.

    Also returns the estimated and true forces (n, 2, p) in N, NaN where skipped.  `weak` has exact states of `record`.
    """
    estimate = np.stack(weak.contact_forces(total_force(weak, fitted.forces, fitted.values)), axis=1)
    true = np.stack([record.c_n[weak.step], record.c_t[weak.step]], axis=1)
    normal = true[:, 0]
    touching = normal > 0.0
    typical = np.array([np.median(column[on]) if on.any() else 0.0 for column, on in zip(normal.T, touching.T)])
    counted = np.broadcast_to((touching & (normal <= IMPACT * typical))[:, None], true.shape)
    error = float(np.sqrt(np.mean((estimate - true)[counted] ** 2) / np.mean(true[counted] ** 2)))
    return error, np.where(counted, estimate, np.nan), np.where(counted, true, np.nan)
