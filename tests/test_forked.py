"""Work that is shared by forked processes."""

import os
import signal
import time

import numpy as np
import pytest

from thesis_lib.foundation import forked
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.forked import each, processes, sharing


@pytest.fixture
def at_once(monkeypatch):
    """Other processes begin with the first item."""
    monkeypatch.setattr(forked, "WORTH", 0.0)


@pytest.fixture
def patient(monkeypatch):
    """What is short, and what is long, is far from what a busy machine takes for nothing."""
    monkeypatch.setattr(forked, "WORTH", 10.0)
    monkeypatch.setattr(forked, "_long", set())


@pytest.mark.usefixtures("at_once")
def test_results_come_in_order_from_other_processes():
    data = np.arange(5.0)  # known after the fork, and never sent
    with sharing(2):
        found = each(lambda i: (os.getpid(), data[i] ** 2), range(5))
    assert [square for _, square in found] == [0.0, 1.0, 4.0, 9.0, 16.0]
    assert os.getpid() not in {pid for pid, _ in found}


@pytest.mark.parametrize(("items", "jobs"), [(range(3), 1), (range(1), 4), ([], 4)])
def test_what_one_process_does_stays_here(items, jobs):
    with sharing(jobs):
        assert each(lambda i: (i, os.getpid()), items) == [(i, os.getpid()) for i in items]


@pytest.mark.usefixtures("at_once")
def test_a_forked_process_forks_no_further():
    assert processes() == 1
    with sharing(2):
        assert processes() == 2
        inner = each(lambda _: [os.getpid(), *each(lambda _: os.getpid(), range(3))], range(2))
        assert each(lambda _: processes(), range(2)) == [1, 1]
    assert all(len(set(pids)) == 1 for pids in inner) and processes() == 1


@pytest.mark.usefixtures("at_once")
def test_an_error_is_raised_here():
    def fail(i: int) -> int:
        raise UserError(f"item {i} is wrong")

    with sharing(2), pytest.raises(UserError, match="item 0 is wrong"):
        each(fail, range(4))


@pytest.mark.usefixtures("at_once")
def test_a_process_that_is_killed_is_an_error_with_a_way_out():
    with sharing(2), pytest.raises(UserError, match="--jobs 1"):
        each(lambda i: os.kill(os.getpid(), signal.SIGKILL), range(4))


@pytest.mark.usefixtures("patient")
def test_short_work_stays_here():
    with sharing(4):
        assert each(lambda i: (i, os.getpid()), range(50)) == [(i, os.getpid()) for i in range(50)]


@pytest.mark.usefixtures("patient")
def test_the_first_item_of_long_work_is_done_here_and_next_time_none(monkeypatch):
    def work(i: int) -> tuple[int, bool]:
        time.sleep(0.02)
        return i, os.getpid() == here

    here = os.getpid()
    monkeypatch.setattr(forked, "WORTH", 0.01)
    monkeypatch.setattr(forked, "LONG", 0.01)
    with sharing(2):
        assert each(work, range(3)) == [(0, True), (1, False), (2, False)]
        assert each(work, range(3)) == [(0, False), (1, False), (2, False)]
