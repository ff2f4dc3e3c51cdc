"""Predicted against measured tosses: the metrics, the start and its covariance, the floor, comparisons and errors."""

import json
import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from saved_models import model_of, space_model

from thesis_lib.__main__ import main
from thesis_lib.commands.rollout import also_held_out
from thesis_lib.contact.compliant.normal_force import LinearDamper
from thesis_lib.critique.simulation import rollout
from thesis_lib.critique.simulation.first_flight import MeasuredTosses, first_flight, first_frame
from thesis_lib.critique.simulation.rollout import compared, of_frames, of_tosses, roll_out, summary
from thesis_lib.critique.simulation.simulate_in_space import simulate_in_space
from thesis_lib.critique.simulation.to_tosses import fit_to_tosses
from thesis_lib.datasets.format.table_forms import POSE_IN_SPACE, V_POST_IN_SPACE, V_PRE_IN_SPACE
from thesis_lib.datasets.format.write import write_dataset
from thesis_lib.foundation.errors import UserError
from thesis_lib.mechanics.space import SPACE, of_rotation_vector
from thesis_lib.mechanics.state import State
from thesis_lib.simulate.tosses.example import simulate_tosses

COMPLIANT = {"law": "compliant_contact", "tau": 2e-3}


@pytest.fixture(scope="module")
def simulated():
    model = space_model(**COMPLIANT)
    return model, simulate_in_space(model, 12, rng=np.random.default_rng(2))


def resting(height: float, aside: float = 0.0, turn: float = 0.0, n: int = 5) -> State:
    pose = np.concatenate([[aside, 0.0, height], of_rotation_vector(np.array([[0.0], [0.0], [turn]]))[:, 0]])
    return State.of(np.tile(pose, (n, 1)), np.zeros((n, 6)), np.zeros(n), np.zeros(n), None, SPACE)


def test_metrics_of_tosses_made_by_hand():
    model, times, seen = space_model(), np.arange(5)[:, None] / 100.0, np.arange(5)[:, None] < 4
    frames = of_frames(model, resting(0.029, 0.006, 0.1), resting(0.03), times, seen, np.zeros((5, 1), int))
    of = of_tosses(model, frames).iloc[0]
    off, width = np.hypot(0.006, 0.001), 0.08  # the mean of 100, 80 and 60 mm
    assert len(frames) == 4
    assert of["pos_int_percent"] == pytest.approx(100.0 * off / width)
    assert of["angle_int_deg"] == pytest.approx(np.degrees(0.1))
    assert of["penetration_int_percent"] == pytest.approx(100.0 * 0.001 / width)
    assert of["loss"] == pytest.approx(off**2 / (0.5 * width) + 0.1**2)
    assert of["position_m"] == pytest.approx(off) and of["angle_rad"] == pytest.approx(0.1) and of["share"] == 1.0
    over = resting(0.03).changed(attitude=np.tile(of_rotation_vector(np.array([[1.6], [0.0], [0.0]])), 5))
    wrong = of_tosses(model, of_frames(model, over, resting(0.03), times, seen, np.zeros((5, 1), int)))
    assert wrong["share"].iloc[0] == 0.0


def test_the_loss_of_acosta_counts_from_three_frames_before_a_touch_is_possible():
    model, n = space_model(), 10
    frames = pd.DataFrame({"trial": np.zeros(n), "place": np.where(np.arange(n) < 5, 1.0, 0.01), "turn": 0.0})
    frames = frames.assign(depth=0.0, low=np.arange(n) >= 8, face=True)
    assert of_tosses(model, frames)["loss"].iloc[0] == pytest.approx(0.01**2 / 0.04)


def test_means_medians_and_intervals_over_tosses():
    table = pd.DataFrame({"loss": [1.0, 2.0, 9.0], "median": [1.0, 2.0, 9.0]})
    names = ("pos_int_percent", "angle_int_deg", "penetration_int_percent", "position_m", "angle_rad")
    content = summary(table.assign(share=np.nan, **dict.fromkeys(names, 2.0)), "first_flight", np.random.default_rng(0))
    assert content["acosta"]["loss"] == 4.0 and content["acosta"]["median"] == 2.0 and content["acosta"]["n"] == 3
    assert content["contactnets"]["interval"]["angle_int_deg"] == (2.0, 2.0)
    low, high = content["acosta"]["interval"]["loss"]
    assert 1.0 <= low < 4.0 < high <= 9.0
    assert content["final_face"] == {"share": None, "n": 0, "interval": {}, "start": "first_flight"}


@pytest.mark.slow
def test_the_first_flight_gives_the_release_within_its_covariance():
    model = space_model(**COMPLIANT, **{"linear_drag.c_v": 0.3, "linear_drag.c_w": 0.2, "time_lag.lag": 0.004})
    made = simulate_in_space(model, 40, duration=0.5, rng=np.random.default_rng(5))
    none = {"position": 1e-7, "rotation": 1e-7}
    exact = simulate_in_space(model, 40, duration=0.5, rng=np.random.default_rng(5), noise=none)
    tosses, without = (MeasuredTosses.of(one, model, range(40)) for one in (made, exact))
    found, truth = (first_flight(one.bound(model), one) for one in (tosses, without))
    assert found.noise == pytest.approx([2e-4, 3e-3], rel=0.1) and (truth.noise < 2e-5).all()
    off = np.concatenate(
        [SPACE.difference(found.state.pose, truth.state.pose), found.state.motion - truth.state.motion]
    )
    chi = np.einsum("in,nij,jn->n", off, np.linalg.inv(found.cov), off)
    assert 10.0 < chi.mean() < 14.5  # 12 degrees of freedom, 40 tosses
    stored = first_frame(tosses.bound(model), tosses)
    np.testing.assert_array_equal(stored.state.pose, tosses.states.pose[:, :40])
    assert (np.einsum("nii->ni", stored.cov) > np.einsum("nii->ni", found.cov)).all()


@pytest.mark.slow
def test_the_true_model_is_at_the_floor_and_another_one_worse(simulated):
    model, data = simulated
    rng = np.random.default_rng
    true = roll_out(model, data, data.trials, rng(0))
    wrong = roll_out(space_model(**COMPLIANT, mu=0.5, epsilon=0.2), data, data.trials, rng(0))
    for name in ("position_m", "angle_rad", "loss"):
        assert true.tosses[name].median() < 4.0 * true.floor[name].median(), name
    less = compared(true.tosses, wrong.tosses, "first_flight", rng(0))
    assert less["contactnets"]["interval"]["pos_int_percent"][1] < 0.0
    assert less["benchmark"]["interval"]["angle_rad"][1] < 0.0
    curve = true.curve("hits")
    first, later = (curve[(curve["what"] == "model") & (curve["hits"] == k)]["place"].iloc[0] for k in (0, 3))
    assert first < 5e-4 < later  # noise of a frame, then errors that grow


@pytest.mark.slow
def test_a_toss_of_another_simulator_comes_out_at_the_floor_with_what_it_hides():
    data = simulate_tosses("own", hidden={"com_offset.c_x": 0.004}, drops=24)
    loss = LinearDamper().loss(np.array([0.5]))
    tau = 2e-3 * float((LinearDamper().centroid(loss) / LinearDamper().duration(loss))[0])
    rig = data.in_space.model_dump(
        mode="json", by_alias=True, exclude={"description", "rate", "noise", "spin", "surfaces"}
    )
    c = {"com_offset.c_x": 0.004, "com_offset.c_y": 0.0, "com_offset.c_z": 0.0}
    found = [
        roll_out(space_model("damped_contact", rig=rig, tau=tau, **more), data, data.trials, np.random.default_rng(0))
        for more in (c, {})
    ]
    true, plain = (of.tosses["pos_int_percent"].median() for of in found)
    assert true < 3.0 * found[0].floor["pos_int_percent"].median()
    assert plain > 2.0 * true


@pytest.mark.slow
def test_the_command_writes_numbers_and_pictures(simulated, tmp_path, capsys):
    model, data = simulated
    model.save(tmp_path / "model.json")
    (tmp_path / "other").mkdir()
    space_model(**COMPLIANT, mu=0.5).save(tmp_path / "other" / "model.json")
    pd.DataFrame({"trial": [1, 2, 3, 4], "held_out": [1, 1, 1, 0]}).to_csv(tmp_path / "other" / "errors.csv")
    write_dataset(data, tmp_path / "set")
    pd.DataFrame({"trial": [0, 1, 2, 3, 4], "held_out": [0, 1, 1, 1, 1]}).to_csv(tmp_path / "errors.csv")
    command = ["rollout", str(tmp_path / "model.json"), str(tmp_path / "set"), "-q", "-o", str(tmp_path / "out")]
    assert main([*command, "--against", str(tmp_path / "other" / "model.json")]) == 0
    said = capsys.readouterr()
    assert "contactnets pos_int_percent" in said.out and "minus the other" in said.out and not said.err
    content = json.loads((tmp_path / "out" / "rollout.json").read_text())
    assert content["held_out"] and content["contactnets"]["n"] == 3 and content["floor"]["acosta"]["n"] == 3
    assert content["against"]["difference"]["benchmark"]["interval"]["position_m"]
    for name in ("rollout_by_t", "rollout_by_hits"):
        assert all((tmp_path / "out" / f"{name}{end}").stat().st_size for end in (".png", ".pdf", ".csv"))
    pd.DataFrame({"trial": [77], "held_out": [1]}).to_csv(tmp_path / "errors.csv")
    assert main(command) == 2 and "--all takes all tosses" in capsys.readouterr().err
    (tmp_path / "errors.csv").unlink()
    assert main(command) == 2 and "does not exist" in capsys.readouterr().err


def test_another_model_is_judged_on_tosses_that_both_held_out(simulated, tmp_path, capsys):
    """The other one does not look better because it was fitted to tosses that only the first held out."""
    model, other = simulated[0], tmp_path / "model.json"
    assert also_held_out([1, 2, 3], str(other), {"none"}, model) == [1, 2, 3]
    assert f"{other} has no errors.csv beside it: it may have been fitted" in capsys.readouterr().err
    pd.DataFrame({"trial": [1, 1, 2, 3], "held_out": [0, 0, 1, 1]}).to_csv(tmp_path / "errors.csv")
    assert also_held_out([1, 2], str(other), {"none"}, model) == [2] and not capsys.readouterr().err
    with pytest.raises(UserError, match="No toss was held out by the critiques of both models"):
        also_held_out([1, 7], str(other), {"none"}, model)
    assert also_held_out([1, 2], str(other), {"set"}, model) == [1, 2]
    assert "was fitted to none: it may" in capsys.readouterr().err


def test_a_folder_that_cannot_be_written_is_refused_before_the_work(simulated, tmp_path, capsys, monkeypatch):
    model = tmp_path / "model.json"
    simulated[0].save(model)
    command = ["rollout", str(model), str(tmp_path / "no set"), "--fit", "mu", "-o"]
    assert main([*command, str(tmp_path)]) == 2 and "which --fit would overwrite" in capsys.readouterr().err
    assert main([*command, str(model)]) == 2 and "no set" not in capsys.readouterr().err
    monkeypatch.setattr("os.access", lambda *_: False)
    assert main([*command, str(tmp_path / "out")]) == 2
    assert "nothing can be written into this folder" in capsys.readouterr().err


@pytest.mark.slow
def test_parameters_are_fitted_to_whole_tosses(simulated, tmp_path, capsys):
    """Tosses of a known μ bring it back from a wrong one; the command judges the fit on tosses that it did not see."""
    _, data = simulated
    model, truth = space_model(**COMPLIANT, mu=0.32), 0.25
    model.save(tmp_path / "model.json")
    write_dataset(data.first_trials(7), tmp_path / "set")
    pd.DataFrame({"trial": range(7), "held_out": [0] * 4 + [1] * 3}).to_csv(tmp_path / "errors.csv")
    command = ["rollout", str(tmp_path / "model.json"), str(tmp_path / "set"), "-q", "--fit"]
    assert main([*command, "mu", "-o", str(tmp_path / "out"), "--json"]) == 0
    content = json.loads(capsys.readouterr().out)
    fitted = json.loads((tmp_path / "out" / "model.json").read_text())["parameters"]
    assert fitted["mu"] == {"value": pytest.approx(content["fitted"]["mu"]), "std": None, "unit": "1"}
    assert content["fitted"]["mu"] == pytest.approx(truth, abs=0.01) and fitted["epsilon"]["value"] == 0.5
    assert content["search_ended"] and content["contactnets"]["n"] == 3
    assert content["against"]["difference"]["acosta"]["loss"] < 0.0
    again = ["rollout", str(tmp_path / "out" / "model.json"), str(tmp_path / "set"), "-q", "--json"]
    assert main(again) == 0  # judged on the same tosses
    kept = json.loads(capsys.readouterr().out)
    assert kept["held_out"] and kept["contactnets"]["n"] == 3
    assert kept["benchmark"]["position_m"] == pytest.approx(content["benchmark"]["position_m"], rel=1e-4)
    assert main([*command, "radius"]) == 2
    said = capsys.readouterr().err
    assert "has no parameter radius to fit; it has mu, epsilon, tau" in said and "<Saved" not in said
    assert main([*command, "mu", "--all"]) == 2 and "leave --all and --against out" in capsys.readouterr().err


@pytest.mark.slow
def test_values_with_which_a_toss_has_no_solution_are_none(simulated, monkeypatch):
    """They must not look better because the toss drops out of the mean."""
    first = []

    def numbers(model, frames):
        found = of_tosses(model, frames)
        first.append(model.values["mu"])
        if model.values["mu"] != first[0]:
            found = 0.0 * found  # perfect, but for the first
            found.iloc[0] = np.nan
        return found

    monkeypatch.setattr(rollout, "of_tosses", numbers)
    fitted, _ = fit_to_tosses(space_model(**COMPLIANT, mu=0.32), simulated[1], [0, 1], ["mu"])
    assert len(set(first)) > 3 and fitted.values["mu"] == 0.32


def test_a_model_of_another_body_is_said(simulated, tmp_path, capsys):
    model, data = simulated
    write_dataset(data.first_trials(1), tmp_path / "set")
    other = space_model(**COMPLIANT, shape={"kind": "box", "half_extents": (0.05, 0.04, 0.032)})
    for one, said in (
        (other, "has another shape than the body of set, by up to 0.002 m; its own is used"),
        (model, ""),
    ):
        one.save(tmp_path / "model.json")
        assert main(["rollout", str(tmp_path / "model.json"), str(tmp_path / "set"), "--all", "-q"]) == 0
        err = capsys.readouterr().err
        assert said in err and ("shape" in err) == bool(said)


def test_what_cannot_be_rolled_out_is_refused(simulated, tmp_path, capsys):
    model, data = simulated
    plane, space, flat, given = (str(tmp_path / name) for name in ("plane.json", "model.json", "flat", "given"))
    model.save(space)
    model_of(mu=0.3, epsilon=0.5).save(plane)
    assert main(["simulate", plane, "--drops", "2", "-o", flat, "-q"]) == 0
    columns = ["trial", "impact", *POSE_IN_SPACE, *V_PRE_IN_SPACE, *V_POST_IN_SPACE]
    one = pd.DataFrame([[0, 0, 0.0, 0.0, 0.03, 1.0, 0.0, 0.0, 0.0, *[0.1] * 12]], columns=columns)
    write_dataset(replace(data, trajectories=None, impacts=one), given)
    for of, at, said in (
        (plane, given, "plane.json is a model of a body in a plane"),
        (space, flat, "dataset in a plane"),
        (space, given, "impacts without trajectories"),
    ):
        assert main(["rollout", of, at, "--all", "-q"]) == 2
        assert said in capsys.readouterr().err
    for of, at, said in (
        (space, flat, "flat is in a plane .schema 1.; --like of a model in space needs tosses in space"),
        (space, given, "given has impacts without trajectories; --like of a model in space needs tosses"),
        (plane, given, "given is in space .schema 2.; --like of a planar model needs a planar dataset"),
    ):
        assert main(["simulate", of, "--like", at, "-o", str(tmp_path / "x"), "-q"]) == 2
        assert re.search(said, capsys.readouterr().err)
    assert main(["simulate", space, "--engine", "drake", "-o", str(tmp_path / "x"), "-q"]) == 2
    assert "planar models" in capsys.readouterr().err
    for seconds in ("0", "1"):
        assert main(["simulate", plane, "--duration", seconds, "-o", str(tmp_path / "x"), "-q"]) == 2
    assert "for models in space" in capsys.readouterr().err
