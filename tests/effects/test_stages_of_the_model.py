"""The critique's model takes each effect through its stages as the small predictor of these tests does."""

import numpy as np
import pytest
from stage_predictor import predict

from thesis_lib.contact import LAWS
from thesis_lib.critique.contacts.kinds import bind
from thesis_lib.critique.contacts.model import Model
from thesis_lib.effects import Effect, effects_in
from thesis_lib.extensions.effect_probe import EPSILON, MU, RIGS, TAU, at_scale, random_states
from thesis_lib.mechanics.space import PLANE

LAW = "anitescu_potra_newton"
ROUNDING = 1e-9  # the two order their sums differently


@pytest.mark.parametrize("effect", effects_in(PLANE).values(), ids=lambda effect: effect.name)
@pytest.mark.parametrize("tau", [0.0, TAU])
def test_velocity_and_gap_at_impact(effect: Effect, tau: float) -> None:
    rig = RIGS["quadrilateral"]
    states = random_states(rig, 300, np.random.default_rng(2))
    model, p = Model(LAWS[LAW], (effect,), takes_time=tau > 0.0), at_scale(effect)
    values = {"mu": MU, "epsilon": EPSILON, "tau": tau} | {f"{effect.name}.{name}": value for name, value in p.items()}
    dynamics = bind(model, values, rig)
    after, depth = dynamics.strike(states)
    gap = dynamics.gap(dynamics.to_true(states))
    expected = predict([(effect, p)], states, rig, LAW, contact_time=tau)
    np.testing.assert_allclose(after.v, expected.impact, atol=ROUNDING)
    np.testing.assert_allclose(gap + depth, expected.touch, atol=ROUNDING)
