"""The believed model of a mechanism: inverse dynamics of many time steps at once, and contacts.

    M(q) v̇ + C(q, v) v − g(q) = Y(q, v, v̇; g) π,        π = (m, m c_x, m c_y, I) of each body

The columns of Y for a body are the regressor of a free body at the pose of its frame, projected on the coordinates that
move it, Y_b = J_b' Y_free(pose, velocity, acceleration; g).  In the two-link arm with the disk, J_1 = ẑ in q_1, and the
frame of link 2 is at its joint, l_1 (cos q_1, sin q_1) from the base.

Source: W. Khalil, E. Dombre, Modeling, Identification and Control of Robots, 2002,
doi 10.1016/B978-1-903996-66-9.X5000-3.
"""

from abc import ABC, abstractmethod

import numpy as np

from thesis_lib.simulate.mechanisms.regressor import FREE_BODY_PARAMETERS, free_body_regressor, parameter_names
from thesis_lib.simulate.stepping.arm_disk import LINKS, ArmDisk
from thesis_lib.simulate.stepping.multibody import Mechanism
from thesis_lib.simulate.stepping.rimless_wheel import RimlessWheel


class BelievedModel(ABC):
    """A mechanism as believed.

    Attributes:
        coordinates: (nv,) names of q.
        names, parameters: (4 b,) inertial parameters π about the joint, kg, kg m, kg m².
        gravity: (2,) believed acceleration of gravity, m/s².
        identified: inertial parameters that motion and known forces can identify; the others keep believed values.
        roller: radius in m and contact pairs of the body that rolls on the ground; the last coordinate is its angle.
        payload: change of `parameters` by a point mass of 1 kg at the place of the payload.
        joints: number of driven joints, whose coordinates come first.
    """

    name: str
    coordinates: tuple[str, ...]
    names: tuple[str, ...]
    parameters: np.ndarray
    gravity: np.ndarray
    identified: tuple[str, ...]
    roller: tuple[float, tuple[int, ...]]
    payload: np.ndarray
    joints: int
    mechanism: Mechanism

    @abstractmethod
    def regressor(self, q: np.ndarray, v: np.ndarray, a: np.ndarray, gravity: np.ndarray | None = None) -> np.ndarray:
        """Return Y (n, nv, 4 b) at q, v, a (n, nv); `gravity` (2,) in m/s² replaces the believed gravity."""

    def inverse_dynamics(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        """Return Y π (n, nv) in N, N m: the sum of external and contact forces."""
        return self.regressor(q, v, a) @ self.parameters

    def mass_matrix(self, q: np.ndarray) -> np.ndarray:
        """Return M (n, nv, nv) at q (n, nv)."""
        units = (np.broadcast_to(unit, q.shape) for unit in np.eye(q.shape[1]))
        columns = [self.regressor(q, np.zeros_like(q), a, np.zeros(2)) @ self.parameters for a in units]
        return np.stack(columns, axis=2)


class BelievedArm(BelievedModel):
    """The two-link arm that pushes a disk."""

    name = "arm"
    coordinates = ("q_1", "q_2", "x", "y", "theta")
    joints = 2

    def __init__(self, arm: ArmDisk) -> None:
        self.mechanism = arm
        self.names = parameter_names((*LINKS, "disk"))
        links = zip(arm.link_masses, arm.link_coms, arm.link_inertias)
        rows = [[m, m * c[0], m * c[1], inertia + m * c @ c] for m, c, inertia in links]
        self.parameters = np.concatenate([*rows, [arm.disk_mass, 0.0, 0.0, arm.disk_inertia]])
        self.gravity = np.array([0.0, -arm.g])
        # the centre of the disk is known; links are believed to have their centre of mass on their axis
        self.identified = (*(f"{link}.{name}" for link in LINKS for name in ("m", "mc_x", "I")), "disk.m", "disk.I")
        self.roller = (arm.disk_radius, (1,))
        self.first_length, length = arm.link_lengths
        self.payload = np.concatenate([np.zeros(4), [1.0, length, 0.0, length**2], np.zeros(4)])

    def regressor(self, q: np.ndarray, v: np.ndarray, a: np.ndarray, gravity: np.ndarray | None = None) -> np.ndarray:
        g = self.gravity if gravity is None else gravity
        l1, n = self.first_length, len(q)
        cos, sin = np.cos(q[:, 0]), np.sin(q[:, 0])
        turn, spin = v[:, 0], a[:, 0]
        pose, speed, change = (np.column_stack([np.zeros((n, 2)), x[:, 0]]) for x in (q, v, a))
        first = free_body_regressor(pose, speed, change, g)
        # position of the second joint, l_1 (cos q_1, sin q_1), and its derivatives
        second = free_body_regressor(
            np.stack([l1 * cos, l1 * sin, q[:, 0] + q[:, 1]], axis=1),
            np.stack([-l1 * turn * sin, l1 * turn * cos, turn + v[:, 1]], axis=1),
            np.stack([l1 * (-spin * sin - turn**2 * cos), l1 * (spin * cos - turn**2 * sin), spin + a[:, 1]], axis=1),
            g,
        )
        Y = np.zeros((n, 5, 12))
        Y[:, 0, :4] = first[:, 2]
        Y[:, 0, 4:8] = l1 * (cos[:, None] * second[:, 1] - sin[:, None] * second[:, 0]) + second[:, 2]
        Y[:, 1, 4:8] = second[:, 2]
        Y[:, 2:, 8:] = free_body_regressor(q[:, 2:], v[:, 2:], a[:, 2:], g)
        return Y


class BelievedWheel(BelievedModel):
    """The rimless wheel on its slope; a payload would be `payload_radius` m along spoke 0."""

    name = "wheel"
    coordinates = ("x", "y", "theta")
    joints = 0

    def __init__(self, wheel: RimlessWheel, payload_radius: float) -> None:
        self.mechanism = wheel
        self.names = FREE_BODY_PARAMETERS
        self.parameters = np.array([wheel.mass, 0.0, 0.0, wheel.inertia])
        self.gravity = wheel.g * np.array([np.sin(wheel.slope), -np.cos(wheel.slope)])
        # without known external forces, motion does not determine the mass: all other parameters scale with it
        self.identified = ("I",)
        self.roller = (wheel.length, tuple(range(wheel.spokes)))
        self.payload = np.array([1.0, payload_radius, 0.0, payload_radius**2])

    def regressor(self, q: np.ndarray, v: np.ndarray, a: np.ndarray, gravity: np.ndarray | None = None) -> np.ndarray:
        return free_body_regressor(q, v, a, self.gravity if gravity is None else gravity)
