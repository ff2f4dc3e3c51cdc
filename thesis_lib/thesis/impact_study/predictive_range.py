"""Predictive range of a law: share of outcomes that it can predict, and share of the admissible set that it covers.

An outcome lies in the range of a law if some (μ, ε) brings the law within a tolerance of the measured impulse
(thesis, table 3.2).  The thesis gives no tolerance; the share is reported for several (own choice).

The region of a law (thesis, figure 3-3) is the image of 0 ≤ μ ≤ μ_s, 0 ≤ ε ≤ 1 in the plane of impulses.  Its area over
the area of the admissible set is the share of the outcomes of rigid contact that the law can predict.
"""

import numpy as np

from thesis_lib.contact.law import Law
from thesis_lib.contact.space import admissible
from thesis_lib.mechanics.contact import Contact

POINTS = 81  # points per side of the parameter grid; doubling them changes the covered share by less than 0.002
ARC = 721  # vertices of the half disc before it is clipped to the admissible set


def region(law: Law, space: Contact, *, points: int = POINTS) -> tuple[np.ndarray, np.ndarray]:
    """Impulses (c_t, c_n) of a law, (points μ, points ε, n) each, over a grid that is even in arctan μ and in ε."""
    mu = np.tan(np.linspace(0.0, 0.5 * np.pi, points, endpoint=False))
    epsilon = np.linspace(0.0, 1.0, points)
    with np.errstate(all="ignore"):
        c_t, c_n = law.impulse(space, mu[:, None, None], epsilon[None, :, None])
    shape = (points, points, len(space.v_t))
    return np.broadcast_to(c_t, shape), np.broadcast_to(c_n, shape)


def covered_share(law: Law, space: Contact) -> np.ndarray:
    """Area (n,) of the law's region over the admissible area; grid cells not inside the admissible set are excluded."""
    c_t, c_n = region(law, space)
    inside = admissible(space, c_t, c_n)
    inside = inside[1:, 1:] & inside[:-1, 1:] & inside[1:, :-1] & inside[:-1, :-1]
    # area of each cell from its diagonals
    d1_t, d1_n = c_t[1:, 1:] - c_t[:-1, :-1], c_n[1:, 1:] - c_n[:-1, :-1]
    d2_t, d2_n = c_t[1:, :-1] - c_t[:-1, 1:], c_n[1:, :-1] - c_n[:-1, 1:]
    area = 0.5 * np.abs(d1_t * d2_n - d1_n * d2_t)
    return np.where(inside, area, 0.0).sum(axis=(0, 1)) / admissible_area(space)


def admissible_area(space: Contact) -> np.ndarray:
    """Area (n,) in (N s)² of the set of admissible impulses (thesis, figure 3-2)."""
    outline_t, outline_n = admissible_outline(space)
    cross = outline_t * np.roll(outline_n, -1, axis=0) - outline_n * np.roll(outline_t, -1, axis=0)
    return 0.5 * np.abs(cross.sum(axis=0))


def admissible_outline(space: Contact) -> tuple[np.ndarray, np.ndarray]:
    """Outline (c_t, c_n), (ARC + 2, n) each, of the admissible set: half the energy ellipse above the line of maximum
    compression, cut at c_n = 0.  The first and the last point are the ends of the line."""
    # whitened with M_C⁻¹ = L Lᵀ the ellipse is a disc; v_n⁺ ≥ 0 is the half of it about (l_nt, l_nn)
    l_tt = np.sqrt(space.K_tt)
    l_nt, l_nn = space.K_tn / l_tt, np.sqrt(space.det) / l_tt
    radius = np.sqrt(space.energy(space.v_t, space.v_n))
    phase = np.linspace(-0.5 * np.pi, 0.5 * np.pi, ARC)[:, None] + np.arctan2(l_nn, l_nt)
    centre_t, centre_n = space.impulse_to(0.0, 0.0)
    d_n = radius * np.sin(phase) / l_nn
    c_n = centre_n + d_n
    c_t = centre_t + (radius * np.cos(phase) - l_nt * d_n) / l_tt
    # points with c_n < 0 (a few, in skewed contacts) move to c_n = 0 along a chord to a frictionless impulse: points of
    # the arc to an impulse inside the set, ends of the line of maximum compression to the plastic impulse on this line
    plastic = -space.v_n / space.K_nn
    arc = _lifted(c_t, c_n, 1.5 * plastic)
    line = _lifted(c_t[[0, -1]], c_n[[0, -1]], plastic)
    c_t, c_n = (np.concatenate([ends[:1], middle, ends[1:]]) for ends, middle in zip(line, arc))
    return c_t, c_n


def _lifted(c_t: np.ndarray, c_n: np.ndarray, apex_n: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Move points (points, n) with c_n < 0 to c_n = 0 along their chord to (0, apex_n > 0)."""
    below = c_n < 0.0
    share = np.where(below, apex_n / np.where(below, apex_n - c_n, 1.0), 1.0)
    return share * c_t, np.where(below, 0.0, c_n)
