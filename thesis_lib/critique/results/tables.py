"""Tables of the critique: comparison, errors, ladder, impacts used and left out, flights, error budget.

Comparison, ladder and budget use held-out impacts; `errors` and `flights` contain all impacts and flights, with a mark
(`held_out`).  foundation/columns.yaml explains the columns.  The budget splits the mean square error of the base law:

| part                | definition                                                                                    |
|---------------------|-----------------------------------------------------------------------------------------------|
| noise               | trace of the kinetic covariance of the error from measured noise                              |
| parameters          | trace of J Cov(μ, ε) Jᵀ, the error of the fit because training data are few                   |
| rigid_point_contact | mean square IRB error, less that on data drawn from the base law with the measured noise      |
| choice_of_law       | base law less Best Post Hoc of the six, less the same difference on drawn data                |
| rest                | remainder of the total: a missing effect, or scatter                                          |

Parts, in (m/s)², are subtracted in this order, each between zero and the remainder, so that they sum to the total.  The
largest 2 % of the errors are excluded: a single missed hit would dominate a mean square.
"""

import numpy as np
import pandas as pd

from thesis_lib.coefficients.cost import target_of
from thesis_lib.coefficients.individual import fit_individual
from thesis_lib.contact.bounds import best_post_hoc
from thesis_lib.critique.drops.criticise import DropsCritique, irb_errors
from thesis_lib.critique.drops.features import features
from thesis_lib.critique.drops.few_impacts import FewImpacts
from thesis_lib.critique.drops.questions.class_tests import velocities
from thesis_lib.critique.drops.questions.flight_residuals import flight_table
from thesis_lib.critique.drops.world import Judgement
from thesis_lib.critique.likelihood.comparison import Comparison
from thesis_lib.critique.likelihood.fit import Fit
from thesis_lib.critique.likelihood.observations import Observations
from thesis_lib.critique.likelihood.synthesis import synthesise
from thesis_lib.critique.results.numbers import contact_residuals, impact_errors
from thesis_lib.critique.selection.discovery import paired_gain
from thesis_lib.datasets.format.impacts import Impacts
from thesis_lib.statistics.bootstrap import bootstrap_mean

COMPARISON = (
    *("model", "kind", "mu", "mu_std", "epsilon", "epsilon_std", "mean", "median", "quantile_90"),
    *("floor", "score", "n_failed", "share_in_range", "tolerance", "n_held_out"),
)
DRAWS = 999  # resamples of trials for an interval
SYNTHETIC = 4  # datasets drawn from the base law, averaged
MOST_IN_RANGE = 400  # held-out impacts fitted one by one: a share then has an error of 2.5 %
RANGE_FLOORS = 2.0  # noise floors: an outcome is in range if some (μ, ε) comes this near
RANGE_UNKNOWN = 0.1  # m/s, the same if the noise is unknown
TRIM = 0.02  # share of the impacts, largest errors first, that the budget excludes


def tables(critique: DropsCritique, rng: np.random.Generator) -> dict[str, pd.DataFrame]:
    """All tables by file stem."""
    content = {
        "comparison": comparison(critique),
        "errors": errors(critique),
        "ladder": ladder(critique, rng),
        "budget": budget(critique, rng),
    }
    if critique.space.is_plane:
        content["impacts"] = impacts(critique.observations, critique.held_out.trial)
    if len(critique.observations.flights):
        content["flights"] = flight_table(critique)
    return content


def comparison(critique: DropsCritique) -> pd.DataFrame:
    """A row per law, bound and baseline: parameters, held-out error, score, failed solves, share in range."""
    o = critique.held_out
    bases = critique.discovery.bases
    errors = {name: impact_errors(fitted, o) for name, fitted in bases.items()}
    base = critique.ladder[0][1]
    share, tolerance = _shares_in_range(critique)
    rows = [
        _row(name, "law", errors[name], fitted, critique.laws[name])
        | {"share_in_range": share[name], "tolerance": tolerance}
        for name, fitted in bases.items()
    ]
    if critique.discovery.steps:
        _, fitted, judged = critique.ladder[-1]
        rows.append(_row("augmented", "augmented", impact_errors(fitted, o), fitted, judged))
    rows.append(_row("best_post_hoc", "bound", best_post_hoc(np.stack(list(errors.values()), axis=1))[1]))
    rows.append(_row("irb_bound", "bound", irb_errors(base, o)))
    here = base.on(o)
    rows.append(_row("no_impact", "baseline", o.norm(here.after.v - here.before.v)))
    return pd.DataFrame(rows).reindex(columns=COMPARISON)


def few_tables(few: FewImpacts) -> dict[str, pd.DataFrame]:
    """Table `comparison`, and in the plane `impacts`, for too few impacts for a verdict: nothing is held out."""
    none = np.zeros(0)
    rows = [_row(name, "law", none, fitted) for name, fitted in few.laws.items()]
    content = {"comparison": pd.DataFrame(rows).reindex(columns=COMPARISON)}
    return content | ({"impacts": impacts(few.observations, none)} if few.observations.space.is_plane else {})


def errors(critique: DropsCritique) -> pd.DataFrame:
    """A row per impact and model (base, and augmented if there are effects) with the error in the contact frame."""
    o = critique.observations
    models = {"base": critique.ladder[0][1]}
    if critique.discovery.steps:
        models["augmented"] = critique.ladder[-1][1]
    held_out = np.isin(o.trial, critique.held_out.trial).astype(int)
    of_impact = {"trial": o.trial, "impact": o.impact}
    parts = []
    for name, fitted in models.items():
        tangential, *across, normal, couple = contact_residuals(fitted, o).T
        errors = {"error_normal": normal, "error_tangential": tangential, "error_couple": couple}
        errors |= dict(zip(["error_across"], across))
        judged = {"model": name, "held_out": held_out, "error": impact_errors(fitted, o)}
        table = pd.DataFrame(of_impact | judged | errors)
        parts.append(pd.concat([table, features(fitted, o).drop(columns="trial")], axis=1))
    return pd.concat(parts, ignore_index=True).sort_values(
        ["model", "trial", "impact"], key=lambda c: c if c.name != "model" else c != "base", ignore_index=True
    )


def ladder(critique: DropsCritique, rng: np.random.Generator) -> pd.DataFrame:
    """A row per model of the ladder, after 0, 1, ... effects."""
    rows, previous = [], None
    for step, (label, _, judged) in enumerate(critique.ladder):
        low, high = bootstrap_mean(judged.error, judged.trial, DRAWS, rng)
        gain = (np.nan,) * 3 if previous is None else paired_gain(judged, previous, rng)
        rows.append(
            {
                "step": step,
                "label": label,
                "error": float(judged.error.mean()),
                "error_low": low,
                "error_high": high,
                "floor": judged.floor,
                **{name: judged.misfit(name)[0] for name in judged.sigmas},
                "score": judged.total / len(judged.score),
                **dict(zip(("gain", "gain_low", "gain_high"), gain)),
            }
        )
        previous = judged
    return pd.DataFrame(rows)


def impacts(o: Observations, held_out: np.ndarray) -> pd.DataFrame:
    """Impacts in the plane: used ones with covariance, others with the reason; `held_out`: held-out trials."""
    used = o.found.impacts.to_table().assign(hits=1, span=0.0, used=1, reason="", detail="")
    rows = np.flatnonzero(o.span)
    if len(rows):
        used = pd.concat([used, _episodes(o.rows(rows))], ignore_index=True)
    left_out = left_out_impacts(o).assign(used=0, hits=1)
    table = pd.concat([used, left_out], ignore_index=True) if len(left_out) else used
    table["held_out"] = np.isin(table["trial"], held_out).astype(int)
    first = ["trial", "impact", "hits", "span", "used", "held_out", "reason", "detail"]
    table = table[[*first, *(name for name in table.columns if name not in first)]]
    return table.sort_values(["trial", "impact", "used"], ignore_index=True, kind="stable")


def _episodes(o: Observations) -> pd.DataFrame:
    """Episodes as rows of impacts.csv: pose and velocity at the first touch, velocity where the next flight begins."""
    cov = np.zeros((len(o), 9, 9))
    for channel in range(3):
        before = (channel, 3 + channel)
        cov[np.ix_(range(len(o)), before, before)] = o.cov[:, 0, channel]
        cov[:, 6 + channel, 6 + channel] = o.cov[:, 1, channel, 1, 1]
    q, v_pre, v_post = o.value[:, 0], o.slope[:, 0], o.slope[:, 1]
    r = o.rig.shape.contact_point(q[:, 2])
    episodes = Impacts(o.trial, o.impact, q, v_pre, v_post, r, k_g=o.rig.k_g, t=o.t, cov=cov)
    return episodes.to_table().assign(hits=o.hits, span=o.span, used=1, reason="", detail="")


def left_out_impacts(observations: Observations) -> pd.DataFrame:
    """Impacts that were detected but not used: trial, impact, t, reason, detail."""
    detected = observations.found
    left_out = detected.left_out[["trial", "impact", "t", "reason", "detail"]].copy()
    if not observations.arcs:
        return left_out
    # detection fits arcs of both sides together; the critique needs a line on each side
    arcs = detected.arcs[detected.arcs["used"].astype(bool)]
    known = pd.MultiIndex.from_arrays([detected.impacts.trial, detected.impacts.impact])
    short = arcs[~pd.MultiIndex.from_frame(arcs[["trial", "impact"]]).isin(known)]
    short = short[["trial", "impact", "t"]].assign(
        reason="window_too_short", detail="fewer than three samples clear of contact on one side"
    )
    return pd.concat([left_out, short], ignore_index=True) if len(short) else left_out


def budget(critique: DropsCritique, rng: np.random.Generator) -> pd.DataFrame:
    """Parts of the mean square error of the base law on held-out single hits, as in the module's table."""
    o, base = critique.held_out.single, critique.ladder[0][1]
    laws = list(critique.discovery.bases.values())
    squares, irb, gap = _bounds(base, laws, o)
    noise, made_irb, made_gap = 0.0, np.nan, np.nan
    if o.noise_known:
        m = o.space.motions
        S = base.on(o).covariance(o.t_std)[:, :m, :m]
        if not o.rig.has_angle:
            left = base.on(o).what_is_left
            S = left @ S @ np.swapaxes(left, 1, 2)
        noise = float(np.einsum("nij,nij->n", S, o.metric)[_kept(impact_errors(base, o))].mean())
        drawn = [_bounds(base, laws, synthesise(base.on(o), rng)) for _ in range(SYNTHETIC)]
        _, made_irb, made_gap = np.mean(drawn, axis=0)
    goals = {
        "noise": noise,
        "parameters": _parameter_square(base, o),
        "rigid_point_contact": irb - np.nan_to_num(made_irb),
        "choice_of_law": gap - np.nan_to_num(made_gap),
        "rest": np.inf,
    }
    remainder, rows = squares, []
    for part, goal in goals.items():
        amount = float(np.clip(goal, 0.0, remainder))
        remainder -= amount
        rows.append({"part": part, "mean_square": amount, "share": amount / squares})
    return pd.DataFrame(rows)


def _row(model: str, kind: str, error: np.ndarray, fitted: Fit | None = None, judged: Judgement | None = None) -> dict:
    solved = error[np.isfinite(error)]
    row = {"model": model, "kind": kind, "n_failed": int(len(error) - len(solved)), "n_held_out": len(error)}
    if len(solved):
        row |= {"mean": solved.mean(), "median": np.median(solved), "quantile_90": np.quantile(solved, 0.9)}
    if fitted is not None:
        for name in ("mu", "epsilon"):
            row |= {name: fitted.content(name)["value"], f"{name}_std": fitted.std[name]}  # NaN for a bound
    if judged is not None:
        row |= {"floor": judged.floor, "score": judged.total / len(judged.score)}
    return row


def _shares_in_range(critique: DropsCritique) -> tuple[dict[str, float], float]:
    """By law, the share of held-out single hits that some (μ, ε) brings within the tolerance; the tolerance in m/s."""
    o, base = critique.held_out.single, critique.ladder[0][1]
    floor = critique.ladder[0][2].floor
    tolerance = RANGE_FLOORS * floor if np.isfinite(floor) else RANGE_UNKNOWN
    if not (o.rig.has_angle and o.space.is_plane):  # coefficients are fitted to single impacts in the plane only
        return dict.fromkeys(critique.discovery.bases, np.nan), tolerance
    v_pre, v_post, r = (a[:MOST_IN_RANGE] for a in velocities(base, o))
    n = len(v_pre)
    target = target_of(Impacts(o.trial[:n], np.zeros(n, int), o.value[:n, 0], v_pre, v_post, r, k_g=o.rig.k_g))
    shares = {}
    for name, fitted in critique.discovery.bases.items():
        error = fit_individual(fitted.model.law, target, "velocity").error
        shares[name] = float(np.mean(np.nan_to_num(error, nan=np.inf) <= tolerance))
    return shares, tolerance


def _bounds(base: Fit, laws: list[Fit], o: Observations) -> tuple[float, float, float]:
    """Trimmed mean squares, (m/s)²: of the base law, of the IRB bound, and of the base law less Best Post Hoc."""
    error = impact_errors(base, o)
    keep = _kept(error)
    best = best_post_hoc(np.stack([impact_errors(fitted, o)[keep] for fitted in laws], axis=1))[1] ** 2
    square = error[keep] ** 2
    return float(square.mean()), float(np.mean(irb_errors(base, o)[keep] ** 2)), float(np.mean(square - best))


def _kept(error: np.ndarray) -> np.ndarray:
    """Indices of the rows without the largest `TRIM` of the errors and without failed solves."""
    order = np.argsort(np.where(np.isfinite(error), error, np.inf), kind="stable")
    return np.sort(order[: max(1, min(np.isfinite(error).sum(), round((1.0 - TRIM) * len(error))))])


def _parameter_square(fitted: Fit, o: Observations) -> float:
    """Mean of trace(J Cov Jᵀ) in the kinetic metric, (m/s)², with secants J over a standard error."""
    columns = []
    for name in (name for name, p in fitted.model.parameters.items() if p.discrete is None):
        value, step = fitted.values[name], max(np.nan_to_num(fitted.std[name]), 1e-6)
        high, low = (
            Comparison(fitted.model, {**fitted.values, name: value + offset}, o).R[:, : o.space.motions]
            for offset in (0.5 * step, -0.5 * step)
        )
        columns.append((high - low) / step)
    J = np.stack(columns, axis=-1)  # (n, motions, parameters)
    return float(np.einsum("nij,nji->n", J @ fitted.covariance @ np.swapaxes(J, 1, 2), o.metric).mean())
