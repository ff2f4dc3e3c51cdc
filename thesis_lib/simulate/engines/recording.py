"""A recording of an engine's arm or wheel with one hidden cause."""

import numpy as np
import pandas as pd

from thesis_lib.datasets.recordings.recording import Recording
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.randomness import generator
from thesis_lib.simulate.chapter2 import motions as chapter2
from thesis_lib.simulate.chapter2.hidden_forces import TRUTHS, MechanismKind, planned
from thesis_lib.simulate.chapter2.motions import DEFAULT, Chapter2Bodies
from thesis_lib.simulate.chapter2.recording import MIN_TRIALS, TRIALS, hidden_sizes, recording_header
from thesis_lib.simulate.engines.sensors import DrawnSensors, Sensors
from thesis_lib.simulate.engines.settings import EngineContact, EngineMotion, EngineName

DESCRIPTION = "{kind} in {engine}, with its own contact, that may not be what recording.yaml says"


def record_engine(
    name: str,
    kind: MechanismKind,
    hidden: str,
    engine: EngineName,
    *,
    size: float | None = None,
    trials: int = TRIALS,
    seed: int = 0,
    bodies: Chapter2Bodies = DEFAULT,
    contact: EngineContact | None = None,
    sensors: Sensors | None = None,
) -> Recording:
    """Recording of the mechanism `bodies` in an engine, with the cause `hidden`, one of `TRUTHS[kind]`.

    Starts and torques are planned with the believed mechanism.  Trials in which the arm flies off or goes through the
    ground are left out.

    Args:
        size: of the cause, in its unit, the same at both joints; default: that of `HiddenSizes`.
        seed: equal seeds give equal data on one machine.

    Raises:
        UserError: the cause or the engine is unknown, or too few trials remain.
    """
    if trials < MIN_TRIALS or seed < 0:
        raise UserError(
            f"A recording needs {MIN_TRIALS} trials or more and a seed of 0 or more; got {trials} and {seed}."
        )
    if hidden not in TRUTHS[kind]:
        raise UserError(f"The {kind} hides one of {', '.join(TRUTHS[kind])}; got {hidden!r}.")
    sizes, contact, sensors = hidden_sizes(kind, hidden, size), contact or EngineContact(), sensors or Sensors()
    plans = planned(kind, trials, generator(seed, "recording", kind), bodies, sizes)
    if engine == "mujoco":
        from thesis_lib.simulate.engines.mujoco_motion import mujoco_motions as run
    elif engine == "drake":
        from thesis_lib.simulate.engines.drake_motion import drake_motions as run
    else:
        raise UserError(f"The engines are mujoco and drake; got {engine!r}.")
    drawn = contact.draw(generator(seed, "recording", kind, engine, hidden, "contact"))
    motions = run(kind, hidden, plans, bodies, sizes, drawn)
    usable = [(plan, motion) for plan, motion in zip(plans, motions) if _is_usable(kind, motion, bodies)]
    if len(usable) < MIN_TRIALS:
        raise UserError(f"Only {len(usable)} of {trials} trials of the {kind} are usable; {MIN_TRIALS} are needed.")
    header = recording_header(kind, bodies).model_copy(
        update={
            "description": DESCRIPTION.format(kind=kind, engine=engine),
            "noise": sensors.noise(bodies.h),
            "sampling": sensors.sampling(),
        }
    )
    driven = len(header.mechanism.torques)
    rng = generator(seed, "recording", kind, engine, hidden, "sensors")
    rig = DrawnSensors.draw(sensors, driven, rng)
    tables = []
    for i, (plan, motion) in enumerate(usable):
        t, q, v, u = rig.record(motion, plan.f_ext[:, :driven], bodies.h, rng)
        numbers = np.column_stack([np.full(len(t), i), t, q, v, u])
        tables.append(pd.DataFrame(numbers, columns=list(header.columns)).astype({"trial": int}))
    return Recording(name, header, pd.concat(tables, ignore_index=True))


def _is_usable(kind: MechanismKind, motion: EngineMotion, bodies: Chapter2Bodies) -> bool:
    if not np.isfinite(motion.q).all() or np.abs(motion.v).max() > bodies.arm.max_speed:
        return False
    return kind == "wheel" or min(p[:, 1].min() for p in chapter2.arm_disk(bodies).joints(motion.q)) >= 0.0
