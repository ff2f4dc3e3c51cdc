"""The pictures of the reference pages: signatures of the effects and reachable impulses of the laws.

signatures.csv holds some of the plotted numbers; outdated pictures are detected by them, not by their pixels.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from thesis_lib.contact import LAWS, Law
from thesis_lib.effects import EFFECTS, Effect, effects_in
from thesis_lib.figures.style import GREY, INK, ImpulseAxis, house_style, new_figure
from thesis_lib.foundation.files import atomic, write_table
from thesis_lib.mechanics.space import PLANE
from thesis_lib.studies.docs.signatures import signature, sizes_text
from thesis_lib.studies.figures.curves import draw_next_drops
from thesis_lib.studies.proof.next_drops import read_answers

DPI = 110  # 600 to 700 pixels wide, below 60 kB
LOOKS = ({"color": "#0072B2"}, {"color": "#D55E00", "linestyle": (0, (5, 1.5))}, {"color": "0.2", "linestyle": ":"})
AXES = {
    "theta": "body angle θ (rad)",
    "omega": "ω before impact (rad/s)",
    "x": "position x (m)",
    "t": "time t (s)",
    "trial": "number of the release",
    "v_t": "$v_x$ (m/s)",
    "v_n": "$v_y$ (m/s)",
}
WHAT = {
    "curve": ("Δ velocity after impact (m/s)", 1.0),
    "flight": ("Δ acceleration (m/s²)", 1.0),
    "path": ("Δ path (mm)", 1e3),
    "slide": ("Δ acceleration in a slide (m/s²)", 1.0),
    "gap": ("Δ gap (mm)", 1e3),
}
KEPT_EVERY = 97  # every 97th number is stored; coprime to the grid sizes, so that all rows and columns occur


def draw_pictures(folder: Path) -> Iterator[Path]:
    """Draw all pictures into `folder`, `folder`/effects and `folder`/laws; yield the files."""
    tables = {effect.name: signature(effect) for effect in effects_in(PLANE).values()}
    for name, table in tables.items():
        yield _save(draw_signature(EFFECTS[name], table), folder / "effects" / f"{name}.png")
    for law in LAWS.values():
        if not law.as_published:
            yield _save(draw_reach(law), folder / "laws" / f"{law.name}.png")
    yield _save(draw_next_drops(read_answers())[0], folder / "next_experiment.png")
    write_table(kept_numbers(tables), folder / "effects" / "signatures.csv")
    yield folder / "effects" / "signatures.csv"


def kept_numbers(tables: dict[str, pd.DataFrame]) -> pd.DataFrame:
    """The numbers that are stored beside the pictures, every `KEPT_EVERY`-th row of each table."""
    kept = pd.concat([table.iloc[::KEPT_EVERY] for table in tables.values()], ignore_index=True)
    numbers = ["at", "at_n", "value"]
    return kept.assign(**{name: [float(f"{x:.5g}") for x in kept[name]] for name in numbers})


@house_style
def draw_signature(effect: Effect, table: pd.DataFrame) -> Figure:
    """Draw the picture of one effect."""
    panels = list(dict.fromkeys(table["panel"]))
    figure = new_figure(5.6 if len(panels) > 1 else 3.2, 2.2)
    figure.suptitle(f"{effect.title}: {sizes_text(effect)}", fontsize=8, x=0.01, ha="left")
    for ax, panel in zip(np.atleast_1d(figure.subplots(1, len(panels))), panels):
        rows = table[table["panel"] == panel]
        if panel == "plane":
            _draw_plane(figure, ax, rows)
        else:
            _draw_curve(ax, rows, *WHAT[panel])
    return figure


def _draw_plane(figure: Figure, ax: Axes, rows: pd.DataFrame) -> None:
    grids = {name: part.pivot(index="at_n", columns="at", values="value") for name, part in rows.groupby("series")}
    size, v_x, v_y = grids["size"], grids["v_x"], grids["v_y"]
    ends = (size.columns[0], size.columns[-1], size.index[0], size.index[-1])
    image = ax.imshow(size, origin="lower", extent=ends, aspect="auto", cmap="Blues", vmin=0.0)
    figure.colorbar(image, ax=ax, label="|Δv| after impact (m/s)")
    each = (slice(2, None, 5), slice(2, None, 6))
    ax.quiver(v_x.columns[each[1]], v_x.index[each[0]], v_x.iloc[each], v_y.iloc[each], color=INK, width=0.006)
    ax.set(xlabel="contact velocity $v_t$ (m/s)", ylabel="$v_n$ (m/s)")


def _draw_curve(ax: Axes, rows: pd.DataFrame, label: str, factor: float) -> None:
    ax.axhline(0.0, color=GREY, linewidth=0.6)
    for look, (name, part) in zip(LOOKS, rows.groupby("series", sort=False)):
        ax.plot(part["at"], factor * part["value"], label=f"${name}$", **look)
    over = rows["over"].iloc[0]
    at_impact = over == "v_n" and rows["panel"].iloc[0] == "gap"
    ax.set(xlabel="$v_n$ before impact (m/s)" if at_impact else AXES[over], ylabel=label)
    if rows["series"].nunique() > 1:
        ax.legend()


@house_style
def draw_reach(law: Law) -> Figure:
    """Draw the region of impulses that a law can give in one impact of the ellipse, with the energy ellipse."""
    from thesis_lib.simulate.rig.hidden_causes import ELLIPSE_BODY
    from thesis_lib.thesis.figures.chapter3.contact_space import EXAMPLE, draw_ellipse, region_outline

    space, unit = EXAMPLE.space(ELLIPSE_BODY), ImpulseAxis.of(ELLIPSE_BODY.mass is not None)
    figure = new_figure(4.6, 2.6)
    ax = figure.add_subplot()
    draw_ellipse(ax, space, unit, labels=True)
    published = LAWS.get(f"{law.name}_as_published")
    for variant, look in zip((law, published) if published else (law,), LOOKS):
        outline = unit.factor * region_outline(variant, space)
        ax.plot(*outline.T, **look, label="as published" if variant is published else law.title)
        ax.set_ylim(top=max(ax.get_ylim()[1], 1.03 * float(outline[:, 1].max())))
    unit.label(ax)
    figure.legend(loc="outside right upper")
    return figure


def _save(figure: Figure, path: Path) -> Path:
    with atomic(path) as tmp:
        house_style(figure.savefig)(tmp, dpi=DPI, metadata={"Software": None})
    return path
