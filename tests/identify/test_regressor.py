"""The regressor against Drake's own dynamics and against simulated motions with contact."""

import numpy as np
import pytest

from thesis_lib.simulate.mechanisms.motions import arm_disk, block
from thesis_lib.simulate.mechanisms.regressor import PlantRegressor, free_body_regressor, parameter_names
from thesis_lib.simulate.stepping.stepping import simulate

ROUNDING = 1e-10  # N, N m: sums of a few terms of at most 1e3


def states(rng: np.random.Generator, n: int, nv: int) -> tuple[np.ndarray, ...]:
    return tuple(rng.normal(size=(n, nv)) for _ in range(3))


def arm_parameters(arm: object) -> np.ndarray:
    """(m, m c_x, m c_y, I about the origin) of both links and the disk."""
    values = []
    for mass, com, inertia in zip(arm.link_masses, arm.link_coms, arm.link_inertias):
        values += [mass, *(mass * com), inertia + mass * com @ com]
    return np.array([*values, arm.disk_mass, 0.0, 0.0, arm.disk_inertia])


def test_arm_regressor_times_parameters_is_inverse_dynamics() -> None:
    arm = arm_disk()
    regressor = PlantRegressor(arm.plant, ("link_1", "link_2", "disk"))
    q, v, a = states(np.random.default_rng(0), 20, 5)
    expected = [arm.mass_matrix(q[k]) @ a[k] + arm.bias(q[k], v[k]) - arm.gravity(q[k]) for k in range(20)]
    assert np.abs(regressor(q, v, a) @ arm_parameters(arm) - expected).max() < ROUNDING


def test_arm_regressor_matches_differences_in_the_parameters() -> None:
    """Column by column: the arm built with a changed inertia, not only the sum of all columns."""
    from thesis_lib.simulate.stepping.arm_disk import ArmDisk

    def made(inertia: float) -> ArmDisk:
        return ArmDisk((0.8, 0.7), (1.0, 0.9), (0.3, 0.4), (0.06, inertia), 0.25, 1.0, 0.04)

    q, v, a = states(np.random.default_rng(1), 5, 5)
    one, other = made(0.05), made(0.15)
    Y = PlantRegressor(one.plant, ("link_2",))(q, v, a)
    for k in range(5):
        difference = (other.mass_matrix(q[k]) - one.mass_matrix(q[k])) @ a[k]
        difference += other.bias(q[k], v[k]) - one.bias(q[k], v[k])
        assert np.abs(Y[k, :, 3] - difference / 0.1).max() < ROUNDING


def test_free_body_closed_form_is_the_plants_with_any_centre_of_mass() -> None:
    arm = arm_disk()
    q, v, a = states(np.random.default_rng(2), 20, 5)
    Y = PlantRegressor(arm.plant, ("disk",))(q, v, a)
    closed = free_body_regressor(q[:, 2:], v[:, 2:], a[:, 2:], (0.0, -arm.g))
    assert np.abs(Y[:, 2:] - closed).max() < ROUNDING
    assert np.abs(closed[:, :, 1]).max() > 0.1  # the columns of m c are not trivially equal


def test_regressor_explains_a_simulated_drop_with_its_contact_forces() -> None:
    body = block()
    record = simulate(body, [0.0, 1.2, 0.4], [1.0, 0.0, 2.0], None, 5e-3, 200, 0.7, 0.6)
    assert (record.c_n > 0.0).any()
    Y = free_body_regressor(record.q[:-1], record.v[:-1], np.diff(record.v, axis=0) / record.h)
    contact = np.einsum("kpv,kp->kv", record.J_n, record.c_n) + np.einsum("kpv,kp->kv", record.J_t, record.c_t)
    assert np.abs(Y @ [body.mass, 0.0, 0.0, body.inertia] - contact).max() < ROUNDING


def test_states_that_are_not_finite_are_refused_before_drake_sees_them() -> None:
    regressor = PlantRegressor(arm_disk().plant, ("disk",))
    q, v, a = np.zeros((2, 5)), np.zeros((2, 5)), np.zeros((2, 5))
    q[1, 0] = np.nan
    with pytest.raises(ValueError, match="finite"):
        regressor(q, v, a)
    with pytest.raises(ValueError, match="shapes"):
        regressor(q[:, :4], v, a)


def test_names_follow_the_columns() -> None:
    assert parameter_names(("a", "b"))[3:5] == ("a.I", "b.m")
