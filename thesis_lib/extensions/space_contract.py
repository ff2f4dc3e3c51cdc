"""What an impact law that holds in space must do there beside what it must do in the plane (`law_contract`).

A turn about the normal by ψ, R its matrix, turns velocity and compliance of the contact, and so the impulse:

    v → R v,    K → R K Rᵀ,    c → R c.

An impact in a plane is one in space with slip, r and the couple of all else in that plane: K has no element between the
plane and the direction across it, whose own compliance does not matter.
"""

from collections.abc import Sequence

import numpy as np

from thesis_lib.contact.law import ROUNDING, Law
from thesis_lib.extensions.impact_draws import ImpactDraws
from thesis_lib.mechanics.contact import Contact

PARALLEL = 1.3  # compliance across the plane over that along it; any positive number would do


def turns_with_the_surface(law: Law, draw: ImpactDraws) -> str:
    """Impacts turned about the normal have turned impulses."""
    contact, R = draw.space, _about_the_normal(len(draw.mu))
    c = np.stack(law.impulse(contact, draw.mu, draw.epsilon))
    found = law.impulse(_turned(contact, R), draw.mu, draw.epsilon)
    wrong = _differ(law, found, np.einsum("ijn,jn->in", R, c), draw)
    return f"turned about the normal, {wrong} of {len(draw.mu)} impacts have not the turned impulse" if wrong else ""


def embeds_the_plane(law: Law, draw: ImpactDraws) -> str:
    """An impact in a plane, however that is turned about the normal, has the impulse of that in the plane."""
    if 2 not in law.dimensions:
        return ""
    plane, R = draw.space, _about_the_normal(len(draw.mu))
    c_t, c_n = law.impulse(plane, draw.mu, draw.epsilon)
    zero = np.zeros_like(c_n)
    K = np.array([[plane.K_tt, zero, plane.K_tn], [zero, PARALLEL * plane.K_tt, zero], [plane.K_tn, zero, plane.K_nn]])
    embedded = _turned(Contact(np.stack([plane.v_t, zero, plane.v_n]), K), R)
    expected = np.einsum("ijn,jn->in", R, np.stack([c_t, zero, c_n]))
    wrong = _differ(law, law.impulse(embedded, draw.mu, draw.epsilon), expected, draw)
    return f"in {wrong} of {len(draw.mu)} impacts in a plane the impulse in space is another one" if wrong else ""


def _about_the_normal(n: int) -> np.ndarray:
    """Turns (3, 3, n) about the normal by angles of all sizes, every other by none."""
    angle = np.linspace(-np.pi, np.pi, n) * (np.arange(n) % 2)
    cos, sin, zero = np.cos(angle), np.sin(angle), np.zeros(n)
    return np.array([[cos, -sin, zero], [sin, cos, zero], [zero, zero, zero + 1.0]])


def _turned(contact: Contact, R: np.ndarray) -> Contact:
    return Contact(np.einsum("ijn,jn->in", R, contact.v), np.einsum("ijn,jkn,lkn->iln", R, contact.K, R))


def _differ(law: Law, found: Sequence[np.ndarray], expected: np.ndarray, draw: ImpactDraws) -> int:
    """Number of impacts whose impulse differs from what is expected."""
    tolerance = max(ROUNDING, law.accuracy_in_space) * draw.speed
    return int(np.sum(~(np.abs(np.stack(found) - expected).max(axis=0) <= tolerance)))
