"""Which effect a mechanism's believed model lacks: the critique of residual generalised forces.

The whitened window equations z (`windows`) are unit noise if the model holds.  Trials are split once: the held-out ones
are seen by no choice.  On the others the search of `critique.selection` chooses among the candidates.  The misfit is
the root mean square of z, 1 if noise alone is left.

The verdict is `unexplained` if the held-out misfit of the final model stays beyond noise, significantly by the χ²
distribution of |z|² and by an amount that matters; `dependence` then says what the rest depends on.

The noise enters the columns, too (errors in variables), to second order only: the misfit after the fit would show it.

| on paper | in code  | unit  | shape | meaning                              |
|----------|----------|-------|-------|--------------------------------------|
| z        | `z`      | 1     | (N,)  | whitened residual generalised forces |
| rms z    | `ladder` | sigma |       | misfit                               |
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2

from thesis_lib.critique.mechanisms.dependence import dependence
from thesis_lib.critique.mechanisms.effects import MechanismEffect
from thesis_lib.critique.mechanisms.fit import ForceFit
from thesis_lib.critique.mechanisms.model import BelievedModel
from thesis_lib.critique.mechanisms.settings import MechanismSettings
from thesis_lib.critique.mechanisms.windows import Trial, WeakForm
from thesis_lib.critique.mechanisms.world import ForceJudgement, Windows
from thesis_lib.critique.selection.remaining import Remaining
from thesis_lib.critique.selection.search import Discovery, Step, judge_held_out, paired_gain, search, split
from thesis_lib.foundation.errors import UserError

GROUP = 3  # most members of a group that counts as an answer
MIN_TRIALS = 4

ForceStep = Step[MechanismEffect, ForceFit, ForceJudgement]
ForceDiscovery = Discovery[MechanismEffect, ForceFit, ForceJudgement]


@dataclass(frozen=True)
class MechanismCritique:
    """Everything that the critique found of one mechanism.

    Attributes:
        model: as believed; settings: how it was criticised; candidates: all that were tried.
        training, held_out: window equations.
        discovery: effects, chosen on training trials.
        ladder: held-out misfit (rms of z, low, high) after 0, 1, ... effects.
        gains: by effect, held-out gain of the final model over the one without it, nats a window with 95 % interval.
        remaining: misfit on held-out trials, and what it depends on, on training trials.
        is_structured: whether it matters, also after an effect too small to be named.
    """

    model: BelievedModel
    settings: MechanismSettings
    candidates: tuple[MechanismEffect, ...]
    training: WeakForm
    held_out: WeakForm
    discovery: ForceDiscovery
    ladder: tuple[tuple[float, float, float], ...]
    gains: dict[str, tuple[float, float, float]]
    remaining: Remaining
    is_structured: bool

    @property
    def verdict(self) -> str:
        """adequate, effects or unexplained, as in diagnosis.json."""
        return self.discovery.verdict(self.is_structured)

    @property
    def steps(self) -> tuple[ForceStep, ...]:
        """Effects in the order of selection."""
        return self.discovery.steps

    @property
    def fitted(self) -> ForceFit:
        """The final model on training trials."""
        return self.discovery.fitted

    @property
    def below(self) -> str:
        """Name of an effect that is significant but too small to matter; '' if there is none."""
        return self.discovery.below.effects[-1].name if self.discovery.below else ""

    @property
    def found(self) -> tuple[str, ...]:
        """The first effect and those that the data cannot tell from it; empty where nothing was found."""
        return (self.steps[0].effect.name, *self.steps[0].alternatives) if self.steps else ()


def criticise_mechanism(
    trials: Sequence[Trial],
    model: BelievedModel,
    candidates: Sequence[MechanismEffect],
    rng: np.random.Generator,
    settings: MechanismSettings | None = None,
) -> MechanismCritique:
    """Criticise the believed model of a mechanism with measured trials.

    Args:
        trials: measured motion, all of one mechanism and one time step.
        model: as believed.
        candidates: effects that may be missing.
        rng: splits the trials and draws null distributions.
        settings: thresholds.

    Raises:
        UserError: there are fewer than four trials, or no window can be used.
    """
    settings = settings or MechanismSettings()
    thresholds, draws = settings.thresholds, settings.resamples
    if len(trials) < MIN_TRIALS:
        raise UserError(
            f"The critique of a mechanism needs {MIN_TRIALS} trials or more to hold some out; got {len(trials)}."
        )
    if len({t.h for t in trials}) > 1:
        raise UserError(
            "The trials of one critique share a time step; resample them or criticise them apart."
        )
    kept, unseen = split(np.arange(len(trials)), thresholds.held_out_share, rng)
    held_out, training = (
        Windows(WeakForm([trials[i] for i in part], model, settings.windows), candidates, draws)
        for part in (unseen, kept)
    )
    discovery = search(training, thresholds, rng)

    judged, without = judge_held_out(training, held_out, discovery)
    last = judged[-1][2]
    ladder = [judged[0][2].misfit_interval(draws, rng)]
    gains = {}
    for name, _, judgement in judged[1:]:
        gains[name] = paired_gain(last, without[name], rng, draws)
        ladder.append(judgement.misfit_interval(draws, rng))
    remaining = beyond_noise(last)
    is_structured = remaining.is_structured(thresholds, 1.0)
    if discovery.below:
        # a named effect that explains it all, if too small a one to matter, leaves nothing unexplained
        with_it = beyond_noise(held_out.judge(discovery.below))
        is_structured = is_structured and with_it.is_structured(thresholds, 1.0)
    if is_structured:
        # a description of the whole, which needs many windows and chooses nothing
        depends_on, _ = dependence(training.weak, discovery.fitted.z, thresholds.alpha, rng)
        remaining = replace(remaining, depends_on=depends_on)
    return MechanismCritique(
        model,
        settings,
        tuple(candidates),
        training.weak,
        held_out.weak,
        discovery,
        tuple(ladder),
        gains,
        remaining,
        is_structured,
    )


def beyond_noise(judgement: ForceJudgement) -> Remaining:
    """The misfit beside that of noise alone, with the p-value of |z|² against its χ² distribution."""
    z = judgement.z
    return Remaining(float(chi2.sf(z @ z, len(z))), judgement.misfit, 1.0, ())


def smallest_sizes(critique: MechanismCritique) -> dict[str, dict[str, float]]:
    """Smallest size of each candidate's parameters that these trials would have shown, all else as found.

    A parameter x alone raises the log score by x² I / 2 and the mean square of z by x² I / N.
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
