"""Files of torch tensors as tosses: columns by number, units of any length, one toss each; what is refused."""

import numpy as np
import pytest
import torch
from tossed import RATE, flights

from thesis_lib.commands.datasets import main
from thesis_lib.datasets import read_dataset

WIDTH = 0.0524  # m, in which lengths count
COLUMNS = "x=5,y=6,z=7,q1=1,q2=2,q3=3,q4=4"
OPTIONS = ["--quaternion", "wxyz", "--rate", str(RATE), "--scale", f"1/{WIDTH}", "--shape", "box:0.1,0.08,0.06"]


def saved(folder, legacy: bool = False):
    """A folder of tosses (1, T, 9): quaternion, position, two columns of something else."""
    folder.mkdir()
    for trial, toss in flights(trials=12).groupby("trial"):
        pose = np.c_[toss[["qw", "qx", "qy", "qz"]], toss[["x", "y", "z"]] / WIDTH, np.ones((len(toss), 2))]
        made = torch.tensor(pose[None])
        torch.save(made, folder / f"{trial}.pt", _use_new_zipfile_serialization=not legacy)
    return folder


def init(tmp_path, *options: str) -> int:
    return main(["init", *map(str, options), "-o", str(tmp_path / "made"), "--force"])


@pytest.mark.slow
@pytest.mark.parametrize("legacy", [False, True])
def test_a_folder_of_tosses(tmp_path, legacy, capsys):
    assert init(tmp_path, saved(tmp_path / "tosses", legacy), "--columns", COLUMNS, *OPTIONS) == 0
    made, truth = read_dataset(tmp_path / "made"), flights(trials=12)
    assert len(made.trials) == 12 and made.rate == RATE  # 10 and 11 after 9
    np.testing.assert_allclose(made.trajectories[["t", "x", "y", "z"]], truth[["t", "x", "y", "z"]], atol=1e-12)
    q = ["qw", "qx", "qy", "qz"]
    turned = np.abs(np.sum(made.trajectories[q].to_numpy() * truth[q].to_numpy(), axis=1))
    np.testing.assert_allclose(turned, 1.0, atol=1e-9)


@pytest.mark.slow
def test_what_is_no_toss_is_refused(tmp_path, capsys, monkeypatch):
    folder = saved(tmp_path / "tosses")
    columns = ["--columns", COLUMNS]
    assert init(tmp_path, folder, "--columns", "x=12", *OPTIONS) == 2
    assert "0.pt has no column 12, y, z" in capsys.readouterr().err
    assert init(tmp_path, folder, *columns, *OPTIONS[:2], *OPTIONS[4:]) == 2
    assert "--rate HZ for evenly spaced rows" in capsys.readouterr().err
    assert init(tmp_path, folder, *columns, *OPTIONS, "--origin", "3,4") == 2
    assert "--origin is for" in capsys.readouterr().err
    bad = tmp_path / "bad.pt"
    for held, said in (
        ({"pose": torch.zeros(3, 7)}, "it holds a dict, not a tensor"),
        (torch.zeros(7), "holds a tensor of size (7,); expected rows"),
        (print, "bad.pt: "),
    ):
        torch.save(held, bad)
        assert init(tmp_path, bad, *columns, *OPTIONS) == 2
        assert said in capsys.readouterr().err
    (tmp_path / "none.pt").mkdir()
    assert init(tmp_path, tmp_path / "none.pt", *columns, *OPTIONS) == 2
    assert "none.pt: 0 files of tensors" in capsys.readouterr().err
    bad.write_bytes((folder / "0.pt").read_bytes()[:-300])
    assert init(tmp_path, bad, *columns, *OPTIONS) == 2
    assert "cannot be read as tensors of torch" in capsys.readouterr().err
    monkeypatch.setattr("thesis_lib.datasets.sources.motion_capture.tensors.find_spec", lambda name: None)
    assert init(tmp_path, folder, *columns, *OPTIONS) == 2
    assert "pip install torch" in capsys.readouterr().err
