"""Simulate drops with a saved model: law, effects and experimental set-up (rig) of a model.json.

Two engines resolve every impact with the model and use its acceleration in flight: `law_drops` and Drake
(`drake_augmented`).  Equal releases give equal paths in both.  Scatter beyond noise is not drawn.

Releases are drawn as for the proof, or taken from a dataset.  The latter are the states before the first impact of each
trial, traced back to the first sample t_0, or without trajectories (impacts.csv) to v_y = 0, with the model's
acceleration in flight a (m, 3):

    q_0 = q − v T + a T²/2,    v_0 = v − a T,    T = t_c − t_0   or   |v_y| / g
"""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from thesis_lib.bodies.body import Body, Noise, Surface
from thesis_lib.critique.drops.sliding import require_falling
from thesis_lib.critique.likelihood.comparison import Comparison
from thesis_lib.critique.likelihood.observations import Observations, observe
from thesis_lib.critique.results.saved_model import SavedModel, SavedReference
from thesis_lib.critique.simulation.law_drops import MeasuredReleases, own_poses, simulate_law_drops
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.foundation.errors import UserError
from thesis_lib.mechanics.state import State
from thesis_lib.simulate.rig.hidden_causes import PROOF_RELEASE, RIG_NOISE
from thesis_lib.simulate.rig.release import Release

ENGINES = ("own", "drake")
RATE = 250.0  # Hz
DURATION = 0.6  # s, for releases of the proof under 9.81 m/s²
AFTER_FALL = 0.3  # s, recorded after the longest fall if no trajectories give a duration
CLEAR = 0.01  # m, smallest height of the lowest point at release


def simulate_model(
    model: SavedModel,
    n: int | None = None,
    *,
    engine: str = "own",
    like: Dataset | None = None,
    rng: np.random.Generator,
    say: Callable[[str], None] = lambda text: None,
) -> Dataset:
    """Simulate drops with a saved model, and return their trajectories.

    Args:
        n: number of drops; None: 50, or one for each release of `like`.
        engine: "own" or "drake".
        like: dataset whose releases, noise, rate and duration replace the values of the proof.
        rng: equal streams give equal releases and noise in both engines.
        say: receives a line for each step.

    Raises:
        UserError: n is not positive, the engine is unknown or not installed, or `like` contains no release.
    """
    if n is not None and n < 1:
        raise UserError(f"The number of drops must be 1 or more, got {n}.")
    if engine not in ENGINES:
        raise UserError(f"There is no engine {engine!r}; known are {', '.join(ENGINES)}.")
    require_falling(model.rig.gravity, model.rig.has_angle, model.rig.walls, "simulate")
    rate, noise = RATE, RIG_NOISE
    if like is None:
        releases = proof_releases(model)
        duration = DURATION * math.sqrt(9.81 / model.rig.gravity)
        n = n or 50
    else:
        say(f"looking for the releases of {like.name}")
        observations = observe(like).counted_from(model.believed.reference)
        releases, duration = measured_releases(model, like, observations)
        rate, noise = like.rate or RATE, _noise(like, observations)
        n = n or len(releases.q)
    # the drops begin at 0 s with number 0
    middle = SavedReference(x=model.rig.reference.x if like else 0.0, t=0.5 * duration, trial=0.5 * (n - 1))
    model = model.model_copy(update={"rig": model.rig.model_copy(update={"reference": middle})})
    say(f"simulating {n} drops of {duration:.2f} s, engine {engine}")
    poses = own_poses
    if engine == "drake":
        try:
            from thesis_lib.critique.simulation.drake_augmented import drake_poses
        except ImportError as error:
            raise UserError(
                f"Drake cannot be used here ({error}): install it (pip install drake), or use --engine own."
            ) from error
        poses = partial(drake_poses, say=say)
    body = Body(shape=model.rig.shape, radius_of_gyration=model.rig.radius_of_gyration)
    believed = {"gravity": model.rig.gravity, "reference": model.believed.reference}
    recorded = {"duration": duration, "rate": rate, "noise": noise, "rng": rng}
    made = simulate_law_drops(body, releases, n, model.model, model.values, **believed, **recorded, poses=poses)
    effects = ", ".join(model.effects) or "no effects"
    text = f"simulated, not measured: {n} drops by {model.law} with {effects}, engine {engine}"
    height = model.rig.height  # they were simulated over y = 0
    header = made.header.model_copy(update={"surface": Surface(height=height), "description": text})
    table = made.trajectories.assign(y=made.trajectories["y"] + height)  # pyright: ignore[reportOptionalMemberAccess, reportOptionalSubscript]
    return replace(made, name="simulated", header=header, trajectories=table)


def proof_releases(model: SavedModel) -> Release:
    """Return the releases of the proof, raised if the body is too large for their lowest height."""
    height = PROOF_RELEASE.height
    lift = max(0.0, model.rig.shape.extent + CLEAR - height.low)
    lifted = height.model_copy(update={"low": height.low + lift, "high": height.high + lift})
    return PROOF_RELEASE.model_copy(update={"height": lifted})


def measured_releases(model: SavedModel, like: Dataset, observations: Observations) -> tuple[MeasuredReleases, float]:
    """Return releases of a dataset and the duration in s to record; UserError if no release is above the surface."""
    o = observations
    first = np.flatnonzero(o.impact == 0)
    here = Comparison(model.model, model.values, o)
    before = here.before.select(first)
    a = here.dynamics.acceleration(before)
    if o.arcs:
        times = like.trajectories.groupby("trial")["t"].agg(["min", "max"])  # pyright: ignore[reportOptionalMemberAccess]
        T = before.t - times["min"].reindex(before.trial).to_numpy(float)
        duration = float((times["max"] - times["min"]).median())
    else:
        T = np.maximum(-before.vy, 0.0) / o.rig.gravity
        duration = float(T.max(initial=0.0)) + AFTER_FALL
    q, v = before.q, before.v
    q, v = q - v * T[:, None] + 0.5 * a * T[:, None] ** 2, v - a * T[:, None]
    start = State.of(q, v, before.trial, before.t - T)
    true = here.dynamics.to_true(start)
    above = true.y - o.rig.height
    good = np.isfinite(above) & (model.rig.shape.gap(above, true.theta) > 0.0)
    if not good.any():
        raise UserError(
            f"{like.name} contains no release above the surface ({len(first)} first impacts were found): omit --like, "
            "or give a dataset whose trials begin in free fall with a body of this size."
        )
    q = np.stack([true.x, above, true.theta], axis=1)[good]
    return MeasuredReleases(q, true.v[good]), duration


def _noise(like: Dataset, observations: Observations) -> Noise:
    """Return the noise of a sample: position in m, angle in rad."""
    if observations.arcs:
        used = observations.found.noise.used
        return Noise(position=float(used[:2].mean()), angle=float(used[2]))
    stated = like.header.noise or RIG_NOISE
    return Noise(position=stated.position or RIG_NOISE.position, angle=stated.angle or RIG_NOISE.angle)
