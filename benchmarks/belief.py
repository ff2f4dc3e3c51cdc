"""Particle-throws per CPU second: how fast a belief over thrown squares is propagated to rest, on one core.

    python -m benchmarks.belief [--particles 10000] [--quick] [-o FILE.csv]

Every particle is thrown from the height and with the speeds of the measured dice until it lies.  One run measures the
law alone, the scattered law, a learned wrench residual, and the contact map of compliant contacts, with uncertainty;
the learned models are trained on 450 contacts that a law makes (what they learn does not change their cost).  Printed
with what is asked (10,000 for the law, 1,000 learned) and the ratio to the same particles thrown one at a time, in the
same run.
"""

import time

import numpy as np

from benchmarks.results import Results, benchmark_parser
from thesis_lib.contact import LAWS
from thesis_lib.datasets.format.impacts import Impacts
from thesis_lib.learners.bases import LawBase
from thesis_lib.learners.gaussian_process import GaussianProcessSettings, fit_gaussian_process
from thesis_lib.learners.learners import ImpulseLearner
from thesis_lib.thesis.residual.throwing.compliant_contact import CornerContact, compliant_path
from thesis_lib.thesis.residual.throwing.contact_map import ContactMap, Regime, contact_features
from thesis_lib.thesis.residual.throwing.flight import ThrownBody, first_touch, fly
from thesis_lib.thesis.residual.throwing.propagation import LearnedImpact, ScatteredLaw
from thesis_lib.thesis.residual.throwing.throw import LawImpact, ThrowSettings, simulate_throws

TRAINED = 450
ALONE = 40  # particles thrown one at a time
ASKED = {"law": 10_000, "scattered_law": 10_000, "learned_wrench": 1_000, "contact_map": 1_000}
FAST = GaussianProcessSettings(restarts=1, device="cpu")


def throws(n: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Starts (n, 3) each, within the range of the measured throws."""
    q = np.column_stack([np.zeros(n), np.full(n, 0.155), rng.uniform(-np.pi, np.pi, n)])
    v = np.column_stack([rng.uniform(-0.9, -0.3, n), rng.uniform(-2.5, -1.8, n), rng.uniform(-10, 10, n)])
    return q, v


def measure(particles: int, trained_on: int = TRAINED, singly: int = ALONE) -> dict[str, dict[str, float]]:
    """Particle-throws per CPU second of each model, all at once (`batched`) and one at a time (`alone`)."""
    rng = np.random.default_rng(0)
    half = 0.03 - 0.003
    corners = np.array([(half, half), (-half, half), (-half, -half), (half, -half)])
    body = ThrownBody(corners, 0.003, 0.0245, 9.81, c_v=0.5, c_w=0.5)
    law = LawImpact(LAWS["mirtich"], 0.12, 0.48, body.k_g)
    scatter = np.diag([0.03, 0.05, 0.002]) ** 2

    # training contacts: speeds from those of the first impact down to a tenth of them
    q, v = throws(trained_on, rng)
    v *= rng.uniform(0.1, 1.0, (trained_on, 1))
    t, corner = first_touch(body, q, v)
    q, v = fly(body, q, v, t)
    r = body.contact_point(q[:, 2], corner)
    _, after, _ = ScatteredLaw(body, law, relative=scatter)(q, v, r, np.zeros(trained_on, bool), rng)
    index = np.arange(trained_on)
    impacts = Impacts(trial=index, impact=index, q=q, v_pre=v, v_post=after, r=r, k_g=body.k_g)
    trained = ImpulseLearner("X1", True, LawBase("mirtich"), True, settings=FAST).fit(impacts, rng)
    features = contact_features(q, v, body.k_g)
    # smooth, with noise: hyperparameters as a real residual has them
    smooth = np.sin(features @ rng.normal(size=(features.shape[1], 6)))
    residual = 0.05 * smooth + 0.02 * rng.normal(size=(trained_on, 6))
    process = fit_gaussian_process(features, residual, rng, FAST, centred=False)

    def path(q: np.ndarray, v: np.ndarray, duration: float) -> tuple[np.ndarray, np.ndarray]:
        return compliant_path(body, CornerContact(), q, v, duration)

    regimes = (Regime(np.inf, process, np.ones(6)),)
    models = {
        "law": law,
        "scattered_law": ScatteredLaw(body, law, relative=scatter),
        "learned_wrench": LearnedImpact(body, law, trained=trained),
        "contact_map": ContactMap(body, law, path=path, regimes=regimes, freedom=4.0),
    }
    rates = {}
    for name, model in models.items():
        q, v = throws(particles, np.random.default_rng(1))
        settings = ThrowSettings(snapshots=0)
        # the first call fills caches (factor of the training covariance)
        simulate_throws(body, q[:50], v[:50], model, 0.15, settings, rng)
        begin = time.process_time()
        simulate_throws(body, q, v, model, 0.15, settings, rng)
        batched = time.process_time()
        for i in range(singly):
            simulate_throws(body, q[i : i + 1], v[i : i + 1], model, 0.15, settings, rng)
        alone = time.process_time()
        rates[name] = {"batched": round(particles / (batched - begin)), "alone": round(singly / (alone - batched), 1)}
    return rates


def main(arguments: list[str] | None = None) -> None:
    parser = benchmark_parser("belief", "Particle-throws per CPU second.")
    parser.add_argument("--particles", type=int, default=10_000)
    options = parser.parse_args(arguments)
    particles, trained, alone = (100, 40, 2) if options.quick else (options.particles, TRAINED, ALONE)
    rates = measure(particles, trained, alone)
    results = Results("belief")
    print("particle-throws per CPU second, one core")
    print(f"{'':16s}{'at once':>9s}{'asked':>8s}{'ratio':>7s}{'one at a time':>15s}{'ratio':>7s}")
    for name, rate in rates.items():
        asked, alone = rate["batched"] / ASKED[name], rate["batched"] / rate["alone"]
        print(f"{name:16s}{rate['batched']:9,d}{ASKED[name]:8,d}{asked:7.1f}{rate['alone']:15,.0f}{alone:7.0f}")
        results.add(f"{name}: at once", rate["batched"], "particle-throws a CPU second", f"{particles:,} particles")
        results.add(f"{name}: at once over one at a time", alone)
    results.write(options.out)


if __name__ == "__main__":
    main()
