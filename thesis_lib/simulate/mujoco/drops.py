"""Drops of a planar body in MuJoCo: a source of data whose contact is independent of our code.

MuJoCo simulates the body, the plate and the hidden causes (`model`).  All drops form one `mujoco.batch.Batch`.  Flight
is integrated without contact in steps of at most `FLIGHT_STEP`.  If a step ends within `SKIN` of the plate, it is
repeated with contact and the contact's smaller time step, at most a twentieth of the contact time.

The integrator is RK4.  It is exact for a parabola at any step size, while MuJoCo's other integrators, of first order,
have an error of g h t / 2 (0.03 mm in a drop of 0.3 s with 20 µs); it resolves a contact of 200 steps to 0.1 %.

A contact lasts from the touch until body and plate, both undeformed, no longer overlap; MuJoCo's force ends earlier,
while the body is still below the surface.  Its two ends are found by bisection: the touch on free flight from the step
before it, the end on the cubic Hermite path of the step that contains it.  Its impulse is the change of momentum minus
the impulse of gravity.  Everything else is as in all simulated drops (`compliant.drops`).
"""

import numpy as np
from mujoco import mjtDisableBit  # pyright: ignore[reportAttributeAccessIssue]
from mujoco.batch import Batch
from scipy.interpolate import CubicHermiteSpline

from thesis_lib.foundation.errors import UserError
from thesis_lib.mechanics.bisection import bisected
from thesis_lib.simulate.compliant.compiled import BISECTIONS
from thesis_lib.simulate.compliant.contacts import LONGEST, Contacts
from thesis_lib.simulate.compliant.drops import FLIGHT_STEP, Falls, Instants, refuse_foreign
from thesis_lib.simulate.compliant.forces import Mechanics
from thesis_lib.simulate.mujoco.causes import SUPPORTED, WITHOUT_ELEMENT, MujocoCauses
from thesis_lib.simulate.mujoco.contact import COARSEST, MujocoContact, solref
from thesis_lib.simulate.mujoco.model import drop_model, share
from thesis_lib.simulate.rig.hidden_causes import CompliantContact, HiddenCauses

SKIN = 2e-4  # m; a corner at 0.05 m of a body spinning at 60 rad/s dips by 0.02 mm between two flight steps


class DropsInMujoco:
    """MuJoCo as the engine of simulated drops; hidden causes may be `MujocoCauses`.

    The exponent of the contact must be 1, and its time step at most a twentieth of the contact.
    """

    def accepts(
        self, contact: CompliantContact | None, hidden: HiddenCauses | None
    ) -> tuple[MujocoContact, MujocoCauses]:
        if not isinstance(contact, MujocoContact):
            contact = MujocoContact(**contact.model_dump() if contact else {})
        m = MujocoCauses(**(hidden or HiddenCauses()).model_dump())
        refuse_foreign("MuJoCo", contact, m, WITHOUT_ELEMENT, SUPPORTED)
        if contact.steps < COARSEST:
            raise UserError(f"MuJoCo's contact needs at least {COARSEST} steps; got {contact.steps}.")
        return contact, m

    def fall(self, mechanics: Mechanics, pose: np.ndarray, velocity: np.ndarray, instants: Instants) -> Falls:
        return _Run(mechanics, instants.samples[-1]).falls(pose, velocity, instants.rate)


class _Run:
    """Paths and contacts of n drops in MuJoCo; `t` (n,): ends of the recordings in s, at most `end`.

    States q, v are those of `Mechanics`.
    """

    def __init__(self, mechanics: Mechanics, end: float) -> None:
        n = len(mechanics.epsilon)
        assert isinstance(mechanics.contact, MujocoContact) and isinstance(mechanics.hidden, MujocoCauses)
        self.mechanics, self.contact, self.hidden = mechanics, mechanics.contact, mechanics.hidden
        self.model = drop_model(mechanics.believed, self.contact, self.hidden, mechanics.believed_gravity)
        self.batch = Batch(self.model, n, 1)
        self.steps, self.without = self.batch.expand("opt.timestep"), self.batch.expand("opt.disableflags")
        self.open: dict[int, tuple[np.ndarray, np.ndarray, float]] = {}  # states at the touch, by drop
        self.contacts, self.t = Contacts(mechanics), np.full(n, end)
        # drops (m,), times (m, s) and states (m, s, 5) of all integrated steps
        self.path: list[tuple[np.ndarray, ...]] = []

    def falls(self, pose: np.ndarray, velocity: np.ndarray, rate: float) -> Falls:
        """Simulate the drops from poses and velocities (n, 3) of their origins."""
        self._release(pose, velocity)
        n, every = len(pose), np.arange(len(pose))
        self.path.append((every, np.zeros((n, 1)), *(part[:, None] for part in self._state(every))))
        self._run(float(self.t[0]), 1.0 / (rate * np.ceil(1.0 / (rate * FLIGHT_STEP) - 1e-9)))
        return Falls.along(self._joined(), self.mechanics, self.contacts.records, self.t)

    # --- states ---

    def _release(self, pose: np.ndarray, velocity: np.ndarray) -> None:
        """Set the initial states; a loose mass is at rest relative to the body, a plate moves as at time 0."""
        centre, rate = self.mechanics.centre_state(pose, velocity)
        q, v = self.batch.bind("qpos"), self.batch.bind("qvel")
        q[:, :3], v[:, :3] = np.column_stack([centre, pose[:, 2]]), np.column_stack([rate, velocity[:, 2]])
        if self.hidden.moving_plate:
            rows = np.arange(len(pose))
            height, rise = self.mechanics.plate(np.zeros(len(rows)), rows)
            q[:, -1] = height[:, 0] - self.hidden.surface_height
            v[:, -1] = self.hidden.plate_velocity or rise[:, 0]

    def _state(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return self._of_mechanics(self.batch.bind("qpos")[rows], self.batch.bind("qvel")[rows])

    def _of_mechanics(self, qpos: np.ndarray, qvel: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """States (..., 5) of `Mechanics` from MuJoCo's, in which a loose mass is located relative to the body."""
        q, v = (np.concatenate([part[..., :3], part[..., :2]], axis=-1) for part in (qpos, qvel))
        if self.hidden.loose_mass:
            cos, sin, omega = np.cos(qpos[..., 2]), np.sin(qpos[..., 2]), qvel[..., 2]
            x, vx = (cos * part[..., 3] - sin * part[..., 4] for part in (qpos, qvel))
            y, vy = (sin * part[..., 3] + cos * part[..., 4] for part in (qpos, qvel))
            q[..., 3:] += np.stack([x, y], axis=-1)
            v[..., 3:] += np.stack([vx - omega * y, vy + omega * x], axis=-1)
        return q, v

    def _gap(self, q: np.ndarray, t: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Gaps (m, s) in m at states q (m, s, 5) and times t (m, s) of the drops `rows` (m,)."""
        shape = t.shape
        return self.mechanics.gap(q.reshape(-1, q.shape[-1]), t.ravel(), np.repeat(rows, shape[1])).reshape(shape)

    # --- time ---

    def _run(self, end: float, interval: float) -> None:
        """Integrate all drops from 0 to `end` in s, in intervals of a flight step."""
        parts = int(np.ceil(interval / self.contact.dt - 1e-9))
        active = np.arange(len(self.steps))
        near = np.zeros(len(active), dtype=bool)
        for k in range(round(end / interval)):
            t0, t1 = k * interval, (k + 1) * interval
            far = active[~near[active]]
            saved = self.batch.state[far]
            # the stages of a long step must not touch the plate
            self.steps[far], self.without[far] = interval, mjtDisableBit.mjDSBL_CONTACT
            if len(far):
                self.batch.step(far)
            q, v = self._state(far)
            touches = self.mechanics.gap(q, np.full(len(far), t1), far) < SKIN
            self.batch.state[far[touches]] = saved[touches]
            self.path.append(
                (far[~touches], np.full((len(far[~touches]), 1), t1), q[~touches, None], v[~touches, None])
            )
            fine = np.sort(np.concatenate([far[touches], active[near[active]]]))
            if len(fine):
                near[fine] = self._close(fine, t0, interval, parts)
                active = active[self.t[active] == end]

    def _close(self, rows: np.ndarray, t0: float, interval: float, parts: int) -> np.ndarray:
        """Integrate one interval of the drops `rows` in `parts` steps; return which of them remain near the plate."""
        self._set_surface(rows)
        before = self._state(rows)
        self.steps[rows], self.without[rows] = interval / parts, 0
        made = self.batch.rollout(parts, record=("qpos", "qvel"), ids=rows)
        after = self._of_mechanics(made["qpos"], made["qvel"])
        q, v = (np.concatenate([a[:, None], b], axis=1) for a, b in zip(before, after))
        t = np.broadcast_to(t0 + np.arange(parts + 1) * (interval / parts), q.shape[:2])
        gap = self._gap(q, t, rows)
        self.path.append((rows, t[:, 1:], q[:, 1:], v[:, 1:]))
        for i, row in enumerate(rows):
            self._crossings(row, t[i], q[i], v[i], gap[i])
        longest = LONGEST * self.contact.contact_time
        for i, row in enumerate(rows):
            if row in self.open and t[i, -1] - self.open[row][2] > longest and self.contacts.flies_on(row):
                self._record(row, (q[i, -1], v[i, -1], t[i, -1]), separated=False)
        return (gap[:, -1] < SKIN) | np.isin(rows, list(self.open))

    def _set_surface(self, rows: np.ndarray) -> None:
        """Set friction and solref of the pairs of drops that are not yet in contact, by drop and place."""
        if not self.hidden.by_place:
            return
        rows = rows[~np.isin(rows, list(self.open))]
        epsilon, mu, stiffness = self.mechanics.touch(self._state(rows)[0], rows)
        self.batch.expand("pair_friction")[rows, :, :2] = mu[..., None]
        # a softer place keeps the damping ratio
        lasting = self.contact.contact_time * np.sqrt(self.mechanics.stiffness / stiffness)
        of_central = share(self.model, self.contact)
        self.batch.expand("pair_solref")[rows] = solref(epsilon, lasting, of_central)

    # --- contacts ---

    def _crossings(self, row: int, t: np.ndarray, q: np.ndarray, v: np.ndarray, gap: np.ndarray) -> None:
        """Begin and end contacts of a drop along its path t (s,), q and v (s, 5) with gaps (s,)."""
        if row in self.open and gap[0] >= 0.0:
            self._record(row, (q[0], v[0], t[0]), separated=True)
        for j in np.flatnonzero(np.diff(gap < 0.0)):
            if not self.contacts.flies_on(row):
                return
            if row in self.open:
                self._record(row, self._leaves(row, t[j : j + 2], q[j : j + 2], v[j : j + 2]), separated=True)
            else:
                self.open[row] = self._lands(row, t[j], q[j], v[j], t[j + 1] - t[j])

    def _lands(
        self, row: int, t: float, q: np.ndarray, v: np.ndarray, h: float
    ) -> tuple[np.ndarray, np.ndarray, float]:
        """State q, v (5,) and time of the touch in free flight from t, q, v, which occurs within h s."""
        a = self.mechanics.acceleration(q[None], v[None])[0]

        def at(s: float) -> tuple[np.ndarray, np.ndarray]:
            return q + s * v + 0.5 * s * s * a, v + s * a

        return *at(s := self._root(row, t, 0.0, h, lambda s: at(s)[0])), t + s

    def _leaves(self, row: int, t: np.ndarray, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
        """State q, v (5,) and time at which a body leaves the plate on the path t (2,), q and v (2, 5)."""
        path = CubicHermiteSpline(t - t[0], q, v)
        s = self._root(row, t[0], t[1] - t[0], 0.0, path)
        return path(s), path(s, 1), t[0] + s

    def _root(self, row: int, t: float, high: float, low: float, path) -> float:
        """Time after t in s at which the gap along a path is 0, between `high` (gap above 0) and `low` (below 0)."""
        gap, rows = self.mechanics.gap, np.array([row])
        return float(
            bisected(lambda s: gap(path(s)[None], np.array([t + s]), rows)[0] >= 0.0, high, low, BISECTIONS)[0]
        )

    def _record(self, row: int, after: tuple[np.ndarray, np.ndarray, float], *, separated: bool) -> None:
        """End the contact of a drop; if the drop has come to rest, its recording ends there."""
        if not self.contacts.add(row, self.open.pop(row), after, separated):
            self.t[row] = after[2]

    def _joined(self) -> list[CubicHermiteSpline]:
        """The path of each drop."""
        parts: list[list[tuple]] = [[] for _ in self.t]
        for rows, t, q, v in self.path:
            for i, row in enumerate(rows):
                parts[row].append((t[i], q[i, :, :3], v[i, :, :3]))
        joined = ([np.concatenate(part) for part in zip(*one)] for one in parts)
        return [CubicHermiteSpline(t, q, v) for t, q, v in joined]
