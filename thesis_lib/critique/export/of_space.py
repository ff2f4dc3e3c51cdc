"""The body of a model in space: the body that dataset.yaml describes, corrected by the effects of the model.

World axes are the axes of the recording; the body frame is the frame of the shape.  With c_0 the believed centre of
mass, and s, ρ, h the parameters of `wrong_size`, `rounded_corners` and `surface_height`,

    shape      all lengths times 1 + s about c_0, then edge radii increased by ρ
    inertia    m G, with G from the flights and contacts of the model
    gravity    the acceleration of a body at rest, as in the flights of the model
    surface    shifted by h along its normal
"""

from dataclasses import replace

import numpy as np

from thesis_lib.bodies.solids import Cylinder, Edged, Solid
from thesis_lib.critique.contacts.kinds import ByImpulse
from thesis_lib.critique.export.solid import NO_MASS, UPRIGHT, ExportedBody, contact_of, mass_said, n, require_size
from thesis_lib.critique.results.saved_in_space import SavedSpaceModel
from thesis_lib.datasets.format.frames import surface_frames
from thesis_lib.foundation.errors import UserError
from thesis_lib.mechanics.frame import Frame
from thesis_lib.mechanics.space import SPACE
from thesis_lib.mechanics.state import State

NO_ROUND_CYLINDER = "no format has a cylinder with round edges: the file has sharp edges in place of a radius of {:g} m"
OF_INERTIA = ("wrong_inertia", "inertia_ratios", "inertia_axes")
BARELY = 1e-9  # relative margin by which the largest moment stays below the sum of the others


def body_in_space(
    model: SavedSpaceModel, target: str, mass: float | None = None, depth: float | None = None
) -> ExportedBody:
    """Return the body of a model in space for the format `target`.

    Args:
        mass: kg; None: the mass in dataset.yaml, or else `NO_MASS`.
        depth: must be None; it is for planar models.

    Raises:
        UserError: the mass is not positive, a depth is given, or no body can have the fitted numbers.
    """
    require_size("mass", mass)
    if depth is not None:
        raise UserError(f"--depth is for planar models; {model.dataset or 'this model'} describes a body in space.")
    body, dynamics = model.rig.body, model.dynamics
    known = mass or body.mass
    fitted = ", ".join(name for name in OF_INERTIA if name in model.effects)
    G, impossible = _possible(np.asarray(dynamics.flying.tensor).reshape(3, 3))
    contact, s, h = contact_of(model, target), *(model.values.get(p, 0.0) for p in ("wrong_size.s", "surface_height.h"))
    solid, radius = _corrected(body.solid, s, model.values.get("rounded_corners.rho", 0.0))
    if isinstance(solid, Cylinder) and radius:
        contact["expressed"] = tuple(one for one in contact["expressed"] if one[0] != "rounded_corners")
        name = "rounded_corners" if "rounded_corners" in model.effects else "edge_radius"
        contact["left_out"] += ((name, NO_ROUND_CYLINDER.format(radius)),)
        solid = solid.rounded(0.0)
    if impossible:
        contact["left_out"] += (("inertia", impossible),)
    (frame, *_) = surface_frames(model.rig)
    normal = frame.vectors_out(np.array([[0.0], [0.0], [1.0]]))[:, 0]
    gravity = frame.vectors_out(_pull(dynamics)[:, None])[:, 0]
    surface = replace(frame, origin=frame.origin + h * normal)
    size = " times 1 + wrong_size.s about the believed centre of mass" if s else ""
    return ExportedBody(
        **contact,
        shape=solid,
        at=Frame(-s * body.centre, UPRIGHT),
        mass=known or NO_MASS,
        mass_known=known is not None,
        inertia=(known or NO_MASS) * G,
        centre=body.centre + [model.values.get(f"com_offset.c_{axis}", 0.0) for axis in "xyz"],
        points=1,
        estimate=1.0,
        gravity=gravity,
        surface=surface,
        said=(
            "axes: as in the recording; units m, kg, s, rad",
            "frame of the body: the frame of the shape, as in dataset.yaml",
            f"shape: {body.shape.kind} as in dataset.yaml{size}"
            + (f", edges of {radius:g} m" if radius and not isinstance(solid, Cylinder) else ""),
            "mass: as in dataset.yaml" if mass is None and body.mass else mass_said(mass),
            f"inertia: about the centre of mass, {f'fitted ({fitted})' if fitted else 'as in dataset.yaml'}",
        ),
        not_patched={
            "wrong_size": f"geometry is not patched: scale it by {1.0 + s:.6g} about the believed centre of mass",
            "rounded_corners": f"geometry is not patched: round its edges with {radius:.6g} m",
            "surface_height": f"the surface is not patched: it lies {h:.6g} m higher than believed",
            **dict.fromkeys(("surface_tilt", "wrong_gravity"), f"gravity is not patched: it is {n(gravity)} m/s^2"),
        },
    )


def _corrected(solid: Solid, s: float, rho: float) -> tuple[Solid, float]:
    """Return the solid corrected by size error s and rounding ρ, and the radius of its edges in m."""
    if not isinstance(solid, Edged):
        return solid.scaled(1.0 + s), 0.0
    sharp, inside = solid.rounded(0.0).scaled(1.0 + s), solid.inradius
    assert isinstance(sharp, Edged)
    # rounding adds the same radius as it adds to the believed solid
    radius = (1.0 + s) * solid.edge_radius + min(solid.edge_radius + rho, inside) - solid.edge_radius
    radius = min(radius, sharp.inradius)
    return sharp.rounded(radius), radius


def _pull(dynamics: ByImpulse) -> np.ndarray:
    """Return the acceleration (3,) in m/s² of a body at rest, in axes of the surface; air has no effect on it."""
    rest = State.of(np.array([[0.0, 0.0, 1.0, *UPRIGHT]]), np.zeros((1, 6)), np.zeros(1), np.zeros(1), None, SPACE)
    return dynamics.true_acceleration(rest)[0, :3]


def _possible(G: np.ndarray) -> tuple[np.ndarray, str]:
    """Return the tensor (3, 3) in m², with its largest moment limited to that of a flat body, and why if limited."""
    moments, axes = np.linalg.eigh(G)
    most = (1.0 - BARELY) * (moments[0] + moments[1])
    if moments[2] <= most:
        return G, ""
    said = ", ".join(f"{moment:.6g}" for moment in moments)
    why = f"no body has the fitted principal moments per mass, {said} m^2: the last exceeds the sum of the others"
    moments[2] = most
    return (axes * moments) @ axes.T, f"{why}, which was written"
