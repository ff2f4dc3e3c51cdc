"""m/I of single drops: arc maximum likelihood against the Cramér-Rao bound, scipy and scikit-learn.

    python -m benchmarks.arcs [--drops 160] [--snr 30] [--quick] [-o FILE.csv]

Drops of block and ellipse as in Table 2.1, with noise on every position and velocity.

- ours: `DropEstimates`; finds the impacts and vertices by itself, and the noise; impulses free, without the gap, so
  that the bound holds for it; it also tries other hypotheses and takes the second-order bias out;
- scipy: `optimize.least_squares` on the same likelihood, the whole trajectory from start, impulses and m/I; it is told
  steps, vertices and noise, and starts from means over samples and the answer of the third;
- scikit-learn: `LinearRegression` of Δω on the lever r_x Δv_y − r_y Δv_x, velocities from the mean of `SIDE` samples on
  either side; it is told steps and vertices.

Error over bound: root mean square over the drops that ours believes, each divided by its own Cramér-Rao bound; 1 for an
efficient estimator.  Same answer: median distance of scipy's answer from ours, over the bound.  CPU seconds a drop.
"""

import time

import numpy as np

from benchmarks.results import Results, benchmark_parser
from thesis_lib.simulate.mechanisms.motions import DEFAULT
from thesis_lib.simulate.mechanisms.noise_snr import NoisyStates, add_noise
from thesis_lib.simulate.stepping.multibody import PlanarFreeBody
from thesis_lib.statistics.spread import MAD_TO_STD
from thesis_lib.thesis.identify.mass_ratio.cramer_rao import TrueImpacts, ratio_bound
from thesis_lib.thesis.identify.mass_ratio.estimate import DropEstimates, EstimateStatus
from thesis_lib.thesis.identify.mass_ratio.table_2_1 import make_drops

SHAPES = ("block", "ellipse")
SIDE = 5  # samples whose velocities, without gravity, are averaged on either side of an impact
EVALUATIONS = 200  # those that end well take fewer than 50
METHODS = ("ours", "scipy", "scikit-learn")


def changes(body: PlanarFreeBody, h: float, noisy: NoisyStates, steps: np.ndarray) -> np.ndarray:
    """Velocity changes (J, 3) at the impacts: means of up to `SIDE` samples after, less those before."""
    v = noisy.v - h * np.arange(len(noisy.v))[:, None] * body.gravity(noisy.q[0]) / body.mass
    ends = [-1, *steps, len(v) - 1]
    return np.array(
        [
            v[k + 1 : min(ends[j + 2], k + SIDE) + 1].mean(axis=0)
            - v[max(ends[j] + 1, k + 1 - SIDE) : k + 1].mean(axis=0)
            for j, k in enumerate(steps)
        ]
    )


def regression(body: PlanarFreeBody, h: float, noisy: NoisyStates, impacts: TrueImpacts) -> float:
    """m/I in 1/m² by scikit-learn."""
    from sklearn.linear_model import LinearRegression

    change = changes(body, h, noisy, impacts.steps)
    J_n, J_t = _rows(body, noisy.q[impacts.steps], impacts)
    lever = J_n[:, 2] * change[:, 1] + J_t[:, 2] * change[:, 0]
    line = LinearRegression(fit_intercept=False).fit(lever[:, None], change[:, 2])
    return float(line.coef_[0])


def least_squares(body: PlanarFreeBody, h: float, noisy: NoisyStates, impacts: TrueImpacts, start: float) -> float:
    """m/I in 1/m² by scipy: all samples against one trajectory with free impulses; NaN if it does not converge."""
    from scipy.optimize import least_squares as solve

    m, steps = len(noisy.q) - 1, impacts.steps
    free = h * body.gravity(noisy.q[0]) / body.mass
    count = np.arange(m + 1)[:, None]
    scale = start if np.isfinite(start) and start > 0 else 1.0

    def residuals(p: np.ndarray) -> np.ndarray:
        q0, v0, ratio, c = p[:3], p[3:6], scale * p[6], p[7:].reshape(-1, 2)
        v = v0 + count * free
        q = q0 + h * (count * v0 + 0.5 * count * (count + 1) * free)
        for j, k in enumerate(steps):
            J_n, J_t = _rows(body, q[k][None], impacts, j)
            dv = np.array([1.0, 1.0, ratio]) * (J_t[0] * c[j, 0] + J_n[0] * c[j, 1])  # impulse over mass
            later = np.maximum(count - k, 0)
            v = v + (later > 0) * dv
            q = q + h * later * dv
        return np.concatenate([(noisy.q - q) / noisy.sigma[0], (noisy.v - v) / noisy.sigma[1]]).ravel()

    # free flight: pose and velocity at the start from several samples
    first = slice(0, min(steps[0] + 1, SIDE))
    v0 = (noisy.v - count * free)[first].mean(axis=0)
    q0 = (noisy.q - h * (count * v0 + 0.5 * count * (count + 1) * free))[first].mean(axis=0)
    impulses = changes(body, h, noisy, steps)[:, :2]
    guess = np.concatenate([q0, v0, [1.0], impulses.ravel()])
    found = solve(residuals, guess, x_scale="jac", max_nfev=EVALUATIONS)
    return float(scale * found.x[6]) if found.success else np.nan


def _rows(body: PlanarFreeBody, q: np.ndarray, impacts: TrueImpacts, j: int | None = None):
    vertices = impacts.vertices if j is None else impacts.vertices[j : j + 1]
    contacts, rows = body.contacts_of(q), np.arange(len(q))
    return contacts.J_n[rows, vertices], contacts.J_t[rows, vertices]


def measure(shape: str, n: int, snr: float, results: Results) -> None:
    """Print and add error over bound and CPU time of every method on n drops of one shape."""
    drops = make_drops(shape, n, np.random.default_rng(0))
    body, rng = drops.body, np.random.default_rng(1)
    truth, g = body.mass / body.inertia, DEFAULT.gravity
    value, cpu = np.full((len(METHODS), n), np.nan), np.zeros((len(METHODS), n))
    bound, believed = np.empty(n), np.zeros(n, bool)
    for i, (record, impacts) in enumerate(zip(drops.records, drops.impacts)):
        noisy, h = add_noise(record, snr, rng), record.h
        bound[i] = ratio_bound(record, noisy.sigma, impacts, body.shape, g, law=False)
        clock = [time.process_time()]
        estimate = DropEstimates(h, noisy.q, noisy.v, body.shape, g).estimate(use_gap=False)
        clock.append(time.process_time())
        slope = regression(body, h, noisy, impacts)
        clock.append(time.process_time())
        value[:, i] = estimate.value, least_squares(body, h, noisy, impacts, slope), slope
        clock.append(time.process_time())
        ours, theirs, line = clock[1] - clock[0], clock[3] - clock[2], clock[2] - clock[1]
        # scipy's start costs it nothing
        cpu[:, i] = ours, theirs, line
        believed[i] = estimate.status == EstimateStatus.OK
    errors = np.abs(value - truth) / bound
    for name, own, seconds in zip(METHODS, errors, cpu):
        good = believed & np.isfinite(own)
        rms = float(np.sqrt(np.mean(own[good] ** 2))) if good.any() else np.nan
        middle = MAD_TO_STD * float(np.median(own[good])) if good.any() else np.nan
        note = f"{good.sum()} of {n} drops at {snr:g} dB"
        if name == "ours":
            spread = f"1 ± {1.0 / np.sqrt(2.0 * max(good.sum(), 1)):.2f} for an efficient estimator"
            note = f"{note}; {spread}"
        results.add(f"{shape}, {name}: error over Cramér-Rao bound", rms, "1", note)
        results.add(f"{shape}, {name}: median error over the bound's", middle, "1")
        results.add(f"{shape}, {name}: CPU time a drop", 1e3 * float(np.median(seconds)), "ms")
        if name != "ours":
            times = float(np.median(seconds / cpu[0]))
            results.add(f"{shape}, {name}: CPU time over ours", times, "1")
        print(f"{shape:9s}{name:14s}{rms:10.2f}{middle:12.2f}{1e3 * np.median(seconds):12.1f}   {note}")
    same = float(np.nanmedian(np.abs(value[0] - value[1])[believed] / bound[believed]))
    results.add(f"{shape}, scipy: distance from ours", same, "bounds")
    print(f"{shape:9s}scipy's answer lies {same:.3f} bounds from ours in the median")


def main(arguments: list[str] | None = None) -> None:
    """Command line."""
    parser = benchmark_parser("arcs", "m/I of single drops against the Cramér-Rao bound, scipy and scikit-learn.")
    parser.add_argument("--drops", type=int, default=160, help="of each shape (160)")
    parser.add_argument("--snr", type=float, default=30.0, help="dB (30)")
    options = parser.parse_args(arguments)
    results = Results("arcs")
    print(f"{'':23s}{'rms/bound':>10s}{'median':>12s}{'ms a drop':>12s}")
    for shape in SHAPES:
        measure(shape, 3 if options.quick else options.drops, options.snr, results)
    results.write(options.out)


if __name__ == "__main__":
    main()
