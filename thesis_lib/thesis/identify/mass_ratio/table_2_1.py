"""Table 2.1 of the thesis (section 2.4): errors of m/I of block and ellipse at four signal-to-noise ratios.

Drops are simulated (`simulate.mechanisms.motions`) and cut before the fourth impact.  Left out, and counted, are drops
in which two corners hit in one step (their shares of the impulse are unobservable), drops with fewer than two impacts,
and drops with fewer than `min_after` samples after the last.  Each ratio has its own noise.  Methods, on equal states:

- plain: eq. 2.23 on the samples, noise level and μ known (`plain_program.plain_ratio`)
- softened, complementary, projected: the three treatments of noise of section 2.3.2, noise level and μ known
  (`plain_program.treated_ratio`)
- least_squares: Δω against lever at the true impact steps (`plain_program.impact_least_squares`)
- arcs: maximum likelihood over arcs and free impulses, without gap, noise estimated (`estimate.DropEstimates`)
- arcs_gap: arcs, with the gap at the impacts
- arcs_law: arcs_gap, with the contact law, μ and ε unknown

The bound of a row is the root mean square of the Cramér-Rao bounds of its drops, without a contact law: arcs_gap and
arcs_law fall below it where geometry and law add information.  `law_bound` is the bound with the law.  The worst
drops dominate a root mean square (an ellipse with little rotation gives little information), so `error_over_bound`
divides each error by the bound of its drop; it is 1 for an efficient estimator.

The thesis's column for the ellipse contradicts its text: the percentages correspond to m/I near 6, not 0.8.
"""

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
import pandas as pd

from thesis_lib.simulate.mechanisms.motions import BODIES, DEFAULT, Chapter2Bodies, releases
from thesis_lib.simulate.mechanisms.noise_snr import add_noise
from thesis_lib.simulate.stepping.multibody import PlanarFreeBody
from thesis_lib.simulate.stepping.stepping import SimulatedMotion, simulate
from thesis_lib.statistics.spread import MAD_TO_STD
from thesis_lib.thesis.identify.mass_ratio.cramer_rao import TrueImpacts, ratio_bound, true_impacts
from thesis_lib.thesis.identify.mass_ratio.estimate import DropEstimates, EstimateStatus
from thesis_lib.thesis.identify.mass_ratio.plain_program import (
    Treatment,
    impact_least_squares,
    plain_ratio,
    treated_ratio,
)
from thesis_lib.thesis.identify.settings import Table21

Method = Literal["plain", "softened", "complementary", "projected", "least_squares", "arcs", "arcs_gap", "arcs_law"]
METHODS: tuple[Method, ...] = get_args(Method)
# table 2.1: mean error and its standard deviation in 1/m², and the mean error in percent; by SNR in dB
THESIS = {
    "block": {
        40: (-0.021, 0.097, -0.35),
        30: (-0.125, 0.311, -2.083),
        20: (-0.659, 0.912, -10.98),
        10: (-3.491, 1.366, -58.197),
    },
    "ellipse": {
        40: (-0.031, 0.101, -0.31),
        30: (-0.136, 0.443, -2.34),
        20: (-0.712, 0.820, -11.71),
        10: (-4.891, 1.938, -80.44),
    },
}
LEFT_OUT = ("not solved", "two corners at once", "few impacts", "short end")
DEFAULT_STUDY = Table21()
_BATCH = 64  # releases drawn at a time
_MAX_BATCHES = 100


@dataclass(frozen=True)
class KeptDrops:
    """Accepted drops of one body."""

    body: PlanarFreeBody
    records: tuple[SimulatedMotion, ...]  # windows of the simulation
    impacts: tuple[TrueImpacts, ...]  # of each record
    left_out: dict[str, int]  # number of drops left out, by reason of `LEFT_OUT`


def make_drops(
    kind: str, n: int, rng: np.random.Generator, settings: Table21 = DEFAULT_STUDY, bodies: Chapter2Bodies = DEFAULT
) -> KeptDrops:
    """Simulate drops of "block" or "ellipse" until n are accepted.

    Raises:
        RuntimeError: hardly any drop is accepted, because the settings contradict each other.
    """
    body = BODIES[kind](bodies)
    reasons = dict.fromkeys(LEFT_OUT, 0)
    records, impacts = [], []
    for _ in range(_MAX_BATCHES):
        for q, v in zip(*releases(kind, _BATCH, rng, bodies)):
            record = simulate(body, q, v, None, bodies.h, bodies.steps, bodies.mu, bodies.epsilon)
            record, window_impacts, reason = _window(record, bodies.mu, settings)
            if reason:
                reasons[reason] += 1
                continue
            records.append(record)
            impacts.append(window_impacts)
            if len(records) == n:
                return KeptDrops(body, tuple(records), tuple(impacts), reasons)
    raise RuntimeError(f"only {len(records)} of {_MAX_BATCHES * _BATCH} drops of the {kind} were accepted: {reasons}")


def _window(record: SimulatedMotion, mu: float, settings: Table21) -> tuple[SimulatedMotion, TrueImpacts | None, str]:
    if not record.solved:
        return record, None, "not solved"
    steps = true_impacts(record, mu).steps
    if len(steps) > settings.max_impacts:
        record = record.window(0, int(steps[settings.max_impacts]))
    impacts = true_impacts(record, mu)
    if len(impacts.steps) < settings.min_impacts:
        return record, None, "few impacts"
    if not impacts.alone.all():
        return record, None, "two corners at once"
    if record.steps - impacts.steps[-1] < settings.min_after:
        return record, None, "short end"
    return record, impacts, ""


def left_out_table(kind: str, drops: KeptDrops) -> pd.DataFrame:
    """Table of the numbers of drops left out, a row per reason of `LEFT_OUT`."""
    return pd.DataFrame({"shape": kind, "reason": list(drops.left_out), "drops": list(drops.left_out.values())})


def study(
    kind: str, drops: KeptDrops, rng: np.random.Generator, settings: Table21, bodies: Chapter2Bodies
) -> pd.DataFrame:
    """Apply all methods to all drops; a row per drop, signal-to-noise ratio and method.

    Columns: shape, snr, drop, method, ratio (1/m²), error (%), std (%, stated), bound, law_bound (%), status.
    """
    body, mu = drops.body, bodies.mu
    truth = body.mass / body.inertia
    rows = []
    for snr in settings.snr:
        for i, (record, impacts) in enumerate(zip(drops.records, drops.impacts)):
            noisy = add_noise(record, snr, rng)
            known = (record, noisy.sigma, impacts, body.shape, bodies.gravity)
            bounds = [100.0 * ratio_bound(*known, law) / truth for law in (False, True)]
            estimates = DropEstimates(record.h, noisy.q, noisy.v, body.shape, bodies.gravity)
            for method in METHODS:
                value, std, status = _apply(method, body, record.h, noisy, impacts, mu, estimates)
                error = 100.0 * (value / truth - 1.0)
                rows.append((kind, snr, i, method, value, error, 100.0 * std / truth, *bounds, status))
    columns = ["shape", "snr", "drop", "method", "ratio", "error", "std", "bound", "law_bound", "status"]
    return pd.DataFrame(rows, columns=columns)


def _apply(method, body, h, noisy, impacts, mu, estimates) -> tuple[float, float, str]:
    q, v = noisy.q, noisy.v
    if method == "plain":
        value = plain_ratio(body, h, q, v, mu, noisy.sigma)
    elif method in get_args(Treatment):
        value = treated_ratio(method, body, h, q, v, mu, noisy.sigma)
    elif method == "least_squares":
        value = impact_least_squares(body, h, q, v, impacts.steps)
    else:
        estimate = estimates.estimate(law=method == "arcs_law", use_gap=method != "arcs")
        return estimate.value, estimate.std, estimate.status.name.lower()
    return value, np.nan, "ok" if np.isfinite(value) else "no_contact"


def _rms(values: pd.Series) -> float:
    return float(np.sqrt(np.mean(values**2)))


def table_2_1(rows: pd.DataFrame) -> pd.DataFrame:
    """Table 2.1 from the rows of `study`: a row per shape, method and ratio; errors are over drops with status ok."""
    ok = EstimateStatus.OK.name.lower()
    table = []
    rows = rows.assign(method=pd.Categorical(rows["method"], METHODS))
    for (shape, method, snr), group in rows.groupby(["shape", "method", "snr"], observed=True):
        used = group[group["status"] == ok]
        error, bound = used["error"], _rms(used["bound"])
        thesis, thesis_std, thesis_percent = THESIS[shape].get(snr, (np.nan, np.nan, np.nan))
        unit = float(np.median(used["ratio"] / (100.0 + error))) if len(used) else np.nan  # one percent of m/I
        scaled = (used["error"] / used["bound"]).abs()
        table.append(
            {
                "shape": shape,
                "method": method,
                "snr": snr,
                "n": len(used),
                "n_failed": len(group) - len(used),
                "mean_error": error.mean(),
                "mean_error_std": error.std() / np.sqrt(max(len(used), 1)),
                "median_error": error.median(),
                "std": error.std(),
                "rms_error": _rms(error),
                "bound": bound,
                "law_bound": _rms(used["law_bound"]),
                "std_over_bound": error.std() / bound,
                "error_over_bound": _rms(error / used["bound"]),
                "error_over_law_bound": _rms(error / used["law_bound"]),
                # 1 for an efficient estimator, independently of the tails
                "median_over_bound": MAD_TO_STD * scaled.median(),
                "std_stated": _rms(used["std"]),
                "mean_ratio_error": unit * error.mean(),
                "std_ratio_error": unit * error.std(),
                "thesis": thesis_percent,
                "thesis_ratio_error": thesis,
                "thesis_ratio_std": thesis_std,
                "thesis_ratio": 100.0 * thesis / thesis_percent,
            }
        )
    return pd.DataFrame(table)
