"""Figures 5-2, 5-3, 5-4B and 5-5C: diagrams of the pushed block, the hierarchical model and the architecture.

The tables contain no data, only the positions of a diagram's parts in units of the picture (thesis 5.3.1).

| on paper | in the diagrams                                                                  |
|----------|----------------------------------------------------------------------------------|
| α, π     | concentration and shares of the stick-breaking process                           |
| c_i      | abstraction of push i; for MOR: l_t, the expert of one step                      |
| θ_k      | weights of the network (HMA) or the regression (MOR) of abstraction k            |
| s_t, a_t | state and action; z_t, Σ_z: reading and its noise                                |
| D, N, K  | plates: steps of a window, pushes, abstractions                                  |

Circles are random variables, shaded if given or observed; dots are fixed parameters.
"""

from itertools import pairwise

import numpy as np
import pandas as pd
from matplotlib.patches import Circle, FancyBboxPatch, Rectangle

from thesis_lib.figures.planar_drawing import Sketch, unit
from thesis_lib.figures.style import BLUE, GREY, INK, RED, WIDTH, Drawn, house_style, new_figure

RADIUS = 0.34  # radius of a node
MARGIN = 0.45  # around the drawing: at least a node's radius
GIVEN, BLOCK, GHOST = "#D9D9D9", "#C9B6DC", "#F1ECF6"
LEARNED = "#F6D9C4"
HALF = np.array([1.4, 0.6])  # half width and height of a box
Place = tuple[float, float]
Node = tuple[Place, str, bool | None]


@house_style
def figure_5_2() -> Drawn:
    """Figure 5-2: pusher against a block that (a) is too heavy to move and (b) moves along; state: q_t, p_t and f_t."""
    figure = new_figure(5.2, 1.55)
    sketches = []
    cases = (("a", "heavy: force rises, nothing moves", 0.0, 2.3), ("b", "light: moves at little force", 1.3, 0.9))
    for ax, (panel, title, moved, force) in zip(figure.subplots(1, 2, sharex=True, sharey=True), cases):
        sketch = Sketch(ax, panel)
        sketch.ground(-4.2, 4.6, 0.35)
        square = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]])
        if moved:
            sketch.fill("block before", square, facecolor=GHOST, edgecolor=GREY, linestyle=(0, (4, 3)))
        sketch.fill("block", square + [moved, 0.0], facecolor=BLOCK)
        tip = 0.22 * unit(np.linspace(-0.5 * np.pi, 0.5 * np.pi, 31)).T + [moved - 0.22, 1.0]
        finger = np.vstack([[[-3.9, 0.78]], tip, [[-3.9, 1.22]]])
        sketch.fill("pusher", finger, facecolor="0.8", linewidth=0.9)
        sketch.arrow("force", np.array([moved, 1.0]), np.array([force, 0.0]), RED)
        sketch.label((moved + force + 0.12, 1.0), r"$\mathbf{f}_t$", RED, ha="left")
        sketch.point("block pose", (moved + 1.0, 1.6))
        sketch.label((moved + 1.25, 1.62), r"$\mathbf{q}_t$", ha="left")
        sketch.point("pusher location", (moved, 1.0), markersize=4, color=BLUE)
        sketch.label((moved - 0.3, 0.5), r"$\mathbf{p}_t$", BLUE)
        sketch.arrow("action", np.array([-3.2, 1.75]), np.array([1.1, 0.0]))
        sketch.label((-2.65, 2.1), r"$\mathbf{a}_t$")
        ax.set_title(f"({panel})  {title}", loc="center")
        sketches.append(sketch)
    return figure, _places(*sketches)


@house_style
def figure_5_3() -> Drawn:
    """Figure 5-3: the hierarchical model in plate notation: abstractions, transitions and readings."""
    figure = new_figure(4.6, 2.7)
    sketch = Sketch(figure.add_subplot(), "")
    nodes = {
        "alpha": ((-2.6, 4.0), r"$\alpha$", None),
        "pi": ((-1.3, 4.0), r"$\boldsymbol{\pi}$", False),
        "c_i": ((2.1, 4.0), r"$\mathbf{c}_i$", False),
        "theta_k": ((5.9, 4.0), r"$\boldsymbol{\theta}_k$", False),
        "v_theta": ((7.6, 4.0), r"$\mathbf{v}_\theta$", None),
        "s_t": ((0.9, 2.0), r"$\mathbf{s}_t$", False),
        "s_t+1": ((3.3, 2.0), r"$\mathbf{s}_{t+1}$", False),
        "a_t": ((0.9, 3.1), r"$\mathbf{a}_t$", True),
        "z_t": ((0.9, 0.5), r"$\mathbf{z}_t$", True),
        "z_t+1": ((3.3, 0.5), r"$\mathbf{z}_{t+1}$", True),
        "Sigma_z": ((5.9, 0.5), r"$\boldsymbol{\Sigma}_z$", None),
    }
    _plate(sketch, "N", (0.05, -0.55), (4.35, 4.85), "$N$")
    _plate(sketch, "D", (0.25, 0.0), (4.15, 3.55), "$D$")
    _plate(sketch, "K", (5.15, 3.1), (6.65, 4.85), r"$K$")
    edges = [("alpha", "pi"), ("pi", "c_i"), ("c_i", "s_t+1"), ("theta_k", "s_t+1"), ("v_theta", "theta_k")]
    edges += [("s_t", "s_t+1"), ("a_t", "s_t+1"), ("s_t", "z_t"), ("s_t+1", "z_t+1"), ("Sigma_z", "z_t+1")]
    _graph(sketch, nodes, edges)
    for text, y in (("abstractions", 4.6), ("physics", 2.0), ("readings", 0.5)):
        sketch.label((-0.2, y), text, GREY, ha="right", fontsize=8)
    return figure, _places(sketch)


@house_style
def figure_5_4() -> Drawn:
    """Figure 5-4B: architecture of sensing, inference with learned physics, game play, control, robot and tower."""
    figure = new_figure(WIDTH, 2.6)
    sketch = Sketch(figure.add_subplot(), "B")
    boxes = {
        "sensing": ((0.0, 2.0), "sensing", "block poses, force", "white"),
        "inference": ((3.6, 2.0), "inference", "states, abstraction", "white"),
        "learned physics": ((3.6, 4.0), "learned physics", "$p(s_{t+1}, c \\mid s_t, a_t)$", LEARNED),
        "game play": ((7.2, 2.0), "game play", "state machine: push,\nretract, extract, place", "white"),
        "control": ((7.2, 0.0), "control", "trajectories", "white"),
        "robot and tower": ((0.0, 0.0), "robot and tower", "simulated (MuJoCo)", "0.92"),
    }
    for name, (at, title, text, colour) in boxes.items():
        _box(sketch, name, at, title, text, colour)
    centre = {name: np.array(at) for name, (at, *_) in boxes.items()}
    hops = (
        ("sensing", "inference", "$z_t$"),
        ("inference", "game play", "$s_t, c$"),
        ("game play", "control", "primitive"),
        ("control", "robot and tower", "pose, heading of 1 mm"),
        ("robot and tower", "sensing", ""),
        ("learned physics", "inference", ""),
    )
    for start, end, text in hops:
        _hop(sketch, f"{start} to {end}", centre[start], centre[end], text)
    # the controller looks ahead with the same model
    corner = np.array([centre["game play"][0], centre["learned physics"][1]])
    sketch.line("learned physics to game play", np.stack([centre["learned physics"] + [HALF[0], 0.0], corner]))
    sketch.arrow("forward prediction", corner, np.array([0.0, -(2.0 - HALF[1])]))
    sketch.label(corner + [-0.95, 0.25], "forward prediction", fontsize=7.5)
    return figure, _places(sketch)


@house_style
def figure_5_5c() -> Drawn:
    """Figure 5-5C: structure of MOR, with an expert l_t for each step, and HMA, with an abstraction c for a push."""
    figure = new_figure(WIDTH, 2.3)
    sketches = []
    for ax, panel in zip(figure.subplots(1, 2, sharex=True, sharey=True), ("MOR", "HMA")):
        sketch = Sketch(ax, panel)
        times, nodes, edges = ("t-1", "t", "t+1"), {}, []
        for i, time in enumerate(times):
            nodes[f"s_{time}"] = ((2.0 * i, 1.3), rf"$\mathbf{{s}}_{{{time}}}$", False)
            nodes[f"z_{time}"] = ((2.0 * i, 0.0), rf"$\mathbf{{z}}_{{{time}}}$", True)
            edges.append((f"s_{time}", f"z_{time}"))
        for i, (time, after) in enumerate(pairwise(times)):
            nodes[f"a_{time}"] = ((2.0 * i + 1.0, 2.5), rf"$\mathbf{{a}}_{{{time}}}$", True)
            edges += [(f"s_{time}", f"s_{after}"), (f"a_{time}", f"s_{after}")]
            if panel == "MOR":
                nodes[f"l_{time}"] = ((2.0 * i + 1.0, 3.8), rf"$l_{{{time}}}$", False)
                # the gate depends on state and action
                edges += [(f"a_{time}", f"l_{time}"), (f"s_{time}", f"l_{time}"), (f"l_{time}", f"s_{after}")]
        if panel == "HMA":
            nodes["c"] = ((3.0, 3.8), r"$\mathbf{c}$", False)
            edges += [("c", f"s_{time}") for time in times[1:]]
        _graph(sketch, nodes, edges, 0.36)
        scope = "an expert for each step" if panel == "MOR" else "an abstraction for the whole push"
        ax.set_title(f"{panel}: {scope}", loc="center")
        sketches.append(sketch)
    return figure, _places(*sketches)


def _places(*sketches: Sketch) -> pd.DataFrame:
    """Table of everything drawn (panel, series, x, y); also sets common limits of the panels around it."""
    table = pd.concat([sketch.table() for sketch in sketches], ignore_index=True)
    low, high = table[["x", "y"]].min() - MARGIN, table[["x", "y"]].max() + MARGIN
    for sketch in sketches:
        sketch.ax.set(xlim=(low["x"], high["x"]), ylim=(low["y"], high["y"]))
    return table[["panel", "series", "x", "y"]]


def _graph(sketch: Sketch, nodes: dict[str, Node], edges: list[tuple[str, str]], radius: float = RADIUS) -> None:
    """Draw nodes (place, text; observed, latent, or None: fixed parameter, a dot) and the arrows between them."""
    dot = 0.09
    for name, (at, text, observed) in nodes.items():
        sketch.keep(name, np.array(at))
        if observed is None:
            sketch.ax.add_patch(Circle(at, dot, facecolor=INK, edgecolor=INK, zorder=3))
            sketch.label(np.add(at, (0.0, 0.42)), text, fontsize=9)
        else:
            colour = GIVEN if observed else "white"
            sketch.ax.add_patch(Circle(at, radius, facecolor=colour, edgecolor=INK, linewidth=0.9, zorder=3))
            sketch.label(at, text, fontsize=8.5, zorder=4)
    for start, end in edges:
        a, b = np.array(nodes[start][0]), np.array(nodes[end][0])
        along = (b - a) / np.linalg.norm(b - a)
        a = a + (dot if nodes[start][2] is None else radius) * along
        sketch.arrow(f"{start} to {end}", a, b - radius * along - a)


def _plate(sketch: Sketch, name: str, low: Place, high: Place, text: str) -> None:
    """Draw a plate, the rectangle around repeated nodes, with its number in the lower right corner."""
    width, height = np.subtract(high, low)
    sketch.keep(f"plate {name}", np.array([low, high]))
    sketch.ax.add_patch(Rectangle(low, width, height, fill=False, edgecolor=GREY, linewidth=0.9))
    sketch.label((high[0] - 0.1, low[1] + 0.08), text, INK, ha="right", va="bottom", fontsize=8)


def _box(sketch: Sketch, name: str, at: Place, title: str, text: str, colour: str) -> None:
    corners = np.array([np.subtract(at, HALF), np.add(at, HALF)])
    sketch.keep(name, corners)
    look = {"facecolor": colour, "edgecolor": INK, "linewidth": 0.9, "boxstyle": "round,pad=0,rounding_size=0.12"}
    sketch.ax.add_patch(FancyBboxPatch(corners[0], *(2.0 * HALF), **look))
    lines = text.count("\n") + 1
    sketch.label(np.add(at, (0.0, 0.12 + 0.12 * lines)), title, fontsize=8, fontweight="bold")
    sketch.label(np.add(at, (0.0, -0.2)), text, fontsize=7)


def _hop(sketch: Sketch, name: str, start: np.ndarray, end: np.ndarray, text: str) -> None:
    """Draw an arrow between the borders of two boxes that are beside or above each other."""
    away = np.sign(end - start) * HALF
    sketch.arrow(name, start + away, end - start - 2.0 * away)
    level = start[1] == end[1]
    middle = 0.5 * (start + end) + (np.array([0.0, 0.22]) if level else np.array([0.1, 0.0]))
    sketch.label(middle, text, fontsize=7.5, ha="center" if level else "left")
