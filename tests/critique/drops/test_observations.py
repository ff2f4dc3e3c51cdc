"""Observations: errors are as large as their covariance says, windows stop at hits, tables are taken as they are."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hidden_effects import LAW, RIG_NOISE, TRUTH, drops, injected_impacts, observed

from thesis_lib.critique.contacts.model import Model
from thesis_lib.critique.drops.criticise import DropsCritique
from thesis_lib.critique.drops.settings import CritiqueSettings
from thesis_lib.critique.drops.world import Drops
from thesis_lib.critique.likelihood.comparison import Comparison
from thesis_lib.critique.likelihood.fit import fit
from thesis_lib.critique.likelihood.observations import Observations, observe
from thesis_lib.critique.results.diagnosis import left_out
from thesis_lib.critique.results.summary import much_left_out
from thesis_lib.datasets.flights.parabolas import MIN_FLIGHT
from thesis_lib.datasets.format.dataset import Dataset

GRAVITY = 9.81
SIGMAS = 4.0  # standard deviations of a reduced chi² (√(2/dof)) by which it may miss 1
MATCH = 4e-3  # s; a hit found farther than a frame from a true one is another hit
# share of impacts with a hit too weak to be seen in their windows, or of a body that rolls out at the end of its
# record: the t weights of the fit take them
FALSE = 0.1
ROLLING = 0.1  # the same of flights
POSE, SPEED = ("x", "y", "theta"), ("vx", "vy", "omega")


def matched() -> tuple[np.ndarray, list[int]]:
    """Impacts that are real and have no other true hit in their windows, and their rows in the truth."""
    o, truth = observed(), drops().impacts
    support = drops().trials.set_index("trial")["t_support"].fillna(np.inf)
    real, rows = [], []
    for i, (trial, t) in enumerate(zip(o.trial, o.t)):
        own = truth[truth["trial"] == trial]
        nearest = (own["t"] - t).abs().idxmin()
        used = t + o.nodes[i].ravel()
        others = own["t"].drop(nearest).between(used.min(), used.max()).any()
        if abs(own.loc[nearest, "t"] - t) < MATCH and not others and used.max() < support[trial]:
            real.append(i)
            rows.append(nearest)
    return np.array(real), rows


def test_nearly_all_impacts_are_real_and_none_counts_twice():
    real, rows = matched()
    assert len(real) >= (1.0 - FALSE) * len(observed())
    assert len(set(rows)) == len(rows)


def test_errors_of_pose_and_velocity_are_as_large_as_their_covariance_says_and_have_no_bias():
    o, truth = observed(), drops().impacts
    real, rows = matched()
    true = truth.loc[rows]
    late = o.t[real] - true["t"].to_numpy()
    # pose and velocity minus truth, (n, 2 sides, 3, 2), at the estimated instant
    errors, here = np.zeros((len(real), 2, 3, 2)), Comparison(Model(LAW), TRUTH, o)
    for side, (whole, suffix) in enumerate(zip((here.before, here.after), ("pre", "post"))):
        state = whole.select(real)
        for channel in range(3):
            a = -GRAVITY if channel == 1 else 0.0
            v = true[f"{SPEED[channel]}_{suffix}"].to_numpy()
            q = true[POSE[channel]].to_numpy() + late * v + 0.5 * a * late**2
            turns = 2 * np.pi * np.rint((getattr(state, POSE[channel]) - q) / (2 * np.pi))
            errors[:, side, channel, 0] = getattr(state, POSE[channel]) - q - turns * (channel == 2)
            errors[:, side, channel, 1] = getattr(state, SPEED[channel]) - v - a * late
    cov, n = o.cov[real], len(real)
    chi2 = np.einsum("nsck,nsck->nsc", errors, np.linalg.solve(cov, errors[..., None])[..., 0]) / 2.0
    assert chi2.mean() == pytest.approx(1.0, abs=SIGMAS * np.sqrt(2.0 / (12 * n)))
    assert np.abs(chi2.mean(axis=0) - 1.0).max() < SIGMAS * np.sqrt(2.0 / (2 * n))
    z = errors / np.sqrt(np.einsum("nsckk->nsck", cov))
    assert np.abs(z.mean(axis=0)).max() < SIGMAS / np.sqrt(n)


def test_flights_fall_with_gravity():
    flights, truth = observed().flights, drops().impacts
    free = []
    for i, (trial, t) in enumerate(zip(flights.state.trial, flights.state.t)):
        hits = truth.loc[truth["trial"] == trial, "t"]
        end = t + 0.5 * flights.span[i] - MATCH
        free.append(end < hits.max() and not hits.between(t - 0.5 * flights.span[i] + MATCH, end).any())
    assert np.mean(free) > 1.0 - ROLLING
    flights = flights.select(np.flatnonzero(free))
    assert len(flights) > 40  # more than one a drop, or the test would say little
    z = (flights.acceleration - [0.0, -GRAVITY, 0.0]) / np.sqrt(flights.variance)
    assert np.abs(z.mean(axis=0)).max() < SIGMAS / np.sqrt(len(z))
    assert np.abs((z**2).mean(axis=0) - 1.0).max() < SIGMAS * np.sqrt(2.0 / len(z))


def test_no_window_reaches_over_a_detected_hit_used_or_not():
    o = observed()
    hits = o.found.arcs
    assert not hits["used"].all()  # else unused hits would not be put to the test
    bounded = 0
    for i in range(len(o)):
        own = hits.loc[hits["trial"] == o.trial[i], "t"].to_numpy()
        others = own[np.abs(own - o.t[i]) > 1e-9]
        used = o.t[i] + o.nodes[i].ravel()
        assert not ((others > used.min()) & (others < used.max())).any()
        bounded += bool(len(others))
    assert bounded > 0
    # each side keeps to its own side, and has enough samples for a line
    assert (o.nodes[:, 0] < 0).all() and (o.nodes[:, 1] > 0).all()


def test_windows_and_flights_hold_samples_of_one_trial_only():
    one = drops()
    table = one.trajectories.sample(frac=1.0, random_state=0)  # order of rows must not matter
    shuffled = observe(Dataset("plain", one.header, table), episodes=False)
    np.testing.assert_allclose(shuffled.slope, observed().slope, atol=1e-12)
    single = one.trajectories.query("trial == 7").reset_index(drop=True)
    alone = observe(Dataset("plain", one.header, single), episodes=False)
    same = observed().select(np.array([7]))
    assert len(alone) == len(same) > 0
    np.testing.assert_allclose(alone.slope, same.slope, atol=1e-9)
    assert len(alone.flights) == len(same.flights)


def test_samples_that_detection_masks_are_used_nowhere():
    one, rng = drops(), np.random.default_rng(1)
    table = one.trajectories.copy()
    wild = np.sort(rng.choice(len(table), 15, replace=False))
    table.loc[wild[:12], "x"] += rng.normal(0.0, 0.2, 12)
    table.loc[wild[12:], "y"] = 1e6
    o = observe(Dataset("glitches", one.header, table))
    assert len(o.found.samples) <= len(table) - 14
    assert np.abs(o.slope).max() < 100.0 and np.isfinite(o.value).all()
    # a line from which one glitch of 0.2 m were not left out would miss by metres a second
    at = {(a, round(b, 2)): i for i, (a, b) in enumerate(zip(observed().trial, observed().t))}
    pairs = [(i, at[key]) for i, key in enumerate(zip(o.trial, np.round(o.t, 2))) if key in at]
    i, j = np.array(pairs).T
    assert len(i) > 0.8 * len(observed())
    z = (o.slope[i] - observed().slope[j]) / np.sqrt(observed().cov[j, ..., 1, 1])
    assert np.mean(np.abs(z) > 6.0) < 0.02
    assert abs(len(o.flights) - len(observed().flights)) < 10


def test_selection_keeps_impacts_and_flights_of_the_trials():
    o = observed()
    kept = np.array([3, 11, 20])
    part = o.select(kept)
    rows = np.isin(o.trial, kept)
    assert len(part) == rows.sum() > 0
    assert set(part.trial) == set(part.flights.state.trial) == set(kept)
    for name in ("t", "value", "slope", "bow", "cov", "nodes", "weights", "t_std", "offset"):
        np.testing.assert_array_equal(getattr(part, name), getattr(o, name)[rows])
    rest = o.select(np.setdiff1d(o.trial, kept))
    assert len(rest) + len(part) == len(o)
    assert len(rest.flights) + len(part.flights) == len(o.flights)
    assert len(o.select(np.array([], int))) == 0


def test_impacts_csv_is_taken_as_it_is():
    table_only = injected_impacts("table", 25, 2, "tangential_restitution", {"tangential_restitution.e_t": 0.0})
    o, table = observe(table_only), table_only.impacts
    assert not o.arcs and o.noise_known and len(o.flights) == 0
    for side, suffix in enumerate(("pre", "post")):
        np.testing.assert_array_equal(o.value[:, side], table[list(POSE)])
        np.testing.assert_array_equal(o.slope[:, side], table[[f"{name}_{suffix}" for name in SPEED]])
    variance = np.einsum("nsckk->nsck", o.cov)
    noise = table_only.header.noise
    for channel, (pose, speed) in enumerate(
        [(noise.position, noise.velocity)] * 2 + [(noise.angle, noise.angular_velocity)]
    ):
        np.testing.assert_allclose(variance[:, :, channel, 0], pose**2)
        np.testing.assert_allclose(variance[:, :, channel, 1], speed**2)
    np.testing.assert_allclose(o.offset, 0.0, atol=1e-12)
    # a contact point that is given is kept as an offset
    r = table_only.shape.contact_point(table["theta"].to_numpy())
    given = observe(replace(table_only, impacts=table.assign(r_x=r[:, 0] + 0.002, r_y=r[:, 1] - 0.001)))
    np.testing.assert_allclose(given.offset, np.tile([0.002, -0.001], (len(o), 1)), atol=1e-12)
    # without stated noise only scatter is known
    silent = observe(replace(table_only, header=table_only.header.model_copy(update={"noise": None})))
    assert not silent.noise_known and (silent.cov == 0.0).all()


def test_noise_in_the_samples_is_that_of_the_rig_and_flights_have_enough_of_them():
    assert observed().flights.span.min() > (MIN_FLIGHT - 2) / 250.0
    assert observed().found.noise.position == pytest.approx(RIG_NOISE.position, rel=0.1)
    assert observed().found.noise.angle == pytest.approx(RIG_NOISE.angle, rel=0.1)


def wobbling(share: float) -> Observations:
    """Drops of which the first ones swing by 1.5 mm as they fly, five times the noise: no hit, and no gravity."""
    one = drops()
    table = one.trajectories.copy()
    x = 1.5e-3 * np.sin(2.0 * np.pi * table["t"] / 0.2)
    table["x"] += np.where(table["trial"] < share * table["trial"].max(), x, 0.0)
    return observe(Dataset("wobbling", one.header, table), episodes=False)


def test_flights_that_are_no_parabolas_are_counted_and_said():
    o, few = wobbling(0.25), observed()
    trials = np.unique(o.flights.bent)
    assert len(trials) > 5 and np.mean(trials < 10) > 0.8
    n = len(o.flights) + len(o.flights.bent)
    (said,) = (text for text in o.found.warnings if "not parabolas" in text)
    assert said.startswith(f"{len(o.flights.bent)} of {n} flights are not parabolas and are left out")
    content = {"left_out": left_out(o), "verdict": "adequate"}
    assert content["left_out"]["flights"] == {"bent": len(o.flights.bent), "n": n}
    assert said in much_left_out(content)
    held = o.select(np.arange(8, 40))
    assert set(held.flights.bent) == {trial for trial in trials if trial >= 8}
    assert len(few.flights.bent) < 3 and not any("not parabolas" in text for text in few.found.warnings)


@pytest.mark.parametrize(("share", "far"), [(0.25, ()), (1.1, ("flight",))])
def test_where_most_flights_are_no_parabolas_the_model_of_the_flight_is_wrong(share: float, far: tuple):
    o = wobbling(share)
    judged = replace(Drops(observed()).judge(fit(Model(LAW), observed(), TRUTH, rounds=1)), excess=1.0)
    judged = replace(judged, sigmas=dict.fromkeys(judged.sigmas, 1.0))
    of_all = SimpleNamespace(ladder=(("", None, judged),), settings=CritiqueSettings(), observations=o)
    assert DropsCritique.misfit_channels.fget(of_all) == far
