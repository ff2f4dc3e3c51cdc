"""Regions of the laws and the admissible set: outlines that bound what they should, areas against Monte Carlo."""

from dataclasses import replace

import numpy as np
import pytest
from known_truth import K_G, MASS, falling_ellipses

from thesis_lib.contact import LAWS, SIX_LAWS
from thesis_lib.contact.law import Law
from thesis_lib.contact.space import admissible, contact_space
from thesis_lib.mechanics.contact import Contact
from thesis_lib.thesis.impact_study import predictive_range
from thesis_lib.thesis.impact_study.predictive_range import admissible_area, admissible_outline, covered_share

N = 25
DRAWS = 40_000  # Monte Carlo points; the area is good to 1 / sqrt(DRAWS) of that of the box, so
MONTE_CARLO = 0.025  # of the area: four standard errors, as the set fills a third of its box or more
HALVED = 5e-3  # change of the covered share when the grid gets twice as dense
MIRRORED = 1e-12


@pytest.fixture
def space(rng) -> Contact:
    impacts = falling_ellipses(rng, N)
    return contact_space(impacts.v_pre, impacts.r, mass=MASS, k_g=K_G)


@pytest.fixture
def skewed(rng) -> Contact:
    """Contacts with so much coupling that the line c_n = 0 cuts the half disc."""
    n = 300
    r = rng.uniform(-1, 1, (n, 2)) / 0.3
    v_pre = rng.standard_normal((n, 3))
    v_pre[:, 1] -= 1.0
    space = contact_space(v_pre, r, mass=1.0, k_g=1.0)
    return space[np.flatnonzero(space.v_n < -0.1)]


class TestAdmissibleSet:
    def test_outline_is_admissible_and_cannot_be_passed(self, space, skewed):
        for one in (space, skewed):
            c_t, c_n = admissible_outline(one)
            # rounding, on a line that is itself the limit
            assert admissible(one, c_t, c_n, tolerance=1e-8).all()
            middle_t, middle_n = c_t.mean(axis=0), c_n.mean(axis=0)
            farther = middle_t + 1.001 * (c_t - middle_t), middle_n + 1.001 * (c_n - middle_n)
            assert not admissible(one, *farther, tolerance=1e-8).any()

    def test_some_sets_are_cut_at_zero_normal_impulse(self, skewed):
        _, c_n = admissible_outline(skewed)
        cut = (np.abs(c_n) < 1e-12).sum(axis=0) > 1
        assert 0.05 < cut.mean() < 0.95  # both kinds are tested here

    def test_area_against_monte_carlo(self, space, skewed, rng):
        for one in (space, skewed[np.arange(N)]):
            c_t, c_n = admissible_outline(one)
            low_t, high_t, low_n, high_n = c_t.min(0), c_t.max(0), c_n.min(0), c_n.max(0)
            drawn_t = rng.uniform(low_t, high_t, (DRAWS, N))
            drawn_n = rng.uniform(low_n, high_n, (DRAWS, N))
            share = admissible(one, drawn_t, drawn_n).mean(axis=0)
            box = (high_t - low_t) * (high_n - low_n)
            np.testing.assert_allclose(admissible_area(one), share * box, rtol=MONTE_CARLO)


class TestCoveredShare:
    @pytest.mark.parametrize("name", LAWS)
    def test_between_none_and_all(self, name, space):
        if name == "mirtich_as_published":
            space = space[np.arange(3)]  # its solver is slow
        share = covered_share(LAWS[name], space)
        assert np.all((share >= 0.0) & (share <= 1.0))
        # Drumwright-Shell's bound on c_n forbids all friction that presses, so its region is often a mere line
        assert share.mean() > 0.005

    @pytest.mark.parametrize("name", SIX_LAWS)
    def test_a_denser_grid_changes_little(self, name, space, monkeypatch):
        share = covered_share(LAWS[name], space)
        monkeypatch.setitem(predictive_range.region.__kwdefaults__, "points", 2 * predictive_range.POINTS - 1)
        dense = covered_share(LAWS[name], space)
        assert not np.array_equal(dense, share)  # the denser grid was used
        assert np.abs(dense - share).max() < HALVED

    @pytest.mark.parametrize("name", SIX_LAWS)
    def test_mirror_images_are_covered_equally(self, name, rng):
        impacts = falling_ellipses(rng, N)
        spaces = [contact_space(impacts.v_pre * [s, 1, s], impacts.r * [s, 1], mass=MASS, k_g=K_G) for s in (1, -1)]
        a, b = (covered_share(LAWS[name], one) for one in spaces)
        np.testing.assert_allclose(a, b, atol=MIRRORED)

    def test_size_and_speed_do_not_matter(self, rng):
        impacts = falling_ellipses(rng, N)
        a = contact_space(impacts.v_pre, impacts.r, mass=MASS, k_g=K_G)
        b = contact_space(3.0 * impacts.v_pre, impacts.r, mass=5 * MASS, k_g=K_G)
        for name in SIX_LAWS:
            np.testing.assert_allclose(covered_share(LAWS[name], a), covered_share(LAWS[name], b), atol=1e-9)

    def test_a_law_whose_region_is_known(self, space):
        """Half of the admissible set: every second phase of the half disc, scaled to all radii."""

        def impulse(space, mu, epsilon):
            c_t, c_n = admissible_outline(space)
            centre = space.impulse_to(0.0, 0.0)
            # μ = tan of an angle from 0 to π/2 walks over half of the outline, ε from the centre to it
            row = np.rint(np.arctan(mu) / (np.pi / 2) * 0.5 * (len(c_t) - 1)).astype(int)
            columns = np.arange(len(space.v_t))
            edge_t, edge_n = c_t[row, columns], c_n[row, columns]
            return centre[0] + epsilon * (edge_t - centre[0]), centre[1] + epsilon * (edge_n - centre[1])

        half = Law("half", "half", impulse, frozenset(), "made up")
        # whitened, a phase is an angle of a disc: half of the phases are half of the area, less the last cell of μ
        last = 1.0 - 1.0 / predictive_range.POINTS
        np.testing.assert_allclose(covered_share(half, space), 0.5 * last, atol=0.01)

    def test_impulses_outside_the_admissible_set_do_not_count(self, space):
        pulling = replace(
            LAWS["whittaker"], impulse=lambda s, mu, epsilon: (-mu * s.v_n, (1.0 + epsilon) * s.v_n / s.K_nn)
        )
        np.testing.assert_array_equal(covered_share(pulling, space), 0.0)
