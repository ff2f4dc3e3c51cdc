"""Keep byte code between the jobs of a run.

With PYTHONDONTWRITEBYTECODE set, as in many containers, each job would compile all its imports anew, among them pandas,
torch and SciPy: for most jobs of the quick scale this takes longer than their work.
"""

import os
import sys


def keep_byte_code() -> None:
    """Let this process and its children write byte code; if the folders are read-only, Python continues without it."""
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    sys.dont_write_bytecode = False
