"""Datasets of schema 2: each rule of the format, read or refused with the form wanted; written and read back."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from folders import header as planar_header
from folders import only, refusal, write
from folders import trajectories as planar_trajectories
from folders_in_space import BOX, body, header, impacts, mesh, trajectories, write_mesh
from scipy.spatial.transform import Rotation

from thesis_lib.datasets import dataset_of, read_dataset
from thesis_lib.datasets.format.validate import DatasetError, Problem
from thesis_lib.datasets.format.write import write_dataset
from thesis_lib.datasets.sources.locate import locate
from thesis_lib.mechanics.space import SPACE

SHAPES = {
    "box": BOX,
    "rounded_box": BOX | {"edge_radius": 0.002},
    "sphere": {"kind": "sphere", "radius": 0.03},
    "ellipsoid": {"kind": "ellipsoid", "semi_axes": [0.05, 0.04, 0.03]},
    "cylinder": {"kind": "cylinder", "radius": 0.03, "half_length": 0.05, "edge_radius": 0.001},
    "capsule": {"kind": "capsule", "radius": 0.02, "half_length": 0.05},
}
INERTIA = {"xx": 2.1e-4, "yy": 2.8e-4, "zz": 3.4e-4}


def with_cells(frame: pd.DataFrame, row: int, **cells) -> pd.DataFrame:
    frame = frame.copy()
    for column, value in cells.items():
        frame.loc[row, column] = value
    return frame


# --- valid datasets ---


@pytest.mark.parametrize("shape", SHAPES.values(), ids=SHAPES)
def test_a_dataset_is_read_and_what_is_written_reads_back_to_the_bit(tmp_path, shape):
    head = header(body=body(shape=shape))
    low = {"cylinder": 0.05, "capsule": 0.07}.get(shape["kind"], 0.03)
    hits = impacts(3).assign(z=low)
    read = read_dataset(write(tmp_path / "drops", head, trajectories=trajectories(), impacts=hits))
    assert read.warnings == () and read.space is SPACE and read.has_angle and len(read.trials) == 3
    again = read_dataset(write_dataset(read, tmp_path / "again", float_format=None))
    assert again.header == read.header and again.digest() == read.digest()
    for kind in ("trajectories", "impacts"):
        pd.testing.assert_frame_equal(getattr(again, kind), getattr(read, kind), check_exact=True)


def test_the_smallest_header_has_the_documented_defaults():
    made = dataset_of({"schema": 2, "body": body(mass=None)}, trajectories=trajectories())
    assert made.gravity == 9.81 and made.rate == pytest.approx(240.0) and made.mass is None
    ((point, normal),) = made.header.planes
    assert point.tolist() == [0.0, 0.0, 0.0] and normal.tolist() == [0.0, 0.0, 1.0]
    assert made.header.tracked.attitude.tolist() == [1.0, 0.0, 0.0, 0.0]
    sideways = dataset_of(header(surface=None, gravity=[0.0, 3.0, 0.0]), trajectories=trajectories())
    assert sideways.header.planes[0][1].tolist() == [0.0, -1.0, 0.0]


def test_arrays_csv_and_parquet_are_the_same_dataset(tmp_path):
    folder = write(tmp_path / "a", header())
    trajectories().to_parquet(folder / "trajectories.parquet", index=False)
    csv = read_dataset(write(tmp_path / "b", header(), trajectories=trajectories()))
    assert read_dataset(folder).digest() == csv.digest()
    assert dataset_of(header(), trajectories=trajectories()).digest() == csv.digest()
    assert dataset_of(header(gravity=[0, 0, -9.80]), trajectories=trajectories()).digest() != csv.digest()


def test_signs_and_lengths_of_quaternions_change_nothing():
    frame = trajectories()
    flipped = frame.copy()
    q = ["qw", "qx", "qy", "qz"]
    flipped.loc[::3, q] *= -1.0
    flipped.loc[::2, q] *= 1.01
    made, other = (dataset_of(header(), trajectories=table) for table in (frame, flipped))
    np.testing.assert_allclose(other.trajectories[q], made.trajectories[q], atol=1e-15)
    assert np.linalg.norm(other.trajectories[q], axis=1) == pytest.approx(1.0, abs=1e-15)
    signs_only = frame.copy()
    signs_only.loc[::3, q] *= -1.0
    assert dataset_of(header(), trajectories=signs_only).digest() == made.digest()


def test_lost_orientations_are_kept_and_lost_frames_are_as_if_they_were_not_there():
    q, pose = ["qw", "qx", "qy", "qz"], ["x", "y", "z", "qw", "qx", "qy", "qz"]
    frame = with_cells(trajectories(), 5, **dict.fromkeys(q, np.nan))
    made = dataset_of(header(), trajectories=frame)
    assert np.isnan(made.trajectories.loc[5, q].astype(float)).all() and np.isfinite(made.trajectories.loc[5, "x"])
    empty = with_cells(frame, 7, **dict.fromkeys(pose, np.nan))
    assert (
        dataset_of(header(), trajectories=empty).digest() == dataset_of(header(), trajectories=frame.drop(7)).digest()
    )


def test_a_sphere_needs_no_orientation_and_says_its_spin(tmp_path):
    head = header(body=body(shape=SHAPES["sphere"]), noise={"position": 1e-4}, spin=20.0)
    frame = trajectories().drop(columns=["qw", "qx", "qy", "qz"])
    ball = read_dataset(write(tmp_path / "ball", head, trajectories=frame))
    assert not ball.has_angle and ball.header.spin == 20.0
    again = read_dataset(write_dataset(ball, tmp_path / "again", float_format=None))
    assert again.digest() == ball.digest() and not again.has_angle
    assert "columns qw, qx, qy, qz: missing" in only(write(tmp_path / "box", header(), trajectories=frame))
    some = frame.assign(qw=1.0)
    assert "give all of qw, qx, qy, qz" in only(write(tmp_path / "some", head, trajectories=some))


# --- body ---


def test_the_three_ways_to_say_the_inertia_agree():
    solid = dataset_of(header(), trajectories=trajectories()).header.body
    kx, ky, kz = np.sqrt(np.diag(solid.inertia_per_mass))
    np.testing.assert_allclose([kx, ky, kz], np.sqrt(np.array([0.0025, 0.0034, 0.0041]) / 3.0))
    for told in (
        {"radii_of_gyration": [kx, ky, kz]},
        {"inertia": dict(zip(("xx", "yy", "zz"), 0.25 * np.array([kx, ky, kz]) ** 2))},
    ):
        other = dataset_of(header(body=body(homogeneous=None, **told)), trajectories=trajectories()).header.body
        np.testing.assert_allclose(other.inertia_per_mass, solid.inertia_per_mass, rtol=1e-12, atol=1e-18)


def test_products_of_inertia_are_elements_of_the_tensor():
    told = INERTIA | {"xy": -2e-5, "xz": 1e-5, "yz": 3e-6}
    G = dataset_of(header(body=body(homogeneous=None, inertia=told)), trajectories=trajectories()).header.body
    wanted = np.array([[2.1e-4, -2e-5, 1e-5], [-2e-5, 2.8e-4, 3e-6], [1e-5, 3e-6, 3.4e-4]]) / 0.25
    np.testing.assert_allclose(G.inertia_per_mass, wanted)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        (
            {"homogeneous": None},
            "exactly one of inertia, radii_of_gyration and homogeneous: true is needed; there is none",
        ),
        ({"radii_of_gyration": [0.02, 0.03, 0.03]}, "there are radii_of_gyration and homogeneous"),
        ({"homogeneous": False, "inertia": INERTIA, "radii_of_gyration": [0.02] * 3}, "inertia and radii_of_gyration"),
        ({"homogeneous": None, "inertia": INERTIA, "mass": None}, "inertia needs the mass"),
        ({"homogeneous": None, "inertia": INERTIA | {"zz": 6e-4}}, "the largest is above the sum of the others"),
        ({"homogeneous": None, "inertia": INERTIA | {"xy": 3e-4}}, "must all be above 0"),
        ({"homogeneous": None, "inertia": INERTIA | {"xx": -1e-4}}, "body.inertia.xx: is -0.0001, but must be above 0"),
        ({"homogeneous": None, "inertia": {"xx": 1e-4, "yy": 1e-4}}, "body.inertia.zz: the key is missing"),
        ({"homogeneous": None, "radii_of_gyration": [0.01, 0.01, 0.03]}, "the largest is above the sum of the others"),
        (
            {"center_of_mass": [0.01, 0.0, 0.0]},
            "center_of_mass contradicts homogeneous: this shape has its centre at [0, 0, 0]",
        ),
        ({"center_of_mass": [0.01, 0.0]}, "body.center_of_mass[2]: the key is missing"),
        ({"uncertainty": {"center_of_mass": -1.0}}, "body.uncertainty.center_of_mass: is -1.0, but must be above 0"),
        ({"shape": BOX | {"edge_radius": 0.031}}, "edge_radius is larger than the solid allows, at most 0.03 m"),
        ({"shape": SHAPES["sphere"] | {"edge_radius": 0.001}}, "body.shape.edge_radius: unknown key"),
        ({"shape": {"kind": "box", "half_extents": [0.05, 0.04]}}, "body.shape.half_extents[2]: the key is missing"),
        ({"shape": {"kind": "boxx"}}, "did you mean 'box'?"),
        ({"colour": "red"}, "body.colour: unknown key"),
    ],
)
def test_bodies_that_cannot_be(tmp_path, changes, said):
    assert said in only(write(tmp_path, header(body=body(**changes)), trajectories=trajectories()))


# --- meshes ---


@pytest.mark.parametrize("name", ["body.obj", "body.stl", "BODY.STL"])
def test_a_mesh_is_its_hull_for_contacts_and_itself_for_the_mass(tmp_path, name):
    shape = write_mesh(tmp_path / "drops", name, half_extents=(50.0, 40.0, 30.0)) | {"scale": 0.001}
    read = read_dataset(write(tmp_path / "drops", header(body=body(shape=shape)), trajectories=trajectories()))
    box = dataset_of(header(), trajectories=trajectories())
    np.testing.assert_allclose(read.header.body.inertia_per_mass, box.header.body.inertia_per_mass, atol=1e-9)
    np.testing.assert_allclose(read.header.body.centre, 0.0, atol=1e-9)
    d = np.random.default_rng(0).standard_normal((3, 50))
    np.testing.assert_allclose(read.shape.support(d), box.shape.support(d), atol=1e-8)
    again = read_dataset(write_dataset(read, tmp_path / "again", float_format=None))
    assert again.digest() == read.digest() and again.header == read.header
    assert (tmp_path / "again" / name).read_bytes() == (tmp_path / "drops" / name).read_bytes()


def test_the_bytes_of_a_mesh_are_content_of_the_dataset_and_its_file_an_input(tmp_path):
    shape = write_mesh(tmp_path / "boxes")
    folder = write(tmp_path / "boxes", header(body=body(shape=shape)), trajectories=trajectories())
    before = read_dataset(folder).digest()
    (folder / "body.obj").write_bytes(mesh() + b"# measured again\n")
    assert read_dataset(folder).digest() != before
    assert str(folder / "body.obj") in locate("boxes", [tmp_path]).files


def test_a_hollow_mesh_has_the_inertia_of_the_mesh_and_rounds_its_hull(tmp_path):
    import trimesh

    plates = [
        trimesh.creation.box((0.02, 0.08, 0.06), trimesh.transformations.translation_matrix((x, 0, 0)))
        for x in (-0.04, 0.04)
    ]
    tmp_path.joinpath("two.stl").write_bytes(trimesh.util.concatenate(plates).export(file_type="stl"))
    shape = {"kind": "mesh", "file": "two.stl", "edge_radius": 0.005}
    read = read_dataset(write(tmp_path, header(body=body(shape=shape)), trajectories=trajectories()))
    plate = np.array([0.0001, 0.0016, 0.0009])
    own = (plate.sum() - plate) / 3.0 + np.array([0.0, 0.0016, 0.0016])
    np.testing.assert_allclose(read.header.body.inertia_per_mass, np.diag(own), atol=1e-9)
    corner = read.shape.support(np.ones((3, 1)))[:, 0]
    np.testing.assert_allclose(corner, np.array([0.045, 0.035, 0.025]) + 0.005 / np.sqrt(3.0), atol=1e-7)


@pytest.mark.parametrize(
    ("place", "said"),
    [
        (lambda path: path.symlink_to("../secret.obj"), "is a link"),
        (lambda path: None, "does not exist"),
        (lambda path: path.write_text("v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"), "cannot be read as a mesh"),
        (lambda path: path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\nf 1 2 4\n"), "lie in a plane"),
        (lambda path: path.write_bytes(mesh()), "the limit is 100"),
        (lambda path: path.mkdir(), "is a folder"),
    ],
    ids=["link", "nothing", "text", "flat", "large", "folder"],
)
def test_meshes_that_are_refused(tmp_path, place, said, monkeypatch):
    monkeypatch.setattr("thesis_lib.bodies.mesh.MAX_BYTES", 100)
    write_mesh(tmp_path, "secret.obj")
    shape = {"kind": "mesh", "file": "body.obj"}
    folder = write(tmp_path / "drops", header(body=body(shape=shape)), trajectories=trajectories())
    place(folder / "body.obj")
    assert said in only(folder)


@pytest.mark.parametrize("name", ["../secret.obj", "dataset.yaml"])
def test_meshes_that_cannot_be_meant_are_refused(tmp_path, name):
    write_mesh(tmp_path, "secret.obj")
    head = header(body=body(shape={"kind": "mesh", "file": name}))
    said = only(write(tmp_path / "drops", head, trajectories=trajectories()))
    assert "must be the name of an .obj or .stl file in the folder of the dataset" in said


def test_an_open_mesh_cannot_be_homogeneous_and_one_without_a_centre_neither(tmp_path):
    shape = write_mesh(tmp_path, closed=False)
    assert "is not closed" in only(write(tmp_path, header(body=body(shape=shape)), trajectories=trajectories()))
    text = (tmp_path / "body.obj").read_text()
    *rest, last = mesh().decode().rstrip().split("\n")
    corners = last.split()
    (tmp_path / "body.obj").write_text("\n".join([*rest, " ".join([corners[0], *corners[:0:-1]])]))
    said = only(write(tmp_path, header(body=body(shape=shape)), trajectories=trajectories()))
    assert "has some faces clockwise" in said and "is not closed" not in said
    (tmp_path / "body.obj").write_text(text)
    told = {"homogeneous": None, "radii_of_gyration": [0.03, 0.03, 0.03]}
    folder = write(tmp_path, header(body=body(shape=shape, **told)))
    assert "a mesh needs center_of_mass, or homogeneous: true" in only(folder)
    known = body(shape=shape, **told, center_of_mass=[0.001, 0.0, 0.0])
    assert read_dataset(write(tmp_path, header(body=known))).header.body.centre[0] == 0.001
    with pytest.raises(DatasetError, match="no folder is given"):
        dataset_of(header(body=known), trajectories=trajectories())
    assert dataset_of(header(body=known), trajectories=trajectories(), folder=tmp_path).shape.extent > 0.07


# --- frames, surfaces, gravity, noise ---


def test_the_tracked_frame_may_be_given_or_unknown(tmp_path):
    tracked = {"position": [0.0, 0.0, 0.03], "quaternion": [-1.01, 0, 0, 0], "uncertainty": {"position": 1e-3}}
    read = read_dataset(write(tmp_path / "a", header(tracked=tracked), trajectories=trajectories()))
    assert read.header.tracked.attitude.tolist() == [-1.0, 0.0, 0.0, 0.0]
    sure = tracked | {"uncertainty": {"position": 2e-3, "rotation": 0.01}}
    assert dataset_of(header(tracked=sure), trajectories=trajectories()).digest() == read.digest()
    unknown = read_dataset(write(tmp_path / "b", header(tracked="unknown"), trajectories=trajectories()))
    assert unknown.header.tracked is None
    again = read_dataset(write_dataset(unknown, tmp_path / "c", float_format=None))
    assert again.header == unknown.header and "tracked: unknown" in (tmp_path / "c" / "dataset.yaml").read_text()


FLOOR = {"name": "floor", "point": [0, 0, 0], "normal": [0, 0, 1]}


def test_several_surfaces_may_end_somewhere(tmp_path):
    square = [[0.5, 0.5, 0], [-0.5, 0.5, 0], [-0.5, -0.5, 0], [0.5, -0.5, 0]]
    wall = {"name": "wall", "point": [1.0, 0, 0], "normal": [-2.0, 0, 0]}
    head = header(surface=None, surfaces=[FLOOR | {"extent": square}, wall])
    read = read_dataset(write(tmp_path / "a", head, trajectories=trajectories()))
    assert [normal.tolist() for _, normal in read.header.planes] == [[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]]
    again = read_dataset(write_dataset(read, tmp_path / "b", float_format=None))
    assert again.digest() == read.digest()


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"tracked": "unknwon"}, "tracked: is 'unknwon', but must be a mapping"),
        ({"tracked": {"quaternion": [1, 1, 0, 0]}}, "the quaternion has the length 1.414"),
        ({"tracked": {"quaternion": [0.97, 0, 0, 0]}}, "the quaternion has the length 0.97"),
        ({"tracked": {"rotation": [1, 0, 0]}}, "tracked.rotation: unknown key"),
        ({"surface": {"normal": [0, 0, 0]}}, "the vector has no direction"),
        ({"surface": {"point": [0, 0, 400]}}, "more than 40 m from the origin: millimetres?"),
        (
            {"surface": None, "gravity": [0, 0, 0]},
            "without gravity the direction of the surface is not defined; give surface.normal",
        ),
        ({"surfaces": [FLOOR]}, "surface and surfaces are both given; keep one of them"),
        ({"surface": None, "surfaces": []}, "surfaces contains no surface"),
        (
            {"surface": None, "surfaces": [FLOOR, {"name": "floor", "point": [0, 0, 1], "normal": [0, 1, 0]}]},
            "the name floor occurs more than once",
        ),
        ({"surface": None, "surfaces": [FLOOR | {"normal": None}]}, "surfaces[0].normal"),
        ({"surface": None, "surfaces": [FLOOR | {"extent": [[0, 0, 0], [1, 0, 0]]}]}, "surfaces[0].extent"),
        (
            {"surface": None, "surfaces": [FLOOR | {"extent": [[0, 0, 0], [1, 0, 0], [0, 1, 0.2]]}]},
            "do not lie in the plane",
        ),
        ({"gravity": [0, 0, float("inf")]}, "gravity[2]: is inf, but must be a finite number"),
        ({"rate": 0}, "rate: is 0, but must be above 0"),
        ({"noise": {"position": [1e-4, 1e-4]}}, "noise.position[2]: the key is missing"),
        ({"noise": {"position": [1.0, -1.0, 1.0]}}, "noise.position[1]: is -1.0, but must be above 0"),
        ({"noise": {"rotatoin": 1e-3}}, "did you mean 'rotation'?"),
        ({"colour": "red"}, "colour: unknown key"),
    ],
)
def test_surroundings_that_cannot_be(tmp_path, changes, said):
    assert said in only(write(tmp_path, header(**changes), trajectories=trajectories()))


def test_noise_of_a_position_is_one_number_or_one_for_each_axis():
    one, each = (
        dataset_of(header(noise={"position": value}), trajectories=trajectories()) for value in (1e-4, [1e-4] * 3)
    )
    assert one.header == each.header and one.digest() == each.digest()


# --- the other schema ---


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"body": body(homogeneous=None, radius_of_gyration=0.03)}, "in space, give [k_x, k_y, k_z] in m"),
        ({"body": body(shape={"kind": "disk", "radius": 0.03})}, "{kind: sphere, radius: R}"),
        ({"surface": {"height": 0.0}}, "in space, write surface: {point: [0, 0, height], normal: [0, 0, 1]}"),
        ({"gravity": 9.81}, "give [0, 0, -9.81] in m/s²"),
        ({"noise": {"angle": 1e-3}}, "in space, write rotation: rad"),
    ],
)
def test_planar_keys_show_the_form_in_space(tmp_path, changes, said):
    assert said in refusal(write(tmp_path, header(**changes), trajectories=trajectories()))


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"body": body(shape={"kind": "sphere", "radius": 0.03, "edge_radius": 1e-3})}, "box, cylinder and mesh have"),
        ({"tracked": {"rotation": [1, 0, 0, 0]}}, "write quaternion: [w, x, y, z]"),
    ],
)
def test_keys_at_a_wrong_place_are_explained(tmp_path, changes, said):
    assert said in only(write(tmp_path, header(**changes), trajectories=trajectories()))


@pytest.mark.parametrize(
    "changes",
    [
        {"tracked": "unknown"},
        {"body": planar_header()["body"] | {"center_of_mass": [0, 0, 0]}},
        {"body": planar_header()["body"] | {"radii_of_gyration": [0.02] * 3}},
        {"body": planar_header()["body"] | {"shape": BOX}},
        {"surface": {"normal": [0, 0, 1]}},
        {"noise": {"rotation": 1e-3}},
    ],
)
def test_keys_of_space_name_the_schema(tmp_path, changes):
    assert "'schema: 2'" in refusal(write(tmp_path, planar_header(**changes), trajectories=planar_trajectories()))


@pytest.mark.parametrize("written", ["schema: [2", "", "schema: 3\n", "schema: '2'\n"])
def test_a_header_that_cannot_be_read_puts_no_motion_in_a_plane(tmp_path, written):
    folder = write(tmp_path / "drops", header(), trajectories=trajectories(), impacts=impacts(3))
    (folder / "dataset.yaml").write_text(written)
    assert only(folder).startswith("dataset.yaml")
    (folder / "trajectories.csv").unlink()
    assert only(folder).startswith("dataset.yaml")
    planar_trajectories().to_csv(folder / "trajectories.csv", index=False)
    assert "impacts.csv, columns z, qw, qx, qy, qz, " in refusal(folder)  # the tables contradict each other


def test_columns_of_the_other_schema_show_the_form_wanted(tmp_path):
    text = refusal(write(tmp_path / "a", header(), trajectories=planar_trajectories()))
    assert "column theta: belongs to motions in a plane" in text
    assert "in space the columns are trial,t,x,y,z,qw,qx,qy,qz" in text
    text = refusal(write(tmp_path / "b", planar_header(), trajectories=trajectories()))
    assert "columns z, qw, qx, qy, qz: the motion is in space" in text and "write 'schema: 2'" in text
    text = refusal(write(tmp_path / "c", planar_header(), impacts=impacts()))
    assert "vz_pre" in text and "write 'schema: 2'" in text
    text = refusal(write(tmp_path / "d", header(), impacts=impacts().assign(omega_pre=0.0)))
    assert "column omega_pre: belongs to motions in a plane" in text and "wx_pre,wy_pre,wz_pre" in text


# --- tables ---


@pytest.mark.parametrize(
    ("cells", "said"),
    [
        ({"x": np.nan}, "columns x, y, z, row 7: only some of them are given"),
        ({"qy": np.nan}, "columns qw, qx, qy, qz, row 7: only some of them are given"),
        (dict.fromkeys("xyz", np.nan), "columns x, y, z, row 7: there is an orientation without a position"),
        ({"qw": 0.5, "qx": 0.0, "qy": 0.0, "qz": 0.0}, "row 7: the length of the quaternion is 0.5"),
        (dict.fromkeys(("qw", "qx", "qy", "qz"), 0.0), "row 7: the length of the quaternion is 0; that"),
        ({"qw": np.inf}, "column qw, row 7: is infinite"),
        ({"z": -np.inf}, "column z, row 7: is infinite"),
        ({"t": np.nan}, "column t, row 7: is empty or NaN"),
        ({"trial": np.nan}, "column trial, row 7: is empty or NaN"),
    ],
)
def test_rows_that_cannot_be(tmp_path, cells, said):
    assert said in only(write(tmp_path, header(), trajectories=with_cells(trajectories(), 5, **cells)))


@pytest.mark.parametrize("stem", ["trajectories", "impacts"])
def test_unknown_columns_are_refused_with_the_one_that_was_meant(tmp_path, stem):
    frame = {"trajectories": trajectories, "impacts": impacts}[stem]()
    assert "unknown column" in only(write(tmp_path / "a", header(), **{stem: frame.assign(colour=1.0)}))
    misread = refusal(write(tmp_path / "b", header(), **{stem: frame.rename(columns={"qw": "QW"})}))
    assert "did you mean 'qw'?" in misread


def test_times_copies_and_rates_are_judged_as_in_the_plane(tmp_path):
    frame = trajectories()
    late = frame.assign(t=frame["t"].where(frame.index != 9, frame["t"][7]))
    assert "the time goes backwards" in only(write(tmp_path / "a", header(), trajectories=late))
    copied = pd.concat([frame, frame[frame["trial"] == 1].assign(trial=3)])
    assert "trials 1 and 3 contain the same measurements" in only(write(tmp_path / "b", header(), trajectories=copied))
    assert "but dataset.yaml has rate: 100 Hz" in only(write(tmp_path / "c", header(rate=100.0), trajectories=frame))
    assert "the first row" in refusal(write(tmp_path / "d", header(), trajectories=frame.drop(columns="z")))


def test_impacts_may_have_times_and_contact_points_whole(tmp_path):
    frame = impacts().assign(t=0.1, r_x=0.05, r_y=0.04, r_z=-0.03)
    assert len(read_dataset(write(tmp_path / "a", header(), impacts=frame)).impacts) == 12
    assert "column r_z: is missing" in only(write(tmp_path / "b", header(), impacts=frame.drop(columns="r_z")))
    lost = with_cells(impacts(), 3, qw=np.nan)
    assert "column qw, row 5: is empty or NaN" in only(write(tmp_path / "c", header(), impacts=lost))


def test_neither_table_and_no_positions(tmp_path):
    assert "neither file exists" in only(write(tmp_path / "a", header()))
    nothing = trajectories().assign(**dict.fromkeys(("x", "y", "z", "qw", "qx", "qy", "qz"), np.nan))
    assert "no row has a position" in only(write(tmp_path / "b", header(), trajectories=nothing))


# --- in use ---


def test_a_critique_of_a_dataset_in_space_says_what_is_there(tmp_path):
    from thesis_lib.critique import TooFew, criticise, fit

    made = dataset_of(header(), trajectories=trajectories())
    with pytest.raises(TooFew, match="0 usable impacts"):
        fit(made)
    doubted = replace(made, warnings=(Problem("trajectories.csv", "column t", "samples are missing", "nothing"),))
    with pytest.raises(TooFew, match=r"0 usable impacts.* datasets check has 1 warning") as stopped:
        criticise(doubted, effects=["com_offset"])
    assert "samples are missing" not in str(stopped.value)
    found = criticise(made)
    content = found.save(tmp_path / "few")
    assert {"diagnosis.json", "report.html"} <= {path.name for path in (tmp_path / "few").iterdir()}
    assert content["verdict"] is content["restitution"]["value"] is None
    assert content["summary"][0] == "Too few impacts for a verdict (0 in 0 trials; 30 in 10 are needed)."


def test_the_world_may_have_any_direction_up():
    turned = Rotation.from_rotvec([0.3, -1.1, 0.7]).as_matrix()
    gravity = turned @ [0.0, 0.0, -9.81]
    made = dataset_of(header(gravity=gravity.tolist(), surface=None), trajectories=trajectories(up=turned))
    np.testing.assert_allclose(made.header.planes[0][1], turned[:, 2], atol=1e-12)
