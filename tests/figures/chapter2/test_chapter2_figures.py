"""The motions that chapter 2's figures show do what their captions say, and what is drawn is what was simulated."""

import numpy as np
import pandas as pd
import pytest
from legible import assert_legible

from thesis_lib.bodies.body import Body
from thesis_lib.bodies.shapes import Ellipse
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.header import Header
from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.mechanisms.motions import DEFAULT, disk, ellipse, releases
from thesis_lib.simulate.mechanisms.scenes import (
    SCENES,
    Mode,
    SceneSettings,
    contact_modes,
    falling_rod,
    landing_disk,
    tipping_block,
    traces,
)
from thesis_lib.simulate.stepping.stepping import simulate
from thesis_lib.thesis.figures.chapter2.motions import figure_2_2, figure_2_4, figure_2_5, figure_2_9, figure_2_14
from thesis_lib.thesis.identify.base_parameters.excitation_table import landings
from thesis_lib.thesis.identify.base_parameters.projection import project_motion

EXACT = 1e-12
STUCK = 1e-9  # m, m/s: rounding of a sticking contact is far below
FORCE = 1e-9  # N, of forces up to some 100 N: the simulator's complementarity residual
DRIFT = 2e-3  # m: h ω² l of a corner that turns at 2 rad/s; the gap that a step opens is closed in the next


@pytest.fixture(scope="module")
def fall():
    return falling_rod()


@pytest.fixture(scope="module")
def rolling():
    return landing_disk(np.random.default_rng(0))


@pytest.fixture(scope="module")
def tipping():
    return tipping_block(np.random.default_rng(0))


@pytest.fixture(scope="module")
def shown():
    return traces(np.random.default_rng(1))


def ends(fall):
    """Positions (m+1, 2, 2) of the rod's ends."""
    q = fall.record.q
    half = 0.5 * DEFAULT.rod_length * np.stack([np.cos(q[:, 2]), np.sin(q[:, 2])], axis=1)
    return np.stack([q[:, :2] - half, q[:, :2] + half], axis=1)


def test_modes_of_a_disk_that_slides_until_it_rolls():
    # friction slows the disk and turns it: v = v0 - μ g t, R ω = -2 μ g t, rolling from t = v0 / (3 μ g) on
    body, v0, mu = disk(), 3.0, 0.2
    q = np.array([0.0, body.shape.radius, 0.0])
    record = simulate(body, q, np.array([v0, 0.0, 0.0]), None, DEFAULT.h, 200, mu, 0.0)
    modes = contact_modes(record)[:, 0]
    assert set(modes) == {Mode.SLIDES, Mode.STICKS}
    rolls = int(np.argmax(modes == Mode.STICKS))
    assert (modes[rolls:] == Mode.STICKS).all()
    assert abs(rolls * record.h - v0 / (3.0 * mu * DEFAULT.gravity)) <= record.h


def test_rod_sticks_with_its_left_end_and_slides_with_its_right(fall):
    left, right = fall.lands
    place, omega = ends(fall), fall.record.v[1:, 2]
    sticks = np.flatnonzero(fall.modes[:, 0] == Mode.STICKS)
    run = sticks[(sticks >= left) & (sticks < right)]
    assert run[0] == left and len(run) > 10
    # the left end stays where it is, but for the curvature of its path in a step, l (h ω)² / 4 about the centre
    moves = np.abs(np.diff(place[run[0] : run[-1] + 2, 0, 0]))
    assert (moves <= 0.25 * DEFAULT.rod_length * (fall.record.h * omega[run]) ** 2 + STUCK).all()
    assert place[left, 1, 1] > 0.5 * DEFAULT.rod_length
    slides = np.flatnonzero(fall.modes[:, 1] == Mode.SLIDES)
    assert slides[0] == right > left and (np.diff(place[slides[0] : slides[-1] + 2, 1, 0]) > 0.0).all()


def test_rod_obeys_coulomb_in_its_modes_and_gains_no_energy(fall):
    record, mu = fall.record, SCENES.rod_mu
    limit = mu * record.c_n
    sticks, slides = fall.modes == Mode.STICKS, fall.modes == Mode.SLIDES
    assert (np.abs(record.c_t[sticks]) <= limit[sticks] + FORCE).all()
    assert np.abs(record.c_t[slides]) == pytest.approx(limit[slides], abs=FORCE)
    assert (record.c_n[fall.modes == Mode.OPEN] == 0.0).all()
    weights = np.array([fall.body.mass, fall.body.mass, fall.body.inertia])
    speed = 0.5 * (record.v**2 @ weights)
    gain = np.diff(speed) + fall.body.mass * fall.body.g * np.diff(record.q[:, 1])
    flight = (fall.modes == Mode.OPEN).all(axis=1)
    # semi-implicit steps lose m (g h)² / 2 each in flight
    step = 0.5 * fall.body.mass * (fall.body.g * record.h) ** 2
    assert gain[flight] == pytest.approx(np.full(flight.sum(), -step), abs=FORCE)
    assert gain[list(fall.lands)].max() < -100.0 * step  # both landings take energy


def test_rod_that_cannot_slide_is_said():
    settings = SceneSettings(rod_mu=10.0, rod_theta=(1.2,), rod_vx=(0.0,), rod_omega=(0.0,))
    with pytest.raises(UserError, match="rod_mu"):
        falling_rod(scenes=settings)


def test_figure_2_2_shows_both_events(fall):
    figure, table = figure_2_2(fall)
    assert_legible(figure)
    for number, (step, end) in enumerate(((fall.lands[0], 0), (fall.lands[1], 1)), start=1):
        drawn = table.loc[table["series"] == f"event {number}", ["x", "y"]].to_numpy()[0]
        assert drawn == pytest.approx(ends(fall)[step, end], abs=EXACT)
    modes = table[table["panel"] == "modes"]
    first = modes[modes["mode"] != "open"].groupby("series").first()
    assert first["mode"].to_dict() == {"left end": "sticks", "right end": "slides"}
    assert first["t"].to_numpy() == pytest.approx(fall.record.t[list(fall.lands)])
    rods = table[table["series"] == "rod"][["x", "y"]].to_numpy().reshape(-1, 2, 2)
    assert np.hypot(*(rods[:, 1] - rods[:, 0]).T) == pytest.approx(np.full(len(rods), DEFAULT.rod_length))


def test_disk_flies_then_rolls_in_the_window(rolling):
    record, R = rolling.record, rolling.body.shape.radius
    modes = contact_modes(record)[rolling.start : rolling.stop, 0]
    assert modes[0] == Mode.OPEN and modes[-1] == Mode.STICKS and rolling.stop - rolling.start == SCENES.window
    v = record.v[rolling.stop]
    assert v[0] == pytest.approx(-R * v[2], abs=STUCK) and v[0] > 0.0
    # landing without rebound: friction takes a third of the speed to turn the disk
    assert v[0] == pytest.approx(SCENES.disk_vx * 2.0 / 3.0, abs=1e-9)


def test_figure_2_4_draws_the_path_and_what_was_observed(rolling):
    figure, table = figure_2_4(rolling)
    assert_legible(figure)
    path = table.loc[table["series"] == "true path", ["x", "y"]].to_numpy()
    assert path == pytest.approx(rolling.record.q[:, :2], abs=EXACT)
    seen = table[table["series"] == "observations in the window"]
    assert (seen["t"] >= rolling.record.t[rolling.start]).all()
    assert (seen["t"] < rolling.record.t[rolling.stop]).all()
    scatter = seen["y"].to_numpy() - np.interp(seen["t"], rolling.record.t, rolling.record.q[:, 1])
    assert 0.5 < scatter.std() / rolling.observed.sigma[0, 1] < 1.6  # 30 draws
    assert table["m"].iloc[0] == SCENES.window


def test_window_that_does_not_fit_is_said():
    with pytest.raises(UserError, match="window"):
        landing_disk(np.random.default_rng(0), scenes=SceneSettings(window=200))


def test_block_tips_in_contact(tipping):
    record = tipping.record
    assert (record.c_n.sum(axis=1) > 0.0).all()
    assert np.abs(record.phi.min(axis=1)).max() < DRIFT
    assert record.q[0, 2] == SCENES.tip_theta and (record.q[:, 2].min() < 0.0)  # past lying flat: it rocks


def test_projection_is_the_shortest_way_to_the_manifold(tipping):
    body, projected = tipping.body, project_motion(tipping)
    single = projected.closed.sum(axis=1) == 1
    assert single.sum() > 50
    theta = np.linspace(-0.3, 0.9, 240001)
    points = body.contact_points(theta)[..., 1]
    k2 = body.inertia / body.mass
    for step in np.flatnonzero(single)[::10]:
        measured, moved = tipping.observed.q[step], projected.q[step]
        pair = int(np.argmax(projected.closed[step]))
        assert body.contacts(moved).phi[pair] == pytest.approx(0.0, abs=EXACT)
        # independent: the least distance over the curve y = -r_y(θ) of that corner
        distance = np.hypot(-points[:, pair] - measured[1], np.sqrt(k2) * (theta - measured[2]))
        # Newton's steps stop on the curve, a second-order distance in the small angle from the nearest point
        way = np.hypot(moved[1] - measured[1], np.sqrt(k2) * (moved[2] - measured[2]))
        assert way == pytest.approx(distance.min(), rel=0.02)
        assert moved[0] == measured[0]


def test_figure_2_5_flat_landing_identifies_nothing_tilted_the_ratio(tipping):
    figure, table = figure_2_5(tipping, project_motion(tipping), landings())
    assert_legible(figure)
    ranks = table.groupby("panel")[["rank", "rank_mass_known"]].first()
    assert ranks.loc["c"].tolist() == [0, 0] and ranks.loc["d"].tolist() == [1, 1]
    manifold = table[(table["panel"] == "b") & (table["series"] == "projected")]
    theta = manifold["k_theta"] * np.sqrt(6.0)  # k² = a²/6
    expected = 0.5 * (np.abs(np.cos(theta)) + np.abs(np.sin(theta)))
    assert manifold["y"].to_numpy() == pytest.approx(expected.to_numpy(), abs=1e-9)
    measured = table[(table["panel"] == "b") & (table["series"] == "measured")]
    theta = measured["k_theta"] * np.sqrt(6.0)
    assert np.abs(measured["y"] - 0.5 * (np.abs(np.cos(theta)) + np.abs(np.sin(theta)))).max() > 1e-3


def test_traces_are_the_farthest_of_the_candidates(shown):
    rng = np.random.default_rng(1)
    releases("block", SCENES.candidates, rng)  # drawn first
    q, v = releases("ellipse", SCENES.candidates, rng)
    body = ellipse()
    ways = [
        np.ptp(simulate(body, a, b, None, DEFAULT.h, DEFAULT.steps, DEFAULT.mu, DEFAULT.epsilon).q[:, 0])
        for a, b in zip(q, v)
    ]
    assert np.ptp(shown["ellipse"][1].q[:, 0]) == pytest.approx(max(ways))
    assert max(ways) > 1.1 * np.median(ways)


def test_wheel_sticks_with_high_friction_and_slides_with_low(shown):
    modes = {name: contact_modes(record) for name, (_, record) in shown.items() if "wheel" in name}
    high, low = modes["wheel, high friction"], modes["wheel, low friction"]
    assert (high == Mode.SLIDES).sum() < 0.02 * (high == Mode.STICKS).sum()
    assert (low == Mode.SLIDES).sum() > 5 * (low == Mode.STICKS).sum()
    ways = {name: np.ptp(shown[name][1].q[:, 0]) for name in modes}
    assert ways["wheel, low friction"] > ways["wheel, high friction"]


def test_figure_2_9_draws_rigid_bodies_on_their_slopes(shown):
    figure, table = figure_2_9(shown)
    assert all(ax.get_aspect() == 1.0 for ax in figure.axes)
    outlines = table[(table["panel"] == "block") & (table["series"] == "outline")]
    for _, outline in outlines.groupby("t"):
        sides = np.diff(outline[["x", "y"]].to_numpy(), axis=0)
        assert np.hypot(*sides.T) == pytest.approx(np.full(4, DEFAULT.side))
    ground = table[(table["panel"] == "wheel, low friction") & (table["series"] == "ground")]
    slope = np.diff(ground[["x", "y"]].to_numpy(), axis=0)[0]
    assert -slope[1] / slope[0] == pytest.approx(np.tan(DEFAULT.wheel.slope))
    # nothing is drawn below the ground of the block
    assert outlines["y"].min() > -DRIFT * 10


def bouncing_ellipse() -> Dataset:
    """Vertical bounces of a level ellipse at 250 Hz: trial 3 has four impacts, trial 5 none."""
    shape, g, rest = Ellipse(semi_axes=(0.035, 0.025)), 9.81, 0.5
    t = np.arange(500) * 0.004
    height, speed, y = 0.3, 0.0, []
    for _ in t:
        y.append(height)
        speed -= g * 0.004
        height += speed * 0.004
        if height < shape.semi_axes[1]:
            height, speed = shape.semi_axes[1], -rest * speed
    bounce = pd.DataFrame({"trial": 3, "t": t, "x": 0.2 * t, "y": y, "theta": 0.0})
    flight = pd.DataFrame({"trial": 5, "t": t[:50], "x": 0.0, "y": 5.0 - 0.5 * g * t[:50] ** 2, "theta": t[:50]})
    header = Header(schema=1, body=Body(shape=shape, mass=0.0364, radius_of_gyration=0.0215), gravity=g, rate=250.0)
    return Dataset("bounces", header, pd.concat([bounce, flight], ignore_index=True))


def test_figure_2_14_ends_at_the_third_impact():
    dataset = bouncing_ellipse()
    figure, table = figure_2_14(dataset)
    path = table[table["series"] == "path of the centre"]
    samples = dataset.trajectories[dataset.trajectories["trial"] == 3]
    # fall from 0.275 m above the surface, then e, e² times the speed: third impact after (1 + 2 e + 2 e²) t_fall
    fall_time = np.sqrt(2.0 * 0.275 / 9.81)
    assert path["t"].max() == pytest.approx(fall_time * (1.0 + 2.0 * 0.5 + 2.0 * 0.25), abs=0.02)
    drawn = table[table["series"] == "outline"]
    assert len(drawn["t"].unique()) < 0.2 * len(path)  # sparse
    assert set(np.round(drawn["t"], 9)) <= set(np.round(samples["t"], 9))
    assert np.ptp(drawn[drawn["t"] == drawn["t"].min()]["x"]) == pytest.approx(0.07, rel=1e-3)
    assert all(ax.get_aspect() == 1.0 for ax in figure.axes)


def test_figure_2_14_of_a_trial_without_three_impacts_shows_all_of_it():
    dataset = bouncing_ellipse()
    flight = dataset.trajectories[dataset.trajectories["trial"] == 5]
    _, table = figure_2_14(Dataset("flight", dataset.header, flight))
    assert (table["series"] == "path of the centre").sum() == 50


def test_figure_2_14_says_what_is_missing():
    dataset = bouncing_ellipse()
    with pytest.raises(UserError, match="trajectories"):
        figure_2_14(Dataset("impacts only", dataset.header, None))
