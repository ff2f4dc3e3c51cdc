"""Rigid impact laws for one planar contact: `LAWS[name](v_pre, r, mass=, k_g=, mu=, epsilon=)`.

A new law is one file with a `LAW` (and, where published code differs, a `LAW_AS_PUBLISHED`) added to the list below.
"""

from thesis_lib.contact import (
    anitescu_potra_newton,
    anitescu_potra_poisson,
    drumwright_shell,
    mirtich,
    wang_mason,
    whittaker,
)
from thesis_lib.contact.law import Law, Outcome, Promise, Status

# the order of the thesis's Table 3.1
_MODULES = (
    drumwright_shell,
    anitescu_potra_poisson,
    anitescu_potra_newton,
    mirtich,
    wang_mason,
    whittaker,
)

SIX_LAWS: tuple[str, ...] = tuple(module.LAW.name for module in _MODULES)

LAWS: dict[str, Law] = {module.LAW.name: module.LAW for module in _MODULES}
LAWS.update(
    (module.LAW_AS_PUBLISHED.name, module.LAW_AS_PUBLISHED)
    for module in _MODULES
    if hasattr(module, "LAW_AS_PUBLISHED")
)

__all__ = ["LAWS", "SIX_LAWS", "Law", "Outcome", "Promise", "Status"]
