"""The schematics of chapter 2 show the geometry of the thesis's formulas, to scale and legibly."""

import numpy as np
import pandas as pd
import pytest
from legible import assert_legible, assert_schematic

from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.mechanisms.motions import block, disk, ellipse, rod, wheel
from thesis_lib.simulate.mechanisms.scenes import falling_polygon, reaching_arm
from thesis_lib.thesis.figures.chapter2.schematics import (
    closest_point,
    figure_2_1,
    figure_2_3,
    figure_2_6,
    figure_2_7,
    figure_2_8,
    outline_at,
)

EXACT = 1e-12  # m, rad: closed forms up to double precision
OUTLINE = 2e-3  # m: the lowest of the ellipse's outline of 180 points is that far from its lowest point at most
BLOCK_POSE, ELLIPSE_POSE = np.array([0.2, 1.05, 0.35]), np.array([-0.1, 2.1, 0.5])


def standing_wheel():
    made = wheel()
    return made, made.standing(np.pi / made.spokes, -1.0, 5)[0]


FIGURES = {
    "2-1": lambda: figure_2_1(*reaching_arm()),
    "2-3": lambda: figure_2_3(*falling_polygon()),
    "2-6": lambda: figure_2_6(block(), BLOCK_POSE),
    "2-7": lambda: figure_2_7(ellipse(), ELLIPSE_POSE),
    "2-8": lambda: figure_2_8(*standing_wheel()),
}


def points(table: pd.DataFrame, series: str) -> np.ndarray:
    return table.loc[table["series"] == series, ["x", "y"]].to_numpy()


def angle_drawn(table: pd.DataFrame, series: str, centre: np.ndarray) -> float:
    """Signed angle in rad that an arc sweeps."""
    arm = points(table, series) - centre
    return float(np.unwrap(np.arctan2(arm[:, 1], arm[:, 0]))[[0, -1]] @ [-1.0, 1.0])


@pytest.mark.parametrize("name", FIGURES)
def test_to_scale_and_legible(name):
    assert_schematic(*FIGURES[name]())


def test_legibility_check_can_fail():
    figure, _ = FIGURES["2-6"]()
    figure.axes[0].text(0.2, 1.05, "again")
    figure.axes[0].text(0.2, 1.05, "again")
    with pytest.raises(AssertionError, match="covers"):
        assert_legible(figure)


@pytest.mark.parametrize("make", [block, ellipse, disk, rod, wheel])
def test_closest_point_is_the_lowest_of_the_outline(make):
    body, rng = make(), np.random.default_rng(0)
    for theta in rng.uniform(-4.0, 4.0, 10):
        q = np.array([0.3, 5.0, theta])
        P, gap = closest_point(body, q)
        outline = outline_at(body, q)
        lowest = outline[outline[:, 1].argmin()]
        assert gap == pytest.approx(P[1], abs=EXACT)
        assert P[1] <= lowest[1] + EXACT and lowest[1] - P[1] < OUTLINE


def test_corner_of_the_block_as_in_2_20():
    # P = (x, y) - l (sin(β - θ), cos(β - θ)) with β = π/4 and l = a/√2
    _, table = FIGURES["2-6"]()
    beta, length = np.pi / 4, 1.0 / np.sqrt(2.0)
    turned = beta - BLOCK_POSE[2]
    expected = BLOCK_POSE[:2] - length * np.array([np.sin(turned), np.cos(turned)])
    assert points(table, "P")[0] == pytest.approx(expected, abs=EXACT)
    assert angle_drawn(table, "beta", BLOCK_POSE[:2]) == pytest.approx(-beta, abs=EXACT)
    assert angle_drawn(table, "theta", BLOCK_POSE[:2]) == pytest.approx(BLOCK_POSE[2], abs=EXACT)
    side = np.diff(points(table, "side"), axis=0)[0]
    assert np.hypot(*side) == pytest.approx(1.0)
    # φ_n of 2.19 is the least over the corners
    quarter = np.array([np.pi / 4 - BLOCK_POSE[2], np.pi / 4 + BLOCK_POSE[2]])
    phi_n = (BLOCK_POSE[1] + np.array([[-length], [length]]) * np.cos(quarter)).min()
    assert table["phi_n"].iloc[0] == pytest.approx(phi_n, abs=EXACT)


def test_point_of_the_ellipse_as_in_2_22():
    _, table = FIGURES["2-7"]()
    a, b = ellipse().shape.semi_axes
    beta = table["beta"].iloc[0]
    length = a * b / np.sqrt(b**2 * np.cos(beta) ** 2 + a**2 * np.sin(beta) ** 2)
    assert np.hypot(*(points(table, "P")[0] - ELLIPSE_POSE[:2])) == pytest.approx(length, abs=EXACT)
    for name, expected in (("a", a), ("b", b)):
        assert np.hypot(*np.diff(points(table, name), axis=0)[0]) == pytest.approx(expected)
    # the tangent in P is level: a small turn of β either way leads up
    for turn in (-1e-3, 1e-3):
        near = a * b / np.sqrt(b**2 * np.cos(beta + turn) ** 2 + a**2 * np.sin(beta + turn) ** 2)
        y = ELLIPSE_POSE[1] + near * np.sin(beta + turn + ELLIPSE_POSE[2])
        assert y > points(table, "P")[0, 1]


def test_distances_of_figure_2_3_are_those_to_the_closest_point():
    body, q = falling_polygon()
    _, table = figure_2_3(body, q)
    P = outline_at(body, q)[:-1]
    P = P[P[:, 1].argmin()]
    assert points(table, "P")[0] == pytest.approx(P, abs=EXACT)
    assert table[["phi_t", "phi_n"]].iloc[0].to_numpy() == pytest.approx(P, abs=EXACT)
    assert points(table, "phi_n") == pytest.approx(np.array([[P[0], 0.0], P]), abs=EXACT)
    assert points(table, "phi_t") == pytest.approx(np.array([[0.0, P[1]], P]), abs=EXACT)


def test_wheel_stands_on_its_slope():
    made, q = standing_wheel()
    _, table = figure_2_8(made, q)
    down = np.array([np.cos(made.slope), -np.sin(made.slope)])
    up = np.array([np.sin(made.slope), np.cos(made.slope)])
    feet = np.concatenate([points(table, f"contact {i}") for i in (1, 2)])
    assert feet @ up == pytest.approx(np.zeros(2), abs=EXACT)  # on the line that the ground is drawn as
    assert points(table, "ground") @ up == pytest.approx(np.zeros(2), abs=EXACT)
    assert abs((feet[1] - feet[0]) @ down) == pytest.approx(2.0 * np.sin(np.pi / made.spokes), abs=EXACT)
    assert np.diff(points(table, "normal force 1"), axis=0)[0] @ down == pytest.approx(0.0, abs=EXACT)
    hub = points(table, "hub")[0]
    tips = np.array([points(table, f"spoke {i}")[1] for i in range(made.spokes)])
    assert np.hypot(*(tips - hub).T) == pytest.approx(np.full(made.spokes, made.length))
    assert angle_drawn(table, "angle between spokes", hub) == pytest.approx(2.0 * np.pi / made.spokes)
    # the level through the foot of the slope is level
    assert np.ptp(points(table, "level")[:, 1]) < EXACT


def test_arm_touches_the_disk_where_its_link_is():
    arm, q = reaching_arm()
    assert arm.contacts(q).phi == pytest.approx(np.zeros(2), abs=EXACT)
    _, table = figure_2_1(arm, q)
    elbow, tip = points(table, "link 2")
    C, n = points(table, "contact, arm")[0], np.diff(points(table, "normal, arm"), axis=0)[0]
    along = (tip - elbow) / np.hypot(*(tip - elbow))
    assert np.hypot(*(C - q[2:4])) == pytest.approx(arm.disk_radius, abs=EXACT)
    assert (C - elbow) @ [-along[1], along[0]] == pytest.approx(0.0, abs=EXACT)
    assert 0.0 < (C - elbow) @ along < arm.link_lengths[1]
    assert n @ along == pytest.approx(0.0, abs=EXACT) and n @ (q[2:4] - C) > 0.0
    for joint, origin in ((1, arm.base), (2, elbow)):
        assert angle_drawn(table, f"q_{joint}", origin) == pytest.approx(q[joint - 1], abs=EXACT)


@pytest.mark.parametrize(
    ("draw", "says"),
    [
        (lambda: figure_2_3(falling_polygon()[0], np.array([-2.0, 1.0, 0.3])), "right of the origin"),
        (lambda: figure_2_6(block(), np.array([0.0, 0.3, 0.3])), "above the surface"),
    ],
)
def test_wrong_poses_are_said(draw, says):
    with pytest.raises(UserError, match=says):
        draw()
