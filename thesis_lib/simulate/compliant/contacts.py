"""Contacts of simulated drops: the ground truth recorded for each, and whether they bring the body to rest.

A body has come to rest after `SLOW_TOUCHES` slow contacts in a row, `MAX_CONTACTS` contacts, or a contact longer than
`LONGEST` contact times.
"""

import numpy as np

from thesis_lib.simulate.compliant.compiled import MAX_CONTACTS, SLOW_TOUCHES, V_SLOW
from thesis_lib.simulate.compliant.forces import Mechanics
from thesis_lib.simulate.rig.record import CONTACT, contact_columns

LONGEST = 30.0  # contact times

# q, v (m, size) in m, rad and per s, and t (m,) in s; for a single drop q, v (size,) and a number
States = tuple[np.ndarray, np.ndarray, np.ndarray]
State = tuple[np.ndarray, np.ndarray, float]
TRUTH = (*CONTACT, "duration", "energy_change", "separated")


def contact_truth(
    mechanics: Mechanics,
    rows: np.ndarray,
    before: States,
    after: States,
    separated: np.ndarray,
    impulse: np.ndarray | None = None,
    energy_change: np.ndarray | None = None,
) -> dict[str, np.ndarray]:
    """Columns `TRUTH` of the contacts of the drops `rows` (m,).

    `before` and `after`: q, v (m, 5) of the true centre of mass (with impulse and energy given, (m, 3 or more)), and
    t (m,) in s; `separated` (m,): whether the body has left the plate; `impulse` (m, 2): c_t, c_n in N s, by default
    the change of momentum minus the impulse of gravity; `energy_change` (m,): J, by default of the kinetic energy.
    """
    (q, v, t), (q_end, v_end, t_end) = before, after
    if impulse is None:
        momentum = mechanics.weights * (v_end - v)
        impulse = momentum[:, :2] + momentum[:, 3:] - mechanics.mass * mechanics.gravity * (t_end - t)[:, None]
    if energy_change is None:
        energy_change = 0.5 * (v_end**2 - v**2) @ mechanics.weights
    pose, v_pre = mechanics.origin_state(q, v)
    _, v_post = mechanics.origin_state(q_end, v_end)
    r = mechanics.lowest_point(q[:, 2], q[:, 0]) + mechanics.origin(q[:, 2])
    more = {"duration": t_end - t, "energy_change": energy_change, "separated": separated}
    return contact_columns(rows, t, (pose, v_pre, v_post), r, impulse, **more)


class Contacts:
    """Contacts of n drops, recorded one after another; `records` have the columns `TRUTH`."""

    def __init__(self, mechanics: Mechanics) -> None:
        n = len(mechanics.epsilon)
        self.mechanics = mechanics
        self.records: list[dict[str, np.ndarray]] = []
        self._slow, self._count = np.zeros(n, dtype=int), np.zeros(n, dtype=int)

    def flies_on(self, row: int) -> bool:
        """Return whether a drop has not come to rest after too many contacts, or too many slow ones in a row."""
        return bool(self._slow[row] < SLOW_TOUCHES and self._count[row] < MAX_CONTACTS)

    def add(
        self,
        row: int,
        before: State,
        after: State,
        separated: bool,
        impulse: np.ndarray | None = None,
        energy_change: float | None = None,
    ) -> bool:
        """Record a contact of a drop between two states q, v (size,), t; return whether the drop continues to fly.

        `impulse` (2,) and `energy_change` are the engine's own, if it gives them; see `contact_truth`.
        """
        rows = np.array([row])
        start, end = ((q[None], v[None], np.asarray(t)[None]) for q, v, t in (before, after))
        own = (None if one is None else np.asarray(one)[None] for one in (impulse, energy_change))
        self.records.append(contact_truth(self.mechanics, rows, start, end, np.array([separated]), *own))
        slow = self.mechanics.approach(*start, rows)[0] < V_SLOW
        self._slow[row] = self._slow[row] + 1 if slow else 0
        self._count[row] += 1
        return separated and self.flies_on(row)
