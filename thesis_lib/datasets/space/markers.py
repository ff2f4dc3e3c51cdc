"""A rigid body from its markers: the rotation and shift that carry their places over, frame by frame.

    R, p = argmin Σ |p + R (m_i − m̄) − x_i|²       (Kabsch 1976, doi:10.1107/S0567739476001873)

x_i (3,) are the markers seen in a frame, m_i their places in the first frame that shows all of them: there the body's
axes are those of the recording, and its origin is the mean m̄ of the markers.
"""

import numpy as np

from thesis_lib.datasets.space.motion import quaternions

FEWEST = 3  # markers seen
FLAT = 0.05  # second singular value over the first: markers on a line give no rotation
RIGID = 0.003  # m, rms distance of markers from the rigid body; more is a marker taken for another


def body_of_markers(markers: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
    """Positions (n, 3) in m and quaternions (n, 4) of a body from markers (n, m, 3), NaN where lost.

    Also the number of frames whose markers are not those of a rigid body; they are NaN.  ValueError in words if the
    markers do not make a body.
    """
    from scipy.spatial.transform import Rotation

    n, count, _ = markers.shape
    shown = np.isfinite(markers.sum(axis=2))
    if count < FEWEST:
        raise ValueError(f"{count} markers do not tell a rotation; three or more do")
    whole = np.flatnonzero(shown.sum(axis=1) == count)
    if len(whole) == 0:
        raise ValueError("no frame shows all of its markers; leave out those that are seldom seen")
    reference = markers[whole[0]]
    reference = reference - reference.mean(axis=0)
    sizes = np.linalg.svd(reference, compute_uv=False)
    if sizes[1] < FLAT * sizes[0]:
        raise ValueError("its markers lie on a line, which tells no rotation about it")
    weight = shown[:, :, None].astype(float)
    seen: np.ndarray = weight.sum(axis=1)
    usable = np.flatnonzero(seen[:, 0] >= FEWEST)
    x, w = np.where(shown[:, :, None], markers, 0.0)[usable], weight[usable]
    middle_x, middle_m = (x * w).sum(axis=1) / seen[usable], (reference * w).sum(axis=1) / seen[usable]
    a, b = (x - middle_x[:, None]) * w, (reference - middle_m[:, None]) * w
    u, _, vt = np.linalg.svd(np.einsum("nmi,nmj->nij", a, b))
    u[:, :, 2] *= np.sign(np.linalg.det(u @ vt))[:, None]  # no reflection
    rotation = u @ vt
    rest = a - np.einsum("nij,nmj->nmi", rotation, b)
    rigid = np.sqrt(np.sum(rest**2, axis=(1, 2)) / seen[usable, 0]) < RIGID
    position, rotations, good = np.full((n, 3), np.nan), np.full((n, 3, 3), np.nan), usable[rigid]
    position[good] = (middle_x - np.einsum("nij,nj->ni", rotation, middle_m))[rigid]
    rotations[good] = rotation[rigid]
    return position, quaternions(rotations, Rotation.from_matrix), int(np.sum(~rigid))
