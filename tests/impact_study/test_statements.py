"""What chapter 3 says in words, on synthetic data that make the answer known."""

import numpy as np
import pandas as pd
import pytest
from known_truth import K_G, MASS, SHAPE, falling_ellipses

from thesis_lib.coefficients.cost import target_of
from thesis_lib.contact import LAWS, SIX_LAWS
from thesis_lib.contact.bounds import irb_bound
from thesis_lib.contact.space import contact_space, line_of_sticking
from thesis_lib.foundation.files import read_table, write_table
from thesis_lib.thesis.impact_study import study
from thesis_lib.thesis.impact_study.statements import (
    before_bump,
    converged_at,
    crosses,
    local_minima,
    mirrored_rotation,
    outside_beyond,
    reverses,
    statements,
)
from thesis_lib.thesis.impact_study.tables import SIX_AS_PUBLISHED

NONE = 1e-9  # m/s: rounding of a velocity of some m/s
N = 60


def irb(impacts) -> np.ndarray:
    return irb_bound(impacts.v_pre, impacts.v_post, impacts.r, mass=impacts.mass, k_g=impacts.k_g).error


class TestMirroredRotation:
    def test_angles_recorded_clockwise_are_put_right(self, rng):
        """Rigid outcomes, written down with θ and ω clockwise: no impulse explains them until they are mirrored."""
        true = falling_ellipses(rng, N, law="wang_mason", mu=0.2, epsilon=0.5)
        recorded = mirrored_rotation(true)
        assert irb(true).max() < NONE
        assert np.median(irb(recorded)) > 0.1
        assert irb(mirrored_rotation(recorded)).max() < NONE

    def test_contact_point_goes_with_the_angle(self, rng):
        impacts = falling_ellipses(rng, N)
        mirrored = mirrored_rotation(impacts)
        np.testing.assert_allclose(mirrored.r, SHAPE.contact_point(mirrored.q[:, 2]), atol=1e-15)
        np.testing.assert_array_equal(mirrored.v_pre[:, :2], impacts.v_pre[:, :2])


class TestBackSpin:
    @pytest.fixture
    def space(self, rng):
        impacts = falling_ellipses(rng, N)
        return contact_space(impacts.v_pre, impacts.r, mass=MASS, k_g=K_G)

    def test_slip_that_changes_its_sign_is_back_spin(self, space):
        changes = np.arange(N) % 3 == 0
        c = space.impulse_to(np.where(changes, -0.2, 0.2) * space.v_t, -0.5 * space.v_n)
        np.testing.assert_array_equal(reverses(space, *c), changes)

    def test_impulses_on_either_side_of_the_line_of_sticking(self, space):
        c_n = -1.5 * space.v_n / space.K_nn
        on_line = line_of_sticking(space, c_n)
        for share, beyond in ((0.0, 0.0), (0.9, 0.0), (1.0, 0.0), (1.1, 1.0), (-0.5, 0.0)):
            np.testing.assert_array_equal(crosses(space, share * on_line, c_n), beyond)

    def test_the_normal_impulse_alone_may_reverse_without_crossing(self, space):
        c_n = -1.9 * space.v_n / space.K_nn
        spun = reverses(space, np.zeros(N), c_n) == 1.0
        assert 0.02 < spun.mean() < 0.98
        assert not crosses(space, np.zeros(N), c_n).any()

    def test_sticking_is_neither_whatever_the_rounding(self, space):
        for c_n in (-1.2 * space.v_n / space.K_nn, -1.7 * space.v_n / space.K_nn):
            c = line_of_sticking(space, c_n), c_n
            assert not reverses(space, *c).any() and not crosses(space, *c).any()


class TestConvergence:
    def table(self, mus: dict[int, list[float]]) -> pd.DataFrame:
        sizes = (10, 50, 100, 200)
        return pd.DataFrame(
            [
                {"subset": subset, "k": k, "mu": mu, "epsilon": 0.5}
                for subset, values in mus.items()
                for k, mu in zip(sizes, values)
            ]
        ).sample(frac=1.0, random_state=1)

    def test_least_k_from_which_all_subsets_stay_near(self):
        assert converged_at(self.table({0: [0.2, 0.105, 0.1, 0.1], 1: [0.1, 0.12, 0.1, 0.1]})) == 100
        assert converged_at(self.table({0: [0.105, 0.1, 0.1, 0.1]})) == 10

    def test_coming_near_once_is_not_enough(self):
        assert converged_at(self.table({0: [0.1, 0.1, 0.2, 0.1]})) == 200


def test_the_tail_of_errors_lies_outside_the_range_only_if_its_impulses_do():
    rows = pd.DataFrame({"trial": np.arange(100), "impact": 0})
    errors, misfit = rows.assign(velocity_error=np.arange(100.0)), np.where(np.arange(100) % 3, 0.0, 0.2)
    none, std = outside_beyond(90.0, errors, rows.assign(misfit=misfit), 0.1)
    assert abs(none) < std and 0.1 < std < 0.2
    misfit[90:] = 0.2
    rest = np.mean(misfit[:90] > 0.1)
    assert outside_beyond(90.0, errors, rows.assign(misfit=misfit)[::-1], 0.1)[0] == pytest.approx(1.0 - rest)


def test_a_bump_of_errors_begins_in_the_valley_before_it():
    rng = np.random.default_rng(0)
    near = np.abs(rng.normal(0.0, 0.05, 900))
    assert before_bump(near) is None
    assert 0.15 < before_bump(np.concatenate([near, rng.normal(0.4, 0.03, 200), [np.nan]])) < 0.35


def test_local_minima():
    x, y = np.meshgrid(np.linspace(0, 2, 41), np.linspace(0, 1, 21), indexing="ij")
    for cost, count in (
        ((x - 1) ** 2 + y, 1),  # on the border
        (np.minimum((x - 0.5) ** 2, (x - 1.5) ** 2) + (y - 0.5) ** 2, 2),
        (-((x - 1) ** 2) - (y - 0.5) ** 2, 4),  # the corners
    ):
        table = pd.DataFrame({"mu": x.ravel(), "epsilon": y.ravel(), "cost": cost.ravel()})
        assert local_minima(table) == count


MU, EPSILON, NOISE = 0.12, 0.6, 0.01


@pytest.fixture(scope="module")
def study_tables():
    rng = np.random.default_rng(1)
    impacts = falling_ellipses(rng, 160, law="anitescu_potra_newton", mu=MU, epsilon=EPSILON, noise=NOISE)
    laws = tuple(LAWS)
    train = study.split_trials(impacts.trial, 0.5, rng)
    training, split = impacts.select(train), study.split_table(impacts, train)
    both = ("kinetic", "unweighted")
    ensemble = study.ensemble_table(training, laws, both, 20, rng)
    axes = np.linspace(0, 0.4, 7), np.linspace(0.2, 0.9, 7)
    return {
        "impacts": impacts,
        "split": split,
        "ensemble": ensemble,
        "individual": study.individual_table(impacts, laws, both),
        "errors": study.held_out_errors(impacts, split, ensemble, "kinetic"),
        "topography": study.topography_table(training, "whittaker", 50, *axes, rng),
        "convergence": study.convergence_table(training, ("whittaker",), (5, 20, 80), 2, rng),
        "tolerance": 0.01,
    }


def held_out_of(tables):
    return study.pick(tables["impacts"], tables["split"], train=0)


@pytest.fixture(scope="module")
def table(study_tables) -> pd.DataFrame:
    return statements(**study_tables)


class TestAll:
    """The whole table, from a study of impacts that Anitescu-Potra-Newton made with little noise."""

    def value(self, table: pd.DataFrame, statement: str, law: str = "") -> pd.Series:
        (row,) = table[(table["statement"] == statement) & (table["law"] == law)].itertuples()
        return row

    @pytest.mark.slow
    def test_columns_and_unique_rows(self, table):
        assert table.columns.tolist() == ["statement", "law", "value", "std", "unit"]
        assert not table[["statement", "law"]].duplicated().any()
        assert np.isfinite(table["value"].to_numpy(float)).all()
        assert (table["std"].dropna() >= 0).all()

    def test_bound_is_what_noise_leaves(self, table, study_tables):
        row = self.value(table, "irb_bound")
        assert row.value == pytest.approx(irb(held_out_of(study_tables)).mean())
        # of three noisy components the impulse takes up two
        assert 0.3 * NOISE < row.value < 2 * NOISE
        assert self.value(table, "irb_bound_mirrored").value > 20 * row.value

    def test_steep_friction_is_worse(self, table):
        row = self.value(table, "steep_friction", "anitescu_potra_newton")
        assert row.value > 5 * row.std > 0 and row.unit == "m/s"

    def test_individual_parameters_of_the_true_law(self, table, study_tables):
        """Impacts that stick report μ_s < μ, so the mean of μ is lower; that of ε is not."""
        law = "anitescu_potra_newton"
        row = self.value(table, "individual_minus_ensemble_epsilon", law)
        assert abs(row.value) < 4 * row.std + 0.01
        assert self.value(table, "individual_minus_ensemble_mu", law).value < 0
        part = study_tables["individual"].query("law == @law and weighting == 'kinetic'")
        spread = self.value(table, "individual_spread_epsilon", law).value
        assert spread == pytest.approx(part["epsilon"].std() / EPSILON, rel=0.05)
        assert self.value(table, "epsilon_mode", law).value == pytest.approx(EPSILON, abs=0.03)
        assert self.value(table, "mu_zero", law).value == pytest.approx((part["mu"] < 1e-3).mean())

    def test_standard_error_of_individual_minus_ensemble(self, table, study_tables):
        """The mean of n individual values and the ensemble's are taken as independent, so variances add."""
        law = "anitescu_potra_newton"
        part = study_tables["individual"].query("law == @law and weighting == 'kinetic'")
        fit = study_tables["ensemble"].query("law == @law and weighting == 'kinetic'").iloc[0]
        for name in ("mu", "epsilon"):
            row = self.value(table, f"individual_minus_ensemble_{name}", law)
            assert row.value == pytest.approx(part[name].mean() - fit[name])
            of_mean = part[name].std(ddof=1) / np.sqrt(len(part))
            assert min(of_mean, fit[f"{name}_std"]) > 0
            assert row.std == pytest.approx(np.sqrt(of_mean**2 + fit[f"{name}_std"] ** 2))

    def test_best_post_hoc_is_better_than_the_law_that_made_the_data(self, table, study_tables):
        wide = study_tables["errors"].pivot(index=["trial", "impact"], columns="model", values="velocity_error")
        for law, laws in (("anitescu_potra_newton", SIX_AS_PUBLISHED), ("whittaker", SIX_LAWS)):
            row = self.value(table, "over_best_post_hoc", law)
            gain = wide[law] - wide[list(laws)].min(axis=1)
            assert row.value == pytest.approx(gain.mean()) and row.value > 0
            assert row.std == pytest.approx(gain.std(ddof=1) / np.sqrt(len(gain)))

    def test_rows_about_energy_are_appended(self, study_tables, table):
        row = pd.DataFrame([("energy_loss", "", 1.0, 0.1, "1")], columns=table.columns)
        more = statements(**study_tables, energy=row)
        assert len(more) == len(table) + 1 and more.iloc[-1]["statement"] == "energy_loss"

    def test_shares_of_measured_and_predicted_impulses(self, table, study_tables):
        held_out = held_out_of(study_tables)
        target = target_of(held_out)
        measured = target.space, target.c_t, target.c_n
        assert self.value(table, "back_spin").value == pytest.approx(reverses(*measured).mean())
        assert self.value(table, "beyond_sticking").value == pytest.approx(crosses(*measured).mean())
        law = "anitescu_potra_newton"
        fit = study_tables["ensemble"].query("law == @law and weighting == 'kinetic'").iloc[0]
        out = LAWS[law](held_out.v_pre, held_out.r, mass=MASS, k_g=K_G, mu=fit["mu"], epsilon=fit["epsilon"])
        predicted = reverses(target.space, *out.impulse.T).mean()
        assert self.value(table, "predicted_back_spin", law).value == pytest.approx(predicted)
        # friction on the final slip can stop at sticking, never go beyond; Whittaker's law forbids reversal too
        assert predicted > 0.0 == self.value(table, "predicted_beyond_sticking", law).value
        assert self.value(table, "predicted_back_spin", "whittaker").value == 0.0

    def test_small_momentum(self, table, study_tables):
        held_out, errors = held_out_of(study_tables), study_tables["errors"]
        space = contact_space(held_out.v_pre, held_out.r, mass=MASS, k_g=K_G)
        # tangential momentum of the contact, M_C v_C
        momentum = np.abs(np.einsum("nij,nj->ni", space.M_c, np.stack([space.v_t, space.v_n], 1))[:, 0])
        error = errors.loc[errors["model"] == "anitescu_potra_poisson", "velocity_error"].to_numpy()
        order = np.argsort(momentum)
        quarter = int(np.ceil(len(order) / 4))
        ratio = error[order[:quarter]].mean() / error[order[quarter:]].mean()
        law = "anitescu_potra_poisson"
        assert self.value(table, "small_momentum", law).value == pytest.approx(ratio, rel=0.05)

    def test_tables_may_come_from_files(self, study_tables, table, tmp_path):
        read = {name: study_tables[name] for name in ("impacts", "tolerance")}
        for name in set(study_tables) - set(read):
            write_table(study_tables[name], tmp_path / f"{name}.csv")
            read[name] = read_table(tmp_path / f"{name}.csv")
        again = statements(**read)
        assert again[["statement", "law"]].equals(table[["statement", "law"]])
        np.testing.assert_allclose(again["value"].to_numpy(float), table["value"].to_numpy(float), rtol=1e-4, atol=1e-6)


class TestSlowest:
    def test_any_number_of_laws_may_be_followed(self, study_tables):
        part = study_tables["convergence"]
        late = part.assign(law="mirtich", mu=np.where(part["k"] < 80, 1.0, part["mu"]))
        for convergence, laws in (
            (part, {"", "whittaker"}),
            (pd.concat([part, late]), {"", "whittaker", "mirtich"}),
            (part.iloc[:0], set()),
        ):
            found = statements(**{**study_tables, "convergence": convergence})
            found = found[found["statement"] == "converged_at"].set_index("law")["value"]
            assert set(found.index) == laws
            if laws:
                assert found[""] == found.drop("").max()
