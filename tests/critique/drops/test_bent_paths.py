"""Paths that the camera bends: what a lens makes of lines and of parabolas through flights, and back."""

from types import SimpleNamespace

import numpy as np
import pytest

from thesis_lib.bodies.shapes import Disk
from thesis_lib.contact import LAWS
from thesis_lib.critique.contacts.kinds import bind
from thesis_lib.critique.contacts.model import Model
from thesis_lib.critique.likelihood.at_impact import state_beside
from thesis_lib.critique.likelihood.flights import Flights
from thesis_lib.datasets.flights.lines import side_lines
from thesis_lib.datasets.format.samples import Samples
from thesis_lib.effects import EFFECTS
from thesis_lib.effects.effect import Rig
from thesis_lib.mechanics.space import PLANE
from thesis_lib.mechanics.state import State

RIG = Rig(Disk(radius=0.03), 0.0212, 9.81, 0.0)
N, WINDOW, FLIGHT, RATE = 12, 0.1, 0.3, 250.0
TAU = np.linspace(-0.5 * FLIGHT, 0.5 * FLIGHT, 76)
NEAR_POSE, NEAR_SPEED, NEAR_FALL = 2e-5, 5e-4, 5e-3  # m, m/s, m/s²: a tenth of what a noise of 0.2 mm makes of them
CASES = {
    "lens": {"k_1": 0.16, "c_x": 0.05, "c_y": 0.2},  # 1 % at 0.25 m
    "marker_offset": {"d_x": 4e-3, "d_y": -3e-3},
}
EACH = pytest.mark.parametrize("name, sign", [("lens", 1.0), ("lens", -1.0), ("marker_offset", 1.0)])


def model_of(name: str, sign: float) -> tuple[Model, dict[str, float], dict[str, float]]:
    """With linear drag, too, so that the true flight is not a parabola either."""
    p = CASES[name] | ({"k_1": sign * CASES[name]["k_1"]} if name == "lens" else {})
    model = Model(LAWS["mirtich"], (EFFECTS["linear_drag"], EFFECTS[name]))
    drag = {"linear_drag.c_v": 0.1, "linear_drag.c_w": 0.0}
    return model, {f"{name}.{key}": value for key, value in p.items()} | drag, p


def flown(state: State, h: float) -> State:
    """The states after h in s with drag, exactly."""
    c, rate = 0.1, -np.expm1(-0.1 * h) / 0.1
    fall = RIG.gravity / c
    return state.moved(
        x=state.x + rate * state.vx,
        y=state.y + rate * (state.vy + fall) - fall * h,
        theta=state.theta + h * state.omega,
        vx=state.vx * np.exp(-c * h),
        vy=(state.vy + fall) * np.exp(-c * h) - fall,
    )


def states(height: float, falling: float = 2.0) -> State:
    """At a height in m, with vertical velocities from 1 m/s up to 1 m/s down about `falling` in m/s."""
    rng = np.random.default_rng(8)
    q = np.stack([rng.uniform(-0.2, 0.2, N), np.full(N, height), rng.uniform(-3.0, 3.0, N)], axis=1)
    v = np.stack([rng.uniform(-1.0, 1.0, N), rng.uniform(-1.0, 1.0, N) - falling, rng.uniform(-15.0, 15.0, N)], axis=1)
    return State.of(q, v, np.arange(N), np.zeros(N))


@EACH
def test_the_state_at_impact_is_found_behind_a_line_through_a_bent_path(name: str, sign: float) -> None:
    model, values, p = model_of(name, sign)
    true, t = states(0.03), np.arange(-WINDOW, 1e-9, 1.0 / RATE)
    seen = np.stack([EFFECTS[name].to_measured(flown(true, h), p, RIG).q for h in t], axis=1)
    later = seen[:, -1:] + np.arange(1, 5)[:, None] / RATE  # the side after is not looked at
    times = np.r_[t, np.arange(1, 5) / RATE]
    run = np.repeat(np.arange(N), len(times))
    samples = Samples(run, np.tile(times, N), np.concatenate([seen, later], axis=1).reshape(-1, 3), run)
    edges = np.tile([-np.inf, 1e-6, 1e-6, np.inf], (N, 1))
    lines = side_lines(samples, np.arange(N), np.zeros(N), edges, np.full((N, 2), 40), np.ones(3))
    names = ("value", "slope", "bow", "nodes", "weights")
    of_lines = {key: getattr(lines, key) for key in names}
    o = SimpleNamespace(
        rig=RIG, space=PLANE, trial=np.arange(N), t=np.zeros(N), span=np.zeros(N), arcs=True, **of_lines
    )
    o.lines = lambda side: State.of(lines.value[:, side], lines.slope[:, side], o.trial, o.t)
    found, exact = state_beside(bind(model, values, o.rig), o, 0), EFFECTS[name].to_measured(true, p, RIG)
    np.testing.assert_allclose(found.q, exact.q, atol=NEAR_POSE)
    np.testing.assert_allclose(found.v[:, :2], exact.v[:, :2], atol=NEAR_SPEED)
    parabola = lines.slope[:, 0] - lines.bow[:, 0, 1:] * RIG.fall(true).T
    assert np.abs(parabola - exact.v)[:, :2].max() > 20.0 * NEAR_SPEED


def require_seen(path: np.ndarray, model: Model, values: dict[str, float]) -> None:
    """Of flights along these paths (n, m, 3) at `TAU` the model leaves nothing, and free fall much."""
    fits = np.stack([np.polyfit(TAU, one, 2) for one in path])
    state = State.of(fits[:, 2], fits[:, 1], np.arange(N), np.zeros(N))
    flights = Flights(state, np.ones((N, 3)), 2.0 * fits[:, 0], np.full(N, FLIGHT))
    np.testing.assert_allclose(flights.residuals(bind(model, values, RIG))[:, :2], 0.0, atol=NEAR_FALL)
    assert np.abs(flights.residuals(bind(Model(LAWS["mirtich"]), {}, RIG)))[:, :2].max() > 20.0 * NEAR_FALL


@EACH
def test_a_flight_has_the_acceleration_of_the_parabola_through_its_bent_path(name: str, sign: float) -> None:
    model, values, p = model_of(name, sign)
    true = states(0.3, falling=0.0)
    require_seen(np.stack([EFFECTS[name].to_measured(flown(true, h), p, RIG).q for h in TAU], axis=1), model, values)


def test_a_flight_of_a_displaced_centre_of_mass_has_the_acceleration_of_its_origin_on_a_circle() -> None:
    c_x, c_y = 1e-3, -2e-3
    model, values = Model(LAWS["mirtich"], (EFFECTS["com_offset"],)), {"com_offset.c_x": c_x, "com_offset.c_y": c_y}
    centre, tau = states(0.3, falling=0.0), TAU[:, None]
    q = centre.q[:, None] + centre.v[:, None] * tau + 0.5 * RIG.fall(centre).T[:, None] * tau**2
    lever = (c_x + 1j * c_y) * np.exp(1j * q[..., 2])  # from the origin to the centre
    require_seen(q - np.stack([lever.real, lever.imag, np.zeros_like(lever.real)], axis=-1), model, values)
