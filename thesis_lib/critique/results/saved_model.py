"""A fitted model as a file: law, parameters, effects and rig; and its predictions.

`SavedModel` validates model.json: a file with an invalid value or an unknown effect is refused with the reason.
"""

import csv
import io
import warnings
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import ClassVar, Literal

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from pydantic import Field

from thesis_lib.bodies.shapes import Shape
from thesis_lib.bodies.walls import MOST, Wall, in_wall_frame, struck_wall, turns
from thesis_lib.critique.contacts.bases import BASES
from thesis_lib.critique.contacts.contact_time import CONTACT_TIME
from thesis_lib.critique.contacts.kinds import ByImpulse, bind
from thesis_lib.critique.contacts.model import Model
from thesis_lib.critique.drops.sliding import SLIDING, TABLE
from thesis_lib.critique.likelihood.fit import Fit
from thesis_lib.critique.likelihood.in_space.episodes import OFF_SURFACE
from thesis_lib.effects import EFFECTS
from thesis_lib.effects.effect import Reference, Rig
from thesis_lib.extensions.registry import Origin, additions, origin_of
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.files import six_digits, write_json
from thesis_lib.foundation.regular_file import read_bytes
from thesis_lib.foundation.settings import Section
from thesis_lib.mechanics.space import PLANE, Space
from thesis_lib.mechanics.state import State
from thesis_lib.statistics.wording import formatted, listed

STATE = ("x", "y", "theta", "vx", "vy", "omega")
POST = ("vx_post", "vy_post", "omega_post")
OF_BOUND = ("bound", "used", "range")  # of a parameter; not written if there is an estimate
OPTIONAL = ("trial", "t")  # for effects that change over time
MAX_MODEL = 1_000_000  # bytes; a model with 20 effects has 10 kB
MAX_STATES = 200_000_000  # bytes; two million impacts
MAX_COLUMNS = 1000
MOST_ROWS = 3  # named in a warning
# usual values of the rig, not written: one surface, a measured angle, and effects that count from 0
_USUAL = (("walls", []), ("mesh_sha256", None), ("has_angle", True), ("reference", {"x": 0.0, "t": 0.0, "trial": 0.0}))
_PULL = 1.0  # one release or 1 s: step of `trial` and `t` that shows whether a model depends on them


class SavedParameter(Section):
    """One parameter of a fitted model; std is null if it was not fitted or if the data only bound it."""

    value: float = Field(allow_inf_nan=False)
    std: float | None = Field(None, ge=0)
    unit: str
    bound: Literal["lower", "upper"] | None = Field(None, description="kind of bound, if `value` is one")
    used: float | None = Field(None, allow_inf_nan=False, description="value in predictions, if `value` is a bound")
    range: tuple[float, float] | None = Field(None, description="range of values in which a bound was searched")


class SavedReference(Section):
    """The middle of the impacts that the model was fitted to, in the numbers of the dataset."""

    x: float = Field(0.0, allow_inf_nan=False, description="m, place along the surface")
    t: float = Field(0.0, allow_inf_nan=False, description="s")
    trial: float = Field(0.0, allow_inf_nan=False, description="number of the release")
    y: float | None = Field(None, allow_inf_nan=False, description="m, in space: place along the second axis")

    @property
    def believed(self) -> Reference:
        """The same in the form that effects use."""
        return Reference(self.x, self.t, self.trial, self.y or 0.0)


class SavedRig(Section):
    """Body and experimental set-up (rig) as assumed in the fit."""

    shape: Shape
    radius_of_gyration: float = Field(gt=0, description="m")
    gravity: float = Field(ge=0, description="m/s²")
    height: float = Field(description="m, of the surface")
    walls: tuple[Wall, ...] = Field((), max_length=MOST, description="`surfaces` of dataset.yaml")
    has_angle: bool = Field(True, description="false: theta was not measured")
    reference: SavedReference = Field(SavedReference(), description="where effects count from; mu, epsilon, tau there")


class SavedModel(Section):
    """The content of model.json."""

    schema_: Literal[1] = Field(1, alias="schema", description="version of this format")
    dataset: str = Field("", description="name of the dataset that the model was fitted to")
    law: str = Field(description="an impact law or a compliant contact")
    effects: tuple[str, ...] = Field((), description="keys of thesis_lib.effects.EFFECTS, in order")
    origins: dict[str, Origin] = Field({}, description="of a law and of effects from outside the library")
    parameters: dict[str, SavedParameter] = Field(description="mu, epsilon, tau if seen, effect.parameter")
    scatter: float = Field(0.0, ge=0, description="m/s, scatter of the velocity after impact beyond noise")
    rig: SavedRig

    # columns of states and of predictions, and the units of the former
    columns: ClassVar[tuple[str, ...]] = STATE
    found: ClassVar[tuple[str, ...]] = POST
    units: ClassVar[str] = "m, rad, m/s, rad/s"

    @property
    def space(self) -> Space:
        """Where the body moves."""
        return PLANE

    def measured(self, columns: Mapping[str, np.ndarray]) -> State:
        """The states in these columns (n,), in the form that the model uses."""
        return State.planar(**columns)

    def after(self, state: State) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Velocity (n, d + turns) in m/s, rad/s at the end of the contact, a mask (n,) of approaching bodies, and the
        gap (n,) in m between body and surface in `state`.

        Bodies that do not approach the surface keep the velocity of the state.
        """
        walls, level = self.rig.walls, state
        if walls:
            wall = struck_wall(walls, self.rig.shape, state.q, -state.v)  # the nearest of those ahead
            R = turns(walls, wall)
            v = np.einsum("nij,nj->ni", R, state.v)
            level = State.of(in_wall_frame(walls, wall, state.q), v, state.trial, state.t, wall)
        dynamics = self.dynamics
        true = dynamics.to_true(level)
        after = (dynamics.to_measured(dynamics.off(true)) if dynamics.model.takes_time else dynamics.predict(level)).v
        if walls:
            after = np.einsum("nji,nj->ni", R, after)
        # the velocity of a body that moves away must not be rounded by the transformations to the camera and back
        approaches = dynamics.approaches(true)
        v = np.where((approaches | np.isnan(after).any(axis=1))[:, None], after, state.v)
        return v, approaches, dynamics.gap(true)

    @property
    def model(self) -> Model:
        """Law with effects; its contact takes time if the parameters contain that time."""
        effects = tuple(EFFECTS[name] for name in self.effects)
        timed, slides = (p.name in self.parameters for p in (CONTACT_TIME, SLIDING))
        return Model(BASES[self.law], effects, timed, (TABLE,) * slides, self.space)

    @property
    def values(self) -> dict[str, float]:
        """Parameters by full name."""
        return {name: p.value if p.used is None else p.used for name, p in self.parameters.items()}

    @property
    def believed(self) -> Rig:
        """The rig in the form that effects use."""
        rig, there = self.rig, self.rig.reference.believed
        return Rig(rig.shape, rig.radius_of_gyration, rig.gravity, rig.height, rig.walls, rig.has_angle, there)

    @property
    def dynamics(self) -> ByImpulse:
        """Dynamics of the model."""
        return bind(self.model, self.values, self.believed)

    def __str__(self) -> str:
        return f"{self.dataset}: {' with '.join(filter(None, [self.law, ', '.join(self.effects)]))}"

    def __repr__(self) -> str:
        return f"<SavedModel of {self}>"

    def _refuse(self, states: pd.DataFrame, prefix: str) -> None:
        """UserError, which begins with `prefix`, if the model needs columns that the states lack."""
        if missing := [name for name in self.columns if name not in states]:
            raise UserError(
                f"{prefix}The states lack the column(s) {', '.join(missing)}; needed are {', '.join(self.columns)} "
                f"({self.units}) just before impact."
            )

    def predict(
        self,
        states: pd.DataFrame | Mapping[str, ArrayLike],
        source: str = "",
        say: Callable[[str], None] = warnings.warn,
    ) -> pd.DataFrame:
        """The table of states with vx_post, vy_post, omega_post and `status`: ok, not_approaching or no_solution.

        The prediction holds at the end of the contact: at once, or after the contact time of a model with `tau`.
        `states` are x, y, theta, vx, vy, omega at first touch, as measured (m, rad, m/s, rad/s), `trial` and `t` if an
        effect depends on them, and any further columns.  Between walls the body hits the nearest one towards which it
        moves.  If the fit had no measured spins, predictions hold for the spins in `states`.  `say` gets a warning of
        bodies that do not touch.  UserError, which like the warning begins with `source`, the name of their file, if a
        column is missing or a value is not a finite number.
        """
        prefix, states = f"{source}: " if source else "", pd.DataFrame(states)
        self._refuse(states, prefix)
        columns = {}
        for name in (*self.columns, *OPTIONAL):
            if name in states:
                try:
                    columns[name] = pd.to_numeric(states[name], errors="coerce").to_numpy(float)
                except OverflowError as error:
                    raise UserError(f"{prefix}The column {name} holds a number that is too large.") from error
                bad = np.flatnonzero(~np.isfinite(columns[name]))
                if len(bad):
                    raise UserError(
                        f"{prefix}The column {name} holds no finite number in {len(bad)} row(s), first in row "
                        f"{bad[0] + 1} below the header."
                    )
        # a missing column gets the reference value: far from it, a limit such as ε ≤ 1 would hide a dependence
        for name in (name for name in OPTIONAL if name not in states):
            columns[name] = np.full(len(states), getattr(self.rig.reference, name))
        after, approaches, gap = self.after(self.measured(columns))
        for name in (name for name in OPTIONAL if name not in states):
            moved, *_ = self.after(self.measured(columns | {name: columns[name] + _PULL}))
            if not np.array_equal(after, moved, equal_nan=True):
                effects = ", ".join(self.effects)
                why = f"This model depends on {name} ({effects}): add the column {name} to the states."
                raise UserError(f"{prefix}{why}")
        limit = OFF_SURFACE * self.believed.shape.extent
        if len(far := np.flatnonzero(np.abs(gap) > limit)):
            rows = [f"row {i + 1} by {formatted(gap[i], '+.3g')} m" for i in far[:MOST_ROWS]]
            more = [f"{len(far) - MOST_ROWS} more"] * (len(far) > MOST_ROWS)
            off = f"the lowest point of the body is more than {limit:.2g} m above (+) or below (−) the surface"
            if self.rig.walls:
                off = f"the body is more than {limit:.2g} m away from (+) or inside (−) the wall that it would hit"
            say(
                f"{prefix}In {len(far)} of {len(gap)} row(s) {off}: {listed([*rows, *more])}. Predictions hold for "
                "bodies that touch it."
            )
        status = np.where(approaches, "ok", "not_approaching")
        status = np.where(np.isfinite(after).all(axis=1), status, "no_solution")
        return states.assign(**dict(zip(self.found, after.T)), status=status)

    def save(self, path: str | Path) -> None:
        """Write model.json, with `origins` only if something is from outside the library."""
        content = self.model_dump(mode="json", by_alias=True)
        content["parameters"] = {
            name: {k: v for k, v in p.items() if k not in OF_BOUND or v is not None}
            for name, p in content["parameters"].items()
        }
        content["origins"] = {name: one.content() for name, one in self.origins.items()}
        if content["rig"]["reference"]["y"] is None:
            del content["rig"]["reference"]["y"]
        content["rig"] = {k: v for k, v in content["rig"].items() if (k, v) not in _USUAL}
        write_json(content if self.origins else {k: v for k, v in content.items() if k != "origins"}, path)


def saved(fitted: Fit, rig: Rig, dataset: str, parameters: Mapping[str, Mapping] | None = None) -> SavedModel:
    """Content of model.json for a fitted model; `parameters`: as in diagnosis.json, None: as fitted."""
    # values of the user are not rounded
    user = {"shape": rig.shape.model_dump(mode="json"), "radius_of_gyration": rig.k_g}
    user |= {"gravity": rig.gravity, "height": rig.height, "has_angle": rig.has_angle}
    user |= {"reference": rig.reference.content(rig.space)}
    user |= {"walls": [wall.model_dump(mode="json") for wall in rig.walls]}
    return SavedModel.model_validate(content_of(fitted, dataset, parameters) | {"rig": user})


def content_of(fitted: Fit, dataset: str, parameters: Mapping[str, Mapping] | None) -> dict:
    """Content of model.json without the rig, rounded to six digits; arguments as for `saved`."""
    parameters = parameters or {
        name: fitted.content(name) | ({} if p.discrete is None else {"std": None})
        for name, p in fitted.model.parameters.items()
    }
    effects = [effect.name for effect in fitted.model.effects]
    law = fitted.model.law.name
    of = {"law": [law], "effect": effects}
    origins = {name: origin for (kind, name), origin in additions().items() if name in of[kind]}
    model = {"schema": 1, "dataset": dataset, "law": law, "effects": effects, "origins": origins}
    return six_digits(model | {"parameters": parameters, "scatter": fitted.sigma_m})


def changed_code(model: SavedModel) -> list[str]:
    """A sentence for the law and for each effect whose code has changed since the model was fitted."""
    now = {**{name: origin_of("effect", name) for name in model.effects}, model.law: origin_of("law", model.law)}
    return [
        f"{name} was fitted with another version of {saved}; its numbers hold for that version only."
        for name, saved in model.origins.items()
        if (origin := now.get(name)) is not None and origin.sha256 != saved.sha256
    ]


def read_states(path: str | Path) -> pd.DataFrame:
    """Read the states for `predict` from a CSV file; UserError if it is missing or not a table with column names."""
    content = read_bytes(path, MAX_STATES)
    try:
        names = next(csv.reader(content.decode("utf-8-sig").splitlines()[:1]), [])
        if len(set(names)) < len(names) or len(names) > MAX_COLUMNS:
            raise ValueError("the first row must hold column names, each once")
        return pd.read_csv(io.BytesIO(content), index_col=False, encoding="utf-8-sig")
    except Exception as error:  # the parser raises errors of many kinds
        raise UserError(f"{path} is not a CSV table: {error}") from error
