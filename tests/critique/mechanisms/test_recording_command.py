"""`critique` on the recording of a mechanism: the hidden cause is named, the folder as whole as that of drops."""

import json
from pathlib import Path

import pytest

from thesis_lib.__main__ import main

FILES = {
    *("diagnosis.json", "report.html", "misfit.csv"),
    *(f"mechanism_residuals.{suffix}" for suffix in ("png", "pdf", "csv")),
}


@pytest.fixture(scope="module")
def wheel(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("data") / "wheel"
    example = ["datasets", "example", "-o", str(folder), "--mechanism", "wheel", "--hidden", "payload"]
    assert main([*example, "--drops", "12"]) == 0
    return folder


@pytest.fixture(scope="module")
def run_folder(wheel, tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("out") / "run"
    assert main(["critique", str(wheel), "-o", str(out), "-q"]) == 0
    return out


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.mark.slow
def test_the_hidden_cause_of_a_wheel_is_named_in_file_page_and_terminal(wheel, run_folder, tmp_path, capsys):
    assert set(contents(run_folder)) == FILES
    content = json.loads((run_folder / "diagnosis.json").read_text())
    (effect,) = content["effects"]
    assert (content["verdict"], content["mechanism"], effect["name"]) == ("effects", "wheel", "payload")
    hidden = 0.05  # kg, HiddenSizes.wheel_payload
    size = effect["parameters"]["m_p"]
    assert abs(size["value"] - hidden) < 4.0 * size["std"] < 0.1 * hidden
    assert "payload" in (run_folder / "report.html").read_text()
    assert main(["critique", str(wheel), "-o", str(tmp_path / "again"), "-q"]) == 0
    shown = capsys.readouterr().out
    assert "wheel: effects" in shown and "payload.m_p = " in shown and "nats per window" in shown
    assert contents(tmp_path / "again") == contents(run_folder)


@pytest.mark.slow
def test_the_hidden_cause_of_an_arm_is_named(tmp_path, capsys):
    data, out = str(tmp_path / "arm"), str(tmp_path / "out")
    hidden = ["--mechanism", "arm", "--hidden", "viscous_joint_friction", "--drops", "8"]
    assert main(["datasets", "example", "-o", data, *hidden]) == 0
    assert main(["datasets", "check", data, "--json"]) == 0
    capsys.readouterr()
    assert main(["critique", data, "-o", out, "-q", "--json"]) == 0
    content = json.loads(capsys.readouterr().out)
    assert content == json.loads((tmp_path / "out" / "diagnosis.json").read_text())
    assert [effect["name"] for effect in content["effects"]] == ["viscous_joint_friction"]


def test_only_the_effects_that_are_asked_for_are_tried(wheel, tmp_path, capsys):
    command = ["critique", str(wheel), "-o", str(tmp_path), "-q", "--effect"]
    assert main([*command, "rolling_resistance", "--json"]) == 0
    tried = [entry["name"] for entry in json.loads(capsys.readouterr().out)["detectable"]]
    assert tried == ["rolling_resistance"]
    assert main([*command, "com_offset"]) == 2
    assert "no effect 'com_offset' of the wheel; known are gravity_direction" in capsys.readouterr().err


def test_runs_of_one_mechanism_are_compared_and_of_two_are_not(wheel, run_folder, tmp_path, capsys):
    assert main(["critique", str(run_folder), str(run_folder)]) == 0
    assert "error, base (sigma)" in capsys.readouterr().out
    content = json.loads((run_folder / "diagnosis.json").read_text()) | {"mechanism": "arm"}
    (tmp_path / "diagnosis.json").write_text(json.dumps(content))
    assert main(["critique", str(run_folder), str(tmp_path)]) == 2
    assert "A critique of wheel cannot be compared with one of arm" in capsys.readouterr().err
    assert main(["critique", str(wheel), "-o", str(wheel)]) == 2
    assert "is the dataset itself" in capsys.readouterr().err


def test_a_batch_mixes_drops_and_recordings(wheel, tmp_path, capsys):
    (tmp_path / "empty").mkdir()
    (tmp_path / "empty" / "dataset.yaml").write_text("schema: 1")
    folders = [str(wheel), str(tmp_path / "empty")]
    command = ["critique", "--batch", *folders, "-o", str(tmp_path / "out"), "-q", "--jobs", "1"]
    assert main(command) == 1
    batch = json.loads((tmp_path / "out" / "batch.json").read_text())
    first, second = batch["datasets"]
    assert (first["verdict"], first["mechanism"], first["unit"]) == ("effects", "wheel", "sigma")
    assert second["status"] == "failed"
    assert main(command) == 1
    assert "1 of them were done already" in capsys.readouterr().out
