"""Drops under a given law: energy, contact, agreement with Drake and with the independent simulator, the camera.

A saved model makes drops that are a dataset like a measured one.
"""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pandas as pd
import pytest
from hidden_effects import LAW, RIG_NOISE, TRUTH, injected_impacts, sizes
from hidden_effects import simulated as recorded_drops
from saved_models import model_of as saved_model_of

from thesis_lib.__main__ import main
from thesis_lib.bodies.body import Body, Noise
from thesis_lib.bodies.shapes import Ellipse
from thesis_lib.critique.contacts.bases import BASES
from thesis_lib.critique.contacts.model import Model
from thesis_lib.critique.likelihood.fit import fit
from thesis_lib.critique.likelihood.observations import observe
from thesis_lib.critique.results.saved_model import SavedModel, SavedReference
from thesis_lib.critique.simulation import simulate_model as module
from thesis_lib.critique.simulation.drake_augmented import drake_poses
from thesis_lib.critique.simulation.law_drops import between, own_poses, simulate_law_drops
from thesis_lib.critique.simulation.simulate_model import measured_releases, proof_releases, simulate_model
from thesis_lib.datasets import read_dataset
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.effects import EFFECTS
from thesis_lib.foundation.errors import UserError
from thesis_lib.mechanics.state import State
from thesis_lib.simulate.rig.hidden_causes import ELLIPSE_BODY, PROOF_RELEASE, SQUARE
from thesis_lib.simulate.stepping.drops import simulate_drops

DT = 1.0 / 250.0
GRAVITY = 9.81
EXACT = Noise(position=1e-12, angle=1e-12)  # as good as none
FREE = 1e-5  # m/s², rad/s²: second differences of exact poses are that of free fall to 1e-12 / DT²
SIGMAS = 4.0
# the other simulator takes drag by a midpoint rule in steps of 1 ms, and impacts amplify what that leaves
SAME_FLIGHT, OWN_FLIGHT = 1e-8, 5e-4
GRIPPING = {"mu": 0.3, "epsilon": 0.55, "tangential_restitution.e_t": 0.4}
SAME = 1e-7  # m and rad, between the engines


def model_of(*effects: str, law: str = LAW.name, factor: float = 1.0, tau: float | None = None) -> tuple[Model, dict]:
    """The law with effects at a multiple of their scales, and its values; contacts take time with `tau` in s."""
    chosen = tuple(EFFECTS[name] for name in effects)
    values = TRUTH | ({} if tau is None else {"tau": tau})
    for effect in chosen:
        values = values | sizes(effect, factor)
    return Model(BASES[law], chosen, takes_time=tau is not None), values


@cache
def simulated(
    *effects: str, n: int = 12, seed: int = 0, noise: Noise = EXACT, body: Body = ELLIPSE_BODY, poses=own_poses, **how
) -> Dataset:
    rng = np.random.default_rng(seed)
    model, values = model_of(*effects, **how)
    return simulate_law_drops(body, PROOF_RELEASE, n, model, values, noise=noise, rng=rng, poses=poses)


def energies(dataset: Dataset, trial: int) -> np.ndarray:
    """Energy per unit mass, J/kg, wherever three samples in a row are in free flight."""
    q = dataset.trajectories.loc[dataset.trajectories["trial"] == trial, ["x", "y", "theta"]].to_numpy()
    a = (q[2:] - 2 * q[1:-1] + q[:-2]) / DT**2
    v = (q[2:] - q[:-2]) / (2 * DT)  # exact on a parabola
    free = (np.abs(a - [0.0, -GRAVITY, 0.0]) < FREE).all(axis=1)
    kinetic = 0.5 * (v[:, 0] ** 2 + v[:, 1] ** 2 + dataset.k_g**2 * v[:, 2] ** 2)
    return (kinetic + GRAVITY * q[1:-1, 1])[free]


@pytest.mark.parametrize("law", ["anitescu_potra_newton", "wang_mason", "mirtich"])
def test_energy_never_rises_and_falls_at_impacts(law):
    dataset = simulated(law=law)
    for trial in dataset.trials:
        E = energies(dataset, trial)
        assert len(E) > 10
        assert np.diff(E).max() < 1e-6 * E[0]
        if dataset.trajectories["trial"].value_counts()[trial] > 100:
            assert E[-1] < 0.9 * E[0]


def test_the_body_stays_above_the_surface_and_touches_it():
    dataset = simulated()
    table = dataset.trajectories
    gap = dataset.shape.gap(table["y"].to_numpy(), table["theta"].to_numpy(), 0.0)
    assert gap.min() > -1e-9
    lowest = pd.Series(gap).groupby(table["trial"]).min()
    assert lowest.max() < 0.02  # 3 m/s for half a sampling period, and some


def test_a_raised_surface_is_touched_where_it_is():
    height = sizes(EFFECTS["surface_height"])["surface_height.h"]
    assert height != 0.0
    gaps = []
    for effects in ((), ("surface_height",)):
        table = simulated(*effects).trajectories
        gaps.append(simulated().shape.gap(table["y"].to_numpy(), table["theta"].to_numpy(), 0.0).min())
    assert gaps[1] >= min(height, 0.0) - 1e-9 and gaps[1] - gaps[0] == pytest.approx(height, abs=5e-4)


def test_drops_agree_with_the_independent_simulator_until_chaos():
    n, seed = 12, 0
    truth = simulate_drops(
        ELLIPSE_BODY, PROOF_RELEASE, n, **TRUTH, duration=0.6, noise=EXACT, rng=np.random.default_rng(seed)
    )
    ours = simulated(n=n, seed=seed)
    compared = 0
    for trial, hits in truth.impacts.groupby("trial"):
        until = hits["t"].iloc[1] if len(hits) > 1 else np.inf  # over the first impact
        tables = [
            table.loc[(table["trial"] == trial) & (table["t"] < until), ["t", "x", "y", "theta"]].to_numpy()
            for table in (truth.trajectories, ours.trajectories)
        ]
        shorter = min(map(len, tables))
        assert shorter > 5
        np.testing.assert_allclose(tables[0][:shorter], tables[1][:shorter], atol=1e-6)
        compared += tables[1][:shorter][-1, 0] > hits["t"].iloc[0]
    assert compared >= n - 2


@pytest.mark.parametrize("names", [(), ("linear_drag",), ("com_offset",), ("tangential_restitution",)])
def test_the_fit_finds_the_coefficients_and_an_effect_beside_them(names):
    """Drops integrate the effect in small steps; the fit extrapolates arcs: neither may bias the other."""
    o = observe(simulated(*names, n=40, seed=2, noise=RIG_NOISE))
    model, values = model_of(*names)
    fitted = fit(model, o)
    for key, value in values.items():
        assert abs(fitted.values[key] - value) < SIGMAS * fitted.std[key], key


def test_the_camera_adds_its_faults_to_the_poses_and_nothing_else():
    plain, drifting, mirrored = (
        simulated(*names).trajectories for names in ((), ("sensor_drift",), ("mirrored_rotation",))
    )
    drift = sizes(EFFECTS["sensor_drift"])["sensor_drift.d_x"]
    np.testing.assert_allclose(drifting["x"] - plain["x"], drift * plain["t"], atol=1e-9)
    np.testing.assert_allclose(drifting[["y", "theta"]], plain[["y", "theta"]], atol=1e-9)
    np.testing.assert_allclose(mirrored["theta"], -plain["theta"], atol=1e-9)
    np.testing.assert_allclose(mirrored[["x", "y"]], plain[["x", "y"]], atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("body", [ELLIPSE_BODY, SQUARE], ids=["ellipse", "square"])
@pytest.mark.parametrize("law", ["mirtich", "compliant_contact"])
def test_contacts_last_as_long_as_the_model_says(law, body):
    model, values = model_of(law=law, tau=6e-4)
    fitted = fit(model, observe(simulated(law=law, tau=6e-4, body=body, n=30, noise=RIG_NOISE)))
    for name, value in values.items():
        assert abs(fitted.values[name] - value) < SIGMAS * fitted.std[name], name


def test_a_body_sinks_in_while_it_touches():
    """At most by τ times the fastest approach, 3 m/s; and the shorter the contact, the less."""
    depths = []
    for tau in (6e-4, 1.8e-3):
        made = simulated(law="mirtich", tau=tau, n=30, noise=RIG_NOISE)
        table = made.trajectories
        depths.append(-made.shape.gap(table["y"].to_numpy(), table["theta"].to_numpy(), 0.0).min())
        assert 3.0 * RIG_NOISE.position < depths[-1] < 3.0 * tau
    assert depths[1] > 2.0 * depths[0]


def test_a_contact_that_takes_no_time_is_an_impulse():
    short, rigid = simulated(tau=1e-8).trajectories, simulated().trajectories
    first = rigid["t"] < 0.3  # later impacts amplify what differs
    np.testing.assert_allclose(short[first][["x", "y", "theta"]], rigid[first][["x", "y", "theta"]], atol=1e-5)


def test_the_path_within_a_contact_joins_both_ends():
    zero = np.zeros(1)
    touch = State.of(np.array([[0.0, 0.03, 0.1]]), np.array([[0.5, -2.0, 3.0]]), zero, zero + 0.1)
    end = State.of(np.array([[0.0005, 0.03, 0.11]]), np.array([[0.3, 1.0, 9.0]]), zero, zero + 0.101)
    np.testing.assert_allclose(between(touch, end, 0.1).q, touch.q, atol=1e-15)
    np.testing.assert_allclose(between(touch, end, 0.1).v, touch.v, atol=1e-12)
    near = between(touch, end, 0.101 - 2e-9)
    np.testing.assert_allclose(near.v, end.v, atol=1e-3)
    middle = between(touch, end, 0.1005)
    assert middle.t[0] == pytest.approx(0.1005) and middle.y[0] == pytest.approx(0.03 - 0.001 * 3.0 / 8.0)
    assert between(touch, end, 0.101) is end


def both(*names: str, tau: float | None = None) -> tuple[pd.DataFrame, pd.DataFrame]:
    """The first half second in Drake and in the program's own simulator, side by side."""
    of = {"law": "wang_mason", "factor": 3.0, "tau": tau, "n": 6}
    tables = (simulated(*names, **of, poses=poses).trajectories for poses in (drake_poses, own_poses))
    return tuple(table[table["t"] < 0.5].reset_index(drop=True) for table in tables)


@pytest.mark.parametrize("names", [(), ("tangential_restitution",), ("linear_drag",), ("mirrored_rotation",)])
def test_drake_and_the_own_simulator_agree(names):
    drake, own = both(*names)
    assert len(drake) == len(own) > 50 * 6
    np.testing.assert_allclose(drake["t"], own["t"], atol=1e-9)
    tolerance = OWN_FLIGHT if "linear_drag" in names else SAME_FLIGHT
    np.testing.assert_allclose(drake[["x", "y", "theta"]], own[["x", "y", "theta"]], atol=tolerance)
    if names and names != ("mirrored_rotation",):  # the effect acts far beyond the tolerance
        with_it, without = (table.set_index(["trial", "t"]) for table in (drake, both()[0]))
        assert (with_it - without).dropna().abs()["x"].max() > 10.0 * OWN_FLIGHT


@pytest.mark.parametrize("names", [(), ("mirrored_rotation",)])
def test_contacts_last_as_long_in_drake(names):
    drake, own = both(*names, tau=2e-3)  # T is 3.7 ms: most contacts hold a sample
    np.testing.assert_allclose(drake["t"], own["t"], atol=1e-9)
    np.testing.assert_allclose(drake[["x", "y", "theta"]], own[["x", "y", "theta"]], atol=SAME_FLIGHT)
    rigid = both(*names)[0]
    assert len(rigid) != len(drake) or np.abs(drake["y"] - rigid["y"]).max() > 1e-3


@pytest.fixture
def model_file(tmp_path):
    saved_model_of(**GRIPPING).save(tmp_path / "model.json")
    return tmp_path / "model.json"


def test_the_command_writes_a_dataset_that_can_be_read(model_file, tmp_path, capsys):
    command = ["simulate", str(model_file), "--drops", "6", "--seed", "4"]
    assert main([*command, "-o", str(tmp_path / "a")]) == 0
    said = capsys.readouterr()
    assert said.out == "" and "6 drops" in said.err
    data = read_dataset(tmp_path / "a")
    assert data.trials.tolist() == list(range(6)) and data.impacts is None
    assert data.shape == ELLIPSE_BODY.shape and data.rate == 250.0 and data.header.noise == RIG_NOISE
    assert "simulated" in data.header.description and "tangential_restitution" in data.header.description
    assert len(observe(data)) > 6
    assert main([*command, "-q", "-o", str(tmp_path / "b")]) == 0
    assert capsys.readouterr().err == ""
    for name in ("dataset.yaml", "trajectories.csv"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()


def test_engines_agree_where_the_surface_is_not_at_zero():
    own, drake = (
        simulate_model(saved_model_of(0.4, **GRIPPING), 3, engine=engine, rng=np.random.default_rng(1))
        for engine in module.ENGINES
    )
    assert own.height == drake.height == 0.4
    assert own.mass is None and drake.mass is None  # a model.json knows of none
    columns = ["x", "y", "theta"]
    np.testing.assert_allclose(own.trajectories[columns], drake.trajectories[columns], atol=SAME)


@pytest.mark.slow
def test_without_noise_the_measured_throws_come_back():
    """Free flight and its law are known here: what differs is what the noise does to the releases."""
    model = saved_model_of(mu=0.15, epsilon=0.55)
    like = recorded_drops("throws", 3)
    made = simulate_model(model, 10, like=like, rng=np.random.default_rng(0))
    measured = like.trajectories.groupby("trial").head(20).set_index(["trial", "t"])
    o = observe(like)
    rows = np.flatnonzero(o.found.impacts.impact == 0)[:10]
    again = made.trajectories.groupby("trial").head(20).set_index(["trial", "t"])
    for i, trial in enumerate(o.trial[rows]):
        off = again.loc[i].to_numpy() - measured.loc[trial].to_numpy()
        # velocities at the impact are known to 5 mm/s and 0.05 rad/s, 0.3 s after the release
        assert np.abs(off[:, :2].mean(axis=0)).max() < 5e-3 and abs(off[:, 2].mean()) < 0.05
    assert made.rate == like.rate


@pytest.mark.slow
def test_more_drops_than_releases_repeat_them_in_another_order():
    releases, _ = _releases(recorded_drops("throws", 3))
    count = len(releases.q)
    q, v = releases.draw(count + 40, np.random.default_rng(0))
    np.testing.assert_array_equal(q[:count], releases.q)
    assert len(q) == len(v) == count + 40 and not np.array_equal(q[count:], releases.q[:40])
    assert all(row in releases.q[:, 2] for row in q[count:, 2])


def test_impacts_alone_are_traced_back_to_where_the_body_was_let_go():
    like = injected_impacts("hits", 40, 3, "tangential_restitution", {"tangential_restitution.e_t": 0.4})
    releases, duration = _releases(like)
    assert np.abs(releases.v[:, 1]).max() < 1e-9
    fall = like.impacts["vy_pre"].to_numpy() ** 2 / (2.0 * 9.81)
    np.testing.assert_allclose(releases.q[:, 1], like.impacts["y"] + fall, atol=1e-9)
    assert duration > -like.impacts["vy_pre"].min() / 9.81


def _releases(like):
    return measured_releases(saved_model_of(mu=0.15, epsilon=0.55), like, observe(like))


def test_large_bodies_are_released_clear_of_the_surface():
    assert proof_releases(saved_model_of(**GRIPPING)) == PROOF_RELEASE
    large = ELLIPSE_BODY.model_copy(update={"shape": Ellipse(semi_axes=(0.5, 0.2))})
    height = proof_releases(saved_model_of(body=large, **GRIPPING)).height
    assert height.low > 0.5 and height.high - height.low == pytest.approx(0.54)


def test_bad_options_and_models_are_refused_and_measurements_are_not_written_over(model_file, tmp_path, capsys):
    out = tmp_path / "out"
    command = ["simulate", str(model_file), "-o", str(out)]
    for options, says in (("--drops 0", "must be 1 or more"), ("--seed -1", "--seed"), ("--like nowhere", "nowhere")):
        assert main([*command, *options.split()]) == 2
        assert says in capsys.readouterr().err and not out.exists()
    out.mkdir()
    (out / "trajectories.csv").write_text("precious\n")
    assert main(command) == 2 and "may be measured" in capsys.readouterr().err
    assert (out / "trajectories.csv").read_text() == "precious\n"
    content = json.loads(model_file.read_text())
    del content["rig"]
    model_file.write_text(json.dumps(content))
    assert main([*command[:-1], str(tmp_path / "no_rig")]) == 2
    assert "rig: Field required" in capsys.readouterr().err


def test_without_drake_the_other_engine_is_named(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "thesis_lib.critique.simulation.drake_augmented", None)
    with pytest.raises(UserError, match="--engine own"):
        simulate_model(saved_model_of(**GRIPPING), 1, engine="drake", rng=np.random.default_rng(0))


def from_elsewhere(model: SavedModel, **reference: float) -> SavedModel:
    return model.model_copy(update={"rig": model.rig.model_copy(update={"reference": SavedReference(**reference)})})


def test_drops_are_numbered_from_0_and_the_middle_one_is_that_of_the_reference():
    model, plain = saved_model_of(mu=0.3, epsilon=0.55, **{"wear.w": -0.01}), saved_model_of(mu=0.3, epsilon=0.55)
    near, far, unworn = (
        simulate_model(one, 9, rng=np.random.default_rng(6)).trajectories
        for one in (model, from_elsewhere(model, x=3.0, t=1.7e9, trial=20260114.0), plain)
    )
    np.testing.assert_array_equal(near, far)
    same = [
        near[near["trial"] == i].reset_index(drop=True).equals(unworn[unworn["trial"] == i].reset_index(drop=True))
        for i in range(9)
    ]
    assert same == [i == 4 for i in range(9)]


def test_measured_releases_keep_their_places():
    sloping = saved_model_of(mu=0.3, epsilon=0.55, **{"position_dependent_restitution.g_eps": 0.5})
    like = injected_impacts("hits", 12, 3, "tangential_restitution", {"tangential_restitution.e_t": 0.4})
    moved = replace(like, impacts=like.impacts.assign(x=like.impacts["x"] + 3.0))
    here, there = (
        simulate_model(model, 12, like=data, rng=np.random.default_rng(6)).trajectories
        for model, data in ((sloping, like), (from_elsewhere(sloping, x=3.0), moved))
    )
    np.testing.assert_allclose(there["x"] - 3.0, here["x"], atol=SAME)
    np.testing.assert_allclose(there["y"], here["y"], atol=SAME)
