"""Drops of a planar body in Drake with compliant contact: a second source without an impact law.

Drake's MultibodyPlant has the body, the plate and the hidden causes (`plant`).  Its error-controlled Runge-Kutta
integrator takes steps of at most `FLIGHT_STEP` in flight and some hundreds of about ten nanoseconds in a contact.  No
Python runs within them: Drake logs its steps, and poses at the samples are interpolated (cubic Hermite, exact for a
parabola).  A contact lasts from the touch until body and plate, both undeformed, no longer overlap.  Its impulse is the
change of momentum less that due to gravity.

A recording ends when the body comes to rest, by the rules of `compliant`.

| on paper | in code      | unit               | shape   | meaning                                                 |
|----------|--------------|--------------------|---------|---------------------------------------------------------|
| q, v     | `q`, `v`     | m, rad; m/s, rad/s | (size,) | x, y, θ of the true centre of mass, then a loose mass's |
| c_t, c_n | `c_t`, `c_n` | N s                |         | time integral of the contact forces over one contact    |

Randomness is as in `compliant`: the same generator gives the same releases, noise and phases.
Sources: R. Tedrake and the Drake development team, Drake, https://drake.mit.edu (Simulator, RungeKutta3Integrator).
"""

from typing import TYPE_CHECKING

import numpy as np

from thesis_lib.bodies.body import Body, Noise
from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.compliant.drops import (
    LONGEST,
    MAX_CONTACTS,
    SLOW_TOUCHES,
    TRUTH,
    V_SLOW,
    check_hidden_request,
    contact_truth,
)
from thesis_lib.simulate.compliant.forces import Mechanics
from thesis_lib.simulate.rig.camera import reported, wobble
from thesis_lib.simulate.rig.hidden_causes import CAUSES, CompliantContact, HiddenCauses
from thesis_lib.simulate.rig.record import Drops, as_dataset, contact_table, sample_times, trial_table
from thesis_lib.simulate.rig.release import Release

if TYPE_CHECKING:
    from thesis_lib.simulate.drake.clock import Clock

FLIGHT_STEP = 2e-3  # s; a corner at 0.05 m turning with 30 rad/s dips by at most 0.02 mm undetected
# relative, of Drake's error control; a tenth of it moves velocities after impact by 0.01 mm/s
ACCURACY = 1e-4
LOOKS = 4  # checks per contact time whether the contact has ended
WEAR_NODES = 5  # pads from which those of worn plates are interpolated

# causes without an element in Drake: they would only repeat the formulas of `compliant`
WITHOUT_ELEMENT = (
    *("stribeck", "friction_anisotropy", "rolling_lever", "adhesion_energy", "orientation_restitution"),
    *("friction_slope", "restitution_slope"),
)
SUPPORTED: tuple[str, ...] = tuple(name for name in CAUSES if name not in WITHOUT_ELEMENT)


def simulate_drake_drops(
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
    accuracy: float = ACCURACY,
    rng: np.random.Generator,
) -> Drops:
    """Release n bodies over a plate in Drake and record their poses.

    Arguments, result and errors are those of `simulate_compliant_drops`, except that `contact.exponent` must be 1,
    `contact.steps` is not used, and `accuracy` is the relative accuracy of Drake's error control.  Also raises
    UserError for a hidden cause that Drake's elements cannot produce.
    """
    contact, hidden = contact or CompliantContact(), hidden or HiddenCauses()
    _refuse(contact, hidden)
    check_hidden_request(body, release, hidden, n=n, gravity=gravity, duration=duration, rate=rate)
    release_rng, noise_rng, phase_rng = rng.spawn(3)
    pose, velocity = release.draw(n, release_rng)
    mechanics = Mechanics(body, contact, hidden, gravity, n, phase_rng.uniform(0.0, 2.0 * np.pi, n))
    drops = _Drops(body, contact, mechanics, gravity, accuracy)
    samples = sample_times(duration, rate)
    lagged = samples - hidden.time_lag
    poses, late = np.full((n, len(samples), 3), np.nan), np.full((n, len(samples)), np.nan)
    for i in range(n):
        drops.run(i, pose[i], velocity[i], samples)
        poses[i] = drops.poses_at(samples)
        late[i] = drops.poses_at(np.maximum(lagged, 0.0))[:, 2] + np.minimum(lagged, 0.0) * velocity[i, 2]
    impacts = contact_table(drops.records, TRUTH, {"separated": bool})
    if hidden.wobble:
        shown = wobble(impacts, samples, n, hidden, body.radius_of_gyration)
        poses, late = poses + shown, late + shown[..., 2]
    poses = reported(poses, late, samples, hidden)
    dataset = as_dataset(poses, f"{n} drops", body, gravity, rate, noise, noise_rng)
    count = np.bincount(impacts["trial"], minlength=n)
    return Drops(*dataset, impacts, trial_table(pose, velocity, contacts=count, t_end=drops.ends))


def _refuse(contact: CompliantContact, m: HiddenCauses) -> None:
    asked = [name for name in WITHOUT_ELEMENT if getattr(m, name)]
    if asked:
        raise UserError(
            f"Drops in Drake cannot have {', '.join(asked)}: Drake has no such contact. "
            f"Take simulate_compliant_drops for it; Drake makes {', '.join(SUPPORTED)}."
        )
    if contact.exponent != 1.0:
        raise UserError(f"Drake's contact is linear: exponent must be 1, got {contact.exponent}.")
    if m.plate_velocity and m.plate_amplitude:
        raise UserError("Drops in Drake have one carriage: give plate_velocity or plate_amplitude, not both.")


class _Drops:
    """Drake's simulators, path of the last drop and record of all contacts; states hold body, then loose mass."""

    def __init__(
        self, body: Body, contact: CompliantContact, mechanics: Mechanics, gravity: float, accuracy: float
    ) -> None:
        from thesis_lib.simulate.drake.clock import Clock
        from thesis_lib.simulate.drake.plant import drop_plant, pad_of

        self.body, self.contact, self.mechanics = body, contact, mechanics
        self.gravity, self.accuracy = gravity, accuracy
        every = mechanics.epsilon
        self._nodes = np.linspace(every.min(), every.max(), WEAR_NODES) if np.ptp(every) else every[:1]
        self._pads = [pad_of(body, contact, mechanics.hidden, float(epsilon)) for epsilon in self._nodes]
        self._flight = Clock(drop_plant(body, contact, mechanics.hidden, gravity), FLIGHT_STEP, accuracy)
        self._plate: tuple[float, Clock] | None = None
        self.ends = np.zeros(len(every))
        self.records: list[dict[str, np.ndarray]] = []

    def run(self, trial: int, pose: np.ndarray, velocity: np.ndarray, samples: np.ndarray) -> None:
        """Simulate one drop from the pose and velocity (3,) of its origin to the last sample, or to rest."""
        from thesis_lib.simulate.drake.clock import fly

        flight = self._flight
        (centre,), (rate,) = self.mechanics.centre_state(pose[None], velocity[None])
        q, v = np.zeros((2, flight.size))  # a loose mass starts at rest in the body
        q[:3], v[:3] = np.r_[centre, pose[2]], np.r_[rate, velocity[2]]
        t, slow, path = 0.0, 0, []

        def gap(q: np.ndarray, t: np.ndarray) -> np.ndarray:
            return self.mechanics.gap(q, t, np.full(len(t), trial))

        for _ in range(MAX_CONTACTS):
            times, q_path, v_path, landed = fly(flight, gap, t, q, v, samples[samples > t + 1e-12])
            path.append((times, q_path[:, :3], v_path[:, :3]))
            t, q, v = times[-1], q_path[-1], v_path[-1]
            if not landed:
                break
            start = q, v, t
            t, q, v, separated = self._touch_down(trial, t, q, v)
            speed = self._record(trial, start, (q, v, t), separated)
            slow = slow + 1 if speed < V_SLOW else 0
            path.append((np.array([t]), q[None, :3], v[None, :3]))
            if not separated or slow == SLOW_TOUCHES:
                break
        self._times, self._q, self._v = (np.concatenate(part) for part in zip(*path))
        # a flight begins with the state in which the contact ended
        self._times, first = np.unique(self._times, return_index=True)
        self._q, self._v = self._q[first], self._v[first]
        self.ends[trial] = self._times[-1]

    def _touch_down(
        self, trial: int, t: float, q: np.ndarray, v: np.ndarray
    ) -> tuple[float, np.ndarray, np.ndarray, bool]:
        """Time, positions and velocities at the end of a contact, and whether the body has left the plate."""
        clock, mech, T = self._over_plate(trial), self.mechanics, self.contact.contact_time
        clock.start(t, q, v)
        if clock.made.carriage is not None:
            m, context = mech.hidden, clock.context
            height, rise = mech.plate(np.array([t]), np.array([trial]))
            raised = 0.0 if m.plate_velocity else height[0, 0] - m.surface_height
            clock.made.carriage.set_translation(context, raised)
            clock.made.carriage.set_translation_rate(context, m.plate_velocity or rise[0, 0])
        for part in range(1, int(LONGEST * LOOKS) + 1):
            end = t + part * T / LOOKS
            clock.simulator.AdvanceTo(end)
            q, v = clock.state()
            if mech.gap(q[None], np.array([end]), np.array([trial]))[0] > 0.0:
                return end, q, v, True
        return end, q, v, False

    def _over_plate(self, trial: int) -> "Clock":
        """Simulator over a plate of the drop's restitution; reused while that stays the same."""
        from thesis_lib.simulate.drake.clock import Clock
        from thesis_lib.simulate.drake.plant import drop_plant
        from thesis_lib.simulate.drake.viscoelastic_pad import Pad

        epsilon = float(self.mechanics.epsilon[trial])
        if self._plate is None or self._plate[0] != epsilon:
            table = np.array([np.r_[p.k_contact, np.ravel(p.layers), p.mass] for p in self._pads])
            k, *layers, mass = (float(np.interp(epsilon, self._nodes, column)) for column in table.T)
            pad = Pad(k, tuple(zip(layers[::2], layers[1::2])), mass)
            made = drop_plant(self.body, self.contact, self.mechanics.hidden, self.gravity, pad)
            self._plate = epsilon, Clock(made, self.contact.contact_time, self.accuracy)
        return self._plate[1]

    def poses_at(self, times: np.ndarray) -> np.ndarray:
        """Poses (len(times), 3) of the body's origin in the last drop; NaN after the end of its recording."""
        from scipy.interpolate import CubicHermiteSpline

        q = CubicHermiteSpline(self._times, self._q, self._v)(times)
        out = np.column_stack([q[:, :2] - self.mechanics.origin(q[:, 2]), q[:, 2]])
        out[times > self._times[-1] + 1e-9] = np.nan
        return out

    def _record(self, trial: int, before: tuple, after: tuple, separated: bool) -> float:
        """Record a contact between two states (q, v, t); returns the speed of approach in m/s."""
        mech, rows = self.mechanics, np.array([trial])
        p0, e0 = self._flight.momentum_and_energy(*before[:2])
        p1, e1 = self._flight.momentum_and_energy(*after[:2])
        impulse = p1 - p0 - mech.mass * mech.gravity * (after[2] - before[2])
        # one contact, as arrays of length one
        q, v, t = (np.asarray(part)[None] for part in before)
        q_end, v_end, t_end = (np.asarray(part)[None] for part in after)
        end = q_end, v_end, t_end
        truth = contact_truth(mech, rows, (q, v, t), end, impulse[None], np.array([e1 - e0]), np.array([separated]))
        self.records.append(truth)
        return float(mech.approach(q, v, t, rows)[0])
