"""Registry of user-defined effects and laws: their origins, and their addition to the library.

They are added to `EFFECTS` and `LAWS`, so that the critique, saved models and reports treat all alike; only
`additions` distinguishes them from the effects and laws of the library.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, Self

from pydantic import Field, model_validator

from thesis_lib.contact import LAWS, Law
from thesis_lib.effects import EFFECTS, Effect
from thesis_lib.effects.effect import FAMILIES
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.settings import Section

Kind = Literal["effect", "law"]
NAME = re.compile(r"[a-z][a-z0-9_]{0,59}")
PACKAGE, VERSION = r"^[\w.-]*$", r"^[\w.!+-]*$"  # of an installed package
# names with another meaning in tables and in the critique: bounds, the model with effects, compliant contacts
RESERVED = re.compile(r"augmented|best_post_hoc|irb_bound|no_impact|\w*_contact|\w*_as_published")


class Origin(Section):
    """Origin of user-defined effects and laws: a file or an installed package; the other field is ""."""

    # patterns exclude paths and sentences, because messages repeat these texts
    file: str = Field("", max_length=200, pattern=r"^([^/\\\x00-\x1f]+\.py)?$", description="its name, without folders")
    package: str = Field("", max_length=200, pattern=PACKAGE)
    version: str = Field("", max_length=100, pattern=VERSION, description="version of the package")
    sha256: str = Field(pattern="^[0-9a-f]{64}$", description="SHA-256 of the file or of the package's Python files")

    @model_validator(mode="after")
    def _is_from_somewhere(self) -> Self:
        if bool(self.file) == bool(self.package):
            raise ValueError("it must name either a file or a package, and not both")
        return self

    def __str__(self) -> str:
        return self.file or f"the package {self.package} {self.version}".rstrip()

    @property
    def remedy(self) -> str:
        """Advice on how to load effects and laws of this origin."""
        if self.file:
            return f"if you trust that file, add --effects {self.file}, with the path to it"
        return f"if you trust that package, install it (python -m pip install {self.package})"

    def content(self) -> dict[str, str]:
        """Nonempty fields of the origin, for JSON."""
        return {name: value for name, value in ({"sha256": self.sha256} | vars(self)).items() if value}


@dataclass(frozen=True)
class Loaded:
    """Effects and laws of one file or package."""

    origin: Origin
    effects: tuple[Effect, ...]
    laws: tuple[Law, ...]


_ADDED: dict[tuple[Kind, str], Origin] = {}  # by kind and name, in the order in which they were added


def additions() -> dict[tuple[Kind, str], Origin]:
    """Origins of all additions to the library, by kind and name: effects first, in the order of names."""
    return {key: _ADDED[key] for key in sorted(_ADDED)}


def contents() -> list[dict[str, str]]:
    """List of `additions` for JSON."""
    return [{"kind": kind, "name": name} | origin.content() for (kind, name), origin in additions().items()]


def added_laws() -> tuple[str, ...]:
    """Names of the added laws, which the critique tests in addition to the laws of the library."""
    return tuple(name for kind, name in additions() if kind == "law")


def origin_of(kind: Kind, name: str) -> Origin | None:
    """Origin of an effect or a law; None for the library's own and for unknown names."""
    return _ADDED.get((kind, name))


def add(loaded: Loaded) -> None:
    """Add effects and laws to the library; those from an earlier version of the same file are replaced.

    Raises:
        UserError: a name or title is invalid or taken; then none of them is added.
    """
    require_free(loaded)
    for (kind, name), origin in list(_ADDED.items()):
        if _same_place(origin, loaded.origin):
            del _ADDED[kind, name]
            (EFFECTS if kind == "effect" else LAWS).pop(name, None)
    _ADDED.update({("effect", effect.name): loaded.origin for effect in loaded.effects})
    _ADDED.update({("law", law.name): loaded.origin for law in loaded.laws})
    LAWS.update({law.name: law for law in loaded.laws})
    # in the order of the library, families first
    everything = EFFECTS | {effect.name: effect for effect in loaded.effects}
    EFFECTS.clear()
    EFFECTS.update(sorted(everything.items(), key=lambda item: (FAMILIES.index(item[1].family), item[0])))


def _same_place(one: Origin, other: Origin) -> bool:
    return (one.file, one.package) == (other.file, other.package)


def require_free(loaded: Loaded) -> None:
    """Reject names and titles that are invalid or already used by an effect or law of another origin."""
    origin = loaded.origin
    taken: dict[str, str] = {}  # name or title -> its owner
    libraries: tuple[tuple[Kind, Mapping[str, Effect | Law]], ...] = (("effect", EFFECTS), ("law", LAWS))
    for kind, library in libraries:
        for name, one in library.items():
            whose = origin_of(kind, name)
            if whose is None or not _same_place(whose, origin):
                taken |= dict.fromkeys((name, one.title), f"{name} of {whose or 'the library'}")
    for kind, new in (*(("effect", one) for one in loaded.effects), *(("law", one) for one in loaded.laws)):
        if not (isinstance(new.name, str) and NAME.fullmatch(new.name)):
            raise UserError(
                f"{origin}: the {kind} {str(new.name)[:60]!r} needs a name of lower-case letters, digits and _, at "
                "most 60, that begins with a letter."
            )
        if kind == "law" and RESERVED.fullmatch(new.name):
            raise UserError(f"{origin}: the name {new.name!r} is reserved; give your law another name.")
        for what, word in (("name", new.name), ("title", new.title)):
            if word in taken:
                raise UserError(f"{origin}: the {what} {word!r} is used by {taken[word]}; give your {kind} another.")
        taken |= dict.fromkeys((new.name, new.title), f"the {kind} {new.name} in it")
