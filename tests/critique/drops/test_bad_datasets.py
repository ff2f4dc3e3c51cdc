"""Datasets that cannot be criticised get an answer that a user can act on; outliers do not change the verdict."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hidden_effects import RIG_NOISE, injected_impacts
from plain_drops import LAW, TRUTH, drops

from thesis_lib.__main__ import main
from thesis_lib.critique.contacts.model import Model
from thesis_lib.critique.drops.criticise import criticise_drops
from thesis_lib.critique.likelihood.fit import fit
from thesis_lib.critique.likelihood.observations import observe
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.write import write_dataset
from thesis_lib.simulate.rig.hidden_causes import ELLIPSE_BODY, PROOF_RELEASE
from thesis_lib.simulate.stepping.drops import simulate_drops

RATE = 250.0


def from_trajectories(table: pd.DataFrame) -> Dataset:
    return Dataset("bad", drops().header, table.reset_index(drop=True))


def poses(make: Callable[[np.ndarray, np.random.Generator], np.ndarray], noise: bool = True) -> Dataset:
    """20 trials of 100 samples of a made-up motion t -> (x, y, θ)."""
    rng = np.random.default_rng(0)
    tables = []
    for trial in range(20):
        t = np.arange(100) / RATE
        q = make(t, rng)
        if noise:
            sigma = [RIG_NOISE.position, RIG_NOISE.position, RIG_NOISE.angle]
            q = q + sigma * rng.standard_normal(q.shape)
        tables.append(pd.DataFrame({"trial": trial, "t": t, "x": q[:, 0], "y": q[:, 1], "theta": q[:, 2]}))
    return from_trajectories(pd.concat(tables))


def no_impacts() -> Dataset:
    """Bodies that are only ever in the air."""
    return poses(lambda t, rng: np.stack([rng.uniform(-1, 1) * t, 2.0 - 4.905 * t**2, 5.0 * t], 1))


def never_moves() -> Dataset:
    return poses(lambda t, rng: np.stack([0 * t, 0.025 + 0 * t, 0 * t], 1))


def never_moves_without_noise() -> Dataset:
    return poses(lambda t, rng: np.stack([0 * t, 0.025 + 0 * t, 0 * t], 1), noise=False)


def five_rows() -> Dataset:
    return injected_impacts("bad", 5, 0, "tangential_restitution", {"tangential_restitution.e_t": 0.0})


def no_rows() -> Dataset:
    table = five_rows()
    return replace(table, impacts=table.impacts.iloc[:0])


def constant_rows() -> Dataset:
    """Sixty times the same impact."""
    table = five_rows()
    rows = pd.concat([table.impacts.iloc[:1]] * 60, ignore_index=True).assign(trial=np.arange(60))
    return replace(table, impacts=rows)


def stuck_channel(column: str) -> Callable[[], Dataset]:
    """A camera that reports the same value all the time in one channel."""

    def make() -> Dataset:
        return from_trajectories(drops().trajectories.assign(**{column: 0.0 if column != "y" else 0.05}))

    make.__name__ = f"constant_{column}"
    return make


def constant_angle() -> Dataset:
    made = injected_impacts("bad", 40, 0, "tangential_restitution", {"tangential_restitution.e_t": 0.0})
    return replace(made, impacts=made.impacts.assign(theta=0.3, vx_pre=0.5))


def out_of_plane() -> Dataset:
    """A throw that turns away from the camera: x is foreshortened."""
    table = drops().trajectories
    return from_trajectories(table.assign(x=table["x"] * np.cos(8.0 * table["t"])))


def second_body(**changes: float) -> Dataset:
    """Every other trial is of another body."""
    head = drops().header
    a, b = head.body.shape.semi_axes
    size = 1.0 + changes.get("size", 0.0)
    shape = head.body.shape.model_copy(update={"semi_axes": (size * a, size * b)})
    k_g = head.body.radius_of_gyration * np.sqrt(1.0 + changes.get("inertia", 0.0)) * size
    other = ELLIPSE_BODY.model_copy(update={"shape": shape, "radius_of_gyration": k_g})
    rng = np.random.default_rng(3)
    made = simulate_drops(other, PROOF_RELEASE, 20, **TRUTH, noise=RIG_NOISE, rng=rng)
    first = drops().trajectories.query("trial < 20")
    both = pd.concat(
        [first.assign(trial=2 * first["trial"]), made.trajectories.assign(trial=2 * made.trajectories["trial"] + 1)]
    )
    return from_trajectories(both.sort_values(["trial", "t"]))


def two_sizes() -> Dataset:
    return second_body(size=0.3)


def two_inertias() -> Dataset:
    return second_body(inertia=0.4)


REFUSED = [
    (constant_angle, "Columns theta, vx_pre of impacts.csv"),
    (out_of_plane, "is not a planar free motion"),
    (two_sizes, "20 trials (trial 1, 3, 5, "),
    (two_inertias, "k² "),
    (no_impacts, "because not one was detected. What was noticed: No impact was found"),
    (never_moves, "usable impacts"),
    (never_moves_without_noise, "x, y, theta of trajectories.csv"),
    (no_rows, "impacts"),
    (constant_rows, "vx_post, vy_post, omega_post of impacts.csv"),
    (stuck_channel("x"), "Column x of trajectories.csv"),
    (stuck_channel("y"), "Column y of trajectories.csv"),
    (stuck_channel("theta"), "Column theta of trajectories.csv"),
]


@pytest.mark.parametrize(("make", "says"), REFUSED, ids=lambda one: getattr(one, "__name__", ""))
def test_it_is_refused_in_one_block_of_words(make, says, tmp_path: Path, capsys):
    folder = write_dataset(make(), tmp_path / "bad")
    assert main(["critique", str(folder), "-q", "-o", str(tmp_path / "out")]) == 2
    shown = capsys.readouterr()
    assert shown.err.startswith("error: ") and says in shown.err and "Traceback" not in shown.err
    assert len(shown.err) > 60
    assert shown.out == "" and not (tmp_path / "out").exists()


def with_outliers() -> Dataset:
    """One sample in a hundred is thrown 100 m and ten turns away."""
    table = drops().trajectories.copy()
    rng = np.random.default_rng(0)
    wild = rng.random(len(table)) < 0.01
    table.loc[wild, ["x", "y"]] += 100.0 * rng.standard_normal((wild.sum(), 2))
    table.loc[wild, "theta"] += 60.0 * rng.standard_normal(wild.sum())
    return from_trajectories(table)


def test_huge_outliers_in_trajectories_leave_the_coefficients_alone():
    o = observe(with_outliers())
    assert len(o) > 60
    fitted = fit(Model(LAW), o)
    for name, value in TRUTH.items():
        assert fitted.values[name] == pytest.approx(value, abs=0.005)


@pytest.mark.slow
def test_huge_outliers_in_impacts_do_not_make_effects():
    clean = injected_impacts("table", 80, 4, "tangential_restitution", {"tangential_restitution.e_t": 0.0})
    table = clean.impacts.copy()
    table.loc[[5, 40, 71], ["vx_post", "vy_post"]] = [[300.0, -20.0], [-50.0, 900.0], [0.0, 4000.0]]
    found = criticise_drops(replace(clean, impacts=table), rng=np.random.default_rng(0))
    assert found.verdict == "adequate"
    assert found.discovery.fitted.values["epsilon"] == pytest.approx(0.6, abs=0.01)


@pytest.mark.slow
def test_huge_outliers_in_trajectories_do_not_make_effects():
    found = criticise_drops(with_outliers(), rng=np.random.default_rng(0))
    assert found.discovery.steps == ()
