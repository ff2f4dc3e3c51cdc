"""The identification program without known external force, a singular value problem (thesis 2.3.3, after eq. 2.14).

With f = 0, eq. 2.12 is homogeneous: Θ = 0, c = 0 solves it, and other solutions are determined up to a scale, common
to parameters and forces.  The scale is therefore fixed, and the contact forces are eliminated as in `mode_qp`,

    minimise ‖Ỹ Θ‖   subject to   ‖S Θ‖ = 1,        Ỹ_k = (1 − B_k B_k⁺) Y_k,        a_k = B_k⁺ Y_k Θ,

where the columns of Y S⁻¹ have unit norm.  S Θ is the right singular vector of Ỹ S⁻¹ for the least singular value,
which is 0 without noise.  If the next one is also 0, more than the scale is undetermined: bodies that never touch each
other each have their own scale.  The sign is chosen such that contacts push.

| in code           | on paper            | unit | shape |
|-------------------|---------------------|------|-------|
| `theta`           | Θ over its first entry, m | 1, m² | (n_Θ,) |

With noise the least singular value is not 0, and the Θ of least misfit depends on S; a parameter that only noise
excites is underestimated, as with known mass (`mass_ratio.plain_program`).
"""

import re
from dataclasses import replace

import numpy as np
import pandas as pd

from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.mechanisms.motions import DEFAULT, Chapter2Bodies, block, disk
from thesis_lib.thesis.identify.base_parameters.excitation_table import excitation_cases
from thesis_lib.thesis.identify.base_parameters.identifiability import FLOOR, identifiability
from thesis_lib.thesis.identify.base_parameters.window import ContactWindow
from thesis_lib.thesis.identify.programs.mode_qp import admissible, amplitudes, edges_of, forces_of, without_forces
from thesis_lib.thesis.identify.programs.result import ProgramResult, judged


def solve_homogeneous(window: ContactWindow) -> ProgramResult:
    """Estimate Θ and c relative to the first parameter, which is set to 1, from a window without known force.

    Raises:
        UserError: a force or a parameter is known, or more than the scale is undetermined.
    """
    if np.abs(window.f).max(initial=0.0) > FLOOR:
        raise UserError("the window has a known force or parameter, which sets the scale: use solve_mode_qp")
    n = len(window.names)
    if (known := identifiability(window)).rank < n - 1:
        raise UserError("more than the scale is undetermined: " + "; ".join(known.warnings))
    edges = edges_of(window, "2.12")
    Y, _, inverse = without_forces(window, edges)
    scale = np.linalg.norm(window.Y.reshape(-1, n), axis=0)
    theta = np.linalg.svd(Y.reshape(-1, n) / scale, full_matrices=False)[2][-1] / scale
    amplitude = amplitudes(window, inverse, theta, len(edges))
    sign = np.sign(amplitude.sum()) or np.sign(theta @ scale)
    # scale the largest generalised force to 1, the unit of the residuals
    size = sign * np.abs(window.Y * theta).max()
    theta, amplitude = theta / size, amplitude / size
    c_n, c_t = forces_of(window, edges, amplitude)
    cost = float(np.sum(window.residual(theta, c_n, c_t) ** 2))
    pushes = admissible(window, theta, amplitude)
    result = judged(window, "singular value", pushes, theta, c_n, c_t, cost)
    one = theta[0] or 1.0  # if the first parameter is 0, the status reports that the result explains nothing
    return replace(result, theta=theta / one, c_n=c_n / one, c_t=c_t / one)


def ratios_table(settings: Chapter2Bodies = DEFAULT) -> pd.DataFrame:
    """Table of the program's estimates in the cases of `excitation_cases` without known force, a row each.

    Columns: case, ratio and truth (m/I in 1/m²), ratio_error and force_error (relative, of m/I and of the forces over
    the mass), found; numbers are empty if the program refuses the window.
    """
    bodies = {"disk": disk(settings), "square": block(settings), "flight": block(settings)}
    rows = []
    for name, (record, window) in excitation_cases(settings).items():
        if "no force" not in name:
            continue
        body = bodies[re.split("[ ,]", name)[0]]
        row: dict[str, object] = {"case": name, "truth": body.mass / body.inertia, "found": 0}
        try:
            found = solve_homogeneous(window)
        except UserError:
            rows.append(row)
            continue
        true, c = (np.stack([x.c_n, x.c_t]) / unit for x, unit in ((record, body.mass), (found, 1.0)))
        row |= {"ratio": 1.0 / found.theta[1], "ratio_error": abs(body.mass / body.inertia * found.theta[1] - 1.0)}
        row |= {"force_error": np.linalg.norm(c - true) / np.linalg.norm(true), "found": int(found.solved)}
        rows.append(row)
    return pd.DataFrame(rows, columns=["case", "ratio", "truth", "ratio_error", "force_error", "found"])
