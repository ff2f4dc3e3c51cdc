"""One row of the proof: the result of the critique of one dataset, and the hash of the code."""

import functools
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from thesis_lib.contact import LAWS
from thesis_lib.critique.contacts.model import Model
from thesis_lib.critique.drops.criticise import DropsCritique, criticise_drops
from thesis_lib.critique.likelihood.fit import cramer_rao
from thesis_lib.critique.proof.cases import Case, make
from thesis_lib.critique.proof.sizes import LAW
from thesis_lib.effects import EFFECTS
from thesis_lib.effects.effect import Reference
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.provenance import lib_hash
from thesis_lib.foundation.randomness import generator
from thesis_lib.foundation.rows import today

# slopes g of a coefficient c (1 + m g x)^(1/m) by what is counted from the reference: c, x and m
SLOPES = {
    "wear.w": ("epsilon", "trial", 1.0),
    "position_dependent_restitution.g_eps": ("epsilon", "x", 1.0),
    "position_dependent_friction.g_mu": ("mu", "x", 1.0),
    "position_dependent_contact_time.g_tau": ("tau", "x", -2.0),
}


class Recovered(NamedTuple):
    """A parameter of the hidden effect; `std` of the fit, `fisher` from the Cramér-Rao bound, NaN if no law is true."""

    true: float
    found: float
    std: float
    fisher: float


@dataclass(frozen=True)
class Row:
    """Result of the critique of one dataset.

    Attributes:
        verdict: adequate, effects, unexplained, or refused.
        law: base law.
        groups: effects in the order of selection, each with the effects that cannot be told from it.
        errors: held-out error `base`, `augmented` and noise `floor` of impacts, m/s; `flight_base`, `flight_augmented`,
            `touch_base` and `touch_augmented` in units of noise; NaN if absent.
        remaining_p: p-value of the remaining structure.
        parameters: of a single hidden effect that the model contains, if a true value exists.
        why: reason of a refusal.
        code, made: `code_hash` of the code that made the row, "" if unknown; and the date.
        sizes: `Case.sizes` of what was hidden; empty if unknown.
    """

    case: Case
    verdict: str
    law: str = ""
    groups: tuple[tuple[str, ...], ...] = ()
    n_impacts: int = 0
    errors: Mapping[str, float] = field(default_factory=dict)
    remaining_p: float = np.nan
    parameters: Mapping[str, Recovered] = field(default_factory=dict)
    why: str = ""
    code: str = ""
    made: str = ""
    sizes: Mapping[str, float] = field(default_factory=dict)

    @property
    def is_of_today(self) -> bool:
        """Whether today's code made the row, with today's sizes."""
        return self.code == code_hash() and self.sizes == self.case.sizes

    @property
    def named(self) -> str:
        """The groups as text: "a/b + c"."""
        return " + ".join("/".join(group) for group in self.groups)


@functools.cache
def code_hash() -> str:
    """Hash (16 hex digits) of the code that makes a row."""
    return lib_hash(__file__)[:16]


def compute(case: Case, code: str = "") -> Row:
    """Make the dataset of a case, and criticise it; `code` is `code_hash()` where that is known, for it takes 1.5 s."""
    by = {"code": code or code_hash(), "made": today(), "sizes": case.sizes}
    dataset, true = make(case)
    try:
        critique = criticise_drops(dataset, rng=generator(case.seed, "critique", dataset.digest()))
    except UserError as error:
        return Row(case, "refused", why=str(error).splitlines()[0][:200], **by)
    judged = {"base": critique.ladder[0][2], "augmented": critique.ladder[-1][2]}
    errors = {when: float(of.error.mean()) for when, of in judged.items()} | {"floor": judged["augmented"].floor}
    for channel in ("flight", "touch"):
        errors |= {f"{channel}_{when}": float(np.sqrt(of.sigmas[channel])) for when, of in judged.items()}
    return Row(
        case,
        critique.verdict,
        law=critique.discovery.fitted.model.law.name,
        groups=tuple((step.effect.name, *step.alternatives) for step in critique.discovery.steps),
        n_impacts=len(critique.observations),
        errors=errors,
        remaining_p=critique.remaining.p_value,
        parameters=_parameters(critique, true) if len(case.hidden) == 1 else {},
        **by,
    )


def _parameters(critique: DropsCritique, true: dict[str, float]) -> dict[str, Recovered]:
    """Continuous parameters of the hidden effect by short name."""
    fitted, true = critique.discovery.fitted, counted_from(critique.training.rig.reference, true)
    continuous = {name for name, p in fitted.model.parameters.items() if "." in name and p.discrete is None}
    names = [name for name in true if name in continuous]
    if not names:
        return {}
    bound = dict.fromkeys(names, np.nan)
    if "mu" in true:
        effects = tuple(EFFECTS[name] for name in dict.fromkeys(key.split(".")[0] for key in names))
        bound = cramer_rao(Model(LAWS[LAW], effects), true, critique.training)
    return {key.split(".")[1]: Recovered(true[key], fitted.values[key], fitted.std[key], bound[key]) for key in names}


def counted_from(reference: Reference, true: Mapping[str, float]) -> dict[str, float]:
    """Parameters that count from `reference` and say the same as those, by full name, that count from 0.

    With m = 1, c (1 + g x) = c (1 + g x_0) (1 + g / (1 + g x_0) (x − x_0)).
    """
    moved = dict(true)
    for name, (coefficient, along, m) in SLOPES.items():
        if name in true:
            factor = 1.0 + m * true[name] * getattr(reference, along)
            moved[name] /= factor
            if coefficient in true:
                moved[coefficient] *= factor ** (1.0 / m)
    places = {f"{name}.{p.name}": p.along for name, effect in EFFECTS.items() for p in effect.parameters if p.along}
    return moved | {name: true[name] - getattr(reference, of) for name, of in places.items() if name in true}
