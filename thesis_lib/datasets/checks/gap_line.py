"""Trend of the gap at impact along the surface, which shows that the surface slopes in the picture, or is bent.

The gap of the believed shape at an impact, against the position x_c of the contact point, is a line b x_c if the
picture is rotated against the surface by atan b, and a parabola if the surface is bent or the lens distorts.  Fits are
robust; a trend is reported if it is significant and not small beside the scatter.
"""

from dataclasses import dataclass

import numpy as np

from thesis_lib.bodies.shapes import Shape
from thesis_lib.statistics.spread import robust_std

CLEARLY = 8.0  # standard errors of the slope, or of the curvature
MATTERS = 1.0  # spread of the line over that of the gaps about it
LEAST = 20  # impacts
TURNS = 4  # fits; each turns the body by the angle found, which moves its contact points
STEEP = 0.17  # rad, 10 degrees: beyond it the surface is a ramp, not the error of a camera set up by eye
MOSTLY = 0.5  # of the variance of the gaps: soft contacts of 20 drops reach 0.27 by chance, lenses of 0.5 % 0.55
GRID = 50  # points at which the maximum of a curve is searched
TRIMMED = 3.0  # robust standard deviations


@dataclass(frozen=True)
class GapLine:
    """Trend of the gap along the surface: `angle` in rad or `curvature` in 1/m; the one that is not reported is 0.

    `place` (2,) in m is a point of the surface, `share` (0 to 1) the share of the variance of the gaps that the curve
    explains; `tangent` is the slope of a bent surface at `place`.
    """

    angle: float
    curvature: float
    place: tuple[float, float]
    share: float
    tangent: float = 0.0

    @property
    def normal(self) -> tuple[float, float]:
        """Unit normal of the surface in the picture."""
        return -float(np.sin(self.angle)), float(np.cos(self.angle))

    def gap(self, shape: Shape, q: np.ndarray) -> np.ndarray:
        """Gap (n,) in m between the body at poses q (n, 3) and the surface that slopes or is bent."""
        if self.curvature:
            x = q[:, 0] + shape.contact_point(q[:, 2])[:, 0] - self.place[0]
            return shape.gap(q[:, 1], q[:, 2], self.place[1]) - x * (self.tangent + 0.5 * self.curvature * x)
        return shape.gap((q[:, :2] - self.place) @ np.array(self.normal), q[:, 2] - self.angle)

    def said(self) -> str:
        """Message on the trend."""
        if self.curvature:
            return (
                f"Along x the gap at impact is a parabola: the surface seems to be bent, with a radius of "
                f"{1.0 / abs(self.curvature):.2g} m ({'a hollow' if self.curvature > 0.0 else 'a hump'}), or the lens "
                "distorts."
            )
        degrees = np.degrees(self.angle)
        way = f"{'rises' if degrees > 0.0 else 'falls'} by {abs(degrees):.2g} degrees along +x"
        return f"The gap at impact is a line along x: in the picture the surface {way} (R² = {self.share:.1%})."

    def remedy(self) -> str:
        """Advice on what to do about the trend."""
        if self.curvature:
            return "The critique distinguishes these causes (curved_surface, lens)."
        (x, y), n = self.place, self.normal
        return (
            "Level the camera with the surface, or the surface itself; another surface.height does not help. If the "
            "surface is a ramp, give it instead of `surface` in dataset.yaml: "
            f"surfaces: [{{name: ramp, point: [{x:.4g}, {y:.4g}], normal: [{n[0]:.5f}, {n[1]:.5f}]}}]. "
            "If the angle is only a few degrees, the critique finds it itself (camera_pose)."
        )


def gap_line(shape: Shape, q: np.ndarray) -> GapLine | None:
    """Line through the gaps at impact, from poses q (n, 3) in m and rad; None if the surface looks level and flat."""
    if len(q) < LEAST:
        return None
    angle, line = 0.0, None
    for _ in range(TURNS):
        r = shape.contact_point(q[:, 2] - angle)
        cos, sin = np.cos(angle), np.sin(angle)
        x = q[:, 0] + cos * r[:, 0] - sin * r[:, 1]
        y = q[:, 1] + sin * r[:, 0] + cos * r[:, 1]
        if not np.ptp(x) > 0.0:
            return None
        line = _fitted(x, y, 1)
        angle = float(np.arctan(line.c[1]))
    assert line is not None
    bent = _fitted(x, y, 2)
    if bent.clear and bent.rest < 0.6 * line.rest and bent.spread > MATTERS * bent.rest:
        level, tangent, half = map(float, bent.c)
        return GapLine(0.0, 2.0 * half, (bent.middle, level), bent.share, tangent)
    if line.clear and line.spread > MATTERS * line.rest:
        middle = float(np.mean(x))
        return GapLine(angle, 0.0, (middle, float(line.c[0] + line.c[1] * (middle - line.middle))), line.share)
    return None


def sunk(shape: Shape, q: np.ndarray, at: np.ndarray) -> np.ndarray | float:
    """Depth (n,) in m of the surface at poses `at` (n, 3) below its highest point, from the gaps at impacts q (k, 3).

    The surface is a cubic along x, as a lens distorts it, and constant beyond the outermost impacts.  0 if impacts are
    few, or if the cubic explains less than `MOSTLY` of the variance of the gaps.
    """
    if len(q) < LEAST:
        return 0.0
    x, x_at = (poses[:, 0] + shape.contact_point(poses[:, 2])[:, 0] for poses in (q, at))
    if not np.ptp(x) > 0.0:
        return 0.0
    x_at = np.clip(x_at, x.min(), x.max())
    cubic = _fitted(x, shape.gap(q[:, 1], q[:, 2]), 3)
    if cubic.share < MOSTLY:
        return 0.0
    return cubic.at(np.linspace(x.min(), x.max(), GRID)).max() - cubic.at(x_at)


@dataclass(frozen=True)
class _Curve:
    """A polynomial fitted to points: coefficients c (degree + 1,) about the mean of x, and the quality of the fit."""

    c: np.ndarray
    middle: float
    clear: bool
    spread: float
    rest: float
    share: float

    def at(self, x: np.ndarray) -> np.ndarray:
        """Values (n,) at x (n,)."""
        return np.polynomial.polynomial.polyval(x - self.middle, self.c)


def _fitted(x: np.ndarray, y: np.ndarray, degree: int) -> _Curve:
    """A polynomial fitted to the points (n,), without outliers."""
    middle, kept = float(np.mean(x)), np.ones(len(x), bool)
    A = np.stack([(x - middle) ** k for k in range(degree + 1)], axis=1)
    c, rest = np.zeros(degree + 1), 0.0
    for _ in range(3):
        c = np.linalg.lstsq(A[kept], y[kept], rcond=None)[0]
        off = y - A @ c
        rest = float(robust_std(off[:, None])[0])
        kept = np.abs(off) <= TRIMMED * max(rest, 1e-12)
    error = max(rest, 1e-12) * np.sqrt(np.linalg.pinv(A[kept].T @ A[kept])[-1, -1])
    of_last = A[kept, -1] * c[-1]
    share = 1.0 - float(np.var(y[kept] - A[kept] @ c)) / max(float(np.var(y[kept])), 1e-24)
    return _Curve(c, middle, abs(c[-1]) > CLEARLY * error, float(np.std(of_last)), rest, share)
