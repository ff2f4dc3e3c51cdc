"""Bodies that lie still or slide on the surface: what they show that impacts do not, and only where it is asked for."""

from dataclasses import replace
from functools import cache

import numpy as np
import pandas as pd
import pytest

from thesis_lib.bodies.body import Body, Noise
from thesis_lib.bodies.shapes import Disk, Ellipse, Polygon
from thesis_lib.contact import LAWS
from thesis_lib.critique.contacts.kinds import bind
from thesis_lib.critique.contacts.model import Model
from thesis_lib.critique.drops import world
from thesis_lib.critique.drops.criticise import criticise_drops
from thesis_lib.critique.drops.settings import CritiqueSettings
from thesis_lib.critique.likelihood.channels import CHANNELS, REST, SLIDE, concerned
from thesis_lib.critique.likelihood.comparison import Comparison
from thesis_lib.critique.likelihood.fit import fit
from thesis_lib.critique.likelihood.observations import Observations, observe
from thesis_lib.critique.likelihood.synthesis import synthesise
from thesis_lib.critique.results.diagnosis import diagnosis
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.effects import EFFECTS
from thesis_lib.simulate.compliant.drops import simulate_compliant_drops
from thesis_lib.simulate.rig.hidden_causes import PROOF_RELEASE, HiddenCauses

HALF = 0.03  # m
CORNERS = ((HALF, HALF), (-HALF, HALF), (-HALF, -HALF), (HALF, -HALF))
SQUARE = Body(shape=Polygon(vertices=CORNERS), mass=0.1, radius_of_gyration=HALF * np.sqrt(2.0 / 3.0))
NOISE = Noise(position=3e-4, angle=3e-3)
RATE, GRAVITY = 250.0, 9.81
MU = 0.15  # of the simulated contact, and of the slides
DROPS = 40
OFFSET = 0.033  # rad: as of the published die
SPREAD = np.array([3e-4, 3e-3])  # m, rad: of rests beyond the noise of many samples
BOTH = ("rest", "slide")


@cache
def that_end_at_rest(offset: float = 0.0, higher: float = 0.0, seed: int = 0, sliding: float = MU) -> Dataset:
    """Simulated drops, each followed by 40 samples in which the body slides and 30 in which it lies."""
    rng = np.random.default_rng(seed)
    hidden = HiddenCauses(angle_offset=offset, surface_height=higher)
    made = simulate_compliant_drops(SQUARE, PROOF_RELEASE, DROPS, hidden=hidden, noise=NOISE, rng=rng)
    parts = [made.trajectories]
    for trial, drop in made.trajectories.groupby("trial"):
        last = drop.iloc[-1]
        up, lean = rng.normal(0.0, SPREAD)
        pose = [last.x, HALF + higher + up, float(SQUARE.shape.lying(np.array([last.theta]))[0]) + offset + lean]
        tau = np.arange(40) / RATE
        way = rng.choice([-1.0, 1.0]) * (0.9 * tau - 0.5 * sliding * GRAVITY * tau**2)
        for start, x in ((0.2, pose[0] + way), (1.0, np.full(30, pose[0] + way[-1]))):
            q = np.column_stack([x, np.full(len(x), pose[1]), np.full(len(x), pose[2])])
            q += rng.normal(size=q.shape) * [NOISE.position, NOISE.position, NOISE.angle]
            t = last.t + start + np.arange(len(x)) / RATE
            parts.append(pd.DataFrame({"trial": trial, "t": t, **dict(zip(("x", "y", "theta"), q.T))}))
    return Dataset("rests", made.header, pd.concat(parts).sort_values(["trial", "t"], ignore_index=True))


def supports(o: Observations) -> dict:
    return {beside.channel: beside for beside in o.supports}


def test_a_body_lies_on_the_sides_that_its_centre_is_above():
    theta = np.array([0.1, 1.5, -3.0, 7.0])
    assert SQUARE.shape.lying(theta) == pytest.approx(np.round(theta / (np.pi / 2)) * np.pi / 2)
    flat, tall = Ellipse(semi_axes=(0.03, 0.02)), Ellipse(semi_axes=(0.02, 0.03))
    assert flat.lying(np.array([0.2, 3.0])) == pytest.approx([0.0, np.pi])
    assert tall.lying(np.array([1.4])) == pytest.approx([np.pi / 2])
    assert Disk(radius=0.03).lying(theta) is theta
    # the origin of a leaning wedge is above its long side only
    wedge = Polygon(vertices=((-0.01, -0.01), (0.05, -0.01), (0.06, 0.02)))
    for angle in wedge.lying(np.linspace(-3.0, 3.0, 13)):
        turned = np.array(wedge.vertices) @ np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        lowest = np.sort(turned[:, 1])[:2]
        assert np.ptp(lowest) < 1e-12 and turned[np.argsort(turned[:, 1])[:2], 0].prod() < 0.0


def test_they_are_evidence_only_where_they_are_asked_for():
    data = that_end_at_rest()
    plain, both = observe(data), observe(data, channels=BOTH)
    assert plain.supports == () and CritiqueSettings().channels == ()
    assert set(supports(both)) == set(BOTH) and all(DROPS >= len(beside) > 0.8 * DROPS for beside in both.supports)
    assert len(plain) == len(both) and len(plain.flights) == len(both.flights)
    some = both.select(np.array([3, 5]))
    assert some.supports and all(set(beside.trial) <= {3, 5} for beside in some.supports)
    assert set(supports(some.single)) == set(supports(some))


def test_noise_and_scatter_make_up_what_rests_and_slides_leave_measured_or_drawn_from_a_model():
    o = observe(that_end_at_rest(), channels=BOTH)
    model, values = Model(LAWS["mirtich"]), {"mu": MU, "epsilon": 0.5}
    turned, at = model.with_effect(EFFECTS["angle_offset"]), {"mu": 0.1, "epsilon": 0.5, "angle_offset.d_theta": 0.05}
    drawn = synthesise(Comparison(turned, at, o), np.random.default_rng(0))
    for of, dynamics in ((o, bind(model, values, o.rig)), (drawn, bind(turned, at, o.rig))):
        for beside in of.supports:
            z = beside.residuals(dynamics) / np.sqrt(beside.variance)
            assert 0.7 < z.std() < (1.4 if of is o else 1.3) and np.abs(z.mean(axis=0)).max() < 4.0 / np.sqrt(DROPS)
    rest = supports(o)["rest"]
    assert np.sqrt(rest.variance) == pytest.approx(np.tile(SPREAD, (len(rest), 1)), rel=0.5)


def test_rests_tell_angle_height_and_mirror_and_nothing_of_rounding():
    o = observe(that_end_at_rest(), channels=("rest",))
    (rest,) = o.supports
    bare = rest.residuals(bind(Model(LAWS["mirtich"]), {}, o.rig))

    def moved(name: str, **p: float) -> np.ndarray:
        model = Model(LAWS["mirtich"], (EFFECTS[name],))
        return rest.residuals(bind(model, {f"{name}.{key}": value for key, value in p.items()}, o.rig)) - bare

    assert moved("angle_offset", d_theta=0.02) == pytest.approx(np.tile([0.0, -0.02], (len(rest), 1)), abs=1e-9)
    assert moved("surface_height", h=1e-3) == pytest.approx(np.tile([-1e-3, 0.0], (len(rest), 1)), abs=1e-9)
    assert np.abs(moved("rounded_corners", rho=2e-3)).max() < 1e-12
    (p,) = EFFECTS["mirrored_rotation"].parameters
    assert (moved("mirrored_rotation", **{p.name: p.discrete}) + bare)[:, 1] == pytest.approx(-bare[:, 1])


def test_a_channel_concerns_the_effects_that_change_what_it_compares():
    named = {name: {c.name for c in (REST, SLIDE) if c.concerns(effect)} for name, effect in EFFECTS.items()}
    assert named["angle_offset"] == {"rest", "slide"} and named["surface_height"] == {"rest"}
    assert named["position_dependent_friction"] == named["sliding_friction"] == {"slide"}
    assert named["wrong_inertia"] == set()
    for effect in EFFECTS.values():  # what effects declare stands as it did
        assert set(concerned(effect)) - set(BOTH) == set(effect.channels) - set(BOTH)
        assert set(effect.channels) <= set(CHANNELS)


@pytest.mark.slow
def test_slides_tell_friction():
    data = that_end_at_rest()
    o = observe(data, channels=("slide",))
    (slide,) = o.supports
    # as precise as the slides are beside the impacts; their residuals are −g sgn(v) for each unit of μ
    alone, both = (fit(Model(LAWS["mirtich"]), part) for part in (observe(data), o))
    information = alone.std["mu"] ** -2 + float(np.sum(GRAVITY**2 / slide.variance))
    assert both.std["mu"] == pytest.approx(information**-0.5, rel=0.35)
    assert abs(both.values["mu"] - MU) < 3.0 * both.std["mu"]


def test_a_friction_of_slides_alone_is_given_back_beside_that_of_impacts():
    o = observe(that_end_at_rest(sliding=0.22), channels=("slide",))
    effect, (slide,) = EFFECTS["sliding_friction"], o.supports
    model, without = Model(LAWS["mirtich"], (effect,)), fit(Model(LAWS["mirtich"]), replace(o, supports=()))
    found = fit(model, o)
    assert abs(found.values["sliding_friction.mu_s"] - 0.22) < 3.0 * found.std["sliding_friction.mu_s"] < 0.03
    # impacts are as they were, and where both frictions are equal the effect is absent
    assert found.values["mu"] == pytest.approx(without.values["mu"], rel=1e-3)
    at_null = without.values | {"sliding_friction.mu_s": without.values["mu"]}
    models = bind(model, at_null, o.rig), bind(without.model, without.values, o.rig)
    np.testing.assert_array_equal(*map(slide.residuals, models))
    assert effect.parameters[0].absent_at(without.values) == without.values["mu"]


def test_no_friction_of_slides_is_tested_where_nothing_slides():
    data = that_end_at_rest()
    for channels, testable in ((("rest",), False), (BOTH, True)):
        names, why_not = world.testable_effects(observe(data, channels=channels), timed=True)
        assert ("sliding_friction" in names) is testable
        assert ("slides" in why_not.get("sliding_friction", "")) is not testable


def test_rests_that_share_their_error_count_less():
    """Where the camera moved between two sessions, the mean of all heights is known as that of few: here a sixth."""
    data = that_end_at_rest()
    table = data.trajectories
    moved = table.assign(y=table.y + 2e-3 * (table.trial >= DROPS // 2))
    (apart,), (still,) = (observe(replace(data, trajectories=t), channels=("rest",)).supports for t in (moved, table))
    std = [np.sqrt(rest.variance[:, 0].mean() / DROPS) for rest in (apart, still)]
    half = 1e-3  # m, of the step: the spread of all heights
    assert 2.0 < std[0] / (half / np.sqrt(DROPS)) < 3.0
    assert std[1] < 2.0 * SPREAD[0] / np.sqrt(DROPS)
    turned = [rest.variance[:, 1] for rest in (apart, still)]
    np.testing.assert_allclose(*turned, rtol=1e-9)


@pytest.mark.slow
def test_a_turned_frame_is_named_through_rests():
    data, settings = that_end_at_rest(OFFSET), CritiqueSettings(channels=("rest",), episodes=False)
    critique = criticise_drops(data, rng=np.random.default_rng(1), settings=settings)
    content = diagnosis(critique, np.random.default_rng(0))
    assert [effect["name"] for effect in content["effects"]] == ["angle_offset"]
    assert "rest" in content["effects"][0]["material_in"] and content["error"]["rest"]["augmented"] < 1.5
    final = critique.ladder[-1][1]
    assert abs(final.values["angle_offset.d_theta"] - OFFSET) < 3.0 * final.std["angle_offset.d_theta"]
    plain = CritiqueSettings(episodes=False)
    not_asked = criticise_drops(data, rng=np.random.default_rng(1), settings=plain, effects=())
    assert "rest" not in diagnosis(not_asked, np.random.default_rng(0))["error"]


@pytest.mark.slow
def test_a_friction_of_slides_alone_is_named():
    settings = CritiqueSettings(channels=BOTH, episodes=False)
    critique = criticise_drops(that_end_at_rest(sliding=0.22), rng=np.random.default_rng(1), settings=settings)
    final = critique.ladder[-1][1]
    assert [effect.name for effect in final.effects] == ["sliding_friction"] and critique.verdict == "effects"
    content = diagnosis(critique, np.random.default_rng(0))["effects"][0]
    assert content["material_in"] == ["slide"] and abs(content["parameters"]["mu_s"]["value"] - 0.22) < 0.01
    assert abs(final.values["mu"] - MU) < 3.0 * final.std["mu"]
