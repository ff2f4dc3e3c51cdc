"""A few bounces give restitution with its standard error, exit code 0 and no verdict."""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from bouncing_disk import bouncing
from hidden_effects import injected_impacts

from thesis_lib.__main__ import main
from thesis_lib.critique import TooFew, criticise
from thesis_lib.critique.drops.own_restitution import OwnRestitution
from thesis_lib.critique.results.load_model import load_model
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.write import write_dataset
from thesis_lib.thesis.records.catalogue import records

EPSILON = 0.7
STANDARD_ERRORS = 4.0  # by chance once in 16,000
FILES = {"impacts.csv", "comparison.csv", "diagnosis.json", "model.json", "report.html"}


@pytest.fixture(scope="module")
def videos() -> Dataset:
    """Three videos of three bounces each, of a ball whose spin nobody measured."""
    return bouncing([EPSILON] * 3, 0.3, np.random.default_rng(1), bounces=3, angle=False)[0]


@pytest.fixture(scope="module")
def folder(videos, tmp_path_factory):
    return write_dataset(videos, tmp_path_factory.mktemp("few") / "videos")


def test_restitution_is_told_with_its_error_and_no_verdict(folder, tmp_path, capsys):
    out = tmp_path / "out"
    assert main(["critique", str(folder), "-q", "-o", str(out)]) == 0
    said = capsys.readouterr().out
    assert said.startswith(
        "videos: no verdict\n  Too few impacts for a verdict (9 in 3 trials; 30 in 10 are needed).\n"
    )
    assert "Restitution 0.70" in said and "±" in said and "nan" not in said and "e+" not in said
    content = json.loads((out / "diagnosis.json").read_text())
    found = content["restitution"]
    assert content["verdict"] is None and content["effects"] == []
    assert abs(found["value"] - EPSILON) < STANDARD_ERRORS * found["std"] < 0.01
    assert content["base_model"]["parameters"]["mu"]["std"] is None  # no spin, no friction
    assert {path.name for path in out.iterdir()} == FILES
    assert load_model(out / "model.json").parameters["epsilon"].value == found["value"]
    page = (out / "report.html").read_text()
    assert "No verdict: too few impacts" in page and "nan" not in page.split("</style>")[1].lower()
    assert not content["summary"][0].startswith("The") and records()["verdict"].said(content) == " ".join(
        content["summary"]
    )


def test_json_batch_and_comparison_bear_no_verdict(folder, tmp_path, capsys):
    assert main(["critique", str(folder), "-q", "--json", "-o", str(tmp_path / "a")]) == 0
    assert json.loads(capsys.readouterr().out)["verdict"] is None
    assert main(["critique", "--batch", str(folder), "-q", "--jobs", "1", "-o", str(tmp_path / "batch")]) == 0
    assert "1 dataset: 1 too few impacts" in capsys.readouterr().out
    row = pd.read_csv(tmp_path / "batch" / "batch.csv").iloc[0]
    assert row["status"] == "done" and pd.isna(row["verdict"])
    assert "too few impacts" in (tmp_path / "batch" / "index.html").read_text()
    assert main(["critique", str(tmp_path / "a"), str(tmp_path / "batch" / "videos")]) == 0
    assert "none (too few impacts)" in capsys.readouterr().out


def test_the_check_says_what_a_critique_will_give(folder, capsys):
    assert main(["datasets", "check", str(folder)]) == 0
    assert "restitution and friction, and no verdict: 9 usable impacts in 3 trials; 30 in 10" in capsys.readouterr().out


def test_the_standard_error_covers_how_far_trials_differ():
    rng = np.random.default_rng(2)
    epsilon = np.clip(EPSILON + 0.05 * rng.standard_normal(5), 0.0, 1.0)
    value, std = criticise(bouncing(epsilon, 0.3, rng, bounces=3)[0]).found.restitution
    assert value == pytest.approx(epsilon.mean(), abs=0.005)
    assert std == pytest.approx(epsilon.std(ddof=1) / np.sqrt(5), rel=0.1)


def test_impacts_without_their_noise_scatter_or_have_no_error():
    dataset = injected_impacts("few", 20, 3, "tangential_restitution", {"tangential_restitution.e_t": 0.0})
    bare = replace(dataset, header=dataset.header.model_copy(update={"noise": None}))
    value, std = criticise(bare).found.restitution
    assert 0.0 < std < 0.05 and 0.0 < value < 1.0
    nan = np.full(1, np.nan)
    assert np.isnan(OwnRestitution(np.zeros(1, int), np.zeros(1), np.full(1, 0.5), nan, 1.0).mean()[1])


def test_one_impact_is_enough_for_a_number_and_none_is_an_error(tmp_path, capsys):
    one = bouncing([EPSILON], 0.3, np.random.default_rng(3))[0]
    value, std = criticise(one).found.restitution
    assert abs(value - EPSILON) < STANDARD_ERRORS * std < 0.01
    falling = replace(one, trajectories=one.trajectories.query("t < 0.15"))
    with pytest.raises(TooFew, match="0 usable impacts"):
        criticise(falling)


@pytest.mark.parametrize("asked", [["--effect", "wear"], ["--models", "laws"], ["--propose", "term.py"]])
def test_what_needs_a_verdict_is_refused(asked, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    folder = write_dataset(bouncing([EPSILON] * 3, 0.3, np.random.default_rng(4))[0], tmp_path / "few")
    assert main(["critique", str(folder), "-q", *asked]) == 2
    assert "3 usable impacts in 3 trials; the critique needs 30 in 10" in capsys.readouterr().err
