"""Recordings of a mechanism: what is written is read back, and whatever is wrong is told with its place."""

import numpy as np
import pytest
from folders import refusal

from thesis_lib.datasets.format.validate import DatasetError
from thesis_lib.datasets.recordings.recording import Recording, read_recording, write_recording
from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.engines.recording import NOISE, simulate_recording


@pytest.fixture(scope="module")
def wheel() -> Recording:
    return simulate_recording("wheel", "wheel", "payload", trials=4)


@pytest.mark.parametrize("kind", ["arm", "wheel"])
def test_what_is_written_is_read_back(kind, tmp_path):
    recording = simulate_recording(kind, kind, "nothing", trials=4, seed=1)
    again = read_recording(write_recording(recording, tmp_path / kind))
    assert again.header == recording.header and again.name == kind and list(again.trials) == [0, 1, 2, 3]
    columns = list(recording.header.columns)
    np.testing.assert_allclose(again.states[columns], recording.states[columns], rtol=1e-8, atol=1e-9)
    twice = read_recording(write_recording(again, tmp_path / "twice"))
    assert twice.digest() == again.digest()


def test_noise_of_the_samples_is_that_of_the_header():
    """The same trials with and without a hidden cause share their noise; two seeds do not."""
    wheel = simulate_recording("wheel", "wheel", "nothing", trials=12)
    (q, v), states = wheel.header.sigmas, wheel.states
    assert (q, v) == (
        (NOISE.position, NOISE.position, NOISE.angle),
        (NOISE.velocity, NOISE.velocity, NOISE.angular_velocity),
    )
    omega = states["omega"].to_numpy()[states["trial"] == 0]
    # second differences of a smooth motion are noise of variance 6 sigma²; the median leaves impacts out
    spread = np.median(np.abs(np.diff(omega, 2))) / 0.6745 / np.sqrt(6.0)
    assert spread == pytest.approx(NOISE.angular_velocity, rel=0.25)


def test_torques_are_read_only_where_the_arm_is_driven(tmp_path):
    folder = write_recording(simulate_recording("arm", "arm", "nothing", trials=4), tmp_path / "arm")
    header = folder / "recording.yaml"
    header.write_text(header.read_text().replace("driven: true", "driven: false"))
    with pytest.raises(DatasetError, match="column u_1: unknown column"):
        read_recording(folder)


YAML_MISTAKES = [
    ("spokes: 8", "spokes: 8, colour: red", "line 3, mechanism.colour: unknown key"),
    ("spokes: 8", "spokes: 2", "mechanism.spokes: is 2, but must be 3 or more"),
    ("kind: wheel", "kind: car", "mechanism: kind is 'car', but must be arm or wheel"),
    ("mass: 1.0", "mass: .nan", "mechanism.mass"),
    ("mass: 1.0", "mass: 1.0, mass: 2.0", "mass: the key occurs twice"),
    ("rate: 200.0", "rate: 100.0", "the time step is not the 0.01 s of rate: 100"),
    ("rate: 200.0", "", "rate: the key is missing"),
    ("schema: 1", "schema: 2", "schema: is 2, but must be 1"),
    ("schema: 1", "schema: [1", "is not valid YAML"),
]


@pytest.mark.parametrize(("old", "new", "says"), YAML_MISTAKES)
def test_mistakes_of_the_header_are_told_with_their_place(wheel, tmp_path, old, new, says):
    folder = write_recording(wheel, tmp_path / "wheel")
    header = folder / "recording.yaml"
    assert old in header.read_text()
    header.write_text(header.read_text().replace(old, new))
    assert says in refusal(folder, read_recording)


def spoilt(lines: list[str], row: int, column: int, cell: str) -> list[str]:
    cells = lines[row].rstrip().split(",")
    cells[column] = cell
    return [*lines[:row], ",".join(cells) + "\n", *lines[row + 1 :]]


TABLE_MISTAKES = [
    (lambda lines: spoilt(lines, 7, 4, "nan"), "column theta, row 8: is empty or NaN"),
    (lambda lines: spoilt(lines, 7, 4, "inf"), "column theta, row 8: is infinite"),
    (lambda lines: spoilt(lines, 0, 7, "spin"), "column spin: unknown column"),
    (lambda lines: [line.rsplit(",", 1)[0] + "\n" for line in lines], "column omega: missing"),
    (lambda lines: [*lines[:-1], lines[-1][:-21] + "\n"], "the file may have been cut off"),
    (lambda lines: [*lines[:-1], lines[-1].rstrip()[:-2]], "may have been cut off"),
    (lambda lines: [*lines[:50], *lines[60:]], "the time step is not the 0.005 s"),
    (lambda lines: lines[:1], "has a header but no rows"),
    (lambda lines: [*lines, *lines[1:302]], "a trial begins again"),
]


@pytest.mark.parametrize(("spoil", "says"), TABLE_MISTAKES)
def test_mistakes_of_the_table_are_told_with_their_place(wheel, tmp_path, spoil, says):
    folder = write_recording(wheel, tmp_path / "wheel")
    table = folder / "states.csv"
    table.write_text("".join(spoil(table.read_text().splitlines(keepends=True))))
    assert says in refusal(folder, read_recording)


def test_what_is_not_there_or_unclear_is_told(wheel, tmp_path):
    with pytest.raises(DatasetError, match="the folder does not exist"):
        read_recording(tmp_path / "nowhere")
    folder = write_recording(wheel, tmp_path / "wheel")
    (folder / "dataset.yaml").write_text("schema: 1")
    with pytest.raises(DatasetError, match=r"stands beside dataset\.yaml"):
        read_recording(folder)
    (folder / "dataset.yaml").unlink()
    (folder / "states.csv").rename(folder / "states.parquet")
    with pytest.raises(UserError, match="would be read as part of the recording"):
        write_recording(wheel, folder)
    (folder / "states.parquet").unlink()
    with pytest.raises(DatasetError, match=r"states\.csv: the file is missing"):
        read_recording(folder)


def test_an_example_that_makes_no_sense_is_refused():
    with pytest.raises(UserError, match="hides one of"):
        simulate_recording("w", "wheel", "cogging")
    with pytest.raises(UserError, match="no meaning"):
        simulate_recording("w", "wheel", "nothing", size=1.0)
    with pytest.raises(UserError, match=r"A size of -1 .* greater than or equal to 0"):
        simulate_recording("w", "wheel", "payload", size=-1.0)
    with pytest.raises(UserError, match="4 trials or more"):
        simulate_recording("w", "wheel", "payload", trials=3)
