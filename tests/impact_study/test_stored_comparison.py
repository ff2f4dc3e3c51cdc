"""Our laws and counts against what the authors stored, and from which drops they identified table 3.1."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from known_truth import falling_ellipses, with_outcome

from thesis_lib.contact import LAWS, SIX_LAWS
from thesis_lib.contact.space import measured_impulse, velocity_change
from thesis_lib.datasets.read import read_dataset
from thesis_lib.foundation.files import read_table
from thesis_lib.thesis.impact_study import stored_predictions
from thesis_lib.thesis.impact_study.stored_predictions import (
    GRAVITY_STEP,
    TABLE_3_1,
    TOGETHER,
    agreement,
    best_worst,
    cost_at_published,
    drops_kept,
    first_drops,
    first_kept,
    law_with_gravity_step,
    parameters,
    target_with_gravity_step,
)
from thesis_lib.thesis.impact_study.tables import SIX_AS_PUBLISHED

# per cent of impacts in which each law is best and worst, thesis, table 3.1
COUNTS = {
    "drumwright_shell": (4, 11),
    "anitescu_potra_poisson": (7, 6),
    "anitescu_potra_newton": (25, 0),
    "mirtich": (17, 43),
    "wang_mason": (16, 10),
    "whittaker": (31, 30),
}
PRINTED = 1.0  # printed in whole per cent, and ties and rounding shift a few of 1718 impacts
MATCHES = 2e-4  # N s: two steps of the authors' marching laws; impulses are about 0.1 N s
KEPT = 1718  # thesis, section 3.4
TWO_LAWS = ("anitescu_potra_newton", "wang_mason")  # as published they are themselves, and quick
PAIRS = [(law, law) for law in TWO_LAWS]
MU, EPSILON = 0.11, 0.52
RECOVERED = 2e-5  # the search stops at 1e-6, and a kinked cost is flat to a few times that
FOUND = 1e-4  # the last cells of the search of first drops
N, IMPACTS = 40, 200
NOISE = 2e-3  # N s, a fiftieth of the impulse
FIRST_KEPT = 127  # of the first 150 drops
STORED = Path(__file__).parents[2] / "config/reference/chapter3/published_first_drops.csv"
UNSTEPPED = 3e-3  # the step lowers |v_n| by 39 mm/s of some 2 m/s


@pytest.fixture(scope="module")
def stored(planar_impact_dir):
    return read_table(planar_impact_dir / "published_predictions.csv")


@pytest.fixture(scope="module")
def impacts(planar_impact_dir):
    return read_dataset(planar_impact_dir).stated_impacts()


def test_best_and_worst_are_those_of_the_thesis(stored):
    table = best_worst(stored).set_index("law")
    assert tuple(table.index) == SIX_LAWS and (table["n"] == KEPT).all()
    for law, (best, worst) in COUNTS.items():
        assert table.loc[law, "best"] == pytest.approx(best, abs=PRINTED), law
        assert table.loc[law, "worst"] == pytest.approx(worst, abs=PRINTED), law


def test_our_laws_as_published_match_the_stored_impulses(impacts, stored):
    table = agreement(impacts, stored).set_index(["law", "variant"])
    published = table.xs("as_published", level="variant")
    assert tuple(published.index) == SIX_LAWS
    assert (published["median"] < MATCHES).all(), published
    # the laws as defined are something else where the authors' code differs
    defined = table.xs("as_defined", level="variant")
    assert set(defined.index) == {"drumwright_shell", "anitescu_potra_poisson", "mirtich", "whittaker"}
    worse = {law for law in defined.index if defined.loc[law, "median"] > 5 * MATCHES}
    assert "mirtich" in worse and "drumwright_shell" in worse


def test_agreement_does_not_depend_on_the_order_of_impacts(impacts, stored, rng):
    rows = rng.permutation(len(impacts))[:300]
    a = agreement(impacts.select(rows), stored)
    b = agreement(impacts.select(np.sort(rows)), stored.sample(frac=1.0, random_state=0))
    np.testing.assert_allclose(a["median"], b["median"], rtol=1e-12)


def test_published_parameters_are_nearly_as_good_as_ours(impacts):
    few = impacts.select(np.arange(0, len(impacts), 20))
    table = cost_at_published(few)
    assert tuple(table["law"]) == SIX_LAWS
    assert (table["excess"] > -1e-9).all()  # ours are the best
    assert (table["excess"] < 0.5).all()


def test_drops_kept_are_those_of_the_thesis(planar_impact_dir):
    counts = drops_kept(read_table(planar_impact_dir / "all_drops.csv")).set_index("drops")["count"]
    assert counts["all"] == 2000 and counts["kept"] == KEPT
    assert len(counts) > 2 and (counts.drop(["all", "kept"]) <= 2000 - KEPT).all()


def only_these_laws(monkeypatch, pairs):
    laws, names = zip(*pairs)
    monkeypatch.setattr(stored_predictions, "SIX_LAWS", laws)
    monkeypatch.setattr(stored_predictions, "SIX_AS_PUBLISHED", names)


@pytest.fixture
def two_laws(monkeypatch):
    only_these_laws(monkeypatch, PAIRS)


class TestParametersWithGravityStep:
    """Outcomes made as the authors' code makes predictions: (μ, ε) must come back. No measured data needed."""

    @pytest.fixture
    def fall(self, rng):
        return falling_ellipses(rng, 60)

    def predicted(self, fall, name, law):
        """v + step + M⁻¹ Jᵀ c, with the law called after the step, as `agreement` found it."""
        body = {"mass": fall.mass, "k_g": fall.k_g}
        stepped = fall.v_pre + GRAVITY_STEP
        v_n, after = (v[:, 1] + fall.r[:, 0] * v[:, 2] for v in (fall.v_pre, stepped))
        fed = EPSILON * v_n / after if law == "anitescu_potra_newton" else EPSILON
        out = LAWS[name](stepped, fall.r, **body, mu=MU, epsilon=fed)
        # the stored impulse M_C J (v⁺ − v) is all that the identification sees of the outcome
        dv = out.v_post - fall.v_pre
        c = measured_impulse(dv, fall.r, **body)
        return fall.v_pre + velocity_change(*c, fall.r, **body)

    @pytest.mark.parametrize(("law", "name"), list(zip(SIX_LAWS, SIX_AS_PUBLISHED)))
    def test_what_made_the_outcomes_is_found(self, fall, law, name, monkeypatch):
        only_these_laws(monkeypatch, [(law, name)])
        made = replace(fall, v_post=self.predicted(fall, name, law))
        (row,) = parameters(made, seed=0).itertuples()
        assert row.law == law and row.n == 60 and row.at_bound == ""
        assert row.mu == pytest.approx(MU, abs=RECOVERED) and row.epsilon == pytest.approx(EPSILON, abs=RECOVERED)

    def test_without_the_step_something_else_is_found(self, fall, monkeypatch):
        """The test above can fail: outcomes without the step give another ε."""
        only_these_laws(monkeypatch, PAIRS[1:])
        made = with_outcome(fall, "wang_mason", MU, EPSILON)
        (row,) = parameters(made, seed=0).itertuples()
        assert abs(row.epsilon - EPSILON) > UNSTEPPED

    def test_a_seed_gives_the_same_errors_whatever_other_laws_there_are(self, fall, two_laws, monkeypatch):
        made = with_outcome(fall, "wang_mason", MU, EPSILON, noise=0.05, rng=np.random.default_rng(1))
        both = parameters(made, seed=3).set_index("law").loc["wang_mason"]
        only_these_laws(monkeypatch, PAIRS[1:])
        alone = parameters(made, seed=3).set_index("law").loc["wang_mason"]
        assert both.equals(alone) and alone["mu_std"] > 0
        assert parameters(made, seed=4).iloc[0]["mu_std"] != alone["mu_std"]


def dropped(law, offset, rng, noise=0.0):
    """Impacts whose outcome is that of one law at table 3.1's ε and at its μ plus `offset` (n,), in recorded order."""
    fall = falling_ellipses(rng, IMPACTS)
    fall = replace(fall, trial=np.arange(IMPACTS), impact=np.zeros(IMPACTS, dtype=int))
    mu, epsilon = TABLE_3_1[law]
    target = target_with_gravity_step(fall)
    # with v_post = v_pre the target's impulse is minus gravity's part
    with np.errstate(all="ignore"):  # branches of the law that are not taken
        c = np.stack(law_with_gravity_step(law, law).impulse(target.space, mu + offset, np.full(IMPACTS, epsilon)))
    c = c - np.stack([target.c_t, target.c_n]) + noise * rng.standard_normal(c.shape)
    return replace(fall, v_post=fall.v_pre + velocity_change(*c, fall.r, mass=fall.mass, k_g=fall.k_g))


@pytest.mark.parametrize("law", TWO_LAWS)
def test_first_drops_of_another_friction_are_told_apart(law, two_laws, rng):
    offset = np.where(np.arange(IMPACTS) < N, 0.0, 0.05)
    impacts = dropped(law, offset, rng)
    # the order is that of the trials, not of the rows
    table = first_drops(impacts.select(rng.permutation(IMPACTS)), N, 20, rng).set_index("law")
    row, (mu, epsilon) = table.loc[law], TABLE_3_1[law]
    assert row["mu"] == pytest.approx(mu, abs=FOUND) and row["epsilon"] == pytest.approx(epsilon, abs=FOUND)
    assert row["lower"] == 0.0 and row["nearer"] == 0.0 and row["nearer_runs"] == 0.0
    assert row["mu_runs_low"] > mu + 0.04 and row["n_runs"] == IMPACTS // N - 1 and row["n_random"] == 20
    assert table["n"].unique().tolist() == [N] and list(table.index) == [*TWO_LAWS, TOGETHER]
    assert table.loc[TOGETHER, "mu"] == pytest.approx(table.loc[list(TWO_LAWS), "mu"].mean())


def test_drops_of_one_friction_are_not(two_laws, rng):
    """The test above can fail: where the first drops are like all others, random subsets do as well."""
    impacts = dropped("wang_mason", np.zeros(IMPACTS), rng, noise=NOISE)
    row = first_drops(impacts, N, 40, rng).set_index("law").loc["wang_mason"]
    assert 0.1 < row["lower"] < 0.9 and row["mu_runs_low"] < TABLE_3_1["wang_mason"][0] < row["mu_runs_high"]


def test_drops_with_a_flag_do_not_count():
    drops = pd.DataFrame({"trial": range(5), "flag_a": [0, 1, 0, 0, 0], "flag_b": [0, 1, 1, 0, 0]})
    assert first_kept(drops, 4) == 2 and first_kept(drops) == 3


def test_the_published_set_gives_the_stored_numbers(planar_impact_dir, impacts, two_laws, rng):
    assert first_kept(read_table(planar_impact_dir / "all_drops.csv")) == FIRST_KEPT
    table = first_drops(impacts, FIRST_KEPT, 2, rng).set_index("law")
    stored = pd.read_csv(STORED).set_index("law")
    for column in ("mu", "epsilon", "mu_runs_low", "mu_runs_high", "nearer_runs", "n"):
        found = table.loc[list(TWO_LAWS), column].to_numpy(float)
        np.testing.assert_allclose(found, stored.loc[list(TWO_LAWS), column], atol=FOUND, err_msg=column)
