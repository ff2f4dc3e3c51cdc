"""The plane in which a body moves: given, or found from its flights; its motion in it, and the energy out of it.

    E       = |v|² + k² |ω|²                        twice the kinetic energy over the mass
    E_out   = (v·n)² + k² (|ω|² − (ω·n)²)           share out of the plane: E_out / E
    n       = argmin Σ E_out                        smallest eigenvector of Σ (v vᵀ − k² ω ωᵀ) over the flights

n is the unit normal of the plane, k the radius of gyration about it, which stands for those about all axes.  In the
plane y is up, x = y × n, and θ counts from x counter-clockwise, seen against n.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from thesis_lib.datasets.space.motion import Motion
from thesis_lib.foundation.errors import UserError

UNDECIDED = 0.05  # m/s: a plane is found if motion in it is by so much faster (rms) than in the next best
STEEPEST = np.radians(30.0)  # between a plane that is found and the vertical; a flatter one has to be given
ALONG = 0.7  # share of a body axis that must lie in the plane to give the angle


@dataclass(frozen=True, eq=False)
class Plane:
    """Axes of a plane in those of the recording, unit vectors (3,); `tilt` in rad is its angle to the vertical."""

    x: np.ndarray
    y: np.ndarray
    normal: np.ndarray
    tilt: float

    @classmethod
    def of(cls, normal: np.ndarray, up: np.ndarray) -> "Plane":
        """The plane with this normal; UserError if it is level, so that no direction in it is up."""
        normal = normal / np.linalg.norm(normal)
        y = up - (up @ normal) * normal
        if np.linalg.norm(y) < np.sin(np.radians(1.0)):
            raise UserError(
                "--plane: the plane is level, so that nothing in it falls; give its normal, not an axis in it."
            )
        y = y / np.linalg.norm(y)
        return cls(np.cross(y, normal), y, normal, float(np.arcsin(np.clip(up @ normal, -1.0, 1.0))))


def find_plane(v: np.ndarray, omega: np.ndarray, k_g: float, up: np.ndarray) -> Plane:
    """The plane of the least energy out of it, from velocities v, ω (n, 3) in flight.

    UserError if no plane is better than others, or if it is far from vertical.
    """
    values, vectors = np.linalg.eigh(v.T @ v - k_g**2 * omega.T @ omega)
    if values[1] - values[0] < len(v) * UNDECIDED**2:
        raise UserError(
            "The plane of the motion cannot be found: the body hardly moves sideways or turns. Give it with "
            "--plane, the axis of the recording that is normal to it (such as --plane x)."
        )
    plane = Plane.of(signed(vectors[:, 0], up), up)
    if abs(plane.tilt) > STEEPEST:
        raise UserError(
            f"The plane of the motion is {np.degrees(abs(plane.tilt)):.0f}° off the vertical. If the body slides on an "
            "inclined plane, give its normal with --plane X,Y,Z; else check which axis is up (--up)."
        )
    return plane


def signed(normal: np.ndarray, up: np.ndarray) -> np.ndarray:
    """The one of ± normal (3,) along which the largest component of up × normal is positive: angles in a plane that
    was found have a sign, and all who find one must mean the same.
    """
    side = np.cross(up, normal)
    return normal if side[np.argmax(np.abs(side))] > 0.0 else -normal


def share_out(v: np.ndarray, omega: np.ndarray, plane: Plane, k_g: float) -> tuple[np.ndarray, np.ndarray]:
    """E_out and E (n,) in m²/s² of velocities v, ω (n, 3)."""
    spin, along = np.sum(omega**2, axis=1), omega @ plane.normal
    total = np.sum(v**2, axis=1) + k_g**2 * spin
    return (v @ plane.normal) ** 2 + k_g**2 * (spin - along**2), total


def in_plane(motion: Motion, plane: Plane) -> tuple[np.ndarray, str]:
    """Poses x, y, θ (n, 3) in m, m, rad in the plane, and the body's axis whose angle θ is.

    y counts from the level plane through the recording's origin, where that cuts the plane of the motion.
    """
    depth = float(np.median(motion.position @ plane.normal))
    y = motion.position @ plane.y + depth * np.tan(plane.tilt)
    axes = Rotation.from_quat(motion.quaternion).as_matrix()  # columns: the body's axes
    flat = np.stack([np.einsum("i,nij->nj", plane.x, axes), np.einsum("i,nij->nj", plane.y, axes)])
    lies = np.median(np.hypot(*flat), axis=0)
    chosen = int(np.argmax(lies > ALONG))  # of three orthogonal axes two lie along the plane that much
    theta = np.arctan2(flat[1, :, chosen], flat[0, :, chosen])
    return np.stack([motion.position @ plane.x, y, theta], axis=1), "xyz"[chosen]
