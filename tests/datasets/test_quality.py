"""Quality tests: contact-space measures against known numbers; every flag and every reason."""

import numpy as np
import pandas as pd
import pytest
from bouncing import bounce

from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.header import Header
from thesis_lib.datasets.format.impacts import Impacts
from thesis_lib.datasets.format.samples import ArcSettings
from thesis_lib.datasets.impacts.detect import find_impacts, find_in_arrays
from thesis_lib.datasets.impacts.quality import contact_measures, flag_physics, has_flag, thesis_filter
from thesis_lib.simulate.compliant.drops import simulate_compliant_drops
from thesis_lib.simulate.rig.hidden_causes import ELLIPSE_BODY, PROOF_RELEASE, RIG_NOISE, SQUARE, CompliantContact

RADIUS = 0.03
ROUNDING = 1e-9  # a dozen operations in double precision, with some cancellation
SIX_DIGITS = 1e-6  # the known numbers are given with six or more digits


def impacts_of(v_pre: list, v_post: list, r: list, k2: float, mass: float = 1.0) -> Impacts:
    v_pre, v_post, r = (np.atleast_2d(np.asarray(a, float)) for a in (v_pre, v_post, r))
    n = len(v_pre)
    return Impacts(np.arange(n), np.zeros(n, int), np.zeros((n, 3)), v_pre, v_post, r, np.sqrt(k2), mass)


def test_impulse_and_energy_ratio_of_the_kane_paradox():
    # uniform rod of length 1 at 45 degrees, v_C = (0.6, -1), eps = 0.9, stick: P = (0.3375, 0.9625),
    # alpha = 0.81/0.64 (Kane's energy paradox; K = [[2.5, -1.5], [-1.5, 2.5]])
    r = np.array([[-np.sqrt(0.125), -np.sqrt(0.125)]])
    v_pre = np.array([[0.6, -1.0, 0.0]])
    v_post = bounce(v_pre, r, 1 / 12, np.array([0.9]), np.array([0.0]))
    c = contact_measures(impacts_of(v_pre, v_post, r, 1 / 12))
    np.testing.assert_allclose(c.impulse, [[0.3375, 0.9625]], atol=SIX_DIGITS)
    np.testing.assert_allclose(c.alpha, [1.265625], atol=SIX_DIGITS)
    np.testing.assert_allclose(c.v_c_post, [[0.0, 0.9]], atol=SIX_DIGITS)
    assert flag_physics(impacts_of(v_pre, v_post, r, 1 / 12)).flags[0] == "energy;cone"


def test_contact_measures_are_those_of_the_matrices():
    """Written out with J and M for each impact: M_C = (J M⁻¹ Jᵀ)⁻¹, P = M_C J Δv, α from v_Cᵀ M_C v_C."""
    rng = np.random.default_rng(3)
    r, pre, post = rng.normal(0, 0.03, (20, 2)), rng.normal(0, 2, (20, 3)), rng.normal(0, 2, (20, 3))
    k2, mass = 4e-4, 0.05
    c = contact_measures(impacts_of(pre, post, r, k2, mass))
    for i in range(len(r)):
        jacobian = np.array([[1.0, 0.0, -r[i, 1]], [0.0, 1.0, r[i, 0]]])
        m_c = np.linalg.inv(jacobian @ np.diag([1 / mass, 1 / mass, 1 / mass / k2]) @ jacobian.T)
        before, after = jacobian @ pre[i], jacobian @ post[i]
        np.testing.assert_allclose(c.v_c_pre[i], before, rtol=ROUNDING)
        np.testing.assert_allclose(c.v_c_post[i], after, rtol=ROUNDING, atol=ROUNDING)
        np.testing.assert_allclose(c.impulse[i], m_c @ (after - before), rtol=ROUNDING, atol=ROUNDING)
        np.testing.assert_allclose(c.alpha[i], (after @ m_c @ after) / (before @ m_c @ before), rtol=ROUNDING)


def test_a_contact_that_did_not_move_before_gains_energy():
    impacts = impacts_of([0.0, 0.0, 0.0], [0.1, 0.2, 0.0], [0.0, -RADIUS], 4e-4)
    assert contact_measures(impacts).alpha[0] == np.inf
    assert has_flag(flag_physics(impacts), "energy")[0]


def test_flags_and_thesis_filter():
    pre = [[0.1, -2.0, 0.0]] * 4
    post = [[0.1, 1.0, 0.0], [0.1, 2.5, 0.0], [-4.5, 1.0, 0.0], [0.1, -0.5, 0.0]]
    impacts = flag_physics(impacts_of(pre, post, [[0.0, -RADIUS]] * 4, 4.5e-4, mass=0.05))
    assert list(impacts.flags) == ["", "energy", "energy;cone", "compression"]
    np.testing.assert_array_equal(thesis_filter(impacts), [True, False, False, False])
    np.testing.assert_array_equal(has_flag(impacts, "cone"), [False, False, True, False])
    # flags from elsewhere stay, and stay single
    assert list(flag_physics(impacts).flags) == list(impacts.flags)


def test_perfectly_elastic_frictionless_impact_is_not_flagged():
    rng = np.random.default_rng(0)
    n = 200
    r = np.c_[rng.uniform(-0.01, 0.01, n), rng.uniform(-0.035, -0.025, n)]
    pre = np.c_[np.zeros(n), rng.uniform(-3, -1, n), np.zeros(n)]
    knn = 1 + r[:, 0] ** 2 / 3.7e-4
    impulse = -2 * pre[:, 1] / knn  # eps = 1, mu = 0: alpha = 1 exactly
    post = pre + np.c_[np.zeros(n), impulse, r[:, 0] * impulse / 3.7e-4]
    assert (flag_physics(impacts_of(pre, post, r, 3.7e-4)).flags == "").all()


def flight(hits: list[tuple[float, tuple]]) -> tuple:
    """A disk that touches down at 0.2 s with (0.3, -2, 4) and changes velocity by dv at each (t, dv)."""
    t = np.arange(0, 0.5, 0.004)
    dt = t - 0.2
    v = np.array([0.3, -2.0, 4.0])
    q = np.array([0, RADIUS, 0]) + v * dt[:, None] - [0, 4.905, 0] * dt[:, None] ** 2
    for when, dv in hits:
        q += np.array(dv) * np.maximum(t - when, 0)[:, None]
    noise = np.random.default_rng(0).normal(size=q.shape) * [3e-4, 3e-4, 3e-3]
    return t, q + noise


def assess(t: np.ndarray, q: np.ndarray, **settings: object) -> tuple[Impacts, pd.DataFrame]:
    body = {"shape": {"kind": "disk", "radius": RADIUS}, "radius_of_gyration": RADIUS / np.sqrt(2)}
    header = {"schema": 1, "body": body, "rate": 250.0, "noise": {"position": 3e-4, "angle": 3e-3}}
    found = find_in_arrays(np.zeros(len(t), int), t, q, Header.model_validate(header), ArcSettings(**settings))
    return found.impacts, found.left_out


SIGMAS = 4.0  # 1 of 16,000 components of a velocity is further off by chance
HIT = (0.2003, (-0.2, 3.4, -8.0))


def test_a_clean_hit_is_used():
    impacts, left_out = assess(*flight([HIT]))
    assert len(impacts) == 1 and left_out.empty
    assert impacts.t[0] == pytest.approx(HIT[0], abs=5e-4)
    np.testing.assert_allclose(impacts.dv[0], HIT[1], atol=0.15)


@pytest.mark.parametrize("apart", [0.002, 0.004, 0.006, 0.008, 0.012, 0.016])
@pytest.mark.parametrize("offset", [0.0, 0.001, 0.002, 0.003])
def test_second_hit_within_the_window_is_left_out(apart: float, offset: float):
    """Two corners one after the other: spin reverses between them.  2 ms is half a frame."""
    hits = [(0.2 + offset, (-0.2, 2.0, 40.0)), (0.2 + offset + apart, (0.1, 1.6, -60.0))]
    impacts, left_out = assess(*flight(hits))
    assert len(impacts) == 0
    assert set(left_out["reason"]) == {"second_hit"}


def test_hits_six_frames_apart_are_both_used():
    impacts, _ = assess(*flight([(0.201, (-0.2, 1.6, 30.0)), (0.225, (0.1, 1.6, -40.0))]))
    np.testing.assert_allclose(impacts.t, [0.201, 0.225], atol=1e-3)


@pytest.mark.parametrize("lost", [[49, 50], [50, 51, 52], [46, 47], [53, 54], [35, 36, 65], [47, 49, 51, 53]])
def test_frames_lost_beside_an_impact_do_not_discard_it(lost: list[int]):
    t, q = flight([HIT])
    impacts, left_out = assess(np.delete(t, lost), np.delete(q, lost, axis=0))
    assert len(impacts) == 1 and left_out.empty
    assert impacts.cov is not None
    off = (impacts.dv[0] - HIT[1]) / np.sqrt(np.diagonal(impacts.cov[0])[3:6] + np.diagonal(impacts.cov[0])[6:9])
    assert np.abs(off).max() < SIGMAS


def test_an_impact_in_a_long_gap_is_left_out():
    t, q = flight([HIT])
    lost = np.arange(46, 55)
    impacts, left_out = assess(np.delete(t, lost), np.delete(q, lost, axis=0))
    assert len(impacts) == 0 and list(left_out["reason"]) == ["lost_frames"]


def test_window_too_short_at_either_end_of_the_record():
    t, q = flight([HIT])
    for keep in (slice(47, None), slice(None, 54)):
        impacts, left_out = assess(t[keep], q[keep])
        assert len(impacts) == 0 and list(left_out["reason"]) == ["window_too_short"]


def test_held_body_is_not_ballistic():
    t, q = flight([HIT])
    held = t > HIT[0]
    q[held, 1] += 6.0 * (t[held] - HIT[0]) ** 2  # 12 m/s² upwards
    impacts, left_out = assess(t, q)
    assert len(impacts) == 0 and "not_ballistic" in set(left_out["reason"])


def test_kick_away_from_the_surface_is_no_approach():
    # the disk moves up at 1 m/s when something gives it another 1 m/s
    t, q = flight([(0.2, (0.0, 1.0, 0.0))])
    q[:, 1] += 3.0 * (t - 0.2)
    impacts, left_out = assess(t, q)
    assert len(impacts) == 0 and list(left_out["reason"]) == ["no_approach"]


def test_hit_above_the_surface_is_flagged():
    t, q = flight([HIT])
    q[:, 1] += 0.05
    impacts, _ = assess(t, q)
    assert len(impacts) == 1 and "no_touch" in impacts.flags[0]


def test_moderate_deviation_from_the_parabola_is_flagged():
    t, q = flight([HIT])
    q[:, 1] += 9e-4 * np.sin(2 * np.pi * t / 0.05)  # wobble of thrice the noise: no shorter arc is straight
    impacts, _ = assess(t, q, min_window=20)
    assert len(impacts) == 1 and "arc_deviation" in impacts.flags[0]


@pytest.mark.parametrize("body", [ELLIPSE_BODY, SQUARE], ids=["ellipse", "square"])
@pytest.mark.parametrize(("contact_time", "height", "off"), [(4e-3, 0.0, False), (1e-4, 0.005, True)])
def test_a_body_that_sinks_in_is_not_off_the_surface(body, contact_time, height, off):
    """Long contacts meet up to 5 mm below the surface; a surface believed too high is told as before."""
    contact, rng = CompliantContact(contact_time=contact_time, steps=50), np.random.default_rng(2)
    made = simulate_compliant_drops(body, PROOF_RELEASE, 30, contact=contact, noise=RIG_NOISE, rng=rng)
    header = made.header.model_copy(update={"surface": made.header.surface.model_copy(update={"height": height})})
    found = find_impacts(Dataset("drops", header, made.trajectories))
    share = np.mean(["no_touch" in flags for flags in found.impacts.flags])
    assert share > 0.9 if off else share < 0.1
    assert any("off the surface" in text for text in found.warnings) == off
    if not off:
        assert (found.used_arcs["gap"] < -4e-3).sum() >= 5  # it did sink in
