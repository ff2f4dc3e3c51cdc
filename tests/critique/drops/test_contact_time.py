"""Contacts that take time: where the arcs meet, what the body turns by, and the verdict on a rig with such contacts."""

import re
from functools import cache

import numpy as np
import pytest
from hidden_effects import LAW, TRUTH, observed

from thesis_lib.bodies.body import Body
from thesis_lib.contact import LAWS
from thesis_lib.critique.contacts.contact_time import CONTACT_TIME, duration
from thesis_lib.critique.contacts.kinds import bind
from thesis_lib.critique.contacts.model import Model
from thesis_lib.critique.drops.criticise import DropsCritique, criticise_drops
from thesis_lib.critique.likelihood.comparison import Comparison
from thesis_lib.critique.likelihood.fit import fit
from thesis_lib.critique.likelihood.observations import observe
from thesis_lib.critique.likelihood.synthesis import synthesise
from thesis_lib.critique.results.diagnosis import diagnosis
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.impacts import POSE, V_POST, V_PRE
from thesis_lib.effects.effect import Rig
from thesis_lib.mechanics.state import State
from thesis_lib.simulate.compliant.drops import simulate_compliant_drops
from thesis_lib.simulate.rig.hidden_causes import ELLIPSE_BODY, PROOF_RELEASE, RIG_NOISE, SQUARE, CompliantContact
from thesis_lib.simulate.rig.record import DropsWithTruth
from thesis_lib.simulate.rig.tracker import Tracker

BODIES = {"ellipse": ELLIPSE_BODY, "square": SQUARE}
EPSILON, MU = 0.55, 0.15
T = 1e-3  # s; a plastic body on a metal plate
SIGMAS = 4.0
CENTRAL = 0.02  # of τ: contacts are oblique, and gravity and friction act in them


@cache
def drops(shape: str, contact_time: float = T, noisy: bool = True) -> DropsWithTruth:
    contact = CompliantContact(mu=MU, epsilon=EPSILON, contact_time=contact_time)
    noise, rng = RIG_NOISE if noisy else None, np.random.default_rng(1)
    return simulate_compliant_drops(BODIES[shape], PROOF_RELEASE, 150, contact=contact, noise=noise, rng=rng)


@cache
def critique(shape: str, contact_time: float = T) -> DropsCritique:
    made = drops(shape, contact_time)
    return criticise_drops(Dataset(shape, made.header, made.trajectories), rng=np.random.default_rng(1))


def where_arcs_meet(body: Body, made: DropsWithTruth, tau: float) -> tuple[State, np.ndarray]:
    """Free arcs before and after, at the centroid of the impulse: state before (n, …) and velocity after (n, 3).

    Only contacts of one corner that part within two contact times, from a fall of at least 0.3 m/s.
    """
    table = made.impacts
    r = body.shape.contact_point(table["theta"].to_numpy())
    v_n = table["vy_pre"] + r[:, 0] * table["omega_pre"]
    table = table[table["separated"] & (table["duration"] < 2.0 * T) & (v_n < -0.3)]
    r_x = body.shape.contact_point(table["theta"].to_numpy())[:, 0]
    delay = (tau / np.sqrt(1.0 + (r_x / body.radius_of_gyration) ** 2))[:, None]
    gravity = np.array([0.0, -9.81, 0.0])
    q, v, v_post = (table[list(names)].to_numpy() for names in (POSE, V_PRE, V_POST))
    later = table["duration"].to_numpy()[:, None] - delay
    before = State.of(q + v * delay, v + gravity * delay, table["trial"].to_numpy(), table["t"].to_numpy())
    return before, v_post - gravity * later


@pytest.mark.slow
@pytest.mark.parametrize("shape", BODIES)
def test_an_instantaneous_law_holds_at_the_centroid_of_the_impulse(shape):
    body = BODIES[shape]
    rig = Rig(body.shape, body.radius_of_gyration, 9.81, 0.0)
    tau = T / duration(1.0, EPSILON)
    errors = {}
    for name, at, values in (("at touch", 0.0, {}), ("at the centroid", tau, {}), ("turned", tau, {"tau": tau})):
        before, after = where_arcs_meet(body, drops(shape, noisy=False), at)
        predicted = bind(
            Model(LAWS["mirtich"], takes_time="tau" in values), {"mu": MU, "epsilon": EPSILON, **values}, rig
        ).predict(before)
        error = (after - predicted.v) * [1.0, 1.0, body.radius_of_gyration]
        errors[name] = np.median(np.linalg.norm(error, axis=1))
    # each order of the expansion removes about half of the error or more
    assert errors["at the centroid"] < 0.5 * errors["at touch"]
    assert errors["turned"] < 0.65 * errors["at the centroid"]
    assert errors["turned"] < 0.003  # m/s; the floor of these drops is 0.008 to 0.013


def test_duration_of_a_half_sine_is_twice_its_centroid():
    assert duration(0.5e-3, 1.0) == pytest.approx(1e-3)
    assert duration(1.0, 0.0) == pytest.approx(np.pi / 2)  # a quarter of a sine, all of it loading


@pytest.mark.slow
def test_fit_finds_the_contact_time_with_an_honest_error():
    model, true = Model(LAW, takes_time=True), TRUTH | {"tau": 5e-4}
    z = []
    for seed in range(12):
        fitted = fit(model, synthesise(Comparison(model, true, observed()), np.random.default_rng(seed)))
        z.append([(fitted.values[name] - value) / fitted.std[name] for name, value in true.items()])
    assert np.abs(np.mean(z, axis=0)).max() < SIGMAS / np.sqrt(len(z))
    assert np.mean(np.square(z)) == pytest.approx(1.0, abs=SIGMAS * np.sqrt(2.0 / np.size(z)))


def test_without_contact_time_nothing_changes():
    before = State.of(*np.random.default_rng(0).standard_normal((2, 5, 3)), np.arange(5), np.zeros(5))
    rig = Rig(ELLIPSE_BODY.shape, ELLIPSE_BODY.radius_of_gyration, 9.81, 0.0)
    plain, depth = bind(Model(LAW), TRUTH, rig).strike(before)
    timed, none = bind(Model(LAW, takes_time=True), TRUTH | {"tau": 0.0}, rig).strike(before)
    assert np.array_equal(plain.v, timed.v) and not depth.any() and not none.any()


@pytest.mark.slow
@pytest.mark.parametrize("shape", BODIES)
def test_a_contact_of_a_millisecond_with_nothing_hidden_is_adequate(shape):
    judged = critique(shape)
    assert judged.verdict == "adequate"
    assert not judged.discovery.steps
    fitted = judged.ladder[-1][1]
    true = T / duration(1.0, EPSILON)
    assert abs(fitted.values["tau"] - true) < CENTRAL * true + SIGMAS * fitted.std["tau"]
    assert fitted.values["epsilon"] == pytest.approx(EPSILON, abs=0.005)
    assert fitted.values["mu"] == pytest.approx(MU, abs=0.002)
    summary = " ".join(diagnosis(judged, np.random.default_rng(0))["summary"])
    last = re.search(r"Contacts last about ([\d.]+) ms", summary)
    assert last and float(last[1]) == pytest.approx(1e3 * duration(fitted.values["tau"], EPSILON), rel=0.02)


def test_a_contact_too_short_to_be_seen_has_no_time():
    made = drops("ellipse", 2e-5)
    fitted = fit(Model(LAWS["mirtich"], takes_time=True), observe(Dataset("short", made.header, made.trajectories)))
    assert abs(fitted.values["tau"] - 1.1e-5) < SIGMAS * fitted.std["tau"]
    assert fitted.std["tau"] < 0.1 * CONTACT_TIME.scale


FILTERS = {
    "as seen": {},
    "moving average": {"filter": "moving_average"},
    "Butterworth": {"filter": "butterworth"},
    "Butterworth, both ways": {"filter": "zero_phase_butterworth"},
    "Kalman smoother": {"filter": "kalman_smoother"},
    "first order": {"time_constant": 5e-3},
}
FOOLED = 0.12  # ms; a Kalman smoother is at 0.08, the others are below 0.04


@pytest.mark.parametrize("recorded", FILTERS)
def test_smoothed_samples_are_not_taken_for_long_contacts(recorded):
    """A filter rounds the corner at an impact as a contact of many milliseconds would."""
    contact = CompliantContact(mu=MU, epsilon=EPSILON, contact_time=T, steps=60)
    tracker, rng = Tracker(**FILTERS[recorded]), np.random.default_rng(5)
    made = simulate_compliant_drops(
        ELLIPSE_BODY, PROOF_RELEASE, 100, contact=contact, noise=RIG_NOISE, rng=rng, tracker=tracker
    )
    o = observe(Dataset("filtered", made.header, made.trajectories), episodes=False)
    fitted = fit(Model(LAWS["mirtich"], takes_time=True), o)
    lasts = 1e3 * duration(fitted.values["tau"], EPSILON)
    assert lasts == pytest.approx(1e3 * T, abs=FOOLED)
    assert fitted.values["epsilon"] == pytest.approx(EPSILON, abs=0.002)
    assert any("were smoothed" in text for text in o.found.warnings) == bool(FILTERS[recorded])
