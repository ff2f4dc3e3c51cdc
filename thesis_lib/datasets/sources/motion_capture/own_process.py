"""Reading arrays from files in a separate process, where a damaged file can do no harm to this one.

ezc3d is C++ and trusts the sizes stated in a file: a damaged file may end the process that reads it, or keep it running
for ever.  A file of torch tensors states their sizes, too, which may be anything in a damaged file; only tensors are
created (`weights_only`), no other objects that a file may hold.  This module is also the program of that process: it
reads the files named on its standard input, and writes their arrays to its standard output as .npz.
"""

import contextlib
import io
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

LONGEST = 600.0  # s that reading may take
# processor time in s for any files, bytes that take one more s, and bytes of address space; ten times the usual
OF_C3D = 8, 5e5, 8 << 30
OF_TENSORS = 60, 1e6, 16 << 30


def arrays_of(form: str, paths: Sequence[Path]) -> dict[str, np.ndarray]:
    """The arrays in files, as `_of_c3d` ("c3d") or `_of_tensors` ("tensors") returns them.

    Raises:
        ValueError: reading fails; the text gives the reason.
    """
    try:
        # -P: no module beside the program replaces one of Python's
        done = subprocess.run(
            [sys.executable, "-P", __file__, form],
            input=os.fsencode("\0".join(str(path.resolve()) for path in paths)),
            capture_output=True,
            timeout=LONGEST,
            check=False,
        )
    except subprocess.TimeoutExpired as error:
        raise ValueError(f"reading it takes more than {LONGEST:.0f} s") from error
    if done.returncode:
        said = done.stderr.decode("utf-8", "replace").strip().splitlines() if done.returncode > 0 else []
        raise ValueError(said[-1][:300] if said else "the sizes that it states contradict each other")
    try:
        with np.load(io.BytesIO(done.stdout), allow_pickle=False) as file:
            return {name: file[name] for name in file.files}
    except (ValueError, OSError, KeyError, EOFError) as error:
        raise ValueError(str(error)) from error


def _of_c3d(paths: Sequence[str]) -> dict[str, np.ndarray]:
    """Points (3, m, n) of a file, their labels, rate and unit, rotations (4, 4, k, n), their labels and rate."""
    from ezc3d import c3d

    _limit(paths, *OF_C3D)
    file = c3d(paths[0])
    groups, data = file["parameters"], file["data"]

    def texts(group: str, name: str) -> np.ndarray:
        # more than 255 labels go on in LABELS2, …
        found = [groups.get(group, {}).get(name + more, {}).get("value", []) for more in ("", *map(str, range(2, 20)))]
        return np.array([str(text) for part in found for text in part], dtype=str)

    return {
        "points": data["points"][:3],
        "rotations": data["rotations"],
        "labels": texts("POINT", "LABELS"),
        "bodies": texts("ROTATION", "LABELS"),
        "units": texts("POINT", "UNITS"),
        "rates": np.array([float(file["header"][of]["frame_rate"]) for of in ("points", "rotations")]),
    }


def _of_tensors(paths: Sequence[str]) -> dict[str, np.ndarray]:
    """The tensor of each file, in order, named 0, 1, …"""
    import torch

    _limit(paths, *OF_TENSORS)
    arrays = {}
    for i, path in enumerate(paths):
        try:
            held = torch.load(path, map_location="cpu", weights_only=True)
        except Exception as error:  # errors of many kinds
            first = (str(error).strip().splitlines() or [""])[0][:100]
            sys.exit(f"{Path(path).name}: {first or type(error).__name__}")
        if not isinstance(held, torch.Tensor):
            sys.exit(f"{Path(path).name}: it holds a {type(held).__name__}, not a tensor")
        arrays[str(i)] = held.detach().to_dense().to(torch.float64).numpy()
    return arrays


def _limit(paths: Sequence[str], seconds: int, bytes_a_second: float, memory: int) -> None:
    """Limit the processor time and memory of this process, if the system supports limits."""
    with contextlib.suppress(ImportError, ValueError, OSError):
        import resource

        limit = seconds + int(sum(Path(path).stat().st_size for path in paths) / bytes_a_second)
        resource.setrlimit(resource.RLIMIT_CPU, (limit, limit + 1))
        resource.setrlimit(resource.RLIMIT_AS, (memory, memory))


def main(form: str) -> None:
    """Write the arrays of the files; anything that a library prints goes to standard error."""
    answer = os.dup(1)
    os.dup2(2, 1)
    content = io.BytesIO()
    paths = os.fsdecode(sys.stdin.buffer.read()).split("\0")
    np.savez(content, **{"c3d": _of_c3d, "tensors": _of_tensors}[form](paths))  # pyright: ignore[reportArgumentType]
    with os.fdopen(answer, "wb") as out:
        out.write(content.getvalue())


if __name__ == "__main__":
    try:
        main(sys.argv[1])
    except Exception as error:
        sys.exit(str(error)[:200] or type(error).__name__)
