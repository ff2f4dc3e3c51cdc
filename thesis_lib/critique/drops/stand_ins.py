"""Effects that are, or may be, only proxies for another cause.

*Contradictions.*  The search uses drops only.  If dataset.yaml states how well inertia, size or centre of mass are
known without any drop (`Body.known`), an effect that contradicts this by

    N = √(Σ_i (p_i − p_0i)² / (σ_i² + σ²)),    p_0 the nulls, σ_i from the drops, σ as stated

standard errors, N > `contradicts`, is not the cause, however well it predicts.  If the data cannot tell it from an
effect that contradicts nothing, that effect may be the cause.  Otherwise the cause is unknown, and the verdict is
`unexplained`.  For a parameter that the drops only bound, p_i is the bound, with σ_i = 0, if it excludes the null, and
the null if it does not.

*Partial explanations.*  If structure is left, the cause is at least partly unknown, and an effect may only imitate it.
It is named as a cause only if the model explains at least the share `explains` of what exceeds the noise in one of the
errors that the effect lowers, on held-out trials:

    share = (e_base − e_model) / (e_base − noise)
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from thesis_lib.bodies.body import Body
from thesis_lib.critique.drops.judgement import Judgement, channel_is_material
from thesis_lib.critique.likelihood.channels import CHANNELS, IMPACT
from thesis_lib.critique.likelihood.fit import Fit
from thesis_lib.critique.selection.discovery import Step
from thesis_lib.critique.selection.settings import SearchSettings
from thesis_lib.effects import EFFECTS


@dataclass(frozen=True)
class StandIn:
    """Why an effect is not the cause: the property it contradicts, the standard errors, and other possible causes.

    Or why it may not be: the share of the error that the model `explains`, if more is left; None for a contradiction.
    """

    denies: str = ""
    standard_errors: float = 0.0
    instead: tuple[str, ...] = ()
    explains: float | None = None


def stand_ins(body: Body, steps: Sequence[Step], fitted: Fit, contradicts: float) -> dict[str, StandIn]:
    """Effects of the final model that differ from the known body by over `contradicts` standard errors, by name."""
    found = {}
    for step in steps:
        effect, known = step.effect, body.known(step.effect.denies)
        if known is None:
            continue
        errors = float(
            np.linalg.norm(
                [_off(fitted, f"{effect.name}.{p.name}", p.null, known) for p in fitted.model.parameters_of(effect)]
            )
        )
        if errors > contradicts:
            others = [name for name in step.alternatives if name in EFFECTS]
            instead = tuple(name for name in others if body.known(EFFECTS[name].denies) is None)
            found[effect.name] = StandIn(effect.denies, errors, instead)
    return found


def partial(
    steps: Sequence[Step],
    base: Judgement,
    final: Judgement,
    without: Mapping[str, Judgement],
    settings: SearchSettings,
    explains: float,
) -> dict[str, StandIn]:
    """Effects that lower only errors of which the final model explains less than the share `explains`, by name."""
    shares = {}
    for channel in CHANNELS:
        (before, floor), (after, _) = base.misfit(channel), final.misfit(channel)
        if before > floor:
            shares[channel] = max((before - after) / (before - floor), 0.0)
    found = {}
    for name in (step.effect.name for step in steps):
        lowered = [c for c in CHANNELS if channel_is_material(final, without[name], c, settings)] or [IMPACT.name]
        share = max(shares.get(channel, 1.0) for channel in lowered)
        if share < explains:
            found[name] = StandIn(explains=share)
    return found


def _off(fitted: Fit, name: str, null: float, known: float) -> float:
    """Standard errors between a parameter and its null, `known` the standard uncertainty of the null."""
    bound = fitted.bounds.get(name)
    if bound is None:
        return (fitted.values[name] - null) / np.hypot(fitted.std[name], known)
    beyond = bound.value - null if bound.kind == "lower" else null - bound.value
    return max(beyond, 0.0) / known
