"""The study of dice: states from recorded throws, models that can be thrown, limits and tables, on simulated throws."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from impacts_for_tests import saved_model
from throws_for_tests import HALF, RIG, SQUARE, throws

from thesis_lib.bodies.body import Body, Noise
from thesis_lib.critique.results.saved_model import SavedModel, SavedParameter
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.header import Header
from thesis_lib.datasets.format.impacts import Impacts
from thesis_lib.foundation.columns import explain
from thesis_lib.foundation.errors import UserError
from thesis_lib.learners.gaussian_process import GaussianProcessSettings, fit_gaussian_process
from thesis_lib.thesis.residual.dice.budget import budget
from thesis_lib.thesis.residual.dice.data import MeasuredContacts, ThrowReleases, read_throws
from thesis_lib.thesis.residual.dice.fit import DiceModel, contact_path, touch_down
from thesis_lib.thesis.residual.dice.models import (
    Thrower,
    contact_residuals,
    critique_model,
    leave_one_out,
    noise_limit,
    scattered,
)
from thesis_lib.thesis.residual.dice.results import dice_tables, examples, over_parts, tables_of_part
from thesis_lib.thesis.residual.dice.settings import DiceDataSettings, DiceStudySettings
from thesis_lib.thesis.residual.dice.study import dice_study, parts_of, side_of
from thesis_lib.thesis.residual.dice.tables import contact_pits, difficulty, spread, summary
from thesis_lib.thesis.residual.throwing.flight import first_touch
from thesis_lib.thesis.residual.throwing.propagation import Sampled
from thesis_lib.thesis.residual.throwing.settings import ThrowSettings
from thesis_lib.thesis.residual.throwing.throw import simulate_throws, state_at

MODEL = DiceModel(HALF, 0.0, 0.0, RIG.k_g, "mirtich", 0.15, 0.45, 9.81, c_v=0.35, c_w=0.35)
SIGMA = np.array([1e-4, 1e-4, 1e-3])
N = 40
SET_APART = [3, 12, 19, 25, 27]


@pytest.fixture(scope="module")
def recorded() -> tuple[Dataset, pd.DataFrame, np.ndarray, np.ndarray]:
    """Poses at 250 Hz of simulated throws with white noise, hits, and the true starts."""
    rng = np.random.default_rng(0)
    q, v = throws(N)
    settings = ThrowSettings(snapshots=25, merge=0.0, max_contacts=400)
    out = simulate_throws(MODEL.body, q, v, MODEL.impact, MODEL.mu, settings, rng)
    t = np.arange(0.0, 0.8, 0.004)
    last = np.nanmax(out.snapshot_t, axis=0)
    parts, v_t = [q], v
    short = ThrowSettings(max_contacts=30)
    for _ in t[1:]:
        q_t, v_t = state_at(MODEL.body, parts[-1], v_t, 0.004, MODEL.impact, short)
        # chatter at rest has no end
        v_t = np.where(np.isfinite(v_t), v_t, 0.0)
        parts.append(np.where(np.isfinite(q_t), q_t, parts[-1]))
    poses = np.array(parts)  # (time, throw, 3)
    # after its last contact a body lies: its bounces have become too small to follow
    poses = np.where((t[:, None] > last)[:, :, None], out.q, poses)
    poses = poses + SIGMA * rng.standard_normal(poses.shape)
    table = pd.DataFrame(
        {
            "trial": np.repeat(np.arange(N), len(t)),
            "t": np.tile(t, N),
            **{name: poses[:, :, i].T.ravel() for i, name in enumerate(("x", "y", "theta"))},
        }
    )
    header = Header(
        schema=1,
        description="",
        body=Body(shape=SQUARE, radius_of_gyration=RIG.k_g),
        gravity=9.81,
        rate=250.0,
        noise=Noise(position=1e-4, angle=1e-3),
    )
    step, throw = np.nonzero(np.isfinite(out.snapshot_t))
    hits = pd.DataFrame({"trial": throw, "t": out.snapshot_t[step, throw]}).sort_values(["trial", "t"])
    return Dataset("dice", header, table), hits, q, v


@pytest.fixture(scope="module")
def read(recorded) -> tuple[ThrowReleases, MeasuredContacts]:
    """Starts and contacts that are read from them."""
    return read_throws(recorded[0], recorded[1], DiceDataSettings())[:2]


def test_starts_are_found_within_their_covariance(recorded, read):
    (_, hits, q, v), (releases, _) = recorded, read
    assert releases.sigma == pytest.approx(SIGMA, rel=0.15)
    first = hits.groupby("trial")["t"].min()
    z = []
    for i, trial in enumerate(releases.trial):
        at = np.floor((first[trial] - 0.002) / 0.004) * 0.004
        true_q, true_v = state_at(MODEL.body, q[[trial]], v[[trial]], np.array([at]), MODEL.impact, ThrowSettings())
        away = np.r_[releases.q[i] - true_q[0], releases.v[i] - true_v[0]]
        z.append(away / np.sqrt(np.diag(releases.cov[i])))
    z = np.array(z)
    # stray accelerations, which these throws do not have, widen the covariance: z is not above 1
    assert (np.sqrt((z**2).mean(0)) < 1.25).all()
    assert np.sqrt((z[:, :3] ** 2).mean()) > 0.5


def test_contacts_reach_from_flight_to_flight(read):
    _, contacts = read
    _, after = contact_path(MODEL, MODEL.seen(contacts.q), contacts.v, contacts.span, ThrowSettings())
    error = np.linalg.norm((after - contacts.v_after) * [1, 1, RIG.k_g], axis=1)
    assert np.median(error) < 0.03
    assert contacts.first.sum() <= N


def test_throws_that_do_not_come_to_rest_are_left_out_and_counted(recorded, read):
    (dataset, hits, _, _), (one, _) = recorded, read
    poses = dataset.trajectories.copy()
    moving = (poses["trial"] == 3) & (poses["t"] > 0.7)
    poses.loc[moving, "x"] += 0.5 * (poses.loc[moving, "t"] - 0.7)
    poses = poses[~((poses["trial"] == 5) & (poses["t"] < 0.05))]
    changed = Dataset("dice", dataset.header, poses)
    two, _, _ = read_throws(changed, hits, DiceDataSettings())
    assert set(one.trial) - set(two.trial) == {3, 5}
    assert sum(two.left_out.values()) == sum(one.left_out.values()) + 2


def test_the_limit_is_zero_without_noise_and_grows_with_it(read):
    releases, _ = read

    def limit(factor):
        noisy = replace(releases, cov=factor * releases.cov)
        thrower = Thrower("law", MODEL, Sampled(MODEL.body, MODEL.impact))
        return noise_limit(thrower, noisy, 2 * HALF, DiceStudySettings(), np.random.default_rng(0))

    assert limit(0.0)["spread"].max() < 1e-9 and (limit(0.0)["face_kept"] == 1.0).all()
    assert 0.0 < limit(1.0)["spread"].median() < limit(400.0)["spread"].median()
    assert limit(400.0)["face_kept"].mean() < limit(1.0)["face_kept"].mean()


def test_the_law_that_made_contacts_is_calibrated_once_its_scatter_is_known(read):
    _, contacts = read
    settings = DiceStudySettings()
    thrower = scattered("calibrated", MODEL, contacts, settings)
    # what the camera's noise adds is all that scatters here
    assert np.sqrt(np.diag(thrower.contact.relative))[:2].max() < 0.05
    other = replace(thrower, model=replace(MODEL, epsilon=0.7, mu=0.4))
    good, bad = (contact_pits(t, contacts, settings)["misfit"].median() for t in (thrower, other))
    assert good < 0.5 * bad


def test_no_flight_is_traced_back_through_a_later_hit(read):
    _, contacts = read
    settings = DiceStudySettings(slowest=0.5)
    t, *_ = touch_down(MODEL, contacts)
    late = contacts.last_hit - t > settings.duration
    assert late.sum() > 5
    rows, *_, residual, _ = contact_residuals(MODEL, contacts, settings)
    assert not late[rows].any()
    unaware, *_, spoilt, _ = contact_residuals(MODEL, replace(contacts, last_hit=0.0 * t), settings)
    # the model that made the contacts misses nothing of them, but of those that were traced back through a hit
    of_late = np.linalg.norm(spoilt[late[unaware], 3:], axis=1)
    assert np.median(np.linalg.norm(residual[:, 3:], axis=1)) < 0.1 * np.median(of_late)


def saved(effects: dict[str, float]) -> SavedModel:
    return saved_model(effects, law="mirtich", mu=0.15, shape=SQUARE, k_g=RIG.k_g)


BODY = {
    "rounded_corners.rho": 0.003,
    "angle_offset.d_theta": -0.03,
    "linear_drag.c_v": 0.5,
    "linear_drag.c_w": 0.6,
    "wrong_inertia.d_I": -0.2,
}
CONTACT = {
    "angle_offset.d_theta": -0.03,
    "tangential_compliance.eta": 5.0,
    "tangential_compliance.zeta": 0.5,
    "velocity_dependent_restitution.p": 0.3,
    "velocity_dependent_restitution.c": -0.2,
    "position_dependent_restitution.g_eps": 0.5,
    "contact_torque.m_r": 5e-4,
}


@pytest.mark.parametrize("values", [BODY, CONTACT], ids=["body", "contact"])
def test_the_critiques_model_hits_as_its_own_prediction_says(values):
    model = saved(values)
    thrown = critique_model(model, 2 * HALF)
    q, v = throws(60)
    true = q - [0.0, 0.0, -0.03]
    r, _ = thrown.body.lowest(true[:, 2])
    _, after, _ = thrown.impact(true, v, r, np.zeros(60, bool))
    states = pd.DataFrame(np.hstack([q, v]), columns=["x", "y", "theta", "vx", "vy", "omega"])
    expected = model.predict(states)
    hit = (expected["status"] == "ok").to_numpy()
    assert hit.sum() > 50
    assert after[hit] == pytest.approx(expected.loc[hit, ["vx_post", "vy_post", "omega_post"]].to_numpy())


def test_a_contact_time_is_left_out_of_throws():
    model = saved(CONTACT)
    tau = SavedParameter(value=6e-4, std=None, unit="s")
    timed = model.model_copy(update={"parameters": model.parameters | {"tau": tau}})
    assert timed.model.takes_time
    assert critique_model(timed, 2 * HALF) == critique_model(model, 2 * HALF)


def test_effects_that_throws_do_not_know_are_refused_by_name():
    with pytest.raises(UserError, match="surface_tilt"):
        critique_model(saved({"surface_tilt.phi": 0.01}), 2 * HALF)


def test_leave_one_out_is_what_leaving_one_out_gives():
    rng = np.random.default_rng(0)
    X = rng.normal(size=(30, 2))
    Y = np.sin(X[:, :1]) + 0.1 * rng.normal(size=(30, 1))
    process = fit_gaussian_process(X, Y, rng, GaussianProcessSettings(restarts=1, device="cpu"), centred=False)
    z = leave_one_out(process)
    x = process.x / process.lengthscale[0]
    K = process.signal[0] * np.exp(-0.5 * ((x[:, None] - x) ** 2).sum(-1))
    for i in (0, 11, 29):
        rest = np.arange(30) != i
        K_y = K[np.ix_(rest, rest)] + process.noise[0] * np.eye(29)
        k = np.linalg.solve(K_y, K[rest, i])
        variance = process.signal[0] + process.noise[0] - k @ K[rest, i]
        assert z[i, 0] == pytest.approx((process.y[i, 0] - k @ process.y[rest, 0]) / np.sqrt(variance))


def made_throws(n: int, rng: np.random.Generator) -> pd.DataFrame:
    """Throws of a law that ends at one of two places, and of a learned model, whose belief is wide where that errs."""
    wide, side = rng.uniform(0.1, 2.0, n), rng.choice([-1.0, 1.0], n)
    law = pd.DataFrame({"trial": np.arange(n), "model": "law", "spread_rest": wide, "spread_first": wide})
    law["error"] = law["error_certain"] = 0.5 + 2.0 * side + 0.2 * rng.normal(size=n)
    learned = law.assign(model="learned", spread_rest=wide, spread_first=rng.permutation(wide))
    learned["error_certain"] = learned["error"] = wide * rng.normal(size=n)
    table = pd.concat([law, learned[::-1]], ignore_index=True)
    table["first_slope"] = 2.0 - np.abs(table["error"])  # hits at a corner miss by less
    rest = ("face_right", "face_right_certain", "log_score", "crps")
    return table.assign(**dict.fromkeys(rest, 1.0))


def test_difficulty_sees_a_spread_that_predicts_the_error_and_one_that_does_not():
    rng = np.random.default_rng(0)
    table = made_throws(400, rng)
    found = difficulty(table, 200, rng).set_index(["model", "spread", "of"])
    assert found.loc[("learned", "spread_rest", "error"), "low"] > 0.2
    first = found.loc[("learned", "spread_first", "error")]
    assert first["low"] < 0.0 < first["high"]
    assert found.loc[("learned", "first_slope", "error"), "rank_correlation"] == pytest.approx(-1.0)
    # the law ends 2 sides away from the middle of all beliefs, whatever their width
    apart = found.loc[("learned", "spread_rest", "law")]
    assert apart["low"] < 0.1 and ("law", "spread_rest", "law") not in found.index
    near = table["model"] == "law"
    table.loc[near, "error_certain"] = table.loc[~near].set_index("trial")["error"].loc[table.loc[near, "trial"]].values
    table.loc[near, "error_certain"] += table.loc[~near].set_index("trial")["spread_rest"].to_numpy()[::-1]
    assert difficulty(table, 2, rng).set_index(["of"]).loc["law", "rank_correlation"] == pytest.approx(1.0)


def test_errors_with_two_peaks_are_bimodal_and_means_are_compared_by_their_size():
    rng = np.random.default_rng(1)
    table = made_throws(400, rng)
    limit = pd.DataFrame({"model": ["law"], "spread": [0.1], "face_kept": [1.0]})
    found = summary(table, limit, 100, rng).set_index(["model", "quantity"])
    row = found.loc[("law", "bimodality_certain")]
    assert row["value"] > 0.9 and row["low"] > 5.0 / 9.0 + 5.0 * row["std"]
    assert found.loc[("learned", "bimodality"), "high"] < 5.0 / 9.0
    means = table.groupby("model")["error"].mean().abs()
    beyond = found.loc[("learned", "mean_size_beyond_law")]
    assert beyond["value"] == pytest.approx(means["learned"] - means["law"]) and beyond["high"] < -0.2


def test_tables_over_parts_are_of_all_throws_and_show_the_spread():
    parts = [pd.DataFrame({"model": ["law", "critique"], "value": values}) for values in ([1.0, 5.0], [3.0, 5.0])]
    whole = pd.DataFrame({"model": ["law", "critique"], "value": [2.2, 5.0], "std": [0.2, 0.3]})
    found = over_parts(whole.assign(low=0.0, high=6.0, n=7), parts).set_index("model")
    assert list(found.columns) == ["value", "std", "low", "high", "std_splits", "splits"]
    assert found.loc["law", ["value", "std", "splits"]].tolist() == [2.2, 0.2, 2]
    assert found.loc["law", "std_splits"] == pytest.approx(np.sqrt(2.0))
    assert found.loc["critique", "std_splits"] == 0.0


def test_each_throw_is_held_out_once_and_part_0_stays_the_same():
    settings = DiceStudySettings()
    trials = np.arange(1, 486)
    parts = parts_of(trials, settings)
    assert len(parts) == 5 and np.array_equal(np.sort(np.concatenate(parts)), trials)
    # set apart on 24 November 2026, before the models of that day were tried
    assert parts[0][:5].tolist() == SET_APART


def test_the_bootstraps_standard_error_is_that_of_a_mean():
    values = np.random.default_rng(0).normal(size=400)
    std, low, high = spread(values, np.mean, 2000, np.random.default_rng(1))
    assert std == pytest.approx(values.std() / 20.0, rel=0.06)
    assert high - low == pytest.approx(2 * 1.96 * std, rel=0.06) and low < values.mean() < high
    assert np.isnan(spread(values, np.mean, 0, np.random.default_rng(1))).all()


@pytest.mark.slow
def test_the_study_of_simulated_throws(recorded, read):
    """No held-out throw is a training throw, all columns are explained, and the shown throws are held out."""
    (dataset, hits, _, _), (_, contacts) = recorded, read
    _, corner = first_touch(MODEL.body, contacts.q, contacts.v)
    r = MODEL.body.contact_point(contacts.q[:, 2], corner)
    number = np.arange(len(contacts))
    impacts = Impacts(
        trial=contacts.trial, impact=number, q=contacts.q, v_pre=contacts.v, v_post=contacts.v_after, r=r, k_g=RIG.k_g
    )
    settings = DiceStudySettings(
        parts=2,
        particles=10,
        limit_copies=2,
        bootstrap=20,
        slide_grid=(0.15,),
        fit={"evaluations": 50, "choice_evaluations": 50, "contacts": 60},
        process={"iterations": 10, "restarts": 1, "robust_rounds": 0},
    )
    studies = dice_study(dataset, hits, impacts, None, settings, np.random.default_rng(0))
    tables = dice_tables(studies, settings, np.random.default_rng(0))
    for i, part in enumerate(parts_of(studies[0].releases.trial, settings)):
        held = tables["dice_throws"].loc[tables["dice_throws"]["split"] == i, "trial"]
        assert set(held) == set(part)
        counts = studies[i].tables["counts"].set_index("counted")["count"]
        assert counts["train"] + counts["held_out"] == counts["used"]
    tables |= tables_of_part(studies[0], side_of(dataset), settings, np.random.default_rng(0))
    for name, table in tables.items():
        explain(name, table.columns)
    throws, of_parts = tables["dice_throws"], tables["dice_parts"].set_index(["split", "model", "quantity"])["value"]
    for i in range(len(studies)):
        right = throws.loc[(throws["split"] == i) & (throws["model"] == "law"), "face_right"]
        assert of_parts[i, "law", "face_right"] == pytest.approx(right.mean())
    assert set(tables["dice_widths"]["throws"]) <= set(range(1, len(studies[0].held.releases) + 1))
    assert set(tables["dice_calibration"]["kind"]) == {"roll", "contact"}
    shown = examples(studies[0], side_of(dataset), settings, np.random.default_rng(0))
    assert {shown.easy, shown.hard} <= set(studies[0].held.releases.trial)
    width = shown.beliefs.groupby("case")["distance"].std()
    assert width["easy"] < width["hard"]
    assert set(shown.samples["trial"]) == {shown.hard}


def test_the_budget_tells_what_each_contact_costs(read):
    releases, contacts = read
    order = np.arange(len(releases))
    training, held = releases.select(order % 2 == 0), releases.select(order % 2 == 1)
    of_held = contacts.select(np.isin(contacts.trial, held.trial))
    wrong = replace(MODEL, epsilon=0.3)
    throwers = [Thrower(name, m, Sampled(m.body, m.impact)) for name, m in (("true", MODEL), ("wrong", wrong))]
    settings = DiceStudySettings(bootstrap=20)
    table = budget(throwers, training, held, of_held, 2 * HALF, settings, np.random.default_rng(0))
    explain("dice_budget", table.columns)
    table = table.set_index(["model", "contact"])
    start = table.loc[("true", 0)]
    assert start["std"] < 0.5 * table.loc[("wrong", 0), "std"] and start["face_right"] > 0.7
    # a wrong model has less and less to spoil
    late = table.loc[("wrong", 3)]
    assert late["std"] < 0.7 * late["std_start"] and late["face_right"] >= late["face_start"]
    # without a model, from half of so few throws, one errs by more than the true model
    assert table.loc[("nearest", 0), "std"] > start["std"]
    assert table.loc[("pairs", 0), "throws"] >= 2


def test_throws_that_start_equal_and_end_equal_leave_no_error(read, monkeypatch):
    releases, contacts = read
    # every throw again, elsewhere along the surface and on another side
    again = replace(releases, q=releases.q + [0.3, 0.0, np.pi], end=releases.end + [0.3, 0.0, np.pi])
    thrower = Thrower("law", MODEL, Sampled(MODEL.body, MODEL.impact))
    settings = DiceStudySettings(bootstrap=0)
    rng = np.random.default_rng(0)
    few = round(0.8 * len(releases))
    monkeypatch.setattr("thesis_lib.thesis.residual.dice.budget.ALIKE", few)
    table = budget([thrower], releases, again, contacts, 2 * HALF, settings, rng).set_index("model")
    assert table.loc["pairs", "std"] < 1e-6 and table.loc["pairs", "face_right"] == 1.0


def test_a_marker_off_the_centre_leaves_the_outline_where_it_is():
    d = np.array([3e-4, -4e-4])
    marked = critique_model(saved({"marker_offset.d_x": d[0], "marker_offset.d_y": d[1]}), 2 * HALF)
    plain = critique_model(saved({"angle_offset.d_theta": 0.0}), 2 * HALF)
    q, _ = throws(20)
    cos, sin = np.cos(q[:, 2]), np.sin(q[:, 2])
    centre = q - np.column_stack([cos * d[0] - sin * d[1], sin * d[0] + cos * d[1], np.zeros(20)])
    assert marked.body.gap(q) == pytest.approx(plain.body.gap(centre), abs=1e-12)
    assert np.abs(marked.body.gap(q) - plain.body.gap(q)).max() > 3e-4
