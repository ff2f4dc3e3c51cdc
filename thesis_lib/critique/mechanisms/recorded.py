"""The critique of a recording: its header as a believed model, its samples as trials."""

from collections.abc import Sequence

import numpy as np

from thesis_lib.critique.mechanisms.critique import MechanismCritique, criticise_mechanism
from thesis_lib.critique.mechanisms.effects import ARM_EFFECTS, WHEEL_EFFECTS, MechanismEffect
from thesis_lib.critique.mechanisms.model import BelievedArm, BelievedModel, BelievedWheel
from thesis_lib.critique.mechanisms.settings import MechanismSettings
from thesis_lib.critique.mechanisms.windows import Trial
from thesis_lib.datasets.recordings.header import Arm, RecordingHeader
from thesis_lib.datasets.recordings.recording import Recording
from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.stepping.arm_disk import ArmDisk
from thesis_lib.simulate.stepping.rimless_wheel import RimlessWheel


def criticise_recording(
    recording: Recording,
    rng: np.random.Generator,
    *,
    effects: Sequence[str] | None = None,
    settings: MechanismSettings | None = None,
) -> MechanismCritique:
    """Criticise the believed model of a recording.

    Args:
        rng: splits the trials and draws null distributions.
        effects: names of the candidates; None: all of this mechanism.

    Raises:
        UserError: too few trials, no usable window, or an unknown effect.
    """
    h = recording.header
    candidates = _candidates(h.mechanism.kind, effects)
    return criticise_mechanism(trials_of(recording), believed_model(h), candidates, rng, settings)


def believed_model(header: RecordingHeader) -> BelievedModel:
    """Believed model of the arm or wheel that the header describes."""
    m, g = header.mechanism, header.gravity
    if isinstance(m, Arm):
        links = (m.link_lengths, m.link_masses, m.link_coms, m.link_inertias)
        return BelievedArm(ArmDisk(*links, m.disk_radius, m.disk_mass, m.disk_inertia, g, m.base))
    wheel = RimlessWheel(m.spokes, m.length, m.mass, m.inertia, m.slope, g)
    return BelievedWheel(wheel, m.payload_radius)


def trials_of(recording: Recording) -> tuple[Trial, ...]:
    """Trials in the order of their numbers."""
    h, m = recording.header, recording.header.mechanism
    trials = []
    for _, samples in recording.states.groupby("trial"):
        f_ext = np.zeros((len(samples) - 1, len(m.coordinates)))
        f_ext[:, : len(m.torques)] = samples[list(m.torques)].to_numpy(float)[:-1]
        q, v = (samples[list(names)].to_numpy(float) for names in (m.coordinates, m.velocities))
        trials.append(Trial(1.0 / h.rate, q, v, f_ext, np.array(h.sigmas)))
    return tuple(trials)


def _candidates(kind: str, names: Sequence[str] | None) -> tuple[MechanismEffect, ...]:
    library = {e.name: e for e in (ARM_EFFECTS if kind == "arm" else WHEEL_EFFECTS)}
    for name in names or ():
        if name not in library:
            raise UserError(f"There is no effect {name!r} of the {kind}; known are {', '.join(library)}.")
    return tuple(library.values() if names is None else (library[name] for name in names))
