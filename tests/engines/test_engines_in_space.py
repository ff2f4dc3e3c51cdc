"""Engines as laws of bodies in space: they agree with our own integration of the same contact, and find their truth."""

from types import SimpleNamespace

import numpy as np
import pytest

from thesis_lib.bodies.solids import Box, Ellipsoid, Sphere
from thesis_lib.critique.contacts.bases import BASES
from thesis_lib.critique.contacts.engine_contact import IN_SPACE, STAND_INS, engine_law, lacks
from thesis_lib.critique.contacts.kinds import bind
from thesis_lib.critique.contacts.model import Model
from thesis_lib.critique.engines.compare import held_out_error, require_models
from thesis_lib.critique.likelihood.in_space.hits import observe_in_space
from thesis_lib.effects import EFFECTS
from thesis_lib.effects.effect import Rig
from thesis_lib.foundation.errors import UserError
from thesis_lib.mechanics.space import SPACE, of_rotation_vector
from thesis_lib.mechanics.state import State
from thesis_lib.simulate.mujoco.tosses import MujocoTosses
from thesis_lib.simulate.tosses.example import simulate_tosses

HALF = np.array([0.05, 0.04, 0.03])
SOLIDS = {
    "box": Box(half_extents=tuple(HALF)),
    "rounded box": Box(half_extents=tuple(HALF), edge_radius=4e-3),
    "sphere": Sphere(radius=0.04),
    "ellipsoid": Ellipsoid(semi_axes=tuple(HALF)),
}
VALUES = {"mu": 0.3, "epsilon": 0.5, "tau": 6e-4, "damping_ratio": 10.0, "impedance": 0.9}
EFFECT = {"com_offset.c_x": 3e-3, "com_offset.c_y": -2e-3, "com_offset.c_z": 1e-3}


def touching(solid, n: int, rng: np.random.Generator) -> tuple[Rig, State]:
    """A body of any attitude, with its lowest point on the surface, that comes down and turns."""
    rig = Rig(solid, 0.04, 9.81, 0.0, tensor=solid.moments.inertia_per_mass)
    attitude = of_rotation_vector(2.0 * rng.standard_normal((3, n)))
    velocity = rng.uniform(-0.7, 0.7, (2, n)), rng.uniform(-2.5, -1.5, (1, n)), 8.0 * rng.standard_normal((3, n))
    pose = np.concatenate([np.zeros((3, n)), attitude])
    state = State(pose, np.concatenate(velocity), np.arange(n), np.zeros(n), None, SPACE)
    return rig, state.changed(position=state.position - np.array([[0.0], [0.0], [1.0]]) * rig.gap(state))


@pytest.mark.parametrize("name", SOLIDS)
@pytest.mark.parametrize("engine", IN_SPACE)
def test_an_engine_has_the_contact_of_the_law_that_stands_for_it(engine, name, rng):
    rig, state = touching(SOLIDS[name], 40 if engine == "mujoco" else 8, rng)
    ends = []
    for law in (engine_law(engine), BASES[STAND_INS[engine][0]]):
        model = Model(law, (EFFECTS["com_offset"],), True, space=SPACE)
        ends.append(bind(model, VALUES | EFFECT, rig).press(state))
    (there, lasts), (here, wanted) = ends
    changed = np.linalg.norm(here.velocity - state.velocity, axis=0)
    off = np.linalg.norm(there.velocity - here.velocity, axis=0) / changed
    assert np.median(off) < 2e-3 and np.quantile(off, 0.8) < 5e-3  # a corner that just touches may turn any body
    assert np.median(np.linalg.norm(there.spin - here.spin, axis=0)) < 0.1
    np.testing.assert_allclose(np.median(lasts), np.median(wanted), rtol=0.03)
    assert np.median(np.linalg.norm(there.position - here.position, axis=0)) < 1e-4


def test_what_an_engine_in_space_lacks_is_named():
    effects = [EFFECTS[name] for name in ("com_offset", "torsional_friction", "position_dependent_friction", "lens")]
    assert lacks("mujoco", effects, SPACE) == ["torsional_friction"]


def test_impacts_without_a_contact_time_are_refused_before_minutes_pass():
    stated = SimpleNamespace(space=SPACE, gravity=9.81, has_angle=True, impacts=[1])
    with pytest.raises(UserError, match="does not show how long contacts last"):
        require_models(stated, ("laws", "mujoco"))  # pyright: ignore[reportArgumentType]
    require_models(stated, ("laws",))  # pyright: ignore[reportArgumentType]


@pytest.mark.slow
def test_mujoco_explains_what_mujoco_tossed():
    made = simulate_tosses("box", drops=5, seed=4, engine=MujocoTosses(impratio=10.0, impedance=(0.9, 0.9)))
    o = observe_in_space(made)
    force = engine_law("mujoco").force
    assert force is not None
    tau = 1e-3 / force.lasting(0.5)  # μ, ε and 1 ms are those of `TossedWorld`
    truth = {"mu": 0.25, "epsilon": 0.5, "tau": tau, "damping_ratio": 10.0, "impedance": 0.9}
    errors = {}
    for name, changed in (("truth", {}), ("friction", {"mu": 0.5}), ("restitution", {"epsilon": 0.3})):
        model = Model(engine_law("mujoco"), (), True, space=SPACE)
        errors[name] = np.median(held_out_error(model, truth | changed, o))
    law = np.median(held_out_error(Model(BASES["convex_contact"], (), True, space=SPACE), truth, o))
    assert errors["truth"] < 0.35 * min(errors["friction"], errors["restitution"])
    assert errors["truth"] == pytest.approx(law, rel=0.1)
