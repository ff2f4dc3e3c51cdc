"""Drops in MuJoCo: restitution, convergence and the causes that only MuJoCo has; else see `test_engine_contract`."""

from functools import partial

import falling
import numpy as np
import pytest
from falling import DISK, ELLIPSE, EXACT, POSE, POST, SQUARE, at, contact_velocity, first

from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.mujoco.causes import OWN, SUPPORTED, WITHOUT_ELEMENT
from thesis_lib.simulate.rig.hidden_causes import CAUSES

run = partial(falling.run, "mujoco")


def test_elastic_contact_without_friction_keeps_energy():
    """In a short contact: while the body turns, the stiffness that MuJoCo gives it changes with the effective mass."""
    one = run(25, contact={"mu": 0.0, "epsilon": 1.0, "contact_time": 1e-4, "steps": 100}).impacts
    kinetic = 0.5 * ELLIPSE.mass * (one[["vx_pre", "vy_pre"]] ** 2).sum(axis=1)
    np.testing.assert_allclose(one["energy_change"] / kinetic, 0.0, atol=5e-3)


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


@pytest.mark.slow
def test_every_cause_that_mujoco_makes_changes_the_drops():
    """None is accepted and then left out; the camera's are seen in the samples alone."""
    given = {"duration": 0.35, "contact": {"steps": 50}}
    unchanged = {id(body): run(4, body, **given).trajectories for body in (SQUARE, ELLIPSE)}
    for name in SUPPORTED:
        body = SQUARE if name in CAUSES and CAUSES[name].polygon_only else ELLIPSE
        size = 1.0 if name == "mirrored" else 5.0 * {**CAUSES, **OWN}[name].size
        size = float(np.clip(size, -0.9, 0.9)) if name in ("stiffness_patch", "soft_spot", "loose_mass") else size
        wide = {"patch_centre": 0.0, "patch_width": 0.6, name: size}  # so that every drop lands on it
        merged = unchanged[id(body)].merge(run(4, body, hidden=wide, **given).trajectories, on=["trial", "t"])
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


def test_says_what_is_wrong():
    assert set(SUPPORTED) | set(WITHOUT_ELEMENT) == set(CAUSES) | set(OWN)
    with pytest.raises(UserError, match="20 steps"):
        run(1, contact={"steps": 19})
