"""Bullet as a model of impacts: the laws that its two contacts are; what all engines do is in `test_engine`."""

import numpy as np
import pytest
from engine_states import BODIES, ELLIPSE, SQUARE, STEEP, STILL, distance, of, touching

from thesis_lib.contact import LAWS
from thesis_lib.contact.compliant.normal_force import LinearDamper
from thesis_lib.critique.contacts.bases import BASES
from thesis_lib.critique.contacts.kinds import bind
from thesis_lib.critique.contacts.model import Model
from thesis_lib.critique.contacts.pressing import press
from thesis_lib.effects.effect import Rig
from thesis_lib.engines.bullet_engine import PACKAGE
from thesis_lib.engines.engine import impacts
from thesis_lib.engines.parameters import bullet_numbers, of_bullet
from thesis_lib.mechanics.state import State
from thesis_lib.simulate.rig.hidden_causes import HiddenCauses

pytest.importorskip("pybullet", reason=f"Bullet is optional: pip install {PACKAGE}")

MEASURED = 2e-3  # of ε, and of T relative: a hundred implicit steps
SAME = 1e-9  # m/s: the same numbers by another way
RIGID = 5e-4  # m/s, of a solver that iterates; measured 1e-4
LAW, LAW_MOST = 1e-3, 1e-2  # m/s, median and largest, of the law's steps and the engine's; measured 0.3e-3 and 8e-3


@pytest.mark.parametrize("name", BODIES)
def test_the_rigid_contact_is_anitescu_and_potras_law_with_newtons_restitution(name):
    """At any speed: the threshold of 0.2 m/s is off."""
    body = BODIES[name]
    q, v = touching(body, 60, steep=STEEP)
    v[::2] *= 0.03
    for mu, epsilon in ((0.2, 0.6), (0.5, 0.05), (1.0, 0.6)):
        made = impacts(of("rigid", body, 60, gravity=STILL, mu=mu, epsilon=epsilon, contact_time=1e-4), q, v)
        r, k = body.shape.contact_point(q[:, 2]), body.radius_of_gyration
        by, rough = (
            distance(body, made.v, LAWS[law](v, r, mass=1.0, k_g=k, mu=mu, epsilon=epsilon).v_post)
            for law in ("anitescu_potra_newton", "mirtich")
        )
        assert by.max() < RIGID and made.left.all()
        if mu == 1.0:
            assert rough.max() > 100.0 * RIGID  # other laws are told from it


def test_what_acts_outside_the_contact_force_is_in_the_body():
    """Centre of mass, inertia and size, against the law with the lever arms of that body."""
    causes = HiddenCauses(com_offset_x=0.002, com_offset_y=-0.001, inertia_error=0.1, size_error=0.03)
    for body in (ELLIPSE, SQUARE):
        q, v = touching(body, 40, steep=STEEP)
        engine = of("rigid", body, 40, causes=causes, gravity=STILL, mu=0.2, epsilon=0.6, contact_time=1e-4)
        made, m = impacts(engine, q, v), engine.mechanics
        _, rate = m.centre_state(q, v)
        k, r = np.sqrt(m.inertia / m.mass), m.lowest_point(q[:, 2])
        state = np.column_stack([rate, v[:, 2]])
        after = LAWS["anitescu_potra_newton"](state, r, mass=m.mass, k_g=k, mu=0.2, epsilon=0.6).v_post
        np.testing.assert_allclose(made.v, m.origin_state(q, after)[1], atol=20.0 * RIGID)
        plain = impacts(of("rigid", body, 40, gravity=STILL, mu=0.2, epsilon=0.6, contact_time=1e-4), q, v)
        assert np.median(distance(body, made.v, plain.v)) > 0.05


@pytest.mark.parametrize("name", BODIES)
def test_the_soft_contact_is_the_law_of_spring_and_damper(name):
    body = BODIES[name]
    q, v = touching(body, 60, steep=STEEP)
    touch = State.of(q, v, np.arange(60), np.zeros(60))
    rig, model = Rig(body.shape, body.radius_of_gyration, STILL, 0.0), Model(BASES["damped_contact"], (), True)
    for mu, epsilon, T in ((0.2, 0.6, 1e-3), (0.5, 0.3, 3e-3)):
        loss = LinearDamper().loss(np.array([epsilon]))
        tau = T * float((LinearDamper().centroid(loss) / LinearDamper().duration(loss))[0])
        law, _ = press(bind(model, {"mu": mu, "epsilon": epsilon, "tau": tau}, rig), touch)
        made = impacts(of("bullet", body, 60, gravity=STILL, mu=mu, epsilon=epsilon, contact_time=T), q, v)
        off = distance(body, made.v, law.v)
        assert np.median(off) < LAW and off.max() < LAW_MOST


def test_an_impact_hangs_on_no_other_and_is_the_same_again():
    q, v = touching(ELLIPSE, 6)
    together, again = (impacts(of("bullet", ELLIPSE, 6), q, v).v for _ in range(2))
    np.testing.assert_array_equal(together, again)
    for i in range(6):
        np.testing.assert_allclose(
            impacts(of("bullet", ELLIPSE, 1), q[i : i + 1], v[i : i + 1]).v[0], together[i], atol=SAME
        )


@pytest.mark.parametrize("points", [1, 2])
def test_numbers_of_a_body_with_its_own_contact_are_those_of_the_map(points):
    """The map's numbers, in a world of Bullet's own making: a ball, and a pair of them."""
    import pybullet

    h, T, mass = 1e-5, 1e-3, 0.05
    numbers = bullet_numbers(0.2, 0.6, T, mass=mass, step=h, points=points)
    world = pybullet.connect(pybullet.DIRECT)
    plane = pybullet.createCollisionShape(pybullet.GEOM_PLANE)
    surface = pybullet.createMultiBody(0, plane)
    ends = [[0.0, 0.1 * i - 0.05 * (points - 1), 0.0] for i in range(points)]
    shape = pybullet.createCollisionShapeArray(
        [pybullet.GEOM_SPHERE] * points, radii=[0.03] * points, collisionFramePositions=ends
    )
    body = pybullet.createMultiBody(mass, shape, basePosition=[0.0, 0.0, 0.03])
    soft = {"contactStiffness": numbers.stiffness, "contactDamping": numbers.damping}
    pybullet.changeDynamics(body, -1, linearDamping=0, angularDamping=0, **soft)
    pybullet.changeDynamics(surface, -1, contactStiffness=1e18, contactDamping=0)
    pybullet.setPhysicsEngineParameter(fixedTimeStep=h, contactSlop=0)
    pybullet.resetBaseVelocity(body, [0.0, 0.0, -2.0])
    for _ in range(200):
        pybullet.stepSimulation()
    speed = pybullet.getBaseVelocity(body)[0][2]
    pybullet.disconnect(world)
    assert speed / 2.0 == pytest.approx(0.6, abs=MEASURED)
    np.testing.assert_allclose(of_bullet(numbers, mass, h, points), (0.2, 0.6, T), rtol=1e-6)
