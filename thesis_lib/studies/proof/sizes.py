"""Sizes of hidden effects and causes at which the base law's misfit is 3 times the noise floor.

For the source "law", factors in config/proof_sizes.json multiply the scales of an effect's parameters.  For causes, the
file holds the sizes found by `find_size`, by source and shape (others have the sizes in `hidden_causes`).  They were
found on a development seed before the first run; `python -m thesis_lib.studies.proof size NAME` finds one again.
"""

import functools
import json
from collections.abc import Mapping, Sequence

import numpy as np

from thesis_lib.effects import EFFECTS
from thesis_lib.effects.effect import Effect, Rig, parameters_in
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.files import write_text
from thesis_lib.studies.proof.store import CONFIG

SIZES = CONFIG / "proof_sizes.json"
# with less friction hardly any contact sticks, and some effects cannot be observed
MU, EPSILON = 0.3, 0.55
LAW = "wang_mason"  # an exact path-wise law
# slopes g of a coefficient c (1 + m g x)^(1/m), where x is measured from the reference: c, x and m
SLOPES = {
    "wear.w": ("epsilon", "trial", 1.0),
    "position_dependent_restitution.g_eps": ("epsilon", "x", 1.0),
    "position_dependent_friction.g_mu": ("mu", "x", 1.0),
    "position_dependent_contact_time.g_tau": ("tau", "x", -2.0),
}
ALONG_TABLE = {name.split(".")[0]: m for name, (_, along, m) in SLOPES.items() if along == "x"}


def require_checkout() -> None:
    """Raise UserError if the package was installed without its checkout, and config/ is therefore missing."""
    if not SIZES.is_file():
        raise UserError(
            "The proof needs a checkout of the project, whose config/ holds the sizes of hidden causes and the stored "
            f"results; {CONFIG} does not exist. Run the proof in a clone of the repository."
        )


@functools.cache
def _stored_sizes() -> dict[str, dict]:
    require_checkout()
    return json.loads(SIZES.read_text(encoding="utf-8"))


def stored_factor(name: str, default: float | None = None) -> float:
    """Factor on the scales of an effect in config/proof_sizes.json; `default`, or UserError, if none is stored."""
    factor = _stored_sizes()["law"].get(name, default)
    if factor is None:
        raise UserError(f"config/proof_sizes.json has no size of {name}; the command `size {name}` finds one.")
    return factor


def cause_size(source: str, shape: str, name: str, default: float) -> float:
    """Size of a hidden cause in config/proof_sizes.json, in its unit; `default` if none is stored for it."""
    return _stored_sizes().get(source, {}).get(shape, {}).get(name, default)


def store_cause_size(source: str, shape: str, name: str, size: float) -> None:
    """Store the size of a hidden cause, in its unit, in config/proof_sizes.json."""
    stored = json.loads(SIZES.read_text(encoding="utf-8"))  # another run may have added to it
    of_shape = stored.setdefault(source, {}).setdefault(shape, {})
    stored[source][shape] = dict(sorted({**of_shape, name: size}.items()))
    write_text(json.dumps(stored, indent=1) + "\n", SIZES)


def law_size(name: str, factor: float) -> dict[str, float]:
    """Parameters of an effect by name: its scales times `factor`."""
    return {
        p.name: p.discrete if p.discrete is not None else float(np.clip(p.null + factor * p.scale, p.low, p.high))
        for p in EFFECTS[name].parameters
    }


def as_fitted(effects: Sequence[Effect], hidden: Mapping[str, float], rig: Rig) -> dict[str, float]:
    """The hidden sizes, converted to the conventions of the fitted effects.

    A rotation that the data cannot determine is not fitted (`Effect.unseen`).  A property that varies along the table
    is hidden relative to its value at the table's point, but fitted relative to its value at the reference of the rig:
    a slope s becomes s / (1 + s·x_0), with s = −2 g_τ for the stiffness behind a contact time.
    """
    true = dict(hidden)
    for effect in effects:
        names = [f"{effect.name}.{p.name}" for p in parameters_in(effect, rig.space)]
        sizes = np.array([hidden.get(name, 0.0) for name in names])
        if effect.name in ALONG_TABLE:
            sizes = sizes / (1.0 + ALONG_TABLE[effect.name] * sizes @ [rig.reference.x, rig.reference.y])
        directions = effect.unseen(rig)
        true |= zip(names, sizes - directions.T @ (directions @ sizes))
    return true
