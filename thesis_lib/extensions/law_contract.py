"""What every impact law must do, whoever wrote it: the library's are tested by the same checks as a user's.

Each check resolves random impacts, most of them those of the reference draw (`impact_draws`).
"""

import functools

import numpy as np

from thesis_lib.contact.law import Law, Promise, Status
from thesis_lib.contact.space import velocity_change
from thesis_lib.extensions.contract import Check
from thesis_lib.extensions.impact_draws import ImpactDraws, reference_draw, violation

N_REFERENCE = 20_000  # as in the published constraint summary that the rates are compared with
# Relative to the speed (or energy) before impact.  Rounding, amplified by the condition of M_C (r/k up to 10),
# reaches 5e-13 in 600 000 impacts; of true violations less than 1 in 10 000 is below 1e-6.
KEPT = 1e-9
SIGMAS = 4.0  # binomial: one false alarm in 16 000 rates
RATE_DIGITS = 5e-4  # the rates in `breaks` have three digits
ROUNDING = 1e-12  # two evaluations of the same formulas in another order, relative to the speed
UNITS = 1e-10  # the same in other units of mass and length


@functools.cache
def reference() -> ImpactDraws:
    """The reference draw; do not write into it."""
    return reference_draw(np.random.default_rng(1), N_REFERENCE)


@functools.cache
def central() -> ImpactDraws:
    """The same with the centre of mass above the contact."""
    return reference_draw(np.random.default_rng(2), N_REFERENCE, central=True)


def few(n: int = 40) -> ImpactDraws:
    """A few impacts."""
    return reference_draw(np.random.default_rng(20180608), n)


def band(rate: float, n: int) -> float:
    """Half-width within which a rate measured on n impacts agrees with `rate`."""
    return SIGMAS * np.sqrt(rate * (1.0 - rate) / n) + RATE_DIGITS


def declared(law: Law) -> str:
    """Title and source, and each promise kept or broken at a rate."""
    if not law.title or not law.reference:
        return "title and reference must say what it is and where it is from"
    if both := law.promises & law.breaks.keys():
        return f"promises and breaks both hold {_names(both)}"
    if missing := set(Promise) - law.promises - law.breaks.keys():
        return f"neither promises nor breaks holds {_names(missing)}"
    if wrong := [promise for promise, rate in law.breaks.items() if not 0.0 < rate <= 1.0]:
        return f"breaks must be shares above 0 and at most 1; not so for {_names(wrong)}"
    return ""


def _names(promises) -> str:
    return ", ".join(sorted(f"Promise.{promise.name}" for promise in promises))


def always_solves(law: Law) -> str:
    """Every impact of the reference draw has a finite impulse."""
    failed = int(np.sum(reference().resolve(law).status != Status.OK))
    return f"the impulse is not finite in {failed} of {N_REFERENCE} random impacts" if failed else ""


def broken_share(law: Law, promise: Promise) -> float:
    """Share of the impacts of the reference draw in which a law breaks a promise."""
    factor = np.random.default_rng(20180608).uniform(0.1, 10.0, N_REFERENCE)
    x = violation(promise, law, reference(), central(), factor)
    return float(np.mean(~(x <= KEPT)))


def keeps_its_promises(law: Law) -> str:
    """What it promises holds in every impact, what it breaks it breaks at its stated rate."""
    for promise in Promise:
        share = broken_share(law, promise)
        said = f"Promise.{promise.name} ({promise.value})"
        if promise in law.promises and share:
            return f"it promises {said}, but breaks it in a share of {share:.3g}: move it to breaks, with that share"
        if promise in law.breaks and abs(share - law.breaks[promise]) > band(law.breaks[promise], N_REFERENCE):
            rate = law.breaks[promise]
            return f"it says that it breaks {said} in a share of {rate:.3g} of impacts; measured: {share:.3g}"
    return ""


def mirror_symmetric(law: Law) -> str:
    """(v_t, r_x, ω) → −(v_t, r_x, ω) turns (c_t, c_n) into (−c_t, c_n), wherever the impulse pushes."""
    draw = reference()
    out, mirrored = draw.resolve(law), draw.resolve(law, v_pre=draw.v_pre * [-1, 1, -1], r=draw.r * [-1, 1])
    away = np.abs(mirrored.impulse - out.impulse * [-1, 1]).max(axis=1) > ROUNDING * draw.speed
    wrong = int(np.sum((away & (out.impulse[:, 1] >= 0.0)) | (mirrored.status != out.status)))
    return f"in {wrong} of {N_REFERENCE} impacts the mirrored one has not the mirrored impulse" if wrong else ""


def ignores_units(law: Law) -> str:
    """Mass and length in other units give the same; μ of the viscous variant keeps its unit here."""
    draw, mass, length = reference(), 0.05, 0.02
    out = draw.resolve(law)
    v_pre, r = draw.v_pre / [1.0, 1.0, length], draw.r * length
    other = law(v_pre, r, mass=mass, k_g=length, mu=draw.mu, epsilon=draw.epsilon)
    scale = draw.speed[:, None]
    if not np.allclose(other.impulse / mass / scale, out.impulse / scale, rtol=0.0, atol=UNITS, equal_nan=True):
        return "with mass and lengths in other units the impulse is another one: a constant in it has a unit"
    return ""


def keeps_momentum(law: Law) -> str:
    """v⁺ − v = M⁻¹ Jᵀ c, in SI units of a real body."""
    n, mass, k_g = 2000, 0.0364, 0.0192
    rng = np.random.default_rng(20180608)
    v_pre, r = rng.standard_normal((n, 3)) * [1.0, 1.0, 20.0], rng.uniform(-0.035, 0.035, (n, 2))
    out = law(v_pre, r, mass=mass, k_g=k_g, mu=0.3, epsilon=0.5)
    change = velocity_change(out.impulse[:, 0], out.impulse[:, 1], r, mass=mass, k_g=k_g)
    same = np.allclose(out.v_post - v_pre, change, rtol=1e-9, atol=1e-10, equal_nan=True)
    return "" if same else "the velocity after impact is not that which the impulse gives"


def elastic_without_friction(law: Law) -> str:
    """ε = 1 and μ = 0 keep the energy, α = 1 exactly, for every law that is frictionless at μ = 0."""
    alpha = reference().space.alpha(*reference().impulse(law, mu=0.0, epsilon=1.0))
    if Promise.FRICTIONLESS in law.promises and not np.all(np.abs(alpha - 1.0) <= KEPT):
        return "with ε = 1 and μ = 0 it does not keep the energy, though it is frictionless there"
    return ""


def takes_batches(law: Law) -> str:
    """n impacts at once, one at a time, and a grid of parameters (G, 1) agree; none give none."""
    impacts = few()
    out = impacts.resolve(law, mu=0.4, epsilon=0.6)
    if not np.array_equal(impacts.resolve(law, mu=np.full(40, 0.4), epsilon=np.full(40, 0.6)).v_post, out.v_post):
        return "one μ and ε for all impacts, and the same for each, give different outcomes"
    for i in range(40):
        row = law(impacts.v_pre[i : i + 1], impacts.r[i : i + 1], mass=1.0, k_g=1.0, mu=0.4, epsilon=0.6)
        if row.status[0] != out.status[i] or not np.allclose(row.impulse[0], out.impulse[i], rtol=1e-10, atol=1e-12):
            return "an impact alone and the same among others have different outcomes"
    if law(np.empty((0, 3)), np.empty((0, 2)), mass=1.0, k_g=1.0, mu=0.3, epsilon=0.5).v_post.shape != (0, 3):
        return "no impacts must give no outcomes"
    seven, mu, epsilon = few(7), np.array([[0.1], [0.5], [1.2]]), np.array([[0.2], [0.5], [0.9]])
    c_t, c_n = law.impulse(seven.space, mu, epsilon)
    if np.broadcast_shapes(np.shape(c_t), np.shape(c_n)) != (3, 7):
        return "a grid of parameters (3, 1) on 7 impacts must give (3, 7) impulses: broadcast"
    for i in range(3):
        row = seven.resolve(law, mu=mu[i, 0], epsilon=epsilon[i, 0]).impulse
        grid = np.stack([np.broadcast_to(c, (3, 7))[i] for c in (c_t, c_n)], axis=-1)
        if not np.allclose(grid, row, rtol=1e-9, atol=1e-12):
            return "a grid of parameters and single ones give different impulses"
    return ""


def keeps_arguments(law: Law) -> str:
    """Nothing is written into what the law is given."""
    impacts = few()
    given = (impacts.v_pre, impacts.r, impacts.mu, impacts.epsilon)
    before = [array.copy() for array in given]
    space = impacts.space
    kept = np.array(space.v), np.array(space.K)
    law.impulse(space, impacts.mu, impacts.epsilon)
    same = np.array_equal(np.array(space.v), kept[0]) and np.array_equal(np.array(space.K), kept[1])
    if not same or not all(np.array_equal(a, b) for a, b in zip(given, before)):
        return "impulse writes into its arguments; make new arrays"
    return ""


def leaves_what_does_not_approach(law: Law) -> str:
    """A contact with v_n ≥ 0 gets no impulse."""
    r = np.array([[0.3, -0.5], [0.3, -0.5]])
    for v_n in (0.0, 0.7):
        v = np.array([[0.4, v_n, 0.0], [0.4, -1.0, 0.0]])
        out = law(v, r, mass=1.0, k_g=0.3, mu=0.4, epsilon=0.5)
        if out.status.tolist() != [Status.NOT_APPROACHING, Status.OK] or np.any(out.impulse[0] != 0.0):
            return "a contact that does not approach must have no impulse, and spare the others"
        if not out.impulse[1, 1] > 0.0:
            return "a contact that approaches must be pushed"
    return ""


def marks_invalid_states(law: Law) -> str:
    """NaN or infinity in one state is marked, and spares the others."""
    for bad in (np.nan, np.inf, -np.inf):
        for column in range(5):
            state = np.tile([0.6, -2.5, 1.0, 0.1, -0.2], (3, 1))
            state[1, column] = bad
            out = law(state[:, :3], state[:, 3:], mass=1.0, k_g=0.3, mu=0.4, epsilon=0.5)
            if out.status.tolist() != [Status.OK, Status.INVALID_INPUT, Status.OK]:
                return f"with {bad} in one state the others must be resolved as without it"
    return ""


LAW_CHECKS: tuple[Check[Law], ...] = (
    Check("says where it is from, what it promises and what it breaks", declared),
    Check("solves every impact", always_solves),
    Check("keeps its promises, and breaks the others as often as it says", keeps_its_promises),
    Check("gives a mirrored impact the mirrored impulse", mirror_symmetric),
    Check("does not depend on the units of mass and length", ignores_units),
    Check("gives the velocity that follows from its impulse", keeps_momentum),
    Check("keeps the energy where nothing takes it", elastic_without_friction),
    Check("takes one impact, many, and grids of parameters", takes_batches),
    Check("leaves its arguments as they are", keeps_arguments),
    Check("leaves a contact alone that does not approach", leaves_what_does_not_approach),
    Check("marks an invalid state and spares the others", marks_invalid_states),
)
