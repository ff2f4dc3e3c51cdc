"""All pictures of the proof, and its confusion matrix of the hidden effect against the effect named first.

A row is a truth; a column is an effect or, if none was named, the verdict.  Rows are ordered by the effects that
describe them, like the columns; right answers therefore lie on the diagonal.  The cell of the effect that describes a
truth best is framed.  The share at the right margin counts all right verdicts: also truths elsewhere in the group named
first, both effects of a pair, and `adequate` or `unexplained`.
"""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

from thesis_lib.effects import EFFECTS, effects_in
from thesis_lib.effects.effect import FAMILIES
from thesis_lib.figures.critique.errors import set_title
from thesis_lib.figures.style import DARK, GREY, INK, SHADES, WIDTH, Drawn, house_style, new_figure
from thesis_lib.mechanics.space import PLANE
from thesis_lib.studies.figures import curves
from thesis_lib.studies.figures.curves import SOURCE_TITLE, draw_real_contacts, not_run, words
from thesis_lib.studies.proof.by_contact import by_contact
from thesis_lib.studies.proof.results import of_table, usual

NAMES = (*(f"matrix_{source}" for source in SOURCE_TITLE), "detection", "sizes", "misfits", "recovery", "real_contacts")
UNNAMED = {"adequate": "adequate", "unexplained": "unexplained, none named", "refused": "refused"}
CHARACTER = 0.047  # inches, width of a character in the rows' labels
FRAME = 2.5  # inches above and below the cells, for title, families and labels of the columns


def pictures(outcomes: pd.DataFrame, recovered: pd.DataFrame) -> dict[str, Drawn]:
    """Figures with the tables of the plotted numbers, by the names in `NAMES`.

    `outcomes` (a row for each dataset) and `recovered` (a row for each parameter) come from `studies.proof.results`;
    the figures show the first table of the proof, with contacts of 20 µs, and `real_contacts` shows all other results.
    """
    contacts = draw_real_contacts(by_contact(outcomes, recovered))
    outcomes, recovered = (table[table["source"].isin(SOURCE_TITLE)] for table in (outcomes, recovered))
    outcomes, recovered = usual(outcomes), usual(recovered)
    table = of_table(outcomes)
    drawn = {f"matrix_{source}": draw_matrix(table, source) for source in SOURCE_TITLE}
    drawn["detection"] = curves.draw_detection(outcomes)
    drawn["sizes"] = curves.draw_sizes(outcomes)
    drawn["misfits"] = curves.draw_misfits(table)
    drawn["recovery"] = curves.draw_parameters(of_table(recovered))
    drawn["real_contacts"] = contacts
    return drawn


@house_style
def draw_matrix(outcomes: pd.DataFrame, source: str) -> Drawn:
    """Confusion matrix of one source: shares (truths × effects and verdicts).

    `outcomes`: rows of one size, drops and noise; columns as in `studies.proof.results.outcomes`.
    """
    rows = outcomes[outcomes["source"] == source].copy()
    rows["column"] = np.where(rows["named_first"] != "", rows["named_first"], rows["verdict"])
    columns = [*effects_in(PLANE), *UNNAMED]
    truths = _ordered(rows)
    counts = rows.groupby(["truth", "column"]).size().unstack(fill_value=0)
    shares = counts if len(rows) else pd.DataFrame(columns=columns)
    # effects that have been removed from the library stay in the picture
    columns += [name for name in shares.columns if name not in columns]
    shares = shares.reindex(index=truths["truth"], columns=columns, fill_value=0)
    shares = shares.div(shares.sum(axis=1), axis=0)
    # cells are square, as wide as the row labels permit
    longest = max((len(part) for name in truths["truth"] for part in name.split("+")), default=0)
    cell = (WIDTH - CHARACTER * longest) / (len(columns) + 2.0)
    figure = new_figure(height=FRAME + cell * len(truths))
    if truths.empty:
        not_run(figure, SOURCE_TITLE[source], shares)
    else:
        ax = figure.add_subplot()
        _draw(ax, shares, truths)
        set_title(figure, f"Effect named first for each hidden effect, % of datasets: {SOURCE_TITLE[source]}")
    table = shares.stack().rename("share").rename_axis(["truth", "column"]).reset_index()
    table = table.merge(truths[["truth", "n", "right"]], on="truth") if len(table) else table.assign(n=0, right=0)
    table.insert(0, "source", source)
    return figure, table[["source", "truth", "column", "share", "n", "right"]]


def _ordered(outcomes: pd.DataFrame) -> pd.DataFrame:
    """A row for each truth: truth, kind, effect, n, right; single effects in order, then nothing, outside, pairs."""
    groups = outcomes.groupby(["kind", "truth", "effect"], as_index=False)
    rows = groups.agg(n=("right", "size"), right=("right", "mean"))
    rows["place"] = rows["effect"].map({name: i for i, name in enumerate(EFFECTS)}).fillna(-1)
    rows["order"] = rows["kind"].map(["single", "nothing", "outside", "pair"].index)
    return rows.sort_values(["order", "place", "truth"], ignore_index=True)


def _draw(ax: Axes, shares: pd.DataFrame, truths: pd.DataFrame) -> None:
    values = shares.to_numpy(float)
    m, n = values.shape
    ax.imshow(values, cmap=SHADES, vmin=0.0, vmax=1.0, aspect="equal", interpolation="none")
    for i, j in np.argwhere(values > 0.0):
        text = f"{100 * values[i, j]:.0f}" if values[i, j] >= 0.01 else "<1"
        color = "white" if values[i, j] > DARK else INK
        ax.text(j, i, text, ha="center", va="center_baseline", fontsize=4.6, color=color)
    ax.set_xlim(-0.5, n + 1.6)
    for i, row in truths.iterrows():
        if row["effect"] in shares.columns:
            j = shares.columns.get_loc(row["effect"])
            ax.add_patch(Rectangle((j - 0.5, i - 0.5), 1, 1, fill=False, edgecolor=INK, linewidth=0.7))
        ax.text(n + 1.4, i, f"{100 * row['right']:.0f}", ha="right", va="center_baseline", fontsize=5.5, color=INK)
    ax.text(n + 1.4, -0.9, "right (%)", ha="right", va="bottom", fontsize=6, rotation=90)
    ax.set_xticks(range(n), [UNNAMED.get(name, name).replace("_", " ") for name in shares.columns])
    ax.set_yticks(range(m), [name.replace("_", " ").replace("+", " +\n") for name in truths["truth"]])
    ax.tick_params(axis="x", labelrotation=90, labelsize=5.5, length=0, pad=1.5)
    ax.tick_params(axis="y", labelsize=5.5, length=0, pad=1.5)
    for label, kind in zip(ax.get_yticklabels(), truths["kind"]):
        if kind == "pair":  # two lines in one cell
            label.set(fontsize=4.4, linespacing=0.95)
    ax.spines[:].set_visible(False)
    _families(ax, shares, truths)


def _families(ax: Axes, shares: pd.DataFrame, truths: pd.DataFrame) -> None:
    """Draw lines between families of effects, and their names above the columns."""
    m, n = shares.shape
    family = [EFFECTS[name].family if name in EFFECTS else "" for name in shares.columns]
    rows = [EFFECTS[e].family if e in EFFECTS else k for e, k in zip(truths["effect"], truths["kind"])]
    style = {"color": GREY, "linewidth": 0.4, "clip_on": False}
    for j in range(1, n):
        if family[j] != family[j - 1]:
            ax.plot([j - 0.5, j - 0.5], [-0.5, m - 0.5], **style)
    for i in range(1, m):
        if rows[i] != rows[i - 1]:
            ax.plot([-0.5, n - 0.5], [i - 0.5, i - 0.5], **style)
    ax.add_patch(Rectangle((-0.5, -0.5), n, m, fill=False, edgecolor=GREY, linewidth=0.4, clip_on=False))
    for name in FAMILIES:
        at = [j for j, other in enumerate(family) if other == name]
        if at:
            turn = {"ha": "left", "rotation": 35} if len(at) < 3 else {"ha": "center", "rotation": 0}
            look = {"va": "bottom", "fontsize": 6, "color": INK, "rotation_mode": "anchor"}
            ax.text(np.mean(at), -0.8, words(name), **turn, **look)
