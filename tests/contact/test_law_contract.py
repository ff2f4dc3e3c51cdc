"""Each check of the laws' contract finds the mistake that it is about, and says it so that it can be mended."""

import re
from collections.abc import Callable
from dataclasses import replace
from types import MappingProxyType

import numpy as np
import pytest

from thesis_lib.contact import LAWS, Law, Promise
from thesis_lib.extensions.contract import outcomes
from thesis_lib.extensions.law_contract import LAW_CHECKS, SPACE_CHECKS, checks_of

RIGHT, WHITTAKER, CONE = LAWS["wang_mason"], LAWS["whittaker"], LAWS["anitescu_potra_newton"]


def changed(change: Callable) -> Law:
    """Wang-Mason with another impulse: `change` is given the space, the parameters and the right impulse."""
    return replace(RIGHT, impulse=lambda s, mu, e: change(s, mu, e, *RIGHT.impulse(s, mu, e)))


def writes(s, mu, e, c_t, c_n):
    mu *= 1.0
    s.v_t[...] = 0.0
    return c_t, c_n


@pytest.mark.parametrize(
    ("wrong", "check", "says"),
    [
        (replace(RIGHT, reference=""), "states its source", "title and reference"),
        (replace(RIGHT, promises=frozenset()), "states its source", "breaks contains Promise.CENTRAL"),
        (replace(RIGHT, breaks={Promise.STICKS: 0.1}), "states its source", "both contain Promise.STICKS"),
        (changed(lambda s, mu, e, t, n: (t, np.where(s.v_t > 2.0, np.nan, n))), "solves every", "not finite in"),
        (changed(lambda s, mu, e, t, n: (t, n * (1.0 + 1e-6))), "keeps its promises", "move it to breaks"),
        (
            replace(WHITTAKER, breaks=MappingProxyType({**WHITTAKER.breaks, Promise.FRICTION_CONE: 0.2})),
            "keeps its promises",
            r"in a share of 0.2 of impacts; measured: 0.0\d",
        ),
        (changed(lambda s, mu, e, t, n: (t + 1e-3 * n, n)), "mirrored", "in 20000 of 20000"),
        (changed(lambda s, mu, e, t, n: (t, n * (1.0 + 0.1 * s.K_nn))), "units", "a constant in it has a unit"),
        (changed(lambda s, mu, e, t, n: (t, n * 0.99)), "keeps the energy", "it is frictionless there"),
        (changed(lambda s, mu, e, t, n: (t, n + np.mean(n))), "grids of", "an impact alone"),
        (changed(writes), "arguments", "impulse writes into its arguments"),
        (changed(lambda s, mu, e, t, n: (t, -n)), "does not approach", "must be pushed"),
        (changed(lambda s, mu, e, t, n: (t, n + 0.0 * np.sum(n))), "invalid", "the others must be resolved"),
        (changed(lambda s, mu, e, t, n: (t, n if mu > 0.1 else 0.0 * n)), "grids of", "ambiguous"),
    ],
)
def test_a_mistake_is_found_and_named(wrong: Law, check: str, says: str) -> None:
    (outcome,) = outcomes([one for one in LAW_CHECKS if check in one.name], wrong)
    assert outcome.verdict == "FAIL" and re.search(says, outcome.reason), outcome


def in_space(change: Callable) -> Law:
    """AP Newton with another impulse in space: `change` is given the contact, the parameters and the right impulse."""

    def impulse(s, mu, e):
        right = CONE.impulse(s, mu, e)
        return right if s.dimension == 2 else change(s, mu, e, *right)

    return replace(CONE, impulse=impulse)


@pytest.mark.parametrize(
    ("wrong", "check", "says"),
    [
        (replace(CONE, breaks_in_space={}), "states its source", "how often it breaks Promise.NO_ENERGY_GAIN in space"),
        (replace(CONE, dimensions=frozenset({4})), "states its source", "dimensions must be"),
        (in_space(lambda s, mu, e, a, b, n: (a, n)), "states its", r"return \(c_t1, c_t2, c_n\), not 2 arrays"),
        (
            in_space(lambda s, mu, e, a, b, n: (a, b, np.where(s.v[0] > 2.0, np.nan, n))),
            "solves every",
            "not finite in",
        ),
        (in_space(lambda s, mu, e, a, b, n: (a, b, n * (1.0 + 1e-6))), "keeps its", "add it to breaks_in_space"),
        (
            replace(CONE, breaks_in_space=MappingProxyType({Promise.NO_ENERGY_GAIN: 0.2})),
            "in space, keeps its",
            r"in a share of 0.2 of impacts; measured: 0.0\d",
        ),
        (in_space(lambda s, mu, e, a, b, n: (a + 1e-3 * n, b, n)), "mirrored", "in 2000 of 2000"),
        # friction towards one side keeps mirror symmetry, but not the turn
        (in_space(lambda s, mu, e, a, b, n: (a, b + 1e-3 * n, n)), "rotates the impulse", "the rotated impulse"),
        (in_space(lambda s, mu, e, a, b, n: (0.99 * a, 0.99 * b, n)), "for impacts in a plane", "is different"),
        (in_space(lambda s, mu, e, a, b, n: (a, b, n * (1.0 + 0.1 * s.K_nn))), "units", "a constant in it has a unit"),
        (in_space(lambda s, mu, e, a, b, n: (a, b, n + np.mean(n))), "in space, takes one", "an impact alone"),
        (in_space(lambda s, mu, e, a, b, n: (a, b, -n)), "in space, gives no impulse", "must be pushed"),
    ],
)
def test_a_mistake_in_space_is_found_and_named(wrong: Law, check: str, says: str) -> None:
    found = outcomes([one for one in checks_of(wrong) or LAW_CHECKS if check in one.name], wrong)
    assert found[-1].verdict == "FAIL" and re.search(says, found[-1].reason), found


def test_a_law_is_held_to_the_dimensions_that_it_names() -> None:
    assert checks_of(LAWS["drumwright_shell"]) == LAW_CHECKS
    assert checks_of(CONE) == (*LAW_CHECKS, *SPACE_CHECKS)
    assert checks_of(replace(CONE, dimensions=frozenset({3}))) == (LAW_CHECKS[0], *SPACE_CHECKS)


def test_momentum_follows_from_the_impulse() -> None:
    class Lighter(Law):
        def __call__(self, *args, **kwargs):
            out = super().__call__(*args, **kwargs)
            return replace(out, v_post=out.v_post * 1.001)

    wrong = Lighter(RIGHT.name, RIGHT.title, RIGHT.impulse, RIGHT.promises, RIGHT.reference)
    (outcome,) = outcomes([one for one in LAW_CHECKS if "follows from its impulse" in one.name], wrong)
    assert outcome.verdict == "FAIL"
    for dimensions in (3, frozenset({4}), frozenset()):
        law = replace(CONE, dimensions=dimensions)
        (outcome,) = outcomes(checks_of(law), law)
        assert outcome.verdict == "FAIL" and "dimensions must be" in outcome.reason
