"""Flights in space: what a right model leaves of them is noise, and they show what is wrong in one that is not."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares
from test_box_in_space import RIG
from tosses import simulate_tosses

from thesis_lib.contact import LAWS
from thesis_lib.critique.contacts.dynamics import COURSE
from thesis_lib.critique.contacts.kinds import bind
from thesis_lib.critique.contacts.model import Model
from thesis_lib.critique.likelihood.in_space.hits import observe_in_space
from thesis_lib.datasets import dataset_of
from thesis_lib.datasets.format.table_forms import POSITION
from thesis_lib.effects import EFFECTS
from thesis_lib.mechanics.space import SPACE, of_rotation_vector
from thesis_lib.mechanics.state import State
from thesis_lib.statistics.spread import robust_std

HALF = np.array([0.05, 0.04, 0.03])
RADII = np.sqrt((np.sum(HALF**2) - HALF**2) / 3.0)
BODY = {"shape": {"kind": "box", "half_extents": HALF.tolist()}, "radii_of_gyration": RADII.tolist()}
CONTENT = {"schema": 2, "body": BODY, "rate": 240.0, "noise": {"position": 2e-4, "rotation": 3e-3}}
TRIALS, GRAVITY = 40, 9.81
NEAR = 0.12  # of a spread from a thousand values: four standard errors


def tossed(seed=1, noise=(2e-4, 3e-3), body=None, **hidden):
    """Tosses of a body, seen by a camera, that are as `hidden` and not as believed."""
    header = CONTENT | {"body": BODY | (body or {})} | hidden
    made = simulate_tosses(header, TRIALS, np.random.default_rng(seed), noise=noise)
    return dataset_of(CONTENT, trajectories=made.trajectories)


def model_with(*effects):
    return Model(LAWS["anitescu_potra_newton"], tuple(EFFECTS[name] for name in effects), space=SPACE)


def left(o, *effects, **values):
    """Whitened residuals (m, 12) of the flights of a model with these effects, at null but for `values`."""
    model = model_with(*effects)
    at = {name: p.null for name, p in model.parameters.items()} | values
    return o.flights.whitened(bind(model, at, o.rig))


def named_by_flights(o, effect):
    """Parameters of an effect with their standard errors, by the flights alone."""
    model = model_with(effect)
    names = {f"{effect}.{p.name}": p for p in model.parameters_of(EFFECTS[effect])}
    scale = np.array([p.scale for p in names.values()])
    start = [p.null + 0.1 * p.scale for p in names.values()] / scale
    found = least_squares(lambda x: left(o, effect, **dict(zip(names, x * scale))).ravel(), start)
    std = np.sqrt(np.diag(np.linalg.inv(found.jac.T @ found.jac)))
    return dict(zip((p.name for p in names.values()), zip(found.x * scale, std * scale)))


@pytest.fixture(scope="module")
def as_believed():
    return observe_in_space(tossed())


@pytest.mark.slow
def test_what_a_right_model_leaves_is_noise_of_unit_variance(as_believed):
    z = left(as_believed)
    assert len(z) > TRIALS
    assert robust_std(z, None) == pytest.approx(1.0, abs=NEAR)
    np.testing.assert_allclose(robust_std(z), 1.0, atol=0.5)  # four standard errors of a component
    # no contact of another corner, however weak, within what counts as a flight: it would turn the body
    assert np.abs(z).max() < 5.0
    across = np.corrcoef(np.clip(z, -3.0, 3.0).T) - np.eye(12)
    assert np.abs(across).max() < 4.0 / np.sqrt(len(z))
    assert not len(as_believed.flights.bent)


@pytest.mark.slow
def test_frames_may_be_lost_and_noise_may_be_beyond_what_is_stated():
    dataset = tossed(seed=2)
    table = dataset.trajectories[np.random.default_rng(0).random(len(dataset.trajectories)) < 0.7]
    z = left(observe_in_space(type(dataset)("d", dataset.header, table)))  # of some 20 flights
    assert robust_std(z, None) == pytest.approx(1.0, abs=NEAR * np.sqrt(1000.0 / z.size))
    assert robust_std(left(observe_in_space(tossed(noise=(4e-4, 6e-3)))), None) == pytest.approx(1.0, abs=NEAR)


@pytest.mark.slow
def test_a_flight_with_a_hit_that_nobody_detected_is_left_out():
    dataset = tossed(seed=3)
    table = dataset.trajectories.copy()
    whole = observe_in_space(dataset).flights
    i = int(np.argmax(whole.span))
    after = (table["trial"] == whole.trial[i]) & (table["t"] > whole.state.t[i])
    table.loc[after, "x"] += 0.09 * (table.loc[after, "t"] - whole.state.t[i])  # too weak a kink for the detection
    found = observe_in_space(type(dataset)("d", dataset.header, table)).flights
    assert len(found) == len(whole) - 1 and found.bent.tolist() == [whole.trial[i]]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("effect", "hidden", "true"),
    [
        ("com_offset", {"body": {"center_of_mass": [3e-3, 0.0, -1e-3]}}, {"c_x": 3e-3, "c_y": 0.0, "c_z": -1e-3}),
        ("marker_offset", {"tracked": {"position": [0.0, 2e-3, 1e-3]}}, {"d_x": 0.0, "d_y": 2e-3, "d_z": 1e-3}),
        ("wrong_gravity", {"gravity": [0.0, 0.0, -10.0]}, {"dg": 10.0 - GRAVITY}),
    ],
)
def test_flights_alone_find_what_is_wrong_in_them(effect, hidden, true):
    o = observe_in_space(tossed(seed=4, **hidden))
    assert robust_std(left(o), 0).max() > 2.0
    for name, (value, std) in named_by_flights(o, effect).items():
        assert abs(value - true[name]) < 3.0 * std and std < 5e-3 * max(1.0, abs(true[name]) * 1e3)
    fitted = {f"{effect}.{name}": value for name, (value, _) in named_by_flights(o, effect).items()}
    assert robust_std(left(o, effect, **fitted), None) == pytest.approx(1.0, abs=NEAR)


@pytest.mark.slow
def test_lengths_that_are_too_long_show_in_gravity():
    dataset = tossed(seed=5)
    table = dataset.trajectories
    table = table.assign(**{name: 1.02 * table[name] for name in POSITION})
    o = observe_in_space(type(dataset)("d", dataset.header, table))
    value, std = named_by_flights(o, "length_scale")["s_L"]
    assert abs(value - 0.02) < 3.0 * std and std < 1e-3


@pytest.mark.parametrize(
    ("effects", "values"),
    [
        (("linear_drag", "magnus"), {"linear_drag.c_v": 0.5, "linear_drag.c_w": 0.5, "magnus.k_m": 0.02}),
        (("com_offset", "quadratic_drag"), {"com_offset.c_x": 5e-3, "com_offset.c_z": -5e-3}),
    ],
)
def test_the_course_of_a_flight_is_that_of_many_small_steps(effects, values, rng):
    n = 6
    pose = np.concatenate([rng.uniform(-0.1, 0.3, (3, n)), of_rotation_vector(2.0 * rng.standard_normal((3, n)))])
    motion = np.concatenate([rng.standard_normal((3, n)), 6.0 * rng.standard_normal((3, n))])
    start = State(pose, motion, np.arange(n), np.zeros(n), None, SPACE)
    model = model_with(*effects)
    at = {name: p.null + 3.0 * p.scale for name, p in model.parameters.items()} | values
    dynamics, half, steps = bind(model, at, RIG), np.full(n, 0.15), 500
    course = dynamics.course(start, half)
    for j in (0, 7, 11):
        small = start
        for _ in range(steps):
            small = dynamics.flown(small, half * COURSE[j] / steps)
        off = SPACE.difference(course.select(np.arange(n) * len(COURSE) + j).pose, small.pose)
        assert np.abs(off[:3]).max() < 1e-5 and np.abs(off[3:]).max() < 1e-3


def test_a_true_inertia_turns_the_body_in_flight(as_believed):
    """An inertia of other proportions shows in flights, one that is larger as a whole does not."""
    flights, rig = as_believed.flights, as_believed.rig
    model = model_with("wrong_inertia")
    at = {name: p.null for name, p in model.parameters.items()}
    here = flights.residuals(bind(model, at, rig))
    np.testing.assert_allclose(flights.residuals(bind(model, at | {"wrong_inertia.d_I": 0.3}, rig)), here, atol=1e-6)
    several = at | {"wrong_inertia.d_I": np.full(len(flights), 0.3)}
    np.testing.assert_allclose(flights.residuals(bind(model, several, rig)), here, atol=1e-6)
    longer = bind(model, at, replace(rig, tensor=rig.tensor * [1.0, 1.0, 1.2]))
    np.testing.assert_allclose(flights.residuals(longer)[:, :3], here[:, :3], atol=1e-9)
    assert np.abs(flights.residuals(longer) - here)[:, 3:6].max() > 5.0
