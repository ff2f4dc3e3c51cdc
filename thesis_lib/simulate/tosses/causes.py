"""Causes that the proof hides in tosses in space: range of sizes for each, and definition of causes in the contact.

Causes in body, table, air and camera are in `thesis_lib.simulate.rig.causes_in_space`.  Causes in the contact, where u
is the direction to the surface in axes of the body's shape, v_n the speed of approach and v_t the speed of the slip:

| cause                             | in code         | unit | effect on ε or μ                                        |
|-----------------------------------|-----------------|------|---------------------------------------------------------|
| velocity_dependent_restitution    | c               | s/m  | ε exp(−c v_n), v_n at the touch                         |
| velocity_dependent_friction       | s, v_s          | 1, m/s | μ (1 + s exp(−(v_t / v_s)²))                          |
| position_dependent_...            | g_..._x, _y     | 1/m  | times 1 + g · (t_1, t_2) of the contact point           |
| orientation_dependent_...         | a_x, a_y, a_z   | 1    | times 1 + a · u, u at the touch                         |
| later_restitution, later_friction | d               | 1    | times 1 + d, from `LATER` after the first touch on      |
| sliding_friction                  | d_mu            | 1    | μ + d_mu if there has been no hit for `SUPPORTED`       |
| contact_torque                    | m_r             | m    | a couple against rolling, at most m_r times the force   |
| torsional_friction                | m_t             | m    | a couple about the normal, in one cone with the slip    |
| anisotropic_friction              | a_c, a_s        | 1    | μ (1 + [[a_c, a_s], [a_s, −a_c]]), an ellipse           |
| moving_surface                    | V_x, V_y        | m/s  | slip is measured relative to the moving surface         |
| curved_surface                    | κ, x_0, y_0     | 1/m, m | none: the normal is that at each ball's contact point |
| position_dependent_contact_time   | g_tau_x, _y     | 1/m  | none: stiffness times 1 − 2 g · (t_1, t_2)              |
| orientation_dependent_contact_time | a_x, a_y, a_z  | 1    | none: stiffness times exp(−2 a · u), u at the touch    |
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

LATER = 0.03  # s after the first touch of a toss, after which touches count as later hits
SUPPORTED = 0.015  # s without a hit, after which a touching body counts as supported
HIT = 0.1  # m/s of approach; a slower touch does not count as a hit


@dataclass(frozen=True)
class Range:
    """Range from which the size of a cause is drawn.

    Attributes:
        values: names of the parameters that have the size; several are components of a vector of this length.
        low, high: limits of the size, whose logarithm is drawn uniformly; both signs occur if `signed`.
        fixed: further parameters with fixed values.
        choices: possible values of a discrete cause.
    """

    values: tuple[str, ...]
    low: float = 0.0
    high: float = 0.0
    signed: bool = True
    fixed: Mapping[str, float] | None = None
    choices: tuple[float, ...] = ()

    def drawn(self, rng: np.random.Generator) -> dict[str, float]:
        """Draw parameters: a size from the range, with a random direction or sign."""
        if self.choices:
            return {self.values[0]: float(self.choices[rng.integers(len(self.choices))])}
        size = np.exp(rng.uniform(np.log(self.low), np.log(self.high)))
        along = rng.standard_normal(len(self.values))
        along = size * (along if self.signed else np.abs(along)) / np.linalg.norm(along)
        return {name: float(f"{value:.4g}") for name, value in zip(self.values, along)} | dict(self.fixed or {})


def _vector(stem: str, axes: str = "xyz") -> tuple[str, ...]:
    return tuple(f"{stem}{axis}" for axis in axes)


RANGES: Mapping[str, Range] = {
    "angle_offset": Range(_vector("d_r"), 0.02, 0.06),
    "camera_pose": Range(_vector("b_"), 0.02, 0.06),
    "com_offset": Range(_vector("c_"), 1.5e-3, 4e-3),
    "contact_torque": Range(("m_r",), 1e-3, 3e-3, signed=False),
    "inertia_ratios": Range(("a_y", "a_z"), 0.1, 0.25),
    "length_scale": Range(("s_L",), 0.02, 0.06),
    "linear_drag": Range(("c_v",), 0.1, 0.4, signed=False),
    "quadratic_drag": Range(("c_q",), 0.1, 0.3, signed=False),
    "magnus": Range(("k_m",), 0.02, 0.08),
    "marker_offset": Range(_vector("d_"), 2e-3, 6e-3),
    "mirrored_rotation": Range(("mirrored_axis",), choices=(1.0, 2.0, 3.0)),
    "misread_rotation": Range(("reading",), choices=(1.0, 2.0, 3.0, 4.0, 5.0)),
    "velocity_dependent_restitution": Range(("c",), 0.1, 0.25),
    "position_dependent_restitution": Range(("g_eps_x", "g_eps_y"), 1.5, 4.0),
    "orientation_dependent_restitution": Range(_vector("a_"), 0.2, 0.4),
    "later_restitution": Range(("d",), 0.2, 0.4),
    "velocity_dependent_friction": Range(("s",), 0.5, 1.5, signed=False, fixed={"v_s": 0.5}),
    "position_dependent_friction": Range(("g_mu_x", "g_mu_y"), 2.0, 5.0),
    "orientation_dependent_friction": Range(_vector("a_"), 0.3, 0.6),
    "later_friction": Range(("d",), 0.3, 0.6),
    "rotation_scale": Range(("s_R",), 0.03, 0.1),
    "rounded_corners": Range(("rho",), 2e-3, 6e-3, signed=False),
    "sliding_friction": Range(("d_mu",), 0.08, 0.2),
    "surface_height": Range(("h",), 1e-3, 3e-3),
    "surface_tilt": Range(("phi_x", "phi_y"), 0.02, 0.07),
    "time_lag": Range(("lag",), 4e-3, 12e-3),
    "torsional_friction": Range(("m_t",), 3e-3, 10e-3, signed=False),
    "wrong_gravity": Range(("dg",), 0.15, 0.5),
    "wrong_inertia": Range(("d_I",), 0.1, 0.3),
    "wrong_size": Range(("s",), 0.02, 0.05),
}
RANGES_OF_MORE: Mapping[str, Range] = {  # causes that were added to the library later
    "anisotropic_friction": Range(("a_c", "a_s"), 0.2, 0.4),
    "curved_surface": Range(("kappa",), 0.1, 0.3, fixed={"x_0": 0.0, "y_0": 0.0}),
    "inertia_axes": Range(_vector("b_"), 0.1, 0.3),
    "lens": Range(("k_1",), 0.2, 0.6, fixed={"c_u": 0.0, "c_v": 0.0}),
    "moving_surface": Range(("V_x", "V_y"), 0.1, 0.3),
    "orientation_dependent_contact_time": Range(_vector("a_"), 0.3, 0.7),
    "position_dependent_contact_time": Range(("g_tau_x", "g_tau_y"), 1.0, 2.5),
    "spin_damping": Range(("c_w",), 0.3, 1.0, signed=False),
}
AIR = ("linear_drag", "spin_damping", "quadratic_drag", "magnus")
CORNERED = ("rounded_corners", "angle_offset")  # causes without effect on a sphere
NOT_IN_MUJOCO = (  # causes for which MuJoCo has no element
    *("contact_torque", "velocity_dependent_friction", "anisotropic_friction", "curved_surface", "moving_surface"),
    *("orientation_dependent_contact_time", "position_dependent_contact_time"),
)
NOT_IN_DRAKE = (
    *NOT_IN_MUJOCO,
    *("velocity_dependent_restitution", "position_dependent_restitution", "orientation_dependent_restitution"),
    *("position_dependent_friction", "orientation_dependent_friction", "later_restitution", "later_friction"),
    *("sliding_friction", "torsional_friction"),
)
# causes that no effect of the library describes, and ranges of their parameters (`simulate.mujoco.outside`)
OUTSIDE: Mapping[str, Mapping[str, tuple[float, float]]] = {
    "loose_mass": {"share": (0.15, 0.4), "frequency": (4.0, 15.0), "damping": (0.05, 0.2)},
    "two_materials": {"edge": (-0.03, 0.03), "friction": (1.6, 2.5), "restitution": (0.5, 0.75)},
    "hand": {"push": (5.0, 20.0), "share": (0.3, 0.8)},
    "second_object": {"x": (-0.05, 0.05), "y": (-0.05, 0.05), "radius": (0.02, 0.05)},
    "light_table": {"mass": (1.0, 4.0), "frequency": (15.0, 60.0), "damping": (0.05, 0.3)},
}
