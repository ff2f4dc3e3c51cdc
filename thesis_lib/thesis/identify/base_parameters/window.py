"""Window of observations with all data that the identification programs need (thesis section 2.3.2, step 3).

In eq. 2.12 the states are data, so over a window of m steps, gaps, Jacobians and sliding velocities are constants, and
only the base parameters Θ and the contact forces c are unknown:

    Y_k Θ − J_n,k' c_n,k − J_t,k' c_t,k = f_k,        k = 1..m

At step k, a time stepper decides on contact from the gap expected at the end of the step without contact forces,

    φ̃_k = max(0, φ_k + h J_n,k v_free),   v_free = v_k + h a_free.

φ̃_k is exactly zero where the stepper lets a contact act, so complementarity holds for its data; φ_k itself is positive
just before an impact.  λ = |v_rel|, v_rel = J_t,k v_{k+1}, is the sliding speed after the step.  Below `v_tolerance` it
is set to zero, because a rounding error would turn sticking into sliding.

Sources: thesis eqs. 2.10-2.14; D. Stewart, J. C. Trinkle, Int. J. Numer. Meth. Eng. 39 (1996),
doi 10.1002/(SICI)1097-0207(19960815)39:15<2673::AID-NME972>3.0.CO;2-I.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.mechanisms.regressor import free_body_regressor
from thesis_lib.simulate.stepping.contact_modes import TOUCH
from thesis_lib.simulate.stepping.multibody import Mechanism, PlanarFreeBody
from thesis_lib.simulate.stepping.stepping import SimulatedMotion

V_TOLERANCE = 1e-9  # m/s: far above the rounding error of a time step (1e-15), far below any relevant sliding
GAP_TOLERANCE = 1e-9  # m: the same for gaps
# m/s², acceleration by which a contact may close within a step if the free acceleration is unknown: three times
# gravity, a gap of h² times this is 0.7 mm
ALLOWANCE = 30.0
BY_STEP = ("Y", "f", "gap", "v_t", "J_n", "J_t")  # fields of a window with a row per step


@dataclass(frozen=True)
class States:
    """States, known forces, and the contacts computed from them.

    A simulated `stepping.Record` has the same attributes, shapes and units.
    """

    h: float  # s
    q: np.ndarray  # q, v: (m+1, nv)
    v: np.ndarray
    f_ext: np.ndarray  # (m, nv) N, N m
    phi: np.ndarray  # (m, p) m
    J_n: np.ndarray  # J_n, J_t: (m, p, nv)
    J_t: np.ndarray

    @classmethod
    def of(cls, mechanism: Mechanism, h: float, q: np.ndarray, v: np.ndarray, f_ext: np.ndarray) -> "States":
        """Create from measured states q, v (m+1, nv) and forces f_ext (m, nv) in N, N m."""
        at = mechanism.contacts_of(q[:-1])
        return cls(h, q, v, f_ext, at.phi, at.J_n, at.J_t)


@dataclass(frozen=True)
class ContactWindow:
    """Data of m steps with p contact pairs."""

    Y: np.ndarray  # (m, nv, n_Θ) regressor of the unknown parameters, f per Θ
    f: np.ndarray  # (m, nv) known generalised force in N, N m, less the share of known parameters
    gap: np.ndarray  # (m, p) φ̃ above in m, or 0 within `gap_tolerance`
    J_n: np.ndarray  # J_n, J_t: (m, p, nv) contact Jacobians
    J_t: np.ndarray
    v_t: np.ndarray  # (m, p) sliding velocity v_rel after the step, m/s
    mu: float  # coefficient of friction
    names: tuple[str, ...]  # (n_Θ,) names of the unknown parameters, in the order of Y's columns
    theta_min: np.ndarray  # (n_Θ,) lower bounds of the unknown parameters

    def __post_init__(self) -> None:
        for name in BY_STEP:
            bad = np.flatnonzero(~np.isfinite(getattr(self, name)).reshape(len(self), -1).all(axis=1))
            if len(bad):
                raise UserError(
                    f"{name} is not finite at step {bad[0]} of the window ({len(bad)} steps in all): the data contain "
                    "NaN or infinite values; repair them or choose a window without them"
                )
        if not (np.isfinite(self.mu) and self.mu >= 0.0):
            raise UserError(f"the coefficient of friction must be finite and not negative, got {self.mu}")

    def __len__(self) -> int:
        return len(self.Y)

    def __getitem__(self, steps: slice) -> "ContactWindow":
        """Return the window of these steps."""
        return replace(self, **{name: getattr(self, name)[steps] for name in BY_STEP})

    @property
    def force_scale(self) -> float:
        """Largest known generalised force F over the window, the unit of contact forces; 1 if there is none."""
        return float(np.abs(self.f).max(initial=0.0)) or 1.0

    @property
    def gap_scale(self) -> float:
        """Largest gap L of the window in m; 1 if all are closed."""
        return float(self.gap.max(initial=0.0)) or 1.0

    @property
    def speed_scale(self) -> float:
        """Largest sliding speed V of the window in m/s; 1 if nothing slides."""
        return float(np.abs(self.v_t).max(initial=0.0)) or 1.0

    @property
    def touching(self) -> np.ndarray:
        """Mask (m, p) of the contacts that may act, whose gap is zero."""
        return self.gap == 0.0

    def residual(self, theta: np.ndarray, c_n: np.ndarray, c_t: np.ndarray) -> np.ndarray:
        """Residual of the dynamics, Y Θ − J_n' c_n − J_t' c_t − f, (m, nv) in N and N m."""
        contact = np.einsum("kpv,kp->kv", self.J_n, c_n) + np.einsum("kpv,kp->kv", self.J_t, c_t)
        return self.Y @ theta - contact - self.f

    def fix(self, known: dict[str, float]) -> "ContactWindow":
        """Return the window with some parameters known: their columns times values move to the right-hand side.

        Raises:
            UserError: a name is not a parameter of the window, or no parameter would remain unknown.
        """
        unknown_names = [name for name in known if name not in self.names]
        if unknown_names:
            raise UserError(f"this window has no parameter {unknown_names}; its parameters are {', '.join(self.names)}")
        free = [j for j, name in enumerate(self.names) if name not in known]
        if not free:
            raise UserError("every parameter is given, so none remains to be identified; leave at least one out")
        f = self.f - sum(self.Y[:, :, self.names.index(name)] * value for name, value in known.items())
        names = tuple(self.names[j] for j in free)
        return replace(self, Y=self.Y[:, :, free], f=f, names=names, theta_min=self.theta_min[free])


def expected_gap(
    phi: np.ndarray, J_n: np.ndarray, v: np.ndarray, a_free: np.ndarray, h: float, tolerance: float
) -> np.ndarray:
    """Expected gaps φ̃ (m, p) in m from gaps phi (m, p), Jacobians J_n (m, p, nv), v (m, nv) and a_free (nv,).

    Pairs that touch at the start of the step, phi <= `TOUCH`, count as closed, because another pair's impulse may keep
    them closed; so do gaps up to `tolerance` in m.  With noisy data, use a few standard deviations of the gap.
    """
    gap = phi + h * np.einsum("kpv,kv->kp", J_n, v + h * a_free)
    return np.where((gap <= tolerance) | (phi <= TOUCH), 0.0, gap)


def window_of(
    record: SimulatedMotion | States,
    Y: np.ndarray,
    a_free: np.ndarray,
    mu: float,
    names: Sequence[str],
    *,
    theta_min: np.ndarray,
    gap_tolerance: float,
    v_tolerance: float = V_TOLERANCE,
) -> ContactWindow:
    """Make a window of a whole record; its slices are windows of fewer steps.

    `Y` (N, nv, n_Θ) includes gravity, Y Θ = f_ext + J' c; `a_free` (nv,) is the acceleration without contact forces,
    for the expected gap; `names` and lower bounds `theta_min` are (n_Θ,); the tolerances are in m and m/s.

    Raises:
        UserError: the data are not finite.
    """
    v_t = np.einsum("kpv,kv->kp", record.J_t, record.v[1:])
    return ContactWindow(
        Y=Y,
        f=np.asarray(record.f_ext, dtype=float),
        gap=expected_gap(record.phi, record.J_n, record.v[:-1], a_free, record.h, gap_tolerance),
        J_n=record.J_n,
        J_t=record.J_t,
        v_t=np.where(np.abs(v_t) <= v_tolerance, 0.0, v_t),
        mu=float(mu),
        names=tuple(names),
        theta_min=theta_min,
    )


def free_body_window(
    record: SimulatedMotion | States,
    mu: float,
    body: PlanarFreeBody,
    *,
    gap_tolerance: float = GAP_TOLERANCE,
    v_tolerance: float = V_TOLERANCE,
) -> ContactWindow:
    """Make a window of one free body of unknown (m, I), with origin at its centre of mass; `body` gives the gravity.

    Without an external force or a known parameter (`ContactWindow.fix`), the common scale of forces and parameters is
    undetermined.  External forces do not enter the expected gap; within a step they change it by h² f/m, so widen
    `gap_tolerance` where they are large.

    Raises:
        UserError: as `window_of`.
    """
    gravity = body.gravity(record.q[0])[:2] / body.mass
    a = np.diff(record.v, axis=0) / record.h
    Y = free_body_regressor(record.q[:-1], record.v[:-1], a, gravity)[:, :, [0, 3]]
    limits = {"theta_min": np.zeros(2), "gap_tolerance": gap_tolerance, "v_tolerance": v_tolerance}
    return window_of(record, Y, np.array([*gravity, 0.0]), mu, ("m", "I"), **limits)
