"""Drops of a planar body with compliant contact, integrated in continuous time without an impact law.

Each drop has its own clock.  Flight goes from tick to tick (samples and times between them, at most `FLIGHT_STEP`
apart) with classical Runge-Kutta steps, exact for a parabola.  Bisection cuts a step that ends below the plate at the
touch.  From there the contact forces of `forces` are integrated with the small step of the contact until nothing
touches or sticks.  Loops run over steps, never over drops: all fly until they land, then contacts are integrated until
half of them have ended, and those fly until they land and join the others.

A recording ends when the body comes to rest: after `SLOW_TOUCHES` slow contacts in a row, `MAX_CONTACTS` contacts, or a
contact longer than `LONGEST` contact times.

`rng` spawns three streams (releases, noise, phase of the plate), each drawn in the order of the drops, so drop i does
not depend on the number of drops (except under wear, which counts them).  Sources: see `hidden_causes`.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from thesis_lib.bodies.body import Body, Noise
from thesis_lib.simulate.compliant.forces import Mechanics, Memory
from thesis_lib.simulate.rig.camera import reported, wobble
from thesis_lib.simulate.rig.hidden_causes import CompliantContact, HiddenCauses
from thesis_lib.simulate.rig.record import (
    CONTACT,
    Drops,
    as_dataset,
    check_request,
    contact_columns,
    contact_table,
    sample_times,
    trial_table,
)
from thesis_lib.simulate.rig.release import Release
from thesis_lib.simulate.rig.smoothing import low_pass
from thesis_lib.simulate.rig.tracker import Tracker

FLIGHT_STEP = 1e-3  # s; a corner at 0.05 m turning with 60 rad/s dips by at most 0.02 mm undetected
BISECTIONS = 34  # of a flight step: 1e-3 / 2^34 = 6e-14 s
V_SLOW = 0.05  # m/s; rebounds of slower contacts are below the noise of the rig
SLOW_TOUCHES = 3
MAX_CONTACTS = 25
LONGEST = 30.0  # contact times
_COMPACT = 8  # steps between removals of separated drops

TRUTH = (*CONTACT, "duration", "energy_change", "separated")


def simulate_compliant_drops(
    body: Body,
    release: Release,
    n: int,
    *,
    contact: CompliantContact | None = None,
    hidden: HiddenCauses | None = None,
    gravity: float = 9.81,
    duration: float = 0.5,
    rate: float = 250.0,
    noise: Noise | None = None,
    rng: np.random.Generator,
    engine: Callable[..., Any] | None = None,
    tracker: Tracker | None = None,
) -> Drops:
    """Release n bodies over a plate and record their poses.

    Args:
        body, gravity: as believed, m/s².
        contact: the contact without hidden causes.
        duration, rate: s, Hz; samples at 0, 1/rate, ... up to the duration.
        noise: one-sigma noise of position (x, y each) and angle; none where it is None or absent.
        engine: class that integrates the motion, with the arguments and results of `_Drops`, which is the default.
        tracker: how poses are recorded; if None, as they are seen.

    Returns:
        Drops whose `impacts` also have duration (s) and separated (False where the recording ended during the contact),
        and whose `trials` have contacts (count) and t_end, the end of the recording in s.

    Raises:
        UserError: the body has no mass, an argument is out of range, or a release touches the plate.
    """
    contact, hidden = contact or CompliantContact(), hidden or HiddenCauses()
    reach = (
        body.shape.extent * max(1.0 + hidden.size_error, 1.0)
        + np.hypot(hidden.com_offset_x, hidden.com_offset_y)
        + max(hidden.surface_height, 0.0)
        + hidden.plate_amplitude
    )
    check_request(body, release, reach, n=n, gravity=gravity, duration=duration, rate=rate)
    release_rng, noise_rng, phase_rng = rng.spawn(3)
    pose, velocity = release.draw(n, release_rng)
    mechanics = Mechanics(body, contact, hidden, gravity, n, phase_rng.uniform(0.0, 2.0 * np.pi, n))

    pictures = rate * (tracker.frames if tracker else 1)
    samples = sample_times(duration, pictures)
    lagged = samples - hidden.time_lag
    drops = (engine or _Drops)(mechanics, pose, velocity, samples, lagged, pictures)
    if tracker and tracker.time_constant:
        drops.poses = low_pass(drops.poses, drops.ticks, velocity, tracker.time_constant)
    poses = drops.poses_at(samples)
    late = poses[..., 2]
    if hidden.time_lag:
        late = drops.poses_at(np.maximum(lagged, 0.0))[..., 2] + np.minimum(lagged, 0.0) * velocity[:, 2:]
    impacts = contact_table(drops.records, TRUTH, {"separated": bool})
    if hidden.wobble:
        shown = wobble(impacts, samples, n, hidden, body.radius_of_gyration)
        poses, late = poses + shown, late + shown[..., 2]
    poses = reported(poses, late, samples, hidden)
    dataset = as_dataset(poses, f"{n} drops", body, gravity, rate, noise, noise_rng, tracker)
    count = np.bincount(impacts["trial"], minlength=n)
    return Drops(*dataset, impacts, trial_table(pose, velocity, contacts=count, t_end=drops.t))


def contact_truth(
    mechanics: Mechanics,
    rows: np.ndarray,
    before: tuple[np.ndarray, np.ndarray, np.ndarray],
    after: tuple[np.ndarray, np.ndarray, np.ndarray],
    impulse: np.ndarray,
    energy_change: np.ndarray,
    separated: np.ndarray,
) -> dict[str, np.ndarray]:
    """Columns `TRUTH` of the contacts of the drops `rows` (m,).

    `before` and `after`: q, v (m, 3 or more) of the true centre of mass and t (m,) in s; `impulse` (m, 2): c_t, c_n in
    N s; `energy_change` (m,): J; `separated` (m,): whether the body has left the plate.
    """
    q, v, t = before
    pose, v_pre = mechanics.origin_state(q, v)
    _, v_post = mechanics.origin_state(*after[:2])
    r = mechanics.lowest_point(q[:, 2]) + mechanics.origin(q[:, 2])
    more = {"duration": after[2] - t, "energy_change": energy_change, "separated": separated}
    return contact_columns(rows, t, (pose, v_pre, v_post), r, impulse, **more)


@dataclass
class Contacts:
    """n contacts, each since its own touch."""

    rows: np.ndarray  # (n,) which drops
    q: np.ndarray  # q, v (n, 5), t (n,) s: state now
    v: np.ndarray
    t: np.ndarray
    start: tuple[np.ndarray, np.ndarray, np.ndarray]  # q, v, t at the touch
    memory: Memory
    impulse: np.ndarray  # (n, 2) c_t, c_n so far, N s
    steps: np.ndarray  # (n,) taken so far
    held: np.ndarray  # (n,) whether it goes on
    separated: np.ndarray  # (n,) whether it has ended as the body left the plate

    def __len__(self) -> int:
        return len(self.rows)

    def keep(self, which: np.ndarray) -> "Contacts":
        """The contacts `which`, a mask."""
        q, v, t = (part[which] for part in self.start)
        state = self.rows[which], self.q[which], self.v[which], self.t[which], (q, v, t), self.memory.keep(which)
        return Contacts(*state, self.impulse[which], self.steps[which], self.held[which], self.separated[which])

    def join(self, other: "Contacts") -> "Contacts":
        """These contacts, then the `other` ones."""

        def both(name: str) -> np.ndarray:
            return np.concatenate([getattr(self, name), getattr(other, name)])

        q, v, t = (np.concatenate(pair) for pair in zip(self.start, other.start))
        state = both("rows"), both("q"), both("v"), both("t"), (q, v, t), self.memory.join(other.memory)
        return Contacts(*state, both("impulse"), both("steps"), both("held"), both("separated"))


class _Drops:
    """State of n drops, their poses at the ticks and the record of their contacts; `t` (n,) ends the recordings in s.

    `q`, `v` (n, 5), m, rad and per s: x, y, θ of the true centre of mass, then x, y of a loose mass.  Poses
    and velocities of release are (n, 3); `samples` and `lagged` are the times in s at which poses are asked for.
    """

    def __init__(
        self,
        mechanics: Mechanics,
        pose: np.ndarray,
        velocity: np.ndarray,
        samples: np.ndarray,
        lagged: np.ndarray,
        rate: float,
    ) -> None:
        n, ticks = len(pose), _ticks(samples, lagged[lagged > 0.0], rate)
        self.mechanics, self.ticks = mechanics, ticks
        # the loose mass starts at rest in the body
        centre, motion = mechanics.centre_state(pose, velocity)
        self.q = np.column_stack([centre, pose[:, 2], centre])
        self.v = np.column_stack([motion, velocity[:, 2], motion])
        self.t = np.zeros(n)
        self.next = np.ones(n, dtype=int)  # number of the next tick
        self.poses = np.full((n, len(ticks), 3), np.nan)
        self.poses[:, 0] = pose
        self.slow, self.contacts = np.zeros(n, dtype=int), np.zeros(n, dtype=int)
        self.records: list[dict[str, np.ndarray]] = []
        flying, contacts = np.arange(n), self._touch(np.zeros(0, dtype=int))
        while len(flying) or len(contacts):
            flying, contacts = self._press(contacts.join(self._touch(self._fly(flying))))

    # --- flight ---

    def _runge_kutta(self, q: np.ndarray, v: np.ndarray, h: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        a, h = self.mechanics.acceleration, h[:, None]
        a1 = a(q, v)
        v2 = v + 0.5 * h * a1
        a2 = a(q + 0.5 * h * v, v2)
        v3 = v + 0.5 * h * a2
        a3 = a(q + 0.5 * h * v2, v3)
        v4 = v + h * a3
        a4 = a(q + h * v3, v4)
        return q + h / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4), v + h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)

    def _fly(self, rows: np.ndarray) -> np.ndarray:
        """Fly the drops `rows` until they touch or the recording ends; returns those that touch."""
        landed, steps = [], []
        rows = rows[self.next[rows] < len(self.ticks)]
        while len(rows):
            tick = self.next[rows]
            h = self.ticks[tick] - self.t[rows]
            q, v = self._runge_kutta(self.q[rows], self.v[rows], h)
            touches = self.mechanics.gap(q, self.ticks[tick], rows) < 0.0
            landed.append(rows[touches])
            steps.append(h[touches])
            go = ~touches
            rows, tick = rows[go], tick[go]
            self.q[rows], self.v[rows], self.t[rows] = q[go], v[go], self.ticks[tick]
            self.poses[rows, tick] = self.mechanics.origin_state(q[go], v[go])[0]
            self.next[rows] = tick + 1
            rows = rows[self.next[rows] < len(self.ticks)]
        rows = np.concatenate(landed) if landed else rows
        if not len(rows):
            return rows
        low, high = np.zeros(len(rows)), np.concatenate(steps)
        for _ in range(BISECTIONS):
            middle = 0.5 * (low + high)
            q, _ = self._runge_kutta(self.q[rows], self.v[rows], middle)
            below = self.mechanics.gap(q, self.t[rows] + middle, rows) < 0.0
            low, high = np.where(below, low, middle), np.where(below, middle, high)
        self.q[rows], self.v[rows] = self._runge_kutta(self.q[rows], self.v[rows], high)
        self.t[rows] += high
        return rows

    # --- contact ---

    def _touch(self, rows: np.ndarray) -> Contacts:
        """Contacts of the drops `rows` that begin now."""
        q, v, t, n = self.q[rows], self.v[rows], self.t[rows], len(rows)
        memory, none = self.mechanics.touch(q, rows), np.zeros(n, dtype=bool)
        return Contacts(rows, q, v, t, (q, v, t), memory, np.zeros((n, 2)), np.zeros(n, dtype=int), ~none, none)

    def _press(self, contacts: Contacts) -> tuple[np.ndarray, Contacts]:
        """Integrate until at most half of the contacts go on; returns the drops that fly on, and those contacts."""
        flying, most, limit = [], len(contacts) // 2, int(LONGEST * self.mechanics.contact.steps)
        while len(contacts) > most:
            for _ in range(_COMPACT):
                self._step(contacts, limit)
            if not contacts.held.all():
                flying.append(self._end(contacts.keep(~contacts.held)))
                contacts = contacts.keep(contacts.held)
        return np.concatenate([np.zeros(0, dtype=int), *flying]), contacts

    def _step(self, c: Contacts, limit: int) -> None:
        """One time step of the contacts that are held; they end when nothing touches or sticks, or after `limit`."""
        mech, h = self.mechanics, self.mechanics.contact.dt
        q, v, impulse, free = mech.step(c.q, c.v, c.t, c.memory, c.rows)
        tick = self.next[c.rows]
        coming = self.ticks[np.minimum(tick, len(self.ticks) - 1)]
        crosses = (c.t + h >= coming) & c.held & (tick < len(self.ticks))
        if crosses.any():
            i = np.flatnonzero(crosses)
            share = ((coming[i] - c.t[i]) / h)[:, None]
            between = c.q[i] + share * (q[i] - c.q[i])
            self.poses[c.rows[i], tick[i]] = mech.origin_state(between, v[i])[0]
            self.next[c.rows[i]] += 1
        # those that have ended stay unchanged until they are removed
        held = c.held[:, None]
        c.q, c.v, c.t = np.where(held, q, c.q), np.where(held, v, c.v), c.t + h * c.held
        c.impulse += impulse * held
        c.steps += 1
        c.separated |= c.held & free
        c.held = c.held & ~free & (c.steps < limit)

    def _end(self, c: Contacts) -> np.ndarray:
        """Record contacts that have ended; returns the drops that fly on."""
        mech, rows = self.mechanics, c.rows
        self.q[rows], self.v[rows], self.t[rows] = c.q, c.v, c.t
        shell, loose = mech.shell, mech.mass - mech.shell
        weights = 0.5 * np.array([shell, shell, mech.inertia, loose, loose])
        energy_change = (c.v**2 - c.start[1] ** 2) @ weights
        after = c.q, c.v, c.t
        self.records.append(contact_truth(mech, rows, c.start, after, c.impulse, energy_change, c.separated))
        self.slow[rows] = np.where(mech.approach(*c.start, rows) < V_SLOW, self.slow[rows] + 1, 0)
        self.contacts[rows] += 1
        return rows[c.separated & (self.slow[rows] < SLOW_TOUCHES) & (self.contacts[rows] < MAX_CONTACTS)]

    def poses_at(self, times: np.ndarray) -> np.ndarray:
        """Recorded poses (n, len(times), 3) at `times`, which are ticks; NaN after the end of a recording."""
        return self.poses[:, np.abs(self.ticks[:, None] - times).argmin(axis=0)]


def _ticks(samples: np.ndarray, lagged: np.ndarray, rate: float) -> np.ndarray:
    """Times in s at which flights stop: samples, lagged samples, and times between at most `FLIGHT_STEP` apart."""
    parts = int(np.ceil(1.0 / (rate * FLIGHT_STEP) - 1e-9))
    between = (samples[:-1, None] + np.arange(parts) / (parts * rate)).ravel()
    ticks = np.unique(np.concatenate([between, samples[-1:], lagged]))
    # a lag near a whole part of a sample would give pairs of ticks that differ by rounding
    return ticks[np.r_[True, np.diff(ticks) > 1e-9]]
