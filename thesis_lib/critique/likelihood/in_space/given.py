"""Observations of a body in space from the impacts stated in impacts.csv, in the frame of the surface.

The table contains the tracked frame T.  With the lever A from its origin to the believed centre of mass and small
errors δp, δφ, δv, δω of the stated values, the errors of the centre are

    δp_C = δp + δφ × A,    δv_C = δv + δω × A + ω × (δφ × A)
"""

from dataclasses import replace

import numpy as np

from thesis_lib.bodies.solid_body import NoiseInSpace
from thesis_lib.critique.likelihood.flights import no_flights
from thesis_lib.critique.likelihood.observations import Observations, as_stated, rig_of
from thesis_lib.datasets.checks.tracked_pose import settled
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.frames import body_states, surface_frames, tracked_states
from thesis_lib.datasets.format.table_forms import CONTACT_POINT, V_POST_IN_SPACE, V_PRE_IN_SPACE
from thesis_lib.datasets.impacts.found import found_in_space
from thesis_lib.effects.effect import Rig
from thesis_lib.foundation.errors import UserError
from thesis_lib.mechanics.space import SPACE
from thesis_lib.mechanics.state import State

FASTEST = 5.0  # ratio of the energy norm after an impact to that before it, or to the median; no impact doubles it


def given_in_space(dataset: Dataset) -> Observations:
    """Observations of the rows of impacts.csv; rows that cannot be impacts have a reason in `found`.

    Raises:
        UserError: there are several surfaces, the tracked frame is unknown, or the centre of mass depends on an
            orientation that is not stated.
    """
    header, table = dataset.in_space, dataset.impacts
    assert table is not None
    if len(header.planes) > 1:
        raise UserError(
            f"{dataset.name}: impacts on several surfaces cannot be distinguished. Give the surface that was hit as "
            "`surface`, and put the impacts on each surface into a separate dataset."
        )
    table = table.iloc[np.lexsort((table["impact"], table["trial"]))].reset_index(drop=True)
    turned = bool(np.isfinite(table["qw"].to_numpy(float)).any())
    dataset = settled(replace(dataset, has_angle=turned))
    header = dataset.in_space
    tracked = [tracked_states(table, names) for names in (V_PRE_IN_SPACE, V_POST_IN_SPACE)]
    (frame,), rig = surface_frames(header), rig_of(dataset)
    before, after = (frame.seen(body_states(states, header)) for states in tracked)
    lever = before.position - frame.vectors_in(tracked[0].position - frame.origin[:, None])
    if not turned and np.abs(lever).max(initial=0.0) > 1e-9:
        raise UserError(
            f"{dataset.name}: impacts.csv has no orientation, but the centre of mass is not at the tracked point; give "
            "qw, qx, qy, qz, or the velocities of the centre."
        )
    r, offset = rig.lowest(before), np.zeros((len(table), 3))
    if CONTACT_POINT[0] in table:
        offset = (frame.vectors_in(table[list(CONTACT_POINT)].to_numpy(float).T) - lever - r).T
    motion = np.stack([before.v, after.v], axis=1)
    reason = _reasons(before, r + offset.T, motion, rig)
    cov = _covariance(header.noise, lever, tracked[0].spin, frame.attitude, motion, turned)
    n, impact = len(table), table["impact"].to_numpy()
    stated = as_stated(before.q, motion, before.t, SPACE)
    stated["offset"] = offset
    o = Observations(
        rig=rig,
        trial=before.trial,
        impact=impact,
        **stated,
        cov=np.zeros((n, 2, 12, 12)) if cov is None else cov,
        arcs=False,
        flights=no_flights(SPACE),
        noise_known=cov is not None,
        found=found_in_space(header, before, impact, reason, np.full(n, np.nan), _sigma(header.noise)),
    )
    assert o.found.contacts is not None
    contacts = o.found.contacts.assign(jump=o.norm(motion[:, 1] - motion[:, 0]))
    return replace(o, found=replace(o.found, contacts=contacts)).rows(np.flatnonzero(reason == ""))


def _reasons(before: State, r: np.ndarray, motion: np.ndarray, rig: Rig) -> np.ndarray:
    """Reasons (n,) why impacts are left out; "" for impacts that are used."""
    v, spin = np.moveaxis(motion, -1, 0)[:3], np.moveaxis(motion, -1, 0)[3:]
    G = np.asarray(rig.tensor)
    of_body = np.stack([SPACE.turned_back(before.attitude, spin[:, :, side]) for side in (0, 1)], axis=2)
    size = np.sqrt((v**2).sum(axis=0) + np.einsum("ins,ij,jns->ns", of_body, G, of_body))
    wild = size[:, 1] > FASTEST * np.maximum(size[:, 0], np.median(size[:, 0]) if len(size) else 0.0)
    leaves = before.space.velocity_at(before.velocity, before.spin, r)[2] >= 0.0
    return np.select([wild, leaves], ["energy_gain", "no_approach"], "").astype(object)


def _covariance(
    noise: NoiseInSpace | None,
    lever: np.ndarray,
    spin: np.ndarray,
    surface: np.ndarray,
    motion: np.ndarray,
    turned: bool,
) -> np.ndarray | None:
    """Covariance (n, 2, 12, 12) of value and slope of each channel on both sides, as in `Observations`.

    None if a part of the noise is not stated.  `lever` (3, n) and `motion` (n, 2, 6) are in the frame of the surface,
    whose axes the quaternion `surface` (4,) turns into the axes of the recording.
    """
    if noise is None or None in (noise.position, noise.velocity, noise.angular_velocity):
        return None
    if noise.rotation is None and turned:
        return None
    n, axes = len(motion), SPACE.turned_back(surface[:, None], np.eye(3))
    place = axes @ np.diag(np.square(np.array(noise.position))) @ axes.T
    parts = [
        place,
        *(np.eye(3) * (one or 1.0) ** 2 for one in (noise.rotation, noise.velocity, noise.angular_velocity)),
    ]
    stated = np.zeros((12, 12))
    for i, part in enumerate(parts):
        stated[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = part
    across = -_cross(lever.T)  # δφ × A = −A × δφ
    order = np.array([[k, 6 + k] for k in range(6)]).ravel()  # p, φ, v, ω -> value and slope of each channel
    cov = np.empty((n, 2, 12, 12))
    for side in (0, 1):
        J = np.tile(np.eye(12), (n, 1, 1))
        J[:, 0:3, 3:6] = J[:, 6:9, 9:12] = across
        J[:, 6:9, 3:6] = _cross(motion[:, side, 3:]) @ across
        cov[:, side] = (J @ stated @ np.swapaxes(J, 1, 2))[:, order[:, None], order]
    return cov


def _cross(u: np.ndarray) -> np.ndarray:
    """Matrices (n, 3, 3) of the vector product u × for vectors u (n, 3)."""
    return np.cross(u[:, None, :], np.eye(3)).swapaxes(1, 2)


def _sigma(noise: NoiseInSpace | None) -> tuple[float, float]:
    """One sigma of a position in m and of a turn in rad; NaN if not stated."""
    place, turn = (None, None) if noise is None else (noise.position, noise.rotation)
    return np.nan if place is None else float(np.sqrt(np.mean(np.square(place)))), turn or np.nan
