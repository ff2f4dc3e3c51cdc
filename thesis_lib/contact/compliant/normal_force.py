"""Normal forces of contacts of finite duration, and the restitution and duration of a central contact under each.

In units of a length L, of v₀ = 1 m/s and of L/v₀, with x the depth, x' its rate, x_m the greatest depth so far and D
the loss, the force per mass is

    hysteresis      f = xⁿ while loading,  f = ((x − (1 − D) x_m)₊ / D)ⁿ below x_m,  D = ε²
    linear damper   f = (x + D x')₊
    Hunt-Crossley   f = xⁿ (1 + D x')₊

with n = 1 for a linear spring, 3/2 for Hertz's contact, and 2 where pressure and area both grow with the depth.  No
contact pulls.  A central contact, x'' = −f from x = 0 and x' = 1, ends at time S, when f is 0 again, with the velocity
−ε.  The centroid of its impulse is at s = (ε S + x(S)) / (1 + ε).  Therefore ε and τ = s L / v₀ of a central contact
at v₀ determine the force: D follows from ε, and L from τ.

A contact at another speed v or of another mass 1/b has the same motion in other units, L' = L (v²/(b v₀²))^(1/(n+1)):

| force         | its loss | restitution                         | time          |
|---------------|----------|-------------------------------------|---------------|
| hysteresis    | D        | is the same at any speed and mass   | s L'/v        |
| linear damper | D √b     | is smaller for smaller masses       | s(D √b) L'/v  |
| Hunt-Crossley | D v/v₀   | is smaller for faster contacts      | s(D v/v₀) L'/v |

A convex contact is a linear damper whose normal and friction forces are found together by a convex program, as in
simulators for control.  With v the velocity of the contact points and A their inverse inertia, M⁻¹ = 1 of a central
contact, the forces f of all points minimise

    ½ fᵀ (A + R) f + fᵀ (a − a*)  in  |f_t| ≤ μ f_n,    a*_n = (1 + R)(x − D v_n),  a*_t = −(1 + R) D v_t

where a is the acceleration without contact and R_n = R, R_t = R/ratio.  Then f_n of a central contact is x + D x'.
If R is large, the force depends on depth and rate alone, and friction is also a damper, `ratio` times as strong as the
damper in the normal direction.  If R is small, the contact points get the acceleration a* for any mass.  The program
lifts a body that slides.  MuJoCo's R is (1 − d)/d with its impedance d and its own estimate of A, which is 2/3 for a
body that cannot leave its plane.

On a pyramid f is a sum of forces along four edges, n ± μ t_1 and n ± μ t_2, each with R_e = 2 μ² R_t: a contact that
sticks has R_t along the surface, and R_n = μ² R_t/2.  Between t_1 and t_2 friction is weaker and changes direction.

Sources: Walton and Braun 1986, doi:10.1122/1.549893; Schwager and Pöschel 2007, doi:10.1007/s10035-007-0065-z; Hunt and
Crossley 1975, doi:10.1115/1.3423596; Johnson 1985, section 11.4, doi:10.1017/CBO9781139171731 (Hertz); Todorov 2014,
doi:10.1109/ICRA.2014.6907751 (convex contact; a* and R in MuJoCo's documentation, "Computation", "Constraint model");
Elandt et al. 2019, doi:10.1109/IROS40897.2019.8968548 (n = 2).
"""

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
from scipy.special import gamma

from thesis_lib.contact.compliant.compiled import (
    CONVEX,
    HUNT_CROSSLEY,
    HYSTERESIS,
    LINEAR_DAMPER,
    PRESSURE_FIELD,
    PYRAMID,
    SPEED,
    pushes,
)
from thesis_lib.contact.compliant.watched_slide import share_of_slide

LEAST = 1e-6  # least D of a hysteresis: share of the work that a plastic contact returns, for a finite unloading slope
LOSSES = np.concatenate([[0.0], np.geomspace(1e-3, 30.0, 300)])  # D of the table; ε is below 0.05 at the last value
FINE = 4e-3  # time step of the table's integration; ε and S are accurate to 1e-5
SLOWEST = 1e-2  # m/s, below every impact that a camera can resolve; keeps powers finite


@dataclass(frozen=True)
class NormalForce:
    """Normal force with the `exponent` n; this class is the hysteresis, which returns the fraction ε² of its work."""

    exponent: float = 1.0
    kind: ClassVar[int] = HYSTERESIS

    def push(
        self, depth: np.ndarray, rate: np.ndarray, deepest: np.ndarray, loss: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """f and ∂f/∂x' (n,) for x, x', x_m and D (n,), in the units of the module's docstring."""
        return pushes(self.kind, self.exponent, depth, rate, deepest, loss)

    def loss(self, epsilon: np.ndarray) -> np.ndarray:
        """Loss D of central contacts with restitution ε at v₀."""
        return np.maximum(epsilon * epsilon, LEAST)

    def changed(self, loss: np.ndarray, b: np.ndarray, speed: np.ndarray) -> np.ndarray:
        """Loss D of contacts of mass 1/b at speeds relative to v₀, from D of a central contact at v₀."""
        return loss + 0.0 * b * speed

    def restitution(self, loss: np.ndarray) -> np.ndarray:
        """Restitution ε of contacts with the loss D."""
        return np.sqrt(loss)

    def duration(self, loss: np.ndarray) -> np.ndarray:
        """Duration S of contacts with the loss D."""
        return self._half * (1.0 + np.sqrt(loss))

    def centroid(self, loss: np.ndarray) -> np.ndarray:
        """Time s of the centroid of the impulse of contacts with the loss D."""
        epsilon = np.sqrt(loss)
        return (epsilon * self.duration(loss) + (1.0 - loss) * self._depth) / (1.0 + epsilon)

    def lasting(self, epsilon: float) -> float:
        """Ratio of duration to τ of a central contact with restitution ε."""
        loss = self.loss(np.array([epsilon]))
        return float((self.duration(loss) / self.centroid(loss))[0])

    @property
    def _depth(self) -> float:
        """Greatest x without loss: xⁿ⁺¹/(n + 1) = 1/2."""
        return (0.5 * (self.exponent + 1.0)) ** (1.0 / (self.exponent + 1.0))

    @cached_property
    def _half(self) -> float:
        """Time to the greatest depth without loss."""
        power = 1.0 / (self.exponent + 1.0)
        return float(self._depth * np.sqrt(np.pi) * gamma(1.0 + power) / gamma(0.5 + power))

    def sliding(
        self, slip: np.ndarray, limit: np.ndarray, pull: np.ndarray, span: np.ndarray | float = 0.0
    ) -> np.ndarray:
        """Acceleration (2, n) in m/s² along the surface that parabolas fitted over `span` (n,) in s would show.

        `slip` (2, n) in m/s is the slip in the middle of the span.  Friction is at most `limit` (n,); all other forces
        accelerate the body by `pull` (2, n), both in m/s².
        """
        a = pull - limit * slip / np.maximum(np.hypot(*slip), 1e-9)
        stops = limit > np.hypot(*pull)  # on a steeper surface the body does not come to rest
        return a * np.where(stops, share_of_slide(np.hypot(*slip), np.hypot(*a), span), 1.0)

    # --- impacts ---

    def length(self, tau: np.ndarray, loss: np.ndarray) -> np.ndarray:
        """Length L in m of contacts with the loss D and the time τ in s at v₀."""
        return tau * SPEED / self.centroid(loss)

    def epsilon_at(self, epsilon: np.ndarray, b: np.ndarray, v_n: np.ndarray) -> np.ndarray:
        """Restitution ε of contacts of mass 1/b at v_n in m/s, from ε of a central contact at v₀."""
        return self.restitution(self.changed(self.loss(epsilon), b, np.abs(v_n) / SPEED))

    def tau_at(self, tau: np.ndarray, epsilon: np.ndarray, b: np.ndarray, v_n: np.ndarray) -> np.ndarray:
        """Time τ in s, times √b, of contacts of mass 1/b at v_n in m/s, from τ and ε of a central contact at v₀."""
        loss, speed = self.loss(epsilon), np.maximum(np.abs(v_n), SLOWEST) / SPEED
        there = self.centroid(self.changed(loss, b, speed)) / self.centroid(loss)
        return tau * there * (np.sqrt(b) / speed) ** ((self.exponent - 1.0) / (self.exponent + 1.0))


class _Damped(NormalForce):
    """Normal force whose loss grows with the rate; the results of its central contacts are tabulated."""

    def loss(self, epsilon: np.ndarray) -> np.ndarray:
        return np.interp(epsilon, self._table[0][::-1], LOSSES[::-1])

    def restitution(self, loss: np.ndarray) -> np.ndarray:
        return np.interp(loss, LOSSES, self._table[0])

    def duration(self, loss: np.ndarray) -> np.ndarray:
        return np.interp(loss, LOSSES, self._table[1])

    def centroid(self, loss: np.ndarray) -> np.ndarray:
        return np.interp(loss, LOSSES, self._table[2])

    def _left(self, x: np.ndarray, v: np.ndarray, loss: np.ndarray) -> np.ndarray:
        """Quantity that falls to 0 when a contact ends."""
        return x

    @cached_property
    def _table(self) -> np.ndarray:
        """ε, S and s (3, losses) of central contacts, by classical Runge-Kutta steps; the last is cut where f = 0."""

        def rate(y: np.ndarray) -> np.ndarray:
            return np.stack([y[1], -self.push(y[0], y[1], y[0], loss)[0]])

        table, rows, loss, t = np.zeros((3, len(LOSSES))), np.arange(len(LOSSES)), LOSSES, 0.0
        y = np.stack([np.zeros_like(LOSSES), np.ones_like(LOSSES)])
        while len(rows):
            a = rate(y)
            b = rate(y + 0.5 * FINE * a)
            c = rate(y + 0.5 * FINE * b)
            later = y + FINE / 6.0 * (a + 2.0 * b + 2.0 * c + rate(y + FINE * c))
            left, then = (self._left(*state, loss) for state in (y, later))
            over = then <= 0.0
            if over.any():
                part = (left[over] / (left[over] - then[over]))[None]
                x, v = y[:, over] + part * (later - y)[:, over]
                S = t + FINE * part[0]
                table[:, rows[over]] = -v, S, (x - v * S) / (1.0 - v)
            rows, loss, y, t = rows[~over], loss[~over], later[:, ~over], t + FINE
        return table


@dataclass(frozen=True)
class LinearDamper(_Damped):
    """Linear spring and linear damper in parallel; the exponent is 1."""

    kind: ClassVar[int] = LINEAR_DAMPER

    def changed(self, loss, b, speed):
        return loss * np.sqrt(b)

    def _left(self, x, v, loss):
        return x + loss * v


@dataclass(frozen=True)
class HuntCrossley(_Damped):
    """Spring whose loss grows with depth and rate."""

    kind: ClassVar[int] = HUNT_CROSSLEY

    def changed(self, loss, b, speed):
        return loss * speed


@dataclass(frozen=True)
class PressureField(HuntCrossley):
    """Pressure in a soft body, integrated over the chord where the surface cuts it; n = 2 in a central contact."""

    exponent: float = 2.0
    kind: ClassVar[int] = PRESSURE_FIELD


@dataclass(frozen=True)
class ConvexDamper(LinearDamper):
    """Linear damper with friction from a convex program."""

    kind: ClassVar[int] = CONVEX


@dataclass(frozen=True)
class PyramidDamper(ConvexDamper):
    """Linear damper with friction on a pyramid whose edges lie along the first two axes."""

    kind: ClassVar[int] = PYRAMID

    def sliding(self, slip, limit, pull, span=0.0):
        # friction acts on the edge of the larger component until both components are equal, and is then shared to keep
        # them equal: their sum and their difference decrease at constant rates until they are 0
        sign = np.where(slip < 0.0, -1.0, 1.0)
        (first, second), (gained, other) = sign * slip, sign * pull
        ahead = np.where(first < second, -1.0, 1.0)
        falls = limit - gained - other, limit - ahead * (gained - other)
        total, apart = (
            -fall * share_of_slide(size, fall, span)
            for size, fall in zip((first + second, np.abs(first - second)), falls)
        )
        return 0.5 * sign * np.stack([total + ahead * apart, total - ahead * apart])
