"""Each check of the effects' contract finds the mistake that it is about, and says it so that it can be mended."""

import re
from dataclasses import replace

import numpy as np
import pytest

from thesis_lib.effects import EFFECTS
from thesis_lib.effects.effect import ONLY_SPACE, Effect, Parameter
from thesis_lib.extensions.contract import CheckResult, outcomes
from thesis_lib.extensions.effect_contract import EFFECT_CHECKS, checks_of

H = Parameter("h", "1", null=0.0, low=-0.5, high=0.5, scale=0.1)


class Right(Effect):
    """ε ← clip(ε (1 + h |v_t| / (1 + |v_t|)), 0, 1)."""

    name = "right"
    family = "contact_law"
    title = "an effect without mistakes"
    equation = "ε = ε₀ (1 + h |v_t| / (1 m/s + |v_t|))"
    parameters = (H,)
    reference = "a source"

    def coefficients(self, mu, epsilon, contact, state, p, rig):
        speed = np.abs(contact.v_t)
        return mu, np.clip(epsilon * (1.0 + p["h"] * speed / (1.0 + speed)), 0.0, 1.0)


def of(effect: Effect) -> dict[str, CheckResult]:
    return {outcome.check: outcome for outcome in outcomes(EFFECT_CHECKS, effect)}


class NoIdentity(Right):
    def coefficients(self, mu, epsilon, contact, state, p, rig):
        return mu, np.clip(epsilon * (0.9 + p["h"]), 0.0, 1.0)


class NoInverse(Right):
    def to_contact(self, state, p, rig):
        return state.moved(vx=state.vx + p["h"])


class Writes(Right):
    def coefficients(self, mu, epsilon, contact, state, p, rig):
        epsilon *= 1.0 + p["h"] * 0.1
        return mu, epsilon


class Branches(Right):
    def coefficients(self, mu, epsilon, contact, state, p, rig):
        return super().coefficients(mu, epsilon, contact, state, p, rig) if p["h"] > 0.0 else (mu, epsilon)


class Unbounded(Right):
    def coefficients(self, mu, epsilon, contact, state, p, rig):
        return mu, epsilon * (1.0 + 3.0 * p["h"] * np.abs(contact.v_t))


class Infinite(Right):
    def acceleration(self, a, state, p, rig):
        return a / (1.0 - (p["h"] == 0.5))


class OtherChannel(Right):
    def acceleration(self, a, state, p, rig):
        return a * (1.0 + p["h"])


class FromZero(Right):
    breaks_mirror = True

    def coefficients(self, mu, epsilon, contact, state, p, rig):
        return mu, np.clip(epsilon * (1.0 + p["h"] * np.tanh(state.x)), 0.0, 1.0)


class Unsaid(Right):
    def coefficients(self, mu, epsilon, contact, state, p, rig):
        return mu, np.clip(epsilon * (1.0 + 1e-3 * p["h"] * (state.trial - rig.reference.trial)), 0.0, 1.0)


class SaidInVain(Right):
    along = ("t",)


class Weak(Right):
    parameters = (replace(H, scale=1e-4),)


class Nothing(Right):
    def coefficients(self, mu, epsilon, contact, state, p, rig):
        return mu, epsilon


class NotOnDisks(Right):
    def applies_to(self, rig):
        return rig.shape.kind == "polygon"


class LeftIsRight(Right):
    def coefficients(self, mu, epsilon, contact, state, p, rig):
        return mu, np.clip(epsilon * (1.0 + p["h"] * np.tanh(contact.v_t)), 0.0, 1.0)


class SaysLeftIsNotRight(Right):
    breaks_mirror = True


class Forgets(Right):
    def coefficients(self, mu, epsilon, contact, state, p, rig):
        return np.full_like(mu, 0.25 * (1.0 + p["h"])), np.full_like(epsilon, 0.55)


class Remembers(Right):
    calls = 0

    def coefficients(self, mu, epsilon, contact, state, p, rig):
        self.calls += 1
        return mu, np.clip(epsilon * (1.0 + 0.1 * p["h"] * self.calls), 0.0, 1.0)


class Short(Right):
    def coefficients(self, mu, epsilon, contact, state, p, rig):
        return mu[0], epsilon[0]


class Crashes(Right):
    def coefficients(self, mu, epsilon, contact, state, p, rig):
        return mu, epsilon * p["x"]


class Wordless(Right):
    reference = ""


class WrongLimits(Right):
    parameters = (replace(H, null=0.7),)


class WrongChannel(Right):
    channels = ("speed",)


class OfNoSpace(Right):
    dimensions = frozenset({4})


class NoSetOfSpaces(Right):
    dimensions = 3


class InSpace(Right):
    dimensions = ONLY_SPACE


class OtherChannelInSpace(InSpace):
    channels = ("impact", "flight")


class NothingInSpace(Nothing):
    dimensions = ONLY_SPACE


class SlidesInSpace(InSpace):
    channels = ("slide",)

    def coefficients(self, mu, epsilon, contact, state, p, rig):
        return mu, epsilon

    def sliding(self, mu, contact, state, p, rig):
        return mu * (1.0 + p["h"])


@pytest.mark.parametrize(
    ("wrong", "check", "says"),
    [
        (WrongLimits, "limits that make sense", "parameter h: null 0.7 must lie between low -0.5 and high 0.5"),
        (WrongChannel, "limits that make sense", "impact, meet, touch, flight"),
        (Wordless, "names a source", "table of symbols"),
        (NoIdentity, "nothing at its null", "coefficients with all parameters at null .* off by up to 0.055"),
        (Short, "nothing at its null", r"shape \(\) instead of \(300,\)"),
        (NoInverse, "undoes its own maps", "from_contact must undo to_contact"),
        (Writes, "leaves its arguments", "coefficients changes its arguments"),
        (Branches, "a value for each body", "use NumPy|ambiguous"),
        (Unbounded, "finite within its bounds", "ε outside 0 to 1 at h = .*; clip"),
        (Infinite, "finite within its bounds", "the flight is not finite at h = 0.5"),
        (OtherChannel, "no other", "it changes the channel flight"),
        (Weak, "no other", "it names the channel impact, but"),
        (NotOnDisks, "does not apply", "refuses a disk, but there it changes the impact"),
        (LeftIsRight, "mirrored outcome", "breaks_mirror = True"),
        (SaysLeftIsNotRight, "mirrored outcome", "remove that line"),
        (FromZero, "from the reference", r"coefficients must not .*state\.x - rig\.reference\.x.* off by"),
        (Unsaid, "from the reference", r'counts trial .* along = \("trial",\)'),
        (SaidInVain, "from the reference", "along names t, but nothing"),
        (Forgets, "together with", "it removes the influence of .* on the impact"),
        (Remembers, "whatever order", "the impact differs if it is added first or last"),
        (Crashes, "nothing at its null", r"KeyError: 'x' \(test_effect_contract.py, line \d+\)"),
    ],
)
def test_a_mistake_is_found_and_named(wrong: type[Effect], check: str, says: str) -> None:
    (outcome,) = outcomes([one for one in EFFECT_CHECKS if check in one.name], wrong())
    assert outcome.verdict == "FAIL" and re.search(says, outcome.reason), outcome


@pytest.mark.parametrize("wrong", [OfNoSpace, NoSetOfSpaces])
def test_an_effect_is_defined_in_the_plane_or_in_space(wrong: type[Effect]) -> None:
    (outcome,) = outcomes(checks_of(wrong()), wrong())
    assert outcome.verdict == "FAIL" and "they must be {2}, {3} or {2, 3}" in outcome.reason


@pytest.mark.parametrize(
    ("effect", "verdict"),
    [(InSpace, "pass"), (SlidesInSpace, "pass"), (OtherChannelInSpace, "FAIL"), (NothingInSpace, "to do")],
)
def test_an_effect_of_space_alone_acts_in_its_channels(effect: type[Effect], verdict: str) -> None:
    (outcome,) = [o for o in outcomes(checks_of(effect()), effect()) if "declared channels" in o.check]
    assert outcome.verdict == verdict


def test_an_effect_without_mistakes_passes_all_but_the_table_of_symbols() -> None:
    # the one that this file has not
    failed = {name for name, outcome in of(Right()).items() if outcome.verdict != "pass"}
    assert failed == {check.name for check in EFFECT_CHECKS if check.describes}


def test_an_effect_that_does_nothing_yet_is_no_mistake() -> None:
    (outcome,) = [o for o in of(Nothing()).values() if o.verdict != "pass" and "symbols" not in o.check]
    assert outcome.verdict == "to do" and "hooks" in outcome.reason


def test_checks_leave_the_library_as_it_is() -> None:
    before = dict(EFFECTS)
    of(Right())
    assert before == EFFECTS
