"""Each effect does what its equation says: cases worked out by hand or by an independent computation."""

import numpy as np
import pytest
from stage_predictor import EPSILON, MU, RIGS, arrays, at_scale, predict, random_states

from thesis_lib.bodies.shapes import Disk, Polygon
from thesis_lib.contact import LAWS
from thesis_lib.contact.space import ContactSpace, contact_space, residual_couple
from thesis_lib.effects import EFFECTS
from thesis_lib.effects.effect import Impulse, Rig, State
from thesis_lib.effects.impulse_path import STEPS, walk

N = 400
EXACT = 1e-12  # rounding of quantities of order 1 to 10
RADIUS = 0.03
DISK = Rig(Disk(radius=RADIUS), RADIUS / np.sqrt(2.0), 9.81, 0.0)
HALF = 0.03  # half the side of the square
SQUARE = Rig(
    Polygon(vertices=((HALF, HALF), (-HALF, HALF), (-HALF, -HALF), (HALF, -HALF))), 0.0245, 9.81, 0.0
)


def one_state(**given: float) -> State:
    """One body at rest at the origin, but for the given values."""
    values = dict.fromkeys(("x", "y", "theta", "vx", "vy", "omega", "trial", "t"), 0.0) | given
    return State(**{name: np.array([value]) for name, value in values.items()})


def on(name: str, **p: float):
    """An effect with these parameters, the others at null."""
    effect = EFFECTS[name]
    return [(effect, {q.name: q.null for q in effect.parameters} | p)]


def coefficients(name: str, v_t: float = 0.0, v_n: float = -1.0, **given: float) -> tuple[float, float]:
    """μ and ε that an effect makes of 0.2 and 0.5."""
    state = {key: given.pop(key) for key in ("x", "theta", "trial") if key in given}
    space = ContactSpace(*(np.array([a]) for a in (v_t, v_n, 3.0, 1.0, 0.0)))
    effect, p = on(name, **given)[0]
    mu, epsilon = effect.coefficients(np.array([0.2]), np.array([0.5]), space, one_state(**state), p, DISK)
    return float(mu[0]), float(epsilon[0])


@pytest.fixture(scope="module")
def quadrilateral() -> tuple[Rig, State]:
    rig = RIGS["quadrilateral"]
    return rig, random_states(rig, N, np.random.default_rng(21))


# contact law ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "law", ["anitescu_potra_newton", "anitescu_potra_poisson", "mirtich", "drumwright_shell"]
)
def test_tangential_restitution_turns_the_slip(law: str) -> None:
    state = one_state(vx=0.2, vy=-2.0, omega=3.0)
    v_t = 0.2 + RADIUS * 3.0
    made = predict(on("tangential_restitution", e_t=0.4), state, DISK, law, mu=1.0)
    after = made.impact[0]
    np.testing.assert_allclose(after[0] + RADIUS * after[2], -0.4 * v_t, rtol=1e-9)
    np.testing.assert_allclose(after[1], 2.0 * EPSILON, rtol=1e-9)


def test_tangential_restitution_keeps_to_the_cone_and_leaves_slip(quadrilateral) -> None:
    rig, states = quadrilateral
    base, made = predict([], states, rig), predict(on("tangential_restitution", e_t=0.8), states, rig)
    slides = np.abs(base.impulse.c_t) >= MU * base.impulse.c_n * (1 - 1e-9)
    assert 0.2 < slides.mean() < 0.95
    np.testing.assert_array_equal(made.impulse.c_t[slides], base.impulse.c_t[slides])
    assert (np.abs(made.impulse.c_t) <= MU * made.impulse.c_n * (1 + EXACT)).all()
    assert (np.abs(made.impulse.c_t[~slides]) > np.abs(base.impulse.c_t[~slides])).all()


def test_tangential_restitution_leaves_slip_that_turned_inside_the_cone(quadrilateral) -> None:
    rig, states = quadrilateral
    given = {"law": "wang_mason", "mu": 0.1}
    base = predict([], states, rig, **given)
    made = predict(on("tangential_restitution", e_t=0.8), states, rig, **given)
    v_t = base.space.velocity_after(base.impulse.c_t, base.impulse.c_n)[0]
    turned = (np.abs(base.impulse.c_t) < 0.09 * base.impulse.c_n) & (np.abs(v_t) > 1e-3)
    assert turned.sum() > 5
    np.testing.assert_array_equal(made.impulse.c_t[turned], base.impulse.c_t[turned])
    assert (made.impulse.c_t != base.impulse.c_t).any()


SPRING_ERROR = 0.02  # of 20 steps a phase, relative to the stick impulse


def with_path(
    name: str, space: ContactSpace, mu: float, epsilon: float, state: State | None = None, r=None, **p
):
    """Impulse of the exact path law with an effect, and without."""
    n = len(space.v_t)
    mus, epsilons, zero = np.full(n, mu), np.full(n, epsilon), np.zeros(n)
    with np.errstate(all="ignore"):
        law = Impulse(*LAWS["mirtich"].impulse(space, mus, epsilons), zero)
    effect, p = on(name, **p)[0]
    return effect.impulse(law, space, mus, epsilons, r, state, p, DISK), law


def random_space(rng: np.random.Generator, n: int) -> ContactSpace:
    """Skewed contacts that slide either way, with every outcome at μ = 0.3."""
    return ContactSpace(
        rng.uniform(-2, 2, n),
        -rng.uniform(0.5, 2, n),
        rng.uniform(2, 4, n),
        rng.uniform(1, 2, n),
        rng.uniform(-0.6, 0.6, n),
    )


@pytest.mark.parametrize("eta", [0.4, 1.2, 3.0])
def test_compliance_without_slip_is_an_oscillator(eta: float) -> None:
    K_tt = np.array([1.5, 3.0, 4.0])
    space = ContactSpace(np.full(3, 1e-3), np.full(3, -2.0), K_tt, np.ones(3), np.zeros(3))
    made, _ = with_path("tangential_compliance", space, 1e6, 1.0, eta=eta, zeta=0.0)
    stick = -space.v_t / K_tt
    np.testing.assert_allclose(made.c_t / stick, 1 - np.cos(np.pi * np.sqrt(K_tt / eta)), atol=1e-9)
    np.testing.assert_allclose(made.c_n, 4.0, rtol=1e-9)


def test_compliance_in_gross_slip_is_coulomb() -> None:
    space = ContactSpace(np.full(1, 6.0), np.full(1, -1.0), np.full(1, 3.0), np.ones(1), np.zeros(1))
    made, _ = with_path("tangential_compliance", space, 0.2, 0.5, eta=1.2)
    np.testing.assert_allclose(made.c_t, -0.2 * 1.5, rtol=1e-3)


def test_compliance_goes_to_the_rigid_contact() -> None:
    space = random_space(np.random.default_rng(3), 100)
    change = []
    for eta in (1e-2, 1e-4, 1e-6):
        made, law = with_path("tangential_compliance", space, 0.3, 0.6, eta=eta)
        change.append(np.abs(made.c_t - law.c_t).mean())
    assert change[0] > 2 * change[1] and change[2] < 1e-3


def compliant_motion(space: ContactSpace, mu: float, epsilon: float, eta: float, zeta: float, steps: int):
    """(c_t, c_n) by small steps in time of two springs and a slider; unloading stiffer by 1/ε², as in Stronge's model.

    Units: k_n = 1, so that k_t = 1/η.
    """
    n = len(space.v_t)
    k_t = 1.0 / eta
    damping = 2.0 * zeta * np.sqrt(k_t / space.K_tt)
    dt = 0.5 * np.pi / np.sqrt(space.K_nn) * min(epsilon, 1.0) / steps
    v_t, v_n, z = space.v_t.copy(), space.v_n.copy(), np.zeros(n)
    depth, deepest, c_t, c_n = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)
    for _ in range(6 * steps):
        depth = depth - 0.5 * dt * v_n
        deepest = np.maximum(deepest, depth)
        f_n = np.maximum((depth - (1.0 - epsilon**2) * deepest) / epsilon**2, 0.0)
        slip = v_t + dt * space.K_tn * f_n
        f_t = np.clip(-k_t * (z + dt * slip) - damping * slip, -mu * f_n, mu * f_n)
        z = (damping / dt * z - f_t) / (k_t + damping / dt)
        v_t = v_t + dt * (space.K_tt * f_t + space.K_tn * f_n)
        v_n = v_n + dt * (space.K_tn * f_t + space.K_nn * f_n)
        depth = depth - 0.5 * dt * v_n
        c_t, c_n = c_t + dt * f_t, c_n + dt * f_n
    return c_t, c_n


@pytest.mark.parametrize("eta, zeta", [(0.04, 0.15), (0.3, 0.1), (1.1, 0.03)])
def test_compliance_agrees_with_fine_integration_of_forces(eta: float, zeta: float) -> None:
    space = random_space(np.random.default_rng(4), 80)
    c_t, c_n = compliant_motion(space, 0.3, 0.6, eta, zeta, 2000)
    made, law = with_path("tangential_compliance", space, 0.3, 0.6, eta=eta, zeta=zeta)
    rest, before = (np.hypot(one.c_t - c_t, one.c_n - c_n) for one in (made, law))
    size = np.abs(c_t).mean()
    assert rest.mean() < SPRING_ERROR * size
    assert before.mean() > 3 * rest.mean()
    assert (np.abs(made.c_t) <= 0.3 * made.c_n * (1 + EXACT)).all()


def test_compliance_reverses_slip_and_gains_no_energy() -> None:
    rng = np.random.default_rng(2)
    space = ContactSpace(rng.uniform(-2, 2, N), np.full(N, -1.0), np.full(N, 3.0), np.ones(N), np.zeros(N))
    made, _ = with_path("tangential_compliance", space, 0.3, 1.0, eta=1.0, zeta=0.02)
    after = space.v_t + 3.0 * made.c_t
    assert (np.abs(after) <= np.abs(space.v_t) * (1 + 1e-3)).all()
    psi = np.abs(space.v_t) / 0.3
    turned = after * space.v_t < 0
    # Maw, Barber and Fawcett: back-spin at intermediate angles, none at small ones and in gross slip
    assert (
        turned[(psi > 2.5) & (psi < 5)].all() and not turned[psi > 6.5].any() and not turned[psi < 0.8].any()
    )


def test_path_in_steps_converges_to_the_exact_one() -> None:
    space = random_space(np.random.default_rng(6), N)
    for mu, epsilon in ((0.1, 0.6), (0.5, 0.4), (0.3, 1.0)):
        mus, epsilons = np.full(N, mu), np.full(N, epsilon)
        with np.errstate(all="ignore"):
            exact = LAWS["mirtich"].impulse(space, mus, epsilons)
        errors = []
        for steps in (STEPS, 8 * STEPS):
            made = walk(space, mus, epsilons, steps=steps)
            errors.append(np.hypot(made.c_t[1] - exact[0], made.c_n[1] - exact[1]).mean())
        assert errors[0] < 5e-3 and errors[1] < errors[0] / 5


def test_restitution_falls_with_speed() -> None:
    assert coefficients("velocity_dependent_restitution", v_n=-2.0, p=0.25) == (0.2, 0.5 * 2**-0.25)
    assert coefficients("velocity_dependent_restitution", v_n=-1.0, p=0.25) == (0.2, 0.5)
    assert coefficients("velocity_dependent_restitution", v_n=-1e-9, p=0.9)[1] == 1.0
    assert coefficients("velocity_dependent_restitution", v_n=-2.0, c=0.1)[1] == pytest.approx(
        0.5 * np.exp(-0.2)
    )


def test_exponential_restitution_follows_a_viscous_spring() -> None:
    # a spring with the factor 1 + d δ̇ (Hunt and Crossley), small dissipation: ε = 1 − 2 d v / 3, c = (1 + ε) d / 3
    d, dt = 0.02, 1e-3
    for speed in (0.5, 1.5, 3.0):
        depth, rate = 0.0, speed
        while depth >= 0.0:
            depth += 0.5 * dt * rate
            rate -= dt * depth * (1.0 + d * rate)
            depth += 0.5 * dt * rate
        effect, p = on("velocity_dependent_restitution", c=2.0 * d / 3.0)[0]
        space = ContactSpace(*(np.array([a]) for a in (0.0, -speed, 3.0, 1.0, 0.0)))
        found = effect.coefficients(np.zeros(1), np.ones(1), space, None, p, DISK)[1][0]
        assert -rate / speed == pytest.approx(found, abs=1e-3) and found < 0.995


def test_friction_at_the_ends_of_the_stribeck_curve() -> None:
    # gross slip: far above v_s it is μ, far below μ (1 + s)
    for v_t, mu, v_s, factor in ((8.0, 0.2, 0.5, 1.0), (-8.0, 0.2, 0.5, 1.0), (0.3, 0.02, 3.0, 1.4)):
        space = ContactSpace(*(np.array([a]) for a in (v_t, -1.0, 3.0, 1.0, 0.0)))
        made, _ = with_path("velocity_dependent_friction", space, mu, 0.5, s=0.4, v_s=v_s)
        np.testing.assert_allclose(made.c_t, -np.sign(v_t) * factor * mu * 1.5, rtol=5e-3)
        np.testing.assert_allclose(made.c_n, 1.5, rtol=1e-9)


@pytest.mark.parametrize("s", [0.8, -0.5])
def test_stribeck_agrees_with_fine_steps(s: float) -> None:
    mu, epsilon, v_s, steps = 0.3, 0.6, 0.5, 20000
    space = random_space(np.random.default_rng(14), 60)
    v_t, v_n, c_t = space.v_t.copy(), space.v_n.copy(), np.zeros(60)
    work, least, done, c_n = np.zeros(60), np.zeros(60), np.zeros(60, bool), np.zeros(60)
    dp = 8.0 / steps
    for i in range(steps):
        limit = mu * (1.0 + s * np.exp(-((v_t / v_s) ** 2))) * dp
        d = np.where(done, 0.0, np.clip(-(v_t + space.K_tn * dp) / space.K_tt, -limit, limit))
        c_t, v_t = c_t + d, v_t + space.K_tt * d + space.K_tn * dp
        rise = space.K_nn * dp + space.K_tn * d
        work = work + dp * (v_n + 0.5 * rise)
        v_n, least = v_n + rise, np.minimum(least, work)
        ends = ~done & (v_n > 0.0) & (work >= (1.0 - epsilon**2) * least)
        c_n, done = np.where(ends, (i + 1) * dp, c_n), done | ends
    assert done.all()
    made, law = with_path("velocity_dependent_friction", space, mu, epsilon, s=s, v_s=v_s)
    rest, before = (np.hypot(one.c_t - c_t, one.c_n - c_n) for one in (made, law))
    assert rest.mean() < 5e-3 and before.mean() > 5 * rest.mean()


def test_friction_depends_on_direction() -> None:
    assert coefficients("anisotropic_friction", v_t=0.1, a_t=0.1)[0] == pytest.approx(0.22)
    assert coefficients("anisotropic_friction", v_t=-0.1, a_t=0.1)[0] == pytest.approx(0.18)


def test_contact_torque_by_hand() -> None:
    # frictionless disk: c_n = (1 + ε) 2 = 3, τ = −m_r c_n against ω, and nothing else moves
    state = one_state(vy=-2.0, omega=10.0)
    made = predict(on("contact_torque", m_r=5e-4), state, DISK, mu=0.0, epsilon=0.5)
    np.testing.assert_allclose(made.impact[0], [0.0, 1.0, 10.0 - 1.5e-3 / DISK.k_g**2], atol=EXACT)
    # a longer lever stops the turning, and then holds it
    made = predict(on("contact_torque", m_r=2e-2), state, DISK, mu=0.0, epsilon=0.5)
    np.testing.assert_allclose(made.impact[0], [0.0, 1.0, 0.0], atol=1e-10)


def test_contact_torque_moves_the_end_of_restitution() -> None:
    # frictionless, r_x = 0.01 m, ω > 0 throughout: dv_n = (K_nn − m_r r_x / k²) dp, so c_n by hand
    m_r, r_x, r_y, omega = 1e-3, 0.01, -0.03, 30.0
    k2 = DISK.k_g**2
    state = one_state(vy=-2.0 - r_x * omega, omega=omega)
    r = np.array([r_x]), np.array([r_y])
    space = contact_space(
        np.array([[0.0, state.vy[0], omega]]), np.array([[r_x, r_y]]), mass=1.0, k_g=DISK.k_g
    )
    made, _ = with_path("contact_torque", space, 0.0, 0.5, state, r, m_r=m_r)
    c_n = 1.5 * 2.0 / (1.0 + (r_x * r_x - m_r * r_x) / k2)
    np.testing.assert_allclose([made.c_n[0], made.tau[0]], [c_n, -m_r * c_n], rtol=1e-9)


def test_contact_torque_opposes_rolling_and_keeps_sticking(quadrilateral) -> None:
    rig, states = quadrilateral
    m_r = 1e-3
    given = {"law": "mirtich", "mu": 0.4}
    base = predict([], states, rig, **given)
    made = predict(on("contact_torque", m_r=m_r), states, rig, **given)
    r = rig.shape.contact_point(states.theta)
    before = np.stack([states.vx, states.vy, states.omega], axis=-1)
    tau = residual_couple(made.impact - before, r, mass=1.0, k_g=rig.k_g)
    np.testing.assert_allclose(tau, made.impulse.tau, atol=EXACT)
    assert (np.abs(tau) <= m_r * made.impulse.c_n * (1 + EXACT)).all()
    # where the body turns one way throughout, the couple is the whole lever against it; a few turn round and back
    oneway = (states.omega * made.impact[:, 2] > 25.0) & (states.omega * base.impact[:, 2] > 25.0)
    whole = -np.sign(states.omega) * m_r * made.impulse.c_n
    assert oneway.sum() > 20 and np.isclose(tau, whole, rtol=1e-2)[oneway].mean() > 0.95
    # what stuck still has no slip: it rolls; friction never leaves the cone
    sticks = np.abs(base.space.velocity_after(base.impulse.c_t, base.impulse.c_n)[0]) < 1e-9
    slip = made.impact[:, 0] - r[:, 1] * made.impact[:, 2]
    inside = np.abs(made.impulse.c_t) < 0.8 * 0.4 * made.impulse.c_n
    assert (sticks & inside).sum() > 10
    left = np.abs(slip[sticks & inside])  # m/s; some where sticking begins in the last step
    assert np.mean(left < 1e-3) > 0.95 and left.max() < 0.05
    assert (np.abs(made.impulse.c_t) <= 0.4 * made.impulse.c_n * (1 + EXACT)).all()


@pytest.mark.parametrize("epsilon", [0.0, 0.6, 1.0])
@pytest.mark.parametrize("name", ["contact_torque", "velocity_dependent_friction", "tangential_compliance"])
def test_path_effects_push_dissipate_and_do_not_penetrate(name: str, epsilon: float, quadrilateral) -> None:
    rig, states = quadrilateral
    made = predict([(EFFECTS[name], at_scale(EFFECTS[name]))], states, rig, "mirtich", 0.3, epsilon)
    metric = np.array([1.0, 1.0, rig.k_g**2])
    before = np.stack([states.vx, states.vy, states.omega], axis=-1) ** 2 @ metric
    assert (made.impact**2 @ metric <= before * (1 + 1e-3)).all()
    assert (made.impulse.c_n >= 0.0).all()
    r_x = rig.shape.contact_point(states.theta)[:, 0]
    assert (made.impact[:, 1] + r_x * made.impact[:, 2] >= -5e-3).all()


@pytest.mark.parametrize("name", ["contact_torque", "velocity_dependent_friction", "tangential_compliance"])
def test_path_effects_are_continuous(name: str, quadrilateral) -> None:
    rig, states = quadrilateral
    p = at_scale(EFFECTS[name])
    one = predict([(EFFECTS[name], p)], states, rig, "mirtich").impact
    for key in p:
        other = predict([(EFFECTS[name], p | {key: p[key] * (1 + 1e-6)})], states, rig, "mirtich").impact
        assert np.abs(other - one).max() < 1e-3


def test_adhesion_takes_energy() -> None:
    assert coefficients("adhesion", v_n=-1.0, v_s=0.3)[1] == pytest.approx(0.4)
    assert coefficients("adhesion", v_n=-0.5, v_s=0.3)[1] == 0.0
    state = one_state(vy=-1.5)
    rebound = [predict(on("adhesion", v_s=v_s), state, DISK).impact[0, 1] for v_s in (0.0, 0.4)]
    np.testing.assert_allclose(rebound[0] ** 2 - rebound[1] ** 2, 0.4**2)


def test_restitution_depends_on_body_angle() -> None:
    name = "orientation_dependent_restitution"
    assert coefficients(name, theta=0.0, a_c=0.1)[1] == pytest.approx(0.55)
    assert coefficients(name, theta=np.pi / 2, a_c=0.1)[1] == pytest.approx(0.45)
    assert coefficients(name, theta=np.pi / 4, a_s=0.2)[1] == pytest.approx(0.6)


def test_wear_counts_trials() -> None:
    assert coefficients("wear", trial=100.0, w=-1e-3)[1] == pytest.approx(0.45)
    assert coefficients("wear", trial=0.0, w=-1e-3)[1] == 0.5


# geometry and inertia -------------------------------------------------------------------------------------------------


def contact_point(name: str, rig: Rig, theta: np.ndarray, **p: float) -> np.ndarray:
    effect, p = on(name, **p)[0]
    zero = np.zeros_like(theta)
    state = State(zero, zero, theta, zero, zero, zero, zero, zero)
    return np.stack(effect.contact_point(*rig.shape.contact_point(theta).T, state, p, rig), axis=-1)


def test_rounded_corner_by_hand() -> None:
    rho = 5e-3
    r = contact_point("rounded_corners", SQUARE, np.array([np.pi / 4, 0.2]), rho=rho)
    np.testing.assert_allclose(r[0], [0.0, -(np.sqrt(2) * HALF - rho * (np.sqrt(2) - 1))], atol=EXACT)
    # at 0.2 rad the corner (−a, −a) is lowest; its arc has the centre (−a + ρ, −a + ρ)
    centre = HALF - rho
    sin, cos = np.sin(0.2), np.cos(0.2)
    np.testing.assert_allclose(r[1], [centre * (sin - cos), -centre * (sin + cos) - rho], atol=EXACT)


def test_square_rounded_as_far_as_it_goes_is_a_disk() -> None:
    theta = np.linspace(-3.0, 3.0, 50)
    r = contact_point("rounded_corners", SQUARE, theta, rho=0.05)
    np.testing.assert_allclose(r, np.tile([0.0, -HALF], (50, 1)), atol=EXACT)


def test_rounded_quadrilateral_against_its_outline() -> None:
    # outline: points of the shrunk polygon, found as the set at distance ≥ ρ from all sides, grown by ρ
    rig, rho = RIGS["quadrilateral"], 4e-3
    v = np.array(rig.shape.vertices)
    along = np.roll(v, -1, axis=0) - v
    normal = np.stack([along[:, 1], -along[:, 0]], axis=-1) / np.linalg.norm(along, axis=1)[:, None]
    reach = np.sum(normal * v, axis=1) - rho
    inner = np.array([np.linalg.solve(normal[[i - 1, i]], reach[[i - 1, i]]) for i in range(4)])
    angle = np.linspace(0, 2 * np.pi, 20001)
    outline = (inner[:, None] + rho * np.stack([np.cos(angle), np.sin(angle)], axis=-1)).reshape(-1, 2)
    theta = np.random.default_rng(1).uniform(-np.pi, np.pi, 40)
    expected = []
    for one in theta:
        turned = outline @ np.array([[np.cos(one), np.sin(one)], [-np.sin(one), np.cos(one)]])
        expected.append(turned[np.argmin(turned[:, 1])])
    found = contact_point("rounded_corners", rig, theta, rho=rho)
    np.testing.assert_allclose(found, expected, atol=rho * angle[1])
    # order of the corners and points inside the hull do not matter
    for vertices in (rig.shape.vertices[::-1], (*rig.shape.vertices, (0.0, 0.001))):
        other = Rig(Polygon(vertices=vertices), rig.k_g, 9.81, 0.0)
        np.testing.assert_allclose(contact_point("rounded_corners", other, theta, rho=rho), found, atol=EXACT)


@pytest.mark.parametrize("name, p", [("rounded_corners", {"rho": 4e-3}), ("wrong_size", {"s": -0.05})])
def test_gap_closes_with_the_true_shape(name: str, p: dict, quadrilateral) -> None:
    # put the true body on the surface: the gap of the believed one is the gap that the effect predicts
    rig, states = quadrilateral
    r = contact_point(name, rig, states.theta, **p)
    touching = states.moved(y=rig.height - r[:, 1])
    np.testing.assert_allclose(predict(on(name, **p), touching, rig).touch, 0.0, atol=EXACT)
    assert np.abs(predict([], touching, rig).touch).max() > 1e-3


def test_contact_point_offset_is_a_lever(quadrilateral) -> None:
    rig, states = quadrilateral
    made = predict(on("contact_point_offset", d_r=1e-3), states, rig)
    before = np.stack([states.vx, states.vy, states.omega], axis=-1)
    believed = rig.shape.contact_point(states.theta)
    couple = residual_couple(made.impact - before, believed, mass=1.0, k_g=rig.k_g)
    np.testing.assert_allclose(couple, 1e-3 * made.impulse.c_n, atol=EXACT)


def mass_matrix(c: np.ndarray, k_g: float) -> np.ndarray:
    """Inertia (n, 3, 3) of a unit mass for the velocity of the origin, the centre of mass being at c (n, 2)."""
    M = np.zeros((len(c), 3, 3))
    M[:, 0, 0] = M[:, 1, 1] = 1.0
    M[:, 0, 2] = M[:, 2, 0] = -c[:, 1]
    M[:, 1, 2] = M[:, 2, 1] = c[:, 0]
    M[:, 2, 2] = k_g**2 + np.sum(c * c, axis=1)
    return M


def turned(theta: np.ndarray, c: tuple[float, float]) -> np.ndarray:
    """c in the axes of the surface, (n, 2)."""
    rotated = (c[0] + 1j * c[1]) * np.exp(1j * theta)
    return np.stack([rotated.real, rotated.imag], axis=-1)


def test_com_offset_against_the_mass_matrix_of_the_origin(quadrilateral) -> None:
    rig, states = quadrilateral
    c = turned(states.theta, (3e-3, -2e-3))
    r = rig.shape.contact_point(states.theta)
    inverse = np.linalg.inv(mass_matrix(c, rig.k_g))
    J = np.zeros((N, 2, 3))  # rows t, n
    J[:, 0, 0] = J[:, 1, 1] = 1.0
    J[:, 0, 2], J[:, 1, 2] = -r[:, 1], r[:, 0]
    v = np.stack([states.vx, states.vy, states.omega], axis=-1)
    K = J @ inverse @ np.swapaxes(J, 1, 2)
    v_c = np.einsum("nij,nj->ni", J, v)
    space = ContactSpace(v_c[:, 0], v_c[:, 1], K[:, 0, 0], K[:, 1, 1], K[:, 0, 1])
    impulse = np.stack(
        LAWS["anitescu_potra_newton"].impulse(space, np.full(N, MU), np.full(N, EPSILON)), axis=-1
    )
    expected = v + np.einsum("nij,nkj,nk->ni", inverse, J, impulse)
    made = predict(on("com_offset", c_x=3e-3, c_y=-2e-3), states, rig)
    np.testing.assert_allclose(made.impact, expected, rtol=EXACT, atol=EXACT)
    assert np.abs(made.impact - predict([], states, rig).impact).max() > 0.1


def test_com_offset_in_flight_against_lagrange(quadrilateral) -> None:
    # M a = generalised gravity + ω² c, with a spin that something else damps (α given)
    rig, states = quadrilateral
    c = turned(states.theta, (3e-3, -2e-3))
    gravity = np.stack([np.zeros(N), np.full(N, -rig.gravity), -rig.gravity * c[:, 0]], axis=-1)
    circling = np.zeros((N, 3))
    circling[:, :2] = states.omega[:, None] ** 2 * c
    M = mass_matrix(c, rig.k_g)
    expected = np.linalg.solve(M, (gravity + circling)[..., None])[..., 0]
    effect, p = on("com_offset", c_x=3e-3, c_y=-2e-3)[0]
    falling = np.tile([0.0, -rig.gravity, 0.0], (N, 1))
    np.testing.assert_allclose(effect.acceleration(falling, states, p, rig), expected, atol=1e-10)
    # α = 2 rad/s²: the first two rows of M a = F hold, with the force through the centre of mass
    a = effect.acceleration(falling + [0.0, 0.0, 2.0], states, p, rig)
    force = np.einsum("nij,nj->ni", M, a)[:, :2] - circling[:, :2]
    np.testing.assert_allclose(force, gravity[:, :2], atol=1e-10)


def test_wrong_size_and_inertia_equal_the_true_rig(quadrilateral) -> None:
    rig, states = quadrilateral
    larger = Polygon(vertices=tuple((1.05 * x, 1.05 * y) for x, y in rig.shape.vertices))
    true = predict([], states, Rig(larger, rig.k_g, rig.gravity, rig.height))
    made = predict(on("wrong_size", s=0.05), states, rig)
    np.testing.assert_allclose(made.impact, true.impact, atol=1e-11)
    np.testing.assert_allclose(made.touch, true.touch, atol=EXACT)
    true = predict([], states, Rig(rig.shape, rig.k_g * np.sqrt(1.2), rig.gravity, rig.height))
    np.testing.assert_allclose(
        predict(on("wrong_inertia", d_I=0.2), states, rig).impact, true.impact, atol=1e-11
    )


# surface and flight ---------------------------------------------------------------------------------------------------


def flight(name: str, state: State, **p: float) -> np.ndarray:
    effect, p = on(name, **p)[0]
    return effect.acceleration(np.array([[0.0, -9.81, 0.0]]), state, p, DISK)[0]


def test_surface_tilt_turns_gravity() -> None:
    for phi in (-0.3, 0.01, 0.2):
        expected = [9.81 * np.sin(phi), -9.81 * np.cos(phi), 0.0]
        np.testing.assert_allclose(flight("surface_tilt", one_state(), phi=phi), expected, rtol=0, atol=4e-15)


def test_surface_height_is_the_gap(quadrilateral) -> None:
    rig, states = quadrilateral
    raised = states.moved(y=states.y + 2e-3)
    np.testing.assert_allclose(predict(on("surface_height", h=2e-3), raised, rig).touch, 0.0, atol=EXACT)


def test_moving_surface_carries_what_sticks(quadrilateral) -> None:
    rig, states = quadrilateral
    made = predict(on("moving_surface", V=0.5), states, rig, mu=50.0)
    r_y = rig.shape.contact_point(states.theta)[:, 1]
    np.testing.assert_allclose(made.impact[:, 0] - r_y * made.impact[:, 2], 0.5, atol=1e-10)


def test_drifting_camera_looks_like_a_moving_surface(quadrilateral) -> None:
    rig, states = quadrilateral
    drift = predict(on("sensor_drift", d_x=0.3), states, rig)
    np.testing.assert_allclose(
        drift.impact, predict(on("moving_surface", V=0.3), states, rig).impact, atol=1e-12
    )


def test_coefficients_depend_on_place() -> None:
    assert coefficients("position_dependent_friction", x=0.2, g_mu=0.5)[0] == pytest.approx(0.22)
    assert coefficients("position_dependent_friction", x=-3.0, g_mu=0.5)[0] == 0.0
    assert coefficients("position_dependent_restitution", x=-0.2, g_eps=0.5)[1] == pytest.approx(0.45)
    assert coefficients("position_dependent_restitution", x=3.0, g_eps=0.5)[1] == 1.0


def test_flight_by_hand() -> None:
    state = one_state(vx=3.0, vy=-4.0, omega=10.0)
    np.testing.assert_allclose(flight("linear_drag", state, c_v=0.1, c_w=0.2), [-0.3, -9.41, -2.0])
    np.testing.assert_allclose(flight("quadratic_drag", state, c_q=0.1), [-1.5, -7.81, 0.0])
    np.testing.assert_allclose(flight("magnus", state, k_m=0.01), [0.4, -9.51, 0.0])
    np.testing.assert_allclose(flight("wrong_gravity", state, dg=0.1), [0.0, -9.91, 0.0])


@pytest.mark.parametrize("name", ["linear_drag", "quadratic_drag", "magnus"])
def test_power_in_flight(name: str, quadrilateral) -> None:
    rig, states = quadrilateral
    extra = EFFECTS[name].acceleration(np.zeros((N, 3)), states, at_scale(EFFECTS[name]), rig)
    power = extra[:, 0] * states.vx + extra[:, 1] * states.vy + rig.k_g**2 * extra[:, 2] * states.omega
    if name == "magnus":
        np.testing.assert_allclose(power, 0.0, atol=EXACT)
    else:
        assert (power < 0.0).all()


# measurement ----------------------------------------------------------------------------------------------------------


def test_mirrored_rotation_twice_is_identity(quadrilateral) -> None:
    rig, states = quadrilateral
    effect, p = on("mirrored_rotation", mirrored=1.0)[0]
    once = effect.to_true(states, p, rig)
    np.testing.assert_array_equal(once.omega, -states.omega)
    for name, values in arrays(effect.to_true(once, p, rig)).items():
        np.testing.assert_array_equal(values, arrays(states)[name])


def test_mirrored_rotation_looks_like_a_huge_couple() -> None:
    # a disk: Δω has the wrong sign, so τ = −2 k² Δω_true = 2 r_y c_t with c = Δv
    state = one_state(vx=1.0, vy=-2.0, omega=4.0)
    made = predict(on("mirrored_rotation", mirrored=1.0), state, DISK)
    dv = made.impact - [[1.0, -2.0, 4.0]]
    couple = residual_couple(dv, np.array([[0.0, -RADIUS]]), mass=1.0, k_g=DISK.k_g)
    np.testing.assert_allclose(couple, 2 * -RADIUS * made.impulse.c_t, rtol=1e-9)
    assert abs(couple[0]) > 1e-3


def true_drop(rig: Rig, states: State) -> np.ndarray:
    return predict([], states, rig).impact


@pytest.mark.parametrize(
    "name, p",
    [
        ("length_scale", {"s_L": 0.03}),
        ("angle_offset", {"d_theta": 0.05}),
        ("time_lag", {"lag": 3e-3}),
        ("mirrored_rotation", {"mirrored": 1.0}),
        ("sensor_drift", {"d_x": 0.2}),
    ],
)
def test_a_fault_of_the_camera_does_not_change_the_drop(name: str, p: dict, quadrilateral) -> None:
    # a true drop seen through a faulty camera is predicted exactly by the model that knows the fault
    rig, states = quadrilateral
    effect, p = on(name, **p)[0]
    after = states.moved(**dict(zip(("vx", "vy", "omega"), true_drop(rig, states).T)))
    seen_before, seen_after = (effect.to_measured(state, p, rig) for state in (states, after))
    made = predict([(effect, p)], seen_before, rig)
    expected = np.stack([seen_after.vx, seen_after.vy, seen_after.omega], axis=-1)
    np.testing.assert_allclose(made.impact, expected, atol=1e-10)
    np.testing.assert_allclose(made.touch, 0.0, atol=EXACT)  # `states` touch
    jump = [np.asarray(getattr(seen_after, q) - getattr(seen_before, q)) for q in ("x", "y", "theta")]
    np.testing.assert_allclose(made.meet, np.stack(jump, axis=-1), atol=EXACT)
    assert np.abs(predict([], seen_before, rig).impact - expected).max() > 1e-2


def test_time_lag_is_the_angle_of_an_earlier_instant() -> None:
    effect, p = on("time_lag", lag=2e-3)[0]
    seen = effect.to_measured(one_state(theta=0.5, omega=10.0), p, DISK)
    np.testing.assert_allclose(seen.theta, 0.5 - 10.0 * 2e-3)


def test_drift_is_the_integral_of_its_velocity() -> None:
    effect, p = on("sensor_drift", d_x=0.1)[0]
    seen = effect.to_measured(one_state(x=1.0, vx=2.0, t=0.5), p, DISK)
    np.testing.assert_allclose([seen.x[0], seen.vx[0]], [1.05, 2.1])
    unknown = effect.to_measured(one_state(x=1.0, vx=2.0, t=np.nan), p, DISK)
    np.testing.assert_allclose([unknown.x[0], unknown.vx[0]], [1.0, 2.1])


def test_length_scale_is_about_the_surface() -> None:
    rig = Rig(DISK.shape, DISK.k_g, 9.81, 0.5)
    effect, p = on("length_scale", s_L=0.1)[0]
    seen = effect.to_measured(one_state(x=1.0, y=0.7, vx=2.0, vy=-3.0, omega=5.0), p, rig)
    values = [seen.x[0], seen.y[0], seen.vx[0], seen.vy[0], seen.omega[0]]
    np.testing.assert_allclose(values, [1.1, 0.72, 2.2, -3.3, 5.0])


def test_contact_space_of_the_predictor_is_the_library_one() -> None:
    # guards the tests above: masses are 1 and lengths are metres on both sides
    state = one_state(vx=1.0, vy=-2.0, omega=4.0)
    space = contact_space(np.array([[1.0, -2.0, 4.0]]), np.array([[0.0, -RADIUS]]), mass=1.0, k_g=DISK.k_g)
    assert predict([], state, DISK).space.v_t == space.v_t == 1.0 + RADIUS * 4.0
