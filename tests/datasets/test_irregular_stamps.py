"""Recordings as cameras keep them, with irregular stamps and lost frames: what is used, and whether it is right."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from bouncing import ellipse_header, fly
from rolling import Rig, Rolled, roll

from thesis_lib.bodies.walls import turns
from thesis_lib.datasets.format.samples import ArcSettings, make_samples, noise_from_differences
from thesis_lib.datasets.impacts.detect import FoundImpacts, find_in_arrays
from thesis_lib.datasets.samples.pieces import HITS

PUCK = Rig(rate=118.0)
BALL = Rig(rate=25.0, length=2.84, width=1.42, radius=0.03, friction=0.1, epsilon=0.8, speeds=(0.5, 3.0), noise=1e-3)
RIGS = {"puck at 118 Hz": (PUCK, 200.0), "ball at 25 Hz": (BALL, 600.0), "puck at 25 Hz": (Rig(rate=25.0), 300.0)}
SHARE = 0.8  # of the hits with four samples on each side; one in ten stands in a corner, beside a rest or another hit
FALSE = 0.02  # share of the impacts used that are none; 0 in most runs
# reduced chi² of about 100 velocities of two components: 10 % standard error, and some of the 20 % in the noise squared
CHI2 = (0.6, 1.4)
WILD = 14.0  # chi² with 2 dof that one in a thousand exceeds: arcs with a hit too weak to be seen
FAR = 1.5  # sampling intervals between an impact and the true one
RESTITUTION = 2e-3  # median over 70 impacts of a ratio known to 0.3 %
FRICTION = 0.01  # half of the impacts slide; their ratio is known to 1 % of the normal velocity each


@cache
def searched(name: str) -> tuple[Rolled, FoundImpacts, np.ndarray]:
    """The recording, what was found in it, and the number of the true event (n,) nearest to each impact used."""
    rig, duration = RIGS[name]
    rolled = roll(rig, duration, np.random.default_rng(1))
    q = np.column_stack([rolled.xy, np.zeros(len(rolled.t))])
    found = find_in_arrays(np.zeros(len(q), int), rolled.t, q, rolled.header)
    return rolled, found, np.abs(rolled.hit_t - found.impacts.t[:, None]).argmin(axis=1)


@pytest.mark.parametrize("name", RIGS)
def test_most_hits_of_a_cushion_are_used_and_few_others(name: str) -> None:
    rolled, found, event = searched(name)
    true = np.abs(rolled.hit_t[event] - found.impacts.t) < FAR / RIGS[name][0].rate
    true &= rolled.kind[event] == "wall"
    assert rolled.roomy.sum() > 60
    assert np.isin(np.flatnonzero(rolled.roomy), event[true]).mean() > SHARE
    assert (~true).mean() <= FALSE


@pytest.mark.parametrize("name", RIGS)
def test_velocities_are_right_within_their_covariance(name: str) -> None:
    rolled, found, event = searched(name)
    hits = found.impacts
    R = turns(rolled.header.surfaces, hits.surface)[:, :2, :2]
    assert hits.cov is not None
    for measured, true, of in ((hits.v_pre, rolled.v_pre, slice(3, 5)), (hits.v_post, rolled.v_post, slice(6, 8))):
        off = measured[:, :2] - np.einsum("nij,nj->ni", R, true[event])
        chi2 = np.einsum("ni,nij,nj->n", off, np.linalg.inv(hits.cov[:, of, of]), off)
        assert CHI2[0] < np.median(chi2) / 1.386 < CHI2[1]  # the median of chi² with 2 dof
        assert (chi2 > WILD).mean() <= FALSE


@pytest.mark.parametrize("name", RIGS)
def test_restitution_and_friction_come_out(name: str) -> None:
    rig, hits = RIGS[name][0], searched(name)[1].impacts
    assert np.median(-hits.v_post[:, 1] / hits.v_pre[:, 1]) == pytest.approx(rig.epsilon, abs=RESTITUTION)
    # those that slide have |Δv_t| = μ Δv_n, those that stick have less
    assert np.quantile(np.abs(hits.dv[:, 0]) / hits.dv[:, 1], 0.75) == pytest.approx(rig.mu, abs=FRICTION)


@pytest.mark.parametrize("name", RIGS)
def test_what_hits_no_wall_is_counted_and_spoils_no_neighbour(name: str) -> None:
    rolled, found, _ = searched(name)
    away = found.left_out[found.left_out["reason"] == "off_wall"]
    event = np.abs(rolled.hit_t - away["t"].to_numpy()[:, None]).argmin(axis=1)
    assert not np.isin(np.flatnonzero(rolled.roomy), event).any()
    others = (rolled.kind != "wall") & (rolled.room >= 4).all(axis=1)
    assert np.isin(np.flatnonzero(others), event).mean() > 0.6  # some are weaker than a hit, or beside a cushion
    assert not (found.left_out["reason"] == "lost_frames").any()


def test_a_long_recording_is_cut_into_pieces_between_hits() -> None:
    rolled, found, _ = searched("puck at 118 Hz")
    pieces, count = np.unique(found.impacts.trial, return_counts=True)
    assert len(pieces) >= 10 and (count >= HITS).all() and pieces[0] == 0
    assert found.samples is not None and set(found.samples.trial) == set(pieces)
    assert (np.diff(found.samples.trial) >= 0).all()
    cut = np.flatnonzero(np.diff(found.samples.trial))
    assert all(np.abs(rolled.hit_t - found.samples.t[i]).min() > 2.0 / PUCK.rate for i in cut)
    assert (found.arcs.groupby("trial")["impact"].max() + 1 == found.arcs.groupby("trial").size()).all()
    said = [text for text in found.warnings if "were cut" in text]
    assert len(said) == 1 and f"trial 0 into the pieces 0 to {len(pieces) - 1}" in said[0]


def test_a_body_that_stands_still_has_no_hits() -> None:
    rng = np.random.default_rng(0)
    rolled = searched("ball at 25 Hz")[0]
    q = np.column_stack([[0.3, 0.2] + 1e-3 * rng.standard_normal((len(rolled.t), 2)), np.zeros(len(rolled.t))])
    found = find_in_arrays(np.zeros(len(q), int), rolled.t, q, rolled.header)
    assert len(found.arcs) == 0 and any("No impact was found" in text for text in found.warnings)


def test_glitches_make_neither_hits_nor_flights() -> None:
    rolled, whole, _ = searched("puck at 118 Hz")
    rng = np.random.default_rng(3)
    wrong = rng.random(len(rolled.t)) < 0.01
    xy = rolled.xy + wrong[:, None] * rng.normal(0.0, 0.02, rolled.xy.shape)
    found = find_in_arrays(np.zeros(len(xy), int), rolled.t, np.column_stack([xy, 0.0 * xy[:, 0]]), rolled.header)
    assert len(found.impacts) == pytest.approx(len(whole.impacts), rel=0.1)
    assert len(found.arcs) < 1.3 * len(whole.arcs)
    assert found.noise.position == pytest.approx(PUCK.noise, rel=0.1)
    assert found.noise.stray[:2] == pytest.approx(whole.noise.stray[:2], rel=0.5)


def test_noise_is_found_at_irregular_stamps() -> None:
    rolled = searched("puck at 118 Hz")[0]
    q = np.column_stack([rolled.xy, np.zeros(len(rolled.t))])
    samples = make_samples(np.zeros(len(q), int), rolled.t, q, rolled.header, ArcSettings())
    np.testing.assert_allclose(noise_from_differences(samples)[:2], PUCK.noise, rtol=0.1)


def test_drops_are_used_at_irregular_stamps() -> None:
    """A phone at 120 Hz that loses 3 % of its pictures, their steps jittered by 20 %, cut out of 2 kHz."""
    rng, fine, rate = np.random.default_rng(2), 2000.0, 120.0
    header = ellipse_header(rate=None)
    exact = fly(ellipse_header(rate=fine), rng, 30, samples=2000)
    rows = []
    for trial in np.unique(exact.trial):
        of = np.flatnonzero(exact.trial == trial)
        steps = np.clip(1.0 + 0.2 * rng.standard_normal(int(rate)), 0.2, None) * fine / rate
        at = np.unique(np.rint(np.cumsum(steps)).astype(int)[rng.random(len(steps)) > 0.03])
        rows.append(of[at[at < len(of)]])
    seen = np.concatenate(rows)
    found = find_in_arrays(exact.trial[seen], exact.t[seen], exact.q[seen], header)
    room = replace(exact, trial=exact.trial[seen], t=exact.t[seen]).room()
    event, off = exact.nearest(found.impacts.trial, found.impacts.t)
    assert (off < FAR / rate).all()
    assert np.isin(np.flatnonzero((room >= 4).all(axis=1)), event).mean() > SHARE
    assert found.impacts.cov is not None
    off = found.impacts.v_post - exact.hit_post[event]
    chi2 = np.einsum("ni,nij,nj->n", off, np.linalg.inv(found.impacts.cov[:, 6:, 6:]), off)
    assert CHI2[0] < np.median(chi2) / 2.366 < CHI2[1]  # the median of chi² with 3 dof


def test_a_stated_rate_changes_nothing() -> None:
    rolled, found, _ = searched("puck at 118 Hz")
    q = np.column_stack([rolled.xy, np.zeros(len(rolled.t))])
    again = find_in_arrays(np.zeros(len(q), int), rolled.t, q, rolled.header.model_copy(update={"rate": 118.0}))
    assert len(again.impacts) == pytest.approx(len(found.impacts), abs=1)
