"""Impacts as arrays: nothing is lost or reordered between tables and arrays."""

import numpy as np
import pandas as pd
import pytest

from thesis_lib.bodies.shapes import Ellipse, Polygon
from thesis_lib.datasets.format.impacts import COVARIANCE_COLUMNS, IMPACT_COLUMNS, STATE, Impacts
from thesis_lib.foundation.files import read_table, write_table

N = 6
SHAPE = Ellipse(semi_axes=(0.035, 0.025))
CSV = 1e-8  # nine digits are written


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(5)


@pytest.fixture
def impacts(rng) -> Impacts:
    """Impacts with everything that can be known, and contact points that are not the shape's."""
    root = rng.standard_normal((N, 9, 9))
    return Impacts(
        trial=np.array([3, 3, 5, 9, 9, 9]),
        impact=np.array([0, 1, 0, 0, 1, 2]),
        q=rng.standard_normal((N, 3)),
        v_pre=rng.standard_normal((N, 3)),
        v_post=rng.standard_normal((N, 3)),
        r=rng.standard_normal((N, 2)),
        k_g=0.02,
        mass=0.05,
        t=rng.uniform(size=N),
        cov=root @ np.swapaxes(root, 1, 2),
        flags=np.array(["", "energy", "cone;energy", "", "", "no_touch"], dtype=object),
    )


def assert_same(a: Impacts, b: Impacts, rtol: float = 0.0) -> None:
    for name in ("trial", "impact", "q", "v_pre", "v_post", "r", "t", "cov"):
        np.testing.assert_allclose(getattr(a, name), getattr(b, name), rtol=rtol, atol=rtol, err_msg=name)
    assert a.flags.tolist() == b.flags.tolist()
    assert (a.k_g, a.mass) == (b.k_g, b.mass)


def test_round_trip_through_a_table(impacts):
    again = Impacts.from_table(impacts.to_table(), SHAPE, impacts.k_g, impacts.mass)
    assert_same(impacts, again)


def test_round_trip_through_a_file(impacts, tmp_path):
    write_table(impacts.to_table(), tmp_path / "impacts.csv")
    table = read_table(tmp_path / "impacts.csv", IMPACT_COLUMNS)
    assert_same(impacts, Impacts.from_table(table, SHAPE, impacts.k_g, impacts.mass), rtol=CSV)


def test_columns_say_what_they_hold(impacts):
    row = impacts.to_table().iloc[2]
    assert row["trial"] == 5 and row["theta"] == impacts.q[2, 2]
    assert row["vy_pre"] == impacts.v_pre[2, 1] and row["omega_post"] == impacts.v_post[2, 2]
    i, j = STATE.index("omega_post"), STATE.index("vx_pre")
    assert row["cov_omega_post_vx_pre"] == impacts.cov[2, i, j] == impacts.cov[2, j, i]
    assert "cov_omega_post_vx_pre" in COVARIANCE_COLUMNS


def test_what_is_not_known_leaves_no_columns(impacts):
    bare = Impacts(impacts.trial, impacts.impact, impacts.q, impacts.v_pre, impacts.v_post, impacts.r, k_g=impacts.k_g)
    assert np.isnan(bare.t).all() and bare.flags.tolist() == [""] * N and bare.mass == 1.0
    assert set(bare.to_table().columns) == {*IMPACT_COLUMNS, "r_x", "r_y", "flags"}
    assert Impacts.from_table(bare.to_table(), SHAPE, bare.k_g).cov is None


@pytest.mark.parametrize("dropped", [["r_x", "r_y"], ["r_y"]])
def test_contact_points_that_are_not_stated_come_from_shape_and_angle(impacts, dropped):
    polygon = Polygon(vertices=((0.05, -0.01), (0.02, 0.03), (-0.04, 0.0), (-0.02, -0.03)))
    table = impacts.to_table().drop(columns=dropped)
    for shape in (SHAPE, polygon):
        found = Impacts.from_table(table, shape, 0.02).r
        np.testing.assert_array_equal(found, shape.contact_point(impacts.q[:, 2]))


def test_missing_mass_means_impulses_per_unit_mass(impacts):
    table = impacts.to_table()
    assert Impacts.from_table(table, SHAPE, 0.02, None).mass == 1.0
    assert Impacts.from_table(table, SHAPE, 0.02, 0.07).mass == 0.07


def test_missing_flags_in_a_file_mean_none(impacts):
    table = impacts.to_table()
    table["flags"] = table["flags"].replace("", np.nan)
    assert Impacts.from_table(table, SHAPE, 0.02).flags.tolist() == impacts.flags.tolist()


@pytest.mark.parametrize("rows", [[4, 0], [True, False, False, True, False, True], np.empty(0, int), range(1, 3)])
def test_select_takes_the_same_rows_of_everything(impacts, rows):
    rows = np.asarray(rows)
    chosen = impacts.select(rows)
    expected = impacts.to_table().iloc[np.arange(N)[rows]].reset_index(drop=True)
    if len(expected):
        pd.testing.assert_frame_equal(chosen.to_table(), expected)
    assert len(chosen) == len(expected) and chosen.cov.shape == (len(expected), 9, 9)
    assert (chosen.k_g, chosen.mass) == (impacts.k_g, impacts.mass)


def test_select_without_covariance(impacts):
    bare = Impacts.from_table(impacts.to_table()[[*IMPACT_COLUMNS]], SHAPE, 0.02)
    assert bare.select([1, 2]).cov is None
