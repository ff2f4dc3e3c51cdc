"""Fit parameters of a model in space to whole tosses, as simulators are often tuned, instead of to hits.

    minimise over p the mean over tosses of  L(p) = mean of abs(Δp) / w + mean of abs(Δθ)

with the errors Δp, Δθ and the width w of `thesis_lib/critique/simulation/rollout.py`.  Absolute values are our choice:
with squares, as in the loss of Acosta, Yang and Posa, few tosses dominate.  Each bounce determines the next, so L jumps
where a toss tips over another edge.  The Nelder-Mead search needs no derivatives; it starts at the values of the model.
If p affects the flight, the initial state of each toss is fitted again for every p.
"""

from collections.abc import Callable, Sequence

import numpy as np

from thesis_lib.critique.results.saved_in_space import SavedSpaceModel
from thesis_lib.critique.results.saved_model import SavedParameter
from thesis_lib.critique.simulation.first_flight import MeasuredTosses
from thesis_lib.critique.simulation.rollout import STARTS, missed
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.effects import EFFECTS
from thesis_lib.foundation.errors import UserError

STEP = 1.0  # first step, as a multiple of the size of a parameter that matters
MOST = 40  # largest number of evaluations per parameter
CLOSE = 0.01  # size of the simplex at which the search ends, as a multiple of the first step
OF_CONTACTS = ("contact_law", "surface")  # families of effects that do not act in flight


def fit_to_tosses(
    model: SavedSpaceModel,
    dataset: Dataset,
    trials: Sequence[int],
    names: Sequence[str],
    start: str = "first_flight",
    say: Callable[[str], None] = lambda text: None,
) -> tuple[SavedSpaceModel, bool]:
    """Return the model with the parameters `names` fitted to these tosses, to be judged on others; and whether the
    search converged within `MOST` evaluations per parameter.

    These parameters then have no standard errors.  Values for which a toss has no solution are rejected.

    Raises:
        UserError: the model has no such parameter, or no first flight is recorded.
    """
    known = {name: p for name, p in model.model.fitted_parameters.items() if name in model.parameters}
    if unknown := [name for name in names if name not in known]:
        raise UserError(f"The model {model} has no parameter {unknown[0]} to fit; it has {', '.join(known)}.")
    measured = MeasuredTosses.of(dataset, model, trials)
    begins = any("." in name and EFFECTS[name.split(".")[0]].family not in OF_CONTACTS for name in names)
    first = np.array([model.values[name] for name in names])
    steps, low, high = np.array([(STEP * known[name].scale, known[name].low, known[name].high) for name in names]).T
    begun = STARTS[start](measured.bound(model), measured)
    best, count = np.inf, 0

    def loss(z: np.ndarray) -> float:
        nonlocal best, count
        p = first + steps * z
        if (p < low).any() or (p > high).any():
            return np.inf
        changed = with_values(model, dict(zip(names, p.tolist())))
        dynamics = measured.bound(changed)
        beginning = STARTS[start](dynamics, measured) if begins else begun
        errors = missed(changed, dynamics, beginning.state, measured)[["pos_int_percent", "angle_rad"]].to_numpy()
        found, count = float((errors @ [0.01, 1.0]).mean()), count + 1
        found = found if np.isfinite(found) else np.inf  # a toss without a solution must not drop out of the mean
        best = min(best, found)
        say(f"{len(measured.flight)} whole tosses, {count} of at most {MOST * len(names)}: error {best:.4g}")
        return found

    from scipy.optimize import minimize

    simplex = np.vstack([np.zeros(len(names)), np.eye(len(names))])
    options = {"initial_simplex": simplex, "maxfev": MOST * len(names), "xatol": CLOSE, "fatol": np.inf}
    found = minimize(loss, simplex[0], method="Nelder-Mead", options=options)
    return with_values(model, dict(zip(names, (first + steps * found.x).tolist()))), bool(found.success)


def with_values(model: SavedSpaceModel, values: dict[str, float]) -> SavedSpaceModel:
    """Return the model with other values of some parameters, without standard errors."""
    changed = {name: SavedParameter(value=value, unit=model.parameters[name].unit) for name, value in values.items()}
    return model.model_copy(update={"parameters": {**model.parameters, **changed}})
