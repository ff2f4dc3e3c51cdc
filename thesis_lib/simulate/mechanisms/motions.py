"""Bodies, releases and torques of chapter 2's simulations (thesis 2.4).

The thesis gives m = 1 kg, ε = 0.6, μ = 0.7 and m/I = 6 and 0.8 1/m² for block and ellipse.  The ratios determine the
size of uniform bodies: m/I = 6/a² for a square of side a, hence a = 1 m, and m/I = 4/(a² + b²) for an ellipse, hence
semi-axes of 2 and 1 m.  Everything else is our choice; the descriptions of the settings give the reasons.

The torques of the arm are open loop: a share of the arm's weight at the start, which lets it descend onto the disk, and
two sines per joint with random phases, which excite all inertial parameters,

    τ_i(t) = τ_i0 - s g_i(q_0) + Σ_j A_i sin(2π f_ij t + ψ_ij).

The disk spins when it lands.  If it only rolls on the ground, only the combination m + I/R² of its inertial parameters
is identifiable, even if it slips on the arm; a landing with slip adds I/m, and both parameters become identifiable.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from pydantic import Field

from thesis_lib.bodies.shapes import Disk, Ellipse, Polygon
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.settings import Section
from thesis_lib.simulate.rig.release import Release, Spread
from thesis_lib.simulate.stepping.arm_disk import ArmDisk
from thesis_lib.simulate.stepping.multibody import PlanarFreeBody, Rod
from thesis_lib.simulate.stepping.rimless_wheel import RimlessWheel
from thesis_lib.simulate.stepping.stepping import SimulatedMotion, simulate

Kind = Literal["block", "ellipse", "disk", "rod", "wheel"]
# most trajectories drawn per accepted trajectory of the arm; if more are needed, the settings give no contact
MAX_TRIES = 50
FILTERS = ("not solved", "too fast", "arm below the ground", "too little contact")


class Releases(Release):
    """States from which a body is released, at x = 0; x and y are along and normal to the surface."""

    height: Spread = Field(description="m, centre of mass above the surface")
    vx: Spread = Field(
        Spread(low=-1.0, high=1.0), description="m/s, like the speed of the fall in the last fraction of a second"
    )
    vy: Spread = Field(Spread(low=-1.0, high=1.0), description="m/s")
    omega: Spread = Field(Spread(low=-3.0, high=3.0), description="rad/s, up to one turn per drop")


class WheelSettings(Section):
    """Rimless wheel; the thesis shows eight spokes (figure 2-8) but gives no numbers."""

    spokes: int = Field(8, ge=3, le=100, description="as drawn in figure 2-8")
    length: float = Field(1.0, gt=0, description="m, hub to tip; own choice: the size of the other bodies")
    mass: float = Field(1.0, gt=0, description="kg, unit mass of the thesis")
    inertia: float = Field(0.5, gt=0, description="kg m²; own choice: half of the mass at the tips")
    slope: float = Field(0.15, ge=0, lt=1.5, description="rad; own choice: steady rolling at 2 rad/s")
    omega: Spread = Field(
        Spread(low=-2.0, high=-1.2), description="rad/s at the start, downhill; around the limit cycle"
    )
    mu: float = Field(0.7, ge=0, description="thesis")
    mu_low: float = Field(0.1, ge=0, description="low friction of figure 2-9 c; own choice, below the slope")
    epsilon: float = Field(
        0.0, ge=0, le=1, description="own choice: the feet of a walker do not rebound, and contact lasts"
    )


class ArmSettings(Section):
    """Two-link arm with disk; the thesis gives no numbers for it."""

    link_lengths: tuple[float, float] = Field((0.8, 0.8), description="m; own choice")
    link_masses: tuple[float, float] = Field((1.0, 0.8), description="kg; own choice, of the disk's order")
    link_coms: tuple[float, float] = Field((0.36, 0.42), description="m from the joint; own choice, off the middle")
    link_inertias: tuple[float, float] = Field((0.06, 0.045), description="kg m²; own choice, rod-like")
    base: tuple[float, float] = Field((0.0, 0.5), description="m, first joint; own choice")
    disk_radius: float = Field(0.25, gt=0, description="m; own choice")
    disk_mass: float = Field(1.0, gt=0, description="kg, unit mass of the thesis")
    disk_inertia: float = Field(0.04, gt=0, description="kg m²; own choice, above the 0.031 of a uniform disk")
    mu: float = Field(
        0.4, ge=0, le=0.4, description="own choice: with the 0.7 of the thesis the disk might never slip, see 2.3.3"
    )
    epsilon: float = Field(0.0, ge=0, le=1, description="own choice: contact lasts from the first touch on")
    steps: int = Field(240, ge=1, description="1.2 s; own choice: the disk leaves the wedge")
    link_1: Spread = Field(Spread(low=-0.3, high=0.0), description="rad, q_1 at the start")
    incline: Spread = Field(Spread(low=0.7, high=1.0), description="rad, q_1 + q_2 at the start")
    arm_gap: Spread = Field(Spread(low=0.02, high=0.1), description="m, distance of disk and link 2 at the start")
    disk_gap: Spread = Field(Spread(low=0.02, high=0.1), description="m, disk above the ground at the start")
    disk_spin: Spread = Field(
        Spread(low=-10.0, high=-5.0),
        description="rad/s at the start; own choice: a landing with slip, without which mass and inertia of "
        "a rolling disk cannot be distinguished",
    )
    support: Spread = Field(Spread(low=0.8, high=1.0), description="share s of the arm's weight that is carried")
    push: tuple[float, float] = Field((-4.0, -2.0), description="N m, τ_0; presses link 2 onto the disk")
    amplitude: tuple[float, float] = Field((2.0, 1.0), description="N m, A of each joint")
    frequency: Spread = Field(Spread(low=0.5, high=3.0), description="Hz; the time scale of the motion")
    min_contact: int = Field(50, ge=0, description="required number of steps with both pairs in contact")
    max_speed: float = Field(25.0, gt=0, description="m/s or rad/s; faster motions have flown off")


class Chapter2Bodies(Section):
    """Chapter 2's simulated mechanisms."""

    h: float = Field(5e-3, gt=0, description="s, time step; own choice")
    steps: int = Field(300, ge=1, description="steps of a drop, 1.5 s; own choice: two impacts or more in most drops")
    mass: float = Field(1.0, gt=0, description="kg, thesis")
    epsilon: float = Field(0.6, ge=0, le=1, description="thesis")
    mu: float = Field(0.7, ge=0, description="thesis")
    gravity: float = Field(9.81, gt=0, description="m/s²")
    side: float = Field(1.0, gt=0, description="m, of the block; from m/I = 6 of the thesis, uniform")
    semi_axes: tuple[float, float] = Field((2.0, 1.0), description="m; from m/I = 0.8 of the thesis, uniform")
    radius: float = Field(0.5, gt=0, description="m, of the disk of figure 2-4; own choice: like the block")
    rod_length: float = Field(1.0, gt=0, description="m, of the rod of figure 2-2; own choice")
    block_release: Releases = Releases(height=Spread(low=1.2, high=2.0))
    ellipse_release: Releases = Releases(height=Spread(low=2.5, high=3.5))
    disk_release: Releases = Releases(height=Spread(low=0.8, high=1.6))
    rod_release: Releases = Releases(height=Spread(low=1.0, high=1.8))
    wheel: WheelSettings = WheelSettings()
    arm: ArmSettings = ArmSettings()

    @cached_property
    def ratios(self) -> dict[str, float]:
        """True m/I in 1/m² of the free bodies."""
        bodies = {name: make(self) for name, make in BODIES.items()}
        return {name: body.mass / body.inertia for name, body in bodies.items()}


DEFAULT = Chapter2Bodies()


def block(settings: Chapter2Bodies = DEFAULT) -> PlanarFreeBody:
    """Uniform square, four contact pairs (thesis figure 2-6)."""
    s = 0.5 * settings.side
    corners = Polygon(vertices=((s, s), (-s, s), (-s, -s), (s, -s)))
    return PlanarFreeBody(corners, settings.mass, settings.mass * settings.side**2 / 6.0, settings.gravity)


def ellipse(settings: Chapter2Bodies = DEFAULT) -> PlanarFreeBody:
    """Uniform ellipse, one contact pair (thesis figure 2-7)."""
    a, b = settings.semi_axes
    inertia = settings.mass * (a * a + b * b) / 4.0
    return PlanarFreeBody(Ellipse(semi_axes=(a, b)), settings.mass, inertia, settings.gravity)


def disk(settings: Chapter2Bodies = DEFAULT) -> PlanarFreeBody:
    """Uniform disk, one contact pair (thesis figure 2-4)."""
    inertia = 0.5 * settings.mass * settings.radius**2
    return PlanarFreeBody(Disk(radius=settings.radius), settings.mass, inertia, settings.gravity)


def rod(settings: Chapter2Bodies = DEFAULT) -> PlanarFreeBody:
    """Thin uniform rod, a contact pair at each end (thesis figure 2-2)."""
    inertia = settings.mass * settings.rod_length**2 / 12.0
    return PlanarFreeBody(Rod(settings.rod_length), settings.mass, inertia, settings.gravity)


def wheel(settings: Chapter2Bodies = DEFAULT) -> RimlessWheel:
    """Rimless wheel on its slope, a contact pair per spoke (thesis figure 2-8)."""
    w = settings.wheel
    return RimlessWheel(w.spokes, w.length, w.mass, w.inertia, w.slope, settings.gravity)


BODIES: dict[str, Callable[[Chapter2Bodies], PlanarFreeBody]] = {
    make.__name__: make for make in (block, ellipse, disk, rod, wheel)
}


def arm_disk(settings: Chapter2Bodies = DEFAULT) -> ArmDisk:
    """Two-link arm, disk and ground (thesis figure 2-1)."""
    a = settings.arm
    links, disk = (a.link_lengths, a.link_masses, a.link_coms, a.link_inertias), (a.disk_radius, a.disk_mass)
    return ArmDisk(*links, *disk, a.disk_inertia, settings.gravity, a.base)


def releases(
    kind: Kind, n: int, rng: np.random.Generator, settings: Chapter2Bodies = DEFAULT
) -> tuple[np.ndarray, np.ndarray]:
    """Draw initial states q and v, (n, 3) each, for n drops of a body or starts of the wheel on one spoke.

    Raises:
        UserError: the kind is unknown, or a release penetrates the surface.
    """
    if kind == "wheel":
        made = wheel(settings)
        starts = [made.standing(0.0, omega) for omega in settings.wheel.omega.quantile(rng.random(n))]
        return np.array([q for q, _ in starts]).reshape(n, 3), np.array([v for _, v in starts]).reshape(n, 3)
    spreads = {name: getattr(settings, f"{name}_release") for name in BODIES if name != "wheel"}
    if kind not in spreads:
        raise UserError(f"There are releases for {', '.join(spreads)} and wheel; got {kind!r}.")
    q, v = spreads[kind].draw(n, rng)
    if n and BODIES[kind](settings).contacts_of(q).phi.min() < 0.0:
        raise UserError(
            f"A release of the {kind} from {spreads[kind].height.low} m can penetrate the surface; raise the lower "
            f"end of {kind}_release.height."
        )
    return q, v


@dataclass(frozen=True)
class ArmTrajectories:
    """Trajectories of arm and disk with enough contact."""

    records: tuple[SimulatedMotion, ...]
    tried: int  # number of trajectories drawn
    left_out: dict[str, int]  # number of trajectories left out, by reason (`FILTERS`)


def arm_trajectories(n: int, rng: np.random.Generator, settings: Chapter2Bodies = DEFAULT) -> ArmTrajectories:
    """Draw starts and torques until n trajectories have enough simultaneous contact with arm and ground.

    Raises:
        UserError: fewer than one in `MAX_TRIES` draws is accepted.
    """
    arm, a = arm_disk(settings), settings.arm
    kept: list[SimulatedMotion] = []
    reasons: dict[str, int] = dict.fromkeys(FILTERS, 0)
    tried = 0
    while len(kept) < n:
        if tried >= MAX_TRIES * (len(kept) + 1):
            raise UserError(
                f"Only {len(kept)} of {tried} trajectories of the arm had {a.min_contact} steps with both contacts; "
                "adjust the start, the torques or min_contact in the settings of the arm."
            )
        q, v, torque = _start(arm, a, settings.h, rng)
        tried += 1
        record = simulate(arm, q, v, torque, settings.h, a.steps, a.mu, a.epsilon)
        reason = _left_out(arm, record, a)
        if reason:
            reasons[reason] += 1
        else:
            kept.append(record)
    return ArmTrajectories(tuple(kept), tried, reasons)


def _start(
    arm: ArmDisk, a: ArmSettings, h: float, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Draw initial q and v (5,) and torques (steps, 5): the disk is under link 2, and only the disk's spin is not 0."""
    u = rng.random(6)
    first, incline = a.link_1.quantile(u[0]), a.incline.quantile(u[1])
    height = a.disk_radius + a.disk_gap.quantile(u[2])
    q = np.array([first, incline - first, 0.0, height, 0.0])
    elbow = arm.joints(q[None])[0][0]
    # below link 2 at the given distance: (P - elbow)' (sin β, -cos β) = R + gap
    distance = a.disk_radius + a.arm_gap.quantile(u[3])
    q[2] = elbow[0] + (distance + (height - elbow[1]) * np.cos(incline)) / np.sin(incline)
    t = h * np.arange(a.steps)
    torque = np.zeros((a.steps, 5))
    for i in range(2):
        torque[:, i] = a.push[i] - a.support.quantile(u[4]) * arm.gravity(q)[i]
        for f, phase in zip(a.frequency.quantile(rng.random(2)), rng.uniform(0.0, 2.0 * np.pi, 2)):
            torque[:, i] += a.amplitude[i] * np.sin(2.0 * np.pi * f * t + phase)
    return q, np.array([0.0, 0.0, 0.0, 0.0, a.disk_spin.quantile(u[5])]), torque


def _left_out(arm: ArmDisk, record: SimulatedMotion, a: ArmSettings) -> str:
    if not record.solved:
        return "not solved"
    if np.abs(record.v).max() > a.max_speed:
        return "too fast"
    if min(points[:, 1].min() for points in arm.joints(record.q)) < 0.0:
        return "arm below the ground"  # the model has no contact between arm and ground
    return "" if (record.c_n > 0).all(axis=1).sum() >= a.min_contact else "too little contact"
