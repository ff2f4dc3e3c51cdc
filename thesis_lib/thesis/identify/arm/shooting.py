"""Maximum likelihood of arm and disk by shooting with the contact simulator (thesis 2.4, beyond eqs. 2.12 to 2.14).

For known torques, a start x_0 = (q_0, v_0) and base parameters Θ(ξ), the motion is simulated with the step of
`stepping`, contact modes included, to minimise

    χ²(x_0, ξ) = Σ_k |W (z_k - z(k; x_0, ξ))|²,     W = 1/σ per channel,  z = (q, v).

Over the whole motion χ² is rough, since an impact predicted a step late costs thousands; over short segments with free
starts it has hardly any false minimum.  Segments are therefore lengthened stage by stage.  Their starts are eliminated
from the arrow-shaped normal equations; all perturbed copies of all candidates are simulated in one batch.

The noise level is estimated (`noise_level`, `noise_of_residuals`), which makes χ²/n near 1 a test that a fit can fail.

Sources: H. G. Bock, Recent advances in parameter identification techniques for O.D.E., 1983,
doi 10.1007/978-1-4684-7324-7_7 (multiple shooting); D. W. Marquardt, SIAM J. 11 (1963), doi 10.1137/0111030.
"""

from dataclasses import dataclass

import numpy as np

from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.stepping.arm_disk import ArmDisk
from thesis_lib.statistics.spread import robust_std
from thesis_lib.thesis.identify.arm.parameters import from_free
from thesis_lib.thesis.identify.arm.stepping import Copies, simulate_copies

STEP = 1e-6  # forward-difference step of a parameter or a state; the rounding error is then 1e-8
DAMPING = np.array([0.02, 0.3, 4.0, 60.0])  # factors on the damping that are tried in parallel in an iteration
SETTLED = 1e-3  # relative decrease of χ² in an iteration, below which the search counts as converged
LARGEST_STEP = 1.5  # of a logarithm, so that no parameter changes by more than a factor of 4.5 in an iteration
Stage = tuple[tuple[int, int], ...]  # segments (start, stop) in steps, each predicted from a free start
CLIP, CLIPPED = 3.0, 0.9733  # standard deviations, and the variance of a normal distribution truncated there


@dataclass(frozen=True)
class ArmData:
    """Data of one motion: noisy states, torques, and coefficients of the contacts."""

    h: float  # s
    q: np.ndarray  # q, v: (m+1, 5) measured states z, m, rad and per s
    v: np.ndarray
    f_ext: np.ndarray  # (m, 5) known external force in N, N m
    mu: float  # mu, epsilon: of both pairs
    epsilon: float
    sigma: np.ndarray  # (2, 5) noise of q and v, estimated by `noise_level`

    @property
    def steps(self) -> int:
        """Number of steps m."""
        return len(self.f_ext)


@dataclass(frozen=True)
class Candidates:
    """Candidate solutions, P in number: p = ξ (P, 6), starts x (P, S, 10) of the segments, cost χ² (P,)."""

    p: np.ndarray
    x: np.ndarray
    cost: np.ndarray

    def __getitem__(self, rows: np.ndarray) -> "Candidates":
        return Candidates(self.p[rows], self.x[rows], self.cost[rows])


def noise_level(q: np.ndarray, v: np.ndarray, h: float) -> np.ndarray:
    """Standard deviations (2, 5) of the noise of q and v (m+1, 5), without a model of the motion.

    The time step gives q_{k+1} - q_k = h v_{k+1} exactly, and σ_q is far above h σ_v, so that

        rms of (q_{k+1} - q_k - h v_{k+1}) = √2 σ_q

    independently of the contacts.  σ_v comes from second differences, of variance 6 σ²; their median ignores the few
    steps with events.
    """
    slack = np.diff(q, axis=0) - h * v[1:]
    second = np.diff(v, n=2, axis=0)
    return np.stack([slack.std(axis=0) / np.sqrt(2.0), robust_std(second) / np.sqrt(6.0)])


def noise_of_residuals(r: np.ndarray) -> np.ndarray:
    """Standard deviations (...,) of the white part of residuals (n, ...), from their first differences (von Neumann).

    Model errors last many steps, so they show in the residuals but hardly in their differences.  The ratio tests a
    fit without a known noise level.  Differences beyond `CLIP` standard deviations are omitted, since an impact that
    the model predicts a step late must not count as noise.
    """
    d = np.diff(r, axis=0) / np.sqrt(2.0)
    scale = robust_std(d)
    within = np.abs(d) <= CLIP * scale
    return np.sqrt(np.sum(np.where(within, d, 0.0) ** 2, axis=0) / np.maximum(within.sum(axis=0), 1) / CLIPPED)


def measured(q: np.ndarray, v: np.ndarray, f_ext: np.ndarray, h: float, mu: float, epsilon: float = 0.0) -> ArmData:
    """Return the data of one motion with its estimated noise level; arguments as in `ArmData`.

    Raises:
        UserError: shapes do not match, values are not finite, the motion is too short, or a channel has no noise.
    """
    q, v, f_ext = (np.asarray(a, dtype=float) for a in (q, v, f_ext))
    m = len(f_ext)
    if q.shape != (m + 1, 5) or v.shape != q.shape or f_ext.shape != (m, 5):
        raise UserError(
            f"Arm and disk need states (m+1, 5) and external forces (m, 5); got {q.shape}, {v.shape}, {f_ext.shape}."
        )
    if not (np.isfinite(q).all() and np.isfinite(v).all() and np.isfinite(f_ext).all()):
        raise UserError("The arm's states or torques contain NaN or infinite values; remove or repair them first.")
    if m < 10:
        raise UserError(f"A motion of {m} steps is too short to identify arm and disk; at least 10 are needed.")
    sigma = noise_level(q, v, h)
    if not (sigma > 0).all():
        raise UserError(
            "A channel of the arm's states has no noise, so it cannot be weighted; for data without noise, use the "
            "mode QP (mode_qp.solve_mode_qp)."
        )
    return ArmData(float(h), q, v, f_ext, float(mu), float(epsilon), sigma)


def equal_segments(steps: int, length: int) -> Stage:
    """Divide the whole motion into segments of about `length` steps."""
    edges = np.linspace(0, steps, max(round(steps / length), 1) + 1).round().astype(int)
    return tuple(zip(edges[:-1].tolist(), edges[1:].tolist()))


class Shooting:
    """Problem of fitting one motion: χ² over the segments of a stage, and its minimisation.

    Only the lengths, base, radius and gravity of `arm` are used.
    """

    def __init__(self, arm: ArmDisk, data: ArmData) -> None:
        self.arm, self.data = arm, data
        self.z = np.concatenate([data.q, data.v], axis=1)
        self.sigma = data.sigma.ravel()

    def copies(self, p: np.ndarray, x: np.ndarray, f_ext: np.ndarray) -> Copies:
        """Simulate n copies with parameters p (n, 6) from x (n, 10) under f_ext (m, 5) or (n, m, 5)."""
        theta = from_free(p, self.arm.link_lengths[0])
        d = self.data
        return simulate_copies(self.arm, theta, x[:, :5], x[:, 5:], f_ext, d.h, d.mu, d.epsilon)

    def residuals(self, stage: Stage, p: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Whitened residuals (n, S, (L+1) 10) for p (n, 6), x (n, S, 10): zero beyond a segment's end, NaN if the
        motion has no solution."""
        n, S = x.shape[:2]
        lengths = np.array([stop - start for start, stop in stage])
        L = int(lengths.max())
        f_ext, z = np.zeros((S, L, 5)), np.zeros((S, L + 1, 10))
        inside = np.arange(L + 1) <= lengths[:, None]
        for s, (start, stop) in enumerate(stage):
            f_ext[s, : stop - start] = self.data.f_ext[start:stop]
            z[s, : stop - start + 1] = self.z[start : stop + 1]
        forces = f_ext if S == 1 else np.tile(f_ext, (n, 1, 1))
        out = self.copies(np.repeat(p, S, axis=0), x.reshape(n * S, 10), forces)
        r = np.concatenate([out.q, out.v], axis=2).reshape(n, S, L + 1, 10)
        r -= z
        r /= self.sigma
        r[:, ~inside] = 0.0
        return r.reshape(n, S, -1)

    def cost(self, stage: Stage, p: np.ndarray, x: np.ndarray) -> np.ndarray:
        """χ² (n,) for p (n, 6), x (n, S, 10); infinite where a motion has no solution."""
        with np.errstate(over="ignore", invalid="ignore"):
            r = self.residuals(stage, p, x)
            total = np.einsum("nsr,nsr->n", r, r)
        return np.where(np.isfinite(total), total, np.inf)

    def differences(
        self, stage: Stage, p: np.ndarray, x: np.ndarray, steps: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Residuals (P, S, R) and their derivatives (P, S, 16, R) with respect to the segment's start and p.

        `steps` (16,) are the forward difference steps; the default approximates derivatives.
        """
        P, S = x.shape[:2]
        width = 17
        if steps is None:
            steps = np.full(16, STEP)
        pp = np.repeat(p[:, None], width, axis=1)
        xx = np.repeat(x[:, None], width, axis=1)
        for j in range(10):
            xx[:, 1 + j, :, j] += steps[j]
        for j in range(6):
            pp[:, 11 + j, j] += steps[10 + j]
        r = self.residuals(stage, pp.reshape(P * width, 6), xx.reshape(P * width, S, 10))
        r = r.reshape(P, width, S, -1)
        base = r[:, 0]
        jacobian = (r[:, 1:] - base[:, None]) / steps[:, None, None]
        return base, np.nan_to_num(jacobian, nan=0.0, posinf=0.0, neginf=0.0).transpose(0, 2, 1, 3)

    def minimise(self, stage: Stage, point: Candidates, iterations: int, steps: np.ndarray | None = None) -> Candidates:
        """Levenberg-Marquardt for P candidates in parallel, each until χ² falls by less than `SETTLED` twice.

        `steps` as in `differences`; steps of one standard error average the slope over the kinks of χ², at which a
        search with derivatives gets stuck.
        """
        p, x = point.p.copy(), point.x.copy()
        cost = self.cost(stage, p, x)
        P, S = x.shape[:2]
        n_d = len(DAMPING)
        damping, idle = np.full(P, 1e-2), np.zeros(P, dtype=int)
        for _ in range(iterations):
            run = np.flatnonzero((idle < 2) & np.isfinite(cost))
            if not len(run):
                break
            r, J = self.differences(stage, p[run], x[run], steps)
            H = np.matmul(J, J.transpose(0, 1, 3, 2))
            g = np.matmul(J, r[..., None])[..., 0]
            dp = np.empty((len(run), n_d, 6))
            dx = np.empty((len(run), n_d, S, 10))
            for i, a in enumerate(run):
                for d, factor in enumerate(DAMPING):
                    dp[i, d], dx[i, d] = _arrow_step(H[i], g[i], damping[a] * factor)
            shrink = LARGEST_STEP / np.maximum(np.abs(dp).max(axis=2), LARGEST_STEP)
            dp, dx = dp * shrink[..., None], dx * shrink[..., None, None]
            new_p, new_x = p[run][:, None] + dp, x[run][:, None] + dx
            trial = self.cost(stage, new_p.reshape(-1, 6), new_x.reshape(-1, S, 10)).reshape(len(run), n_d)
            best = trial.argmin(axis=1)
            for i, a in enumerate(run):
                b = best[i]
                if trial[i, b] < cost[a]:
                    idle[a] = idle[a] + 1 if cost[a] - trial[i, b] < SETTLED * cost[a] else 0
                    p[a], x[a], cost[a] = new_p[i, b], new_x[i, b], trial[i, b]
                    damping[a] = max(damping[a] * DAMPING[b], 1e-9)
                else:
                    damping[a] *= DAMPING[-1] * 2.0
                    if damping[a] > 1e8:
                        idle[a] = 2
        return Candidates(p, x, cost)

    def moved(self, point: Candidates, old: Stage, new: Stage) -> Candidates:
        """Candidates with starts for the segments of stage `new`, simulated from the starts of stage `old`."""
        x = np.empty((len(point.p), len(new), 10))
        begins = [start for start, _ in old]
        for j, (start, _) in enumerate(new):
            i = max(k for k, begin in enumerate(begins) if begin <= start)
            x[:, j] = point.x[:, i]
            if begins[i] < start:
                out = self.copies(point.p, point.x[:, i], self.data.f_ext[begins[i] : start])
                x[:, j] = np.concatenate([out.q[:, -1], out.v[:, -1]], axis=1)
        # where that simulation has no solution, the measured states are used
        lost = ~np.isfinite(x).all(axis=2)
        x[lost] = np.broadcast_to(self.z[[start for start, _ in new]], x.shape)[lost]
        return Candidates(point.p, x, np.full(len(x), np.inf))


def _arrow_step(H: np.ndarray, g: np.ndarray, damping: float) -> tuple[np.ndarray, np.ndarray]:
    """Damped Gauss-Newton step (p, x (S, 10)) for H (S, 10+n, 10+n) and g (S, 10+n) of S segments; x is eliminated.

    (H + λ diag H) δ = -g;  with blocks xx, xp, pp:  (Σ H_pp - H_px H_xx⁻¹ H_xp) δp = -Σ (g_p - H_px H_xx⁻¹ g_x)
    """
    H = H.copy()
    n = H.shape[1] - 10
    at = np.arange(10)
    H[:, at, at] *= 1.0 + damping
    H[:, at, at] += 1e-12
    Hpp = H[:, 10:, 10:].sum(axis=0)
    diagonal = np.diag(Hpp).copy()
    Hpp[np.arange(n), np.arange(n)] += damping * diagonal + 1e-12 * diagonal.max() + 1e-12
    solved = np.linalg.solve(H[:, :10, :10], np.concatenate([H[:, :10, 10:], g[:, :10, None]], axis=2))
    A = Hpp - np.einsum("sxp,sxq->pq", H[:, :10, 10:], solved[..., :n])
    b = g[:, 10:].sum(axis=0) - np.einsum("sxp,sx->p", H[:, :10, 10:], solved[..., n])
    try:
        dp = -np.linalg.solve(A, b)
    except np.linalg.LinAlgError:
        dp = np.zeros(n)
    return dp, -solved[..., n] - solved[..., :n] @ dp
