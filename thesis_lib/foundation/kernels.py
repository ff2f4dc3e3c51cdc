"""The same numerical kernels on every machine.

BLAS, NumPy and torch choose their kernels by the processor, and with them the last digits of sums.  A throw of a die
doubles a difference at every contact, so that a figure stored on one machine would not be reproduced on another.
Every x86-64 processor with AVX2 therefore gets kernels for AVX2; all others keep theirs.
"""

import os

from thesis_lib.foundation.provenance import processor

KERNELS = {
    "OPENBLAS_CORETYPE": "Haswell",
    "NPY_DISABLE_CPU_FEATURES": "X86_V4 AVX512_ICL AVX512_SPR",
    "ATEN_CPU_CAPABILITY": "avx2",
    "MKL_CBWR": "COMPATIBLE",
}


def use_common_kernels() -> None:
    """Set the common kernels for this process and its children, unless set already; call it before importing NumPy."""
    if {"avx2", "fma"} <= set(processor()["vector"]):
        for name, value in KERNELS.items():
            os.environ.setdefault(name, value)
