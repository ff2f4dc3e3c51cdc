"""Restitution against the place of the contact: of measured contacts and of the fitted contact.

    e_n = −v_n⁺/v_n⁻    at the corner that touches, both velocities at the time of the touch

Flights after a contact, measured and simulated, are traced back to the touch.  Only contacts of one corner are used,
far from landing flat (|sin 2θ| above `ASKEW`) and faster than `FAST`.

| on paper | in code             | unit | shape | meaning                          |
|----------|---------------------|------|-------|----------------------------------|
| x        | `x`                 | m    | (m,)  | of the contact point             |
| e_n      | `measured`, `model` | 1    | (m,)  | restitution at the contact point |
"""

import numpy as np
import pandas as pd

from thesis_lib.residual.dice.data import MeasuredContacts
from thesis_lib.residual.dice.fit import DiceModel, contact_path
from thesis_lib.residual.throwing.flight import first_touch, fly
from thesis_lib.residual.throwing.settings import ThrowSettings

ASKEW = 0.75  # 24 degrees from a side: the neighbour touches much later, if at all
FAST = 0.5  # m/s; slower contacts give poor estimates of restitution


def restitution(model: DiceModel, contacts: MeasuredContacts, settings: ThrowSettings) -> pd.DataFrame:
    """A row per contact: x (m), measured, model (1), speed (m/s of approach), first (0 or 1), trial."""
    body = model.body
    q = model.seen(contacts.q)
    t, corner = first_touch(body, q, contacts.v)
    at, before = fly(body, q, contacts.v, t)
    r = body.contact_point(at[:, 2], corner)
    approach = -(before[:, 1] + r[:, 0] * before[:, 2])
    shown = (np.abs(np.sin(2.0 * at[:, 2])) > ASKEW) & (approach > FAST) & (t < contacts.span)
    path_q, path_v = contact_path(model, q[shown], contacts.v[shown], contacts.span[shown], settings)
    ends = {
        "measured": (contacts.q_after[shown] - [0.0, 0.0, model.d_theta], contacts.v_after[shown]),
        "model": (path_q, path_v),
    }
    table = pd.DataFrame(
        {
            "trial": contacts.trial[shown],
            "first": contacts.first[shown].astype(int),
            "x": at[shown, 0] + r[shown, 0],
            "speed": approach[shown],
        }
    )
    for name, (end_q, end_v) in ends.items():
        _, after = fly(body, end_q, end_v, t[shown] - contacts.span[shown])
        table[name] = (after[:, 1] + r[shown, 0] * after[:, 2]) / approach[shown]
    return table.sort_values(["first", "x", "trial"], kind="stable").reset_index(drop=True)
