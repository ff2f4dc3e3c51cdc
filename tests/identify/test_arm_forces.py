"""Arm and disk: closed-form dynamics against Drake, the batched stepper against the simulator, recovery from noise."""

import numpy as np
import pytest

from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.mechanisms.motions import DEFAULT, arm_disk, arm_trajectories
from thesis_lib.simulate.mechanisms.noise_snr import add_noise
from thesis_lib.simulate.mechanisms.regressor import PlantRegressor
from thesis_lib.simulate.stepping.stepping import SimulatedMotion, simulate
from thesis_lib.thesis.identify.arm.fit import fit
from thesis_lib.thesis.identify.arm.parameters import (
    NAMES,
    ArmPrior,
    base_of,
    free_coordinates,
    from_free,
    from_free_jacobian,
    positive_definite,
    regressor,
)
from thesis_lib.thesis.identify.arm.settings import ArmFitSettings, ArmStudy
from thesis_lib.thesis.identify.arm.shooting import (
    Candidates,
    Shooting,
    _arrow_step,
    equal_segments,
    measured,
    noise_level,
    noise_of_residuals,
)
from thesis_lib.thesis.identify.arm.stepping import simulate_copies
from thesis_lib.thesis.identify.arm.study import (
    arm_force_study,
    arm_force_summary,
    arm_window,
    force_errors,
    window_rank,
)
from thesis_lib.thesis.identify.programs.mode_qp import solve_mode_qp

MU = 0.4
ROUNDING = 1e-9  # relative; over 240 steps of contact rounding errors grow by up to a million
ARM = arm_disk()
L1 = float(ARM.link_lengths[0])


@pytest.fixture(scope="module")
def records() -> tuple[SimulatedMotion, ...]:
    return arm_trajectories(3, np.random.default_rng(5)).records


def test_regressor_equals_that_of_drake(rng):
    q, v, a = rng.standard_normal((3, 20, 5))
    full = PlantRegressor(ARM.plant, ("link_1", "link_2", "disk"))(q, v, a)
    m, c, inertia = ARM.link_masses, ARM.link_coms[:, 0], ARM.link_inertias
    parameters = []
    for i in range(2):
        parameters += [m[i], m[i] * c[i], 0.0, inertia[i] + m[i] * c[i] ** 2]
    parameters += [ARM.disk_mass, 0.0, 0.0, ARM.disk_inertia]
    np.testing.assert_allclose(regressor(ARM, q, v, a) @ base_of(ARM), full @ parameters, atol=1e-11)


def test_free_coordinates_give_every_positive_definite_mass_matrix_and_no_other(rng):
    xi = rng.standard_normal((200, 6))
    theta = from_free(xi, L1)
    assert positive_definite(theta, L1).all()
    np.testing.assert_allclose(free_coordinates(theta, L1), xi, atol=1e-8)
    # the definition: M at random configurations has positive eigenvalues
    for b in theta[:50]:
        for q2 in np.linspace(0.0, np.pi, 7):
            M12 = b[3] + L1 * b[2] * np.cos(q2)
            M = np.array([[b[1] + b[3] + 2.0 * L1 * b[2] * np.cos(q2), M12], [M12, b[3]]])
            assert np.linalg.eigvalsh(M).min() > 0.0
    with pytest.raises(UserError, match="positive definite"):
        free_coordinates(np.array([1.0, 0.1, 2.0, 0.1, 1.0, 1.0]), L1)


def test_jacobian_of_free_coordinates(rng):
    xi, step = rng.standard_normal(6), 1e-6
    moved = xi + step * np.concatenate([np.eye(6), -np.eye(6)])
    theta = from_free(moved, L1)
    np.testing.assert_allclose(
        from_free_jacobian(xi, L1), ((theta[:6] - theta[6:]) / (2 * step)).T, atol=1e-8, rtol=1e-6
    )


def test_prior_is_physical_and_wide(rng):
    theta = ArmPrior().draw(500, ARM, rng)
    assert positive_definite(theta, L1).all()
    ratio = np.quantile(theta, 0.95, axis=0) / np.quantile(theta, 0.05, axis=0)
    assert (ratio > 15.0).all()  # blind: more than an order of magnitude


@pytest.mark.parametrize(("epsilon", "steps"), [(0.0, 240), (0.5, 80)])
def test_copies_equal_the_simulator(records, epsilon, steps):
    for record in records:
        f_ext = record.f_ext[:steps]
        true = simulate(ARM, record.q[0], record.v[0], f_ext, record.h, len(f_ext), MU, epsilon)
        out = simulate_copies(ARM, base_of(ARM)[None], record.q[:1], record.v[:1], f_ext, record.h, MU, epsilon)
        np.testing.assert_allclose(out.q[0], true.q, atol=ROUNDING)
        np.testing.assert_allclose(out.v[0], true.v, atol=ROUNDING * 100)
        np.testing.assert_allclose(out.c_n[0], true.c_n, atol=1e-6)
        np.testing.assert_allclose(out.c_t[0], true.c_t, atol=1e-6)


def test_copies_do_not_disturb_each_other(records, rng):
    record = records[0]
    theta = np.concatenate([base_of(ARM)[None], ArmPrior().draw(5, ARM, rng)])
    q, v = np.tile(record.q[:1], (6, 1)), np.tile(record.v[:1], (6, 1))
    together = simulate_copies(ARM, theta, q, v, record.f_ext, record.h, MU, 0.0)
    for i in (0, 3):
        alone = simulate_copies(ARM, theta[i : i + 1], q[:1], v[:1], record.f_ext[:120], record.h, MU, 0.0)
        np.testing.assert_allclose(together.q[i, :121], alone.q[0], atol=ROUNDING)


def test_forces_and_parameters_without_noise(records):
    for record in records:
        window = arm_window(ARM, record, MU)
        assert window_rank(window) == 6
        found = solve_mode_qp(window, "2.12")
        np.testing.assert_allclose(found.theta, base_of(ARM), rtol=1e-8)
        for j in range(2):
            errors = force_errors((record.c_n[:, j], record.c_t[:, j]), (found.c_n[:, j], found.c_t[:, j]))
            assert max(errors["force_error"], errors["impact_error"]) < 1e-4  # the target; 1e-10 is found


def test_a_disk_in_flight_has_no_identifiable_inertia(records):
    record = records[0]
    flight = int(np.argmax(record.c_n.any(axis=1)))
    assert window_rank(arm_window(ARM, record.window(0, flight), MU)) < 6


def test_noise_level_is_found_before_anything_is_known(records, rng):
    ratios = []
    for record in records:
        noisy = add_noise(record, 40.0, rng)
        ratios.append(noise_level(noisy.q, noisy.v, record.h) / noisy.sigma)
    assert np.abs(np.mean(ratios, axis=(0, 2)) - 1.0).max() < 0.2
    white = rng.standard_normal((2000, 3))
    np.testing.assert_allclose(noise_of_residuals(white), 1.0, atol=0.08)
    # neither an impact a step late nor what lasts counts as noise
    late = white.copy()
    late[500] += 100.0
    np.testing.assert_allclose(noise_of_residuals(late), 1.0, atol=0.08)
    np.testing.assert_allclose(noise_of_residuals(white + 5.0 * np.sin(np.arange(2000) / 50)[:, None]), 1.0, atol=0.1)


def test_arrow_elimination_equals_the_full_normal_equations(records, rng):
    record = records[0]
    noisy = add_noise(record, 40.0, rng)
    shooting = Shooting(ARM, measured(noisy.q, noisy.v, record.f_ext, record.h, MU))
    stage = ((0, 8), (8, 16))
    p = free_coordinates(base_of(ARM), L1)[None] + 0.05
    x = shooting.z[[0, 8]][None]
    r, J = shooting.differences(stage, p, x)
    H, g = np.matmul(J[0], J[0].transpose(0, 2, 1)), np.matmul(J[0], r[0][..., None])[..., 0]
    dp, dx = _arrow_step(H, g, 0.1)
    full = np.zeros((26, 26))
    rhs = np.zeros(26)
    for s in range(2):
        at = np.r_[10 * s : 10 * s + 10, 20:26]
        full[np.ix_(at, at)] += H[s]
        rhs[at] += g[s]
    full += 0.1 * np.diag(np.diag(full))
    expected = -np.linalg.lstsq(full, rhs, rcond=None)[0]
    reached = full @ np.concatenate([dx.ravel(), dp]) + rhs
    assert np.linalg.norm(reached) < 1e-6 * np.linalg.norm(rhs)
    np.testing.assert_allclose(dx.ravel(), expected[:20], rtol=1e-3, atol=1e-8)


def test_short_segments_draw_a_blind_start_near_the_truth(records, rng):
    record = records[1]
    noisy = add_noise(record, 50.0, rng)
    shooting = Shooting(ARM, measured(noisy.q, noisy.v, record.f_ext, record.h, MU))
    stage = equal_segments(record.steps, 10)
    p = free_coordinates(2.0 * base_of(ARM), L1)[None]
    x = shooting.z[[start for start, _ in stage]][None]
    found = shooting.minimise(stage, Candidates(p, x, np.full(1, np.inf)), 20)
    assert np.abs(from_free(found.p[0], L1) / base_of(ARM) - 1.0).max() < 0.3


def test_force_errors_count_an_impact_that_comes_a_step_late_as_an_impact():
    true = np.ones(60)
    true[20] = 100.0
    late = np.ones(60)
    late[21] = 100.0
    nothing = np.zeros(60)
    errors = force_errors((true, nothing), (late, nothing))
    assert errors["force_error"] == 0.0 and errors["impact_error"] > 1.0
    assert (errors["n_contact"], errors["n_impact"]) == (60, 1)
    errors = force_errors((true, nothing), (1.1 * true, nothing))
    assert all(errors[f"{kind}_error"] == pytest.approx(0.1) for kind in ("force", "impact"))


def test_bad_data_are_refused(records):
    record = records[0]
    q = record.q.copy()
    q[3, 1] = np.nan
    with pytest.raises(UserError, match="NaN"):
        measured(q, record.v, record.f_ext, record.h, MU)
    with pytest.raises(UserError, match="m\\+1, 5"):
        measured(record.q[:-1], record.v, record.f_ext, record.h, MU)
    with pytest.raises(UserError, match="no noise"):
        still = np.zeros((31, 5))
        measured(still, still, np.zeros((30, 5)), record.h, MU)


@pytest.mark.slow
def test_forces_and_parameters_at_40_db_from_blind_starts():
    tables = arm_force_study(np.random.default_rng(11), ArmStudy(trajectories=2), DEFAULT)
    summary = arm_force_summary(tables.forces, tables.parameters).set_index(["quantity", "method"])
    ours = summary.xs("ours", level="method")
    assert (ours["error_median"] <= 0.05).all()  # the target
    plain = summary.xs("plain", level="method")
    assert (plain.loc[["arm_force", "ground_force"], "error_median"] > 0.1).all()  # which the thesis's way misses
    z = [(one.fit.theta - base_of(ARM)) / one.fit.std[: len(NAMES)] for one in tables.trajectories if one.fit.accepted]
    assert 0.3 < np.sqrt(np.mean(np.square(z))) < 3.0  # standard errors of the right size


@pytest.mark.slow
def test_gate_refuses_a_model_that_lacks_a_force(records):
    """Viscous friction in the joints: without it no fit passes."""
    rng = np.random.default_rng(3)
    first = records[0]
    joints = np.array([1.0, 1.0, 0.0, 0.0, 0.0])
    record = simulate(
        ARM, first.q[0], first.v[0], first.f_ext, first.h, first.steps, MU, 0.0,
        hidden=lambda t, q, v: -0.2 * v * joints,
    )  # fmt: skip
    noisy = add_noise(record, 50.0, rng)
    data = measured(noisy.q, noisy.v, record.f_ext, record.h, MU)
    assert not fit(ARM, data, rng, ArmFitSettings(attempts=1, rounds=2)).accepted
