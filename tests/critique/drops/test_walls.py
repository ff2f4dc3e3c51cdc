"""Between walls: which wall differs, and how, is found; an unknown spin neither passes for a cause nor hides one."""

import numpy as np
import pytest

from thesis_lib.contact import mirtich
from thesis_lib.critique import criticise
from thesis_lib.critique.contacts.model import Model
from thesis_lib.critique.drops.criticise import criticise_drops
from thesis_lib.critique.drops.settings import CritiqueSettings
from thesis_lib.critique.drops.sliding import TABLE
from thesis_lib.critique.drops.world import Drops
from thesis_lib.critique.export.export import exported
from thesis_lib.critique.likelihood.comparison import Comparison
from thesis_lib.critique.likelihood.observations import observe
from thesis_lib.critique.results.saved_model import SavedModel
from thesis_lib.critique.simulation.simulate_model import simulate_model
from thesis_lib.effects import EFFECTS, require_known
from thesis_lib.effects.at_wall import AT_ONE_WALL, AtWall
from thesis_lib.effects.effect import Effect
from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.table.mujoco_puck import slide_in_mujoco
from thesis_lib.simulate.table.puck import CUSHIONS, EPSILON, FRICTION, MU, RADIUS, simulate_puck

STUCK = 2.0  # a friction with which every rim sticks
ROUNDED = 1e-5  # relative: seven nodes give the variance of a straight line exactly, dataset.yaml k to six digits


@pytest.fixture(scope="module")
def observations():
    return observe(simulate_puck("puck", "nothing", trials=25))


def test_a_rim_that_sticks_scatters_by_a_third_of_the_unknown_rim_speed(observations) -> None:
    # v_x⁺ = v_x − (v_x + R ω)/K_tt with K_tt = 1 + R²/k² = 3
    values = {"mu": STUCK, "epsilon": EPSILON, "tau": 0.0, "a_table": FRICTION}
    here = Comparison(Model(mirtich.LAW, (), True, (TABLE,)), values, observations)
    cov = here.of_spin
    third = (RADIUS * observations.spin / 3.0) ** 2
    assert np.median(cov[:, 0, 0]) == pytest.approx(third, rel=ROUNDED)
    assert cov[:, 0, 0].max() < third * (1.0 + ROUNDED)  # where the widest spins slide all the same
    assert cov[:, 1, 1].max() < 1e-20  # nothing of it across the wall
    # an error along the wall is then the spin's but for the share of noise, one across it is the model's
    left = here.what_is_left
    noise = here.covariance(observations.t_std) - cov
    assert np.median(left[:, 0, 0]) == pytest.approx(np.median(noise[:, 0, 0] / (noise + cov)[:, 0, 0]), rel=0.2)
    assert np.median(left[:, 0, 0]) < 0.1 < 0.9 < np.median(left[:, 1, 1])


def test_without_friction_the_spin_does_nothing(observations) -> None:
    values = {"mu": 0.0, "epsilon": EPSILON, "tau": 0.0, "a_table": FRICTION}
    model = Model(mirtich.LAW, (), True, (TABLE,))
    assert np.abs(Comparison(model, values, observations).of_spin[:, :2, :2]).max() < 1e-20
    # then an error along the wall counts in full
    left = Comparison(model, values, observations).velocity_left
    assert np.abs(left[:, 0]).mean() > 0.1


def test_what_only_the_angle_shows_is_not_tested_and_said(observations) -> None:
    world = Drops(observations)
    for name in ("magnus", "mirrored_rotation", "com_offset", "marker_offset", "tangential_restitution"):
        assert "theta is not measured" in world.not_testable[name]
    assert "walls" in world.not_testable["position_dependent_restitution"]
    assert "gravity" in world.not_testable["surface_tilt"]
    assert {"other_restitution_at_east", "velocity_dependent_restitution_at_south"} <= set(world.candidates)


def test_what_needs_a_falling_body_is_refused_for_a_puck_with_the_reason() -> None:
    rig = {"shape": {"kind": "disk", "radius": RADIUS}, "radius_of_gyration": RADIUS / 2**0.5, "gravity": 0.0}
    numbers = {"mu": {"value": MU, "unit": "1"}, "epsilon": {"value": EPSILON, "unit": "1"}}
    content = {"schema": 1, "law": "mirtich", "effects": (), "parameters": numbers, "rig": rig | {"height": 0.0}}
    level = SavedModel.model_validate(content)
    turning = SavedModel.model_validate(content | {"rig": content["rig"] | {"gravity": 9.81, "has_angle": False}})
    boxed = SavedModel.model_validate(content | {"rig": content["rig"] | {"gravity": 9.81, "walls": CUSHIONS}})
    for model, reason in ((level, "no gravity"), (turning, "theta was not measured"), (boxed, "there are walls")):
        for what in (lambda m: exported(m, "mjcf"), lambda m: simulate_model(m, rng=np.random.default_rng(0))):
            with pytest.raises(UserError, match=reason):
                what(model)
    with pytest.raises(UserError, match="--models needs a body that falls"):
        criticise(simulate_puck("puck", "nothing", trials=3), models=("laws",))


@pytest.mark.parametrize("name", AT_ONE_WALL)
def test_an_effect_at_one_wall_acts_there_alone(observations, name: str) -> None:
    effect = EFFECTS[f"{name}_at_west"]
    values = {"mu": MU, "epsilon": EPSILON, "tau": 5e-4, "a_table": FRICTION}
    model = Model(mirtich.LAW, (effect,), True, (TABLE,))

    def left(size: float) -> np.ndarray:
        at = {f"{effect.name}.{p.name}": p.null + size * (p.high - p.null) for p in effect.parameters}
        return Comparison(model, values | at, observations).R

    at_null, at_size = left(0.0), left(0.3)
    plain = Comparison(Model(mirtich.LAW, (), True, (TABLE,)), values, observations).R
    np.testing.assert_array_equal(at_null, plain)
    west = [wall.name for wall in observations.rig.walls].index("west")
    changed = np.abs(at_size - plain).max(axis=1) > 1e-9
    assert changed.any() and (observations.surface[changed] == west).all()


@pytest.mark.parametrize("effect", AT_ONE_WALL.values(), ids=AT_ONE_WALL)
def test_all_of_an_effect_acts_at_its_wall(effect: Effect) -> None:
    hooks = {name for name, value in vars(Effect).items() if callable(value) and not name.startswith("_")}
    of_effect = {name for name in hooks if getattr(type(effect), name) is not getattr(Effect, name)}
    assert of_effect <= set(vars(AtWall))


def test_no_effect_has_the_name_of_one_at_a_wall() -> None:
    assert "other_restitution_at_north" in EFFECTS
    assert "other_restitution_at_north" not in list(EFFECTS)
    assert "magnus_at_north" not in EFFECTS
    assert "other_restitution_at_the north" not in EFFECTS
    with pytest.raises(KeyError):
        EFFECTS["other_restitution"]


def test_an_effect_at_a_wall_that_is_not_there_is_refused_with_the_walls_that_are() -> None:
    with pytest.raises(UserError, match="no wall 'nowhere' for the effect other_restitution_at_nowhere: the walls are"):
        puck = simulate_puck("puck", "nothing", trials=2)
        criticise_drops(puck, rng=np.random.default_rng(0), effects=["other_restitution_at_nowhere"])
    require_known(["other_restitution_at_west", "magnus"], CUSHIONS)
    with pytest.raises(UserError, match="there are no walls"):
        require_known(["other_friction_at_west"], ())


@pytest.mark.slow
def test_four_like_cushions_are_adequate() -> None:
    found = criticise_drops(simulate_puck("puck", "nothing", seed=0), rng=np.random.default_rng(0))
    values = found.ladder[-1][1].values
    assert found.verdict == "adequate"
    assert values["epsilon"] == pytest.approx(EPSILON, abs=2e-3)
    assert values["a_table"] == pytest.approx(FRICTION, abs=5e-3)
    assert values["mu"] == pytest.approx(MU, abs=0.015)  # of a spin that nobody knows


@pytest.mark.slow
@pytest.mark.parametrize(
    ("hidden", "name"),
    [
        ("quick_cushion", "velocity_dependent_restitution_at_east"),
        ("dead_cushion", "other_restitution_at_east"),
        ("shifted_cushion", "surface_height_at_east"),
    ],
)
def test_the_cause_and_the_cushion_are_named(hidden: str, name: str) -> None:
    found = criticise_drops(simulate_puck("puck", hidden, seed=0), rng=np.random.default_rng(0))
    assert found.verdict == "effects"
    assert [step.effect.name for step in found.discovery.steps] == [name]
    assert found.discovery.steps[0].alternatives == ()


@pytest.mark.slow
def test_another_simulators_cushion_is_named_with_its_size() -> None:
    """MuJoCo's friction pushes a sliding puck off the cushion, so that the verdict may be `unexplained` beside it."""
    dataset = simulate_puck("puck", "dead_cushion", trials=30, move=slide_in_mujoco)
    found = criticise_drops(
        dataset, rng=np.random.default_rng(0), settings=CritiqueSettings(finalists=2, max_effects=1)
    )
    (step,) = found.discovery.steps
    assert step.effect.name in ("other_restitution_at_east", "velocity_dependent_restitution_at_east")
    assert found.ladder[-1][1].values[f"{step.effect.name}.d"] == pytest.approx(-0.08 / EPSILON, abs=0.01)
