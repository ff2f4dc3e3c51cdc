"""Compare contact models with measurements, find where they fail, and name and add the missing effect.

    from thesis_lib.critique import criticise
    critique = criticise("data/my_drops")
    print(critique.summary())

`criticise` returns a `Critique`; `fit` fits one law with named effects; `TooFew` is raised if the data hold too few
impacts for the request.  All are imported on first use to keep the import of this package cheap.
"""

from importlib import import_module

_FACE = {
    "Critique": "thesis_lib.critique.result",
    "TooFew": "thesis_lib.critique.drops.few_impacts",
    "criticise": "thesis_lib.critique.run",
    "fit": "thesis_lib.critique.run",
}
__all__ = ["Critique", "TooFew", "criticise", "fit"]


def __getattr__(name: str):
    if name in _FACE:
        return getattr(import_module(_FACE[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
