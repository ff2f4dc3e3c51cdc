"""Compare contact models with measurements, see where they fail, name the missing effect, add it.

    from thesis_lib.critique import criticise
    critique = criticise(read_dataset("data/my_drops"), rng=np.random.default_rng(0))

Too few impacts for a verdict give a `FewImpacts` instead of a `Critique`.  All are imported on first use, so that
importing this package stays cheap.
"""

from importlib import import_module

__all__ = ["Critique", "FewImpacts", "criticise"]


def __getattr__(name: str):
    if name in __all__:
        return getattr(import_module("thesis_lib.critique.drops.criticise"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
