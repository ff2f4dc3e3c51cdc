"""Impacts in space as impacts.csv states them: the body's states and their covariance, reasons, and a verdict."""

import json

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation
from tosses import stated_hits

from tests.critique.simulation.saved_models import space_model
from tests.datasets.folders_in_space import write_mesh
from thesis_lib.__main__ import main
from thesis_lib.contact import LAWS
from thesis_lib.critique import criticise, fit
from thesis_lib.critique.contacts.model import Model
from thesis_lib.critique.likelihood.comparison import Comparison
from thesis_lib.critique.likelihood.in_space.given import given_in_space
from thesis_lib.critique.likelihood.in_space.hits import observe_in_space
from thesis_lib.critique.results.load_model import load_model
from thesis_lib.critique.results.saved_in_space import SavedSpaceModel
from thesis_lib.datasets import dataset_of
from thesis_lib.datasets.format.frames import surface_frames
from thesis_lib.datasets.format.header import SpaceHeader
from thesis_lib.datasets.format.table_forms import POSE_IN_SPACE, V_POST_IN_SPACE, V_PRE_IN_SPACE
from thesis_lib.foundation.errors import UserError
from thesis_lib.mechanics.space import SPACE

TRUTH = {"mu": 0.25, "epsilon": 0.5}
CAMERA = Rotation.from_rotvec([0.4, -1.2, 0.7])
NOISE = {"position": [2e-4, 2e-4, 1e-3], "rotation": 3e-3, "velocity": 0.01, "angular_velocity": 0.1}


def content(**changes) -> dict:
    box = {"kind": "box", "half_extents": [0.05, 0.04, 0.03]}
    return {
        "schema": 2,
        "body": {"shape": box, "homogeneous": True, "mass": 0.25},
        "tracked": {"position": [0.03, -0.02, 0.04], "quaternion": [0.8, 0.0, 0.6, 0.0]},
        "gravity": CAMERA.apply([0.0, 0.0, -9.81]).tolist(),
        "surface": {"point": [0.1, 0.2, 0.3]},
        "noise": NOISE,
    } | changes


def noisy(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    """The table as it is measured, each side with an error of its own but of one pose."""
    n, pose = len(table), table[list(POSE_IN_SPACE)].to_numpy().T
    place = pose[:3] + np.array(NOISE["position"])[:, None] * rng.standard_normal((3, n))
    turned = SPACE.attitude_after(pose[3:], NOISE["rotation"] * rng.standard_normal((3, n)))
    made = table.assign(**dict(zip(POSE_IN_SPACE, np.concatenate([place, turned]))))
    for name in V_PRE_IN_SPACE + V_POST_IN_SPACE:
        made[name] += NOISE["velocity" if name[0] == "v" else "angular_velocity"] * rng.standard_normal(n)
    return made


def test_the_law_that_made_the_hits_leaves_nothing():
    head = content()
    o = observe_in_space(dataset_of(head, impacts=stated_hits(head, 6)))
    assert len(o) > 15 and not o.arcs and o.noise_known and set(o.trial) == set(range(6))
    here = Comparison(Model(LAWS["anitescu_potra_newton"], space=SPACE), TRUTH, o)
    assert np.abs(here.R).max() < 1e-6
    assert np.abs(o.value[:, 0, 2] + o.rig.lowest(o.lines(0))[2]).max() < 1e-6  # the body touches


def test_one_law_is_fitted_by_one_call_and_predicts():
    table = stated_hits(content(), 8)
    model = fit(dataset_of(content(), impacts=noisy(table, np.random.default_rng(5))), "anitescu_potra_newton")
    for name, value in TRUTH.items():
        fitted = model.parameters[name]
        assert abs(fitted.value - value) < 3.0 * fitted.std < 0.1, name
    names = list(V_POST_IN_SPACE)
    errors = (model.predict(table)[names] - table[names]).to_numpy()
    assert isinstance(model, SavedSpaceModel) and np.abs(np.median(errors, axis=0)).max() < NOISE["velocity"]


def test_the_covariance_is_that_of_many_measurements():
    head, rng = content(), np.random.default_rng(3)
    one = stated_hits(head, 1).iloc[[0]]
    many = noisy(one.loc[one.index.repeat(4000)].reset_index(drop=True), rng)
    many["trial"] = np.arange(len(many))
    o = given_in_space(dataset_of(head, impacts=many))
    off = o.space.difference(o.value[:, 0].T, o.value[0, 0][:, None]).T
    data = np.stack([off, o.slope[:, 0]], axis=2).reshape(len(o), 12)
    found, said = np.cov(data.T), o.cov[:, 0].mean(axis=0)
    sigma = np.sqrt(np.diag(said))
    np.testing.assert_allclose(found / np.outer(sigma, sigma), said / np.outer(sigma, sigma), atol=0.08)


def test_what_no_impact_makes_has_a_reason():
    head = content()
    table = stated_hits(head, 4)
    up = CAMERA.apply([0.0, 0.0, 1.0])
    table.loc[1, list(V_PRE_IN_SPACE[:3])] = 3.0 * up
    table.loc[2, list(V_POST_IN_SPACE[:3])] = 30.0 * up
    found = given_in_space(dataset_of(head, impacts=table)).found.left_out
    assert found[["impact", "reason"]].to_numpy().tolist() == [[1, "no_approach"], [2, "energy_gain"]]


def test_a_contact_point_that_is_given_is_used():
    head = content()
    table, shift = stated_hits(head, 3), CAMERA.apply([1e-3, -2e-3, 0.0])
    plain = given_in_space(dataset_of(head, impacts=table))
    (frame,) = surface_frames(SpaceHeader.model_validate(head))
    lowest = frame.vectors_out(plain.lines(0).position + plain.rig.lowest(plain.lines(0))) + frame.origin[:, None]
    r = lowest.T + shift - table[["x", "y", "z"]].to_numpy()
    given = given_in_space(dataset_of(head, impacts=table.assign(**dict(zip(("r_x", "r_y", "r_z"), r.T)))))
    np.testing.assert_allclose(given.offset, np.tile(frame.vectors_in(shift[:, None]).T, (len(given), 1)), atol=1e-9)
    assert np.abs(plain.offset).max() < 1e-12


def test_a_ball_without_orientation_and_what_is_refused():
    ball = {"shape": {"kind": "sphere", "radius": 0.03}, "homogeneous": True, "mass": 0.1}
    head = content(body=ball, tracked={"position": [0.0, 0.0, 0.0]})
    bare = stated_hits(head, 4).drop(columns=["qw", "qx", "qy", "qz"])
    o = observe_in_space(dataset_of(head, impacts=bare))
    assert len(o) > 10 and not o.rig.has_angle and o.noise_known
    with pytest.raises(UserError, match="the centre of mass is not at the tracked point"):
        observe_in_space(dataset_of(content(body=ball), impacts=bare))
    floor = {"point": [0.1, 0.2, 0.3], "normal": CAMERA.apply([0.0, 0.0, 1.0]).tolist()}
    two = {key: value for key, value in content().items() if key != "surface"}
    two |= {"surfaces": [floor | {"name": "floor"}, floor | {"name": "shelf", "point": [0.1, 0.2, 1.0]}]}
    one = two | {"surfaces": [floor | {"name": "floor"}]}
    assert len(observe_in_space(dataset_of(one, impacts=stated_hits(content(), 2)))) == len(stated_hits(content(), 2))
    with pytest.raises(UserError, match="several surfaces cannot be distinguished"):
        observe_in_space(dataset_of(two, impacts=stated_hits(content(), 2)))


@pytest.mark.slow
def test_a_model_of_a_mesh_keeps_its_mesh(tmp_path):
    shape = write_mesh(tmp_path / "data")  # the same box
    head = content(body={"shape": shape, "homogeneous": True, "mass": 0.25})
    found = criticise(dataset_of(head, impacts=stated_hits(content(), 5), folder=tmp_path / "data"))
    assert found.to_dict()["verdict"] is None
    found.save(tmp_path / "out")
    model = load_model(tmp_path / "out" / "model.json")
    after = model.predict(stated_hits(content(), 2, seed=1)[["trial", "t", *POSE_IN_SPACE, *V_PRE_IN_SPACE]])
    assert (after["status"] == "ok").all()
    write_mesh(tmp_path / "out", half_extents=(0.05, 0.04, 0.02))
    with pytest.raises(UserError, match="the mesh is not the one that the model was fitted to"):
        load_model(tmp_path / "out" / "model.json")
    (tmp_path / "out" / "body.obj").unlink()
    with pytest.raises(UserError, match=r"the file body\.obj does not exist"):
        load_model(tmp_path / "out" / "model.json")


@pytest.mark.slow
@pytest.mark.usefixtures("without_pictures")
def test_impacts_alone_are_criticised(tmp_path):
    head = content()
    found = criticise(dataset_of(head, impacts=noisy(stated_hits(head, 25), np.random.default_rng(1))))
    told = found.to_dict()
    assert told["verdict"] == "adequate" and told["base_model"]["name"] == "anitescu_potra_newton"
    for name, value in TRUTH.items():
        said = told["base_model"]["parameters"][name]
        assert abs(said["value"] - value) < 4.0 * said["std"] + 1e-3
    found.save(tmp_path / "out")
    assert (tmp_path / "out" / "report.html").exists()


def model_with(**values: float) -> SavedSpaceModel:
    """Newton's restitution with friction, and one effect."""
    rig = {name: value for name, value in content().items() if name != "noise"}
    return space_model("anitescu_potra_newton", rig=rig, **values)


def test_a_model_of_later_hits_predicts_them_by_their_tosses():
    table = stated_hits(content(), 6)
    given = table.drop(columns=list(V_POST_IN_SPACE))
    found = model_with(**{"later_restitution.d": -0.4}).predict(given)
    first = table["impact"] == 0
    for rows, epsilon in (
        (first, 0.5),
        (~first & (table.groupby("trial")["t"].transform("min") + 0.03 < table["t"]), 0.3),
    ):
        expected = model_with(epsilon=epsilon).predict(given[rows])
        assert len(expected) > 3
        pd.testing.assert_frame_equal(found[rows], expected)
    with pytest.raises(UserError, match="add the column t to the states, and include the first hit of each trial"):
        model_with(**{"later_friction.d": 0.3}).predict(given.drop(columns="t"))
    with pytest.raises(UserError, match="rotation_scale, which depends on all frames of a toss before the hit"):
        model_with(**{"rotation_scale.s_R": 0.02}).predict(given)


def test_lengths_and_signs_of_quaternions_change_no_prediction_and_those_of_no_rotation_are_refused():
    table, q = stated_hits(content(), 3), ["qw", "qx", "qy", "qz"]
    names, plain = list(V_POST_IN_SPACE), model_with().predict(table)
    scaled = table.assign(**{name: -1.015 * table[name] for name in q})
    np.testing.assert_allclose(model_with().predict(scaled)[names], plain[names], atol=1e-9)
    with pytest.raises(UserError, match=r"^The quaternion has the length 0.9 in .* first in row 1 below"):
        model_with().predict(table.assign(**{name: 0.9 * table[name] for name in q}))


def test_hits_of_a_ball_without_orientation_are_predicted():
    ball = {"shape": {"kind": "sphere", "radius": 0.03}, "homogeneous": True, "mass": 0.1}
    head = content(body=ball, tracked={"position": [0.0, 0.0, 0.0]})
    table, model = stated_hits(head, 3), space_model("anitescu_potra_newton", rig={"body": ball} | _without_noise(head))
    bare, names = table.drop(columns=["qw", "qx", "qy", "qz"]), list(V_POST_IN_SPACE)
    made = model.predict(bare)
    assert list(made) == [*bare, "status"] and (made["status"] == "ok").all()
    np.testing.assert_allclose(made[names], table[names], atol=1e-6)
    with pytest.raises(UserError, match="lack the column"):
        model_with().predict(bare)


def _without_noise(head: dict) -> dict:
    return {key: value for key, value in head.items() if key in ("tracked", "gravity", "surface")}


def test_the_command_predicts_as_json_in_space(tmp_path, capsys):
    model_with().save(tmp_path / "model.json")
    stated_hits(content(), 3).to_csv(tmp_path / "states.csv", index=False)
    assert main(["predict", str(tmp_path / "model.json"), str(tmp_path / "states.csv"), "--json"]) == 0
    printed = capsys.readouterr()
    assert set(json.loads(printed.out)["predictions"][0]) == {*V_POST_IN_SPACE, "status"} and not printed.err


def test_the_command_says_which_bodies_do_not_touch(tmp_path, capsys):
    model_with().save(tmp_path / "model.json")
    table = stated_hits(content(), 3)
    off = np.zeros(len(table))
    off[[1, 3]] = 2.0, -1.5
    table[["x", "y", "z"]] += off[:, None] * CAMERA.apply([0.0, 0.0, 1.0])
    table.to_csv(tmp_path / "states.csv", index=False)
    assert main(["predict", str(tmp_path / "model.json"), str(tmp_path / "states.csv")]) == 0
    said = capsys.readouterr().err
    assert said.startswith("warning: ") and f"states.csv: In 2 of {len(table)} row(s)" in said
    assert "more than 0.018 m above (+) or below (−) the surface: row 2 by +2 m and row 4 by −1.5 m." in said
