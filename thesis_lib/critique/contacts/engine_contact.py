"""Contacts resolved by a physics engine instead of a law, from touch until the body is off the surface.

An engine is treated as a law whose contacts the engine resolves: camera, flight, episodes and likelihood are unchanged.
Its parameters are those of the compliant law that approximates it (`STAND_INS`); both are therefore fitted alike.

Effects of body and rig that act outside the contact force become causes in the engine (`CAUSE_OF`); a surface that
moves along itself is a change of frame; (μ, ε) that depend on place or angle are passed to MuJoCo for each body.  No
engine supports other effects (`lacks`).
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from thesis_lib.bodies.body import Body
from thesis_lib.contact.compliant.compiled import SPEED
from thesis_lib.contact.law import Law
from thesis_lib.critique.contacts.bases import BASES
from thesis_lib.critique.contacts.contact_time import DAMPING_RATIO, IMPEDANCE
from thesis_lib.critique.contacts.dynamics import Dynamics
from thesis_lib.critique.contacts.model import Model
from thesis_lib.critique.contacts.pressing import integrates
from thesis_lib.effects.effect import Effect, Rig
from thesis_lib.engines.engine import OUTSIDE, Press, impacts
from thesis_lib.engines.parameters import DrakeNumbers, MujocoNumbers, drake_numbers, of_drake, of_mujoco
from thesis_lib.mechanics.space import PLANE, Space
from thesis_lib.mechanics.state import State
from thesis_lib.simulate.rig.hidden_causes import CAUSES, CompliantContact, HiddenCauses

MASS = 1.0  # kg: arbitrary, because planar drops do not reveal the mass and contacts are given per mass
SHORTEST = 2e-5  # s; shortest contact of an engine
INSTANT = 1e-4  # s, for impacts measured as instants: a body hardly moves during this time
LONGEST = 0.1  # s
LATE = 5e-3  # s; longer contacts are compared as if they ended then: the arc after them is observed
STAND_INS = {  # engine: the compliant law that approximates it, and its title
    "mujoco": ("convex_contact", "MuJoCo"),
    "drake": ("hunt_crossley_contact", "Drake, point contact"),
    "drake_hydroelastic": ("pressure_field_contact", "Drake, hydroelastic"),
    "bullet": ("damped_contact", "Bullet"),
}
DEFAULT = ":default"  # suffix of an engine's name: with the engine's default contact
IN_SPACE = ("mujoco", "drake")
WITH_DEFAULT = ("mujoco", "drake", "bullet")  # hydroelastic bodies in Drake have no default: they require a modulus
# MuJoCo's default contact, with the impedance at large depth, and Drake's for geometries without properties
MUJOCO_DEFAULT = MujocoNumbers((0.02, 1.0), (0.9, 0.95, 1e-3, 0.5, 2.0), friction=1.0, impratio=1.0)
DRAKE_DEFAULT = DrakeNumbers(stiffness=1e6, dissipation=50.0, friction=0.5)
BULLET_DEFAULT = (0.5 * 0.5, 0.0, 1.0 / 240.0)  # μ of two bodies, ε, and the time step in s that a rigid contact takes
CAUSE_OF = {f"{CAUSES[name].effects[0]}.{CAUSES[name].parameter}": name for name in OUTSIDE}
FRAME = "moving_surface"
_OF_FORCE = ("to_contact", "from_contact", "contact_point", "inertia", "impulse", "gap", "contact_time")


def engine_law(name: str) -> Law:
    """Law for the engine `name`; "mujoco:default" is MuJoCo with its default contact.  KeyError for unknown names."""
    engine, default = name.removesuffix(DEFAULT), name.endswith(DEFAULT)
    base, title = STAND_INS[engine]
    title += " at its defaults" * default
    return replace(BASES[base], name=name, title=title, engine=name, reference="its own contact")


def default_values(engine: str, mass: float) -> dict[str, float]:
    """Default contact of an engine of `WITH_DEFAULT` as values of its law; for Drake it depends on `mass` in kg."""
    force = engine_law(engine).force
    assert force is not None  # every law in `STAND_INS` has one
    if engine == "mujoco":
        mu, epsilon, lasting = of_mujoco(MUJOCO_DEFAULT)
        ratio = {DAMPING_RATIO.name: MUJOCO_DEFAULT.impratio, IMPEDANCE.name: MUJOCO_DEFAULT.solimp[1]}
    elif engine == "bullet":
        (mu, epsilon, lasting), ratio = BULLET_DEFAULT, {}
    else:
        mu, epsilon, lasting = of_drake(DRAKE_DEFAULT, mass, speed=SPEED)
        ratio = {}
    loss = force.loss(np.array([epsilon]))
    tau = lasting * float((force.centroid(loss) / force.duration(loss))[0])
    return {"mu": mu, "epsilon": epsilon, "tau": tau, **ratio}


def lacks(engine: str, effects: Sequence[Effect], space: Space = PLANE) -> list[str]:
    """Names of the effects that an engine does not support."""
    if not space.is_plane:
        force = BASES[STAND_INS[engine][0]]
        changed = Model(force, tuple(effects), True, space=space).acting("impulse")
        return [effect.name for effect in effects if effect in changed or integrates(force, effect, space)]
    causes = {key.split(".")[0] for key in CAUSE_OF}
    missing = []
    for effect in effects:
        own = [
            hook for hook in (*_OF_FORCE, "coefficients") if getattr(type(effect), hook) is not getattr(Effect, hook)
        ]
        by_body = own == ["coefficients"] and engine == "mujoco"
        if own and not by_body and effect.name not in causes and effect.name != FRAME:
            missing.append(effect.name)
    return missing


def press_in_engine(dynamics: Dynamics, true: State) -> tuple[State, np.ndarray]:
    """True states (n,) when the bodies are off the surface, from true states at first touch, and the time (n,) in s.

    Bodies with equal values share an engine.  Contacts end at the time limit of the engine at the latest; returned
    times are at most `LATE`.
    """
    rig, law = dynamics.rig, dynamics.model.law
    frame = dynamics.with_active([(effect, p) for effect, p in dynamics.active if effect.name == FRAME])
    seen = frame.to_contact(true)
    mu, epsilon = dynamics.coefficients(*dynamics.contact(true))  # of each body, at its lowest point
    mu, epsilon = np.maximum(mu, 0.0), np.clip(epsilon, 0.0, 1.0)
    q, v = seen.q - [0.0, rig.height, 0.0], seen.v
    after_q, after_v, elapsed = q.copy(), v.copy(), np.zeros(len(true))
    for rows, settings in _groups(law, dynamics.values, mu, epsilon):
        engine = _engine(law, rig, mu[rows], epsilon[rows], settings)
        out = impacts(engine, q[rows], v[rows])
        after_q[rows] = q[rows] + out.q - _set_down(engine, q[rows])
        after_v[rows], elapsed[rows] = out.v, np.minimum(out.t, LATE)
    shift = after_q - q
    after = frame.from_contact(State.of(seen.q + shift, after_v, true.trial, true.t + elapsed, true.surface))
    shift = shift + elapsed[:, None] * (after.v - after_v)
    return State.of(true.q + shift, after.v, true.trial, after.t, true.surface), elapsed


def _groups(
    law: Law, values: Mapping[str, float], mu: np.ndarray, epsilon: np.ndarray
) -> Iterator[tuple[np.ndarray, tuple[float, float, float, dict]]]:
    """Yield rows of bodies that share an engine, and its settings: contact time in s, impratio, impedance, causes."""
    n = len(mu)
    assert law.force is not None
    names = [name for name in CAUSE_OF if name in values]
    loss = law.force.loss(np.full(n, values["epsilon"]))
    lasting = np.full(n, INSTANT)
    if "tau" in values:
        lasting = np.full(n, values["tau"]) * law.force.duration(loss) / law.force.centroid(loss)
    friction = [np.full(n, values.get(p.name, p.null)) for p in (DAMPING_RATIO, IMPEDANCE)]
    own = (mu, epsilon) if not law.engine.startswith("mujoco") else (np.zeros(n), np.zeros(n))
    columns = [np.clip(lasting, SHORTEST, LONGEST), *friction, *own, *(np.full(n, values[name]) for name in names)]
    different, group = np.unique(np.stack(columns, axis=1), axis=0, return_inverse=True)
    for k, (T, impratio, impedance, _, _, *sizes) in enumerate(different.tolist()):
        causes = dict(zip((CAUSE_OF[name] for name in names), sizes))
        yield np.flatnonzero(group.ravel() == k), (T, impratio, impedance, causes)


def _engine(
    law: Law, rig: Rig, mu: np.ndarray, epsilon: np.ndarray, settings: tuple[float, float, float, dict]
) -> Press:
    T, impratio, impedance, sizes = settings
    body = Body(shape=rig.shape, mass=MASS, radius_of_gyration=rig.k_g)
    causes, n, least = HiddenCauses(**sizes), len(mu), 1e-3
    if law.engine.startswith("mujoco"):
        from thesis_lib.engines.mujoco_engine import STEPS, MujocoEngine
        from thesis_lib.simulate.mujoco.contact import MujocoContact

        contact = MujocoContact.model_construct(
            contact_time=T, impratio=max(impratio, 1.0), impedance=impedance, steps=STEPS
        )
        options = {"contact": contact, "causes": causes, "gravity": rig.gravity}
        return MujocoEngine(body, n, **options, mu=mu, epsilon=np.clip(epsilon, least, 1.0))
    if law.engine.startswith("bullet"):
        from thesis_lib.engines.bullet_engine import STEPS, BulletEngine

        rigid = law.engine.endswith(DEFAULT)
        e = float(epsilon[0]) if rigid else max(float(epsilon[0]), least)
        contact = CompliantContact.model_construct(mu=float(mu[0]), epsilon=e, contact_time=T, steps=STEPS)
        return BulletEngine(body, n, contact=contact, causes=causes, gravity=rig.gravity, rigid=rigid)
    from thesis_lib.engines.drake_engine import DrakeEngine
    from thesis_lib.simulate.drake.hunt_crossley import Spring, duration

    if law.engine == f"drake{DEFAULT}":
        d = DRAKE_DEFAULT.dissipation
        spring = Spring(MASS * (duration(d * SPEED, 1.0) / T) ** 2, d)
        contact = CompliantContact.model_construct(mu=float(mu[0]), epsilon=least, contact_time=T)
        return DrakeEngine(body, n, contact=contact, causes=causes, gravity=rig.gravity, spring=spring)
    # ε and contact time of the law refer to 1 m/s
    friction, e, lasting = of_drake(
        drake_numbers(float(mu[0]), max(float(epsilon[0]), least), T, mass=MASS, speed=SPEED), MASS
    )
    contact = CompliantContact.model_construct(mu=friction, epsilon=e, contact_time=lasting)
    surface = "hydroelastic" if law.engine.startswith("drake_hydroelastic") else "point"
    return DrakeEngine(body, n, contact=contact, causes=causes, gravity=rig.gravity, surface=surface)


def _set_down(engine: Press, q: np.ndarray) -> np.ndarray:
    """Initial poses (n, 3) in the engine: each body moved along the normal until it touches."""
    mechanics = engine.mechanics
    centre, _ = mechanics.centre_state(q, np.zeros_like(q))
    gap = mechanics.gap(np.column_stack([centre, q[:, 2]]), np.zeros(len(q)), np.arange(len(q)))
    return q - np.column_stack([0.0 * gap, gap, 0.0 * gap])
