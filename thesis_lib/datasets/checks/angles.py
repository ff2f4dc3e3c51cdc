"""Are angles given in degrees?  Heuristics that must not misfire on real drops.

Angles are judged by physics, not by size: θ is continuous, so 20 rad is as good a value as 0.2.  Degrees read as
radians are 57 times too large.  Each of these reveals them (k is the radius of gyration):

- steps of more than 1.5 turns between samples: a camera cannot resolve them, and a wrapped radian angle jumps by one
  turn at most.  A single sample that jumps out and back is a glitch of the tracker, whatever the units;
- a median k|ω| above 10 times the median speed, which makes the rotational energy 100 times the translational energy,
  unless hits change the spin as friction would in radians;
- k|ω| above the speed, and a body that is inside the surface at the angles as given, but not if read as degrees;
- hits that change the spin far more than a contact at the rim can: without a couple k² |Δω| ≤ R |Δv|, R the extent.

The third test decides nothing if the contact point does not depend on the angle (a disk).  A warning is then given if
k|ω| exceeds the speed, or if the angle noise at the rim far exceeds the position noise.
"""

import numpy as np

from thesis_lib.bodies.shapes import Shape
from thesis_lib.datasets.checks.known_body import BLIND_SHAPE, FEW_HITS, RADIANS, TO_RAD, KnownBody
from thesis_lib.datasets.checks.lasting_contacts import lasting_contacts
from thesis_lib.datasets.format.samples import Samples
from thesis_lib.datasets.format.validate import UsableRows

BLIND_STEP = 3.0 * np.pi  # rad between samples: a true step below π plus a wrap of one turn
BLIND_MEDIAN = 5  # samples on either side of a step, up to two of them glitches
ELSEWHERE = 3.0  # times the 99 % quantile of position steps: a larger step is not a motion of the body
MIN_BLIND_STEPS = 3  # one or two may be glitches of a tracker
SPIN_SURE = 10.0  # k|ω| over speed; dice throws have 0.25 (2.7 at most), a spun coin about 5
SPIN_FAST = 1.0  # m/s of k|ω|; below it both medians may be tracker noise of a body at rest
SPIN_LIKELY = 1.0  # k|ω| over speed; in degrees, dice throws have 14
HIT = 0.5  # m/s between steps, beyond gravity, that only a hit causes ...
CLEAR_HIT = 8.0  # ... if it is so many times the median
BEYOND = 2.5  # k² |Δω| over R |Δv|: at most 1; dice throws and simulated drops have 0.1 to 0.3, in degrees 6 to 17
RUBS = 0.05  # of the same ratio: from here on, friction explains the spin in radians, and the body really spins
RIM_NOISE = 5.0  # k σ_θ over σ of positions; markers at the rim give 1, degrees 57
BURIED = 0.5  # smallest half-widths; a centre that stays below is inside the surface at any angle
DEEP = 0.1  # penetration in extents that no tracker error explains ...
DEEP_SHARE = 0.05  # ... if it happens this often


def check_degrees(table: UsableRows, samples: Samples, speeds: dict, noise: np.ndarray, body: KnownBody) -> None:
    """Report angles in degrees and bodies deep inside the surface, as warnings if the data are not conclusive.

    `speeds` are |Δx|/Δt, |Δy|/Δt (m/s) and |Δθ|/Δt (rad/s) of all steps, by name; `noise` (3,) is in m, m, rad.
    """
    shape, k_g, y, theta = body.shape, body.k_g, samples.q[:, 1], samples.q[:, 2]
    why = None
    # inside at any angle: the shape or the surface height is wrong, which is reported below
    buried = shape is not None and np.quantile(y - body.height, 0.9) < BURIED * _reach(shape)[0]
    speed = float(np.median(np.hypot(speeds["x"], speeds["y"])))
    blind = _blind_steps(samples)
    if blind >= MIN_BLIND_STEPS:
        why = f"{blind} steps between samples are larger than 1.5 turns"
    elif shape is not None and k_g is not None and not buried:
        spin = k_g * float(np.median(speeds["theta"]))
        inside, in_degrees = (_share_inside(shape, body.height, y, angle) for angle in (theta, theta * TO_RAD))
        beyond = _beyond_contact(samples, body)
        if beyond > BEYOND:
            why = f"as radians, hits would change the spin {beyond:.0f} times more than a contact at the rim can"
        elif spin > max(SPIN_FAST, SPIN_SURE * speed) and speed > 0.0 and not RUBS < beyond < 1.0:
            why = f"as radians, the rim would move {spin / speed:.0f} times faster than the centre"
        elif spin > SPIN_LIKELY * speed > 0.0 and inside > DEEP_SHARE > in_degrees:
            why = f"as radians, the body would be inside the surface in {inside:.0%} of the rows, as degrees in none"
    if why:
        table.error("column theta", f"looks like degrees ({theta.min():.4g} to {theta.max():.4g}; {why})", RADIANS)
        return
    if shape is None or k_g is None:
        return
    low, high = _reach(shape)
    if not buried and high - low <= BLIND_SHAPE * shape.extent:
        _doubt_degrees_of_a_disk(table, theta, speed, k_g * float(np.median(speeds["theta"])), noise, k_g)
    inside = _share_inside(shape, body.height, y, theta, 2.5 * DEEP)
    gap = shape.gap(y, theta, body.height)
    if inside > DEEP_SHARE and not lasting_contacts(samples, gap, float(noise[1]), body.gravity):
        remedy = "check surface.height, the shape (in m), and that theta is counter-clockwise, and 0 for the shape "
        what = f"the body is deep inside the surface in {inside:.0%} of the rows"
        table.warn("columns y and theta", what, remedy + "as drawn")


def _doubt_degrees_of_a_disk(
    table: UsableRows, theta: np.ndarray, speed: float, spin: float, noise: np.ndarray, k_g: float
) -> None:
    """Warn of angles that may be degrees if no contact can decide; `speed` and `spin` = k|ω| are medians in m/s."""
    position, rim = float(np.max(noise[:2])), k_g * noise[2]
    why = []
    if spin > max(SPIN_FAST, SPIN_LIKELY * speed) and speed > 0.0:
        why.append(f"as radians, the rim moves {spin / speed:.1f} times faster than the centre")
    if rim > RIM_NOISE * position:
        times = f"{rim / position:.0f} times as much as the position"
        why.append(f"theta scatters by {noise[2]:.2g} rad, at the rim {times}")
    if why:
        what = f"may be in degrees ({theta.min():.4g} to {theta.max():.4g}; {'; '.join(why)})"
        remedy = f"{RADIANS}; no change if it is in radians, and the body spins fast or its angle is hard to measure"
        table.warn("column theta", f"{what}; the contacts of a round body cannot decide", remedy)


def _blind_steps(samples: Samples) -> int:
    """Number of steps of θ that are too large for a camera, without steps to and from samples that jump out and back.

    A step at which the position jumps, too, begins another motion and does not count.
    """
    n, run, theta = BLIND_MEDIAN, samples.run, samples.q[:, 2]
    if len(theta) < 2 * n:
        return 0
    level = np.median(np.lib.stride_tricks.sliding_window_view(theta, n), axis=1)
    same = run[2 * n - 1 :] == run[: len(run) - 2 * n + 1]
    # medians over the n samples before and the n after a step
    lasting = np.abs(level[n:] - level[:-n]) > BLIND_STEP
    moved = np.linalg.norm(np.diff(samples.q[:, :2], axis=0), axis=1)
    follows = moved <= ELSEWHERE * np.quantile(moved, 0.99)
    steps = ((np.abs(np.diff(theta)) > BLIND_STEP) & follows)[n - 1 : len(theta) - n]
    return int(np.sum(steps & lasting & same))


def _beyond_contact(samples: Samples, body: KnownBody) -> float:
    """Median over hits of k² |Δω| / (R |Δv|), from differences of steps; 0 where hits are few or do not stand out."""
    assert body.shape is not None and body.k_g is not None
    dt = np.diff(samples.t)
    same = (samples.run[2:] == samples.run[:-2]) & (dt[1:] > 0.0) & (dt[:-1] > 0.0)
    if not same.any():
        return 0.0
    rate = np.diff(samples.q, axis=0) / np.where(dt > 0.0, dt, np.inf)[:, None]
    change = np.diff(rate, axis=0)[same]
    change[:, 1] += body.gravity * (dt[1:] + dt[:-1])[same] / 2.0
    dv, domega = np.hypot(change[:, 0], change[:, 1]), np.abs(change[:, 2])
    hit = dv > max(HIT, CLEAR_HIT * float(np.median(dv)))
    if hit.sum() < FEW_HITS or np.median(domega[hit]) < CLEAR_HIT * np.median(domega[~hit]):
        return 0.0
    return float(np.median(body.k_g**2 * domega[hit] / (body.shape.extent * dv[hit])))


def _reach(shape: Shape) -> tuple[float, float]:
    """Smallest and largest distance (m), over a full turn, from the body origin down to the lowest point."""
    depth = -shape.contact_point(np.linspace(0.0, 2.0 * np.pi, 181))[:, 1]
    return float(depth.min()), float(depth.max())


def _share_inside(shape: Shape, height: float, y: np.ndarray, theta: np.ndarray, depth: float = DEEP) -> float:
    """Share of the poses in which the body reaches more than `depth` extents into the surface."""
    return float(np.mean(shape.gap(y, theta, height) < -depth * shape.extent))
