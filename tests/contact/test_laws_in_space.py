"""Impact laws in space against what they are derived from: Coulomb's law written out, paths followed in small steps.

The contracts that every law inherits run in `test_laws.py`.
"""

import numpy as np
import pytest

from thesis_lib.contact import LAWS, LAWS_IN_SPACE, slip_hodograph
from thesis_lib.contact.circular_cone import cone_point, friction_at, impulse_to_normal_velocity, principal
from thesis_lib.contact.mirtich import increasing_root
from thesis_lib.contact.slip_hodograph import Restitution
from thesis_lib.extensions.impact_draws import ImpactDraws, reference_draw_in_space, size
from thesis_lib.mechanics.contact import Contact

N = 1500
EXACT = 1e-10  # of the speed
PATH = 2e-4  # of the speed: the largest error that slip_hodograph.py says
SMALL_STEPS = 2_000


@pytest.fixture(scope="module")
def draw() -> ImpactDraws:
    return reference_draw_in_space(np.random.default_rng(3), N)


def test_contacts_that_hardly_slide_have_an_impulse(rng):
    draw = reference_draw_in_space(rng, 100_000)
    contact, dv_n = draw.space, -1.5 * draw.space.v_n
    stick = contact.impulse_to(0.0 * dv_n, 0.0 * dv_n, contact.v_n + dv_n)
    share = np.hypot(stick[0], stick[1]) / stick[2]
    pushes = share > 0.0
    for less in (1e-3, 1e-5, 1e-8, 1e-12):  # Newton's steps end in rounding errors there
        mu = np.where(pushes, (1.0 - less) * share, 1.0)
        found = np.stack(impulse_to_normal_velocity(contact, mu, dv_n))
        assert np.isfinite(found).all()
        off = np.abs(found - np.stack(stick))[:, pushes]
        assert np.median(off) <= 10.0 * less


@pytest.mark.parametrize("restitution", [0.0, 0.7])
def test_circular_cone_is_coulombs_law_on_the_final_slip(draw, restitution):
    contact = draw.space
    dv_n = -(1.0 + restitution) * contact.v_n
    c_1, c_2, c_n = impulse_to_normal_velocity(contact, draw.mu, dv_n)
    v_1, v_2, v_n = contact.velocity_after(c_1, c_2, c_n)
    np.testing.assert_allclose(v_n, -restitution * contact.v_n, atol=EXACT)
    slips, friction = np.hypot(v_1, v_2), np.hypot(c_1, c_2)
    assert np.all(c_n > 0.0) and np.all(friction <= draw.mu * c_n + EXACT)
    sliding = slips > 1e-9
    assert 0.3 < sliding.mean() < 0.9
    # the friction of sliding is on the cone's edge and opposes the slip
    np.testing.assert_allclose(friction[sliding], (draw.mu * c_n)[sliding], rtol=0, atol=EXACT)
    np.testing.assert_allclose((v_1 * c_1 + v_2 * c_2)[sliding], -(slips * friction)[sliding], rtol=0, atol=EXACT)


def test_friction_at_a_given_normal_impulse_takes_most_energy(draw):
    """Of all impulses in the disc it leaves the least kinetic energy: the minimum of vᵀc + cᵀK c/2."""
    contact, rng = draw.space, np.random.default_rng(4)
    v_1, v_2, _ = contact.v
    limit = draw.mu * rng.uniform(0.0, 1.0, N)
    K_11, K_12, K_22 = contact.K[0][0], contact.K[0][1], contact.K[1][1]

    def energy(c_1, c_2):
        return v_1 * c_1 + v_2 * c_2 + 0.5 * (K_11 * c_1**2 + 2.0 * K_12 * c_1 * c_2 + K_22 * c_2**2)

    least = energy(*friction_at(contact, (v_1, v_2), limit))
    for _ in range(200):
        angle, radius = rng.uniform(0.0, 2.0 * np.pi, N), limit * np.sqrt(rng.uniform(0.0, 1.0, N))
        assert np.all(energy(radius * np.cos(angle), radius * np.sin(angle)) >= least - EXACT)


def test_a_cone_without_width_gives_no_friction():
    a, b = (
        (np.array([2.0, 1.0, 3.0]), np.array([1.0, 1.0, 2.0])),
        (np.array([1.0, 0.0, 2.0]), np.array([-1.0, 0.0, 1.0])),
    )
    for part in cone_point(a, b, np.zeros(3)):
        np.testing.assert_array_equal(part, 0.0)


def test_principal_axes():
    rng = np.random.default_rng(5)
    A = rng.standard_normal((100, 2, 2))
    A = A @ A.mT + 0.1 * np.eye(2)
    axes = principal(A[:, 0, 0], A[:, 0, 1], A[:, 1, 1])
    values = np.linalg.eigvalsh(A)
    np.testing.assert_allclose(np.stack([axes.second, axes.first], axis=1), values, rtol=1e-10)
    x = rng.standard_normal((2, 100))
    inner = axes.into((x[0], x[1]))
    turned = axes.back((axes.first * inner[0], axes.second * inner[1]))
    np.testing.assert_allclose(turned, np.einsum("nij,jn->in", A, x), atol=1e-12)
    np.testing.assert_allclose(axes.back(inner), x, atol=1e-14)


def test_roots_are_found_and_missing_ones_are_nan():
    target = np.array([1e-6, 1.0, 7.0, 1e8])
    found = increasing_root(lambda x: (x**3 - target, 3.0 * x**2), np.zeros(4), np.ones(4))
    np.testing.assert_allclose(found, np.cbrt(target), rtol=1e-12)
    assert np.isnan(increasing_root(lambda x: (-1.0 / (1.0 + x), 1.0 / (1.0 + x) ** 2), np.zeros(1), np.ones(1))).all()


def followed(contact: Contact, mu: np.ndarray, epsilon: np.ndarray) -> dict[Restitution, np.ndarray]:
    """Impulses (3, n) along the path, by Coulomb's law in `SMALL_STEPS` implicit steps of normal impulse.

    In a step of h the slip goes from x to x + h (k + K_tt T), |T| ≤ μ, T against the slip at its end: friction at the
    normal impulse h, which `friction_at` solves.
    """
    x, v_n = np.array(contact.v[:2]), np.array(contact.v[2])
    k, n = np.array([contact.K[0][2], contact.K[1][2]]), len(v_n)
    h = -8.0 * contact.v_n / contact.K_nn / SMALL_STEPS  # up to 8 times the frictionless compression
    c, p, W = np.zeros((2, n)), np.zeros(n), np.zeros(n)
    p_c, W_c = np.full(n, np.nan), np.full(n, np.nan)
    out = {rule: np.full((3, n), np.nan) for rule in Restitution}
    for _ in range(SMALL_STEPS):
        T = np.stack(friction_at(contact, tuple(x + h * k), mu * h))
        x = x + h * k + np.stack([contact.K[i][0] * T[0] + contact.K[i][1] * T[1] for i in range(2)])
        before, v_n = v_n, v_n + contact.K_nn * h + k[0] * T[0] + k[1] * T[1]
        c, p, W = c + T, p + h, W + 0.5 * h * (before + v_n)
        compressed = np.isnan(p_c) & (v_n >= 0.0)
        p_c, W_c = np.where(compressed, p, p_c), np.where(compressed, W, W_c)
        ends = {
            Restitution.NEWTON: ~np.isnan(p_c) & (v_n >= -epsilon * contact.v_n),
            Restitution.POISSON: p >= (1.0 + epsilon) * p_c,
            Restitution.STRONGE: (1.0 - epsilon**2) * W_c <= W,
        }
        for rule, end in ends.items():
            new = end & np.isnan(out[rule][2])
            out[rule][:, new] = np.concatenate([c, p[None]])[:, new]
    return out


def test_paths_are_those_of_small_steps(draw):
    few = draw[:100]
    for rule, expected in followed(few.space, few.mu, few.epsilon).items():
        there = np.isfinite(expected).all(axis=0)
        assert there.mean() > 0.9
        found = np.stack(slip_hodograph.impulse(few.space, few.mu, few.epsilon, rule))
        error = size(found - expected) / few.speed
        assert (
            np.all(error[there] <= 0.03) and np.median(error[there]) <= 4e-3
        )  # small steps err with their first power


@pytest.mark.parametrize("rule", Restitution)
def test_the_error_of_paths_is_as_said(draw, rule, monkeypatch):
    few = draw[:300]
    found = np.stack(slip_hodograph.impulse(few.space, few.mu, few.epsilon, rule))
    monkeypatch.setattr(slip_hodograph, "TURN", 0.025)
    monkeypatch.setattr(slip_hodograph, "STEPS", 5_000)
    exact = np.stack(slip_hodograph.impulse(few.space, few.mu, few.epsilon, rule))
    error = size(found - exact) / few.speed
    assert error.max() <= PATH and np.median(error) <= 1e-6


@pytest.mark.parametrize("rule", Restitution)
def test_slip_turns_where_the_compliance_is_not_that_of_a_ball(draw, rule):
    """Otherwise the test of a path would not test it."""
    contact = draw.space
    c_1, c_2, c_n = slip_hodograph.impulse(contact, draw.mu, draw.epsilon, rule)
    along = np.abs(contact.v[0] * c_2 - contact.v[1] * c_1) / np.hypot(contact.v[0], contact.v[1]) / c_n
    assert np.median(along) > 0.05


def test_slip_in_an_invariant_direction_needs_no_step(monkeypatch, draw):
    """A ball slides straight, so that the answer is that of the plane without any step."""
    monkeypatch.setattr(slip_hodograph, "STEPS", 0)
    n = len(draw.mu)
    zero = np.zeros(n)
    K = np.array([[zero + 3.5, zero, zero], [zero, zero + 3.5, zero], [zero, zero, zero + 1.0]])
    v = draw.space.v
    found = slip_hodograph.impulse(Contact(v, K), draw.mu, draw.epsilon, Restitution.STRONGE)
    slip = np.hypot(v[0], v[1])
    c_n = -(1.0 + draw.epsilon) * v[2]
    friction = np.minimum(draw.mu * c_n, slip / 3.5)
    np.testing.assert_allclose(found, [-friction * v[0] / slip, -friction * v[1] / slip, c_n], atol=EXACT)


@pytest.mark.parametrize("rule", Restitution)
def test_friction_after_the_first_slip_may_be_another(draw, rule):
    few, same = draw[:200], np.array(1.0)
    first = slip_hodograph.impulse(few.space, same, few.epsilon, rule)
    np.testing.assert_array_equal(slip_hodograph.impulse(few.space, same, few.epsilon, rule, same), first)
    other = np.stack(slip_hodograph.impulse(few.space, same, few.epsilon, rule, np.array(0.0)))
    changed = np.abs(other - np.stack(first)).max(axis=0) > EXACT
    assert 0.05 < changed.mean() < 0.95  # where slip ends before the impact does


def test_a_ball_with_back_spin_is_that_of_the_textbook():
    """A ball that strikes a floor at an angle: it slides with μ (1 + ε) v_n, or leaves rolling with 5/7 of v_t."""
    R, v_n = 0.1, 2.0
    inertia = 0.4 * R**2 * np.eye(3)
    r = np.array([[0.0, 0.0, -R]] * 2)
    v_pre = np.array([[3.0, 4.0, -v_n, 0.0, 0.0, 0.0], [0.3, 0.4, -v_n, 0.0, 0.0, 0.0]])
    for name in LAWS_IN_SPACE:
        out = LAWS[name](v_pre, r, mass=0.5, inertia=inertia, mu=0.2, epsilon=0.5)
        lost = 0.2 * 1.5 * v_n  # of 5 m/s
        np.testing.assert_allclose(out.v_post[0, :3], [3.0 * (1 - lost / 5), 4.0 * (1 - lost / 5), 1.0], atol=1e-12)
        np.testing.assert_allclose(out.v_post[1, :3], [0.3 * 5 / 7, 0.4 * 5 / 7, 1.0], atol=1e-12)
        np.testing.assert_allclose(out.v_post[1, 3:], [-0.4 * 5 / 7 / R, 0.3 * 5 / 7 / R, 0.0], atol=1e-11)
