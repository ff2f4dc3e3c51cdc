"""Tables 3.1 and 3.2 and the error summary, on hand-made tables with counts that can be checked by eye."""

import numpy as np
import pandas as pd
import pytest

from thesis_lib.contact import LAWS, SIX_LAWS
from thesis_lib.thesis.impact_study.tables import (
    SIX_AS_PUBLISHED,
    VARIANTS,
    best_and_worst,
    error_summary,
    table_3_1,
    table_3_2,
)


def errors_of(values: dict[str, list[float]], column: str) -> pd.DataFrame:
    """Errors in the form of `held_out_errors`: model -> one value an impact."""
    other = {"velocity_error": "impulse_error", "impulse_error": "velocity_error"}[column]
    rows = [
        {"trial": i, "impact": 0, "model": model, column: value, other: 99.0 - value}
        for model, list_ in values.items()
        for i, value in enumerate(list_)
    ]
    return pd.DataFrame(rows).sample(frac=1.0, random_state=0)  # tables must not hang on the order of rows


class TestBestAndWorst:
    def test_counts(self):
        errors = np.array([[1.0, 2.0, 3.0], [3.0, 2.0, 1.0], [1.0, 3.0, 2.0], [1.0, 2.0, 4.0]])
        best, worst = best_and_worst(errors)
        assert best.tolist() == [0.75, 0.0, 0.25]
        assert worst.tolist() == [0.25, 0.25, 0.5]

    def test_failed_solve_is_worst_and_never_best(self):
        best, worst = best_and_worst(np.array([[np.nan, 5.0, 1.0], [2.0, np.nan, 9.0]]))
        assert best.tolist() == [0.5, 0.0, 0.5]
        assert worst.tolist() == [0.5, 0.5, 0.0]


class TestTable31:
    @pytest.fixture
    def table(self) -> pd.DataFrame:
        # as read from a file, where empty text is NaN
        rows = [
            (law, weighting, 0.01 * i + j, 0.5 + 0.01 * i, "mu" if law == SIX_LAWS[0] else np.nan)
            for j, weighting in enumerate(("kinetic", "unweighted"))
            for i, law in enumerate(LAWS)
        ]
        ensemble = pd.DataFrame(rows, columns=["law", "weighting", "mu", "epsilon", "at_bound"])
        ensemble = ensemble.assign(mu_std=0.001, epsilon_std=0.002, n=77)
        # the first law is best in three of four impacts, the second in one; the last is always worst
        defined = {law: [2.0 + i] * 4 for i, law in enumerate(SIX_LAWS)}
        defined[SIX_LAWS[0]] = [1.0, 1.0, 1.0, 3.5]
        published = {law: [2.0 - 0.1 * i] * 4 for i, law in enumerate(SIX_AS_PUBLISHED) if law not in SIX_LAWS}
        bound = {"irb_bound": [0.0] * 4}
        errors = errors_of({**defined, **published, **bound}, "impulse_error")
        return table_3_1(ensemble, {"kinetic": errors, "unweighted": errors})

    def test_rows(self, table):
        keys = table[["variant", "weighting", "law"]]
        assert len(table) == 24 and not keys.duplicated().any()
        assert table["law"].tolist() == [*SIX_LAWS] * 4
        assert (table["n_train"] == 77).all() and (table["n_held_out"] == 4).all()

    def test_counts_are_among_the_six_of_a_variant(self, table):
        for (variant, _), part in table.groupby(["variant", "weighting"]):
            assert part["best"].sum() == pytest.approx(100) and part["worst"].sum() == pytest.approx(100)
            if variant == "as_defined":
                assert part["best"].tolist() == [75, 25, 0, 0, 0, 0]
                assert part["worst"].tolist() == [0, 0, 0, 0, 0, 100]
                # Wilson: √(p (1 − p)/n + 1/(4 n²))/(1 + 1/n)
                assert part["best_std"].tolist()[:3] == pytest.approx([100 * np.sqrt(1 / 16) / 1.25] * 2 + [10])

    def test_parameters_at_the_edge_of_their_range_are_named(self, table):
        published_shell = SIX_AS_PUBLISHED[0]
        assert published_shell != SIX_LAWS[0]
        at_edge = table[table["law"] == SIX_LAWS[0]].set_index("variant")["at_bound"]
        assert set(at_edge["as_defined"]) == {"mu"} and set(at_edge["as_published"]) == {""}
        assert set(table.loc[table["law"] != SIX_LAWS[0], "at_bound"]) == {""}

    def test_parameters_are_those_of_the_variant_and_weighting(self, table):
        names = list(LAWS)
        for row in table.itertuples():
            name = VARIANTS[row.variant][SIX_LAWS.index(row.law)]
            offset = ("kinetic", "unweighted").index(row.weighting)
            assert row.mu == pytest.approx(0.01 * names.index(name) + offset)
            assert row.epsilon == pytest.approx(0.5 + 0.01 * names.index(name))


class TestTable32:
    def test_shares(self):
        values = {law: [0.0, 2.0, 4.0, np.nan] for law in SIX_LAWS}
        values["mirtich"] = [0.0, 1.0, 2.0, 3.0]
        values |= {law: [9.0] * 4 for law in SIX_AS_PUBLISHED if law not in SIX_LAWS}
        rows = [
            (law, weighting, 2.0 if error == 1.0 else 1.0, 0.5 * scale * error)
            for weighting, scale in (("kinetic", 1), ("unweighted", 100))
            for law, list_ in values.items()
            for error in list_
        ]
        individual = pd.DataFrame(rows, columns=["law", "weighting", "mu", "misfit"])
        table = table_3_2(individual, (1.5, 2.0), mass=0.5).set_index(["variant", "weighting", "law", "tolerance"])
        assert len(table) == 2 * 2 * 6 * 2
        assert table.loc[("as_defined", "kinetic", "mirtich", 1.5), "fraction"] == 0.5
        # the tolerance itself is within
        assert table.loc[("as_defined", "kinetic", "mirtich", 2.0), "fraction"] == 0.75
        # one of them needs μ = 2
        assert table.loc[("as_defined", "kinetic", "mirtich", 2.0), "fraction_up_to_one"] == 0.5
        # an impact that the law never resolves is outside, and counts
        row = table.loc[("as_defined", "kinetic", "whittaker", 2.0)]
        assert row["fraction"] == 0.5 and row["n"] == 4
        assert row["fraction_std"] == pytest.approx(np.sqrt(0.25 / 4 + 1 / 64) / 1.25)  # Wilson
        assert table.loc[("as_published", "kinetic", "mirtich", 2.0), "fraction"] == 0.0
        assert table.loc[("as_defined", "unweighted", "mirtich", 2.0), "fraction"] == 0.25


class TestErrorSummary:
    def test_values(self):
        values = {law: [10.0 + i] * 5 for i, law in enumerate({**LAWS})}
        values["mirtich"] = [1.0, 2.0, 3.0, 4.0, np.nan]
        values["wang_mason"] = [9.0, 1.0, 9.0, 9.0, 9.0]
        table = error_summary(errors_of(values, "velocity_error")).set_index("model")
        row = table.loc["mirtich"]
        assert (row["mean"], row["median"], row["n"], row["n_failed"]) == (2.5, 2.5, 4, 1)
        assert row["quantile_90"] == pytest.approx(3.7)
        assert row["mean_std"] == pytest.approx(np.std([1, 2, 3, 4], ddof=1) / 2)
        # the best of the six in each impact
        assert table.loc["best_post_hoc_as_defined", "mean"] == pytest.approx((1 + 1 + 3 + 4 + 9) / 5)
        # mirtich as published is another law; wang_mason is in both variants
        assert table.loc["best_post_hoc_as_published", "mean"] == pytest.approx((9 + 1 + 9 + 9 + 9) / 5)
