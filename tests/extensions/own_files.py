"""Files of a user, as text, and a library without what tests add to it."""

from collections.abc import Iterator

import pytest

from thesis_lib.contact import LAWS
from thesis_lib.effects import EFFECTS
from thesis_lib.extensions import registry


@pytest.fixture(autouse=True)
def library() -> Iterator[None]:
    kept = [(mapping, dict(mapping)) for mapping in (EFFECTS, LAWS, registry._ADDED)]
    yield
    for mapping, content in kept:  # in its order, which other tests see
        mapping.clear()
        mapping.update(content)


EFFECT = '''
"""Slip-dependent restitution.

| on paper | in code | unit |
|----------|---------|------|
| h        | `h`     | s/m  |
"""

import numpy as np

from thesis_lib.effects.effect import Effect, Parameter


class SlipDependentRestitution(Effect):
    name = "slip_dependent_restitution"
    family = "contact_law"
    title = "restitution depends on slip"
    equation = "ε = ε₀ (1 + h |v_t|)"
    parameters = (Parameter("h", "s/m", null=0.0, low=-0.5, high=0.5, scale=0.05),)
    reference = "Louge and Adams 2002, doi:10.1103/PhysRevE.65.021303"

    def coefficients(self, mu, epsilon, contact, state, p, rig):
        return mu, np.clip(epsilon * (1.0 + p["h"] * np.abs(contact.v_t)), 0.0, 1.0)


EFFECT = SlipDependentRestitution()
'''
NO_IDENTITY = EFFECT.replace("1.0 + p", "0.9 + p")
LAW = """
from dataclasses import replace

from thesis_lib.contact import LAWS as LIBRARY

LAW = replace(LIBRARY["mirtich"], name="my_law", title="my law", reference="nobody")
"""
LAW_THAT_FAILS = """
from dataclasses import replace

from thesis_lib.contact import LAWS as LIBRARY


def impulse(contact, mu, epsilon):
    return 1 / 0


LAW = replace(LIBRARY["mirtich"], name="my_law", title="my law", reference="nobody", impulse=impulse)
"""
