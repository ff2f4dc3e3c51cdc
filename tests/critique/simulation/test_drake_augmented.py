"""A saved model in Drake flies and rebounds as in the program's own simulator."""

import numpy as np
import pytest
from plain_drops import sizes

from thesis_lib.bodies.body import Noise
from thesis_lib.contact import LAWS
from thesis_lib.critique.contacts.model import Model
from thesis_lib.critique.simulation.drake_augmented import drake_poses
from thesis_lib.critique.simulation.law_drops import own_poses, simulate_law_drops
from thesis_lib.effects import EFFECTS
from thesis_lib.simulate.rig.hidden_causes import ELLIPSE_BODY, PROOF_RELEASE

N = 6
NONE = Noise(position=None, angle=None)
# the other simulator takes drag by a midpoint rule in steps of 1 ms, and impacts amplify what that leaves
SAME_FLIGHT, OWN_FLIGHT = 1e-8, 5e-4


def both(*names, tau=None):
    """Poses in Drake and in the program's own simulator, side by side."""
    effects = tuple(EFFECTS[name] for name in names)
    model = Model(LAWS["wang_mason"], effects, takes_time=tau is not None)
    values = {"mu": 0.3, "epsilon": 0.55, "tau": tau}
    for effect in effects:
        values |= sizes(effect, 3.0)
    drops = (ELLIPSE_BODY, PROOF_RELEASE, N, model, values)
    return tuple(
        simulate_law_drops(*drops, duration=0.5, noise=NONE, rng=np.random.default_rng(0), poses=poses).trajectories
        for poses in (drake_poses, own_poses)
    )


@pytest.mark.parametrize("names", [(), ("tangential_restitution",), ("linear_drag",), ("mirrored_rotation",)])
def test_drake_and_the_own_simulator_agree(names):
    drake, own = both(*names)
    assert len(drake) == len(own) > 50 * N
    np.testing.assert_allclose(drake["t"], own["t"], atol=1e-9)
    tolerance = OWN_FLIGHT if "linear_drag" in names else SAME_FLIGHT
    np.testing.assert_allclose(drake[["x", "y", "theta"]], own[["x", "y", "theta"]], atol=tolerance)


@pytest.mark.parametrize("names", [(), ("mirrored_rotation",)])
def test_contacts_last_as_long_in_drake(names):
    drake, own = both(*names, tau=2e-3)  # T is 3.7 ms: most contacts hold a sample
    np.testing.assert_allclose(drake["t"], own["t"], atol=1e-9)
    np.testing.assert_allclose(drake[["x", "y", "theta"]], own[["x", "y", "theta"]], atol=SAME_FLIGHT)
    rigid = both(*names)[0]
    assert len(rigid) != len(drake) or np.abs(drake["y"] - rigid["y"]).max() > 1e-3


@pytest.mark.parametrize("name", ["tangential_restitution", "linear_drag"])
def test_the_effect_acts_far_beyond_the_tolerance(name):
    with_it, without = (both(*names)[0].set_index(["trial", "t"]) for names in ((name,), ()))
    moved = (with_it - without).dropna().abs()
    assert moved["x"].max() > 10.0 * OWN_FLIGHT
