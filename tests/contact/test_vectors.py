"""Published cases with known answers: test vectors to the printed digits, limits, and the energy paradox."""

import numpy as np
import pytest

from thesis_lib.contact import LAWS, Promise, Status
from thesis_lib.contact.slip_path import slip_path
from thesis_lib.contact.space import contact_space

HALF_DIGIT = 0.505  # of the last printed digit: correct rounding, with room for values exactly between two
EXACT = 1e-12  # where the answer is a fraction

# the rod of length 1 at 45 degrees that hits with its lower left end
ROD = {"r": (-np.sqrt(0.125), -np.sqrt(0.125)), "mass": 1.0, "k_g": np.sqrt(1 / 12)}
DISC = {"r": (0.0, -0.05), "mass": 1.0, "k_g": np.sqrt(0.5) * 0.05}
ELLIPSE = {"r": (0.006, -0.031), "mass": 0.0364, "k_g": np.sqrt(3.7e-4)}

# columns of the tables of vectors
COLUMNS = (
    "anitescu_potra_newton",
    "anitescu_potra_poisson",
    "anitescu_potra_poisson_as_published",
    "drumwright_shell_as_published",
    "mirtich",
    "wang_mason",
    "whittaker_as_published",
)
# (body, v_x, v_y, μ, ε, (c_t, c_n) as printed, law by law; one entry for all laws that agree)
VECTORS = [
    (DISC, 1, -2, 0.2, 0.6, ["-.333333333333333 3.2"] * 7),
    (DISC, 1, -2, 1.2, 0.6, ["-.333333333333333 3.2"] * 7),
    (DISC, 1, -2, 0.0, 0.6, ["0 3.2"] * 7),
    (
        ELLIPSE, 0.6, -2.5, 0.2, 0.6,
        ["-.0262975 .144737", "-.0264842 .146074", "-.0182592 .146074", "-.0183381 .146705",
         "-.0264062 .145515", "-.0264842 .146074", "-.0262975 .144737"],
    ),
    (
        ELLIPSE, 0.6, -2.5, 1.2, 0.6,
        ["-.0262975 .144737", "-.0265466 .146520", "-.0188684 .146520", "-.0188684 .146520",
         "-.0265388 .146464", "-.0265466 .146520", "-.0262975 .144737"],
    ),
    (
        ELLIPSE, 0.6, -2.5, 0.2, 0.0,
        ["-.0182592 .0912961"] * 3 + ["-.0183381 .0916905"] + ["-.0182592 .0912961"] * 2
        + ["-.018315 .0915752"],
    ),
    (ELLIPSE, 0.6, -2.5, 0.0, 0.6, ["0 .132690"] * 6 + ["0 .144737"]),
    (
        ROD, 0.2, -1, 0.2, 0.6,
        [".145455 .727273", ".145455 .727273", ".0909091 .727273", ".096 .768",
         ".0971088 .685544", ".0967273 .683636", ".185 .925"],
    ),
    (
        ROD, 0.2, -1, 1.2, 0.6,
        [".475 .925", ".448 .88", ".25 .88", ".25 .88", ".449088 .881813", ".448 .88", ".475 .925"],
    ),
    (
        ROD, 0.2, -1, 0.2, 0.0,
        [".0909091 .454545"] * 3 + [".096 .48"] + [".0454545 .427273"] * 2 + [".11 .55"],
    ),
]  # fmt: skip


def assert_printed(values, printed: str) -> None:
    """Values are the numbers as printed; short decimals such as .48 are exact."""
    for value, text in zip(values, printed.split(), strict=True):
        digits = len(text.partition(".")[2])
        assert abs(value - float(text)) <= (HALF_DIGIT * 10.0**-digits if digits > 4 else EXACT), (value, text)


def resolve(name, body, v_x, v_y, mu, epsilon):
    """(c_t, c_n), α and v_C⁺ of one impact without spin; the contact velocity is then (v_x, v_y)."""
    v, r = np.array([[v_x, v_y, 0.0]]), np.array([body["r"]])
    out = LAWS[name](v, r, mass=body["mass"], k_g=body["k_g"], mu=mu, epsilon=epsilon)
    assert out.status[0] == Status.OK
    space = contact_space(v, r, mass=body["mass"], k_g=body["k_g"])
    c_t, c_n = out.impulse.T
    return out.impulse[0], space.alpha(c_t, c_n)[0], np.concatenate(space.velocity_after(c_t, c_n))


@pytest.mark.parametrize("vector", VECTORS, ids=lambda v: f"v_x={v[1]}-mu={v[3]}-eps={v[4]}-m={v[0]['mass']}")
@pytest.mark.parametrize("column", range(7), ids=COLUMNS)
def test_vector(vector, column):
    body, v_x, v_y, mu, epsilon, impulses = vector
    assert_printed(resolve(COLUMNS[column], body, v_x, v_y, mu, epsilon)[0], impulses[column])


def test_compliance_of_the_bodies():
    def space(body):
        return contact_space(np.zeros((1, 3)), np.array([body["r"]]), mass=body["mass"], k_g=body["k_g"])

    s = space(ROD)
    np.testing.assert_allclose([s.K_tt[0], s.K_nn[0], s.K_tn[0], s.det[0]], [2.5, 2.5, -1.5, 4], rtol=EXACT)
    np.testing.assert_allclose(s.M_c[0], [[0.625, 0.375], [0.375, 0.625]], rtol=EXACT)
    assert s.K_tn**2 / (s.K_tt * s.K_nn) == pytest.approx(0.36, rel=EXACT)
    s = space(DISC)
    np.testing.assert_allclose([s.K_tt[0], s.K_nn[0], s.K_tn[0]], [3, 1, 0], atol=EXACT)
    s = space(ELLIPSE)
    assert_printed([s.K_tt[0], s.K_tn[0], s.K_nn[0]], "98.826849 13.810514 30.145530")


# ------------------------------------------------------------------------------------------ sanity cases


@pytest.mark.parametrize(
    "name, expected",
    [
        ("anitescu_potra_newton", (-0.64, 3.2)),
        ("anitescu_potra_poisson", (-0.64, 3.2)),
        ("mirtich", (-0.64, 3.2)),
        ("wang_mason", (-0.64, 3.2)),
        ("whittaker", (-0.64, 3.2)),
        ("anitescu_potra_poisson_as_published", (-0.4, 3.2)),
        ("drumwright_shell_as_published", (-0.5, 4.0)),
    ],
)
def test_sliding_disc_separates_friction_in_restitution(name, expected):
    c, _, v_post = resolve(name, DISC, 4, -2, 0.2, 0.6)
    np.testing.assert_allclose(c, expected, rtol=EXACT)
    if name == "drumwright_shell_as_published":
        assert v_post[1] == pytest.approx(2.0, rel=EXACT)  # above ε · 2


@pytest.mark.parametrize("name", [name for name, law in LAWS.items() if Promise.CENTRAL in law.promises])
def test_central_stick_impulse_of_disc_and_sphere(name):
    # |v_t| / K_tt = m |v_t| / 3 (disc), 2 m |v_t| / 7 (sphere)
    for k2, share in ((0.5, 1 / 3), (0.4, 2 / 7)):
        body = {"r": (0.0, -0.05), "mass": 0.3, "k_g": np.sqrt(k2) * 0.05}
        c, _, v_post = resolve(name, body, 0.7, -2.0, 1.0, 0.6)
        np.testing.assert_allclose(c, [-0.3 * 0.7 * share, 0.3 * 2.0 * 1.6], rtol=EXACT)
        assert abs(v_post[0]) <= EXACT


def test_slip_without_change_has_one_restitution(draw):
    # Newton = Poisson = Stronge where the first slip lasts to the end
    wang, mirtich = draw.resolve(LAWS["wang_mason"]), draw.resolve(LAWS["mirtich"])
    newton = draw.resolve(LAWS["anitescu_potra_newton"])
    v_t = draw.space.velocity_after(*wang.impulse.T)[0]
    slides = v_t * draw.space.v_t > 1e-6
    assert 0.4 < slides.mean() < 0.6
    np.testing.assert_allclose(mirtich.impulse[slides], wang.impulse[slides], rtol=1e-12, atol=EXACT)
    np.testing.assert_allclose(newton.impulse[slides], wang.impulse[slides], rtol=1e-11, atol=EXACT)


@pytest.mark.parametrize("mu", [0.36, 0.5, 0.9])
def test_energy_paradox(mu):
    """Newton's restitution with friction creates energy: α = .81/.64 for the rod at v = (0.6, −1), ε = 0.9."""
    c, alpha, v_post = resolve("anitescu_potra_newton", ROD, 0.6, -1.0, mu, 0.9)
    np.testing.assert_allclose(c, [0.3375, 0.9625], rtol=EXACT)
    np.testing.assert_allclose(v_post, [0.0, 0.9], atol=EXACT)
    assert alpha == pytest.approx(1.265625, rel=EXACT)
    assert alpha == pytest.approx(0.9**2 / (1 - 0.36), rel=EXACT)


@pytest.mark.parametrize(
    "name, printed",
    [
        ("wang_mason", ".147013 .730390 .453026"),
        ("mirtich", ".169441 .775246 .582633"),
        ("anitescu_potra_poisson", ".18 .76 .5265"),
    ],
)
def test_the_paradox_is_resolved_by_other_restitutions(name, printed):
    impulse, alpha, _ = resolve(name, ROD, 0.6, -1.0, 0.5, 0.9)
    assert_printed([*impulse, alpha], printed)


def test_the_paradox_needs_friction_enough_to_stick():
    stuck = resolve("anitescu_potra_newton", ROD, 0.6, -1.0, 0.3507, 0.9)
    slips = resolve("anitescu_potra_newton", ROD, 0.6, -1.0, 0.3506, 0.9)
    assert abs(stuck[2][0]) <= EXACT and abs(slips[2][0]) > 1e-6


def test_worst_case_of_newton_restitution(rng):
    # stick at the worst initial slip v_t = (K_tn/K_nn) v_n: α = ε² / (1 − ρ²), gain iff ε² > det / (K_tt K_nn)
    n = 500
    r, epsilon = rng.uniform(-1, 1, (n, 2)), rng.uniform(0, 1, n)
    space = contact_space(np.zeros((n, 3)), r, mass=1.0, k_g=0.5)
    v_n = -np.ones(n)
    v = np.stack([space.K_tn / space.K_nn * v_n, v_n, np.zeros(n)], axis=1)
    space = contact_space(v, r, mass=1.0, k_g=0.5)
    out = LAWS["anitescu_potra_newton"](v, r, mass=1.0, k_g=0.5, mu=1e6, epsilon=epsilon)
    limit = space.det / (space.K_tt * space.K_nn)
    np.testing.assert_allclose(space.alpha(*out.impulse.T), epsilon**2 / limit, rtol=1e-10)
    assert np.any(epsilon**2 > limit) and np.any(epsilon**2 < limit)


def test_stick_threshold_and_jam_of_the_rod():
    # once stuck the rod stays stuck iff μ ≥ 0.6; slip to the left jams (b ≤ 0) for μ > 5/3
    below, above = (resolve("wang_mason", ROD, 0.1, -1.0, mu, 0.5)[2] for mu in (0.59, 0.61))
    assert abs(above[0]) <= EXACT and below[0] < -1e-3  # K_tn < 0: slip leaves the stick towards −t
    v, r = np.array([[-0.6, -1.0, 0.0]]), np.array([ROD["r"]])
    space = contact_space(v, r, mass=1.0, k_g=ROD["k_g"])
    b = [slip_path(space, np.array(mu)).b[0] for mu in (5 / 3 - 1e-9, 5 / 3 + 1e-9)]
    assert b[0] > 0.0 > b[1]
