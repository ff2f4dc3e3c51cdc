"""Regressors against Drake, the arm's base parameters against the textbook, and what contact lets a body identify."""

import numpy as np
import pytest

from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.mechanisms.base_parameters import base_parameters, linear_combination
from thesis_lib.simulate.mechanisms.motions import arm_disk, disk
from thesis_lib.simulate.mechanisms.regressor import PlantRegressor, free_body_regressor
from thesis_lib.simulate.mechanisms.scenes import Mode, contact_modes
from thesis_lib.simulate.stepping.arm_disk import ArmDisk
from thesis_lib.thesis.identify.base_parameters.excitation_table import excitation_cases, excitation_table
from thesis_lib.thesis.identify.base_parameters.identifiability import (
    identifiability,
    projected,
    require_identifiable,
    sliding_regressor,
)

LENGTH = 0.8
ROUNDING = 1e-10  # N, N m: sums of a few terms of at most 1e3


def arm_regressor(gravity: float) -> tuple[np.ndarray, tuple[str, ...]]:
    arm = ArmDisk((LENGTH, 0.7), (1.0, 0.9), (0.3, 0.4), (0.06, 0.05), 0.25, 1.0, 0.04, gravity)
    regressor = PlantRegressor(arm.plant, ("link_1", "link_2"))
    rng = np.random.default_rng(0)
    return regressor(*(rng.normal(size=(40, 5)) for _ in range(3)))[:, :2], regressor.names


@pytest.mark.parametrize(("gravity", "rank"), [(9.81, 6), (0.0, 4)])
def test_two_link_arm_has_the_textbooks_base_set(gravity: float, rank: int) -> None:
    """With gravity m c of link 1 counts too; without, I_1 + l² m_2, m_2 c_2 (x, y) and I_2 remain."""
    Y, names = arm_regressor(gravity)
    base = base_parameters(Y, names)
    assert base.rank == rank
    assert f"link_1.I + {LENGTH**2:.4g} link_2.m" in base.base_names
    assert (f"link_1.mc_x + {LENGTH:.4g} link_2.m" in base.base_names) == (gravity > 0.0)
    unseen = [linear_combination(direction, names) for direction in base.null_space.T]
    assert "link_1.m" in unseen  # the first link turns about a fixed joint: its mass never shows


def test_base_parameters_predict_what_all_parameters_predict() -> None:
    Y, names = arm_regressor(9.81)
    base = base_parameters(Y, names)
    parameters = np.random.default_rng(1).normal(size=len(names))
    assert np.abs(base.reduce(Y) @ base.theta(parameters) - Y @ parameters).max() < 1e-9
    assert np.abs(Y @ base.null_space).max() < 1e-9
    # a parameter left out of the combination would be noticed
    assert np.abs(base.reduce(Y) @ parameters[base.columns] - Y @ parameters).max() > 0.1


def test_nothing_that_moves_and_nan_are_refused() -> None:
    with pytest.raises(UserError, match="no excitation"):
        base_parameters(np.zeros((3, 2, 2)), ("m", "I"))
    with pytest.raises(UserError, match="not finite"):
        base_parameters(np.full((3, 2, 2), np.nan), ("m", "I"))


def test_combinations_read_as_sums() -> None:
    assert linear_combination(np.array([0.25, 0.0, 1.0]), ("a", "b", "c")) == "c + 0.25 a"
    assert linear_combination(np.array([-1.0, 2.0]), ("a", "b")) == "-a + 2 b"
    assert linear_combination(np.zeros(2), ("a", "b")) == "0"


def test_section_2_3_3_in_singular_values() -> None:
    table = excitation_table().set_index("case")
    # with external force mass and inertia are both identified, sliding, in flight, and from an impact
    assert (table.loc[["disk slides, force", "flight, force", "square lands tilted, force"], "rank"] == 2).all()
    # without it only their ratio, and eq. 2.18 has its first column left
    assert (table.loc[["disk slides, no force", "square lands tilted, no force"], "rank"] == 1).all()
    assert table.loc["disk slides, no force", "eq_2_18_rank"] == 1
    # 1/m and 1/I come in with force; the column of m/I² vanishes identically, so never four
    assert table.loc["disk slides, force", "eq_2_18_rank"] == 3
    # contact that sticks gives the same as contact that slides, if a corner is pivoted about
    assert table.loc[["square pivots, no force", "square pivots, force"], "rank"].tolist() == [1, 2]
    # figure 2-5, left: like a point
    assert table.loc["square lands flat, no force", "rank"] == 0
    radius = disk().shape.radius
    # a rolling disk shows m + I/R² only: m may grow while I falls by R²
    assert table.loc["disk rolls, force", "not_identified"] == f"m - {radius**2:.4g} I"


@pytest.mark.parametrize("case", ["square pivots, no force", "square pivots, force"])
def test_the_square_that_pivots_sticks_on_one_corner(case: str) -> None:
    record, _ = excitation_cases()[case]
    modes = contact_modes(record)
    assert record.solved and (modes == Mode.SLIDES).sum() == 0
    assert ((modes == Mode.STICKS).sum(axis=1) == 1).all() and np.ptp(record.q[:, 2]) > 0.05


def test_equation_2_18_holds_on_a_sliding_motion() -> None:
    record, window = excitation_cases()["disk slides, force"]
    body = disk()
    Y, left = sliding_regressor(record, window.mu, 9.81)
    ratio = body.mass / body.inertia
    error = Y @ [ratio, 1.0 / body.mass, 1.0 / body.inertia, ratio / body.inertia] - left
    assert np.abs(error).max() < 1e-12
    assert np.abs(left).max() > 1e-3


def test_projection_removes_exactly_the_contact_forces() -> None:
    window = excitation_cases()["disk slides, force"][1]
    Y, f = projected(window)
    body = disk()
    assert np.abs(Y @ [body.mass, body.inertia] - f).max() < 1e-10
    assert np.abs(window.Y @ [body.mass, body.inertia] - window.f).max() > 1.0


@pytest.mark.parametrize(
    ("case", "reason"),
    [
        ("flight, no force", "no contact and no known force"),
        ("disk slides, no force", "up to a common factor"),
        ("disk rolls, force", "every contact of the window sticks"),
    ],
)
def test_a_window_that_cannot_identify_says_why(case: str, reason: str) -> None:
    window = excitation_cases()[case][1]
    with pytest.raises(UserError, match=reason):
        require_identifiable(window)
    assert len(identifiability(window).warnings) == 1


def states(rng: np.random.Generator, n: int, nv: int) -> tuple[np.ndarray, ...]:
    return tuple(rng.normal(size=(n, nv)) for _ in range(3))


@pytest.mark.parametrize("inertia", [0.05, 0.15])
def test_arm_regressor_times_parameters_is_inverse_dynamics(inertia: float) -> None:
    arm = ArmDisk((0.8, 0.7), (1.0, 0.9), (0.3, 0.4), (0.06, inertia), 0.25, 1.0, 0.04)
    parameters = []  # m, m c_x, m c_y, I about the origin
    for mass, com, about in zip(arm.link_masses, arm.link_coms, arm.link_inertias):
        parameters += [mass, *(mass * com), about + mass * com @ com]
    parameters += [arm.disk_mass, 0.0, 0.0, arm.disk_inertia]
    regressor = PlantRegressor(arm.plant, ("link_1", "link_2", "disk"))
    q, v, a = states(np.random.default_rng(0), 20, 5)
    expected = [arm.mass_matrix(q[k]) @ a[k] + arm.bias(q[k], v[k]) - arm.gravity(q[k]) for k in range(20)]
    assert np.abs(regressor(q, v, a) @ parameters - expected).max() < ROUNDING


def test_free_body_closed_form_is_the_plants_with_any_centre_of_mass() -> None:
    arm = arm_disk()
    q, v, a = states(np.random.default_rng(2), 20, 5)
    Y = PlantRegressor(arm.plant, ("disk",))(q, v, a)
    closed = free_body_regressor(q[:, 2:], v[:, 2:], a[:, 2:], (0.0, -arm.g))
    assert np.abs(Y[:, 2:] - closed).max() < ROUNDING
    assert np.abs(closed[:, :, 1]).max() > 0.1  # the columns of m c are not trivially equal


def test_states_that_are_not_finite_are_refused_before_drake_sees_them() -> None:
    regressor = PlantRegressor(arm_disk().plant, ("disk",))
    q, v, a = np.zeros((2, 5)), np.zeros((2, 5)), np.zeros((2, 5))
    q[1, 0] = np.nan
    with pytest.raises(ValueError, match="finite"):
        regressor(q, v, a)
    with pytest.raises(ValueError, match="shapes"):
        regressor(q[:, :4], v, a)
