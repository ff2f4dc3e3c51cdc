"""Equations of motion over windows, free of contact forces and whitened by the noise of the states.

In step k the believed model leaves h (Y_k π − f_k − Q_k) = h J_k' c_k.  Let N_k span the directions that the active
contacts leave free, J_k N_k = 0.  Contact forces then drop out, and a window of steps with the same contacts gives

    r_w = Σ_k N_k' h (Y_k π − f_k − Q_k),        h Y_k π ∋ M_k (v_{k+1} − v_k).

Noisy velocities enter only at the ends of the window, not divided by h at each step.  N_k = [1; −J_D⁻¹ J_F] with free
coordinates F and dependent ones D; D is fixed within a window, so that N varies smoothly.  A contact counts as active
if noise could hide it: projecting out an inactive one only costs information.

The noise of the states is independent with known σ for each channel.  With G = ∂r/∂(q, v) by central differences,

    S = G diag(σ²) G',      S = L L',      z = L⁻¹ r      one S per trial,

z is unit noise to first order if the model is right.  Windows without free directions (the wheel on two spokes), near a
singular pose, or shorter than `min_window` are left out and counted.

| on paper | in code   | unit   | shape      | meaning                                          |
|----------|-----------|--------|------------|--------------------------------------------------|
| N_k'     | `basis`   | 1, m   | (n, nv, nv)| rows beyond the free ones are zero               |
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

from thesis_lib.critique.mechanisms.effects import Motion
from thesis_lib.critique.mechanisms.model import BelievedModel
from thesis_lib.critique.mechanisms.settings import WindowSettings
from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.chapter2.noise_snr import add_noise
from thesis_lib.simulate.stepping.multibody import ContactGeometry
from thesis_lib.simulate.stepping.stepping import Record

NUDGE = 1e-5  # m, rad and per s: central differences of smooth functions of order one
SINGULAR = 0.02  # least |det J_D| in a window: below it N amplifies noise


@dataclass(frozen=True)
class Trial:
    """Measured motion: q, v (m+1, nv), f_ext (m, nv), and the noise `sigma` (2, nv) of q and v."""

    h: float
    q: np.ndarray
    v: np.ndarray
    f_ext: np.ndarray
    sigma: np.ndarray


def measured(
    records: Sequence[Record], snr_db: float, rng: np.random.Generator, settings: WindowSettings
) -> tuple[Trial, ...]:
    """Trials as measured at this signal-to-noise ratio; infinite: exact states."""
    trials = []
    for record in records:
        noisy = add_noise(record, snr_db, rng)
        sigma = noisy.sigma
        if not np.isfinite(snr_db):
            spread = np.stack([record.q.std(axis=0), record.v.std(axis=0)])
            sigma = spread * 10.0 ** (-settings.exact_db / 20.0)
        trials.append(Trial(record.h, noisy.q, noisy.v, record.f_ext, sigma))
    return tuple(trials)


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
        motion: (n, ...) all steps in a window, with contact forces of the believed model alone.
        f: (n, nv) known forces in N, N m; step, step_trial: (n,) numbers of step and trial.
        starts: (windows,) first step of each window; active_pairs: its contact pairs.
        trial, window, coordinate: (N,) trial, window and free coordinate of each row of z.
        left_out: steps in no window, by reason; steps, trials: numbers of all.

    Raises:
        UserError: no usable window, or a state that is not finite.
    """

    def __init__(self, trials: Sequence[Trial], model: BelievedModel, settings: WindowSettings) -> None:
        self.model, self.h = model, trials[0].h
        self.left_out: Counter[str] = Counter()
        self.steps, self.trials = sum(len(t.f_ext) for t in trials), len(trials)
        for i, t in enumerate(trials):
            if not all(np.isfinite(x).all() for x in (t.q, t.v, t.f_ext, t.sigma)):
                raise UserError(f"Trial {i} holds states, forces or noise that are not finite; repair or drop it.")
        windows = [w for i, t in enumerate(trials) for w in self._windows(i, t, settings)]
        if not windows:
            raise UserError(
                "No window of any trial has a direction that its contacts leave free, so nothing can be criticised; "
                f"steps left out: {dict(self.left_out)}."
            )
        self.step = np.concatenate([np.arange(w.start, w.stop) for w in windows])
        self.step_trial = np.concatenate([np.full(w.stop - w.start, w.trial) for w in windows])
        self.active_pairs = tuple(w.active for w in windows)
        self._group(windows)
        q, v, v_next, f = (
            np.concatenate([getattr(trials[w.trial], name)[w.start + later : w.stop + later] for w in windows])
            for name, later in (("q", 0), ("v", 0), ("v", 1), ("f_ext", 0))
        )
        self.f, self.basis, self._to_contact = f, self._basis(q), self._constraints(q)
        self.motion = Motion(q, v, (v_next - v) / self.h, np.zeros((len(q), len(model.mechanism.pairs))))
        self._rest = model.inverse_dynamics(q, v, self.motion.a) - f
        self.motion = self.with_normals(np.zeros_like(q))
        self._factors = self._whitening(trials, v_next)

    def _windows(self, i: int, t: Trial, settings: WindowSettings) -> list[_Window]:
        q, v = t.q[:-1], t.v[:-1]
        contacts = self.model.mechanism.contacts_of(q)
        spread = np.sqrt(np.einsum("kpv,v->kp", contacts.J_n**2, t.sigma[0] ** 2))
        closing = np.minimum(0.0, self.h * np.einsum("kpv,kv->kp", contacts.J_n, v))
        # margin: noise, and one step of free fall
        reach = settings.gap_sigmas * spread + np.linalg.norm(self.model.gravity) * self.h**2
        active = contacts.phi + closing <= reach
        # the step before counts too: a driven arm closes a gap faster than gravity
        active[:-1] |= active[1:]
        cuts = (np.flatnonzero((active[1:] != active[:-1]).any(axis=1)) + 1).tolist()
        windows = []
        for a, b in zip([0, *cuts], [*cuts, len(q)]):
            if b - a < settings.min_window:
                self.left_out["too short"] += b - a
                continue
            parts = max(1, round((b - a) / settings.window))
            ends = np.linspace(a, b, parts + 1).round().astype(int).tolist()
            pairs = tuple(np.flatnonzero(active[a]).tolist())
            J = _jacobians(contacts, pairs)
            for start, stop in pairwise(ends):
                dependent, why = _dependent(J[start:stop])
                if why:
                    self.left_out[why] += stop - start
                else:
                    windows.append(_Window(i, start, stop, pairs, dependent))
        return windows

    def _group(self, windows: list[_Window]) -> None:
        """Group steps with the same contacts and dependent coordinates, to batch their algebra."""
        groups: dict[tuple, list[np.ndarray]] = {}
        at, rows, starts = 0, [], []
        for number, w in enumerate(windows):
            length = w.stop - w.start
            groups.setdefault((w.active, w.dependent), []).append(np.arange(at, at + length))
            starts.append(at)
            free = (c for c in range(len(self.model.coordinates)) if c not in w.dependent)
            rows += [(w.trial, number, c, j) for j, c in enumerate(free)]
            at += length
        self._groups = {key: np.concatenate(parts) for key, parts in groups.items()}
        self.starts = np.array(starts)
        self.trial, self.window, self.coordinate, self._slot = np.array(rows).T

    def _basis(self, q: np.ndarray) -> np.ndarray:
        nv = q.shape[1]
        basis = np.zeros((len(q), nv, nv))
        for (active, dependent), at in self._groups.items():
            free = [c for c in range(nv) if c not in dependent]
            J = _jacobians(self.model.mechanism.contacts_of(q[at]), active)
            N = np.zeros((len(at), len(free), nv))
            N[:, np.arange(len(free)), free] = 1.0
            if dependent:
                solved = np.linalg.solve(J[:, :, list(dependent)], J[:, :, free])
                N[:, :, list(dependent)] = -np.swapaxes(solved, 1, 2)
            basis[at, : len(free)] = N
        return basis

    def _constraints(self, q: np.ndarray) -> np.ndarray:
        """(J M⁻¹ J')⁺ J M⁻¹ (n, 2 p, nv), which maps the residual force to contact forces."""
        contacts = self.model.mechanism.contacts_of(q)
        is_active = np.zeros(contacts.phi.shape, dtype=bool)
        for (active, _), at in self._groups.items():
            is_active[np.ix_(at, list(active))] = True
        J = np.concatenate([contacts.J_n * is_active[..., None], contacts.J_t * is_active[..., None]], axis=1)
        JM = J @ np.linalg.inv(self.model.mass_matrix(q))
        return np.linalg.pinv(JM @ np.swapaxes(J, 1, 2), hermitian=True) @ JM

    def contact_forces(self, force: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """c_n, c_t (n, p) in N that the motion requires if `force` (n, nv) acts besides the believed model."""
        c_n, c_t = np.split(np.einsum("kcv,kv->kc", self._to_contact, self._rest - force), 2, axis=1)
        return c_n, c_t

    def with_normals(self, force: np.ndarray) -> Motion:
        """The motion with the normal forces that it requires if `force` (n, nv) also acts."""
        return replace(self.motion, c_n=self.contact_forces(force)[0])

    def gathered(self, force: np.ndarray) -> np.ndarray:
        """Σ_k N_k' h force_k over each window, whitened: (n, nv) to (N,), or (n, nv, j) to (N, j)."""
        step = np.einsum("krv,kv...->kr...", self.basis, self.h * force)
        rows = np.add.reduceat(step, self.starts, axis=0)[self.window, self._slot]
        whitened = np.empty_like(rows)
        for rows_of_trial, L in self._factors:
            whitened[rows_of_trial] = solve_triangular(L, rows[rows_of_trial], lower=True)
        return whitened

    def residual(self, force: np.ndarray) -> np.ndarray:
        """z (N,) if `force` (n, nv) of the effects acts besides the believed model."""
        return self.gathered(self._rest - force)

    def _whitening(self, trials: Sequence[Trial], v_next: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
        """Rows of z and L of each trial."""
        n, nv = v_next.shape

        def balance(q: np.ndarray, v: np.ndarray, v_next: np.ndarray) -> np.ndarray:
            rest = self.model.inverse_dynamics(q, v, (v_next - v) / self.h) - self.f
            return np.einsum("krv,kv->kr", self._basis(q), self.h * rest)

        slopes = np.zeros((3, n, nv, nv))  # of q_k, v_k, v_{k+1}; row, channel
        measured = np.stack([self.motion.q, self.motion.v, v_next])
        for which, channel in product(range(3), range(nv)):
            shift = np.zeros_like(measured)
            shift[which, :, channel] = NUDGE
            slopes[which, :, :, channel] = (balance(*measured + shift) - balance(*measured - shift)) / (2.0 * NUDGE)
        factors = []
        ends = np.append(self.starts, n).tolist()
        for i, t in enumerate(trials):
            rows = np.flatnonzero(self.trial == i)
            if not len(rows):
                continue
            G = np.zeros((2, len(rows), len(t.q), nv))
            for row, r in enumerate(rows):
                window = int(self.window[r])
                at = np.arange(ends[window], ends[window + 1])
                k, slot = self.step[at], self._slot[r]
                G[0, row, k] += slopes[0, at, slot]
                G[1, row, k] += slopes[1, at, slot]
                G[1, row, k + 1] += slopes[2, at, slot]
            S = np.einsum("crkv,cv,cskv->rs", G, t.sigma**2, G, optimize=True)
            # rows may have no noise at all: a small diagonal keeps the factor defined
            S += 1e-14 * np.trace(S) / len(S) * np.eye(len(S))
            factors.append((rows, np.linalg.cholesky(S)))
        return factors


def _jacobians(contacts: ContactGeometry, pairs: tuple[int, ...]) -> np.ndarray:
    """Normal and tangential rows (n, 2 p, nv) of `pairs`."""
    return np.concatenate([contacts.J_n[:, list(pairs)], contacts.J_t[:, list(pairs)]], axis=1)


def _dependent(J: np.ndarray) -> tuple[tuple[int, ...], str]:
    """Coordinates that the constraints J (k, c, nv) of a window determine, and why it is unusable, or ''."""
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
