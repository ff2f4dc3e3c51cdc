"""What drops of every engine promise: flight and truth, mechanics of a contact, camera and randomness, refusals.

The engines are our own integrator, MuJoCo, and Drake over a pad, in point and in hydroelastic contact.  What is
particular to one of them is in `test_compliant`, `test_mujoco_drops`, `test_drake_drops`.
"""

from functools import cache

import numpy as np
import pytest
from falling import (
    CORNERS,
    DISK,
    ELLIPSE,
    ENGINES,
    EXACT,
    FLAT,
    POSE,
    POST,
    PRE,
    RIG,
    SQUARE,
    at,
    contact_velocity,
    first,
    run,
)

from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.compliant.compiled import SLOW_TOUCHES
from thesis_lib.simulate.compliant.contacts import TRUTH
from thesis_lib.simulate.drake.drops import SURFACES
from thesis_lib.simulate.mujoco.causes import OWN
from thesis_lib.simulate.mujoco.causes import SUPPORTED as IN_MUJOCO
from thesis_lib.simulate.rig.hidden_causes import CAUSES
from thesis_lib.simulate.rig.tracker import Tracker

BODIES = {"ellipse": ELLIPSE, "square": SQUARE}
OTHERS = [name for name in ENGINES if name != "own"]
MAKES = {"mujoco": IN_MUJOCO, **SURFACES}  # causes
# m: how far the force acts from the lowest point at the touch, of contacts of 0.1 ms or less: the body moves, the
# middle of a patch is not its lowest point
LEVER = {"own": 1e-4, "mujoco": 3e-4, "pad": 1e-4, "point": 2e-4, "hydroelastic": 1e-3}
# s; that of Drake's pad, whose restitution comes from dampers, is 20 µs
SHORT = {"own": 2e-5, "mujoco": 1e-4, "pad": 2e-5, "point": 1e-4, "hydroelastic": 1e-4}
# an ellipse in hydroelastic contact costs a tenth of a second each, a square nothing
FEW, BODY = {"hydroelastic": 5}, {"hydroelastic": SQUARE}
every = pytest.mark.parametrize("engine", ENGINES)
other = pytest.mark.parametrize("engine", OTHERS)


@cache
def plain(engine):
    return run(engine, FEW.get(engine, 15), duration=0.45)


@cache
def short(engine, shape):
    contact = {"contact_time": SHORT[engine], "mu": 0.15} | ({"steps": 50} if engine == "mujoco" else {})
    return run(engine, 12, BODIES[shape], contact=contact).impacts


# --- flight and truth ---


@every
def test_flight_is_a_parabola_and_the_recording_regular(engine):
    drops = run(engine, 2, release=at(height=0.5, vx=0.7, omega=-9.0, theta=1.0), duration=0.25)
    t = drops.trajectories["t"].to_numpy()
    expected = np.column_stack([0.7 * t, 0.5 - 0.5 * 9.81 * t**2, 1.0 - 9.0 * t])
    np.testing.assert_allclose(drops.trajectories[POSE], expected, atol=EXACT)
    np.testing.assert_allclose(t, np.tile(np.arange(63) / 250.0, 2), atol=EXACT)


@every
def test_the_truth_agrees_with_samples_without_noise(engine):
    """Velocities from the samples around an impact are those of the truth: neither is made from the other."""
    table, compared = plain(engine).trajectories, 0
    assert tuple(plain(engine).impacts.columns) == TRUTH
    for _, one in first(plain(engine)).iterrows():
        mine = table[table["trial"] == one["trial"]]
        t, q = mine["t"].to_numpy(), mine[POSE].to_numpy()
        end = one["t"] + one["duration"]
        for near, names in ((np.flatnonzero(t < one["t"])[-3:], PRE), (np.flatnonzero(t > end)[:3], POST)):
            if len(near) < 3 or (names is POST and q[near, 1].min() < 0.036):
                continue  # the next impact may be among them
            slope = np.polyfit(t[near] - (one["t"] if names is PRE else end), q[near], 2)[1]
            np.testing.assert_allclose(slope, one[names].to_numpy(float), atol=2e-3)
            compared += 1
    assert compared >= FEW.get(engine, 15)


@every
def test_a_contact_begins_where_the_outline_meets_the_plate(engine):
    one, square = first(plain(engine)), first(run(engine, 4, SQUARE))
    a, b = ELLIPSE.shape.semi_axes
    np.testing.assert_allclose(one["y"], np.hypot(a * np.sin(one["theta"]), b * np.cos(one["theta"])), atol=EXACT)
    np.testing.assert_allclose(square["y"] + square["r_y"], 0.0, atol=EXACT)
    np.testing.assert_allclose(np.hypot(square["r_x"], square["r_y"]), np.hypot(*CORNERS[0]), atol=EXACT)


# --- mechanics of a contact ---


@pytest.mark.parametrize("shape", BODIES)
@every
def test_momentum_balance_friction_cone_and_energy_of_every_contact(engine, shape):
    one, body = short(engine, shape), BODIES[shape]
    d = one[POST].to_numpy() - one[PRE].to_numpy()
    free = np.outer(one["duration"], [0.0, -9.81])
    np.testing.assert_allclose(body.mass * (d[:, :2] - free), one[["c_t", "c_n"]].to_numpy(), atol=EXACT)
    single = one["r_x"].abs() < FLAT  # else two corners touch, and the couple has two levers
    assert single.sum() > 10
    error = body.radius_of_gyration**2 * d[:, 2] - one["r_x"] * d[:, 1] + one["r_y"] * d[:, 0]
    np.testing.assert_allclose(error[single], 0.0, atol=LEVER[engine] * np.abs(d[:, :2]).max())
    assert (np.abs(one["c_t"]) < (0.15 + 1e-6) * one["c_n"]).all()
    # gravity's work during it
    given = body.mass * 9.81 * (np.hypot(one["vx_pre"], one["vy_pre"]) + 0.1) * one["duration"]
    assert (one["energy_change"] < given).all() and one["energy_change"].mean() < -0.01


@pytest.mark.parametrize("engine", ["own", "mujoco", "pad"])
def test_friction_slides_on_coulombs_cone(engine):
    one = run(engine, 25, contact={"mu": 0.05}).impacts
    before, after = contact_velocity(one, "pre")[0], contact_velocity(one, "post")[0]
    # so fast that viscous friction is beyond the cone throughout
    slides = (before * after > 0.0) & (np.abs(after) > 0.8)
    assert slides.sum() > 5
    np.testing.assert_allclose(np.abs(one["c_t"] / one["c_n"])[slides], 0.05, atol=1e-3)


@pytest.mark.parametrize("engine", ["own", "pad"])
def test_a_disk_sticks_or_slips_as_a_rigid_one(engine):
    one = first(run(engine, 40, DISK, at(height=(0.06, 0.6), vx=(-4.0, 4.0), omega=(-20.0, 20.0))))
    v, after = one[PRE].to_numpy(), one[POST].to_numpy()
    slip, lever = v[:, 0] + 0.03 * v[:, 2], 1.0 + 0.03**2 / 0.02**2
    c_n = -1.55 * v[:, 1]
    c_t = np.clip(-slip / lever, -0.15 * c_n, 0.15 * c_n)
    stuck = np.abs(slip / lever) < 0.15 * c_n
    assert min(stuck.sum(), (~stuck).sum()) > 5
    expected = v + np.column_stack([c_t, c_n, 0.03 * c_t / 0.02**2])
    # m/s, of changes of 2 to 5 m/s; friction that is regularised leaves up to its slip of 2 mm/s where it sticks
    np.testing.assert_allclose((after - expected) * [1, 1, 0.02], 0.0, atol=0.012)


# what two integrators may differ by: 20 µs with friction over a pad; without friction in contacts of 0.2 ms at
# impedance 0.9999, where MuJoCo's restitution knows no lever, between impulses of a damper and of a hysteretic spring
RIGID = {"pad": {"contact_time": 2e-5}, "mujoco": {"mu": 0.0, "contact_time": 2e-4, "steps": 80}}
AGREE = {"pad": 0.01, "mujoco": 0.02}  # m/s, of changes of 2 to 5 m/s
# m/s: MuJoCo finds the top of a box to 1e-10 m, so that a part of a step may feel it too early: B v dt / 6
EARLY = 5e-3
IN_BOTH = [
    *({"inertia_error": 0.2}, {"tilt": 0.065}, {"wear": 0.3}, {"loose_mass": 0.17}, {"plate_amplitude": 5e-4}),
    *({"com_offset_x": 2e-3, "gravity_error": 0.65}, {"quadratic_drag": 0.23, "magnus": 0.039}),
    *({"linear_drag": 0.42, "spin_damping": 0.47}, {"size_error": 0.04, "surface_height": 1e-3}),
    {"corner_radius": 4e-3, "plate_velocity": 0.1},
]
BY_PLACE = [{"restitution_slope": 0.5}, {"orientation_restitution": 0.2}]


@pytest.mark.slow
@pytest.mark.parametrize("shape", BODIES)
@pytest.mark.parametrize(
    ("engine", "hidden"),
    [("pad", hidden) for hidden in IN_BOTH] + [("mujoco", hidden) for hidden in (*IN_BOTH, *BY_PLACE)],
    ids=lambda part: part if isinstance(part, str) else "+".join(part),
)
def test_first_impacts_agree_with_our_own_integrator(engine, shape, hidden):
    """Two integrators, two contact models: the same flights, and the same rebounds."""
    body, own = BODIES[shape], first(run("own", 12, BODIES[shape], hidden=hidden, contact=RIGID[engine]))
    made, own = made_with(engine, shape, **hidden).set_index("trial"), own.set_index("trial")
    assert list(made.index) == list(own.index) and len(made) >= 10
    np.testing.assert_allclose(made[["t", *POSE]], own[["t", *POSE]], atol=2e-6)
    scale = [1.0, 1.0, body.radius_of_gyration]
    early = engine == "mujoco" and "plate_amplitude" in hidden
    np.testing.assert_allclose(made[PRE] * scale, own[PRE] * scale, atol=EARLY if early else 2e-5)
    # within a hair's breadth of flat two corners land in one contact, and so do the differences of two contact models
    apart = own["r_x"].abs() < (FLAT - hidden.get("corner_radius", 0.0) if shape == "square" else 1.0)
    assert apart.sum() >= 7
    error = ((made[POST] - own[POST]) * scale).abs()[apart]
    assert error.to_numpy().max() < AGREE[engine]
    if set(hidden) & {"wear", "restitution_slope", "orientation_restitution", "inertia_error", "plate_amplitude"}:
        # the tolerance is far below what the mechanism does
        without = made_with(engine, shape).set_index("trial")
        assert ((made[POST] - without[POST]) * scale).abs().to_numpy().max() > 1.5 * AGREE[engine]


@cache
def made_with(engine, shape, **hidden):
    rigid = RIGID[engine] | ({"impedance": 0.9999} if engine == "mujoco" else {})
    return first(run(engine, 12, BODIES[shape], hidden=hidden, contact=rigid))


# --- camera, end and randomness ---


@every
def test_camera_faults_reach_the_recording_with_the_signs_of_the_format(engine):
    hidden = {"mirrored": True, "angle_offset": 0.1, "length_scale": 0.02, "drift": 0.3}
    seen, true = (run(engine, 3, BODY.get(engine, ELLIPSE), hidden=h).trajectories for h in (hidden, {}))
    np.testing.assert_allclose(seen["theta"], 0.1 - true["theta"], atol=EXACT)
    np.testing.assert_allclose(seen["y"], 1.02 * true["y"], atol=EXACT)
    np.testing.assert_allclose(seen["x"], 1.02 * true["x"] + 0.3 * true["t"], atol=EXACT)


@every
def test_a_lag_shows_an_earlier_angle_and_nothing_else(engine):
    # one sample
    true, late = (run(engine, 3, BODY.get(engine, ELLIPSE), hidden={"time_lag": lag}) for lag in (0.0, 0.004))
    a, b = (d.trajectories[d.trajectories["trial"] == 2] for d in (true, late))
    np.testing.assert_allclose(b["theta"].to_numpy()[1:], a["theta"].to_numpy()[:-1], atol=1e-7)
    np.testing.assert_allclose(b[["x", "y"]], a[["x", "y"]], atol=1e-7)
    release = true.trials.iloc[2]
    np.testing.assert_allclose(b["theta"].iloc[0], release["theta"] - 0.004 * release["omega"], atol=EXACT)


@every
def test_a_tracker_of_its_own_time_constant_is_late_by_it(engine):
    """The same poses, late by T: θ of a body that turns at a constant rate."""
    plain, slow = (run(engine, 2, duration=0.1, tracker=tracker) for tracker in (None, Tracker(time_constant=2e-3)))
    late = (plain.trajectories["theta"] - slow.trajectories["theta"])[:20] / plain.trials["omega"][0]
    np.testing.assert_allclose(late, 2e-3, rtol=1e-3)


@every
def test_a_recording_ends_where_the_body_rests(engine):
    drops = run(engine, 2, DISK, at(height=0.05), contact={"epsilon": 0.3}, duration=0.5)
    last = drops.trajectories.groupby("trial")["t"].max()
    # where restitution is the higher the slower the contact, it takes longer
    assert (last < (0.45 if engine in ("own", "mujoco", "pad") else 0.51)).all()
    assert (drops.trials["t_end"] >= last - 1e-9).all()
    assert drops.trials["contacts"].min() >= SLOW_TOUCHES


@every
def test_a_drop_depends_on_the_seed_alone_and_has_the_release_of_every_engine(engine):
    body = BODY.get(engine, ELLIPSE)
    few, again, more = (run(engine, n, body, noise=RIG) for n in (3, 3, 5))
    np.testing.assert_array_equal(few.trajectories, again.trajectories)
    np.testing.assert_array_equal(few.trajectories, more.trajectories[more.trajectories["trial"] < 3])
    own = run("own", 3, body, noise=RIG)
    np.testing.assert_allclose(few.trials[[*POSE, "vx", "omega"]], own.trials[[*POSE, "vx", "omega"]])
    assert few.header == own.header and "hidden" not in few.header.description


# --- refusals ---


@other
def test_every_cause_is_made_or_refused_by_name(engine):
    assert set(MAKES[engine]) <= set(CAUSES) | set(OWN)
    for name in set(CAUSES) - set(MAKES[engine]):
        with pytest.raises(UserError, match=name):
            run(engine, 1, SQUARE, hidden={name: CAUSES[name].size})


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"body": ELLIPSE.model_copy(update={"mass": None})}, "mass"),
        ({"rate": -1.0}, "rate"),
        ({"release": at(height=0.03)}, "Raise the lower end"),
        ({"hidden": {"size_error": 1.0}, "release": at(height=0.06)}, "Raise the lower end"),
    ],
)
@every
def test_says_what_is_wrong(engine, change, text):
    with pytest.raises(UserError, match=text):
        run(engine, 2, **change)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"contact": {"exponent": 1.5}}, "exponent"),
        ({"hidden": {"plate_velocity": 0.1, "plate_amplitude": 1e-4}}, "one carriage"),
    ],
)
@other
def test_says_what_a_foreign_engine_cannot_make(engine, change, text):
    with pytest.raises(UserError, match=text):
        run(engine, 1, **change)
