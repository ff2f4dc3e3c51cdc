"""From which impacts the authors identified table 3.1: the first 150 drops of their recording, as it seems.

The thesis says "a randomly selected subset of the data", and of figure 3-7 that "the summation is over 150 drops".
Random subsets hardly ever give friction as low as table 3.1's.  The first `DROPS` drops, less those that the authors'
tests refuse, do: fitted as the authors' code predicts, with its gravity step (`stored_predictions`), they give table
3.1 for all laws but AP Newton, whose problem the authors solve by a quadratic program to a loose tolerance.  No later
run of as many drops does; μ wanders over the recording.

| column                             | meaning                                                                      |
|------------------------------------|------------------------------------------------------------------------------|
| `mu`, `epsilon`                    | of the n impacts kept of the first drops                                     |
| `mu_published`, ...                | table 3.1                                                                    |
| `mu_runs_low`, `mu_runs_high`, ... | least and largest over the later runs of n impacts                           |
| `mu_random`, `mu_random_std`, ...  | median over random subsets of n impacts, and their robust standard deviation |
| `lower`                            | share of the random subsets whose μ is at most the published one             |
| `nearer`                           | share of them with (μ, ε) as near to the published pair as the first drops'  |
| `nearer_runs`                      | the same share of the later runs                                             |

The row `TOGETHER` holds the means over the six laws; its `nearer` compares distances in all six pairs.
"""

import numpy as np
import pandas as pd

from thesis_lib.contact import SIX_LAWS
from thesis_lib.datasets.format.impacts import Impacts
from thesis_lib.impact_study.ensemble import fit_ensemble
from thesis_lib.impact_study.stored_predictions import TABLE_3_1, law_with_gravity_step, target_with_gravity_step
from thesis_lib.impact_study.tables import SIX_AS_PUBLISHED
from thesis_lib.statistics.spread import robust_std

DROPS = 150  # thesis, figure 3-7: "the summation is over 150 drops"
TOGETHER = "together"
_RESOLUTION = 1e-3  # of the search, whose last cells are a tenth of it: finer than table 3.1 is printed


def first_kept(all_drops: pd.DataFrame, drops: int = DROPS) -> int:
    """Number of the first `drops` that carry none of the authors' flags."""
    return int((all_drops.filter(like="flag_")[:drops] == 0).all(axis=1).sum())


def first_drops(impacts: Impacts, n: int, subsets: int, rng: np.random.Generator) -> pd.DataFrame:
    """A row per law and one for all together, with the columns above.

    `impacts` are all that the authors kept, trials numbered as recorded, at least two runs of n.
    """
    target = target_with_gravity_step(impacts)
    order = np.argsort(impacts.trial, kind="stable")
    runs = [order[start : start + n] for start in range(0, len(order) - n + 1, n)]
    chosen = [*runs, *(rng.choice(len(order), size=n, replace=False) for _ in range(subsets))]
    pairs = np.empty((len(chosen), len(SIX_LAWS), 2))
    for i, names in enumerate(zip(SIX_LAWS, SIX_AS_PUBLISHED)):
        law = law_with_gravity_step(*names)
        fits = [fit_ensemble(law, target[rows], "impulse", tolerance=_RESOLUTION) for rows in chosen]
        pairs[:, i] = [(fit.mu, fit.epsilon) for fit in fits]
    published = np.array([TABLE_3_1[law] for law in SIX_LAWS])
    distance = np.sqrt(((pairs - published) ** 2).sum(axis=2))  # (fits, laws)
    rows = [_row(law, len(runs), pairs[:, i], published[i], distance[:, i]) for i, law in enumerate(SIX_LAWS)]
    whole = (pairs.mean(axis=1), published.mean(axis=0), np.linalg.norm(distance, axis=1))
    return pd.DataFrame([*rows, _row(TOGETHER, len(runs), *whole)]).assign(n=n)


def _row(law: str, runs: int, pairs: np.ndarray, published: np.ndarray, distance: np.ndarray) -> dict[str, object]:
    """`pairs` (runs + subsets, 2), with their distances to `published` (2,); the first run is that of the claim."""
    row: dict[str, object] = {"law": law}
    for i, name in enumerate(("mu", "epsilon")):
        (first, *later), random = pairs[:runs, i], pairs[runs:, i]
        middle = float(np.median(random))
        row |= {name: first, f"{name}_published": published[i]}
        row |= {f"{name}_runs_low": min(later), f"{name}_runs_high": max(later)}
        row |= {f"{name}_random": middle, f"{name}_random_std": float(robust_std(random - middle))}
    near = distance <= distance[0]
    return row | {
        "lower": float(np.mean(pairs[runs:, 0] <= published[0])),
        "nearer": float(near[runs:].mean()),
        "nearer_runs": float(near[1:runs].mean()),
        "n_runs": runs - 1,
        "n_random": len(pairs) - runs,
    }
