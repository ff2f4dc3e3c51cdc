"""Shapes: the contact point is the lowest point of the outline, whatever the shape and the angle."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import TypeAdapter, ValidationError

from thesis_lib.bodies.shapes import Disk, Ellipse, Polygon, Shape

OUTLINE = 20_001  # points; the gap between a smooth outline and its polygon is (π/OUTLINE)²/2 of the radius
LOWEST = 1e-7  # of the extent: that gap, with room for rounding
EXACT = 1e-12  # of the extent: rounding only
INTEGRATED = 2e-3  # share: error of k from a grid of 500 × 500 cells over the body

SQUARE = Polygon(vertices=((0.03, 0.03), (-0.03, 0.03), (-0.03, -0.03), (0.03, -0.03)))
SKEWED = Polygon(vertices=((0.05, -0.01), (0.02, 0.03), (-0.01, 0.04), (-0.04, 0.0), (-0.02, -0.03)))
SHAPES = {
    "ellipse": Ellipse(semi_axes=(0.035, 0.025)),
    "upright_ellipse": Ellipse(semi_axes=(0.01, 0.04)),
    "disk": Disk(radius=0.03),
    "square": SQUARE,
    "skewed": SKEWED,
}
THETA = np.concatenate([np.linspace(-7.0, 7.0, 57), np.arange(-4, 5) * np.pi / 4])


@pytest.fixture(params=SHAPES, ids=list(SHAPES))
def shape(request):
    return SHAPES[request.param]


def turned(points: np.ndarray, theta: np.ndarray) -> np.ndarray:
    """Points (p, 2) of the body frame in the surface frame at each angle: (n, p, 2)."""
    cos, sin = np.cos(theta)[:, None], np.sin(theta)[:, None]
    return np.stack([cos * points[:, 0] - sin * points[:, 1], sin * points[:, 0] + cos * points[:, 1]], -1)


def test_contact_point_is_the_lowest_of_the_outline(shape):
    outline = turned(shape.outline(OUTLINE), THETA)
    r = shape.contact_point(THETA)
    assert r.shape == (len(THETA), 2)
    np.testing.assert_allclose(r[:, 1], outline[..., 1].min(axis=1), rtol=0, atol=LOWEST * shape.extent)
    distance = np.linalg.norm(outline - r[:, None, :], axis=-1).min(axis=1)
    spacing = 2 * np.pi / OUTLINE  # of the extent; a polygon's contact is a vertex, which the outline has
    assert np.all(distance <= spacing * shape.extent)


def test_gap_is_the_height_of_the_lowest_point(shape):
    y = np.linspace(-0.1, 0.3, len(THETA))
    lowest = y + turned(shape.outline(OUTLINE), THETA)[..., 1].min(axis=1)
    np.testing.assert_allclose(shape.gap(y, THETA, 0.02), lowest - 0.02, atol=LOWEST * shape.extent)
    np.testing.assert_allclose(shape.gap(-shape.contact_point(THETA)[:, 1], THETA), 0.0, atol=1e-17)


def test_derivative_of_the_support_height_is_the_lever(shape):
    """dr_y/dθ = r_x wherever the contact point is unique: what makes J_n = [0, 1, r_x] the gradient of the gap."""
    theta, step = np.linspace(0.05, 6.2, 40), 1e-6
    slope = (shape.gap(0.0, theta + step) - shape.gap(0.0, theta - step)) / (2 * step)
    np.testing.assert_allclose(slope, shape.contact_point(theta)[:, 0], atol=1e-7)


def test_ellipse_is_the_limit_of_polygons():
    ellipse = SHAPES["ellipse"]
    polygon = Polygon(vertices=tuple(map(tuple, ellipse.outline(1001)[:-1])))
    theta = np.linspace(-4.0, 4.0, 101)
    spacing = 2 * np.pi / 1000
    lower = polygon.contact_point(theta)[:, 1] - ellipse.contact_point(theta)[:, 1]
    assert np.all(lower >= -EXACT) and np.all(lower <= 0.5 * spacing**2 * ellipse.extent)
    away = np.linalg.norm(polygon.contact_point(theta) - ellipse.contact_point(theta), axis=1)
    assert away.max() <= spacing * ellipse.extent
    assert polygon.radius_of_gyration == pytest.approx(ellipse.radius_of_gyration, rel=spacing**2)


def test_circle_is_an_ellipse_with_equal_axes():
    circle = Ellipse(semi_axes=(0.03, 0.03))
    np.testing.assert_allclose(circle.contact_point(THETA), SHAPES["disk"].contact_point(THETA), atol=1e-15)
    assert circle.radius_of_gyration == pytest.approx(SHAPES["disk"].radius_of_gyration)


def test_polygon_does_not_depend_on_order_or_first_vertex():
    vertices = SKEWED.vertices
    for other in (vertices[::-1], vertices[2:] + vertices[:2]):
        again = Polygon(vertices=other)
        np.testing.assert_array_equal(again.contact_point(THETA), SKEWED.contact_point(THETA))
        assert again.radius_of_gyration == pytest.approx(SKEWED.radius_of_gyration, rel=EXACT)


def test_only_the_hull_of_a_polygon_touches():
    dented = Polygon(vertices=(*SQUARE.vertices[:3], (0.0, -0.01), SQUARE.vertices[3]))
    np.testing.assert_array_equal(dented.contact_point(THETA)[:, 1], SQUARE.contact_point(THETA)[:, 1])


def test_radius_of_gyration_by_numerical_integration(shape):
    """k² = ∫ |p − p̄|² dA / A over the inside of the outline."""
    from matplotlib.path import Path

    outline = shape.outline(361)
    side = np.linspace(-1.0, 1.0, 501)[:-1] + 2e-3
    x, y = (shape.extent * axis.ravel() for axis in np.meshgrid(side, side))
    inside = Path(outline).contains_points(np.stack([x, y], axis=1))
    k = np.sqrt(x[inside].var() + y[inside].var())
    assert shape.radius_of_gyration == pytest.approx(k, rel=INTEGRATED)


def test_extent(shape):
    farthest = {"ellipse": 0.035, "upright_ellipse": 0.04, "disk": 0.03, "square": 0.03 * np.sqrt(2)}
    expected = {id(SHAPES[name]): value for name, value in farthest.items()}.get(id(shape), np.hypot(0.05, 0.01))
    # an outline of 180 points misses the far end of an ellipse by up to (π/180)²/2 of it
    assert shape.extent == pytest.approx(expected, rel=2e-4)


@settings(max_examples=50, deadline=None)
@given(st.lists(st.tuples(*[st.floats(-1.0, 1.0, width=32)] * 2), min_size=3, max_size=8), st.floats(-10.0, 10.0))
def test_no_vertex_is_below_the_contact_point(vertices, theta):
    try:
        polygon = Polygon(vertices=tuple(vertices))
    except ValidationError:
        return  # without area
    heights = turned(np.array(vertices), np.array([theta]))[0, :, 1]
    assert polygon.contact_point(np.array(theta))[1] <= heights.min() + EXACT


class TestValidation:
    @pytest.mark.parametrize(
        ("values", "message"),
        [
            ({"kind": "ellipse", "semi_axes": [0.03, -0.02]}, "greater than 0"),
            ({"kind": "ellipse", "semi_axes": [0.03, 0.0]}, "greater than 0"),
            ({"kind": "ellipse", "semi_axes": [0.03]}, "Field required"),
            ({"kind": "ellipse", "semi_axes": [0.03, float("inf")]}, "finite"),
            ({"kind": "ellipse", "semi_axes": [0.03, 0.02], "angle": 0}, "Extra inputs"),
            ({"kind": "disk", "radius": -1.0}, "greater than 0"),
            ({"kind": "disk", "radius": float("nan")}, "greater than 0|finite"),
            ({"kind": "disk"}, "Field required"),
            ({"kind": "polygon", "vertices": [[0, 0], [1, 0]]}, "at least 3"),
            ({"kind": "polygon", "vertices": [[0, 0], [1, 1], [2, 2]]}, "no area"),
            ({"kind": "polygon", "vertices": [[0, 0], [1, 1], [1, 0], [0, 1]]}, "cross each other"),
            ({"kind": "polygon", "vertices": [[0, 0], [1, float("nan")], [0, 1]]}, "finite"),
            ({"kind": "triangle", "vertices": [[0, 0], [1, 0], [0, 1]]}, "'ellipse', 'disk', 'polygon'"),
            ({"radius": 0.03}, "kind|discriminator"),
        ],
    )
    def test_bad_shapes_are_refused(self, values, message):
        with pytest.raises(ValidationError, match=message):
            TypeAdapter(Shape).validate_python(values)

    def test_shapes_are_read_by_kind_and_cannot_be_changed(self):
        shape = TypeAdapter(Shape).validate_python({"kind": "disk", "radius": 0.03})
        assert shape == Disk(radius=0.03)
        with pytest.raises(ValidationError, match="frozen"):
            shape.radius = 0.04
