"""Effects that live in space pass the checks there, and these find what is wrong."""

import pytest

from thesis_lib.effects import EFFECTS
from thesis_lib.effects.length_scale import LengthScale
from thesis_lib.effects.linear_drag import LinearDrag
from thesis_lib.effects.marker_offset import MarkerOffset
from thesis_lib.extensions.contract import outcomes
from thesis_lib.extensions.effect_contract import EFFECT_CHECKS, checks_of
from thesis_lib.extensions.effect_in_space import SPACE_EFFECT_CHECKS


class AlongX(LinearDrag):
    def acceleration(self, a, state, p, rig):
        slowed = a.copy()
        slowed[0] -= p["c_v"] * state.velocity[0]
        return slowed


class OneWay(MarkerOffset):
    def to_measured(self, state, p, rig):
        return state


class AlwaysThere(LinearDrag):
    def acceleration(self, a, state, p, rig):
        return a + (0.0 if state.space.is_plane else 0.01)


class OtherInSpace(LengthScale):
    def to_true(self, state, p, rig):
        made = super().to_true(state, p, rig)
        return made if state.space.is_plane else super().to_true(made, p, rig)

    def to_measured(self, state, p, rig):
        made = super().to_measured(state, p, rig)
        return made if state.space.is_plane else super().to_measured(made, p, rig)


@pytest.mark.parametrize(
    "wrong, check",
    [(AlongX(), "horizontal"), (OneWay(), "undoes"), (AlwaysThere(), "null"), (OtherInSpace(), "plane as a case")],
)
def test_a_mistake_in_space_is_found(wrong, check) -> None:
    failed = [outcome.check for outcome in outcomes(checks_of(wrong), wrong) if outcome.verdict == "FAIL"]
    assert any(check in name for name in failed)


@pytest.mark.parametrize("name", [name for name, effect in EFFECTS.items() if 3 in effect.dimensions])
def test_the_librarys_effects_pass(name: str) -> None:
    assert checks_of(EFFECTS[name])[-len(SPACE_EFFECT_CHECKS) :] == SPACE_EFFECT_CHECKS
    failed = [outcome for outcome in outcomes(SPACE_EFFECT_CHECKS, EFFECTS[name]) if outcome.verdict != "pass"]
    assert not failed


def test_effects_of_the_plane_are_not_asked() -> None:
    assert checks_of(EFFECTS["lens"]) == EFFECT_CHECKS
