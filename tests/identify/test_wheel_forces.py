"""Contact forces of the rolling wheel: exact without noise, calibrated with it, and refused where it does not roll."""

import numpy as np
import pytest

from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.mechanisms.motions import DEFAULT
from thesis_lib.simulate.mechanisms.noise_snr import add_noise
from thesis_lib.simulate.stepping.rimless_wheel import RimlessWheel
from thesis_lib.simulate.stepping.stepping import simulate
from thesis_lib.thesis.identify.wheel.forces import (
    WheelStatus,
    fit_wheel,
    noise_of_residuals,
    noise_of_third_differences,
    plain_forces,
    white,
)
from thesis_lib.thesis.identify.wheel.study import (
    WheelStudy,
    mass_summary,
    motion_by_mass,
    rolling_steps,
    touchdown,
    touched_pairs,
    wheel_force_study,
    wheel_force_table,
)

H, MU, STEPS = 5e-3, 0.7, 110  # a change of spoke
EXACT = 1e-10  # relative; least squares on exact data, rounding grows with 1/h
FORCE = 5e-3  # relative error of the fit's forces at 40 dB on a short window; the thesis's program has 0.2


def made(mass=1.0, inertia=0.4):
    return RimlessWheel(8, 1.0, mass, inertia, 0.15)


def rolled(wheel, omega=-1.8, steps=STEPS, mu=MU, epsilon=0.0):
    return simulate(wheel, *wheel.standing(0.0, omega), None, H, steps, mu, epsilon)


def relative(found, true, rolling):
    return np.sqrt(np.sum((found - true)[rolling] ** 2) / np.sum(true[rolling] ** 2))


@pytest.fixture(scope="module")
def noisy():
    truth = rolled(made())
    states = add_noise(truth, 40.0, np.random.default_rng(3))
    # the estimator is given a wheel of another inertia, and none of the noise
    return truth, states, fit_wheel(made(inertia=0.8), H, states.q, states.v, MU)


def test_exact_states_give_exact_forces():
    truth = rolled(made())
    found = plain_forces(made(inertia=0.8), H, truth.q, truth.v, MU)
    every = np.ones(STEPS, dtype=bool)
    assert found.solved
    assert relative(found.c_n, truth.c_n, every) < EXACT and relative(found.c_t, truth.c_t, every) < EXACT
    assert found.theta[0] == pytest.approx(0.4, rel=EXACT)


def test_noisy_states_give_forces_inertia_and_noise_which_the_plain_program_does_not(noisy):
    truth, states, fit = noisy
    rolling = rolling_steps(truth.c_n)
    assert fit.status is WheelStatus.OK
    error = relative(fit.record.c_n, truth.c_n, rolling)
    plain = plain_forces(made(), H, states.q, states.v, MU, states.sigma)
    assert error < FORCE and 0.05 < relative(plain.c_n, truth.c_n, rolling) > 20 * error
    assert relative(fit.record.c_t, truth.c_t, rolling) < 5 * FORCE
    assert abs(fit.inertia - 0.4) < 4.0 * fit.inertia_std < 0.02
    # 111 samples tell a standard deviation to 7 %
    assert fit.sigma == pytest.approx(states.sigma, rel=0.3)


def test_standard_errors_cover_the_impulse_of_the_touchdown(noisy):
    truth, _, fit = noisy
    pair = touched_pairs(truth.c_n)[1]
    impact = touchdown(truth.c_n, pair)
    miss = H * (fit.record.c_n - truth.c_n)[impact, pair].sum()
    std = fit.impulse_std(impact, pair)[0]
    assert 0 < abs(miss) < 4.0 * std < 0.01 * H * truth.c_n[impact, pair].sum()


def test_forces_scale_with_the_mass_that_is_given(noisy):
    _, states, fit = noisy
    heavy = fit_wheel(made(mass=3.0), H, states.q, states.v, MU)
    assert heavy.record.c_n == pytest.approx(3.0 * fit.record.c_n, rel=1e-5, abs=1e-5)
    assert heavy.inertia == pytest.approx(3.0 * fit.inertia, rel=1e-5)


@pytest.mark.parametrize(
    "wrong", ["rebounds", *(pytest.param(w, marks=pytest.mark.slow) for w in ("slips", "steeper"))]
)
def test_a_wheel_that_does_not_roll_as_assumed_is_refused(wrong):
    truth = {
        "slips": lambda: rolled(made(), mu=0.1, steps=80),
        "rebounds": lambda: rolled(made(), epsilon=0.3, steps=80),
        "steeper": lambda: rolled(RimlessWheel(8, 1.0, 1.0, 0.4, 0.18), steps=80),
    }[wrong]()
    states = add_noise(truth, 40.0, np.random.default_rng(4))
    assert fit_wheel(made(), H, states.q, states.v, MU).status is not WheelStatus.OK


def test_states_without_contact_or_with_nan_are_said():
    truth = rolled(made())
    with pytest.raises(UserError, match="no contact force in this window"):
        fit_wheel(made(), H, truth.q + [0.0, 1.0, 0.0], truth.v, MU)
    broken = truth.q.copy()
    broken[7, 1] = np.nan
    with pytest.raises(UserError, match="first at sample 7"):
        fit_wheel(made(), H, broken, truth.v, MU)
    with pytest.raises(UserError, match="at least 20 samples"):
        plain_forces(made(), H, truth.q[:10], truth.v[:10], MU)


def test_noise_is_seen_through_motion_and_impacts():
    truth = rolled(made(), steps=600)
    states = add_noise(truth, 40.0, np.random.default_rng(5))
    assert noise_of_third_differences(states.q, states.v) == pytest.approx(states.sigma, rel=0.25)


def test_noise_is_not_understated_by_what_was_fitted_to_it():
    """Four parameters fitted to six channels of five samples with unit noise: variances are right on average."""
    rng, n = np.random.default_rng(7), 5
    A = rng.standard_normal((2, n, 3, 4)).reshape(-1, 4)  # four parameters that move all channels
    noise = rng.standard_normal((4000, 6 * n))
    left = noise - noise @ A @ np.linalg.pinv(A)
    variance = [noise_of_residuals(r.reshape(2, n, 3), 4) ** 2 for r in left]
    # 4,000 draws with 26 degrees of freedom tell it to 0.5 %; four of thirty would be 13 %
    assert np.mean(variance) == pytest.approx(1.0, abs=0.02)


def test_whiteness_is_uniform_on_white_noise_and_small_on_a_trend():
    rng = np.random.default_rng(6)
    p = np.sort([white(rng.standard_normal((2, 200, 3))) for _ in range(200)])
    # Kolmogorov's distance of 200 uniform numbers exceeds 0.14 once in a thousand
    assert np.abs(p - (np.arange(200) + 0.5) / 200).max() < 0.14
    assert white(rng.standard_normal((2, 200, 3)) + np.sin(np.linspace(0, 9, 200))[:, None]) < 1e-6


def test_only_the_ratio_of_mass_to_inertia_moves_the_wheel():
    settings = WheelStudy(masses=(0.5, 2.0), mass_seconds=1.0)
    motions = motion_by_mass(settings, DEFAULT).pivot(index="t", columns="mass", values="omega")
    # angular acceleration on one spoke, at equal angle and inertia: m g l sin / (I + m l²) grows with the mass
    assert motions[2.0].iloc[20] < motions[0.5].iloc[20] < motions[0.5].iloc[0]
    summary = mass_summary(settings, DEFAULT).set_index("friction")
    assert summary.index.tolist() == ["high", "low"]
    assert (summary["apart"] > 3.0 * summary["step_error"]).all() and (summary["step_error"] > 0.0).all()
    ends = motion_by_mass(settings, DEFAULT).groupby("mass")["theta"].last()
    assert summary["apart"]["high"] == pytest.approx(ends.max() - ends.min()) != summary["apart"]["low"]
    light, heavy = rolled(made(1.0, 0.4)), rolled(made(4.0, 1.6))
    assert heavy.q == pytest.approx(light.q, abs=1e-9)
    assert heavy.c_n == pytest.approx(4.0 * light.c_n, abs=1e-6)


@pytest.mark.slow
def test_study_has_a_row_per_record_spoke_and_method():
    rows = wheel_force_study(2, np.random.default_rng(0), WheelStudy(steps=280), DEFAULT)
    assert len(rows) == 2 * 3 * 3 and not rows.duplicated(["record", "pair", "method"]).any()
    table = wheel_force_table(rows).set_index(["method", "order"])
    assert (table.loc["noise_free", "error_n_90"] < 1e-4).all()
    assert (table.loc["fit", "error_n_90"] < FORCE).all() and (table.loc["fit", "n_failed"] == 0).all()
    assert np.isnan(table.loc[("fit", 0), "impulse_error_n_median"])
