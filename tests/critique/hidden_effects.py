"""Small datasets with something hidden in them, and drops with nothing hidden, made once, with their observations."""

from functools import cache

import numpy as np
import pandas as pd

from thesis_lib.bodies.body import Body, Noise
from thesis_lib.contact import LAWS
from thesis_lib.critique.contacts.kinds import bind
from thesis_lib.critique.contacts.model import Model
from thesis_lib.critique.likelihood.comparison import Comparison
from thesis_lib.critique.likelihood.observations import Observations, observe
from thesis_lib.critique.likelihood.synthesis import synthesise
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.header import Header
from thesis_lib.effects import EFFECTS
from thesis_lib.effects.effect import Effect, Rig
from thesis_lib.mechanics.state import State
from thesis_lib.simulate.compliant.drops import simulate_compliant_drops
from thesis_lib.simulate.rig.hidden_causes import ELLIPSE_BODY, PROOF_RELEASE, RIG_NOISE, HiddenCauses
from thesis_lib.simulate.rig.record import DropsWithTruth
from thesis_lib.simulate.stepping.drops import simulate_drops

TRUTH = {"mu": 0.2, "epsilon": 0.6}
LAW = LAWS["anitescu_potra_newton"]  # that of the simulator of `drops`
DROPS = 60
ANISOTROPY = 0.3  # hidden in `hidden_drops`
E_T = 0.4  # hidden in `hidden_impacts`


def recorded(body: Body, drops: int, seed: int, name: str = "drops", **given) -> Dataset:
    """Drops with compliant contact in continuous time, sampled as a rig would."""
    rng = np.random.default_rng(seed)
    made = simulate_compliant_drops(body, PROOF_RELEASE, drops, rng=rng, **{"noise": RIG_NOISE} | given)
    return Dataset(name, made.header, made.trajectories)


def simulated(name: str, seed: int, **mechanisms: float) -> Dataset:
    """Such drops of an ellipse, with causes hidden in them."""
    return recorded(ELLIPSE_BODY, DROPS, seed, name, hidden=HiddenCauses(**mechanisms))


def injected_impacts(
    name: str, n: int, seed: int, effect: str | Effect, values: dict[str, float], body: Body = ELLIPSE_BODY
) -> Dataset:
    """impacts.csv only, from the law with one effect, with noise as stated in its header."""
    effect = EFFECTS[effect] if isinstance(effect, str) else effect
    rng = np.random.default_rng(seed)
    noise = Noise(position=3e-4, angle=3e-3, velocity=0.01, angular_velocity=0.3)
    header = Header(schema=1, body=body, noise=noise)
    shape = body.shape
    theta = rng.uniform(-np.pi, np.pi, n)
    state = State.planar(
        x=rng.uniform(-0.2, 0.2, n),
        y=-shape.contact_point(theta)[:, 1],
        theta=theta,
        vx=rng.uniform(-1.2, 1.2, n),
        vy=-rng.uniform(1.0, 3.3, n),
        omega=rng.uniform(-15.0, 15.0, n),
        trial=np.arange(n),
        t=np.zeros(n),
    )
    model = Model(LAW, (effect,))
    rig = Rig(shape, body.radius_of_gyration, 9.81, 0.0)
    after = bind(model, TRUTH | values, rig).predict(state)

    def seen(values: np.ndarray, sigma: float) -> np.ndarray:
        return values + sigma * rng.standard_normal(n)

    table = pd.DataFrame({"trial": np.arange(n), "impact": 0})
    for column in ("x", "y"):
        table[column] = seen(getattr(state, column), noise.position)
    table["theta"] = seen(theta, noise.angle)
    for side, one in (("pre", state), ("post", after)):
        for column in ("vx", "vy"):
            table[f"{column}_{side}"] = seen(getattr(one, column), noise.velocity)
        table[f"omega_{side}"] = seen(one.omega, noise.angular_velocity)
    return Dataset(name, header, impacts=table)


@cache
def drops(n: int = 40, seed: int = 0) -> DropsWithTruth:
    rng = np.random.default_rng(seed)
    return simulate_drops(ELLIPSE_BODY, PROOF_RELEASE, n, **TRUTH, noise=RIG_NOISE, rng=rng)


@cache
def observed(n: int = 40, seed: int = 0) -> Observations:
    one = drops(n, seed)
    """Single hits; episodes have tests of their own."""
    return observe(Dataset("plain", one.header, one.trajectories), episodes=False)


def sizes(effect: Effect, factor: float = 1.0) -> dict[str, float]:
    """Parameters of an effect at a multiple of their scales, by full name."""
    return {
        f"{effect.name}.{p.name}": p.null + factor * p.scale if p.discrete is None else p.discrete
        for p in effect.parameters
    }


def injected(name: str, factor: float = 1.0, seed: int = 5) -> tuple[Observations, dict[str, float]]:
    """Observations as the law with one effect would have made them, and the true values."""
    effect = EFFECTS[name]
    values = TRUTH | sizes(effect, factor)
    rng = np.random.default_rng(seed)
    return synthesise(Comparison(Model(LAW, (effect,)), values, observed()), rng), values
