"""Thresholds of the search."""

import math
from collections.abc import Callable, Mapping

from pydantic import Field

from thesis_lib.foundation.settings import Section
from thesis_lib.statistics.wording import number


class SearchSettings(Section):
    """Thresholds of the search; all own choices."""

    held_out_share: float = Field(0.3, gt=0, lt=1, description="share of trials that are used for no choice")
    folds: int = Field(5, ge=2, description="K of the K-fold over training trials")
    max_effects: int | None = Field(
        None,
        ge=0,
        description="effects in one model; null: 4, in space 12, where hits are so precise that small causes show",
    )
    finalists: int = Field(
        5, ge=1, description="shortlisted candidates, fitted in full at once; others follow if none enters"
    )
    alpha: float = Field(0.01, gt=0, lt=1, description="significance level; the null counts all candidates tried")
    material_share: float = Field(0.05, ge=0, description="least fall of a held-out error, over that error")
    material_floor: float = Field(0.25, ge=0, description="least fall of a held-out error, over the noise floor")
    confirmed: float = Field(
        0.5,
        ge=0,
        le=1,
        description="share of that fall that held-out trials must show: an effect that just matters shows less than "
        "all of it in half of all splits",
    )
    tell_apart: float = Field(3.0, gt=0, description="nats in total below which two effects cannot be told apart")
    moved: float = Field(
        4.0,
        gt=0,
        description="squares of scales by which a candidate moves earlier effects further than one that predicts as "
        "well, at which the other enters",
    )
    worth_a_fit: float = Field(
        0.5,
        ge=0,
        le=1,
        description="least gain of a fitted candidate by score test, over the significant gain: slopes rank badly",
    )
    finalist_gain: float = Field(
        0.3, ge=0, le=1, description="least quick gain of a finalist, over the best: full fits seldom change more"
    )
    rivalled: int = Field(
        8, ge=1, description="candidates tried with rival bases too, the best by quick fits: each costs a fit per base"
    )
    judged: int = Field(
        3, ge=1, description="finalists judged by K-fold first; the others if none enters: each costs K fits"
    )
    close: float = Field(
        20.0, gt=0, description="nats by which a finalist may fit worse than the best and still be judged beside it"
    )
    far_beyond: float = Field(
        3.0,
        ge=1,
        description="gain over the largest of the null beyond which refits are not needed: they stretch the null less",
    )
    far_better: float = Field(
        1.2,
        ge=1,
        description="quick gain of a base of the reserve over that of the best effect at which it is judged first: the "
        "effect may only compensate for the wrong base",
    )
    runners_up: int = Field(
        3,
        ge=1,
        description="effects tried with bases of the reserve if the best one leaves an error: each costs slow fits",
    )
    enough_on_reserve: int = Field(
        4,
        ge=1,
        description="least number of effects found on a base of the reserve with which the search does not go back to "
        "where it took that base: it compensated for none of them",
    )
    nearly: float = Field(
        0.8, ge=0, le=1, description="least quick gain of a runner-up, over the best: a wrong base may cost that much"
    )

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
    """Sentence on the setting at which a search ended although more may be found; `search`: as in diagnosis.json.

    [] if there is no such setting.  `section` of the configuration contains the settings.
    """
    if search["limit"] is None:
        return []
    name, value = search["limit"], search["value"]
    return [
        f"The search ended at {name} = {value}, although a further effect would still gain more than chance; "
        f"{section}.{name} in the configuration, or {name} of the settings in Python, allows more."
    ]
