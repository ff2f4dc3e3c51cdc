"""Impulses from poses against Drake's contact force, its sensor, and what a declared duration makes of a peak."""

import numpy as np
import pytest

from thesis_lib.bodies.body import Noise
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.impacts import POSE, V_PRE
from thesis_lib.datasets.format.samples import ArcSettings
from thesis_lib.datasets.impacts.detect import find_impacts
from thesis_lib.effects.effect import Rig
from thesis_lib.foundation.errors import UserError
from thesis_lib.thesis.identify.impacts.forces import (
    ForcePlate,
    ImpactForces,
    drop_ellipses,
    estimate_impulses,
    force_summary,
    peak_force,
    shown_impact,
    study_impact_forces,
)

SETTINGS = ImpactForces(drops=12)
STEP_FORCE = 1e-4  # N s: friction that changes its sense within a step of 5 µs, at some ten newtons
SIGMAS = 4.0


@pytest.fixture(scope="module")
def drops():
    return drop_ellipses(SETTINGS, np.random.default_rng(4))


@pytest.fixture(scope="module")
def rows(drops):
    return study_impact_forces(drops, SETTINGS)


def first_contact(drops):
    truth = drops.impacts.iloc[0]
    q, v = (truth[list(names)].to_numpy(float) for names in (POSE, V_PRE))
    return truth, ForcePlate(SETTINGS).contact(q, v, truth["t"])


@pytest.mark.slow
def test_integral_of_the_force_is_the_change_of_momentum(drops):
    truth, history = first_contact(drops)
    assert history.impulse == pytest.approx(truth[["c_t", "c_n"]].to_numpy(float), abs=STEP_FORCE)
    assert history.force[0, 1] == 0.0 and (history.force[:, 1] >= 0.0).all()
    # Coulomb's cone, at every instant
    assert (np.abs(history.force[:, 0]) <= SETTINGS.mu * history.force[:, 1] + 1e-6).all()


def test_sensor_keeps_the_impulse_but_not_the_peak(drops):
    truth, history = first_contact(drops)
    integral = np.trapezoid(history.response, history.response_t)
    assert integral == pytest.approx(history.impulse[1], rel=0.01)
    assert abs(history.response.max() / history.force[:, 1].max() - 1.0) > 0.05
    assert history.response.min() < -0.2 * history.force[:, 1].max()
    assert np.interp(history.sensor_t, history.response_t, history.response) == pytest.approx(history.reading)
    # it is read on its own clock
    ticks = (history.sensor_t + truth["t"]) * SETTINGS.sensor_rate
    assert ticks == pytest.approx(np.round(ticks), abs=1e-6)


@pytest.mark.slow
def test_impulses_are_unbiased_and_stated_errors_hold(rows):
    table, left_out = rows
    arcs = table[table["method"] == "arcs"]
    assert len(arcs) + sum(left_out.values()) == 3 * SETTINGS.drops
    for name in ("c_n", "c_t"):
        z = (arcs[name] - arcs[f"true_{name}"]) / arcs[f"{name}_std"]
        assert abs(z.mean()) < SIGMAS / np.sqrt(len(z))
        assert 0.6 < z.std() < 1.4
    # what the noise of 0.3 mm lets through, and no fit to the truth
    assert 1e-5 < arcs["c_n_std"].median() < 5e-4


@pytest.mark.slow
def test_estimator_finds_the_noise_that_it_is_not_told():
    stated = []
    for noise in (Noise(position=3e-4, angle=3e-3), Noise(position=3e-5, angle=3e-4)):
        settings = SETTINGS.model_copy(update={"noise": noise, "drops": 6})
        found, rig = observed(drop_ellipses(settings, np.random.default_rng(4)))
        stated.append(np.median(estimate_impulses(found, rig)["arcs"][1][:, 0, 0]))
    assert np.sqrt(stated[0] / stated[1]) == pytest.approx(10.0, rel=0.15)


def observed(drops):
    header = drops.header.model_copy(update={"noise": None})
    found = find_impacts(Dataset("drops", header, drops.trajectories), ArcSettings(stray_acceleration=False))
    return found, Rig(header.body.shape, header.body.radius_of_gyration, header.gravity, 0.0)


def test_rigid_link_helps_where_contact_is_short_and_errs_where_it_is_not(rows):
    settings = SETTINGS.model_copy(update={"contact_time": 2e-5, "declared_duration": 2e-5, "drops": 8})
    made = drop_ellipses(settings, np.random.default_rng(4))
    found, rig = observed(made)
    z = {}
    for name, (c, cov) in estimate_impulses(found, rig).items():
        error = []
        for i, (trial, t) in enumerate(zip(found.impacts.trial, found.impacts.t)):
            near = made.impacts[(made.impacts["trial"] == trial) & ((made.impacts["t"] - t).abs() < 2e-3)]
            if len(near) == 1:
                error.append((c[i, 0] - near["c_t"].iloc[0]) / np.sqrt(cov[i, 0, 0]))
        z[name] = np.std(error)
        assert len(error) > 20
    assert z["arcs_link"] < 1.5
    table, _ = rows
    linked = table[table["method"] == "arcs_link"]
    assert ((linked["c_t"] - linked["true_c_t"]) / linked["c_t_std"]).std() > 1.5


def test_linked_covariance_is_smaller(rows):
    wide = rows[0].pivot(index=["trial", "impact"], columns="method", values="c_n_std")
    assert (wide["arcs_link"] <= wide["arcs"] * (1.0 + 1e-9)).all()


def test_peak_is_that_of_a_half_sine_of_the_impulse():
    t = np.linspace(0.0, 2e-3, 20001)
    pulse = peak_force(0.12, 2e-3) * np.sin(np.pi * t / 2e-3)
    assert np.trapezoid(pulse, t) == pytest.approx(0.12, rel=1e-6)
    assert peak_force(0.12, 1e-3) == pytest.approx(2.0 * pulse.max())


def test_summary_is_that_of_the_rows(rows):
    table, _ = rows
    summary = force_summary(table).set_index(["method", "quantity", "reference"])
    arcs = table[table["method"] == "arcs"]
    row = summary.loc[("arcs", "peak", "peak_true")]
    assert row["mean_error"] == pytest.approx((arcs["peak"] - arcs["peak_true"]).mean())
    error = (arcs["c_n"] - arcs["true_c_n"]).abs()
    inside = (error <= 1.96 * arcs["c_n_std"]).mean()
    assert summary.loc[("arcs", "c_n", "true_c_n"), "coverage_95"] == pytest.approx(inside)


def test_the_impact_shown_is_the_median_first_hit(rows, drops):
    row, history = shown_impact(rows[0], drops, SETTINGS)
    assert row["impact"] == 0 and history.force[:, 1].max() == pytest.approx(row["peak_true"])


def test_recordings_without_impact_are_said():
    settings = SETTINGS.model_copy(update={"duration": 0.1, "drops": 2})
    drops = drop_ellipses(settings, np.random.default_rng(0))
    with pytest.raises(UserError, match="duration"):
        study_impact_forces(drops, settings)
