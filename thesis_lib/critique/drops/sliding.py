"""Friction with a table, which slows down a body that slides over it between impacts.

    a ← a − a_table (v_x, v_y)/|v|,    a_table = μ_table g

Coulomb friction of a level table acts against the motion of the centre, whatever the speed.  Without gravity in the
plane of the motion `a_table` is a parameter beside μ and ε, not an effect, because every table has friction.  The spin
is slowed down, too, but by how much depends on where the body rests on the table; here it stays constant.

| on paper | in code   | unit | shape |                            |
|----------|-----------|------|-------|----------------------------|
| a_table  | `a_table` | m/s² |       | deceleration               |
"""

from collections.abc import Sequence

import numpy as np

from thesis_lib.critique.likelihood.observations import Observations
from thesis_lib.effects.effect import Effect, Parameter
from thesis_lib.foundation.errors import UserError

SLIDING = Parameter("a_table", "m/s²", null=0.0, low=0.0, high=10.0, scale=0.1)
_SLOWEST = 1e-3  # m/s; slower bodies stand still for a camera


class _Table(Effect):
    """Table friction; not a candidate, because it belongs to the model of every body that slides."""

    name = "table"
    family = "flight"
    title = "friction with the table"
    equation = "a = −a_table v/|v|"
    parameters = (SLIDING,)
    channels = ("flight",)
    reference = "Coulomb 1785"

    def acceleration(self, a, state, p, rig):
        slowed = a.copy()
        slowed[:2] -= p[SLIDING.name] / np.maximum(np.hypot(state.vx, state.vy), _SLOWEST) * state.velocity
        return slowed


TABLE = _Table()


def of_motion(o: Observations) -> tuple[Effect, ...]:
    """Effects in every model of these observations: sliding friction of the table if there is no gravity."""
    return (TABLE,) if o.arcs and o.rig.gravity == 0.0 else ()


def require_falling(gravity: float, has_angle: bool, walls: Sequence, what: str) -> None:
    """Raise a UserError that `what` needs gravity, a measured angle and no walls, if the motion lacks any of these."""
    lacks = {
        "there is no gravity": not gravity,
        "theta was not measured": not has_angle,
        "there are walls": bool(walls),
    }
    if any(lacks.values()):
        why = " and ".join(name for name, is_so in lacks.items() if is_so)
        raise UserError(f"{what} needs a body that falls on one surface and whose angle is measured; here {why}.")
