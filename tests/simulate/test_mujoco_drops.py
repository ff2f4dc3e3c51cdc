"""Drops in MuJoCo: flight, impulses and restitution in closed form, agreement with the other integrator."""

from functools import cache

import numpy as np
import pytest

from thesis_lib.bodies.body import Body, Noise
from thesis_lib.bodies.shapes import Disk, Ellipse, Polygon
from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.compliant.drops import TRUTH, simulate_compliant_drops
from thesis_lib.simulate.mujoco.causes import OWN, SUPPORTED, WITHOUT_ELEMENT, MujocoCauses
from thesis_lib.simulate.mujoco.contact import MujocoContact
from thesis_lib.simulate.mujoco.drops import simulate_mujoco_drops
from thesis_lib.simulate.rig.hidden_causes import CAUSES, PROOF_RELEASE, CompliantContact, HiddenCauses
from thesis_lib.simulate.rig.release import Release, Spread

EXACT = 1e-9  # free flight: a parabola for a Runge-Kutta step and for a Hermite path
FLIGHT = 2e-6  # m, rad: between two integrators of a flight with drag until the first touch
# m/s, frictionless, contacts of 0.2 ms at impedance 0.9999, where restitution knows no lever: impulses of a damper and
# of a hysteretic spring, of changes of 2 to 5 m/s
AGREE = 0.02
# m/s: MuJoCo finds the top of a box to 1e-10 m, so that a part of a step may feel it too early: B v dt / 6
EARLY = 5e-3
RIG = Noise(position=3e-4, angle=3e-3)
ELLIPSE = Body(shape=Ellipse(semi_axes=(0.035, 0.025)), mass=0.0364, radius_of_gyration=0.01924)
DISK = Body(shape=Disk(radius=0.03), mass=0.05, radius_of_gyration=0.02)
CORNERS = ((0.03, 0.03), (-0.03, 0.03), (-0.03, -0.03), (0.03, -0.03))
SQUARE = Body(shape=Polygon(vertices=CORNERS), mass=0.05, radius_of_gyration=0.0245)
FLAT = 0.0285  # m: lever of a corner of the square, 0.03 where it lands flat and two corners touch
PRE, POST = ["vx_pre", "vy_pre", "omega_pre"], ["vx_post", "vy_post", "omega_post"]
POSE = ["x", "y", "theta"]


def run(n=10, body=ELLIPSE, release=PROOF_RELEASE, seed=0, hidden=None, contact=None, own=False, **options):
    simulate, law, causes = simulate_mujoco_drops, MujocoContact, MujocoCauses
    if own:
        simulate, law, causes = simulate_compliant_drops, CompliantContact, HiddenCauses
    return simulate(
        body,
        release,
        n,
        contact=law(**({"contact_time": 1e-3} | (contact or {}))),
        hidden=causes(**(hidden or {})),
        rng=np.random.default_rng(seed),
        **({"duration": 0.4} | options),
    )


@cache
def plain():
    return run(25, duration=0.5)


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
        end = one["t"] + one["duration"]
        for near, names in ((np.flatnonzero(t < one["t"])[-3:], PRE), (np.flatnonzero(t > end)[:3], POST)):
            if len(near) < 3 or (names is POST and q[near, 1].min() < 0.036):
                continue  # the next impact may be among them
            slope = np.polyfit(t[near] - (one["t"] if names is PRE else end), q[near], 2)[1]
            np.testing.assert_allclose(slope, one[names].to_numpy(float), atol=2e-3)
            compared += 1
    assert compared >= 30


def test_a_touch_is_where_the_lowest_point_meets_the_plate():
    """An ellipse touches at its own lowest point: MuJoCo's support function is exact."""
    one = first(plain())
    a, b = ELLIPSE.shape.semi_axes
    lowest = np.hypot(a * np.sin(one["theta"]), b * np.cos(one["theta"]))
    np.testing.assert_allclose(one["y"], lowest, atol=1e-9)


@pytest.mark.parametrize("body", [ELLIPSE, SQUARE], ids=["ellipse", "square"])
def test_momentum_balance_across_every_contact(body):
    """The couple on the body is that of the impulse at the contact, within the way that the contact point moves."""
    one = run(15, body, contact={"contact_time": 1e-4, "steps": 50, "mu": 0.3}).impacts
    d = one[POST].to_numpy() - one[PRE].to_numpy()
    k2 = body.radius_of_gyration**2
    error = k2 * d[:, 2] - one["r_x"] * d[:, 1] + one["r_y"] * d[:, 0]
    single = one["r_x"].abs() < FLAT  # else two corners touch, and the couple has two levers
    assert single.sum() > 12
    np.testing.assert_allclose(error[single] / body.radius_of_gyration, 0.0, atol=1e-2 * np.abs(d[:, :2]).max())
    free = np.outer(one["duration"], [0.0, -9.81])
    np.testing.assert_allclose(body.mass * (d[:, :2] - free), one[["c_t", "c_n"]].to_numpy(), atol=1e-9)


@pytest.mark.parametrize("body", [ELLIPSE, SQUARE], ids=["ellipse", "square"])
def test_impulses_obey_coulomb_and_slide_on_his_cone(body):
    one = run(25, body, contact={"mu": 0.05}).impacts
    ratio = np.abs(one["c_t"] / one["c_n"])
    assert ratio.max() < 0.05 + 1e-6
    before, after = contact_velocity(one, "pre")[0], contact_velocity(one, "post")[0]
    # so fast that viscous friction is beyond the cone throughout
    slides = (before * after > 0.0) & (np.abs(after) > 0.8) & (one["r_x"].abs() < FLAT)
    assert slides.sum() > 5
    np.testing.assert_allclose(ratio[slides], 0.05, atol=1e-3)


@pytest.mark.parametrize("body", [ELLIPSE, SQUARE], ids=["ellipse", "square"])
def test_no_contact_gains_energy(body):
    one = run(25, body, contact={"mu": 0.3}).impacts
    weight = body.mass * 9.81 * (one["vy_pre"].abs() + 0.1) * one["duration"]  # gravity's work during it
    assert (one["energy_change"] < weight).all() and one["energy_change"].mean() < -0.01


def test_elastic_contact_without_friction_keeps_energy():
    """In a short contact: while the body turns, the stiffness that MuJoCo gives it changes with the effective mass."""
    one = run(25, contact={"mu": 0.0, "epsilon": 1.0, "contact_time": 1e-4, "steps": 100}).impacts
    kinetic = 0.5 * ELLIPSE.mass * (one[["vx_pre", "vy_pre"]] ** 2).sum(axis=1)
    np.testing.assert_allclose(one["energy_change"] / kinetic, 0.0, atol=5e-3)


@pytest.mark.parametrize("epsilon", [0.2, 0.55, 0.9])
@pytest.mark.parametrize("contact_time", [3e-4, 1e-3, 3e-3])
def test_a_central_impact_gives_back_epsilon_at_any_speed(epsilon, contact_time):
    contact = {"epsilon": epsilon, "mu": 0.0, "contact_time": contact_time}
    one = first(run(12, DISK, at(height=(0.06, 0.6)), contact=contact))
    v, after = one["vy_pre"], one["vy_post"]
    assert v.min() < 2.5 * v.max() < 0.0
    # gravity acts for the time of contact, and takes back v from a deeper point
    np.testing.assert_allclose(-after / v, epsilon, atol=0.005 + 2.0 * 9.81 * contact_time / v.abs().min())
    # it overlaps for longer than its force lasts, as it leaves with a dent
    assert (one["duration"] > 0.99 * contact_time).all()
    assert (one["duration"] < (1.1 + 0.3 / epsilon**0.5) * contact_time).all()


@pytest.mark.slow
def test_smaller_time_steps_converge():
    """Errors fall with the step: at most of first order, as the touch falls within a step."""

    def after(steps):
        return first(run(10, contact={"steps": steps}, duration=0.3))[POST].to_numpy()

    fine, scale = after(1600), np.array([1.0, 1.0, ELLIPSE.radius_of_gyration])
    largest = [float(np.abs((after(steps) - fine) * scale).max()) for steps in (25, 100, 400)]
    assert largest[2] < 0.5 * largest[1] < 0.25 * largest[0]
    assert largest[2] < 3e-3  # m/s; 200 steps, the default, are within the rig's noise of 0.01


@pytest.mark.slow
@pytest.mark.parametrize("body", [ELLIPSE, SQUARE], ids=["ellipse", "square"])
@pytest.mark.parametrize(
    "hidden",
    [{"com_offset_x": 2e-3, "gravity_error": 0.65}, {"inertia_error": 0.2}, {"tilt": 0.065}, {"wear": 0.3}]
    + [{"quadratic_drag": 0.23, "magnus": 0.039}, {"linear_drag": 0.42, "spin_damping": 0.47}]
    + [{"loose_mass": 0.17}, {"plate_amplitude": 5e-4}, {"size_error": 0.04, "surface_height": 1e-3}]
    + [{"corner_radius": 4e-3, "plate_velocity": 0.1}, {"restitution_slope": 0.5}, {"orientation_restitution": 0.2}],
    ids="+".join,
)
def test_first_impacts_without_friction_agree_with_the_other_integrator(body, hidden):
    """Two integrators, two contact models: the same flights, and the same rebound where friction has no part."""
    contact = {"mu": 0.0, "contact_time": 2e-4, "steps": 80}
    rigid = contact | {"impedance": 0.9999}
    mine = first(run(15, body, hidden=hidden, contact=rigid, duration=0.33)).set_index("trial")
    own = first(run(15, body, hidden=hidden, contact=contact, own=True, duration=0.33)).set_index("trial")
    assert list(mine.index) == list(own.index) and len(mine) >= 10
    np.testing.assert_allclose(mine[["t", *POSE]], own[["t", *POSE]], atol=FLIGHT)
    scale = [1.0, 1.0, body.radius_of_gyration]
    np.testing.assert_allclose(mine[PRE] * scale, own[PRE] * scale, atol=EARLY if "plate_amplitude" in hidden else 2e-5)
    flat = FLAT - hidden.get("corner_radius", 0.0)
    apart = own["r_x"].abs() < flat if body is SQUARE else own["r_x"].abs() >= 0.0
    assert apart.sum() >= 7
    error = ((mine[POST] - own[POST]) * scale).abs()[apart]
    assert error.to_numpy().max() < AGREE
    if set(hidden) & {"wear", "restitution_slope", "orientation_restitution", "inertia_error"}:
        without = rebounds(body.shape.kind).set_index("trial")
        assert ((mine[POST] - without[POST]) * scale).abs().to_numpy().max() > 2.0 * AGREE


@cache
def rebounds(kind):
    """First impacts of the same with nothing hidden."""
    rigid = {"mu": 0.0, "contact_time": 2e-4, "steps": 80, "impedance": 0.9999}
    return first(run(15, {"ellipse": ELLIPSE, "polygon": SQUARE}[kind], contact=rigid, duration=0.33))


def test_friction_by_place_and_a_moving_plate_act_on_the_slip():
    """Where it slides throughout, the friction impulse is μ c_n with the μ of the place, against the slip."""
    slope = first(run(40, contact={"mu": 0.05}, hidden={"friction_slope": 2.0}))
    before, after = (contact_velocity(slope, side)[0] for side in ("pre", "post"))
    fast = (before * after > 0.0) & (before.abs() > 0.5) & (after.abs() > 0.5)
    assert fast.sum() > 5
    place = slope["x"] + slope["r_x"]
    expected = 0.05 * (1.0 + 2.0 * place)
    np.testing.assert_allclose((slope["c_t"] / slope["c_n"]).abs()[fast], expected[fast], rtol=0.01)
    carried = first(run(3, DISK, at(), hidden={"plate_velocity": 4.0}, contact={"mu": 0.1}))
    np.testing.assert_allclose(carried["c_t"] / carried["c_n"], 0.1, rtol=1e-3)  # a body at rest is dragged along


def test_a_soft_place_lasts_longer_and_gives_back_the_same():
    """Stiffness by place: T ~ 1/√k at the same restitution."""
    half = {"stiffness_slope": -0.75, "patch_centre": 0.0}
    for x, factor in ((0.0, 1.0), (1.0, 0.25)):
        moved = at(vx=x / np.sqrt(2.0 * 0.27 / 9.81))  # it lands at x
        contact = {"mu": 0.0}
        soft, hard = (first(run(1, DISK, moved, hidden=h, contact=contact)).iloc[0] for h in (half, {}))
        assert soft["x"] == pytest.approx(x, abs=1e-3)
        assert soft["duration"] / hard["duration"] == pytest.approx(factor**-0.5, rel=0.02)
        assert soft["vy_post"] == pytest.approx(hard["vy_post"], abs=0.02)


@pytest.mark.slow
def test_every_cause_that_mujoco_makes_changes_the_drops():
    """None is accepted and then left out; the camera's are seen in the samples alone."""
    for name in SUPPORTED:
        body = SQUARE if name in CAUSES and CAUSES[name].polygon_only else ELLIPSE
        size = 1.0 if name == "mirrored" else 5.0 * {**CAUSES, **OWN}[name].size
        size = float(np.clip(size, -0.9, 0.9)) if name in ("stiffness_patch", "soft_spot", "loose_mass") else size
        wide = {"patch_centre": 0.0, "patch_width": 0.6, name: size}  # so that every drop lands on it
        plain, made = (run(4, body, hidden=h, duration=0.35, contact={"steps": 50}) for h in ({}, wide))
        merged = plain.trajectories.merge(made.trajectories, on=["trial", "t"])
        change = np.abs(merged[[f"{c}_x" for c in POSE]].to_numpy() - merged[[f"{c}_y" for c in POSE]].to_numpy())
        assert change.max() > 1e-5, name


def test_fluid_on_the_ellipsoid_slows_lifts_and_turns():
    """Drag across the long axis exceeds that along it, and an inclined ellipse is pushed aside; water beats air."""
    release = at(height=0.6, theta=(0.0, np.pi / 2.0))
    thick, air, none = (
        run(9, release=release, duration=0.2, hidden={"fluid_density": rho}).trajectories for rho in (30.0, 1.2, 0.0)
    )
    last = {name: one[one["t"] == one["t"].max()] for name, one in (("thick", thick), ("air", air), ("none", none))}
    fallen = 0.6 - last["none"]["y"].to_numpy()
    short = fallen - (0.6 - last["thick"]["y"].to_numpy())
    assert (short > 1e-3).all()
    assert (short > 15.0 * (fallen - (0.6 - last["air"]["y"].to_numpy()))).all()
    theta = run(9, release=release, duration=0.2).trials["theta"].to_numpy()
    assert short[theta.argmin()] > 1.1 * short[theta.argmax()]  # flat against upright
    aside = np.abs(last["thick"]["x"].to_numpy())
    assert aside[np.abs(theta - np.pi / 4.0).argmin()] > 2.0 * max(aside[theta.argmin()], aside[theta.argmax()])
    np.testing.assert_allclose(last["none"]["x"], 0.0, atol=EXACT)


def test_the_loose_mass_swings_at_its_frequency_after_an_impact():
    """Momentum of body and mass together is that of the impulse; the body alone rings on."""
    hidden = {"loose_mass": 0.1, "loose_frequency": 60.0, "loose_damping": 0.0}
    drops = run(1, DISK, at(height=0.3), hidden=hidden, contact={"mu": 0.0}, duration=0.4, rate=2000.0)
    one, path = first(drops).iloc[0], drops.trajectories
    after = path[(path["t"] > one["t"] + one["duration"]) & (path["t"] < one["t"] + 0.06)]
    t, y = after["t"].to_numpy(), after["y"].to_numpy()
    ring = y - np.polyval(np.polyfit(t, y, 2), t)
    basis = 2.0 * np.pi * 60.0 / np.sqrt(0.9)  # two masses on one spring
    design = np.column_stack([np.ones_like(t), t, t**2, np.cos(basis * t), np.sin(basis * t)])
    left = y - design @ np.linalg.lstsq(design, y, rcond=None)[0]
    assert np.std(left) < 0.02 * np.std(ring) and np.std(ring) > 1e-4


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


@pytest.mark.parametrize("hidden", [{}, {"wear": 0.3, "friction_slope": 0.5, "loose_mass": 0.2}])
def test_results_do_not_depend_on_the_number_of_threads(hidden):
    one, three = (run(7, noise=RIG, hidden=hidden, threads=threads) for threads in (1, 3))
    np.testing.assert_array_equal(one.trajectories, three.trajectories)
    np.testing.assert_array_equal(one.impacts, three.impacts)


def test_a_drop_does_not_depend_on_the_others_and_has_the_releases_of_the_other_source():
    few, many = run(3, noise=RIG), run(8, noise=RIG)
    np.testing.assert_array_equal(few.trajectories, many.trajectories[many.trajectories["trial"] < 3])
    own = run(3, noise=RIG, own=True)
    np.testing.assert_allclose(few.trials[[*POSE, "vx", "omega"]], own.trials[[*POSE, "vx", "omega"]])
    assert few.header == own.header


def test_every_cause_is_supported_or_refused_by_name():
    assert set(SUPPORTED) | set(WITHOUT_ELEMENT) == set(CAUSES) | set(OWN)
    for name in WITHOUT_ELEMENT:
        with pytest.raises(UserError, match=name):
            run(1, hidden={name: CAUSES[name].size})


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"body": ELLIPSE.model_copy(update={"mass": None})}, "mass"),
        ({"contact": {"exponent": 1.5}}, "exponent"),
        ({"contact": {"steps": 19}}, "20 steps"),
        ({"hidden": {"plate_velocity": 0.1, "plate_amplitude": 1e-4}}, "one carriage"),
        ({"threads": 0}, "thread"),
        ({"release": at(height=0.03)}, "Raise the lower end"),
    ],
)
def test_says_what_is_wrong(change, text):
    with pytest.raises(UserError, match=text):
        run(1, **change)
