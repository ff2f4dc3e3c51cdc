"""Episodes: hits that follow each other too quickly are predicted together, from one measurable flight to the next."""

import re
from dataclasses import replace
from functools import cache

import numpy as np
import pandas as pd
import pytest
from hidden_effects import sizes
from test_contact_time import BODIES, EPSILON, MU, SIGMAS, T, critique, drops

from thesis_lib.bodies.shapes import Corner
from thesis_lib.contact import LAWS
from thesis_lib.critique.contacts import episodes
from thesis_lib.critique.contacts.bases import BASES
from thesis_lib.critique.contacts.contact_time import duration
from thesis_lib.critique.contacts.episodes import MOST_HITS, Played
from thesis_lib.critique.contacts.kinds import bind, kind_of
from thesis_lib.critique.contacts.model import Model
from thesis_lib.critique.contacts.pressing import press
from thesis_lib.critique.drops.settings import CritiqueSettings
from thesis_lib.critique.drops.unpredictable import predictable
from thesis_lib.critique.drops.world import Drops
from thesis_lib.critique.likelihood.comparison import Comparison
from thesis_lib.critique.likelihood.fit import fit
from thesis_lib.critique.likelihood.observations import Observations, observe
from thesis_lib.critique.likelihood.synthesis import synthesise
from thesis_lib.critique.results.diagnosis import diagnosis
from thesis_lib.critique.results.tables import impacts
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.impacts import POSE, V_POST, V_PRE
from thesis_lib.effects import EFFECTS
from thesis_lib.effects.effect import Rig
from thesis_lib.mechanics.state import State
from thesis_lib.simulate.rig.hidden_causes import SQUARE

MODEL = Model(LAWS["mirtich"], takes_time=True)
RIG = Rig(SQUARE.shape, SQUARE.radius_of_gyration, 9.81, 0.0)
APART = 0.024  # s; a flight of that length has the five samples that measure it
FREE = 0.004  # s after the last hit


def truth(contact_time: float) -> dict[str, float]:
    return {"mu": MU, "epsilon": EPSILON, "tau": contact_time / duration(1.0, EPSILON)}


@cache
def observed(contact_time: float = T, episodes: bool = True) -> Observations:
    made = drops("square", contact_time)
    return observe(Dataset("square", made.header, made.trajectories), episodes=episodes)


def simulated_episodes(table: pd.DataFrame) -> list[pd.DataFrame]:
    """Contacts of the simulator between two flights of at least `APART`, without the last of each trial."""
    groups = []
    for _, trial in table.groupby("trial"):
        ends = trial["t"] + trial["duration"]
        number = np.r_[0, np.cumsum(trial["t"].to_numpy()[1:] - ends.to_numpy()[:-1] > APART)]
        groups += [group for k, group in trial.groupby(number) if k < number[-1]]
    return groups


@cache
def played(contact_time: float) -> tuple[Played, np.ndarray, np.ndarray]:
    """Episodes of the simulator as the model plays them: outcome, true number of contacts, error in m/s, each (n,)."""
    groups = simulated_episodes(drops("square", contact_time, noisy=False).impacts)
    first, last = (pd.DataFrame([group.iloc[i] for group in groups]) for i in (0, -1))
    q, v, v_post = first[list(POSE)].to_numpy(), first[list(V_PRE)].to_numpy(), last[list(V_POST)].to_numpy()
    start = State.of(q, v, first["trial"].to_numpy(int), first["t"].to_numpy())
    span = (last["t"] + last["duration"]).to_numpy() - start.t + FREE
    outcome = Played(bind(MODEL, truth(contact_time), RIG), start, span)
    error = (outcome.after.v - v_post - [0.0, -9.81 * FREE, 0.0]) * [1.0, 1.0, RIG.k_g]
    return outcome, np.array([len(group) for group in groups]), np.linalg.norm(error, axis=1)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("contact_time", "median", "most"), [(2e-5, 0.0015, 0.01), (T, 0.003, 0.02), (3e-3, 0.008, 0.08)]
)
def test_episodes_end_as_those_of_a_simulator_without_impact_laws(contact_time, median, most):
    outcome, contacts, error = played(contact_time)
    assert not outcome.rests.any()
    several = contacts > 1
    assert several.sum() > 40 and contacts.max() > 2
    alone = ~outcome.pressed
    assert np.mean(outcome.hits[alone & several] == contacts[alone & several]) > 0.97
    for kind in (several, ~several):
        assert np.median(error[kind]) < median
        assert np.quantile(error[kind], 0.9) < most


@pytest.mark.parametrize("effects", [(), ("quadratic_drag", "rounded_corners")])
def test_in_how_many_pieces_a_flight_is_looked_at_changes_nothing(monkeypatch, rng, effects):
    model = Model(LAWS["mirtich"], tuple(EFFECTS[name] for name in effects), takes_time=True)
    n = 60
    values = {name: p.null + p.scale for name, p in model.parameters.items()} | truth(2e-4)
    q = np.stack([np.zeros(n), np.full(n, 0.045), rng.uniform(-3.0, 3.0, n)], axis=1)
    v = rng.normal([0.0, -1.5, 0.0], [0.5, 0.3, 10.0], (n, 3))
    start = State.of(q, v, np.arange(n), np.zeros(n))
    found = []
    for ahead, in_cache in ((1000, 10**9), (3, 500), (1, 1)):
        monkeypatch.setattr(episodes, "AHEAD", ahead)
        monkeypatch.setattr(episodes, "IN_CACHE", in_cache)
        found.append(Played(bind(model, values, RIG), start, np.linspace(0.001, 0.06, n)))
    assert len(np.unique(found[0].hits)) > 2
    for other in found[1:]:
        assert (other.hits == found[0].hits).all()
        assert (other.after.q == found[0].after.q).all() and (other.after.v == found[0].after.v).all()


def test_corners_of_all_bodies_are_those_of_each(rng):
    theta = rng.uniform(-3.0, 3.0, 5)
    every = Corner(SQUARE.shape, 5)
    alone = Corner(SQUARE.shape, np.repeat(np.arange(4), 5))
    assert (every.index == alone.index).all()
    assert (every.contact_point(np.tile(theta, 4)) == alone.contact_point(np.tile(theta, 4))).all()


def flat(turn: float, omega: float = 0.0) -> State:
    """A square that lands almost flat: two corners press at once."""
    height = 0.03 * (np.cos(turn) + abs(np.sin(turn)))
    return State.of(np.array([[0.0, height, turn]]), np.array([[0.3, -2.0, omega]]), np.zeros(1, int), np.zeros(1))


def test_a_square_that_lands_flat_does_not_turn():
    after, elapsed = press(bind(MODEL, truth(T) | {"mu": 0.0}, RIG), flat(0.0))
    assert abs(after.omega[0]) < 1e-9
    assert after.vy[0] == pytest.approx(2.0 * EPSILON, rel=0.02)  # gravity acts meanwhile
    # two springs are stiffer than one by √2; then the body leaves its dent of (1 − ε²) of the depth
    pressing = T / np.sqrt(2.0)
    depth = 2.0 / np.pi * pressing / (1.0 + EPSILON)
    assert elapsed[0] == pytest.approx(pressing + (1.0 - EPSILON**2) * depth / EPSILON, rel=0.05)


def test_pressing_corners_lose_energy_and_mirror():
    for turn, omega in ((0.002, 3.0), (-0.01, 10.0), (0.005, -8.0)):
        before, mirrored = flat(turn, omega), flat(-turn, -omega)
        after, _ = press(bind(MODEL, truth(T), RIG), before)
        image, _ = press(bind(MODEL, truth(T), RIG), mirrored.moved(vx=-mirrored.vx))
        assert np.allclose(after.v * [-1.0, 1.0, -1.0], image.v, atol=1e-9)
        energy = [float(((s.v * [1.0, 1.0, RIG.k_g]) ** 2).sum() + 2.0 * 9.81 * s.y[0]) for s in (before, after)]
        assert energy[1] < energy[0]


def test_a_round_body_in_flight_is_left_alone():
    body = BODIES["ellipse"]
    rig = Rig(body.shape, body.radius_of_gyration, 9.81, 0.0)
    high = State.of(np.array([[0.0, 1.0, 0.3]]), np.array([[0.5, -1.0, 4.0]]), np.zeros(1, int), np.zeros(1))
    outcome = Played(bind(MODEL, truth(T), rig), high, np.array([0.05]))
    assert outcome.hits[0] == 0
    assert np.allclose(outcome.after.q, high.flown(np.array([[0.0, -9.81, 0.0]]), 0.05).q, atol=1e-12)


def test_a_body_that_never_bounces_rests():
    outcome = Played(bind(MODEL, truth(T) | {"epsilon": 0.0}, RIG), flat(0.0), np.array([0.08]))
    assert outcome.rests[0]


def test_a_body_that_a_hit_makes_too_fast_to_be_followed_stops(monkeypatch):
    turned = flat(0.0).moved(theta=np.array([0.3]))
    spins = []
    for fastest in (episodes.FASTEST, 10.0):
        monkeypatch.setattr(episodes, "FASTEST", fastest)
        spins.append(abs(Played(bind(MODEL, truth(T), RIG), turned, np.array([0.03])).after.omega[0]))
    assert spins[0] > 10.0 > spins[1]


def test_a_corner_that_touches_as_another_comes_free_is_struck_once():
    """Whoever hits most often has come to rest on the surface.

    A touch at the instant at which a contact is over was taken for a part of it, and played again until the hits ran
    out: the body was said to rest while it moved with 1 m/s, 2 cm deep.
    """
    rng, n = np.random.default_rng(0), 2000
    turn, omega = rng.uniform(-0.06, 0.06, n), rng.uniform(-12.0, 12.0, n)
    q = np.stack([0.0 * turn, 0.03 * (np.cos(turn) + np.abs(np.sin(turn))), turn], axis=1)
    v = np.stack([rng.uniform(-1.0, 1.0, n), rng.uniform(-2.5, -0.8, n), omega], axis=1)
    lands = State.of(q, v, np.arange(n), np.zeros(n))
    outcome = Played(bind(MODEL, {"mu": MU, "epsilon": 0.3, "tau": 2e-3}, RIG), lands, np.full(n, 0.03))
    stands = outcome.after.select(np.flatnonzero(outcome.hits == MOST_HITS))
    assert len(stands.x) > 20
    assert np.hypot(stands.vy, RIG.k_g * stands.omega).max() < 0.2
    assert stands.y.min() > 0.029  # half a side, less the dent of a contact that loses nine tenths of its work


@pytest.mark.slow
def test_most_hits_of_a_square_are_used():
    episodes, single = observed(), observed(episodes=False)
    detected = len(single.found.arcs)
    assert episodes.hits.sum() >= 0.8 * detected > len(single)
    assert episodes.hits.sum() + len(episodes.found.left_out) == detected
    assert len(episodes.single) == len(single)


def test_episodes_scatter_as_their_covariance_says():
    o = observed()
    values = truth(T)
    R, S = Comparison(MODEL, values, o).R, Comparison(MODEL, values, o).covariance(o.t_std)
    z = (R / np.sqrt(np.einsum("nii->ni", S)))[o.span > 0.0]
    assert len(z) > 50
    assert np.all(z[:, 6] == 0.0)
    spread = 1.4826 * np.median(np.abs(z[:, :6]), axis=0)
    # contacts of 1 ms are predicted to 2 mm/s, a third of what noise does to an episode
    assert np.all((spread > 0.5) & (spread < 1.8))
    assert np.mean(np.abs(z[:, :6]) < 5.0) > 0.97


def test_an_episode_that_goes_with_the_square_of_the_angle_scatters_with_the_square_of_its_noise(monkeypatch):
    """No straight line shows it: the variance of κ z² is 2 κ² σ⁴, and that of a linear λ z is λ² σ² beside it."""
    o = observed()
    o = o.rows(np.flatnonzero(o.span)[:5])
    cov = np.zeros_like(o.cov)
    sigma, spin, curved, straight = 0.02, 3.0, 40.0, 0.1
    cov[:, 0, 2] = np.diag([sigma**2, spin**2])  # of the angle and the spin before
    theta = o.value[:, 0, 2]

    def bent(dynamics, before, span, single=False):
        off = before.theta - np.tile(theta, len(span) // len(theta))
        v = np.stack([curved * off**2, straight * before.omega, 0.0 * off], axis=1)
        return State.of(before.q * [1.0, 1.0, 0.0], v, before.trial, before.t)

    monkeypatch.setattr(kind_of(MODEL), "end", bent)
    S = Comparison(MODEL, truth(T), replace(o, cov=cov)).covariance()
    assert S[:, 0, 0] == pytest.approx(2.0 * curved**2 * sigma**4)
    assert S[:, 1, 1] == pytest.approx((straight * spin) ** 2)
    assert np.abs(S[:, 0, 1]).max() < 1e-12


@pytest.mark.slow
def test_episodes_sharpen_the_same_coefficients():
    fits = {episodes: fit(MODEL, observed(episodes=episodes)) for episodes in (False, True)}
    for name in ("mu", "epsilon", "tau"):
        alone, both = fits[False], fits[True]
        assert abs(alone.values[name] - both.values[name]) < SIGMAS * alone.std[name]
        assert both.std[name] < alone.std[name]


def test_drawn_episodes_are_fitted_with_honest_errors():
    o, true = observed(), truth(T)
    z = []
    for seed in range(6):
        fitted = fit(MODEL, synthesise(Comparison(MODEL, true, o), np.random.default_rng(seed)), start=true, rounds=1)
        z.append([(fitted.values[name] - value) / fitted.std[name] for name, value in true.items()])
    assert np.mean(np.square(z)) == pytest.approx(1.0, abs=SIGMAS * np.sqrt(2.0 / np.size(z)))


def test_what_noise_leaves_open_is_left_out_with_its_spread():
    o = observed()
    noisy = replace(o, cov=400.0 * o.cov)
    kept = predictable(noisy, noisy, CritiqueSettings())
    gone = kept.found.left_out[kept.found.left_out["reason"] == "unpredictable"]
    assert len(gone) == o.hits.sum() - kept.hits.sum() > 0
    # what is told of the first of them is the spread of its end, in the kinetic norm, over draws of the noise
    trial, first = gone.iloc[0][["trial", "impact"]]
    row = noisy.rows(np.flatnonzero((o.trial == trial) & (o.impact == first)))
    copies, rng = row.rows(np.zeros(400, int)), np.random.default_rng(5)
    noise = (np.linalg.cholesky(copies.cov) @ rng.standard_normal((*copies.cov.shape[:3], 2, 1)))[..., 0]
    drawn = replace(copies, value=copies.value + noise[..., 0], slope=copies.slope + noise[..., 1])
    ends = Comparison(MODEL, truth(T), drawn).R[:, :3] * [1.0, 1.0, RIG.k_g]
    told = float(re.search(r"by ([\d.e-]+) m/s", gone.iloc[0]["detail"])[1])
    assert 0.8 < np.sqrt(((ends - ends.mean(axis=0)) ** 2).sum(axis=1).mean()) / told < 1.25
    assert len(kept.single) == len(o.single)
    assert len(predictable(o, o, CritiqueSettings())) > 0.97 * len(o)


def test_a_hit_that_comes_late_still_counts():
    """A start that is 2 mm higher makes hits late by 1 to 2 ms; the state after an episode is told later than that."""
    o = observed()
    rows = o.rows(np.flatnonzero(o.span))
    before = Comparison(MODEL, truth(T), rows).before
    higher = State.of(before.q + [0.0, 0.002, 0.0], before.v, before.trial, before.t)
    hits, late = (Played(bind(MODEL, truth(T), RIG), start, rows.span).hits for start in (before, higher))
    assert len(hits) > 50 and np.mean(late != hits) < 0.05


def test_effects_act_at_every_hit():
    """A displaced contact point, a wrong size and rounded corners change the hits of every corner."""
    o = observed()
    rows = o.rows(np.flatnonzero(o.span))
    for name in ("wrong_size", "rounded_corners", "com_offset", "surface_height", "position_dependent_restitution"):
        effect = EFFECTS[name]
        model = MODEL.with_effect(effect)
        null, moved = sizes(effect, 0.0), sizes(effect)
        plain = Comparison(MODEL, truth(T), rows).R
        assert np.allclose(Comparison(model, truth(T) | null, rows).R, plain, atol=1e-9)
        assert np.mean(np.abs(Comparison(model, truth(T) | moved, rows).R - plain).max(axis=1) > 1e-5) > 0.5


def test_rounding_moves_each_corner_of_a_polygon_as_it_moves_the_lowest():
    theta, corners = np.linspace(0.1, 6.2, 40), SQUARE.shape.corners
    heights = np.sin(theta)[:, None] * corners[:, 0] + np.cos(theta)[:, None] * corners[:, 1]
    lowest = heights.argmin(axis=1)
    q, v = np.column_stack([0 * theta, 0 * theta + 0.05, theta]), np.tile([0.1, -1.0, 2.0], (40, 1))
    before = State.of(q, v, np.arange(40), 0 * theta)
    for name in ("rounded_corners", "wrong_size"):
        model = MODEL.with_effect(EFFECTS[name])
        values = truth(T) | sizes(EFFECTS[name])
        by_shape, by_corner = (
            bind(model, values, rig).contact(before)[1].r
            for rig in (RIG, replace(RIG, shape=Corner(SQUARE.shape, lowest)))
        )
        np.testing.assert_allclose(by_shape, by_corner, atol=1e-12)


@pytest.mark.slow
def test_the_noise_floor_of_single_hits_is_below_that_of_episodes():
    error = diagnosis(critique("square"), np.random.default_rng(0))["error"]
    assert 0.0 < error["noise_floor_single"] < error["noise_floor"]


@pytest.mark.slow
def test_the_table_of_impacts_tells_which_hits_belong_together():
    made = critique("square")
    table = impacts(made.observations, made.held_out.trial)
    episodes = table[(table["used"] == 1) & (table["span"] > 0.0)]
    assert len(episodes) > 50 and (episodes["hits"] >= 1).all()
    counted = table.loc[table["used"] == 1, "hits"].sum() + (table["used"] == 0).sum()
    assert counted == len(made.observations.found.arcs)


def errors_of_single_hits(law: str, shape: str, contact_time: float) -> np.ndarray:
    """Errors (n,) in m/s of single contacts of the simulator, without noise, as the law plays them."""
    body = BODIES[shape]
    rig = Rig(body.shape, body.radius_of_gyration, 9.81, 0.0)
    table = drops(shape, contact_time, noisy=False).impacts
    table = table[table["separated"] & (table["impact"] == 0) & (table["duration"] < 2.0 * contact_time)]
    v_post = table[list(V_POST)].to_numpy()
    start = State.of(
        *(table[list(names)].to_numpy() for names in (POSE, V_PRE)), table["trial"].to_numpy(), table["t"].to_numpy()
    )
    span = table["duration"].to_numpy()
    model = Model(BASES[law], takes_time=True)
    played = Played(bind(model, truth(contact_time), rig), start, span, most=1)
    assert (played.hits == 1).all()
    return np.linalg.norm((played.after.v - v_post) * [1.0, 1.0, rig.k_g], axis=1)


@pytest.mark.slow
@pytest.mark.parametrize("shape", BODIES)
def test_a_compliant_law_follows_long_contacts_that_no_impulse_does(shape):
    rigid, compliant = (np.median(errors_of_single_hits(law, shape, 3e-3)) for law in ("mirtich", "compliant_contact"))
    assert compliant < 0.001 < rigid


@pytest.mark.slow
def test_a_law_that_takes_time_predicts_long_contacts_better():
    made = drops("ellipse", 3e-3)
    every = observe(Dataset("ellipse", made.header, made.trajectories))
    trials = np.unique(every.trial)[:60]
    training, held_out = every.select(trials[::2]), every.select(trials[1::2])
    fitted = {name: Drops(training).fit(name, ()) for name in ("mirtich", "compliant_contact")}
    for name, value in truth(3e-3).items():
        f = fitted["compliant_contact"]
        assert abs(f.values[name] - value) < max(
            SIGMAS * f.std[name], 0.005 * value
        )  # a contact ends within one of 48 steps
    judged = {name: Drops(held_out).judge(f) for name, f in fitted.items()}
    assert judged["compliant_contact"].total > judged["mirtich"].total + 50.0
    assert judged["mirtich"].excess > 1.2 * judged["compliant_contact"].excess
