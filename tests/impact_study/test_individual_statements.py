"""The insights of figure 3-10 as numbers, on parameters whose answer is known."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from known_truth import falling_ellipses

from thesis_lib.thesis.impact_study.statements import (
    FOLLOWED,
    STUDIED,
    epsilon_modes,
    flatness,
    individual_rows,
    single_hits,
)

N = 400
INSIDE = 1.0  # N s, in the middle of the misfits that are drawn below
SAMPLED = 0.05  # of a quantile range: 20 000 values know it to a percent


class TestEpsilonModes:
    def test_one_hill(self, rng):
        peak, peaks = epsilon_modes(rng.normal(0.55, 0.05, 2000))
        assert peaks == 1 and peak == pytest.approx(0.55, abs=0.02)

    def test_two_hills_and_the_higher_one(self, rng):
        peak, peaks = epsilon_modes(np.r_[rng.normal(0.2, 0.03, 500), rng.normal(0.7, 0.03, 1500)])
        assert peaks == 2 and peak == pytest.approx(0.7, abs=0.02)

    def test_a_ripple_below_a_tenth_is_no_mode(self, rng):
        _, peaks = epsilon_modes(np.r_[rng.normal(0.2, 0.03, 40), rng.normal(0.7, 0.03, 2000)])
        assert peaks == 1

    def test_failed_fits_are_left_out_and_equal_values_are_one_mode(self):
        assert epsilon_modes(np.array([0.4, np.nan, 0.4])) == (0.4, 1)


class TestFlatness:
    def test_an_even_density_has_half_of_its_range(self, rng):
        assert flatness(rng.uniform(0.0, 0.3, 20_000)) == pytest.approx(0.5 / 0.95, rel=SAMPLED)

    def test_a_localised_one_has_its_spread(self, rng):
        # half of a Gaussian lies within 0.674 sigma; its 95 % quantile is 1.645 sigma above the mean
        expected = 2 * 0.674 * 0.1 / (1 + 1.645 * 0.1)
        assert flatness(rng.normal(1.0, 0.1, 20_000)) == pytest.approx(expected, rel=SAMPLED)

    def test_a_peak_that_holds_half_is_not_flat(self, rng):
        assert flatness(np.r_[np.zeros(60), rng.uniform(0, 1, 40)]) == 0.0
        assert flatness(np.zeros(5)) == 0.0


@pytest.fixture
def made(rng):
    """Impacts, individual parameters without and with structure put into the law studied, and an ensemble."""
    impacts = falling_ellipses(rng, N)
    n = len(FOLLOWED) * N
    law, (trial, impact) = np.repeat(FOLLOWED, N), np.tile([impacts.trial, impacts.impact], len(FOLLOWED))
    found = {"mu": rng.uniform(0.01, 0.3, n), "epsilon": rng.normal(0.5, 0.05, n), "misfit": rng.uniform(0.5, 1.5, n)}
    individual = pd.DataFrame({"law": law, "trial": trial, "impact": impact} | found).sample(frac=1.0, random_state=0)
    ensemble = pd.DataFrame(
        {"mu": 0.1, "mu_std": 0.01, "epsilon": 0.5, "epsilon_std": 0.01}, index=pd.Index(FOLLOWED, name="law")
    )
    return impacts, individual, ensemble


def value(rows, statement, law=STUDIED):
    (row,) = [row for row in rows if row[:2] == (statement, law)]
    return row[2:4]


class TestRows:
    def test_nothing_is_found_where_nothing_is(self, made):
        rows = individual_rows(*made, INSIDE)
        ratio, std = value(rows, "misfit_lower_left")
        assert abs(ratio - 1.0) < 4 * std
        assert value(rows, "mu_zero")[0] == 0.0 and value(rows, "mu_zero")[1] > 0.0
        # no impact has μ = 0, so that it lies nowhere
        assert not [row for row in rows if row[0] == "mu_zero_offset"]

    def test_misfits_in_the_lower_left_are_found(self, made):
        impacts, individual, ensemble = made
        own = individual["law"] == STUDIED
        low = individual["mu"] < individual.loc[own, "mu"].quantile(0.25)
        low &= individual["epsilon"] < individual.loc[own, "epsilon"].quantile(0.25)
        individual.loc[own & low, "misfit"] *= 3.0
        rows = individual_rows(impacts, individual, ensemble, INSIDE)
        ratio, std = value(rows, "misfit_lower_left")
        assert ratio == pytest.approx(3.0, rel=0.2) and ratio - 1.0 > 3 * std
        other, other_std = value(rows, "misfit_lower_left", "mirtich")
        assert abs(other - 1.0) < 4 * other_std

    def test_cases_without_friction_below_the_centre_are_found(self, made):
        """Rows of the parameters stand in another order than the impacts: they are matched by trial and impact."""
        impacts, individual, ensemble = made
        central = np.abs(impacts.r[:, 0]) < np.quantile(np.abs(impacts.r[:, 0]), 0.2)
        keys = pd.MultiIndex.from_arrays([impacts.trial[central], impacts.impact[central]])
        chosen = pd.MultiIndex.from_frame(individual[["trial", "impact"]]).isin(keys)
        individual.loc[chosen & (individual["law"] == STUDIED), "mu"] = 0.0
        rows = individual_rows(impacts, individual, ensemble, INSIDE)
        offset = np.abs(impacts.r[:, 0])
        ratio, std = value(rows, "mu_zero_offset")
        assert ratio == pytest.approx(offset[central].mean() / offset[~central].mean())
        assert ratio + 3 * std < 1.0
        assert value(rows, "mu_zero")[0] == pytest.approx(0.2, abs=1 / N)

    def test_back_spin_out_of_range_is_counted_of_back_spin_alone(self, made):
        impacts, individual, ensemble = made
        turned = np.arange(N) < N // 2
        impacts = replace(impacts, v_post=np.where(turned[:, None], -1.0, 1.0) * impacts.v_pre)
        keys = pd.MultiIndex.from_arrays([impacts.trial[turned], impacts.impact[turned]])
        of_turned = pd.MultiIndex.from_frame(individual[["trial", "impact"]]).isin(keys)
        individual["misfit"] = np.where(of_turned & (individual["law"] == STUDIED), 2.0 * INSIDE, 0.5 * INSIDE)
        rows = individual_rows(impacts, individual, ensemble, INSIDE)
        assert value(rows, "back_spin_outside")[0] == 1.0 and value(rows, "back_spin_outside", "mirtich")[0] == 0.0
        individual["misfit"] = np.where(of_turned, 0.5 * INSIDE, 2.0 * INSIDE)
        assert value(individual_rows(impacts, individual, ensemble, INSIDE), "back_spin_outside")[0] == 0.0

    def test_impacts_that_a_law_never_resolves_are_left_out(self, made):
        impacts, individual, ensemble = made
        spoiled = individual.copy()
        spoiled.loc[spoiled.index[:50], ["mu", "epsilon", "misfit"]] = np.nan
        kept = individual.drop(individual.index[:50])
        a, b = (individual_rows(impacts, table, ensemble, INSIDE) for table in (spoiled, kept))
        assert [row[:2] for row in a] == [row[:2] for row in b]
        np.testing.assert_allclose([row[2] for row in a], [row[2] for row in b], rtol=1e-12)


def test_single_hits_are_counted_among_the_first_three_that_were_seen(rng):
    impacts = replace(falling_ellipses(rng, 4), trial=np.array([0, 0, 1, 1]), impact=np.array([0, 3, 0, 1]))
    hits = [
        (0, 1, "second_hit"),
        (0, 2, "second_hit"),
        (1, 2, "lost_frames"),
        (2, 0, "stays_down"),
        (2, 5, "second_hit"),
    ]
    statement, law, share, std, unit = single_hits(impacts, pd.DataFrame(hits, columns=["trial", "impact", "reason"]))
    # 1 of 3 in trial 0, 2 of 2 in trial 1, 0 of 1 in trial 2
    assert (statement, law, unit) == ("single_hits", "", "1") and share == pytest.approx(0.5)
    off = np.array([1 - 1.5, 2 - 1.0, 0 - 0.5])
    assert std == pytest.approx(np.sqrt(1.5 * np.sum(off**2)) / 6)
