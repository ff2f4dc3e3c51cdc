"""Several points of several fits in one call say the same as one by one, for every effect and every base."""

from dataclasses import replace

import numpy as np
import pytest
from hidden_effects import recorded

from thesis_lib.critique.contacts.bases import BASES, RESERVE
from thesis_lib.critique.contacts.model import Model
from thesis_lib.critique.drops.world import Drops
from thesis_lib.critique.likelihood.fit import fit, fit_each
from thesis_lib.critique.likelihood.observations import observe
from thesis_lib.critique.likelihood.whitening import Whitening, together
from thesis_lib.effects import EFFECTS, effects_in
from thesis_lib.foundation import forked
from thesis_lib.foundation.forked import sharing
from thesis_lib.mechanics.space import PLANE
from thesis_lib.simulate.rig.hidden_causes import ELLIPSE_BODY, SQUARE, CompliantContact

CLOSE = 1e-4  # standard deviations; an instant of touch is found to a nanometre, on a bent plate to ten
EFFORTS = ("quick", "near", "full")


@pytest.fixture(scope="module", params=["ellipse", "square"])
def observations(request):
    body = {"ellipse": ELLIPSE_BODY, "square": SQUARE}[request.param]
    return observe(recorded(body, 12, 0, contact=CompliantContact(contact_time=1e-3)))


def points_of(model: Model) -> list[dict[str, float]]:
    """Values off the null, and each parameter moved from there."""
    at = {name: p.null for name, p in model.parameters.items()} | {"mu": 0.15, "epsilon": 0.55, "tau": 7e-4}
    at |= {name: p.discrete for name, p in model.parameters.items() if p.discrete is not None}
    moves = [
        (name, p.scale if at[name] + p.scale <= p.high else -p.scale) for name, p in model.fitted_parameters.items()
    ]
    return [at, *({**at, name: at[name] + step} for name, step in moves)]


def assert_the_same(model: Model, observations) -> None:
    points = points_of(model)
    whitening = Whitening.at(model, points[0], observations)
    others = Whitening.at(model, points[0], observations.select(np.unique(observations.trial)[:6]))
    for request, answers in zip((whitening, others), together([(whitening, points), (others, points)])):
        for values, (z, f) in zip(points, answers):
            alone, flights_alone = Whitening.at(model, points[0], request.observations)(values)
            np.testing.assert_allclose(z, alone, atol=CLOSE, rtol=CLOSE)
            np.testing.assert_allclose(f, flights_alone, atol=CLOSE, rtol=CLOSE)


@pytest.mark.parametrize(
    ("base", "effect"),
    [*(("mirtich", name) for name in effects_in(PLANE)), *((base, "wrong_inertia") for base in RESERVE)],
)
def test_effects_and_contacts_that_take_time_take_a_value_for_each_body(observations, base, effect):
    if EFFECTS[effect].applies_to(observations.rig):
        assert_the_same(Model(BASES[base], (EFFECTS[effect],), True), observations)


def test_fits_that_go_together_are_those_alone(observations):
    model = Model(BASES["wang_mason"], (), True)
    start = fit(model, observations, rounds=1).values
    trials = np.unique(observations.trial)
    parts = [observations.select(trials[trials % 3 != k]) for k in range(3)]
    for part, fitted in zip(parts, fit_each(model, [(part, start) for part in parts], rounds=1)):
        alone = fit(model, part, start, rounds=1)
        assert fitted.score == pytest.approx(alone.score, abs=1e-6)
        assert fitted.values == pytest.approx(alone.values, rel=1e-6)


@pytest.mark.slow
def test_a_first_round_may_take_the_noise_of_the_model_without_the_effect(observations):
    """It ends where the effect's own noise leads, or better: a start off the null errs, and takes that for scatter."""
    smaller = Drops(observations).fit("mirtich", (), effort="near")
    known = smaller.whitening.S, smaller.whitening.sigma_m
    for name in ("com_offset", "camera_pose", "lens"):
        model = smaller.model.limit.with_effect(EFFECTS[name])
        given, own = (fit(model, observations, smaller.values, 1, noise) for noise in (known, None))
        assert given.score > own.score - 0.5
        assert fit(model, observations, given.values).score - given.score < 1.0


def test_an_effect_is_worth_a_fit_where_it_acts_on_what_is_left(observations):
    world = Drops(observations)
    fitted = world.fit("mirtich", (), effort="near")
    near = replace(world.judge(fitted), excess=1.0, sigmas={"flight": 1.0, "meet": 1.0, "touch": 4.0})
    told = {name: world.leaves_little(fitted, near, effect) for name, effect in world.candidates.items()}
    assert {name for name, enough in told.items() if not enough} == {
        name for name, effect in world.candidates.items() if "touch" in effect.channels
    }
    far = replace(near, excess=2.0)
    assert not any(world.leaves_little(fitted, far, effect) for effect in world.candidates.values())


@pytest.mark.parametrize("name", ["lens", "curved_surface"])
def test_where_an_effect_is_absent_its_place_is_no_direction(observations, name):
    """Rounding as a column of the score test would be one more way to explain noise."""
    world = Drops(observations)
    fitted = world.fit("mirtich", (), effort="near")
    columns = world.slopes(fitted, [EFFECTS[name]]).candidates[name]
    assert columns[:, 0].any() and not columns[:, 1:].any()


def test_fits_and_judgements_by_several_processes_equal_those_of_one(observations, monkeypatch):
    monkeypatch.setattr(forked, "WORTH", 0.0)

    def results(jobs: int) -> tuple:
        world = Drops(observations)
        names, folds = ("wrong_inertia", "com_offset", "wrong_gravity"), np.arange(len(world.trials)) % 3
        with sharing(jobs):
            start = world.fit("mirtich", (), effort="near")
            asked = [("mirtich", (world.candidates[n],), start.values, effort) for n in names for effort in EFFORTS]
            fits = world.fits(asked)
            of = [world.quick if effort == "quick" else observations for *_, effort in asked]
            assert all(fitted.whitening.observations is o for fitted, o in zip(fits, of))
            slopes = world.slopes(start, list(world.candidates.values()))
            return fits, world.cross_validated(fits[:3], folds), slopes

    (fits, judged, slopes), (others, judged_by_others, other_slopes) = results(1), results(2)
    assert [(f.values, f.score, f.std) for f in fits] == [(f.values, f.score, f.std) for f in others]
    for one, other in zip(judged, judged_by_others, strict=True):
        np.testing.assert_array_equal(one.score, other.score)
        assert one.sigmas == other.sigmas
    for name, columns in slopes.candidates.items():
        np.testing.assert_array_equal(columns, other_slopes.candidates[name])
