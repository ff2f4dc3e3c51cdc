"""The programs recover what was simulated, agree with their convex forms, and say so when they cannot."""

from dataclasses import replace
from typing import get_args

import numpy as np
import pytest

from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.mechanisms.motions import block
from thesis_lib.simulate.mechanisms.noise_snr import add_noise
from thesis_lib.simulate.stepping.stepping import simulate
from thesis_lib.thesis.identify.base_parameters.projection import project_to_contact
from thesis_lib.thesis.identify.base_parameters.window import ContactWindow, States, free_body_window
from thesis_lib.thesis.identify.programs import nonlinear
from thesis_lib.thesis.identify.programs.mode_qp import Program, edges_of, solve_mode_qp
from thesis_lib.thesis.identify.programs.nonlinear import ContactProgram
from thesis_lib.thesis.identify.programs.result import SolveStatus, judged
from thesis_lib.thesis.identify.programs.study import SUCCESS, ProgramRun, TrueWindow, cases, study

PROGRAMS = get_args(Program)
CONVEX_AGREEMENT = 1e-6  # relative, of costs: SNOPT stops at 1e-10 of feasibility, which a cost can multiply
STARTS = 4


@pytest.fixture(scope="module")
def drops() -> list[TrueWindow]:
    return cases("block", 30, 3, np.random.default_rng(0))


@pytest.fixture(scope="module")
def noisy() -> ContactWindow:
    """A window that no parameters explain exactly, with gaps and slips that are a little off."""
    case = cases("ellipse", 40, 1, np.random.default_rng(4))[0]
    rng = np.random.default_rng(1)
    window = case.window
    Y = window.Y * (1.0 + 0.05 * rng.normal(size=window.Y.shape))
    f = window.f + 0.01 * window.force_scale * rng.normal(size=window.f.shape)
    return replace(window, Y=Y, f=f)


@pytest.mark.parametrize("program", PROGRAMS)
def test_every_program_recovers_inertia_and_forces_from_random_starts(drops: list[TrueWindow], program: str) -> None:
    row = study(ProgramRun(program, "snopt"), "block", drops, STARTS, np.random.default_rng(1))
    assert row["n_success"] == row["n_starts"] == 3 * STARTS
    assert row["n_false_claims"] == 0


@pytest.mark.parametrize("kind", ["block", "ellipse", "wheel"])
@pytest.mark.parametrize("n_steps", [10, 100, 300])
def test_equation_2_14_succeeds_at_every_length(kind: str, n_steps: int) -> None:
    windows = cases(kind, n_steps, 2, np.random.default_rng(n_steps))
    row = study(ProgramRun("2.14", "snopt"), kind, windows, 3, np.random.default_rng(2))
    assert row["n_success"] == 6, row


def test_ipopt_cross_checks_snopt(drops: list[TrueWindow]) -> None:
    for case in drops:
        program = ContactProgram(case.window, "2.14")
        found = program.answer(program.random_point(np.random.default_rng(3)), "ipopt")
        assert found.solver == "ipopt" and found.solved
        assert max(case.errors(found)) < SUCCESS


def test_arm_and_disk_give_six_base_parameters_and_both_forces() -> None:
    case = cases("arm_disk", 100, 1, np.random.default_rng(5))[0]
    assert len(case.theta) == 6
    program = ContactProgram(case.window, "2.14")
    nonlinear = program.answer(program.random_point(np.random.default_rng(0)), "snopt")
    for found in (solve_mode_qp(case.window), nonlinear):
        assert found.solved and max(case.errors(found)) < SUCCESS


@pytest.mark.parametrize("program", PROGRAMS)
def test_convex_form_is_the_programs_global_minimum(noisy: ContactWindow, program: str) -> None:
    """On data that nothing fits exactly, no start of the nonlinear program ends below its convex form."""
    window = noisy
    if program == "2.14":
        # hard dynamics need data that fit: a gap that is a little open keeps the cost above zero
        exact = cases("ellipse", 40, 1, np.random.default_rng(4))[0].window
        window = replace(exact, gap=exact.gap + np.where(exact.gap == 0.0, 0.01, 0.0))
    convex = solve_mode_qp(window, program, dynamics_tolerance=1.0)
    nlp = ContactProgram(window, program)
    rng = np.random.default_rng(0)
    costs = [nlp.answer(nlp.random_point(rng), "snopt").cost for _ in range(STARTS)]
    assert convex.cost > 1e-6 and (convex.solver == "clarabel" or program == "2.12")
    assert min(costs) == pytest.approx(convex.cost, rel=1e-4)
    assert min(costs) > convex.cost * (1.0 - CONVEX_AGREEMENT)


def test_edges_are_priced_by_the_complementarity_they_break(drops: list[TrueWindow]) -> None:
    window = drops[0].window
    k, i = np.argwhere(window.touching)[0]
    slides = window.v_t.copy()
    slides[k, i] = 0.5
    window = replace(window, v_t=slides)
    free = edges_of(window, "2.12")
    here = (free.step == k) & (free.pair == i)
    assert free.sign[here].tolist() == [-1.0]  # friction against the slip to the right
    every = edges_of(window, "2.14")
    here = (every.step == k) & (every.pair == i)
    assert every.price[here & (every.sign > 0)][0] > 0.0


def test_a_solvers_word_does_not_count_without_residuals(drops: list[TrueWindow]) -> None:
    window, theta, c_n, c_t = drops[0].window, drops[0].theta, drops[0].c_n, drops[0].c_t
    far = np.where(window.gap > 0.01, 1e-3 * window.force_scale, c_n)
    for answer, status in (
        ((theta, c_n, c_t), SolveStatus.SOLVED),
        ((1.5 * theta, c_n, c_t), SolveStatus.DYNAMICS_VIOLATED),
        ((theta, far, c_t), SolveStatus.NOT_COMPLEMENTARY),
        ((theta, c_n, 2.0 * window.mu * c_n), SolveStatus.NOT_COMPLEMENTARY),  # outside the cone
        ((theta, -c_n, c_t), SolveStatus.NOT_COMPLEMENTARY),  # pulling
        ((theta * np.nan, c_n, c_t), SolveStatus.SOLVER_FAILED),
    ):
        found = judged(window, "x", True, *answer, 0.0)
        assert found.status is status and found.claimed


def test_projection_makes_the_manifold_exact_and_strict_programs_usable() -> None:
    """With noise eq. 2.12 admits no force at all; on projected poses it does (treatment 3)."""
    body, mu = block(), 0.7
    record = simulate(body, [0.0, 1.2, 0.4], [0.3, 0.0, 2.0], None, 5e-3, 120, mu, 0.6)
    noisy = add_noise(record, 50.0, np.random.default_rng(0))
    measured = States.of(body, record.h, noisy.q, noisy.v, record.f_ext)
    moved = project_to_contact(measured, body, gap_tolerance=0.01, v_tolerance=0.05, metric=np.ones(3))
    assert moved.closed.any() and np.abs(moved.phi[moved.closed]).max() < 1e-10
    assert np.linalg.norm(moved.q - noisy.q, axis=1).max() < 0.2
    window = moved.touching(free_body_window(moved, mu, body)).fix({"m": 1.0})
    impact = record.c_n.argmax()
    found = solve_mode_qp(window, dynamics_tolerance=1.0)
    assert found.complementarity < 1e-8
    assert found.c_n.ravel()[impact] == pytest.approx(record.c_n.ravel()[impact], rel=0.2)


def test_nan_in_the_data_is_said_with_its_step() -> None:
    record = simulate(block(), [0.0, 1.2, 0.4], [0.3, 0.0, 2.0], None, 5e-3, 100, 0.7, 0.6)
    v = record.v.copy()
    v[50, 1] = np.nan
    with pytest.raises(UserError, match="not finite at step 49 of the window"):
        free_body_window(replace(record, v=v), 0.7, block())


def test_ipopt_is_not_asked_for_more_equations_than_unknowns(monkeypatch: pytest.MonkeyPatch) -> None:
    """It may end the process: arm and disk with one contact a step, 5 equations for 4 unknowns and few parameters."""
    case = cases("arm_disk", 100, 1, np.random.default_rng(5))[0]
    single = (case.window.gap <= 0.0).sum(axis=1) == 1
    runs = np.flatnonzero(np.convolve(single, np.ones(10), mode="valid") == 10)
    window = case.window[int(runs[0]) : int(runs[0]) + 10]
    monkeypatch.setattr(nonlinear, "REACH", 0.0)
    nlp = ContactProgram(window, "2.14")
    point = nlp.random_point(np.random.default_rng(0))
    found = nlp.answer(point, "ipopt")
    assert not found.claimed and not found.solved and np.isnan(found.theta).all()
    assert np.isfinite(nlp.answer(point, "snopt").theta).all()


def test_wrong_arguments_are_said(drops: list[TrueWindow]) -> None:
    window = drops[0].window
    with pytest.raises(UserError, match="no parameter"):
        window.fix({"mass": 1.0})
    with pytest.raises(UserError, match="windows are available for"):
        cases("sphere", 10, 1, np.random.default_rng(0))
