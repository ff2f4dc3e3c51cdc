"""Sizes of what the proof hides: those at which the base law's misfit is 3 times the floor.

Of laws, factors in config/proof_sizes.json multiply the scales of an effect's parameters; of causes it holds, by source
and shape, those that `cause_sizes` found (other sources and causes have the sizes in `hidden_causes`).  They were found
on a development seed before the first run.  `python -m thesis_lib.critique.proof size NAME` finds one again.
"""

import functools
import json
from pathlib import Path

import numpy as np

import thesis_lib
from thesis_lib.contact import LAWS
from thesis_lib.critique.contacts.model import Model
from thesis_lib.critique.drops.world import Drops
from thesis_lib.critique.likelihood.fit import fit
from thesis_lib.critique.likelihood.observations import observe
from thesis_lib.critique.simulation.law_drops import simulate_law_drops
from thesis_lib.effects import EFFECTS
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.files import write_text
from thesis_lib.foundation.randomness import generator
from thesis_lib.simulate.rig.hidden_causes import ELLIPSE_BODY, PROOF_RELEASE, RIG_NOISE, SQUARE

CONFIG = Path(thesis_lib.__file__).resolve().parent.parent / "config"  # in a checkout; an installed package has none
SIZES = CONFIG / "proof_sizes.json"
# with less friction hardly any contact sticks, and some effects do not show
MU, EPSILON = 0.3, 0.55
LAW = "wang_mason"  # an exact path-wise law


def require_checkout() -> None:
    """UserError if the package was installed without its checkout, so that there is no config/."""
    if not SIZES.is_file():
        raise UserError(
            "The proof needs a checkout of the project, whose config/ holds the sizes of what is hidden and the stored "
            f"results; {CONFIG} does not exist, so run it in a clone."
        )


def stored_factor(name: str) -> float:
    """Factor on the scales of an effect in config/proof_sizes.json; UserError if none is stored."""
    require_checkout()
    stored = json.loads(SIZES.read_text(encoding="utf-8"))["law"]
    if name not in stored:
        raise UserError(f"config/proof_sizes.json has no size of {name}; `size {name}` finds one.")
    return stored[name]


@functools.cache
def _stored_sizes() -> dict[str, dict]:
    require_checkout()
    return json.loads(SIZES.read_text(encoding="utf-8"))


def cause_size(source: str, shape: str, name: str, default: float) -> float:
    """Size of a hidden cause in config/proof_sizes.json, in its unit; `default` if none is stored for it."""
    return _stored_sizes().get(source, {}).get(shape, {}).get(name, default)


def store_cause_size(source: str, shape: str, name: str, size: float) -> None:
    """Put the size of a hidden cause, in its unit, into config/proof_sizes.json."""
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


def find_size(name: str, ratio: float, seed: int) -> float:
    """Factor on an effect's scales at which the base law's misfit is `ratio` times the noise floor, by bisection."""
    effect = EFFECTS[name]
    body = SQUARE if name == "rounded_corners" else ELLIPSE_BODY

    def misfit(factor: float) -> float:
        values = {"mu": MU, "epsilon": EPSILON} | {f"{name}.{k}": v for k, v in law_size(name, factor).items()}
        rng = generator(seed, "proof sizes", name)
        model = Model(LAWS[LAW], (effect,))
        o = observe(simulate_law_drops(body, PROOF_RELEASE, 80, model, values, noise=RIG_NOISE, rng=rng))
        judged = Drops(o).judge(fit(Model(LAWS[LAW]), o))
        # relative to the misfit without effects, which is not exactly 1 in the gap
        impact = float(judged.error.mean()) / judged.floor
        flight = np.sqrt(judged.sigmas["flight"])
        touch = np.sqrt(judged.sigmas["touch"]) / 0.85 if effect.channels == ("touch",) else 0.0
        return float(max(flight, 0.0) if effect.family == "flight" or name == "surface_tilt" else max(impact, touch))

    low, high = 0.01, 30.0
    for _ in range(9):
        middle = float(np.sqrt(low * high))
        low, high = (middle, high) if misfit(middle) < ratio else (low, middle)
    return float(f"{np.sqrt(low * high):.3g}")
