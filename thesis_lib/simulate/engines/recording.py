"""A simulated recording of an arm or a wheel with one hidden cause, by our time stepping or by a physics engine.

The trials are planned with the believed mechanism and run with the hidden cause (`hidden_forces`).  Our own time
stepping adds white noise to the states, for trying the critique; an engine has its own contact, and its states are
recorded by realistic sensors.
"""

from collections.abc import Iterator, Sequence
from typing import Literal

import numpy as np
import pandas as pd

from thesis_lib.datasets.recordings.header import Arm, RecordingHeader, Sampling, StateNoise, Wheel
from thesis_lib.datasets.recordings.recording import Recording
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.randomness import generator
from thesis_lib.simulate.engines.sensors import DrawnSensors, Sensors
from thesis_lib.simulate.engines.settings import EngineMotion, EngineName, drawn_stiffness
from thesis_lib.simulate.mechanisms import motions as chapter2
from thesis_lib.simulate.mechanisms.hidden_forces import TRUTHS, HiddenSizes, MechanismKind, planned, run_with
from thesis_lib.simulate.mechanisms.motions import DEFAULT
from thesis_lib.simulate.rig.hidden_causes import NO_SIZE, of_size
from thesis_lib.simulate.stepping.stepping import SimulatedMotion

# m, rad, m/s, rad/s; a motion tracker at about 60 dB, as accurate as the encoders of a laboratory
NOISE = StateNoise(position=3e-4, angle=5e-4, velocity=1e-3, angular_velocity=2e-3)
STEPPED = "example: simulated {kind} that may not be what recording.yaml says"
IN_ENGINE = "{kind} in {engine}, with its own contact, that may not be what recording.yaml says"
TRIALS = 16
MIN_TRIALS = 4
SIZE_OF: dict[tuple[MechanismKind, str], str] = {  # key of `HiddenSizes` that a given size sets
    ("arm", "viscous_joint_friction"): "viscous",
    ("arm", "coulomb_joint_friction"): "coulomb",
    ("arm", "cogging"): "cogging",
    ("arm", "payload"): "payload",
    ("wheel", "payload"): "wheel_payload",
    **{(kind, "gravity_direction"): "tilt" for kind in TRUTHS},
    **{(kind, "rolling_resistance"): "rolling" for kind in TRUTHS},
}
# t (n,), q and v (n, nv) and torques (n, joints) of a trial, as written to the recording
Written = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]


def simulate_recording(
    name: str,
    kind: MechanismKind,
    hidden: str,
    engine: EngineName | Literal["own"] = "own",
    *,
    size: float | None = None,
    trials: int = TRIALS,
    seed: int = 0,
    sensors: Sensors | None = None,
) -> Recording:
    """Simulate a recording of a mechanism of chapter 2 with the cause `hidden`, one of `TRUTHS[kind]`.

    Trials that cannot be solved, or in which an engine's arm flies off or penetrates the ground, are left out.

    Args:
        engine: "own" is time stepping, which does not use `sensors`.
        size: size of the cause, in its unit, the same at both joints; default: the size in `HiddenSizes`.
        seed: equal seeds give equal data (with an engine, on the same machine).

    Raises:
        UserError: the cause or the engine is unknown, its size is out of range, or too few trials are requested or
            remain.
    """
    if trials < MIN_TRIALS or seed < 0:
        raise UserError(
            f"A recording needs {MIN_TRIALS} trials or more and a seed of 0 or more; got {trials} and {seed}."
        )
    if hidden not in TRUTHS[kind]:
        raise UserError(f"The {kind} hides one of {', '.join(TRUTHS[kind])}; got {hidden!r}.")
    sizes, sensors = hidden_sizes(kind, hidden, size), sensors or Sensors()
    plans = planned(kind, trials, generator(seed, "recording", kind), DEFAULT, sizes)
    if engine == "own":
        header = _header(kind, STEPPED, NOISE, Sampling(velocities="time_stepping"))
        rng = generator(seed, "recording", kind, "noise")
        written = _with_noise(header, run_with(kind, hidden, plans, DEFAULT, sizes), rng)
    else:
        description = IN_ENGINE.replace("{engine}", engine)
        header = _header(kind, description, sensors.noise(DEFAULT.h), sensors.sampling())
        stiffness = drawn_stiffness(generator(seed, "recording", kind, engine, hidden, "contact"))
        usable = _usable(kind, plans, _runner(engine)(kind, hidden, plans, sizes, stiffness))
        joints, rng = len(header.mechanism.torques), generator(seed, "recording", kind, engine, hidden, "sensors")
        rig = DrawnSensors.draw(sensors, joints, rng)
        written = (rig.record(motion, plan.f_ext[:, :joints], DEFAULT.h, rng) for plan, motion in usable)
    rows = np.vstack([np.column_stack([np.full(len(one[0]), i), *one]) for i, one in enumerate(written)])
    return Recording(name, header, pd.DataFrame(rows, columns=list(header.columns)).astype({"trial": int}))


def _with_noise(
    header: RecordingHeader, records: Sequence[SimulatedMotion], rng: np.random.Generator
) -> Iterator[Written]:
    """The stepped trials with the noise of the header."""
    sigma_q, sigma_v = np.array(header.sigmas)
    joints = len(header.mechanism.torques)
    for record in records:
        q = record.q + sigma_q * rng.standard_normal(record.q.shape)
        v = record.v + sigma_v * rng.standard_normal(record.v.shape)
        # the torque of a step is in the row of the state before it; the last row has no torque
        yield record.t, q, v, np.vstack([record.f_ext[:, :joints], np.zeros((1, joints))])


def _runner(engine: str):
    if engine == "mujoco":
        from thesis_lib.simulate.engines.mujoco_motion import mujoco_motions

        return mujoco_motions
    if engine == "drake":
        from thesis_lib.simulate.engines.drake_motion import drake_motions

        return drake_motions
    raise UserError(f"The engines are mujoco and drake; got {engine!r}.")


def _usable(
    kind: MechanismKind, plans: Sequence[SimulatedMotion], motions: list[EngineMotion]
) -> list[tuple[SimulatedMotion, EngineMotion]]:
    """Trials in which the arm neither flies off nor penetrates the ground; UserError if too few remain."""
    arm, usable = chapter2.arm_disk(), []
    for plan, motion in zip(plans, motions):
        if not np.isfinite(motion.q).all() or np.abs(motion.v).max() > DEFAULT.arm.max_speed:
            continue
        if kind == "wheel" or min(points[:, 1].min() for points in arm.joints(motion.q)) >= 0.0:
            usable.append((plan, motion))
    if len(usable) < MIN_TRIALS:
        raise UserError(f"Only {len(usable)} of {len(plans)} trials of the {kind} are usable; {MIN_TRIALS} are needed.")
    return usable


def _header(kind: MechanismKind, description: str, noise: StateNoise, sampling: Sampling) -> RecordingHeader:
    section, believed = (Arm, DEFAULT.arm) if kind == "arm" else (Wheel, DEFAULT.wheel)
    mechanism = {name: getattr(believed, name) for name in section.model_fields if hasattr(believed, name)}
    if kind == "wheel":
        mechanism["payload_radius"] = HiddenSizes().payload_radius
    return RecordingHeader.model_validate(
        {
            "schema": 1,
            "description": description.format(kind=kind),
            "mechanism": {"kind": kind, **mechanism},
            "gravity": DEFAULT.gravity,
            "rate": 1.0 / DEFAULT.h,
            "noise": noise,
            "sampling": sampling,
        }
    )


def hidden_sizes(kind: MechanismKind, hidden: str, size: float | None) -> HiddenSizes:
    """Default sizes, with `size` for the hidden cause; UserError if the size is not possible."""
    if size is None:
        return HiddenSizes()
    key = SIZE_OF.get((kind, hidden))
    if key is None:
        raise UserError(NO_SIZE)
    return of_size(HiddenSizes, key, size, hidden, both=key in ("viscous", "coulomb"))


def hidden_text() -> str:
    """A line per cause that can be hidden in each mechanism, with its default size and meaning."""
    lines = []
    for kind, truths in TRUTHS.items():
        lines.append(f"\n  --mechanism {kind}:")
        for truth in truths:
            key = SIZE_OF.get((kind, truth))
            field = HiddenSizes.model_fields[key] if key else None
            size = "" if field is None else f"{field.default}".strip("()").replace(", ", "; ")
            meaning = "a mechanism that agrees with recording.yaml" if field is None else field.description
            lines.append(f"  {truth:<22}  {size:<10} {meaning}")
    return "\n".join(lines)
