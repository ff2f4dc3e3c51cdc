"""MuJoCo as an impact model: its own contact, planar bodies, all impacts in one `mujoco.batch.Batch`.

The model comes from `thesis_lib/simulate/mujoco/model.py`.  Each simulation begins exactly at the touch, so 30
Runge-Kutta steps per contact time are enough.  μ and ε may be one number for all impacts, or one for each.
"""

import numpy as np

from thesis_lib.bodies.body import Body
from thesis_lib.engines.engine import mechanics
from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.compliant.forces import SHARP, rounded_centres
from thesis_lib.simulate.mujoco.causes import MujocoCauses
from thesis_lib.simulate.mujoco.contact import MujocoContact, solref
from thesis_lib.simulate.rig.hidden_causes import HiddenCauses

STEPS = 30  # in one contact time: 0.1 mm/s in an impact of an ellipse, 0.7 mm/s at most, against 400 steps
# m below the touch, so that MuJoCo's damper acts from the first stage of the first step on
SUNK = 1e-10


class MujocoEngine:
    """n bodies on MuJoCo's surface; see `thesis_lib/engines/engine.py`."""

    name = "mujoco"

    def __init__(
        self,
        body: Body,
        n: int,
        *,
        contact: MujocoContact,
        causes: HiddenCauses,
        gravity: float = 9.81,
        mu: np.ndarray | None = None,
        epsilon: np.ndarray | None = None,
    ) -> None:
        """`mu` and `epsilon` (n,) replace the values of `contact`; UserError for causes that no engine models."""
        try:
            from mujoco.batch import Batch
        except ImportError as error:
            raise UserError(f"MuJoCo cannot be used here ({error}): pip install mujoco-core.") from error
        from thesis_lib.simulate.mujoco.model import drop_model, share

        self.mechanics = mechanics(body, contact, causes, gravity, n)
        self.h = contact.dt
        self._centres, self._radius = None, 0.0
        if self.mechanics.vertices is not None and not causes.corner_radius:
            self._centres = rounded_centres(self.mechanics.vertices, SHARP)
            self._radius = SHARP
        self.model = drop_model(body, contact, MujocoCauses(**causes.model_dump()), gravity)
        self.batch = Batch(self.model, n, 1)
        if mu is not None:
            self.batch.expand("pair_friction")[:, :, :2] = np.asarray(mu, dtype=float)[:, None, None]
        if epsilon is not None:
            of_central = share(self.model, contact)
            self.batch.expand("pair_solref")[:] = solref(epsilon, np.full(n, contact.contact_time), of_central)[:, None]

    def press(self, rows: np.ndarray, q: np.ndarray, v: np.ndarray, steps: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the paths q, v (m, steps + 1, 3) that start from the states (m, 3) of the centre of mass."""
        down = np.zeros_like(q)
        down[:, 1] = SUNK + self._blunt(q[:, 2])
        self.batch.bind("qpos")[rows, :3] = q - down
        self.batch.bind("qvel")[rows, :3] = v
        made = self.batch.rollout(steps, record=("qpos", "qvel"), ids=rows)
        starts = {"qpos": q - down, "qvel": v}
        places, rates = (np.concatenate([one[:, None], made[name][..., :3]], axis=1) for name, one in starts.items())
        return places + down[:, None], rates

    def _blunt(self, theta: np.ndarray) -> np.ndarray:
        """Return how much higher (m,) in m the model's rounded corners end than the sharp corners of the body."""
        if self._centres is None:
            return np.zeros(len(theta))
        x, z = self._centres.T
        height = np.sin(theta)[:, None] * x + np.cos(theta)[:, None] * z - self._radius
        return height.min(axis=1) - self.mechanics.lowest_point(theta)[:, 1]
