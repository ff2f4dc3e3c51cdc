"""Table 2.1 as a figure: bias and error of m/I against the noise, per method, beside the Cramér-Rao bound."""

import numpy as np
import pandas as pd

from thesis_lib.figures.style import GREY, INK, Drawn, house_style, new_figure

METHODS = {  # colour, marker, label
    "plain": (GREY, "s", "plain program, eq. 2.23"),
    "least_squares": ("#CC79A7", "v", "least squares at true impacts"),
    "arcs": ("#0072B2", "o", "arcs, free impulses"),
    "arcs_gap": ("#009E73", "^", "arcs, with gaps"),
    "arcs_law": ("#D55E00", "D", "arcs, with contact law"),
}
LINEAR = 0.1  # %; the axis of the bias is linear below this size, because the bias has both signs
_OFFSET = 0.5  # dB, between the methods of one noise level


@house_style
def figure_table_2_1(table: pd.DataFrame) -> Drawn:
    """Mean error with its standard error (above), and error over the bound without contact law (below).

    `table`: as `identify.table_2_1.table_2_1` returns it.
    """
    shapes = list(dict.fromkeys(table["shape"]))
    figure = new_figure(height=4.6)
    axes = figure.subplots(2, len(shapes), sharex=True, sharey="row", squeeze=False)
    for column, shape in enumerate(shapes):
        above, below = axes[:, column]
        errors = table[table["shape"] == shape]
        for i, (method, (colour, marker, label)) in enumerate(METHODS.items()):
            rows = errors[errors["method"] == method].sort_values("snr")
            snr = rows["snr"] + _OFFSET * (i - 2.0)
            style = {"color": colour, "marker": marker, "ms": 4, "lw": 0.9, "capsize": 2}
            above.errorbar(snr, rows["mean_error"], 2.0 * rows["mean_error_std"], label=label, **style)
            relative = 1.0 / np.sqrt(2.0 * rows["n"])  # of the root mean square of n normal errors
            below.errorbar(
                snr, rows["error_over_bound"], 2.0 * relative * rows["error_over_bound"], label=label, **style
            )
        thesis = errors[errors["method"] == "plain"].sort_values("snr")
        above.plot(thesis["snr"], thesis["thesis"], "x", color=INK, ms=6, label="thesis")
        above.axhline(0.0, color=INK, lw=0.6)
        above.set_title(shape)
        above.set_yscale("symlog", linthresh=LINEAR)
        below.axhline(1.0, color=INK, lw=0.8, ls="--")
        below.text(0.98, 1.4, "Cramér-Rao bound", ha="right", va="bottom", transform=_at(below), fontsize=7)
        below.set(yscale="log", xlabel="signal-to-noise ratio (dB)")
        below.set_xticks(sorted(errors["snr"].unique()))
        below.minorticks_off()
    axes[0, 0].set_ylabel("mean error of $m/I$ (%)")
    axes[1, 0].set_ylabel("error over bound")
    axes[0, 0].invert_xaxis()
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncol=3)
    columns = ["shape", "method", "snr", "n", "mean_error", "mean_error_std", "error_over_bound", "thesis"]
    return figure, table[table["method"].isin(METHODS)][columns].reset_index(drop=True)


def _at(axes):
    """Transform with x in axes' fraction and y in data."""
    return axes.get_yaxis_transform()
