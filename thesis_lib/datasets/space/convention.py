"""Check that rotations are read as written: the data reveal a wrong order of quaternions, or a left-handed frame.

A quaternion with permuted components also rotates smoothly about a fixed axis, and a frame with one reversed axis
rotates in the opposite sense.  For a body that moves in a vertical plane, two quantities reveal this:

    S_f  = Σ [(v·n)² + k² (|ω|² − (ω·n)² + (ω·n − its mean)²)] / Σ [|v_h|² + k² |ω|²]      over a flight f
    c±   = ± k² Δω − r_x(±θ) Δv_y + r_y(±θ) Δv_x

S is the median over the flights, with the normal n that minimises the sum of their numerators: the share of the energy
that is out of the best plane or in unsteady rotation, without the fall (v_h: horizontal part of v).  Without a torque
the rotation is constant, and its axis is normal to the plane of the motion.  c is the couple of an impact over the
mass, 0 at a point contact: it is small for the true sign of the rotation, at the angle of the shape in its frame that
fits best.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from thesis_lib.bodies.shapes import Shape
from thesis_lib.datasets.space.flights import Track, inner, smoothed_turning
from thesis_lib.datasets.space.motion import Motion, turning
from thesis_lib.datasets.space.plane import Plane, in_plane, signed
from thesis_lib.foundation.errors import UserError

OUT = 0.02  # S of a planar motion is far below 0.01; that of a wrong reading is some hundredths to tenths
BETTER = 0.25  # S of another reading over that of the stated one, below which the other is preferred
SLOW = 0.05  # m/s: horizontal speed and k|ω| below it (rms) decide nothing
CONTACT = 0.05  # s between two flights with an impact between
MIRRORED = 0.5  # typical couple of the opposite sign over that of the stated one, below which the sign is wrong
TURNS = np.radians(np.arange(0.0, 360.0, 3.0))  # trial angles of the shape against its frame
FINER = np.radians(np.arange(-6.0, 6.5, 0.5))  # finer steps about the best of these
SAME = 1.001  # ratio of couples that count as equal, such as those of a square turned by 90°
OFF = np.radians(6.0)  # least angle of the shape that is reported ...
CLEARLY = 0.5  # ... if it reduces the couples to this share
IMPACTS = 12  # fewest impacts that determine the sign
SHOWN = 3  # readings named in a message


@dataclass(frozen=True, eq=False)
class Scene:
    """The parts of a recording that do not depend on how rotations are read: the track with its flights, and the rig.

    `turn` is the angle (rad) of the shape against the tracked frame; `plane` is None if it is not known.
    """

    track: Track
    flights: Sequence[slice]
    shape: Shape
    k_g: float  # m
    up: np.ndarray
    plane: Plane | None
    turn: float = 0.0


@dataclass(frozen=True)
class ReadingFit:
    """How well a reading fits: `out` is S, `mirrored` the couple with reversed rotation over the couple as read.

    `turned` (rad) is the angle of the shape against the frame that it was believed to have, 0 if the impacts do not
    show one.
    """

    out: float
    mirrored: float  # NaN if impacts are few
    turned: float

    @property
    def good(self) -> bool:
        """Whether the reading is consistent with the data."""
        return not (self.out > OUT or self.mirrored < MIRRORED)


def check_reading(motion: Motion, scene: Scene) -> ReadingFit:
    """The fit of the motion with its stated reading; UserError if another of its readings fits far better."""
    stated = fit(motion, scene)
    if stated.good:
        return stated
    others = {}
    for option, read in motion.readings.items():
        other = fit(replace(motion, quaternion=read()), scene)
        if not other.good:
            continue
        if other.out < BETTER * stated.out or stated.out <= OUT:
            others[option] = other
    if not others:
        return stated
    wrong = "its impacts turn the body in the wrong direction"
    if stated.out > OUT:
        wrong = f"{stated.out:.0%} of its energy is out of any plane, or in rotation that changes in free flight"
    best = sorted(others, key=lambda option: others[option].out)
    raise UserError(
        f"{motion.source}: read as stated, the rotations do not fit the motion: {wrong}. They fit with "
        f"{' or with '.join(best[:SHOWN])}. Find out how the log was written, and state it."
    )


def fit(motion: Motion, scene: Scene) -> ReadingFit:
    """S and the sign of the rotation of a motion; if `scene` has a plane, n is its normal."""
    samples, track, up, plane = 0, scene.track, scene.up, scene.plane
    omega = smoothed_turning(turning(motion.quaternion), motion.t, track.half)
    energy, spin, total = [], [], []
    for flight in scene.flights:
        rows = inner(flight, track)
        v, w = track.v[rows], scene.k_g * omega[rows]
        whole = np.isfinite(v).all(axis=1) & np.isfinite(w).all(axis=1)
        if not whole.any():
            continue
        v, w = v[whole], w[whole]
        change = w - w.mean(axis=0)
        energy.append(v.T @ v - w.T @ w + change.T @ change)
        spin.append(np.sum(w**2))
        total.append(max(np.sum((v - np.outer(v @ up, up)) ** 2) + spin[-1], 1e-12))
        samples += len(v)
    if samples == 0 or np.sum(spin) < samples * SLOW**2:
        return ReadingFit(0.0, np.nan, 0.0)
    if plane is None:
        plane = Plane.of(signed(np.linalg.eigh(np.sum(energy, axis=0))[1][:, 0], up), up)
    out = np.einsum("i,nij,j->n", plane.normal, np.stack(energy), plane.normal) + spin
    order = np.argsort(out / np.array(total))
    middle = order[np.searchsorted(np.cumsum(np.array(total)[order]), np.sum(total) / 2.0)]
    return ReadingFit(float(out[middle] / total[middle]), *_couples(motion, scene, omega, plane))


def _couples(motion: Motion, scene: Scene, omega: np.ndarray, plane: Plane) -> tuple[float, float]:
    """Typical |c₋| over |c₊| of the impacts, and the angle of the shape that they show; NaN and 0 if they are few."""
    q, track = in_plane(motion, plane)[0], scene.track
    rows = []
    for before, after in zip(scene.flights[:-1], scene.flights[1:]):
        if motion.t[after.start] - motion.t[before.stop - 1] > CONTACT:
            continue
        i, j = inner(before, track).stop - 1, inner(after, track).start
        hit = (motion.t[before.stop - 1] + motion.t[after.start]) / 2.0
        start, end = (track.v[n] + track.a[n] * (hit - motion.t[n]) for n in (i, j))
        spin = omega[[i, j]] @ plane.normal
        theta = scene.turn + q[i, 2] + spin[0] * (hit - motion.t[i])
        rows.append([*((end - start) @ np.stack([plane.x, plane.y]).T), spin[1] - spin[0], theta])
    rows = np.array(rows).reshape(-1, 4)
    rows = rows[np.isfinite(rows).all(axis=1)]
    if len(rows) < IMPACTS:
        return float("nan"), 0.0
    dvx, dvy, dw, theta = rows.T

    def couples(sign: float, turns: np.ndarray) -> np.ndarray:
        r = scene.shape.contact_point((sign * theta + turns[:, None]).ravel()).reshape(len(turns), -1, 2)
        return np.abs(sign * scene.k_g**2 * dw - r[..., 0] * dvy + r[..., 1] * dvx)

    along, against = (np.median(couples(sign, TURNS), axis=1) for sign in (1.0, -1.0))
    least = np.flatnonzero(along <= SAME * np.min(along))  # several for a shape with symmetries
    finer = TURNS[least[np.argmin(np.abs(_wrapped(TURNS[least])))]] + FINER
    # large couples are capped: those of hits nearly on two corners are large at any angle
    turned = float(_wrapped(finer[np.argmin(np.minimum(couples(1.0, finer), 3.0 * np.min(along)).mean(axis=1))]))
    tells = np.min(along) < CLEARLY * along[0] and abs(turned) > OFF
    return float(np.min(against) / max(np.min(along), 1e-12)), turned if tells else 0.0


def _wrapped(angle: np.ndarray) -> np.ndarray:
    """Angles in rad between -π and π."""
    return np.angle(np.exp(1j * angle))
