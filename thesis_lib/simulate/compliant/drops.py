"""Drops of a planar body over a plate, without an impact law: the one way in which they are simulated and recorded.

What moves the bodies is an engine: our own contact in continuous time (`OwnContact`), MuJoCo or Drake.  Releases,
hidden causes, the plate's phase, the end of a recording, camera, tracker and truth are the same for all of them.

Our own gives each drop its own clock.  Flight goes from tick to tick (samples and times between them, at most
`FLIGHT_STEP` apart) with classical Runge-Kutta steps, exact for a parabola.  Bisection cuts a step that ends below the
plate at the touch.  From there the contact forces of `forces` are integrated with the small step of the contact until
nothing touches or sticks; then it flies on.

A recording ends when the body comes to rest (`contacts`).

`rng` spawns three streams (releases, noise, phase of the plate), each drawn in the order of the drops, so drop i does
not depend on the number of drops (except under wear, which counts them).  Sources: see `hidden_causes`.
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

FLIGHT_STEP = 1e-3  # s; a corner at 0.05 m turning with 60 rad/s dips by at most 0.02 mm undetected


@dataclass(frozen=True)
class Instants:
    """Times in s: `samples`, `rate` (Hz) of them, and `ticks` (samples, lagged samples and times between)."""

    rate: float
    samples: np.ndarray
    ticks: np.ndarray


@dataclass(frozen=True)
class Falls:
    """Motions of n releases by an engine.

    Attributes:
        poses_at: poses (n, k, 3) of the origin at k times in s that are ticks; NaN after the end of a recording.
        contacts: of columns `TRUTH`.
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
        """Those of n paths of the true centre of mass: functions from k times to states (k, 3)."""

        def poses_at(times: np.ndarray) -> np.ndarray:
            q = np.array([path(times) for path in paths])
            origin = mechanics.origin(q[..., 2].ravel()).reshape(*q.shape[:2], 2)
            poses = np.concatenate([q[..., :2] - origin, q[..., 2:]], axis=-1)
            poses[times > t[:, None] + 1e-9] = np.nan
            return poses

        return cls(poses_at, contacts, t)


class Engine(Protocol):
    """Simulator that moves the bodies."""

    def accepts(
        self, contact: CompliantContact | None, hidden: HiddenCauses | None
    ) -> tuple[CompliantContact, HiddenCauses]:
        """Contact and hidden causes as the engine has them, its own for None; UserError for what it cannot make."""
        ...

    def fall(self, mechanics: Mechanics, pose: np.ndarray, velocity: np.ndarray, instants: Instants) -> Falls:
        """The falls of n bodies from poses and velocities (n, 3) of their origins."""
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
        body, gravity: as believed, m/s².
        engine: what moves the bodies: `OwnContact()`, the default, `DropsInMujoco()` or `DropsInDrake()`.
        contact: the contact without hidden causes.
        duration, rate: s, Hz; samples at 0, 1/rate, ... up to the duration.
        noise: one-sigma noise of position (x, y each) and angle; none where it is None or absent.
        tracker: how poses are recorded; if None, as they are seen.

    Returns:
        Drops whose `impacts` also have duration (s) and separated (False where the recording ended during the contact),
        and whose `trials` have contacts (count) and t_end, the end of the recording in s.

    Raises:
        UserError: the body has no mass, an argument is out of range, a release touches the plate, or the engine cannot
            make the contact or a hidden cause.
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
    """Refuse, with a UserError, what an engine with a linear contact cannot make: causes that it `lacks`, and more."""
    if asked := [name for name in lacks if getattr(m, name)]:
        raise UserError(
            f"Drops in {engine} cannot have {', '.join(asked)}{over}: {engine} has no such contact. "
            f"Take our own simulator for it (OwnContact); {engine} makes {', '.join(can)}."
        )
    if contact.exponent != 1.0:
        raise UserError(f"{engine}'s contact is linear: exponent must be 1, got {contact.exponent}.")
    if m.plate_velocity and m.plate_amplitude:
        raise UserError(f"Drops in {engine} have one carriage: give plate_velocity or plate_amplitude, not both.")


@dataclass(frozen=True)
class OwnContact:
    """Our own integrator; `law`: see `hidden_laws`."""

    law: tuple[int, int, float] = NO_LAW

    def accepts(
        self, contact: CompliantContact | None, hidden: HiddenCauses | None
    ) -> tuple[CompliantContact, HiddenCauses]:
        return contact or CompliantContact(), hidden or HiddenCauses()

    def fall(self, mechanics: Mechanics, pose: np.ndarray, velocity: np.ndarray, instants: Instants) -> Falls:
        # the loose mass starts at rest in the body
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
    """Poses (n, k, 3) at k times, of those (n, m, 3) at `ticks` (m,)."""
    return lambda times: poses[:, np.abs(ticks[:, None] - times).argmin(axis=0)]


def _ticks(samples: np.ndarray, lagged: np.ndarray, rate: float) -> np.ndarray:
    """Times in s at which flights stop: samples, lagged samples, and times between at most `FLIGHT_STEP` apart."""
    parts = int(np.ceil(1.0 / (rate * FLIGHT_STEP) - 1e-9))
    between = (samples[:-1, None] + np.arange(parts) / (parts * rate)).ravel()
    ticks = np.unique(np.concatenate([between, samples[-1:], lagged]))
    # a lag near a whole part of a sample would give pairs of ticks that differ by rounding
    return ticks[np.r_[True, np.diff(ticks) > 1e-9]]
