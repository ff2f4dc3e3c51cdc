"""Measured speed and accuracy, each as a ratio within one run: `make bench`, then `python -m benchmarks.table`."""

import os

# before numpy is imported: one core, whatever the number of threads it would take
for _variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_variable] = "1"
