"""Declaration of a model, which is a law with any set of effects: its parameters and properties.

`thesis_lib/critique/contacts/dynamics.py` applies a model to states at given parameter values.
"""

from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from thesis_lib.contact.compliant.normal_force import ConvexDamper
from thesis_lib.contact.law import Law
from thesis_lib.critique.contacts.contact_time import BASE_PARAMETERS, CONTACT_TIME, OF_FRICTION
from thesis_lib.effects.effect import Effect, Parameter, Rig, in_order, parameters_in
from thesis_lib.mechanics.space import PLANE, Space

HELD = 1e-2  # relative to a parameter's scale: standard deviation of directions held at 0


def inward(p: Parameter, value: float, step: float) -> float:
    """`step`, or its negative if the step from `value` would exceed the upper bound."""
    return step if value + step <= p.high else -step


def _without_camera(effect: Effect) -> Effect:
    """Part of a measurement effect that acts on the body, as gravity does if oblique to the camera's axes."""
    inner = copy(effect)
    exact = {"to_true": Effect.to_true, "to_measured": Effect.to_measured}
    inner.__class__ = type(type(effect).__name__, (type(effect),), exact)
    return inner


@dataclass(frozen=True)
class Model:
    """A law with effects; its parameters are those of the law, `tau` if it `takes_time`, and `effect.parameter`.

    `effects` are in the order in which they were chosen; they act in the order of `hooks`.

    `always` are effects of every model of the data, such as the table under a sliding body: they act first, measurement
    effects last, and their parameters have no prefix.  In `space` (3D), vector parameters of effects have one component
    per axis.
    """

    law: Law
    effects: tuple[Effect, ...] = ()
    takes_time: bool = False
    always: tuple[Effect, ...] = ()
    space: Space = PLANE

    def parameters_of(self, effect: Effect) -> tuple[Parameter, ...]:
        """Parameters of an effect in the model's space."""
        return parameters_in(effect, self.space)

    @cached_property
    def parameters(self) -> dict[str, Parameter]:
        """All parameters by full name, in order."""
        of_effects = {f"{effect.name}.{p.name}": p for effect in self.effects for p in self.parameters_of(effect)}
        of_law = BASE_PARAMETERS + (CONTACT_TIME,) * self.takes_time + self.of_friction
        of_law += tuple(p for effect in self.always for p in self.parameters_of(effect))
        return {p.name: p for p in of_law} | of_effects

    @property
    def of_friction(self) -> tuple[Parameter, ...]:
        """Parameters besides μ of an integrated contact with non-Coulomb friction; otherwise empty."""
        return OF_FRICTION.get(type(self.law.force), ()) if self.is_compliant else ()

    @cached_property
    def fitted_parameters(self) -> dict[str, Parameter]:
        """Parameters that a fit varies: all but the discrete ones."""
        return {name: p for name, p in self.parameters.items() if p.discrete is None}

    def unseen(self, rig: Rig) -> np.ndarray:
        """Directions (k, p) of the fitted parameters that are unobservable on this rig, as weights of residuals that
        hold them at 0 more strongly than the errors of finite differences."""
        names, rows = list(self.fitted_parameters), []
        for effect in self.effects:
            for direction in effect.unseen(rig):
                rows.append(np.zeros(len(names)))
                for p, part in zip(self.parameters_of(effect), direction):
                    rows[-1][names.index(f"{effect.name}.{p.name}")] = part / (HELD * p.scale)
        return np.array(rows).reshape(-1, len(names))

    @cached_property
    def hooks(self) -> list[tuple[Effect, dict[str, str]]]:
        """Effects in the order in which they act, each with the full names of its parameters."""
        first, last = ([e for e in self.always if (e.family == "measurement") == late] for late in (False, True))
        return [
            (e, {p.name: p.name if e in self.always else f"{e.name}.{p.name}" for p in self.parameters_of(e)})
            for e in [*first, *in_order(self.effects, self.space), *last]
        ]

    def acting(self, *hooks: str) -> list[Effect]:
        """Effects that override at least one of the given hooks."""
        return [e for e, _ in self.hooks if any(getattr(type(e), hook) is not getattr(Effect, hook) for hook in hooks)]

    @cached_property
    def has_varying_flight(self) -> bool:
        """Whether the true acceleration in flight may change with the velocity."""
        return bool(self.acting("acceleration"))

    @cached_property
    def spins_evenly(self) -> bool:
        """Whether the true acceleration in flight follows from attitude and spin alone, and bodies turn freely."""
        return all(effect.even for effect in self.acting("acceleration"))

    @cached_property
    def camera_is_exact(self) -> bool:
        """Whether measured states equal true states."""
        return not self.acting("to_true", "to_measured")

    @cached_property
    def camera_bends(self) -> bool:
        """Whether the camera distorts parabolas, so that paths have to be mapped through the camera model.

        In space the tracked point is off the centre of mass, which seems to circle about it if any attitude is wrong.
        """
        if not self.space.is_plane:
            return not self.camera_is_exact
        return any(effect.bends for effect in self.acting("to_true", "to_measured"))

    @cached_property
    def turns_otherwise(self) -> bool:
        """Whether bodies in flight may appear to turn differently from the free believed body; only in space."""
        if self.space.is_plane:
            return False
        return any(effect.turns for effect in self.effects) or (self.camera_bends and not self.spins_evenly)

    @cached_property
    def has_arc(self) -> bool:
        """Whether measured paths in flight may differ from parabolas."""
        return bool(self.acting("arc")) or self.camera_bends or self.turns_otherwise

    @cached_property
    def flight_parameters(self) -> list[str]:
        """Parameters on which the measured flights, and hence the states at impact, depend."""
        acting = self.acting("to_true", "to_measured", "acceleration", "arc", *["inertia"] * (not self.space.is_plane))
        return [name for effect, names in self.hooks if effect in acting for name in names.values()]

    @property
    def is_compliant(self) -> bool:
        """Whether contacts are integrated in time rather than resolved by an impulse."""
        return self.takes_time and self.law.force is not None

    @property
    def limit(self) -> "Model":
        """For compliant laws, the model with the impulse of short contacts; convex contacts lack a closed form."""
        has_limit = self.is_compliant and not isinstance(self.law.force, ConvexDamper)
        return replace(self, law=replace(self.law, force=None)) if has_limit else self

    def with_effect(self, effect: Effect) -> "Model":
        """Model with one more effect."""
        return replace(self, effects=(*self.effects, effect))

    def camera_and_body(self) -> tuple["Model", "Model"]:
        """Model with measurement effects only, and model with all effects on the body; neither with a contact time."""
        camera = tuple(e for e in self.effects if e.family == "measurement")
        rest = Model(self.law, camera).acting("acceleration")
        body = tuple(_without_camera(e) if e in rest else e for e in self.effects if e not in camera or e in rest)
        return Model(self.law, camera), Model(self.law, body)
