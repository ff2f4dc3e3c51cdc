"""A puck among cushions and another one, over minutes, as a camera with irregular stamps sees it; with the true hits.

It slides with a constant deceleration until it stops, hits the cushions (restitution ε, friction μ against the slip of
the rim, a disk of one density) and the other puck (restitution, no friction), and stands until somebody strikes it.
All of it is known in closed form between events.  Nothing of thesis_lib is used but the header.
"""

from dataclasses import dataclass

import numpy as np

from thesis_lib.datasets.format.header import Header

LOOK = 2e-3  # s, steps in which the pucks are looked at for a collision, before bisection
REST = 1.0  # s, mean time for which all stands still


@dataclass(frozen=True)
class Rig:
    """The table and what happens on it; m, s."""

    rate: float
    length: float = 1.2
    width: float = 0.8
    radius: float = 0.04
    friction: float = 0.25  # m/s², deceleration
    epsilon: float = 0.75
    mu: float = 0.1
    speeds: tuple[float, float] = (0.8, 2.5)
    noise: float = 3e-4
    jitter: float = 0.2  # of the steps, relative to the mean one
    lost: float = 0.03
    other: bool = True  # another puck, of the same mass


@dataclass(frozen=True)
class Rolled:
    """Samples t (N,), xy (N, 2), and events: times, kind ("wall", "puck", "strike"), v before and after (n, 2)."""

    header: Header
    t: np.ndarray
    xy: np.ndarray
    hit_t: np.ndarray
    kind: np.ndarray
    v_pre: np.ndarray
    v_post: np.ndarray

    @property
    def room(self) -> np.ndarray:
        """Samples (n, 2) between each event and the one before and after it."""
        at = np.r_[0, np.searchsorted(self.t, self.hit_t), len(self.t)]
        between = np.diff(at)
        return np.stack([between[:-1], between[1:]], axis=1)

    @property
    def roomy(self) -> np.ndarray:
        """Mask (n,) of the hits of a cushion with four samples on either side."""
        return (self.kind == "wall") & (self.room >= 4).all(axis=1)


def table_header(rig: Rig, **changes: object) -> Header:
    a, b = rig.length / 2.0, rig.width / 2.0
    walls = {
        "south": ([0, -b], [0, 1]),
        "north": ([0, b], [0, -1]),
        "west": ([-a, 0], [1, 0]),
        "east": ([a, 0], [-1, 0]),
    }
    surfaces = [{"name": name, "point": point, "normal": normal} for name, (point, normal) in walls.items()]
    body = {"shape": {"kind": "disk", "radius": rig.radius}, "radius_of_gyration": rig.radius / np.sqrt(2.0)}
    base = {"schema": 1, "body": body, "surfaces": surfaces, "gravity": 0.0}
    return Header.model_validate(base | changes)


def stamps(rig: Rig, duration: float, rng: np.random.Generator) -> np.ndarray:
    """Times in s of irregular pictures, without the lost ones."""
    n = int(duration * rig.rate)
    step = np.clip(1.0 + rig.jitter * rng.standard_normal(n), 0.2, None) / rig.rate
    return np.cumsum(step)[rng.random(n) >= rig.lost]


def roll(rig: Rig, duration: float, rng: np.random.Generator) -> Rolled:
    """A recording of `duration` s."""
    t = stamps(rig, duration, rng)
    half = np.array([rig.length, rig.width]) / 2.0 - rig.radius
    q = np.array([[-0.2, 0.05], [0.25, -0.1]]) if rig.other else np.array([[-0.2, 0.05]])
    v, spin, now = np.zeros_like(q), np.zeros(len(q)), 0.0
    xy, events = np.zeros((len(t), 2)), []
    while now < duration:
        speed = np.hypot(*v.T)
        unit = v / np.maximum(speed, 1e-12)[:, None]
        stop = speed / rig.friction

        def way(s: np.ndarray) -> np.ndarray:
            """Path (pucks, len(s)) in m after `s` seconds."""
            on = np.minimum(s, stop[:, None])  # noqa: B023
            return speed[:, None] * on - 0.5 * rig.friction * on**2  # noqa: B023

        def at(s: np.ndarray) -> np.ndarray:
            return q[:, None] + way(s)[..., None] * unit[:, None]  # noqa: B023

        last = float(stop.max())
        if last <= 0.0:  # all stands: somebody strikes one of them after a while
            wait, which = rng.exponential(REST), int(rng.integers(len(q)))
            inside = (t >= now) & (t < now + wait)
            xy[inside] = q[0]
            now += wait
            before = v[0].copy()
            angle, hard = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(*rig.speeds)
            v[which] = hard * np.array([np.cos(angle), np.sin(angle)])
            spin[which] = 0.2 * hard / rig.radius * rng.standard_normal()
            if which == 0:
                events.append((now, "strike", before, v[0].copy()))
            continue
        first, what = last, ("stop", 0, 0)
        for i in range(len(q)):
            for axis in (0, 1):
                if abs(v[i, axis]) < 1e-12:
                    continue
                far = (np.sign(v[i, axis]) * half[axis] - q[i, axis]) / unit[i, axis]
                root = speed[i] ** 2 - 2.0 * rig.friction * max(far, 0.0)
                if root > 0.0 and (when := (speed[i] - np.sqrt(root)) / rig.friction) < first:
                    first, what = when, ("wall", i, axis)
        if len(q) == 2:
            s = np.arange(0.0, first + LOOK, LOOK)

            def apart(s: np.ndarray) -> np.ndarray:
                p = at(s)
                return np.hypot(*(p[1] - p[0]).T) - 2.0 * rig.radius

            d = apart(s)
            touch = np.flatnonzero((d[1:] < 0.0) & (d[1:] < d[:-1]))
            if len(touch):
                low, high = s[touch[0]], s[touch[0] + 1]
                for _ in range(40):
                    middle = 0.5 * (low + high)
                    low, high = (low, middle) if apart(np.array([middle]))[0] < 0.0 else (middle, high)
                if low < first:
                    first, what = low, ("puck", 0, 0)
        inside = (t >= now) & (t < now + first)
        xy[inside] = at(t[inside] - now)[0]
        q = at(np.array([first]))[:, 0]
        v = np.maximum(speed - rig.friction * first, 0.0)[:, None] * unit
        now += first
        before = v[0].copy()
        if what[0] == "wall":
            _, i, axis = what
            out = np.sign(v[i, axis])
            normal = np.zeros(2)
            normal[axis] = -out
            tangent = np.array([normal[1], -normal[0]])
            v_n, v_t = v[i] @ normal, v[i] @ tangent
            slip = v_t + rig.radius * spin[i]
            # K_tt = 1 + R²/k² = 3 of a disk of one density
            p_t = -np.clip(slip / 3.0, -rig.mu * (1 + rig.epsilon) * -v_n, rig.mu * (1 + rig.epsilon) * -v_n)
            v[i] = -rig.epsilon * v_n * normal + (v_t + p_t) * tangent
            spin[i] += 2.0 * p_t / rig.radius
        elif what[0] == "puck":
            axis = (q[1] - q[0]) / np.hypot(*(q[1] - q[0]))
            p = 0.5 * 1.9 * ((v[0] - v[1]) @ axis) * axis
            v[0], v[1] = v[0] - p, v[1] + p
        if what[0] != "stop" and (v[0] != before).any():
            events.append((now, what[0], before, v[0].copy()))
    seen = xy + rig.noise * rng.standard_normal(xy.shape)
    events = [event for event in events if event[0] < t[-1]]
    hit_t, kind, pre, post = (np.array(column) for column in zip(*events))
    return Rolled(table_header(rig), t, seen, hit_t, kind, pre, post)
