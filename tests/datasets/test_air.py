"""Flights that are not parabolas: drag is found before hits are, with its size, and no bend passes for a hit."""

import numpy as np
import pytest
from bouncing import ellipse_header, fly
from falling_disk import damped, light_balls

from thesis_lib.datasets.flights.drag import air_in
from thesis_lib.datasets.format.air import Air
from thesis_lib.datasets.format.samples import ArcSettings, Samples, make_samples, noise_from_differences
from thesis_lib.datasets.impacts.detect import find_impacts

EXACT = 1e-6  # relative: the path of constants in closed form, in double precision and small steps
SIZE = 0.03  # relative: a coefficient of 45 flights of 0.2 s is known to 1 %
SERIES = 2e-3  # share of the way that drag makes: the third power of the share of the velocity that it takes, 0.13


@pytest.mark.parametrize(("rate", "c_q"), [(143.0, 0.12), (240.0, 0.2), (60.0, 0.15)])
def test_each_bounce_of_a_fast_light_ball_is_one_hit(rate: float, c_q: float):
    found = find_impacts(light_balls(rate, c_q=c_q))
    assert len(found.impacts) == 45 and len(found.arcs) == 45
    assert found.air is not None and found.air.c_q == pytest.approx(c_q, rel=SIZE) and not found.air.c_v
    (said,) = [text for text in found.warnings if "slowed by" in text]
    assert "air drag (quadratic, c_q = 0." in said


def test_a_spinning_ball_is_lifted_as_well():
    found = find_impacts(light_balls(c_q=0.14, k_m=0.005, spin=100.0, has_angle=True))
    assert len(found.impacts) >= 44 and len(found.arcs) <= 46
    assert found.air.c_q == pytest.approx(0.14, rel=SIZE) and found.air.k_m == pytest.approx(0.005, rel=SIZE)


def test_linear_damping_is_told_from_air_drag():
    found = find_impacts(damped(0.1))
    assert found.air.c_v == pytest.approx(0.1, rel=SIZE) and not found.air.c_q
    assert found.arcs_air is None  # arcs of 0.2 s do not see it


def test_plain_flights_have_no_air(rng: np.random.Generator):
    f = fly(ellipse_header(), rng, 40)
    samples = make_samples(f.trial, f.t, f.q, f.header, ArcSettings())
    assert air_in(samples, noise_from_differences(samples), f.header) is None


def test_what_constant_spin_and_linear_drag_make_of_a_path():
    """Linear drag leaves v e^(−c t); a Magnus force turns v by k ω t and keeps its size."""
    t = np.linspace(0.0, 0.5, 2001)
    c, v = 0.8, np.array([4.0, 2.0, 0.0])
    q = np.outer((1.0 - np.exp(-c * t)) / c, v)
    samples = Samples(np.zeros(len(t), int), t, q, np.zeros(len(t), int), Air(c_v=c))
    np.testing.assert_allclose(samples.without_air(), np.outer(t, v), atol=EXACT * 2.0)
    rate = 0.01 * 50.0
    circle = np.stack([np.sin(rate * t), 1.0 - np.cos(rate * t), 50.0 * t], axis=1) / [rate, rate, 1.0]
    samples = Samples(samples.trial, t, circle, samples.run, Air(k_m=0.01))
    np.testing.assert_allclose(samples.without_air(), np.stack([t, 0.0 * t, 50.0 * t], 1), atol=EXACT)


def test_the_path_beyond_a_parabola_is_that_of_the_motion():
    """Quadratic drag along a line: x = ln(1 + c v t) / c."""
    c, v = 0.15, 6.0
    tau = np.linspace(-0.15, 0.15, 31)[None]
    velocity = np.array([[v, 0.0, 0.0]])
    path = Air(c_q=c).beyond(tau, velocity, velocity, gravity=0.0)[0]
    true = np.log1p(c * v * tau[0]) / c - v * tau[0]
    np.testing.assert_allclose(path[:, 0], true, atol=SERIES * np.abs(true).max())
    np.testing.assert_allclose(path[:, 1:], 0.0, atol=1e-15)


def test_the_slope_of_the_forces_is_their_derivative(rng: np.random.Generator):
    air, v, h = Air(c_v=0.3, c_q=0.2, c_l=0.1, k_m=0.02), rng.normal(0.0, 3.0, (5, 3)), 1e-6
    for j in range(3):
        step = h * np.eye(3)[j]
        secant = (air.acceleration(v + step) - air.acceleration(v - step)) / (2.0 * h)
        np.testing.assert_allclose(air.slope(v)[:, :, j], secant, atol=1e-7)
