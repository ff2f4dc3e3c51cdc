"""recording.yaml as typed, checked data (recording format, schema 1).

A recording is a folder with recording.yaml, which describes the assumed mechanism, and states.csv, a row per sample:

    arm     trial,t,q_1,q_2,x,y,theta,dq_1,dq_2,vx,vy,omega,u_1,u_2        u only if the arm is driven
    wheel   trial,t,x,y,theta,vx,vy,omega

q_1 is the angle of link 1 against the horizontal, q_2 of link 2 against link 1; x, y, theta are the pose of the disk or
of the wheel's hub.  The wheel's x points down its slope and y away from it.  The torques u act from the time of their
row until the next row; the torques in the last row of a trial are not used.

`sampling` states how the numbers were obtained.  Encoders give positions only; velocities computed from these contain
no further information.  Each device has its own clock, and the values that it writes are a few milliseconds old.
"""

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from thesis_lib.bodies.body import Positive
from thesis_lib.foundation.settings import Section

Finite = Annotated[float, Field(allow_inf_nan=False)]
Pair = tuple[Positive, Positive]


class Arm(Section):
    """A two-link arm that pushes a disk over the ground y = 0."""

    coordinates: ClassVar[tuple[str, ...]] = ("q_1", "q_2", "x", "y", "theta")  # columns of q in rad and m
    velocities: ClassVar[tuple[str, ...]] = ("dq_1", "dq_2", "vx", "vy", "omega")  # columns of v in rad/s and m/s

    kind: Literal["arm"]
    link_lengths: Pair = Field(description="m, joint to joint and joint to tip")
    link_masses: Pair = Field(description="kg")
    link_coms: tuple[Finite, Finite] = Field(description="m, centre of mass of each link along it, from its joint")
    link_inertias: Pair = Field(description="kg m², about the centre of mass")
    base: tuple[Finite, Finite] = Field((0.0, 0.0), description="m, x and y of the first joint")
    disk_radius: Positive = Field(description="m")
    disk_mass: Positive = Field(description="kg")
    disk_inertia: Positive = Field(description="kg m², about the centre, which is the centre of mass")
    driven: bool = Field(True, description="whether states.csv contains the torques u_1 and u_2 in N m")

    @property
    def torques(self) -> tuple[str, ...]:
        """Columns of u in N m, on the first coordinates."""
        return ("u_1", "u_2") if self.driven else ()


class Wheel(Section):
    """A rimless wheel on a slope; its centre of mass is assumed to be the hub."""

    coordinates: ClassVar[tuple[str, ...]] = ("x", "y", "theta")  # columns of q in m and rad
    velocities: ClassVar[tuple[str, ...]] = ("vx", "vy", "omega")  # columns of v in m/s and rad/s
    torques: ClassVar[tuple[str, ...]] = ()  # a wheel rolls freely

    kind: Literal["wheel"]
    spokes: int = Field(ge=3, le=100, description="their number; spoke 0 points along theta")
    length: Positive = Field(description="m, hub to tip")
    mass: Positive = Field(description="kg")
    inertia: Positive = Field(description="kg m², about the hub")
    slope: float = Field(ge=0, lt=1.5, description="rad, of the ground, downhill along +x")
    payload_radius: Finite = Field(0.0, ge=0, description="m along spoke 0, position of a possible payload")


class StateNoise(Section):
    """One-sigma noise of the samples, independent for each column."""

    position: Positive = Field(description="m, each x and y")
    angle: Positive = Field(description="rad, each theta, q_1 and q_2")
    velocity: Positive = Field(description="m/s, each vx and vy")
    angular_velocity: Positive = Field(description="rad/s, each omega, dq_1 and dq_2")
    joint_angle: Positive | None = Field(
        None, description="rad, q_1 and q_2; default: angle; for an encoder, one count over √12"
    )


class Sampling(Section):
    """How samples and torques were obtained."""

    velocities: Literal["measured", "derived", "time_stepping"] = Field(
        "measured",
        description="measured: by sensors of their own, with the noise stated; derived: computed from the positions, "
        "filtered or not, and not used; time_stepping: a simulation with v_{k+1} = v_k + h v̇(q_k, v_k)",
    )
    jitter: float = Field(0.0, ge=0, description="s, one sigma of the time of a sample")
    delay: float = Field(0.0, ge=0, description="s, largest offset between the clocks of torques, joints and disk")
    torque_ripple: float = Field(
        0.0, ge=0, lt=1, description="share of a torque, one sigma of its error that depends on the angle of its joint"
    )
    torque_offset: float = Field(0.0, ge=0, description="N m, one sigma of a torque's constant error")


class RecordingHeader(Section):
    """The content of recording.yaml."""

    schema_: Literal[1] = Field(alias="schema", description="version of this format")
    description: str = ""
    mechanism: Annotated[Arm | Wheel, Field(discriminator="kind")] = Field(
        description="its assumed geometry, masses and inertias"
    )
    gravity: Positive = Field(9.81, description="m/s²")
    rate: Positive = Field(description="Hz, of the samples; the same throughout")
    noise: StateNoise
    sampling: Sampling = Sampling()

    @property
    def columns(self) -> tuple[str, ...]:
        """Columns of states.csv."""
        m = self.mechanism
        return ("trial", "t", *m.coordinates, *m.velocities, *m.torques)

    @property
    def sigmas(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Noise of each coordinate and of each velocity, in the order of the columns and in their units."""
        n, names = self.noise, self.mechanism.coordinates
        straight = [name in ("x", "y") for name in names]
        joint = n.joint_angle or n.angle
        angles = [joint if name in ("q_1", "q_2") else n.angle for name in names]
        return (
            tuple(n.position if s else angle for s, angle in zip(straight, angles)),
            tuple(n.velocity if s else n.angular_velocity for s in straight),
        )
