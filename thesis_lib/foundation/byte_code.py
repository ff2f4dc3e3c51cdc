"""Byte code is kept between the jobs of a run.

Where PYTHONDONTWRITEBYTECODE is set, as in many containers, each job would compile all that it imports anew, pandas,
torch and SciPy among it: for most jobs of the quick scale that takes longer than their work.
"""

import os
import sys


def keep_byte_code() -> None:
    """Let this process and its children write byte code; where the folders are read-only, Python goes on without."""
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    sys.dont_write_bytecode = False
