"""Chapter 5's diagrams: the right arrows between the right parts, legible."""

import numpy as np
import pandas as pd
import pytest
from legible import assert_schematic

from thesis_lib.thesis.figures.chapter5.schematics import HALF, RADIUS, figure_5_2, figure_5_3, figure_5_4, figure_5_5c

FIGURES = {"5-2": figure_5_2, "5-3": figure_5_3, "5-4": figure_5_4, "5-5c": figure_5_5c}


def edges(table: pd.DataFrame, panel: str = "") -> set[tuple[str, str]]:
    own = table.loc[(table["panel"] == panel) & table["series"].str.contains(" to "), "series"]
    return {tuple(name.split(" to ")) for name in own}


def places(table: pd.DataFrame, series: str, panel: str = "") -> np.ndarray:
    return table.loc[(table["series"] == series) & (table["panel"] == panel), ["x", "y"]].to_numpy()


@pytest.mark.parametrize("name", FIGURES)
def test_legible(name):
    assert_schematic(*FIGURES[name]())


def test_only_the_light_block_moves_and_it_resists_less():
    _, table = figure_5_2()
    assert not len(places(table, "block before", "a"))
    moved = places(table, "block", "b") - places(table, "block before", "b")
    assert (moved[:, 0] > 0).all() and np.ptp(moved, axis=0) == pytest.approx(0.0)
    force = {panel: np.ptp(places(table, "force", panel)[:, 0]) for panel in ("a", "b")}
    assert force["a"] > 2 * force["b"]
    for panel in ("a", "b"):
        # the pusher touches the face of the block
        assert places(table, "pusher location", panel)[0, 0] == places(table, "block", panel)[:, 0].min()


def test_the_model_has_the_dependences_of_the_generative_process():
    _, table = figure_5_3()
    assert edges(table) == {
        ("alpha", "pi"),
        ("pi", "c_i"),
        ("c_i", "s_t+1"),
        ("v_theta", "theta_k"),
        ("theta_k", "s_t+1"),
        ("s_t", "s_t+1"),
        ("a_t", "s_t+1"),
        ("s_t", "z_t"),
        ("s_t+1", "z_t+1"),
        ("Sigma_z", "z_t+1"),
    }


def test_plates_hold_what_is_repeated_and_nothing_else():
    _, table = figure_5_3()
    nodes = ["alpha", "pi", "c_i", "theta_k", "v_theta", "s_t", "s_t+1", "a_t", "z_t", "z_t+1", "Sigma_z"]
    inside = {}
    for plate in ("N", "D", "K"):
        low, high = places(table, f"plate {plate}")
        at = {name: places(table, name)[0] for name in nodes}
        inside[plate] = {n for n, p in at.items() if (p - RADIUS > low).all() and (p + RADIUS < high).all()}
    steps = {"s_t", "s_t+1", "a_t", "z_t", "z_t+1"}
    assert inside == {"D": steps, "N": steps | {"c_i"}, "K": {"theta_k"}}


def test_the_loop_of_the_architecture_is_closed_and_its_boxes_apart():
    _, table = figure_5_4()
    after = dict(edge for edge in edges(table, "B") if edge[0] != "learned physics")
    name, seen = "sensing", []
    for _ in after:
        seen.append(name)
        name = after[name]
    assert name == "sensing" and len(set(seen)) == 5
    corners = [places(table, box, "B") for box in (*seen, "learned physics")]
    for i, (low, high) in enumerate(corners):
        assert high - low == pytest.approx(2.0 * HALF)
        assert all((low > other[1]).any() or (other[0] > high).any() for other in corners[:i])


def test_experts_hang_on_steps_and_the_abstraction_on_the_push():
    _, table = figure_5_5c()
    mor, hma = edges(table, "MOR"), edges(table, "HMA")
    assert {a for a, _ in mor if a.startswith("l_")} == {"l_t-1", "l_t"}
    assert {b for a, b in hma if a == "c"} == {"s_t", "s_t+1"}
    assert not any(b == "c" for _, b in hma)
    # the rest is the same model
    assert {e for e in mor if "l_" not in "".join(e)} == {e for e in hma if "c" not in e}
