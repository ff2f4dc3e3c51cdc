"""The regressor against Drake's own dynamics."""

import numpy as np
import pytest

from thesis_lib.simulate.mechanisms.motions import arm_disk
from thesis_lib.simulate.mechanisms.regressor import PlantRegressor, free_body_regressor
from thesis_lib.simulate.stepping.arm_disk import ArmDisk

ROUNDING = 1e-10  # N, N m: sums of a few terms of at most 1e3


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
