"""The contracts of effects and laws, held against what a file or a package brings."""

from collections.abc import Iterator

from thesis_lib.extensions import effect_contract, law_contract
from thesis_lib.extensions.contract import CheckResult, outcomes
from thesis_lib.extensions.registry import Loaded


def results(loaded: Loaded, described: bool = True) -> Iterator[tuple[str, str, list[CheckResult]]]:
    """Kind, name and outcomes of each effect and law; `described`: look also at what is said of them."""
    for effect in loaded.effects:
        checks = [check for check in effect_contract.checks_of(effect) if described or not check.describes]
        yield "effect", effect.name, outcomes(checks, effect)
    for law in loaded.laws:
        yield "law", law.name, outcomes(law_contract.checks_of(law), law)
