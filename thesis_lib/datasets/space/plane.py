"""The plane in which a body moves, given or found from its flights; the motion in the plane, and energy out of it.

    E       = |v|² + k² |ω|²                        twice the kinetic energy over the mass
    E_out   = (v·n)² + k² (|ω|² − (ω·n)²)           share out of the plane: E_out / E
    n       = argmin Σ E_out                        smallest eigenvector of Σ (v vᵀ − k² ω ωᵀ) over the flights

n is the unit normal of the plane, k the radius of gyration about n, which is used for all axes.  In the plane y is up,
x = y × n, and θ counts from x counter-clockwise, with n pointing to the viewer.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from thesis_lib.datasets.space.motion import Motion
from thesis_lib.foundation.errors import UserError

UNDECIDED = 0.05  # m/s (rms): a plane is accepted if motion out of the next best plane is faster by this
STEEPEST = np.radians(30.0)  # largest angle of a found plane to the vertical; a flatter plane must be given
ALONG = 0.7  # share of a body axis that must lie in the plane to give the angle


@dataclass(frozen=True, eq=False)
class Plane:
    """Axes of a plane, unit vectors (3,) in the axes of the recording; `tilt` in rad is its angle to the vertical."""

    x: np.ndarray
    y: np.ndarray
    normal: np.ndarray
    tilt: float

    @classmethod
    def of(cls, normal: np.ndarray, up: np.ndarray) -> "Plane":
        """The plane with this normal; UserError if the plane is horizontal, so that no direction in it is up."""
        normal = normal / np.linalg.norm(normal)
        y = up - (up @ normal) * normal
        if np.linalg.norm(y) < np.sin(np.radians(1.0)):
            raise UserError(
                "--plane: the plane is level, so that no body falls in it; give its normal, not an axis in it."
            )
        y = y / np.linalg.norm(y)
        return cls(np.cross(y, normal), y, normal, float(np.arcsin(np.clip(up @ normal, -1.0, 1.0))))


def find_plane(v: np.ndarray, omega: np.ndarray, k_g: float, up: np.ndarray) -> Plane:
    """The plane with the least energy out of it, from velocities v, ω (n, 3) in flight.

    UserError if no plane is clearly better than the others, or if the plane is far from vertical.
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
    """The one of ± normal (3,) for which the largest component of up × normal is positive: it defines the sign of
    angles in a plane that was found.
    """
    side = np.cross(up, normal)
    return normal if side[np.argmax(np.abs(side))] > 0.0 else -normal


def share_out(v: np.ndarray, omega: np.ndarray, plane: Plane, k_g: float) -> tuple[np.ndarray, np.ndarray]:
    """E_out and E (n,) in m²/s² of velocities v, ω (n, 3)."""
    spin, along = np.sum(omega**2, axis=1), omega @ plane.normal
    total = np.sum(v**2, axis=1) + k_g**2 * spin
    return (v @ plane.normal) ** 2 + k_g**2 * (spin - along**2), total


def in_plane(motion: Motion, plane: Plane) -> tuple[np.ndarray, str]:
    """Poses x, y, θ (n, 3) in m, m, rad in the plane, and the body axis whose angle is θ.

    y counts from the line in which the level plane through the recording's origin cuts the plane of the motion.
    """
    depth = float(np.median(motion.position @ plane.normal))
    y = motion.position @ plane.y + depth * np.tan(plane.tilt)
    axes = Rotation.from_quat(motion.quaternion).as_matrix()  # columns: the body's axes
    flat = np.stack([np.einsum("i,nij->nj", plane.x, axes), np.einsum("i,nij->nj", plane.y, axes)])
    lies = np.median(np.hypot(*flat), axis=0)
    chosen = int(np.argmax(lies > ALONG))  # of three orthogonal axes two lie along the plane that much
    theta = np.arctan2(flat[1, :, chosen], flat[0, :, chosen])
    return np.stack([motion.position @ plane.x, y, theta], axis=1), "xyz"[chosen]
