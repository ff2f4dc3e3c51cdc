"""Equations of motion summed over windows of steps, free of contact forces and whitened by the noise of the states.

In step k the believed model leaves h (Y_k π − f_k − Q_k) = h J_k' c_k.  Let N_k span the directions that the active
contacts leave free, J_k N_k = 0.  Contact forces then drop out, and a window of steps with the same contacts gives

    r_w = Σ_k N_k' h (Y_k π − f_k − Q_k),        h Y_k π ∋ M_k (v_{k+1} − v_k).

Noisy velocities enter only at the ends of the window, not divided by h at each step.  (`steps` defines how q, v and v̇
of a step follow from samples, and how a window weights its steps; N_k includes the weights.)  N_k = [1; −J_D⁻¹ J_F]
with free coordinates F and dependent coordinates D; D is fixed within a window, so N varies smoothly.  A contact counts
as active if noise could hide it: projecting out an inactive contact only loses information.

A driven joint at rest may stick: dry friction is then a constraint force, of any size up to its limit.  In measured
motion such a joint counts as a contact of its own, whose row of J selects the coordinate of the joint.

The noise of the samples is independent with known σ for each channel; an error σ_t of the instant adds v σ_t to it.
With G the derivative of r with respect to each sample, by central differences of the equations of a step,

    S = G diag(σ²) G',      S = L L',      z = L⁻¹ r      one S per trial,

z is unit noise to first order if the model is right.  Windows without free directions (the wheel on two spokes), near a
singular pose, or shorter than `min_window` are left out; their steps are counted.

| on paper | in code   | unit   | shape      | meaning                                          |
|----------|-----------|--------|------------|--------------------------------------------------|
| N_k'     | `basis`   | 1, m   | (n, nv, nv)| rows beyond the free directions are zero         |
| Q_k      | `force`   | N, N m | (n, nv)    | force of effects                                 |
| z        | returned  | 1      | (N,)       | whitened residuals, trial by trial               |

Sources: D. A. Messenger, D. M. Bortz, Multiscale Model. Simul. 19 (2021), doi 10.1137/20M1343166 (weak form); F. E.
Udwadia, R. E. Kalaba, Proc. R. Soc. A 439 (1992), doi 10.1098/rspa.1992.0158 (projection).
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations, pairwise, product

import numpy as np
from scipy.linalg import solve_triangular
from scipy.ndimage import binary_opening

from thesis_lib.critique.mechanisms.effects import SMOOTH_JOINT, MotionSteps
from thesis_lib.critique.mechanisms.model import BelievedModel
from thesis_lib.critique.mechanisms.settings import EquationWindowSettings
from thesis_lib.critique.mechanisms.steps import StepRule, Trial, may_touch, rule_of
from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.stepping.multibody import ContactGeometry

NUDGE = 1e-5  # in m and rad, and their rates: step of central differences of smooth functions of order one
SINGULAR = 0.02  # least |det J_D| in a window: below it N amplifies noise


@dataclass(frozen=True)
class _Window:
    trial: int
    start: int
    stop: int
    active: tuple[int, ...]
    dependent: tuple[int, ...]


class WeakForm:
    """Window equations of trials under a believed model.

    Attributes:
        motion: (n, ...) all steps in windows, with contact forces of the believed model alone.
        f: (n, nv) known forces in N, N m; step: (n,) number of each step in its trial.
        starts, ends: (windows,) first step of each window, and the step after its last.
        active_pairs: active contact pairs of each window, and p + i if joint i is at rest.
        trial, window, coordinate: (N,) trial, window and free coordinate of each row of z.
        left_out: number of steps in no window, by reason; steps, trials: total numbers.
        columns: by sensor error, change of z per unit of each parameter; filled by `world`.

    Raises:
        UserError: no usable window, or a state that is not finite.
    """

    def __init__(self, trials: Sequence[Trial], model: BelievedModel, settings: EquationWindowSettings) -> None:
        self.model, self.h = model, trials[0].h
        self.left_out: Counter[str] = Counter()
        self.columns: dict[str, np.ndarray] = {}
        self.steps, self.trials = sum(len(t.f_ext) for t in trials), len(trials)
        for i, t in enumerate(trials):
            if not all(np.isfinite(x).all() for x in (t.q, t.v, t.f_ext, t.sigma)):
                raise UserError(f"Trial {i} contains states, forces or noise that are not finite: repair or remove it.")
        self.rule: StepRule = rule_of(trials[0].velocities, self.h)
        windows = [w for i, t in enumerate(trials) for w in self._windows(i, t, settings)]
        if not windows:
            raise UserError(
                "No window has a direction that its contacts leave free, so the model cannot be criticised; "
                f"steps left out: {dict(self.left_out)}."
            )
        self.step = np.concatenate([np.arange(w.start, w.stop) for w in windows])
        self.active_pairs = tuple(w.active for w in windows)
        self._weight = np.concatenate([self.rule.kernel(w.stop - w.start) for w in windows])
        self._group(windows)
        q, v, a, f, df = (np.concatenate(parts) for parts in zip(*(self._states(trials[w.trial], w) for w in windows)))
        self.f, self.basis, self._to_contact = f, self._basis(q), self._constraints(q)
        self.motion = MotionSteps(q, v, a, np.zeros((len(q), len(model.mechanism.pairs))), f, df)
        self._rest = model.inverse_dynamics(q, v, a) - f
        self.motion = self.with_normals(np.zeros_like(q))
        self._contact = np.concatenate(self.contact_forces(np.zeros_like(q)), axis=1)
        self._factors = self._whitening(trials)

    def _states(self, t: Trial, w: "_Window") -> tuple[np.ndarray, ...]:
        """Return q, v, a, f, df (n, nv) of the steps of a window."""
        k, rule = np.arange(w.start, w.stop), self.rule
        states = (rule.of(stencil, t.q, t.v, k) for stencil in (rule.q, rule.v, rule.a))
        last = len(t.f_ext) - 1
        none = np.zeros((len(k), t.q.shape[1]))
        known = (sum((w * t.f_ext[np.clip(k + j, 0, last)] for j, w in weights), none) for weights in (rule.f, rule.df))
        return (*states, *known)

    def _active(self, t: Trial, settings: EquationWindowSettings) -> np.ndarray:
        """Return (m, p) or (m, p + joints): pairs that may touch, and joints at rest, within the samples of a step."""
        if t.velocities == "time_stepping":
            q, v = t.q[:-1], t.v[:-1]
            contacts = self.model.mechanism.contacts_of(q)
            closing = np.minimum(0.0, self.h * np.einsum("kpv,kv->kp", contacts.J_n, v))
            active = contacts.phi + closing <= self._reach(contacts, t, settings)
            # the step before also counts: a driven arm closes a gap faster than gravity
            active[:-1] |= active[1:]
            return active
        contacts = self.model.mechanism.contacts_of(t.q)
        active = may_touch(contacts.phi, self._reach(contacts, t, settings))
        if t.velocities == "derived":  # a second difference also contains the interval before
            active[1:] |= active[:-1].copy()
        k = np.arange(self.rule.before, len(t.q) - self.rule.after)
        still = np.zeros((len(active), self.model.joints), dtype=bool)
        v, weights = self.rule.of(self.rule.v, t.q, t.v, k), np.array([w for _, _, w in self.rule.v])
        noise = np.sqrt(weights @ weights) * t.sigma["qv".index(self.rule.v[0][0])]
        for i in range(self.model.joints):
            slow = np.abs(v[:, i]) <= settings.gap_sigmas * noise[i] + SMOOTH_JOINT
            still[k, i] = binary_opening(slow, np.ones(settings.min_window))  # drop shorter intervals
        return np.concatenate([active, still], axis=1)

    def _reach(self, contacts: ContactGeometry, t: Trial, settings: EquationWindowSettings) -> np.ndarray:
        """Return the gap (m, p) in m below which a contact is active: noise, and one step of free fall."""
        spread = np.sqrt(np.einsum("kpv,v->kp", contacts.J_n**2, t.sigma[0] ** 2))
        return settings.gap_sigmas * spread + np.linalg.norm(self.model.gravity) * self.h**2

    def _windows(self, i: int, t: Trial, settings: EquationWindowSettings) -> list[_Window]:
        active = self._active(t, settings)
        contacts = self.model.mechanism.contacts_of(t.q[:-1])
        first, last = self.rule.before, len(t.q) - self.rule.after
        self.left_out["too close to an end"] += first + len(active) - last
        cuts = (np.flatnonzero((active[first + 1 : last] != active[first : last - 1]).any(axis=1)) + first + 1).tolist()
        windows = []
        for a, b in zip([first, *cuts], [*cuts, last]):
            if b - a < settings.min_window:
                self.left_out["too short"] += b - a
                continue
            pairs = tuple(np.flatnonzero(active[a]).tolist())
            J = _jacobians(contacts, pairs)
            for start, stop in _pieces(a, b, settings, self.rule):
                dependent, why = _dependent(J[start:stop])
                if why:
                    self.left_out[why] += stop - start
                else:
                    windows.append(_Window(i, start, stop, pairs, dependent))
        self.left_out = +self.left_out
        return windows

    def _group(self, windows: list[_Window]) -> None:
        """Group steps with the same contacts and dependent coordinates, for batched linear algebra."""
        self.ends = np.cumsum([w.stop - w.start for w in windows])
        self.starts = np.concatenate([[0], self.ends[:-1]])
        groups: dict[tuple, list[np.ndarray]] = {}
        rows = []
        for number, w in enumerate(windows):
            groups.setdefault((w.active, w.dependent), []).append(self._steps_of(number))
            free = (c for c in range(len(self.model.coordinates)) if c not in w.dependent)
            rows += [(w.trial, number, c, j) for j, c in enumerate(free)]
        self._groups = {key: np.concatenate(parts) for key, parts in groups.items()}
        self.trial, self.window, self.coordinate, self._slot = np.array(rows).T

    def _basis(self, q: np.ndarray) -> np.ndarray:
        nv = q.shape[1]
        basis = np.zeros((len(q), nv, nv))
        for (active, dependent), at in self._groups.items():
            free = [c for c in range(nv) if c not in dependent]
            N = np.zeros((len(at), len(free), nv))
            N[:, np.arange(len(free)), free] = 1.0
            if dependent:
                J = _jacobians(self.model.mechanism.contacts_of(q[at]), active)
                solved = np.linalg.solve(J[:, :, list(dependent)], J[:, :, free])
                N[:, :, list(dependent)] = -np.swapaxes(solved, 1, 2)
            basis[at, : len(free)] = N
        return basis * self._weight[:, None, None]

    def _constraints(self, q: np.ndarray) -> np.ndarray:
        """Return (J M⁻¹ J')⁺ J M⁻¹ (n, 2 p or more, nv), which maps the residual force to contact forces."""
        contacts = self.model.mechanism.contacts_of(q)
        n, pairs = contacts.phi.shape
        is_active = np.zeros((n, pairs + self.model.joints), dtype=bool)
        for (active, _), at in self._groups.items():
            is_active[np.ix_(at, list(active))] = True
        touching, still = is_active[:, :pairs, None], is_active[:, pairs:, None]
        parts = [contacts.J_n * touching, contacts.J_t * touching]
        if still.any():
            parts.append(np.eye(self.model.joints, q.shape[1]) * still)
        J = np.concatenate(parts, axis=1)
        JM = J @ np.linalg.inv(self.model.mass_matrix(q))
        return np.linalg.pinv(JM @ np.swapaxes(J, 1, 2), hermitian=True) @ JM

    def contact_forces(self, force: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return c_n, c_t (n, p) in N that the motion requires if `force` (n, nv) acts besides the believed model."""
        p = len(self.model.mechanism.pairs)
        c = np.einsum("kcv,kv->kc", self._to_contact[:, : 2 * p], self._rest - force)
        return c[:, :p], c[:, p:]

    def with_normals(self, force: np.ndarray) -> MotionSteps:
        """Return the motion with the normal forces that it requires if `force` (n, nv) also acts."""
        c_n = self.contact_forces(force)[0]
        if self.rule.power:  # the noise of a single step exceeds the force: use the mean over the window
            total = np.add.reduceat(self._weight[:, None] * c_n, self.starts, axis=0)
            mean = total / np.add.reduceat(self._weight, self.starts)[:, None]
            c_n = np.repeat(mean, self.ends - self.starts, axis=0)
        return replace(self.motion, c_n=c_n)

    def gathered(self, force: np.ndarray) -> np.ndarray:
        """Return Σ_k N_k' h force_k over each window, whitened: (n, nv) to (N,), or (n, nv, j) to (N, j)."""
        step = np.einsum("krv,kv...->kr...", self.basis, self.h * force)
        rows = np.add.reduceat(step, self.starts, axis=0)[self.window, self._slot]
        whitened = np.empty_like(rows)
        for rows_of_trial, L in self._factors:
            whitened[rows_of_trial] = solve_triangular(L, rows[rows_of_trial], lower=True)
        return whitened

    def residual(self, force: np.ndarray) -> np.ndarray:
        """Return z (N,) if `force` (n, nv) of the effects acts besides the believed model."""
        return self.gathered(self._rest - force)

    def _steps_of(self, window: int) -> np.ndarray:
        return np.arange(int(self.starts[window]), int(self.ends[window]))

    def _whitening(self, trials: Sequence[Trial]) -> list[tuple[np.ndarray, np.ndarray]]:
        """Return the rows of z and the factor L of each trial."""
        n, nv = self.motion.q.shape
        measured = np.stack([self.motion.q, self.motion.v, self.motion.a])

        def balance(q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
            rest = self.model.inverse_dynamics(q, v, a) - self.f
            basis = self.basis if (q == self.motion.q).all() else self._basis(q)  # depends on poses alone
            return np.einsum("krv,kv->kr", basis, self.h * rest)

        slopes = np.zeros((3, n, nv, nv))  # of q, v, v̇; row, channel
        for which, channel in product(range(3), range(nv)):
            shift = np.zeros_like(measured)
            shift[which, :, channel] = NUDGE
            slopes[which, :, :, channel] = (balance(*measured + shift) - balance(*measured - shift)) / (2.0 * NUDGE)
        stencils = list(enumerate((self.rule.q, self.rule.v, self.rule.a)))
        factors = []
        for i, t in enumerate(trials):
            rows = np.flatnonzero(self.trial == i)
            if not len(rows):
                continue
            G = np.zeros((2, len(rows), len(t.q), nv))  # of q, v
            for row, r in enumerate(rows):
                at, slot = self._steps_of(self.window[r]), self._slot[r]
                k = self.step[at]
                for which, stencil in stencils:
                    for name, j, w in stencil:
                        G["qv".index(name), row, k + j] += w * slopes[which, at, slot]
            for channel, W in t.mixed.items():
                G[:, :, :, channel] = G[:, :, :, channel] @ W
            sigma = np.repeat(t.sigma[:, None], len(t.q), axis=1)  # (2, m+1, nv)
            if t.jitter:
                sigma[0] = np.hypot(sigma[0], t.jitter * np.gradient(t.q, self.h, axis=0))
            S = np.einsum("crkv,ckv,cskv->rs", G, sigma**2, G, optimize=True)
            if self.rule.is_blind_to_instants:
                T = self._instants(t, rows)
                S += T @ T.T
            # rows may have no noise at all: a small diagonal keeps S positive definite
            S += 1e-14 * np.trace(S) / len(S) * np.eye(len(S))
            factors.append((rows, np.linalg.cholesky(S)))
        return factors

    def _instants(self, t: Trial, rows: np.ndarray) -> np.ndarray:
        """Return (rows, m+1): change of r by one sigma of the instant at which the contact impulse of each step acts.

        An impact is shorter than a step, during which J changes by ΔJ: the error is N' ΔJ' h c / √12.
        """
        T = np.zeros((len(rows), len(t.q)))
        contacts = self.model.mechanism.contacts_of(t.q)
        J = np.concatenate([contacts.J_n, contacts.J_t], axis=1)
        for row, r in enumerate(rows):
            at = self._steps_of(self.window[r])
            k = self.step[at]
            turned = np.einsum("kcv,kc->kv", J[k + 1] - J[k], self._contact[at])
            T[row, k] += self.h / np.sqrt(12.0) * np.einsum("kv,kv->k", self.basis[at, self._slot[r]], turned)
        return T


def _pieces(a: int, b: int, settings: EquationWindowSettings, rule: StepRule) -> list[tuple[int, int]]:
    """Return (start, stop) of the windows in steps a to b-1: side by side, or half overlapping."""
    if not rule.power:
        parts = max(1, round((b - a) / settings.window))
        return list(pairwise(np.linspace(a, b, parts + 1).round().astype(int).tolist()))
    length = min(b - a, settings.tapered_window)
    count = int(np.ceil(2.0 * (b - a - length) / length)) + 1
    starts = np.linspace(a, b - length, count).round().astype(int)
    return [(start, start + length) for start in starts.tolist()]


def _jacobians(contacts: ContactGeometry, pairs: tuple[int, ...]) -> np.ndarray:
    """Return the normal and tangential rows (n, 2 p, nv) of `pairs`; numbers from p on denote joints at rest."""
    n, p, nv = contacts.J_n.shape
    touching, joints = [j for j in pairs if j < p], [j - p for j in pairs if j >= p]
    still = np.broadcast_to(np.eye(nv)[joints], (n, len(joints), nv))
    return np.concatenate([contacts.J_n[:, touching], contacts.J_t[:, touching], still], axis=1)


def _dependent(J: np.ndarray) -> tuple[tuple[int, ...], str]:
    """Return the coordinates that constraints J (k, c, nv) of a window determine, and why it is unusable, or ''."""
    c, nv = J.shape[1:]
    if c == 0:
        return (), ""
    if c >= nv:
        return (), "no free direction"
    best, chosen = 0.0, ()
    for columns in combinations(range(nv), c):
        det = np.abs(np.linalg.det(J[:, :, list(columns)]))
        if det.min() > best:
            best, chosen = float(det.min()), columns
    return (chosen, "") if best > SINGULAR else ((), "singular pose")
