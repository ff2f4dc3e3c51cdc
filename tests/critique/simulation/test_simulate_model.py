"""A saved model makes drops that are a dataset like a measured one, and that the critique takes for the model's."""

import json
from dataclasses import replace

import numpy as np
import pytest
from hidden_effects import RIG_NOISE, injected_impacts, simulated
from saved_models import model_of

from thesis_lib.__main__ import main
from thesis_lib.bodies.shapes import Ellipse
from thesis_lib.critique.drops.criticise import criticise_drops
from thesis_lib.critique.likelihood.observations import observe
from thesis_lib.critique.results.load_model import load_model
from thesis_lib.critique.results.saved_model import SavedModel, SavedReference
from thesis_lib.critique.simulation import simulate_model as module
from thesis_lib.critique.simulation.simulate_model import measured_releases, proof_releases, simulate_model
from thesis_lib.datasets import read_dataset
from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.rig.hidden_causes import ELLIPSE_BODY, PROOF_RELEASE

TRUTH = {"mu": 0.3, "epsilon": 0.55, "tangential_restitution.e_t": 0.4}
SAME = 1e-7  # m and rad, between the engines


@pytest.fixture
def model_file(tmp_path):
    model_of(**TRUTH).save(tmp_path / "model.json")
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
        simulate_model(model_of(0.4, **TRUTH), 3, engine=engine, rng=np.random.default_rng(1))
        for engine in module.ENGINES
    )
    assert own.height == drake.height == 0.4
    assert own.mass is None and drake.mass is None  # a model.json knows of none
    columns = ["x", "y", "theta"]
    np.testing.assert_allclose(own.trajectories[columns], drake.trajectories[columns], atol=SAME)


@pytest.mark.slow
def test_without_noise_the_measured_throws_come_back():
    """Free flight and its law are known here: what differs is what the noise does to the releases."""
    model = model_of(mu=0.15, epsilon=0.55)
    like = simulated("throws", 3)
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
    releases, _ = _releases(simulated("throws", 3))
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
    return measured_releases(model_of(mu=0.15, epsilon=0.55), like, observe(like))


def test_large_bodies_are_released_clear_of_the_surface():
    assert proof_releases(model_of(**TRUTH)) == PROOF_RELEASE
    large = ELLIPSE_BODY.model_copy(update={"shape": Ellipse(semi_axes=(0.5, 0.2))})
    height = proof_releases(model_of(body=large, **TRUTH)).height
    assert height.low > 0.5 and height.high - height.low == pytest.approx(0.54)


@pytest.mark.parametrize(
    ("options", "says"),
    [(["--drops", "0"], "must be 1 or more"), (["--seed", "-1"], "--seed"), (["--like", "nowhere"], "nowhere")],
)
def test_bad_options_are_refused(model_file, tmp_path, capsys, options, says):
    assert main(["simulate", str(model_file), "-o", str(tmp_path / "out"), *options]) == 2
    assert says in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_model_without_a_rig_is_refused_with_the_reason(model_file, tmp_path, capsys):
    content = json.loads(model_file.read_text())
    del content["rig"]
    model_file.write_text(json.dumps(content))
    assert main(["simulate", str(model_file), "-o", str(tmp_path / "out")]) == 2
    assert "rig: Field required" in capsys.readouterr().err


def test_measurements_are_not_written_over(model_file, tmp_path, capsys):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "trajectories.csv").write_text("precious\n")
    assert main(["simulate", str(model_file), "-o", str(tmp_path / "out")]) == 2
    assert "may be measured" in capsys.readouterr().err
    assert (tmp_path / "out" / "trajectories.csv").read_text() == "precious\n"


def test_without_drake_the_other_engine_is_named(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "thesis_lib.critique.simulation.drake_augmented", None)
    with pytest.raises(UserError, match="--engine own"):
        simulate_model(model_of(**TRUTH), 1, engine="drake", rng=np.random.default_rng(0))


@pytest.mark.slow
def test_the_critique_finds_the_parameters_of_the_model_that_made_the_drops(model_file):
    data = simulate_model(load_model(model_file), 60, rng=np.random.default_rng(2))
    found = criticise_drops(data, rng=np.random.default_rng(0), effects=("tangential_restitution",))
    fitted = found.ladder[-1][1]
    assert found.verdict == "effects"  # by a law that agrees with Wang-Mason here: several do
    for name, value in TRUTH.items():
        assert abs(fitted.values[name] - value) < 4.0 * fitted.std[name], name
        assert fitted.std[name] < 0.05


def from_elsewhere(model: SavedModel, **reference: float) -> SavedModel:
    return model.model_copy(update={"rig": model.rig.model_copy(update={"reference": SavedReference(**reference)})})


def test_drops_are_numbered_from_0_and_the_middle_one_is_that_of_the_reference():
    model, plain = model_of(mu=0.3, epsilon=0.55, **{"wear.w": -0.01}), model_of(mu=0.3, epsilon=0.55)
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
    sloping = model_of(mu=0.3, epsilon=0.55, **{"position_dependent_restitution.g_eps": 0.5})
    like = injected_impacts("hits", 12, 3, "tangential_restitution", {"tangential_restitution.e_t": 0.4})
    moved = replace(like, impacts=like.impacts.assign(x=like.impacts["x"] + 3.0))
    here, there = (
        simulate_model(model, 12, like=data, rng=np.random.default_rng(6)).trajectories
        for model, data in ((sloping, like), (from_elsewhere(sloping, x=3.0), moved))
    )
    np.testing.assert_allclose(there["x"] - 3.0, here["x"], atol=SAME)
    np.testing.assert_allclose(there["y"], here["y"], atol=SAME)
