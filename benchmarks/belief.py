"""Particle-throws per CPU second: how fast a belief over thrown squares is propagated to rest, on one core.

    python -m benchmarks.belief [--particles 3000] [-o FILE.json]

Every particle is thrown from the height and with the speeds of the measured dice until it lies.  One run measures the
law alone, the scattered law, a learned wrench residual, and the contact map, with uncertainty; the learned models are
trained on 450 contacts that a law makes (what they learn does not change their cost).  Wanted: 10,000 for the law,
1,000 learned.
"""

import argparse
import time
from pathlib import Path

import numpy as np

from thesis_lib.bodies.shapes import Polygon
from thesis_lib.contact import LAWS
from thesis_lib.datasets.impacts import Impacts
from thesis_lib.effects.effect import Rig
from thesis_lib.files import write_json
from thesis_lib.residual.bases import LawBase
from thesis_lib.residual.flight import first_touch, fly, thrown_body
from thesis_lib.residual.gaussian_process import GaussianProcessSettings, fit_gaussian_process
from thesis_lib.residual.learners import ImpulseLearner
from thesis_lib.residual.propagation import ContactMap, LearnedImpact, ScatteredLaw, contact_features
from thesis_lib.residual.throw import LawImpact, ThrowSettings, simulate_throws

TRAINED = 450
FAST = GaussianProcessSettings(restarts=1, device="cpu")


def throws(n: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Starts (n, 3) each, within the range of the measured throws."""
    q = np.column_stack([np.zeros(n), np.full(n, 0.155), rng.uniform(-np.pi, np.pi, n)])
    v = np.column_stack([rng.uniform(-0.9, -0.3, n), rng.uniform(-2.5, -1.8, n), rng.uniform(-10, 10, n)])
    return q, v


def measure(particles: int) -> dict[str, float]:
    """Particle-throws per CPU second of each model."""
    rng = np.random.default_rng(0)
    half = 0.03
    shape = Polygon(vertices=((half, half), (-half, half), (-half, -half), (half, -half)))
    body = thrown_body(Rig(shape, 0.0245, 9.81, 0.0), rho=0.003, c_v=0.5, c_w=0.5)
    law = LawImpact(LAWS["mirtich"], 0.12, 0.48, body.k_g)
    scatter = np.diag([0.03, 0.05, 0.002]) ** 2

    # training contacts: speeds from those of the first impact down to a tenth of them
    q, v = throws(TRAINED, rng)
    v *= rng.uniform(0.1, 1.0, (TRAINED, 1))
    t, corner = first_touch(body, q, v)
    q, v = fly(body, q, v, t)
    r = body.contact_point(q[:, 2], corner)
    _, after, _ = ScatteredLaw(body, law, relative=scatter)(q, v, r, np.zeros(TRAINED, bool), rng)
    index = np.arange(TRAINED)
    impacts = Impacts(trial=index, impact=index, q=q, v_pre=v, v_post=after, r=r, k_g=body.k_g)
    trained = ImpulseLearner("X1", True, LawBase("mirtich"), True, FAST).fit(impacts, rng)
    features = contact_features(q, v, body.k_g)
    # smooth, with noise: hyperparameters as a real residual has them
    residual = 0.05 * np.sin(features @ rng.normal(size=(6, 6))) + 0.02 * rng.normal(size=(TRAINED, 6))
    process = fit_gaussian_process(features, residual, rng, FAST, centred=False)

    models = {
        "law": law,
        "scattered_law": ScatteredLaw(body, law, relative=scatter),
        "learned_wrench": LearnedImpact(body, law, trained=trained),
        "contact_map": ContactMap(body, law, process=process),
    }
    rates = {}
    for name, model in models.items():
        start = throws(particles, np.random.default_rng(1))
        # the first call fills caches (factor of the training covariance)
        simulate_throws(body, start[0][:50], start[1][:50], model, 0.15, ThrowSettings(snapshots=0), rng)
        begin = time.process_time()
        simulate_throws(body, *start, model, 0.15, ThrowSettings(snapshots=0), rng)
        rates[name] = round(particles / (time.process_time() - begin))
    return rates


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.belief", description="Particle-throws per CPU second."
    )
    parser.add_argument("--particles", type=int, default=3000)
    parser.add_argument("-o", "--output", type=Path, metavar="FILE.json", help="write the figures as JSON")
    options = parser.parse_args(arguments)
    rates = measure(options.particles)
    for name, rate in rates.items():
        print(f"{name:16s} {rate:>8,d} particle-throws per CPU second")
    if options.output:
        write_json({"particle_throws_per_cpu_s": rates, "particles": options.particles}, options.output)


if __name__ == "__main__":
    main()
