"""An effect that was written for earlier hooks ends with one error, and what that error shows runs."""

import re

import own_files
import pytest

from thesis_lib.extensions.loading import load
from thesis_lib.foundation.errors import UserError

HOOKS = {
    "coefficients": (
        "",
        """    def coefficients(self, mu, epsilon, space, state, p, rig):
        # the harder, the softer
        return mu, np.clip(epsilon * (1.0 + p["h"] * np.abs(space.v_t)), 0.0, 1.0)
""",
    ),
    "impulse": (
        "needs_angle = True",
        """    def impulse(self, impulse, space, mu, epsilon, r, state, p, rig):
        r_x, r_y = r
        return Impulse(impulse.c_t, impulse.c_n, impulse.tau - 1e-3 * p["h"] * np.sign(state.omega) * impulse.c_n)
""",
    ),
    "contact_point": (
        "breaks_mirror = True",
        """    def contact_point(self, r_x, r_y, state, p, rig):
        return r_x + 1e-2 * p["h"], r_y
""",
    ),
    "radius_of_gyration": (
        "",
        """    def radius_of_gyration(self, k_g, p):
        return k_g * np.sqrt(1.0 + p["h"])
""",
    ),
    "acceleration": (
        'channels = ("flight",); needs_trajectories = True',
        """    def acceleration(self, a, state, p, rig):
        return a - np.stack([p["h"] * state.vx, p["h"] * state.vy, 0.0 * state.vx], axis=-1)
""",
    ),
}


def text_of(hook: str, name: str, code: str) -> str:
    """A file of a user with this hook instead of its own."""
    more, _ = HOOKS[hook]
    head = own_files.EFFECT.partition("    def ")[0].replace("slip_dependent_restitution", name)
    head = head.replace("import Effect,", "import Effect, Impulse,")
    if hook == "acceleration":
        head = head.replace("contact_law", "flight")
    return f"{head}    {more}\n\n{code}\n\nEFFECT = SlipDependentRestitution()\n"


@pytest.mark.parametrize("hook", HOOKS)
def test_the_error_shows_the_hook_rewritten_and_that_runs(hook: str, tmp_path) -> None:
    path = tmp_path / "old.py"
    path.write_text(text_of(hook, f"old_{hook}", HOOKS[hook][1]), encoding="utf-8")
    with pytest.raises(UserError, match="earlier version") as raised:
        load([path], say=lambda text: None)
    shown = re.search(r"in their place:\n\n(.*)\n\n?", str(raised.value), re.S)
    assert shown and shown.group(1).startswith("def ")
    code = shown.group(1).split("\n. python -m")[0]
    if hook == "acceleration":  # a stack of rows has become one of components
        assert "axis" not in code
    indented = "\n".join(f"    {line}" if line else line for line in code.strip().split("\n")) + "\n"
    path.write_text(text_of(hook, f"old_{hook}_again", indented), encoding="utf-8")
    loaded = load([path], say=lambda text: None)
    assert any(entry["name"] == f"old_{hook}_again" for entry in loaded)
