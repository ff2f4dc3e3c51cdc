"""The benchmark compares like with like: the plain Python loop gives what the batched laws give."""

import numpy as np
import pandas as pd
import pytest

from benchmarks.impacts import falling_ellipses
from benchmarks.laws import main
from benchmarks.plain_laws import PLAIN_LAWS, resolve_all
from thesis_lib.contact import LAWS, SIX_LAWS
from thesis_lib.extensions.impact_draws import reference_draw

ROUNDING = 1e-10  # the same formulas in another order, times the condition of M_C


@pytest.mark.parametrize("name", SIX_LAWS)
def test_plain_law_equals_the_batched_one(name, rng):
    draw = reference_draw(rng, 3000)
    draw.v_pre[:5] *= -1.0  # not approaching
    for mu, epsilon in ((0.15, 0.55), (0.0, 1.0), (1.2, 0.0)):
        plain, impulse = resolve_all(
            PLAIN_LAWS[name], draw.v_pre.tolist(), draw.r.tolist(), mass=1.0, k_g=1.0, mu=mu, epsilon=epsilon
        )
        out = draw.resolve(LAWS[name], mu=mu, epsilon=epsilon)
        assert np.max(np.abs(out.impulse - impulse) / draw.speed[:, None]) <= ROUNDING
        np.testing.assert_allclose(plain, out.v_post, rtol=0, atol=1e-8)


def test_benchmark_runs_and_writes_its_figures(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("benchmarks.laws.SECONDS", 0.0)
    main(["-n", "20", "--rounds", "1", "-o", str(tmp_path / "laws.csv")])
    printed = capsys.readouterr().out
    rows = pd.read_csv(tmp_path / "laws.csv")
    assert {measure.split(",")[0] for measure in rows["measure"]} == set(SIX_LAWS)
    assert all(name in printed for name in SIX_LAWS) and (rows["value"] > 0).all()


def test_benchmark_impacts_approach(rng):
    _, v_pre, r = falling_ellipses(rng, 1000)
    assert np.all(v_pre[:, 1] + r[:, 0] * v_pre[:, 2] < 0.0)
