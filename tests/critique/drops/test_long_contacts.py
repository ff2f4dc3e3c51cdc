"""Contacts of several milliseconds, whose details bend what is found of other causes."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from test_contact_time import BODIES, EPSILON, MU, drops

from thesis_lib.critique.contacts.bases import BASES
from thesis_lib.critique.contacts.contact_time import duration
from thesis_lib.critique.contacts.kinds import bind
from thesis_lib.critique.contacts.model import Model
from thesis_lib.critique.contacts.pressing import press
from thesis_lib.critique.drops.world import Drops
from thesis_lib.critique.likelihood.comparison import Comparison
from thesis_lib.critique.likelihood.fit import fit
from thesis_lib.critique.likelihood.flights import Flights
from thesis_lib.critique.likelihood.observations import observe
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.effects import EFFECTS
from thesis_lib.effects.effect import Rig
from thesis_lib.mechanics.state import State
from thesis_lib.simulate.rig.hidden_causes import SQUARE
from thesis_lib.studies.proof.cases import SEEDS, Case, make

LONG = 3e-3  # s
RIG = Rig(SQUARE.shape, SQUARE.radius_of_gyration, 9.81, 0.0)


def with_effect(name: str, **values: float) -> tuple[Model, dict[str, float]]:
    """An integrated contact with an effect, and its true values."""
    model = Model(BASES["compliant_contact"], (EFFECTS[name],), takes_time=True)
    at = {"mu": MU, "epsilon": EPSILON, "tau": LONG / duration(1.0, EPSILON)}
    nulls = {key: p.null for key, p in model.parameters.items()}
    return model, nulls | at | {f"{name}.{key}": value for key, value in values.items()}


# without what is tested here they lie 3.5 to 5.5 standard errors from the truth
@pytest.mark.slow
@pytest.mark.parametrize(
    ("cause", "effect", "shape"),
    [
        ("time_lag", "time_lag", "ellipse"),
        ("tilt", "surface_tilt", "square"),
        ("friction_slope", "position_dependent_friction", "ellipse"),
    ],
)
def test_effects_under_long_contacts_are_where_they_were_hidden(cause, effect, shape):
    dataset, true = make(Case("mechanism", cause, SEEDS, shape=shape, contact_time=LONG))
    model, start = with_effect(effect)
    (name, value), *_ = ((name, value) for name, value in true.items() if name in start)
    found = fit(model, observe(dataset), start | {name: 0.9 * value})
    assert abs(found.values[name] - value) < 3.0 * found.std[name]
    assert found.values[name] == pytest.approx(value, rel=0.015)


@pytest.mark.parametrize("shape", BODIES)
def test_a_contact_that_is_integrated_does_not_hang_on_the_instant_that_was_detected(shape):
    made = drops(shape, LONG, noisy=False)
    o = observe(Dataset(shape, made.header, made.trajectories), episodes=False)
    model, values = with_effect("time_lag")
    w = np.abs(Comparison(model, values, o).noisy.by_instant) * [1.0, 1.0, RIG.k_g, 1.0, 1.0, RIG.k_g, 1.0]
    # m/s² and m/s; lines that move by their own slope give 14 and 0.3
    assert np.median(w[:, :3]) < 0.1 and np.median(w[:, 3:6]) < 0.02
    assert np.median(w[:, 6]) > 0.5  # arcs that come apart: the normal velocity


def test_what_accelerates_in_flight_does_so_in_contact():
    lands = State.of(np.array([[0.0, 0.03, 0.0]]), np.array([[0.3, -2.0, 0.0]]), np.zeros(1, int), np.zeros(1))
    for name, of, gained in (
        ("surface_tilt", {"phi": 0.3}, 9.81 * np.sin(0.3)),
        ("quadratic_drag", {"c_q": 2.0}, -2.0 * 0.5 * (np.hypot(0.3, 2.0) + np.hypot(0.3, 1.1)) * 0.3),
    ):
        model, values = with_effect(name, **of)
        after, elapsed = press(bind(model, values | {"mu": 0.0}, RIG), lands)
        assert after.vx[0] - 0.3 == pytest.approx(gained * elapsed[0], rel=0.05)


def test_a_contact_is_over_where_the_body_is_out_of_its_dent():
    model, values = with_effect("time_lag")
    turns = np.linspace(-0.05, 0.05, 21)
    height = 0.03 * (np.cos(turns) + np.abs(np.sin(turns)))
    n = len(turns)
    q = np.column_stack([np.zeros(n), height, turns])
    v = np.column_stack([np.full(n, 0.3), np.full(n, -1.0), np.zeros(n)])
    after, _ = press(bind(model, values, RIG), State.of(q, v, np.arange(n), np.zeros(n)))
    assert bind(model, values, RIG).gap(after).min() > -1e-6


@pytest.mark.parametrize("contact_time", [1e-3, LONG])
def test_samples_in_a_contact_belong_to_no_flight_and_a_wrong_height_is_none(contact_time):
    made = drops("square", contact_time)
    lasting = 1.5 * contact_time / duration(1.0, EPSILON)
    for raised in (0.0, 3e-3):
        poses = made.trajectories.assign(y=made.trajectories["y"] - raised)
        found = observe(Dataset("square", made.header, poses), episodes=False).found
        assert found.guard == pytest.approx(max(lasting, 1e-3), rel=0.2)


def test_a_parabola_through_a_long_flight_with_drag_is_predicted():
    span, c = 0.3, 0.36
    times = np.linspace(-0.5 * span, 0.5 * span, 76)

    def rate(_: float, s: np.ndarray) -> np.ndarray:
        v = s[2:]
        return np.concatenate([v, [0.0, -9.81] - c * np.hypot(*v) * v])

    ends = (0.0, span)
    path = solve_ivp(rate, ends, [0.0, 1.0, 1.0, 1.0], t_eval=times + 0.5 * span, rtol=1e-9, atol=1e-12).y[:2].T
    B = np.stack([np.ones_like(times), times, 0.5 * times**2], axis=1)
    q, v, a = (np.append(row, 0.0)[None] for row in np.linalg.lstsq(B, path, rcond=None)[0])
    flights = Flights(State.of(q, v, np.zeros(1, int), np.zeros(1)), np.ones((1, 3)), a, np.array([span]))
    model, values = with_effect("quadratic_drag", c_q=c)
    dragged = np.abs(a - [0.0, -9.81, 0.0]).max()
    # to first order alone 1 % and more
    assert np.abs(flights.residuals(bind(model, values, RIG))).max() < 5e-3 * dragged


@pytest.mark.slow
@pytest.mark.parametrize(
    ("cause", "shape", "contact_time", "without"),
    [("linear_drag", "ellipse", 1e-3, 1.2), ("time_lag", "square", 3e-4, 2.5), ("com_offset_x", "ellipse", 1e-3, 1.5)],
)
def test_the_gap_is_judged_where_the_flights_of_the_model_meet(cause, shape, contact_time, without):
    """The detection takes another instant for the impact where it does not know the cause; no instant of its enters."""
    o = observe(make(Case("mechanism", cause, SEEDS, 60, noise=0.3, shape=shape, contact_time=contact_time))[0])
    world, effect = Drops(o), EFFECTS[cause.removesuffix("_x")]
    off, on = (world.fit("mirtich", effects) for effects in ((), (effect,)))
    misfit = np.sqrt([world.judge(fit).sigmas["touch"] for fit in (off, on)])
    assert misfit[0] > without and 0.7 < misfit[1] < 1.4
    # impacts that are taken for later ones by 0.1 ms, in all arcs: the same lines, followed for longer
    late, a = 1e-4, o.rig.fall(State.of(o.value[:, 0], o.slope[:, 0], o.trial, o.t)).T[:, None]
    moved = replace(o, value=o.value + late * (o.slope - o.bow[:, :, 1:] * a), slope=o.slope + late * a)
    later = Drops(moved).judge(on).sigmas["touch"]
    assert np.sqrt(later) == pytest.approx(misfit[1], rel=0.05)
