"""Hits found in the trajectories of a tossed box are those that were, within their covariance."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt
from scipy.spatial.transform import Rotation
from tosses import simulate_tosses

from thesis_lib.bodies.solids import Box, Sphere, contact_kind
from thesis_lib.critique.likelihood.in_space import episodes
from thesis_lib.critique.likelihood.in_space.hits import beside, jump, observe_in_space
from thesis_lib.critique.likelihood.in_space.left_out import has_another_hit, hops_unseen, off_free_motion
from thesis_lib.datasets import dataset_of
from thesis_lib.datasets.checks.jumps import out_and_back
from thesis_lib.datasets.flights.beside_hits import fit_windows
from thesis_lib.datasets.flights.rounding import contact_guard
from thesis_lib.datasets.format.frames import surface_frames
from thesis_lib.datasets.format.samples import ArcSettings
from thesis_lib.datasets.format.table_forms import POSE_IN_SPACE, QUATERNION, V_POST_IN_SPACE, V_PRE_IN_SPACE
from thesis_lib.foundation.errors import UserError
from thesis_lib.mechanics.space import SPACE, of_rotation_vector
from thesis_lib.mechanics.state import State

BODY = {"shape": {"kind": "box", "half_extents": [0.05, 0.04, 0.03]}, "mass": 0.25, "homogeneous": True}
_HITS_TWICE = episodes._hits_twice
ALONE = 5e-3  # s to the next hit: two hits between two frames are seen as one
TURN = Rotation.from_rotvec([0.4, -1.0, 0.7])
SEEN = {  # tracked frame and camera's axes
    "tracked at the centre, z up": {},
    "tracked elsewhere, in a camera's axes": {
        "tracked": {"position": [0.02, -0.01, 0.03], "quaternion": TURN.as_quat(scalar_first=True).tolist()},
        "gravity": TURN.apply([0.0, 0.0, -9.81]).tolist(),
        "surface": {"point": TURN.apply([0.3, 0.1, 0.2]).tolist()},
    },
}


def tosses_of(body, **seen):
    """The dataset of 40 tosses, and what was simulated."""
    content = {"schema": 2, "body": body, "rate": 240.0, "noise": {"position": 2e-4, "rotation": 3e-3}} | seen
    made = simulate_tosses(content, 40, np.random.default_rng(3))
    return dataset_of(content, trajectories=made.trajectories), made


@pytest.fixture(scope="module", params=SEEN.values(), ids=SEEN)
def tossed(request):
    dataset, made = tosses_of(BODY, **request.param)
    found = observe_in_space(dataset, episodes=False)
    true = made.hits
    rows, alone = [], []
    for trial, t in zip(found.trial, found.t):
        apart = np.sort(np.abs(true.loc[true["trial"] == trial, "t"] - t))
        rows.append((true["t"] - t).abs().where(true["trial"] == trial).idxmin())
        alone.append(len(apart) < 2 or apart[1] > ALONE)
    matched = true.loc[rows]
    (frame,) = surface_frames(dataset.in_space)
    pose = matched[list(POSE_IN_SPACE)].to_numpy()
    states = [
        frame.seen(State.of(pose, matched[list(v)].to_numpy(), found.trial, found.t, space=SPACE))
        for v in (V_PRE_IN_SPACE, V_POST_IN_SPACE)
    ]
    return SimpleNamespace(
        dataset=dataset, found=found, true=true, matched=matched, states=states, alone=np.array(alone)
    )


@pytest.mark.slow
def test_motions_beside_a_hit_are_true_within_their_covariance(tossed):
    assert tossed.alone.sum() > 60
    for side in (0, 1):
        found, true = beside(tossed.found, side), tossed.states[side]
        variance = np.einsum("nii->ni", tossed.found.cov[:, side])
        late = tossed.found.t - tossed.matched["t"].to_numpy()
        # at the instant that was found
        there = true.motion + late * np.array([0.0, 0.0, -9.81, 0.0, 0.0, 0.0])[:, None]
        z = ((found.motion - there).T / np.sqrt(variance[:, 1::2]))[tossed.alone]
        # a weak hit in the same window may stay below what chi² of a million hits has
        assert np.abs(z).max() < 8.0 and (np.abs(z) > 4.0).mean() < 0.02
        np.testing.assert_allclose(np.quantile(np.abs(z), 0.683, axis=0), 1.0, atol=0.35)  # three standard errors
        off = found.position - true.position - late * true.velocity
        assert np.all((36.0 * variance[:, [0, 2, 4]] > off.T**2)[tossed.alone])


def test_most_hits_are_found_at_their_instants_and_the_others_have_a_reason(tossed):
    z = ((tossed.found.t - tossed.matched["t"].to_numpy()) / tossed.found.t_std)[tossed.alone]
    assert np.median(np.abs(z)) < 1.2 and np.abs(z).max() < 8.0
    # the gap of the believed body, whose lowest corner hits, is what the noise of place and instant makes of 0
    gap = tossed.found.rig.gap(beside(tossed.found, 0))[tossed.alone]
    assert np.median(np.abs(gap)) < 1e-3 and np.abs(np.median(gap)) < 3e-4
    out, made = tossed.found.found.left_out, len(tossed.true)
    assert len(tossed.found) > 0.4 * made
    assert set(out["reason"]) <= {"second_hit", "window_too_short", "no_approach"}
    assert len(tossed.found) + len(out) <= made + 2
    assert (jump(tossed.found) > 0.1).all()
    # longer arcs lose hits that follow too soon; the settings of the pipeline are those of the command line
    default, longer = (
        len(observe_in_space(tossed.dataset, ArcSettings(**given), episodes=False))
        for given in ({}, {"min_window_in_space": 12})
    )
    assert 0 < longer < default == len(tossed.found)


def test_a_hit_at_the_end_of_its_trial_is_not_called_a_second_hit(tossed):
    """Trials that end two frames after their second hit, if this is far from the first."""
    hits = tossed.true[tossed.true.groupby("trial").cumcount() == 1].set_index("trial")["t"]
    late = hits - tossed.true.groupby("trial")["t"].min()
    ends = hits[late > 0.1] + 2.5 / 240.0
    table = tossed.dataset.trajectories
    table = table[table["t"] < table["trial"].map(ends)]
    cut = type(tossed.dataset)("drops", tossed.dataset.header, table)
    out = observe_in_space(cut, episodes=False).found.left_out
    reasons = out[(out["impact"] == 1) & (out["t"] > out["trial"].map(ends) - 3.0 / 240.0)]["reason"]
    assert len(reasons) > 5 and set(reasons) == {"window_too_short"}


def test_noise_that_is_not_stated_is_found(tossed):
    header = tossed.dataset.header.model_copy(update={"noise": None})
    other = observe_in_space(type(tossed.dataset)("drops", header, tossed.dataset.trajectories), episodes=False)
    noise = other.found.noise
    assert noise.angle == pytest.approx(3e-3, rel=0.15) and len(other) > 0.9 * len(tossed.found)
    assert noise.source == "differences"


def test_noise_that_a_filter_has_smoothed_makes_no_hits(tossed):
    table = tossed.dataset.trajectories.copy()
    low_pass = butter(2, 0.4, output="sos")  # at a fifth of the rate: neighbours differ by a sixth of the noise
    q = table[list(QUATERNION)].to_numpy()
    table[list(QUATERNION)] = q * np.cumprod(np.r_[1.0, np.sign((q[1:] * q[:-1]).sum(axis=1))])[:, None]
    poses = table.groupby("trial")[list(POSE_IN_SPACE)]
    table[list(POSE_IN_SPACE)] = poses.transform(lambda column: sosfiltfilt(low_pass, column))
    header = tossed.dataset.header.model_copy(update={"noise": None})
    found = observe_in_space(type(tossed.dataset)("drops", header, table), episodes=False)
    assert len(found) + len(found.found.left_out) <= len(tossed.true)
    assert len(found) > 0.5 * len(tossed.found)  # of some that are near to each other only rounded samples are left
    assert (found.found.left_out["reason"] != "off_surface").all()


@pytest.mark.parametrize(
    ("turn", "kind"),
    [((0.0, 0.0, 0.5), "face"), ((0.3, 0.0, 0.0), "edge"), ((0.6, 0.5, 0.2), "corner"), ((0.02, 0.02, 0.0), "face")],
)
def test_hits_are_told_by_the_corners_that_lie_within_4_mm(turn, kind):
    attitude = of_rotation_vector(np.array(turn)[:, None])
    box = Box(half_extents=(0.05, 0.04, 0.03))
    assert contact_kind(box, attitude).tolist() == [kind]
    assert contact_kind(box.about(np.array([0.01, 0.0, 0.0])), attitude).tolist() == [kind]
    assert contact_kind(Sphere(radius=0.03), attitude).tolist() == [""]


def test_what_cannot_be_searched_is_said(tossed):
    floor = {"name": "floor", "point": (0, 0, 0), "normal": (0, 0, 1)}
    wall = {"name": "wall", "point": (1, 0, 0), "normal": (-1, 0, 0)}
    content = {"schema": 2, "body": BODY, "surfaces": [floor, wall]}
    several = dataset_of(content, trajectories=tossed.dataset.trajectories.assign(z=tossed.dataset.trajectories["z"]))
    with pytest.raises(UserError, match="on one surface"):
        observe_in_space(several)


@pytest.mark.slow
def test_a_tracked_frame_that_nobody_knows_is_found(tossed):
    header, table = tossed.dataset.header.model_copy(update={"tracked": None}), tossed.dataset.trajectories
    found = observe_in_space(type(tossed.dataset)("d", header, table), episodes=False)
    assert len(found) > 0.9 * len(tossed.found)
    gap = found.rig.gap(beside(found, 0))
    assert np.median(np.abs(gap)) < 1e-3
    few = type(tossed.dataset)("d", header, table[table["trial"] < 2])
    with pytest.raises(UserError, match=r"tracked: unknown: .*follow"):
        observe_in_space(few)


def test_hits_that_follow_too_soon_are_episodes_between_two_flights(tossed):
    found, true = observe_in_space(tossed.dataset), tossed.true
    episodes = np.flatnonzero(found.span > 0.0)
    assert len(episodes) > 0.15 * len(found) and len(found) > 1.1 * len(tossed.found)
    assert len(found.found.left_out) < len(tossed.found.found.left_out)
    end, inside = found.t + found.span, []
    for i in episodes:
        of_trial = true["t"][true["trial"] == found.trial[i]].to_numpy()
        inside.append(((of_trial > found.t[i] - ALONE) & (of_trial < end[i])).sum())
    # what looks like one hit may be two; a touch that the flight before foretells is true to some ms
    assert np.mean(np.array(inside) >= 2) > 0.5 and np.mean(np.array(inside) >= 1) > 0.98
    same = np.flatnonzero(found.span == 0.0)
    assert set(zip(found.trial[same], found.impact[same])) <= set(zip(tossed.found.trial, tossed.found.impact))


@pytest.mark.parametrize("offset, gravity, drag", [((0.0, 0.0, 0.0), 9.81, 0.0), ((2e-3, 0.0, 6e-3), 9.6, 0.5)])
def test_what_all_hits_share_is_no_misfit_of_flights(offset, gravity, drag):
    rng, n, noise = np.random.default_rng(4), 60, (1e-4, 1e-3)
    G, tau = np.eye(3) * 1e-3, np.tile(np.arange(-12, 13) / 150.0 + 1e-3, (n, 1))
    side = np.stack([tau < 0.0, tau > 0.0], axis=1)
    spin, v = rng.uniform(-8.0, 8.0, (2, n, 3)), rng.uniform(-1.0, 1.0, (2, n, 3))
    turn = np.where(tau[..., None] < 0.0, spin[0][:, None], spin[1][:, None]) * tau[..., None]
    turn += noise[1] * rng.standard_normal(turn.shape)
    attitude = Rotation.from_rotvec(turn.reshape(-1, 3)) * Rotation.random(n, rng=rng)[np.repeat(np.arange(n), 25)]
    v = np.where(tau[..., None] < 0.0, v[0][:, None], v[1][:, None])
    place = v * (tau - 0.5 * drag * tau**2)[..., None]
    place += attitude.apply(offset).reshape(n, 25, 3) - 0.5 * gravity * tau[..., None] ** 2 * [0.0, 0.0, 1.0]
    place += noise[0] * rng.standard_normal(place.shape)
    pose = np.concatenate([place, attitude.as_quat(scalar_first=True).reshape(n, 25, 4)], axis=2)
    fitted = fit_windows(pose, tau, side, G, noise)
    off, dof = off_free_motion(fitted, pose, tau, side, G, 9.81, noise, 0.0)
    assert np.median(off / dof, axis=0) == pytest.approx(1.0, abs=0.15)
    another, grown, _ = has_another_hit(off, dof)
    assert not another.any() and grown == pytest.approx(1.0, abs=0.15)


def test_hits_that_are_rarely_clean_leave_the_noise_as_it_is():
    rng, dof = np.random.default_rng(0), np.full((500, 2), 40.0)
    clean = np.arange(500) < 80
    off = rng.chisquare(40.0, (500, 2)) * np.where(clean, 1.0, rng.uniform(20.0, 200.0, 500))[:, None]
    another, grown, slack = has_another_hit(off, dof)
    assert (another == ~clean).all()
    assert grown == pytest.approx(1.0, abs=0.2) and slack == pytest.approx(4.0)
    assert has_another_hit(3.0 * rng.chisquare(40.0, (500, 2)), dof)[1] == pytest.approx(3.0, rel=0.1)


@pytest.mark.parametrize("tau", [0.0, 2e-3])
def test_round_corners_are_no_contacts_that_last(tau):
    rng = np.random.default_rng(1)
    normal = np.abs(Rotation.random(300, rng=rng).as_matrix()[:, 2])
    speed = rng.uniform(0.5, 1.5, 300) * normal.sum(axis=1)  # a corner has the shorter lever
    sunk = 5e-3 * (normal.sum(axis=1) - 1.0) + tau * speed + 1e-4 * rng.standard_normal(300)
    shape = np.column_stack([np.ones(300), normal])
    assert contact_guard(sunk, speed) > 5e-4 + 1.5 * tau
    assert contact_guard(sunk, speed, shape) == pytest.approx(1.5 * tau, abs=2e-4)


@pytest.mark.parametrize("shape", [BODY["shape"], {"kind": "ellipsoid", "semi_axes": [0.06, 0.05, 0.03]}])
def test_a_body_that_leaves_the_surface_late_has_hit_more_than_once(shape, monkeypatch):
    seen = []
    monkeypatch.setattr(episodes, "_hits_twice", lambda *args: seen.append(args) or _HITS_TWICE(*args))
    observe_in_space(tosses_of({**BODY, "shape": shape})[0])
    ((poses, alone),) = seen
    several, t = _HITS_TWICE(poses, alone), poses.samples.t.copy()
    assert not len(_HITS_TWICE(poses, alone[:0]))  # where every hit follows another one too soon
    late = np.flatnonzero(~several)[::8]
    for row, count in alone.loc[late, ["row_post", "n_post"]].to_numpy():
        t[row : row + count] += 4e-3  # s; the same corner touched last
    moved = _HITS_TWICE(replace(poses, samples=replace(poses.samples, t=t)), alone)
    assert len(late) > 5 and moved[late].all()
    others = np.setdiff1d(np.flatnonzero(~several), late)
    assert moved[others].mean() < 0.1


@pytest.mark.parametrize("share", [0.0, 0.2])
def test_hops_where_samples_are_rounded_let_arcs_meet_deep_below_the_surface(share):
    rng, n, guard = np.random.default_rng(3), 150, 0.025
    normal = rng.standard_normal((3, n))
    normal /= np.linalg.norm(normal, axis=0)
    shape = np.concatenate([np.ones((2, n)), normal, np.abs(normal)]).T
    sunk = shape[:, 5:] @ [3e-3, -2e-3, 1e-3] + 2e-4 * rng.standard_normal(n)  # a box of another size
    speeds = np.stack([rng.uniform(0.2, 2.0, n), rng.uniform(0.2, 1.0, n)], axis=1)
    hopped, lasts = rng.uniform(size=n) < share, rng.uniform(0.4 * guard, 2.0 * guard, n)
    speeds[hopped] = rng.uniform(0.3, 0.5, (hopped.sum(), 2))  # hops this short are of slow bodies
    sunk += np.where(hopped, lasts / (1.0 / speeds).sum(axis=1), 0.0)
    assert np.array_equal(hops_unseen(sunk, speeds, shape, guard), hopped)
    assert not hops_unseen(sunk[:5], speeds[:5], shape[:5], guard).any()  # nobody knows what the shape does


@pytest.mark.slow
def test_frames_in_which_a_tag_is_read_in_its_other_pose_are_left_out(tossed):
    rng, table = np.random.default_rng(6), tossed.dataset.trajectories.copy()
    flipped = rng.random(len(table)) < 0.02
    turned = Rotation.from_quat(table[list(QUATERNION)].to_numpy(), scalar_first=True)
    turned = turned * Rotation.from_rotvec([0, 0.7, 0])
    table.loc[flipped, list(QUATERNION)] = turned.as_quat(scalar_first=True)[flipped]
    names = ("trial", "t", list(QUATERNION))
    out = out_and_back(*(table[of].to_numpy() for of in names))
    assert out[flipped].mean() > 0.9 and not out[~flipped].any()
    found, expected = observe_in_space(replace(tossed.dataset, trajectories=table)), observe_in_space(tossed.dataset)
    assert f"in {out.sum()} of {len(table)} rows the orientation has jumped" in " ".join(found.found.warnings)
    assert len(found) > 0.9 * len(expected)
    assert not out_and_back(*(tossed.dataset.trajectories[of].to_numpy() for of in names)).any()
