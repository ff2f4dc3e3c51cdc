"""Episodes in space: the plane is a case, what a model draws fits it, and a box in our own simulator is explained."""

from dataclasses import replace

import numpy as np
import pytest

from thesis_lib.bodies.shapes import Polygon
from thesis_lib.bodies.solids import Box, Hull
from thesis_lib.critique.contacts import episodes
from thesis_lib.critique.contacts.bases import BASES
from thesis_lib.critique.contacts.episodes import MOST_HITS, Played
from thesis_lib.critique.contacts.kinds import bind
from thesis_lib.critique.contacts.model import Model
from thesis_lib.critique.drops.world import Drops
from thesis_lib.critique.likelihood import comparison, whitening
from thesis_lib.critique.likelihood.comparison import Comparison
from thesis_lib.critique.likelihood.fit import fit
from thesis_lib.critique.likelihood.in_space.hits import HARD, hard_hits, observe_in_space
from thesis_lib.critique.likelihood.synthesis import synthesise
from thesis_lib.effects import EFFECTS
from thesis_lib.effects.effect import Rig
from thesis_lib.foundation import forked
from thesis_lib.foundation.forked import sharing
from thesis_lib.mechanics.space import SPACE, of_rotation_vector
from thesis_lib.mechanics.state import State
from thesis_lib.simulate.tosses.example import CONTACT_TIME, simulate_tosses

BELIEVED = {"mu": 0.25, "epsilon": 0.5, "tau": 5e-4, "damping_ratio": 1.0, "impedance": 0.9}
VALUES = {"mu": 0.25, "epsilon": 0.5, "tau": 5e-4}
K_G = 0.03
SECTION = Polygon(vertices=((0.05, 0.03), (-0.05, 0.03), (-0.05, -0.03), (0.05, -0.03)))
# that rectangle in the plane x, z, and two corners beside it that do not touch there
FLAT = Hull(
    vertices=(
        (0.05, 0.0, 0.03),
        (0.05, 0.0, -0.03),
        (-0.05, 0.0, 0.03),
        (-0.05, 0.0, -0.03),
        (0.0, 0.02, 0.0),
        (0.0, -0.02, 0.0),
    )
)
SPAN = 0.015  # s
SAME = 1e-6  # m/s and k rad/s: flights in space are integrated


@pytest.mark.parametrize("law", ["mirtich", "compliant_contact"])
def test_episodes_in_a_plane_of_space_are_those_of_the_plane(law):
    rng, n = np.random.default_rng(2), 60
    theta = 0.5 * np.pi * rng.integers(0, 4, n) + rng.uniform(-0.2, 0.2, n)
    y = -SECTION.contact_point(theta)[:, 1]
    v = rng.uniform(-1, 1, n), -rng.uniform(1, 2.5, n), 6.0 * rng.standard_normal(n)
    flat = State.planar(np.zeros(n), y, theta, *v, np.arange(n), np.zeros(n))
    plane = bind(Model(BASES[law], takes_time=True), VALUES, Rig(SECTION, K_G, 9.81, 0.0))
    tensor = np.diag([6e-4, K_G**2, 1.1e-3])
    space = bind(Model(BASES[law], takes_time=True, space=SPACE), VALUES, Rig(FLAT, K_G, 9.81, 0.0, tensor=tensor))
    none, span = np.zeros(n), np.full(n, SPAN)
    pose = np.concatenate([np.stack([flat.x, none, flat.y]), of_rotation_vector(np.stack([none, -flat.theta, none]))])
    motion = np.stack([flat.vx, none, flat.vy, none, -flat.omega, none])
    expected = Played(plane, flat, span)
    found = Played(space, State(pose, motion, flat.trial, flat.t, None, SPACE), span)
    assert (expected.hits >= 2).mean() > 0.3 and expected.hits.max() < MOST_HITS
    np.testing.assert_array_equal(found.hits, expected.hits)
    after = found.after.motion
    off = np.stack(
        [after[0] - expected.after.vx, after[2] - expected.after.vy, K_G * (after[4] + expected.after.omega)]
    )
    # a corner may touch, or be caught in another's contact, by a hair; where it touches within a step of another one it
    # presses from the next step on in the plane, and from there on in space
    off = np.abs(off).max(axis=0)
    assert (off < SAME).mean() > 0.8 and np.quantile(off, 0.95) < 0.01
    np.testing.assert_allclose(after[[1, 3, 5]], 0.0, atol=1e-9)


def test_rounded_corners_act_on_every_corner_that_presses():
    rng, n, rho = np.random.default_rng(3), 60, 3e-3
    sharp = Box(half_extents=(0.05, 0.04, 0.03))
    tensor = sharp.moments.inertia_per_mass
    attitude = of_rotation_vector(2.0 * rng.standard_normal((3, n)))
    v = np.concatenate([rng.uniform(-1, 1, (2, n)), rng.uniform(-2.5, -1.5, (1, n)), 5.0 * rng.standard_normal((3, n))])
    round_box = sharp.rounded(rho)
    pose = np.concatenate([np.zeros((2, n)), -round_box.lowest(attitude)[2:], attitude])
    states, span = State(pose, v, np.arange(n), np.zeros(n), None, SPACE), np.full(n, 4e-3)

    def played(solid, effects, values):
        model = Model(BASES["compliant_contact"], effects, takes_time=True, space=SPACE)
        rig = Rig(solid, K_G, 9.81, 0.0, tensor=tensor)
        return Played(bind(model, VALUES | values, rig), states, span).after.motion

    expected, believed = played(round_box, (), {}), played(sharp, (), {})
    found = played(sharp, (EFFECTS["rounded_corners"],), {"rounded_corners.rho": rho})
    scale = np.repeat([1.0, K_G], 3)[:, None]
    # as an effect the round corner does not roll on while it presses
    assert np.median(np.abs(found - expected) * scale) < 0.1 * np.median(np.abs(believed - expected) * scale)


@pytest.fixture(scope="module")
def tossed():
    return observe_in_space(simulate_tosses("tosses", "box", "nothing", drops=25, seed=1))


@pytest.mark.slow
def test_most_hits_of_a_box_are_used_and_those_in_episodes_count(tossed):
    hits = hard_hits(tossed)
    share = (hits["row"] >= 0).groupby(hits["kind"]).mean()
    assert share["corner"] > 0.95 and share["edge"] > 0.8 and share["face"] > 0.6
    played = hits[(hits["row"] >= 0) & (tossed.span[hits["row"]] > 0.0)]  # others are measured by their own windows
    assert not (played.merge(tossed.found.contacts)["jump"] <= HARD).any()
    assert len(hits) < len(tossed.found.contacts)  # what rattles at last is too weak
    # each observation holds its hits, and a hit is used if its observation is there
    first = hits[hits["row"] >= 0]
    assert (first["impact"] - tossed.impact[first["row"]]).between(0, tossed.hits[first["row"]] - 1).all()
    assert (first["impact"] > tossed.impact[first["row"]]).any()
    fewer = hard_hits(tossed.rows(np.flatnonzero(tossed.hits == 1)))
    lost = tossed.hits[first["row"]] > 1
    assert (fewer["row"] >= 0).sum() == (~lost).sum() and lost.any()


def test_of_a_body_too_high_to_touch_the_gap_is_compared(tossed):
    """Without a contact the pose after impact is that before, and only the gap says that a hit was seen there."""
    single = tossed.single
    high = single.value.copy()
    high[:, :, 2] += 0.02 * (np.arange(len(single)) % 2)[:, None]
    slow = single.slope.copy()
    slow[:, 0, 2:] = [-0.1, 0.0, 0.0, 0.0]
    raised = replace(single, value=high, slope=slow)
    seen = Comparison(Model(BASES["convex_contact"], takes_time=True, space=SPACE), BELIEVED, raised)
    up = seen.dynamics.gap(seen.before) > 0.01
    assert up.sum() > 10
    np.testing.assert_allclose(seen.R[up, -1], seen.dynamics.gap(seen.before.select(np.flatnonzero(up))))
    assert np.linalg.eigvalsh(seen.covariance()[up])[:, 0].min() > 1e-12


def test_hits_and_episodes_drawn_from_a_model_differ_from_it_by_their_noise(tossed):
    model, rng = Model(BASES["compliant_contact"], takes_time=True, space=SPACE), np.random.default_rng(0)
    drawn = synthesise(Comparison(model, VALUES, tossed), rng)
    noisy = Comparison(model, VALUES, drawn).noisy
    of_episodes = drawn.span > 0.0
    assert of_episodes.sum() > 15
    squares = np.einsum("ni,nij,nj->n", noisy.value, np.linalg.inv(noisy.covariance()), noisy.value)
    # chi square with 12 degrees of freedom: 11.3; a minority lands on the other side of a branch
    assert 9.0 < np.median(squares[of_episodes]) < 14.5 and 9.0 < np.median(squares[~of_episodes]) < 15.5


@pytest.mark.parametrize("size", [0.0, 0.05])
def test_no_hit_is_of_a_point_above_the_surface(tossed, monkeypatch, size):
    """Also where the body is believed too large, so that corners are below it from the start and rise."""
    model = Model(BASES["mirtich"], (EFFECTS["wrong_size"],), takes_time=True, space=SPACE)
    gaps, hit = [], Played._hit

    def noted(self, rows):
        gap, v_n = self._gaps(self._state(rows), rows)
        gaps.extend(np.where(v_n < 0.0, gap, np.inf).min(axis=0))
        hit(self, rows)

    monkeypatch.setattr(Played, "_hit", noted)
    for step in (1e-3, 2e-4):
        monkeypatch.setattr(episodes, "STEP", step)
        assert np.isfinite(Comparison(model, VALUES | {"wrong_size.s": size}, tossed).R).all()
    assert len(gaps) > 100 and max(gaps) < 1e-6


def test_predictions_and_covariances_that_processes_share_are_equal(tossed, monkeypatch):
    monkeypatch.setattr(whitening, "SHARED", 100)
    monkeypatch.setattr(comparison, "SHARED", 400)
    monkeypatch.setattr(forked, "WORTH", 0.0)
    model = Model(BASES["compliant_contact"], takes_time=True, space=SPACE)
    points = [VALUES | {"mu": mu} for mu in (0.2, 0.22, 0.3)]

    def results(jobs: int) -> tuple:
        fresh = replace(tossed)  # keeps no residuals
        with sharing(jobs):
            here = whitening.Whitening.at(model, points[0], fresh)
            return here.S, *(part for z in here.many(points) for part in z)

    one, two = results(1), results(2)
    for array, other in zip(one, two, strict=True):
        np.testing.assert_array_equal(array, other)
    monkeypatch.undo()
    for array, whole in zip(one, results(1), strict=True):
        np.testing.assert_allclose(array, whole, rtol=1e-6, atol=1e-6)


@pytest.mark.slow
def test_an_integrated_contact_explains_a_box_of_our_own_simulator_that_no_impulse_does(tossed):
    world = Drops(tossed.counted_from(tossed.middle))
    assert "compliant_contact" in world.reserve and "pressure_field_contact" not in world.reserve
    rigid = fit(world.model("mirtich"), world.observations, rounds=1)
    model = world.model("damped_contact")  # the forces of that simulator
    limit = fit(model.limit, world.quick, rigid.values, rounds=1)
    found = fit(model, world.observations, limit.values)
    assert found.score > rigid.score + 300.0
    assert found.values["mu"] == pytest.approx(0.25, abs=5e-3)
    assert found.values["epsilon"] == pytest.approx(0.5, abs=0.01)
    assert found.values["tau"] == pytest.approx(CONTACT_TIME / model.law.force.lasting(0.5), rel=0.1)
    noisy = found.on(world.observations).noisy
    squares = np.einsum("ni,nij,nj->n", noisy.value, np.linalg.inv(noisy.covariance()), noisy.value)
    assert np.median(squares) < 20.0  # 13 components
