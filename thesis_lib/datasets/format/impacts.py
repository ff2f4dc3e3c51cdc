"""Impacts as arrays, the input of every law, fit and figure.

A row is an impact: the pose q = (x, y, θ) at the instant of impact, the velocities v = (v_x, v_y, ω) just before and
just after, and the contact point r = (r_x, r_y) from the body origin, as in impacts.csv.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import pandas as pd

from thesis_lib.bodies.shapes import Shape

POSE = ("x", "y", "theta")
V_PRE = ("vx_pre", "vy_pre", "omega_pre")
V_POST = ("vx_post", "vy_post", "omega_post")
STATE = POSE + V_PRE + V_POST  # order of rows and columns of the covariance
IMPACT_COLUMNS = ("trial", "impact", *STATE)
COVARIANCE_COLUMNS = tuple(f"cov_{STATE[a]}_{STATE[b]}" for a, b in zip(*np.tril_indices(len(STATE))))


@dataclass(frozen=True)
class Impacts:
    """n impacts of one body."""

    trial: np.ndarray  # trial, impact: (n,) integers; `trial` is a release and the unit of every split
    impact: np.ndarray
    q: np.ndarray  # (n, 3) pose at impact, m, m, rad
    v_pre: np.ndarray  # v_pre, v_post: (n, 3) m/s, m/s, rad/s
    v_post: np.ndarray
    r: np.ndarray  # (n, 2) contact point from the body origin, m
    k_g: float  # radius of gyration, m
    mass: float = 1.0  # kg; 1.0 if the dataset states none, and impulses are then per unit mass
    # (n,) instant of impact in s, NaN if unknown
    t: np.ndarray = field(default=None)  # type: ignore[assignment]
    cov: np.ndarray | None = None  # (n, 9, 9) covariance of (q, v_pre, v_post), or None if unknown
    # (n,) text, ';'-joined names of failed quality tests ('' = none); flagged impacts are kept
    flags: np.ndarray = field(default=None)  # type: ignore[assignment]
    # (n,) number of the wall that was hit, in whose frame pose and velocities are; 0 on one surface
    surface: np.ndarray = field(default=None)  # type: ignore[assignment]

    def __post_init__(self) -> None:
        if self.t is None:
            object.__setattr__(self, "t", np.full(len(self), np.nan))
        if self.surface is None:
            object.__setattr__(self, "surface", np.zeros(len(self), int))
        if self.flags is None:
            object.__setattr__(self, "flags", np.full(len(self), "", dtype=object))

    def __len__(self) -> int:
        return len(self.trial)

    @property
    def dv(self) -> np.ndarray:
        """Velocity change Δv = v_post − v_pre, (n, 3) in m/s, m/s, rad/s."""
        return self.v_post - self.v_pre

    def select(self, rows: np.ndarray | Sequence[int]) -> "Impacts":
        """The impacts at `rows` (indices or a mask), in that order."""
        rows = np.asarray(rows)
        names = ("trial", "impact", "q", "v_pre", "v_post", "r", "t", "flags", "surface")
        arrays = {name: getattr(self, name)[rows] for name in names}
        return replace(self, **arrays, cov=None if self.cov is None else self.cov[rows])

    def sample(self, count: int | None, rng: np.random.Generator) -> "Impacts":
        """At most `count` impacts drawn at random, in their original order; all if None."""
        if count is None or count >= len(self):
            return self
        return self.select(np.sort(rng.choice(len(self), size=count, replace=False)))

    @classmethod
    def from_table(cls, table: pd.DataFrame, shape: Shape, k_g: float, mass: float | None = None) -> "Impacts":
        """Impacts from a table with at least `IMPACT_COLUMNS`; `k_g` in m, `mass` in kg.

        Contact points are `r_x`, `r_y` if present, else derived from shape and θ.
        """
        q, v_pre, v_post = (table[list(names)].to_numpy(float) for names in (POSE, V_PRE, V_POST))
        has_r = {"r_x", "r_y"} <= set(table.columns)
        return cls(
            trial=table["trial"].to_numpy(),
            impact=table["impact"].to_numpy(),
            q=q,
            v_pre=v_pre,
            v_post=v_post,
            r=table[["r_x", "r_y"]].to_numpy(float) if has_r else shape.contact_point(q[:, 2]),
            k_g=float(k_g),
            mass=1.0 if mass is None else float(mass),
            t=table["t"].to_numpy(float) if "t" in table else None,  # pyright: ignore[reportArgumentType]
            cov=_covariance_from(table),
            flags=table["flags"].fillna("").to_numpy(object) if "flags" in table else None,  # pyright: ignore[reportArgumentType]
        )

    def to_table(self) -> pd.DataFrame:
        """The inverse of `from_table`, with r_x, r_y, and with t, flags and covariance if known."""
        table = pd.DataFrame({"trial": self.trial, "impact": self.impact})
        if not np.all(np.isnan(self.t)):
            table["t"] = self.t
        for names, values in ((POSE, self.q), (V_PRE, self.v_pre), (V_POST, self.v_post), (("r_x", "r_y"), self.r)):
            for i, name in enumerate(names):
                table[name] = values[:, i]
        table["flags"] = self.flags
        if self.cov is not None:
            i, j = np.tril_indices(len(STATE))
            table = pd.concat([table, pd.DataFrame(dict(zip(COVARIANCE_COLUMNS, self.cov[:, i, j].T)))], axis=1)
        return table


def _covariance_from(table: pd.DataFrame) -> np.ndarray | None:
    if COVARIANCE_COLUMNS[0] not in table:
        return None
    i, j = np.tril_indices(len(STATE))
    cov = np.zeros((len(table), len(STATE), len(STATE)))
    cov[:, i, j] = table[list(COVARIANCE_COLUMNS)].to_numpy(float)
    cov[:, j, i] = cov[:, i, j]
    return cov
