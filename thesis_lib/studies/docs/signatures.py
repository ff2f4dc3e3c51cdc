"""Signatures of effects: prediction with an effect minus prediction without it, over the relevant states.

One ellipse (a square if an effect needs corners) hits the surface once, by Mirtich's law with μ = 0.15, ε = 0.55:

| panel   | plotted                                                           | for effects that change          |
|---------|-------------------------------------------------------------------|----------------------------------|
| plane   | √(Δv_x² + Δv_y² + (kΔω)²) and Δv over the contact velocity before | the velocity after impact        |
| curve   | Δv_x, Δv_y, kΔω over the other variable with the largest effect   | the velocity after impact        |
| flight  | Δa_x, Δa_y, kΔα over the variable with the largest effect         | the flight only                  |
| path    | Δx, Δy, kΔθ over half a second of flight                          | the flight only                  |
| slide   | Δa_x over the velocity along the surface                          | slides only                      |
| gap     | Δφ_n over the variable with the largest effect                    | the gap at impact only           |
"""

from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd

from thesis_lib.bodies.shapes import Ellipse, Polygon
from thesis_lib.contact import LAWS
from thesis_lib.critique.contacts.dynamics import Dynamics
from thesis_lib.critique.contacts.kinds import bind
from thesis_lib.critique.contacts.model import Model
from thesis_lib.effects.effect import Effect, Parameter, Rig
from thesis_lib.mechanics.state import State

LAW = LAWS["mirtich"]
COEFFICIENTS = {"mu": 0.15, "epsilon": 0.55, "tau": 5e-4}  # τ in s affects only the gap at impact
ELLIPSE = Rig(Ellipse(semi_axes=(0.035, 0.025)), 0.0192, 9.81, 0.0)  # as published
_CORNERS = ((0.035, 0.035), (-0.035, 0.035), (-0.035, -0.035), (0.035, -0.035))
SQUARE = Rig(Polygon(vertices=_CORNERS), 0.0286, 9.81, 0.0)
# an impact without any symmetry, at an angle at which the contact can stick: x (m), θ (rad), v_t, v_n (m/s),
# ω (rad/s), t (s), number of the release
BASE = {"x": 0.15, "theta": 0.12, "v_t": 0.6, "v_n": -2.5, "omega": 6.0, "t": 0.3, "trial": 40.0}
RANGES = {"theta": (-np.pi, np.pi), "omega": (-20.0, 20.0), "x": (-0.4, 0.4), "t": (0.0, 0.6), "trial": (0.0, 150.0)}
IN_FLIGHT = {"v_t": (-2.0, 2.0), "v_n": (-3.0, 3.0), "omega": (-20.0, 20.0), "theta": (-np.pi, np.pi)}
PLANE_T, PLANE_N = np.linspace(-2.0, 2.0, 41), np.linspace(-3.5, -0.25, 27)
POINTS = 121
SPAN = 0.5  # s
COLUMNS = ["effect", "panel", "over", "at", "at_n", "series", "value"]
PREDICTED: dict[str, Callable[[Dynamics, State], np.ndarray]] = {
    "impact": lambda dynamics, state: dynamics.predict(state).v,
    "flight": lambda dynamics, state: dynamics.acceleration(state),
    "slide": lambda dynamics, state: dynamics.sliding(state),
    "gap": lambda dynamics, state: -dynamics.gap(state) - dynamics.strike(state)[1],
}


def size_that_matters(p: Parameter) -> float:
    """The value of a parameter that is used in the pictures."""
    return p.null + p.scale if p.discrete is None else p.discrete


def sizes_text(effect: Effect) -> str:
    """The parameter values of an effect's picture as text."""
    sizes = [f"{p.name} = {size_that_matters(p):g}{'' if p.unit == '1' else f' {p.unit}'}" for p in effect.parameters]
    return ", ".join(sizes)


def rig_for(effect: Effect) -> Rig:
    """A rig on which the effect can occur."""
    return ELLIPSE if effect.applies_to(ELLIPSE) else SQUARE


def signature(effect: Effect) -> pd.DataFrame:
    """The numbers in an effect's picture, in SI: panel, variable `over` and its value `at` (`at_n`), series, value."""
    if "impact" in effect.channels:
        parts = [_plane(effect), _curve(effect, "curve", RANGES, "impact", ("v_x", "v_y", "k ω"))]
    elif "flight" in effect.channels:
        parts = [_curve(effect, "flight", IN_FLIGHT, "flight", ("a_x", "a_y", "k α")), _path(effect)]
    elif "slide" in effect.channels:
        parts = [_curve(effect, "slide", {"v_t": (-2.0, 2.0)}, "slide", ("a_x",))]
    else:
        ranges = {name: RANGES[name] for name in ("theta", "x")} | {"v_n": (-3.5, -0.25)}
        parts = [_curve(effect, "gap", ranges, "gap", ("φ_n",))]
    return pd.concat(parts, ignore_index=True).assign(effect=effect.name)[COLUMNS]


def states(rig: Rig, **changed: np.ndarray) -> State:
    """States that touch the surface: BASE with some values replaced by arrays (n,)."""
    n = len(next(iter(changed.values())))
    s = {name: changed.get(name, np.full(n, value)) for name, value in BASE.items()}
    r_x, r_y = rig.shape.contact_point(s["theta"]).T
    same = {name: s[name] for name in ("x", "theta", "omega", "trial", "t")}
    return State.planar(y=rig.height - r_y, vx=s["v_t"] + r_y * s["omega"], vy=s["v_n"] - r_x * s["omega"], **same)


def change(effect: Effect, state: State, channel: str) -> np.ndarray:
    """Change in the prediction of a channel of `PREDICTED` caused by an effect, in SI.

    Δ(v_x, v_y, k ω) (n, 3) of the velocity after impact, Δ(a_x, a_y, k α) (n, 3) of the acceleration in flight, Δa_x
    (n, 1) of a body that slides on the surface, Δφ_n (n, 1) of the gap.
    """
    rig, with_it, without = _models(effect, takes_time=channel == "gap")
    changed = PREDICTED[channel](with_it, state) - PREDICTED[channel](without, state)
    return changed * [1.0, 1.0, rig.k_g] if changed.ndim == 2 else changed[:, None]


def _models(effect: Effect, takes_time: bool = False) -> tuple[Rig, Dynamics, Dynamics]:
    """The rig, and its dynamics with the effect and without it."""
    rig = rig_for(effect)
    values = COEFFICIENTS | {f"{effect.name}.{p.name}": size_that_matters(p) for p in effect.parameters}
    with_it, without = (bind(Model(LAW, on, takes_time=takes_time), values, rig) for on in ((effect,), ()))
    return rig, with_it, without


def _plane(effect: Effect) -> pd.DataFrame:
    v_t, v_n = (grid.ravel() for grid in np.meshgrid(PLANE_T, PLANE_N))
    changes = change(effect, states(rig_for(effect), v_t=v_t, v_n=v_n), "impact")
    columns = {"size": np.linalg.norm(changes, axis=1), "v_x": changes[:, 0], "v_y": changes[:, 1]}
    return _table("plane", "v_t, v_n", v_t, columns, v_n)


def _table(panel: str, over: str, at: np.ndarray, columns: dict[str, np.ndarray], at_n: Any = np.nan) -> pd.DataFrame:
    """A row for each series and value of the variable `over`."""
    parts = [pd.DataFrame({"at": at, "at_n": at_n, "series": name, "value": c}) for name, c in columns.items()]
    return pd.concat(parts).assign(panel=panel, over=over)


def _curve(
    effect: Effect, panel: str, ranges: dict[str, tuple[float, float]], channel: str, series: tuple[str, ...]
) -> pd.DataFrame:
    """Changes over the variable in whose range they vary most; the first variable if they depend on none."""
    best, most = None, -1.0
    for over, (low, high) in ranges.items():
        at = np.linspace(low, high, POINTS)
        changes = change(effect, states(rig_for(effect), **{over: at}), channel)
        spread = float(np.ptp(changes, axis=0).max())
        if spread > most + 1e-9:
            best, most = (over, at, changes), spread
    over, at, changes = best
    return _table(panel, over, at, dict(zip(series, changes.T)))


def _path(effect: Effect) -> pd.DataFrame:
    rig, with_it, without = _models(effect)
    t = np.linspace(0.0, SPAN, POINTS)
    changes = (_flown(with_it, t) - _flown(without, t)) * [1.0, 1.0, rig.k_g]
    return _table("path", "t", t, dict(zip(("x", "y", "k θ"), changes.T)))


def _flown(dynamics: Dynamics, t: np.ndarray) -> np.ndarray:
    """Poses (len(t), 3) of a body thrown up at 2.5 m/s, by the midpoint rule."""
    state = states(dynamics.rig, v_n=np.array([2.5]))
    poses = []
    for h in np.diff(t, append=t[-1]):
        poses.append(state.q[0])
        half = state.flown(dynamics.acceleration(state), 0.5 * h)
        state = state.flown(dynamics.acceleration(half), h)
    return np.array(poses)
