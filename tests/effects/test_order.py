"""Effects act in one order, whatever the order in which they were chosen, and that order is the physical one."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from thesis_lib.contact import LAWS
from thesis_lib.critique.contacts.kinds import bind
from thesis_lib.critique.contacts.model import Model
from thesis_lib.effects import EFFECTS, Effect, effects_in
from thesis_lib.effects.effect import Parameter, in_order
from thesis_lib.extensions.effect_probe import BOX, EPSILON, MU, RIGS, TAU, at_scale, random_states, tumbling_boxes
from thesis_lib.mechanics.frame import Frame
from thesis_lib.mechanics.space import PLANE, SPACE
from thesis_lib.mechanics.state import State

N = 12
RIG = RIGS["quadrilateral"]
ROUNDING = 1e-12
GRAVITY = np.array([0.0, -RIG.gravity, 0.0])


class Own(Effect):
    """An effect of a user, who knows no ranks."""

    name = "own"
    family = "contact_law"
    parameters = (Parameter("h", "1", null=0.0, low=-0.5, high=0.5, scale=0.1),)

    def coefficients(self, mu, epsilon, contact, state, p, rig):
        return mu, np.clip(epsilon * (1.0 + p["h"]), 0.0, 1.0)


def sizes(effects, rng: np.random.Generator) -> dict[str, float]:
    """Parameters up to three times their scales, within their bounds."""
    values = {"mu": MU, "epsilon": EPSILON, "tau": TAU}
    for effect in effects:
        for p in effect.parameters:
            size = float(np.clip(p.null + rng.uniform(-3.0, 3.0) * p.scale, p.low, p.high))
            values[f"{effect.name}.{p.name}"] = size if p.discrete is None else p.discrete
    return values


def everything(effects, values: dict[str, float], states: State) -> np.ndarray:
    """What a model predicts of impact, touch, jump and flight, in a row."""
    dynamics = bind(Model(LAWS["anitescu_potra_newton"], tuple(effects), takes_time=True), values, RIG)
    after, depth = dynamics.strike(states)
    gap, a = dynamics.gap(dynamics.to_true(states)), dynamics.acceleration(states)
    return np.concatenate([after.q, after.v, depth[:, None], gap[:, None], dynamics.jump(states, after), a], axis=1)


def test_any_order_of_all_effects_gives_the_same_order() -> None:
    effects = [*effects_in(PLANE).values(), Own()]
    rng = np.random.default_rng(1)
    orders = [in_order([effects[i] for i in rng.permutation(len(effects))]) for _ in range(20)]
    assert all(order == orders[0] for order in orders)
    model = Model(LAWS["mirtich"], tuple(reversed(orders[0])))
    assert [effect for effect, _ in model.hooks] == orders[0]
    assert model.effects == tuple(reversed(orders[0]))  # as chosen


def test_any_order_of_choice_gives_the_same_prediction() -> None:
    """All stages of a model; for each effect its contract says the same."""
    rng = np.random.default_rng(1)
    ranked = [effect for effect in effects_in(PLANE).values() if effect.rank]
    for effects in ([*effects_in(PLANE).values(), Own()], ranked):
        values, states = sizes(effects, rng), random_states(RIG, N, rng)
        made = [everything([effects[i] for i in rng.permutation(len(effects))], values, states) for _ in range(5)]
        for other in made[1:]:
            np.testing.assert_array_equal(other, made[0])


def test_a_camera_reports_the_tracked_point_and_not_the_centre_in_its_wrong_axes() -> None:
    """Axes are named last: what is mirrored is the pose of the marker, which circles the other way."""
    marker, mirror, offset = (EFFECTS[name] for name in ("marker_offset", "mirrored_rotation", "angle_offset"))
    values = sizes((marker, mirror, offset), np.random.default_rng(2))
    states = random_states(RIG, N, np.random.default_rng(3))
    model = Model(LAWS["mirtich"], (offset, mirror, marker))
    seen = bind(model, values, RIG).to_measured(states)
    d, turned = np.array([values["marker_offset.d_x"], values["marker_offset.d_y"]]), values["angle_offset.d_theta"]
    sin, cos = np.sin(states.theta), np.cos(states.theta)
    np.testing.assert_allclose(seen.x, states.x + cos * d[0] - sin * d[1], atol=ROUNDING)
    np.testing.assert_allclose(seen.y, states.y + sin * d[0] + cos * d[1], atol=ROUNDING)
    np.testing.assert_allclose(seen.theta, turned - states.theta, atol=ROUNDING)
    np.testing.assert_allclose(seen.omega, -states.omega, atol=ROUNDING)


def seen_in_space(others: dict[str, dict[str, float]]) -> tuple[Rotation, Rotation]:
    """Attitudes R(q) of the tracked frame, as reported with these effects and with an offset, and with the offset only.

    The tracked frame is turned in the body, the offset is R_WS exp(d) R_ST, and the recording's axes are oblique.
    """
    d, (world, mark) = np.array([0.05, -0.03, 0.2]), Rotation.random(2, rng=np.random.default_rng(7))
    tracked = Frame(np.array([0.01, -0.02, 0.03]), mark.as_quat(scalar_first=True))
    rig = replace(BOX, tracked=tracked, world=world.as_quat(scalar_first=True))
    states = tumbling_boxes(N, np.random.default_rng(8))
    given = others | {"angle_offset": dict(zip(("d_rx", "d_ry", "d_rz"), d))}
    values = {f"{name}.{key}": value for name, p in given.items() for key, value in p.items()}
    model = Model(LAWS["mirtich"], tuple(EFFECTS[name] for name in given), space=SPACE)
    seen = bind(model, {"mu": MU, "epsilon": EPSILON} | values, rig).to_measured(states)
    body, measured = (Rotation.from_quat(one.attitude.T, scalar_first=True) for one in (states, seen))
    return world * measured * mark, world * body * Rotation.from_rotvec(d) * mark


@pytest.mark.parametrize("reading, P", [(1.0, [1, -1, -1, -1]), (4.0, [1, 1, -1, 1])])
def test_a_quaternion_is_misread_after_the_tracked_frame_is_fixed_to_the_body(reading: float, P: list[int]) -> None:
    """q of the file is P q(R_WS exp(d) R_ST)."""
    seen, fixed = seen_in_space({"misread_rotation": {"reading": reading}})
    q = fixed.as_quat(scalar_first=True) * P
    off = Rotation.from_quat(q, scalar_first=True).inv() * seen
    np.testing.assert_allclose(off.magnitude(), 0.0, atol=1e-9)


@pytest.mark.parametrize("axis", [1, 2, 3])
def test_in_space_the_attitude_of_the_tracked_frame_is_mirrored(axis: int) -> None:
    """R of the file is M R_WS exp(d) R_ST M, so that d is the offset that is to be corrected in dataset.yaml."""
    seen, fixed = seen_in_space({"mirrored_rotation": {"mirrored_axis": float(axis)}})
    M = np.diag(np.where(np.arange(1, 4) == axis, -1.0, 1.0))
    np.testing.assert_allclose(seen.as_matrix(), M @ fixed.as_matrix() @ M, atol=1e-9)


@pytest.mark.parametrize("name", ["wear", "position_dependent_restitution", "velocity_dependent_restitution"])
def test_adhesion_takes_the_same_energy_whatever_else_lowers_restitution(name: str) -> None:
    adhesion, other = EFFECTS["adhesion"], EFFECTS[name]
    states = random_states(RIG, N, np.random.default_rng(4))
    rebounds = []
    for on in ((other,), (other, adhesion)):
        values = {"mu": 0.0, "epsilon": 0.8} | {f"{e.name}.{k}": v for e in on for k, v in at_scale(e).items()}
        model = Model(LAWS["mirtich"], on)
        r_x = bind(model, values, RIG).measured_contact(states)[1].r[0]
        after = bind(model, values, RIG).predict(states)
        rebounds.append((after.vy + r_x * after.omega) ** 2)
    lost, expected = rebounds[0] - rebounds[1], 0.3**2  # v_s at its scale
    assert np.all(rebounds[1] > 0.0)
    np.testing.assert_allclose(lost, expected, atol=ROUNDING)


def test_the_origin_circles_a_centre_of_mass_whose_spin_is_damped() -> None:
    com, drag = EFFECTS["com_offset"], EFFECTS["linear_drag"]
    values = {"mu": MU, "epsilon": EPSILON, "com_offset.c_x": 2e-3, "com_offset.c_y": 0.0}
    values |= {"linear_drag.c_v": 0.0, "linear_drag.c_w": 3.0}
    states = random_states(RIG, N, np.random.default_rng(5))
    a = bind(Model(LAWS["mirtich"], (drag, com)), values, RIG).acceleration(states)
    C = 2e-3 * np.stack([np.cos(states.theta), np.sin(states.theta)], axis=1)
    alpha = -3.0 * states.omega
    circle = states.omega[:, None] ** 2 * C - alpha[:, None] * np.stack([-C[:, 1], C[:, 0]], axis=1)
    np.testing.assert_allclose(a, GRAVITY + np.column_stack([circle, alpha]), atol=1e-9)


def test_a_contact_that_sticks_springs_back_though_rolling_is_resisted_too() -> None:
    """Tangential restitution asks the law's own impulse whether it sticks, before others change that impulse."""
    spring, rolling = EFFECTS["tangential_restitution"], EFFECTS["contact_torque"]
    states = random_states(RIG, 60, np.random.default_rng(6))
    after = {}
    for e_t in (0.0, 0.2):
        values = {"mu": 1.0, "epsilon": EPSILON, "contact_torque.m_r": 5e-4, "tangential_restitution.e_t": e_t}
        after[e_t] = bind(Model(LAWS["mirtich"], (rolling, spring)), values, RIG).predict(states).v
    assert np.mean(np.abs(after[0.2] - after[0.0]).max(axis=1) > 1e-3) > 0.5
