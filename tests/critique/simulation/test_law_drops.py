"""Drops under a given law: energy, contact, agreement with Drake and with the independent simulator, the camera."""

from functools import cache

import numpy as np
import pandas as pd
import pytest
from hidden_effects import RIG_NOISE
from plain_drops import LAW, TRUTH, sizes

from thesis_lib.bodies.body import Body, Noise
from thesis_lib.critique.contacts.bases import BASES
from thesis_lib.critique.contacts.model import Model
from thesis_lib.critique.likelihood.fit import fit
from thesis_lib.critique.likelihood.observations import observe
from thesis_lib.critique.simulation.drake_augmented import drake_poses
from thesis_lib.critique.simulation.law_drops import between, own_poses, simulate_law_drops
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.effects import EFFECTS
from thesis_lib.mechanics.state import State
from thesis_lib.simulate.rig.hidden_causes import ELLIPSE_BODY, PROOF_RELEASE, SQUARE
from thesis_lib.simulate.stepping.drops import simulate_drops

DT = 1.0 / 250.0
GRAVITY = 9.81
EXACT = Noise(position=1e-12, angle=1e-12)  # as good as none
FREE = 1e-5  # m/s², rad/s²: second differences of exact poses are that of free fall to 1e-12 / DT²
SIGMAS = 4.0
# the other simulator takes drag by a midpoint rule in steps of 1 ms, and impacts amplify what that leaves
SAME_FLIGHT, OWN_FLIGHT = 1e-8, 5e-4


def model_of(*effects: str, law: str = LAW.name, factor: float = 1.0, tau: float | None = None) -> tuple[Model, dict]:
    """The law with effects at a multiple of their scales, and its values; contacts take time with `tau` in s."""
    chosen = tuple(EFFECTS[name] for name in effects)
    values = TRUTH | ({} if tau is None else {"tau": tau})
    for effect in chosen:
        values = values | sizes(effect, factor)
    return Model(BASES[law], chosen, takes_time=tau is not None), values


@cache
def simulated(
    *effects: str, n: int = 12, seed: int = 0, noise: Noise = EXACT, body: Body = ELLIPSE_BODY, poses=own_poses, **how
) -> Dataset:
    rng = np.random.default_rng(seed)
    model, values = model_of(*effects, **how)
    return simulate_law_drops(body, PROOF_RELEASE, n, model, values, noise=noise, rng=rng, poses=poses)


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


@pytest.mark.parametrize("names", [(), ("linear_drag",), ("com_offset",)])
def test_the_fit_finds_the_coefficients_and_an_effect_beside_them(names):
    """Drops integrate the effect in small steps; the fit extrapolates arcs: neither may bias the other."""
    o = observe(simulated(*names, n=40, seed=2, noise=RIG_NOISE))
    model, values = model_of(*names)
    fitted = fit(model, o)
    for key, value in values.items():
        assert abs(fitted.values[key] - value) < SIGMAS * fitted.std[key], key


def test_the_camera_adds_its_faults_to_the_poses_and_nothing_else():
    plain, drifting, mirrored = (
        simulated(*names).trajectories for names in ((), ("sensor_drift",), ("mirrored_rotation",))
    )
    drift = sizes(EFFECTS["sensor_drift"])["sensor_drift.d_x"]
    np.testing.assert_allclose(drifting["x"] - plain["x"], drift * plain["t"], atol=1e-9)
    np.testing.assert_allclose(drifting[["y", "theta"]], plain[["y", "theta"]], atol=1e-9)
    np.testing.assert_allclose(mirrored["theta"], -plain["theta"], atol=1e-9)
    np.testing.assert_allclose(mirrored[["x", "y"]], plain[["x", "y"]], atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("body", [ELLIPSE_BODY, SQUARE], ids=["ellipse", "square"])
@pytest.mark.parametrize("law", ["mirtich", "compliant_contact"])
def test_contacts_last_as_long_as_the_model_says(law, body):
    model, values = model_of(law=law, tau=6e-4)
    fitted = fit(model, observe(simulated(law=law, tau=6e-4, body=body, n=30, noise=RIG_NOISE)))
    for name, value in values.items():
        assert abs(fitted.values[name] - value) < SIGMAS * fitted.std[name], name


def test_a_body_sinks_in_while_it_touches():
    """At most by τ times the fastest approach, 3 m/s; and the shorter the contact, the less."""
    depths = []
    for tau in (6e-4, 1.8e-3):
        made = simulated(law="mirtich", tau=tau, n=30, noise=RIG_NOISE)
        table = made.trajectories
        depths.append(-made.shape.gap(table["y"].to_numpy(), table["theta"].to_numpy(), 0.0).min())
        assert 3.0 * RIG_NOISE.position < depths[-1] < 3.0 * tau
    assert depths[1] > 2.0 * depths[0]


def test_a_contact_that_takes_no_time_is_an_impulse():
    short, rigid = simulated(tau=1e-8).trajectories, simulated().trajectories
    first = rigid["t"] < 0.3  # later impacts amplify what differs
    np.testing.assert_allclose(short[first][["x", "y", "theta"]], rigid[first][["x", "y", "theta"]], atol=1e-5)


def test_the_path_within_a_contact_joins_both_ends():
    zero = np.zeros(1)
    touch = State.of(np.array([[0.0, 0.03, 0.1]]), np.array([[0.5, -2.0, 3.0]]), zero, zero + 0.1)
    end = State.of(np.array([[0.0005, 0.03, 0.11]]), np.array([[0.3, 1.0, 9.0]]), zero, zero + 0.101)
    np.testing.assert_allclose(between(touch, end, 0.1).q, touch.q, atol=1e-15)
    np.testing.assert_allclose(between(touch, end, 0.1).v, touch.v, atol=1e-12)
    near = between(touch, end, 0.101 - 2e-9)
    np.testing.assert_allclose(near.v, end.v, atol=1e-3)
    middle = between(touch, end, 0.1005)
    assert middle.t[0] == pytest.approx(0.1005) and middle.y[0] == pytest.approx(0.03 - 0.001 * 3.0 / 8.0)
    assert between(touch, end, 0.101) is end


def both(*names: str, tau: float | None = None) -> tuple[pd.DataFrame, pd.DataFrame]:
    """The first half second in Drake and in the program's own simulator, side by side."""
    of = {"law": "wang_mason", "factor": 3.0, "tau": tau, "n": 6}
    tables = (simulated(*names, **of, poses=poses).trajectories for poses in (drake_poses, own_poses))
    return tuple(table[table["t"] < 0.5].reset_index(drop=True) for table in tables)


@pytest.mark.parametrize("names", [(), ("tangential_restitution",), ("linear_drag",), ("mirrored_rotation",)])
def test_drake_and_the_own_simulator_agree(names):
    drake, own = both(*names)
    assert len(drake) == len(own) > 50 * 6
    np.testing.assert_allclose(drake["t"], own["t"], atol=1e-9)
    tolerance = OWN_FLIGHT if "linear_drag" in names else SAME_FLIGHT
    np.testing.assert_allclose(drake[["x", "y", "theta"]], own[["x", "y", "theta"]], atol=tolerance)
    if names and names != ("mirrored_rotation",):  # the effect acts far beyond the tolerance
        with_it, without = (table.set_index(["trial", "t"]) for table in (drake, both()[0]))
        assert (with_it - without).dropna().abs()["x"].max() > 10.0 * OWN_FLIGHT


@pytest.mark.parametrize("names", [(), ("mirrored_rotation",)])
def test_contacts_last_as_long_in_drake(names):
    drake, own = both(*names, tau=2e-3)  # T is 3.7 ms: most contacts hold a sample
    np.testing.assert_allclose(drake["t"], own["t"], atol=1e-9)
    np.testing.assert_allclose(drake[["x", "y", "theta"]], own[["x", "y", "theta"]], atol=SAME_FLIGHT)
    rigid = both(*names)[0]
    assert len(rigid) != len(drake) or np.abs(drake["y"] - rigid["y"]).max() > 1e-3
