"""A patch of another surface: between two places restitution, friction and contact time differ.

    ε ← clip(ε (1 + h_ε P), 0, 1),   μ ← max(μ (1 + h_μ P), 0),   τ ← max(τ (1 + h_τ P), 0)
    P(x_c) = cosh²((x_2 − x_1) / 2w) / (cosh((x_c − x_1) / w) cosh((x_c − x_2) / w))

P is 1 in the middle and 0 far outside, with edges like ½ (1 + tanh) of width w; the order of the edges does not matter.
If w is below the distance between the edges, the patch is flat (tape, an inlaid plate); if w is above it, P is a smooth
bump (a dent, a worn place).  If one edge lies beyond all impacts, P is a step from one material to another; the place
of that edge is then unknown.

| on paper      | in code                  | unit | shape | meaning                                                   |
|---------------|--------------------------|------|-------|-----------------------------------------------------------|
| h_ε, h_μ, h_τ | `h_eps`, `h_mu`, `h_tau` | 1    |       | relative change within the patch, of ε, μ, τ              |
| x_1, x_2      | `x_1`, `x_2`             | m    |       | edges along the surface, from the reference               |
| w             | `w`                      | m    |       | half-width of an edge                                     |
| P             |                          | 1    | (n,)  | weight of the patch in an impact                          |

Breaks mirror symmetry.  For a linear change along the surface see `position_dependent_restitution` and
`position_dependent_friction`.
"""

import numpy as np

from thesis_lib.effects.contact_place import along_surface
from thesis_lib.effects.effect import Effect, Parameter

PARTS = 6  # equal groups of impacts, ordered by place; the starting patches of a fit end between groups


class SurfacePatch(Effect):
    name = "surface_patch"
    family = "surface"
    title = "a patch of another surface"
    equation = "ε = ε₀ (1 + h_ε P), μ = μ₀ (1 + h_μ P), τ = τ₀ (1 + h_τ P), P(x_c) between x_1 and x_2"
    parameters = (
        Parameter("h_eps", "1", null=0.0, low=-1.0, high=3.0, scale=0.1),
        Parameter("h_mu", "1", null=0.0, low=-1.0, high=10.0, scale=0.2),
        Parameter("h_tau", "1", null=0.0, low=-1.0, high=10.0, scale=0.5),
        Parameter("x_1", "m", null=0.05, low=-10.0, high=10.0, scale=0.02, along="x", open_end=True),
        Parameter("x_2", "m", null=0.15, low=-10.0, high=10.0, scale=0.02, along="x", open_end=True),
        Parameter("w", "m", null=0.02, low=2e-3, high=0.1, scale=0.01, open_end=True),
    )
    channels = ("impact", "touch")
    needs_one_surface = True
    reference = "Yu, Bauza, Fazeli and Rodriguez 2016 (friction by place), doi:10.1109/IROS.2016.7758091"
    breaks_mirror = True
    along = ("x",)

    def shapes(self, state, rig):
        x = along_surface(state, rig)
        edges = np.quantile(x, np.linspace(0.0, 1.0, PARTS + 1))
        span = edges[-1] - edges[0]
        edges[0], edges[-1] = edges[0] - span, edges[-1] + span
        low, high = self.parameters[-1].low, self.parameters[-1].high
        found = []
        # at most half of the parts: a larger patch is equivalent to the rest with the opposite change
        for parts in range(1, PARTS // 2 + 1):
            for i in range(PARTS + 1 - parts):
                x_1, x_2 = edges[i], edges[i + parts]
                inner = min(x_2 - x_1, span / PARTS)
                found.append({"x_1": float(x_1), "x_2": float(x_2), "w": float(np.clip(inner / 4.0, low, high))})
        return found

    def coefficients(self, mu, epsilon, contact, state, p, rig):
        patch = _patch(state, p, rig)
        epsilon = np.clip(epsilon * (1.0 + p["h_eps"] * patch), 0.0, 1.0)
        return np.maximum(mu * (1.0 + p["h_mu"] * patch), 0.0), epsilon

    def contact_time(self, tau, contact, state, p, rig):
        return np.maximum(tau * (1.0 + p["h_tau"] * _patch(state, p, rig)), 0.0)


def _patch(state, p, rig) -> np.ndarray:
    """Weight P (n,) of the patch."""
    x, w = along_surface(state, rig), p["w"]
    outside = _log_cosh((x - p["x_1"]) / w) + _log_cosh((x - p["x_2"]) / w)
    return np.exp(2.0 * _log_cosh((p["x_2"] - p["x_1"]) / (2.0 * w)) - outside)


def _log_cosh(z: np.ndarray | float) -> np.ndarray:
    return np.abs(z) + np.log1p(np.exp(-2.0 * np.abs(z))) - np.log(2.0)


EFFECT = SurfacePatch()
