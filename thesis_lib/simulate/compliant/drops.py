"""Drops of a planar body with compliant contact, integrated in continuous time: a truth that no impact law made.

Each drop has its own clock.  Flight goes from tick to tick (samples, and at most `FLIGHT_STEP` between) with classical
Runge-Kutta steps, exact for a parabola; a tick that ends below the plate is cut at the touch by bisection.  From there
the contact forces of `compliant_forces` are integrated with the contact's own small step until nothing touches or
sticks any more.  All drops fly, then all that have landed are in contact together, and so on: both loops are over
steps, never over drops.

A recording ends where the body comes to rest: after `SLOW_TOUCHES` slow contacts in a row, `MAX_CONTACTS` contacts, or
a contact longer than `LONGEST` contact times.  Later samples do not exist.

| on paper | in code       | unit               | shape  | meaning                                                  |
|----------|---------------|--------------------|--------|----------------------------------------------------------|
| q, v     | `q`, `v`      | m, rad; m/s, rad/s | (n, 5) | x, y, θ of the true centre of mass; x, y of a loose mass |
| c_t, c_n | `c_t`, `c_n`  | N s                | (n,)   | time integral of the contact forces over one contact     |
| h        | `contact.dt`  | s                  |        | time step during contact                                 |

Randomness: `rng` spawns three streams (releases, noise, phase of the plate), each drawn in the order of the drops,
so drop i is the same whatever the number of drops (wear excepted: it counts them).

Sources: see `mechanisms`.
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from thesis_lib.bodies.body import Body, Noise
from thesis_lib.datasets.format.header import Header
from thesis_lib.datasets.format.impacts import POSE, V_POST, V_PRE
from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.compliant.forces import Mechanics, Memory
from thesis_lib.simulate.rig.camera import as_trajectories, reported, with_noise, wobble
from thesis_lib.simulate.rig.hidden_causes import CompliantContact, Mechanisms
from thesis_lib.simulate.rig.release import Release

FLIGHT_STEP = 1e-3  # s; a corner at 0.05 m turning with 60 rad/s dips by at most 0.02 mm unseen within it
BISECTIONS = 34  # of a flight step: 1e-3 / 2^34 = 6e-14 s
V_SLOW = 0.05  # m/s; slower contacts rebound by less than the noise of the rig
SLOW_TOUCHES = 3
MAX_CONTACTS = 25
LONGEST = 30.0  # contact times
_COMPACT = 8  # steps between removals of those that have separated

TRUTH = ("trial", "impact", "t", *POSE, *V_PRE, *V_POST, "r_x", "r_y", "c_t", "c_n")
TRUTH += ("duration", "energy_change", "separated")


@dataclass(frozen=True)
class CompliantDrops:
    """Simulated drops.

    Attributes:
        header: content of dataset.yaml as the user believes it: no mechanism shows in it.
        trajectories: columns trial,t,x,y,theta as the camera reports them, with noise, sorted by trial and t.
        impacts: the truth, a row per contact: the columns of impacts.csv for the body's origin, t (of the touch),
            r_x, r_y (true deepest point from the origin), c_t, c_n (N s), duration (s), energy_change (J, kinetic),
            separated (False where the recording ended during the contact).
        trials: the truth, a row per drop: release x,y,theta,vx,vy,omega of the origin; contacts (count); t_end, the end
            of the recording in s.
    """

    header: Header
    trajectories: pd.DataFrame
    impacts: pd.DataFrame
    trials: pd.DataFrame


def simulate_compliant_drops(
    body: Body,
    release: Release,
    n: int,
    *,
    contact: CompliantContact | None = None,
    mechanisms: Mechanisms | None = None,
    gravity: float = 9.81,
    duration: float = 0.5,
    rate: float = 250.0,
    noise: Noise | None = None,
    rng: np.random.Generator,
) -> CompliantDrops:
    """Release n bodies over a plate and record their poses.

    Args:
        body: shape, mass, radius of gyration, as believed.
        release: distribution of the release states of the body's origin.
        n: number of drops.
        contact: the contact without anything hidden; its defaults if None.
        mechanisms: what is hidden; nothing if None.
        gravity: believed, m/s².
        duration: s; samples at 0, 1/rate, ... up to it.
        rate: sampling rate, Hz.
        noise: one-sigma noise of position (x, y each) and angle; what is None or absent is recorded without noise.
        rng: spawns the streams for releases, noise and phases.

    Raises:
        UserError: the body has no mass, an argument is out of range, or a release touches the plate.
    """
    contact, m = contact or CompliantContact(), mechanisms or Mechanisms()
    check_request(body, release, m, {"n": n, "gravity": gravity, "duration": duration, "rate": rate})
    release_rng, noise_rng, phase_rng = rng.spawn(3)
    pose, velocity = release.draw(n, release_rng)
    mechanics = Mechanics(body, contact, m, gravity, n, phase_rng.uniform(0.0, 2.0 * np.pi, n))

    samples = np.arange(int(duration * rate + 1e-9) + 1) / rate
    lagged = samples - m.time_lag
    drops = _Drops(mechanics, pose, velocity, _ticks(samples, lagged[lagged > 0.0], rate))
    drops.run()

    impacts = drops.impacts()
    poses = drops.poses_at(samples)
    if m.wobble:
        poses = poses + wobble(impacts, samples, n, m, body.radius_of_gyration)
    late = poses[..., 2]
    if m.time_lag:
        late = drops.poses_at(np.maximum(lagged, 0.0))[..., 2] + np.minimum(lagged, 0.0) * velocity[:, 2:]
    poses = reported(poses, late, samples, m)
    poses = with_noise(poses, noise, noise_rng)
    header = Header(schema=1, description=f"{n} drops", body=body, gravity=gravity, rate=rate, noise=noise)  # pyright: ignore[reportCallIssue]
    return CompliantDrops(header, as_trajectories(poses, samples), impacts, drops.trials(pose, velocity))


class _Drops:
    """The moving state of n drops, their poses at the ticks and the record of their contacts."""

    def __init__(
        self, mechanics: Mechanics, pose: np.ndarray, velocity: np.ndarray, ticks: np.ndarray
    ) -> None:
        n = len(pose)
        self.mechanics, self.ticks = mechanics, ticks
        # the loose mass starts at rest in the body
        centre, rate = self._centre(pose, velocity)
        self.q = np.column_stack([centre, pose[:, 2], centre])
        self.v = np.column_stack([rate, velocity[:, 2], rate])
        self.t = np.zeros(n)
        self.next = np.ones(n, dtype=int)  # number of the next tick
        self.poses = np.full((n, len(ticks), 3), np.nan)
        self.poses[:, 0] = pose
        self.slow, self.contacts = np.zeros(n, dtype=int), np.zeros(n, dtype=int)
        self._rows: list[dict[str, np.ndarray]] = []

    def _centre(self, pose: np.ndarray, velocity: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        c, omega = self.mechanics.origin(pose[:, 2]), velocity[:, 2:]
        return pose[:, :2] + c, velocity[:, :2] + omega * np.stack([-c[:, 1], c[:, 0]], axis=-1)

    def _body(self, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Pose and velocity (n, 3) of the body's origin."""
        c, omega = self.mechanics.origin(q[:, 2]), v[:, 2:3]
        rate = v[:, :2] - omega * np.stack([-c[:, 1], c[:, 0]], axis=-1)
        return np.column_stack([q[:, :2] - c, q[:, 2]]), np.column_stack([rate, v[:, 2]])

    def run(self) -> None:
        """Advance all drops to the last tick, or to where they come to rest."""
        flying = np.arange(len(self.q))
        while len(flying):
            landed = self._fly(flying)
            flying = self._contact(landed)

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
        """Fly the drops `rows` until they touch or the recording ends; returns those that touch, in place."""
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
            self.poses[rows, tick] = self._body(q[go], v[go])[0]
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

    def _contact(self, rows: np.ndarray) -> np.ndarray:
        """Integrate the contact of the drops `rows`; returns those that fly on."""
        if not len(rows):
            return rows
        mech, h = self.mechanics, self.mechanics.contact.dt
        start_q, start_v, start_t = self.q[rows], self.v[rows], self.t[rows]
        q, v, t = start_q, start_v, start_t
        memory: Memory = mech.touch(q, rows)
        here, tick = np.arange(len(rows)), self.next[rows]
        impulse, separated = np.zeros((len(rows), 2)), np.zeros(len(rows), dtype=bool)
        coming = self.ticks[np.minimum(tick, len(self.ticks) - 1)]
        held = np.ones(len(rows), dtype=bool)
        for step in range(int(LONGEST * mech.contact.steps)):
            new_q, new_v, c, free = mech.step(q, v, t, memory, rows[here])
            crosses = (t + h >= coming) & held
            if crosses.any():
                i = np.flatnonzero(crosses)
                share = ((coming[i] - t[i]) / h)[:, None]
                between = q[i] + share * (new_q[i] - q[i])
                self.poses[rows[here[i]], tick[i]] = self._body(between, new_v[i])[0]
                tick[i] += 1
                coming[i] = np.append(self.ticks, np.inf)[tick[i]]
            # those that have separated wait, unchanged, to be taken out
            mine = held[:, None]
            q, v = np.where(mine, new_q, q), np.where(mine, new_v, v)
            t = t + h * held
            impulse[here] += c * mine
            held &= ~free
            if step % _COMPACT == 0 and not held.all():
                self._store(rows, here, q, v, t, tick, ~held)
                separated[here[~held]] = True
                here, q, v, t = here[held], q[held], v[held], t[held]
                tick, coming, memory, held = tick[held], coming[held], memory.keep(held), held[held]
            if not len(here):
                break
        self._store(rows, here, q, v, t, tick, np.ones(len(here), dtype=bool))
        separated[here[~held]] = True
        self._record(rows, start_q, start_v, start_t, impulse, separated)

        r_x, r_y = mech.points(start_q[:, 2])
        r_x = r_x[np.arange(len(rows)), r_y.argmin(axis=1)]
        speed = mech.plate(start_t, rows)[1][:, 0] - start_v[:, 1] - r_x * start_v[:, 2]
        self.slow[rows] = np.where(speed < V_SLOW, self.slow[rows] + 1, 0)
        self.contacts[rows] += 1
        on = separated & (self.slow[rows] < SLOW_TOUCHES) & (self.contacts[rows] < MAX_CONTACTS)
        return rows[on]

    def _store(
        self,
        rows: np.ndarray,
        here: np.ndarray,
        q: np.ndarray,
        v: np.ndarray,
        t: np.ndarray,
        tick: np.ndarray,
        which: np.ndarray,
    ) -> None:
        at = rows[here[which]]
        self.q[at], self.v[at], self.t[at], self.next[at] = q[which], v[which], t[which], tick[which]

    def _record(
        self,
        rows: np.ndarray,
        q: np.ndarray,
        v: np.ndarray,
        t: np.ndarray,
        impulse: np.ndarray,
        separated: np.ndarray,
    ) -> None:
        pose, before = self._body(q, v)
        _, after = self._body(self.q[rows], self.v[rows])
        r_x, r_y = self.mechanics.points(q[:, 2])
        lowest, every = r_y.argmin(axis=1), np.arange(len(rows))
        r = np.stack([r_x[every, lowest], r_y[every, lowest]], axis=-1) + self.mechanics.origin(q[:, 2])
        shell, loose = self.mechanics.shell, self.mechanics.mass - self.mechanics.shell
        weights = 0.5 * np.array([shell, shell, self.mechanics.inertia, loose, loose])
        self._rows.append(
            {"trial": rows, "t": t, "duration": self.t[rows] - t, "separated": separated}
            | {"energy_change": (self.v[rows] ** 2 - v**2) @ weights}
            | dict(zip(POSE, pose.T))
            | dict(zip(V_PRE, before.T))
            | dict(zip(V_POST, after.T))
            | dict(zip(("r_x", "r_y"), r.T))
            | dict(zip(("c_t", "c_n"), impulse.T))
        )

    # --- results ---

    def poses_at(self, times: np.ndarray) -> np.ndarray:
        """Recorded poses (n, len(times), 3) at `times`, which are ticks; NaN after the end of a recording."""
        return self.poses[:, np.abs(self.ticks[:, None] - times).argmin(axis=0)]

    def impacts(self) -> pd.DataFrame:
        """The recorded contacts, sorted by trial and time and counted from 0 in each trial."""
        if self._rows:
            table = pd.concat([pd.DataFrame(row) for row in self._rows])
        else:
            table = pd.DataFrame(columns=TRUTH, dtype=float).astype({"trial": int, "separated": bool})
        table = table.sort_values(["trial", "t"], kind="stable", ignore_index=True)
        table["impact"] = table.groupby("trial").cumcount()
        return table[list(TRUTH)]

    def trials(self, pose: np.ndarray, velocity: np.ndarray) -> pd.DataFrame:
        """A row per drop, with its release state (n, 3), (n, 3)."""
        states = dict(zip((*POSE, "vx", "vy", "omega"), [*pose.T, *velocity.T]))
        table = {"trial": np.arange(len(pose))} | states | {"contacts": self.contacts, "t_end": self.t}
        return pd.DataFrame(table)


def _ticks(samples: np.ndarray, lagged: np.ndarray, rate: float) -> np.ndarray:
    """Times at which flights stop: samples, lagged samples, and enough between for `FLIGHT_STEP`."""
    parts = int(np.ceil(1.0 / (rate * FLIGHT_STEP) - 1e-9))
    between = (samples[:-1, None] + np.arange(parts) / (parts * rate)).ravel()
    ticks = np.unique(np.concatenate([between, samples[-1:], lagged]))
    # a lag that is nearly a whole part would leave pairs of ticks that differ by rounding
    return ticks[np.r_[True, np.diff(ticks) > 1e-9]]


def check_request(body: Body, release: Release, m: Mechanisms, positive: dict[str, float]) -> None:
    """Refuse what cannot be simulated; `positive` holds what must be above zero, by name.

    Raises:
        UserError: see `simulate_compliant_drops`.
    """
    for name, value in positive.items():
        if not 0 < value < np.inf:
            raise UserError(f"Simulated drops need a positive {name}; got {value}.")
    reach = (
        body.shape.extent * max(1.0 + m.size_error, 1.0)
        + np.hypot(m.com_offset_x, m.com_offset_y)
        + max(m.surface_height, 0.0)
        + m.plate_amplitude
    )
    if release.height.low <= reach:
        raise UserError(
            f"A release at {release.height.low} m can touch the plate: the body reaches {reach:.4g} m from its "
            "origin. Raise the lower end of the release height."
        )
