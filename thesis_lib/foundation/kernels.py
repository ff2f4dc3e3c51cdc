"""The same numerical kernels on every machine.

BLAS, NumPy and torch choose their kernels by the processor, which affects the last digits of sums.  A throw of a die
doubles a difference at every contact, so that a figure stored on one machine would not be reproduced on another.
Every x86-64 processor with AVX2 therefore gets kernels for AVX2; all others keep theirs.
"""

import os
import platform
import re
from pathlib import Path

VECTOR = {"sse4_2", "avx", "avx2", "fma", "avx512f", "avx512bw"}  # instructions by which BLAS and torch choose
KERNELS = {
    "OPENBLAS_CORETYPE": "Haswell",
    "NPY_DISABLE_CPU_FEATURES": "X86_V4 AVX512_ICL AVX512_SPR",
    "ATEN_CPU_CAPABILITY": "avx2",
    "MKL_CBWR": "COMPATIBLE",
}


def use_common_kernels() -> None:
    """Set the common kernels for this process and its children, unless set already.

    `import thesis_lib` calls it.  NumPy reads them on import: packages that were imported before keep their kernels.
    """
    if {"avx2", "fma"} <= set(processor()["vector"]):
        for name, value in KERNELS.items():
            os.environ.setdefault(name, value)


def processor(file: Path = Path("/proc/cpuinfo")) -> dict:
    """`model` of the processor and its `vector` instructions, as far as the system (Linux: `file`) reports them."""
    try:
        text = file.read_text(encoding="utf-8")
    except OSError:
        return {"model": platform.processor() or platform.machine(), "vector": []}
    values = dict(re.findall(r"^(model name|flags)\s*:\s*(.*)$", text, re.MULTILINE))
    return {
        "model": values.get("model name", platform.machine()),
        "vector": sorted(VECTOR & set(values.get("flags", "").split())),
    }
