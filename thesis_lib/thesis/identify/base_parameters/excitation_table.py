"""Table of the parameters that contact of a rigid body identifies, as singular values, for cases of thesis 2.3.3.

Each case is a simulated motion of a free body whose m and I are unknown, analysed by `identifiability`: sliding or
sticking contact (a disk; a square that pivots about a corner, as in thesis figure 2-5), with and without a known
external force; flight; and two special cases, a square that lands flat (figure 2-5, left) and a disk that only rolls
(not in the thesis), whose motion depends on m + I/R² only.  For the sliding cases the columns of eq. 2.18
in (m/I, 1/m, 1/I, m/I²) are analysed as well.

| column           | unit | meaning |
| ---------------- | ---- | --- |
| `sigma_1`, `2`   | 1    | singular values of the regressor outside the span of contact forces, columns of unit norm |
| `rank`           | 1    | combinations of (m, I) that are determined |
| `eq_2_18_rank`   | 1    | rank of eq. 2.18's four columns; -1 where the case does not slide |
| `not_identified` |      | changes of the parameters that have no observable effect |
"""

from collections.abc import Callable

import numpy as np
import pandas as pd

from thesis_lib.simulate.mechanisms.base_parameters import linear_combination
from thesis_lib.simulate.mechanisms.motions import DEFAULT, Chapter2Bodies, block, disk
from thesis_lib.simulate.stepping.multibody import PlanarFreeBody
from thesis_lib.simulate.stepping.stepping import SimulatedMotion, simulate
from thesis_lib.thesis.identify.base_parameters.identifiability import (
    RANK_TOLERANCE,
    identifiability,
    sliding_regressor,
)
from thesis_lib.thesis.identify.base_parameters.window import ContactWindow, free_body_window

STEPS = 60
# N and N m at 1 kg: an irregular push in all directions, below the weight, so that the contact stays closed
PUSH = ((2.0, 5.0, 0.3), (1.0, 7.0, 1.1), (0.15, 3.0, 0.7))
GAP = 1e-4  # m, expected gap within which the contact of a body that stays on the surface counts as closed
TILTED = 0.4  # rad, of the square that pivots
PIVOT_STEPS = 40
LOW_FRICTION, HIGH_FRICTION = 0.1, 5.0  # the pushed body always slides, or never slides


def push(t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Known external force (3,) at time t in s: three sines, in N, N and N m."""
    return np.array([a * np.sin(w * t * 2.0 * np.pi + phase) for a, w, phase in PUSH])


def _on_surface(
    body: PlanarFreeBody, angle: float, v: tuple, force: Callable | None, steps: int, mu: float
) -> tuple[SimulatedMotion, float, PlanarFreeBody]:
    """Motion of a body released on the surface at an angle (rad) with a velocity; returned with μ and the body."""
    q = np.array([0.0, 0.0, angle])
    q[1] = -body.contacts_of(q[None]).phi[0].min()
    return simulate(body, q, np.array(v), force, DEFAULT.h, steps, mu, 0.0), mu, body


def excitation_cases(settings: Chapter2Bodies = DEFAULT) -> dict[str, tuple[SimulatedMotion, ContactWindow]]:
    """Motion of each case, by name, and its window with unknown (m, I)."""
    rolling, square = disk(settings), block(settings)
    fast, still = (4.0, 0.0, 3.0), (0.0, 0.0, 0.0)
    high, flat, tilted = (0.0, 3.0, 0.4), (0.0, 0.8, 0.0), (0.0, 0.95, 0.35)

    def released(q: tuple, v: tuple, force: Callable | None) -> tuple[SimulatedMotion, float, PlanarFreeBody]:
        arguments = (settings.h, STEPS, settings.mu, settings.epsilon)
        return simulate(square, np.array(q), np.array(v), force, *arguments), settings.mu, square

    motions = {
        # the only contact of a disk stays closed under any force
        "disk slides, no force": _on_surface(rolling, 0.0, fast, None, STEPS, LOW_FRICTION),
        "disk slides, force": _on_surface(rolling, 0.0, fast, push, STEPS, LOW_FRICTION),
        "disk rolls, no force": _on_surface(rolling, 0.0, still, None, STEPS, HIGH_FRICTION),
        "disk rolls, force": _on_surface(rolling, 0.0, still, push, STEPS, HIGH_FRICTION),
        # released on a corner, the square falls about it, without slip, until just before the next corner lands
        "square pivots, no force": _on_surface(square, TILTED, still, None, PIVOT_STEPS, HIGH_FRICTION),
        "square pivots, force": _on_surface(square, TILTED, still, push, PIVOT_STEPS, HIGH_FRICTION),
        "flight, no force": released(high, (1.0, 0.0, 2.0), None),
        "flight, force": released(high, (1.0, 0.0, 2.0), push),
        "square lands tilted, no force": released(tilted, still, None),
        "square lands tilted, force": released(tilted, still, push),
        "square lands flat, no force": released(flat, still, None),
    }
    return {name: (motion[0], free_body_window(*motion, gap_tolerance=GAP)) for name, motion in motions.items()}


def landings(settings: Chapter2Bodies = DEFAULT) -> dict[str, tuple[SimulatedMotion, ContactWindow]]:
    """Landings "flat" and "tilted" of the square of figure 2-5, without external force."""
    cases = excitation_cases(settings)
    return {name: cases[f"square lands {name}, no force"] for name in ("flat", "tilted")}


def excitation_table(settings: Chapter2Bodies = DEFAULT) -> pd.DataFrame:
    """Table with a row per case; columns as in the module's docstring."""
    rows = []
    for name, (record, window) in excitation_cases(settings).items():
        result = identifiability(window)
        rows.append(
            {
                "case": name,
                "sigma_1": result.singular_values[0],
                "sigma_2": result.singular_values[1],
                "rank": result.rank,
                "eq_2_18_rank": _sliding_rank(record, window, settings),
                "not_identified": "; ".join(linear_combination(c, window.names) for c in result.null_space.T),
            }
        )
    return pd.DataFrame(rows)


def _sliding_rank(record: SimulatedMotion, window: ContactWindow, settings: Chapter2Bodies) -> int:
    if window.gap.shape[1] != 1:
        return -1
    slides = window.touching[:, 0] & (window.v_t[:, 0] != 0.0) & (record.c_n[:, 0] > 0.0)
    if not slides.any():
        return -1
    columns = sliding_regressor(record, window.mu, settings.gravity)[0][slides].reshape(-1, 4)
    size = np.linalg.norm(columns, axis=0)
    values = np.linalg.svd(columns[:, size > RANK_TOLERANCE] / size[size > RANK_TOLERANCE], compute_uv=False)
    return int((values > RANK_TOLERANCE * values[0]).sum()) if len(values) else 0
