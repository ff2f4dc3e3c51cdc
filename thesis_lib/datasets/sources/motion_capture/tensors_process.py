"""Reads files of torch tensors, named on standard input, and writes them to standard output as .npz: a program.

A file says how large its tensors are, and a damaged one says anything.  Only tensors are made (`weights_only`), no
other object that a file may hold.
"""

import contextlib
import io
import os
import sys

import numpy as np

MEMORY = 16 << 30  # bytes of address space
SECONDS, BYTES_A_SECOND = 60, 1e6  # processor time for any files, and beyond that for their size


def main(paths: list[str]) -> None:
    """Write the tensor of each file, in order, named 0, 1, …"""
    answer = os.dup(1)
    os.dup2(2, 1)
    import torch

    with contextlib.suppress(ImportError, ValueError, OSError):
        import resource

        size = sum(os.stat(path).st_size for path in paths)  # noqa: PTH116
        limit = SECONDS + int(size / BYTES_A_SECOND)
        resource.setrlimit(resource.RLIMIT_CPU, (limit, limit + 1))
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    arrays = {}
    for i, path in enumerate(paths):
        try:
            held = torch.load(path, map_location="cpu", weights_only=True)
        except Exception as error:  # errors of many kinds
            first = (str(error).strip().splitlines() or [""])[0][:100]
            sys.exit(f"{os.path.basename(path)}: {first or type(error).__name__}")  # noqa: PTH119
        if not isinstance(held, torch.Tensor):
            sys.exit(f"{os.path.basename(path)}: it holds a {type(held).__name__}, and no tensor")  # noqa: PTH119
        arrays[str(i)] = held.detach().to_dense().to(torch.float64).numpy()
    content = io.BytesIO()
    np.savez(content, **arrays)
    with os.fdopen(answer, "wb") as out:
        out.write(content.getvalue())


if __name__ == "__main__":
    try:
        main(sys.stdin.read().splitlines())
    except Exception as error:
        sys.exit(str(error)[:200] or type(error).__name__)
