"""Distributions of the states from which bodies are released."""

import math

import numpy as np
from pydantic import Field, model_validator
from scipy.special import ndtr, ndtri

from thesis_lib.foundation.settings import Section

Finite = Field(allow_inf_nan=False)
MOTION = ("vx", "vy", "omega")


class Spread(Section):
    """A random quantity: uniform in [low, high], or normal(mean, std) truncated to [low, high] if both are given."""

    low: float = Finite
    high: float = Finite
    mean: float | None = Field(None, allow_inf_nan=False)
    std: float | None = Field(None, gt=0, allow_inf_nan=False)

    @model_validator(mode="after")
    def _consistent(self) -> "Spread":
        if self.low > self.high:
            raise ValueError(f"low ({self.low}) exceeds high ({self.high})")
        if (self.mean is None) != (self.std is None):
            raise ValueError("give mean and std together (truncated normal) or neither (uniform)")
        return self

    def quantile(self, u: np.ndarray) -> np.ndarray:
        """Values at probabilities `u` in [0, 1), of the shape of `u`."""
        if self.mean is None or self.std is None:
            return self.low + (self.high - self.low) * u
        p_low, p_high = ndtr((np.array([self.low, self.high]) - self.mean) / self.std)
        return np.clip(self.mean + self.std * ndtri(p_low + (p_high - p_low) * u), self.low, self.high)


class Release(Section):
    """States from which the body is released, at x = 0 and with v_y = 0.

    The defaults give pre-impact velocities like those of the 1,718 published impacts: v_x 0.14..1.13 (mean 0.60,
    sd 0.155) m/s, v_y -2.87..-2.21 (mean -2.57) m/s, ω -14..25 (mean -1.1, sd 6.1) rad/s.
    """

    height: Spread = Field(Spread(low=0.285, high=0.445), description="m, body origin above the surface")
    theta: Spread = Field(Spread(low=-math.pi, high=math.pi), description="rad")
    vx: Spread = Field(Spread(low=0.14, high=1.13, mean=0.6, std=0.156), description="m/s")
    omega: Spread = Field(Spread(low=-14.3, high=25.3, mean=-1.4, std=6.5), description="rad/s")

    def draw(self, n: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """Draw poses q (n, 3) and velocities v (n, 3) of n releases; earlier releases do not depend on n."""
        moving = [i for i, name in enumerate(MOTION) if hasattr(self, name)]
        u = rng.random((n, 2 + len(moving)))  # row by row: one row per drop
        q, v = np.zeros((n, 3)), np.zeros((n, 3))
        q[:, 1], q[:, 2] = self.height.quantile(u[:, 0]), self.theta.quantile(u[:, 1])
        for column, i in enumerate(moving, start=2):
            v[:, i] = getattr(self, MOTION[i]).quantile(u[:, column])
        return q, v
