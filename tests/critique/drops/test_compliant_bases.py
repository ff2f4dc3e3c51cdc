"""Compliant bases: their integrated contacts, the limit of short ones, and where the search takes them."""

from dataclasses import replace

import numpy as np
import pytest
from hidden_effects import recorded

from thesis_lib.bodies.body import Noise
from thesis_lib.contact import LAWS
from thesis_lib.contact.compliant.compiled import central_pressure
from thesis_lib.critique.contacts.bases import BASES, RESERVE
from thesis_lib.critique.contacts.contact_time import STICTION_TOLERANCE
from thesis_lib.critique.contacts.episodes import Played
from thesis_lib.critique.contacts.kinds import bind
from thesis_lib.critique.contacts.model import Model
from thesis_lib.critique.contacts.pressing import press
from thesis_lib.critique.drops.criticise import criticise_drops
from thesis_lib.critique.drops.world import Drops
from thesis_lib.critique.likelihood.fit import fit
from thesis_lib.critique.likelihood.observations import observe
from thesis_lib.critique.likelihood.whitening import Whitening
from thesis_lib.datasets.format.impacts import POSE, V_POST, V_PRE
from thesis_lib.effects import EFFECTS
from thesis_lib.effects.effect import Rig
from thesis_lib.foundation.errors import UserError
from thesis_lib.mechanics.state import State
from thesis_lib.simulate.compliant.drops import simulate_compliant_drops
from thesis_lib.simulate.drake.drops import DropsInDrake
from thesis_lib.simulate.drake.plant import STICTION
from thesis_lib.simulate.mujoco.contact import MujocoContact
from thesis_lib.simulate.mujoco.drops import DropsInMujoco
from thesis_lib.simulate.rig.hidden_causes import (
    ELLIPSE_BODY,
    PROOF_RELEASE,
    RIG_NOISE,
    SQUARE,
    CompliantContact,
    HiddenCauses,
)

RIG = Rig(ELLIPSE_BODY.shape, ELLIPSE_BODY.radius_of_gyration, 9.81, 0.0)
SHORT = {"mu": 0.15, "epsilon": 0.6, "tau": 2e-6}  # s; nothing moves meanwhile
QUIET = Noise(position=0.1 * RIG_NOISE.position, angle=0.1 * RIG_NOISE.angle)
STEPPED = 0.006  # of ε: 48 steps in a contact, which ends within one


def touching(theta: np.ndarray, v: np.ndarray) -> State:
    """Ellipses at angles (n,) in rad that touch with velocities (n, 3)."""
    height = -RIG.shape.contact_point(theta)[:, 1]
    return State.of(np.column_stack([np.zeros_like(theta), height, theta]), v, np.arange(len(theta)), 0.0 * theta)


def thrown(seed: int, n: int) -> State:
    """Those of n bodies in random states of which the contact point comes down."""
    rng = np.random.default_rng(seed)
    v = np.column_stack([rng.uniform(-1.5, 1.5, n), rng.uniform(-3.0, -0.8, n), rng.uniform(-12.0, 12.0, n)])
    state = touching(rng.uniform(0.0, 2.0 * np.pi, n), v)
    r_x = RIG.shape.contact_point(state.theta)[:, 0]
    return state.select(np.flatnonzero(v[:, 1] + r_x * v[:, 2] < -0.3))


@pytest.mark.parametrize("name", RESERVE)
def test_a_contact_without_friction_has_the_restitution_of_its_force(name):
    theta = np.array([0.0, 0.5, 0.9, 1.3, 0.5, 0.9])
    speed = np.array([1.0, 1.0, 1.0, 1.0, 3.0, 0.4])
    v = np.column_stack([np.zeros(6), -speed, np.zeros(6)])
    after, elapsed = press(bind(Model(BASES[name], takes_time=True), SHORT | {"mu": 0.0}, RIG), touching(theta, v))
    r_x = RIG.shape.contact_point(theta)[:, 0]
    b = 1.0 + (r_x / RIG.k_g) ** 2
    force = BASES[name].force
    expected = force.epsilon_at(np.full(6, SHORT["epsilon"]), b, speed)
    assert (after.vy + r_x * after.omega) / speed == pytest.approx(expected, abs=STEPPED)
    # the impulse acts at its centroid: its moment about the touch is what the centre of mass is ahead by
    dv = after.vy + speed
    ahead = after.y - touching(theta, v).y + speed * elapsed
    tau = force.tau_at(np.full(6, SHORT["tau"]), np.full(6, SHORT["epsilon"]), b, speed)
    axes, none = np.square(ELLIPSE_BODY.shape.semi_axes), np.zeros((0, 2))
    if name == "pressure_field_contact":  # the flatter the body is where it touches, the stiffer
        tau = tau * np.array([central_pressure(axes, none, a, 1e-4) for a in theta]) ** (-1.0 / 3.0)
        tau = tau * central_pressure(axes, none, 0.0, 1e-4) ** (1.0 / 3.0)
    assert elapsed - ahead / dv == pytest.approx(tau / np.sqrt(b), rel=0.02)


@pytest.mark.parametrize("name", [name for name in RESERVE if name != "convex_contact"])
def test_short_contacts_tend_to_the_limit(name):
    state = thrown(3, 100)
    model = Model(BASES[name], takes_time=True)
    after, _ = press(bind(model, SHORT | {STICTION_TOLERANCE.name: 0.0}, RIG), state)
    limit, _ = bind(model.limit, SHORT, RIG).collide(state)
    plain, _ = bind(Model(LAWS["mirtich"]), SHORT, RIG).collide(state)
    scale = [1.0, 1.0, RIG.k_g]
    error, other = (np.median(np.linalg.norm((after.v - s.v) * scale, axis=1)) for s in (limit, plain))
    assert error < 0.001  # of 3 m/s
    assert error < 0.1 * other or name in ("compliant_contact", "hertz_contact")


@pytest.mark.parametrize(
    ("body", "impedance", "ratio"),
    [(ELLIPSE_BODY, 0.01, 10.0), (SQUARE, 0.9, 1.0), (ELLIPSE_BODY, 0.9999, 100.0)],
    ids=["spring and damper", "usual", "whatever mass"],
)
def test_a_convex_contact_is_that_of_mujoco(body, impedance, ratio):
    contact = MujocoContact(mu=0.15, epsilon=0.55, contact_time=1e-3, impratio=ratio, impedance=impedance)
    given = {"engine": DropsInMujoco(), "contact": contact}
    made = simulate_compliant_drops(body, PROOF_RELEASE, 15, rng=np.random.default_rng(2), **given)
    table = made.impacts[made.impacts["impact"] == 0]
    q, v, v_post = (table[list(names)].to_numpy() for names in (POSE, V_PRE, V_POST))
    start = State.of(q, v, table["trial"].to_numpy(), table["t"].to_numpy())
    force, rig = BASES["convex_contact"].force, Rig(body.shape, body.radius_of_gyration, 9.81, 0.0)
    loss = force.loss(np.array(0.55))
    tau = 1e-3 * float(force.centroid(loss) / force.duration(loss))

    def error(name: str, **other: float) -> float:
        values = {"mu": 0.15, "epsilon": 0.55, "tau": tau, "damping_ratio": ratio, "impedance": impedance, **other}
        model = Model(BASES[name], takes_time=True)
        played = Played(bind(model, values, rig), start, table["duration"].to_numpy(), most=1)
        return float(np.median(np.linalg.norm((played.after.v - v_post) * [1.0, 1.0, rig.k_g], axis=1)))

    # m/s, of 3; MuJoCo's 200 steps in a contact find the touch within a step to that
    assert error("convex_contact") < 0.0015
    # Coulomb's friction, another strength of it, or another impedance is another contact
    other = {"impedance": 0.3} if ratio * impedance != 0.1 else {"damping_ratio": 3.0}
    assert min(error("damped_contact"), error("convex_contact", **other)) > 5.0 * error("convex_contact")


DEFAULT = {"impedance": 0.9, "deep_impedance": 0.95, "impratio": 1.0, "steps": 100}


@pytest.mark.slow
def test_mujoco_s_usual_impedance_is_fitted():
    o = observe(recorded(SQUARE, 40, 7, engine=DropsInMujoco(), contact=MujocoContact(contact_time=8e-4, **DEFAULT)))
    fitted = fit(Model(BASES["convex_contact"], takes_time=True), o)
    assert 0.88 < fitted.values["impedance"] < 0.95
    # 2: what 0.9 to 0.95 over the depth leave, in a few dozen impacts
    own = replace(fitted, values=fitted.values | {"impedance": 0.01})
    assert Drops(o).judge(fitted).excess < 2.0 < 4.0 < Drops(o).judge(own).excess


def test_mujoco_s_default_solref_is_too_soft_for_an_impact():
    # solref (0.02, 1): critically damped, so that ω T = 2 and ε = exp(−2)
    soft = {"contact_time": 0.04 * np.sqrt(0.95), "epsilon": np.exp(-2.0)}
    contact = MujocoContact.model_construct(**MujocoContact(**DEFAULT).model_dump() | soft)
    with pytest.raises(UserError, match=r"Contacts last about .* contact is soft, like that of foam or of a simulator"):
        criticise_drops(recorded(SQUARE, 15, 7, engine=DropsInMujoco(), contact=contact), rng=np.random.default_rng(0))


def test_a_clock_so_late_that_bodies_do_not_come_off_can_be_weighed():
    o = observe(recorded(SQUARE, 12, 4, engine=DropsInMujoco()))
    model = Model(BASES["convex_contact"], (EFFECTS["time_lag"],), takes_time=True)
    values = {"mu": 0.15, "epsilon": 0.55, "tau": 4e-4, "damping_ratio": 10.0, "time_lag.lag": -0.03}
    whitening = Whitening.at(model, values, o)  # a residual without noise would make it singular
    assert np.isfinite(whitening.log_scores(values)[0]).all()


@pytest.mark.slow
def test_hertz_is_named_where_contacts_are_long():
    contact = CompliantContact(contact_time=3e-3, exponent=1.5)
    judged = criticise_drops(recorded(ELLIPSE_BODY, 70, 1, contact=contact), rng=np.random.default_rng(1))
    assert judged.verdict == "adequate"
    fitted = judged.ladder[-1][1]
    assert fitted.base == "hertz_contact" and fitted.values["epsilon"] == pytest.approx(0.55, abs=0.003)
    assert fitted.values["mu"] == pytest.approx(0.15, abs=0.002)
    assert judged.discovery.bases["hertz_contact"].score > judged.discovery.bases["mirtich"].score + 100.0


@pytest.mark.slow
@pytest.mark.parametrize(("shape", "exponent"), [("ellipse", 1.5), ("square", 1.0)])
def test_a_spring_along_the_surface_is_that_of_the_simulated_contact(shape, exponent):
    body = {"ellipse": ELLIPSE_BODY, "square": SQUARE}[shape]
    contact = CompliantContact(contact_time=3e-3, exponent=exponent, steps=400)
    hidden = HiddenCauses(tangential_compliance=0.3)
    o = observe(recorded(body, 40, 1, contact=contact, hidden=hidden, noise=QUIET))
    base = BASES["compliant_contact" if exponent == 1.0 else "hertz_contact"]
    fitted = fit(Model(base, (EFFECTS["tangential_compliance"],), takes_time=True), o)
    assert fitted.values["tangential_compliance.eta"] == pytest.approx(0.3, rel=0.02)
    judged = Drops(o).judge(fitted)
    # at a tenth of a rig's noise, where an impulse added to a rigid one errs by 6 times the floor and more
    assert judged.excess < 2.0


def test_a_stiff_spring_along_the_surface_is_a_rigid_contact_and_in_short_ones_the_impulse_of_its_effect():
    state, zeta = thrown(4, 60), {"tangential_compliance.zeta": 0.2}
    model = Model(BASES["compliant_contact"], (EFFECTS["tangential_compliance"],), takes_time=True)

    def after(eta: float, **values: float) -> np.ndarray:
        return press(bind(model, values | zeta | {"tangential_compliance.eta": eta}, RIG), state)[0].v

    rigid, stiff = (after(eta, mu=0.3, epsilon=0.6, tau=1e-3) for eta in (0.0, 1e-6))
    assert stiff == pytest.approx(rigid, abs=0.02)
    limit, _ = bind(model.limit, SHORT | zeta | {"tangential_compliance.eta": 0.5}, RIG).collide(state)
    assert np.abs(after(0.5, **SHORT)[:, :2] - limit.v[:, :2]).mean() < 0.01


@pytest.mark.slow
def test_simulators_put_the_force_in_the_middle_of_the_overlap():
    slow = MujocoContact(contact_time=3e-3)
    o = observe(recorded(ELLIPSE_BODY, 40, 1, engine=DropsInMujoco(), contact=slow, noise=QUIET))
    fitted = fit(Model(BASES["convex_contact"], takes_time=True), o)
    # at the lowest point instead: μ 0.148, and 3 times the error
    assert fitted.values["mu"] == pytest.approx(slow.mu, rel=0.004)
    assert fitted.values["damping_ratio"] == pytest.approx(slow.impratio, rel=0.2)
    assert Drops(o).judge(fitted).excess < 3.5


@pytest.mark.parametrize("name", ["compliant_contact", "convex_contact"])
def test_a_body_that_is_carried_along_with_its_surface_is_pressed_as_at_rest(name):
    V, theta = 0.7, np.array([0.2, 0.9, 2.0])
    rest = touching(theta, np.array([[0.6, -1.5, 4.0], [-0.3, -2.0, -6.0], [0.0, -1.0, 9.0]]))
    values = {"mu": 0.2, "epsilon": 0.5, "tau": 1e-3, "damping_ratio": 10.0, "impedance": 0.9}
    after, took = press(bind(Model(BASES[name], takes_time=True), values, RIG), rest)
    moving = Model(BASES[name], (EFFECTS["moving_surface"],), takes_time=True)
    carried, as_long = press(bind(moving, values | {"moving_surface.V": V}, RIG), rest.moved(vx=rest.vx + V))
    assert np.array_equal(took, as_long)
    np.testing.assert_allclose(carried.v - after.v, np.tile([V, 0.0, 0.0], (3, 1)), atol=1e-12)
    np.testing.assert_allclose(carried.q - after.q, np.outer(V * took, [1.0, 0.0, 0.0]), atol=1e-12)


def test_the_pressure_in_a_chord_is_that_of_the_integral():
    a, b = ELLIPSE_BODY.shape.semi_axes
    none = np.zeros((0, 2))
    # e = δ/b (1 − u²) to first order, and the third axis adds √e: ∫ (1 − u²)^(3/2) du = 3π/8
    flat = np.sqrt(2.0) * a * 3.0 * np.pi / (8.0 * b**2)
    assert central_pressure(np.square([a, b]), none, 0.0, 1e-6) == pytest.approx(flat, rel=1e-3)
    # a right angle on its tip: a chord 2 δ long, (δ − |x|)/√2 inside
    corners = np.array(SQUARE.shape.corners)
    assert central_pressure(np.ones(2), corners, 0.25 * np.pi, 1e-4) == pytest.approx(1.0 / np.sqrt(2.0), rel=0.02)


@pytest.mark.parametrize("tolerance", [0.0, 0.02, 0.1])
def test_friction_of_a_pressure_field_falls_as_the_arctangent_of_the_slip(tolerance):
    # slides on its flat side, hardly slower at the end, so that nothing turns it but the friction's lever
    state = touching(np.zeros(1), np.array([[0.5, -0.2, 0.0]]))
    values = SHORT | {"mu": 0.02, STICTION_TOLERANCE.name: tolerance}
    after, _ = press(bind(Model(BASES["pressure_field_contact"], takes_time=True), values, RIG), state)
    lost, gained = state.vx[0] - after.vx[0], after.vy[0] - state.vy[0]
    slip = 0.5 + 0.5 * (after.vx[0] + RIG.shape.semi_axes[1] * after.omega[0] - 0.5)  # in the middle
    share = 2.0 / np.pi * np.arctan(slip / tolerance) if tolerance else 1.0
    assert lost / gained == pytest.approx(values["mu"] * share, rel=2e-3)


@pytest.mark.slow
def test_drake_s_hydroelastic_contact_is_a_pressure_field():
    o = observe(recorded(SQUARE, 40, 1, engine=DropsInDrake("hydroelastic"), noise=QUIET))
    errors = {}
    for name in ("hunt_crossley_contact", "pressure_field_contact"):
        fitted = fit(Model(BASES[name], takes_time=True), o)
        errors[name] = np.median(Drops(o).judge(fitted).error)
    # measured: 0.011 and 0.003 m/s
    assert errors["pressure_field_contact"] < 0.5 * errors["hunt_crossley_contact"]
    assert fitted.values["mu"] == pytest.approx(0.15, rel=0.02)
    # an arctangent of the slip over Drake's tolerance, times a soft norm of the slip
    assert 0.3 * STICTION < fitted.values[STICTION_TOLERANCE.name] < 2.0 * STICTION
