"""Each check of the laws' contract finds the mistake that it is about, and says it so that it can be mended."""

import re
from collections.abc import Callable
from dataclasses import replace
from types import MappingProxyType

import numpy as np
import pytest

from thesis_lib.contact import LAWS, Law, Promise
from thesis_lib.extensions.contract import outcomes
from thesis_lib.extensions.law_contract import LAW_CHECKS

RIGHT, WHITTAKER = LAWS["wang_mason"], LAWS["whittaker"]


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
        (replace(RIGHT, reference=""), "where it is from", "title and reference"),
        (replace(RIGHT, promises=frozenset()), "where it is from", "neither promises nor breaks holds Promise.CENTRAL"),
        (replace(RIGHT, breaks={Promise.STICKS: 0.1}), "where it is from", "both hold Promise.STICKS"),
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


def test_momentum_follows_from_the_impulse() -> None:
    class Lighter(Law):
        def __call__(self, *args, **kwargs):
            out = super().__call__(*args, **kwargs)
            return replace(out, v_post=out.v_post * 1.001)

    wrong = Lighter(RIGHT.name, RIGHT.title, RIGHT.impulse, RIGHT.promises, RIGHT.reference)
    (outcome,) = outcomes([one for one in LAW_CHECKS if "follows from its impulse" in one.name], wrong)
    assert outcome.verdict == "FAIL"
