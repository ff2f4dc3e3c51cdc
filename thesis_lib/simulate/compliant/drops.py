"""Drops of a planar body onto a plate, simulated and recorded without an impact law.

An engine moves the bodies: our own contact in continuous time (`OwnContact`), MuJoCo or Drake.  Releases, hidden
causes, the plate's phase, the end of a recording, camera, tracker and truth are the same for all engines.

Our own engine integrates each drop separately.  Flight advances from tick to tick (samples and times between them, at
most `FLIGHT_STEP` apart) with classical Runge-Kutta steps, exact for a parabola.  If a step ends below the plate, the
instant of touch is found by bisection.  From there the contact forces of `forces` are integrated with the small time
step of the contact until no point touches or sticks; then the flight continues.

A recording ends when the body comes to rest (`contacts`).

`rng` spawns three streams (releases, noise, phase of the plate), each drawn in the order of the drops; drop i therefore
does not depend on the number of drops (except under wear, which depends on it).  Sources: see `hidden_causes`.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from thesis_lib.bodies.body import Body, Noise
from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.compliant.compiled import MAX_CONTACTS, NO_LAW, falls
from thesis_lib.simulate.compliant.contacts import LONGEST, TRUTH, contact_truth
from thesis_lib.simulate.compliant.forces import Mechanics
from thesis_lib.simulate.rig.camera import reported, wobble
from thesis_lib.simulate.rig.hidden_causes import CompliantContact, HiddenCauses
from thesis_lib.simulate.rig.record import (
    DropsWithTruth,
    as_dataset,
    check_request,
    contact_table,
    sample_times,
    trial_table,
)
from thesis_lib.simulate.rig.release import Release
from thesis_lib.simulate.rig.smoothing import low_pass
from thesis_lib.simulate.rig.tracker import Tracker

FLIGHT_STEP = 1e-3  # s; a corner at 0.05 m of a body spinning at 60 rad/s can penetrate at most 0.02 mm undetected


@dataclass(frozen=True)
class Instants:
    """Times in s: `samples`, `rate` (Hz) of them, and `ticks` (samples, lagged samples and times between)."""

    rate: float
    samples: np.ndarray
    ticks: np.ndarray


@dataclass(frozen=True)
class Falls:
    """Motions of n released bodies, simulated by an engine.

    Attributes:
        poses_at: returns the poses (n, k, 3) of the origin at k ticks in s; NaN after the end of a recording.
        contacts: tables of contacts with the columns `TRUTH`.
        t: (n,) s, ends of the recordings.
    """

    poses_at: Callable[[np.ndarray], np.ndarray]
    contacts: list[dict[str, np.ndarray]]
    t: np.ndarray

    @classmethod
    def along(
        cls,
        paths: Sequence[Callable[[np.ndarray], np.ndarray]],
        mechanics: Mechanics,
        contacts: list[dict[str, np.ndarray]],
        t: np.ndarray,
    ) -> "Falls":
        """Falls along n paths of the true centre of mass, which are functions from k times to states (k, 3)."""

        def poses_at(times: np.ndarray) -> np.ndarray:
            q = np.array([path(times) for path in paths])
            origin = mechanics.origin(q[..., 2].ravel()).reshape(*q.shape[:2], 2)
            poses = np.concatenate([q[..., :2] - origin, q[..., 2:]], axis=-1)
            poses[times > t[:, None] + 1e-9] = np.nan
            return poses

        return cls(poses_at, contacts, t)


class Engine(Protocol):
    """Simulator that moves the bodies of simulated drops."""

    def accepts(
        self, contact: CompliantContact | None, hidden: HiddenCauses | None
    ) -> tuple[CompliantContact, HiddenCauses]:
        """Contact and hidden causes as the engine uses them (None: its defaults); UserError if it cannot model them."""
        ...

    def fall(self, mechanics: Mechanics, pose: np.ndarray, velocity: np.ndarray, instants: Instants) -> Falls:
        """Simulate the falls of n bodies from poses and velocities (n, 3) of their origins."""
        ...


def simulate_compliant_drops(
    body: Body,
    release: Release,
    n: int,
    *,
    engine: Engine | None = None,
    contact: CompliantContact | None = None,
    hidden: HiddenCauses | None = None,
    gravity: float = 9.81,
    duration: float = 0.5,
    rate: float = 250.0,
    noise: Noise | None = None,
    tracker: Tracker | None = None,
    rng: np.random.Generator,
) -> DropsWithTruth:
    """Release n bodies over a plate and record their poses.

    Args:
        body, gravity: as believed; gravity in m/s².
        engine: simulator that moves the bodies: `OwnContact()` (the default), `DropsInMujoco()` or `DropsInDrake()`.
        contact: the contact without hidden causes.
        duration, rate: s, Hz; samples at 0, 1/rate, ... up to the duration.
        noise: one-sigma noise of position (x, y each) and angle; no noise if None or absent.
        tracker: settings of the recording; if None, the poses are recorded as the camera sees them.

    Returns:
        Drops whose `impacts` also have duration (s) and separated (False if the recording ended during the contact),
        and whose `trials` have contacts (their number) and t_end, the end of the recording in s.

    Raises:
        UserError: the body has no mass, an argument is out of range, a release touches the plate, or the engine cannot
            model the contact or a hidden cause.
    """
    engine = engine or OwnContact()
    contact, hidden = engine.accepts(contact, hidden)
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
    instants = Instants(pictures, samples, _ticks(samples, lagged[lagged > 0.0], pictures))
    made = engine.fall(mechanics, pose, velocity, instants)
    poses_at = made.poses_at
    if tracker and tracker.time_constant:
        seen = low_pass(poses_at(instants.ticks), instants.ticks, velocity, tracker.time_constant)
        poses_at = _at_ticks(seen, instants.ticks)
    poses = poses_at(samples)
    late = poses[..., 2]
    if hidden.time_lag:
        late = poses_at(np.maximum(lagged, 0.0))[..., 2] + np.minimum(lagged, 0.0) * velocity[:, 2:]
    impacts = contact_table(made.contacts, TRUTH, {"separated": bool})
    if hidden.wobble:
        shown = wobble(impacts, samples, n, hidden, body.radius_of_gyration)
        poses, late = poses + shown, late + shown[..., 2]
    poses = reported(poses, late, samples, hidden)
    dataset = as_dataset(poses, f"{n} drops", body, gravity, rate, noise, noise_rng, tracker)
    count = np.bincount(impacts["trial"], minlength=n)
    return DropsWithTruth(*dataset, impacts, trial_table(pose, velocity, contacts=count, t_end=made.t))


def refuse_foreign(
    engine: str, contact: CompliantContact, m: HiddenCauses, lacks: Iterable[str], can: Sequence[str], over: str = ""
) -> None:
    """Raise UserError for causes that an engine `lacks`, a nonlinear contact, or two motions of the plate at once."""
    if asked := [name for name in lacks if getattr(m, name)]:
        raise UserError(
            f"Drops in {engine} cannot have {', '.join(asked)}{over}: {engine} has no such contact. "
            f"Use our own simulator for it (OwnContact); {engine} supports {', '.join(can)}."
        )
    if contact.exponent != 1.0:
        raise UserError(f"{engine}'s contact is linear: exponent must be 1, got {contact.exponent}.")
    if m.plate_velocity and m.plate_amplitude:
        raise UserError(f"The plate in {engine} has one carriage: give plate_velocity or plate_amplitude, not both.")


@dataclass(frozen=True)
class OwnContact:
    """Our own integrator as an engine; `law` is a hidden law of the contact (see `hidden_laws`)."""

    law: tuple[int, int, float] = NO_LAW

    def accepts(
        self, contact: CompliantContact | None, hidden: HiddenCauses | None
    ) -> tuple[CompliantContact, HiddenCauses]:
        return contact or CompliantContact(), hidden or HiddenCauses()

    def fall(self, mechanics: Mechanics, pose: np.ndarray, velocity: np.ndarray, instants: Instants) -> Falls:
        # the loose mass starts at rest relative to the body
        centre, motion = mechanics.centre_state(pose, velocity)
        q = np.column_stack([centre, pose[:, 2], centre])
        v = np.column_stack([motion, velocity[:, 2], motion])
        world, longest = mechanics.world._replace(law=self.law), int(LONGEST * mechanics.contact.steps)
        poses, t, counts, states, times, impulse, left = falls(
            world, longest, q, v, instants.ticks, mechanics.phase, mechanics.epsilon
        )
        made = np.arange(MAX_CONTACTS) < counts[:, None]
        before, after = ((*states[made][:, k : k + 2].swapaxes(0, 1), times[made][:, k // 2]) for k in (0, 2))
        contacts = contact_truth(mechanics, np.nonzero(made)[0], before, after, left[made], impulse[made])
        return Falls(_at_ticks(poses, instants.ticks), [contacts], t)


def _at_ticks(poses: np.ndarray, ticks: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """Function that returns poses (n, k, 3) at k times, selected from the poses (n, m, 3) at `ticks` (m,)."""
    return lambda times: poses[:, np.abs(ticks[:, None] - times).argmin(axis=0)]


def _ticks(samples: np.ndarray, lagged: np.ndarray, rate: float) -> np.ndarray:
    """Times in s at which flight steps end: samples, lagged samples, and times between at most `FLIGHT_STEP` apart."""
    parts = int(np.ceil(1.0 / (rate * FLIGHT_STEP) - 1e-9))
    between = (samples[:-1, None] + np.arange(parts) / (parts * rate)).ravel()
    ticks = np.unique(np.concatenate([between, samples[-1:], lagged]))
    # a lag close to a multiple of the spacing would give pairs of ticks that differ only by rounding
    return ticks[np.r_[True, np.diff(ticks) > 1e-9]]
