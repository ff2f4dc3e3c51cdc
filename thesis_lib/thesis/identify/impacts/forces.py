"""Forces at impact (thesis section 2.5, figure 2-15): impulses estimated from 250 Hz poses against a force sensor.

Ellipses fall onto a plate in Drake, with compliant contact of about 1.4 ms (`simulate.drake.drops`).  The force f(t) on
the body is known.  A sensor under the plate responds as a resonator and is sampled 1000 times a second,

    s̈/ω² + 2ζ ṡ/ω + s = f,    so that  ∫ s dt = ∫ f dt,  but max s ≠ max f.                                  (1)

The estimator uses only noisy poses, of unknown noise level.  Arcs on either side of the hit (`datasets.flights.arcs`)
give the velocities just before and after with their covariance, and the method `arcs` gives

    c = m (Δv_x, Δv_y),     cov c = m² cov Δv.                                                              (2)

With k known, `arcs_link` adds the condition that a single impulse acted at the contact point, without a couple:
g = Δω − (r_x Δv_y − r_y Δv_x)/k² = 0, by x ← x − C ∇g (∇g' C ∇g)⁻¹ g for x = (q, v−, v+) of covariance C.  This is the
thesis's assumption of rigid contact; the intervals ignore that the body turns during the real contact.
In flight, only gravity acts, as in the thesis (`stray_acceleration` is off).

A peak follows from an impulse only with a *declared* duration T_c (the thesis gives none) and shape, the half-sine

    f̂(t) = f̂ sin(π t / T_c),     f̂ = π c_n / (2 T_c).                                                        (3)

Sources: thesis section 2.5; K. L. Johnson, Contact Mechanics, Cambridge 1985, doi 10.1017/CBO9781139171731, section
11.4 (half-sine shape of an elastic impact).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.impacts import POSE, V_PRE
from thesis_lib.datasets.format.samples import ArcSettings
from thesis_lib.datasets.impacts.detect import FoundImpacts, find_impacts
from thesis_lib.effects.effect import Rig
from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.rig.hidden_causes import HiddenCauses
from thesis_lib.simulate.rig.record import DropsWithTruth
from thesis_lib.statistics.intervals import Z95
from thesis_lib.thesis.identify.impacts.measured_ratio import ImpactLink
from thesis_lib.thesis.identify.impacts.settings import ImpactForces

METHODS = ("arcs", "arcs_link")
THESIS = {"mean": -12.12, "std": 31.59}  # N: error of the peak; section 2.5
LEVELS = {68: 0.994457883209753, 95: Z95}  # %: two-sided normal quantiles
NOT_DETECTED = "not_detected"
_LONGEST = 4.0  # contact times after which a contact that has not ended does not count as an impact
_FINE = 200  # steps of force and response between samples of the sensor; 50 would miss 0.3 mN s of changing friction


@dataclass(frozen=True)
class ForceHistory:
    """Force on the body during one contact, and the sensor's response."""

    t: np.ndarray  # (s,) s since first touch, from 0 to the end of the contact
    force: np.ndarray  # (s, 2) N, tangential and normal
    sensor_t: np.ndarray  # (p,) s since first touch, instants of the sensor's samples
    reading: np.ndarray  # (p,) N, normal, at these instants
    response_t: np.ndarray  # response_t, response: (f,) s, N; the continuous response, s of equation 1
    response: np.ndarray

    @property
    def impulse(self) -> np.ndarray:
        """Impulse (2,), the integral of the force, N s."""
        return np.trapezoid(self.force, self.t, axis=0)


class ForcePlate:
    """Plate and body in Drake, with which single contacts are simulated again to record their force."""

    def __init__(self, settings: ImpactForces):
        from thesis_lib.simulate.drake.clock import Clock
        from thesis_lib.simulate.drake.drops import ACCURACY
        from thesis_lib.simulate.drake.plant import drop_plant, pad_of

        self.settings, body, contact = settings, settings.body, settings.contact
        pad = pad_of(body, contact, HiddenCauses(), contact.epsilon)
        self._clock = Clock(drop_plant(body, contact, HiddenCauses(), 9.81, pad), contact.contact_time, ACCURACY)
        self._port = self._clock.made.plant.get_contact_results_output_port()

    def contact(self, q: np.ndarray, v: np.ndarray, t: float) -> ForceHistory:
        """Force history of a contact that begins at pose, velocity (3,) and time t in s of the sensor's clock.

        Raises:
            UserError: the body does not leave the plate.
        """
        clock, step = self._clock, 1.0 / (self.settings.sensor_rate * _FINE)
        clock.start(0.0, q, v)
        times, forces = [0.0], [np.zeros(2)]
        touched = False
        for i in range(1, int(_LONGEST * self.settings.contact_time / step) + 1):
            clock.simulator.AdvanceTo(i * step)
            results: Any = self._port.Eval(clock.context)
            # Drake's force acts on body B, which may be the falling body or the plate
            contacts = [results.point_pair_contact_info(j) for j in range(results.num_point_pair_contacts())]
            total = sum((self._on_body(contact) for contact in contacts), np.zeros(2))
            times.append(i * step)
            forces.append(total)
            touched |= total[1] > 0.0
            if touched and not total[1] > 0.0:
                break
        else:
            raise UserError("The body does not leave the plate again: raise epsilon or the release heights.")
        time, force = np.array(times), np.array(forces)
        return ForceHistory(time, force, *self._sensor(time, force[:, 1], t))

    def _on_body(self, info: Any) -> np.ndarray:
        plant = self._clock.made.plant
        sign = 1.0 if info.bodyB_index() == plant.GetBodyByName("body").index() else -1.0
        return sign * info.contact_force()[:2]

    def _sensor(self, time: np.ndarray, force: np.ndarray, t: float) -> tuple[np.ndarray, ...]:
        from scipy.signal import lsim

        s = self.settings
        fine = np.arange(int(s.sensor_window * s.sensor_rate * _FINE) + 1) / (s.sensor_rate * _FINE)
        omega = 2.0 * np.pi * s.sensor_frequency
        system = ([omega**2], [1.0, 2.0 * s.sensor_damping * omega, omega**2])
        answer = lsim(system, np.interp(fine, time, force, right=0.0), fine)[1]
        first = np.ceil(t * s.sensor_rate) / s.sensor_rate - t
        at = np.arange(first, s.sensor_window, 1.0 / s.sensor_rate)
        return at, np.interp(at, fine, answer), fine, answer


def estimate_impulses(found: FoundImpacts, rig: Rig) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Estimate impulses c (n, 2) = (c_t, c_n) in N s of n impacts, with covariance (n, 2, 2), by each of `METHODS`.

    `rig` gives shape, mass and k.
    """
    impacts = found.impacts
    m, cov = impacts.mass, impacts.cov
    change = np.zeros((2, 9))  # Δv_x, Δv_y from `impacts.STATE`
    change[[0, 1], [6, 7]], change[[0, 1], [3, 4]] = 1.0, -1.0
    g, gradient = ImpactLink(impacts, rig).relation(np.array([1.0 / rig.k_g**2]))
    along = np.einsum("nij,nj->ni", cov, gradient)  # pyright: ignore[reportArgumentType, reportCallIssue]
    variance = np.einsum("ni,ni->n", gradient, along)
    step = -along * (g / variance)[:, None]
    linked = cov - along[:, :, None] * along[:, None, :] / variance[:, None, None]
    c = m * impacts.dv[:, :2]
    return {
        "arcs": (c, m**2 * change @ cov @ change.T),  # pyright: ignore[reportOperatorIssue]
        "arcs_link": (c + m * step @ change.T, m**2 * change @ linked @ change.T),
    }


def drop_ellipses(settings: ImpactForces, rng: np.random.Generator) -> DropsWithTruth:
    """Simulate drops in Drake, with noisy poses."""
    from thesis_lib.simulate.compliant.drops import simulate_compliant_drops
    from thesis_lib.simulate.drake.drops import DropsInDrake

    return simulate_compliant_drops(
        settings.body,
        settings.release,
        settings.drops,
        engine=DropsInDrake(),
        contact=settings.contact,
        duration=settings.duration,
        rate=settings.rate,
        noise=settings.noise,
        rng=rng,
    )


def study_impact_forces(drops: DropsWithTruth, settings: ImpactForces) -> tuple[pd.DataFrame, dict[str, int]]:
    """Table with a row per impact and method (estimates and truth), and numbers of impacts left out, by reason.

    Columns: trial, impact, method, t, c_t, c_n, c_t_std, c_n_std, true_c_t, true_c_n, sensor_c_n, peak, peak_true,
    peak_sensor, declared_duration, true_duration; s, N s and N.

    Raises:
        UserError: no impact can be measured, or a body does not leave the plate.
    """
    header = drops.header.model_copy(update={"noise": None})
    dataset = Dataset("ellipse_drops", header, drops.trajectories)
    detected = find_impacts(dataset, ArcSettings(stray_acceleration=False))
    rig = Rig(header.body.shape, header.body.radius_of_gyration, header.gravity, header.surface.height)
    estimates = estimate_impulses(detected, rig) if len(detected.impacts) else {}
    plate, rows, left_out = ForcePlate(settings), [], {}
    for truth in drops.impacts[drops.impacts["impact"] < settings.hits].to_dict("records"):
        same = np.flatnonzero(detected.impacts.trial == truth["trial"])
        middle = truth["t"] + 0.5 * truth["duration"]
        i = next((i for i in same if abs(detected.impacts.t[i] - middle) < 1.0 / settings.rate), None)
        if i is None:
            reason = _why(detected.left_out, truth["trial"], middle, 1.0 / settings.rate)
            left_out[reason] = left_out.get(reason, 0) + 1
            continue
        q, v = (np.array([truth[name] for name in names]) for names in (POSE, V_PRE))
        history = plate.contact(q, v, truth["t"])
        common = {
            "true_c_t": history.impulse[0],
            "true_c_n": history.impulse[1],
            "sensor_c_n": history.reading.sum() / settings.sensor_rate,
            "peak_true": history.force[:, 1].max(),
            "peak_sensor": history.reading.max(),
            "declared_duration": settings.declared_duration,
            "true_duration": history.t[-1],
        }
        for method, (impulses, cov) in estimates.items():
            (c_t, c_n), (c_t_std, c_n_std) = impulses[i], np.sqrt(np.diag(cov[i]))
            c = {"c_t": c_t, "c_n": c_n, "c_t_std": c_t_std, "c_n_std": c_n_std}
            peak = peak_force(c_n, settings.declared_duration)
            key = {"trial": truth["trial"], "impact": truth["impact"], "method": method, "t": truth["t"]}
            rows.append(key | c | common | {"peak": peak})
    if not rows:
        raise UserError(f"No impact of {settings.drops} drops could be measured ({left_out}); lengthen `duration`.")
    return pd.DataFrame(rows), left_out


def peak_force(c_n: float, declared_duration: float) -> float:
    """Peak force in N of a half-sine with impulse c_n (N s) and declared duration (s), equation 3."""
    return 0.5 * np.pi * c_n / declared_duration


def force_summary(rows: pd.DataFrame) -> pd.DataFrame:
    """Errors in the table of `study_impact_forces`, by method and comparison; the thesis compares peak and sensor.

    Columns: method, quantity, reference, unit, n, mean (of the reference), mean_error, mean_error_std, std,
    std_stated, coverage_68, coverage_95, thesis_mean_error, thesis_std.
    """
    table = []
    for method, group in rows.groupby("method", sort=False):
        for quantity, reference, stated in (
            ("c_n", "true_c_n", "c_n_std"),
            ("c_t", "true_c_t", "c_t_std"),
            ("c_n", "sensor_c_n", "c_n_std"),
            ("peak", "peak_true", None),
            ("peak", "peak_sensor", None),
        ):
            error = group[quantity] - group[reference]
            row = {
                "method": method,
                "quantity": quantity,
                "reference": reference,
                "unit": "N" if quantity == "peak" else "N s",
                "n": len(group),
                "mean": group[reference].mean(),
                "mean_error": error.mean(),
                "mean_error_std": error.std() / np.sqrt(len(group)),
                "std": error.std(),
            }
            if stated:
                row["std_stated"] = float(np.sqrt(np.mean(group[stated] ** 2)))
                for name, quantile in LEVELS.items():
                    row[f"coverage_{name}"] = float(np.mean(np.abs(error) <= quantile * group[stated]))
            if reference == "peak_sensor":
                row |= {"thesis_mean_error": THESIS["mean"], "thesis_std": THESIS["std"]}
            table.append(row)
    return pd.DataFrame(table)


def shown_impact(rows: pd.DataFrame, drops: DropsWithTruth, settings: ImpactForces) -> tuple[pd.Series, ForceHistory]:
    """Impact of figure 2-15, the first hit with the median true peak: its row of method `arcs` and force history."""
    first = rows[(rows["impact"] == 0) & (rows["method"] == METHODS[0])].sort_values("peak_true", kind="stable")
    if first.empty:
        raise UserError("No first hit could be measured, so none can be shown; simulate more drops.")
    row = first.iloc[len(first) // 2]
    truth = drops.impacts[(drops.impacts["trial"] == row["trial"]) & (drops.impacts["impact"] == 0)].iloc[0]
    q, v = (truth[list(names)].to_numpy(float) for names in (POSE, V_PRE))
    return row, ForcePlate(settings).contact(q, v, truth["t"])


def _why(left_out: pd.DataFrame, trial: int, t: float, near: float) -> str:
    of = left_out[(left_out["trial"] == trial) & ((left_out["t"] - t).abs() < near)]
    return str(of["reason"].iloc[0]) if len(of) else NOT_DETECTED
