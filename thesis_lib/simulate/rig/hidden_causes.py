"""Hidden causes of simulated drops, the contact on which they act, and the releases of the proof.

A hidden cause is a property of the rig or the body: a round corner, a moving plate, a lagging camera channel.  It does
not change an impact law; its effect on the impulse follows from integrating the motion (`compliant`).  Each cause of
`HiddenCauses` is absent at its default, and all can be combined.  `CAUSES` gives the effects that describe each cause
(none if it is outside the library) and a relevant size.

I_n = ∫₀¹ ds / √(1 − s^(n+1)) = √π Γ(1 + 1/(n+1)) / Γ(1/2 + 1/(n+1)) is the time from touch to deepest penetration, in
units of that depth over the speed.  The angle β of a place on the body is the direction to the contact point in the
body frame; x is the place of the contact point on the surface.

Sources: Walton and Braun 1986, doi 10.1122/1.549893 (hysteretic normal force); Hunt and Crossley 1975,
doi 10.1115/1.3423596; Maw, Barber and Fawcett 1976 (tangential compliance).
"""

import math
from dataclasses import dataclass
from typing import Any, TypeVar

from pydantic import Field, ValidationError

from thesis_lib.bodies.body import Body, Noise
from thesis_lib.bodies.shapes import Ellipse, Polygon
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.settings import Section
from thesis_lib.simulate.rig.release import Release, Spread

Sizes = TypeVar("Sizes", bound=Section)
REFERENCE_SPEED = 2.5  # m/s; speed of the published impacts


class CompliantContact(Section):
    """The contact without hidden causes: hysteretic normal force, Coulomb friction.

    By default it lasts as long as a real contact of metal or hard plastic.  A body at 2.5 m/s then penetrates by more
    than the noise of the rig.  In contacts of 20 µs it moves far less, and a rigid impact is the right model.
    """

    mu: float = Field(0.15, ge=0, le=2, description="Coulomb friction, 1")
    epsilon: float = Field(0.55, ge=0.05, le=1, description="restitution, energetic (Stronge), 1")
    contact_time: float = Field(1e-3, gt=0, le=5e-3, description="s, central impact at 2.5 m/s")
    exponent: float = Field(1.0, ge=1, le=2, description="1: linear; 1.5: Hertz")
    steps: int = Field(200, ge=10, description="time steps in one contact time")

    @property
    def dt(self) -> float:
        """Time step during contact, s."""
        return self.contact_time / self.steps

    def stiffness(self, mass: float) -> float:
        """k of the force k δⁿ in N/mⁿ for a body of `mass` kg: (n+1) m v² / (2 δ^(n+1)), δ = T v / ((1+ε) I_n)."""
        n = self.exponent
        shape = math.sqrt(math.pi) * math.gamma(1 + 1 / (n + 1)) / math.gamma(0.5 + 1 / (n + 1))
        depth = self.contact_time * REFERENCE_SPEED / ((1 + self.epsilon) * shape)
        return (n + 1) * mass * REFERENCE_SPEED**2 / (2 * depth ** (n + 1))


def _off(description: str, **limits: Any) -> Any:
    return Field(0.0, description=description, allow_inf_nan=False, **limits)


class HiddenCauses(Section):
    """Hidden causes; at its default, a cause is absent."""

    # contact
    tangential_compliance: float = _off("stiffness of contact, normal over tangential, 1; 0: rigid", ge=0, le=20)
    tangential_damping: float = Field(0.15, ge=0, le=1, description="damping ratio of the tangential spring, 1")
    hunt_crossley: float = _off("d of the factor (1 + d δ̇)₊ on the normal force, s/m", ge=0)
    stribeck: float = _off("s of μ (1 + s exp(−(v_t/v_s)²)), 1; negative: friction rises with speed", ge=-1)
    stribeck_speed: float = Field(0.5, gt=0, description="v_s of stribeck, m/s")
    friction_anisotropy: float = _off("a of μ (1 + a sign v_t), 1", ge=-1, le=1)
    rolling_lever: float = _off("half-width of the contact patch: couple against ω, over the normal force, m", ge=0)
    adhesion_energy: float = _off("work to pull one contact point off, J", ge=0)
    adhesion_range: float = Field(1e-5, gt=0, description="distance over which adhesion acts, m")
    orientation_restitution: float = _off("a of ε (1 + a cos 2(β − axis)), 1", ge=-1, le=1)
    orientation_axis: float = Field(0.4, description="axis of the causes that depend on β, rad")
    soft_spot: float = _off("a of k (1 − a exp(−(1 − cos(β − axis)) / 0.3)), 1", ge=0, lt=1)
    wear: float = _off("w of ε (1 + w s), s from −1/2 at the first trial to 1/2 at the last, 1", ge=-2, le=2)
    # body
    corner_radius: float = _off("radius of the corners of a polygon that is believed sharp, m", ge=0)
    com_offset_x: float = _off("true minus believed centre of mass, body frame, m")
    com_offset_y: float = _off("true minus believed centre of mass, body frame, m")
    size_error: float = _off("true size = (1 + s) believed size, 1", gt=-1)
    inertia_error: float = _off("true k² = (1 + d) believed k², 1", gt=-1)
    # surface
    tilt: float = _off("φ of gravity g (sin φ, −cos φ) in the axes of the surface, rad")
    surface_height: float = _off("true minus believed height of the surface, m")
    plate_curvature: float = _off("κ of a plate of height κ x²/2, 1/m")
    plate_velocity: float = _off("velocity of the plate along x, m/s")
    friction_slope: float = _off("b of μ (1 + b x), 1/m")
    restitution_slope: float = _off("b of ε (1 + b x), 1/m")
    restitution_patch: float = _off("a of ε (1 + a) on a patch, 1", ge=-1)
    restitution_bump: float = _off("a of ε (1 + a exp(−((x − centre) / (width/2))²)), 1", ge=-1)
    restitution_step: float = _off("a of ε (1 + a tanh((x − centre) / (width/2))), 1", ge=-1, le=1)
    friction_patch: float = _off("a of μ (1 + a) on a patch, 1", ge=-1)
    friction_bump: float = _off("a of μ (1 + a exp(−((x − centre) / (width/2))²)), 1", ge=-1)
    friction_step: float = _off("a of μ (1 + a tanh((x − centre) / (width/2))), 1", ge=-1, le=1)
    stiffness_patch: float = _off("a of k (1 + a) on a patch, 1", gt=-1)
    stiffness_slope: float = _off("b of k (1 + b x), at least k/10, 1/m")
    patch_centre: float = Field(0.1, description="centre of patch, bump and step, m", allow_inf_nan=False)
    patch_width: float = Field(0.1, gt=0, description="width of patch, bump and step, m; a patch has sharp edges")
    # flight
    linear_drag: float = _off("c of a = −c v, 1/s", ge=0)
    spin_damping: float = _off("c of α = −c ω, 1/s", ge=0)
    quadratic_drag: float = _off("c of a = −c |v| v, 1/m", ge=0)
    magnus: float = _off("s of a = s ω (−v_y, v_x), 1")
    gravity_error: float = _off("true minus believed gravity, m/s²")
    # camera
    mirrored: bool = Field(False, description="the camera reports θ with the wrong sign")
    length_scale: float = _off("measured lengths = (1 + s) true, 1", gt=-1)
    angle_offset: float = _off("measured minus true θ, rad")
    time_lag: float = _off("measured θ(t) = true θ(t − lag), s")
    drift: float = _off("rate at which measured x drifts, m/s")
    marker_offset_x: float = _off("tracked point minus the body's origin, body frame, m")
    marker_offset_y: float = _off("tracked point minus the body's origin, body frame, m")
    camera_roll: float = _off("angle by which the camera rotates the picture, rad", ge=-1, le=1)
    camera_slope: float = _off("angle of the surface to the horizontal, seen by a level camera, rad", ge=-1, le=1)
    camera_skew: float = _off("change of measured x per height y, 1")
    lens: float = _off("k of radial distortion x + k |x|² x about the middle of the picture, 1/m²")
    # outside the library of effects
    camera_pitch: float = _off("p of a camera that looks up or down: x and y in the picture over 1 + p y, 1/m")
    lens_height: float = Field(0.25, description="height of the middle of the picture, m", allow_inf_nan=False)
    plate_amplitude: float = _off("amplitude of a plate that vibrates in y, with a random phase per trial, m", ge=0)
    plate_frequency: float = Field(30.0, gt=0, description="frequency of the vibrating plate, Hz")
    loose_mass: float = _off("share of the mass that hangs inside on a spring and a damper, 1", ge=0, le=0.9)
    loose_frequency: float = Field(60.0, gt=0, description="natural frequency of the loose mass in a fixed body, Hz")
    loose_damping: float = Field(0.1, ge=0, description="damping ratio of the loose mass, 1")
    wobble: float = _off("amplitude of an out-of-plane wobble over Δv_n of its impact, m per m/s", ge=0)
    wobble_frequency: float = Field(12.0, gt=0, description="frequency of the wobble, Hz")
    wobble_decay: float = Field(0.15, gt=0, description="time constant of the wobble, s")

    @property
    def gravity_angle(self) -> float:
        """Angle φ in rad of gravity g (sin φ, −cos φ) in the axes of the surface."""
        return self.tilt - self.camera_slope


@dataclass(frozen=True)
class Cause:
    """A hidden cause.

    Its size raises the error of the base law, with μ and ε refitted, to about 3 times the noise floor (flight and
    scale: the misfit of whole arcs; height: the gap at impact), with noise of 0.3 mm and 3 mrad, for 150 throws of the
    chapter's ellipse (corners: of a 70 mm square).  Patch, bump, step and stiffness: with contacts of 1 ms.  A soft
    patch or spot affects few impacts and never reaches 3 times; these sizes correspond to rubber on metal.  A slope of
    the stiffness that reaches 3 times would be so steep that the stiffness vanishes within the plate.
    """

    effects: tuple[str, ...]  # effects that describe the cause, the best first; () if it is outside the library
    size: float
    parameter: str = ""  # parameter of the best effect that equals the size; "" if there is none
    polygon_only: bool = False  # whether smooth bodies are unaffected


CAUSES: dict[str, Cause] = {
    "tangential_compliance": Cause(("tangential_compliance", "tangential_restitution"), 0.042),
    "hunt_crossley": Cause(("velocity_dependent_restitution",), 0.07),
    "stribeck": Cause(("velocity_dependent_friction",), 0.14),
    "friction_anisotropy": Cause(("anisotropic_friction",), 0.04, "a_t"),
    "rolling_lever": Cause(("contact_torque",), 0.00027),
    "adhesion_energy": Cause(("adhesion",), 0.00035),
    "orientation_restitution": Cause(("orientation_dependent_restitution",), 0.038),
    "soft_spot": Cause(("orientation_dependent_contact_time",), 0.8),
    "wear": Cause(("wear",), 0.08),
    "corner_radius": Cause(("rounded_corners",), 0.002, "rho", polygon_only=True),
    "com_offset_x": Cause(("com_offset",), 0.0005, "c_x"),
    "com_offset_y": Cause(("com_offset",), 0.00045, "c_y"),
    "size_error": Cause(("wrong_size",), 0.04, "s"),
    "inertia_error": Cause(("wrong_inertia",), 0.07, "d_I"),
    "tilt": Cause(("surface_tilt",), 0.065, "phi"),
    "surface_height": Cause(("surface_height",), 0.00028, "h"),
    "plate_velocity": Cause(("moving_surface",), 0.056, "V"),
    "plate_curvature": Cause(("curved_surface",), 0.026, "kappa"),
    "friction_slope": Cause(("position_dependent_friction",), 0.26, "g_mu"),
    "restitution_slope": Cause(("position_dependent_restitution",), 0.13, "g_eps"),
    "restitution_patch": Cause(("surface_patch",), 0.1),
    "restitution_bump": Cause(("surface_patch",), 0.12),
    "restitution_step": Cause(("surface_patch",), 0.034),
    "friction_patch": Cause(("surface_patch",), 0.3),
    "friction_bump": Cause(("surface_patch",), 0.35),
    "friction_step": Cause(("surface_patch",), 0.08),
    "stiffness_patch": Cause(("surface_patch",), -0.8),
    "stiffness_slope": Cause(("position_dependent_contact_time",), 1.5),
    "linear_drag": Cause(("linear_drag",), 0.42, "c_v"),
    "spin_damping": Cause(("linear_drag",), 0.47, "c_w"),
    "quadratic_drag": Cause(("quadratic_drag",), 0.23, "c_q"),
    "magnus": Cause(("magnus",), 0.039, "k_m"),
    "gravity_error": Cause(("wrong_gravity",), 0.65, "dg"),
    "mirrored": Cause(("mirrored_rotation",), 1.0),
    "length_scale": Cause(("length_scale",), 0.065, "s_L"),
    "angle_offset": Cause(("angle_offset",), 0.0126, "d_theta"),
    "time_lag": Cause(("time_lag",), 0.002, "lag"),
    "drift": Cause(("sensor_drift",), 0.049, "d_x"),
    "marker_offset_x": Cause(("marker_offset",), 0.0008, "d_x"),
    "marker_offset_y": Cause(("marker_offset",), 0.0008, "d_y"),
    "camera_roll": Cause(("camera_pose",), 0.0055, "roll"),
    "camera_slope": Cause(("camera_pose",), 0.0054, "slope"),
    "camera_skew": Cause(("camera_skew",), 0.016, "s"),
    "lens": Cause(("lens",), 0.17, "k_1"),
    "camera_pitch": Cause((), 0.089),
    "plate_amplitude": Cause((), 0.00011),
    "loose_mass": Cause((), 0.17),
    "wobble": Cause((), 0.00076),
}

NO_SIZE = "--size has no meaning with --hidden nothing; omit it."


def of_size(sizes: type[Sizes], key: str, size: float, cause: str = "", both: bool = False) -> Sizes:
    """A section in which `key` has a size, for `both` joints if requested; UserError if the size is not possible.

    `cause` is the name of the cause in the message; by default the key.
    """
    try:
        return sizes.model_validate({key: (size, size) if both else size})
    except ValidationError as error:
        meaning = f"{cause or key} ({sizes.model_fields[key].description})"
        raise UserError(f"A size of {size:g} is not possible for {meaning}: {error.errors()[0]['msg']}.") from error


# both directions, and a factor above 3 in |v_n|: a body of 0.03 m released at 0.06 to 0.6 m lands at 0.8 to 3.3 m/s
PROOF_RELEASE = Release(
    height=Spread(low=0.06, high=0.6),
    theta=Spread(low=-math.pi, high=math.pi),
    vx=Spread(low=-1.2, high=1.2),
    omega=Spread(low=-15.0, high=15.0),
)
RIG_NOISE = Noise(position=3e-4, angle=3e-3)  # m, rad: a good motion capture system at 250 Hz
# ellipse of chapter 3; inertia as in the authors' code, m (a² + b²) / 5, which is not that of a uniform plate
ELLIPSE_BODY = Body(shape=Ellipse(semi_axes=(0.035, 0.025)), mass=0.0364, radius_of_gyration=math.sqrt(3.7e-4))
# body for causes that need corners; elsewhere the chapter's ellipse is used
SQUARE = Body(
    shape=Polygon(vertices=((0.03, 0.03), (-0.03, 0.03), (-0.03, -0.03), (0.03, -0.03))),
    mass=0.05,
    radius_of_gyration=0.06 / math.sqrt(6.0),
)
