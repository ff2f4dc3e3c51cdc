"""A body given by a file of triangles, .obj or .stl: its convex hull touches surfaces; its mass fills the mesh itself.

The file lies in the folder of the dataset.  It is read, with its size bounded, while dataset.yaml is checked, so that a
mesh in memory has always been read; its bytes are part of the content of the dataset.
"""

import hashlib
import io
import logging
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, PrivateAttr, ValidationInfo, model_validator

from thesis_lib.bodies.moments import Moments, moments_within
from thesis_lib.bodies.shapes import Length
from thesis_lib.bodies.solids import Hull
from thesis_lib.foundation.errors import first_line
from thesis_lib.foundation.regular_file import FileProblem, read_bytes
from thesis_lib.foundation.settings import Section

MAX_BYTES = 20_000_000
PACKAGE = "trimesh"
OPEN = "the mesh is not closed"
MIXED = "the mesh has some faces clockwise and others counter-clockwise as seen from outside"
SUFFIXES = (".obj", ".stl")


class Mesh(Section):
    """A closed or open surface of triangles, in the axes of its file."""

    kind: Literal["mesh"] = "mesh"
    file: str = Field(description="name of an .obj or .stl file in the folder of the dataset, at most 20 MB")
    scale: Length = Field(1.0, description="m per unit of the file, 0.001 for millimetres")
    edge_radius: Annotated[float, Field(ge=0, allow_inf_nan=False)] = Field(0.0, description="m, of all edges")

    _content: bytes = PrivateAttr(b"")

    @model_validator(mode="after")
    def _is_read(self, info: ValidationInfo) -> "Mesh":
        if self._content:  # it was read before
            return self
        folder = (info.context or {}).get("folder")
        if folder is None:
            raise ValueError("a mesh is a file in the folder of a dataset, but no folder is given")
        self._content = _content_of(Path(folder), self.file)
        _ = self.solid
        return self

    @property
    def content(self) -> bytes:
        """The bytes of the file."""
        return self._content

    @property
    def sha256(self) -> str:
        """SHA-256 (hex) of the bytes."""
        return hashlib.sha256(self._content).hexdigest()

    @property
    def solid(self) -> Hull:
        """The convex hull of the mesh, the solid that touches a surface."""
        return _hull_of(self._content, Path(self.file).suffix.lower(), self.scale, self.edge_radius)

    def scaled(self, factor: float) -> "Mesh":
        """The same mesh with all lengths times `factor`, as for a `Solid`."""
        return self.model_copy(update={"scale": factor * self.scale, "edge_radius": factor * self.edge_radius})

    def rounded(self, edge_radius: float) -> "Mesh":
        """The same mesh with another edge radius in m."""
        return self.model_copy(update={"edge_radius": edge_radius})

    @property
    def moments(self) -> Moments:
        """Volume, centre of mass and inertia per mass of the homogeneous solid within the mesh.

        Raises:
            ValueError: the mesh is not closed, or has no outside.
        """
        return _moments_of(self._content, Path(self.file).suffix.lower(), self.scale)


@lru_cache(maxsize=8)
def _hull_of(content: bytes, suffix: str, scale: float, edge_radius: float) -> Hull:
    from scipy.spatial import ConvexHull, QhullError

    corners = np.unique(scale * _surface_in(content, suffix)[0], axis=0)
    try:
        corners = corners[ConvexHull(corners).vertices]
    except (QhullError, ValueError):
        raise ValueError("the triangles lie in a plane: the solid has no volume") from None
    return Hull(vertices=tuple(map(tuple, corners.tolist())), edge_radius=edge_radius)


@lru_cache(maxsize=8)
def _moments_of(content: bytes, suffix: str, scale: float) -> Moments:
    vertices, faces, fault = _surface_in(content, suffix)
    if fault:
        raise ValueError(f"{fault}, so that it has neither volume nor inertia")
    triangles = scale * vertices[faces]
    try:
        return moments_within(triangles)
    except ValueError:  # all are seen clockwise from outside
        return moments_within(triangles[:, ::-1])


def _content_of(folder: Path, name: str) -> bytes:
    if Path(name).name != name or Path(name).suffix.lower() not in SUFFIXES or not name.isprintable():
        raise ValueError("must be the name of an .obj or .stl file in the folder of the dataset")
    path = folder / name
    try:
        if path.is_symlink():
            raise FileProblem(path, "is a link", "put the file itself there")
        return read_bytes(path, MAX_BYTES, folder)
    except FileProblem as problem:
        raise ValueError(f"the file {name} {problem.what}") from problem


@lru_cache(maxsize=8)
def _surface_in(content: bytes, suffix: str) -> tuple[np.ndarray, np.ndarray, str]:
    """Vertices (k, 3), triangles (f, 3) as their indices, and why the surface encloses no solid; "" if it does."""
    if find_spec(PACKAGE) is None:
        raise ValueError(f"reading a mesh needs a package: pip install {PACKAGE}")
    import trimesh

    logging.getLogger(PACKAGE).setLevel(logging.CRITICAL)  # faults of a file are reported below
    options = {"skip_materials": True} if suffix == ".obj" else {}  # materials are other files
    try:
        mesh = trimesh.load_mesh(io.BytesIO(content), file_type=suffix[1:], process=False, **options)
        vertices, faces = np.asarray(mesh.vertices, float), np.asarray(mesh.faces)
        if not len(faces) or not np.isfinite(vertices).all():
            raise ValueError("no triangles of finite numbers")
        mesh.merge_vertices(merge_tex=True, merge_norm=True)
        fault = "" if mesh.is_winding_consistent else MIXED
        return np.asarray(mesh.vertices, float), np.asarray(mesh.faces), fault if mesh.is_watertight else OPEN
    except Exception as error:  # the library raises many kinds of errors for a broken file
        raise ValueError(f"the file cannot be read as a mesh ({first_line(error)})") from error
