"""Drops that Bullet made, from release to rest by its own steps, are recognised as Bullet's."""

import numpy as np
import pytest
from hidden_effects import recorded

from thesis_lib.critique.drops.criticise import criticise_drops
from thesis_lib.critique.drops.settings import CritiqueSettings
from thesis_lib.critique.engines.compare import WITHOUT, compare_models
from thesis_lib.engines.bullet_engine import PACKAGE
from thesis_lib.simulate.compliant.drops import Falls, OwnContact
from thesis_lib.simulate.rig.hidden_causes import SQUARE, CompliantContact

pytest.importorskip("pybullet", reason=f"Bullet is optional: pip install {PACKAGE}")

MU, EPSILON, T = 0.2, 0.6, 1e-3
STEP = 1e-5  # s
REST = 0.15  # m²/s²: less energy than that per mass, and the recording ends
CORNER = 1e-6  # m


class Fall:
    """Drops of a square in Bullet, its corners small balls; what `simulate_compliant_drops` asks of an engine."""

    def accepts(self, contact, hidden):
        return OwnContact().accepts(contact, hidden)

    def fall(self, mechanics, pose, velocity, instants):
        import pybullet

        from thesis_lib.engines.parameters import bullet_numbers

        samples, t = instants.samples, np.zeros(len(pose))
        poses = np.full((len(pose), len(samples), 3), np.nan)
        numbers = bullet_numbers(MU, EPSILON, T, mass=mechanics.mass, step=STEP)
        world = pybullet.connect(pybullet.DIRECT)
        surface = pybullet.createMultiBody(
            0, pybullet.createCollisionShape(pybullet.GEOM_PLANE, planeNormal=[0, 1, 0]), basePosition=[0, -CORNER, 0]
        )
        pybullet.changeDynamics(surface, -1, lateralFriction=1, contactStiffness=1e18, contactDamping=0)
        corners = [[x, y, 0.0] for x, y in mechanics.vertices]
        shape = pybullet.createCollisionShapeArray(
            [pybullet.GEOM_SPHERE] * 4, radii=[CORNER] * 4, collisionFramePositions=corners
        )
        body = pybullet.createMultiBody(mechanics.mass, shape)
        soft = {"contactStiffness": numbers.stiffness, "contactDamping": numbers.damping, "lateralFriction": MU}
        turning = {"localInertiaDiagonal": [mechanics.inertia] * 3, "maxJointVelocity": 1e6}
        pybullet.changeDynamics(body, -1, linearDamping=0, angularDamping=0, **soft, **turning)
        pybullet.setGravity(0, -9.81, 0)
        pybullet.setPhysicsEngineParameter(fixedTimeStep=STEP, contactSlop=0, contactERP=0)
        for i, (q, v) in enumerate(zip(pose, velocity)):
            turn = [0, 0, np.sin(q[2] / 2), np.cos(q[2] / 2)]
            pybullet.resetBasePositionAndOrientation(body, [q[0], q[1], 0], turn)
            pybullet.resetBaseVelocity(body, [v[0], v[1], 0], [0, 0, v[2]])
            for k in range(len(samples)):
                place, turn = pybullet.getBasePositionAndOrientation(body)
                (vx, vy, _), (_, _, w) = pybullet.getBaseVelocity(body)
                poses[i, k] = place[0], place[1], 2.0 * np.arctan2(turn[2], turn[3])
                t[i] = samples[k]
                if 0.5 * (vx**2 + vy**2 + mechanics.inertia / mechanics.mass * w**2) + 9.81 * (place[1] - 0.03) < REST:
                    break
                for _ in range(round(1.0 / instants.rate / STEP)):
                    pybullet.stepSimulation()
            seen = ~np.isnan(poses[i, :, 2])
            poses[i, seen, 2] = q[2] + np.unwrap(poses[i, seen, 2] - q[2])
        pybullet.disconnect(world)
        return Falls(lambda times: poses, [], t)


@pytest.mark.slow
def test_bullet_is_recognised_as_the_model_of_its_own_drops():
    contact = CompliantContact(mu=MU, epsilon=EPSILON, contact_time=T)
    dataset = recorded(SQUARE, 40, 3, "squares", contact=contact, engine=Fall(), duration=0.5)
    settings = CritiqueSettings(folds=2, finalists=2, max_effects=1)
    judged = criticise_drops(dataset, rng=np.random.default_rng(0), effects=[], settings=settings)
    table = compare_models(judged, ("mujoco", "bullet")).set_index("model")
    assert (table["effects"] == WITHOUT).all() and table.index[0] == "bullet"
    best, default = table.loc["bullet"], table[table["kind"] == "default"].loc["bullet:default"]
    assert best["error"] < 1.25 * best["noise_floor"]
    assert abs(best["mu"] - MU) < 4.0 * best["mu_std"] and abs(best["epsilon"] - EPSILON) < 4.0 * best["epsilon_std"]
    assert best["contact_time"] == pytest.approx(T, rel=0.05)
    assert table.loc["mujoco", "behind_low"] > 0.0
    assert (default["kind"], default["mu"], default["epsilon"]) == ("default", 0.25, 0.0)
    assert default["error"] > 10.0 * best["error"]
