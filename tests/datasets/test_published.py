"""Fetching and converting the published sets: values as published, checksums enforced, nothing unsafe unpacked."""

import functools
import hashlib
import http.server
import json
import threading

import numpy as np
import pandas as pd
import pytest

from tests.fuzz.hostile import archive
from thesis_lib.commands.datasets import main
from thesis_lib.datasets import read_dataset
from thesis_lib.datasets.sources import fetch, published
from thesis_lib.datasets.sources.published import SOURCES, checksums, convert_published, find_source, local_file
from thesis_lib.datasets.sources.published_tosses import EXPERIMENT
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.provenance import file_sha256

DICE = "x,z,th,vx,vz,vth\n" + "".join(f"0.{i},0.5,0.25,9,9,9\n" for i in range(10, 30))
CONTACT_MISMATCH = 2e-3  # m; published contact points are one frame (1/250 s) before the published pose


@pytest.fixture
def two_throws(monkeypatch, tmp_path):
    """A published dice set of two made-up files."""
    digest = hashlib.sha256(DICE.encode()).hexdigest()
    path = tmp_path / "sums.txt"
    path.write_text("".join(f"{digest}  planar_dice/traj_{i}.csv\n" for i in (10, 2)))
    monkeypatch.setattr(published, "CHECKSUMS", path)
    return {f"repo-abc/dice-data-processed/traj_{i}.csv": DICE.encode() for i in (10, 2)}


@pytest.fixture
def serve(tmp_path):
    """A web server on loopback: `serve(path, content)` publishes a file, `serve.url` is its address."""
    root = tmp_path / "www"
    root.mkdir()

    class Quiet(http.server.SimpleHTTPRequestHandler):
        def log_message(self, *args):
            pass

    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Quiet, directory=root))
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()

    def put(path: str, content: bytes) -> None:
        (root / path).parent.mkdir(parents=True, exist_ok=True)
        (root / path).write_bytes(content)

    put.url = f"http://127.0.0.1:{server.server_address[1]}"
    yield put
    server.shutdown()
    server.server_close()
    thread.join()


def serve_archive(serve, content: bytes, name: str = "planar_dice") -> str:
    repository, commit = SOURCES[name].archive
    serve(f"{repository}/zip/{commit}", content)
    return serve.url


# --- values -------------------------------------------------------------------------------------------------


def test_impacts_are_as_published(planar_impact_dir, raw_folder):
    from scipy.io import loadmat

    raw = raw_folder("planar_impact")
    data = loadmat(raw / "data_ellipse_2017-11-08_measured_y.mat")["data"][0, 0]
    table = read_dataset(planar_impact_dir).impacts
    assert table["trial"].tolist() == list(range(1718))
    assert (table["impact"] == 0).all()
    before = table[["x", "y", "theta", "vx_pre", "vy_pre", "omega_pre"]].to_numpy()
    np.testing.assert_array_equal(before, data["states_i"])
    np.testing.assert_array_equal(table[["vx_post", "vy_post", "omega_post"]], data["states_f"][:, 3:])
    np.testing.assert_array_equal(table["r_x"], data["n"][:, 2])
    np.testing.assert_array_equal(table["r_y"], -data["d"][:, 2])
    assert (table["r_y"] < 0).all()
    p_models = loadmat(raw / "p_models.mat")["p_models"]
    v_models = loadmat(raw / "v_models.mat")["v_models"]
    stored = pd.read_csv(planar_impact_dir / "published_predictions.csv")
    np.testing.assert_array_equal(stored[["wang_mason_p_t", "wang_mason_p_n"]], p_models[:, 8:10])
    np.testing.assert_array_equal(stored["whittaker_omega"], v_models[:, 17])
    assert len(stored.columns) == 1 + 6 * 5 + 5


def test_published_contact_points_and_impulses_fit_the_states(planar_impact_dir):
    """The signs of r and of the stored impulses, from physics: Δp = m Δv, and r is where the ellipse is lowest."""
    dataset = read_dataset(planar_impact_dir)
    hits = dataset.stated_impacts()
    distance = np.linalg.norm(hits.r - dataset.shape.contact_point(hits.q[:, 2]), axis=1)
    assert distance.max() < CONTACT_MISMATCH
    mirrored = np.linalg.norm(hits.r * [-1.0, 1.0] - dataset.shape.contact_point(hits.q[:, 2]), axis=1)
    assert np.median(mirrored) > 10.0 * np.median(distance)
    stored = pd.read_csv(planar_impact_dir / "published_predictions.csv")
    dp = dataset.mass * hits.dv[:, :2]
    np.testing.assert_allclose(stored[["w_true_x", "w_true_y"]], dp, atol=1e-12)  # rounding


def test_the_unflagged_drops_are_the_published_impacts(planar_impact_dir):
    drops = pd.read_csv(planar_impact_dir / "all_drops.csv")
    assert len(drops) == 2000
    kept = drops[(drops.filter(like="flag_") == 0).all(axis=1)].reset_index(drop=True)
    table = read_dataset(planar_impact_dir).impacts
    equal = [name for name in table.columns if name not in ("trial", "impact", "vy_post")]
    np.testing.assert_array_equal(kept[equal], table[equal])
    shift = 3.0 * 9.81 / 250.0  # the two publications differ by three frames of gravity
    np.testing.assert_allclose(table["vy_post"] - kept["vy_post"], shift, rtol=1e-12)


def test_dice_are_as_published(planar_dice_dir, raw_folder):
    raw = raw_folder("planar_dice")
    poses = read_dataset(planar_dice_dir).trajectories
    assert len(poses) == 100_000
    for number in (1, 57, 500):
        log = pd.read_csv(raw / f"traj_{number}.csv")
        throw = poses[poses["trial"] == number]
        np.testing.assert_array_equal(throw[["x", "y"]], log[["x", "z"]])
        np.testing.assert_allclose(throw["t"], np.arange(200) / 250.0, rtol=1e-15)
        turns = (throw["theta"].to_numpy() - log["th"].to_numpy()) / (2.0 * np.pi)
        np.testing.assert_allclose(turns, np.rint(turns), atol=1e-12)  # unwrapped by the reader


def test_converting_twice_gives_the_same_bytes(planar_impact_dir, raw_folder, tmp_path):
    again = convert_published("planar-impact", raw_folder("planar_impact"), tmp_path / "planar_impact")
    for path in again.iterdir():
        assert path.read_bytes() == (planar_impact_dir / path.name).read_bytes()


@pytest.fixture
def three_tosses(monkeypatch, tmp_path):
    """A published set of tosses of which 0, 1 and 4 of 0 to 4 are there, in a box of 0.1 × 0.08 × 0.06 m; its poses."""
    import torch

    folder = tmp_path / "contactnets_cube" / "tosses_processed"
    folder.mkdir(parents=True)
    unit = 9.81 / 200.0
    stated = {"dt": 0.005, "g": 200.0, "mass": 0.5, "inertia": 0.0005 / unit**2, "mu": 0.3, "restitution": 0.2}
    stated["vertices"] = [
        [x * 0.05 / unit, y * 0.04 / unit, z * 0.03 / unit] for x in (1, -1) for y in (1, -1) for z in (1, -1)
    ]
    (folder.parent / "experiment.json").write_text(json.dumps(stated))
    lines, poses = [f"{file_sha256(folder.parent / 'experiment.json')}  contactnets_cube/{EXPERIMENT}\n"], {}
    for number in (0, 1, 4):
        pose = np.tile([0.1, 0.2, 0.3, 0.6, 0.0, 0.8, 0.0, 9.0, 9.0], (20, 1)) + 0.01 * number * np.eye(9)[0]
        torch.save(torch.tensor(pose[None]), folder / f"{number}.pt")
        poses[number] = pose
        lines.append(f"{file_sha256(folder / f'{number}.pt')}  contactnets_cube/tosses_processed/{number}.pt\n")
    lines += [f"{'0' * 64}  contactnets_cube/tosses_processed/{number}.pt\n" for number in (2, 3)]
    monkeypatch.setattr(published, "CHECKSUMS", tmp_path / "sums.txt")
    (tmp_path / "sums.txt").write_text("".join(lines))
    return folder, unit, poses


def test_tosses_are_as_published(contactnets_cube_dir, raw_folder):
    """Values of a file, read without torch, and their physics: the poses move as the stored velocities say."""
    raw, made = raw_folder("contactnets_cube"), read_dataset(contactnets_cube_dir)
    poses = made.trajectories[made.trajectories["trial"] == 0]
    held = local_file(raw, "tosses_processed/0.pt").read_bytes()[-8 * 19 * len(poses) :]  # numbers are at its end
    toss = np.frombuffer(held, "<f8").reshape(-1, 19)
    unit = 9.81 / json.loads(local_file(raw, EXPERIMENT).read_text())["g"]
    np.testing.assert_allclose(poses[["x", "y", "z"]], unit * toss[:, :3], rtol=1e-12)
    np.testing.assert_allclose(poses[["qw", "qx", "qy", "qz"]], toss[:, 3:7], atol=1e-12)
    moved = made.rate * np.diff(poses["z"]) - unit * toss[1:, 9]
    assert np.median(np.abs(moved)) < 0.02  # m/s; the stored velocities are smoothed


# --- finding and checking -----------------------------------------------------------------------------------


def test_checksums_cover_every_file():
    assert len(checksums("planar_dice")) == 500 and len(checksums("contactnets_cube")) == 571
    assert set(checksums("planar_impact")) == set(SOURCES["planar_impact"].raw)
    assert all(len(digest) == 64 for name in SOURCES for digest in checksums(name).values())


def test_a_folder_with_the_files_as_published_is_found_and_converted(two_throws, tmp_path):
    assert find_source("planar_dice", tmp_path) is None
    raw = tmp_path / "fazeli_planar_dice" / "dice-data-processed"
    raw.mkdir(parents=True)
    for name, content in two_throws.items():
        (raw / name.split("/")[-1]).write_bytes(content)
    assert find_source("planar_dice", tmp_path) == find_source("planar_dice", raw) == raw
    out = convert_published("planar-dice", tmp_path, tmp_path / "planar_dice")
    assert read_dataset(out).trials.tolist() == [2, 10]
    with pytest.raises(UserError, match="no published dataset 'planar-cat'"):
        convert_published("planar-cat", tmp_path, tmp_path / "cat")


def test_a_changed_file_is_refused_and_nothing_is_written(two_throws, tmp_path):
    raw = tmp_path / "raw"
    raw.mkdir()
    (raw / "traj_10.csv").write_text(DICE)
    with pytest.raises(UserError, match=r"are missing: traj_2\.csv"):
        convert_published("planar_dice", raw, tmp_path / "out")
    (raw / "traj_2.csv").write_text(DICE.replace("0.5", "0.6", 1))
    with pytest.raises(UserError, match=r"SHA-256 differs\): traj_2\.csv"):
        convert_published("planar_dice", raw, tmp_path / "out")
    assert not (tmp_path / "out").exists()
    with pytest.raises(UserError, match="does not contain the published set"):
        convert_published("planar_dice", tmp_path / "nowhere", tmp_path / "out")


@pytest.mark.slow
def test_any_tosses_are_a_copy_and_the_missing_ones_are_said(three_tosses, tmp_path, capsys):
    folder, unit, poses = three_tosses
    (folder / "0.pt").rename(folder.parent / "0.pt")  # without its folder
    fetched = ["fetch", "contactnets-cube", "--from", str(tmp_path), "--to", str(tmp_path / "m")]
    assert main(fetched) == 0
    assert "3 of 5 tosses present; missing: 2 to 3\n" in capsys.readouterr().out
    made = read_dataset(tmp_path / "m" / "contactnets_cube")
    assert made.trials.tolist() == [0, 1, 4] and made.rate == 200.0 and made.gravity == 9.81
    body = made.in_space.body
    np.testing.assert_allclose(body.shape.half_extents, [0.05, 0.04, 0.03], rtol=1e-12)
    np.testing.assert_allclose(body.inertia.matrix, 0.0005 * np.eye(3), rtol=1e-11)
    toss = made.trajectories[made.trajectories["trial"] == 4]
    np.testing.assert_allclose(toss[["x", "y", "z"]], unit * poses[4][:, :3], rtol=1e-12)
    np.testing.assert_allclose(toss[["qw", "qx", "qy", "qz"]], poses[4][:, 3:7], atol=1e-15)
    np.testing.assert_allclose(toss["t"], 0.005 * np.arange(20), rtol=1e-12)
    # neither a spoilt file nor the experiment alone is a copy
    (folder / "4.pt").write_bytes((folder / "4.pt").read_bytes() + b"x")
    with pytest.raises(UserError, match=r"SHA-256 differs\): tosses_processed/4\.pt"):
        convert_published("contactnets_cube", tmp_path, tmp_path / "out")
    for path in (folder / "4.pt", folder / "1.pt", folder.parent / "0.pt"):
        path.unlink()
    with pytest.raises(UserError, match=r"are missing: tosses_processed/0\.pt"):
        convert_published("contactnets_cube", tmp_path, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_tosses_are_unpacked_from_the_archive_of_their_repository(three_tosses, serve, tmp_path):
    folder, _, _ = three_tosses
    content = {f"tosses_processed/{i}.pt": (folder / f"{i}.pt").read_bytes() for i in (0, 1, 4)}
    content[EXPERIMENT] = (folder.parent / "experiment.json").read_bytes()
    zipped = archive(*((f"contact-nets-1/data/{file}", held) for file, held in content.items()))
    url = serve_archive(serve, zipped, "contactnets_cube")
    with pytest.raises(UserError, match="lacks 2 of 6 files"):  # an archive has all, or it is another one
        fetch.fetch("contactnets-cube", tmp_path / "m", archive_host=url)
    (tmp_path / "archive.zip").write_bytes(zipped)
    files = {file: tmp_path / "unpacked" / file for file in content}
    fetch.unpack(tmp_path / "archive.zip", SOURCES["contactnets_cube"], files)
    assert {file: path.read_bytes() for file, path in files.items()} == content


def test_a_package_that_is_missing_is_named_before_the_download(monkeypatch, tmp_path):
    monkeypatch.setattr(fetch, "find_spec", lambda name: None)
    for copy in (None, tmp_path):
        with pytest.raises(UserError, match=r"^contactnets-cube holds tensors of torch; .* pip install torch"):
            fetch.fetch("contactnets-cube", tmp_path / "m", copy, archive_host="http://127.0.0.1:9")


# --- network ------------------------------------------------------------------------------------------------


def test_archive_is_fetched_checked_and_converted(two_throws, serve, tmp_path):
    members = two_throws | {"repo-abc/big/mesh.bin": bytes(20_000_000), "repo-abc/README": b"x"}
    url = serve_archive(serve, archive(*members.items()))
    said = []
    folder = fetch.fetch("planar-dice", tmp_path / "m", say=said.append, archive_host=url)
    assert folder == tmp_path / "m" / "planar_dice"
    assert read_dataset(folder).trajectories["x"].iloc[0] == 0.10
    assert any("archive of" in text for text in said)


def test_single_files_are_fetched(serve, raw_folder, tmp_path):
    raw = raw_folder("planar_impact")
    for name, path in SOURCES["planar_impact"].raw.items():
        serve(path, (raw / name).read_bytes())
    folder = fetch.fetch("planar-impact", tmp_path, raw_host=serve.url)
    assert len(read_dataset(folder).impacts) == 1718


def test_a_wrong_download_is_refused(serve, tmp_path):
    for path in SOURCES["planar_impact"].raw.values():
        serve(path, b"<html>not found, but politely</html>")
    with pytest.raises(UserError, match="SHA-256 differs"):
        fetch.fetch("planar-impact", tmp_path / "m", raw_host=serve.url)
    assert not (tmp_path / "m").exists()


@pytest.mark.parametrize(
    ("extra", "message"),
    [
        ({"../../evil.csv": b"x"}, "unsafe name '../../evil.csv'"),
        ({"/etc/evil": b"x"}, "unsafe name '/etc/evil'"),
        ({"repo-abc\\..\\evil": b"x"}, "unsafe name"),
        ({"repo-abc/dice-data-processed/traj_2.csv": bytes(2_000_000)}, "states 2,000,000 bytes"),
    ],
    ids=["parent", "absolute", "backslash", "bomb"],
)
def test_unsafe_archives_are_refused(two_throws, serve, tmp_path, extra, message):
    url = serve_archive(serve, archive(*(two_throws | extra).items()))
    before = {path for path in tmp_path.rglob("*") if path.is_file()}
    with pytest.raises(UserError) as caught:
        fetch.fetch("planar-dice", tmp_path / "m", archive_host=url)
    assert message in str(caught.value)
    assert {path for path in tmp_path.rglob("*") if path.is_file()} == before


def test_incomplete_or_broken_archives_are_refused(two_throws, serve, tmp_path):
    url = serve_archive(serve, archive(next(iter(two_throws.items()))))
    with pytest.raises(UserError, match="lacks 1 of 2 files"):
        fetch.fetch("planar-dice", tmp_path / "m", archive_host=url)
    serve_archive(serve, archive(*two_throws.items())[:-30])
    with pytest.raises(UserError, match="archive is damaged"):
        fetch.fetch("planar-dice", tmp_path / "m", archive_host=url)


def test_network_failures_point_to_the_local_copy(serve, tmp_path):
    with pytest.raises(UserError, match="--from DIR"):  # 404
        fetch.fetch("planar-impact", tmp_path / "m", raw_host=serve.url)
    with pytest.raises(UserError, match="--from DIR"):  # nobody listens on port 1
        fetch.fetch("planar-impact", tmp_path / "m", raw_host="http://127.0.0.1:1")
    assert not (tmp_path / "m").exists()


def test_downloads_are_bounded(serve, tmp_path):
    serve("large", bytes(3_000_000))
    with pytest.raises(UserError, match="is larger than 1,000,000 bytes"):
        fetch.download(f"{serve.url}/large", tmp_path / "x", limit=1_000_000)
