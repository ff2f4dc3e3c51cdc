"""Where a body in space lies and slides: noise where the model is right, and what is wrong of attitude and height."""

import numpy as np
import pytest
from tumbling_box import BOX, RIG, G

from thesis_lib.bodies.symmetry import Symmetry
from thesis_lib.contact import LAWS
from thesis_lib.critique.contacts.kinds import bind
from thesis_lib.critique.contacts.model import Model
from thesis_lib.critique.likelihood.supports import supports_in_space
from thesis_lib.datasets.flights.parabolas import Hits
from thesis_lib.datasets.format.samples import Samples
from thesis_lib.effects import EFFECTS
from thesis_lib.mechanics.space import SPACE, multiplied, of_rotation_matrix, of_rotation_vector
from thesis_lib.mechanics.state import State
from thesis_lib.statistics.spread import robust_std

NOISE, RATE, SAMPLES, TRIALS = (2e-4, 3e-3), 240.0, 40, 60
MU, SLIDES = 0.2, 0.35  # of impacts, and while supported
LAW = LAWS["anitescu_potra_newton"]


def recorded(rng, deceleration=0.0, turned=(0.0, 0.0, 0.0), higher=0.0, spin=0.0, slope=0.0, stops=False, hops=0.0):
    """A box on each of its sides, at rest or sliding, as a camera records it that turns its axes by `turned` (rad).

    While sliding it spins about the normal by `spin` (rad/s), and it rises by `slope` along its way.  At first it still
    hops, by `hops` (m).
    """
    symmetry, t = Symmetry(BOX, G), np.arange(SAMPLES) / RATE
    parts = []
    for trial in range(TRIALS):
        up = symmetry.stands[trial % len(symmetry.stands)]
        across = np.eye(3)[np.argmin(np.abs(up))]
        lying = of_rotation_matrix(np.stack([np.cross(across, up), across, up]))  # takes `up` to the normal
        yaw = of_rotation_vector(np.array([[0.0], [0.0], [rng.uniform(-3.0, 3.0)]]))
        attitude = multiplied(multiplied(yaw, lying[:, None]), of_rotation_vector(np.array(turned)[:, None]))
        height = higher - float(BOX.lowest(multiplied(yaw, lying[:, None]))[2, 0])
        angle, speed = rng.uniform(-3.0, 3.0), deceleration * (t[-1] + 0.1)
        if stops:
            speed *= 0.5
        slid = np.minimum(t, speed / deceleration) if stops else t
        path = (speed * slid - 0.5 * deceleration * slid**2) * np.array([[np.cos(angle)], [np.sin(angle)]])
        heights = height + slope * np.linalg.norm(path, axis=0)
        heights = heights + hops * np.abs(np.sin(300.0 * t)) * np.exp(-40.0 * t)
        place = np.concatenate([path + rng.uniform(-0.1, 0.1, (2, 1)), heights[None]])
        turns = of_rotation_vector(np.stack([0.0 * t, 0.0 * t, spin * t]))
        parts.append(np.concatenate([place, multiplied(turns, np.repeat(attitude, SAMPLES, axis=1))]))
    pose = np.concatenate(parts, axis=1)
    pose[:3] += NOISE[0] * rng.standard_normal(pose[:3].shape)
    pose[3:] = SPACE.attitude_after(pose[3:], NOISE[1] * rng.standard_normal(pose[:3].shape))
    trial, times = np.repeat(np.arange(TRIALS), SAMPLES), np.tile(t, TRIALS) + 1.0
    states = State(pose, np.zeros((6, len(trial))), trial, times, None, SPACE)
    hits = Hits(np.arange(TRIALS), np.full(TRIALS, 0.9), np.ones(TRIALS, bool))
    return supports_in_space(states, Samples(trial, times, pose[:3].T, trial), hits, RIG, NOISE)


def bound(*effects, **values):
    model = Model(LAW, tuple(EFFECTS[name] for name in effects), space=SPACE)
    return bind(model, {name: p.null for name, p in model.parameters.items()} | {"mu": MU} | values, RIG)


def test_rests_of_a_right_model_are_noise(rng):
    (rests,) = recorded(rng)
    assert rests.channel == "rest" and len(rests) == TRIALS
    z = rests.whitened(bound())
    assert np.all(robust_std(z) < 1.3) and np.all(
        robust_std(z) > 0.4
    )  # noise of the mean, and the scatter that it makes
    assert len(rests.of_trials(np.arange(10))) == 10


def test_a_surface_at_another_height_shows_in_the_gap_alone(rng):
    (rests,) = recorded(rng, higher=1e-3)
    gap, *leans = np.median(rests.residuals(bound()), axis=0)
    assert gap == pytest.approx(1e-3, abs=5e-5) and np.abs(leans).max() < 1e-3
    z = rests.whitened(bound("surface_height", **{"surface_height.h": 1e-3}))
    assert robust_std(z)[0] < 1.3


def test_a_body_that_still_hops_by_less_than_noise_lies_on_the_surface(rng):
    (rests,) = recorded(rng, hops=NOISE[0])
    assert len(rests) == TRIALS
    gap = rests.residuals(bound())[:, 0]
    assert gap.mean() == pytest.approx(0.0, abs=3.0 * NOISE[0] / np.sqrt(TRIALS * SAMPLES / 2))


def test_an_attitude_that_is_off_shows_on_every_side(rng):
    (rests,) = recorded(rng, turned=(0.02, 0.0, 0.0))
    z = rests.whitened(bound())
    assert robust_std(z)[1:].min() > 5.0 and len(rests) == TRIALS
    undone = rests.less(rests.residuals(bound()))
    np.testing.assert_allclose(undone.residuals(bound()), 0.0, atol=1e-5)


def test_a_body_that_slides_shows_the_friction_that_supports_it(rng):
    (slides,) = recorded(rng, deceleration=9.81 * SLIDES)
    assert slides.channel == "slide" and len(slides) > 0.9 * TRIALS
    assert robust_std(slides.whitened(bound())).min() > 5.0
    right = slides.whitened(bound("sliding_friction", **{"sliding_friction.mu_s": SLIDES}))
    np.testing.assert_allclose(robust_std(right), 1.0, atol=0.35)
    slip = np.hypot(*slides.state.velocity[:2]).mean()  # friction that falls with the slip is that of this one
    s = (SLIDES / MU - 1.0) * np.exp((slip / 3.0) ** 2)
    stribeck = bound(
        "velocity_dependent_friction", **{f"velocity_dependent_friction.{k}": v for k, v in (("s", s), ("v_s", 3.0))}
    )
    np.testing.assert_allclose(robust_std(slides.whitened(stribeck)), 1.0, atol=0.35)
    again = slides.drawn(bound(), rng)
    np.testing.assert_allclose(robust_std(again.whitened(bound())), 1.0, atol=0.35)


def test_slides_are_seen_while_the_body_spins_slowly_and_the_axes_are_those_of_no_table(rng):
    """On the measured cube no slide was found before: it spins a little, and the axes lean by 5 mrad."""
    (slides,) = recorded(rng, deceleration=9.81 * SLIDES, spin=1.0, slope=0.01)
    assert len(slides) > 0.9 * TRIALS
    right = slides.whitened(bound("sliding_friction", **{"sliding_friction.mu_s": SLIDES}))
    np.testing.assert_allclose(robust_std(right), 1.0, atol=0.35)
    assert not recorded(rng, deceleration=9.81 * SLIDES, spin=15.0)  # that changes the friction
    assert not recorded(rng, deceleration=9.81 * SLIDES, slope=0.3)  # no table is so far off


def test_a_slide_that_ends_at_rest_is_used_without_its_end(rng):
    stops = [slides for slides in recorded(rng, deceleration=9.81 * SLIDES, stops=True) if slides.channel == "slide"]
    assert len(stops[0]) > 0.9 * TRIALS
    right = stops[0].whitened(bound("sliding_friction", **{"sliding_friction.mu_s": SLIDES}))
    assert np.abs(np.median(right, axis=0)).max() < 0.5


def test_few_rests_say_nothing(rng):
    (rests,) = recorded(rng)
    few = np.flatnonzero(rests.trial < 5)
    states = rests.state.select(few)
    empty = Hits(np.zeros(0), np.zeros(0), np.zeros(0, bool))
    samples = Samples(states.trial, states.t, states.position.T, states.trial)
    assert supports_in_space(states, samples, empty, RIG, NOISE) == ()
