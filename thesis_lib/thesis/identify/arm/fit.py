"""Maximum-likelihood base parameters and contact forces of arm and disk, without a good initial guess (thesis 2.4).

Lengths, radius, gravity, torques, μ and ε are known.  The base parameters, the start and the noise level are unknown;
starting values are drawn from a prior (`ArmPrior`).  The likelihood of the noisy states is maximised in five stages:

1. screen: prior draws predict short segments from the measured states; the best few are kept;
2. segments: 10, 25 and 60 steps, each segment with a free start (`shooting`);
3. growth: one motion from the first sample, over a horizon that grows to the whole record;
4. kicks: the best result is moved by a few standard errors and refitted, with differences over a standard error, until
   χ² stops falling.  This crosses the kinks of χ² at which a contact event moves by a time step;
5. gate: χ²/n of the residuals relative to their white part must be below `gate`; otherwise new draws are tried, and
   after the last attempt the fit counts as failed.

The covariance of (x_0, ξ) is the inverse of J'J of the whitened residuals (the Cramér-Rao bound at the estimate),
where J holds differences over a standard error.  The standard errors of the forces use the same perturbations.

Sources: see `shooting`; J. von Neumann, Ann. Math. Statist. 12 (1941), doi 10.1214/aoms/1177731677 (ratio of
the mean square successive difference to the variance).
"""

from dataclasses import dataclass, replace

import numpy as np

from thesis_lib.simulate.stepping.arm_disk import ArmDisk
from thesis_lib.thesis.identify.arm.parameters import free_coordinates, from_free, from_free_jacobian
from thesis_lib.thesis.identify.arm.settings import ArmFitSettings
from thesis_lib.thesis.identify.arm.shooting import (
    ArmData,
    Candidates,
    Shooting,
    Stage,
    equal_segments,
    noise_of_residuals,
)

AXES_REPETITIONS = 3  # iterations of the search for the axes; most converge in two
SAME = 1.001  # ratio of χ² up to which two candidates count as the same solution
HOPELESS = 10.0  # ratio to the best χ² above which a candidate is dropped
KICK = (0.05, 3.0)  # sizes of kicks in standard errors, smallest and largest
# difference steps in turn, as shares of a coordinate's conditional standard error; 0 for derivatives
SHARES = (1.0, 0.0, 0.3)
SILENT = 1e-8  # share of the largest information below which a direction counts as not determined


@dataclass(frozen=True)
class ArmFit:
    """Result of a maximum-likelihood fit."""

    theta: np.ndarray  # (6,) Θ in the order of `parameters.NAMES`, kg, kg m, kg m²
    std: np.ndarray  # (6,) standard errors of Θ
    q: np.ndarray  # q, v: (m+1, 5) estimated motion
    v: np.ndarray
    c_n: np.ndarray  # c_n, c_t: (m, 2) contact forces in N, pairs ("arm", "ground")
    c_t: np.ndarray
    c_n_std: np.ndarray  # c_n_std, c_t_std: (m, 2) standard errors of the forces in N
    c_t_std: np.ndarray
    chi2: float  # χ²/n against the noise of q and v in the residuals
    accepted: bool  # whether χ²/n passes the gate


def fit(arm: ArmDisk, data: ArmData, rng: np.random.Generator, settings: ArmFitSettings) -> ArmFit:
    """Maximum-likelihood parameters and forces of one motion; `accepted` is true if the fit passes the gate.

    Only the lengths, base, radius and gravity of `arm` are used.  `data` are from `shooting.measured`; `rng` draws
    starting values and kicks.
    """
    best: tuple[Shooting, Candidates, float] | None = None
    for attempt in range(settings.attempts):
        shooting = Shooting(arm, data)
        point = _screened(shooting, settings.prior.draw(settings.draws, arm, rng), settings)
        growth = settings.growth if attempt == 0 else int(rng.integers(settings.growth // 3, 2 * settings.growth))
        point = _grown(shooting, point, settings, growth)
        if np.isfinite(point.cost).any():
            shooting, point = _kicked(shooting, point, rng, settings)
            chi2 = _chi2(shooting, point)
            if best is None or chi2 < best[2]:
                best = shooting, point, chi2
        if best is not None and best[2] < settings.gate:
            break
    return _nothing(data) if best is None else _answer(*best, settings.gate)


def error_bound(arm: ArmDisk, data: ArmData, theta: np.ndarray, q0: np.ndarray, v0: np.ndarray) -> np.ndarray:
    """Cramér-Rao bound (6,) on the standard errors of Θ if the start and Θ are unknown.

    The states of `data` are not used; `theta` (6,), `q0` and `v0` (5,) are true.
    """
    shooting = Shooting(arm, data)
    xi = free_coordinates(theta, arm.link_lengths[0])
    A = _axes(shooting, Candidates(xi[None], np.concatenate([q0, v0])[None, None], np.zeros(1)))
    D = from_free_jacobian(xi, arm.link_lengths[0])
    return np.linalg.norm(D @ A[10:], axis=1)


def _whole(data: ArmData, stop: int | None = None) -> Stage:
    return ((0, data.steps if stop is None else stop),)


def _screened(shooting: Shooting, theta: np.ndarray, settings: ArmFitSettings) -> Candidates:
    """Candidates that best predict short segments from the measured states."""
    stage = equal_segments(shooting.data.steps, settings.segments[0])
    p = free_coordinates(theta, shooting.arm.link_lengths[0])
    x = np.tile(shooting.z[[start for start, _ in stage]], (len(p), 1, 1))
    r = shooting.residuals(stage, p, x)
    chi2 = np.nan_to_num(np.einsum("nsr,nsr->ns", r, r), nan=np.inf) / r.shape[2]
    # logarithm because a start slightly on the wrong side of a contact spoils its segment for every candidate
    score = np.log1p(np.minimum(chi2, 1e12)).sum(axis=1)
    order = np.argsort(score, kind="stable")[: settings.candidates]
    return Candidates(p[order], x[order], np.full(len(order), np.inf))


def _grown(shooting: Shooting, point: Candidates, settings: ArmFitSettings, growth: int) -> Candidates:
    """Fit candidates to the whole motion by lengthening the segments and then growing the horizon."""
    data = shooting.data
    longest = settings.segments[-1]
    stages = [equal_segments(data.steps, length) for length in settings.segments]
    stages += [_whole(data, stop) for stop in range(longest, data.steps, growth)] + [_whole(data)]
    old = stages[0]
    for stage in stages:
        point = shooting.minimise(stage, shooting.moved(point, old, stage), settings.iterations)
        if len(stage) == 1:
            point = _distinct(point)
        old = stage
    return point


def _distinct(point: Candidates) -> Candidates:
    """Candidates in ascending χ², without duplicates and without candidates far worse than the best."""
    order = np.argsort(point.cost, kind="stable")
    kept = [order[0]]
    for i in order[1:]:
        if SAME * point.cost[kept[-1]] < point.cost[i] < HOPELESS * point.cost[order[0]]:
            kept.append(i)
    return point[np.array(kept)]


def _kicked(
    shooting: Shooting, point: Candidates, rng: np.random.Generator, settings: ArmFitSettings
) -> tuple[Shooting, Candidates]:
    """Perturb and refit the best candidate, at the noise level of its residuals, until χ² stops falling."""
    stage = _whole(shooting.data)
    best = point[[int(point.cost.argmin())]]
    idle = 0
    for round_ in range(settings.rounds):
        shooting, best = _weighed(shooting, best, settings)
        A = _axes(shooting, best)
        trial = _neighbours(shooting, best, A, rng, settings)
        share = SHARES[round_ % len(SHARES)]
        # differences over a share of each coordinate's conditional standard error
        steps = share / np.sqrt(np.diag(np.linalg.inv(A @ A.T))) if share else None
        trial = shooting.minimise(stage, trial, settings.iterations, steps)
        i = int(trial.cost.argmin())
        gain = 1.0 - trial.cost[i] / best.cost[0]
        if gain > 0.0:
            best = trial[[i]]
        idle = 0 if gain > settings.gain else idle + 1
        if idle == 2:
            break
    return _weighed(shooting, best, settings)


def _neighbours(
    shooting: Shooting, best: Candidates, A: np.ndarray, rng: np.random.Generator, settings: ArmFitSettings
) -> Candidates:
    """Points of least χ² within a few standard errors, each with a different sequence of contact modes.

    Half of them lie along the axes of the uncertainty.  If a grazing contact makes the motion unstable, the right
    sequence occupies a thousandth of a standard error in one direction, which only a line search can find.
    """
    n = len(A)
    coordinates = np.zeros((settings.kicks, n))
    half = settings.kicks // 2
    coordinates[np.arange(half), np.arange(half) % n] = rng.uniform(-KICK[1], KICK[1], half)
    size = np.exp(rng.uniform(*np.log(KICK), (settings.kicks - half, 1)))
    coordinates[half:] = size * rng.standard_normal((settings.kicks - half, n))
    move = coordinates @ A.T
    p, x = best.p + move[:, 10:], best.x + move[:, None, :10]
    out = shooting.copies(p, x[:, 0], shooting.data.f_ext)
    r = (np.concatenate([out.q, out.v], axis=2) - shooting.z) / shooting.sigma
    cost = np.nan_to_num(np.einsum("nkc,nkc->n", r, r), nan=np.inf)
    chosen: dict[bytes, int] = {}
    for i in np.argsort(cost, kind="stable"):
        chosen.setdefault(out.mode[i].tobytes(), int(i))
        if len(chosen) == settings.candidates:
            break
    rows = np.array(list(chosen.values()))
    return Candidates(p[rows], x[rows], cost[rows])


def _weighed(shooting: Shooting, best: Candidates, settings: ArmFitSettings) -> tuple[Shooting, Candidates]:
    """Problem with the noise level set from the residuals, and the candidate refitted to it."""
    stage = _whole(shooting.data)
    r = shooting.residuals(stage, best.p, best.x)[0, 0].reshape(-1, 10)
    sigma = (noise_of_residuals(r) * shooting.sigma).reshape(2, 5)
    again = Shooting(shooting.arm, replace(shooting.data, sigma=sigma))
    return again, again.minimise(stage, best, settings.iterations)


def _axes(shooting: Shooting, best: Candidates) -> np.ndarray:
    """Axes A (n, n) of the uncertainty of (x_0, p), each one standard error long: the covariance is A A'.

    At a kink, where an event is about to move by a step, the derivatives on the two sides differ.  The axes are found
    by iteration, such that along each the residuals change by one, averaged over both sides.
    """
    stage = _whole(shooting.data)
    _, J = shooting.differences(stage, best.p, best.x)
    H = J[0, 0] @ J[0, 0].T
    d = np.sqrt(np.diag(H)) + 1e-12
    A = _inverse_root(H / np.outer(d, d)) / d[:, None]
    for _ in range(AXES_REPETITIONS):
        both = np.concatenate([A.T, -A.T])
        r = shooting.residuals(stage, best.p + both[:, 10:], best.x + both[:, None, :10])[:, 0]
        n = len(A)
        J = 0.5 * (r[:n] - r[n:])
        if not np.isfinite(J).all():
            break
        A = A @ _inverse_root(J @ J.T)
    return A


def _inverse_root(H: np.ndarray) -> np.ndarray:
    """B with B B' = H⁻¹; eigenvalues of H are floored in directions that the data do not determine."""
    values, U = np.linalg.eigh(H)
    return U / np.sqrt(np.maximum(values, SILENT * values[-1]))


def _chi2(shooting: Shooting, best: Candidates) -> float:
    """χ²/n relative to the white part of the residuals; n is reduced by the 16 unknowns."""
    r = shooting.residuals(_whole(shooting.data), best.p, best.x)[0, 0].reshape(-1, 10)
    ratio = np.mean(np.mean(r**2, axis=0) / noise_of_residuals(r) ** 2)
    return float(ratio * r.size / (r.size - 16))


def _answer(shooting: Shooting, best: Candidates, chi2: float, gate: float) -> ArmFit:
    data, xi, l1 = shooting.data, best.p[0], shooting.arm.link_lengths[0]
    out = shooting.copies(best.p, best.x[:, 0], data.f_ext)
    A = _axes(shooting, best)
    C = A @ A.T
    D = from_free_jacobian(xi, l1)
    # standard errors of the forces, from their change over one standard error along each axis
    both = np.concatenate([A.T, -A.T])
    moved = shooting.copies(best.p + both[:, 10:], best.x[:, 0] + both[:, :10], data.f_ext)
    pairs = (moved.c_n, out.c_n), (moved.c_t, out.c_t)
    std_n, std_t = (np.sqrt(0.5 * np.nansum((other - c) ** 2, axis=0)) for other, c in pairs)
    return ArmFit(
        theta=from_free(xi, l1),
        std=np.sqrt(np.diag(D @ C[10:, 10:] @ D.T)),
        q=out.q[0],
        v=out.v[0],
        c_n=out.c_n[0],
        c_t=out.c_t[0],
        c_n_std=std_n,
        c_t_std=std_t,
        chi2=chi2,
        accepted=bool(chi2 < gate),
    )


def _nothing(data: ArmData) -> ArmFit:
    states, forces = np.full((data.steps + 1, 5), np.nan), np.full((data.steps, 2), np.nan)
    theta = np.full(6, np.nan)
    return ArmFit(theta, theta, states, states, forces, forces, forces, forces, chi2=np.inf, accepted=False)
