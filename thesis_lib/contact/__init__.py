"""Rigid impact laws for one contact: `LAWS[name](v_pre, r, mass=, k_g=, mu=, epsilon=)`, in space with `inertia=`.

The six laws of the thesis are listed below; where the authors' code differs from the law as defined, the file of the
law also has a `LAW_AS_PUBLISHED`.  Any other file in this folder that defines a `LAW` adds a law to `LAWS`, and the
critique fits it along with the six.
"""

import pkgutil
from importlib import import_module

from thesis_lib.contact import (
    anitescu_potra_newton,
    anitescu_potra_poisson,
    drumwright_shell,
    mirtich,
    wang_mason,
    whittaker,
)
from thesis_lib.contact.law import Law, Outcome, Promise, Status

# in the order of Table 3.1 of the thesis
_MODULES = (drumwright_shell, anitescu_potra_poisson, anitescu_potra_newton, mirtich, wang_mason, whittaker)

SIX_LAWS: tuple[str, ...] = tuple(module.LAW.name for module in _MODULES)


def _further_laws() -> dict[str, Law]:
    laws = {}
    for item in pkgutil.iter_modules(__path__):
        law = getattr(import_module(f"{__name__}.{item.name}"), "LAW", None)
        if law is not None and item.name not in SIX_LAWS:
            if law.name != item.name:
                raise ImportError(f"the law in {item.name}.py has the name {law.name!r}; give it the name of its file")
            laws[law.name] = law
    return laws


_FURTHER = _further_laws()
LAWS: dict[str, Law] = {
    **{module.LAW.name: module.LAW for module in _MODULES},
    **{law.name: law for module in _MODULES if (law := getattr(module, "LAW_AS_PUBLISHED", None))},
    **_FURTHER,
}
# the laws that the critique fits to a planar dataset
CANDIDATE_LAWS: tuple[str, ...] = (*SIX_LAWS, *(name for name, law in _FURTHER.items() if 2 in law.dimensions))
LAWS_IN_SPACE: tuple[str, ...] = tuple(name for name, law in LAWS.items() if 3 in law.dimensions)

__all__ = ["CANDIDATE_LAWS", "LAWS", "LAWS_IN_SPACE", "SIX_LAWS", "Law", "Outcome", "Promise", "Status"]
