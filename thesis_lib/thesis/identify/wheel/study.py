"""Accuracy of contact forces of a rolling rimless wheel, and effect of its mass on the motion (figures 2-10, 2-11).

Each record is a motion of the wheel from one start, identified by three methods with unknown inertia:

- noise_free: eq. 2.12 on the exact states (`forces.plain_forces`)
- plain: the same program on noisy states, with tolerances from the true noise level
- fit: maximum likelihood on the same noisy states, with estimated noise level (`forces.fit_wheel`)

The touchdown of a spoke is an impact of two steps, with forces 30 times larger than in rolling.  It is excluded with a
margin of one step on either side, and assessed by its impulse.  With K the other steps and D those of the touchdown,

    error = √(Σ_K (ĉ - c)² / Σ_K c²),    impulse_error = |Σ_D (ĉ - c)| / |Σ_D c|        for c_n and c_t of a spoke,

where K includes steps without contact.  The first spoke is in contact from the start and has no touchdown.
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.mechanisms.motions import Chapter2Bodies, releases, wheel
from thesis_lib.simulate.mechanisms.noise_snr import add_noise
from thesis_lib.simulate.stepping.rimless_wheel import RimlessWheel
from thesis_lib.simulate.stepping.stepping import SimulatedMotion, simulate
from thesis_lib.thesis.identify.settings import WheelStudy
from thesis_lib.thesis.identify.wheel.forces import WheelFit, fit_wheel, plain_forces

METHODS = ("noise_free", "plain", "fit")
BELIEVED = ("ok", "solved")  # statuses of a fit and of a program
SPOKES = 3  # number of spokes, the first to touch, as in figure 2-11
# a touchdown in step k has steps k - BEFORE .. k + AFTER - 1: its two steps, and one on either side
BEFORE, AFTER = 1, 3
ERRORS = ("error_n", "error_t", "impulse_error_n", "impulse_error_t")


@dataclass(frozen=True)
class WheelForces:
    """Forces of successive spokes of one record by every method."""

    truth: SimulatedMotion  # the simulated motion
    pairs: tuple[int, ...]  # (≤ 3,) contact pairs in the order in which they touch
    c_n: dict[str, np.ndarray]  # c_n, c_t: method -> (m, p) in N
    c_t: dict[str, np.ndarray]
    status: dict[str, str]  # method -> outcome
    inertia: dict[str, float]  # method -> kg m²
    fit: WheelFit  # maximum-likelihood fit with standard errors


def touched_pairs(c_n: np.ndarray, count: int = SPOKES) -> tuple[int, ...]:
    """The first contact pairs that carry a force, in order of contact; `c_n` (m, p) in N."""
    carries = c_n > 0
    used = np.flatnonzero(carries.any(axis=0))
    return tuple(int(i) for i in used[np.argsort(carries[:, used].argmax(axis=0), kind="stable")][:count])


def touchdown(c_n: np.ndarray, pair: int) -> slice | None:
    """Steps of a pair's first impact, margin included; None if it is in contact from the start."""
    first = int((c_n[:, pair] > 0).argmax())
    return slice(first - BEFORE, min(first + AFTER, len(c_n))) if first >= BEFORE else None


def rolling_steps(c_n: np.ndarray) -> np.ndarray:
    """Mask (m,) of the steps in which no spoke touches down."""
    rolling = np.ones(len(c_n), dtype=bool)
    for pair in touched_pairs(c_n, c_n.shape[1]):
        impact = touchdown(c_n, pair)
        if impact is not None:
            rolling[impact] = False
    return rolling


def identify(
    q: np.ndarray, v: np.ndarray, settings: WheelStudy, bodies: Chapter2Bodies, rng: np.random.Generator
) -> WheelForces:
    """Simulate the chapter's wheel from a start q, v, (3,) each, and identify its forces by every method.

    Raises:
        UserError: the simulation did not solve a step.
    """
    made, w, h = wheel(bodies), bodies.wheel, bodies.h
    truth = simulate(made, q, v, None, h, settings.steps, w.mu, w.epsilon)
    noisy = add_noise(truth, settings.snr, rng)
    exact = plain_forces(made, h, truth.q, truth.v, w.mu)
    plain = plain_forces(made, h, noisy.q, noisy.v, w.mu, noisy.sigma)
    fit = fit_wheel(made, h, noisy.q, noisy.v, w.mu, w.epsilon)
    return WheelForces(
        truth=truth,
        pairs=touched_pairs(truth.c_n),
        c_n={"noise_free": exact.c_n, "plain": plain.c_n, "fit": fit.record.c_n},
        c_t={"noise_free": exact.c_t, "plain": plain.c_t, "fit": fit.record.c_t},
        status={"noise_free": str(exact.status), "plain": str(plain.status), "fit": str(fit.status)},
        inertia={"noise_free": exact.theta[0], "plain": plain.theta[0], "fit": fit.inertia},
        fit=fit,
    )


def force_errors(forces: WheelForces, method: str, pair: int) -> dict[str, float]:
    """Values of `ERRORS` for one spoke; the errors of the impulse are NaN without a touchdown."""
    true_n = forces.truth.c_n
    rolling, impact = rolling_steps(true_n), touchdown(true_n, pair)
    out = {}
    for name, c_hat, true in (("n", forces.c_n[method], true_n), ("t", forces.c_t[method], forces.truth.c_t)):
        c_hat, true = c_hat[:, pair], true[:, pair]
        miss = c_hat - true
        out[f"error_{name}"] = float(np.sqrt(np.sum(miss[rolling] ** 2) / np.sum(true[rolling] ** 2)))
        out[f"impulse_error_{name}"] = (
            np.nan if impact is None else float(abs(miss[impact].sum()) / abs(true[impact].sum()))
        )
    return out


def example_forces(rng: np.random.Generator, settings: WheelStudy, bodies: Chapter2Bodies) -> WheelForces:
    """Record of figure 2-11: the chapter's wheel from one start, identified by every method."""
    (q,), (v,) = releases("wheel", 1, rng, bodies)
    return identify(q, v, settings, bodies, rng)


def wheel_force_study(n: int, rng: np.random.Generator, settings: WheelStudy, bodies: Chapter2Bodies) -> pd.DataFrame:
    """Table for n starts of the wheel, a row per record, spoke and method; columns as in `columns.yaml`."""
    made, rows = wheel(bodies), []
    for i, (q, v) in enumerate(zip(*releases("wheel", n, rng, bodies))):
        forces = identify(q, v, settings, bodies, rng)
        truth, fit, rolling = forces.truth, forces.fit, rolling_steps(forces.truth.c_n)
        for order, pair in enumerate(forces.pairs):
            used = rolling & (truth.c_n[:, pair] > 0)
            covered = np.abs(fit.record.c_n - truth.c_n)[used, pair] <= 2.0 * fit.std_n[used, pair]
            for method in METHODS:
                fitted = method == "fit"
                rows.append(
                    {
                        "record": i,
                        "pair": made.pairs[pair],
                        "order": order,
                        "method": method,
                        "snr": np.inf if method == "noise_free" else settings.snr,
                        "contact_steps": int(used.sum()),
                        **force_errors(forces, method, pair),
                        "within_2_std": float(covered.mean()) if fitted else np.nan,
                        "inertia_error": forces.inertia[method] / made.inertia - 1.0,
                        "chi2_n": fit.chi2_n if fitted else np.nan,
                        "p_white": fit.p_white if fitted else np.nan,
                        "status": forces.status[method],
                    }
                )
    return pd.DataFrame(rows)


def wheel_force_table(rows: pd.DataFrame) -> pd.DataFrame:
    """Table of the median and 90 % quantile of errors over accepted records, a row per method and spoke."""
    table = []
    rows = rows.assign(method=pd.Categorical(rows["method"], METHODS))
    for (method, order), group in rows.groupby(["method", "order"], observed=True):
        used = group[group["status"].isin(BELIEVED)]
        row = {"method": method, "order": order, "n": len(used), "n_failed": len(group) - len(used)}
        for name in ERRORS:
            row[f"{name}_median"] = used[name].median()
            row[f"{name}_90"] = used[name].quantile(0.9)
        table.append(row | {"within_2_std": used["within_2_std"].mean()})
    return pd.DataFrame(table)


def motion_by_mass(settings: WheelStudy, bodies: Chapter2Bodies) -> pd.DataFrame:
    """Simulate angle and angular velocity of the wheel for several masses at the same inertia (figure 2-10).

    The motion depends on the mass only through m l² / I.

    Returns:
        Columns mass (kg), t (s), theta (rad), omega (rad/s), a row per mass and step.

    Raises:
        UserError: a motion could not be simulated.
    """
    w = bodies.wheel
    parts = []
    for mass in settings.masses:
        made = RimlessWheel(w.spokes, w.length, mass, w.inertia, w.slope, bodies.gravity)
        q, v = made.standing(0.0, settings.mass_omega)
        steps = max(1, round(settings.mass_seconds / bodies.h))
        record = simulate(made, q, v, None, bodies.h, steps, w.mu, w.epsilon)
        if not record.solved:
            raise UserError(f"The wheel of {mass} kg could not be simulated for {settings.mass_seconds} s; shorten it.")
        parts.append(pd.DataFrame({"mass": mass, "t": record.t, "theta": record.q[:, 2], "omega": record.v[:, 2]}))
    return pd.concat(parts, ignore_index=True)


def mass_summary(settings: WheelStudy, bodies: Chapter2Bodies) -> pd.DataFrame:
    """Effect of the mass on the motion (`motion_by_mass`), and discretisation error of the simulation.

    Returns:
        A row each for the high and low friction of figure 2-9 c: friction; apart (rad), the largest difference of two
        final angles; step_error (rad), the largest change of a final angle if the step is halved.

    Raises:
        UserError: a motion could not be simulated.
    """
    rows = []
    for friction, mu in (("high", bodies.wheel.mu), ("low", bodies.wheel.mu_low)):
        of_friction = bodies.model_copy(update={"wheel": bodies.wheel.model_copy(update={"mu": mu})})
        finer = of_friction.model_copy(update={"h": 0.5 * bodies.h})
        last, exact = (motion_by_mass(settings, each).groupby("mass")["theta"].last() for each in (of_friction, finer))
        rows.append((friction, np.ptp(last), (exact - last).abs().max()))
    return pd.DataFrame(rows, columns=["friction", "apart", "step_error"])
