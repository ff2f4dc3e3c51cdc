"""Drake's hydroelastic contact: a soft thick body on a hard plate.

The planar body is one of Drake's solids with a pressure field, kept in the plane by its joint: an ellipsoid whose third
axis equals its longest, or a box as deep as its longest side.  The pressure at a point is the modulus times the depth
below the body's surface, relative to the depth of its middle; the contact force is the integral of this pressure over
the area where the plate cuts the body, times (1 + d v_n)₊.  A corner therefore touches the plate in a strip that grows
with depth, a side with its whole face, and the number of corners in contact need not be specified.

Contact surfaces of ellipsoids are computed on a mesh: with edges of a tenth of the shortest axis, force and lever are
within a few per cent of those on finer meshes (edges four times as long halve the force).  A box needs no refinement.
"""

# Drake's type stubs accept only ndarray[float64], although lists and other arrays work, and lack the types of ports
# pyright: reportArgumentType=false, reportAttributeAccessIssue=false

from dataclasses import dataclass

import numpy as np
from pydrake.geometry import (
    AddCompliantHydroelasticProperties,
    AddContactMaterial,
    AddRigidHydroelasticProperties,
    Box,
    Ellipsoid,
    ProximityProperties,
    Shape,
)
from pydrake.multibody.plant import CoulombFriction

from thesis_lib.bodies.body import Body
from thesis_lib.bodies.shapes import Polygon
from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.rig.hidden_causes import CompliantContact

RECTANGLE = 1e-9  # m, tolerance of the corners of a rectangle


@dataclass(frozen=True)
class HydroelasticBody:
    """A soft body: `modulus` in Pa, `dissipation` d in s/m, and the `edge` length of its mesh in m."""

    modulus: float
    dissipation: float
    edge: float

    def properties(self, contact: CompliantContact, *, soft: bool) -> ProximityProperties:
        """Contact properties of the soft body, or of the hard plate."""
        properties = ProximityProperties()
        friction = CoulombFriction(contact.mu, contact.mu)
        # Drake uses only the dissipation of the soft body
        AddContactMaterial(dissipation=self.dissipation, friction=friction, properties=properties)
        if soft:
            AddCompliantHydroelasticProperties(self.edge, self.modulus, properties)
        else:
            AddRigidHydroelasticProperties(self.edge, properties)
        return properties


def solid_shape(body: Body, grown: float) -> Shape:
    """The thick body that represents a planar body, with all lengths multiplied by `grown`.

    Raises:
        UserError: a polygon is not a rectangle about its origin with sides along its axes.
    """
    shape = body.shape
    if not isinstance(shape, Polygon):
        a, b = shape.semi_axes
        return Ellipsoid(grown * a, grown * b, grown * max(a, b))
    corners = np.array(shape.vertices)
    a, b = np.abs(corners).max(axis=0)
    if len(corners) != 4 or not np.allclose(np.abs(corners), [a, b], rtol=0.0, atol=RECTANGLE):
        raise UserError(
            "Drake's hydroelastic bodies are ellipses, disks and rectangles about their origin with sides along their "
            'axes; use surface="point" for other polygons.'
        )
    return Box(2.0 * grown * a, 2.0 * grown * b, 2.0 * grown * max(a, b))
