"""Effects that act along the path of the impulse, against closed forms and fine integration of forces."""

import numpy as np
import pytest
from hand_cases import DISK, EXACT, N, at_rest, on
from stage_predictor import predict

from thesis_lib.contact import LAWS
from thesis_lib.contact.space import contact_space, residual_couple
from thesis_lib.effects import EFFECTS
from thesis_lib.effects.effect import Impulse
from thesis_lib.effects.impulse_path import STEPS, walk
from thesis_lib.extensions.effect_probe import at_scale
from thesis_lib.mechanics.contact import Contact
from thesis_lib.mechanics.state import State

SPRING_ERROR = 0.02  # of 20 steps a phase, relative to the stick impulse


def with_path(name: str, space: Contact, mu: float, epsilon: float, state: State | None = None, **p):
    """Impulse of the exact path law with an effect, and without."""
    n = len(space.v_t)
    space = space.with_coefficients(np.full(n, mu), np.full(n, epsilon))
    with np.errstate(all="ignore"):
        law = Impulse(LAWS["mirtich"].impulse(space, space.mu, space.epsilon), np.zeros(n))
    effect, p = on(name, **p)[0]
    return effect.impulse(law, space, state, p, DISK), law


def random_space(rng: np.random.Generator, n: int) -> Contact:
    """Skewed contacts that slide either way, with every outcome at μ = 0.3."""
    return Contact.planar(
        rng.uniform(-2, 2, n),
        -rng.uniform(0.5, 2, n),
        rng.uniform(2, 4, n),
        rng.uniform(1, 2, n),
        rng.uniform(-0.6, 0.6, n),
    )


@pytest.mark.parametrize("eta", [0.4, 1.2, 3.0])
def test_compliance_without_slip_is_an_oscillator(eta: float) -> None:
    K_tt = np.array([1.5, 3.0, 4.0])
    space = Contact.planar(np.full(3, 1e-3), np.full(3, -2.0), K_tt, np.ones(3), np.zeros(3))
    made, _ = with_path("tangential_compliance", space, 1e6, 1.0, eta=eta, zeta=0.0)
    stick = -space.v_t / K_tt
    np.testing.assert_allclose(made.c_t / stick, 1 - np.cos(np.pi * np.sqrt(K_tt / eta)), atol=1e-9)
    np.testing.assert_allclose(made.c_n, 4.0, rtol=1e-9)


def test_critically_damped_compliance_does_not_swing_back() -> None:
    """Stuck from the start: z = v₀ s exp(−w s), of which the contact ends at s = π, where it is elastic."""
    K_tt = np.array([1.5, 3.0, 4.0])
    space = Contact.planar(np.full(3, 1e-3), np.full(3, -2.0), K_tt, np.ones(3), np.zeros(3))
    made, _ = with_path("tangential_compliance", space, 1e6, 1.0, eta=1.2, zeta=1.0)
    w = np.sqrt(K_tt / 1.2)
    left = (1.0 - np.pi * w) * np.exp(-np.pi * w)
    np.testing.assert_allclose(made.c_t / (-space.v_t / K_tt), 1.0 - left, atol=1e-9)


def test_compliance_in_gross_slip_is_coulomb() -> None:
    space = Contact.planar(np.full(1, 6.0), np.full(1, -1.0), np.full(1, 3.0), np.ones(1), np.zeros(1))
    made, _ = with_path("tangential_compliance", space, 0.2, 0.5, eta=1.2)
    np.testing.assert_allclose(made.c_t, -0.2 * 1.5, rtol=1e-3)


def test_compliance_goes_to_the_rigid_contact() -> None:
    space = random_space(np.random.default_rng(3), 100)
    change = []
    for eta in (1e-2, 1e-4, 1e-6):
        made, law = with_path("tangential_compliance", space, 0.3, 0.6, eta=eta)
        change.append(np.abs(made.c_t - law.c_t).mean())
    assert change[0] > 2 * change[1] and change[2] < 1e-3


def compliant_motion(space: Contact, mu: float, epsilon: float, eta: float, zeta: float, steps: int):
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


def random_contacts_in_space(rng: np.random.Generator, n: int) -> Contact:
    """Skewed contacts that slide any way."""
    root = np.eye(3)[:, :, None] * np.sqrt([2.0, 3.0, 1.2])[:, None, None] + rng.uniform(-0.25, 0.25, (3, 3, n))
    v = np.concatenate([rng.uniform(-2.0, 2.0, (2, n)), -rng.uniform(0.5, 2.0, (1, n))])
    return Contact(v, np.einsum("ikn,jkn->ijn", root, root))


def compliant_motion_in_space(space: Contact, mu: float, epsilon: float, eta: float, zeta: float, steps: int):
    """c (3, n) as `compliant_motion`, with a spring and a damper alike in both directions."""
    n, k_t, (K, v) = len(space.v_n), 1.0 / eta, (space.K, space.v.copy())
    along = np.einsum("in,ijn,jn->n", v[:2], K[:2, :2], v[:2]) / (v[:2] ** 2).sum(axis=0)
    damping = 2.0 * zeta * np.sqrt(k_t / along)
    dt = 0.5 * np.pi / np.sqrt(K[2, 2]) * epsilon / steps
    z, depth, deepest, c = np.zeros((n, 2)), np.zeros(n), np.zeros(n), np.zeros((3, n))
    for _ in range(6 * steps):
        depth = depth - 0.5 * dt * v[2]
        deepest = np.maximum(deepest, depth)
        f_n = np.maximum((depth - (1.0 - epsilon**2) * deepest) / epsilon**2, 0.0)
        slip = (v[:2] + dt * K[:2, 2] * f_n).T
        f_t = -k_t * (z + dt[:, None] * slip) - damping[:, None] * slip
        f_t *= np.minimum(1.0, mu * f_n / np.maximum(np.hypot(*f_t.T), 1e-30))[:, None]
        z = ((damping / dt)[:, None] * z - f_t) / (k_t + damping / dt)[:, None]
        f = np.concatenate([f_t.T, f_n[None]])
        v, c = v + dt * np.einsum("ijn,jn->in", K, f), c + dt * f
        depth = depth - 0.5 * dt * v[2]
    return c


@pytest.mark.parametrize("eta, zeta", [(0.04, 0.15), (0.3, 0.1), (1.1, 0.03)])
def test_compliance_in_space_agrees_with_fine_integration_of_forces(eta: float, zeta: float) -> None:
    mu, epsilon = np.full(80, 0.3), np.full(80, 0.6)
    space = random_contacts_in_space(np.random.default_rng(4), 80).with_coefficients(mu, epsilon)
    c = compliant_motion_in_space(space, 0.3, 0.6, eta, zeta, 500)
    law = Impulse(np.array(LAWS["mirtich"].impulse(space, mu, epsilon)), np.zeros((3, 80)))
    made = EFFECTS["tangential_compliance"].impulse(law, space, None, {"eta": eta, "zeta": zeta}, DISK)
    rest, before = (np.linalg.norm(one.c - c, axis=0) for one in (made, law))
    assert rest.mean() < SPRING_ERROR * np.abs(c[:2]).mean() and before.mean() > 1.5 * rest.mean()
    assert (np.hypot(*made.c[:2]) <= 0.3 * made.c[2] * (1 + EXACT)).all()


def test_compliance_reverses_slip_and_gains_no_energy() -> None:
    rng = np.random.default_rng(2)
    space = Contact.planar(rng.uniform(-2, 2, N), np.full(N, -1.0), np.full(N, 3.0), np.ones(N), np.zeros(N))
    made, _ = with_path("tangential_compliance", space, 0.3, 1.0, eta=1.0, zeta=0.02)
    after = space.v_t + 3.0 * made.c_t
    assert (np.abs(after) <= np.abs(space.v_t) * (1 + 1e-3)).all()
    psi = np.abs(space.v_t) / 0.3
    turned = after * space.v_t < 0
    # Maw, Barber and Fawcett: back-spin at intermediate angles, none at small ones and in gross slip
    assert turned[(psi > 2.5) & (psi < 5)].all() and not turned[psi > 6.5].any() and not turned[psi < 0.8].any()


def test_path_in_steps_converges_to_the_exact_one() -> None:
    space = random_space(np.random.default_rng(6), N)
    for mu, epsilon in ((0.1, 0.6), (0.5, 0.4), (0.3, 1.0)):
        mus, epsilons = np.full(N, mu), np.full(N, epsilon)
        with np.errstate(all="ignore"):
            exact = LAWS["mirtich"].impulse(space, mus, epsilons)
        errors = []
        for steps in (STEPS, 8 * STEPS):
            made = walk(space.with_coefficients(mus, epsilons), np.ones_like, steps)
            errors.append(np.hypot(made.c_t[1] - exact[0], made.c_n[1] - exact[1]).mean())
        assert errors[0] < 5e-3 and errors[1] < errors[0] / 5


def test_friction_at_the_ends_of_the_stribeck_curve() -> None:
    # gross slip: far above v_s it is μ, far below μ (1 + s)
    for v_t, mu, v_s, factor in ((8.0, 0.2, 0.5, 1.0), (-8.0, 0.2, 0.5, 1.0), (0.3, 0.02, 3.0, 1.4)):
        space = Contact.planar(*(np.array([a]) for a in (v_t, -1.0, 3.0, 1.0, 0.0)))
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


def test_contact_torque_by_hand() -> None:
    # frictionless disk: c_n = (1 + ε) 2 = 3, τ = −m_r c_n against ω, and nothing else moves
    state = at_rest(vy=-2.0, omega=10.0)
    made = predict(on("contact_torque", m_r=5e-4), state, DISK, mu=0.0, epsilon=0.5)
    np.testing.assert_allclose(made.impact[0], [0.0, 1.0, 10.0 - 1.5e-3 / DISK.k_g**2], atol=EXACT)
    # a longer lever stops the turning, and then holds it
    made = predict(on("contact_torque", m_r=2e-2), state, DISK, mu=0.0, epsilon=0.5)
    np.testing.assert_allclose(made.impact[0], [0.0, 1.0, 0.0], atol=1e-10)


def test_contact_torque_moves_the_end_of_restitution() -> None:
    # frictionless, r_x = 0.01 m, ω > 0 throughout: dv_n = (K_nn − m_r r_x / k²) dp, so c_n by hand
    m_r, r_x, r_y, omega = 1e-3, 0.01, -0.03, 30.0
    k2 = DISK.k_g**2
    state = at_rest(vy=-2.0 - r_x * omega, omega=omega)
    space = contact_space(np.array([[0.0, state.vy[0], omega]]), np.array([[r_x, r_y]]), mass=1.0, k_g=DISK.k_g)
    made, _ = with_path("contact_torque", space, 0.0, 0.5, state, m_r=m_r)
    c_n = 1.5 * 2.0 / (1.0 + (r_x * r_x - m_r * r_x) / k2)
    np.testing.assert_allclose([made.c_n[0], made.couple[0]], [c_n, -m_r * c_n], rtol=1e-9)


def test_contact_torque_opposes_rolling_and_keeps_sticking(quadrilateral) -> None:
    rig, states = quadrilateral
    m_r = 1e-3
    given = {"law": "mirtich", "mu": 0.4}
    base = predict([], states, rig, **given)
    made = predict(on("contact_torque", m_r=m_r), states, rig, **given)
    r = rig.shape.contact_point(states.theta)
    tau = residual_couple(made.impact - states.v, r, mass=1.0, k_g=rig.k_g)
    np.testing.assert_allclose(tau, made.impulse.couple, atol=EXACT)
    assert (np.abs(tau) <= m_r * made.impulse.c_n * (1 + EXACT)).all()
    # where the body turns one way throughout, the couple is the whole lever against it; a few turn round and back
    oneway = (states.omega * made.impact[:, 2] > 25.0) & (states.omega * base.impact[:, 2] > 25.0)
    whole = -np.sign(states.omega) * m_r * made.impulse.c_n
    assert oneway.sum() > 20 and np.isclose(tau, whole, rtol=1e-2)[oneway].mean() > 0.95
    # what stuck still has no slip: it rolls; friction never leaves the cone
    sticks = np.abs(base.contact.velocity_after(base.impulse.c_t, base.impulse.c_n)[0]) < 1e-9
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
    assert (made.impact**2 @ metric <= states.v**2 @ metric * (1 + 1e-3)).all()
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
