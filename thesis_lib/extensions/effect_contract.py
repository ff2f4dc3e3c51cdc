"""Contract of every effect: the same checks test the effects of the library and of users.

Each check calls the hooks of the effect, or predicts with the critique's model and the effect, for the bodies and
states of `effect_probe`.
"""

import inspect
import math
from collections.abc import Collection
from dataclasses import replace

import numpy as np

from thesis_lib.bodies.shapes import Disk, Polygon
from thesis_lib.effects import effects_in
from thesis_lib.effects.effect import FAMILIES, ORIGIN, Effect, Parameter, Reference, Rig, parameters_in
from thesis_lib.extensions.contract import Check, NothingYet
from thesis_lib.extensions.effect_in_space import SPACE_EFFECT_CHECKS
from thesis_lib.extensions.effect_probe import (
    BOX,
    RECORDED_BOX,
    RIGS,
    TAU,
    at_scale,
    differs,
    flat,
    hook_calls,
    null,
    predict,
    random_states,
    tumbling_boxes,
)
from thesis_lib.extensions.old_hooks import rewritten
from thesis_lib.foundation.errors import suggest
from thesis_lib.mechanics.space import PLANE, SPACE
from thesis_lib.mechanics.state import State

N = 300  # number of states
FEW = 40  # number of states for checks in which one would suffice
SLIDE = "slide"  # changed by every effect on friction, whether declared or not
CHANNELS = ("impact", "meet", "touch", "flight", SLIDE)
ROUNDING = 1e-12  # relative to 1: a map of order one and its inverse
IDENTITY = 1e-15  # a null effect may cause one rounding error
IN_SPACE = 1e-11  # for numbers of order 1 to 10 after a few rotations
# velocities (m/s, with ω k_g), poses (m or rad) and accelerations (m/s²) that a rig with noise of 0.3 mm and 3 mrad
# resolves in about 100 impacts: the change due to an effect at its scale must not be below
RESOLVED = {"impact": 3e-3, "meet": 1e-3, "touch": 1e-4, "flight": 1e-2, SLIDE: 3e-2}
UNCHANGED = 1e-9  # difference quotients of the flight lose three digits
ELSEWHERE = Reference(x=3.0, t=1000.0, trial=1000.0)
SHIFTED = 1e-9  # relative to 1: numbers near 1000 have lost three digits, and edges of 2 mm two more
MIRRORED, BROKEN = 1e-6, 1.0  # in units of RESOLVED: mirror symmetry holds below the first, is broken above the second
DISK = Rig(Disk(radius=0.03), 0.0212, 9.81, 0.0)
PATH = (-0.1, -0.1 + 0.1 / 3, -0.1 / 3, 0.0)  # s, evenly spaced: the third difference of a parabola is zero
STRAIGHT = 1e-9  # m and rad
NOTHING = "it changes nothing yet: write its equation into one of the hooks"


def _for_each(value: object, n: int) -> tuple[np.ndarray, ...]:
    """Arrays in a hook's result, each with one value for each body, even if all bodies share an inertia."""
    arrays = [array[None] if array.ndim == 0 else array for array in flat(value)]
    return tuple(np.broadcast_to(array, (*array.shape[:-1], n)) for array in arrays)


def _states(rig: Rig, seed: int = 5) -> State:
    return random_states(rig, N, np.random.default_rng(seed))


def _scenes(effect: Effect) -> list[tuple[str, Rig, State]]:
    """Kinds of bodies with their rigs and states, in each space in which the effect is defined."""
    in_plane, in_space = (space.dimension in effect.dimensions for space in (PLANE, SPACE))
    scenes = [(kind, rig, _states(rig)) for kind, rig in RIGS.items()] * in_plane
    boxes = tumbling_boxes(FEW, np.random.default_rng(8))
    return scenes + [("box", BOX, boxes), ("recorded box", RECORDED_BOX, boxes)] * in_space


def hooks_of_today(effect: Effect) -> str:
    """Check that no hook was written for the arguments of an earlier version."""
    states = random_states(RIGS["ellipse"], FEW, np.random.default_rng(5))
    given = np.zeros((3, FEW))
    failing = []
    for hook, call in (
        ("acceleration", lambda: effect.acceleration(given, states, at_scale(effect), RIGS["ellipse"])),
        ("meet", lambda: effect.meet(given, states, states, at_scale(effect))),
    ):
        try:
            made = call()
        except (ValueError, IndexError):
            made = np.zeros(0)
        if np.shape(made) != given.shape:
            failing.append(hook)
    if text := rewritten(effect, failing):
        return f"its hooks are those of an earlier version. Put these in their place:\n\n{text}\n"
    return ""


def declared(effect: Effect) -> str:
    """Check family, channels, and parameters with sensible limits."""
    if not effect.title or not effect.equation:
        return "title and equation must describe the effect"
    if not _spaces(effect):
        return f"dimensions are {effect.dimensions!r}; they must be {{2}}, {{3}} or {{2, 3}}"
    if effect.family not in FAMILIES:
        return f"family is {effect.family!r}; it must be one of {', '.join(FAMILIES)}"
    if not effect.channels or not set(effect.channels) <= set(CHANNELS):
        return f"channels are {effect.channels!r}; they must be some of {', '.join(CHANNELS)}"
    names = [p.name for p in effect.parameters]
    if not names or len(set(names)) != len(names):
        return "parameters must contain at least one Parameter, and their names must differ"
    everything = (*effect.parameters, *effect.own_in_space)
    return next((f"parameter {p.name}: {why}" for p in everything if (why := _bad_limits(p))), "")


def _spaces(effect: Effect) -> frozenset[int]:
    """Dimensions in which the effect is defined; empty if its `dimensions` are not 2, 3 or both."""
    given = effect.dimensions
    known = isinstance(given, Collection) and set(given) <= {PLANE.dimension, SPACE.dimension}
    return frozenset(given) if known else frozenset()


def _bad_limits(p: Parameter) -> str:
    if not (isinstance(p.name, str) and p.name.isidentifier()):
        return "its name must be one word of letters, digits and _"
    if not p.unit:
        return "it has no unit; give “1” for a pure number"
    if not all(map(math.isfinite, (p.null, p.low, p.high, p.scale, *p.starts, p.discrete or 0.0))):
        return "null, low, high, scale and starts must be finite"
    if not (p.low <= p.null <= p.high and p.low < p.high):
        return f"null {p.null:g} must lie between low {p.low:g} and high {p.high:g}, and low must be below high"
    if not (p.scale > 0 and p.null + p.scale <= p.high):
        return f"scale {p.scale:g} must be above 0, and null + scale at most high {p.high:g}"
    if not all(p.low <= start <= p.high for start in p.starts):
        return "all starts must lie between low and high"
    if p.discrete is not None and not (p.low <= p.discrete <= p.high and p.discrete != p.null):
        return "discrete must lie between low and high and differ from null"
    return ""


def described(effect: Effect) -> str:
    """Check that the module has a table of symbols, and the effect a source."""
    text = getattr(inspect.getmodule(type(effect)), "__doc__", "") or ""
    if "| on paper" not in text:
        return "the docstring of its file has no table of symbols (a row that begins with “| on paper”)"
    missing = [p.name for p in (*effect.parameters, *effect.own_in_space) if f"`{p.name}`" not in text]
    if missing:
        return f"the table of symbols lacks {', '.join(f'`{name}`' for name in missing)}"
    return "" if effect.reference else "reference is empty; name the source of the equation"


def absent_at_null(effect: Effect) -> str:
    """Check that every hook is the identity at the null parameters."""
    for kind, rig, states in _scenes(effect):
        rounding = (IDENTITY,) if states.space.is_plane else (IN_SPACE, IN_SPACE)
        for hook, (given, made) in hook_calls(effect, null(effect, states.space), rig, states).items():
            if why := differs(made, given, *rounding):
                return f"{hook} with all parameters at null must return its argument unchanged; for a {kind} it {why}"
    return ""


def has_inverses(effect: Effect) -> str:
    """Check that to_true and to_measured, and to_contact and from_contact, are inverses of each other."""
    for kind, rig, states in _scenes(effect):
        p, rounding = at_scale(effect, states.space), ROUNDING if states.space.is_plane else IN_SPACE
        for there, back in (("to_true", "to_measured"), ("to_contact", "from_contact")):
            for one, other in ((there, back), (back, there)):
                returned = getattr(effect, other)(getattr(effect, one)(states, p, rig), p, rig)
                if why := differs(returned, states, rounding, rounding):
                    return f"{other} must undo {one}, but the state of a {kind} {why}"
    return ""


def bends_what_it_says(effect: Effect) -> str:
    """Check that `bends` is set if and only if the camera reports a parabola with constant spin as another curve."""
    p, rig = at_scale(effect), RIGS["quadrilateral"]
    states = _states(rig, 9)
    fall = np.tile([0.0, -rig.gravity, 0.0], (N, 1))
    q = [effect.to_measured(states.flown(fall, h), p, rig).q for h in PATH]
    bent = float(np.abs(q[3] - 3.0 * q[2] + 3.0 * q[1] - q[0]).max())
    if effect.bends and not bent > STRAIGHT:
        return "it has bends = True, but the camera reports parabolas as parabolas; remove that line"
    if not effect.bends and bent > STRAIGHT:
        return f"the camera reports a parabola as another curve (by {bent:.2g} m within 0.1 s): set bends = True"
    return ""


def keeps_arguments(effect: Effect) -> str:
    """Check that no hook modifies its arguments."""
    for _, rig, states in _scenes(effect):
        p = at_scale(effect, states.space)
        kept = dict(p)
        copies = [array.copy() for array in flat(states)]
        calls = hook_calls(effect, p, rig, states)
        fresh = hook_calls(Effect(), {}, rig, states)
        for hook, (given, _) in calls.items():
            if differs(given, fresh[hook][0], 0.0):
                return f"{hook} changes its arguments; return new arrays"
        if p != kept or not all(np.array_equal(a, b) for a, b in zip(copies, flat(states))):
            return "a hook changes the parameters or the state; return new ones"
    return ""


def takes_arrays(effect: Effect) -> str:
    """Check that a parameter may be an array with a value for each body, because fits try several values at once."""
    for _, rig, states in _scenes(effect):
        p, n = at_scale(effect, states.space), len(states)
        switches = {q.name for q in parameters_in(effect, states.space) if q.discrete is not None}  # always numbers
        many = {name: value if name in switches else np.full(n, value) for name, value in p.items()}
        one, each = hook_calls(effect, p, rig, states), hook_calls(effect, many, rig, states)
        for hook, (_, made) in one.items():
            if why := differs(_for_each(each[hook][1], n), _for_each(made, n), ROUNDING, ROUNDING):
                return f"{hook} with an array of parameters, one for each body, {why}; use NumPy, no if and no float()"
    return ""


def finite_in_bounds(effect: Effect) -> str:
    """Check that predictions are finite, μ ≥ 0 and 0 ≤ ε ≤ 1 for all parameters within the bounds."""
    rng = np.random.default_rng(11)
    for _, rig, states in _scenes(effect):
        of = parameters_in(effect, states.space)
        draws = [{p.name: getattr(p, side) for p in of} for side in ("low", "high")]
        draws += [{p.name: rng.uniform(p.low, p.high) for p in of} for _ in range(8)]
        for p in draws:
            at = ", ".join(f"{name} = {value:.3g}" for name, value in p.items())
            made = predict([(effect, p)], states, rig)
            for channel in made:
                if not np.isfinite(made[channel]).all():
                    return f"the {channel} is not finite at {at}, which is within the bounds"
            mu, epsilon = hook_calls(effect, p, rig, states)["coefficients"][1]  # pyright: ignore[reportGeneralTypeIssues]
            if not ((mu >= 0).all() and (epsilon >= 0).all() and (epsilon <= 1).all()):
                return f"coefficients returns μ < 0 or ε outside 0 to 1 at {at}; clip them"
    return ""


def _sizes(effect: Effect) -> tuple[dict[str, float], bool]:
    """Change of each channel due to the effect at its scale, and whether it acts on the contact time.

    Contacts have a duration only for effects on the contact time: else changes of the impact would change the touch.
    """
    rig, states = _scene(effect)
    space = states.space
    timed = type(effect).contact_time is not Effect.contact_time
    tau = TAU if timed else 0.0
    made, base = (predict(on, states, rig, contact_time=tau) for on in ([(effect, at_scale(effect, space))], []))
    sizes = {}
    for channel in CHANNELS:
        change = np.abs(made[channel] - base[channel]).reshape(len(states), -1)
        if channel in ("impact", "flight"):
            change = change * np.repeat([1.0, rig.k_g], [space.dimension, space.turns])
        each = np.sum(change**2, axis=1)
        # rotation during a contact is of second order, except if it brings another corner into contact
        mean = np.median if timed and channel not in effect.channels else np.mean
        sizes[channel] = float(np.sqrt(mean(each)))
    return sizes, timed


def _scene(effect: Effect) -> tuple[Rig, State]:
    """Rig and states in the plane, or in space for effects that are defined there only."""
    if PLANE.dimension in effect.dimensions:
        return RIGS["quadrilateral"], _states(RIGS["quadrilateral"], 6)
    return RECORDED_BOX, tumbling_boxes(FEW, np.random.default_rng(6))


def acts_in_its_channels(effect: Effect) -> str:
    """Check that at its scale it changes its declared channels by more than data resolve, and no other channel."""
    if not effect.applies_to(_scene(effect)[0]):
        body = "polygon with four corners" if PLANE.dimension in effect.dimensions else "box"
        return f"applies_to refuses a {body}, which the checks of effects need"
    sizes, timed = _sizes(effect)
    if not any(sizes.values()):
        stages = [name for name, of in vars(Effect).items() if callable(of) and not name.startswith("_")]
        for name, of in vars(type(effect)).items():
            if callable(of) and name not in dir(Effect) and (said := suggest(name, stages)):
                return f"effects have no stage {name} ({said}), so it changes nothing"
        raise NothingYet(NOTHING)
    for channel, size in sizes.items():
        if channel in effect.channels and not size > RESOLVED[channel]:
            return (
                f"it names the channel {channel}, but null + scale changes it only by {size:.2g}, while data resolve "
                f"{RESOLVED[channel]:g}: give a larger scale, or remove the channel"
            )
        if channel not in (*effect.channels, SLIDE) and not size < (RESOLVED[channel] if timed else UNCHANGED):
            return f"it changes the channel {channel} (by {size:.2g}), which `channels` does not contain"
    return ""


def nothing_where_it_does_not_apply(effect: Effect) -> str:
    """Check that it changes nothing on a rig that `applies_to` refuses."""
    for rig in (DISK, *RIGS.values()):
        if effect.applies_to(rig):
            continue
        states = _states(rig, 12)
        made, base = predict([(effect, at_scale(effect))], states, rig), predict([], states, rig)
        for channel in CHANNELS:
            if not np.allclose(made[channel], base[channel], rtol=0.0, atol=UNCHANGED):
                return f"applies_to refuses a {rig.shape.kind}, but there it changes the {channel}"
    return ""


def mirror_difference(effect: Effect) -> float:
    """Largest difference between the outcome of a mirrored drop and the mirrored outcome, in units of `RESOLVED`."""
    rig = RIGS["quadrilateral"]
    assert isinstance(rig.shape, Polygon)
    flipped = Polygon(vertices=tuple((-x, y) for x, y in rig.shape.vertices))
    states = _states(rig, 7)
    mirrored = states.moved(x=-states.x, theta=-states.theta, vx=-states.vx, omega=-states.omega)
    active = [(effect, at_scale(effect))]
    there = ((states, rig), (mirrored, Rig(flipped, rig.k_g, rig.gravity, rig.height)))
    one, other = (predict(active, at, where, contact_time=TAU) for at, where in there)
    odd = {"impact": [-1, 1, -1], "meet": [-1, 1, -1], "touch": 1, "flight": [-1, 1, -1], SLIDE: -1}
    return max(
        float(np.max(np.abs(other[channel] * odd[channel] - one[channel]))) / RESOLVED[channel]
        for channel in effect.channels
    )


def mirror_symmetric(effect: Effect) -> str:
    """Check that a mirrored drop has the mirrored outcome, unless `breaks_mirror` is set."""
    difference = mirror_difference(effect)
    if effect.breaks_mirror and not difference > BROKEN:
        return "it has breaks_mirror = True, but a mirrored drop has the mirrored outcome; remove that line"
    if not effect.breaks_mirror and not difference < MIRRORED:
        return (
            f"the outcome of a mirrored drop is not mirrored (off by {difference:.2g} times what data resolve): check "
            "the signs (|v_t|, not v_t), or, if left and right differ on purpose, set breaks_mirror = True"
        )
    return ""


def counts_from_reference(effect: Effect) -> str:
    """Check that no result depends on the origins of place, time and release number, and that `along` is right."""
    rig = RIGS["quadrilateral"]
    states = random_states(rig, FEW, np.random.default_rng(14))
    here = _made(effect, states, rig)
    there = _made(effect, _moved(states, ELSEWHERE), replace(rig, reference=ELSEWHERE), ELSEWHERE)
    for hook, made in here.items():
        if why := differs(there[hook], made, SHIFTED, SHIFTED):
            return (
                f"{hook} must not depend on the origin of x, t and trial: count them from rig.reference, as in "
                f"state.x - rig.reference.x; with another origin, it {why}"
            )
    for name in ("x", "t", "trial"):
        other = _made(effect, states, replace(rig, reference=Reference(**{name: 0.1})))
        counted = any(differs(other[hook], made, 0.0) for hook, made in here.items())
        if counted and name not in effect.along:
            return f'it counts {name} from rig.reference: declare this with along = ("{name}",)'
        if name in effect.along and not counted:
            return f"along names {name}, but nothing is counted from rig.reference.{name}"
    return ""


def _moved(states: State, by: Reference, sign: float = 1.0) -> State:
    """States with x, t and trial counted from another origin."""
    return states.moved(**{name: getattr(states, name) + sign * getattr(by, name) for name in ("x", "t", "trial")})


def _made(effect: Effect, states: State, rig: Rig, moved: Reference = ORIGIN) -> dict[str, object]:
    """Results of the hooks for states; returned states are counted from 0 if the states were `moved`."""
    p, tau = at_scale(effect), np.full((len(states.x), 1), 0.1)
    made = {hook: value for hook, (_, value) in hook_calls(effect, p, rig, states).items()}
    arc = effect.arc(tau, states, p, rig)
    made |= {"arc": np.zeros(0) if arc is None else arc}
    made |= {"shapes": np.array([list(start.values()) for start in effect.shapes(states, rig)])}
    return {hook: _moved(value, moved, -1.0) if isinstance(value, State) else value for hook, value in made.items()}


def composes(effect: Effect) -> str:
    """Check that predictions with each effect of the library are finite, and neither effect cancels the other."""
    rig = RIGS["quadrilateral"]
    states = _states(rig, 13)

    def made(*on: Effect) -> dict[str, np.ndarray]:
        return predict([(one, at_scale(one)) for one in on], states, rig, contact_time=TAU)

    alone, idle = made(effect), not any(_sizes(effect)[0].values())
    for name, other in effects_in(PLANE).items():
        if name == effect.name:
            continue
        together, of_other = made(effect, other), made(other)
        for channel in CHANNELS:
            both = together[channel]
            if not np.isfinite(both).all():
                return f"together with {name} the {channel} is not finite"
            if channel in effect.channels and not idle and np.array_equal(both, of_other[channel]):
                return f"together with {name} it has no influence on the {channel}"
            if channel in other.channels and np.array_equal(both, alone[channel]):
                return f"it removes the influence of {name} on the {channel}: build on the argument of its hook"
    return ""


def in_any_order(effect: Effect) -> str:
    """Check that predictions are the same if it is added before or after all effects of the library."""
    rig = RIGS["quadrilateral"]
    states = random_states(rig, FEW, np.random.default_rng(15))
    others = [(one, at_scale(one)) for one in effects_in(PLANE).values() if one.name != effect.name]
    own = [(effect, at_scale(effect))]
    first, last = (predict(active, states, rig, contact_time=TAU) for active in (own + others, others[::-1] + own))
    for channel in CHANNELS:
        if not np.array_equal(first[channel], last[channel], equal_nan=True):
            return f"the {channel} differs if it is added first or last: hooks must keep no state, rank is a number"
    return ""


EFFECT_CHECKS: tuple[Check[Effect], ...] = (
    Check("has the hooks of this version", hooks_of_today),
    Check("declares what it is, with limits that make sense", declared),
    Check("explains its symbols and names a source", described, describes=True),
    Check("changes nothing at its null", absent_at_null),
    Check("undoes its own maps", has_inverses),
    Check("declares whether the camera bends parabolas", bends_what_it_says),
    Check("leaves its arguments unchanged", keeps_arguments),
    Check("accepts a value for each body", takes_arrays),
    Check("stays finite within its bounds", finite_in_bounds),
    Check("acts in its declared channels and in no other", acts_in_its_channels),
    Check("does nothing where it does not apply", nothing_where_it_does_not_apply),
    Check("gives a mirrored drop the mirrored outcome, or declares that it does not", mirror_symmetric),
    Check("counts places, times and releases from the reference", counts_from_reference),
    Check("works together with every effect of the library", composes),
    Check("acts the same in whatever order effects are added", in_any_order),
)
# checks for every space in which the effect is defined; the other checks are for the plane
ANYWHERE = (
    declared,
    described,
    absent_at_null,
    has_inverses,
    keeps_arguments,
    takes_arrays,
    finite_in_bounds,
    acts_in_its_channels,
)


def checks_of(effect: Effect) -> tuple[Check[Effect], ...]:
    """Checks that apply to an effect, by the dimensions in which it is defined."""
    checks, spaces = EFFECT_CHECKS, _spaces(effect)
    if not spaces:
        return tuple(check for check in checks if check.find is declared)
    if PLANE.dimension not in spaces:
        checks = tuple(check for check in checks if check.find in ANYWHERE)
    return (*checks, *SPACE_EFFECT_CHECKS) if SPACE.dimension in spaces else checks
