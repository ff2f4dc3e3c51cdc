"""Effects and laws that are not the library's: where each came from, and how they join those of the library.

They join `EFFECTS` and `LAWS` themselves, so that the critique, saved models and reports treat all alike; `ORIGINS` is
what tells them from the library's.
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
# what tables and the critique call something else by: bounds, the model with effects, contacts that take time
RESERVED = re.compile(r"augmented|best_post_hoc|irb_bound|no_impact|\w*_contact|\w*_as_published")


class Origin(Section):
    """Where effects and laws come from that are not the library's: a file or an installed package, the other is ""."""

    # neither a path nor words: a message repeats them
    file: str = Field("", max_length=200, pattern=r"^([^/\\\x00-\x1f]+\.py)?$", description="its name, without folders")
    package: str = Field("", max_length=200, pattern=PACKAGE)
    version: str = Field("", max_length=100, pattern=VERSION, description="of the package")
    sha256: str = Field(pattern="^[0-9a-f]{64}$", description="of the file, or of the Python files of the package")

    @model_validator(mode="after")
    def _is_from_somewhere(self) -> Self:
        if bool(self.file) == bool(self.package):
            raise ValueError("it names a file or a package, not both")
        return self

    def __str__(self) -> str:
        return self.file or f"the package {self.package} {self.version}".rstrip()

    @property
    def remedy(self) -> str:
        """How to load what comes from here."""
        if self.file:
            return f"if you trust that file, add --effects {self.file}, with the path to it"
        return f"if you trust that package, install it (python -m pip install {self.package})"

    def content(self) -> dict[str, str]:
        """For JSON: what is known of the origin."""
        return {name: value for name, value in ({"sha256": self.sha256} | vars(self)).items() if value}


@dataclass(frozen=True)
class Loaded:
    """Effects and laws of one file or package."""

    origin: Origin
    effects: tuple[Effect, ...]
    laws: tuple[Law, ...]


_ADDED: dict[tuple[Kind, str], Origin] = {}  # by kind and name, in the order in which they were added


def additions() -> dict[tuple[Kind, str], Origin]:
    """Where all that was added to the library comes from, by kind and name: effects first, in the order of names."""
    return {key: _ADDED[key] for key in sorted(_ADDED)}


def contents() -> list[dict[str, str]]:
    """`additions` for JSON."""
    return [{"kind": kind, "name": name} | origin.content() for (kind, name), origin in additions().items()]


def added_laws() -> tuple[str, ...]:
    """Names of the laws that were added, which the critique tries beside those of the library."""
    return tuple(name for kind, name in additions() if kind == "law")


def origin_of(kind: Kind, name: str) -> Origin | None:
    """Where an effect or a law comes from; None for those of the library, and for unknown ones."""
    return _ADDED.get((kind, name))


def add(loaded: Loaded) -> None:
    """Let effects and laws join those of the library; what came from an earlier state of the same file is replaced.

    Raises:
        UserError: a name or title that cannot be used, or is taken; then none of them joins.
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
    """Refuse names and titles that cannot be used, or that something from elsewhere has."""
    origin = loaded.origin
    taken: dict[str, str] = {}  # name or title -> whose it is
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
            raise UserError(f"{origin}: the name {new.name!r} has a meaning of its own; give your law another.")
        for what, word in (("name", new.name), ("title", new.title)):
            if word in taken:
                raise UserError(f"{origin}: the {what} {word!r} is that of {taken[word]}; give your {kind} another.")
        taken |= dict.fromkeys((new.name, new.title), f"the {kind} {new.name} in it")
