"""The size of a hidden cause at which what it adds to the misfit is 3 times the floor, for sources with real contacts.

Where the contact of a source is no rigid law, its misfit E_0 with nothing hidden is above the floor already.  The cause
then adds to it as squares add, so that at ratio R

    E² − E_0² = (R² − 1) floor²        (E = R floor where E_0 is the floor)

E is the misfit of the best base law with μ, ε, contact time and the effects that the contact has by itself refitted, on
the same releases with and without the cause: the error of impacts; of causes in flight, the misfit of whole arcs; of
what only the touch shows, that of gaps.  A cause outside the library has the largest of the three.
"""

from dataclasses import replace

import numpy as np

from thesis_lib.contact import LAWS
from thesis_lib.critique.drops.fit import fit
from thesis_lib.critique.drops.model import Model
from thesis_lib.critique.drops.observations import observe
from thesis_lib.critique.drops.world import Drops, Judgement
from thesis_lib.critique.proof.cases import ALL_CAUSES, Case, simulate
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.effects import EFFECTS
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.randomness import generator

DROPS = 80
WIDE = 30.0  # the size is sought between the stored one over this and times this
HALVINGS = 7  # of that range, to 6 %


def find_cause_size(case: Case) -> float:
    """Size of the one hidden cause of a case, in its unit, with which the misfit is the case's ratio.

    Raises:
        UserError: a cause that is on or off, or one that does not reach the ratio.
    """
    (name,) = case.hidden
    if name == "mirrored":
        raise UserError("A mirrored camera is on or off; it has no size.")
    plain = replace(case, drops=DROPS)
    law, without = _base(plain)

    def ratio(size: float) -> float:
        return _ratio(name, without, _judged(plain, {name: size}, (law,))[1])

    low, high = case.size(name) / WIDE, case.size(name) * WIDE
    for _ in range(HALVINGS):
        middle = float(np.sqrt(low * high))
        low, high = (middle, high) if ratio(middle) < case.ratio else (low, middle)
    found = float(f"{np.sqrt(low * high):.2g}")
    if high > 0.9 * case.size(name) * WIDE:
        raise UserError(
            f"{name} does not raise the misfit to {case.ratio:g} times the floor at any size up to {high:g}."
        )
    return found


def _base(case: Case) -> tuple[str, Judgement]:
    """The law that fits best with nothing hidden, and how it is judged."""
    return _judged(case, {}, tuple(LAWS))


def _judged(case: Case, sizes: dict[str, float], laws: tuple[str, ...]) -> tuple[str, Judgement]:
    rng = generator(case.seed, "proof sizes", case.source, case.shape, f"{case.contact_time:g}")
    drops = simulate(case, sizes, rng)
    o = observe(Dataset("sizes", drops.header, drops.trajectories))
    itself = tuple(EFFECTS[name] for name in case.by_itself)
    every = {law: Drops(o).judge(fit(Model(LAWS[law], itself, takes_time=True), o)) for law in laws}
    return min(every.items(), key=lambda one: float(one[1].error.mean()))


def _ratio(name: str, without: Judgement, found: Judgement) -> float:
    """√(1 + (E² − E_0²)/floor²), of the channel in which the cause shows; floors of flight and touch are 1."""
    floor = without.floor
    excess = {
        "impact": (float(found.error.mean()) ** 2 - float(without.error.mean()) ** 2) / floor**2,
        "flight": found.sigmas["flight"] - without.sigmas["flight"],
        "touch": found.sigmas["touch"] - without.sigmas["touch"],
    }
    shown = _shown(name)
    return float(np.sqrt(max(1.0 + max(excess[channel] for channel in shown), 0.0)))


def _shown(name: str) -> tuple[str, ...]:
    effects = ALL_CAUSES[name].effects
    if not effects:
        return "impact", "flight", "touch"
    effect = EFFECTS[effects[0]]
    if effect.family == "flight" or effect.name in ("surface_tilt", "length_scale"):
        return ("flight",)
    return ("touch",) if effect.channels == ("touch",) else ("impact",)
