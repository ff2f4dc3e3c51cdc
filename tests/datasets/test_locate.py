"""Datasets named in the configuration are found, or refused with what is known."""

import pytest

from thesis_lib.datasets.sources.locate import locate
from thesis_lib.foundation.errors import UserError


def make(folder, *files):
    folder.mkdir(parents=True)
    for name in files:
        (folder / name).write_text("x")
    return folder


def test_simulated_drops_are_made_by_the_pipeline(tmp_path):
    found = locate("drops", [tmp_path])
    assert found.origin == "simulated" and found.present and found.has_trajectories


def test_a_users_folder_is_found_with_all_its_files(tmp_path):
    folder = make(tmp_path / "b" / "mine", "dataset.yaml", "trajectories.parquet", "notes.md")
    found = locate("mine", [tmp_path / "a", tmp_path / "b"])
    assert found.origin == "folder" and found.folder == str(folder) and found.has_trajectories
    assert found.files == (str(folder / "dataset.yaml"), str(folder / "trajectories.parquet"))
    (folder / "impacts.csv").write_text("x")
    assert not locate("mine", [tmp_path / "b"]).has_trajectories  # given impacts count before trajectories


def test_the_first_folder_wins(tmp_path):
    for base in ("a", "b"):
        make(tmp_path / base / "mine", "dataset.yaml")
    assert locate("mine", [tmp_path / "b", tmp_path / "a"]).folder == str(tmp_path / "b" / "mine")


def test_published_files_are_the_input_of_their_conversion(tmp_path):
    make(tmp_path / "fazeli_planar_impact", "data_ellipse_2017-11-08_measured_y.mat")
    found = locate("planar_impact", [tmp_path])
    assert found.origin == "published" and found.folder == "results/datasets/planar_impact"
    assert len(found.source_files) == 6 and not found.has_trajectories


def test_an_absent_published_set_is_left_out_not_refused(tmp_path):
    found = locate("planar_dice", [tmp_path])
    assert not found.present and found.files == () and found.source_files == []


def test_an_unknown_name_is_refused_with_where_it_was_looked_for(tmp_path):
    with pytest.raises(UserError, match=r"no dataset 'planar_impcat'.*planar_impact, .*, drops"):
        locate("planar_impcat", [tmp_path])
