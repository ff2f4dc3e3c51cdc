"""Template of an effect file: it passes the checks and does nothing yet."""

from pathlib import Path

from thesis_lib.datasets.format.folder import holds_data
from thesis_lib.effects import EFFECTS
from thesis_lib.extensions.registry import NAME, origin_of
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.files import write_text

TEMPLATE = '''\
"""{title}: its physical meaning, in one sentence.

    ε ← ε (1 + h · 0)

| on paper | in code | unit | shape |                                                          |
|----------|---------|------|-------|----------------------------------------------------------|
| h        | `h`     | 1    |       | meaning of h; 0: the effect is absent                    |
"""

# This file is an effect that does nothing yet.  Complete it in four steps:
#   1. describe it: title, equation, the table above, and the source of the equation (reference);
#   2. give each parameter a unit and limits, within which a fit may vary it;
#   3. write the equation into the hook of the stage at which the effect acts;
#   4. thesis-lib effects --check {name}.py
#      thesis-lib critique DATA --effects {name}.py

import numpy as np

from thesis_lib.effects.effect import Effect, Parameter


class {camel}(Effect):
    name = "{name}"  # its key in model.json and diagnosis.json
    family = "contact_law"  # or geometry, inertia, surface, flight, measurement
    title = "{title}"  # its name in figures and reports
    equation = "ε = ε₀ (1 + h · 0)"
    reference = "no source yet"
    # null: where the effect is absent; low and high: physical limits; scale: a relevant size
    parameters = (Parameter("h", "1", null=0.0, low=-0.5, high=0.5, scale=0.1),)
    # what it changes: "impact" (velocity after impact), "meet" (pose after minus pose before), "touch" (gap at
    # impact), "flight" (acceleration between impacts), "slide" (friction of a body that slides on the surface; every
    # effect on friction changes it, named here or not)
    channels = ("impact",)
    # Does a drop that is mirrored left to right have the mirrored outcome?  If not: breaks_mirror = True

    def coefficients(self, mu, epsilon, contact, state, p, rig):
        """μ and ε of each impact, given those of the law: arrays with one value for each impact.

        contact: v_t, v_n (velocity of the contact point along and into the surface, m/s; v_n < 0), K_tt, K_nn, K_tn.
        state: x, y, theta, vx, vy, omega of the body (m, rad, m/s, rad/s), trial (number of the release), t (s);
        count x, trial and t from rig.reference, and list them in `along`, as in along = ("x",).
        p: the parameters by name.  rig: shape, k_g (m), gravity (m/s²), height (m).
        """
        change = 0.0 * contact.v_t  # put your term here: np.abs(contact.v_t), np.cos(2.0 * state.theta), ...
        return mu, np.clip(epsilon * (1.0 + p["h"] * change), 0.0, 1.0)

    # The other stages: to_true, to_measured, meet (camera), to_contact, from_contact, contact_point, gap,
    # inertia (body), contact_time, impulse (contact), sliding (friction of a body on the surface), acceleration
    # (flight), and arc where that changes within 0.1 s.  Their arguments and results:
    # python -c "from thesis_lib.effects.effect import Effect; help(Effect)"
    # For bodies in space, too: dimensions = IN_SPACE, from thesis_lib.effects.effect
    # Rules: return new arrays; use NumPy, no `if` on a parameter or a state (they may be arrays); in a pair such as
    # to_contact and from_contact, each must be the inverse of the other.


EFFECT = {camel}()
'''


def template(name: str) -> str:
    """Text of a file with an effect of this name; UserError if the name cannot be used."""
    if not NAME.fullmatch(name):
        raise UserError(
            f"--new {name[:60]}: a name has at most 60 lower-case letters, digits and _, and begins with a letter."
        )
    if name in EFFECTS and origin_of("effect", name) is None:
        raise UserError(f"--new {name}: the library has an effect of that name; choose another name.")
    words = name.split("_")
    camel = "".join(word.capitalize() for word in words)
    return TEMPLATE.replace("{title}", " ".join(words)).replace("{name}", name).replace("{camel}", camel)


def write_template(name: str, path: Path) -> Path:
    """Write the file; UserError if it exists already, or is in a folder with data, from which nothing is loaded."""
    text = template(name)
    if path.exists() or path.is_symlink():
        raise UserError(f"{path} exists already and stays as it is; choose another name.")
    for folder in path.absolute().parents:
        if holds_data(folder):
            raise UserError(f"{folder} holds data, and code is not loaded from there; change to another folder.")
    write_text(text, path)
    return path
