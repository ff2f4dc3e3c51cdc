"""The thesis's three treatments of noise (section 2.3.2, step 4) on noisy drops of a free body of known mass.

    softened        eq. 2.13: contacts may act at a distance, at a price
    complementary   eq. 2.14 with the dynamics as cost: every product of the complementarity has a price
    projected       eq. 2.12 on states moved to the contact manifold (`base_parameters.projection`)

Gaps and sliding velocities within three standard deviations of their noise count as zero; without that hardly
any contact acts.  Each program is solved to its global minimum (`programs.mode_qp`).  Eq. 2.14 as printed, with the
dynamics as a constraint, has no solution: in flight the noisy spin changes without a torque.  For the same reason all
three find too small an inertia: I times the noise of the spin's change is a misfit, and I = 0 has none.
"""

from typing import Literal

import numpy as np

from thesis_lib.identify.base_parameters.projection import contact_tolerances, project_to_contact
from thesis_lib.identify.base_parameters.window import GAP_TOLERANCE, V_TOLERANCE, States, free_body_window
from thesis_lib.identify.mass_ratio.plain_program import SEARCH
from thesis_lib.identify.programs.mode_qp import Program, solve_mode_qp
from thesis_lib.simulate.stepping.multibody import PlanarFreeBody

Treatment = Literal["softened", "complementary", "projected"]
PROGRAMS: dict[Treatment, Program] = {"softened": "2.13", "complementary": "2.14 soft", "projected": "2.12"}


def treated_ratio(
    treatment: Treatment, body: PlanarFreeBody, h: float, q: np.ndarray, v: np.ndarray, mu: float, sigma: np.ndarray
) -> float:
    """m/I in 1/m², within `plain_program.SEARCH`, from noisy states q, v (m+1, 3) with noise `sigma` (2, 3).

    Shape, mass and gravity of `body` are used, its inertia is not; h in s.
    """
    states = States.of(body, h, q, v, np.zeros((len(q) - 1, 3)))
    gravity = body.gravity(q[0])[:2] / body.mass
    reach = body.shape.extent
    gap, slip = contact_tolerances(body, sigma)
    closed = None
    if treatment == "projected":
        # a uniform disk of that extent stands for the inertia, which is not known
        metric = np.array([1.0, 1.0, 0.5 * reach**2])
        a_free = np.tile([*gravity, 0.0], (len(q) - 1, 1))
        states = project_to_contact(states, body, a_free=a_free, gap_tolerance=gap, v_tolerance=slip, metric=metric)
        closed, gap, slip = states.closed, 0.0, 0.0
    window = free_body_window(
        states,
        mu,
        gravity=(float(gravity[0]), float(gravity[1])),
        known={"m": body.mass},
        closed=closed,
        gap_tolerance=max(gap, GAP_TOLERANCE),
        v_tolerance=max(slip, V_TOLERANCE),
    )
    inertia = float(solve_mode_qp(window, PROGRAMS[treatment]).theta[0])
    low, high = np.array(SEARCH) / reach**2
    return float(np.clip(body.mass / inertia if inertia > 0.0 else high, low, high))
