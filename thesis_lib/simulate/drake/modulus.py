"""Modulus of a hydroelastic body that gives a required contact time, from measurements of Drake's own contact.

The force is proportional to the modulus and, within a few per cent, to a power of the depth.  Factor and power are
measured in a central pose (an ellipse on its short axis, a box on a corner); `hunt_crossley` gives the rest.
"""

# Drake's type stubs lack the types of ports
# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportCallIssue=false

import numpy as np

from thesis_lib.bodies.body import Body
from thesis_lib.bodies.shapes import Ellipse, Polygon
from thesis_lib.simulate.drake.hunt_crossley import dissipation, duration
from thesis_lib.simulate.drake.hydroelastic import HydroelasticBody
from thesis_lib.simulate.drake.plant import Surface, drop_plant
from thesis_lib.simulate.rig.hidden_causes import REFERENCE_SPEED, CompliantContact, HiddenCauses

RESOLUTION = 0.1  # length of the edges of an ellipsoid's mesh over its shortest axis
TRIAL_MODULUS = 1e6  # Pa
ROUNDS = 4  # iterations of exponent and depth, each of which changes the other by a few per cent


def static_force(body: Body, surface: Surface, theta: float, depths: np.ndarray) -> np.ndarray:
    """Normal force (n,) in N on a body at rest at the angle `theta` in rad, at the penetrations `depths` (n,) in m."""
    made = drop_plant(body, CompliantContact(mu=0.0), HiddenCauses(), 9.81, surface)
    root = made.diagram.CreateDefaultContext()
    context = made.plant.GetMyMutableContextFromRoot(root)
    lowest = body.shape.contact_point(np.array([theta]))[0, 1]
    forces = []
    for depth in depths:
        made.joint.set_translation(context, [0.0, -lowest - depth])
        made.joint.set_rotation(context, theta)
        every = np.ravel(made.plant.get_generalized_contact_forces_output_port(made.moving).Eval(context))
        forces.append(every[1])
    return np.array(forces)


def central_angle(body: Body) -> float:
    """θ in rad at which the lowest point is directly below the middle: ellipse on its short axis, box on a corner."""
    if not isinstance(body.shape, Polygon):
        a, b = body.shape.semi_axes
        return 0.0 if a >= b else 0.5 * np.pi
    x, y = body.shape.vertices[0]
    return float(-0.5 * np.pi - np.arctan2(y, x))


def solid(body: Body, epsilon: float, contact_time: float) -> HydroelasticBody:
    """The soft body with restitution `epsilon` and duration `contact_time` (s) in a central impact."""
    assert body.mass is not None  # bodies without a mass are rejected earlier
    d = dissipation(epsilon)
    shortest = min(body.shape.semi_axes) if isinstance(body.shape, Ellipse) else body.shape.extent
    trial = HydroelasticBody(TRIAL_MODULUS, 0.0, RESOLUTION * shortest)
    exponent, force, depth = 2.0, 0.0, 0.0
    for _ in range(ROUNDS):
        depth = contact_time * REFERENCE_SPEED / duration(d * REFERENCE_SPEED, exponent)
        half, force = static_force(body, trial, central_angle(body), np.array([0.5 * depth, depth]))
        exponent = float(np.log2(force / half))
    # k Lⁿ = m v² / L is the force at depth L
    wanted = body.mass * REFERENCE_SPEED**2 / depth
    return HydroelasticBody(float(TRIAL_MODULUS * wanted / force), d, trial.edge)
