"""Compare contact models with measurements, see where they fail, name the missing effect, add it.

    from thesis_lib.critique import criticise
    found = criticise(read_dataset("data/my_drops"), rng=np.random.default_rng(0))

The function is imported on first use, so that importing this package stays cheap.
"""

import sys
from types import ModuleType


class _Face(ModuleType):
    """This package; `criticise` is the function even after its module of the same name was imported."""

    @property
    def criticise(self):
        from thesis_lib.critique.drops.criticise import criticise

        return criticise

    @criticise.setter
    def criticise(self, module: ModuleType) -> None:
        """The import system hangs every submodule on its package; this one's name is taken."""


sys.modules[__name__].__class__ = _Face
