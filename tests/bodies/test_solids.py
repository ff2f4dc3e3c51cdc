"""Solids: the support is the farthest point, turning turns it, limits agree, moments are those of the solid."""

import numpy as np
import pytest
from pydantic import TypeAdapter, ValidationError
from scipy.spatial.transform import Rotation

from thesis_lib.bodies.minkowski import farthest
from thesis_lib.bodies.moments import moments_within
from thesis_lib.bodies.shapes import Polygon
from thesis_lib.bodies.solid_body import SolidShape
from thesis_lib.bodies.solids import Box, Capsule, Cylinder, Ellipsoid, Hull, Solid, Sphere

EXACT = 1e-14  # m, of bodies of some cm: rounding only
SAMPLES = 400_000
SIGMAS = 4.5  # of a mean over samples; some 60 numbers are compared
SURFACE = 20_000  # points; the farthest of them lies less than a share of FINE below the support
FINE = 3e-3

SCALENE = ((0.03, 0.0, 0.0), (-0.02, 0.01, 0.0), (0.0, -0.03, 0.004), (0.005, 0.01, 0.04), (0.01, -0.01, -0.02))
SOLIDS: dict[str, Solid] = {
    "sphere": Sphere(radius=0.03),
    "ellipsoid": Ellipsoid(semi_axes=(0.05, 0.03, 0.02)),
    "capsule": Capsule(radius=0.02, half_length=0.03),
    "box": Box(half_extents=(0.05, 0.04, 0.03)),
    "rounded_box": Box(half_extents=(0.05, 0.04, 0.03), edge_radius=0.004),
    "cylinder": Cylinder(radius=0.03, half_length=0.05),
    "rounded_cylinder": Cylinder(radius=0.03, half_length=0.05, edge_radius=0.005),
    "hull": Hull(vertices=SCALENE),
    "rounded_hull": Hull(vertices=SCALENE, edge_radius=0.002),
}
SHARP = {name: solid for name, solid in SOLIDS.items() if not name.startswith("rounded")}


@pytest.fixture(params=SOLIDS, ids=list(SOLIDS))
def solid(request) -> Solid:
    return SOLIDS[request.param]


def directions(rng, n: int) -> np.ndarray:
    d = rng.standard_normal((3, n))
    return d / np.linalg.norm(d, axis=0)


def inside(name: str, p: np.ndarray) -> np.ndarray:
    """Whether points (3, n) lie in the sharp solid `name`, by its definition."""
    x, y, z = p
    match name:
        case "sphere":
            return x**2 + y**2 + z**2 <= 0.03**2
        case "ellipsoid":
            return (x / 0.05) ** 2 + (y / 0.03) ** 2 + (z / 0.02) ** 2 <= 1.0
        case "capsule":
            return np.hypot(np.hypot(x, y), np.maximum(np.abs(z) - 0.03, 0.0)) <= 0.02
        case "box":
            return (np.abs(p) <= [[0.05], [0.04], [0.03]]).all(axis=0)
        case "cylinder":
            return (np.hypot(x, y) <= 0.03) & (np.abs(z) <= 0.05)
        case "hull":
            from scipy.spatial import Delaunay

            return Delaunay(SCALENE).find_simplex(p.T) >= 0
    raise AssertionError(name)


# --- support ---


@pytest.mark.parametrize("name", SHARP)
def test_no_point_of_the_solid_lies_farther_and_some_lie_nearly_as_far(name, rng):
    solid, d = SOLIDS[name], directions(rng, 50)
    p = rng.uniform(-1.0, 1.0, (3, SAMPLES)) * solid.extent
    p = p[:, inside(name, p)]
    height, reached = (d * solid.support(d)).sum(axis=0), (d.T @ p).max(axis=1)
    assert np.all(reached <= height + EXACT)
    # in a corner the random points are few: the nearest lies some (V/N)^(1/3) away
    assert np.all(reached >= height - 0.12 * solid.extent)
    assert np.all(inside(name, (1.0 - 1e-9) * solid.support(d)))  # the support belongs to the solid


def test_the_support_is_the_gradient_of_the_height(solid, rng):
    """h(d) = d·s(d) has the gradient s(d): the height is convex, homogeneous, and the support unique almost always."""
    d, step = directions(rng, 30), 1e-7
    for axis in np.eye(3)[:, :, None]:
        above, below = (((d + s * axis) * solid.support(d + s * axis)).sum(axis=0) for s in (step, -step))
        np.testing.assert_allclose((above - below) / (2 * step), (axis * solid.support(d)).sum(axis=0), atol=1e-7)


def test_the_support_is_the_farthest_of_supports(solid, rng):
    """Optimality over the surface itself, which also holds where edges are round."""
    d, surface = directions(rng, 40), solid.support(directions(rng, SURFACE))
    height, reached = (d * solid.support(d)).sum(axis=0), (d.T @ surface).max(axis=1)
    assert np.all(reached <= height + EXACT) and np.all(reached >= height - FINE * solid.extent)


def test_turning_the_body_turns_its_lowest_point(solid, rng):
    turns = Rotation.random(20, rng=rng)
    attitude = turns.as_quat(scalar_first=True).T
    lowest = solid.lowest(attitude)
    body = turns.inv().apply([0.0, 0.0, -1.0]).T
    np.testing.assert_allclose(lowest, turns.apply(solid.support(body).T).T, rtol=0, atol=EXACT)
    np.testing.assert_allclose(solid.lowest(-attitude), lowest, rtol=0, atol=EXACT)  # the same attitude
    # with all turned about an axis, the surface with it, the point turns as well
    whole = Rotation.from_rotvec([0.4, -1.1, 0.7])
    turned = solid.lowest((whole * turns).as_quat(scalar_first=True).T, whole.apply([0.0, 0.0, 1.0])[:, None])
    np.testing.assert_allclose(turned, whole.apply(lowest.T).T, rtol=0, atol=EXACT)


def test_extent_is_the_largest_distance(solid, rng):
    reached = np.linalg.norm(solid.support(directions(rng, SURFACE)), axis=0).max()
    assert reached <= solid.extent + EXACT and reached == pytest.approx(solid.extent, rel=FINE)


def test_a_scaled_solid_is_similar(solid, rng):
    d, larger = directions(rng, 20), solid.scaled(1.3)
    np.testing.assert_allclose(larger.support(d), 1.3 * solid.support(d), rtol=0, atol=EXACT)
    assert larger.moments.volume == pytest.approx(1.3**3 * solid.moments.volume)
    np.testing.assert_allclose(larger.moments.inertia_per_mass, 1.69 * solid.moments.inertia_per_mass, rtol=1e-9)


# --- limits and one solid as another ---


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (Ellipsoid(semi_axes=(0.03, 0.03, 0.03)), SOLIDS["sphere"]),
        (Capsule(radius=0.03, half_length=1e-15), SOLIDS["sphere"]),
        (Box(half_extents=(0.03, 0.03, 0.03), edge_radius=0.03), SOLIDS["sphere"]),
        (Cylinder(radius=0.03, half_length=0.03, edge_radius=0.03), SOLIDS["sphere"]),
        (Cylinder(radius=0.02, half_length=0.05, edge_radius=0.02), SOLIDS["capsule"]),
        (Hull(vertices=tuple(map(tuple, SOLIDS["box"].corners.T))), SOLIDS["box"]),
        (Hull(vertices=tuple(map(tuple, SOLIDS["box"].corners.T)), edge_radius=0.004), SOLIDS["rounded_box"]),
        (Hull(vertices=(*SCALENE, (0.0, 0.0, 0.0), (0.001, 0.0, 0.01))), SOLIDS["hull"]),
        (Hull(vertices=SCALENE, edge_radius=1e-13), SOLIDS["hull"]),
    ],
    ids=lambda solid: solid.kind,
)
def test_limits(one, other, rng):
    # directions along axes and edges as well, where whole edges and faces lie lowest
    d = np.concatenate([directions(rng, 40), np.eye(3), -np.eye(3), [[1.0, 0.0], [-1.0, 1.0], [0.0, 1.0]]], axis=1)
    np.testing.assert_allclose(one.support(d), other.support(d), rtol=0, atol=2e-12)
    assert one.extent == pytest.approx(other.extent, abs=2e-12)


def test_a_prism_in_the_plane_is_its_polygon():
    corners = ((0.05, -0.01), (0.02, 0.03), (-0.01, 0.04), (-0.04, 0.0), (-0.02, -0.03))
    prism = Hull(vertices=tuple((x, side, z) for x, z in corners for side in (-0.02, 0.02)))
    theta = np.linspace(-3.0, 3.0, 37)
    # counter-clockwise in (x, z), seen from −y
    attitude = np.stack([np.cos(theta / 2), 0 * theta, -np.sin(theta / 2), 0 * theta])
    lowest = prism.lowest(attitude)
    np.testing.assert_allclose(lowest[[0, 2]].T, Polygon(vertices=corners).contact_point(theta), rtol=0, atol=EXACT)
    np.testing.assert_allclose(lowest[1], 0.0, atol=EXACT)  # the middle of the edge that lies lowest


@pytest.mark.parametrize("name", ["rounded_box", "rounded_cylinder"])
def test_edge_radius_keeps_the_stated_measures(name):
    rounded, sharp = SOLIDS[name], SOLIDS[name.removeprefix("rounded_")]
    d = np.concatenate([np.eye(3), -np.eye(3)], axis=1)
    for solid in (rounded, sharp):
        measures = (d * solid.support(d)).sum(axis=0)
        expected = (0.05, 0.04, 0.03) if "box" in name else (0.03, 0.03, 0.05)
        np.testing.assert_allclose(measures, expected * 2, rtol=0, atol=EXACT)
    assert rounded.extent < sharp.extent
    assert sharp.rounded(rounded.edge_radius) == rounded and rounded.moments.volume == sharp.moments.volume


def test_rounding_a_hull_moves_in_and_sweeps_out(rng):
    """A ball of the edge radius fits at the support, and the rounded hull touches each face of the sharp one."""
    sharp, rounded, d = SOLIDS["hull"], SOLIDS["rounded_hull"], directions(rng, 300)
    planes = sharp._hull.equations
    centre = rounded.support(d) - 0.002 * d
    gap = -(planes[:, :3] @ centre + planes[:, 3:])  # of the ball's centre from each face
    assert np.all(gap >= 0.002 - EXACT)
    normals = planes[:, :3].T
    np.testing.assert_allclose((normals * rounded.support(normals)).sum(axis=0), -planes[:, 3], rtol=0, atol=1e-13)


def test_many_directions_are_taken_in_blocks(rng, monkeypatch):
    d = directions(rng, 50)
    whole = SOLIDS["hull"].support(d)
    monkeypatch.setattr("thesis_lib.bodies.minkowski.BLOCK", 64)
    np.testing.assert_array_equal(SOLIDS["hull"].support(d), whole)
    assert SOLIDS["hull"].support(np.empty((3, 0))).shape == (3, 0)


def test_points_equally_far_give_their_middle():
    points = np.array([[1.0, -1.0, 0.0], [0.0, 0.0, 0.0], [1.0, 1.0, -1.0]])
    np.testing.assert_allclose(
        farthest(points, np.array([[0.0, 1.0], [0.0, 0.0], [1.0, 0.5]])).T, [[0, 0, 1], [1, 0, 1]]
    )


# --- moments ---


@pytest.mark.parametrize("name", SHARP)
def test_moments_by_sampling(name, rng):
    solid = SOLIDS[name]
    p = rng.uniform(-1.0, 1.0, (3, SAMPLES)) * solid.extent
    within = inside(name, p)
    p, share = p[:, within], within.mean()
    volume, centre, inertia = solid.moments
    sampled = share * (2.0 * solid.extent) ** 3
    assert abs(volume / sampled - 1.0) <= SIGMAS * np.sqrt((1.0 - share) / (share * SAMPLES))
    assert np.all(np.abs(p.mean(axis=1) - centre) <= SIGMAS * p.std(axis=1) / np.sqrt(p.shape[1]))
    x = p - centre[:, None]
    elements = np.einsum("kn,kn->n", x, x) * np.eye(3)[:, :, None] - x[:, None] * x
    error = np.abs(elements.mean(axis=-1) - inertia)
    assert np.all(error <= SIGMAS * elements.std(axis=-1) / np.sqrt(p.shape[1]))


def test_moments_of_a_box_of_triangles_are_those_of_the_box():
    corners = SOLIDS["box"].corners.T + [0.3, -0.2, 0.1]  # away from the origin
    volume, centre, inertia = Hull(vertices=tuple(map(tuple, corners))).moments
    box = SOLIDS["box"].moments
    assert volume == pytest.approx(box.volume, rel=1e-12)
    np.testing.assert_allclose(centre, [0.3, -0.2, 0.1], rtol=1e-12)
    np.testing.assert_allclose(inertia, box.inertia_per_mass, rtol=0, atol=1e-15)


def test_moments_turn_with_the_body():
    turn = Rotation.from_rotvec([0.3, 0.9, -0.5])
    before, after = (Hull(vertices=tuple(map(tuple, p))).moments for p in (SCALENE, turn.apply(SCALENE)))
    R = turn.as_matrix()
    np.testing.assert_allclose(after.centre, R @ before.centre, rtol=0, atol=1e-15)
    np.testing.assert_allclose(after.inertia_per_mass, R @ before.inertia_per_mass @ R.T, rtol=0, atol=1e-17)


def test_triangles_that_enclose_nothing_are_refused():
    triangles = SOLIDS["hull"]._hull.points[SOLIDS["hull"]._hull.simplices]
    flat = triangles * [1.0, 1.0, 0.0]
    with pytest.raises(ValueError, match="enclose no volume"):
        moments_within(flat)


# --- validation ---


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"kind": "sphere", "radius": 0.0}, "greater than 0"),
        ({"kind": "sphere", "radius": 0.1, "edge_radius": 0.01}, "Extra inputs"),
        ({"kind": "ellipsoid", "semi_axes": [0.1, 0.1]}, "Field required"),
        ({"kind": "box", "half_extents": [0.1, 0.1, float("nan")]}, "greater than 0|finite"),
        ({"kind": "box", "half_extents": [0.1, 0.1, 0.02], "edge_radius": 0.021}, "larger than the solid allows"),
        ({"kind": "box", "half_extents": [0.1, 0.1, 0.02], "edge_radius": -0.001}, "greater than or equal to 0"),
        ({"kind": "cylinder", "radius": 0.1, "half_length": 0.02, "edge_radius": 0.05}, "at most 0.02 m"),
        ({"kind": "capsule", "radius": 0.1, "length": 0.02}, "half_length"),
        ({"kind": "cube", "side": 0.1}, "'box', 'sphere', 'ellipsoid', 'cylinder', 'capsule', 'mesh'"),
    ],
)
def test_bad_solids_are_refused(values, message):
    with pytest.raises(ValidationError, match=message):
        TypeAdapter(SolidShape).validate_python(values)


def test_bad_hulls_are_refused():
    flat = tuple((x, y, 0.5 * x) for x, y in ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)))
    for vertices in (flat, tuple((x, y, 0.0) for x, y, _ in flat)):
        with pytest.raises(ValidationError, match="no volume"):
            Hull(vertices=vertices)
    with pytest.raises(ValidationError, match="at least 4"):
        Hull(vertices=SCALENE[:3])
    with pytest.raises(ValidationError, match="larger than the solid allows"):
        Hull(vertices=SCALENE, edge_radius=0.02)
