"""From which impacts table 3.1 was identified: found where it is known, and what the published set says."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from known_truth import falling_ellipses

from thesis_lib.contact.space import velocity_change
from thesis_lib.datasets.read import read_dataset
from thesis_lib.foundation.files import read_table
from thesis_lib.thesis.impact_study import stored_predictions as module
from thesis_lib.thesis.impact_study.stored_predictions import (
    TABLE_3_1,
    TOGETHER,
    first_drops,
    first_kept,
    law_with_gravity_step,
    target_with_gravity_step,
)

ROOT = Path(__file__).parents[2]
LAWS = ("anitescu_potra_newton", "wang_mason")  # as published they are themselves, and quick
FOUND = 1e-4  # the last cells of the search
N, IMPACTS = 40, 200
NOISE = 2e-3  # N s, a fiftieth of the impulse
KEPT = 127  # of the first 150 drops
STORED = ROOT / "config/reference/chapter3/published_first_drops.csv"


@pytest.fixture
def two_laws(monkeypatch):
    monkeypatch.setattr(module, "SIX_LAWS", LAWS)
    monkeypatch.setattr(module, "SIX_AS_PUBLISHED", LAWS)


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


@pytest.mark.parametrize("law", LAWS)
def test_first_drops_of_another_friction_are_told_apart(law, two_laws, rng):
    offset = np.where(np.arange(IMPACTS) < N, 0.0, 0.05)
    impacts = dropped(law, offset, rng)
    # the order is that of the trials, not of the rows
    table = first_drops(impacts.select(rng.permutation(IMPACTS)), N, 20, rng).set_index("law")
    row, (mu, epsilon) = table.loc[law], TABLE_3_1[law]
    assert row["mu"] == pytest.approx(mu, abs=FOUND) and row["epsilon"] == pytest.approx(epsilon, abs=FOUND)
    assert row["lower"] == 0.0 and row["nearer"] == 0.0 and row["nearer_runs"] == 0.0
    assert row["mu_runs_low"] > mu + 0.04 and row["n_runs"] == IMPACTS // N - 1 and row["n_random"] == 20
    assert table["n"].unique().tolist() == [N] and list(table.index) == [*LAWS, TOGETHER]
    assert table.loc[TOGETHER, "mu"] == pytest.approx(table.loc[list(LAWS), "mu"].mean())


def test_drops_of_one_friction_are_not(two_laws, rng):
    """The test above can fail: where the first drops are like all others, random subsets do as well."""
    impacts = dropped("wang_mason", np.zeros(IMPACTS), rng, noise=NOISE)
    row = first_drops(impacts, N, 40, rng).set_index("law").loc["wang_mason"]
    assert 0.1 < row["lower"] < 0.9 and row["mu_runs_low"] < TABLE_3_1["wang_mason"][0] < row["mu_runs_high"]


def test_drops_with_a_flag_do_not_count():
    drops = pd.DataFrame({"trial": range(5), "flag_a": [0, 1, 0, 0, 0], "flag_b": [0, 1, 1, 0, 0]})
    assert first_kept(drops, 4) == 2 and first_kept(drops) == 3


def test_the_published_set_gives_the_stored_numbers(planar_impact_dir, two_laws, rng):
    assert first_kept(read_table(planar_impact_dir / "all_drops.csv")) == KEPT
    impacts = read_dataset(planar_impact_dir).stated_impacts()
    table = first_drops(impacts, KEPT, 2, rng).set_index("law")
    stored = pd.read_csv(STORED).set_index("law")
    for column in ("mu", "epsilon", "mu_runs_low", "mu_runs_high", "nearer_runs", "n"):
        found = table.loc[list(LAWS), column].to_numpy(float)
        np.testing.assert_allclose(found, stored.loc[list(LAWS), column], atol=FOUND, err_msg=column)


NAMES = {
    "DrumShell": "drumwright_shell",
    "AP Poisson": "anitescu_potra_poisson",
    "AP Newton": "anitescu_potra_newton",
    "Mirtich": "mirtich",
    "Wang-Mason": "wang_mason",
    "Whittaker": "whittaker",
}


def test_the_findings_say_what_is_stored():
    stored = pd.read_csv(STORED).set_index("law")
    text = (ROOT / "docs/findings.md").read_text(encoding="utf-8")
    table = text[text.index("<!-- first drops -->") : text.index("<!-- /first drops -->")]
    rows = [[cell.strip() for cell in line.strip("| ").split("|")] for line in table.splitlines()[3:]]
    assert [row[0] for row in rows] == list(NAMES)
    for name, published, first, random, lower in rows:
        own = stored.loc[NAMES[name]]
        numbers = [float(x) for pair in (published, first) for x in pair.split("; ")]
        wanted = own[["mu_published", "epsilon_published", "mu", "epsilon"]]
        assert numbers == pytest.approx(list(wanted), abs=0.00051), name
        mu, std = (float(x) for x in random.split(" ± "))
        assert (mu, std) == pytest.approx((own["mu_random"], own["mu_random_std"]), abs=0.00051), name
        assert float(lower.strip(" %")) == pytest.approx(100.0 * own["lower"], abs=0.51), name
    # what the text below the table says of it
    others = stored.drop(index=["anitescu_potra_newton", TOGETHER])
    for column in ("mu", "epsilon"):
        assert round((others[column] - others[f"{column}_published"]).abs().max(), 3) <= 0.005
    together = stored.loc[TOGETHER]
    assert together["nearer"] == 0.0 and together["nearer_runs"] == 0.0
    said = f"none of {together['n_random']:.0f} random subsets and none of the {together['n_runs']:.0f} later runs"
    assert said in " ".join(text.split())
    said = f"the mean μ of the six laws goes from {together['mu_runs_low']:.3f} to {together['mu_runs_high']:.3f}"
    assert said in " ".join(text.split())


def test_the_findings_say_what_is_stored_of_table_3_2():
    row = pd.read_csv(ROOT / "config/reference/chapter3/table_3_2.csv").set_index("law").loc["mirtich"]
    text = " ".join((ROOT / "docs/findings.md").read_text(encoding="utf-8").split())
    assert f"Table 3.2's Mirtich** (0.413, ours {row['fraction']:.3f})" in text
    assert f"viscosity beyond 1 s/m the share is {row['fraction_up_to_one']:.3f}" in text
