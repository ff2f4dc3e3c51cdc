"""Laws of the contact that no effect of the library describes, hidden in compliant drops.

Each law multiplies one quantity of the contact by 1 + a φ, or adds a φ times the normal impulse, where φ is a
dimensionless function of the state.  ε is fixed when the body touches; μ, the couple and the sideways impulse follow
the motion during the contact, as in a real material (`compiled`).

| on paper | in code | unit | meaning                                                                 |
|----------|---------|------|-------------------------------------------------------------------------|
| a        | `size`  | 1    | relative change of ε or μ; couple over k c_n; sideways impulse over c_n |
| φ        | `phi`   | 1    | function of slip v_t/v, spin ω k/v, lever r_x/k, place β or release     |

v is the speed of the contact point at the touch, k the radius of gyration; the release number enters in hundreds.
"""

from dataclasses import dataclass
from typing import Literal

from thesis_lib.simulate.compliant import compiled as c
from thesis_lib.simulate.compliant.drops import OwnContact


@dataclass(frozen=True)
class HiddenLaw:
    """Quantity that a law acts on, its φ, and a size that raises the error of the best law to several noise floors."""

    acts_on: Literal["epsilon", "mu", "couple", "direction"]
    phi: int
    size: float


_ACTS_ON = {"epsilon": c.ON_EPSILON, "mu": c.ON_MU, "couple": c.COUPLE, "direction": c.DIRECTION}
HIDDEN_LAWS = {
    "restitution_by_obliquity": HiddenLaw("epsilon", c.SLIP, -0.3),
    "restitution_by_spin": HiddenLaw("epsilon", c.SPIN, -0.4),
    "restitution_by_fourth_harmonic": HiddenLaw("epsilon", c.QUARTERS, 0.1),
    "friction_by_place_on_body": HiddenLaw("mu", c.ENDS, 0.4),
    "friction_by_release": HiddenLaw("mu", c.RELEASE, 0.8),
    "friction_by_spin": HiddenLaw("mu", c.SPIN, 2.0),
    "couple_by_spin": HiddenLaw("couple", c.TURNING, -0.15),
    "direction_by_lever": HiddenLaw("direction", c.LEVER, 0.08),
    # forms that are not a product of powers
    "restitution_by_threshold": HiddenLaw("epsilon", c.THRESHOLD, -0.3),
    "friction_by_root_of_spin": HiddenLaw("mu", c.ROOT_OF_SPIN, 1.2),
}


def hiding(name: str, size: float | None = None) -> OwnContact:
    """Return the engine that hides a law of `HIDDEN_LAWS`; `size` None: the size given there."""
    law = HIDDEN_LAWS[name]
    return OwnContact((_ACTS_ON[law.acts_on], law.phi, law.size if size is None else size))
