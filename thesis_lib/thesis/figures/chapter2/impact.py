"""Figure 2-15, the force at one impact, and the figure of m/I (1/m²) from measured impacts.

Normal forces in N: `force` (s,) on the body in Drake, `reading` (p,) of the sensor at 1000 Hz, and the half-sine of the
estimated impulse over the declared duration.  Equations and sources: `thesis_lib.thesis.identify.impacts.forces`,
`thesis_lib.thesis.identify.impacts.measured_ratio`.
"""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from thesis_lib.bodies.shapes import Ellipse
from thesis_lib.figures.planar_drawing import turned
from thesis_lib.figures.style import BLUE, GREEN, GREY, INK, RED, Drawn, house_style, new_figure
from thesis_lib.statistics.intervals import Z95
from thesis_lib.thesis.identify.impacts.forces import ForceHistory, ImpactForces, peak_force

APPROACH = 7  # number of samples drawn before the hit
BEFORE, AFTER = 1e-3, 15e-3  # s drawn before and after the touch
THIN = 20  # steps between drawn points of the sensor's continuous response: 0.1 ms
BINS, BINS_TO = 16, 4.0  # bins of errors over σ and their range; larger errors are in the last bin
NAMES = {
    "as_published": "as published",
    "mirrored_rotation": "rotation mirrored",
    "angle_offset": "angle offset",
    "rounded_corners": "rounded corners",
    "earlier_vy_post": r"earlier $v_y^+$",
}


@house_style
def figure_2_15(
    row: pd.Series, history: ForceHistory, samples: pd.DataFrame, rows: pd.DataFrame, settings: ImpactForces
) -> Drawn:
    """Figure 2-15: an ellipse before an impact, the force at that impact, and the errors of all impulses.

    `row`, `history`: the impact shown and its force, as returned by `shown_impact`; `samples`: trial, t, x, y, theta,
    as tracked; `rows`: all impacts, from `study_impact_forces`.
    """
    figure = new_figure(height=2.6)
    left, middle, right = figure.subplots(1, 3, width_ratios=(0.8, 1.3, 1.1))
    parts = [
        _approach(left, row, samples, settings),
        _forces(middle, row, history, settings),
        _impulse_errors(right, rows[rows["method"] == row["method"]]),
    ]
    left.set_title("(a) samples")
    middle.set_title("(b) force")
    right.set_title(f"(c) {len(rows) // rows['method'].nunique()} impulses")
    return figure, pd.concat(parts)[["panel", "series", "t", "x", "y", "force", "z", "density"]]


def _approach(ax: Axes, row: pd.Series, samples: pd.DataFrame, settings: ImpactForces) -> pd.DataFrame:
    approach = samples[(samples["trial"] == row["trial"]) & (samples["t"] <= row["t"])].tail(APPROACH)
    outline, out = Ellipse(semi_axes=settings.semi_axes).outline(), []
    for i, sample in enumerate(approach.itertuples()):
        x, y = (turned(outline, sample.theta) + [sample.x, sample.y]).T
        ax.plot(1e3 * x, 1e3 * y, color=INK if i == len(approach) - 1 else GREY, linewidth=0.8)
        out.append(pd.DataFrame({"t": sample.t - row["t"], "x": x, "y": y}))
    ax.axhline(0.0, color=INK, linewidth=1.2)
    ax.set_aspect("equal", adjustable="datalim")
    ax.set(xlabel="$x$ (mm)", ylabel="$y$ (mm)")
    return pd.concat(out).assign(panel="a", series="outline")


def _forces(ax: Axes, row: pd.Series, history: ForceHistory, settings: ImpactForces) -> pd.DataFrame:
    t, force = np.append(history.t, settings.sensor_window), np.append(history.force[:, 1], 0.0)
    T = settings.declared_duration
    start = 0.5 * (history.t[-1] - T)  # the estimate has no instant, so it is centred on the contact
    tau = np.linspace(0.0, T, 101)
    peaks = [peak_force(row["c_n"] + s * row["c_n_std"], T) for s in (-Z95, 0.0, Z95)]
    low, half_sine, high = (peak * np.sin(np.pi * tau / T) for peak in peaks)
    ax.plot(1e3 * t, force, color=INK, label="contact force (Drake)")
    response_t, response = history.response_t[::THIN], history.response[::THIN]
    ax.plot(1e3 * response_t, response, color=RED, linewidth=0.6, alpha=0.8)
    ax.plot(1e3 * history.sensor_t, history.reading, "o", color=RED, label="sensor, 1000 Hz")
    ax.plot(1e3 * (start + tau), half_sine, color=BLUE, linestyle=(0, (4, 1.5)), label="estimate, $T_c$ declared")
    ax.fill_between(1e3 * (start + tau), low, high, color=BLUE, alpha=0.25, linewidth=0)
    ax.set_xlim(-1e3 * BEFORE, 1e3 * AFTER)
    top = max(force.max(), response.max(), peaks[2])
    ax.set_ylim(1.1 * response.min(), 1.75 * top)
    ax.axhline(0.0, color=GREY, linewidth=0.5, zorder=0)
    ax.set(xlabel="time since touch (ms)", ylabel="normal force (N)")
    ax.legend(loc="upper right")
    parts = {
        "contact_force": (t, force),
        "sensor": (history.sensor_t, history.reading),
        "sensor_continuous": (response_t, response),
        "estimate": (start + tau, half_sine),
        "estimate_low": (start + tau, low),
        "estimate_high": (start + tau, high),
    }
    frames = [pd.DataFrame({"series": name, "t": a, "force": b}) for name, (a, b) in parts.items()]
    return pd.concat(frames).assign(panel="b")


def _impulse_errors(ax: Axes, rows: pd.DataFrame) -> pd.DataFrame:
    edges = np.linspace(-BINS_TO, BINS_TO, BINS + 1)
    z, out = 0.5 * (edges[1:] + edges[:-1]), []
    for name, color, label in (("c_n", BLUE, "normal"), ("c_t", GREEN, "tangential")):
        scaled = (rows[name] - rows[f"true_{name}"]) / rows[f"{name}_std"]
        density = np.histogram(np.clip(scaled, -BINS_TO, BINS_TO), edges)[0] / (len(rows) * (edges[1] - edges[0]))
        ax.stairs(density, edges, color=color, label=label)
        out.append(pd.DataFrame({"series": label, "z": z, "density": density}))
    fine = np.linspace(-BINS_TO, BINS_TO, 161)
    normal = np.exp(-0.5 * fine**2) / np.sqrt(2.0 * np.pi)
    ax.plot(fine, normal, color=INK, linewidth=0.8, linestyle=(0, (4, 1.5)), label="N(0, 1)")
    out.append(pd.DataFrame({"series": "N(0, 1)", "z": fine, "density": normal}))
    ax.set(xlabel="error of impulse / its stated $\\sigma$", ylabel="density", ylim=(0.0, 1.35 * ax.get_ylim()[1]))
    ax.legend(loc="upper left")
    return pd.concat(out).assign(panel="c")


@house_style
def figure_measured_ratio(table: pd.DataFrame) -> Drawn:
    """Figure of m/I of one dataset, with intervals, for each hypothesis about the measurement, and the authors' value.

    At the right: deviation from a rigid impact, over the noise (`misfit_unit` sigma) or, if the noise is unknown, as
    a velocity (m/s).  `table`: rows of `measured_ratio`.
    """
    has_noise = table["scale"].notna()
    table = table.assign(
        misfit=table["scale"].fillna(table["velocity_noise"]), misfit_unit=np.where(has_noise, "sigma", "m/s")
    )
    figure = new_figure(height=1.0 + 0.27 * len(table))
    ax, y = figure.subplots(), np.arange(len(table))[::-1]
    ax.hlines(y, table["lower"], table["upper"], color=BLUE, alpha=0.3, linewidth=5, label="any ratio of noises")
    errors = np.abs(table[["low", "high"]].to_numpy().T - table["ratio"].to_numpy())
    ax.errorbar(table["ratio"], y, xerr=errors, fmt="o", color=BLUE, capsize=2, label="estimate, 95 %")
    ax.axvline(table["published"].iloc[0], color=RED, linestyle=(0, (4, 1.5)), label="1/k² of the header")
    labels = [" + ".join(NAMES[part] for part in variant.split("+")) for variant in table["variant"]]
    ax.set_yticks(y, labels)
    ax.set(ylim=(-0.7, len(table) - 0.3), xlabel="m/I (1/m²)")
    for height, misfit, unit in zip(y, table["misfit"], table["misfit_unit"]):
        text = rf"misfit {misfit:.1f} $\sigma$" if unit == "sigma" else rf"$\sigma_v$ {misfit:.2g} m/s"
        ax.annotate(text, (1.01, height), xycoords=("axes fraction", "data"), va="center", fontsize=7)
    figure.legend(*ax.get_legend_handles_labels(), loc="outside upper center", ncols=3)
    return figure, table[
        ["variant", "ratio", "std", "low", "high", "published", "lower", "upper", "misfit", "misfit_unit"]
    ]
