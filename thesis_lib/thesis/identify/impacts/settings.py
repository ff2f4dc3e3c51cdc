"""Settings of the studies of single impacts in chapter 2: forces at impact, m/I from measured data."""

import numpy as np
from pydantic import Field

from thesis_lib.bodies.body import Body, Noise
from thesis_lib.bodies.shapes import Ellipse
from thesis_lib.foundation.settings import Section
from thesis_lib.simulate.rig.hidden_causes import RIG_NOISE, CompliantContact
from thesis_lib.simulate.rig.release import Release


class ImpactForces(Section):
    """Settings of the study of forces at impact."""

    drops: int = Field(50, ge=1, description="drops, with three hits each, most of which can be measured")
    hits: int = Field(3, ge=1, description="number of first impacts of a drop; thesis")
    semi_axes: tuple[float, float] = Field((0.035, 0.025), description="m; thesis: axes of 70 and 50 mm")
    mass: float = Field(0.0364, gt=0, description="kg; from the published ellipse, the thesis gives none")
    release: Release = Field(Release(), description="as the published impacts")
    mu: float = Field(0.15, ge=0, description="own choice, as the other simulated drops")
    epsilon: float = Field(0.55, gt=0, le=1, description="own choice, as the other simulated drops")
    contact_time: float = Field(
        1.4e-3, gt=0, le=5e-3, description="s, central hit; own choice: 0.12 N s then peaks near the thesis's 135 N"
    )
    duration: float = Field(1.0, gt=0, description="s, of a recording")
    rate: float = Field(250.0, gt=0, description="Hz, of poses; thesis")
    noise: Noise = Field(RIG_NOISE, description="own choice: a good tracker; unknown to the estimator")
    declared_duration: float = Field(1.4e-3, gt=0, description="s, T_c of equation 3")
    sensor_rate: float = Field(1000.0, gt=0, description="Hz; thesis")
    sensor_frequency: float = Field(300.0, gt=0, description="Hz, of plate and sensor; own choice")
    sensor_damping: float = Field(0.1, gt=0, lt=1, description="its damping ratio; own choice")
    sensor_window: float = Field(0.03, gt=0, description="s of integration; 0.4 % of the ringing then remains")

    @property
    def body(self) -> Body:
        """Uniform ellipse, k² = (a² + b²)/4."""
        a, b = self.semi_axes
        return Body(shape=Ellipse(semi_axes=(a, b)), mass=self.mass, radius_of_gyration=float(np.hypot(a, b) / 2.0))

    @property
    def contact(self) -> CompliantContact:
        """Contact of body and plate in Drake."""
        return CompliantContact(mu=self.mu, epsilon=self.epsilon, contact_time=self.contact_time)


class MeasuredRatio(Section):
    """Settings of the estimate of m/I from measured impacts."""

    bootstrap: int = Field(200, ge=20, description="resamplings of trials; own choice: spread to 5 %")
    level: float = Field(0.95, gt=0.5, lt=1, description="confidence level of the intervals")
