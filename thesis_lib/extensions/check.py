"""The contracts of effects and laws, held against what a file or a package brings."""

from collections.abc import Iterator

from thesis_lib.extensions.contract import CheckResult, outcomes
from thesis_lib.extensions.effect_contract import EFFECT_CHECKS
from thesis_lib.extensions.law_contract import checks_of
from thesis_lib.extensions.registry import Loaded


def results(loaded: Loaded, described: bool = True) -> Iterator[tuple[str, str, list[CheckResult]]]:
    """Kind, name and outcomes of each effect and law; `described`: look also at what is said of them."""
    effect_checks = [check for check in EFFECT_CHECKS if described or not check.describes]
    for effect in loaded.effects:
        yield "effect", effect.name, outcomes(effect_checks, effect)
    for law in loaded.laws:
        yield "law", law.name, outcomes(checks_of(law), law)
