"""Simulated recording of a mechanism with one hidden cause, for trying the critique.

The trials are planned with the believed mechanism and run with the hidden cause (`hidden_forces`).
"""

import numpy as np
import pandas as pd
from pydantic import ValidationError

from thesis_lib.datasets.recordings.header import Arm, RecordingHeader, Sampling, StateNoise, Wheel
from thesis_lib.datasets.recordings.recording import Recording
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.randomness import generator
from thesis_lib.simulate.chapter2.hidden_forces import TRUTHS, HiddenSizes, MechanismKind, planned, run_with
from thesis_lib.simulate.chapter2.motions import DEFAULT, Chapter2Bodies

# m, rad, m/s, rad/s; a motion tracker at about 60 dB, as good as the encoders of a laboratory
NOISE = StateNoise(position=3e-4, angle=5e-4, velocity=1e-3, angular_velocity=2e-3)
DESCRIPTION = "example: simulated {kind} that may not be what recording.yaml says"
TRIALS = 16
MIN_TRIALS = 4
SIZE_OF: dict[tuple[MechanismKind, str], str] = {  # the key of `HiddenSizes` that a size sets
    ("arm", "viscous_joint_friction"): "viscous",
    ("arm", "coulomb_joint_friction"): "coulomb",
    ("arm", "cogging"): "cogging",
    ("arm", "payload"): "payload",
    ("wheel", "payload"): "wheel_payload",
    **{(kind, "gravity_direction"): "tilt" for kind in TRUTHS},
    **{(kind, "rolling_resistance"): "rolling" for kind in TRUTHS},
}


def simulate_recording(
    name: str,
    kind: MechanismKind,
    hidden: str,
    *,
    size: float | None = None,
    trials: int = TRIALS,
    seed: int = 0,
    bodies: Chapter2Bodies = DEFAULT,
) -> Recording:
    """Simulate a recording of the mechanism `bodies` with the cause `hidden`, one of `TRUTHS[kind]`.

    Args:
        size: of the cause, in its unit, the same at both joints; default: that of `HiddenSizes`.
        seed: equal seeds give equal data.

    Raises:
        UserError: the cause is unknown, its size is out of range, or there are too few trials.
    """
    if trials < MIN_TRIALS or seed < 0:
        raise UserError(
            f"A recording needs {MIN_TRIALS} trials or more and a seed of 0 or more; got {trials} and {seed}."
        )
    header = recording_header(kind, bodies)
    plans = planned(kind, trials, generator(seed, "recording", kind), bodies)
    records = run_with(kind, hidden, plans, bodies, hidden_sizes(kind, hidden, size))
    rng = generator(seed, "recording", kind, "noise")
    sigma_q, sigma_v = np.array(header.sigmas)
    driven = len(header.mechanism.torques)
    tables = []
    for i, record in enumerate(records):
        q = record.q + sigma_q * rng.standard_normal(record.q.shape)
        v = record.v + sigma_v * rng.standard_normal(record.v.shape)
        # a step's torque is in the row of the state before it; the last state has none
        u = np.vstack([record.f_ext[:, :driven], np.zeros((1, driven))])
        numbers = np.column_stack([np.full(len(q), i), record.t, q, v, u])
        tables.append(pd.DataFrame(numbers, columns=list(header.columns)).astype({"trial": int}))
    return Recording(name, header, pd.concat(tables, ignore_index=True))


def recording_header(kind: MechanismKind, bodies: Chapter2Bodies) -> RecordingHeader:
    """The header of a time-stepping simulation of `bodies`."""
    section, believed = (Arm, bodies.arm) if kind == "arm" else (Wheel, bodies.wheel)
    mechanism = {name: getattr(believed, name) for name in section.model_fields if hasattr(believed, name)}
    if kind == "wheel":
        mechanism["payload_radius"] = HiddenSizes().payload_radius
    return RecordingHeader.model_validate(
        {
            "schema": 1,
            "description": DESCRIPTION.format(kind=kind),
            "mechanism": {"kind": kind, **mechanism},
            "gravity": bodies.gravity,
            "rate": 1.0 / bodies.h,
            "noise": NOISE,
            "sampling": Sampling(velocities="time_stepping"),
        }
    )


def hidden_sizes(kind: MechanismKind, hidden: str, size: float | None) -> HiddenSizes:
    """Default sizes, with `size` for the cause; UserError if it is not possible."""
    if size is None or hidden not in TRUTHS[kind]:  # `run_with` refuses unknown causes
        return HiddenSizes()
    key = SIZE_OF.get((kind, hidden))
    if key is None:
        raise UserError("--size has no meaning with --hidden nothing; leave it out.")
    try:
        return HiddenSizes.model_validate({key: (size, size) if key in ("viscous", "coulomb") else size})
    except ValidationError as error:
        meaning = HiddenSizes.model_fields[key].description
        raise UserError(
            f"A size of {size:g} is not possible for {hidden} ({meaning}): {error.errors()[0]['msg']}."
        ) from error


def hidden_text() -> str:
    """A line per cause that can be hidden in each mechanism, with its default size and meaning."""
    lines = []
    for kind, truths in TRUTHS.items():
        lines.append(f"\n  --mechanism {kind}:")
        for truth in truths:
            key = SIZE_OF.get((kind, truth))
            field = HiddenSizes.model_fields[key] if key else None
            size = "" if field is None else f"{field.default}".strip("()").replace(", ", "; ")
            meaning = "a mechanism that is what recording.yaml says" if field is None else field.description
            lines.append(f"  {truth:<22}  {size:<10} {meaning}")
    return "\n".join(lines)
