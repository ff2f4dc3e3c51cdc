"""The null of the largest gain on linear Gaussian models: rate of false positives, noise of unknown scale, luck."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import binom

from thesis_lib.critique.selection.evidence import Evidence
from thesis_lib.critique.selection.scan import Scan, scan
from thesis_lib.critique.selection.settings import SearchSettings
from thesis_lib.critique.selection.world import Slopes

POINTS = 300  # so many that a variance estimated from them is known to 8 %
DATASETS = 800
DRAWS = 99  # p-values are multiples of 1 %, so that p <= alpha has the probability alpha exactly
CONFIDENCE = 0.99
UNKNOWN = 3.0  # standard deviation of noise that is estimated
TELL_APART = SearchSettings().tell_apart


def slopes(residual: np.ndarray, unit_noise: bool) -> Slopes:
    """A line, and three candidates of which two are alike and one has three columns."""
    x = np.linspace(-1.0, 1.0, len(residual))
    candidates = {"square": [x**2], "bowl": [np.cosh(2.0 * x)], "waves": [np.sin(k * x) for k in (3.0, 5.0, 7.0)]}
    columns = {name: np.column_stack(of) for name, of in candidates.items()}
    return Slopes(residual, np.column_stack([np.ones_like(x), x]), columns, unit_noise)


def p_values(found: Scan) -> list[float]:
    return [found.p_value(gain) for gain in found.gain.values()]


@pytest.mark.parametrize(("unit_noise", "sigma"), [(True, 1.0), (False, UNKNOWN)])
def test_false_positives_come_at_the_stated_rate(unit_noise, sigma):
    rng = np.random.default_rng(20)
    noise = sigma * rng.standard_normal((DATASETS, POINTS))
    smallest = np.array([min(p_values(scan(slopes(z, unit_noise), DRAWS, rng))) for z in noise])
    for alpha in (0.05, 0.2):
        least, most = binom.interval(CONFIDENCE, DATASETS, alpha)
        assert least <= np.sum(smallest <= alpha + 1e-9) <= most


def test_a_scale_of_the_noise_changes_p_values_only_where_the_noise_is_known():
    z = np.random.default_rng(21).standard_normal(POINTS)
    for unit_noise in (False, True):
        one, other = (scan(slopes(s * z, unit_noise), 999, np.random.default_rng(0)) for s in (1.0, UNKNOWN))
        assert (p_values(one) == p_values(other)) is not unit_noise
        np.testing.assert_allclose(other.null, (1.0 if unit_noise else UNKNOWN**2) * one.null)


def test_an_equal_gain_by_luck_makes_no_alternative():
    """Both gain alike, but if one is at work, the other explains next to nothing of it."""
    x = np.linspace(-1.0, 1.0, POINTS)
    columns = {"even": np.cos(np.pi * x)[:, None], "odd": np.sin(np.pi * x)[:, None]}
    columns["like_even"] = columns["even"] + 0.1 * np.cos(3.0 * np.pi * x)[:, None]
    z = columns["even"][:, 0] + columns["odd"][:, 0]
    found = scan(Slopes(z, np.ones((POINTS, 1)), columns, unit_noise=True), DRAWS, np.random.default_rng(0))
    assert found.gain["even"] == pytest.approx(found.gain["odd"], rel=0.05)
    assert found.cosine("even", "odd") < 0.05 and found.expected_loss("even", "odd") > 10.0 * TELL_APART
    for other in ("odd", "like_even"):
        loss = found.gain["even"] * (1.0 - found.cosine("even", other) ** 2)
        assert found.expected_loss("even", other) == pytest.approx(loss)
    world = SimpleNamespace(trials=np.arange(10), includes=lambda candidate, other: False)
    evidence = Evidence(world, SearchSettings(), np.random.default_rng(0))
    equal = dict.fromkeys(columns, found.gain["even"])
    assert evidence.alternatives("even", equal, found, {}) == ("like_even",)
    # nor does a likeness of columns, where the data say otherwise
    assert evidence.alternatives("even", equal | {"like_even": equal["even"] - 2.0 * TELL_APART}, found, {}) == ()


def test_an_effect_is_an_alternative_within_the_scatter_of_the_difference_by_trial():
    loss, trials = 2.0 * TELL_APART, np.arange(16)
    found = Scan({"a": 90.0, "b": 90.0}, np.zeros(1), dict.fromkeys("ab", np.ones((1, 1))), {"a": np.zeros(1)}, {})
    world = SimpleNamespace(trials=trials, includes=lambda candidate, other: False)
    evidence = Evidence(world, SearchSettings(), np.random.default_rng(0))

    def alternatives(spread: float) -> tuple[str, ...]:
        by_trial = {"a": np.zeros(16), "b": -loss / 16 + spread * (-1.0) ** trials}
        judgements = {name: SimpleNamespace(trials=trials, by_trial=by.take) for name, by in by_trial.items()}
        return evidence.alternatives("a", {"a": loss, "b": 0.0}, found, judgements)

    # two standard errors of a sum over 16 trials are 8 times the spread
    assert alternatives(0.0) == alternatives(loss / 10.0) == ()
    assert alternatives(loss / 7.0) == ("b",)
