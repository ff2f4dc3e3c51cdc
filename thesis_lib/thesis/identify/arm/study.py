"""Accuracy of identified contact forces and base parameters of arm and disk, with and without noise (figure 2-12).

Three methods identify the same trajectories (thesis 2.4); base parameters and forces are unknown to all methods:

    exact    the mode-wise program (2.12, `mode_qp`) on states without noise
    plain    the same program on noisy states; a gap or sliding velocity within a few standard deviations counts as zero
    ours     maximum likelihood by shooting, without a good initial guess (`fit`)

The error of a pair's force c = (c_t, c_n) is relative, over contact steps without impact (`force_error`) and with
(`impact_error`):

    e = √(Σ |ĉ_k - c_k|² / Σ |c_k|²).

A step has contact if the true or the estimated c_n is positive.  An impact is a step with |c| above ten times its
median over contact, with its two neighbours: an impact without rebound takes two steps, and an impact estimated a step
late must not affect the other sum.
"""

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from thesis_lib.simulate.mechanisms.base_parameters import base_parameters
from thesis_lib.simulate.mechanisms.motions import Chapter2Bodies, arm_disk, arm_trajectories
from thesis_lib.simulate.mechanisms.noise_snr import add_noise
from thesis_lib.simulate.stepping.arm_disk import ArmDisk
from thesis_lib.simulate.stepping.stepping import SimulatedMotion
from thesis_lib.thesis.identify.arm.fit import ArmFit, error_bound, fit
from thesis_lib.thesis.identify.arm.parameters import NAMES, base_of, regressor
from thesis_lib.thesis.identify.arm.settings import ArmStudy
from thesis_lib.thesis.identify.arm.shooting import ArmData, measured
from thesis_lib.thesis.identify.base_parameters.identifiability import projected
from thesis_lib.thesis.identify.base_parameters.window import ALLOWANCE, ContactWindow, States, window_of
from thesis_lib.thesis.identify.programs.mode_qp import solve_mode_qp

IMPACT = 10.0  # factor on the median force over contact, above which a step counts as an impact
METHODS = ("exact", "plain", "ours")


@dataclass(frozen=True)
class ArmForces:
    """One trajectory at one noise level, identified by all methods."""

    record: SimulatedMotion  # the true motion
    data: ArmData  # noisy states and torques
    c: dict[str, tuple[np.ndarray, np.ndarray]]  # for each method the forces (c_n, c_t), each (m, 2) in N
    theta: dict[str, np.ndarray]  # for each method Θ (6,)
    # for each method, number of base parameters that its window determines when contact forces are unknown
    rank: dict[str, int]
    fit: ArmFit  # result of "ours" with its uncertainties
    # (6,) Cramér-Rao bound on the standard errors of Θ, at the truth and with the true noise level
    bound: np.ndarray


@dataclass(frozen=True)
class ArmForceTables:
    """Tables of the study, and the trajectories on which they are based."""

    forces: pd.DataFrame  # a row per trajectory, pair and method
    parameters: pd.DataFrame  # a row per trajectory, method and base parameter
    trajectories: tuple[ArmForces, ...]
    left_out: dict[str, int]  # number of simulated trajectories left out, by reason


def arm_window(
    arm: ArmDisk, motion: SimulatedMotion | ArmData, mu: float, sigma: np.ndarray | None = None, tolerances: float = 3.0
) -> ContactWindow:
    """Window of a motion of arm and disk in its base parameters.

    States, known force and step of `motion` are used; `sigma` (2, 5) is the noise of q and v (None: none);
    `tolerances` standard deviations of gap and sliding velocity count as zero.

    Raises:
        UserError: a value is not finite.
    """
    h, q, v, f_ext = motion.h, motion.q, motion.v, motion.f_ext
    states = States.of(arm, h, q, v, f_ext)
    gap_tolerance, v_tolerance = ALLOWANCE * h**2, 1e-9
    if sigma is not None:
        gap_tolerance += tolerances * float(np.sqrt(np.mean((states.J_n * sigma[0]) ** 2 @ np.ones(5))))
        v_tolerance += tolerances * float(np.sqrt(np.mean((states.J_t * sigma[1]) ** 2 @ np.ones(5))))
    return window_of(
        states,
        regressor(arm, q[:-1], v[:-1], np.diff(v, axis=0) / h),
        np.zeros(5),
        mu,
        NAMES,
        theta_min=np.array([-np.inf, 0.0, -np.inf, 0.0, 0.0, 0.0]),
        gap_tolerance=gap_tolerance,
        v_tolerance=v_tolerance,
    )


def window_rank(window: ContactWindow) -> int:
    """Number of base parameters that a window determines when its contact forces are unknown."""
    return base_parameters(projected(window)[0], window.names).rank


def arm_forces(
    arm: ArmDisk, record: SimulatedMotion, mu: float, epsilon: float, rng: np.random.Generator, settings: ArmStudy
) -> ArmForces:
    """Apply all methods to one trajectory; the inertia of `arm` is used only for the bound."""
    noisy = add_noise(record, settings.snr_db, rng)
    data = measured(noisy.q, noisy.v, record.f_ext, record.h, mu, epsilon)
    windows = {
        "exact": arm_window(arm, record, mu),
        "plain": arm_window(arm, data, mu, data.sigma, settings.tolerances),
    }
    c, theta, rank = {}, {}, {}
    for name, window in windows.items():
        result = solve_mode_qp(window, "2.12")
        c[name], theta[name], rank[name] = (result.c_n, result.c_t), result.theta, window_rank(window)
    estimate = fit(arm, data, rng, settings.fit)
    c["ours"], theta["ours"] = (estimate.c_n, estimate.c_t), estimate.theta
    found = replace(data, q=estimate.q, v=estimate.v)
    rank["ours"] = window_rank(arm_window(arm, found, mu)) if np.isfinite(estimate.q).all() else 0
    bound = error_bound(arm, replace(data, sigma=noisy.sigma), base_of(arm), record.q[0], record.v[0])
    return ArmForces(record, data, c, theta, rank, estimate, bound)


def force_errors(true: tuple[np.ndarray, np.ndarray], found: tuple[np.ndarray, np.ndarray]) -> dict[str, float]:
    """Relative rms errors of one pair's force (c_n, c_t), each (m,) in N.

    Returns:
        Numbers of steps n_contact and n_impact, force_error without impacts, and impact_error; NaN without such steps.
    """
    c, d = np.stack(true, axis=1), np.stack(found, axis=1)
    size = np.hypot(*c.T)
    contact = true[0] > 0.0
    peak = contact & (size > IMPACT * np.median(size[contact])) if contact.any() else contact
    impact = peak.copy()
    impact[1:] |= peak[:-1]
    impact[:-1] |= peak[1:]
    steady = (contact | (found[0] > 0.0)) & ~impact
    return {
        "n_contact": int(contact.sum()),
        "n_impact": int(peak.sum()),
        "force_error": _relative(c[steady], d[steady]),
        "impact_error": _relative(c[impact], d[impact]),
    }


def _relative(true: np.ndarray, found: np.ndarray) -> float:
    scale = float(np.sum(true**2))
    return float(np.sqrt(np.sum((found - true) ** 2) / scale)) if scale > 0.0 else np.nan


def arm_force_study(rng: np.random.Generator, settings: ArmStudy, bodies: Chapter2Bodies) -> ArmForceTables:
    """Simulate trajectories with contact, add noise, and estimate forces and parameters by all methods.

    Raises:
        UserError: the settings give no trajectories with enough contact, or the arm has μ above 0.4 (its type forbids).
    """
    arm = arm_disk(bodies)
    made = arm_trajectories(settings.trajectories, rng, bodies)
    streams = rng.spawn(settings.trajectories)  # noise and starts of a trajectory do not depend on earlier ones
    done: tuple[ArmForces, ...] = ()
    for i, (record, stream) in enumerate(zip(made.records, streams)):
        done += (arm_forces(arm, record, bodies.arm.mu, bodies.arm.epsilon, stream, settings),)
        print(f"trajectory {i}: χ²/n {done[-1].fit.chi2:.3f}")
    forces, parameters = tables_of(done, base_of(arm))
    return ArmForceTables(forces, parameters, done, made.left_out)


def tables_of(done: tuple[ArmForces, ...], truth: np.ndarray) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Tables of forces and of parameters; `truth` (6,) is the true Θ."""
    forces, parameters = [], []
    for i, trajectory in enumerate(done):
        for method in METHODS:
            head = {
                "trajectory": i,
                "method": method,
                "rank": trajectory.rank[method],
                "chi2": trajectory.fit.chi2 if method == "ours" else np.nan,
                "accepted": trajectory.fit.accepted if method == "ours" else trajectory.rank[method] == len(NAMES),
            }
            c_n, c_t = trajectory.c[method]
            for j, pair in enumerate(("arm", "ground")):
                true = trajectory.record.c_n[:, j], trajectory.record.c_t[:, j]
                forces.append({**head, "pair": pair, **force_errors(true, (c_n[:, j], c_t[:, j]))})
            std = trajectory.fit.std if method == "ours" else np.full(len(NAMES), np.nan)
            bound = trajectory.bound if method == "ours" else np.full(len(NAMES), np.nan)
            for j, name in enumerate(NAMES):
                value = trajectory.theta[method][j]
                row = {"parameter": name, "estimate": value, "truth": truth[j], "std": std[j], "bound": bound[j]}
                parameters.append({**head, **row, "error": value / truth[j] - 1.0})
    return pd.DataFrame(forces), pd.DataFrame(parameters)


def arm_force_summary(forces: pd.DataFrame, parameters: pd.DataFrame) -> pd.DataFrame:
    """Row per method and quantity: median, 90 % quantile, largest error over trajectories; shares within 1 % and 5 %.

    Failed fits, counted in `n_failed`, lie outside every limit but stay in the median.
    """
    worst = parameters.assign(error=parameters["error"].abs()).groupby(["method", "trajectory"])
    theta = worst.agg(error=("error", "max"), accepted=("accepted", "first")).reset_index()
    parts = [("theta", theta)]
    for pair, rows in forces.groupby("pair"):
        for kind in ("force", "impact"):
            parts += [(f"{pair}_{kind}", rows.assign(error=rows[f"{kind}_error"]))]
    out = []
    for quantity, rows in parts:
        for method in METHODS:
            of = rows[rows["method"] == method].dropna(subset="error")
            error, fine = of["error"].to_numpy(), of["accepted"].to_numpy(bool)
            out.append(
                {
                    "quantity": quantity,
                    "method": method,
                    "n_trajectories": len(of),
                    "n_failed": int((~fine).sum()),
                    "error_median": float(np.median(error)),
                    "error_90": float(np.quantile(error, 0.9)),
                    "error_max": float(error.max()),
                    "share_1_percent": float(np.mean(fine & (error <= 0.01))),
                    "share_5_percent": float(np.mean(fine & (error <= 0.05))),
                }
            )
    return pd.DataFrame(out)
