"""Drops under a given law: energy, contact, agreement with the independent simulator, what the camera reports."""

from functools import cache

import numpy as np
import pandas as pd
import pytest
from hidden_effects import RIG_NOISE
from plain_drops import LAW, TRUTH, sizes

from thesis_lib.bodies.body import Noise
from thesis_lib.contact import LAWS
from thesis_lib.critique.drops.fit import fit
from thesis_lib.critique.drops.model import Model
from thesis_lib.critique.drops.observations import observe
from thesis_lib.critique.simulation.law_drops import simulate_law_drops
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.effects import EFFECTS
from thesis_lib.simulate.rig.hidden_causes import ELLIPSE_BODY, PROOF_RELEASE
from thesis_lib.simulate.stepping.drops import simulate_drops

DT = 1.0 / 250.0
GRAVITY = 9.81
EXACT = Noise(position=1e-12, angle=1e-12)  # as good as none
FREE = 1e-5  # m/s², rad/s²: second differences of exact poses are that of free fall to 1e-12 / DT²
SIGMAS = 4.0


@cache
def simulated(
    *effects: str, law: str = LAW.name, factor: float = 1.0, n: int = 12, seed: int = 0, noise: Noise = EXACT
) -> Dataset:
    chosen = tuple(EFFECTS[name] for name in effects)
    values = dict(TRUTH)
    for effect in chosen:
        values |= sizes(effect, factor)
    rng = np.random.default_rng(seed)
    return simulate_law_drops(ELLIPSE_BODY, PROOF_RELEASE, n, Model(LAWS[law], chosen), values, noise=noise, rng=rng)


def energies(dataset: Dataset, trial: int) -> np.ndarray:
    """Energy per unit mass, J/kg, wherever three samples in a row are in free flight."""
    q = dataset.trajectories.loc[dataset.trajectories["trial"] == trial, ["x", "y", "theta"]].to_numpy()
    a = (q[2:] - 2 * q[1:-1] + q[:-2]) / DT**2
    v = (q[2:] - q[:-2]) / (2 * DT)  # exact on a parabola
    free = (np.abs(a - [0.0, -GRAVITY, 0.0]) < FREE).all(axis=1)
    kinetic = 0.5 * (v[:, 0] ** 2 + v[:, 1] ** 2 + dataset.k_g**2 * v[:, 2] ** 2)
    return (kinetic + GRAVITY * q[1:-1, 1])[free]


@pytest.mark.parametrize("law", ["anitescu_potra_newton", "wang_mason", "mirtich"])
def test_energy_never_rises_and_falls_at_impacts(law):
    dataset = simulated(law=law)
    for trial in dataset.trials:
        E = energies(dataset, trial)
        assert len(E) > 10
        assert np.diff(E).max() < 1e-6 * E[0]
        if dataset.trajectories["trial"].value_counts()[trial] > 100:
            assert E[-1] < 0.9 * E[0]


def test_the_body_stays_above_the_surface_and_touches_it():
    dataset = simulated()
    table = dataset.trajectories
    gap = dataset.shape.gap(table["y"].to_numpy(), table["theta"].to_numpy(), 0.0)
    assert gap.min() > -1e-9
    lowest = pd.Series(gap).groupby(table["trial"]).min()
    assert lowest.max() < 0.02  # 3 m/s for half a sampling period, and some


def test_a_raised_surface_is_touched_where_it_is():
    height = sizes(EFFECTS["surface_height"])["surface_height.h"]
    assert height != 0.0
    gaps = []
    for effects in ((), ("surface_height",)):
        table = simulated(*effects).trajectories
        gaps.append(simulated().shape.gap(table["y"].to_numpy(), table["theta"].to_numpy(), 0.0).min())
    assert gaps[1] >= min(height, 0.0) - 1e-9 and gaps[1] - gaps[0] == pytest.approx(height, abs=5e-4)


def test_drops_agree_with_the_independent_simulator_until_chaos():
    n, seed = 12, 0
    truth = simulate_drops(
        ELLIPSE_BODY, PROOF_RELEASE, n, **TRUTH, duration=0.6, noise=EXACT, rng=np.random.default_rng(seed)
    )
    ours = simulated(n=n, seed=seed)
    compared = 0
    for trial, hits in truth.impacts.groupby("trial"):
        until = hits["t"].iloc[1] if len(hits) > 1 else np.inf  # over the first impact
        tables = [
            table.loc[(table["trial"] == trial) & (table["t"] < until), ["t", "x", "y", "theta"]].to_numpy()
            for table in (truth.trajectories, ours.trajectories)
        ]
        shorter = min(map(len, tables))
        assert shorter > 5
        np.testing.assert_allclose(tables[0][:shorter], tables[1][:shorter], atol=1e-6)
        compared += tables[1][:shorter][-1, 0] > hits["t"].iloc[0]
    assert compared >= n - 2


def test_the_fit_finds_the_truth_in_drops_as_measured():
    o = observe(simulated(n=30, seed=3, noise=RIG_NOISE))
    fitted = fit(Model(LAW), o)
    for name, value in TRUTH.items():
        assert abs(fitted.values[name] - value) < SIGMAS * fitted.std[name]


@pytest.mark.parametrize("name", ["linear_drag", "com_offset"])
def test_the_fit_finds_an_effect_and_the_coefficients_beside_it(name):
    """Drops integrate the effect in small steps; the fit extrapolates arcs: neither may bias the other."""
    o = observe(simulated(name, n=40, seed=2, noise=RIG_NOISE))
    values = TRUTH | sizes(EFFECTS[name])
    fitted = fit(Model(LAW, (EFFECTS[name],)), o)
    for key, value in values.items():
        assert abs(fitted.values[key] - value) < SIGMAS * fitted.std[key], key


def test_a_drifting_camera_adds_its_drift_and_nothing_else():
    plain, seen = simulated().trajectories, simulated("sensor_drift").trajectories
    drift = sizes(EFFECTS["sensor_drift"])["sensor_drift.d_x"]
    np.testing.assert_allclose(seen["x"] - plain["x"], drift * plain["t"], atol=1e-9)
    np.testing.assert_allclose(seen[["y", "theta"]], plain[["y", "theta"]], atol=1e-9)


def test_a_mirrored_camera_mirrors_the_angle_only():
    plain, seen = simulated().trajectories, simulated("mirrored_rotation").trajectories
    np.testing.assert_allclose(seen["theta"], -plain["theta"], atol=1e-9)
    np.testing.assert_allclose(seen[["x", "y"]], plain[["x", "y"]], atol=1e-9)


def test_drag_takes_energy_in_flight():
    dragged = simulated("linear_drag", factor=5.0).trajectories
    plain = simulated().trajectories
    first = plain["t"] <= 0.08  # before any impact of the higher releases
    high = plain.loc[first].groupby("trial")["y"].min() > 0.05
    fall = [
        table.loc[table["t"] <= 0.08].groupby("trial")["y"].agg(lambda y: y.iloc[0] - y.iloc[-1])[high]
        for table in (plain, dragged)
    ]
    assert high.sum() >= 3 and (fall[1] < fall[0]).all()


def test_deterministic_and_seeded():
    one = simulated(n=5, seed=1, noise=RIG_NOISE).trajectories
    two = simulated.__wrapped__(n=5, seed=1, noise=RIG_NOISE).trajectories
    other = simulated(n=5, seed=2, noise=RIG_NOISE).trajectories
    pd.testing.assert_frame_equal(one, two, check_exact=True)
    assert not np.array_equal(one["x"].to_numpy()[:20], other["x"].to_numpy()[:20])
