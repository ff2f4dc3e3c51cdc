"""Arc fits: exact without noise, covariances that mean what they say, symmetries."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from bouncing import Flights, ellipse_header, fly
from scipy.signal import lfilter

from thesis_lib.datasets.flights.arcs import fit_arcs
from thesis_lib.datasets.flights.noise import NoiseEstimate, estimate_spread
from thesis_lib.datasets.flights.parabolas import Hits, parabolas
from thesis_lib.datasets.format.samples import ArcSettings, make_samples
from thesis_lib.datasets.impacts.detect import FoundImpacts, find_in_arrays

EXACT_V = 1e-8  # m/s, k rad/s: rounding of positions (1e-16 m) over 0.1 s, times the condition of the fit
EXACT_T = 1e-9  # s
# 600 impacts x 9 values: the mean chi² per dof has a standard error of √(2/5400) = 0.02
CHI2_PER_DOF = (0.9, 1.1)
COVERAGE = (0.925, 0.975)  # of 95 % intervals: standard error over 600 impacts 0.009
# correlated noise and contact spread are estimated, and AR(1) is only a model of the correlation
LOOSE_CHI2 = (0.7, 1.4)


@pytest.fixture(scope="module")
def flights() -> Flights:
    return fly(ellipse_header(), np.random.default_rng(11), 300)


@pytest.fixture(scope="module")
def found(flights: Flights) -> FoundImpacts:
    return find(flights)


def find(f: Flights, settings: ArcSettings | None = None) -> FoundImpacts:
    return find_in_arrays(f.trial, f.t, f.q, f.header, settings)


def errors(f: Flights, found: FoundImpacts) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """State errors (n, 9), errors of t (n,) and index of the true impact (n,), of the impacts used."""
    impacts = found.impacts
    near, _ = f.nearest(impacts.trial, impacts.t)
    error = np.c_[impacts.q - f.hit_q[near], impacts.v_pre - f.hit_pre[near], impacts.v_post - f.hit_post[near]]
    return error, impacts.t - f.hit_t[near], near


def chi2_per_dof(error: np.ndarray, cov: np.ndarray) -> float:
    values = np.einsum("ni,ni->n", error, np.linalg.solve(cov, error[..., None])[..., 0])
    return float(values.mean() / error.shape[1])


def test_exact_without_noise():
    f = fly(ellipse_header(), np.random.default_rng(3), 40, position=0.0, angle=0.0)
    found = find(f)
    error, t_error, _ = errors(f, found)
    assert len(error) > 60
    scale = np.array([1, 1, 0.0192])
    assert np.abs(error[:, 3:6] * scale).max() < EXACT_V
    assert np.abs(error[:, 6:9] * scale).max() < EXACT_V
    assert np.abs(t_error).max() < EXACT_T


def test_covariance_is_calibrated(flights: Flights, found: FoundImpacts):
    error, t_error, _ = errors(flights, found)
    cov = found.impacts.cov
    assert len(error) >= 500
    assert CHI2_PER_DOF[0] < chi2_per_dof(error, cov) < CHI2_PER_DOF[1]
    std = np.sqrt(np.einsum("nii->ni", cov))
    inside = (np.abs(error) < 1.96 * std).mean(0)
    assert (inside > COVERAGE[0]).all() and (inside < COVERAGE[1]).all()
    t_std = found.arcs["t_std"][found.arcs["used"]].to_numpy()
    assert CHI2_PER_DOF[0] ** 2 < np.mean((t_error / t_std) ** 2) < CHI2_PER_DOF[1] ** 2 * 1.1
    # no bias: mean normalised errors within 4 standard errors
    assert np.abs((error / std).mean(0)).max() < 4.0 / np.sqrt(len(error))


def test_calibration_check_sees_noise_understated_by_a_third(flights: Flights):
    header = ellipse_header(noise={"position": 2e-4, "angle": 2e-3})
    found = find_in_arrays(flights.trial, flights.t, flights.q, header)
    assert chi2_per_dof(errors(flights, found)[0], found.impacts.cov) > CHI2_PER_DOF[1]


def test_velocity_errors_are_those_of_a_line_through_25_samples(found: FoundImpacts):
    full = (found.arcs["n_pre"][found.arcs["used"]] == 25).to_numpy()
    std = np.sqrt(found.impacts.cov[full, 3, 3])
    alone = 3e-4 * 250.0 / np.sqrt(25 * (25**2 - 1) / 12)  # σ rate / √(n(n²−1)/12)
    # the other arc adds what it knows of the position at t_c: at best as if that were exact, half the error
    assert (std < 1.05 * alone).all() and (std > 0.5 * alone).all()


def test_mirror_symmetry(flights: Flights, found: FoundImpacts):
    flip = np.array([-1.0, 1.0, -1.0])
    other = find_in_arrays(flights.trial, flights.t, flights.q * flip, flights.header)
    np.testing.assert_array_equal(other.impacts.trial, found.impacts.trial)
    np.testing.assert_allclose(other.impacts.v_pre * flip, found.impacts.v_pre, atol=EXACT_V)
    np.testing.assert_allclose(other.impacts.v_post * flip, found.impacts.v_post, atol=EXACT_V)
    sign = np.tile(flip, 3)
    np.testing.assert_allclose(other.impacts.cov * np.outer(sign, sign), found.impacts.cov, atol=1e-9)


def test_wrong_surface_height_hardly_moves_the_velocities(flights: Flights, found: FoundImpacts):
    wrong = ellipse_header(surface={"height": 0.013})
    other = find_in_arrays(flights.trial, flights.t, flights.q, wrong).impacts
    same = np.isin(found.impacts.trial * 100 + found.impacts.impact, other.trial * 100 + other.impact)
    there = np.isin(other.trial * 100 + other.impact, found.impacts.trial * 100 + found.impacts.impact)
    shift = other.v_post[there] - found.impacts.v_post[same]
    std = np.sqrt(np.einsum("nii->ni", found.impacts.cov)[same, 6:])
    # one sigma of the touch (1 mm) is ten times the position error at t_c: a hundredth of a sigma or so
    assert np.median(np.abs(shift / std)) < 0.05


def test_contact_spread_is_estimated_and_widens_the_covariance():
    f = fly(ellipse_header(), np.random.default_rng(5), 200, position=3e-5, angle=1e-3)
    rng, k_g, spread = np.random.default_rng(6), 0.0192, 2e-4
    dv = f.hit_post - f.hit_pre
    size = np.sqrt((dv * [1, 1, k_g]) ** 2 @ np.ones(3))
    offset = rng.normal(size=dv.shape) * (spread * size)[:, None] / [1, 1, k_g]
    for trial, t, step in zip(f.hit_trial, f.hit_t, offset):
        f.q[(f.trial == trial) & (f.t > t)] += step
    found = find(f)
    assert found.noise.contact_spread == pytest.approx(spread, rel=0.25)
    error = errors(f, found)[0][:, 3:]
    cov = found.impacts.cov[:, 3:, 3:]
    assert LOOSE_CHI2[0] < chi2_per_dof(error, cov) < LOOSE_CHI2[1]
    stiff = find(f, ArcSettings(contact_spread=0.0))
    assert chi2_per_dof(errors(f, stiff)[0][:, 3:], stiff.impacts.cov[:, 3:, 3:]) > 2 * LOOSE_CHI2[1]


@pytest.mark.parametrize("noise", [0.5, 1.0, 2.0])
def test_contact_spread_is_what_arcs_miss_each_other_by_beyond_noise(noise: float):
    """Misses of two independent parts: however large that of the noise, the other one comes out."""
    rng, n, spread = np.random.default_rng(12), 20_000, 5e-5
    dv, assumed = rng.uniform(1.8, 2.2, n), 0.7  # arcs were fitted with less noise than there is
    of_noise = noise * spread * 2.0  # m, one sigma of each of the two free dimensions
    parts = spread * dv[:, None] * rng.standard_normal((n, 2)), of_noise * rng.standard_normal((n, 2))
    miss = np.linalg.norm(sum(parts), axis=1)
    arcs = SimpleNamespace(
        v_pre=np.zeros((n, 3)),
        v_post=np.stack([0.0 * dv, dv, 0.0 * dv], axis=1),
        n_side=np.full((n, 2), 25),
        converged=np.ones(n, bool),
        miss=miss,
        miss_noise=np.full(n, np.sqrt(2.0) * assumed * of_noise),  # of both dimensions together
        chi2_meet=(miss / (assumed * of_noise)) ** 2,
    )
    sigma = np.array([1e-4, 1e-4, 1e-3])
    known = NoiseEstimate(1e-4, 1e-3, sigma, sigma, "arcs")
    found = estimate_spread(arcs, 0.0192, assumed * sigma, known, ArcSettings())
    assert found == pytest.approx(spread, rel=0.02 * (1.0 + noise**2))  # a median of 20,000 is known to 1 %


def test_correlated_noise_widens_the_covariance():
    f = fly(ellipse_header(), np.random.default_rng(7), 200, position=0.0, angle=0.0)
    rho, rng = 0.6, np.random.default_rng(8)
    white = rng.normal(size=f.q.shape) * [3e-4, 3e-4, 3e-3] * np.sqrt(1 - rho**2)
    f.q[:] = f.exact + lfilter([1.0], [1.0, -rho], white, axis=0)
    found = find(f)
    assert (found.noise.colour > 2.0).all() and any("correlated" in text for text in found.warnings)
    assert LOOSE_CHI2[0] < chi2_per_dof(errors(f, found)[0][:, 3:], found.impacts.cov[:, 3:, 3:]) < LOOSE_CHI2[1]


@pytest.mark.slow
def test_stray_acceleration_is_estimated_and_widens_the_covariance():
    """Each flight has its own acceleration along x, 1 m/s²; x does not enter the geometry of the hits."""
    f = fly(ellipse_header(), np.random.default_rng(9), 250)
    rng, size = np.random.default_rng(10), 1.0
    for trial in np.unique(f.trial):
        rows, hits = f.trial == trial, f.hit_trial == trial
        gained, start = 0.0, 0.0
        for k, end in enumerate([*f.hit_t[hits], np.inf]):
            a = size * rng.normal()
            dt = np.clip(f.t[rows] - start, 0, end - start)
            f.q[rows, 0] += 0.5 * a * dt**2 + a * dt * np.maximum(f.t[rows] - start - dt, 0)
            if np.isfinite(end):
                gained += a * (end - start)
                index = np.flatnonzero(hits)[k]
                f.hit_pre[index, 0] += gained
                f.hit_post[index, 0] += gained
                start = end
    found = find(f)
    assert found.noise.stray[0] == pytest.approx(size, rel=0.2)
    assert found.noise.stray[2] == 0.0
    assert any("accelerations besides gravity" in text for text in found.warnings)
    error = errors(f, found)[0][:, [3, 6]]
    z2 = error**2 / np.einsum("nii->ni", found.impacts.cov)[:, [3, 6]]
    assert LOOSE_CHI2[0] < z2.mean() < LOOSE_CHI2[1]
    stiff = find(f, ArcSettings(stray_acceleration=False))
    error = errors(f, stiff)[0][:, [3, 6]]
    assert (error**2 / np.einsum("nii->ni", stiff.impacts.cov)[:, [3, 6]]).mean() > 3 * LOOSE_CHI2[1]


def test_fit_recovers_from_a_detection_two_samples_off(flights: Flights, found: FoundImpacts):
    samples = make_samples(flights.trial, flights.t, flights.q, flights.header, ArcSettings())
    sigma = np.array([3e-4, 3e-4, 3e-3])
    first = found.arcs[found.arcs["used"] & (found.arcs["impact"] == 0) & (found.arcs["n_post"] >= 20)]
    key = first["trial"].to_numpy() * 1e3 + first["t"].to_numpy()
    at = np.searchsorted(samples.trial * 1e3 + samples.t, key) - 1
    right, shifted = (fit_arcs(samples, at + d, sigma, flights.header, ArcSettings()) for d in (0, 2))
    np.testing.assert_array_equal(shifted.at, right.at)
    # not equal: a sample next to t_c may be used by the one and not by the other
    assert np.abs(shifted.t - right.t).max() < 0.6 * right.t_std.max()


def test_settings_out_of_range_are_refused():
    with pytest.raises(ValueError, match="min_window"):
        ArcSettings(min_window=30)
    with pytest.raises(ValueError, match="scales"):
        ArcSettings(scales=(1, 3))


def test_parabolas_of_flights_have_the_accelerations_that_bodies_have_within_their_errors():
    rng, n, samples = np.random.default_rng(13), 400, 30
    header, sigma = ellipse_header(), np.array([3e-4, 3e-4, 3e-3])
    t = np.tile(np.arange(samples) / 250.0, (n, 1))
    a = rng.normal([0.5, -9.81, 20.0], [0.3, 0.1, 5.0], (n, 3))[:, None]
    v = rng.normal(0.0, [1.0, 1.0, 10.0], (n, 3))[:, None]
    q = [0.0, 0.5, 0.0] + v * t[..., None] + 0.5 * a * t[..., None] ** 2 + sigma * rng.normal(size=(n, samples, 3))
    trial = np.repeat(np.arange(n), samples)
    made = make_samples(trial, t.ravel(), q.reshape(-1, 3), header, ArcSettings())
    hits = Hits(np.arange(n), np.full(n, samples / 250.0), np.ones(n, bool))
    found = parabolas(made, hits, sigma**2)
    assert len(found.t) == n and not len(found.bent)
    z = (found.fitted[:, 2] - a[:, 0]) / np.sqrt(found.variance)
    assert np.mean(z**2) == pytest.approx(1.0, abs=4.0 * np.sqrt(2.0 / z.size))
    assert np.abs(z.mean(axis=0)).max() < 4.0 / np.sqrt(n)
    assert not len(parabolas(made, Hits(hits.trial, hits.t, ~hits.used), sigma**2).t)  # no flight ends at a poor hit
    bent = made.q + 2e-3 * np.sin(100.0 * made.t)[:, None] * [1.0, 0.0, 0.0] * (made.trial < 50)[:, None]
    assert set(parabolas(replace(made, q=bent), hits, sigma**2).bent) == set(range(50))
