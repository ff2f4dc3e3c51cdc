"""The same work on each of several items, shared by processes that are forked from this one.

A forked process has all data of this one, so that nothing is sent to it; only results are sent back.  The first items
are done here: all processes can use what these load or compile, and short work is done before a fork would begin.
"""

import os
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from contextvars import ContextVar
from multiprocessing import get_context
from time import perf_counter
from typing import Any, TypeVar

from thesis_lib.foundation.errors import UserError

T = TypeVar("T")
R = TypeVar("R")

MOST = 16  # largest default number of processes: each takes some 100 MB, and some 40 items come at once
WORTH = 0.3  # s of work that is done here first; to fork two processes and to end them takes 0.1 s
LONG = 1.0  # s for the first item, above which the next call with this work forks at once
_long: set[str] = set()
_jobs: ContextVar[int] = ContextVar("jobs", default=1)
_task: tuple[Callable[[Any], Any], Sequence[Any]] | None = None  # of a forked process; None in the first one


@contextmanager
def sharing(jobs: int) -> Iterator[None]:
    """Let `each` share its work among up to `jobs` processes."""
    token = _jobs.set(jobs)
    try:
        yield
    finally:
        _jobs.reset(token)


def cores() -> int:
    """Number of cores that this process may use; 1 where a fork is not safe, as on macOS, or not known."""
    return len(os.sched_getaffinity(0)) if sys.platform == "linux" else 1


def processes() -> int:
    """Number of processes that share the work here: 1 in a forked process, and by default."""
    return 1 if _task is not None else _jobs.get()


def each(work: Callable[[T], R], items: Sequence[T]) -> list[R]:
    """Results of `work` for each item, in their order, by `processes()` processes that end with this call.

    The results are equal for any number of processes if no call of `work` depends on an earlier one; changes of state
    in a forked process are lost.

    UserError if a process was killed, as happens if memory runs out.
    """
    jobs = min(processes(), len(items))
    if jobs < 2:
        return [work(item) for item in items]
    done: list[R] = []
    if work.__qualname__ not in _long:
        began = perf_counter()
        while len(done) < len(items) and perf_counter() - began < WORTH:
            done.append(work(items[len(done)]))
        if len(done) == 1 and perf_counter() - began > LONG:
            _long.add(work.__qualname__)
    rest = items[len(done) :]
    jobs = min(jobs, len(rest))
    if jobs < 2:
        return [*done, *map(work, rest)]
    context = get_context("fork")  # with other methods all data would have to be sent
    try:
        with ProcessPoolExecutor(jobs, context, _begin, (work, rest)) as pool:
            return [*done, *pool.map(_answer, range(len(rest)))]
    except BrokenProcessPool:
        raise UserError(
            f"One of {jobs} processes was killed, probably for lack of memory. Use fewer processes: --jobs 1."
        ) from None


def _begin(work: Callable[[Any], Any], items: Sequence[Any]) -> None:
    global _task
    _task = work, items


def _answer(i: int) -> Any:
    if _task is None:
        raise RuntimeError("This is not a forked process.")
    work, items = _task
    return work(items[i])
