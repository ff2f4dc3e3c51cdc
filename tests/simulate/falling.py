"""Bodies, releases and engines of the tests of simulated drops."""

import numpy as np

from thesis_lib.bodies.body import Body, Noise
from thesis_lib.bodies.shapes import Disk, Ellipse, Polygon
from thesis_lib.simulate.compliant.drops import OwnContact, simulate_compliant_drops
from thesis_lib.simulate.drake.drops import DropsInDrake
from thesis_lib.simulate.mujoco.causes import MujocoCauses
from thesis_lib.simulate.mujoco.contact import MujocoContact
from thesis_lib.simulate.mujoco.drops import DropsInMujoco
from thesis_lib.simulate.rig.hidden_causes import PROOF_RELEASE, CompliantContact, HiddenCauses
from thesis_lib.simulate.rig.release import Release, Spread

EXACT = 1e-9  # free flight: a parabola for a Runge-Kutta step and for a Hermite path
RIG = Noise(position=3e-4, angle=3e-3)
ELLIPSE = Body(shape=Ellipse(semi_axes=(0.035, 0.025)), mass=0.0364, radius_of_gyration=0.01924)
DISK = Body(shape=Disk(radius=0.03), mass=0.05, radius_of_gyration=0.02)
CORNERS = ((0.03, 0.03), (-0.03, 0.03), (-0.03, -0.03), (0.03, -0.03))
SQUARE = Body(shape=Polygon(vertices=CORNERS), mass=0.05, radius_of_gyration=0.0245)
LARGE = ((0.035, 0.035), (-0.035, 0.035), (-0.035, -0.035), (0.035, -0.035))
LARGE_SQUARE = Body(shape=Polygon(vertices=LARGE), mass=0.05, radius_of_gyration=0.0286)
FLAT = 0.0285  # m: lever of a corner of the square, 0.03 where it lands flat and two corners touch
PRE, POST = ["vx_pre", "vy_pre", "omega_pre"], ["vx_post", "vy_post", "omega_post"]
POSE = ["x", "y", "theta"]
BRIEF = 2e-5  # s; the body moves far less than the noise during such a contact: nearly a rigid impact
ENGINES = {
    "own": OwnContact(),
    "mujoco": DropsInMujoco(),
    "pad": DropsInDrake(),
    "point": DropsInDrake("point"),
    "hydroelastic": DropsInDrake("hydroelastic"),
}
TIMES = {"own": BRIEF, "pad": BRIEF}  # of contacts unless a test says otherwise, in s; else 1 ms


def run(engine, n=10, body=ELLIPSE, release=PROOF_RELEASE, seed=0, hidden=None, contact=None, **options):
    """Drops of an engine of `ENGINES`; `contact` and `hidden` are settings."""
    law, causes = (MujocoContact, MujocoCauses) if engine == "mujoco" else (CompliantContact, HiddenCauses)
    return simulate_compliant_drops(
        body,
        release,
        n,
        engine=ENGINES[engine],
        contact=law(**({"contact_time": TIMES.get(engine, 1e-3)} | (contact or {}))),
        hidden=causes(**(hidden or {})),
        rng=np.random.default_rng(seed),
        **({"duration": 0.4} | options),
    )


def at(**values):
    """A release of one state; a (low, high) pair spreads it."""
    state = {"height": 0.3, "theta": 0.0, "vx": 0.0, "omega": 0.0} | values
    pairs = {name: value if isinstance(value, tuple) else (value, value) for name, value in state.items()}
    return Release(**{name: Spread(low=low, high=high) for name, (low, high) in pairs.items()})


def first(drops):
    return drops.impacts[drops.impacts["impact"] == 0]


def contact_velocity(impacts, side):
    v_t = impacts[f"vx_{side}"] - impacts["r_y"] * impacts[f"omega_{side}"]
    return v_t, impacts[f"vy_{side}"] + impacts["r_x"] * impacts[f"omega_{side}"]
