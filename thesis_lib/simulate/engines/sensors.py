"""Recording of a motion by the sensors of a rig: encoder counts, a camera, delays, and torques with ripple.

| column             | content                                                                                    |
|--------------------|--------------------------------------------------------------------------------------------|
| q of a joint       | whole counts of an encoder, delayed by `delay`                                             |
| pose of disk, hub  | measured by a camera, with noise and another delay                                         |
| velocities         | differences of these positions over a step, low-pass filtered; or from velocity sensors    |
| torques            | τ (1 + ρ(q)) + o; ρ(q) is a sum of harmonics of the joint's angle, o an offset             |

Delays, ripple and offsets are drawn once per recording, within the limits stated in its `sampling`.  The instants of
samples have a random error, `jitter`.
"""

from dataclasses import dataclass

import numpy as np
from pydantic import Field
from scipy.interpolate import CubicHermiteSpline

from thesis_lib.datasets.recordings.header import Sampling, StateNoise
from thesis_lib.foundation.settings import Section
from thesis_lib.simulate.engines.settings import EngineMotion
from thesis_lib.simulate.rig.release import Spread


class Sensors(Section):
    """Sensors of a laboratory; the numbers are our own choices."""

    counts: int = Field(4096, ge=1, description="counts per turn of a joint's encoder")
    camera_position: float = Field(3e-4, gt=0, description="m, one sigma")
    camera_angle: float = Field(5e-4, gt=0, description="rad, one sigma")
    delay: Spread = Field(Spread(low=1e-3, high=5e-3), description="s, drawn for the encoders and for the camera")
    jitter: float = Field(5e-5, ge=0, description="s, one sigma, independent for each device")
    velocity_filter: float = Field(5e-3, gt=0, description="s, time constant of the low-pass filter of the velocities")
    velocity: float | None = Field(
        None, gt=0, description="m/s and rad/s, noise of velocity sensors; null: none, velocities are differences"
    )
    ripple: Spread = Field(
        Spread(low=0.005, high=0.015),
        description="share of the torque, root mean square over a turn, drawn; three harmonics of 1.5 % peak at 3.7 %",
    )
    harmonics: int = Field(3, ge=1, description="number of harmonics of a joint's ripple")
    highest: int = Field(24, ge=1, description="per turn; the harmonics are drawn from 1 to this number")
    offset: float = Field(0.03, ge=0, description="N m, one sigma")

    def noise(self, h: float) -> StateNoise:
        """The noise that recording.yaml states for samples every h seconds."""
        joint = 2.0 * np.pi / self.counts / np.sqrt(12.0)
        # noise of the differences before the low-pass filter; not to be used, as these velocities are derived
        straight, turning = (np.sqrt(2.0) / h * x for x in (self.camera_position, max(self.camera_angle, joint)))
        return StateNoise(
            position=self.camera_position,
            angle=self.camera_angle,
            velocity=self.velocity or straight,
            angular_velocity=self.velocity or turning,
            joint_angle=joint,
        )

    def sampling(self) -> Sampling:
        return Sampling(
            velocities="measured" if self.velocity else "derived",
            jitter=self.jitter,
            delay=self.delay.high,
            torque_ripple=self.ripple.high,
            torque_offset=self.offset,
        )


@dataclass(frozen=True)
class DrawnSensors:
    """Sensors with the random properties that stay fixed during a recording.

    Attributes:
        delays: s, of joints and camera.
        harmonics: (joints, n) per turn; ripple: (joints, 2 n) their cosine and sine amplitudes.
        offset: (joints,) N m.
    """

    sensors: Sensors
    delays: tuple[float, float]
    harmonics: np.ndarray
    ripple: np.ndarray
    offset: np.ndarray

    @classmethod
    def draw(cls, sensors: Sensors, joints: int, rng: np.random.Generator) -> "DrawnSensors":
        delays = sensors.delay.quantile(rng.random(2))
        n = min(sensors.harmonics, sensors.highest)
        harmonics = np.array([1 + rng.choice(sensors.highest, n, replace=False) for _ in range(joints)]).reshape(-1, n)
        phases = rng.uniform(0.0, 2.0 * np.pi, (joints, n))
        amplitude = sensors.ripple.quantile(rng.random((joints, 1))) * np.sqrt(2.0 / n)
        ripple = amplitude * np.concatenate([np.cos(phases), np.sin(phases)], axis=1)
        return cls(sensors, tuple(delays), harmonics, ripple, sensors.offset * rng.standard_normal(joints))

    def record(
        self, motion: EngineMotion, torques: np.ndarray, h: float, rng: np.random.Generator
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Recorded t (n,), q and v (n, nv) and torques (n, joints) every h seconds; `torques` (m, joints): true ones.

        The first rows, before the device with the longest delay has data, are left out.
        """
        s, j = self.sensors, len(self.offset)
        first = int(np.ceil(max(self.delays) / h + 1e-9))
        t = h * np.arange(first, len(torques) + 1)
        states = CubicHermiteSpline(motion.t, motion.q, motion.v)
        instants = [
            np.clip(t - delay + s.jitter * rng.standard_normal(len(t)), 0.0, motion.t[-1]) for delay in self.delays
        ]
        joints, camera = (states(instant) for instant in instants)
        count = 2.0 * np.pi / s.counts
        # x, y, θ of disk or hub come last
        q = camera + rng.standard_normal(camera.shape) * [
            *[0.0] * j,
            *(s.camera_position, s.camera_position, s.camera_angle),
        ]
        q[:, :j] = count * np.floor(joints[:, :j] / count)
        # the zero of an encoder is in the middle of a count
        q[:, :j] += 0.5 * count
        if s.velocity:
            of_joints, of_camera = (states(instant, 1) for instant in instants)
            v = np.concatenate([of_joints[:, :j], of_camera[:, j:]], axis=1)
            v += s.velocity * rng.standard_normal(v.shape)
        else:
            differences = np.diff(q, axis=0, prepend=2.0 * q[:1] - q[1:2]) / h
            v = low_passed(differences, s.velocity_filter / h)
        true = states(np.clip(t, 0.0, motion.t[-1]))[:, :j]
        angles = self.harmonics * true[:, :, None]
        waves = np.concatenate([np.cos(angles), np.sin(angles)], axis=2)
        u = np.vstack([torques, torques[-1:]])[first:] * (1.0 + np.einsum("kjh,jh->kj", waves, self.ripple))
        return t, q, v, u + self.offset


def low_passed(x: np.ndarray, steps: float) -> np.ndarray:
    """x (n, ...) after a first-order low pass with a time constant of `steps` samples."""
    share = 1.0 / (1.0 + steps)
    out = np.array(x)
    for k in range(1, len(x)):
        out[k] = out[k - 1] + share * (x[k] - out[k - 1])
    return out
