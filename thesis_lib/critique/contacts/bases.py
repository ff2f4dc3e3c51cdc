"""Models without effects from which the critique starts: impact laws and compliant contacts.

A compliant contact has a finite duration; the critique integrates the motion of the body under the contact force
(`thesis_lib/critique/contacts/pressing.py`), with Coulomb friction.  Compliant contacts differ in their normal force
(`thesis_lib/contact/compliant/normal_force.py`).

The shorter the contact, the less the body moves during it.  In the limit the impulse follows Routh's path with
Stronge's energetic restitution (Mirtich's law); ε is the restitution of the force for the effective mass of the contact
in compression and for its speed.  `impulse` is this limit.  It omits the lift of a sliding convex contact, which
persists in arbitrarily short contacts; only the integrated contact includes it.
"""

from collections import ChainMap
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from thesis_lib.contact import LAWS, mirtich, slip_hodograph
from thesis_lib.contact.compliant.normal_force import (
    ConvexDamper,
    HuntCrossley,
    LinearDamper,
    NormalForce,
    PressureField,
    PyramidDamper,
)
from thesis_lib.contact.law import ImpulseFunction, Law
from thesis_lib.contact.slip_path import slip_path
from thesis_lib.critique.contacts.contact_time import LEAST_MOBILITY
from thesis_lib.mechanics.contact import Contact

HERTZ = 1.5  # exponent


def _limit(force: NormalForce) -> ImpulseFunction:
    def impulse(space, mu, epsilon):
        with np.errstate(all="ignore"):
            mobility = np.maximum(-space.v_n / _compression(space, mu), LEAST_MOBILITY)
        return mirtich.impulse(space, mu, force.epsilon_at(epsilon, mobility, space.v_n))

    return impulse


def _compression(space: Contact, mu: np.ndarray) -> np.ndarray:
    """Normal impulse (n,) at the end of compression, where v_n = 0."""
    if space.dimension == 2:
        return slip_path(space, mu).p_c
    return slip_hodograph.impulse(space, mu, np.zeros_like(mu), slip_hodograph.Restitution.POISSON)[2]


def _compliant(name: str, title: str, force: NormalForce, reference: str, *, only: int = 0) -> Law:
    dimensions = frozenset({only}) if only else mirtich.LAW.dimensions
    same = {"title": title, "reference": reference, "force": force, "dimensions": dimensions}
    return replace(mirtich.LAW, name=name, impulse=_limit(force), **same)


COMPLIANT = (
    _compliant("compliant_contact", "compliant contact", NormalForce(), "Walton and Braun 1986, doi:10.1122/1.549893"),
    _compliant("hertz_contact", "Hertz's contact", NormalForce(HERTZ), "Johnson 1985, doi:10.1017/CBO9781139171731"),
    _compliant(
        "damped_contact",
        "spring and damper",
        LinearDamper(),
        "Schwager and Pöschel 2007, doi:10.1007/s10035-007-0065-z",
    ),
    _compliant(
        "convex_contact",
        "spring and damper with convex friction",
        ConvexDamper(),
        "Todorov 2014, doi:10.1109/ICRA.2014.6907751",
    ),
    _compliant(
        "hunt_crossley_contact",
        "Hunt and Crossley's contact",
        HuntCrossley(),
        "Hunt and Crossley 1975, doi:10.1115/1.3423596",
    ),
    _compliant(
        "hunt_crossley_hertz_contact",
        "Hunt and Crossley's contact on Hertz's spring",
        HuntCrossley(HERTZ),
        "Hunt and Crossley 1975, doi:10.1115/1.3423596",
    ),
    _compliant(
        "pressure_field_contact",
        "contact of a pressure field",
        PressureField(),
        "Elandt et al. 2019, doi:10.1109/IROS40897.2019.8968548",
        only=2,  # integrated over the chord where the surface cuts the body
    ),
    _compliant(
        "pyramid_contact",
        "spring and damper with convex friction on a pyramid",
        PyramidDamper(),
        "Todorov 2014, doi:10.1109/ICRA.2014.6907751",
        only=3,  # in the plane it equals the convex contact
    ),
)
BASES: Mapping[str, Law] = ChainMap({law.name: law for law in COMPLIANT}, LAWS)
# second-stage models, tried if rigid laws leave an error
RESERVE, RESERVE_IN_SPACE = (tuple(law.name for law in COMPLIANT if d in law.dimensions) for d in (2, 3))
