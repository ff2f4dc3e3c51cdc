"""What is known of the body while units and signs are judged; limits and remedies that these checks share.

| on paper | in code  | unit  |                                                     |
|----------|----------|-------|-----------------------------------------------------|
| e        | `extent` | m     | largest distance of the outline from the origin     |
| k        | `k_g`    | m     | radius of gyration                                  |
"""

from dataclasses import dataclass

import numpy as np

from thesis_lib.bodies.shapes import Shape
from thesis_lib.datasets.format.header import Header

FILE = "dataset.yaml"
LARGEST_BODY = 10.0  # m; what is dropped on a rig fits on a table
LARGEST_HEIGHT = 300.0  # extents, of the lowest tenth; true bodies come down to 1 extent, in mm to 1000
LARGEST_SPEED = 100.0  # m/s, 90th percentile; a fall from 500 m
TO_RAD = np.pi / 180.0

RADIANS = "give theta in radians (and omega in rad/s): multiply by pi/180"
METRES = "give lengths in m: divide by 1000 if they are in millimetres, by 100 if in centimetres"
SHAPE_METRES = METRES + " (--shape of the init command takes m, whatever --units says of the log)"
UPWARDS = "y must point up, away from the surface: flip its sign (and that of theta if that turns clockwise then)"


@dataclass(frozen=True)
class KnownBody:
    """What is known of the body even if dataset.yaml is wrong elsewhere.

    `shape` and `k_g` (m) are None without a valid shape; `height` (m) is that of the surface; `gravity` in m/s².
    """

    shape: Shape | None = None
    k_g: float | None = None
    height: float = 0.0
    gravity: float = 9.81

    @classmethod
    def of(cls, header: Header | None, shape: Shape | None) -> "KnownBody":
        """From a valid header, else from the shape alone."""
        if header is None:
            return cls(shape, None if shape is None else shape.extent / 2)
        shape = header.body.shape
        k_g = min(header.body.radius_of_gyration, shape.extent)  # a larger one is reported by `check_header`
        return cls(shape, k_g, header.surface.height, header.gravity)

    @property
    def oversized(self) -> bool:
        """Whether the shape is too large to be in m, so that ratios to it mean nothing."""
        return self.shape is not None and self.shape.extent > LARGEST_BODY

    def sunk(self, y: np.ndarray) -> str:
        """What is wrong if most of the heights `y` (n,) in m lie below the surface; '' otherwise."""
        if np.mean(y < self.height) <= 0.5:
            return ""
        return f"the body's centre is below the surface ({self.height:g} m) in most rows"
