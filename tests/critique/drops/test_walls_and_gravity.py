"""A disk that falls into a trough of three walls: gravity pulls at each of them in another direction."""

import numpy as np
import pandas as pd
import pytest

from thesis_lib.bodies.walls import Wall
from thesis_lib.critique.drops.criticise import criticise_drops
from thesis_lib.critique.likelihood.observations import observe
from thesis_lib.critique.results.load_model import load_model
from thesis_lib.critique.results.saved_model import saved
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.header import Header
from thesis_lib.mechanics.state import State

RADIUS, MU, EPSILON, G = 0.03, 0.15, 0.7, 9.81
RATE, NOISE, ANGLE_NOISE = 250.0, 2e-4, 3e-3
TROUGH = (
    Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0)),
    Wall(name="left", point=(-0.25, 0.0), normal=(np.cos(0.3), np.sin(0.3))),
    Wall(name="right", point=(0.3, 0.0), normal=(-1.0, 0.1)),
)
DEAD = {"floor": EPSILON, "left": EPSILON, "right": 0.6}


def bounced(v: np.ndarray, wall: Wall, epsilon: float) -> np.ndarray:
    """(v_x, v_y, ω) after Coulomb's impact of a uniform disk, whose spin changes with v_t alone."""
    n = wall.n
    t = np.array([n[1], -n[0]])
    v_n, slip = v[:2] @ n, v[:2] @ t + RADIUS * v[2]
    c_n = -(1.0 + epsilon) * v_n
    c_t = float(np.clip(-slip / 3.0, -MU * c_n, MU * c_n))  # K_tt = 1 + R²/k² = 3
    return v + np.array([*(c_n * n + c_t * t), 2.0 * c_t / RADIUS])


def fall(rng: np.random.Generator, epsilon: dict[str, float]) -> np.ndarray:
    """Poses (m, 3) in m and rad at 250 Hz from the release until contacts follow each other quickly."""
    q = np.array([rng.uniform(-0.15, 0.2), rng.uniform(0.3, 0.6), rng.uniform(-3.0, 3.0)])
    v = np.array([*rng.uniform(-1.0, 1.0, 2) * [1.5, 0.3], rng.uniform(-15.0, 15.0)])
    a, poses, start = np.array([0.0, -G, 0.0]), [], 0.0
    for _ in range(8):
        waits = []
        for wall in TROUGH:
            # gap(t) = 0 of a parabola, the root at which the disk comes nearer
            c = [0.5 * a[:2] @ wall.n, v[:2] @ wall.n, (q[:2] - wall.point) @ wall.n - RADIUS]
            waits += [
                (t.real, wall)
                for t in np.roots(c)
                if abs(t.imag) < 1e-12 and t.real > 1e-9 and 2 * c[0] * t.real + c[1] < 0
            ]
        wait, wall = min(waits, key=lambda pair: pair[0])
        if wait < 0.06:
            break
        times = np.arange(np.ceil(start * RATE), np.ceil((start + wait) * RATE)) / RATE - start
        poses.append(q + times[:, None] * v + 0.5 * times[:, None] ** 2 * a)
        q, v, start = q + wait * v + 0.5 * wait**2 * a, v + wait * a, start + wait
        v = bounced(v, wall, epsilon[wall.name])
    return np.concatenate(poses)


def trough(trials: int, seed: int, **epsilon: float) -> Dataset:
    rng, tables = np.random.default_rng(seed), []
    for trial in range(trials):
        q = fall(rng, dict.fromkeys(DEAD, EPSILON) | epsilon)
        q = q + rng.standard_normal(q.shape) * [NOISE, NOISE, ANGLE_NOISE]
        tables.append(
            pd.DataFrame({"trial": trial, "t": np.arange(len(q)) / RATE, "x": q[:, 0], "y": q[:, 1], "theta": q[:, 2]})
        )
    body = {"shape": {"kind": "disk", "radius": RADIUS}, "mass": 0.05, "radius_of_gyration": RADIUS / 2**0.5}
    content = {"schema": 1, "body": body, "surfaces": [wall.model_dump() for wall in TROUGH], "rate": RATE}
    return Dataset("trough", Header.model_validate(content), pd.concat(tables, ignore_index=True))


def test_gravity_pulls_along_and_across_a_wall() -> None:
    rig = observe(trough(3, 0)).rig
    surface = np.array([-1, 0, 1, 2])  # as it was filmed, floor, left, right
    fall = rig.fall(State.planar(*[np.zeros(4)] * 8, surface)).T
    np.testing.assert_allclose(fall[:2], [[0.0, -G, 0.0]] * 2, atol=1e-12)
    for row, wall in zip(fall[1:], TROUGH):
        np.testing.assert_allclose(row, [G * wall.n[0], -G * wall.n[1], 0.0], atol=1e-12)


@pytest.mark.slow
def test_a_trough_of_like_walls_is_adequate(tmp_path) -> None:
    found = criticise_drops(trough(60, 1), rng=np.random.default_rng(0))
    fitted = found.ladder[-1][1]
    assert set(found.observations.surface) == {0, 1, 2}
    assert found.verdict == "adequate"
    for name, true in (("mu", MU), ("epsilon", EPSILON)):
        assert abs(fitted.values[name] - true) < 4.0 * fitted.std[name] < 0.05 * true
    saved(fitted, found.observations.rig, "trough").save(tmp_path / "model.json")
    model = load_model(tmp_path / "model.json")
    assert model.believed == found.observations.rig
    # just off each wall, as it was filmed, and once away from all of them
    rng = np.random.default_rng(3)
    q, v = np.zeros((4, 3)), np.column_stack([rng.uniform(-1.0, 1.0, (4, 2)), rng.uniform(-9.0, 9.0, 4)])
    for i, wall in enumerate(TROUGH):
        q[i, :2] = np.add(wall.point, 0.3 * np.array([-wall.n[1], wall.n[0]]) * (i != 1)) + RADIUS * wall.n
        v[i, :2] -= (v[i, :2] @ wall.n + 1.5) * wall.n
    q[3], v[3] = [0.0, RADIUS, 0.0], [0.0, 2.0, 3.0]
    states = pd.DataFrame(np.column_stack([q, v]), columns=["x", "y", "theta", "vx", "vy", "omega"])
    after = model.predict(states)
    assert list(after["status"]) == ["ok", "ok", "ok", "not_approaching"]
    expected = [bounced(row, wall, EPSILON) for row, wall in zip(v, TROUGH)]
    np.testing.assert_allclose(after[["vx_post", "vy_post", "omega_post"]][:3], expected, atol=0.05)


@pytest.mark.slow
def test_the_wall_that_differs_is_named() -> None:
    found = criticise_drops(trough(60, 2, right=DEAD["right"]), rng=np.random.default_rng(0))
    assert [step.effect.name for step in found.discovery.steps] == ["other_restitution_at_right"]
    d = found.ladder[-1][1].values["other_restitution_at_right.d"]
    assert found.verdict == "effects" and d == pytest.approx(DEAD["right"] / EPSILON - 1.0, abs=0.01)
