"""Drops of a planar body in Drake with compliant contact: a second source without an impact law.

Drake's MultibodyPlant has the body, the plate and the hidden causes (`plant`).  Drake logs its steps, and poses at the
samples are interpolated (cubic Hermite, exact for a parabola).  A contact lasts from the touch until body and plate,
both undeformed, no longer overlap.  Its impulse is the change of momentum less that due to gravity.

A recording ends when the body comes to rest, by the rules of `compliant`.

Randomness is as in `compliant`: the same generator gives the same releases, noise and phases.
Sources: R. Tedrake and the Drake development team, Drake, https://drake.mit.edu (Simulator, RungeKutta3Integrator).
"""

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from thesis_lib.bodies.body import Body, Noise
from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.compliant.compiled import MAX_CONTACTS, SLOW_TOUCHES, V_SLOW
from thesis_lib.simulate.compliant.drops import LONGEST, contact_truth, simulate_compliant_drops
from thesis_lib.simulate.compliant.forces import Mechanics
from thesis_lib.simulate.rig.hidden_causes import CAUSES, CompliantContact, HiddenCauses
from thesis_lib.simulate.rig.record import Drops
from thesis_lib.simulate.rig.release import Release
from thesis_lib.simulate.rig.tracker import Tracker

if TYPE_CHECKING:
    from scipy.interpolate import CubicHermiteSpline

    from thesis_lib.simulate.drake.clock import Clock
    from thesis_lib.simulate.drake.plant import Surface

FLIGHT_STEP = 2e-3  # s; a corner at 0.05 m turning with 30 rad/s dips by at most 0.02 mm undetected
# relative, of Drake's error control; a tenth of it moves velocities after impact by 0.01 mm/s
ACCURACY = 1e-4
LOOKS = 4  # checks per contact time whether the contact has ended
POINTS = 20  # per contact time, of the path in Drake's own contact: samples may fall into it
WEAR_NODES = 5  # pads from which those of worn plates are interpolated

# causes without an element in Drake: they would only repeat the formulas of `compliant`
WITHOUT_ELEMENT = (
    *("stribeck", "friction_anisotropy", "rolling_lever", "adhesion_energy", "orientation_restitution"),
    *("friction_slope", "restitution_slope", "stiffness_slope", "soft_spot", "stiffness_patch"),
    "plate_curvature",
    *(f"{what}_{shape}" for what in ("restitution", "friction") for shape in ("patch", "bump", "step")),
)
SUPPORTED: tuple[str, ...] = tuple(name for name in CAUSES if name not in WITHOUT_ELEMENT)
# the contact of each surface; in Drake's own it is Hunt and Crossley's dissipation that loses energy, so that it is no
# hidden cause, and a hydroelastic body has sharp edges and no stiffness to compare a tangential one with
SURFACES: dict[str, tuple[str, ...]] = {
    "pad": SUPPORTED,
    "point": tuple(name for name in SUPPORTED if name != "hunt_crossley"),
    "hydroelastic": tuple(
        name for name in SUPPORTED if name not in ("hunt_crossley", "tangential_compliance", "corner_radius")
    ),
}


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
    tracker: Tracker | None = None,
    accuracy: float = ACCURACY,
    surface: str = "pad",
    rng: np.random.Generator,
) -> Drops:
    """Release n bodies over a plate in Drake and record their poses.

    Arguments, result and errors are those of `simulate_compliant_drops`, except that `contact.exponent` must be 1,
    `contact.steps` is not used, and `accuracy` is the relative accuracy of Drake's error control.  `surface` is "pad"
    (restitution that knows neither speed nor lever), or Drake's own contact, "point" or "hydroelastic", in which ε and
    the contact time are those of a central impact at `REFERENCE_SPEED`.  Also raises UserError for a hidden cause that
    Drake's elements cannot produce over that surface.
    """
    contact, hidden = contact or CompliantContact(), hidden or HiddenCauses()
    _refuse(contact, hidden, surface)
    if tracker and tracker.time_constant:  # the low-pass needs the ticks of our own integration
        raise UserError("Drops in Drake cannot have a tracker's time_constant; give it a filter with a cutoff.")
    return simulate_compliant_drops(
        body,
        release,
        n,
        contact=contact,
        hidden=hidden,
        gravity=gravity,
        duration=duration,
        rate=rate,
        noise=noise,
        tracker=tracker,
        rng=rng,
        engine=partial(_Drops, body, gravity, accuracy, surface),
    )


def _refuse(contact: CompliantContact, m: HiddenCauses, surface: str) -> None:
    if surface not in SURFACES:
        raise UserError(f"Drake has no surface {surface!r}; known are {', '.join(SURFACES)}.")
    asked = [name for name in CAUSES if name not in SURFACES[surface] and getattr(m, name)]
    if asked:
        over = "" if surface == "pad" else f" over the surface {surface!r}"
        raise UserError(
            f"Drops in Drake cannot have {', '.join(asked)}{over}: Drake has no such contact. "
            f"Take our own simulator for it (simulate_compliant_drops); Drake makes {', '.join(SURFACES[surface])}."
        )
    if contact.exponent != 1.0:
        raise UserError(f"Drake's contact is linear: exponent must be 1, got {contact.exponent}.")
    if m.plate_velocity and m.plate_amplitude:
        raise UserError("Drops in Drake have one carriage: give plate_velocity or plate_amplitude, not both.")


class _Drops:
    """Drake's simulators, and paths and contacts of all drops; states hold body, then loose mass.

    After the first four, arguments are those of the compliant engine.
    """

    def __init__(
        self,
        body: Body,
        gravity: float,
        accuracy: float,
        surface: str,
        mechanics: Mechanics,
        pose: np.ndarray,
        velocity: np.ndarray,
        samples: np.ndarray,
        lagged: np.ndarray,
        rate: float,
    ) -> None:
        from thesis_lib.simulate.drake.clock import Clock
        from thesis_lib.simulate.drake.plant import drop_plant, pad_of

        contact = mechanics.contact
        self.body, self.contact, self.mechanics = body, contact, mechanics
        self.gravity, self.accuracy = gravity, accuracy
        self.surface, every = surface, mechanics.epsilon
        self._nodes = np.linspace(every.min(), every.max(), WEAR_NODES) if np.ptp(every) else every[:1]
        self._pads = []
        if surface == "pad":
            self._pads = [pad_of(body, contact, mechanics.hidden, float(epsilon)) for epsilon in self._nodes]
        self._flight = Clock(drop_plant(body, contact, mechanics.hidden, gravity), FLIGHT_STEP, accuracy)
        self._plate: tuple[float, Clock] | None = None
        self.records: list[dict[str, np.ndarray]] = []
        self._paths = [self._run(i, pose[i], velocity[i], samples) for i in range(len(pose))]
        self.t = np.array([path.x[-1] for path in self._paths])

    def _run(self, trial: int, pose: np.ndarray, velocity: np.ndarray, samples: np.ndarray) -> "CubicHermiteSpline":
        """Path of one drop from the pose and velocity (3,) of its origin to the last sample, or to rest."""
        from scipy.interpolate import CubicHermiteSpline

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
            times, q_path, v_path, separated = self._touch_down(trial, t, q, v)
            t, q, v = times[-1], q_path[-1], v_path[-1]
            speed = self._record(trial, start, (q, v, t), separated)
            slow = slow + 1 if speed < V_SLOW else 0
            path.append((times, q_path[:, :3], v_path[:, :3]))
            if not separated or slow == SLOW_TOUCHES:
                break
        times, q, v = (np.concatenate(part) for part in zip(*path))
        # a flight begins with the state in which the contact ended
        times, first = np.unique(times, return_index=True)
        return CubicHermiteSpline(times, q[first], v[first])

    def _touch_down(
        self, trial: int, t: float, q: np.ndarray, v: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, bool]:
        """Times (s,), positions and velocities (s, size) in a contact to its end, and whether the body left the plate.

        Over a pad, whose contacts are short, the end alone.
        """
        clock, mech, T = self._over_plate(trial), self.mechanics, self.contact.contact_time
        clock.start(t, q, v)
        if clock.made.carriage is not None:
            m, context = mech.hidden, clock.context
            height, rise = mech.plate(np.array([t]), np.array([trial]))
            raised = 0.0 if m.plate_velocity else height[0, 0] - m.surface_height
            clock.made.carriage.set_translation(context, raised)
            clock.made.carriage.set_translation_rate(context, m.plate_velocity or rise[0, 0])
        looks, path, separated = LOOKS if self.surface == "pad" else POINTS, [], False
        for part in range(1, int(LONGEST * looks) + 1):
            end = t + part * T / looks
            clock.simulator.AdvanceTo(end)
            path.append((end, *clock.state()))
            separated = bool(mech.gap(path[-1][1][None], np.array([end]), np.array([trial]))[0] > 0.0)
            if separated:
                break
        times, q_path, v_path = (np.array(column) for column in zip(*(path[-1:] if self.surface == "pad" else path)))
        return times, q_path, v_path, separated

    def _over_plate(self, trial: int) -> "Clock":
        """Simulator over a plate of the drop's restitution; reused while that stays the same."""
        from thesis_lib.simulate.drake.clock import Clock
        from thesis_lib.simulate.drake.plant import drop_plant

        epsilon = float(self.mechanics.epsilon[trial])
        if self._plate is None or self._plate[0] != epsilon:
            made = drop_plant(self.body, self.contact, self.mechanics.hidden, self.gravity, self._made_of(epsilon))
            self._plate = epsilon, Clock(made, self.contact.contact_time, self.accuracy)
        return self._plate[1]

    def _made_of(self, epsilon: float) -> "Surface":
        """The surface with restitution `epsilon`."""
        from thesis_lib.simulate.drake.hunt_crossley import spring
        from thesis_lib.simulate.drake.modulus import solid
        from thesis_lib.simulate.drake.viscoelastic_pad import Pad

        if self.surface == "point":
            return spring(epsilon, self.contact.contact_time, self.mechanics.mass)
        if self.surface == "hydroelastic":
            return solid(self.body, epsilon, self.contact.contact_time)
        table = np.array([np.r_[p.k_contact, np.ravel(p.layers), p.mass] for p in self._pads])
        k, *layers, mass = (float(np.interp(epsilon, self._nodes, column)) for column in table.T)
        return Pad(k, tuple(zip(layers[::2], layers[1::2])), mass)

    def poses_at(self, times: np.ndarray) -> np.ndarray:
        """Poses (n, len(times), 3) of the body's origin; NaN after the end of a recording."""
        poses = []
        for path in self._paths:
            q = path(times)
            poses.append(np.column_stack([q[:, :2] - self.mechanics.origin(q[:, 2]), q[:, 2]]))
            poses[-1][times > path.x[-1] + 1e-9] = np.nan
        return np.array(poses)

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
