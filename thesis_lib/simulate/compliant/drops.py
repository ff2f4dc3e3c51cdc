"""Drops of a planar body with compliant contact, integrated in continuous time without an impact law.

Each drop has its own clock.  Flight goes from tick to tick (samples and times between them, at most `FLIGHT_STEP`
apart) with classical Runge-Kutta steps, exact for a parabola.  Bisection cuts a step that ends below the plate at the
touch.  From there the contact forces of `forces` are integrated with the small step of the contact until nothing
touches or sticks; then it flies on.

A recording ends when the body comes to rest: after `SLOW_TOUCHES` slow contacts in a row, `MAX_CONTACTS` contacts, or a
contact longer than `LONGEST` contact times.

`rng` spawns three streams (releases, noise, phase of the plate), each drawn in the order of the drops, so drop i does
not depend on the number of drops (except under wear, which counts them).  Sources: see `hidden_causes`.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from thesis_lib.bodies.body import Body, Noise
from thesis_lib.simulate.compliant.compiled import MAX_CONTACTS, NO_LAW, falls
from thesis_lib.simulate.compliant.forces import Mechanics
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
LONGEST = 30.0  # contact times

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
        engine: class that integrates the motion, with the arguments and results of `CompliantMotion`, the default.
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
    drops = (engine or CompliantMotion)(mechanics, pose, velocity, samples, lagged, pictures)
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
    r = mechanics.lowest_point(q[:, 2], q[:, 0]) + mechanics.origin(q[:, 2])
    more = {"duration": after[2] - t, "energy_change": energy_change, "separated": separated}
    return contact_columns(rows, t, (pose, v_pre, v_post), r, impulse, **more)


class CompliantMotion:
    """Poses of n drops at the ticks, and the record of their contacts; `t` (n,) ends the recordings in s.

    Poses and velocities of release are (n, 3); `samples` and `lagged` are the times in s at which poses are asked for;
    `law`: see `hidden_laws`.
    """

    def __init__(
        self,
        mechanics: Mechanics,
        pose: np.ndarray,
        velocity: np.ndarray,
        samples: np.ndarray,
        lagged: np.ndarray,
        rate: float,
        law: tuple[int, int, float] = NO_LAW,
    ) -> None:
        self.ticks = _ticks(samples, lagged[lagged > 0.0], rate)
        # the loose mass starts at rest in the body
        centre, motion = mechanics.centre_state(pose, velocity)
        q = np.column_stack([centre, pose[:, 2], centre])
        v = np.column_stack([motion, velocity[:, 2], motion])
        longest = int(LONGEST * mechanics.contact.steps)
        self.poses, self.t, counts, states, times, impulse, left = falls(
            mechanics.world._replace(law=law), longest, q, v, self.ticks, mechanics.phase, mechanics.epsilon
        )
        made = np.arange(MAX_CONTACTS) < counts[:, None]
        before, after = ((*states[made][:, k : k + 2].swapaxes(0, 1), times[made][:, k // 2]) for k in (0, 2))
        shell, loose = mechanics.shell, mechanics.mass - mechanics.shell
        weights = 0.5 * np.array([shell, shell, mechanics.inertia, loose, loose])
        energy_change = (after[1] ** 2 - before[1] ** 2) @ weights
        rows = np.nonzero(made)[0]
        self.records = [contact_truth(mechanics, rows, before, after, impulse[made], energy_change, left[made])]

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
