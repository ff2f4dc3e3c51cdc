"""Success rates of the identification programs on noise-free windows, from random starts (thesis 2.3.2 and 2.4).

For each program, mechanism and window length (`n_steps`), windows around the first impact of several simulated motions
are identified from random starts (`nonlinear.ContactProgram.random_point`).  A start succeeds if its residuals are
below tolerance and

    |Θ_j/Θ_j,true − 1| <= 1e-6 for every parameter,        ‖c − c_true‖ <= 1e-6 ‖c_true‖ over the window,

independently of the solver's report; `n_false_claims` counts false reports of success.  Block, ellipse and wheel
have known mass and unknown I (hence m/I); arm and disk are driven by known torques, and all their base parameters are
unknown.
"""

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import get_args

import numpy as np
import pandas as pd

from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.randomness import streams
from thesis_lib.simulate.mechanisms.base_parameters import base_parameters
from thesis_lib.simulate.mechanisms.motions import BODIES, DEFAULT, Chapter2Bodies, arm_disk, arm_trajectories, releases
from thesis_lib.simulate.mechanisms.regressor import PlantRegressor
from thesis_lib.simulate.stepping.stepping import SimulatedMotion, simulate
from thesis_lib.thesis.identify.base_parameters.identifiability import require_identifiable
from thesis_lib.thesis.identify.base_parameters.window import ALLOWANCE, ContactWindow, free_body_window, window_of
from thesis_lib.thesis.identify.programs.mode_qp import Program, solve_mode_qp
from thesis_lib.thesis.identify.programs.nonlinear import ContactProgram, Products
from thesis_lib.thesis.identify.programs.result import ProgramResult
from thesis_lib.thesis.identify.settings import Mechanism, Programs

SUCCESS = 1e-6  # largest relative error of parameters and forces
# with 0.4 the disk hardly ever slides on the ground, and rolling depends only on the sum m + I/R² of its parameters
ARM_MU = 0.2
ARM_BODIES = ("link_1", "link_2", "disk")


@dataclass(frozen=True)
class TrueWindow:
    """A window with its true values: `theta` (n_Θ,), `c_n` and `c_t` (m, p) in N."""

    window: ContactWindow
    theta: np.ndarray
    c_n: np.ndarray
    c_t: np.ndarray

    def __getitem__(self, steps: slice) -> "TrueWindow":
        return TrueWindow(self.window[steps], self.theta, self.c_n[steps], self.c_t[steps])

    def errors(self, found: ProgramResult) -> tuple[float, float]:
        """Largest relative error of the parameters, and relative rms error of the forces."""
        theta = float(np.max(np.abs(found.theta / self.theta - 1.0)))
        true, c = np.stack([self.c_n, self.c_t]), np.stack([found.c_n, found.c_t])
        return theta, float(np.linalg.norm(c - true) / np.linalg.norm(true))


def cases(
    kind: str, n_steps: int, n: int, rng: np.random.Generator, settings: Chapter2Bodies = DEFAULT
) -> list[TrueWindow]:
    """Simulate motions and return n noise-free, identifiable windows of n_steps around the first impact.

    `kind` is "block", "ellipse", "wheel" or "arm_disk".

    Raises:
        UserError: the kind is unknown, or hardly any window of that length identifies its parameters.
    """
    kinds = get_args(Mechanism)
    if kind not in kinds:
        raise UserError(f"windows are available for {', '.join(kinds)}; got {kind!r}")
    if kind == "arm_disk":
        arm = settings.arm.model_copy(update={"mu": ARM_MU, "steps": max(settings.arm.steps, n_steps)})
        settings = settings.model_copy(update={"arm": arm})
    windows: list[TrueWindow] = []
    refused = ""
    for tried, record in enumerate(_motions(kind, n_steps, rng, settings)):
        if tried >= 5 * n + 20:
            raise UserError(f"only {len(windows)} of {tried} windows of {n_steps} steps can be identified; {refused}")
        contact = np.flatnonzero(record.c_n.any(axis=1))
        if not (record.solved and len(contact)):
            continue
        motion = _whole(kind, record, settings)
        # around the first impact; for the arm, any window with contact: few short windows determine all parameters
        middles = contact[:: max(n_steps // 4, 1)] if kind == "arm_disk" else contact[:1]
        for middle in middles:
            start = int(np.clip(middle - n_steps // 2, 0, record.steps - n_steps))
            case = motion[start : start + n_steps]
            try:
                require_identifiable(case.window)
            except UserError as error:
                refused = str(error)
                continue
            windows.append(case)
            break
        if len(windows) == n:
            break
    return windows


def _motions(kind: str, n_steps: int, rng: np.random.Generator, settings: Chapter2Bodies) -> Iterator[SimulatedMotion]:
    surface = settings.wheel if kind == "wheel" else settings
    steps = max(settings.steps, n_steps)
    while True:
        if kind == "arm_disk":
            yield arm_trajectories(1, rng, settings).records[0]
        else:
            (q,), (v,) = releases(kind, 1, rng, settings)
            yield simulate(BODIES[kind](settings), q, v, None, settings.h, steps, surface.mu, surface.epsilon)


def _whole(kind: str, record: SimulatedMotion, settings: Chapter2Bodies) -> TrueWindow:
    """Case of the whole motion, from which windows are cut."""
    if kind == "arm_disk":
        window, theta = _arm_window(record, settings)
        return TrueWindow(window, theta, record.c_n, record.c_t)
    body = BODIES[kind](settings)
    mu = settings.wheel.mu if kind == "wheel" else settings.mu
    window = free_body_window(record, mu, body).fix({"m": body.mass})
    return TrueWindow(window, np.array([body.inertia]), record.c_n, record.c_t)


def _arm_window(record: SimulatedMotion, settings: Chapter2Bodies) -> tuple[ContactWindow, np.ndarray]:
    """Window of arm and disk in the base parameters of the motion, and their true values."""
    arm = arm_disk(settings)
    regressor = PlantRegressor(arm.plant, ARM_BODIES)
    Y = regressor(record.q[:-1], record.v[:-1], np.diff(record.v, axis=0) / record.h)
    truth = []
    for mass, com, inertia in zip(arm.link_masses, arm.link_coms, arm.link_inertias):
        truth += [mass, *(mass * com), inertia + mass * (com @ com)]
    truth += [arm.disk_mass, 0.0, 0.0, arm.disk_inertia]
    # centres of mass are known to lie on the link's axis and in the disk's centre
    used = [i for i, value in enumerate(truth) if value != 0.0]
    names = [regressor.names[i] for i in used]
    base = base_parameters(Y[:, :, used], names)
    window = window_of(
        record,
        base.reduce(Y[:, :, used]),
        np.zeros(5),
        settings.arm.mu,
        base.base_names,
        theta_min=np.full(base.rank, -np.inf),
        gap_tolerance=ALLOWANCE * record.h**2,
    )
    return window, base.theta(np.array(truth)[used])


@dataclass(frozen=True)
class ProgramRun:
    """A program and its solver ("snopt", "ipopt" or "mode_qp", which needs no start)."""

    program: Program
    solver: str
    products: Products = "relaxed"


STUDIES = {
    "qp": ProgramRun("2.12", "mode_qp"),
    "2.14": ProgramRun("2.14", "snopt"),
    "2.14 ipopt": ProgramRun("2.14", "ipopt"),
    "2.14 soft": ProgramRun("2.14 soft", "snopt"),
    "2.13": ProgramRun("2.13", "snopt"),
    "2.12": ProgramRun("2.12", "snopt"),
    "2.12 strict": ProgramRun("2.12", "snopt", "strict"),
}
MAIN = ("qp", "2.14", "2.14 ipopt")


def study(
    what: ProgramRun, kind: str, windows: Sequence[TrueWindow], starts: int, rng: np.random.Generator
) -> dict[str, float | str]:
    """Row of the table: successes, errors and CPU seconds of a program over windows and starts."""
    runs = []
    for case in windows:
        begin = time.process_time()
        for result in _answers(what, case.window, starts, rng):
            cpu_s = time.process_time() - begin
            errors = np.nan_to_num(case.errors(result), nan=np.inf)  # without a result, errors count as infinite
            success = result.solved and bool((errors <= SUCCESS).all())
            runs.append((result.solved, success, result.claimed, result.claimed and not success, *errors, cpu_s))
            begin = time.process_time()
    *counts, theta, force, cpu = np.array(runs, dtype=float).T
    names = ("n_solved", "n_success", "n_claims", "n_false_claims")
    measures = {"theta_error": theta, "force_error": force, "cpu_s": cpu}
    return {
        "program": what.program,
        "solver": what.solver,
        "products": what.products if what.program in ("2.12", "2.13") and what.solver != "mode_qp" else "",
        "mechanism": kind,
        "n_steps": len(windows[0].window),
        "n_windows": len(windows),
        "n_starts": len(runs),
        **{name: int(flags.sum()) for name, flags in zip(names, counts)},
        **{f"{name}_{of.__name__}": float(of(x)) for name, x in measures.items() for of in (np.median, np.max)},
    }


def _answers(what: ProgramRun, window: ContactWindow, starts: int, rng: np.random.Generator) -> Iterator[ProgramResult]:
    if what.solver == "mode_qp":
        yield solve_mode_qp(window, what.program)
        return
    for _ in range(starts):
        nlp = ContactProgram(window, what.program, products=what.products)
        yield nlp.answer(nlp.random_point(rng), what.solver)


def programs_table(settings: Programs, rng: np.random.Generator, bodies: Chapter2Bodies = DEFAULT) -> pd.DataFrame:
    """Table of `study` for every program, mechanism and window length; the windows of one length are the same.

    CPU seconds differ between runs and are left to `python -m benchmarks.programs`.
    """
    others = [name for name in STUDIES if name not in MAIN]
    rows, stream = [], streams(rng)
    for kind in settings.mechanisms:
        for names, lengths, n_windows, n_starts in (
            (MAIN, settings.lengths, settings.windows, settings.starts),
            (others, settings.others_lengths, settings.others_windows, settings.others_starts),
        ):
            for length in lengths:
                windows = cases(kind, length, n_windows, stream(kind, length, "windows"), bodies)
                for name in names:
                    row = study(STUDIES[name], kind, windows, n_starts, stream(kind, length, name))
                    rows.append({"name": name, **row})
                    print(f"{kind}, {length} steps, {name}: {row['n_success']} of {row['n_starts']}")
    return pd.DataFrame(rows).drop(columns=["cpu_s_median", "cpu_s_max"])
