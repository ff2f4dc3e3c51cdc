"""Datasets that cannot be criticised get an answer that a user can act on; outliers do not change the verdict.

Data that are of one body are taken as such.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hidden_effects import LAW, RIG_NOISE, TRUTH, drops, injected_impacts, recorded

from thesis_lib.__main__ import main
from thesis_lib.critique.contacts.model import Model
from thesis_lib.critique.drops.criticise import criticise_drops
from thesis_lib.critique.drops.one_body import balance_groups, refuse_what_is_not_one_body, touch_groups
from thesis_lib.critique.drops.settings import OneBody
from thesis_lib.critique.likelihood.fit import fit
from thesis_lib.critique.likelihood.observations import observe
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.write import write_dataset
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.randomness import generator
from thesis_lib.simulate.rig.hidden_causes import (
    CAUSES,
    ELLIPSE_BODY,
    PROOF_RELEASE,
    SQUARE,
    CompliantContact,
    HiddenCauses,
)
from thesis_lib.simulate.stepping.drops import simulate_drops
from thesis_lib.studies.proof import next_drops

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


def never_moves(noise: bool) -> Dataset:
    return poses(lambda t, rng: np.stack([0 * t, 0.025 + 0 * t, 0 * t], 1), noise)


def five_rows() -> Dataset:
    return injected_impacts("bad", 5, 0, "tangential_restitution", {"tangential_restitution.e_t": 0.0})


def constant_rows() -> Dataset:
    """Sixty times the same impact."""
    table = five_rows()
    rows = pd.concat([table.impacts.iloc[:1]] * 60, ignore_index=True).assign(trial=np.arange(60))
    return replace(table, impacts=rows)


def stuck(column: str) -> Dataset:
    """A camera that reports the same value all the time in one channel."""
    return from_trajectories(drops().trajectories.assign(**{column: 0.0 if column != "y" else 0.05}))


def constant_angle() -> Dataset:
    made = injected_impacts("bad", 40, 0, "tangential_restitution", {"tangential_restitution.e_t": 0.0})
    return replace(made, impacts=made.impacts.assign(theta=0.3, vx_pre=0.5))


def out_of_plane() -> Dataset:
    """A throw that turns away from the camera: x is foreshortened."""
    table = drops().trajectories
    return from_trajectories(table.assign(x=table["x"] * np.cos(8.0 * table["t"])))


def second_body(size: float = 0.0, inertia: float = 0.0) -> Dataset:
    """Every other trial is of another body, larger by so much."""
    body = drops().header.body
    shape = body.shape.model_copy(update={"semi_axes": tuple((1.0 + size) * a for a in body.shape.semi_axes)})
    k_g = body.radius_of_gyration * np.sqrt(1.0 + inertia) * (1.0 + size)
    other = ELLIPSE_BODY.model_copy(update={"shape": shape, "radius_of_gyration": k_g})
    rng = np.random.default_rng(3)
    made = simulate_drops(other, PROOF_RELEASE, 20, **TRUTH, noise=RIG_NOISE, rng=rng)
    first = drops().trajectories.query("trial < 20")
    both = pd.concat(
        [first.assign(trial=2 * first["trial"]), made.trajectories.assign(trial=2 * made.trajectories["trial"] + 1)]
    )
    return from_trajectories(both.sort_values(["trial", "t"]))


REFUSED = {
    "constant angle": (constant_angle, "Columns theta, vx_pre of impacts.csv"),
    "out of plane": (out_of_plane, "is not a planar free motion"),
    "two sizes": (lambda: second_body(size=0.3), "20 trials (trial 1, 3, 5, "),
    "two inertias": (lambda: second_body(inertia=0.4), "k² "),
    "only in the air": (
        lambda: poses(lambda t, rng: np.stack([rng.uniform(-1, 1) * t, 2.0 - 4.905 * t**2, 5.0 * t], 1)),
        "because not one was detected. What was noticed: No impact was found",
    ),
    "never moves": (lambda: never_moves(noise=True), "usable impacts"),
    "never moves, without noise": (lambda: never_moves(noise=False), "x, y, theta of trajectories.csv"),
    "no rows": (lambda: replace(five_rows(), impacts=five_rows().impacts.iloc[:0]), "impacts"),
    "constant rows": (constant_rows, "vx_post, vy_post, omega_post of impacts.csv"),
    **{
        f"constant {name}": (partial(stuck, name), f"Column {name} of trajectories.csv") for name in ("x", "y", "theta")
    },
}


@pytest.mark.parametrize(("make", "says"), REFUSED.values(), ids=REFUSED)
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


@pytest.mark.parametrize("seed", range(6))
def test_one_body_with_a_small_cause_is_never_two(seed):
    """One impact in each of 50 trials: two sets of three coefficients make noise four times smaller."""
    cause, size = "com_offset_x", 0.35
    hidden = HiddenCauses.model_validate({cause: size * CAUSES[cause].size})
    rng = generator(1000 + seed, "next experiment", cause, f"{size:g}").spawn(4)[0]
    refuse_what_is_not_one_body(
        "drops", observe(next_drops._drops(ELLIPSE_BODY, next_drops.RELEASE, 50, hidden, rng)), OneBody()
    )


@pytest.mark.parametrize(("second", "told_apart"), [(0.0, False), (0.8, True)])
def test_bodies_that_turn_differently_are_two_and_one_misses_its_balance_by_noise_alone(
    second: float, told_apart: bool
):
    """Three impacts in each of 100 trials; angular momentum about the contact point is kept."""
    made = [
        injected_impacts("body", 300, seed, "wrong_inertia", {"wrong_inertia.d_I": d_I}, SQUARE)
        for seed, d_I in ((1, 0.0), (2, second))
    ]
    table = pd.concat([part.impacts.assign(trial=part.impacts["trial"] // 3 + 100 * i) for i, part in enumerate(made)])
    o = observe(Dataset("bodies", made[0].header, impacts=table.reset_index(drop=True)))
    groups = balance_groups(o)
    assert groups.told_apart(OneBody()) == told_apart
    if told_apart:
        assert np.array_equal(groups.second, groups.trials >= 100) or np.array_equal(groups.second, groups.trials < 100)
        with pytest.raises(
            UserError, match=r"100 trials \(trial 0-99\) and 100 trials \(trial 100-199\).*k² (0.99|1).* and 1.[78]"
        ):
            refuse_what_is_not_one_body("bodies", o, OneBody())
    else:
        assert groups.one == pytest.approx(1.0, abs=0.12)  # a robust spread of 600 is known to 5 %


@pytest.mark.parametrize("cause", ["camera_roll", "camera_slope"])
def test_a_surface_that_slopes_in_the_picture_makes_no_two_bodies(cause: str):
    """Where nobody asked for the slope, two bodies explained 3 times as much as one."""
    hidden = HiddenCauses.model_validate({cause: CAUSES[cause].size})
    o = observe(recorded(ELLIPSE_BODY, 120, 7, contact=CompliantContact(contact_time=3e-4), hidden=hidden))
    for groups in (touch_groups(o), balance_groups(o)):
        assert groups.one < 2.5 and np.mean(groups.margin < OneBody().clear) > 0.5
