"""The Drake plant and the simulated drops: mechanics that must hold, known truths, convergence, reproducibility."""

import dataclasses

import numpy as np
import pytest
from falling import DISK as DISK_BODY
from falling import LARGE_SQUARE as SQUARE_BODY
from falling import POSE as POSES
from falling import POST as V_POST
from falling import PRE as V_PRE
from falling import RIG, at

from thesis_lib.bodies.body import Noise
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.write import write_dataset
from thesis_lib.datasets.read import read_dataset
from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.rig.hidden_causes import ELLIPSE_BODY
from thesis_lib.simulate.rig.release import Release, Spread
from thesis_lib.simulate.stepping import drops as drops_module
from thesis_lib.simulate.stepping.drops import TRUTH, DropStatus, simulate_drops
from thesis_lib.simulate.stepping.lcp import LcpStatus
from thesis_lib.simulate.stepping.plant import PlanarPlant

EXACT = 1e-12  # closed forms in double precision, numbers of order 1
CONTACT_TIME = 1e-9  # truth that depends on the instant of contact: |φ_n| < 1e-13 m over 0.1 m/s and up, amplified
SUNK = 1e-12  # m; no gap may be more negative: rounding of a pose of about 1 m
RESIDUAL_TOL = 1e-9  # complementarity, dimensionless


def run(n=60, body=ELLIPSE_BODY, release=None, mu=0.1, epsilon=0.55, seed=0, **options):
    rng = np.random.default_rng(seed)
    return simulate_drops(body, release or Release(), n, mu=mu, epsilon=epsilon, rng=rng, **options)


def poses(drops):
    """Recorded poses (n, samples, 3) of drops that all ran to the end."""
    return drops.trajectories[POSES].to_numpy().reshape(len(drops.trials), -1, 3)


@pytest.fixture(scope="module")
def many():
    return run(300)


# --- the plant ---


def test_contact_jacobian_is_the_textbook_one():
    rng = np.random.default_rng(0)
    q, r = rng.uniform(-3, 3, (50, 3)), rng.uniform(-0.05, 0.05, (50, 2))
    J, one, zero = PlanarPlant().contact_jacobian(q, r), np.ones(50), np.zeros(50)
    np.testing.assert_allclose(J[:, 0], np.stack([one, zero, -r[:, 1]], -1), atol=EXACT)
    np.testing.assert_allclose(J[:, 1], np.stack([zero, one, r[:, 0]], -1), atol=EXACT)


@pytest.mark.parametrize("wrong", [np.array([[0.0, np.nan, 0.0]]), np.zeros(3)])
def test_plant_refuses_what_would_end_the_process(wrong):
    with pytest.raises(ValueError, match="configurations must be finite and of shape"):
        PlanarPlant().contact_jacobian(wrong, np.zeros((1, 2)))
    with pytest.raises(ValueError, match="contact points"):
        PlanarPlant().contact_jacobian(np.zeros((2, 3)), np.zeros((1, 2)))


# --- flight ---


@pytest.mark.slow
def test_arcs_are_ballistic_before_and_after_the_first_impact(many):
    p, first = poses(many), many.impacts[many.impacts["impact"] == 0]
    second = many.impacts[many.impacts["impact"] == 1].set_index("trial")["t"].reindex(first["trial"]).to_numpy()
    t, t_first = many.trajectories["t"].to_numpy().reshape(len(p), -1), first["t"].to_numpy()[:, None]
    release = many.trials[["vx", "vy", "omega"]].to_numpy()[:, None]
    g = np.array([0.0, -9.81, 0.0])

    arc = p[:, :1] + release * t[..., None] + 0.5 * g * t[..., None] ** 2
    before = t < t_first
    np.testing.assert_allclose(p[before], arc[before], atol=EXACT)
    np.testing.assert_allclose(first[V_PRE], release[:, 0] + g * t_first, atol=EXACT)

    tau = (t - t_first)[..., None]
    arc = first[POSES].to_numpy()[:, None] + first[V_POST].to_numpy()[:, None] * tau + 0.5 * g * tau**2
    between = (t > t_first) & (t < np.fmin(second, np.inf)[:, None])
    between &= t < np.fmin(many.trials["t_support"], np.inf).to_numpy()[:, None]
    assert between.sum() > 1000
    np.testing.assert_allclose(p[between], arc[between], atol=EXACT)
    # the check sees gravity off by a millionth
    assert np.abs(p - arc - 0.5e-6 * g * tau**2)[between].max() > EXACT


def test_energy_is_kept_between_impacts_and_lost_in_them(many):
    table = many.impacts
    M = ELLIPSE_BODY.mass * np.array([1.0, 1.0, ELLIPSE_BODY.radius_of_gyration**2])
    potential = ELLIPSE_BODY.mass * 9.81 * table["y"]
    before = 0.5 * (table[V_PRE].to_numpy() ** 2 @ M) + potential
    after = 0.5 * (table[V_POST].to_numpy() ** 2 @ M) + potential
    np.testing.assert_allclose(table["energy_change"], after - before, atol=EXACT)
    t_support = many.trials["t_support"].to_numpy()[table["trial"]]
    follows = (table["impact"] > 0) & ~(table["t"] > t_support)  # no supported step in between
    assert follows.sum() > 500
    np.testing.assert_allclose(before[follows], after.shift(1)[follows], rtol=EXACT)
    # this body at this ε never gains; the law itself promises nothing (next test)
    assert (table["energy_change"] < 0).all()


def test_energy_gains_of_the_law_are_reported_not_hidden():
    # a square is slender enough about its corner contact for Newton's restitution to gain energy
    table = run(100, SQUARE_BODY, mu=0.4, epsilon=0.95).impacts
    gains = table["energy_change"] > 1e-9
    assert 0 < gains.mean() < 0.5
    assert (table["status"] == LcpStatus.SOLVED).all()


# --- impacts ---


def test_each_impact_obeys_newton_coulomb_and_momentum(many):
    table, epsilon, mu = many.impacts, 0.55, 0.1
    v_pre, v_post = table[V_PRE].to_numpy(), table[V_POST].to_numpy()
    r_x, r_y, c_t, c_n = table[["r_x", "r_y", "c_t", "c_n"]].to_numpy().T
    v_n_pre, v_n_post = v_pre[:, 1] + r_x * v_pre[:, 2], v_post[:, 1] + r_x * v_post[:, 2]
    np.testing.assert_allclose(v_n_post, -epsilon * v_n_pre, rtol=CONTACT_TIME)
    assert (v_n_pre < -drops_module.V_PLASTIC).all()
    assert (np.abs(c_t) <= mu * c_n * (1 + CONTACT_TIME)).all()
    m, k2 = ELLIPSE_BODY.mass, ELLIPSE_BODY.radius_of_gyration**2
    wrench = np.stack([c_t, c_n, r_x * c_n - r_y * c_t], -1)
    np.testing.assert_allclose((v_post - v_pre) * [m, m, m * k2], wrench, atol=EXACT)
    assert table["residual"].max() <= RESIDUAL_TOL
    assert (table["status"] == LcpStatus.SOLVED).all() and (many.trials["status"] == DropStatus.DONE).all()


def test_impacts_happen_on_the_surface_at_the_lowest_point(many):
    table, shape = many.impacts, ELLIPSE_BODY.shape
    theta = table["theta"].to_numpy()
    assert np.abs(shape.gap(table["y"], theta)).max() <= drops_module.GAP_TOL
    np.testing.assert_allclose(table[["r_x", "r_y"]], shape.contact_point(theta), atol=EXACT)


def test_a_disk_without_spin_bounces_straight_to_epsilon_squared():
    out = run(1, DISK_BODY, at(height=0.33), epsilon=0.6, duration=1.0, rate=1000.0)
    assert np.abs(poses(out)[..., [0, 2]]).max() == 0.0
    speed = np.sqrt(2 * 9.81 * 0.3)
    np.testing.assert_allclose(out.impacts["vy_pre"], -speed * 0.6 ** out.impacts["impact"], rtol=CONTACT_TIME)
    flights = 2 * speed * 0.6 ** out.impacts["impact"].to_numpy()[1:] / 9.81
    np.testing.assert_allclose(np.diff(out.impacts["t"]), flights, rtol=CONTACT_TIME)
    # bounces end where the next one would be slower than the plastic limit
    assert len(out.impacts) == 1 + int(np.log(drops_module.V_PLASTIC / speed) / np.log(0.6))
    assert poses(out)[0, -1, 1] == pytest.approx(0.03, abs=SUNK)


def test_mirrored_releases_give_mirrored_drops():
    state = dict(height=0.35, theta=0.4, vx=0.6, omega=7.0)
    left = run(1, release=at(**state))
    right = run(1, release=at(**{**state, "theta": -0.4, "vx": -0.6, "omega": -7.0}))
    np.testing.assert_allclose(poses(right), poses(left) * [-1, 1, -1], atol=CONTACT_TIME)
    np.testing.assert_allclose(right.impacts[["c_t", "c_n"]], left.impacts[["c_t", "c_n"]] * [-1, 1], atol=EXACT)


# --- support ---


@pytest.mark.slow
@pytest.mark.parametrize("body", [ELLIPSE_BODY, DISK_BODY, SQUARE_BODY], ids=["ellipse", "disk", "square"])
@pytest.mark.parametrize("epsilon", [0.0, 0.5, 1.0])
def test_no_drop_sinks(body, epsilon):
    out = run(20, body, mu=0.3, epsilon=epsilon, duration=1.0, rate=1000.0)
    p = poses(out)
    gap = body.shape.gap(p[..., 1], p[..., 2])
    assert gap.min() >= -SUNK
    assert gap[:, 0].min() > 0.1 and gap.min() < 1e-3  # they do come down
    assert (out.trials["status"] == DropStatus.DONE).all()


@pytest.mark.slow
def test_a_plastic_disk_slides_under_coulomb_friction_then_rolls():
    mu, vx = 0.05, 1.0
    out = run(1, DISK_BODY, at(vx=vx), mu=mu, epsilon=0.0, duration=1.2)
    x, rate = poses(out)[0, :, 0], 250.0
    landed = int(np.ceil(out.impacts["t"][0] * rate)) + 2
    assert len(out.impacts) == 1
    # ẍ = -μ g while sliding: exact in each step
    np.testing.assert_allclose(np.diff(x[landed : landed + 60], 2) * rate**2, -mu * 9.81, rtol=1e-6)
    # angular momentum about the contact: v_x = v_x0 R² / (R² + k²) when rolling
    R2, k2 = 0.03**2, 0.02**2
    np.testing.assert_allclose(np.diff(x[-20:]) * rate, vx * R2 / (R2 + k2), rtol=1e-9)


def test_energy_never_grows_without_restitution():
    n, dt, k2 = 20, 1e-3, ELLIPSE_BODY.radius_of_gyration**2
    q, v = Release().draw(n, np.random.default_rng(0))
    simulation = drops_module._Simulation(ELLIPSE_BODY, q, v, np.full(n, 0.3), np.zeros(n), 9.81)
    energy = []  # J/kg
    for i in range(600):
        simulation.step(i * dt, dt)
        energy.append(0.5 * simulation.v**2 @ [1.0, 1.0, k2] + 9.81 * simulation.q[:, 1])
    assert (simulation.t_support < 0.35).all()  # about half of the time is spent in support
    # lifting a body that has drifted into the surface adds up to 3e-10 J/kg in a step of 1 ms, of fourth order in h
    assert np.diff(energy, axis=0).max() < 1e-9
    assert (energy[-1] - energy[350] < -1e-4).all()


# --- time step ---


@pytest.mark.slow
def test_flight_and_impacts_do_not_depend_on_the_time_step():
    fine = run(30, dt=2e-4)
    for dt in (4e-3, 2e-3, 1e-3):
        coarse = run(30, dt=dt)
        a, b = (
            out.impacts.merge(out.trials[["trial", "t_support"]], on="trial").query("not t > t_support")
            for out in (fine, coarse)
        )
        a, b = (table.query("impact < 2").reset_index(drop=True) for table in (a, b))
        assert len(a) == len(b) == 60
        np.testing.assert_allclose(b[list(TRUTH[:12])], a[list(TRUTH[:12])], atol=CONTACT_TIME)


@pytest.mark.slow
def test_support_converges_at_first_order():
    # plastic landing, then a quarter of a second of rocking and rolling on the ellipse
    steps, finest = np.array([4e-3, 2e-3, 1e-3]), 2e-4
    ends = {dt: poses(run(8, mu=0.3, epsilon=0.0, dt=dt, rate=50.0, duration=0.54))[:, -1] for dt in (*steps, finest)}
    errors = [np.median(np.abs(ends[dt] - ends[finest]).max(axis=1)) for dt in steps]
    slope = np.polyfit(np.log(steps), np.log(errors), 1)[0]
    # the reference has an error too, which makes the slope a little steeper than 1
    assert 0.85 < slope < 1.3


def test_a_step_that_does_not_divide_the_sampling_period_is_shortened():
    np.testing.assert_allclose(poses(run(5, dt=1.1e-3)), poses(run(5, dt=1e-3)), atol=0)


# --- randomness, noise, tables ---


def test_a_drop_depends_on_the_seed_alone():
    one, two, more = (run(n, noise=RIG) for n in (10, 10, 23))
    for name in ("trajectories", "impacts", "trials"):
        assert getattr(one, name).equals(getattr(two, name))
    assert not one.trajectories.equals(run(10, noise=RIG, seed=1).trajectories)
    np.testing.assert_allclose(poses(more)[:10], poses(one), atol=CONTACT_TIME)


@pytest.mark.slow
def test_noise_is_what_was_asked_for_and_leaves_the_truth_alone():
    clean, noisy = run(40), run(40, noise=RIG)
    error = poses(noisy) - poses(clean)
    np.testing.assert_allclose(error.std(axis=(0, 1)), [3e-4, 3e-4, 3e-3], rtol=0.05)  # 8,040 samples: 0.8 %
    assert noisy.impacts.equals(clean.impacts)
    assert noisy.header.noise == RIG and clean.header.noise is None
    only = poses(run(5, noise=Noise(angle=3e-3))) - poses(run(5))
    assert (only[..., :2] == 0).all() and (only[..., 2] != 0).all()


def test_pre_impact_states_resemble_the_published_ones():
    # published means, standard deviations and ranges of 1,718 impacts (reference: vx, vy, omega)
    first = run(2000, duration=0.32, rate=25.0).impacts.query("impact == 0")
    for name, mean, std, low, high in (
        ("vx_pre", 0.60, 0.155, 0.14, 1.13),
        ("vy_pre", -2.57, 0.157, -2.87, -2.21),
        ("omega_pre", -1.13, 6.12, -14.3, 25.4),
    ):
        values = first[name]
        assert low <= values.min() and values.max() <= high
        # a fifth of a standard deviation: alike for the study's purpose, far above the sampling error of 2 %
        assert abs(values.mean() - mean) < 0.2 * std
        assert values.std() == pytest.approx(std, rel=0.2)
    assert first["t"].min() > 0.2  # 50 samples of flight before the impact, for the fit of the arc


def test_output_is_a_valid_dataset(tmp_path):
    out = run(5, noise=RIG)
    write_dataset(Dataset("drops", out.header, trajectories=out.trajectories), tmp_path / "drops")
    back = read_dataset(tmp_path / "drops")
    assert back.header == out.header
    np.testing.assert_allclose(back.trajectories[POSES], out.trajectories[POSES], atol=1e-6)
    truth = dataclasses.replace(back, trajectories=None, impacts=out.impacts[list(TRUTH[:14])])
    write_dataset(truth, tmp_path / "truth")
    assert len(read_dataset(tmp_path / "truth").impacts) == len(out.impacts)


def test_drops_that_never_land_have_an_empty_table_of_impacts():
    out = run(3, duration=0.1)
    assert tuple(out.impacts.columns) == TRUTH and len(out.impacts) == 0
    assert (out.trials["impacts"] == 0).all()


# --- failures ---


def test_a_failed_solve_is_a_counted_row_and_ends_its_drop_only(monkeypatch):
    solve, calls = drops_module.impact, []

    def failing(mass, J, v, mu, epsilon):
        out, v_post = solve(mass, J, v, mu, epsilon)
        if not calls:
            calls.append(1)
            out.status[0], out.c[0], v_post[0] = LcpStatus.NO_SOLUTION, np.nan, np.nan
        return out, v_post

    monkeypatch.setattr(drops_module, "impact", failing)
    out = run(10)
    failed = out.impacts[out.impacts["status"] != LcpStatus.SOLVED]
    assert len(failed) == 1 and failed[["c_t", "c_n", *V_POST]].isna().all(axis=None)
    trial = failed["trial"].iloc[0]
    assert out.trials["status"].tolist() == [DropStatus.LCP_FAILED if i == trial else 0 for i in range(10)]
    assert out.trajectories["x"].notna().all()
    last = out.trajectories.groupby("trial")["t"].max()
    assert last[trial] < failed["t"].iloc[0] and (last.drop(trial) == last.max()).all()


def test_too_many_impacts_in_a_step_are_reported(monkeypatch):
    monkeypatch.setattr(drops_module, "MAX_IMPACTS", 0)
    out = run(3)
    assert (out.trials["status"] == DropStatus.CLUSTERED).all()
    assert len(out.impacts) == 0 and poses(out).shape[1] == 201


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"body": ELLIPSE_BODY.model_copy(update={"mass": None})}, "mass"),
        ({"release": at(height=0.03)}, "touch the surface"),
        ({"mu": -0.1}, "mu"),
        ({"epsilon": 1.1}, "epsilon"),
        ({"epsilon": np.nan}, "epsilon"),
        ({"dt": 0.0}, "dt"),
        ({"rate": np.inf}, "rate"),
        ({"n": 0}, "positive n"),
    ],
)
def test_what_cannot_be_simulated_is_refused(change, message):
    with pytest.raises(UserError, match=message):
        run(**{"n": 2, **change})


def test_spreads_are_checked():
    with pytest.raises(ValueError, match="exceeds"):
        Spread(low=1.0, high=0.0)
    with pytest.raises(ValueError, match="together"):
        Spread(low=0.0, high=1.0, mean=0.5)
    with pytest.raises(ValueError, match="extra"):
        Spread(low=0.0, high=1.0, sd=0.5)
