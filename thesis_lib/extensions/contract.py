"""Checks of a contract, and their results: `effect_contract` and `law_contract` hold the checks."""

import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Generic, Literal, TypeVar

import numpy as np

Checked = TypeVar("Checked")


@dataclass(frozen=True)
class Check(Generic[Checked]):
    """One thing that every effect, or every law, must do.

    Attributes:
        name: a few words, in which a reader recognises it.
        find: what is wrong with an effect or a law, in one sentence; "" if nothing is.
        describes: whether it is about what is said of the effect, not about what it computes.
    """

    name: str
    find: Callable[[Checked], str]
    describes: bool = False


@dataclass(frozen=True)
class CheckResult:
    """Result of a check: passed, failed or still to do, with the reason unless it passed."""

    check: str
    verdict: Literal["pass", "FAIL", "to do"]
    reason: str = ""


class NothingYet(Exception):
    """The remark of a check that cannot be made on an effect that changes nothing."""


def outcomes(checks: Sequence[Check[Checked]], checked: Checked) -> list[CheckResult]:
    """Result of each check; an error in a stranger's code is a failure with its file and line, no crash."""
    return [_outcome(check, checked) for check in checks]


def _outcome(check: Check[Checked], checked: Checked) -> CheckResult:
    try:
        with np.errstate(all="ignore"):  # what is not finite is found by the checks
            reason = check.find(checked)
    except NothingYet as todo:
        return CheckResult(check.name, "to do", str(todo))
    except Exception as error:  # whatever the code of others raises
        return CheckResult(check.name, "FAIL", raised(error))
    return CheckResult(check.name, "FAIL" if reason else "pass", reason)


def raised(error: BaseException) -> str:
    """An error in words, with the line at which it came up."""
    said = f"{type(error).__name__}: {error}".rstrip(": ")
    if isinstance(error, SyntaxError):  # says where by itself
        return said
    frames = traceback.extract_tb(error.__traceback__)
    where = f" ({frames[-1].filename.rpartition('/')[2]}, line {frames[-1].lineno})" if frames else ""
    return said + where
