"""Without known force ratios are found, as with known mass, and whatever has a scale of its own is refused."""

from dataclasses import replace

import numpy as np
import pytest

from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.mechanisms.motions import BODIES, DEFAULT, block, releases
from thesis_lib.simulate.mechanisms.noise_snr import add_noise
from thesis_lib.simulate.stepping.stepping import SimulatedMotion, simulate
from thesis_lib.thesis.identify.base_parameters.excitation_table import excitation_cases
from thesis_lib.thesis.identify.base_parameters.projection import contact_tolerances
from thesis_lib.thesis.identify.base_parameters.window import ContactWindow, States, free_body_window
from thesis_lib.thesis.identify.programs.homogeneous import ratios_table, solve_homogeneous
from thesis_lib.thesis.identify.programs.mode_qp import solve_mode_qp
from thesis_lib.thesis.identify.programs.result import SolveStatus

EXACT = 1e-9  # relative: rounding of some hundred steps
AGREE = 1.1  # errors of the two programs on the same noise, relative
PROPORTIONAL = (8.0, 12.5)  # errors at ten times the noise, relative: 10 where it is small
DROPS = 12


def drop(kind: str) -> tuple[SimulatedMotion, ContactWindow]:
    body = BODIES[kind]()
    (q,), (v,) = releases(kind, 1, np.random.default_rng(0), DEFAULT)
    record = simulate(body, q, v, None, DEFAULT.h, 200, DEFAULT.mu, DEFAULT.epsilon)
    return record, free_body_window(record, DEFAULT.mu, body)


@pytest.mark.parametrize("kind", ["block", "ellipse", "wheel"])
def test_ratios_of_parameters_and_forces_are_found(kind: str) -> None:
    record, window = drop(kind)
    body = BODIES[kind]()
    found = solve_homogeneous(window)
    assert found.solved and record.c_n.any()
    np.testing.assert_allclose(found.theta, [1.0, body.inertia / body.mass], rtol=EXACT)
    for forces, true in ((found.c_n, record.c_n), (found.c_t, record.c_t)):
        np.testing.assert_allclose(forces, true / body.mass, atol=EXACT * np.abs(record.c_n).max() / body.mass)


def test_bodies_that_never_touch_each_other_have_a_scale_each() -> None:
    """Two bodies as one system: both ratios m/I could be told, the ratio of the masses could not."""
    (_, one), (_, other) = drop("block"), drop("ellipse")

    def both(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Blocks a (m, i, j) and b (m, k, l) as (m, i + k, j + l)."""
        out = np.zeros((len(one), a.shape[1] + b.shape[1], a.shape[2] + b.shape[2]))
        out[:, : a.shape[1], : a.shape[2]], out[:, a.shape[1] :, a.shape[2] :] = a, b
        return out

    pair = replace(
        one,
        Y=both(one.Y, other.Y),
        f=np.hstack([one.f, other.f]),
        gap=np.hstack([one.gap, other.gap]),
        J_n=both(one.J_n, other.J_n),
        J_t=both(one.J_t, other.J_t),
        v_t=np.hstack([one.v_t, other.v_t]),
        names=("m", "I", "other m", "other I"),
        theta_min=np.zeros(4),
    )
    with pytest.raises(UserError, match="more than the scale is undetermined"):
        solve_homogeneous(pair)


@pytest.mark.parametrize(
    ("case", "why"),
    [
        ("flight, no force", "no contact and no known force"),
        ("square lands flat, no force", "up to a common factor"),
        ("disk rolls, no force", "every contact of the window sticks"),
        ("disk slides, force", "sets the scale"),
    ],
)
def test_windows_without_a_ratio_are_refused_with_the_reason(case: str, why: str) -> None:
    with pytest.raises(UserError, match=why):
        solve_homogeneous(excitation_cases()[case][1])


def test_contact_where_there_is_none_is_no_solution() -> None:
    """Forces that the modes forbid leave a misfit: the status says so, whatever the singular vector."""
    _, window = drop("block")
    open_gap = replace(window, gap=np.where(window.gap == 0.0, 0.01, window.gap))
    assert solve_homogeneous(open_gap).status is SolveStatus.DYNAMICS_VIOLATED


def noisy_errors(snr: float) -> tuple[np.ndarray, np.ndarray]:
    """Relative errors of I/m by the homogeneous program and of I by that of known mass on the same noisy drops."""
    rng, body = np.random.default_rng(1), block()
    errors = []
    for q, v in zip(*releases("block", DROPS, np.random.default_rng(0), DEFAULT)):
        record = simulate(body, q, v, None, DEFAULT.h, 200, DEFAULT.mu, DEFAULT.epsilon)
        noisy = add_noise(record, snr, rng)
        states = States.of(body, record.h, noisy.q, noisy.v, np.zeros((record.steps, 3)))
        gap, slip = contact_tolerances(body, noisy.sigma)
        window = free_body_window(states, DEFAULT.mu, body, gap_tolerance=gap, v_tolerance=slip)
        free = solve_homogeneous(window).theta[1]
        known = solve_mode_qp(window.fix({"m": body.mass})).theta[0]
        errors.append((free / (body.inertia / body.mass) - 1.0, known / body.inertia - 1.0))
    return tuple(np.array(errors).T)


def test_noise_costs_as_much_as_with_known_mass() -> None:
    size = {}
    for snr in (80.0, 60.0):
        free, known = noisy_errors(snr)
        size[snr] = np.sqrt(np.mean(free**2))
        assert 1.0 / AGREE < size[snr] / np.sqrt(np.mean(known**2)) < AGREE
    assert PROPORTIONAL[0] < size[60.0] / size[80.0] < PROPORTIONAL[1]
    # with much noise the inertia comes out too small: it has the less misfit the smaller it is
    free, _ = noisy_errors(30.0)
    assert np.median(free) < -0.02


def test_the_table_has_the_cases_of_section_2_3_3() -> None:
    table = ratios_table().set_index("case")
    found = table[table["found"] == 1]
    assert set(found.index) == {"disk slides, no force", "square pivots, no force", "square lands tilted, no force"}
    assert (found[["ratio_error", "force_error"]].to_numpy() < EXACT).all()
    np.testing.assert_allclose(found["ratio"], found["truth"], rtol=EXACT)
    assert len(table) == 6 and table.drop(index=found.index)["ratio"].isna().all()
