"""Misfit of a law to measured impacts, over grids of parameters (thesis equations 3.7 and 3.8).

    metric "impulse"     ‖c_irb − c‖ in N s, eq. 3.8, with the measured impulse c_irb of eq. 3.7
    metric "velocity"    ‖v⁺ − v̂⁺‖_k in m/s: kinetic norm, as in figure 3-8

The least squares of eq. 3.7 needs a weighting of Δω against Δv, which the thesis does not state:

    "kinetic"      k Δω counts like Δv: c = M_C J Δv, invariant under a change of units; the default here;
    "unweighted"   Δω in rad/s counts like Δv in m/s: used for the impulses in the authors' data ("p_true").

In the velocity metric the misfit is √((c − c_irb)ᵀ M_C⁻¹ (c − c_irb)/m + e²), with kinetic c_irb and e the part of Δv
that no impulse through the contact point can give.  Both metrics need the impulse only.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from thesis_lib.contact.law import Law
from thesis_lib.contact.space import contact_space, measured_impulse, velocity_change, velocity_error
from thesis_lib.datasets.format.impacts import Impacts
from thesis_lib.mechanics.contact import Contact

Metric = Literal["impulse", "velocity"]
Weighting = Literal["kinetic", "unweighted"]
BLOCK = 16_384  # misfits at a time: some thirty arrays of 128 KiB; larger ones lose time to page faults


@dataclass(frozen=True)
class MeasuredImpulses:
    """Measured impulses and contact spaces of n impacts, computed once for all laws and parameters."""

    space: Contact
    c_t: np.ndarray  # c_t, c_n: (n,) measured impulse c_irb in N s
    c_n: np.ndarray
    unreachable: np.ndarray  # (n,) m/s, kinetic norm of the part of Δv that no impulse through the contact can give
    mass: float  # kg

    def __len__(self) -> int:
        return len(self.c_t)

    def __getitem__(self, rows: np.ndarray | slice) -> "MeasuredImpulses":
        """The impacts at `rows`."""
        return MeasuredImpulses(self.space[rows], self.c_t[rows], self.c_n[rows], self.unreachable[rows], self.mass)


def target_of(impacts: Impacts, weighting: Weighting = "kinetic") -> MeasuredImpulses:
    """Measured impulse and contact space of impacts; the module's head explains the weightings."""
    body = {"mass": impacts.mass, "k_g": impacts.k_g}
    c_t, c_n = measured_impulse(impacts.dv, impacts.r, **body)
    explained = velocity_change(c_t, c_n, impacts.r, **body)
    unreachable = velocity_error(impacts.dv - explained, impacts.k_g)
    if weighting == "unweighted":
        # argmin_c ‖Δv − A c‖ with ω in rad/s and A = M⁻¹ Jᵀ (n, 3, 2)
        unit, zero = np.ones(len(impacts)), np.zeros(len(impacts))
        A = np.stack([velocity_change(*c, impacts.r, **body) for c in ((unit, zero), (zero, unit))], axis=-1)
        A_T = np.swapaxes(A, 1, 2)
        c_t, c_n = np.linalg.solve(A_T @ A, A_T @ impacts.dv[:, :, None])[:, :, 0].T
    return MeasuredImpulses(contact_space(impacts.v_pre, impacts.r, **body), c_t, c_n, unreachable, impacts.mass)


def misfit(
    law: Law, target: MeasuredImpulses, mu: np.ndarray | float, epsilon: np.ndarray | float, metric: Metric
) -> np.ndarray:
    """Misfit for parameters that broadcast against n impacts, e.g. (G, 1) gives (G, n); NaN: no solution."""
    with np.errstate(all="ignore"):
        c_t, c_n = law.impulse(target.space, np.asarray(mu, float), np.asarray(epsilon, float))
        return misfit_of_impulse(target, c_t, c_n, metric)


def misfit_table(law: Law, target: MeasuredImpulses, mu: np.ndarray, epsilon: np.ndarray, metric: Metric) -> np.ndarray:
    """Misfit (G, n) at G parameter pairs, in blocks of impacts that fit the cache."""
    table = np.empty((len(mu), len(target)))
    width = max(1, BLOCK // len(mu))
    for start in range(0, len(target), width):
        block = slice(start, start + width)
        table[:, block] = misfit(law, target[block], mu[:, None], epsilon[:, None], metric)
    return table


def misfit_of_impulse(
    target: MeasuredImpulses, c_t: np.ndarray | float, c_n: np.ndarray | float, metric: Metric
) -> np.ndarray:
    """Misfit of impulses (..., n) in N s: in N s, or in m/s for the metric "velocity"."""
    d_t, d_n = c_t - target.c_t, c_n - target.c_n
    if metric == "impulse":
        return np.sqrt(d_t * d_t + d_n * d_n)
    space = target.space  # equals the velocity error only for kinetic weighting
    form = d_t * (space.K_tt * d_t + 2.0 * space.K_tn * d_n) + d_n * (space.K_nn * d_n)
    return np.sqrt(form / target.mass + target.unreachable**2)


def contact_momentum(impacts: Impacts) -> np.ndarray:
    """Momentum M_C v_C (n, 2) in N s at the contact point before impact: minus the impulse that stops that point."""
    return -np.stack(target_of(impacts).space.impulse_to(0.0, 0.0), axis=-1)
