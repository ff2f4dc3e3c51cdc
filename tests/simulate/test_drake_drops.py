"""Drops in Drake: flight and impulses in closed form, agreement with the other integrator, what is refused."""

from functools import cache

import numpy as np
import pytest

from thesis_lib.bodies.body import Body, Noise
from thesis_lib.bodies.shapes import Disk, Ellipse, Polygon
from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.compliant.drops import TRUTH, simulate_compliant_drops
from thesis_lib.simulate.drake.drops import ACCURACY, SUPPORTED, WITHOUT_ELEMENT, simulate_drake_drops
from thesis_lib.simulate.drake.plant import STICTION
from thesis_lib.simulate.drake.viscoelastic_pad import design, rebound
from thesis_lib.simulate.rig.hidden_causes import CAUSES, PROOF_RELEASE, CompliantContact, HiddenCauses
from thesis_lib.simulate.rig.release import Release, Spread

EXACT = 1e-9  # free flight: a parabola for a Runge-Kutta step and for a Hermite path
RIGID_TOL = 0.01  # m/s: of changes of 2 to 5 m/s, in contacts of 20 µs
# between two integrators and two contact models, at the first impact; the rig resolves 0.02 m/s
AGREE = 0.01
FLAT = 0.0297  # m: lever of a corner of the square, 0.03 where it lands flat
RIG = Noise(position=3e-4, angle=3e-3)
ELLIPSE = Body(shape=Ellipse(semi_axes=(0.035, 0.025)), mass=0.0364, radius_of_gyration=0.01924)
DISK = Body(shape=Disk(radius=0.03), mass=0.05, radius_of_gyration=0.02)
CORNERS = ((0.03, 0.03), (-0.03, 0.03), (-0.03, -0.03), (0.03, -0.03))
SQUARE = Body(shape=Polygon(vertices=CORNERS), mass=0.05, radius_of_gyration=0.0245)
BRIEF = 2e-5  # s; the body moves far less than the noise during such a contact: nearly a rigid impact
PRE, POST = ["vx_pre", "vy_pre", "omega_pre"], ["vx_post", "vy_post", "omega_post"]
POSE = ["x", "y", "theta"]
SHORT = Release(height=Spread(low=0.06, high=0.2), vx=Spread(low=-1.2, high=1.2), omega=Spread(low=-15, high=15))


def run(n=10, body=ELLIPSE, release=SHORT, seed=0, hidden=None, contact=None, simulate=simulate_drake_drops, **options):
    return simulate(
        body,
        release,
        n,
        contact=CompliantContact(**({"contact_time": BRIEF} | (contact or {}))),
        hidden=HiddenCauses(**(hidden or {})),
        rng=np.random.default_rng(seed),
        **({"duration": 0.25} | options),
    )


@cache
def plain():
    return run(12, release=PROOF_RELEASE, duration=0.5)


def at(**values):
    """A release of one state; a (low, high) pair spreads it."""
    state = {"height": 0.3, "theta": 0.0, "vx": 0.0, "omega": 0.0} | values
    pairs = {name: value if isinstance(value, tuple) else (value, value) for name, value in state.items()}
    return Release(**{name: Spread(low=low, high=high) for name, (low, high) in pairs.items()})


def first(drops):
    return drops.impacts[drops.impacts["impact"] == 0]


def contact_velocity(impacts, side):
    v_t = impacts[f"vx_{side}"] - impacts["r_y"] * impacts[f"omega_{side}"]
    return v_t, impacts[f"vy_{side}"] + impacts["r_x"] * impacts[f"omega_{side}"]


def test_flight_is_a_parabola():
    drops = run(2, release=at(height=0.5, vx=0.7, omega=-9.0, theta=1.0), duration=0.25)
    t = drops.trajectories["t"].to_numpy()
    expected = np.column_stack([0.7 * t, 0.5 - 0.5 * 9.81 * t**2, 1.0 - 9.0 * t])
    np.testing.assert_allclose(drops.trajectories[POSE], expected, atol=EXACT)


def test_the_truth_agrees_with_samples_without_noise():
    """Velocities from the samples around an impact are those of the truth: neither is made from the other."""
    table, compared = plain().trajectories, 0
    for _, one in first(plain()).iterrows():
        mine = table[table["trial"] == one["trial"]]
        t, q = mine["t"].to_numpy(), mine[POSE].to_numpy()
        for side, names in ((t < one["t"], PRE), (t > one["t"], POST)):
            near = np.flatnonzero(side)[-3:] if names is PRE else np.flatnonzero(side)[:3]
            if len(near) < 3 or (names is POST and one["separated"] and q[near, 1].min() < 0.036):
                continue  # the next impact may be among them
            slope = np.polyfit(t[near] - one["t"], q[near], 2)[1]
            np.testing.assert_allclose(slope, one[names].to_numpy(float), atol=2e-3)
            compared += 1
    assert compared >= 12


def test_momentum_balance_across_every_contact():
    one = plain().impacts
    d = one[POST].to_numpy() - one[PRE].to_numpy()
    k2 = ELLIPSE.radius_of_gyration**2
    error = k2 * d[:, 2] - one["r_x"] * d[:, 1] + one["r_y"] * d[:, 0]
    assert len(one) > 20
    np.testing.assert_allclose(error / ELLIPSE.radius_of_gyration, 0.0, atol=2e-3 * np.abs(d).max())
    free = np.outer(one["duration"], [0.0, -9.81])
    np.testing.assert_allclose(ELLIPSE.mass * (d[:, :2] - free), one[["c_t", "c_n"]].to_numpy(), atol=1e-9)


def test_impulses_obey_coulomb_and_slide_on_his_cone():
    one = run(25, contact={"mu": 0.05}).impacts
    ratio = np.abs(one["c_t"] / one["c_n"])
    assert ratio.max() < 0.05 + 1e-6
    before, after = contact_velocity(one, "pre")[0], contact_velocity(one, "post")[0]
    slides = (before * after > 0.0) & (np.abs(after) > 10.0 * STICTION)  # never stopped
    assert slides.sum() > 10
    np.testing.assert_allclose(ratio[slides], 0.05, atol=1e-3)


def test_disk_sticks_or_slips_and_gives_back_epsilon():
    drops = run(40, DISK, at(height=(0.06, 0.6), vx=(-4.0, 4.0), omega=(-20.0, 20.0)), duration=0.4)
    one = first(drops)
    v, after = one[PRE].to_numpy(), one[POST].to_numpy()
    slip, lever = v[:, 0] + 0.03 * v[:, 2], 1.0 + 0.03**2 / 0.02**2
    c_n = -1.55 * v[:, 1]
    c_t = np.clip(-slip / lever, -0.15 * c_n, 0.15 * c_n)
    stuck = np.abs(slip / lever) < 0.15 * c_n
    assert min(stuck.sum(), (~stuck).sum()) > 5
    expected = v + np.column_stack([c_t, c_n, 0.03 * c_t / 0.02**2])
    # where it sticks, friction that is regularised leaves up to its slip
    np.testing.assert_allclose((after - expected) * [1, 1, 0.02], 0.0, atol=RIGID_TOL + STICTION)


@pytest.mark.parametrize("epsilon", [0.3, 0.55, 0.9, 1.0])
def test_restitution_depends_neither_on_speed_nor_on_the_lever(epsilon):
    contact = {"epsilon": epsilon, "mu": 0.0}
    one = first(run(25, SQUARE, at(height=(0.06, 0.6), theta=(-0.7, 0.7)), contact=contact, duration=0.4))
    v, after = contact_velocity(one, "pre")[1], contact_velocity(one, "post")[1]
    apart = np.abs(one["r_x"]) < FLAT  # else two corners land together
    assert v.min() < 3.0 * v.max() < 0.0 and np.abs(one["r_x"])[apart].max() > 0.02
    np.testing.assert_allclose((-after / v)[apart], epsilon, atol=0.005)


def test_drakes_own_dissipation_makes_restitution_fall_with_speed():
    hidden = {"hunt_crossley": 0.07}
    one = first(run(8, DISK, at(height=(0.05, 0.8)), hidden=hidden, duration=0.42))
    speed, ratio = -one["vy_pre"].to_numpy(), (-one["vy_post"] / one["vy_pre"]).to_numpy()
    slope = np.polyfit(speed, ratio, 1)[0]
    own = first(run(8, DISK, at(height=(0.05, 0.8)), hidden=hidden, duration=0.42, simulate=simulate_compliant_drops))
    own_slope = np.polyfit(-own["vy_pre"], -own["vy_post"] / own["vy_pre"], 1)[0]
    assert slope == pytest.approx(own_slope, rel=0.1) and slope < -0.01  # one d, two contacts
    # slower is never more: the order of the ratios is that of the speeds
    assert (np.diff(ratio[np.argsort(speed)]) < 0.0).all()


@pytest.mark.slow
@pytest.mark.parametrize("body", [ELLIPSE, SQUARE], ids=["ellipse", "square"])
@pytest.mark.parametrize(
    "hidden",
    [{"com_offset_x": 5e-4}, {"inertia_error": 0.07}, {"plate_velocity": 0.056}, {"tilt": 0.065, "wear": 0.3}]
    + [{"quadratic_drag": 0.23, "magnus": 0.039}, {"linear_drag": 0.42}, {"loose_mass": 0.17}]
    + [{"plate_amplitude": 5e-4}, {"size_error": 0.04, "surface_height": 1e-3}, {"corner_radius": 2e-3}],
    ids="+".join,
)
def test_first_impacts_agree_with_the_other_integrator(body, hidden):
    runs = [run(15, body, hidden=hidden, simulate=s) for s in (simulate_drake_drops, simulate_compliant_drops)]
    drake, own = (first(one).set_index("trial") for one in runs)
    assert list(drake.index) == list(own.index) and len(drake) == 15
    np.testing.assert_allclose(drake[["t", *POSE]], own[["t", *POSE]], atol=2e-6)
    scale = [1.0, 1.0, body.radius_of_gyration]
    np.testing.assert_allclose(drake[PRE] * scale, own[PRE] * scale, atol=1e-5)
    # within a hair's breadth of flat, two corners land in one contact, and so do the differences of two contact models
    apart = own["r_x"].abs() < FLAT if body is SQUARE else own["r_x"].abs() >= 0.0
    assert apart.sum() >= 12
    error = ((drake[POST] - own[POST]) * scale).abs()[apart]
    assert error.to_numpy().max() < AGREE
    if next(iter(hidden)) in ("com_offset_x", "inertia_error", "plate_velocity", "plate_amplitude"):
        # the tolerance is far below what the mechanism does
        without = first(run(15, body, simulate=simulate_compliant_drops)).set_index("trial")
        assert ((drake[POST] - without[POST]) * scale).abs().to_numpy().max() > 1.5 * AGREE


def test_tighter_error_control_changes_little():
    rough, fine = (first(run(6, accuracy=a))[POST].to_numpy() for a in (ACCURACY, 0.01 * ACCURACY))
    np.testing.assert_allclose(rough, fine, rtol=0, atol=5e-4)


def test_camera_faults_reach_the_recording_with_the_signs_of_the_format():
    hidden = {"mirrored": True, "angle_offset": 0.1, "length_scale": 0.02, "drift": 0.3}
    seen, true = run(4, hidden=hidden).trajectories, run(4).trajectories
    np.testing.assert_allclose(seen["theta"], 0.1 - true["theta"], atol=EXACT)
    np.testing.assert_allclose(seen["y"], 1.02 * true["y"], atol=EXACT)
    np.testing.assert_allclose(seen["x"], 1.02 * true["x"] + 0.3 * true["t"], atol=EXACT)


def test_lag_shows_an_earlier_angle_and_nothing_else():
    true, late = run(3), run(3, hidden={"time_lag": 0.004})  # one sample
    a, b = (d.trajectories[d.trajectories["trial"] == 2] for d in (true, late))
    np.testing.assert_allclose(b["theta"].to_numpy()[1:], a["theta"].to_numpy()[:-1], atol=1e-7)
    np.testing.assert_allclose(b[["x", "y"]], a[["x", "y"]], atol=EXACT)


def test_recording_ends_where_the_body_rests():
    drops = run(3, DISK, at(height=0.05), contact={"epsilon": 0.3}, duration=0.5)
    assert (drops.trajectories.groupby("trial")["t"].max() < 0.45).all()
    assert tuple(drops.impacts.columns) == TRUTH
    assert drops.trials["contacts"].min() >= 3


def test_same_seed_same_drops_and_the_releases_of_the_other_source():
    a, b = run(3, noise=RIG), run(3, noise=RIG)
    np.testing.assert_array_equal(a.trajectories, b.trajectories)
    own = run(3, noise=RIG, simulate=simulate_compliant_drops)
    np.testing.assert_allclose(a.trials[[*POSE, "vx", "omega"]], own.trials[[*POSE, "vx", "omega"]])
    assert a.header == own.header


def test_every_cause_is_supported_or_refused_by_name():
    assert set(SUPPORTED) | set(WITHOUT_ELEMENT) == set(CAUSES)
    for name in WITHOUT_ELEMENT:
        with pytest.raises(UserError, match=name):
            run(1, hidden={name: CAUSES[name].size})


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"body": ELLIPSE.model_copy(update={"mass": None})}, "mass"),
        ({"contact": {"exponent": 1.5}}, "exponent"),
        ({"contact": {"epsilon": 0.1}}, "epsilon"),
        ({"hidden": {"plate_velocity": 0.1, "plate_amplitude": 1e-4}}, "one carriage"),
        ({"release": at(height=0.03)}, "Raise the lower end"),
    ],
)
def test_says_what_is_wrong(change, text):
    with pytest.raises(UserError, match=text):
        run(1, **change)


@pytest.mark.parametrize("epsilon", [0.3, 0.55, 0.9])
def test_pad_gives_back_the_same_at_any_effective_mass(epsilon):
    pad = design(epsilon, 2e-5, 0.05, 0.4)
    scale = pad.k_contact
    layers = [(k / scale, c / np.sqrt(scale * 0.05)) for k, c in pad.layers]
    every = [rebound(mass, layers)[0] for mass in np.linspace(0.4, 1.0, 13)]
    np.testing.assert_allclose(every, epsilon, atol=2e-3)
    assert rebound(1.0, layers)[1] / np.sqrt(scale / 0.05) == pytest.approx(2e-5, rel=1e-6)
    # one layer alone does not
    single = [rebound(mass, layers[:1])[0] for mass in (0.4, 1.0)]
    assert abs(single[1] - single[0]) > 0.01
