"""Parameters that a window of contact identifies, and reasons why others are not identified (thesis 2.3.3).

Contact forces are unknown at every step (eqs. 2.15 to 2.18).  Let B_k be the directions of contact forces at step k,
J_n' − sgn(v_rel) μ J_t' for a sliding contact, both Jacobians for a sticking contact.  Y_k Θ − B_k a_k = f_k then
contains information on Θ only outside their span,

    (I − B_k B_k⁺) Y_k Θ = (I − B_k B_k⁺) f_k,        Ỹ = (I − B B⁺) Y stacked.

The rank and null space of Ỹ show which parameters the window determines, its singular values how well.  Without known
force (f = 0), Θ and c have an undetermined common scale: Θ itself lies in the null space, and only ratios are found.

The thesis instead eliminates the force of one sliding contact (eq. 2.18).  Multiplied out, the result is linear in
(m/I, 1/m, 1/I, m/I²); `sliding_regressor` gives those columns.  With n_0 = v_y + J_n,θ ω − h g,
e = J_n,θ + s μ J_t,θ and s = −sgn(v_rel), for a contact that comes to rest normally (ε = 0):

    Δv_x + s μ n_0        = −Δv_x J_n,θ e (m/I)        + h (f_x − s μ f_y)/m + h J_n,θ (f_x e − s μ f_θ)/I
    Δv_y + h g + n_0      = −(Δv_y + h g) J_n,θ e (m/I)                      + h J_n,θ (f_y e − f_θ)/I
    Δω                    = −(Δω J_n,θ e + e n_0)(m/I)                       + h (f_θ − e f_y)/I  +  0 · m/I²

The last column vanishes: h f_θ J_n,θ e m/I² from the equation of motion and from the contact force cancel.  In eq. 2.18
as printed they do not, because it has F_y + h (m/I) F_θ; the normal velocity due to a torque is (m/I) J_n,θ F_θ.
"""

from dataclasses import dataclass

import numpy as np

from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.mechanisms.base_parameters import linear_combination
from thesis_lib.simulate.stepping.stepping import SimulatedMotion
from thesis_lib.thesis.identify.base_parameters.window import ContactWindow

FLOOR = 1e-9  # m/s², rad/s²: accelerations below this are rounding errors of a velocity difference over a step
# limit of a singular value, relative to the largest: far above rounding, and too small to be useful in practice
RANK_TOLERANCE = 1e-8


@dataclass(frozen=True)
class Identifiability:
    """Parameters that a window of data determines, with reasons for any deficiency."""

    singular_values: np.ndarray  # (n_Θ,) of Ỹ with columns scaled by the norms of Y's columns, 1
    rank: int  # number of independent combinations of Θ that the window determines
    null_space: np.ndarray  # (n_Θ, n_Θ − rank) changes of Θ without observable effect, largest entry 1
    # a sentence for each reason why parameters cannot be identified; empty if all can
    warnings: tuple[str, ...]


def projected(window: ContactWindow) -> tuple[np.ndarray, np.ndarray]:
    """Projected dynamics, Ỹ (m, nv, n_Θ) and f̃ (m, nv), outside the span of possible contact forces."""
    Y, f = window.Y.copy(), window.f.copy()
    for k in np.flatnonzero(window.touching.any(axis=1)):
        columns = []
        for i in np.flatnonzero(window.touching[k]):
            if window.v_t[k, i] == 0.0 and window.mu > 0.0:
                columns += [window.J_n[k, i], window.J_t[k, i]]
            else:
                columns.append(window.J_n[k, i] - np.sign(window.v_t[k, i]) * window.mu * window.J_t[k, i])
        B = np.array(columns).T
        # project twice: after a single projection, rounding errors of large impacts remain along B
        complement = np.eye(len(B)) - B @ np.linalg.pinv(B)
        Y[k], f[k] = complement @ (complement @ Y[k]), complement @ (complement @ f[k])
    return Y, f


def identifiability(window: ContactWindow) -> Identifiability:
    """Determine rank and null space of a window, with the reasons for any deficiency."""
    Y, _ = projected(window)
    n = Y.shape[2]
    size = np.linalg.norm(window.Y.reshape(-1, n), axis=0)
    silent = size <= FLOOR * np.sqrt(window.f.size)
    scale = np.where(silent, 1.0, size)
    A = np.where(silent, 0.0, Y.reshape(-1, n) / scale)
    # a column that contact forces explain to the last digits is set to zero, so that its rounding does not count
    explained = np.linalg.norm(A, axis=0) * scale <= FLOOR * np.sqrt(window.f.size)
    A[:, explained] = 0.0
    # if there are more rows than columns, all n right singular vectors are returned anyway
    values, V = np.linalg.svd(A, full_matrices=len(A) < 4 * n)[1:]
    values = np.concatenate([values, np.zeros(n - len(values))])
    rank = int((values > RANK_TOLERANCE * max(values[0], np.finfo(float).tiny)).sum())
    null_space = V[rank:].T / scale[:, None]
    if null_space.size:
        null_space = null_space / np.abs(null_space).max(axis=0)
        # sign: the largest entry is +1
        null_space *= np.sign(null_space[np.abs(null_space).argmax(axis=0), np.arange(null_space.shape[1])])
    warnings = tuple(_warnings(window, null_space)) if rank < n else ()
    return Identifiability(values, rank, null_space, warnings)


def _warnings(window: ContactWindow, null_space: np.ndarray) -> list[str]:
    touching = window.touching
    forced = np.abs(window.f).max() > FLOOR
    seen = ", ".join(linear_combination(column, window.names) for column in null_space.T)
    what = f"this change of the parameters has no observable effect: {seen}"
    if not touching.any() and not forced:
        where = f"no contact and no known force in the window of {len(window)} steps"
        return [f"{where}: {what}; choose steps around an impact"]
    reasons = []
    if not forced:
        reasons.append(
            "no known external force acts and no parameter is known: masses, inertias and forces are determined up to "
            f"a common factor only ({what}); give one parameter, for example the mass, or use a window with known force"
        )
        if null_space.shape[1] == 1:
            return reasons  # only the common factor is missing
    sliding = touching & (window.v_t != 0.0)
    if not touching.any():
        reasons.append(f"no contact in the window of {len(window)} steps: {what}; choose steps around an impact")
    elif not sliding.any() and window.mu > 0.0:
        reasons.append(
            f"every contact of the window sticks, so that friction is unknown at each step, and {what}; "
            "add steps that slide, for example with less friction, or that turn the body in flight or at an impact"
        )
    else:
        reasons.append(f"the motion in the window does not excite all parameters: {what}; choose a richer motion")
    return reasons


def require_identifiable(window: ContactWindow) -> None:
    """Check that a window determines every parameter.

    Raises:
        UserError: it does not; the message states what cannot be identified and why.
    """
    result = identifiability(window)
    if result.warnings:
        raise UserError(
            f"the window determines {result.rank} of {len(window.names)} parameters ({', '.join(window.names)}): "
            + "; ".join(result.warnings)
        )


def sliding_regressor(record: SimulatedMotion, mu: float, gravity: float) -> tuple[np.ndarray, np.ndarray]:
    """Columns (m, 3, 4) of (m/I, 1/m, 1/I, m/I²) and left-hand side (m, 3) of eq. 2.18 multiplied out.

    They hold in steps of a body with one contact pair that slides, with zero normal velocity after the step; `gravity`
    is in m/s², downwards.
    """
    v, v_next, h = record.v[:-1], record.v[1:], record.h
    J_n, J_t = record.J_n[:, 0], record.J_t[:, 0]
    s = -np.sign(np.einsum("kv,kv->k", J_t, v_next))
    j, e = J_n[:, 2], J_n[:, 2] + s * mu * J_t[:, 2]
    n_0 = v[:, 1] + j * v[:, 2] - h * gravity
    dx, dy, dw = (v_next - v).T
    f_x, f_y, f_w = record.f_ext.T
    zero = np.zeros(len(v))
    fall = dy + h * gravity
    columns = [
        np.stack([-dx * j * e, -fall * j * e, -dw * j * e - e * n_0], axis=1),
        h * np.stack([f_x - s * mu * f_y, zero, zero], axis=1),
        h * np.stack([j * (f_x * e - s * mu * f_w), j * (f_y * e - f_w), f_w - e * f_y], axis=1),
        # the terms h f_θ J_n,θ e m/I² of the equation of motion and of the contact force cancel
        np.zeros((len(v), 3)),
    ]
    return np.stack(columns, axis=2), np.stack([dx + s * mu * n_0, fall + n_0, dw], axis=1)
