"""Thresholds of the search."""

import math
from collections.abc import Callable, Mapping

from pydantic import Field

from thesis_lib.foundation.settings import Section
from thesis_lib.statistics.wording import number


class SearchSettings(Section):
    """Thresholds of the search; all own choices."""

    held_out_share: float = Field(0.3, gt=0, lt=1, description="share of trials that no choice sees")
    folds: int = Field(5, ge=2, description="K of the K-fold over training trials")
    max_effects: int = Field(4, ge=0, description="effects in one model")
    finalists: int = Field(5, ge=1, description="candidates that are fitted in full at each step")
    alpha: float = Field(0.01, gt=0, lt=1, description="level of the null that counts the candidates tried")
    material_share: float = Field(0.05, ge=0, description="least fall of a held-out error, over that error")
    material_floor: float = Field(0.25, ge=0, description="least fall of a held-out error, over the noise floor")
    tell_apart: float = Field(3.0, gt=0, description="nats in total below which two effects cannot be told apart")

    def matters(self, before: float, after: float, floor: float) -> bool:
        """Whether the fall from `before` to `after` is material; `floor`: error of noise alone."""
        return bool(before - after >= max(self.material_share * before, self.material_floor * floor))

    def change(self, before: float, after: float, floor: float | None, show: Callable[[float], str] = number) -> str:
        """The change of an error in words: it falls or rises by an amount that matters, hardly changes, or stays."""
        floor = floor if floor is not None and math.isfinite(floor) else 0.0
        ends = f"from {show(before)} to {show(after)}"
        if self.matters(before, after, floor):
            return f"falls {ends}"
        if self.matters(after, before, floor):
            return f"rises {ends}"
        return f"stays at {show(after)}" if show(before) == show(after) else f"hardly changes, {ends}"


def search_ended(search: Mapping, section: str) -> list[str]:
    """At which setting a search ended although more may be found; `search`: that of diagnosis.json, [] if at none.

    `section` of the configuration holds the settings.
    """
    if search["limit"] is None:
        return []
    name, value = search["limit"], search["value"]
    why = {
        "max_effects": "although a further effect would still gain more than chance",
        "finalists": "although further effects that gain more than chance were not asked",
    }[name]
    return [
        f"The search ended at {name} = {value}, {why}; {section}.{name} of the configuration, "
        f"{name} of the settings in Python, allows more."
    ]
