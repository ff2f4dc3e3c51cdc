"""Figure 3-11: two single impacts with unusual parameters (`shown_impacts`), each drawn in its energy ellipse."""

import numpy as np
import pandas as pd

from thesis_lib.contact import LAWS
from thesis_lib.datasets.format.impacts import Impacts
from thesis_lib.figures.chapter3.contact_space import draw_ellipse, draw_region, region_outline
from thesis_lib.figures.style import INK, Drawn, ImpulseAxis, house_style, new_figure
from thesis_lib.impact_study.cost import target_of
from thesis_lib.impact_study.shown_impacts import spin_reversal_case, zero_friction_case

MARKS = {  # series: marker, size, colour, filled
    "measured impulse": ("X", 7, INK, True),
    "best of this impact": ("o", 6, "#D55E00", False),
    "ensemble prediction": ("s", 5, "#0072B2", False),
}


@house_style
def figure_3_11(
    impacts: Impacts, individual: pd.DataFrame, ensemble: pd.DataFrame, law: str, *, mass_known: bool
) -> Drawn:
    """Both impacts: ellipse, region of `law`, measured impulse, the law's best impulse and its ensemble prediction.

    Args:
        impacts: all impacts studied.
        individual: trial, impact, law, mu, epsilon, misfit (N s) of one weighting.
        ensemble: law, mu, epsilon of the same weighting.
        law: the law shown (AP Newton in the thesis).
        mass_known: whether impulses are in N s or in N s/kg.

    Raises:
        UserError: no impact qualifies.
    """
    unit = ImpulseAxis.of(mass_known)
    target = target_of(impacts)
    keys = pd.MultiIndex.from_arrays([impacts.trial, impacts.impact])
    parameters = individual[individual["law"] == law].set_index(["trial", "impact"]).reindex(keys)
    mu, epsilon, misfit = (parameters[name].to_numpy(float) for name in ("mu", "epsilon", "misfit"))
    fit = ensemble[ensemble["law"] == law].iloc[0]
    cases = {
        "a": (zero_friction_case(impacts, mu, misfit), r"$\mu = 0$"),
        "b": (spin_reversal_case(target), "spin reversal"),
    }
    figure = new_figure(height=4.3, layout="compressed")
    axes = figure.subplots(1, 2)
    parts = []
    for ax, (letter, (row, title)) in zip(axes, cases.items()):
        space = target.space[np.array([row])]
        part = [draw_ellipse(ax, space, unit, labels=True)]
        outline = region_outline(LAWS[law], space)
        draw_region(ax, LAWS[law], outline, unit, f"region of {LAWS[law].title}")
        part.append(pd.DataFrame(outline, columns=["c_t", "c_n"]).assign(series="region"))
        best = LAWS[law].impulse(space, mu[[row]], epsilon[[row]])
        predicted = LAWS[law].impulse(space, np.array([fit["mu"]]), np.array([fit["epsilon"]]))
        points = ((target.c_t[row], target.c_n[row]), best, predicted)
        for (name, (marker, size, color, filled)), point in zip(MARKS.items(), points):
            c_t, c_n = (float(np.squeeze(value)) for value in point)
            ax.plot(
                unit.factor * c_t,
                unit.factor * c_n,
                marker,
                markersize=size,
                color=color,
                markerfacecolor=color if filled else "none",
                markeredgewidth=0.6 if filled else 1.3,
                label=name,
                clip_on=False,
            )
            part.append(pd.DataFrame({"series": [name], "c_t": [c_t], "c_n": [c_n]}))
        ax.set(
            title=f"({letter}) {title}: trial {impacts.trial[row]}, impact {impacts.impact[row]}",
            xlabel=f"tangential impulse $c_t$ ({unit.unit})",
        )
        parts.append(pd.concat(part).assign(panel=letter, trial=impacts.trial[row], impact=impacts.impact[row]))
    axes[0].set_ylabel(f"normal impulse $c_n$ ({unit.unit})")
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3)
    table = pd.concat(parts, ignore_index=True)
    return figure, table[["panel", "trial", "impact", "series", "c_t", "c_n"]]
