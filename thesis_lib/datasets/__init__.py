"""Datasets of measured or simulated drops: read, validate, write, and find the impacts in them.

`read_dataset(path)` gives a `Dataset`, and so does `dataset_of` from arrays; `find_impacts(dataset)` gives its impacts
with covariance.  All are imported on first use, so that importing this package stays cheap.
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
