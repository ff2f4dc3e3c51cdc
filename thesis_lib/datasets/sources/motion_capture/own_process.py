"""Arrays that a program reads from a file in a process of its own: what a damaged file does there does no harm here."""

import io
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

LONGEST = 600.0  # s that reading may take


def arrays_of(program: str, *arguments: str, names: Sequence[str] = ()) -> dict[str, np.ndarray]:
    """The arrays that `program`, a module beside this one, writes to its standard output as .npz.

    Args:
        arguments: of its command line.
        names: lines of its standard input.

    Raises:
        ValueError: it fails; says why.
    """
    path = Path(__file__).with_name(f"{program}.py")
    try:
        # -P: no module beside the program stands in for one of Python's
        done = subprocess.run(
            [sys.executable, "-P", str(path), *arguments],
            input="\n".join(names).encode(),
            capture_output=True,
            timeout=LONGEST,
            check=False,
        )
    except subprocess.TimeoutExpired as error:
        raise ValueError(f"reading it takes more than {LONGEST:.0f} s") from error
    if done.returncode:
        said = done.stderr.decode("utf-8", "replace").strip().splitlines() if done.returncode > 0 else []
        raise ValueError(said[-1][:300] if said else "what it says of its size contradicts itself")
    try:
        with np.load(io.BytesIO(done.stdout), allow_pickle=False) as file:
            return {name: file[name] for name in file.files}
    except (ValueError, OSError, KeyError, EOFError) as error:
        raise ValueError(str(error)) from error
