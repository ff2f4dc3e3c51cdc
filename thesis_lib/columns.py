"""Unit and meaning of every column in the tables under results/: one dictionary, written to results/columns.csv.

A column means the same in every table, except where `TABLES` says otherwise for one table (by the file's stem).
Impulses of a dataset without a mass are per kilogram, N s/kg = m/s.
"""

from collections.abc import Iterable
from pathlib import Path

import pandas as pd

from thesis_lib.files import write_table

Meaning = tuple[str, str]  # unit ('' for text, "1" for pure numbers), meaning

_COVARIANCE: Meaning = ("product of both", "covariance of the two quantities in the column's name")

COLUMNS: dict[str, Meaning] = {
    "panel": ("", "part of the figure, as lettered or titled in it"),
    "variant": (
        "",
        "as_published: the authors' code where it differs from its law; as_defined: the law itself",
    ),
    "series": ("", "what is drawn: the name of a curve, point or group of points"),
    "kind": ("", "sample: measured; arc: fitted flight; impact: instant of a detected impact"),
    "law": ("", "impact law, a key of thesis_lib.contact.LAWS"),
    "model": ("", "impact law or post-hoc bound"),
    "trial": ("", "number of the release"),
    "impact": ("", "number of the impact within its trial, from 0"),
    "subset": ("", "number of the random order in which impacts are added"),
    "x": ("m", "horizontal position"),
    "y": ("m", "vertical position"),
    "t": ("s", "time since the trial's first sample"),
    "value": ("m", "x, y, or θ times the radius of gyration, as `series` says"),
    "energy": ("J", "energy above rest on the surface; J/kg where the dataset gives no mass"),
    "c_t": ("N s", "tangential impulse on the body; N s/kg where the dataset gives no mass"),
    "c_n": ("N s", "normal impulse on the body; N s/kg where the dataset gives no mass"),
    "momentum_t": ("N s", "tangential contact momentum before impact, (M_C v_C)_t; N s/kg without a mass"),
    "momentum_n": ("N s", "normal contact momentum before impact, (M_C v_C)_n; N s/kg without a mass"),
    "mu": ("1", "coefficient of friction; s/m for mirtich_as_published, whose friction is viscous"),
    "epsilon": ("1", "coefficient of restitution"),
    "parameter": ("1", "value of μ or ε at which a density is given"),
    "cost": ("N s", "mean misfit in impulse space an impact; N s/kg without a mass"),
    "misfit": ("N s", "misfit of one impact in impulse space; N s/kg without a mass"),
    "error": ("m/s", "error of the velocity after impact, √(δv_x² + δv_y² + (k δω)²)"),
    "density": ("", "probability density: s/m over errors, 1 over parameters"),
    "share_below": ("1", "share of held-out impacts with at most this error"),
    "k": ("1", "number of impacts identified from"),
    "n": ("1", "impacts that went into the value"),
    "weighting": ("", "of Δω against Δv in equation 3.7: kinetic, or unweighted as the authors have it"),
    "mu_std": ("1", "bootstrap standard error of mu; in the unit of mu"),
    "epsilon_std": ("1", "bootstrap standard error of epsilon"),
    "mu_s": ("1", "sticking bound, in the unit of mu: the impulse does not change for larger mu"),
    "n_failed": ("1", "impacts for which the law has no solution"),
    "at_bound": ("", "parameters that ended at the edge of their range"),
    "train": ("1", "1: for identification, 0: held out"),
    "velocity_error": ("m/s", "error of the velocity after impact, √(δv_x² + δv_y² + (k δω)²)"),
    "impulse_error": ("N s", "distance from the measured impulse"),
    "mean": ("m/s", "mean error of the velocity after impact"),
    "mean_std": ("m/s", "standard error of the mean"),
    "median": ("m/s", "median error"),
    "quantile_90": ("m/s", "error that 90 % of the impacts do not exceed"),
    "best": ("%", "share of impacts in which the law is nearest to the measured impulse, of the six"),
    "best_std": ("%", "its standard error (Wilson's, never 0)"),
    "worst": ("%", "share of impacts in which the law is farthest from the measured impulse, of the six"),
    "worst_std": ("%", "its standard error (Wilson's, never 0)"),
    "n_train": ("1", "impacts identified from"),
    "n_held_out": ("1", "impacts judged on"),
    "tolerance": ("m/s", "impulse over mass up to which an outcome counts as within range"),
    "fraction": ("1", "share of outcomes within the law's range"),
    "fraction_std": ("1", "its standard error (Wilson's, never 0)"),
    "share": ("1", "area of the law's region over that of the admissible set, mean over impacts"),
    "share_std": ("1", "standard error of the mean"),
    "statement": (
        "",
        "what the thesis states, explained in thesis_lib/identify/statements.py",
    ),
    "unit": ("", "unit of value"),
    "std": ("as value", "standard error of value"),
    "count": ("1", "number"),
}

_FEATURES: dict[str, Meaning] = {
    "v_t": ("m/s", "tangential velocity of the contact point before impact"),
    "v_n": ("m/s", "normal velocity of the contact point before impact"),
    "omega": ("rad/s", "angular velocity before impact"),
    "r_x": ("m", "contact point ahead of the centre of mass"),
    "theta": ("rad", "body angle, within half a turn"),
}
_HELD_OUT: Meaning = ("1", "1: no choice has seen the trial, 0: for training")
_INTERVALS: dict[str, Meaning] = {
    "error": ("m/s", "mean error of the velocity after impact, held-out impacts"),
    "error_low": ("m/s", "lower end of its 95 % interval, bootstrap over trials"),
    "error_high": ("m/s", "upper end of it"),
    "gain": ("1", "held-out log score an impact gained by the effect added, nats"),
    "gain_low": ("1", "lower end of its 95 % interval, bootstrap over trials"),
    "gain_high": ("1", "upper end of it"),
}
_JUDGED: dict[str, Meaning] = {
    "floor": ("m/s", "noise floor: the error that a perfect model would show; empty if the noise is unknown"),
    "score": ("1", "held-out log score an impact (flights included), nats"),
}

_HIDDEN: dict[str, Meaning] = {  # the proof
    "source": (
        "",
        "law: the effect's own law; mechanism: compliant contact with its cause; drake: the same in Drake",
    ),
    "truth": ("", "what was hidden: an effect or a cause, two of them (a+b), or nothing"),
    "effect": ("", "effect that describes the truth best"),
    "ratio": ("1", "size of the effect: nominal misfit of the base law over the noise floor"),
    "drops": ("1", "releases in a dataset"),
    "noise": ("1", "noise of the samples, in units of the rig's (0.3 mm, 3 mrad)"),
}
_RIGHT: dict[str, Meaning] = {
    "n": ("1", "datasets"),
    "right": ("1", "share of right answers, as defined in thesis_lib/critique/proof_results.py"),
    "right_low": ("1", "lower end of its 95 % Wilson interval"),
    "right_high": ("1", "upper end of its 95 % Wilson interval"),
}
_COVERED: dict[str, Meaning] = {
    "coverage": ("1", "share of true parameters within their 95 % interval"),
    "coverage_low": ("1", "lower end of its 95 % Wilson interval"),
    "coverage_high": ("1", "upper end of its 95 % Wilson interval"),
}

_NOISE_STUDY: dict[str, Meaning] = {  # table 2.1
    "shape": ("", "body that is dropped"),
    "snr": ("dB", "signal-to-noise ratio of every channel of q and v"),
    "method": (
        "",
        "plain: eq. 2.23 on the samples; least_squares: Δω against lever at the true impact steps; arcs: maximum "
        "likelihood with free impulses; arcs_gap: with the gap at the impacts too; arcs_law: with the contact law too",
    ),
}

TABLES: dict[str, dict[str, Meaning]] = {
    "table_2_1": {
        **_NOISE_STUDY,
        "n": ("1", "drops that went into the row"),
        "n_failed": ("1", "drops whose estimate was rejected by its own tests"),
        "mean_error": ("%", "mean error of m/I"),
        "mean_error_std": ("%", "standard error of the mean"),
        "median_error": ("%", "median error of m/I"),
        "std": ("%", "standard deviation of the error over drops"),
        "bound": ("%", "Cramér-Rao bound with free impulses, root mean square over drops"),
        "law_bound": ("%", "Cramér-Rao bound with the contact law, root mean square over drops"),
        "std_over_bound": ("1", "std over bound"),
        "error_over_bound": ("1", "root mean square of error / bound of the drop: 1 if efficient"),
        "error_over_law_bound": ("1", "root mean square of error / law_bound of the drop"),
        "median_over_bound": ("1", "median of |error| / bound of the drop, over 0.6745: 1 if efficient"),
        "std_stated": ("%", "standard deviation that the estimator states, root mean square over drops"),
        "thesis": ("%", "mean error in the thesis"),
    },
    "identifiability": {
        "case": ("", "motion of a free body whose m and I are unknown"),
        "sigma_1": (
            "1",
            "larger singular value of the regressor outside the span of contact forces, scaled columns",
        ),
        "sigma_2": ("1", "smaller singular value of the same"),
        "rank": ("1", "combinations of m and I that are determined"),
        "eq_2_18_rank": ("1", "rank of the four columns of eq. 2.18; -1 where the case does not slide"),
        "not_identified": ("", "changes of the parameters that nothing observes"),
    },
    "programs": {
        "name": (
            "",
            "program of thesis 2.3.2, on SNOPT unless said otherwise; qp: mode-wise quadratic program",
        ),
        "program": ("", "equation of the thesis; soft: with the dynamics in the cost"),
        "solver": ("", "snopt, ipopt or mode_qp"),
        "products": ("", "complementarity products: relaxed step by step, or strict from the start"),
        "mechanism": ("", "what moves"),
        "n_steps": ("1", "length m of the window"),
        "n_windows": ("1", "windows"),
        "n_starts": ("1", "random starts, all windows together"),
        "n_solved": ("1", "starts whose residuals are below tolerance"),
        "n_success": ("1", "starts with parameters and forces within 1e-6 of the truth"),
        "n_claims": ("1", "starts that the solver calls a success"),
        "n_false_claims": ("1", "starts that the solver calls a success and that are none"),
        "theta_error_median": (
            "1",
            "median over starts of the largest relative parameter error; inf: no answer",
        ),
        "theta_error_max": ("1", "largest of the same"),
        "force_error_median": ("1", "median over starts of the relative rms error of the contact forces"),
        "force_error_max": ("1", "largest of the same"),
    },
    "figure_table_2_1": {
        **_NOISE_STUDY,
        "n": ("1", "drops that went into the row"),
        "mean_error": ("%", "mean error of m/I"),
        "mean_error_std": ("%", "standard error of the mean"),
        "error_over_bound": ("1", "root mean square of error / bound of the drop: 1 if efficient"),
        "thesis": ("%", "mean error in the thesis"),
    },
    "left_out_drops": {
        "shape": ("", "of the body"),
        "reason": ("", "why a drop was left out"),
        "drops": ("1", "their number"),
    },
    "table_2_1_drops": {
        **_NOISE_STUDY,
        "drop": ("1", "number of the drop"),
        "ratio": ("1/m²", "estimate of m/I"),
        "error": ("%", "its error"),
        "std": ("%", "standard deviation that the estimator states"),
        "bound": ("%", "Cramér-Rao bound of the drop with free impulses"),
        "law_bound": ("%", "Cramér-Rao bound of the drop with the contact law"),
        "status": ("", "ok, or why the drop is not to be used"),
    },
    "rerun": {
        **_HIDDEN,
        "verdict": ("", "of the critique, run again"),
        "agrees": ("1", "1 if verdict and first effect are those stored"),
    },
    "confusion": {
        **_HIDDEN,
        **_RIGHT,
        **_COVERED,
        "kind": ("", "single, nothing, pair, or outside (no effect of the library describes the cause)"),
        "group_size": ("1", "mean number of effects in the group named first; for pairs, in any group"),
        "named_first": ("", "effects named first, with their counts"),
        "verdicts": ("", "verdicts with their counts"),
        "error_before": ("m/s", "median held-out error of the base law"),
        "error_after": ("m/s", "median held-out error with the effects"),
        "floor": ("m/s", "median noise floor"),
        "before_over_floor": (
            "1",
            "median misfit of the base law over its floor, in the worst channel of the effect",
        ),
        "after_over_floor": ("1", "the same with the effects found"),
        "n_parameters": ("1", "true parameters in models that hold the hidden effect, over all datasets"),
        "z": ("1", "median distance of a parameter from the truth, in its standard errors; 0.67 is expected"),
        "width": ("1", "median standard error of a parameter over that of the Cramér-Rao bound"),
    },
    "summary": {
        "figure": ("", "what is measured; defined in thesis_lib/critique/proof_summary.py"),
        "source": ("", "sources of truth that are judged together"),
        "at_least": ("see figure", "least value that is wanted"),
        "aim": ("see figure", "value that is aimed at"),
        "measured": ("1", "share of datasets or parameters; for the error the median over datasets"),
        "low": ("1", "lower end of its 95 % interval: Wilson's for shares, of order statistics for medians"),
        "high": ("1", "upper end of it"),
        "n": ("1", "stored datasets that count"),
        "n_asked": ("1", "datasets planned; empty where the plan is not per source"),
        "met": ("", "aim, at least, missed, or not run"),
        "group_size": ("1", "mean number of effects that were named together"),
        "note": ("", "what belongs beside the figure"),
    },
    "misses": {
        **_HIDDEN,
        "seed": ("1", "of the dataset"),
        "kind": ("", "single, nothing, pair, or outside (no effect of the library describes the cause)"),
        "verdict": ("", "of the critique"),
        "named": ("", "effects named: / within a group, + between groups"),
        "why": ("", "why the dataset was refused"),
    },
    **{
        f"matrix_{source}": {
            **_HIDDEN,
            **_RIGHT,
            "column": ("", "effect named first; the verdict where none was"),
            "share": ("1", "share of the truth's datasets"),
        }
        for source in ("law", "mechanism", "drake")
    },
    "detection": {**_HIDDEN, **_RIGHT},
    "sizes": {**_HIDDEN, **_RIGHT},
    "misfits": {
        **_HIDDEN,
        "series": ("", "before: base law; after: with the effects found"),
        "n": ("1", "datasets"),
        "median": ("1", "median misfit over its floor"),
        "low": ("1", "value that 10 % of the datasets do not exceed"),
        "high": ("1", "value that 90 % of the datasets do not exceed"),
    },
    "recovery": {
        **_HIDDEN,
        **_COVERED,
        "parameter": ("", "name of the parameter"),
        "n": ("1", "datasets whose model holds the effect"),
        "width": ("1", "median standard error over that of the Cramér-Rao bound"),
        "width_low": ("1", "value that 10 % of the datasets do not exceed"),
        "width_high": ("1", "value that 90 % of the datasets do not exceed"),
    },
    "statements": {"value": ("see unit", "the statement as a number")},
    "ensemble_velocity": {
        "cost": ("m/s", "mean error of the velocity after impact, √(δv_x² + δv_y² + (k δω)²)")
    },
    "table_3_1": {
        "mu": ("1", "coefficient of friction; s/m for mirtich in the variant as_published, which is viscous"),
    },
    "published_parameters": {
        "mu": (
            "1",
            "best for all impacts after the authors' gravity step; s/m for mirtich, which is viscous",
        ),
        "epsilon": ("1", "best for all impacts after the authors' gravity step"),
    },
    "published_agreement": {
        "mu": ("1", "with which the authors' predictions were stored; s/m for Mirtich"),
        "epsilon": ("1", "with which the authors' predictions were stored"),
        "median": ("N s", "median distance between our impulses and the stored ones"),
        "quantile_95": ("N s", "distance that 95 % of the impacts do not exceed"),
    },
    "published_best_worst": {},
    "published_cost": {
        "cost_published": ("N s", "mean misfit at the parameters of table 3.1"),
        "cost_best": ("N s", "mean misfit at the best parameters for the same impacts"),
        "excess": ("1", "cost_published over cost_best, minus 1"),
    },
    "published_kept": {"drops": ("", "all, kept (without a flag), or the flag that they carry")},
    "comparison": {
        **_JUDGED,
        "model": ("", "impact law, augmented (law with the effects found), bound or baseline"),
        "kind": ("", "law, augmented, bound or baseline"),
        "mu_std": ("1", "standard error of mu from the fit"),
        "epsilon_std": ("1", "standard error of epsilon from the fit"),
        "mean": ("m/s", "mean error of the velocity after impact, held-out impacts"),
        "share_in_range": ("1", "share of held-out outcomes that some (μ, ε) of their own meets"),
        "tolerance": (
            "m/s",
            "error up to which an outcome counts as met: twice the noise floor, else 0.1 m/s",
        ),
        "n_failed": ("1", "held-out impacts for which the law has no solution"),
    },
    "errors": {
        **_FEATURES,
        "model": ("", "base: law without effects; augmented: law with the effects found"),
        "held_out": _HELD_OUT,
        "error_normal": (
            "m/s",
            "error of the contact point's velocity after impact, normal, measured − predicted",
        ),
        "error_tangential": ("m/s", "the same, tangential"),
        "error_couple": ("m/s", "couple about the contact point that the error needs, over mass and k"),
        "x": ("m", "position along the surface at impact"),
    },
    "flights": {
        "t": ("s", "middle of the flight, since the trial's first sample"),
        "span": ("s", "duration of the flight, first to last sample"),
        "model": ("", "base: law without effects; augmented: law with the effects found"),
        "held_out": _HELD_OUT,
        "residual_x": ("1", "acceleration along the surface, measured − predicted, over its noise"),
        "residual_y": ("1", "acceleration away from the surface, likewise"),
        "residual_theta": ("1", "angular acceleration, likewise"),
        "misfit": ("1", "root mean square of the three residuals; noise alone gives 1"),
        "v_x": ("m/s", "velocity along the surface, of the centre of mass at mid-flight"),
        "v_y": ("m/s", "velocity away from the surface, of the centre of mass at mid-flight"),
        "omega": ("rad/s", "angular velocity at mid-flight"),
        "theta": ("rad", "body angle at mid-flight, within half a turn"),
        "r_x": ("m", "lowest point of the body ahead of the centre of mass at mid-flight"),
        "x": ("m", "position along the surface at mid-flight"),
        "y": ("m", "height at mid-flight"),
    },
    "ladder": {
        **_JUDGED,
        **_INTERVALS,
        "step": ("1", "number of effects in the model"),
        "label": ("", "effect added at this step"),
        "flight": ("1", "misfit of the acceleration in flight, standard deviations of the noise; floor 1"),
        "meet": ("1", "misfit of the poses before and after impact, likewise"),
        "touch": ("1", "misfit of the gap at impact, likewise"),
    },
    "impacts": {
        "used": ("1", "1: used, 0: left out"),
        "held_out": _HELD_OUT,
        "reason": ("", "why the impact was left out, empty if it was used"),
        "detail": ("", "the same with numbers"),
        "flags": ("", "quality tests that failed; flagged impacts are kept"),
        "theta": ("rad", "body angle at impact"),
        "vx_pre": ("m/s", "horizontal velocity before impact"),
        "vy_pre": ("m/s", "vertical velocity before impact"),
        "omega_pre": ("rad/s", "angular velocity before impact"),
        "vx_post": ("m/s", "horizontal velocity after impact"),
        "vy_post": ("m/s", "vertical velocity after impact"),
        "omega_post": ("rad/s", "angular velocity after impact"),
        "r_x": ("m", "contact point from the body origin, along the surface"),
        "r_y": ("m", "contact point from the body origin, upwards"),
    },
    "budget": {
        "part": ("", "part of the base law's error, defined in thesis_lib/critique/tables.py"),
        "mean_square": ("(m/s)²", "its part of the mean square error of held-out impacts"),
        "share": ("1", "its share of that mean square"),
    },
    "laws": {
        **_INTERVALS,
        "gain": ("1", "held-out log score an impact less that of the law chosen, nats"),
    },
    "where": {
        **_FEATURES,
        "x": ("m", "position along the surface"),
        "t": ("s", "time since the first sample"),
        "held_out": _HELD_OUT,
        "disc_across": ("1", "measured impulse in the unit disc of the energy ellipse, against the slip"),
        "disc_along": ("1", "the same, upwards: −1 no impulse, 0 dead stop, 1 complete reversal"),
        "error_before": ("m/s", "error of the velocity after impact, law without effects"),
        "error_after": ("m/s", "the same with the effects found"),
        **{f"region_{i}": ("1", f"1: inside region {i} of where.json") for i in (1, 2, 3)},
    },
    "residuals": {
        "component": ("", "of the residual in the contact frame: normal, tangential or couple"),
        "feature": ("", "state before impact against which it is drawn"),
        "series": ("", "before: law without effects; after: with the effects found"),
        "x": ("see feature", "mean of the feature in the bin; m/s, rad/s, m, rad, s or 1"),
        "mean": ("m/s", "mean residual in the bin"),
        "std": ("m/s", "standard error of the mean"),
        "n": ("1", "impacts in the bin, training and held out"),
    },
    "parameters": {
        "label": ("", "effect added at this step"),
        "parameter": ("", "name of the parameter"),
        "value": ("see unit", "fitted value"),
        "std": ("see unit", "standard error of it"),
    },
    "data": {
        "x": ("see panel", "m in paths; else the state or reason that the panel is named after"),
        "y": ("m", "height in paths; empty in the other panels, which count"),
    },
    "compare": {
        "quantity": ("", "verdict, error (m/s) or parameter"),
        "a": ("see unit", "of the first dataset or run"),
        "a_low": ("see unit", "lower end of its 95 % interval"),
        "a_high": ("see unit", "upper end of its 95 % interval"),
        "b": ("see unit", "of the second dataset or run"),
        "b_low": ("see unit", "lower end of its 95 % interval"),
        "b_high": ("see unit", "upper end of its 95 % interval"),
        "difference": ("see unit", "second minus first"),
        "sigmas": ("1", "difference in its standard errors"),
    },
}


def explain(table: str, columns: Iterable[str]) -> pd.DataFrame:
    """Rows (table, column, unit, meaning) for the columns of the table with file stem `table`.

    Raises:
        KeyError: a column is not explained.
    """
    own = TABLES.get(table, {})
    rows, unknown = [], []
    for name in columns:
        # cov_<one>_<other>: see datasets/impacts.py
        meaning = _COVARIANCE if name.startswith("cov_") else own.get(name) or COLUMNS.get(name)
        if meaning is None:
            unknown.append(name)
        else:
            rows.append((table, name, *meaning))
    if unknown:
        raise KeyError(f"{table} has columns without unit and meaning in columns.py: {', '.join(unknown)}")
    return pd.DataFrame(rows, columns=["table", "column", "unit", "meaning"])


def write_result(table: pd.DataFrame, path: str | Path) -> None:
    """Write a table of results, all of whose columns are explained here.

    Raises:
        KeyError: a column is not explained.
    """
    explain(Path(path).stem, table.columns)
    write_table(table, path)


def column_dictionary(paths: Iterable[str | Path]) -> pd.DataFrame:
    """The explanations of all columns in the given CSV files, one set of rows a kind of table."""
    parts = {}
    for path in sorted(map(Path, paths)):
        parts[path.stem] = explain(path.stem, pd.read_csv(path, nrows=0).columns)
    return pd.concat([parts[name] for name in sorted(parts)], ignore_index=True)
