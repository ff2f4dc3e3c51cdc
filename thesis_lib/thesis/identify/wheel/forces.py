"""Contact forces of a rimless wheel that rolls without slip, from its noisy states (thesis 2.4, figure 2-11).

Mass, geometry, slope and contact law are known, as in the thesis; the inertia about the hub may be unknown.

`plain_forces` is the thesis's method, which takes the samples as true.  Gaps and sliding velocities within `TOLERANCE`
standard deviations of zero count as zero, and eq. 2.12 is then a quadratic program in (I, c) (`mode_qp`).

`fit_wheel` models the samples as a rolling wheel plus noise.  Three numbers describe a wheel on a spoke without
slip at the start; the time stepper predicts all samples, the sequence of spokes and the forces:

    η = (x_0, θ_0, ω_0, log I / (m l²)),    min_η Σ_k |(q_k - q_k(η)) / σ_q|² + |(v_k - v_k(η)) / σ_v|²

The cost is continuous in η: an impact without rebound takes two steps that share its impulse (see `stepping`).  No
initial guess is needed: the start is a parabola through the first samples, with every inertia of `INERTIAS`, first on a
short stretch.  If that fit is rejected, the best points of a grid of angles, speeds and inertias are tried.  A window
must not begin within a touchdown.

σ is estimated, first from third differences d = Δ³ of each channel, σ = median |d| / (0.6745 √20), which are
insensitive to the smooth motion and the few impacts; then from the residuals r of the fit.  Two tests accept or reject
the fit: χ²/n of the residuals with σ from the differences, and their whiteness (Ljung and Box),

    Q = Σ_channels n (n + 2) Σ_{j=1..L} ρ_j² / (n - j)   ~  χ²(6 L),   ρ_j the autocorrelation of r at lag j.

Standard errors of the forces are those of η, propagated through the time stepper at sigma points: with P = S S',

    var F = Σ_i [(F(η + S_i) - F(η))² + (F(η - S_i) - F(η))²] / 2.

Sources: thesis section 2.4; G. M. Ljung, G. E. P. Box, Biometrika 65 (1978) 297, doi 10.1093/biomet/65.2.297;
S. J. Julier, J. K. Uhlmann, Proceedings of the IEEE 92 (2004) 401, doi 10.1109/JPROC.2003.823141 (sigma points).
"""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from scipy.stats import chi2

from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.stepping.rimless_wheel import RimlessWheel
from thesis_lib.simulate.stepping.stepping import SimulatedMotion, simulate
from thesis_lib.statistics.spread import robust_std
from thesis_lib.thesis.identify.base_parameters.window import States, free_body_window
from thesis_lib.thesis.identify.programs.mode_qp import solve_mode_qp
from thesis_lib.thesis.identify.programs.result import ProgramResult
from thesis_lib.thesis.identify.segmentation import check_states, floored

TOLERANCE = 3.0  # standard deviations within which a gap or a sliding velocity counts as zero
# starting values of I / (m l²), over the whole range for a wheel with all mass within the tips
INERTIAS = (0.1, 0.3, 0.9)
FIRST_SAMPLES = 10  # samples for the parabola at the start: a tenth of the time on one spoke
INERTIA_RANGE = (1e-3, 1e3)  # I / (m l²) beyond which the motion no longer changes
KEPT = 2  # number of grid points from which fits are started
STRETCH = 100  # steps of the first stage, with one change of spoke, which keeps fits with bad starts near the data
MIN_SAMPLES = 20  # fewer give too few differences to estimate the noise
LAGS = 5  # number of autocorrelations tested; model errors persist in the residuals for tens of samples
P_WHITE = 1e-4  # probability of a larger Q below which a fit is rejected
CHI2_SIGMAS = 5.0  # standard deviations by which χ²/n may exceed 1
_ROOT_20 = np.sqrt(20.0)  # norm of (1, -3, 3, -1)


class WheelStatus(StrEnum):
    """Outcome of the fit to a record; use only OK."""

    OK = "ok"
    MISFIT = "misfit"  # the residuals are larger than the noise, or not white: the wheel did not roll as fitted
    NOT_CONVERGED = "not converged"


@dataclass(frozen=True)
class WheelFit:
    """Maximum-likelihood motion of a wheel and its forces, for m steps and p spokes."""

    record: SimulatedMotion  # the fitted motion; its c_n, c_t (m, p) in N are the estimated forces
    inertia: float  # inertia, inertia_std: kg m², about the hub
    inertia_std: float
    sigma: np.ndarray  # (2, 3) noise σ of q and v in m, rad and per s, from the residuals
    deviations: np.ndarray  # (8, 2, m, p) c_n and c_t at the sigma points minus the estimate, N
    chi2_n: float  # χ²/n of the residuals with noise from differences
    p_white: float  # probability of less white residuals if the wheel rolled as fitted
    status: WheelStatus

    @property
    def std_n(self) -> np.ndarray:
        """Standard errors (m, p) of the normal forces in N."""
        return _std(self.deviations[:, 0])

    def impulse_std(self, steps: slice, pair: int) -> tuple[float, float]:
        """Standard errors in N s of the normal and tangential impulse of a pair over `steps`."""
        n, t = _std(self.record.h * self.deviations[:, :, steps, pair].sum(axis=2))
        return float(n), float(t)


def _std(deviations: np.ndarray) -> np.ndarray:
    return np.sqrt(0.5 * np.sum(deviations**2, axis=0))


def noise_of_third_differences(q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Noise σ (2, 3) of q and v, (m+1, 3) each, for a smooth motion with a few impacts."""
    third = [robust_std(np.diff(a, n=3, axis=0)) / _ROOT_20 for a in (q, v)]
    return floored(np.stack(third), q, v)


def plain_forces(
    wheel: RimlessWheel, h: float, q: np.ndarray, v: np.ndarray, mu: float, sigma: np.ndarray | None = None
) -> ProgramResult:
    """Forces and inertia by the thesis's program (eq. 2.12), with the samples taken as true.

    The inertia of `wheel` is not used; `h` in s; `q`, `v` (m+1, 3) are states, whose noise `sigma` (2, 3) sets the
    tolerances (None: exact data).

    Raises:
        UserError: the states have a wrong shape or are not finite.
    """
    _check(h, q, v)
    states = States.of(wheel, h, q, v, np.zeros((len(q) - 1, 3)))
    if sigma is None:
        return solve_mode_qp(free_body_window(states, mu, wheel).fix({"m": wheel.mass}))
    # gap y + r_y and velocity v_x - r_y ω of a tip within half the angle between spokes from the foot point
    reach = wheel.length * np.sin(np.pi / wheel.spokes)
    gap = TOLERANCE * float(np.hypot(sigma[0, 1], reach * sigma[0, 2]))
    slip = TOLERANCE * float(np.hypot(sigma[1, 0], wheel.length * sigma[1, 2]))
    window = free_body_window(states, mu, wheel, gap_tolerance=gap, v_tolerance=slip).fix({"m": wheel.mass})
    # effect of noise on the dynamics: differences of v over h, with m l² as the largest possible inertia
    force = np.sqrt(2.0) * wheel.mass / h * sigma[1] * [1.0, 1.0, wheel.length**2]
    noise = TOLERANCE * float(np.linalg.norm(force)) / window.force_scale
    return solve_mode_qp(window, dynamics_tolerance=noise)


def fit_wheel(wheel: RimlessWheel, h: float, q: np.ndarray, v: np.ndarray, mu: float, epsilon: float = 0.0) -> WheelFit:
    """Fit motion, inertia and contact forces of a wheel that stands on a spoke without slip at the first sample.

    The inertia of `wheel` is not used; `h` in s; `q`, `v` (m+1, 3) are noisy states.  `mu` does not matter as long as
    nothing slips.

    Raises:
        UserError: the states have a wrong shape, are not finite or too few, or no spoke comes near the slope.
    """
    q, v = np.asarray(q, dtype=float), np.asarray(v, dtype=float)
    _check(h, q, v)
    rough = noise_of_third_differences(q, v)
    _require_contact(wheel, q, rough)
    fit = _Fit(wheel, h, q, v, mu, epsilon)
    n, stage, start = len(q), min(len(q) - 1, STRETCH), fit.start()
    blind = [np.append(start, np.log(inertia)) for inertia in INERTIAS]
    best, chi2_n, p_white = _stages(fit, blind, rough, stage)
    if not _believed(chi2_n, p_white, n):
        again = _stages(fit, fit.around(start, rough, stage), rough, stage)
        if again[1] < chi2_n:
            best, chi2_n, p_white = again
    sigma = rough * noise_of_residuals(best.fun.reshape(2, n, 3), len(best.x))
    if best.success:
        best = fit.minimise(best.x, sigma, n - 1)
    covariance = np.linalg.inv(best.jac.T @ best.jac)
    if not best.success:
        status = WheelStatus.NOT_CONVERGED
    else:
        status = WheelStatus.OK if _believed(chi2_n, p_white, n) else WheelStatus.MISFIT
    record = fit.motion(best.x, n - 1)
    inertia = wheel.mass * wheel.length**2 * float(np.exp(best.x[3]))
    return WheelFit(
        record=record,
        inertia=inertia,
        inertia_std=inertia * float(np.sqrt(covariance[3, 3])),
        sigma=sigma,
        deviations=fit.deviations(best.x, covariance, record),
        chi2_n=chi2_n,
        p_white=p_white,
        status=status,
    )


def _stages(fit: "_Fit", starts: list[np.ndarray], sigma: np.ndarray, stage: int) -> tuple[object, float, float]:
    """Fit from the starts over the first steps, then over all: scipy's result, its χ²/n and its whiteness."""
    first = min((fit.minimise(eta, sigma, stage) for eta in starts), key=lambda found: found.cost)
    best = fit.minimise(first.x, sigma, len(fit.q) - 1)
    return best, float(np.mean(best.fun**2)), white(best.fun.reshape(2, -1, 3))


def _believed(chi2_n: float, p_white: float, n: int) -> bool:
    # relative standard error of σ from the median of n differences: 1.7 / √n with their correlation; of σ²: twice that
    return chi2_n <= 1.0 + CHI2_SIGMAS * 2.0 * 1.7 / np.sqrt(6.0 * n) and p_white >= P_WHITE


def noise_of_residuals(residuals: np.ndarray, parameters: int) -> np.ndarray:
    """Noise σ (2, 3) from residuals (2, n, 3), whose channels share the number `parameters` of fitted parameters."""
    return np.sqrt(np.sum(residuals**2, axis=1) / (residuals.shape[1] - parameters / 6.0))


def white(residuals: np.ndarray) -> float:
    """Probability of a larger Q (Ljung and Box) if the residuals (2, n, 3) are white, pooled over channels."""
    channels = np.moveaxis(residuals, 1, 0).reshape(residuals.shape[1], -1)
    n, count = channels.shape
    power = np.sum(channels**2, axis=0)
    q = 0.0
    for j in range(1, LAGS + 1):
        rho = np.sum(channels[j:] * channels[:-j], axis=0) / power
        q += n * (n + 2.0) * float(np.sum(rho**2)) / (n - j)
    return float(chi2.sf(q, LAGS * count))


class _Fit:
    """Least-squares problem of one record; η as in the module's docstring."""

    def __init__(self, wheel: RimlessWheel, h: float, q: np.ndarray, v: np.ndarray, mu: float, epsilon: float) -> None:
        self.wheel, self.h, self.q, self.v, self.mu, self.epsilon = wheel, h, q, v, mu, epsilon
        self.half = np.pi / wheel.spokes

    def start(self) -> np.ndarray:
        """Estimate x_0, θ_0, ω_0 from the first samples."""
        t = self.h * np.arange(FIRST_SAMPLES)
        at = np.polynomial.polynomial.polyfit(t, self.q[:FIRST_SAMPLES], 2)[0]
        return np.array([at[0], at[2], self.v[:FIRST_SAMPLES, 2].mean()])

    def around(self, start: np.ndarray, sigma: np.ndarray, steps: int) -> list[np.ndarray]:
        """Find the `KEPT` best η, by χ² over the first steps, on a grid of angles, speeds and inertias near a start."""
        angles = start[1] + self.half * np.linspace(-1.0, 1.0, 7)
        speeds = start[2] * np.linspace(0.7, 1.3, 3)
        grid = [
            np.array([start[0], theta, omega, np.log(inertia)])
            for theta in angles
            for omega in speeds
            for inertia in INERTIAS
        ]
        costs = [np.sum(self.residuals(eta, sigma, steps) ** 2) for eta in grid]
        return [grid[i] for i in np.argsort(costs)[:KEPT]]

    def motion(self, eta: np.ndarray, steps: int) -> SimulatedMotion:
        """Simulate the motion from η, starting on the spoke nearest to the downward direction."""
        w = self.wheel
        inertia = w.mass * w.length**2 * float(np.exp(eta[3]))
        made = RimlessWheel(w.spokes, w.length, w.mass, inertia, w.slope, w.g)
        down = -0.5 * np.pi - eta[1]
        lean = float(down - 2.0 * self.half * np.round(down / (2.0 * self.half)))
        q, v = made.standing(lean, float(eta[2]))
        # `standing` has its foot at the origin and counts spokes from there
        return simulate(made, [eta[0], q[1], eta[1]], v, None, self.h, steps, self.mu, self.epsilon)

    def residuals(self, eta: np.ndarray, sigma: np.ndarray, steps: int) -> np.ndarray:
        """Predicted minus measured samples over σ, (6 (steps+1),), q before v."""
        record = self.motion(eta, steps)
        pairs = ((record.q, self.q, sigma[0]), (record.v, self.v, sigma[1]))
        return np.concatenate([((a - b[: steps + 1]) / s).ravel() for a, b, s in pairs])

    def minimise(self, eta: np.ndarray, sigma: np.ndarray, steps: int) -> object:
        """Minimise from start η over the first steps; return scipy's result."""
        from scipy.optimize import least_squares

        low, high = np.full(4, -np.inf), np.full(4, np.inf)
        fastest = 2.0 * float(np.abs(self.v[:, 2]).max())
        low[2:], high[2:] = (-fastest, np.log(INERTIA_RANGE[0])), (fastest, np.log(INERTIA_RANGE[1]))
        scale = np.array([self.wheel.length, self.half, 1.0, 1.0])
        return least_squares(
            self.residuals, eta, args=(sigma, steps), bounds=(low, high), x_scale=scale, xtol=1e-10, ftol=1e-10
        )

    def deviations(self, eta: np.ndarray, covariance: np.ndarray, record: SimulatedMotion) -> np.ndarray:
        """Forces c_n, c_t at the sigma points minus the forces of the record at η, (8, 2, m, p)."""
        root = np.linalg.cholesky(covariance).T
        points = [self.motion(point, record.steps) for point in np.concatenate([eta + root, eta - root])]
        return np.stack([[p.c_n - record.c_n, p.c_t - record.c_t] for p in points])


def _check(h: float, q: np.ndarray, v: np.ndarray) -> None:
    check_states(h, q, v)
    if len(q) < MIN_SAMPLES:
        raise UserError(f"The forces of a wheel need at least {MIN_SAMPLES} samples; got {len(q)}.")


def _require_contact(wheel: RimlessWheel, q: np.ndarray, sigma: np.ndarray) -> None:
    gap = wheel.contacts_of(q).phi.min(axis=1)
    limit = CHI2_SIGMAS * float(np.hypot(sigma[0, 1], wheel.length * sigma[0, 2]))
    if gap.min() > limit:
        raise UserError(
            f"No spoke comes nearer to the slope than {gap.min():.3g} m (noise: {limit / CHI2_SIGMAS:.2g} m): there is "
            "no contact force in this window. Check the slope, the length of the spokes and the origin of y."
        )
