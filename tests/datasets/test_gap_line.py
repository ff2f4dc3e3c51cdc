"""The line of the gaps at impact: what a slope, a bend and a wrong height are told as."""

import numpy as np
import pytest

from thesis_lib.bodies.body import Body, Noise
from thesis_lib.bodies.shapes import Ellipse
from thesis_lib.datasets.checks.gap_line import gap_line, sunk
from thesis_lib.datasets.checks.known_body import contradictions
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.impacts.detect import find_impacts
from thesis_lib.simulate.compliant.drops import simulate_compliant_drops
from thesis_lib.simulate.rig.hidden_causes import PROOF_RELEASE, CompliantContact, HiddenCauses

SHAPE = Ellipse(semi_axes=(0.035, 0.025))
BODY = Body(shape=SHAPE, mass=0.0364, radius_of_gyration=0.01924)
N, NOISE = 100, 3e-4  # impacts, m


def poses(angle: float = 0.0, curvature: float = 0.0, height: float = 0.0) -> np.ndarray:
    """Bodies (n, 3) that touch a surface, with noise."""
    rng = np.random.default_rng(4)
    x, theta = rng.uniform(-0.2, 0.2, N), rng.uniform(-np.pi, np.pi, N)
    r = SHAPE.contact_point(theta)
    z = (x + 1j * -r[:, 1]) * np.exp(1j * angle)
    bent = 0.5 * curvature * (x + r[:, 0]) ** 2
    return np.stack([z.real, z.imag + bent + height, theta + angle], axis=1) + NOISE * rng.standard_normal((N, 3))


@pytest.mark.parametrize("angle", [-0.35, -0.026, 0.01, 0.1])
def test_a_slope_is_told_with_its_angle_and_a_surface_that_fits(angle: float) -> None:
    line = gap_line(SHAPE, poses(angle))
    assert line is not None and line.curvature == 0.0
    assert abs(line.angle - angle) < 1e-3
    assert np.abs(line.gap(SHAPE, poses(angle))).max() < 5.0 * NOISE
    assert ("rises" if angle > 0.0 else "falls") in line.said() and "surfaces:" in line.remedy()


@pytest.mark.parametrize("curvature", [-0.1, 0.1])
def test_a_bend_is_told_with_its_radius(curvature: float) -> None:
    line = gap_line(SHAPE, poses(curvature=curvature))
    assert line is not None and line.angle == 0.0
    assert abs(line.curvature / curvature - 1.0) < 0.1
    assert ("hollow" if curvature > 0.0 else "hump") in line.said()
    assert np.abs(line.gap(SHAPE, poses(curvature=curvature))).max() < 5.0 * NOISE


def test_a_level_surface_says_nothing_whatever_its_height() -> None:
    assert gap_line(SHAPE, poses()) is None
    assert gap_line(SHAPE, poses(height=0.01)) is None
    assert gap_line(SHAPE, poses(0.1)[:19]) is None  # too few


def test_a_ramp_is_refused_as_a_ramp_and_a_careless_camera_is_not() -> None:
    (problem,) = contradictions(SHAPE, 0.0, poses(0.35) + [0.0, 0.05, 0.0])
    assert "rises by 20 degrees" in str(problem) and "surfaces: [{name: ramp" in str(problem)
    assert not contradictions(SHAPE, 0.0, poses(0.1) + [0.0, 0.05, 0.0])
    (problem,) = contradictions(SHAPE, 0.0, poses() + [0.0, 0.05, 0.0])
    assert "surface.height" in str(problem)


def test_detection_advises_no_other_height_before_a_slope() -> None:
    contact, hidden = CompliantContact(contact_time=1e-3, steps=40), HiddenCauses(camera_slope=0.026)
    noise, rng = Noise(position=NOISE, angle=3e-3), np.random.default_rng(2)
    drops = simulate_compliant_drops(BODY, PROOF_RELEASE, 30, contact=contact, hidden=hidden, noise=noise, rng=rng)
    said = " ".join(find_impacts(Dataset("slope", drops.header, drops.trajectories)).warnings)
    assert "rises by 1.5 degrees" in said and "would close the gap" not in said


def test_what_a_lens_draws_lower_is_no_depth_and_what_a_soft_contact_sinks_in_is() -> None:
    """Depths that vary along x but not otherwise; and those of the speed, with chance along x."""
    q, rng = poses(), np.random.default_rng(5)
    x = q[:, 0] + SHAPE.contact_point(q[:, 2])[:, 0]
    low = 0.08 * (x + 0.1) ** 2 + 0.2 * (x + 0.1) ** 3
    drawn = q - np.outer(low, [0.0, 1.0, 0.0])
    assert np.abs(sunk(SHAPE, drawn, drawn) - (low - low.min())).max() < 3.0 * NOISE
    # beyond the outermost impacts it goes on level
    far = drawn[[x.argmax()]] + [1.0, 0.0, 0.0]
    assert sunk(SHAPE, drawn, far) == pytest.approx(sunk(SHAPE, drawn, drawn)[x.argmax()])
    soft = q - np.outer(rng.uniform(0.0, 5e-3, N), [0.0, 1.0, 0.0])
    assert not np.any(sunk(SHAPE, soft, soft)) and not np.any(sunk(SHAPE, drawn[:19], drawn))
