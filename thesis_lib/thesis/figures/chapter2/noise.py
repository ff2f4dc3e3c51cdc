"""Figure of table 2.1: error of m/I against the noise, by method."""

import numpy as np
import pandas as pd

from thesis_lib.figures.style import BLUE, GREEN, GREY, INK, RED, VIOLET, Drawn, house_style, new_figure

METHODS = {  # color, marker, label
    "plain": (GREY, "s", "plain program, eq. 2.23"),
    "least_squares": (VIOLET, "v", "least squares at true impacts"),
    "arcs": (BLUE, "o", "arcs, free impulses"),
    "arcs_gap": (GREEN, "^", "arcs, with gaps"),
    "arcs_law": (RED, "D", "arcs, with contact law"),
}
LINEAR = 0.1  # %; below this size the axis of the bias, which has both signs, is linear
APART = 0.5  # dB, offset between the methods at one noise level


@house_style
def figure_table_2_1(table: pd.DataFrame) -> Drawn:
    """Mean error of m/I, ± 2 standard errors (above), and error over the bound without contact law (below).

    `table`: as returned by `identify.mass_ratio.table_2_1`, by method and noise.
    """
    shapes = list(dict.fromkeys(table["shape"]))
    figure = new_figure(height=4.6)
    axes = figure.subplots(2, len(shapes), sharex=True, sharey="row", squeeze=False)
    for column, shape in enumerate(shapes):
        above, below = axes[:, column]
        errors = table[table["shape"] == shape]
        for i, (method, (color, marker, label)) in enumerate(METHODS.items()):
            rows = errors[errors["method"] == method].sort_values("snr")
            snr = rows["snr"] + APART * (i - 2.0)
            style = {"color": color, "marker": marker, "ms": 4, "lw": 0.9, "capsize": 2}
            above.errorbar(snr, rows["mean_error"], 2.0 * rows["mean_error_std"], label=label, **style)
            relative = 1.0 / np.sqrt(2.0 * rows["n"])  # standard error of an rms of n normal errors
            over = rows["error_over_bound"]
            below.errorbar(snr, over, 2.0 * relative * over, label=label, **style)
        thesis = errors[errors["method"] == "plain"].sort_values("snr")
        above.plot(thesis["snr"], thesis["thesis"], "x", color=INK, ms=6, label="thesis")
        above.axhline(0.0, color=INK, lw=0.6)
        above.set_title(shape)
        above.set_yscale("symlog", linthresh=LINEAR)
        below.axhline(1.0, color=INK, lw=0.8, ls="--")
        below.text(
            0.98, 1.4, "Cramér-Rao bound", ha="right", va="bottom", transform=below.get_yaxis_transform(), fontsize=7
        )
        below.set(yscale="log", xlabel="signal-to-noise ratio (dB)")
        below.set_xticks(sorted(errors["snr"].unique()))
        below.minorticks_off()
    axes[0, 0].set_ylabel("mean error of $m/I$ (%)")
    axes[1, 0].set_ylabel("error over bound")
    axes[0, 0].invert_xaxis()
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncol=3)
    columns = ["shape", "method", "snr", "n", "mean_error", "mean_error_std", "error_over_bound", "thesis"]
    return figure, table[table["method"].isin(METHODS)][columns].reset_index(drop=True)
