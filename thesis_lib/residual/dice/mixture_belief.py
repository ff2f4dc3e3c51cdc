"""Beliefs over the state of a throw as Gaussian mixtures: the modified GP-SUM propagation (thesis, equation 4.16).

    s_i ~ p(s_0),  i = 1 … m                    of the measured start
    s_i → contact                               deterministic flight in closed form, all samples at once
    p(s⁺) = Σ_i N(s⁺ | m(s_i), S(s_i))/m        the uncertain contact (`propagation`); 4.12 to 4.15 and 4.17
    s_i ~ N(m(s_i), S(s_i)), feasible           repeated for each contact before the requested time
    m → fly(m),  S → F S Fᵀ,  F = ∂fly/∂s       exact, as flights are affine in the state

The weights stay 1/m because nothing is observed on the way; the Gaussians are not truncated.  The particle belief has
the same feasible samples s_i with kernels of covariance S_i = h² cov(s), h = (4/(5 m))^(1/7) (Silverman's in three
dimensions).

Log score and PIT use the velocity in the kinetic metric; most contacts add no uncertainty to the pose.  The measurement
is y = v + noise of covariance R,

    p(y) = (1 − γ) Σ_i N(y | m_i, S_i + R)/m + γ N(y | m̄, 25 S̄)

with m̄ and S̄ the moments of the sum.  γ = 0.01, as in `belief`: a finite sample makes no outcome impossible.  The PIT
u = P(p(Y) > p(y)), the smallest region of highest density that holds y, is estimated from samples.  The CRPS of each
coordinate has a closed form; scores are its means over (v_x, v_y, k ω) and over (x, y, k θ).

R is the covariance of the measured start, since flights before and after a contact are fitted alike.

Sources: Bauza and Rodriguez, GP-SUM, WAFR 2018, arXiv 1709.08120; regions of highest density: Hyndman 1996,
doi:10.1080/00031305.1996.10474359.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from thesis_lib.foundation.randomness import streams
from thesis_lib.residual.dice.data import MeasuredContacts, ThrowReleases
from thesis_lib.residual.dice.models import Thrower, perturbed
from thesis_lib.residual.dice.settings import DiceStudySettings
from thesis_lib.residual.dice.tables import spread
from thesis_lib.residual.throwing.belief import WIDE, GaussianMixture
from thesis_lib.residual.throwing.calibration import LEVELS, crps_of_mixture
from thesis_lib.residual.throwing.flight import ThrownBody, first_touch, fly
from thesis_lib.residual.throwing.propagation import Sampled, Tally, draw

SAMPLES = 200  # of a belief, for its regions of highest density
MOST = 100  # hits of a throw before the requested time: more are micro-hops that hardly move the body


@dataclass(frozen=True)
class StateBelief:
    """Beliefs over the states of n throws (m, rad; m/s, rad/s), m equally weighted components each."""

    mean: np.ndarray  # m_i (n, m, 6)
    cov: np.ndarray  # S_i (n, m, 6, 6)
    sample: np.ndarray  # s_i (n, m, 6)
    out_of_range: np.ndarray  # (n,) share of particles with a contact outside the range of training

    @property
    def particles(self) -> "StateBelief":
        """The belief as particles with kernels."""
        count = self.sample.shape[1]
        away = self.sample - self.sample.mean(1, keepdims=True)
        kernel = np.einsum("nmi,nmj->nij", away, away) / (count - 1) * (4.0 / (5.0 * count)) ** (2.0 / 7.0)
        return replace(self, mean=self.sample, cov=np.repeat(kernel[:, None], count, axis=1))


def propagate(
    body: ThrownBody,
    q: np.ndarray,
    v: np.ndarray,
    contact: Sampled,
    span: np.ndarray,
    micro: float,
    rng: np.random.Generator,
) -> StateBelief:
    """Beliefs over n throws at the times `span` (n,) in s after the start.

    `q` and `v` (n, m, 3; m, rad and m/s, rad/s) are samples of the start, above the surface.  Contacts that approach
    more slowly than `micro` (m/s) keep their energy (`ThrowSettings`).
    """
    shape = q.shape[:2]
    q, v = q.reshape(-1, 3).copy(), v.reshape(-1, 3).copy()
    mean, cov = np.hstack([q, v]), np.zeros((len(q), 6, 6))
    remaining, outside = np.repeat(np.asarray(span, float), shape[1]), np.zeros(len(q), bool)
    rows = np.arange(len(q))
    for _ in range(MOST):
        t, corner = first_touch(body, q[rows], v[rows])
        hits = t <= remaining[rows]
        rows, t, corner = rows[hits], t[hits], corner[hits]
        if not len(rows):
            break
        at_q, at_v = fly(body, q[rows], v[rows], t)
        r = body.contact_point(at_q[:, 2], corner)
        slow = -(at_v[:, 1] + r[:, 0] * at_v[:, 2]) < micro
        out = draw(contact, at_q, at_v, r, slow, rng)
        mean[rows], cov[rows], q[rows], v[rows] = out.mean, out.cov, out.q, out.v
        remaining[rows] -= t + out.took
        outside[rows] |= ~out.in_range
    # particles that have not reached their last hit stay where they are
    remaining[rows] = np.minimum(remaining[rows], 0.0)
    mean, cov = fly_gaussian(body, mean, cov, remaining)
    sample = np.hstack(fly(body, q, v, remaining))
    return StateBelief(
        mean.reshape(*shape, 6), cov.reshape(*shape, 6, 6), sample.reshape(*shape, 6), outside.reshape(shape).mean(1)
    )


def fly_gaussian(body: ThrownBody, mean: np.ndarray, cov: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean (n, 6) and covariance (n, 6, 6) after free flight of t (n,) s; t may be negative."""
    q, v = mean[:, :3], mean[:, 3:]
    end = np.hstack(fly(body, q, v, t))
    F = np.tile(np.eye(6), (len(mean), 1, 1))
    for i, unit in enumerate(np.eye(3)):
        F[:, :, 3 + i] = np.hstack(fly(body, q, v + unit, t)) - end
    return end, F @ cov @ np.swapaxes(F, 1, 2)


def state_scores(
    belief: StateBelief, measured: np.ndarray, noise: np.ndarray, k_g: float, rng: np.random.Generator
) -> pd.DataFrame:
    """Scores of beliefs over n throws at their measured states; see the module's equations.

    `measured` (n, 6) is pose and velocity, `noise` (n, 6, 6) its positive definite covariance, `k_g` in m.  Returns pit
    and log_score (nats; of a density in m³/s³) of the velocity, crps_velocity (m/s), crps_pose (m), out_of_range.
    """
    metric = np.array([1.0, 1.0, k_g, 1.0, 1.0, k_g])
    scale = np.outer(metric, metric)
    rows = []
    for mean, cov, y, R in zip(belief.mean, belief.cov, measured * metric, noise * scale):
        mixture = widened(mean * metric, cov * scale + R)
        velocity = mixture.marginal([3, 4, 5])
        log_density = velocity.log_density(np.vstack([y[3:], velocity.sample(SAMPLES, rng)]))
        # a rank among the samples, uniform if the belief is right
        pit = (np.sum(log_density[1:] > log_density[0]) + rng.uniform()) / (SAMPLES + 1)
        std = np.sqrt(np.einsum("mii->im", mixture.cov))
        crps = crps_of_mixture(y, mixture.mean.T, std, mixture.weight)
        rows.append((pit, log_density[0], crps[3:].mean(), crps[:3].mean()))
    table = pd.DataFrame(rows, columns=["pit", "log_score", "crps_velocity", "crps_pose"])
    return table.assign(out_of_range=belief.out_of_range)


def widened(mean: np.ndarray, cov: np.ndarray) -> GaussianMixture:
    """Mixture of equal Gaussians (m, d), (m, d, d) and, with weight γ, one of five times their total spread."""
    equal = GaussianMixture(mean, cov, np.full(len(mean), 1.0 / len(mean)))
    centre, width = equal.moments
    return GaussianMixture(
        np.vstack([mean, centre]),
        np.concatenate([cov, 25.0 * width[None]]),
        np.append((1.0 - WIDE) * equal.weight, WIDE),
    )


def first_contact_scores(
    throwers: Sequence[Thrower],
    releases: ThrowReleases,
    contacts: MeasuredContacts,
    settings: DiceStudySettings,
    rng: np.random.Generator,
) -> pd.DataFrame:
    """Scores of trained models' beliefs over the state after the first contact of held-out throws.

    The first measured contact of each throw is used, if a flight follows soon.  A row per throw, model and belief
    (mixture or particles): trial, model, belief, columns of `state_scores`.
    """
    first = contacts.select(contacts.first & np.isin(contacts.trial, releases.trial))
    order = np.argsort(releases.trial)
    known = releases.select(order[np.searchsorted(releases.trial[order], first.trial)])
    measured = np.hstack([first.q_after, first.v_after])
    tables, stream = [], streams(rng)
    for thrower in throwers:
        model, draws = thrower.model, stream(thrower.name)
        q, v = perturbed(known, settings.particles, draws)
        shape = (len(first), settings.particles, 3)
        contact = replace(thrower.contact, tally=Tally())
        start = model.seen(q).reshape(shape), v.reshape(shape)
        belief = propagate(model.body, *start, contact, first.span, settings.throw.micro, draws)
        true = measured - [0.0, 0.0, model.d_theta, 0.0, 0.0, 0.0]
        for name, form in (("mixture", belief), ("particles", belief.particles)):
            scores = state_scores(form, true, known.cov, model.k_g, draws)
            labels = {"trial": first.trial, "model": thrower.name, "belief": name}
            tables.append(pd.concat([pd.DataFrame(labels), scores], axis=1))
    return pd.concat(tables, ignore_index=True)


def first_contact_summary(scores: pd.DataFrame, bootstrap: int, rng: np.random.Generator) -> pd.DataFrame:
    """A row per model, belief and quantity: value, std, low, high (bootstrap over throws), n.

    Quantities are means over throws, but for log_score_median: coverage_50, coverage_80, coverage_95 (regions of
    highest density), log_score, crps_velocity, crps_pose, out_of_range.
    """
    rows, stream = [], streams(rng)
    for (model, belief), part in scores.groupby(["model", "belief"], sort=False):
        quantities = {f"coverage_{level:.0%}".rstrip("%"): part["pit"] <= level for level in LEVELS}
        quantities |= {name: part[name] for name in ("log_score", "crps_velocity", "crps_pose", "out_of_range")}
        taken = [(name, column, np.mean, name) for name, column in quantities.items()]
        # one contact that the camera lost can dominate a mean of logarithms
        taken.append(("log_score_median", part["log_score"], np.median, "median"))
        for name, column, statistic, key in taken:
            values = column.to_numpy(float)
            interval = spread(values, statistic, bootstrap, stream(model, belief, key))
            rows.append((model, belief, name, float(statistic(values)), *interval, len(values)))
    return pd.DataFrame(rows, columns=["model", "belief", "quantity", "value", "std", "low", "high", "n"])
