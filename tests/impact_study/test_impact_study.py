"""The impact study: training and held-out trials stay apart, and every table holds what its columns say."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from known_truth import falling_ellipses

from thesis_lib.coefficients.cost import misfit, target_of
from thesis_lib.contact import LAWS, SIX_LAWS
from thesis_lib.contact.bounds import irb_bound
from thesis_lib.contact.space import velocity_error
from thesis_lib.datasets.impacts.quality import flag_physics
from thesis_lib.thesis.impact_study import study

BOTH = ("kinetic", "unweighted")
MU, EPSILON = 0.15, 0.55


@pytest.fixture
def impacts(rng):
    """60 impacts of 30 trials with noise, none of them with a name of its row."""
    made = falling_ellipses(rng, 60, law="mirtich", mu=MU, epsilon=EPSILON, noise=0.05)
    return made.select(rng.permutation(60))


class TestSplit:
    @pytest.mark.parametrize("share", [0.01, 0.3, 0.5, 0.99])
    def test_no_trial_is_on_both_sides(self, impacts, share, rng):
        train = study.split_trials(impacts.trial, share, rng)
        ours, others = set(impacts.trial[train]), set(impacts.trial[~train])
        assert ours and others and not ours & others
        assert len(ours) == np.clip(round(share * 30), 1, 29)

    def test_every_trial_can_be_drawn(self, rng):
        trials = np.arange(6)
        drawn = np.mean([study.split_trials(trials, 0.5, rng) for _ in range(400)], axis=0)
        assert np.all(np.abs(drawn - 0.5) < 0.1)  # four binomial errors

    def test_one_trial_cannot_be_split(self, rng):
        with pytest.raises(ValueError, match="two trials"):
            study.split_trials(np.array([3, 3, 3]), 0.5, rng)

    def test_the_split_survives_its_table(self, impacts, rng, tmp_path):
        from thesis_lib.foundation.files import read_table, write_table

        train = study.split_trials(impacts.trial, 0.5, rng)
        write_table(study.split_table(impacts, train), tmp_path / "split.csv")
        split = read_table(tmp_path / "split.csv")
        for mask, side in ((train, 1), (~train, 0), (train | True, None)):
            chosen = study.pick(impacts, split, side)
            np.testing.assert_array_equal(chosen.v_pre, impacts.v_pre[mask])
        # the same number of an impact in another trial is another impact
        np.testing.assert_array_equal(study.pick(impacts, split.iloc[[3, 17]]).q, impacts.q[[3, 17]])


class TestSelect:
    def test_receding_contacts_are_left_out(self, impacts, rng):
        away = replace(impacts, v_pre=np.where(np.arange(60)[:, None] == 5, [0.0, 1.0, 0.0], impacts.v_pre))
        chosen = study.select_impacts(away, "keep", None, rng)
        np.testing.assert_array_equal(chosen.q, np.delete(impacts.q, 5, axis=0))

    def test_a_limit_draws_without_repetition_and_keeps_the_order(self, impacts, rng):
        chosen = study.select_impacts(impacts, "keep", 20, rng)
        rows = [np.flatnonzero((impacts.q == q).all(axis=1))[0] for q in chosen.q]
        assert len(rows) == 20 and rows == sorted(set(rows))
        assert len(study.select_impacts(impacts, "keep", 100, rng)) == 60

    def test_filter_of_the_thesis_is_an_option(self, impacts, rng):
        gaining = replace(impacts, v_post=np.where(np.arange(60)[:, None] < 7, -2 * impacts.v_pre, impacts.v_post))
        flagged = flag_physics(gaining)
        clean = np.array([flag == "" for flag in flagged.flags])
        assert 0 < clean.sum() <= 53
        kept = study.select_impacts(flagged, "keep", None, rng)
        filtered = study.select_impacts(flagged, "thesis", None, rng)
        assert len(kept) == 60 and len(filtered) == clean.sum()
        assert set(filtered.flags) == {""}

    def test_flags_that_are_no_physics_do_not_filter(self, impacts, rng):
        marked = replace(impacts, flags=np.full(60, "no_touch;arc_deviation", dtype=object))
        assert len(study.select_impacts(marked, "thesis", None, rng)) == 60

    def test_nothing_left_is_an_error(self, impacts, rng):
        with pytest.raises(ValueError, match="no impact is left"):
            study.select_impacts(replace(impacts, v_pre=-impacts.v_pre * [0, 1, 0]), "keep", None, rng)


class TestEnsembleTable:
    def test_rows_and_recovery(self, impacts, rng):
        table = study.ensemble_table(impacts, ("mirtich", "whittaker"), BOTH, 30, rng)
        assert table[["law", "weighting"]].to_numpy().tolist() == [
            [law, weighting] for weighting in BOTH for law in ("mirtich", "whittaker")
        ]
        own = table.iloc[0]
        assert abs(own["mu"] - MU) < 4 * own["mu_std"] and abs(own["epsilon"] - EPSILON) < 4 * own["epsilon_std"]
        assert (table["n"] == 60).all() and (table["n_failed"] == 0).all() and (table["at_bound"] == "").all()

    def test_a_further_law_changes_no_other(self, impacts):
        def table(*laws: str) -> pd.DataFrame:
            made = study.ensemble_table(impacts, laws, BOTH, 10, np.random.default_rng(1))
            return made[made["law"] == "whittaker"].reset_index(drop=True)

        alone = table("whittaker")
        pd.testing.assert_frame_equal(table("mirtich", "whittaker", "wang_mason"), alone)
        # and no two streams are the same
        assert alone["mu_std"].nunique() == 2


class TestConvergence:
    def test_subsets_are_nested_and_end_with_all(self, impacts, monkeypatch):
        seen = []
        fit = study.fit_ensemble

        def watched(law, target, metric):
            seen.append(set(target.c_t))
            return fit(law, target, metric)

        monkeypatch.setattr(study, "fit_ensemble", watched)
        table = study.convergence_table(
            impacts, ("whittaker", "mirtich"), (40, 5, 20, 60, 500), 2, np.random.default_rng(3)
        )
        assert table["k"].tolist() == [5, 20, 40, 60] * 4
        assert table["subset"].tolist() == [0] * 4 + [1] * 4 + [0] * 4 + [1] * 4
        assert [len(rows) for rows in seen] == table["k"].tolist()
        for i in (0, 1, 2, 4, 5, 6):
            assert seen[i] < seen[i + 1]
        assert seen[0] != seen[4]  # another subset
        assert seen[:8] == seen[8:]  # the laws share their subsets
        last = table[table["k"] == 60].groupby("law")[["mu", "epsilon"]]
        assert np.all(last.max() - last.min() < 1e-5)


class TestTopography:
    def test_it_is_the_mean_misfit_of_the_drawn_impacts(self, impacts):
        mu, epsilon = np.array([0.1, 0.2, 0.3]), np.array([0.4, 0.6])
        table = study.topography_table(impacts, "whittaker", 500, mu, epsilon, np.random.default_rng(0))
        assert (table["n"] == 60).all() and (table["law"] == "whittaker").all() and len(table) == 6
        for row in table.itertuples():
            direct = misfit(LAWS["whittaker"], target_of(impacts), row.mu, row.epsilon, "impulse").mean()
            assert row.cost == pytest.approx(direct, rel=1e-12)
        few = study.topography_table(impacts, "whittaker", 10, mu, epsilon, np.random.default_rng(0))
        assert (few["n"] == 10).all() and not np.allclose(few["cost"], table["cost"])

    def grid(self, cost) -> pd.DataFrame:
        mu, epsilon = np.meshgrid(np.linspace(-1, 1, 11), np.linspace(-1, 1, 9), indexing="ij")
        return pd.DataFrame({"mu": mu.ravel(), "epsilon": epsilon.ravel(), "cost": cost(mu, epsilon).ravel()})

    @pytest.mark.parametrize(
        ("cost", "share"),
        [
            (lambda x, y: x**2 + 3 * x * y + 4 * y**2, 0.0),
            (lambda x, y: np.hypot(x, y), 0.0),
            (lambda x, y: 1.0 + 2 * x - y, 0.0),
            (lambda x, y: -(x**2) - y**2, 1.0),
            # convex along both axes, concave along one diagonal only
            (lambda x, y: x**2 + 3 * x * y + y**2, 9 * 7 / (9 * 9 + 11 * 7 + 2 * 9 * 7)),
        ],
    )
    def test_costs_violate_where_they_are_not_convex(self, cost, share):
        assert study.convexity_violations(self.grid(cost)) == pytest.approx(share)

    def test_one_dent_is_found(self):
        table = self.grid(lambda x, y: x**2 + y**2)
        table.loc[50, "cost"] += 1.0
        assert 0.0 < study.convexity_violations(table) < 0.05


class TestIndividualTable:
    def test_rows_carry_the_right_impact(self, impacts):
        table = study.individual_table(impacts, ("whittaker", "mirtich"), BOTH)
        assert len(table) == 60 * 2 * 2
        for (law, weighting), part in table.groupby(["law", "weighting"]):
            np.testing.assert_array_equal(part["trial"], impacts.trial)
            np.testing.assert_array_equal(part["impact"], impacts.impact)
            direct = misfit(LAWS[law], target_of(impacts, weighting), part["mu"], part["epsilon"], "impulse")
            # clipped to the sticking bound, the impulse differs by up to a thousandth
            np.testing.assert_allclose(part["misfit"], direct, atol=3e-4)
            assert (part["mu"] <= part["mu_s"]).all()


class TestHeldOut:
    @pytest.fixture
    def ensemble(self) -> pd.DataFrame:
        rows = [
            {"law": law, "weighting": weighting, "mu": 0.1 + 0.1 * i, "epsilon": 0.5}
            for i, weighting in enumerate(BOTH)
            for law in SIX_LAWS
        ]
        return pd.DataFrame(rows)

    @pytest.fixture
    def none_for_training(self, impacts) -> pd.DataFrame:
        return study.split_table(impacts, np.zeros(60, dtype=bool))

    def test_training_impacts_are_never_judged(self, impacts, ensemble, rng):
        split = study.split_table(impacts, study.split_trials(impacts.trial, 0.5, rng))
        table = study.held_out_errors(impacts, split, ensemble, "kinetic")
        judged = set(zip(table["trial"], table["impact"]))
        kept = split[split["train"] == 0]
        assert judged == set(zip(kept["trial"], kept["impact"])) and 0 < len(judged) < 60

    @pytest.mark.parametrize("weighting", BOTH)
    def test_errors_of_laws_and_bound(self, impacts, ensemble, weighting, none_for_training):
        table = study.held_out_errors(impacts, none_for_training, ensemble, weighting)
        assert set(table["model"]) == {*SIX_LAWS, "irb_bound"}
        mu, target = (0.1, 0.2)[BOTH.index(weighting)], target_of(impacts, weighting)
        body = {"mass": impacts.mass, "k_g": impacts.k_g}
        for law in SIX_LAWS:
            part = table[table["model"] == law]
            np.testing.assert_array_equal(part["trial"], impacts.trial)
            out = LAWS[law](impacts.v_pre, impacts.r, **body, mu=mu, epsilon=0.5)
            error = velocity_error(impacts.v_post - out.v_post, impacts.k_g)
            np.testing.assert_allclose(part["velocity_error"], error, rtol=1e-12)
            distance = misfit(LAWS[law], target, mu, 0.5, "impulse")
            np.testing.assert_allclose(part["impulse_error"], distance, rtol=1e-9)
        bound = irb_bound(impacts.v_pre, impacts.v_post, impacts.r, **body).error
        np.testing.assert_array_equal(table.loc[table["model"] == "irb_bound", "velocity_error"], bound)

    def test_held_out_outcomes_do_not_reach_the_parameters(self, impacts, rng):
        """Spoiling every held-out outcome leaves the parameters as they are, and raises the held-out error."""
        train = study.split_trials(impacts.trial, 0.5, rng)
        spoiled = replace(impacts, v_post=np.where(train[:, None], impacts.v_post, impacts.v_post + 0.5))
        results = []
        for one in (impacts, spoiled):
            split = study.split_table(one, train)
            table = study.ensemble_table(
                study.pick(one, split, 1), ("mirtich",), ("kinetic",), 5, np.random.default_rng(0)
            )
            errors = study.held_out_errors(one, split, table, "kinetic")
            results.append((table, errors.loc[errors["model"] == "mirtich", "velocity_error"].mean()))
        pd.testing.assert_frame_equal(results[0][0], results[1][0])
        assert results[1][1] > results[0][1] + 0.2


def test_coverage_table(impacts):
    few = impacts.select(np.arange(10))
    table = study.coverage_table(few, ("wang_mason", "whittaker"))
    share = study.covered_share(LAWS["wang_mason"], target_of(few).space)
    assert table["law"].tolist() == ["wang_mason", "whittaker"]
    assert table["share"][0] == pytest.approx(share.mean())
    assert table["share_std"][0] == pytest.approx(share.std(ddof=1) / np.sqrt(10))
