"""Types for the checks of a contract and their results; the checks are in `effect_contract` and `law_contract`."""

import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Generic, Literal, TypeVar

import numpy as np

Checked = TypeVar("Checked")


@dataclass(frozen=True)
class Check(Generic[Checked]):
    """One requirement on every effect, or on every law.

    Attributes:
        name: a short phrase that describes the requirement.
        find: function that returns the fault of an effect or a law in one sentence; "" if there is none.
        describes: whether it concerns the documentation of the effect, not its computation.
    """

    name: str
    find: Callable[[Checked], str]
    describes: bool = False


@dataclass(frozen=True)
class CheckResult:
    """Result of a check: passed, failed, or not yet possible, with the reason unless it passed."""

    check: str
    verdict: Literal["pass", "FAIL", "to do"]
    reason: str = ""


class NothingYet(Exception):
    """Raised by a check that is impossible because the effect does not change anything yet."""


def outcomes(checks: Sequence[Check[Checked]], checked: Checked) -> list[CheckResult]:
    """Result of each check; an error in the checked code is a failure with its file and line, not a crash."""
    return [_outcome(check, checked) for check in checks]


def _outcome(check: Check[Checked], checked: Checked) -> CheckResult:
    try:
        with np.errstate(all="ignore"):  # the checks find values that are not finite
            reason = check.find(checked)
    except NothingYet as todo:
        return CheckResult(check.name, "to do", str(todo))
    except Exception as error:  # user-defined code can raise anything
        return CheckResult(check.name, "FAIL", raised(error))
    return CheckResult(check.name, "FAIL" if reason else "pass", reason)


def raised(error: BaseException) -> str:
    """Text of an error, with the file and line that raised it."""
    said = f"{type(error).__name__}: {error}".rstrip(": ")
    if isinstance(error, SyntaxError):  # its text contains file and line
        return said
    frames = traceback.extract_tb(error.__traceback__)
    where = f" ({frames[-1].filename.rpartition('/')[2]}, line {frames[-1].lineno})" if frames else ""
    return said + where
