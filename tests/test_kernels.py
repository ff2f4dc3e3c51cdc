"""Numerical kernels are the same on every machine that has them, and what a user has set stays."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from thesis_lib.foundation import kernels

ROOT = Path(__file__).resolve().parent.parent
ASK = """
import thesis_lib
import numpy as np
from threadpoolctl import threadpool_info
print(*[pool["architecture"] for pool in threadpool_info() if pool["user_api"] == "blas"])
"""


@pytest.fixture
def untouched(monkeypatch):
    for name in kernels.KERNELS:
        monkeypatch.delenv(name, raising=False)


def test_a_process_gets_the_kernels_for_avx2(untouched):
    if "avx2" not in kernels.processor()["vector"]:
        pytest.skip("this processor has no AVX2")
    done = subprocess.run([sys.executable, "-c", ASK], cwd=ROOT, capture_output=True, text=True, check=True)
    assert set(done.stdout.split()) == {"Haswell"} and done.stderr == ""


def test_a_processor_without_avx2_keeps_its_own(untouched, monkeypatch):
    monkeypatch.setattr(kernels, "processor", lambda: {"model": "old", "vector": ["sse4_2"]})
    kernels.use_common_kernels()
    assert not set(kernels.KERNELS) & set(os.environ)


def test_what_is_set_stays(untouched, monkeypatch):
    monkeypatch.setenv("OPENBLAS_CORETYPE", "Nehalem")
    kernels.use_common_kernels()
    assert os.environ["OPENBLAS_CORETYPE"] == "Nehalem"


def test_what_a_processor_says_of_itself(tmp_path):
    lines = "processor\t: 0\nmodel name\t: A 1\nflags\t\t: fpu avx2 fma sse4_2 x\n"
    (tmp_path / "cpuinfo").write_text(2 * lines)
    assert kernels.processor(tmp_path / "cpuinfo") == {"model": "A 1", "vector": ["avx2", "fma", "sse4_2"]}
    assert kernels.processor(tmp_path / "none")["model"]
