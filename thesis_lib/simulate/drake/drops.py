"""Drops of a planar body in Drake with compliant contact: a second source of data without an impact law.

Drake's MultibodyPlant has the body, the plate and the hidden causes (`plant`).  Drake logs its steps, and poses at the
samples are interpolated (cubic Hermite, exact for a parabola).  A contact lasts from the touch until body and plate,
both undeformed, no longer overlap.  Its impulse is the change of momentum minus the impulse of gravity.

Everything else is as in all simulated drops (`compliant.drops`).
Sources: R. Tedrake and the Drake development team, Drake, https://drake.mit.edu (Simulator, RungeKutta3Integrator).
"""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.compliant.contacts import LONGEST, Contacts
from thesis_lib.simulate.compliant.drops import Falls, Instants, refuse_foreign
from thesis_lib.simulate.compliant.forces import Mechanics
from thesis_lib.simulate.drake.clock import Clock, fly
from thesis_lib.simulate.drake.hunt_crossley import spring
from thesis_lib.simulate.drake.modulus import solid
from thesis_lib.simulate.drake.plant import Surface, drop_plant, pad_of
from thesis_lib.simulate.drake.viscoelastic_pad import Pad
from thesis_lib.simulate.rig.hidden_causes import CAUSES, CompliantContact, HiddenCauses

FLIGHT_STEP = 2e-3  # s; a corner at 0.05 m of a body spinning at 30 rad/s can penetrate at most 0.02 mm undetected
# relative accuracy of Drake's error control; a tenth of it changes velocities after impact by 0.01 mm/s
ACCURACY = 1e-4
LOOKS = 4  # number of checks per contact time whether the contact has ended
POINTS = 20  # states per contact time that are recorded in Drake's own contact, as samples may fall into it
WEAR_NODES = 5  # number of pads between which the pads of worn plates are interpolated

# causes for which Drake has no element: modelling them would only repeat the formulas of `compliant`
WITHOUT_ELEMENT = (
    *("stribeck", "friction_anisotropy", "rolling_lever", "adhesion_energy", "orientation_restitution"),
    *("friction_slope", "restitution_slope", "stiffness_slope", "soft_spot", "stiffness_patch"),
    "plate_curvature",
    *(f"{what}_{shape}" for what in ("restitution", "friction") for shape in ("patch", "bump", "step")),
)
SUPPORTED: tuple[str, ...] = tuple(name for name in CAUSES if name not in WITHOUT_ELEMENT)
# causes that can be hidden with each surface; Drake's own contact dissipates by Hunt and Crossley's law, which is then
# not a hidden cause; a hydroelastic body has sharp edges and no normal stiffness to which a tangential one could relate
SURFACES: dict[str, tuple[str, ...]] = {
    "pad": SUPPORTED,
    "point": tuple(name for name in SUPPORTED if name != "hunt_crossley"),
    "hydroelastic": tuple(
        name for name in SUPPORTED if name not in ("hunt_crossley", "tangential_compliance", "corner_radius")
    ),
}


@dataclass(frozen=True)
class DropsInDrake:
    """Drake as the engine of simulated drops.

    `surface` is "pad" (restitution independent of speed and lever), or Drake's own contact, "point" or "hydroelastic",
    for which ε and the contact time are those of a central impact at `REFERENCE_SPEED`.  The exponent of the contact
    must be 1, and its `steps` are not used.
    """

    surface: str = "pad"

    def accepts(
        self, contact: CompliantContact | None, hidden: HiddenCauses | None
    ) -> tuple[CompliantContact, HiddenCauses]:
        contact, m = contact or CompliantContact(), hidden or HiddenCauses()
        if self.surface not in SURFACES:
            raise UserError(f"Drake has no surface {self.surface!r}; known are {', '.join(SURFACES)}.")
        can, over = SURFACES[self.surface], "" if self.surface == "pad" else f" over the surface {self.surface!r}"
        refuse_foreign("Drake", contact, m, [name for name in CAUSES if name not in can], can, over)
        return contact, m

    def fall(self, mechanics: Mechanics, pose: np.ndarray, velocity: np.ndarray, instants: Instants) -> Falls:
        return _Run(self.surface, mechanics).falls(pose, velocity, instants.samples)


class _Run:
    """Drake's simulators and the contacts of all drops of one run; states hold the body, then the loose mass."""

    def __init__(self, surface: str, mechanics: Mechanics) -> None:
        self.mechanics, self.contact, self.surface = mechanics, mechanics.contact, surface
        self.contacts, every = Contacts(mechanics), mechanics.epsilon
        self._of = mechanics.believed, mechanics.contact, mechanics.hidden
        self._nodes = np.linspace(every.min(), every.max(), WEAR_NODES) if np.ptp(every) else every[:1]
        self._pads = []
        if self.surface == "pad":
            self._pads = [pad_of(*self._of, float(epsilon)) for epsilon in self._nodes]
        self._flight = Clock(drop_plant(*self._of, mechanics.believed_gravity), FLIGHT_STEP, ACCURACY)
        self._plate: tuple[float, Clock] | None = None

    def falls(self, pose: np.ndarray, velocity: np.ndarray, samples: np.ndarray) -> Falls:
        """Simulate the drops one after another."""
        paths = [self._fall(i, *state, samples) for i, state in enumerate(zip(pose, velocity))]
        return Falls.along(paths, self.mechanics, self.contacts.records, np.array([path.x[-1] for path in paths]))

    def _fall(self, trial: int, pose: np.ndarray, velocity: np.ndarray, samples: np.ndarray) -> CubicHermiteSpline:
        """Path of one drop from the pose and velocity (3,) of its origin to the last sample, or to rest."""
        flight, mech = self._flight, self.mechanics
        (centre,), (rate,) = mech.centre_state(pose[None], velocity[None])
        q, v = np.zeros((2, flight.size))  # a loose mass starts at rest relative to the body
        q[:3], v[:3] = np.r_[centre, pose[2]], np.r_[rate, velocity[2]]
        t, path, flies_on = 0.0, [], True

        def gap(q: np.ndarray, t: np.ndarray) -> np.ndarray:
            return mech.gap(q, t, np.full(len(t), trial))

        while flies_on:
            times, q_path, v_path, landed = fly(flight, gap, t, q, v, samples[samples > t + 1e-12])
            path.append((times, q_path[:, :3], v_path[:, :3]))
            t, q, v = times[-1], q_path[-1], v_path[-1]
            if not landed:
                break
            p_0, e_0 = flight.momentum_and_energy(q, v)
            start = q, v, t
            times, q_path, v_path, separated = self._touch_down(trial, t, q, v)
            path.append((times, q_path[:, :3], v_path[:, :3]))
            t, q, v = times[-1], q_path[-1], v_path[-1]
            p_1, e_1 = flight.momentum_and_energy(q, v)
            impulse = p_1 - p_0 - mech.mass * mech.gravity * (t - start[2])
            flies_on = self.contacts.add(trial, start, (q, v, t), separated, impulse, e_1 - e_0)
        times, q, v = (np.concatenate(part) for part in zip(*path))
        # a flight begins with the state at the end of a contact, which is then listed twice
        times, first = np.unique(times, return_index=True)
        return CubicHermiteSpline(times, q[first], v[first])

    def _touch_down(
        self, trial: int, t: float, q: np.ndarray, v: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, bool]:
        """Simulate a contact; return times (s,), positions, velocities (s, size), and whether the body left the plate.

        With a pad, whose contacts are short, only the state at the end is returned.
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

    def _over_plate(self, trial: int) -> Clock:
        """Simulator with a plate of the drop's restitution; reused as long as the restitution stays the same."""
        epsilon = float(self.mechanics.epsilon[trial])
        if self._plate is None or self._plate[0] != epsilon:
            made = drop_plant(*self._of, self.mechanics.believed_gravity, self._made_of(epsilon))
            self._plate = epsilon, Clock(made, self.contact.contact_time, ACCURACY)
        return self._plate[1]

    def _made_of(self, epsilon: float) -> Surface:
        """The surface with restitution `epsilon`."""
        if self.surface == "point":
            return spring(epsilon, self.contact.contact_time, self.mechanics.mass)
        if self.surface == "hydroelastic":
            return solid(self.mechanics.believed, epsilon, self.contact.contact_time)
        table = np.array([np.r_[p.k_contact, np.ravel(p.layers), p.mass] for p in self._pads])
        k, *layers, mass = (float(np.interp(epsilon, self._nodes, column)) for column in table.T)
        return Pad(k, tuple(zip(layers[::2], layers[1::2])), mass)
