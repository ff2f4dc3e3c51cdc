"""A pad under the contact that gives the same restitution at any speed and any lever.

Drake's point contact is a spring with Hunt-Crossley dissipation, f = k δ (1 + d δ̇)₊, whose restitution falls with the
speed of the impact.  Here this spring is elastic (d = 0) and presses on a pad of two thin layers, each on a spring and
a damper (a Kelvin chain):

    M ü_0 = −f_0,   p ü_i = f_{i−1} − f_i,   f_i = k_i (u_i − u_{i+1}) + c_i (u̇_i − u̇_{i+1}),   c_0 = 0,   u_3 = 0

until the contact force f_0 is 0.  The system is linear, hence ε = −u̇_0(end) / u̇_0(0) does not depend on the speed.
With one layer ε would depend on the effective mass of the contact, 1/M = 1/m + r_x²/(m k²), since a layer dissipates
most at one frequency.  With two layers, least squares gives c_i and k_i for which ε is nearly the same for all M.

Sources: Lakes 2009, Viscoelastic Materials, doi 10.1017/CBO9780511626722 (chains of Kelvin elements).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq, least_squares

from thesis_lib.foundation.errors import UserError

LAYER_SHARE = 0.15  # p/m; a lighter layer would only make the dampers need smaller time steps
# smallest effective mass over m of a square; used for every body, since it keeps the dampers small
SPREAD = 0.4
ELASTIC = 0.998  # no pad from this ε on: its springs would be a thousand times stiffer than the contact
SOFTEST = 0.25  # lowest ε; lower values would need a pad dominated by its dampers
MASSES = 5  # effective masses at which ε is fitted
HOLD = 1e-3  # weight of the starting values in the least squares, since ε alone does not determine all unknowns
_TIMES = 400  # number of times at which the end of a contact is bracketed before it is solved for


@dataclass(frozen=True)
class Pad:
    """Springs, dampers and masses of a pad, from the contact down."""

    k_contact: float  # k_0, N/m
    layers: tuple[tuple[float, float], ...]  # (k_i, c_i) in N/m, N s/m; empty: an elastic contact
    mass: float  # mass p of a layer, kg

    @property
    def softness(self) -> float:
        """Static compliance of contact and layers in series, m/N."""
        return 1.0 / self.k_contact + sum(1.0 / k for k, _ in self.layers)


def rebound(mass: float, layers: Sequence[tuple[float, float]]) -> tuple[float, float]:
    """Restitution (1) and duration (s) of a contact, in units with k_0 = 1 N/m and m = 1 kg.

    `mass` is the effective mass of the contact, `layers` are springs and dampers.
    """
    n = len(layers) + 1
    k, c = np.array([(1.0, 0.0), *layers]).T
    m = np.r_[mass, np.full(n - 1, LAYER_SHARE)]
    stretch = np.eye(n) - np.eye(n, k=1)  # u_i − u_{i+1}
    K, C = (stretch.T @ np.diag(each) @ stretch for each in (k, c))
    system = np.block([[np.zeros((n, n)), np.eye(n)], [-K / m[:, None], -C / m[:, None]]])
    rates, modes = np.linalg.eig(system)
    weights = np.linalg.solve(modes, np.eye(2 * n)[n].astype(complex))

    def part(row: np.ndarray, t: np.ndarray | float) -> np.ndarray:
        return np.real(np.exp(np.multiply.outer(t, rates)) @ (row * weights))

    squeeze = modes[0] - modes[1] if n > 1 else modes[0]
    t = np.linspace(0.0, 2.5 * np.pi * np.sqrt(mass * (1.0 / k).sum()), _TIMES)[1:]
    ended = np.flatnonzero(part(squeeze, t) < 0.0)
    if not len(ended):
        return 0.0, float(t[-1])
    end = brentq(lambda s: part(squeeze, s), t[max(ended[0] - 1, 0)], t[ended[0]])
    return float(-part(modes[n], end)), float(end)  # pyright: ignore[reportArgumentType]


def design(epsilon: float, contact_time: float, mass: float, lightest: float) -> Pad:
    """Pad with restitution `epsilon` (1) for impacts of a body, in which a central impact lasts `contact_time` (s).

    `mass` is the mass of the body in kg, `lightest` its smallest effective mass over `mass`.

    Raises:
        UserError: the restitution is too low for a pad.
    """
    if epsilon < SOFTEST:
        raise UserError(f"Drake's contact needs epsilon from {SOFTEST} to 1; got {epsilon}.")
    layers: list[tuple[float, float]] = []
    if epsilon < ELASTIC:
        masses = np.geomspace(min(lightest, SPREAD), 1.0, MASSES)
        # loss is about k_0/k_i at the peak of a layer; two peaks, a factor of four apart
        k = 2.0 * epsilon**0.3 / (2.2 * (1.0 - epsilon))
        start = np.log([k, 0.5 * k, k, 2.0 * k])

        def chain(x: np.ndarray) -> list[tuple[float, float]]:
            return [tuple(layer) for layer in np.exp(x).reshape(2, 2)]

        def misfit(x: np.ndarray) -> np.ndarray:
            every = [rebound(M, chain(x))[0] - epsilon for M in masses]
            return np.r_[every, HOLD * (x - start)]

        layers = chain(least_squares(misfit, start, xtol=1e-8).x)
    k_0 = mass * (rebound(1.0, layers)[1] / contact_time) ** 2
    real = tuple((float(k * k_0), float(c * np.sqrt(k_0 * mass))) for k, c in layers)
    return Pad(float(k_0), real, LAYER_SHARE * mass)
