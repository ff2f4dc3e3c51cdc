"""The example dataset: what is hidden shows in the motion and not in the files."""

import numpy as np
import pandas as pd
import pytest

from thesis_lib.bodies.shapes import Polygon
from thesis_lib.commands.datasets import main
from thesis_lib.critique.contacts.contact_time import duration
from thesis_lib.datasets import find_impacts, read_dataset
from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.compliant.example import NEW_IMPACTS, causes_text, simulate_example
from thesis_lib.simulate.rig.hidden_causes import CAUSES, CompliantContact

COARSE = CompliantContact(steps=20)  # where it does not matter how exactly a contact is integrated


def new_impacts(hidden: str, size: float | None = None, seed: int = 0) -> pd.DataFrame:
    return simulate_example("e", hidden, size=size, drops=1, seed=seed, contact=COARSE).new_impacts


def test_equal_seeds_give_equal_data_and_others_do_not():
    one, two, other = (simulate_example("e", "tilt", drops=2, seed=seed, contact=COARSE) for seed in (3, 3, 4))
    pd.testing.assert_frame_equal(one.dataset.trajectories, two.dataset.trajectories)
    pd.testing.assert_frame_equal(one.new_impacts, two.new_impacts)
    assert not np.array_equal(one.new_impacts["x"], other.new_impacts["x"])


def test_nothing_of_the_cause_is_written_down():
    plain, hidden = (simulate_example("e", name, drops=1, contact=COARSE) for name in ("nothing", "com_offset_x"))
    assert plain.dataset.header == hidden.dataset.header
    assert not plain.new_impacts.equals(hidden.new_impacts)


def test_new_impacts_obey_the_balance_of_momentum_only_where_nothing_is_hidden():
    """k² Δω = r_x Δv_y − r_y Δv_x about the contact point, for every contact law."""

    def unbalanced(hidden: str) -> float:
        example = simulate_example("e", hidden, drops=1, contact=CompliantContact(contact_time=2e-5))
        t, dataset = example.new_impacts, example.dataset
        r = dataset.shape.contact_point(t["theta"].to_numpy())
        dx, dy, dw = (t[f"{name}_seen"] - t[name] for name in ("vx", "vy", "omega"))
        couple = dataset.k_g**2 * dw - (r[:, 0] * dy - r[:, 1] * dx)
        return float(np.abs(couple).max() / (dataset.k_g**2 * np.abs(dw)).max())

    assert unbalanced("nothing") < 2e-3  # the body moves on by micrometres during the contact
    assert unbalanced("com_offset_x") > 1e-2


def test_the_camera_faults_show_in_the_new_impacts():
    plain, mirrored = new_impacts("nothing"), new_impacts("mirrored")
    for name in ("theta", "omega", "omega_seen"):
        np.testing.assert_allclose(mirrored[name], -plain[name], atol=1e-9)
    drift = new_impacts("drift", 0.2)
    for name in ("vx", "vx_seen"):
        np.testing.assert_allclose(drift[name] - plain[name], 0.2, atol=1e-9)
    lag = new_impacts("time_lag", 0.004)
    np.testing.assert_allclose(plain["theta"] - lag["theta"], 0.004 * plain["omega"], atol=1e-9)


def test_a_cause_of_corners_gets_a_body_with_corners():
    assert isinstance(simulate_example("e", "corner_radius", drops=1, contact=COARSE).dataset.shape, Polygon)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ({"hidden": "gremlins"}, "no hidden cause 'gremlins'; known are tangential_compliance"),
        ({"hidden": "nothing", "size": 1.0}, "--size has no meaning"),
        ({"hidden": "mirrored", "size": 0.5}, "on or off"),
        ({"hidden": "size_error", "size": -2.0}, "size of -2 is not possible for size_error"),
        ({"hidden": "tilt", "drops": 0}, "at least one drop"),
        ({"hidden": "tilt", "seed": -1}, "seed must be 0 or more"),
        ({"hidden": "corner_radius", "shape": "ellipse"}, "needs corners"),
    ],
)
def test_mistakes_are_explained(arguments, says):
    with pytest.raises(UserError, match=says):
        simulate_example("e", **arguments)


@pytest.mark.slow
def test_the_command_makes_a_dataset_that_check_accepts_and_keeps_what_is_there(tmp_path, capsys):
    out = str(tmp_path / "one")
    assert main(["example", "-o", out, "--drops", "4"]) == 0
    text = capsys.readouterr().out
    assert "trials      4" in text and "The dataset is valid" in text
    assert len(pd.read_csv(tmp_path / "one" / NEW_IMPACTS)) == 40
    assert main(["check", out]) == 0
    assert main(["example", "-o", out, "--drops", "4"]) == 2
    assert "already holds a dataset" in capsys.readouterr().err
    assert main(["example", "-o", out, "--drops", "3", "--force"]) == 0
    assert "trials      3" in capsys.readouterr().out


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["mujoco", "drake"])
def test_another_simulator_makes_the_drops_in_contacts_of_a_millisecond(engine, tmp_path, capsys):
    """The same releases as ours; after the touch another contact, which is longer."""
    folders = [tmp_path / name for name in ("own", engine)]
    for folder in folders:
        assert main(["example", "-o", str(folder), "--drops", "4", "--engine", folder.name]) == 0
    ours, theirs = (pd.read_csv(folder / "trajectories.csv") for folder in folders)
    both = ours.merge(theirs, on=["trial", "t"])
    difference = (both["y_x"] - both["y_y"]).abs()
    assert difference[both["t"] < 0.1].max() < 1e-5 and difference.max() > 1e-3
    assert main(["example", "-o", str(tmp_path / "no"), "--engine", engine, "--hidden", "stribeck"]) == 2
    assert "cannot have stribeck" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize("lasting", [[], ["--contact-time", "3"]])
def test_contacts_last_as_long_as_asked_for(lasting, tmp_path):
    """As deep as the body sinks in; without the option 1 ms."""
    asked = float(lasting[-1]) if lasting else 1.0
    folder = tmp_path / "drops"
    drops = ["--drops", "16", "--hidden", "nothing", "--shape", "square"]
    assert main(["example", "-o", str(folder), *drops, *lasting]) == 0
    found = find_impacts(read_dataset(folder))
    one = found.impacts
    r_x = one.r[:, 0]
    # the arcs meet τ |v_n| / √K_nn below the surface
    v_n = (one.v_pre[:, 1] + r_x * one.v_pre[:, 2]) / np.sqrt(1.0 + (r_x / one.k_g) ** 2)
    tau = np.median(found.used_arcs["gap"] / v_n)
    assert 1e3 * duration(tau, 0.55) == pytest.approx(asked, rel=0.1)


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--contact-time", "0"], "above 0 and at most 5 ms; got 0"),
        (["--contact-time", "nan"], "above 0 and at most 5 ms; got nan"),
        (["--mechanism", "arm", "--contact-time", "1"], "--contact-time, --filter and --cutoff are for drops"),
        (["--mechanism", "arm", "--shape", "square"], "are for drops; leave them out with --mechanism"),
    ],
)
def test_options_that_do_not_fit_are_refused(options, says, tmp_path, capsys):
    assert main(["example", "-o", str(tmp_path / "no"), *options]) == 2
    assert says in capsys.readouterr().err


def test_help_lists_every_cause_with_its_size(capsys):
    with pytest.raises(SystemExit) as stopped:
        main(["example", "--help"])
    assert stopped.value.code == 0
    text = capsys.readouterr().out
    assert causes_text() in text
    for name in CAUSES:
        assert f"  {name} " in text
