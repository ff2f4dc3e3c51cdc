"""What the benchmarks compute from times and errors, on cases whose answer is known."""

import base64
import json

import numpy as np
import pytest

from benchmarks.growth import sizes
from benchmarks.hidden_effects import is_drag
from benchmarks.pipeline import Job, critical_path, least_time, read_jobs
from benchmarks.results import exponent

ROUNDING = 1e-9


def job(rule, start, seconds, inputs=(), outputs=()):
    return Job(rule, start, start + seconds, frozenset(inputs), frozenset(outputs))


DIAMOND = [
    job("a", 0.0, 2.0, outputs=["a1", "a2"]),
    job("b", 2.0, 3.0, ["a1", "given"], ["b"]),
    job("c", 2.0, 7.0, ["a2"], ["c"]),
    job("d", 9.0, 1.0, ["b", "c"]),
]


def test_critical_path_is_the_longest_chain():
    assert critical_path(DIAMOND) == pytest.approx(10.0, abs=ROUNDING)
    assert critical_path(DIAMOND[1:]) == pytest.approx(8.0, abs=ROUNDING)
    assert critical_path([]) == 0.0


def test_least_time_is_the_longer_of_path_and_share():
    assert least_time(DIAMOND, 2) == pytest.approx(10.0, abs=ROUNDING)
    assert least_time(DIAMOND, 1) == pytest.approx(13.0, abs=ROUNDING)


def test_records_of_one_job_are_joined(tmp_path):
    folder = tmp_path / ".snakemake/metadata"
    folder.mkdir(parents=True)
    for output, log, start in (("x.csv", "one", 5.0), ("y.csv", "one", 5.0), ("x2.csv", "two", 8.0)):
        record = {"rule": "make", "log": [log], "input": ["in"], "starttime": start, "endtime": start + 2.0}
        name = base64.b64encode(output.encode()).decode()
        (folder / name).write_text(json.dumps(record))
    jobs = sorted(read_jobs(tmp_path), key=lambda one: one.start)
    assert [sorted(one.outputs) for one in jobs] == [["x.csv", "y.csv"], ["x2.csv"]]
    assert [one.seconds for one in jobs] == [2.0, 2.0]


def test_exponent_of_a_known_power():
    n = np.array([100.0, 1000.0, 10_000.0, 100_000.0])
    p, half = exponent(n, 3.0 * n**1.2)
    assert p == pytest.approx(1.2, abs=ROUNDING) and half < ROUNDING
    _, wide = exponent(n, 3.0 * n**1.2 * np.array([1.0, 1.1, 0.9, 1.0]))
    assert wide > 0.02


def test_sizes_go_up_to_the_largest():
    assert sizes(10_000) == [100, 316, 1000, 3162, 10_000]


def test_drag_is_told_from_other_sparse_models():
    spin = {"v_y": 0.2}
    assert is_drag(({"v_x": -0.9}, {"v_y": -0.8}, spin))
    assert not is_drag(({"v_x": 0.9}, {"v_y": -0.8}, spin))
    assert not is_drag(({"v_x": -0.9, "v_x^2": 0.1}, {"v_y": -0.8}, spin))
    assert not is_drag(({}, {"v_y": -0.8}, spin))
