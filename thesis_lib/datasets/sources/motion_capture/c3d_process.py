"""Reads a C3D file with ezc3d and writes its arrays to standard output, as .npz: a program of its own.

ezc3d is C++ and trusts what a file says of itself: a damaged one ends the process that reads it, or never ends.
"""

import contextlib
import io
import os
import sys

import numpy as np

MEMORY = 8 << 30  # bytes of address space
SECONDS, BYTES_A_SECOND = 8, 5e5  # processor time for any file, and beyond that for its size; ten times the usual


def main(path: str) -> None:
    """Write points (3, m, n), their labels, rate and unit, rotations (4, 4, k, n), their labels and rate."""
    answer = os.dup(1)
    os.dup2(2, 1)  # what C++ says
    with contextlib.suppress(ImportError, ValueError, OSError):
        import resource

        limit = SECONDS + int(os.stat(path).st_size / BYTES_A_SECOND)  # noqa: PTH116
        resource.setrlimit(resource.RLIMIT_CPU, (limit, limit + 1))
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    from ezc3d import c3d

    file = c3d(path)
    groups, data = file["parameters"], file["data"]

    def texts(group: str, name: str) -> list[str]:
        # more than 255 labels go on in LABELS2, …
        found = [groups.get(group, {}).get(name + more, {}).get("value", []) for more in ("", *map(str, range(2, 20)))]
        return [str(text) for part in found for text in part]

    rates = [float(file["header"][of]["frame_rate"]) for of in ("points", "rotations")]
    content = io.BytesIO()
    np.savez(
        content,
        points=data["points"][:3],
        rotations=data["rotations"],
        labels=np.array(texts("POINT", "LABELS"), dtype=str),
        bodies=np.array(texts("ROTATION", "LABELS"), dtype=str),
        units=np.array(texts("POINT", "UNITS"), dtype=str),
        rates=np.array(rates),
    )
    with os.fdopen(answer, "wb") as out:
        out.write(content.getvalue())


if __name__ == "__main__":
    try:
        main(sys.argv[1])
    except Exception as error:
        sys.exit(str(error)[:200] or type(error).__name__)
