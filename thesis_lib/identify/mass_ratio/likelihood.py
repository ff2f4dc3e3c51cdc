"""Maximum likelihood of m/I given the arcs of a drop, for many hypotheses about its impacts at once.

An impulse (c_t, c_n) at the contact point r changes the velocities by Δv_x = c_t / m, Δv_y = c_n / m and

    Δω_j = (m/I) (r_x Δv_y - r_y Δv_x)_j,     r = r(θ_{k_j}),                                             (1)

so m/I is what links the arcs of θ to those of x and y; nothing is assumed about friction or restitution.  The samples
know the arcs u with information N (`arc_statistics`), so maximum likelihood is a small constrained problem,

    minimise χ²_free + (u - û)' N (u - û)   over u, η    subject to  g(u, η) = 0,                              (2)

η = (m/I, ε, μ), g the rows (1), solved by Newton steps on the linearised rows G du + G_η dη + g = 0 (multiple shooting:
every arc keeps its own numbers, so that an early error does not grow through later impacts).  A hypothesis is the
impact steps k_j, the vertex that hits on a polygon, and under a contact law the mode of each impact.  More rows:

Gap (optional).  The time stepper applies an impulse in the first step that would end in the surface: the gap at its
start, φ_j = y + r_y at k_j, lies between 0 and the way h |v_n| of the step.  That is knowledge of geometry, not of a
contact law.  It is uniform there over drops, and enters as a normal variable of the same mean and variance,

    √12 (φ_j / (h |v_n|_j) - 1/2) ~ N(0, 1),   with 2 log(h |v_n|_j) in -2 log likelihood.                        (3)

Contact law (optional).  Newton's restitution and Coulomb's friction with unknown ε and μ, the same at all impacts of
the drop; v- is v_k, v+ is v_{k+1}:

    J_n v+ + ε J_n v- = 0;     J_t v+ = 0 (stick)   or   Δv_x = ± μ Δv_y (slide).                               (4)

| on paper | in code    | unit   | shape   |                                                         |
|----------|------------|--------|---------|---------------------------------------------------------|
| η        | `eta`      | 1/m², 1, 1 | (B, 3) | m/I, ε, μ                                             |
| r, r_x'  | `r`, `dr_x` | m, m/rad | (n, 2), (n,) | contact point, derivative of r_x by θ; that of r_y is r_x |
| u        | `u`        | m, rad, m/s, rad/s | (B, 3, 2+J) | arcs, see `arc_statistics`                 |
| G, G_η   | `G`, `G_eta` |      | (B, n_g, 3, 2+J), (B, n_g, 3) | derivatives of the rows               |
| S        | `S`        |        | (B, n_g, n_g) | G N⁻¹ G', plus the variance of soft rows (3)        |

Sources: thesis eq. 2.3, 2.18-2.23; W. A. Fuller, Measurement Error Models, Wiley 1987, doi 10.1002/9780470316665 (m/I
multiplies quantities that are themselves noisy: least squares on (1) is biased, maximum likelihood not to first order).
"""

from dataclasses import dataclass

import numpy as np

from thesis_lib.bodies.shapes import Disk, Ellipse, Polygon
from thesis_lib.identify.mass_ratio.sufficient_statistics import ArcStatistics
from thesis_lib.simulate.stepping.multibody import Rod

BodyShape = Polygon | Ellipse | Disk | Rod

MAX_ITERATIONS = 30
CONVERGED = 1e-6  # Newton step in standard deviations of the arcs
SPEED_FLOOR = 0.05  # m/s; |v_n| in the gap's scale: a trial value of zero would make (3) infinite
SLIDE_FORWARD, STICK, SLIDE_BACK = 1, 0, -1  # modes: sign of c_t of an impact that slides
_BACKTRACK = (1.0, 0.5, 0.2, 0.05)  # fractions of a Newton step that are tried
# information added to η, of its own: an unknown that no row holds (μ if all stick) stays put
_SOFT_PRIOR = 1e-12


@dataclass(frozen=True)
class ArcFit:
    """Fits of B hypotheses.

    Attributes:
        u: (B, 3, 2+J) arcs.
        eta: (B, 3) m/I in 1/m², ε, μ; the last two as they started where no law is assumed.
        chi2: (B,) -2 log likelihood, up to a constant.
        misfit: (B,) χ² of what links the arcs: of (2) without χ²_free, and of (3) without its logarithm.
        dof: (B,) degrees of freedom of `misfit`.
        std: (B, 3) standard deviations of η; infinite where the drop says nothing about it.
        converged: (B,) bool.
    """

    u: np.ndarray
    eta: np.ndarray
    chi2: np.ndarray
    misfit: np.ndarray
    dof: np.ndarray
    std: np.ndarray
    converged: np.ndarray

    @property
    def ratio(self) -> np.ndarray:
        """m/I (B,) in 1/m²."""
        return self.eta[:, 0]


def corner_points(shape: BodyShape) -> np.ndarray | None:
    """Points (n, 2) in m of the body that may touch: vertices of a polygon, ends of a rod; None if it is smooth."""
    if isinstance(shape, Polygon):
        return np.array(shape.vertices)
    return shape.outline() if isinstance(shape, Rod) else None


def contact_offset(shape: BodyShape, theta: np.ndarray, vertex: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Contact point r (n, 2) in m at angles (n,), and the derivative (n,) of r_x by θ; that of r_y is r_x.

    `vertex` (n,) numbers the vertex of a polygon that touches; other shapes ignore it.
    """
    sin, cos = np.sin(theta), np.cos(theta)
    corners = corner_points(shape)
    if corners is not None:
        x, y = corners[vertex].T
        r = np.stack([cos * x - sin * y, sin * x + cos * y], axis=-1)
        return r, -r[:, 1]
    r = shape.contact_point(theta)
    if not isinstance(shape, Ellipse):
        return r, np.zeros_like(theta)
    a2, b2 = shape.semi_axes[0] ** 2, shape.semi_axes[1] ** 2
    height = -r[:, 1]
    dr_x = -(a2 - b2) * ((cos**2 - sin**2) / height - (a2 - b2) * (sin * cos) ** 2 / height**3)
    return r, dr_x


class ArcModel:
    """The rows g of (1), (3) and (4) and their derivatives, for B hypotheses.

    Args:
        statistics: of the samples, B hypotheses of J impacts.
        vertices: (B, J) numbers of the touching vertices.
        h: time step, s.
        shape, gravity: of the body; m/s².
        modes: (B, J) modes under the contact law, or None for free impulses.
        use_gap: whether (3) is part of the likelihood.
    """

    def __init__(
        self,
        statistics: ArcStatistics,
        vertices: np.ndarray,
        h: float,
        shape: BodyShape,
        gravity: float,
        modes: np.ndarray | None = None,
        use_gap: bool = False,
    ):
        self.s, self.vertices, self.h, self.shape, self.gravity = statistics, vertices, h, shape, gravity
        self.modes, self.use_gap = modes, use_gap
        self.B, self.J = statistics.steps.shape
        # linear maps from u to what happens at each impact: position at k_j, velocity before it and after it
        self.time = h * statistics.steps.astype(float)
        delay = np.maximum(self.time[:, :, None] - self.time[:, None, :], 0.0)
        ones = np.ones((self.B, self.J, 1))
        self.at = np.concatenate([ones, self.time[:, :, None], delay], axis=2)  # (B, J, 2+J)
        own = np.broadcast_to(np.eye(self.J), (self.B, self.J, self.J))
        before = np.broadcast_to(np.tri(self.J, k=-1), (self.B, self.J, self.J))
        self.own = np.concatenate([0.0 * ones, 0.0 * ones, own], axis=2)
        self.before = np.concatenate([0.0 * ones, ones, before], axis=2)
        self.after = self.before + self.own

    def angles(self, u: np.ndarray) -> np.ndarray:
        """Angles (B, J) at the impacts."""
        return np.einsum("bji,bi->bj", self.at, u[:, 2])

    def rows(
        self, u: np.ndarray, eta: np.ndarray, way: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Rows g (B, n_g) at `u`, `eta`, G (B, n_g, 3, 2+J), G_η (B, n_g, 3), and the way h |v_n| (B, J) in (3).

        The rows are (1), then (3) if used, then (4) if a law is assumed: J each, restitution before friction.  With
        `way` given it is held at that, and both G are empty.
        """
        derivatives = way is None
        B, J = self.B, self.J
        theta = self.angles(u)
        r, dr_x = contact_offset(self.shape, theta.ravel(), self.vertices.ravel())
        r_x, r_y, dr_x = r[:, 0].reshape(B, J), r[:, 1].reshape(B, J), dr_x.reshape(B, J)
        dv_x, dv_y, d_omega = u[:, 0, 2:], u[:, 1, 2:], u[:, 2, 2:]
        ratio, epsilon, mu = eta.T[:, :, None]
        lever = r_x * dv_y - r_y * dv_x
        g, G, G_eta = [d_omega - ratio * lever], [], []

        def add(x: np.ndarray, y: np.ndarray, angle: np.ndarray, by_eta: dict[int, np.ndarray]) -> None:
            G.append(np.stack([x, y, angle], axis=2))
            column = np.zeros((B, J, 3))
            for i, value in by_eta.items():
                column[:, :, i] = value
            G_eta.append(column)

        at, own, zero = self.at, self.own, np.zeros_like(self.at)
        if derivatives:
            d_lever = dr_x * dv_y - r_x * dv_x
            add(
                (ratio * r_y)[:, :, None] * own,
                -(ratio * r_x)[:, :, None] * own,
                own - (ratio * d_lever)[:, :, None] * at,
                {0: -lever},
            )
        if self.use_gap or self.modes is not None:
            omega_before = np.einsum("bji,bi->bj", self.before, u[:, 2])
            omega_after = omega_before + d_omega
            v_y_before = np.einsum("bji,bi->bj", self.before, u[:, 1]) - self.gravity * self.time
            v_n_before = v_y_before + r_x * omega_before
        if self.use_gap:
            y = np.einsum("bji,bi->bj", at, u[:, 1]) - self.gravity * self.time * (self.time + self.h) / 2.0
            if derivatives:
                way = self.h * np.maximum(self.gravity * self.h - v_n_before, SPEED_FLOOR)
            g.append(np.sqrt(12.0) * ((y + r_y) / way - 0.5))
            if derivatives:
                scale = (np.sqrt(12.0) / way)[:, :, None]
                add(zero, scale * at, scale * r_x[:, :, None] * at, {})
        if self.modes is not None:
            v_y_after = v_y_before + dv_y - self.gravity * self.h
            g.append(v_y_after + r_x * omega_after + epsilon * v_n_before)
            v_t_after = np.einsum("bji,bi->bj", self.after, u[:, 0]) - r_y * omega_after
            slide = self.modes != STICK
            g.append(np.where(slide, dv_x - self.modes * mu * dv_y, v_t_after))
            if derivatives:
                both = self.after + epsilon[:, :, None] * self.before
                turn = dr_x * (omega_after + epsilon * omega_before)
                add(zero, both, r_x[:, :, None] * both + turn[:, :, None] * at, {1: v_n_before})
                stick_turn = -r_y[:, :, None] * self.after - (r_x * omega_after)[:, :, None] * at
                add(
                    np.where(slide[:, :, None], own, self.after),
                    np.where(slide[:, :, None], -(self.modes * mu)[:, :, None] * own, 0.0),
                    np.where(slide[:, :, None], 0.0, stick_turn),
                    {2: np.where(slide, -self.modes * dv_y, 0.0)},
                )
        g = np.concatenate(g, axis=1)
        if not derivatives:
            return g, np.empty((B, 0)), np.empty((B, 0)), way
        way = np.ones((B, J)) if way is None else way
        return g, np.concatenate(G, axis=1), np.concatenate(G_eta, axis=1), way

    @property
    def variance(self) -> np.ndarray:
        """Variance (n_g,) of the rows: 0 for equations, 1 for (3)."""
        blocks = [0.0] + [1.0] * self.use_gap + [0.0, 0.0] * (self.modes is not None)
        return np.repeat(blocks, self.J)

    def start(self) -> np.ndarray:
        """Start η (B, 3): m/I by least squares on (1), ε the median over the impacts, μ what |Δv_x| / Δv_y reaches."""
        u = self.s.u
        r, _ = contact_offset(self.shape, self.angles(u).ravel(), self.vertices.ravel())
        r_x, r_y = r[:, 0].reshape(self.B, self.J), r[:, 1].reshape(self.B, self.J)
        lever = r_x * u[:, 1, 2:] - r_y * u[:, 0, 2:]
        square = (lever**2).sum(axis=1)
        ratio = (lever * u[:, 2, 2:]).sum(axis=1) / np.where(square > 0, square, 1.0)
        v_n = np.einsum("bji,bi->bj", self.before, u[:, 1]) - self.gravity * self.time
        v_n = v_n + r_x * np.einsum("bji,bi->bj", self.before, u[:, 2])
        change = u[:, 1, 2:] + r_x * u[:, 2, 2:]
        epsilon = np.median(np.clip(-change / np.where(v_n < 0, v_n, -1.0) - 1.0, 0.0, 1.0), axis=1)
        mu = np.clip(np.abs(u[:, 0, 2:]) / np.maximum(u[:, 1, 2:], 0.1), 0.0, 2.0).max(axis=1)
        return np.stack([ratio, epsilon, mu], axis=1)


def fit_arcs(model: ArcModel, u: np.ndarray | None = None, eta: np.ndarray | None = None) -> ArcFit:
    """Solve (2) for every hypothesis of `model`, from the free arcs or from `u` (B, 3, 2+J) and `eta` (B, 3).

    Fits that do not converge within `MAX_ITERATIONS` are returned as they are, with `converged` false.
    """
    s = model.s
    u = s.u.copy() if u is None else u.copy()
    eta = model.start() if eta is None else eta.copy()
    variance = model.variance
    P = np.linalg.inv(s.N)
    converged = np.zeros(model.B, dtype=bool)
    for _ in range(MAX_ITERATIONS):
        g, G, G_eta, way = model.rows(u, eta)
        S, PG = _spread_of_rows(P, G, variance)
        # least (du - e)'N(du - e) on the linearised rows: λ = S⁻¹ (g + G e + G_η dη), du = e - P G' λ
        e = s.u - u
        w = g + np.einsum("bgci,bci->bg", G, e)
        solved = np.linalg.solve(S, np.concatenate([w[:, :, None], G_eta], axis=2))
        information = _information(G_eta, solved[:, :, 1:])
        d_eta = -np.linalg.solve(information, np.einsum("bge,bg->be", G_eta, solved[:, :, 0])[..., None])[
            ..., 0
        ]
        multiplier = solved[:, :, 0] + np.einsum("bge,be->bg", solved[:, :, 1:], d_eta)
        du = e - np.einsum("bcig,bg->bci", PG, multiplier)
        size = np.sqrt(np.einsum("bcij,bcj->bci", s.root, du) ** 2).max(axis=(1, 2))
        fraction = _line_search(model, u, eta, way, du, d_eta, multiplier)
        move = np.where(converged, 0.0, fraction)
        u = u + move[:, None, None] * du
        eta = eta + move[:, None] * d_eta
        converged |= size < CONVERGED
        if converged.all():
            break
    g, G, G_eta, way = model.rows(u, eta)
    S, _ = _spread_of_rows(P, G, variance)
    information = _information(G_eta, np.linalg.solve(S, G_eta))
    known = np.einsum("bee->be", information) > 2.0 * _SOFT_PRIOR
    std = np.where(known, np.sqrt(np.abs(np.einsum("bee->be", np.linalg.inv(information)))), np.inf)
    soft = variance > 0
    misfit = (np.einsum("bcij,bcj->bci", s.root, u - s.u) ** 2).sum(axis=(1, 2)) + (g[:, soft] ** 2).sum(
        axis=1
    )
    dof = g.shape[1] - known.sum(axis=1)
    return ArcFit(u, eta, misfit + s.chi2_free + 2.0 * np.log(way).sum(axis=1), misfit, dof, std, converged)


def _spread_of_rows(P: np.ndarray, G: np.ndarray, variance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """S (B, n_g, n_g) and N⁻¹ G' (B, 3, 2+J, n_g)."""
    PG = np.einsum("bcij,bgcj->bcig", P, G)
    S = np.einsum("bgci,bcih->bgh", G, PG)
    n = np.arange(S.shape[1])
    S[:, n, n] += variance + 1e-13 * S[:, n, n]
    return S, PG


def _information(G_eta: np.ndarray, solved: np.ndarray) -> np.ndarray:
    information = np.einsum("bge,bgf->bef", G_eta, solved)
    n = np.arange(information.shape[1])
    information[:, n, n] += _SOFT_PRIOR
    return information


def _line_search(model, u, eta, way, du, d_eta, multiplier) -> np.ndarray:
    """Fraction (B,) of the Newton step with the least exact-penalty merit ½ χ² + Σ 2 |λ g| (½ g² for soft rows)."""
    soft = model.variance > 0
    merits = []
    for fraction in _BACKTRACK:
        trial = u + fraction * du
        g = model.rows(trial, eta + fraction * d_eta, way)[0]
        chi2 = (np.einsum("bcij,bcj->bci", model.s.root, trial - model.s.u) ** 2).sum(axis=(1, 2))
        penalty = np.where(soft, 0.5 * g**2, 2.0 * np.abs(multiplier * g)).sum(axis=1)
        merits.append(0.5 * chi2 + penalty)
    merits = np.array(merits)
    best = np.argmin(np.where(np.isfinite(merits), merits, np.inf), axis=0)
    return np.array(_BACKTRACK)[best]
