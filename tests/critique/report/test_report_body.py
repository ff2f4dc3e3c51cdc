"""The body in space on a page: its faces, its hits, and tosses replayed beside what a model predicts."""

import json
import re

import numpy as np
import pytest
from judged_tosses import BOX, judged_tosses
from report_pages import DIAGNOSIS, Page

from thesis_lib.bodies.solids import Box, Capsule, Cylinder, Ellipsoid, Hull, Sphere
from thesis_lib.critique.results.candidates import Choice
from thesis_lib.critique.results.numbers import impact_errors
from thesis_lib.datasets.format.frames import body_states, surface_frames, tracked_states
from thesis_lib.report.critique.body import OFF, axes_of_view, drawn_faces, polyhedron, turnable
from thesis_lib.report.critique.replay import replay, tossed
from thesis_lib.report.critique.tables import evidence_table

HALF = (0.05, 0.04, 0.03)
CORNERS = np.random.default_rng(3).normal(size=(40, 3)).round(3)
SOLIDS = {
    "box": Box(half_extents=HALF, edge_radius=0.002),
    "box about its centre of mass": Box(half_extents=HALF).about(np.array([0.01, 0.0, -0.005])),
    "hull": Hull(vertices=tuple(map(tuple, CORNERS.tolist()))),
    "sphere": Sphere(radius=0.04),
    "ellipsoid": Ellipsoid(semi_axes=HALF),
    "cylinder": Cylinder(radius=0.03, half_length=0.05, edge_radius=0.004),
    "capsule": Capsule(radius=0.03, half_length=0.05),
}
FLAT = {"box", "box about its centre of mass", "hull"}
COARSE = 0.88  # least share of the volume of what is round between points 22.5° and 30° apart
SIZE = 300_000  # bytes of the body and of the tosses on a page


@pytest.fixture(scope="module")
def critique():
    return judged_tosses(BOX)


@pytest.fixture(scope="module")
def body(critique):
    html = turnable(critique)
    return html, data_in(html)


def data_in(html):
    return json.loads(re.search(r'<script type="application/json">(.*?)</script>', html)[1])


@pytest.mark.parametrize("name", SOLIDS)
def test_faces_close_the_solid_and_are_seen_counter_clockwise_from_outside(name):
    """Euler's V − E + F = 2, and the volume by Gauss's theorem over the faces: exact where they are flat."""
    vertices, faces, planes = polyhedron(SOLIDS[name])
    edges = [(a, b) for face in faces for a, b in zip(face, np.roll(face, -1))]
    assert len(edges) == len(set(edges)) and {(b, a) for a, b in edges} == set(edges)
    assert len(vertices) - len(edges) // 2 + len(faces) == 2
    volume = 0.0
    for face, plane in zip(faces, planes):
        r = vertices[face]
        assert np.abs(r @ plane[:3] + plane[3]).max() < 1e-6
        area = 0.5 * np.cross(r, np.roll(r, -1, axis=0)).sum(axis=0)
        assert area @ plane[:3] == pytest.approx(np.linalg.norm(area))
        volume += r[0] @ area / 3.0
    share = volume / SOLIDS[name].moments.volume
    assert share == pytest.approx(1.0) if name in FLAT else COARSE < share < 1.0


def test_a_view_has_right_handed_axes_and_shows_half_of_a_closed_body():
    view = axes_of_view(35.0, 20.0)
    assert np.allclose(np.cross(view[0], view[1]), view[2]) and np.allclose(view @ view.T, np.eye(3))
    assert np.allclose(axes_of_view(0.0, 0.0), [[0, 1, 0], [0, 0, 1], [1, 0, 0]])
    solid = polyhedron(SOLIDS["box"])
    is_front, paths = drawn_faces(solid.vertices @ view[:2].T * [1e3, -1e3], solid.faces)
    assert is_front == (solid.planes[:, :3] @ view[2] > 0.0).tolist()
    assert [path.count("Z") for path in paths.values()] == [3, 3]


@pytest.mark.slow
def test_hits_stand_off_their_contact_points_along_the_normal(critique, body):
    """Where the solid's support says that a plane touches it, and beyond the plane of some face."""
    html, numbers = body
    o, final = critique.observations.single, critique.ladder[-1][1]
    before = final.on(o).at_impulse[0]
    rows = np.argsort(impact_errors(final, o), kind="stable")
    assert len(rows) == html.count("data-hit=")
    down = before.space.turned_back(before.attitude, np.array([[0.0], [0.0], [-1.0]]))
    wanted = o.rig.shape.support(down) + OFF * np.linalg.norm(BOX["half_extents"]) * down
    assert np.allclose(numbers["hits"], wanted[:, rows].T, atol=2e-5)
    assert all(numbers["beyond"])


def test_hits_are_told_with_their_errors(critique, body):
    told = [float(one) for one in re.findall(r"impact \d+: ([\d.]+)\u00a0?\s?m/s</title>", body[0])]
    _, fitted, _ = critique.ladder[-1]
    o = critique.observations.single
    assert sorted(told) == pytest.approx(sorted(o.norm(fitted.on(o).R[:, :6])), rel=0.01)
    of_key = 4
    assert body[0].count('class="held-out" cx') == of_key + np.isin(o.trial, critique.held_out.trial).sum()


def test_the_errors_of_each_rung_or_choice_of_effects_can_be_shown_the_final_model_last(critique, body):
    (_, *base), (name, *final) = critique.ladder
    made = [Choice((name,), *final), Choice((), *base), Choice((name, "angle_offset"), *base)]
    o, of_choices = critique.observations.single, turnable(critique, made)
    order = np.argsort(impact_errors(final[0], o), kind="stable")
    for html, n, texts in ((body[0], 2, ["and wrong size"]), (of_choices, 3, ["and wrong size: ", "wrong size, "])):
        rungs = data_in(html)["rungs"]["errors"]
        assert len(rungs) == html.count("<option") == n and all(text in html for text in texts)
        for errors, fitted in ((rungs[0], base[0]), (rungs[-1], final[0])):
            assert np.allclose(errors, impact_errors(fitted, o)[order], rtol=5e-3)


def test_the_law_of_the_tosses_predicts_them_until_the_next_hit(critique):
    """What is flown after a hit is what was measured there, within what noise makes of the state before it."""
    source, apart, heights = critique.source, [], []
    states = body_states(tracked_states(source.trajectories), source.in_space)
    for trial in np.unique(critique.held_out.trial):
        frames = surface_frames(source.in_space)[0].seen(states.select(states.trial == trial))
        toss = tossed(critique, frames)
        known = np.isfinite(toss.predicted[0])
        assert known.any() and not known[toss.t < toss.hits[0]].any()
        apart.append(np.linalg.norm(toss.measured[:3] - toss.predicted[:3], axis=0)[known])
        heights.append(toss.heights[0])
    assert np.median(np.concatenate(apart)) < 2e-3
    assert np.concatenate(heights).min() > -2e-3  # no body is measured deeper than noise makes it


def test_pages_say_what_is_measured_and_stay_small(critique, body):
    assert len(body[0]) < SIZE
    assert require_as_measured(replay(critique))["elevation"] > 0.0


def test_drops_in_a_plane_are_replayed_from_the_side(hidden_drops):
    numbers = require_as_measured(html := replay(hidden_drops))
    assert "Held-out drops" in html and "squares" not in html and numbers["elevation"] == 0.0
    source, judged = hidden_drops.source, hidden_drops.ladder[-1][2]
    worst = max(np.unique(judged.trial), key=lambda trial: judged.error[judged.trial == trial].mean())
    table, toss = source.trajectories[source.trajectories["trial"] == worst], numbers["tosses"][0]
    pose, k = np.array(toss["measured"]), len(toss["t"])
    assert f"largest error: trial {worst}," in html and k > 20
    assert np.allclose(pose[:, [0, 2]], table[["x", "y"]].to_numpy()[:k] - [0.0, source.height], atol=1e-4)
    # the angle at which the picture holds the body is that of the file, up to whole turns
    angle = 2.0 * np.arctan2(-pose[:, 5], pose[:, 3]) - table["theta"].to_numpy()[:k]
    assert np.abs(np.exp(1j * angle) - 1.0).max() < 1e-3
    predicted = np.array([p for p in toss["predicted"] if p])
    seen = pose[[p is not None for p in toss["predicted"]]]
    assert len(predicted) > 5 and np.median(np.linalg.norm(predicted[:, :3] - seen[:, :3], axis=1)) < 5e-3


def require_as_measured(html):
    """What a page of replayed tosses holds, once its numbers agree with each other; returns them."""
    numbers = data_in(html)
    assert len(html) < SIZE
    for toss in numbers["tosses"]:
        k = len(toss["t"])
        assert all(len(toss[name]) == k for name in ("measured", "predicted", "at")) and np.all(np.diff(toss["t"]) > 0)
        pose = np.array(toss["measured"])
        assert np.allclose(np.linalg.norm(pose[:, 3:], axis=1), 1.0, atol=1e-3)
        # the lowest corner by the numbers of the page
        w, q = pose[:, 3, None, None], pose[:, None, 4:]
        r = np.array(numbers["vertices"])[None]
        once = np.cross(q, r)
        low = (pose[:, None, :3] + r + 2.0 * (w * once + np.cross(q, once)))[..., 2].min(axis=1)
        assert np.allclose(1e3 * low, toss["heights"][0], atol=0.3)
    return numbers


def test_there_is_no_body_in_the_plane_and_no_replay_without_trajectories(hidden_impacts):
    assert turnable(hidden_impacts) == replay(hidden_impacts) == ""


def test_the_evidence_of_each_candidate_is_told_by_channel():
    rejected = {"name": "linear_drag", "rises": {"flight": {"unit": "sigma", "ends": [1.0, 2.0]}}}
    page = Page(evidence_table(DIAGNOSIS | {"rejected": [rejected]}))
    assert "tangential restitutionfalls–found" in page.text
    assert "linear dragdoes not riserisesrejected" in page.text
