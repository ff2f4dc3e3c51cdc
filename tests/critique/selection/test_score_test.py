"""Score tests: the injected effect gains most, p-values are fair under the null, twins are known as twins."""

import numpy as np
import pytest
from plain_drops import LAW, TRUTH, injected, observed

from thesis_lib.critique.contacts.model import Model
from thesis_lib.critique.drops.settings import CritiqueSettings
from thesis_lib.critique.drops.world import Drops
from thesis_lib.critique.likelihood.comparison import Comparison
from thesis_lib.critique.likelihood.synthesis import synthesise
from thesis_lib.critique.selection.scan import Scan, scan

SIGMAS = 4.0
RESAMPLES = 999
TELL_APART = CritiqueSettings().tell_apart


def scanned(observations, seed: int = 0, names: tuple[str, ...] | None = None) -> Scan:
    world = Drops(observations)
    candidates = [world.candidates[name] for name in (world.candidates if names is None else names)]
    return scan(world.slopes(world.fit(LAW.name, ()), candidates), RESAMPLES, np.random.default_rng(seed))


@pytest.fixture(scope="module")
def moved() -> Scan:
    return scanned(injected("moving_surface")[0])


@pytest.mark.parametrize(
    "name", ["anisotropic_friction", "contact_torque", "com_offset", "surface_tilt", "linear_drag", "wear"]
)
def test_the_injected_effect_gains_most(name):
    found = scanned(injected(name, factor=0.5)[0])
    assert max(found.gain, key=found.gain.get) == name
    assert found.p_value(found.gain[name]) == pytest.approx(1.0 / (RESAMPLES + 1))
    assert found.p_value(-1.0) == 1.0


@pytest.mark.slow
def test_p_values_are_fair_when_nothing_is_hidden():
    p_values = []
    for seed in range(24):
        o = synthesise(Comparison(Model(LAW), TRUTH, observed()), np.random.default_rng(100 + seed))
        found = scanned(o, seed)
        p_values.append(found.p_value(max(found.gain.values())))
    p_values = np.array(p_values)
    # uniform: mean 1/2 with standard deviation 0.29/√24; 4 of 24 below 0.01 has probability 1e-4
    assert p_values.mean() == pytest.approx(0.5, abs=SIGMAS * 0.2887 / np.sqrt(24))
    assert np.sum(p_values < 0.01) < 4
    assert p_values.min() < 0.4 and p_values.max() > 0.6


def test_p_values_count_the_candidates_tried():
    many, one = scanned(observed()), scanned(observed(), names=("wrong_inertia",))
    assert one.gain["wrong_inertia"] == pytest.approx(many.gain["wrong_inertia"], rel=1e-9)
    assert np.quantile(many.null, 0.5) > np.quantile(one.null, 0.5) + 1.0
    # one parameter: twice the gain is chi² with one degree of freedom, median 0.455
    assert 2.0 * np.median(one.null) == pytest.approx(0.455, abs=0.15)


def test_no_candidates_no_gain():
    found = scanned(observed(), names=())
    assert found.gain == {} and (found.null == 0.0).all()


def test_an_effect_cannot_be_told_from_itself(moved):
    for name in moved.gain:
        assert moved.expected_loss(name, name) == pytest.approx(0.0, abs=1e-6 * (1 + moved.gain[name]))


def test_a_moving_surface_cannot_be_told_from_a_drifting_camera(moved):
    assert moved.gain["moving_surface"] > 50.0
    assert moved.expected_loss("moving_surface", "sensor_drift") < 0.1 * TELL_APART
    assert moved.expected_loss("sensor_drift", "moving_surface") < 0.1 * TELL_APART


def test_unlike_effects_can_be_told_apart(moved):
    for other in ("linear_drag", "wrong_inertia", "surface_tilt", "tangential_restitution"):
        assert moved.expected_loss("moving_surface", other) > 10.0 * TELL_APART


def test_the_same_generator_gives_the_same_null():
    one, two = scanned(observed(), 3), scanned(observed(), 3)
    np.testing.assert_array_equal(one.null, two.null)
    assert one.gain == two.gain
