"""Search for the size of a hidden cause at which it raises the misfit to 3 times the noise floor.

If the contact of a source is not a rigid law, its misfit E_0 exceeds the floor even with nothing hidden.  The hidden
cause then adds to E_0 in squares; at ratio R

    E² − E_0² = (R² − 1) floor²        (E = R floor where E_0 is the floor)

E is the misfit of the best law or compliant contact (for the source "law", of its own law).  μ, ε, contact time and the
effects that the contact has by itself are refitted on the same releases with and without the hidden cause.  The misfit
is the error of impacts; for causes that act in flight, the misfit of whole arcs; for causes seen only at the touch, the
misfit of gaps; for a cause outside the library, the largest of the three.
"""

import functools
from dataclasses import replace

import numpy as np
from pydantic import ValidationError

from thesis_lib.critique.contacts.bases import BASES
from thesis_lib.critique.contacts.model import Model
from thesis_lib.critique.drops.world import Drops, Judgement
from thesis_lib.critique.likelihood.fit import fit
from thesis_lib.critique.likelihood.observations import observe
from thesis_lib.effects import EFFECTS
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.randomness import generator
from thesis_lib.studies.proof.cases import NOTHING, Case, make
from thesis_lib.studies.proof.sizes import LAW, stored_factor

DROPS = 80
WIDE = 30.0  # the search covers the stored size divided and multiplied by this factor
MOST = 7  # largest number of sizes that are tried
CLOSE, NEAR = 0.05, 0.3  # relative errors of the ratio: the search ends, and a result is accepted after `MOST` sizes
FURTHEST = 5.0  # largest factor from one size to the next


def find_size(case: Case) -> float:
    """Return the size (`Case.sizes`) of the single hidden effect or cause of a case that gives the case's ratio.

    Raises:
        UserError: the effect is either on or off, or no size reaches the ratio.
    """
    (name,) = case.hidden
    if name in ("mirrored", "mirrored_rotation"):
        raise UserError("A mirrored camera is either on or off; it has no size.")
    plain = replace(case, drops=DROPS)
    law, without = _base(plain.source, plain.shape, plain.contact_time, plain.seed)
    first = size = possible = case.factor * stored_factor(name, 1.0) if case.source == "law" else case.size(name)
    tried: dict[float, float] = {}  # relative error of the ratio, by size
    for _ in range(MOST):
        try:
            ratio = _ratio(case, without, _judged(plain, {name: size}, (law,))[1])
        except ValidationError:  # the size exceeds the limit of this cause
            size = float(np.sqrt(size * possible)) * np.sign(first)
            continue
        possible, tried[size] = size, abs(ratio / case.ratio - 1.0)
        if tried[size] < CLOSE:
            break
        # the contribution of a cause to the squared misfit grows with the square of its size
        further = np.sqrt((case.ratio**2 - 1.0) / max(ratio**2 - 1.0, 1e-9))
        wanted = size * float(np.clip(further, 1.0 / FURTHEST, FURTHEST))
        size = float(np.clip(abs(wanted), abs(first) / WIDE, abs(first) * WIDE)) * np.sign(first)
    found = min(tried, key=lambda size: tried[size])
    if tried[found] > NEAR:
        raise UserError(
            f"{name} does not reach {case.ratio:g} times the floor within {MOST} sizes; the nearest is {found:.2g}, "
            f"{100 * tried[found]:.0f} % off."
        )
    return float(f"{found:.2g}")


@functools.cache
def _base(source: str, shape: str, contact_time: float, seed: int) -> tuple[str, Judgement]:
    """The law that fits best with nothing hidden, and its judgement."""
    nothing = Case(source, NOTHING, seed, DROPS, shape=shape, contact_time=contact_time)
    return _judged(nothing, {}, (LAW,) if source == "law" else tuple(BASES))


def _judged(case: Case, sizes: dict[str, float], laws: tuple[str, ...]) -> tuple[str, Judgement]:
    rng = generator(case.seed, "proof sizes", case.source, case.shape, f"{case.contact_time:g}")
    o = observe(make(case, sizes, rng)[0])
    itself, lasts = tuple(EFFECTS[name] for name in case.by_itself), case.contact_time > 0.0
    every = {law: Drops(o).judge(fit(Model(BASES[law], itself, takes_time=lasts), o)) for law in laws}
    return min(every.items(), key=lambda one: float(one[1].error.mean()))


def _ratio(case: Case, without: Judgement, found: Judgement) -> float:
    """√(1 + (E² − E_0²)/floor²) in the channel in which the cause shows; the floors of flight and touch are 1."""
    floor = without.floor
    excess = {
        "impact": (float(found.error.mean()) ** 2 - float(without.error.mean()) ** 2) / floor**2,
        "flight": found.sigmas["flight"] - without.sigmas["flight"],
        "touch": found.sigmas["touch"] - without.sigmas["touch"],
    }
    shown = tuple(excess)
    if case.expected[0]:
        effect = EFFECTS[case.expected[0][0]]
        shown = ("touch",) if effect.channels == ("touch",) else ("impact",)
        if effect.family == "flight" or effect.name in ("surface_tilt", "length_scale"):
            shown = ("flight",)
    return float(np.sqrt(max(1.0 + max(excess[channel] for channel in shown), 0.0)))
