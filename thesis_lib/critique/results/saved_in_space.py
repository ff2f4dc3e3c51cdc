"""A fitted model of a body in space as a file, and its predictions; all else as in the plane (`saved_model`).

Instead of the planar rig, model.json contains body, tracked frame, surface and gravity as in dataset.yaml, so the model
predicts rows of an impacts.csv of schema 2: poses and velocities of the tracked frame, in axes of the world.
"""

import warnings
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import ClassVar, Literal

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from pydantic import Field, model_validator

from thesis_lib.bodies.mesh import Mesh
from thesis_lib.bodies.solid_body import UNIT
from thesis_lib.bodies.solids import Sphere
from thesis_lib.critique.contacts.kinds import bind
from thesis_lib.critique.likelihood.fit import Fit
from thesis_lib.critique.likelihood.observations import rig_of
from thesis_lib.critique.results.saved_model import SavedModel, SavedReference, content_of
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.frames import body_states, surface_frames, tracked_of_body, tracked_states
from thesis_lib.datasets.format.header import SpaceHeader
from thesis_lib.datasets.format.table_forms import POSE_IN_SPACE, QUATERNION, V_POST_IN_SPACE, V_PRE_IN_SPACE
from thesis_lib.effects import EFFECTS
from thesis_lib.effects.effect import Rig
from thesis_lib.effects.whole_tosses import WholeTosses
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.files import atomic
from thesis_lib.mechanics.space import SPACE, Space
from thesis_lib.mechanics.state import State

CENTRED = 1e-9  # m, from the tracked point to the centre of mass
OF_LATER_HITS = ("later_friction", "later_restitution")
NOT_OF_THE_RIG = {"description", "noise", "rate", "spin", "surfaces"}  # keys of dataset.yaml


class SavedSpaceRig(SpaceHeader):
    """Body and set-up as assumed in the fit: dataset.yaml without its keys on the recording."""

    reference: SavedReference = Field(SavedReference(), description="where effects count from; mu, epsilon, tau there")
    mesh_sha256: str | None = Field(None, description="SHA-256 of the file of a mesh, which lies beside model.json")

    @model_validator(mode="after")
    def _mesh_is_that_of_the_fit(self) -> "SavedSpaceRig":
        shape = self.body.shape
        if self.mesh_sha256 != (shape.sha256 if isinstance(shape, Mesh) else None):
            raise ValueError("the mesh is not the one that the model was fitted to")
        return self

    @property
    def walls(self) -> tuple:
        """No walls in space."""
        return ()


class SavedSpaceModel(SavedModel):
    """The content of model.json for a body in space.

    `predict` takes x, y, z, qw … qz, vx_pre … wz_pre of the tracked frame and adds vx_post … wz_post and `status`.
    """

    dimensions: Literal[3] = 3
    rig: SavedSpaceRig

    def save(self, path: str | Path) -> None:
        """Write model.json, and a mesh beside it."""
        super().save(path)
        if isinstance(mesh := self.rig.body.shape, Mesh):
            with atomic(Path(path).parent / mesh.file) as made:
                Path(made).write_bytes(mesh.content)

    columns: ClassVar[tuple[str, ...]] = (*POSE_IN_SPACE, *V_PRE_IN_SPACE)
    found: ClassVar[tuple[str, ...]] = V_POST_IN_SPACE
    units: ClassVar[str] = "m, quaternion, m/s, rad/s"

    @property
    def space(self) -> Space:
        return SPACE

    @property
    def believed(self) -> Rig:
        return replace(rig_of(Dataset("", self.rig)), reference=self.rig.reference.believed)

    def predict(
        self,
        states: pd.DataFrame | Mapping[str, ArrayLike],
        source: str = "",
        say: Callable[[str], None] = warnings.warn,
    ) -> pd.DataFrame:
        """As in the plane; states of a ball whose centre of mass is tracked may lack the orientation."""
        states, body, tracked = pd.DataFrame(states), self.rig.body, self.rig.tracked
        centred = tracked is not None and np.abs(body.centre - tracked.position).max() < CENTRED
        if not centred or not isinstance(body.shape, Sphere) or any(name in states for name in QUATERNION):
            return super().predict(states, source, say)
        turned = states.assign(**dict(zip(QUATERNION, (1.0, 0.0, 0.0, 0.0))))
        return super().predict(turned, source, say).drop(columns=list(QUATERNION))

    def _refuse(self, states: pd.DataFrame, prefix: str) -> None:
        """As in the plane; a model with effects on later hits also needs `trial` and `t`, and the first row of a trial
        must be its first hit.

        Raises:
            UserError: as in the plane, an effect depends on how the body has turned since the first frame, or a
                quaternion is not a rotation.
        """
        for name in self._of_history:
            if name not in OF_LATER_HITS:
                raise UserError(
                    f"{prefix}This model has the effect {name}, which depends on all frames of a toss before the hit; "
                    "single impacts do not contain these, so model.json cannot predict them."
                )
            if missing := [column for column in ("trial", "t") if column not in states]:
                raise UserError(
                    f"{prefix}This model has the effect {name}: add the column {missing[0]} to the states, and include "
                    "the first hit of each trial, to distinguish it from later ones."
                )
        super()._refuse(states, prefix)
        require_rotations(states, prefix)

    @property
    def _of_history(self) -> list[str]:
        return [name for name in self.effects if EFFECTS[name].needs_history]

    def measured(self, columns: Mapping[str, np.ndarray]) -> State:
        length = np.linalg.norm([columns[name] for name in QUATERNION], axis=0)
        table = pd.DataFrame({**columns, **{name: columns[name] / length for name in QUATERNION}})
        states = body_states(tracked_states(table, V_PRE_IN_SPACE), self.rig)
        return surface_frames(self.rig)[0].seen(states)

    def after(self, state: State) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        rig = self.believed
        if self._of_history:
            trial, index = np.unique(state.trial, return_inverse=True)
            touched = np.full(len(trial), np.inf)
            np.minimum.at(touched, index, state.t)
            rig = replace(rig, recorded=WholeTosses(trial, 0.0 * touched, np.zeros((3, len(trial))), touched))
        dynamics = bind(self.model, self.values, rig)
        true = dynamics.to_true(state)
        approaches = dynamics.approaches(true)
        after = dynamics.to_measured(dynamics.off(true)) if dynamics.integrated else dynamics.predict(state)
        motion = np.where(approaches, after.motion, state.motion)
        seen = tracked_of_body(surface_frames(self.rig)[0].shown(state.with_motion(motion)), self.rig)
        return seen.v, approaches, dynamics.gap(true)


def require_rotations(states: pd.DataFrame, prefix: str = "") -> None:
    """UserError, which begins with `prefix`, if a quaternion of `states` is not about as long as that of a rotation."""
    q = states[list(QUATERNION)].apply(pd.to_numeric, errors="coerce").to_numpy(float)
    length = np.linalg.norm(q, axis=1)
    if len(wrong := np.flatnonzero(np.abs(length - 1.0) > UNIT)):
        raise UserError(
            f"{prefix}The quaternion has the length {length[wrong[0]]:.4g} in {len(wrong)} row(s), first in row "
            f"{wrong[0] + 1} below the header; that of a rotation is 1. Check the columns {', '.join(QUATERNION)}."
        )


def saved_in_space(
    fitted: Fit, header: SpaceHeader, dataset: str, parameters: Mapping | None = None
) -> SavedSpaceModel:
    """Content of model.json for a model fitted to a dataset with this dataset.yaml; `parameters` as for `saved`."""
    rig = header.model_dump(mode="json", by_alias=True, exclude=NOT_OF_THE_RIG)
    if isinstance(mesh := header.body.shape, Mesh):
        rig["body"]["shape"], rig["mesh_sha256"] = mesh, mesh.sha256
    rig["reference"] = fitted.whitening.observations.rig.reference.content(SPACE)
    return SavedSpaceModel.model_validate(content_of(fitted, dataset, parameters) | {"dimensions": 3, "rig": rig})
