"""Lens: radial distortion, which makes an image too large or too small towards its edge.

With d = x − c from the centre c of the image and r = |d|:

    pose        x_measured = c + (1 + k₁ r²) d             k₁ < 0: barrel, k₁ > 0: pincushion; exact by definition
    velocity    v_measured = (1 + k₁ r²) v + 2 k₁ (d·v) d
    flight      the second derivative of the pose along the true flight: parabolas are reported as other curves
    inverse     r from r_measured = r + k₁ r³, by Newton's method

θ and ω are correct: the map has no rotation anywhere (it is a gradient), so the mean rotation of markers all around the
body is zero.

In space the camera looks along z of the recording: d and r belong to the tracked point in x and y of the recording; its
z is correct, and so are attitude and spin.

| on paper | in code      | unit | shape |                                                                        |
|----------|--------------|------|-------|------------------------------------------------------------------------|
| k₁       | `k_1`        | 1/m² |       | 0.16 is 1 % at 0.25 m from the centre                                  |
| c        | `c_x`, `c_y` | m    |       | centre of the image, from `rig.reference.x` and from the surface       |
|          | `c_u`, `c_v` | m    |       | in space: along x and y of the recording, from the reference place     |

For k₁ < 0 the map would fold the image near r² = −1/(3 k₁); from a slope of 1/4 on, before the fold, it is continued
linearly in r.  If k₁ = 0, the centre is undefined.  Breaks mirror symmetry.
"""

import numpy as np

from thesis_lib.effects.effect import IN_SPACE, Effect, Parameter, components, vector

NEWTON = 8  # maximum number of steps: the true radius is exact to rounding, at the least slope to a relative 1e-6
SETTLED = 1e-7  # m: after a step below this size the next is below rounding
LEAST = 0.25  # least slope of the map along the radius
ASIDE, ABOVE = (-0.2, 0.0, 0.2), (0.05, 0.25, 0.45)  # m: centres from which a fit may start
_STRENGTH = Parameter("k_1", "1/m²", null=0.0, low=-1.5, high=5.0, scale=0.1)
_CENTRE = ("c_u", "c_v")


class Lens(Effect):
    name = "lens"
    family = "measurement"
    title = "lens distortion"
    equation = "x_measured = c + (1 + k₁ |x − c|²) (x − c)"
    equation_in_space = "u_measured = c + (1 + k₁ |u − c|²) (u − c), u = (x, y) of the recording"
    parameters = (
        _STRENGTH,
        Parameter("c_x", "m", null=0.0, low=-1.0, high=1.0, scale=0.1, along="x"),
        Parameter("c_y", "m", null=0.2, low=-1.0, high=2.0, scale=0.1),
    )
    own_in_space = (_STRENGTH, *components(Parameter("c", "m", null=0.0, low=-2.0, high=2.0, scale=0.1), _CENTRE))
    channels = ("impact", "touch", "flight")
    needs_one_surface = True
    reference = "Brown 1971 (close-range camera calibration), Photogrammetric Engineering 37, 855–866"
    breaks_mirror = True
    includes = ("surface_height",)  # nearly, at the height of contacts, if its centre is far above
    bends = True
    along = ("x",)
    rank = 50
    dimensions = IN_SPACE

    def shapes(self, state, rig):
        if not state.space.is_plane:
            return [{"c_u": u, "c_v": v} for u in ASIDE for v in ASIDE]
        return [{"c_x": x, "c_y": y} for x in ASIDE for y in ABOVE]

    def to_true(self, state, p, rig):
        d = _from_centre(state, p, rig)
        measured = np.hypot(*d)
        r = measured / np.cbrt(1.0 + np.maximum(p["k_1"], 0.0) * measured**2)
        for _ in range(NEWTON):
            more, bent = _stretch(r, p["k_1"])
            step = (measured - (1.0 + more) * r) / (1.0 + more + bent * r * r)
            r = r + step
            if np.abs(step).max(initial=0.0) < SETTLED:
                break
        more, bent = _stretch(r, p["k_1"])
        less, straight = -more / (1.0 + more), -bent / ((1.0 + more) * (1.0 + more + bent * r * r))
        return _moved(state, d, (1.0 + less) * d, less, straight, rig)

    def to_measured(self, state, p, rig):
        d = _from_centre(state, p, rig)
        return _moved(state, d, d, *_stretch(np.hypot(*d), p["k_1"]), rig)


def _from_centre(state, p, rig):
    """Vector d (2, n) from the centre of the image."""
    if not state.space.is_plane:
        about = np.array([[rig.reference.x], [rig.reference.y], [rig.height]])
        return _picture(rig).T @ (state.position + rig.lever(state) - about) - vector(p, _CENTRE)
    return np.stack([state.x - rig.reference.x - p["c_x"], state.y - rig.height - p["c_y"]])


def _picture(rig):
    """In space: axes x and y of the recording, (3, 2) in the axes of the surface."""
    return rig.from_recording(np.eye(3)[:, :2])


def _stretch(r, k_1):
    """Stretch r_m/r − 1 and (dr_m/dr − r_m/r) / r² at true radii r: k₁ r² and 2 k₁, unless the image would fold."""
    bound = np.sqrt((1.0 - LEAST) / (3.0 * np.maximum(-k_1, 1e-12)))
    inside = np.minimum(r, bound)
    share = np.divide(inside, r, out=np.ones_like(r), where=r > bound)
    more = share * (1.0 - LEAST + k_1 * inside**2) - (1.0 - LEAST)
    return more, np.divide(3.0 * k_1 * inside**2 - more, r * r, out=np.zeros_like(r), where=r > 0.0)


def _moved(state, seen, d, more, bent, rig):
    """State with position and velocity times 1 + `more`, from `seen`, plus `bent` (d·v) d to the velocity, d true."""
    if not state.space.is_plane:
        axes = _picture(rig)
        v = axes.T @ state.space.velocity_at(state.velocity, state.spin, rig.lever(state))
        faster = more * v + bent * (d * v).sum(axis=0) * d
        return state.changed(state.position + axes @ (more * seen), velocity=state.velocity + axes @ faster)
    v = state.velocity
    faster = v + more * v + bent * (d * v).sum(axis=0) * d
    return state.changed(state.position + more * seen, velocity=faster)


EFFECT = Lens()
