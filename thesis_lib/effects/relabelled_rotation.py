"""Attitudes in a wrong convention: signs and order of quaternion components, described by a signed permutation P.

Shared by effects; not an effect itself.  With q the attitude of the tracked frame in the axes of the recording and ω
its spin there,

    q_measured = P q,   ω_measured = 2 (P q̇) q_measured⁻¹,   q̇ = ½ (0, ω) q

and the tracked point does not move.  Pᵀ is the inverse of P.

| on paper | in code | unit | shape  |                                                     |
|----------|---------|------|--------|-----------------------------------------------------|
| P        | `P`     | 1    | (4, 4) | signed permutation of the components w, x, y, z     |
"""

import numpy as np

from thesis_lib.effects.effect import Rig
from thesis_lib.mechanics.space import conjugate, multiplied, rotated
from thesis_lib.mechanics.state import State

_NONE = np.array([1.0, 0.0, 0.0, 0.0])


def relabelled(state: State, P: np.ndarray, rig: Rig) -> State:
    """State in space that is reported if the quaternions of the tracked frames are P times the true quaternions."""
    shape = state.attitude.shape
    world, mark = (
        np.broadcast_to((_NONE if q is None else q)[:, None], shape)
        for q in (rig.world, None if rig.tracked is None else rig.tracked.attitude)
    )
    q, spin = multiplied(multiplied(world, state.attitude), mark), rotated(world, state.spin)
    rate = 0.5 * multiplied(np.concatenate([np.zeros_like(spin[:1]), spin]), q)
    seen, spin = P @ q, 2.0 * multiplied(P @ rate, conjugate(P @ q))[1:]
    attitude = multiplied(conjugate(world), multiplied(seen, conjugate(mark)))
    return rig.turned(state, attitude, rotated(conjugate(world), spin))
