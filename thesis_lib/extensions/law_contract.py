"""Contract of every impact law: the same checks test the laws of the library and of users.

Each check resolves random impacts, mostly the reference draw (`impact_draws`), in the plane or in space.  Two further
checks apply in space.  A rotation R about the normal rotates velocity and compliance of the contact, and therefore the
impulse:

    v → R v,    K → R K Rᵀ,    c → R c.

A planar impact is an impact in space whose slip and lever r lie in one plane and that causes no motion across it: K
does not couple the plane with the direction across it, and the compliance across it does not matter.
"""

import functools
from collections.abc import Callable, Sequence

import numpy as np

from thesis_lib.contact.law import ROUNDING as KEPT
from thesis_lib.contact.law import Law, Promise, Status
from thesis_lib.extensions.contract import Check
from thesis_lib.extensions.impact_draws import ImpactDraws, reference_draw, reference_draw_in_space, violation
from thesis_lib.mechanics.contact import Contact
from thesis_lib.mechanics.space import PLANE, SPACE

# Numbers of impacts: in the plane as in the published constraint summary, with which the rates are compared.
# KEPT is relative to the speed (or energy) before impact: rounding, amplified by the condition of M_C (r/k up to 10),
# reaches 5e-13 in 600 000 impacts; of true violations less than 1 in 10 000 is below 1e-6.
N_REFERENCE = 20_000
N_IN_SPACE = 2_000
SIGMAS = 4.0  # binomial: one false alarm in 16 000 rates
RATE_DIGITS = 5e-4  # the rates in `breaks` have three digits
ROUNDING = 1e-12  # two evaluations of the same formulas in another order, relative to the speed
UNITS = 1e-10  # tolerance for other units of mass and length
# body of the checks that need only one: principal moments per mass in units of its radius of gyration squared
BODY = np.diag([0.8, 1.0, 1.3])
PARALLEL = 1.3  # compliance across a plane over compliance along it; any positive number would do


def drawn(rng: np.random.Generator, n: int, dimension: int, central: bool = False) -> ImpactDraws:
    """Reference draw of n impacts in 2 or 3 dimensions."""
    return (reference_draw if dimension == 2 else reference_draw_in_space)(rng, n, central=central)


@functools.cache
def reference(dimension: int = 2, *, central: bool = False) -> ImpactDraws:
    """Reference draw, if `central` with the centre of mass above the contact; cached, so do not write into it."""
    n = N_REFERENCE if dimension == 2 else N_IN_SPACE
    return drawn(np.random.default_rng(2 if central else 1), n, dimension, central)


def few(n: int = 40, dimension: int = 2) -> ImpactDraws:
    """Small draw of n impacts."""
    return drawn(np.random.default_rng(20180608), n, dimension)


def band(rate: float, n: int) -> float:
    """Half-width of the interval in which a rate measured on n impacts agrees with `rate`."""
    return SIGMAS * np.sqrt(rate * (1.0 - rate) / n) + RATE_DIGITS


def declared(law: Law) -> str:
    """Check title, source, and that each promise is either kept or broken at a stated rate."""
    if not law.title or not law.reference:
        return "title and reference must describe the law and its source"
    if both := law.promises & law.breaks.keys():
        return f"promises and breaks both contain {_names(both)}"
    if missing := set(Promise) - law.promises - law.breaks.keys():
        return f"neither promises nor breaks contains {_names(missing)}"
    for field in ("breaks", "breaks_in_space"):
        if wrong := [promise for promise, rate in getattr(law, field).items() if not 0.0 < rate <= 1.0]:
            return f"{field} must give shares above 0 and at most 1; wrong for {_names(wrong)}"
    if not _has_dimensions(law):
        return "dimensions must be {2}, {3} or {2, 3}"
    if 3 in law.dimensions and (missing := law.breaks.keys() - law.breaks_in_space.keys()):
        return f"breaks_in_space must state how often it breaks {_names(missing)} in space"
    return _miscounted(law)


def _has_dimensions(law: Law) -> bool:
    return isinstance(law.dimensions, frozenset | set) and bool(law.dimensions) and law.dimensions <= {2, 3}


def _miscounted(law: Law) -> str:
    """Where the impulse lacks a component; "" also if it cannot be computed, which other checks find."""
    for dimension, where, names in ((2, "the plane", "(c_t, c_n)"), (3, "space", "(c_t1, c_t2, c_n)")):
        draw = few(dimension=dimension)
        try:
            with np.errstate(all="ignore"):
                n = len(law.impulse(draw.space, draw.mu, draw.epsilon)) if dimension in law.dimensions else dimension
        except Exception:  # user-defined code can raise anything
            continue
        if n != dimension:
            return f"in {where}, with space.dimension {dimension}, impulse must return {names}, not {n} arrays"
    return ""


def _names(promises) -> str:
    return ", ".join(sorted(f"Promise.{promise.name}" for promise in promises))


def always_solves(law: Law, dimension: int = 2) -> str:
    """Check that every impact of the reference draw has a finite impulse."""
    draw = reference(dimension)
    failed = int(np.sum(draw.resolve(law).status != Status.OK))
    return f"the impulse is not finite in {failed} of {len(draw.mu)} random impacts" if failed else ""


def broken_share(law: Law, promise: Promise, dimension: int = 2) -> float:
    """Share of the impacts of the reference draw in which a law breaks a promise."""
    draw = reference(dimension)
    factor = np.random.default_rng(20180608).uniform(0.1, 10.0, len(draw.mu))
    x = violation(promise, law, draw, reference(dimension, central=True), factor)
    return float(np.mean(~(x <= KEPT)))


def keeps_its_promises(law: Law, dimension: int = 2) -> str:
    """Check that promises hold in every impact, and that the others are broken at their stated rates."""
    field, breaks = ("breaks", law.breaks) if dimension == 2 else ("breaks_in_space", law.breaks_in_space)
    for promise in Promise:
        share = broken_share(law, promise, dimension)
        said = f"Promise.{promise.name} ({promise.value})"
        if promise not in breaks and share:
            move = f"move it to {field}" if dimension == 2 else f"add it to {field}"
            return f"it promises {said}, but breaks it in a share of {share:.3g}: {move}, with that share"
        n = len(reference(dimension).mu)
        if promise in breaks and abs(share - breaks[promise]) > band(breaks[promise], n):
            rate = breaks[promise]
            return f"it states that it breaks {said} in a share of {rate:.3g} of impacts; measured: {share:.3g}"
    return ""


def mirror_symmetric(law: Law, dimension: int = 2) -> str:
    """Check that mirroring x turns (c_t, c_n) into (−c_t, c_n), wherever the impulse pushes."""
    draw = reference(dimension)
    out, mirrored = draw.resolve(law), draw.mirrored().resolve(law)
    x = [-1, 1] if dimension == 2 else [-1, 1, 1]
    tolerance = ROUNDING if dimension == 2 else KEPT
    away = np.abs(mirrored.impulse - out.impulse * x).max(axis=1) > tolerance * draw.speed
    wrong = int(np.sum((away & (out.impulse[:, -1] >= 0.0)) | (mirrored.status != out.status)))
    return f"in {wrong} of {len(draw.mu)} impacts the mirrored impact lacks the mirrored impulse" if wrong else ""


def ignores_units(law: Law, dimension: int = 2) -> str:
    """Check that other units of mass and length give the same; μ of the viscous variant keeps its unit here."""
    draw, mass, length = reference(dimension), 0.05, 0.02
    out = draw.resolve(law)
    v_pre, r = np.array(draw.v_pre), draw.r * length
    v_pre[:, dimension:] /= length
    body: dict = {"k_g": length} if draw.inertia is None else {"inertia": draw.inertia * length**2}
    other = law(v_pre, r, mass=mass, **body, mu=draw.mu, epsilon=draw.epsilon)
    scale, tolerance = draw.speed[:, None], UNITS if dimension == 2 else KEPT
    if not np.allclose(other.impulse / mass / scale, out.impulse / scale, rtol=0.0, atol=tolerance, equal_nan=True):
        return "in other units of mass and length the impulse is different: a constant in it has a unit"
    return ""


def keeps_momentum(law: Law, dimension: int = 2) -> str:
    """Check that v⁺ − v = M⁻¹ Jᵀ c, in SI units for a real body."""
    n, mass, k_g, space = 2000, 0.0364, 0.0192, PLANE if dimension == 2 else SPACE
    rng = np.random.default_rng(20180608)
    v_pre = rng.standard_normal((n, space.motions)) * np.repeat([1.0, 20.0], [dimension, space.turns])
    r = rng.uniform(-0.035, 0.035, (n, dimension))
    body: dict = {"k_g": k_g} if dimension == 2 else {"inertia": k_g**2 * BODY}
    out = law(v_pre, r, mass=mass, **body, mu=0.3, epsilon=0.5)
    couple = space.moment(r.T, out.impulse.T).T
    turned = couple / k_g**2 if dimension == 2 else np.linalg.solve(k_g**2 * BODY, couple.T).T
    change = np.concatenate([out.impulse, turned], axis=1) / mass
    same = np.allclose(out.v_post - v_pre, change, rtol=1e-9, atol=1e-10, equal_nan=True)
    return "" if same else "the velocity after impact does not follow from the impulse"


def elastic_without_friction(law: Law, dimension: int = 2) -> str:
    """Check that ε = 1 and μ = 0 conserve energy, α = 1 exactly, for every law that is frictionless at μ = 0."""
    draw, breaks = reference(dimension), law.breaks if dimension == 2 else law.breaks_in_space
    alpha = draw.space.alpha(*draw.impulse(law, mu=0.0, epsilon=1.0))
    if Promise.FRICTIONLESS not in breaks and not np.all(np.abs(alpha - 1.0) <= KEPT):
        return "with ε = 1 and μ = 0 it does not conserve energy, though it is frictionless there"
    return ""


def takes_batches(law: Law, dimension: int = 2) -> str:
    """Check that n impacts at once, one at a time, and a grid of parameters (G, 1) agree; also for n = 0."""
    impacts = few(dimension=dimension)
    out = impacts.resolve(law, mu=0.4, epsilon=0.6)
    if not np.array_equal(impacts.resolve(law, mu=np.full(40, 0.4), epsilon=np.full(40, 0.6)).v_post, out.v_post):
        return "single numbers μ and ε, and arrays with the same values, give different outcomes"
    for i in range(40):
        row = impacts[i : i + 1].resolve(law, mu=0.4, epsilon=0.6)
        if row.status[0] != out.status[i] or not np.allclose(row.impulse[0], out.impulse[i], rtol=1e-10, atol=1e-12):
            return "an impact alone and the same impact among others have different outcomes"
    if impacts[:0].resolve(law, mu=0.3, epsilon=0.5).v_post.shape != (0, impacts.v_pre.shape[1]):
        return "zero impacts must give zero outcomes"
    seven, mu, epsilon = few(7, dimension), np.array([[0.1], [0.5], [1.2]]), np.array([[0.2], [0.5], [0.9]])
    c = law.impulse(seven.space, mu, epsilon)
    if np.broadcast_shapes(*(np.shape(part) for part in c)) != (3, 7):
        return "a grid of parameters (3, 1) on 7 impacts must give (3, 7) impulses: broadcast"
    for i in range(3):
        row = seven.resolve(law, mu=mu[i, 0], epsilon=epsilon[i, 0]).impulse
        grid = np.stack([np.broadcast_to(part, (3, 7))[i] for part in c], axis=-1)
        if not np.allclose(grid, row, rtol=1e-9, atol=1e-12):
            return "a grid of parameters and single parameters give different impulses"
    return ""


def keeps_arguments(law: Law, dimension: int = 2) -> str:
    """Check that the law does not modify its arguments."""
    impacts = few(dimension=dimension)
    given = (impacts.v_pre, impacts.r, impacts.mu, impacts.epsilon)
    before = [array.copy() for array in given]
    space = impacts.space
    kept = np.array(space.v), np.array(space.K)
    law.impulse(space, impacts.mu, impacts.epsilon)
    same = np.array_equal(np.array(space.v), kept[0]) and np.array_equal(np.array(space.K), kept[1])
    if not same or not all(np.array_equal(a, b) for a, b in zip(given, before)):
        return "impulse writes into its arguments; make new arrays"
    return ""


def leaves_what_does_not_approach(law: Law, dimension: int = 2) -> str:
    """Check that a contact with v_n ≥ 0 gets no impulse."""
    v, r, body = _three_alike(dimension)
    for v_n in (0.0, 0.7):
        v[0, dimension - 1] = v_n
        out = law(v[:2], r[:2], **body, mu=0.4, epsilon=0.5)
        if out.status.tolist() != [Status.NOT_APPROACHING, Status.OK] or np.any(out.impulse[0] != 0.0):
            return "a contact that does not approach must get no impulse, and must not affect the others"
        if not out.impulse[1, -1] > 0.0:
            return "a contact that approaches must be pushed"
    return ""


def marks_invalid_states(law: Law, dimension: int = 2) -> str:
    """Check that a state with NaN or infinity is marked as invalid and does not affect the others."""
    for bad in (np.nan, np.inf, -np.inf):
        v, r, body = _three_alike(dimension)
        for state in (v, r):
            for column in range(state.shape[1]):
                right, state[1, column] = state[1, column], bad
                out = law(v, r, **body, mu=0.4, epsilon=0.5)
                state[1, column] = right
                if out.status.tolist() != [Status.OK, Status.INVALID_INPUT, Status.OK]:
                    return f"with {bad} in one state the others must be resolved as without it"
    return ""


def _three_alike(dimension: int) -> tuple[np.ndarray, np.ndarray, dict]:
    """Three copies of one impact: velocities without spin, contact points, and properties of the body for a law."""
    if dimension == 2:
        return np.tile([0.6, -2.5, 0.0], (3, 1)), np.tile([0.1, -0.2], (3, 1)), {"mass": 1.0, "k_g": 0.3}
    v, r = np.tile([0.6, 0.3, -2.5, 0.0, 0.0, 0.0], (3, 1)), np.tile([0.1, -0.15, -0.2], (3, 1))
    return v, r, {"mass": 1.0, "inertia": 0.09 * BODY}


def turns_with_the_surface(law: Law, draw: ImpactDraws) -> str:
    """Check that impacts rotated about the normal have rotated impulses."""
    contact, R = draw.space, _about_the_normal(len(draw.mu))
    c = np.stack(law.impulse(contact, draw.mu, draw.epsilon))
    found = law.impulse(_turned(contact, R), draw.mu, draw.epsilon)
    wrong = _differ(law, found, np.einsum("ijn,jn->in", R, c), draw)
    return f"rotated about the normal, {wrong} of {len(draw.mu)} impacts lack the rotated impulse" if wrong else ""


def embeds_the_plane(law: Law, draw: ImpactDraws) -> str:
    """Check that an impact in a plane, at any angle about the normal, has the impulse of the planar law."""
    if 2 not in law.dimensions:
        return ""
    plane, R = draw.space, _about_the_normal(len(draw.mu))
    c_t, c_n = law.impulse(plane, draw.mu, draw.epsilon)
    zero = np.zeros_like(c_n)
    K = np.array([[plane.K_tt, zero, plane.K_tn], [zero, PARALLEL * plane.K_tt, zero], [plane.K_tn, zero, plane.K_nn]])
    embedded = _turned(Contact(np.stack([plane.v_t, zero, plane.v_n]), K), R)
    expected = np.einsum("ijn,jn->in", R, np.stack([c_t, zero, c_n]))
    wrong = _differ(law, law.impulse(embedded, draw.mu, draw.epsilon), expected, draw)
    return f"in {wrong} of {len(draw.mu)} impacts in a plane the impulse in space is different" if wrong else ""


def _about_the_normal(n: int) -> np.ndarray:
    """Rotation matrices (3, 3, n) about the normal by angles of all sizes, every other by zero."""
    angle = np.linspace(-np.pi, np.pi, n) * (np.arange(n) % 2)
    cos, sin, zero = np.cos(angle), np.sin(angle), np.zeros(n)
    return np.array([[cos, -sin, zero], [sin, cos, zero], [zero, zero, zero + 1.0]])


def _turned(contact: Contact, R: np.ndarray) -> Contact:
    return Contact(np.einsum("ijn,jn->in", R, contact.v), np.einsum("ijn,jkn,lkn->iln", R, contact.K, R))


def _differ(law: Law, found: Sequence[np.ndarray], expected: np.ndarray, draw: ImpactDraws) -> int:
    """Number of impacts whose impulse differs from the expected impulse."""
    tolerance = KEPT * draw.speed
    return int(np.sum(~(np.abs(np.stack(found) - expected).max(axis=0) <= tolerance)))


# in the plane and in space
_CHECKS: tuple[tuple[str, Callable[..., str]], ...] = (
    ("solves every impact", always_solves),
    ("keeps its promises, and breaks the others as often as stated", keeps_its_promises),
    ("gives a mirrored impact the mirrored impulse", mirror_symmetric),
    ("does not depend on the units of mass and length", ignores_units),
    ("gives the velocity that follows from its impulse", keeps_momentum),
    ("keeps the energy if nothing dissipates it", elastic_without_friction),
    ("takes one impact, many, and grids of parameters", takes_batches),
    ("leaves its arguments unchanged", keeps_arguments),
    ("gives no impulse to a contact that does not approach", leaves_what_does_not_approach),
    ("marks an invalid state and resolves the others", marks_invalid_states),
)
LAW_CHECKS: tuple[Check[Law], ...] = (
    Check("states its source, its promises and what it breaks", declared),
    *(Check(name, find) for name, find in _CHECKS),
)
SPACE_CHECKS: tuple[Check[Law], ...] = (
    *(Check(f"in space, {name}", functools.partial(find, dimension=3)) for name, find in _CHECKS),
    Check("in space, rotates the impulse with the impact", lambda law: turns_with_the_surface(law, reference(3))),
    Check("in space, equals the planar law for impacts in a plane", lambda law: embeds_the_plane(law, reference())),
)


def checks_of(law: Law) -> tuple[Check[Law], ...]:
    """Checks that apply to a law, by the dimensions in which it holds."""
    if not _has_dimensions(law) or _miscounted(law):
        return LAW_CHECKS[:1]
    in_plane = LAW_CHECKS if 2 in law.dimensions else LAW_CHECKS[:1]
    return (*in_plane, *SPACE_CHECKS) if 3 in law.dimensions else in_plane
