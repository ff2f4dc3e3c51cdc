"""The trial shown, velocities that never cross an impact, and energies that a free flight keeps."""

import numpy as np
import pandas as pd
import pytest
from small_study import BODY

from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.header import Header
from thesis_lib.foundation.errors import UserError
from thesis_lib.thesis.figures.chapter3.trajectories import (
    energies,
    figure_3_5,
    figure_3_6,
    pick_trial,
    sample_velocities,
)

ROUNDING = 1e-9  # m/s, rad/s, J: exact up to double precision of sums over eleven samples
G, HIT = 9.81, 0.1
BEFORE, AFTER = np.array([0.5, -1.0, 3.0]), np.array([0.4, 0.8, -9.0])
START = np.array([0.1, 0.2, 0.3])


def flight(q, v, tau):
    return q + np.multiply.outer(tau, v) - 0.5 * G * np.multiply.outer(tau**2, [0.0, 1.0, 0.0])


@pytest.fixture()
def bounce():
    """Noise-free flight with one hit at 0.1 s: t (50,), pose (50, 3), velocity (50, 3)."""
    t = np.arange(50) * 0.004
    at_hit = flight(START, BEFORE, np.array(HIT))
    after = t > HIT
    pose = np.where(after[:, None], flight(at_hit, AFTER, t - HIT), flight(START, BEFORE, t))
    fall = np.array([0.0, G, 0.0])
    velocity = np.where(after[:, None], AFTER - np.outer(t - HIT, fall), BEFORE - np.outer(t, fall))
    return t, pose, velocity


@pytest.fixture()
def dataset(bounce):
    t, pose, _ = bounce
    header = Header(schema=1, body=BODY, gravity=G, rate=250.0)
    table = pd.DataFrame({"trial": 7, "t": t, "x": pose[:, 0], "y": pose[:, 1], "theta": pose[:, 2]})
    return Dataset("bounce", header, table)


@pytest.fixture()
def arcs():
    return pd.DataFrame({"trial": [7], "impact": [0], "t": [HIT], "used": [True], "n_pre": [20], "n_post": [20]})


def test_velocities_are_exact_and_do_not_cross_the_hit(bounce):
    t, pose, velocity = bounce
    assert sample_velocities(t, pose, np.array([HIT + 1e-6]), G) == pytest.approx(velocity, abs=ROUNDING)


def test_too_few_samples_between_hits_give_nan(bounce):
    t, pose, _ = bounce
    found = sample_velocities(t, pose, np.array([0.0995, 0.1105]), G)
    assert np.isnan(found[25:28]).all() and np.isfinite(found[:25]).all() and np.isfinite(found[28:]).all()


def test_energy_is_kept_in_flight_and_lost_at_the_hit(bounce, dataset):
    t, pose, velocity = bounce
    total = energies(pose, velocity, dataset)[:, 2]
    first, second = total[t <= HIT], total[t > HIT]
    assert np.ptp(first) < ROUNDING and np.ptp(second) < ROUNDING
    spin = (BODY.radius_of_gyration**2) * (AFTER[2] ** 2 - BEFORE[2] ** 2)
    at_hit = BEFORE - [0.0, G * HIT, 0.0]
    gain = 0.5 * BODY.mass * (np.sum(AFTER[:2] ** 2) - np.sum(at_hit[:2] ** 2) + spin)
    assert second[0] - first[0] == pytest.approx(gain, abs=ROUNDING)


@pytest.mark.parametrize(
    ("used", "chosen"),
    [
        ({1: [1, 0, 1], 2: [1, 1, 1], 3: [1, 1, 1, 1]}, 2),  # three leading impacts; a fourth does not count
        ({4: [0, 1, 1], 5: [1, 1, 0], 6: [1, 0]}, 5),  # two are the best there is
        ({8: [0, 1], 9: [0, 1, 1]}, 9),  # none measures its first: the most
    ],
)
def test_trial_with_most_leading_impacts(used, chosen):
    rows = [(trial, i, flag) for trial, flags in used.items() for i, flag in enumerate(flags)]
    assert pick_trial(pd.DataFrame(rows, columns=["trial", "impact", "used"])) == chosen


def test_no_measurable_impact_is_said(arcs):
    with pytest.raises(UserError, match=r"left_out\.csv"):
        pick_trial(arcs.assign(used=False))


def test_figures_hold_samples_arcs_and_impacts(dataset, arcs, bounce):
    t, pose, _ = bounce
    q = flight(START, BEFORE, np.array(HIT))
    state = dict(zip(("x", "y", "theta"), q)) | dict(zip(("vx_post", "vy_post", "omega_post"), AFTER))
    state |= dict(zip(("vx_pre", "vy_pre", "omega_pre"), BEFORE - [0.0, G * HIT, 0.0]))
    _, table = figure_3_5(dataset, pd.DataFrame([{"trial": 7, "impact": 0, **state}]), arcs)
    y = table[table["series"] == "y"]
    samples, arc = y[y["kind"] == "sample"], y[y["kind"] == "arc"]
    assert samples["value"].to_numpy() == pytest.approx(pose[:, 1])
    # the curve passes through the samples: linear interpolation of a parabola in steps of 4 ms errs by g h²/8
    order = np.argsort(arc["t"].to_numpy(), kind="stable")
    near = np.abs(arc["t"].to_numpy()[order] - HIT) > 0.004
    expected = np.interp(arc["t"].to_numpy()[order][near], t, pose[:, 1])
    assert arc["value"].to_numpy()[order][near] == pytest.approx(expected, abs=G * 0.004**2 / 8 + ROUNDING)
    assert (table["kind"] == "impact").sum() == 1

    _, table = figure_3_6(dataset, arcs)
    wide = table[table["kind"] == "sample"].pivot(index="t", columns="series", values="energy")
    assert (wide["potential"] + wide["kinetic"]).to_numpy() == pytest.approx(wide["total"].to_numpy())
