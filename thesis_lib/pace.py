"""Pace of this machine: CPU time of a fixed piece of work, against that of the machine where the jobs were measured.

The work is of the kinds that most jobs consist of: steps of Python, operations on short arrays and on long ones.  It
takes a second or two, and tells machines apart that differ by a factor of two, not by a tenth.
"""

import time

REPEATED = 30  # the quickest counts: others were disturbed


def pace_s() -> float:
    """CPU time of the work here, s."""
    return min(_work() for _ in range(REPEATED))


def _work() -> float:
    import numpy as np

    begin = time.process_time()
    total = 0
    for i in range(70_000):
        total += i * i % 7
    short, long = np.linspace(0.1, 1.0, 30), np.linspace(-1.0, 0.0, 100_000)
    for _ in range(3_000):
        short = np.sqrt(short * short + 1e-3)
    for _ in range(15):
        np.exp(long).sum()
    return time.process_time() - begin
