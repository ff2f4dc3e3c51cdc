"""The pose of the tracked frame in the body, and the plane of the table, determined from tosses.

Flights give the centre of mass in the tracked frame T and gravity (`falling_body`).  At each touch the lowest point of
the body lies on the table, and where the body rests it stands on a face:

    n·(u + R e) + n·lowest(R R_STᵀ, n) = h − τ v_n,    n ∥ n_S at rest

in which the rotation R_ST of T's axes into S's, the error e of the centre, the normal n and the height h of the table,
and the penetration τ v_n of a hit before its parabolas meet are unknown.  A search over all rotations gives starting
points; of rotations that are equal by a symmetry of the body, the one nearest to the identity is reported.

| on paper | in code   | unit | shape  | axes                                                              |
|----------|-----------|------|--------|-------------------------------------------------------------------|
| u        | `place`   | m    | (k, 3) | recording: centre of mass at a touch                              |
| R        | `attitude`| 1    | (k)    | T into the recording's                                            |
| e        |           | m    | (3,)   | T: from the centre of mass by the flights to that by the shape    |
| τ, v_n   |           | s, m/s |      | time from touch to meeting, speed of the contact point towards the table |
| n_S      | `stands`  | 1    | (m, 3) | S: directions that are up where the body stands                   |
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from thesis_lib.bodies.solid_body import SolidBody, Tracked
from thesis_lib.bodies.symmetry import Symmetry
from thesis_lib.datasets.space.falling_body import FallingBody, falling_body
from thesis_lib.datasets.space.touches import Touches, touches
from thesis_lib.foundation.errors import UserError
from thesis_lib.mechanics.frame import Frame
from thesis_lib.statistics.wording import plural

TURNS, BEGIN, APART = 6000, 10, 0.35  # rotations that are tried, the best of them (rad apart) that are fitted
COARSE = (0.15, 0.3)  # of the extent, and rad: scale of misfits in the search
FIRST = (1.5e-3, 0.03)  # m and rad: scale of misfits in the first fit, later estimated
LEAST = (5e-5, 1e-4)  # m and rad: smaller misfits are chance
ROUNDS = 4  # fits, each with the misfits of the one before
PARTS = 8  # of the touches, left out in turn
FEWEST = 6  # touches
SLOPE, SINKING, CENTRE = 0.1, 2e-3, 0.02  # one sigma of tilt (rad), τ (s), and of a centre of mass, of the extent
ODD = 3.0  # sigmas, beyond which a touch is ascribed to another object
MISFIT = 0.06  # of the extent, by which most touches may be off the table
OPEN = (0.1, 0.15)  # rad, and of the extent: larger uncertainties are reported as open
FAR = 0.05  # extents by which a touch is clearly off the table
UNSEEN = 0.1  # of the distance that a body moves in one step, by which a touch may be farther off
OFTEN, SEVERAL = 0.1, 3  # share and number of such touches, from which on the shape is doubted
CHANCE = 20.0  # in χ², by which another rotation must fit worse


@dataclass(frozen=True, eq=False)
class TrackedFrame:
    """Tracked frame found from tosses; `open` are sentences on parts that they do not determine, none if complete.

    Attributes:
        tracked: pose of T in S, with its uncertainty.
        point, normal: (3,) of the table, in m and 1, axes of the recording.
        gravity: (3,) in m/s², of the believed magnitude.
        gravity_angle: one sigma of its direction, rad.
        path: (n, 3) in m of the centre of mass.
        doubt: sentence on a shape that does not fit many touches, "" if it does.
    """

    tracked: Tracked
    point: np.ndarray
    normal: np.ndarray
    gravity: np.ndarray
    gravity_angle: float
    path: np.ndarray
    hits: int
    rests: int
    open: tuple[str, ...]
    doubt: str = ""

    @property
    def text(self) -> str:
        """The pose in one sentence."""
        error, touches = self.tracked.uncertainty, f"{plural(self.hits, 'hit')} and {plural(self.rests, 'rest')}"
        if error is None:
            return f"surface found from {touches}"
        assert error.position and error.rotation
        place = ", ".join(f"{1e3 * value:.1f}" for value in self.tracked.position)
        angle = np.degrees(Rotation.from_quat(self.tracked.attitude, scalar_first=True).magnitude())
        return (
            f"tracked frame found from {touches}: at ({place}) mm in the shape, within "
            f"{1e3 * error.position:.2g} mm, turned by {angle:.1f}° within {np.degrees(error.rotation):.2g}°"
        )


def find_tracked_frame(
    trial: np.ndarray,
    t: np.ndarray,
    position: np.ndarray,
    quaternion: np.ndarray | None,
    body: SolidBody,
    gravity: float,
    normal: np.ndarray | None = None,
) -> TrackedFrame:
    """Pose of the tracked frame in the body, table and gravity, from complete poses at increasing times `t` (n,).

    Args:
        trial: (n,) equal within a toss, or a take.
        quaternion: (n, 4) scalar first; None for a ball whose centre is tracked, and whose orientation is not measured.
        gravity: its magnitude in m/s².
        normal: (3,) of a table that is known to slope; None: nearly against gravity.

    Raises:
        UserError: flights or touches are missing; the message states which.
    """
    turned = Rotation.identity(len(t)) if quaternion is None else Rotation.from_quat(quaternion, scalar_first=True)
    falls = falling_body(t, position, turned.as_matrix(), gravity)
    if quaternion is None:
        falls.covariance[:3] = falls.covariance[:, :3] = 0.0
    met = touches(trial, t, position, turned, falls)
    if len(met.rests) < FEWEST:
        raise UserError(
            f"{len(met.rests)} hits and rests follow free flights, but the pose of the tracked frame in the body needs "
            f"{FEWEST}: record until the body lies still, on different faces."
        )
    found = _Fit(body, falls, met, normal).solved(gravity)
    if quaternion is not None:
        return found
    return replace(found, tracked=Tracked.model_validate({"position": tuple(body.centre.tolist())}))


class _Fit:
    """The equations of the touches; the unknowns are rotation (3), e (3), h, tilt (2) and τ."""

    def __init__(self, body: SolidBody, falls: FallingBody, met: Touches, normal: np.ndarray | None) -> None:
        self.body, self.falls, self.met = body, falls, met
        self.solid = body.solid.about(body.centre)
        self.symmetry = Symmetry(self.solid, body.inertia_per_mass)
        against = -falls.gravity / np.linalg.norm(falls.gravity)
        self.frame = Frame.of_surface(np.zeros(3), against if normal is None else normal)
        self.axes = self.frame.vectors_out(np.eye(3))  # columns: t_1, t_2, n
        stated = body.uncertainty.center_of_mass if body.uncertainty else None
        self.spread = stated or CENTRE * self.solid.extent
        self.e_root = np.linalg.inv(np.linalg.cholesky(falls.covariance[:3, :3] + np.eye(3) * self.spread**2))
        self.sigma = np.where(met.rests, *FIRST[:1] * 2), np.full(int(met.rests.sum()), FIRST[1])
        self.used = np.ones(len(met.rests), bool)

    def normal(self, x: np.ndarray) -> np.ndarray:
        n = self.axes @ [x[7], x[8], 1.0]
        return n / np.linalg.norm(n)

    def gaps(self, R: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Heights (k,) in m of the lowest points above the table, corrected for the penetration of hits."""
        n, met = self.normal(x), self.met
        attitude = (met.attitude * Rotation.from_matrix(R.T)).as_quat(scalar_first=True).T
        lowest = self.solid.lowest(attitude, n[:, None]).T
        speed = -(met.velocity + np.cross(met.spin, lowest)) @ n
        return (met.place + met.attitude.apply(x[3:6]) + lowest) @ n - x[6] + x[9] * speed * ~met.rests

    def slants(self, R: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Rotation vectors (m, 3) in rad from the attitude at each rest to the nearest one in which the body stands."""
        return self.symmetry.leaning((self.met.attitude.inv().apply(self.normal(x)) @ R.T)[self.met.rests])

    def residuals(self, x: np.ndarray, R: np.ndarray) -> np.ndarray:
        turned = Rotation.from_rotvec(x[:3]).as_matrix() @ R
        rests = self.used[self.met.rests]
        gaps = (self.gaps(turned, x) / self.sigma[0])[self.used]
        slants = (self.slants(turned, x) / self.sigma[1][:, None])[rests]
        return np.concatenate([gaps, slants.ravel(), self.known(x)])

    def known(self, x: np.ndarray) -> np.ndarray:
        """Residuals of what is known without touches: above all the centre of mass, by the flights and as stated."""
        fixed = x[:3][self.symmetry.axes] / OPEN[0]
        return np.r_[self.e_root @ x[3:6], x[7:9] / SLOPE, x[9] / SINKING, x[:3] / np.pi, fixed]

    def odd_touches(self, z: np.ndarray) -> np.ndarray:
        """Loss function of squares z: that of Cauchy for touches, which may be of other objects, else none."""
        touch = np.arange(len(z)) < len(z) - len(self.known(np.zeros(10)))
        rate = np.where(touch, 1.0 / (1.0 + z), 1.0)
        return np.stack([np.where(touch, np.log1p(z), z), rate, np.where(touch, -(rate**2), 0.0)])

    def starts(self) -> list[np.ndarray]:
        """Starting rotations (3, 3): the best of many, no two alike."""
        some = Rotation.random(TURNS, rng=np.random.default_rng(0)).as_matrix()
        n, costs = self.axes[:, 2], []
        seen = self.met.attitude.inv().apply(n)  # the normal, in T
        for part in np.array_split(some, 20):
            up = np.einsum("tij,kj->tki", part, seen)
            m = up.reshape(-1, 3).T
            gaps = self.met.place @ n + np.einsum("ik,ik->k", self.solid.support(-m), m).reshape(up.shape[:2])
            gaps -= np.median(gaps, axis=1, keepdims=True)
            leans = self.symmetry.leaning(up[:, self.met.rests].reshape(-1, 3)).reshape(len(part), -1, 3)
            cost = np.log1p((gaps / (COARSE[0] * self.solid.extent)) ** 2).sum(axis=1)
            costs.append(cost + np.log1p((leans**2).sum(axis=2) / COARSE[1] ** 2).sum(axis=1))
        chosen: list[np.ndarray] = []
        for i in np.argsort(np.concatenate(costs)):
            if all(self.angle(some[i], R) > APART for R in chosen):
                chosen.append(some[i])
            if len(chosen) == BEGIN:
                break
        return chosen

    def angle(self, one: np.ndarray, other: np.ndarray) -> float:
        """Least angle in rad between two rotations, up to the symmetry of the body."""
        return float(np.arccos(np.clip((np.trace(self.symmetry.nearest(one, other) @ other.T) - 1.0) / 2.0, -1.0, 1.0)))

    def fitted(self, R: np.ndarray, x: np.ndarray, loss: str | Callable[[np.ndarray], np.ndarray]):
        x = np.r_[np.zeros(3), x[3:]]
        options: dict[str, Any] = {"loss": loss, "x_scale": "jac", "max_nfev": 25}
        found = least_squares(self.residuals, x, args=(R,), **options)
        return found.cost, Rotation.from_rotvec(found.x[:3]).as_matrix() @ R, found.x, found.jac

    def begun(self, R: np.ndarray):
        x = np.zeros(10)
        x[6] = np.median(self.gaps(R, x))
        return self.fitted(R, x, "cauchy")

    def solved(self, gravity: float) -> TrackedFrame:
        candidates = sorted((self.begun(R) for R in self.starts()), key=lambda one: one[0])
        _, R, x, _ = candidates[0]
        R, rests = self.symmetry.nearest(R, np.eye(3)), self.met.rests
        for _ in range(ROUNDS):
            gaps, slants = np.abs(self.gaps(R, x)), np.linalg.norm(self.slants(R, x), axis=1)
            size = [max(1.48 * np.median(gaps[which]), LEAST[0]) if which.any() else 1.0 for which in (~rests, rests)]
            # the median of the length of two normal components is 1.18 sigma
            turn = max(float(np.median(slants)) / 1.18, LEAST[1]) if len(slants) else 1.0
            self.sigma = np.where(rests, size[1], size[0]), np.full(len(slants), turn)
            _, R, x, _ = self.fitted(R, x, "cauchy")
        # a centre of mass off the middle tells apart what the shape does not
        best = self.fitted(R, x, self.odd_touches)[0]
        others = [self.fitted(one[1], one[2], self.odd_touches) for one in candidates[1:6]]
        rivals = [other for other in others if other[0] - best < CHANCE / 2.0 and self.angle(other[1], R) > APART]
        self.used = np.abs(self.gaps(R, x)) < ODD * self.sigma[0]
        self.used[rests] &= np.linalg.norm(self.slants(R, x), axis=1) < ODD * self.sigma[1]
        off = float(np.median(np.abs(self.gaps(R, x))))
        if off > MISFIT * self.solid.extent:
            raise UserError(
                f"at the touches the body is {1e3 * off:.2g} mm off its table in any pose (median): check the shape, "
                "the units and the rotations."
            )
        if (number := int(self.used.sum())) < FEWEST:
            raise UserError(
                f"{number} of {len(self.used)} hits and rests after free flights agree on one pose and one table, but "
                f"{FEWEST} must: record more tosses, until the body lies still, on different faces."
            )
        cost, R, x, jac = self.fitted(R, x, "linear")
        free = int(self.used.sum() + 2 * self.used[rests].sum()) - 7
        cov = np.linalg.inv(jac.T @ jac) * max(1.0, 2.0 * cost / max(free, 1)) + self.left_out(R, x)
        fixed = self.symmetry.axes
        cov[fixed], cov[:, fixed] = 0.0, 0.0
        return self.told(R, x, cov, gravity, [rival[1] for rival in rivals])

    def left_out(self, R: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Covariance (10, 10) of the unknowns by the jackknife: fits without each of `PARTS` parts."""
        used, found = self.used, []
        for part in range(PARTS):
            self.used = used & (np.arange(len(used)) % PARTS != part)
            found.append(self.fitted(R, x, "linear")[2])
        self.used = used
        return (PARTS - 1.0) * np.cov(np.array(found).T, bias=True)

    def told(
        self, R: np.ndarray, x: np.ndarray, cov: np.ndarray, gravity: float, rivals: list[np.ndarray]
    ) -> TrackedFrame:
        turns = [self.angle(rival, R) for rival in rivals]
        falls, n, axes = self.falls, self.normal(x), self.symmetry.axes
        r = R @ (falls.centre + x[3:6])  # d = c_S − R (c_T + e)
        by = np.zeros((3, 10))
        by[:, :3], by[:, 3:6] = np.cross(np.eye(3), r), -R  # a rotation by φ moves r by φ × r
        place = by @ cov @ by.T
        turn = cov[:3, :3].copy()
        told = []
        for name, matrix, limit, unit in (
            ("rotation about", turn, OPEN[0], "rad"),
            ("position along", place, OPEN[1] * self.solid.extent, "m"),
        ):
            values, vectors = np.linalg.eigh(matrix)
            for value, vector in zip(values, vectors.T):
                along = np.abs(vector[axes]).max(initial=0.0) > 0.9 and unit == "rad"
                if np.sqrt(value) > limit and not along:
                    direction = ", ".join(f"{part:.2f}" for part in vector + 0.0)
                    told.append(f"the {name} ({direction}) of the shape is known to {np.sqrt(value):.2g} {unit} only")
        if rivals:
            told.append(f"the data fit as well with the shape turned by {np.degrees(turns[0]):.0f}°")
            of_shape = Symmetry(self.body.solid, np.eye(3)).nearest(rivals[0], R)
            if Rotation.from_matrix(of_shape @ R.T).magnitude() < APART:
                told[-1] += (
                    f", which moves only its centre of mass (taken as known within {1e3 * self.spread:.2g} mm: "
                    "body.uncertainty.center_of_mass)"
                )
        free = [i for i in range(3) if i not in axes] or [0]
        q = Rotation.from_matrix(R).as_quat(scalar_first=True, canonical=True)
        one = float(self.sigma[0][self.used].min())  # touches may err together, by as much as one of them
        error = {
            "position": float(np.hypot(np.sqrt(np.linalg.eigvalsh(place)[-1]), one)),
            "rotation": float(max(np.hypot(np.sqrt(np.diag(turn)[free].max()), one / self.solid.extent), *turns, 0.0)),
        }
        tracked = Tracked.model_validate(
            {"position": tuple((self.body.centre - r).tolist()), "quaternion": tuple(q.tolist()), "uncertainty": error}
        )
        g, mean = falls.gravity / np.linalg.norm(falls.gravity), self.met.place[self.used].mean(axis=0)
        point = mean - (mean @ n - x[6]) * n
        across = np.eye(3) - np.outer(g, g)
        angle = np.sqrt(np.linalg.eigvalsh(across @ falls.covariance[3:, 3:] @ across)[-1]) / np.linalg.norm(
            falls.gravity
        )
        hits, rests = (int((self.used & which).sum()) for which in (~self.met.rests, self.met.rests))
        return TrackedFrame(
            tracked, point, n, gravity * g, float(angle), falls.path, hits, rests, tuple(told), self.doubt(R, x)
        )

    def doubt(self, R: np.ndarray, x: np.ndarray) -> str:
        """Sentence on a shape whose lowest point is often clearly off the table, "" if it is not.

        At a low rate the instant of a hit is uncertain, the more if two hits lie within one step.
        """
        off, met = np.abs(self.gaps(R, x)), self.met
        speed = np.linalg.norm(met.velocity, axis=1) + np.linalg.norm(met.spin, axis=1) * self.solid.extent
        far = off[off > FAR * self.solid.extent + UNSEEN * speed * met.step]
        if len(far) < max(SEVERAL, OFTEN * len(off)):
            return ""
        return (
            f"at {len(far)} of {len(off)} hits and rests the lowest point of the shape is off the surface, by "
            f"{1e3 * np.median(far):.2g} mm (median): check the size of the shape (in m; edges and heights in full "
            "length, radii and semi-axes), unless the body touches other objects"
        )
