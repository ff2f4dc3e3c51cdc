"""Library of candidate physical effects, one file each: `EFFECTS[name]`.

A new effect is a file with a class derived from `Effect` and an instance named EFFECT; it needs no other registration.
"""

import pkgutil
from collections.abc import Iterable, Sequence
from importlib import import_module

from thesis_lib.bodies.walls import Wall
from thesis_lib.effects.at_wall import AtWall, effect_at_wall
from thesis_lib.effects.effect import FAMILIES, Effect
from thesis_lib.foundation.errors import UserError, suggest
from thesis_lib.mechanics.space import Space


def _load() -> dict[str, Effect]:
    effects = {}
    for module in pkgutil.iter_modules(__path__):
        effect = getattr(import_module(f"{__name__}.{module.name}"), "EFFECT", None)
        if effect is not None:
            if effect.name != module.name:
                raise ImportError(f"the effect in {module.name}.py has the name {effect.name!r}; name it like its file")
            effects[effect.name] = effect
    return dict(sorted(effects.items(), key=lambda item: (FAMILIES.index(item[1].family), item[0])))


class _Library(dict[str, Effect]):
    """Effects by name; effects at one wall (`at_wall`) are made from their names and are not listed."""

    def __missing__(self, name: str) -> Effect:
        if (effect := effect_at_wall(name)) is None:
            raise KeyError(name)
        return effect

    def __contains__(self, name: object) -> bool:
        return super().__contains__(name) or effect_at_wall(name) is not None


EFFECTS: dict[str, Effect] = _Library(_load())


def effects_in(space: Space) -> dict[str, Effect]:
    """Effects of `EFFECTS` that are defined in the given space."""
    return {name: effect for name, effect in EFFECTS.items() if space.dimension in effect.dimensions}


def require_known(names: Iterable[str], walls: Sequence[Wall] | None = None) -> None:
    """Reject names of unknown effects and, if the `walls` of the rig are given, effects at unknown walls.

    Raises:
        UserError: for the first such name, with the names of all effects or walls.
    """
    for name in names:
        if name not in EFFECTS:
            asked = f": {said}" if (said := suggest(name, EFFECTS)) else ""
            raise UserError(f"There is no effect {name!r}{asked}; known are {', '.join(EFFECTS)}.")
        effect, there = EFFECTS[name], [wall.name for wall in walls or ()]
        if walls is not None and isinstance(effect, AtWall) and effect.wall not in there:
            known = f"the walls are {', '.join(there)}" if there else "there are no walls (`surfaces` of dataset.yaml)"
            raise UserError(f"There is no wall {effect.wall!r} for the effect {name}: {known}.")


__all__ = ["EFFECTS", "Effect", "effects_in", "require_known"]
