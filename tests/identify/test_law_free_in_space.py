"""What needs no law, in space: a rounded cube with a hidden mass centre and inertia, hit by impulses of no law."""

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.header import SpaceHeader
from thesis_lib.datasets.read import read_dataset
from thesis_lib.foundation.errors import UserError
from thesis_lib.studies.proof.store import STORE
from thesis_lib.thesis.identify.impacts.law_free_in_space import ROWS, as_text, law_free
from thesis_lib.thesis.identify.impacts.on_the_table import quantities

H, K2, RATE, G = 0.05, 0.0017, 150.0, 9.81
SCALE, TILT = 0.98, 0.02  # lengths as measured; rad, in another direction in each toss
RHO, EXCESS, C, TURN = 0.004, 0.2, np.array([0.001, 0.0, 0.005]), np.array([0.006, 0.0, -0.004])
NOISE = 3e-5, 3e-4  # m, rad
TOSSES = 70
SIGMAS = 5.0  # by ten groups
LINEAR = 1e-4  # m or rad, what squares of small turns add
HEADER = {
    "schema": 2,
    "body": {
        "shape": {"kind": "box", "half_extents": [H, H, H]},
        "mass": 0.5,
        "inertia": dict.fromkeys(("xx", "yy", "zz"), 0.5 * K2),
    },
    "rate": RATE,
}


def toss(trial: int, rng: np.random.Generator) -> pd.DataFrame:
    """A flight, an impulse at one corner, a flight, and a rest."""
    q = Rotation.random(random_state=int(rng.integers(2**31)))
    corners = np.stack(np.meshgrid([1, -1], [1, -1], [1, -1]), axis=-1).reshape(-1, 3)
    low = q.apply((H - RHO) * corners)
    i = low[:, 2].argmin()
    r = low[i] - q.apply(C) - [0.0, 0.0, RHO]
    P = np.array([*rng.normal(0.0, 0.5, 2), rng.uniform(1.0, 2.5)])
    spin = rng.normal(0.0, 4.0, 3)
    velocity = np.array([*rng.normal(0.0, 0.5, 2), -1.0])
    heading = rng.uniform(0.0, 2.0 * np.pi)
    fall = G * np.array([np.sin(TILT) * np.cos(heading), np.sin(TILT) * np.sin(heading), -np.cos(TILT)])
    after = spin + np.cross(r, P) / (K2 * (1.0 + EXCESS))
    t = np.arange(-20, 14) / RATE + rng.uniform(0.0, 1.0) / RATE
    late = t[:, None] > 0.0
    turns = Rotation.from_rotvec(t[:, None] * np.where(late, after, spin)) * q
    centre = -r + t[:, None] * np.where(late, velocity + P, velocity) + 0.5 * fall * t[:, None] ** 2
    place = centre - turns.apply(C)
    rest = Rotation.from_euler("z", rng.uniform(-3.0, 3.0))
    rest *= Rotation.from_euler("xyz", 90.0 * rng.integers(0, 4, 3), degrees=True)
    place = np.concatenate([place, np.tile([0.3, 0.0, H], (10, 1))]) * SCALE + rng.normal(0.0, NOISE[0], (44, 3))
    whole = Rotation.concatenate([turns, *[rest] * 10]) * Rotation.from_rotvec(TURN)
    whole = Rotation.from_rotvec(rng.normal(0.0, NOISE[1], (44, 3))) * whole
    x, y, z, w = whole.as_quat().T
    columns = dict(zip(("x", "y", "z", "qw", "qx", "qy", "qz"), (*place.T, w, x, y, z)))
    return pd.DataFrame({"trial": trial, "t": np.arange(44) / RATE} | columns)


def test_friction_of_slides_and_the_lean_of_the_axes_are_read_off_in_axes_of_the_throw(rng):
    mu, lean = 0.25, np.array([-0.003, -0.009])
    tosses = []
    for _ in range(40):
        heading, t = Rotation.from_euler("z", rng.uniform(-3.0, 3.0)), np.arange(80) / RATE
        end = 0.9 / (mu * G)
        slid = np.clip(t - 0.15, 0.0, end)
        x = 0.9 * np.minimum(t, 0.15) + 0.9 * slid - 0.5 * mu * G * slid**2
        z = 0.05 + np.maximum(0.15 - t, 0.0)
        p = heading.apply(np.stack([x, 0.0 * x, z], axis=1)) + rng.normal(0.0, NOISE[0], (80, 3))
        faces = Rotation.from_euler("xyz", 90.0 * rng.integers(0, 4, 3), degrees=True)
        leaning = (
            heading * Rotation.from_rotvec([-lean[1], lean[0], 0.0]) * Rotation.from_euler("z", rng.uniform(-3, 3))
        )
        tosses.append((t, p, Rotation.concatenate([leaning * faces] * 80)))
    found = {name: (value, std, n) for name, value, std, _, n in quantities(tosses)}
    assert found["slide_against"][0] == pytest.approx(mu * G, rel=0.01) and found["slide_against"][2] == 40
    assert abs(found["slide_left"][0]) < 4.0 * found["slide_left"][1] < 0.05
    np.testing.assert_allclose([found[name][0] for name in ("lies_along", "lies_left")], lean, atol=2e-4)


@pytest.mark.slow
def test_what_is_hidden_is_found_without_a_law(rng, tmp_path):
    poses = pd.concat([toss(trial, rng) for trial in range(TOSSES)], ignore_index=True)
    dataset = Dataset("cube", SpaceHeader.model_validate(HEADER), poses)
    found = law_free(dataset).set_index("quantity")
    truth = {"fall": G * SCALE, "level_fall": G * SCALE * TILT, "rest_height": H * SCALE}
    truth |= {"corner_half_width": H * SCALE, "corner_rounding": RHO * SCALE}
    truth |= dict(zip(("wobble_x", "wobble_y", "wobble_z"), SCALE * C))
    truth |= dict(zip(("frame_x", "frame_y", "frame_z"), TURN))
    off = {name: abs(found["value"][name] - value) for name, value in truth.items()}
    assert {name: value for name, value in off.items() if value > SIGMAS * found["std"][name] + LINEAR} == {}
    # lengths as measured scale Δv, so that c and ρ of the balance are those of a cube as large as stated
    centre = found["value"][["balance_x", "balance_y", "balance_z"]]
    np.testing.assert_allclose(centre, C, atol=H * np.abs(TURN).max() + 4e-4)
    assert found["value"]["balance_inertia"] == pytest.approx(SCALE * (1.0 + EXCESS) - 1.0, abs=0.04)
    assert found["value"]["level_fall_mean"] < SIGMAS * found["std"]["level_fall_mean"]
    assert found["value"]["misfit_balanced"] < 0.5 * found["value"]["misfit_stated"]
    table = tmp_path / "law_free.csv"
    assert "balance_z" in as_text(dataset, table)
    assert len(pd.read_csv(table)) == len(found)


def test_a_body_that_is_no_cube_is_refused():
    header = HEADER | {"body": HEADER["body"] | {"shape": {"kind": "box", "half_extents": [H, H, 0.6 * H]}}}
    with pytest.raises(UserError, match="needs a cube"):
        law_free(Dataset("brick", SpaceHeader.model_validate(header)))


@pytest.mark.slow
def test_the_stored_numbers_are_those_of_the_cube(contactnets_cube_dir):
    dataset = read_dataset(contactnets_cube_dir).first_trials(300)
    if dataset.trials.tolist() != list(range(300)):
        pytest.skip("of tosses 0 to 299 some are missing")
    stored = pd.read_csv(STORE / ROWS.path).query("dataset == 'contactnets_cube' and trials == 300")
    found = law_free(dataset).set_index("quantity")
    stored = stored.set_index("quantity").loc[found.index]
    np.testing.assert_allclose(stored[["value", "std"]], found[["value", "std"]], rtol=1e-3, atol=1e-6)
