"""The map of single impacts in report.html: pointer or keyboard selects an impact and shows its energy ellipse.

impacts.html draws the map as SVG; in the browser, thesis_lib/pages/impacts.js draws the ellipse of the chosen impact
from numbers that the page contains as JSON.

| on paper         | in the JSON               | unit              | |
|------------------|---------------------------|-------------------|-------------------------------------------------|
| −M_C v_C         | `centre`                  | `unit`            | centre of the ellipse: impulse of a dead stop   |
| ellipse at α = 1 | `axes`, `angle`           | `unit`, degrees   | semi-axes; angle of the major axis from t to n  |
| v_t⁺ = 0, v_n⁺ = 0 | `sticking`, `compression` | degrees         | directions of the two lines through the centre  |
| c = (c_t, c_n)   | `measured`, `base`, `final` | `unit`          | point impulse nearest to each velocity change   |
|                  | `choices`                 | m/s               | errors with each choice of effects              |
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib
import numpy as np
from markupsafe import Markup
from matplotlib.colors import to_hex
from matplotlib.ticker import MaxNLocator

from thesis_lib.contact.space import contact_space, energy_ellipse, measured_impulse, velocity_error
from thesis_lib.critique.drops.criticise import DropsCritique
from thesis_lib.critique.drops.features import features
from thesis_lib.critique.drops.questions.class_tests import velocities
from thesis_lib.critique.likelihood.fit import Fit
from thesis_lib.critique.proposal.effect_file import capital
from thesis_lib.critique.results.candidates import Choice
from thesis_lib.critique.results.titles import effect_title, law_title, plain
from thesis_lib.figures.critique.where import axis_label, map_axes, top_of
from thesis_lib.figures.style import ImpulseAxis
from thesis_lib.pages import render
from thesis_lib.report.elements import percent
from thesis_lib.statistics.intervals import clustered_mean
from thesis_lib.statistics.wording import number

TEMPLATE = Path(__file__).with_name("impacts.html")
MOST = 2000  # impacts drawn: the page stays below 2 MB, and points can still be distinguished
WORST = 0.1  # share of impacts with the largest errors, whose share of all errors is reported
EDGE = 0.005  # quantile at which the map ends; points beyond are drawn on its edge
WIDTH, HEIGHT, LEFT, TOP, BOTTOM, MARGIN = 420, 380, 66, 34, 46, 12  # of the map
SMALL, LARGE = 2.0, 7.0  # radius of a point without error, and of a point at the end of the scale
COLORS = matplotlib.colormaps["cividis_r"]
SHADES = 32  # number of these colours in the script


def explorer(critique: DropsCritique, where: Mapping, choices: Sequence[Choice] = ()) -> Markup:
    """Return the map of impacts with the panel for an energy ellipse; empty without predictions, and in space.

    With `choices` the reader can switch effects on and off, and sees the remaining errors.
    """
    if not critique.space.is_plane:
        return Markup()
    o, base, final = critique.observations.single, critique.ladder[0][1], critique.ladder[-1][1]
    residuals = {"base": base.on(o).velocity_left}
    if len(critique.ladder) > 1:
        residuals["final"] = final.on(o).velocity_left
    errors = {name: velocity_error(R, o.rig.k_told) for name, R in residuals.items()}
    known = np.flatnonzero(np.all([np.isfinite(e) for e in errors.values()], axis=0))
    if not len(known):
        return Markup()
    shown = drawn_impacts(errors["base"], known)
    over = map_axes(where["regions"])
    table = features(base, o)
    x, y = (table[name].to_numpy(float)[shown] for name in over)
    finding, numbers = _finding(errors, known), _numbers(critique, base, residuals, errors, shown)
    labels = [
        f"trial {impact['trial']}, impact {impact['impact']}, error {number(impact['errors'][0])} m/s"
        for impact in numbers["impacts"]
    ]
    switches: list[str] = []
    if choices:
        numbers |= _switched(critique, choices, errors["base"][shown], shown)
        found = {step.effect.name for step in critique.discovery.steps}
        switches = [f"{'closest rival: ' * (name not in found)}{effect_title(name)}" for name in choices[-1].effects]
    return render(
        TEMPLATE,
        switches=switches,
        map=_map(x, y, errors["base"][shown], labels),
        axes=[plain(axis_label(name)) for name in over],
        finding=finding,
        caption=f"{finding} {_reading(len(shown), len(o))}",
        numbers=as_json(numbers),
    )


def as_json(content: dict) -> Markup:
    """Return numbers as JSON for a script; they must not contain text from users."""
    return Markup(json.dumps(content, separators=(",", ":"), allow_nan=False))


def drawn_impacts(error: np.ndarray, known: np.ndarray, most: int = MOST) -> np.ndarray:
    """Return up to `most` of the indices `known`, evenly spaced in order of the errors `error` (n,), smallest first."""
    ranked = known[np.argsort(error[known], kind="stable")]
    return ranked[np.unique(np.linspace(0, len(ranked) - 1, min(len(ranked), most)).round().astype(int))]


def _finding(errors: Mapping[str, np.ndarray], known: np.ndarray) -> str:
    """Return sentences on the distribution of the base law's errors, and the share of impacts that effects improve."""
    base = np.sort(errors["base"][known])
    worst, total = max(round(WORST * len(base)), 1), float(base.sum())
    share = percent(float(base[-worst:].sum()) / total if total else None)
    few = percent(worst / len(base))
    text = f"The {few} of impacts with the largest errors account for {share} of the sum of all errors of the base law."
    if "final" in errors:
        better = float(np.mean(errors["final"][known] < errors["base"][known]))
        text += f" With the effects the error is smaller in {percent(better)} of the impacts."
    return text


def _reading(shown: int, total: int) -> str:
    """Return the caption: how to read both panels, and which impacts are drawn."""
    which = f"all {total} impacts"
    if shown < total:
        which = f"{shown} of {total} impacts, evenly spaced in the order of their errors from smallest to largest"
    return (
        f"Map: {which}; larger and darker points are larger errors, and points beyond the map are drawn on its edge. "
        "Ellipse: impulses of one impact. Impulses inside the ellipse dissipate energy; its centre is the dead stop. "
        "On the dashed line the contact point stops sliding, on the dotted line compression ends. The measured impulse "
        "is the point impulse at the believed contact point that best fits the measured velocity change; predictions "
        "are as far from it as the predicted velocities are from the measured ones. “With the effects” is the final "
        "model, whatever is switched on."
    )


def _numbers(critique: DropsCritique, base: Fit, residuals: Mapping, errors: Mapping, rows: np.ndarray) -> dict:
    """Return the numbers that the script draws (see the module's table) for the impacts `rows`, by model."""
    o = critique.observations.single
    mass = None if critique.source is None else critique.source.mass
    axis = ImpulseAxis.of(mass is not None)
    v_pre, v_post, r = (array[rows] for array in velocities(base, o))
    size = {"mass": 1.0 if mass is None else mass, "k_g": o.rig.k_g}
    space = contact_space(v_pre, r, **size)
    ellipse = energy_ellipse(space)
    dv = v_post - v_pre
    changes = {"measured": dv} | {name: dv - R[rows] for name, R in residuals.items()}
    per_impact = {
        "centre": axis.factor * ellipse.centre,
        "axes": axis.factor * ellipse.semi_axes,
        "angle": np.degrees(ellipse.angle),
        # along v_t⁺ = 0 the impulse moves by (−K_tn, K_tt), along v_n⁺ = 0 by (K_nn, −K_tn)
        "sticking": np.degrees(np.arctan2(space.K_tt, -space.K_tn)),
        "compression": np.degrees(np.arctan2(-space.K_tn, space.K_nn)),
        **{name: axis.factor * np.stack(measured_impulse(c, r, **size), axis=-1) for name, c in changes.items()},
        "errors": np.stack([error[rows] for error in errors.values()], axis=-1),
    }
    of_trial = zip(o.trial[rows], o.impact[rows], np.isin(o.trial[rows], critique.held_out.trial))
    impacts = [
        {"trial": int(trial), "impact": int(impact), "held_out": bool(held_out)}
        | {name: _rounded(values[i]) for name, values in per_impact.items()}
        for i, (trial, impact, held_out) in enumerate(of_trial)
    ]
    return {"unit": axis.unit, "impacts": impacts}


def _switched(critique: DropsCritique, choices: Sequence[Choice], base: np.ndarray, rows: np.ndarray) -> dict:
    """Return the numbers that colour the map: each choice with its held-out error, and errors at the impacts `rows`."""
    o, names, noise = critique.observations.single, choices[-1].effects, critique.ladder[-1][2].floor
    floor = f"; noise alone gives {number(noise)} m/s" if np.isfinite(noise) else ""
    said = []
    for one in choices:
        error = velocity_error(one.fitted.on(o).velocity_left, o.rig.k_told)[rows]
        mean, low, high = (number(x) for x in clustered_mean(one.judged.error, one.judged.trial))
        text = f"{capital(law_title(one.fitted.base))}: held-out error {mean} ({low} to {high}) m/s{floor}"
        on = [name in one.effects for name in names]
        failed = int(np.sum(~np.isfinite(error)))
        text += f"; no solution at {failed} of these impacts, drawn open" if failed else ""
        said.append({"on": on, "text": text, "errors": [_rounded(e) if np.isfinite(e) else None for e in error]})
    return {"choices": said, **scale_of(top_of(base))}


def scale_of(top: float) -> dict:
    """Return the scale with which the script draws errors up to `top` in m/s."""
    colors = [to_hex(COLORS(share)) for share in np.linspace(0.0, 1.0, SHADES)]
    return {"top": top, "radii": [SMALL, LARGE], "colors": colors}


def _rounded(value: np.ndarray) -> list | float:
    """Round to four significant digits: a hundredth of a pixel."""
    if value.ndim:
        return [_rounded(part) for part in value]
    return float(f"{value:.4g}")


def _map(x: np.ndarray, y: np.ndarray, error: np.ndarray, labels: list[str]) -> dict:
    """Return the map for impacts.html, in pixels: frame, ticks, key, and a point per impact, the worst last."""
    top = top_of(error)
    right, low = WIDTH - MARGIN, HEIGHT - BOTTOM
    px, x_ticks = scale(x, LEFT, right)
    py, y_ticks = scale(y, low, TOP)
    share = np.sqrt(np.clip(error / top, 0.0, 1.0))
    frame = {"width": WIDTH, "height": HEIGHT, "left": LEFT, "top": TOP, "right": right, "low": low}
    return frame | {
        "x_ticks": x_ticks,
        "y_ticks": y_ticks,
        "key": key_of(top),
        "points": [(a, b, *look(s), label) for a, b, s, label in zip(px, py, share, labels)],
    }


def key_of(top: float) -> list[tuple[float, float, str, str]]:
    """Return position, radius, colour and text of the points of the key, for errors up to `top` in m/s."""
    steps = ((138, 0.0, "0"), (180, 0.5, number(0.5 * top, 2)), (245, 1.0, f"≥ {number(top, 2)} m/s"))
    return [(LEFT + at, *look(s**0.5), text) for at, s, text in steps]


def look(share: float) -> tuple[float, str]:
    """Return radius and colour of a point, from the square root of its error over the end of the scale."""
    return SMALL + (LARGE - SMALL) * share, to_hex(COLORS(float(share)))


def scale(
    values: np.ndarray, start: float, end: float, edge: float = EDGE
) -> tuple[np.ndarray, list[tuple[float, str]]]:
    """Return positions of the values between the pixels `start` and `end`, and ticks as (position, text).

    Values beyond the quantiles `edge` and 1 − `edge` are placed at the ends.
    """
    low, high = np.quantile(values, [edge, 1.0 - edge])
    pad = 0.04 * (high - low) or 0.5
    low, high = low - pad, high + pad

    def place(value: np.ndarray) -> np.ndarray:
        return start + (end - start) * (np.clip(value, low, high) - low) / (high - low)

    ticks = MaxNLocator(5, steps=[1, 2, 5, 10]).tick_values(low, high)
    inside = ticks[(ticks >= low) & (ticks <= high)]
    return place(values), [(float(place(t)), f"{t:.6g}".replace("-", "−")) for t in inside]
