"""Poses as a camera reports them: faults and optics of the camera, and the wobble of a body out of its plane.

    x_m = (1 + s) X + d t,   y_m = (1 + s) Y,   θ_m(t) = ± (θ(t − lag) + β) + δ

(X, Y) is the position at which the optics show the tracked point x + R(θ) (d_x, d_y), after these steps:

    pose            z ← e^{iβ} z,   β = roll + slope,   z = x + i y; this rotation is added to θ, too
    skew            x ← x + s y
    pitch           (x, y) ← (x, y) / (1 + p y), for a camera that looks up or down
    lens            about (0, h):  z ← z + k |z|² z

A wobble after an impact displaces the tracked frame along the direction of its x axis at the impact, by w = a Δv_n
cos(β − axis) exp(−t/T) sin(2π f t).  Here t is the time since the impact and β the place of the impact on the body (the
lever out of the plane varies over the body).  θ is displaced by w/2 over the radius of gyration.

All arrays in SI units; poses (n, samples, 3) are x, y, θ of the body's origin.
"""

import numpy as np
import pandas as pd

from thesis_lib.datasets.format.impacts import POSE
from thesis_lib.simulate.rig.hidden_causes import HiddenCauses


def wobble(impacts: pd.DataFrame, times: np.ndarray, n: int, m: HiddenCauses, k_g: float) -> np.ndarray:
    """Displacement (n, samples, 3) of the reported poses at `times` (samples,) by wobbles after the true `impacts`."""
    out = np.zeros((n, len(times), 3))
    if m.wobble == 0.0 or not len(impacts):
        return out
    theta = impacts["theta"].to_numpy()
    place = np.arctan2(impacts["r_y"].to_numpy(), impacts["r_x"].to_numpy()) - theta
    size = m.wobble * (impacts["vy_post"] - impacts["vy_pre"]).to_numpy() * np.cos(place - m.orientation_axis)
    since = times - impacts["t"].to_numpy()[:, None]
    after = np.maximum(since, 0.0)
    swing = size[:, None] * np.exp(-after / m.wobble_decay) * np.sin(2 * np.pi * m.wobble_frequency * after)
    shown = np.stack([swing * np.cos(theta)[:, None], swing * np.sin(theta)[:, None], swing / (2.0 * k_g)], axis=-1)
    np.add.at(out, impacts["trial"].to_numpy(), shown)
    return out


def reported(poses: np.ndarray, lagged_theta: np.ndarray, times: np.ndarray, m: HiddenCauses) -> np.ndarray:
    """Poses (n, samples, 3) as the camera with the hidden causes `m` reports them, without noise.

    `poses` are the true poses at `times` (samples,) in s, `lagged_theta` (n, samples) is the true θ in rad at `times`
    minus the lag.
    """
    beta, middle = m.camera_roll + m.camera_slope, 1j * m.lens_height
    z = poses[..., 0] + 1j * poses[..., 1]
    z = z + np.exp(1j * poses[..., 2]) * (m.marker_offset_x + 1j * m.marker_offset_y)
    if beta:
        z = z * np.exp(1j * beta)
    z = z + m.camera_skew * z.imag
    z = z * (1.0 / (1.0 + m.camera_pitch * z.imag))
    z = z + m.lens * np.abs(z - middle) ** 2 * (z - middle)
    theta = lagged_theta + beta
    theta = (-theta if m.mirrored else theta) + m.angle_offset
    x, y = (1.0 + m.length_scale) * z.real + m.drift * times, (1.0 + m.length_scale) * z.imag
    return np.stack([x, y, theta], axis=-1)


def as_trajectories(poses: np.ndarray, times: np.ndarray) -> pd.DataFrame:
    """Long table of poses (n, samples, 3), without samples after the end of a recording (NaN)."""
    n = len(poses)
    table = pd.DataFrame({"trial": np.repeat(np.arange(n), len(times)), "t": np.tile(times, n)})
    table[list(POSE)] = poses.reshape(-1, 3)
    return table.dropna(subset=list(POSE)).reset_index(drop=True)
