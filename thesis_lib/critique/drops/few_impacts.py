"""Restitution and friction from too few impacts for a verdict.

All laws are fitted to all impacts; nothing is chosen, and no data are held out.  Restitution is the mean over single
impacts (`own_restitution`), and its standard error includes the scatter of trials.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from thesis_lib.critique.drops.own_restitution import OwnRestitution, own_restitution
from thesis_lib.critique.drops.settings import CritiqueSettings
from thesis_lib.critique.drops.world import Drops
from thesis_lib.critique.likelihood.fit import Fit, fit
from thesis_lib.critique.likelihood.observations import Observations
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.foundation.errors import UserError

LAW = "mirtich"  # energetic restitution, which depends least on friction


class TooFew(UserError):
    """Error: `dataset` has too few usable impacts for the request; `observations` contains them."""

    def __init__(self, text: str, dataset: Dataset, observations: Observations) -> None:
        super().__init__(text)
        self.dataset, self.observations = dataset, observations

    @property
    def say_something(self) -> bool:
        """Whether there is anything to report: an impact or, in space, trajectories, with flights and rests."""
        return len(self.observations) > 0 or (self.observations.arcs and not self.observations.space.is_plane)


@dataclass(frozen=True)
class FewImpacts:
    """Results from too few impacts for a verdict.

    Attributes:
        observations: all impacts.
        laws: fit of each law to all impacts, by name; empty without impacts.
    """

    dataset: str
    observations: Observations
    laws: dict[str, Fit]
    source: Dataset | None = None

    @property
    def verdict(self) -> None:
        """None: too few impacts."""
        return None

    @property
    def fitted(self) -> Fit:
        """Fit of the law whose friction and restitution are reported."""
        return self.laws[LAW]

    @cached_property
    def each(self) -> OwnRestitution:
        """Restitution of each single hit."""
        return own_restitution(self.fitted, self.observations)

    @property
    def restitution(self) -> tuple[float, float]:
        """ε and its standard error; NaN if unknown, as without impacts or, for the error, with one of unknown noise."""
        if not self.laws:
            return np.nan, np.nan
        if not len(self.each.epsilon):  # episodes alone
            return self.fitted.values["epsilon"], self.fitted.std["epsilon"]
        return self.each.mean()


def few_impacts(few: TooFew, settings: CritiqueSettings) -> FewImpacts:
    """Results of all laws fitted to too few impacts."""
    observations, source = few.observations, few.dataset
    world = Drops(observations, settings)
    laws = {name: fit(world.model(name), observations) for name in world.bases if len(observations)}
    return FewImpacts(source.name, observations, laws, source)


def too_few(dataset: Dataset, observations: Observations, needs: str) -> TooFew:
    """The error to raise, with counts of omitted impacts and with warnings."""
    found, n = observations.found, len(observations)
    reasons = found.left_out["reason"].value_counts().to_dict()
    why = "; ".join(f"{count} {name}" for name, count in reasons.items())
    why = why or ("none" if n else "none, because not one was detected")
    doubts = len(dataset.warnings)
    checked = (f"datasets check has {doubts} warning{'s' * (doubts > 1)}.",) * (doubts > 0)
    noticed = " ".join([*found.warnings, *checked])
    noticed = f"What was noticed: {noticed} " if noticed else ""
    advice = "Measure more drops, or check the detection of impacts (thesis-lib datasets check)."
    text = f"{dataset.name} has {n} usable impacts in {len(np.unique(observations.trial))} trials; {needs}. "
    text += f"Left out: {why}. {noticed}{'' if found.remarks else advice}".rstrip()
    return TooFew(text, dataset, observations)
