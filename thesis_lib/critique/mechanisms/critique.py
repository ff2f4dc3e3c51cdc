"""Find the force that a mechanism's believed model lacks, from its residual generalised forces.

If the model holds, the whitened window equations z (N,) of `windows` are unit noise.  The misfit is the root mean
square of z, 1 for noise alone.  Trials are split once.  The search of `critique.selection` chooses effects on the
training trials; the held-out trials serve only to judge the result.

The verdict is `unexplained` if the held-out misfit of the final model exceeds noise significantly (χ² test of |z|²) and
by an amount that matters.  A permutation test finds the coordinates and velocities on which this misfit depends.  The
window means of each are divided into eight quantile cells; the strength of the dependence is the sum of squares of z
between cells, summed over the free coordinates,

    S = Σ_coordinates Σ_cells (Σ_cell z)² / n_cell.

The null permutes the windows.  Strengths are standardised by their null; p refers to the maximum over all of them.
The verdict is also `unexplained` if sensor errors would have to exceed those that the recording states (`sensors`).
Noise also enters the columns (errors in variables), but only to second order.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2

from thesis_lib.critique.mechanisms.effects import CANDIDATES, MechanismEffect
from thesis_lib.critique.mechanisms.model import BelievedArm, BelievedModel, BelievedWheel
from thesis_lib.critique.mechanisms.sensors import aligned, camera_delay, sensor_errors
from thesis_lib.critique.mechanisms.settings import MechanismSettings
from thesis_lib.critique.mechanisms.steps import Trial
from thesis_lib.critique.mechanisms.windows import WeakForm
from thesis_lib.critique.mechanisms.world import ForceFit, ForceJudgement, MechanismWorld, sensor_excess
from thesis_lib.critique.selection.discovery import Discovery, Step, judge_held_out, paired_gain
from thesis_lib.critique.selection.search import search, split
from thesis_lib.critique.selection.world import Remaining
from thesis_lib.datasets.recordings.header import Arm, RecordingHeader, Sampling
from thesis_lib.datasets.recordings.recording import Recording
from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.stepping.arm_disk import ArmDisk
from thesis_lib.simulate.stepping.rimless_wheel import RimlessWheel

GROUP = 3  # largest group of effects that counts as an answer
MIN_TRIALS = 4
CELLS = 8
PERMUTATIONS = 199


@dataclass(frozen=True)
class MechanismCritique:
    """Result of criticising one mechanism.

    Attributes:
        candidates: all effects that were tried.
        training, held_out: window equations of the training and the held-out trials.
        discovery: effects chosen on training trials.
        ladder: held-out misfit (rms of z, low, high) after 0, 1, ... effects.
        gains: by effect, held-out gain over the final model without it: nats per window with 95 % interval.
        remaining: misfit on held-out trials; the states on which it depends are found on training trials.
        is_structured: whether the remaining misfit is material, even with the effect `below` added, or sensors err
            materially more than stated.
        camera_delay: s, by which poses of the body were read later than the joints.
        sensor_excess: rms of the fitted sensor errors over the stated errors, and its p-value; 0 and 1 without any.
    """

    model: BelievedModel
    settings: MechanismSettings
    candidates: tuple[MechanismEffect, ...]
    training: WeakForm
    held_out: WeakForm
    discovery: Discovery[MechanismEffect, ForceFit, ForceJudgement]
    ladder: tuple[tuple[float, float, float], ...]
    gains: dict[str, tuple[float, float, float]]
    remaining: Remaining
    is_structured: bool
    camera_delay: float = 0.0
    sensor_excess: tuple[float, float] = (0.0, 1.0)

    @property
    def verdict(self) -> str:
        """Verdict of the critique: adequate, effects or unexplained."""
        return self.discovery.verdict(self.is_structured)

    @property
    def steps(self) -> tuple[Step[MechanismEffect, ForceFit, ForceJudgement], ...]:
        return self.discovery.steps

    @property
    def fitted(self) -> ForceFit:
        return self.discovery.fitted

    @property
    def below(self) -> str:
        """Name of the effect that is significant but too small to matter, or ''."""
        return self.discovery.below.effects[-1].name if self.discovery.below else ""

    @property
    def first_group(self) -> tuple[str, ...]:
        """Names of the first effect and its indistinguishable alternatives; empty if no effect was chosen."""
        return (self.steps[0].effect.name, *self.steps[0].alternatives) if self.steps else ()


def criticise_recording(
    recording: Recording, rng: np.random.Generator, *, effects: Sequence[str] | None = None
) -> MechanismCritique:
    """Criticise the believed model of a recording: the header describes the model, the samples are the trials.

    Args:
        rng: splits the trials and draws null distributions.
        effects: names of the candidates; None: all candidates for this mechanism.

    Raises:
        UserError: too few trials, no usable window, or an unknown effect.
    """
    kind = recording.header.mechanism.kind
    library = {e.name: e for e in CANDIDATES[kind]}
    for name in effects or ():
        if name not in library:
            raise UserError(f"There is no effect {name!r} of the {kind}; known are {', '.join(library)}.")
    candidates = [library[name] for name in (library if effects is None else effects)]
    model, sampling = believed_model(recording.header), recording.header.sampling
    return criticise_mechanism(trials_of(recording), model, candidates, rng, sampling=sampling)


def believed_model(header: RecordingHeader) -> BelievedModel:
    """Return the mechanism that recording.yaml describes."""
    m, g = header.mechanism, header.gravity
    if isinstance(m, Arm):
        links = (m.link_lengths, m.link_masses, m.link_coms, m.link_inertias)
        return BelievedArm(ArmDisk(*links, m.disk_radius, m.disk_mass, m.disk_inertia, g, m.base))
    return BelievedWheel(RimlessWheel(m.spokes, m.length, m.mass, m.inertia, m.slope, g), m.payload_radius)


def trials_of(recording: Recording) -> list[Trial]:
    """Return the trials of a recording, with the noise that the recording states."""
    h, m = recording.header, recording.header.mechanism
    trials = []
    for _, samples in recording.states.groupby("trial"):
        f_ext = np.zeros((len(samples) - 1, len(m.coordinates)))
        f_ext[:, : len(m.torques)] = samples[list(m.torques)].to_numpy(float)[:-1]
        q, v = (samples[list(names)].to_numpy(float) for names in (m.coordinates, m.velocities))
        noise, how = np.array(h.sigmas), h.sampling
        trials.append(Trial(1.0 / h.rate, q, v, f_ext, noise, how.velocities, how.jitter))
    return trials


def criticise_mechanism(
    trials: Sequence[Trial],
    model: BelievedModel,
    candidates: Sequence[MechanismEffect],
    rng: np.random.Generator,
    settings: MechanismSettings | None = None,
    sampling: Sampling | None = None,
) -> MechanismCritique:
    """Criticise the believed model of a mechanism with measured trials that share one time step.

    Args:
        candidates: effects that the model may lack.
        rng: splits the trials and draws null distributions.
        sampling: stated errors of clocks and torques; default: none.

    Raises:
        UserError: fewer than four trials, different time steps, or no usable window.
    """
    settings = settings or MechanismSettings()
    thresholds, draws = settings.thresholds, settings.resamples
    if len(trials) < MIN_TRIALS:
        raise UserError(
            f"The critique of a mechanism needs {MIN_TRIALS} trials or more to hold some out; got {len(trials)}."
        )
    if len({t.h for t in trials}) > 1:
        raise UserError("All trials of a critique must share one time step: resample or criticise them separately.")
    kept, unseen = split(np.arange(len(trials)), thresholds.held_out_share, rng)
    sampling = sampling or Sampling()
    sensors = sensor_errors(sampling, model.joints)
    late = camera_delay([trials[i] for i in kept], model, sampling.delay)
    held_out, training = (
        MechanismWorld(
            WeakForm(aligned([trials[i] for i in part], model, late), model, settings.windows),
            candidates,
            draws,
            sensors,
        )
        for part in (unseen, kept)
    )
    discovery = search(training, thresholds, rng)

    discovery, judged, without = judge_held_out(training, held_out, discovery, thresholds)
    last = judged[-1][2]
    ladder = [judged[0][2].misfit_interval(draws, rng)]
    gains = {}
    for name, _, judgement in judged[1:]:
        gains[name] = paired_gain(last, without[name], rng, draws)
        ladder.append(judgement.misfit_interval(draws, rng))
    remaining = _beyond_noise(last)
    is_structured = remaining.is_structured(thresholds, 1.0)
    if discovery.below:
        # an effect too small to matter may still explain all of the remaining misfit
        with_it = _beyond_noise(held_out.judge(discovery.below))
        is_structured = is_structured and with_it.is_structured(thresholds, 1.0)
    excess = sensor_excess(discovery.fitted)
    is_structured = is_structured or is_excess_material(*excess, settings)
    if is_structured:
        # on training trials, because the test needs many windows and makes no choice
        depends_on, _ = dependence(training.weak, discovery.fitted.z, thresholds.alpha, rng)
        remaining = replace(remaining, depends_on=depends_on)
    weak = (training.weak, held_out.weak)
    return MechanismCritique(
        *(model, settings, tuple(candidates), *weak, discovery, tuple(ladder), gains, remaining, is_structured),
        late,
        excess,
    )


def is_excess_material(excess: float, p_value: float, settings: MechanismSettings) -> bool:
    """Return whether sensor errors `excess` times as large as stated are significant and large enough to matter."""
    return p_value <= settings.thresholds.alpha and settings.thresholds.matters(excess, 1.0, 1.0)


def _beyond_noise(judgement: ForceJudgement) -> Remaining:
    """Return the misfit, to be compared with 1 for noise, with the p-value of |z|² from its χ² distribution."""
    z = judgement.z
    return Remaining(float(chi2.sf(z @ z, max(len(z), 1))), judgement.misfit, 1.0, ())


def states_of_windows(weak: WeakForm) -> tuple[list[str], np.ndarray]:
    """Return names of coordinates and velocities ("d" + name), and their means (windows, 2 nv) over each window."""
    states = np.concatenate([weak.motion.q, weak.motion.v], axis=1)
    names = [*weak.model.coordinates, *(f"d{name}" for name in weak.model.coordinates)]
    return names, np.add.reduceat(states, weak.starts, axis=0) / (weak.ends - weak.starts)[:, None]


def dependence(weak: WeakForm, z: np.ndarray, alpha: float, rng: np.random.Generator) -> tuple[tuple[str, ...], float]:
    """Return up to three coordinates or velocities ("d" + name) on which z (N,) depends, and the least p-value."""
    names, states = states_of_windows(weak)
    cells = np.stack([np.searchsorted(np.quantile(x, np.linspace(0, 1, CELLS + 1)[1:-1]), x) for x in states.T])
    rows = [np.flatnonzero(weak.coordinate == c) for c in np.unique(weak.coordinate)]

    def strengths(permuted: np.ndarray) -> np.ndarray:
        sums = np.zeros(len(cells))
        for r in rows:
            for j, cell in enumerate(cells[:, permuted[weak.window[r]]]):
                n = np.maximum(np.bincount(cell, minlength=CELLS), 1)
                sums[j] += np.sum(np.bincount(cell, z[r], minlength=CELLS) ** 2 / n)
        return sums

    measured = strengths(np.arange(len(states)))
    null = np.array([strengths(rng.permutation(len(states))) for _ in range(PERMUTATIONS)])
    # each strength is standardised by its null, so the maximum treats all states alike
    centre, width = null.mean(axis=0), null.std(axis=0)
    score, best = (measured - centre) / width, ((null - centre) / width).max(axis=1)
    p = (1 + (best[:, None] >= score).sum(axis=0)) / (1 + len(best))
    ranked = [int(j) for j in np.argsort(-score) if p[j] <= alpha]
    return tuple(names[j] for j in ranked[:3]), float(p.min())


def smallest_sizes(critique: MechanismCritique) -> dict[str, dict[str, float]]:
    """Return the smallest detectable size of each parameter of each candidate; inf without information.

    The other parameters stay as fitted.  x alone raises the log score by x² I / 2 and the mean square of z by x² I / N.
    """
    thresholds, tests = critique.settings.thresholds, critique.discovery.first_scan
    limit = float(np.quantile(tests.null, 1.0 - thresholds.alpha))
    material = ((1.0 + thresholds.material_floor) ** 2 - 1.0) * len(critique.training.trial)
    sizes = {}
    for e in critique.candidates:
        information = np.diag(tests.information[e.name])
        sizes[e.name] = {
            p.name: float(np.sqrt(max(2.0 * limit, material) / i)) if i > 0 else np.inf
            for p, i in zip(e.parameters, information)
        }
    return sizes
