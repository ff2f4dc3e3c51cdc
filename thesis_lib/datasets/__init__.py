"""Datasets of measured or simulated drops: read, validate and write them, and find their impacts.

`read_dataset(path)` returns a `Dataset` from a folder, `dataset_of` one from arrays; `find_impacts(dataset)` returns
its impacts with their covariance.  All are imported on first use, which keeps the import of this package fast.
"""

from importlib import import_module

_FACE = {
    "dataset_of": "thesis_lib.datasets.read",
    "find_impacts": "thesis_lib.datasets.impacts.detect",
    "read_dataset": "thesis_lib.datasets.read",
}
__all__ = ["dataset_of", "find_impacts", "read_dataset"]


def __getattr__(name: str):
    if name in _FACE:
        return getattr(import_module(_FACE[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
