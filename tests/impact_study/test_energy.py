"""Energy in flight and over impacts, on exact flights and impacts of known loss."""

from dataclasses import replace

import numpy as np
import pytest

from thesis_lib.bodies.body import Body
from thesis_lib.bodies.shapes import Disk, Ellipse, Polygon
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.header import Header
from thesis_lib.datasets.format.impacts import Impacts
from thesis_lib.thesis.impact_study.energy import WINDOWS, energy_statements, flights, rest_height, total_energy

G, RATE, TAKEN = 9.81, 250.0, 0.1
ROUNDING = 1e-12  # relative, of sums of three squares
SHAPE = Ellipse(semi_axes=(0.035, 0.025))
BODY = Body(shape=SHAPE, mass=0.04, radius_of_gyration=0.019)
DATASET = Dataset("bounces", Header(schema=1, body=BODY, gravity=G, rate=RATE))
TERMS = {"k_g": BODY.radius_of_gyration, "gravity": G, "rest": 0.025}


def bounces(rng, n_trials: int = 12, hits: int = 3) -> Impacts:
    """Trials of several hits: free flights between them, and each hit takes the share TAKEN of the energy."""
    rows = []
    for trial in range(n_trials):
        q, v, t = np.array([0.0, 0.04, 0.3]), rng.normal([0.5, -2.5, 3.0], [0.1, 0.1, 2.0]), 0.1
        for impact in range(hits):
            before = total_energy(q[None], v[None], **TERMS)[0]
            potential = total_energy(q[None], np.zeros((1, 3)), **TERMS)[0]
            speed = np.sqrt(((1.0 - TAKEN) * before - potential) / (before - potential))
            after = speed * v * [1.0, -1.0, 1.0]
            rows.append((trial, impact, t, q, v, after))
            assert np.isfinite(after).all()
            # alternately short and long flights, which do not end at the same height
            tau = 0.05 if impact % 2 else 0.46
            q, v, t = q + after * tau - [0, 0.5 * G * tau**2, 0], after - [0, G * tau, 0], t + tau
    order = rng.permutation(len(rows))
    trial, impact, t, q, pre, post = (np.array([rows[i][k] for i in order]) for k in range(6))
    return Impacts(trial, impact, q, pre, post, SHAPE.contact_point(q[:, 2]), BODY.radius_of_gyration, 0.04, t=t)


def values(impacts, dataset=DATASET):
    table = energy_statements(dataset, impacts)
    return {row.statement: (row.value, row.std) for row in table.itertuples()}


def test_flights_keep_their_energy_and_hits_take_theirs(rng):
    found = values(bounces(rng))
    assert found["energy_between"][0] == pytest.approx(0.0, abs=ROUNDING)
    assert found["energy_taken"][0] == pytest.approx(TAKEN, rel=ROUNDING)
    assert found["energy_loss"][0] == 1.0 and found["energy_loss"][1] > 0.0


def test_energy_lost_in_flight_is_found(rng):
    """A tenth of the velocity is gone at the end of each flight, so 19 % of the kinetic energy."""
    impacts = bounces(rng)
    later = (impacts.impact > 0)[:, None]
    slowed = replace(impacts, v_pre=np.where(later, 0.9 * impacts.v_pre, impacts.v_pre))
    change, std = values(slowed)["energy_between"]
    assert -0.19 - 1e-9 < change < -0.1 and abs(change) > 5 * std


def test_a_wrong_gravity_is_found(rng):
    wrong = Dataset("bounces", DATASET.header.model_copy(update={"gravity": 0.8 * G}))
    assert abs(values(bounces(rng), wrong)["energy_between"][0]) > 1e-3


def test_impacts_that_gain_energy_count_against_the_fall(rng):
    impacts = bounces(rng)
    gains = np.arange(len(impacts)) % 4 == 0
    some = replace(impacts, v_post=np.where(gains[:, None], 2.0 * impacts.v_pre, impacts.v_post))
    assert values(some)["energy_loss"][0] == pytest.approx(1.0 - gains.mean())


def test_flights_are_between_successive_impacts_of_one_trial(rng):
    impacts = bounces(rng, n_trials=3, hits=4)
    a, b = flights(impacts)
    assert len(a) == 9
    assert (impacts.trial[a] == impacts.trial[b]).all() and (impacts.impact[b] - impacts.impact[a] == 1).all()
    # an impact that could not be measured leaves two flights without an end
    gap = impacts.select(~((impacts.trial == 1) & (impacts.impact == 1)))
    assert len(flights(gap)[0]) == 7
    long = flights(impacts, longer_than=WINDOWS / RATE)
    assert len(long[0]) == 6 and (impacts.impact[long[0]] != 1).all()
    assert len(flights(replace(impacts, t=np.full(len(impacts), np.nan)))[0]) == 0


def test_without_long_flights_nothing_is_said_about_them(rng):
    few = bounces(rng, n_trials=2, hits=2)
    assert set(values(few)) == {"energy_loss", "energy_taken"}
    one_each = bounces(rng, hits=1)
    unsampled = Dataset("impacts", DATASET.header.model_copy(update={"rate": None}))
    assert set(values(one_each, unsampled)) == {"energy_loss", "energy_taken"}


def test_rest_is_the_lowest_pose_that_touches():
    assert rest_height(SHAPE) == pytest.approx(0.025, abs=1e-9)
    assert rest_height(Disk(radius=0.03), height=0.1) == pytest.approx(0.13)
    square = Polygon(vertices=((1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)))
    assert rest_height(square, height=-0.5) == pytest.approx(0.5, abs=1e-9)
