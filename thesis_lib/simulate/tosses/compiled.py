"""Tosses of a rigid body whose contact points are balls, over a plane, compiled: flight, and springs and dampers.

numba compiles this file at the first call, within seconds, and caches the result beside it.  All compiled functions
must be in this file, since numba does not notice changes of functions in other files.  No code is shared with the
contacts of the critique (`contact`): these tosses are the ground truth by which the critique is judged.

The force on a ball at depth δ with rate δ̇ is max(0, k δ + d δ̇) along the normal, separately for each ball.  d follows
from the restitution at the touch.  After the normal forces of a time step, friction and couples stop the slip and the
rotation at a contact within the limits

    |f_t|² / μ² + τ_n² / m_t²  ≤  f_n²,     |τ_t|  ≤  m_r f_n;

at the limits they dissipate as much energy as possible.  Anisotropic friction has the limit |M⁻¹ f_t| ≤ f_n.  A step is
half a drift, a kick, and half a drift; its length is `FLIGHT` if no ball can touch within it.  In the step of a touch
the ball is pushed only from the touch on; otherwise the rebound would depend on the instant of the touch within the
step, by 0.15 % of the speed with 400 steps per contact.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

FLIGHT = 2e-4  # s, time step in flight
SLOWEST = 1e-9  # m/s and rad/s, smallest speed that counts as motion
RESTING, RESTS = 1e-3, 0.03  # m/s and s: a body that is slower for this long has come to rest

compiled = njit(cache=True, error_model="numpy")


class OnBalls(NamedTuple):
    """A body with its contact and hidden causes, in SI units; vectors are in the axes of `world`."""

    balls: np.ndarray  # (k, 3) from the true centre of mass
    radius: float
    mass: float
    tensor: np.ndarray  # (3, 3)
    inverse: np.ndarray  # inverse of the tensor
    easiest: float  # largest eigenvalue of the inverse
    gravity: np.ndarray
    height: float
    mu: float
    epsilon: float
    stiffness: float
    dt: float  # time step in contact
    drag: tuple[float, float]  # linear, quadratic
    magnus: float
    spin_damping: float
    lever: float  # m_r
    spinning: float  # m_t
    restitution_by_speed: float
    friction_by_speed: tuple[float, float]
    restitution_by_place: np.ndarray
    friction_by_place: np.ndarray
    restitution_by_face: np.ndarray
    friction_by_face: np.ndarray
    later: tuple[float, float]  # relative changes of restitution and friction in later hits
    sliding: float  # change of friction while the body is supported
    bowl: tuple[float, float, float]  # curvature of the surface, x and y of its lowest point
    ellipse: tuple[float, float]  # anisotropy of friction: a_c, a_s
    moving: tuple[float, float]  # velocity of the surface
    time_by_place: np.ndarray
    time_by_face: np.ndarray
    times: tuple[float, float, float]  # `LATER`, `SUPPORTED`, and `HIT` in m/s


@compiled
def _matrix(q):
    """Rotation matrix R, by rows (9,), of a unit quaternion."""
    w, x, y, z = q
    return (
        *(1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
        *(2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
        *(2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
    )


@compiled
def _rotated(R, x, y, z):
    return (R[0] * x + R[1] * y + R[2] * z, R[3] * x + R[4] * y + R[5] * z, R[6] * x + R[7] * y + R[8] * z)


@compiled
def _spin(world, R, L):
    """ω = R I⁻¹ Rᵀ L."""
    x = R[0] * L[0] + R[3] * L[1] + R[6] * L[2]
    y = R[1] * L[0] + R[4] * L[1] + R[7] * L[2]
    z = R[2] * L[0] + R[5] * L[1] + R[8] * L[2]
    I = world.inverse
    return _rotated(
        R,
        I[0, 0] * x + I[0, 1] * y + I[0, 2] * z,
        I[1, 0] * x + I[1, 1] * y + I[1, 2] * z,
        I[2, 0] * x + I[2, 1] * y + I[2, 2] * z,
    )


@compiled
def _turned(q, spin, h):
    """Attitude after a rotation with constant spin for h."""
    rate = np.sqrt(spin[0] ** 2 + spin[1] ** 2 + spin[2] ** 2)
    half = 0.5 * h * rate
    share = 0.5 * h if half < 1e-6 else np.sin(half) / rate
    c, x, y, z = np.cos(half), share * spin[0], share * spin[1], share * spin[2]
    w, a, b, d = q
    w, a, b, d = (
        c * w - x * a - y * b - z * d,
        c * a + x * w + y * d - z * b,
        c * b + y * w + z * a - x * d,
        c * d + z * w + x * b - y * a,
    )
    length = np.sqrt(w * w + a * a + b * b + d * d)
    return w / length, a / length, b / length, d / length


@compiled
def _attitude(world, q, L, h):
    """Attitude after h at constant angular momentum, by the spin in the middle of the step."""
    middle = _turned(q, _spin(world, _matrix(q), L), 0.5 * h)
    return _turned(q, _spin(world, _matrix(middle), L), h)


@compiled
def _flight(world, v, spin):
    """Force (3,) of gravity and air in N."""
    (x, y, z), (a, b, c), g, lift = v, spin, world.gravity, world.magnus
    drag = world.drag[0] + world.drag[1] * np.sqrt(x * x + y * y + z * z)
    return (
        world.mass * (g[0] - drag * x + lift * (b * z - c * y)),
        world.mass * (g[1] - drag * y + lift * (c * x - a * z)),
        world.mass * (g[2] - drag * z + lift * (a * y - b * x)),
    )


@compiled
def _along(by_face, R):
    """Product a · u of a vector a in axes of the body and the direction u to the surface."""
    return -(by_face[0] * R[6] + by_face[1] * R[7] + by_face[2] * R[8])


@compiled
def _damping(epsilon):
    """Damping ratio ζ of a spring and damper, without pull, for restitution ε (Schwager and Pöschel 2007)."""
    low, high = 0.0, 20.0
    for _ in range(60):
        z = 0.5 * (low + high)
        if z < 1.0 - 1e-9:
            time = 2.0 * np.arccos(z) / np.sqrt(1.0 - z * z)
        elif z > 1.0 + 1e-9:
            time = 2.0 * np.arccosh(z) / np.sqrt(z * z - 1.0)
        else:
            time = 2.0
        if np.exp(-z * time) > epsilon:
            low = z
        else:
            high = z
    return 0.5 * (low + high)


@compiled
def _slope(world, x, y):
    """Slope (2,) of the surface at a place, and its height in m above its lowest point."""
    curvature, x_0, y_0 = world.bowl
    return curvature * (x - x_0), curvature * (y - y_0), 0.5 * curvature * ((x - x_0) ** 2 + (y - y_0) ** 2)


@compiled
def _lands(world, R, x, y, speed, later):
    """Stiffness in N/m, damping in N s/m and friction of a ball that touches at the place x, y at `speed` in m/s."""
    epsilon = world.epsilon * np.exp(-world.restitution_by_speed * speed)
    epsilon *= 1.0 + world.restitution_by_place[0] * x + world.restitution_by_place[1] * y
    epsilon *= 1.0 + _along(world.restitution_by_face, R)
    mu = world.mu * (1.0 + world.friction_by_place[0] * x + world.friction_by_place[1] * y)
    mu *= 1.0 + _along(world.friction_by_face, R)
    if later:
        epsilon, mu = epsilon * (1.0 + world.later[0]), mu * (1.0 + world.later[1])
    ratio = _damping(min(max(epsilon, 0.02), 0.98))
    spring = world.stiffness * max(1.0 - 2.0 * (world.time_by_place[0] * x + world.time_by_place[1] * y), 0.1)
    spring *= np.exp(-2.0 * _along(world.time_by_face, R))
    return spring, 2.0 * ratio * np.sqrt(spring * world.mass), max(mu, 0.0)


@compiled
def _mobility(world, R, r):
    """Largest velocity change of the point r along the surface due to a unit impulse along the surface, in 1/kg."""
    w, u = _spin(world, R, (0.0, r[2], -r[1])), _spin(world, R, (-r[2], 0.0, r[0]))
    a, b = 1.0 / world.mass + w[1] * r[2] - w[2] * r[1], w[2] * r[0] - w[0] * r[2]
    c = 1.0 / world.mass + u[2] * r[0] - u[0] * r[2]
    return 0.5 * (a + c) + np.sqrt(0.25 * (a - c) ** 2 + b * b)


@compiled
def _in_ellipse(ellipse, s_x, s_y, push, mu, loosest):
    """Like `_friction`, with the limit |M⁻¹ f| ≤ f_n, M = μ (1 + [[a_c, a_s], [a_s, −a_c]]), and no couple."""
    a, b, c = mu * (1.0 + ellipse[0]), mu * ellipse[1], mu * (1.0 - ellipse[0])
    f_x, f_y = -s_x / loosest, -s_y / loosest
    x, y = (c * f_x - b * f_y) / (a * c - b * b), (a * f_y - b * f_x) / (a * c - b * b)
    if x * x + y * y <= push * push:
        return f_x, f_y, 0.0
    x, y = a * s_x + b * s_y, b * s_x + c * s_y
    size = np.sqrt(x * x + y * y) / push + SLOWEST
    return -(a * x + b * y) / size, -(b * x + c * y) / size, 0.0


@compiled
def _friction(world, s_x, s_y, turning, push, mu, loosest, easiest):
    """Friction force (2,) in N and couple in N m about the normal; `loosest`, `easiest`: mobilities times the step."""
    slip = np.sqrt(s_x * s_x + s_y * s_y)
    if world.friction_by_speed[0] != 0.0:
        mu *= 1.0 + world.friction_by_speed[0] * np.exp(-((slip / world.friction_by_speed[1]) ** 2))
    if world.ellipse[0] != 0.0 or world.ellipse[1] != 0.0:
        return _in_ellipse(world.ellipse, s_x, s_y, push, mu, loosest)
    limit, m_t = mu * push, world.spinning
    if m_t == 0.0:
        force = min(slip / loosest, limit) / max(slip, SLOWEST)
        return -force * s_x, -force * s_y, 0.0
    f_x, f_y, couple = -s_x / loosest, -s_y / loosest, -turning / easiest
    if (f_x * f_x + f_y * f_y) * m_t * m_t + (couple * mu) ** 2 > (limit * m_t) ** 2:
        size = np.sqrt((mu * slip) ** 2 + (m_t * turning) ** 2) / push + SLOWEST
        f_x, f_y, couple = -mu * mu * s_x / size, -mu * mu * s_y / size, -m_t * m_t * turning / size
    return f_x, f_y, couple


@compiled
def toss(world, place, attitude, velocity, spinning, times, poses):
    """Write poses (k, 7) of the centre of mass at rising times (k,) in s, from its state (3,), (4,), (3,), (3,)."""
    points = len(world.balls)
    spring, damper, mu, touching = np.zeros(points), np.zeros(points), np.zeros(points), np.zeros(points, np.bool_)
    r, pushes, normal = np.empty((points, 3)), np.empty(points), np.empty((points, 3))
    reach = world.radius
    for k in range(points):
        reach = max(reach, np.sqrt((world.balls[k] ** 2).sum()) + world.radius)
    x, y, z = place
    v_x, v_y, v_z = velocity
    q = (attitude[0], attitude[1], attitude[2], attitude[3])
    R = _matrix(q)
    I, (a, b, c) = world.tensor, spinning
    a, b, c = R[0] * a + R[3] * b + R[6] * c, R[1] * a + R[4] * b + R[7] * c, R[2] * a + R[5] * b + R[8] * c
    L = _rotated(
        R,
        I[0, 0] * a + I[0, 1] * b + I[0, 2] * c,
        I[1, 0] * a + I[1, 1] * b + I[1, 2] * c,
        I[2, 0] * a + I[2, 1] * b + I[2, 2] * c,
    )
    t, first, hit, moved, row = 0.0, -1.0, -1.0, 0.0, 0
    while True:
        while row < len(times) and times[row] <= t + 1e-12:
            poses[row, 0], poses[row, 1], poses[row, 2] = x, y, z
            for i in range(4):
                poses[row, 3 + i] = q[i]
            row += 1
        if row == len(times):
            return
        R = _matrix(q)
        spin = _spin(world, R, L)
        turning = np.sqrt(spin[0] ** 2 + spin[1] ** 2 + spin[2] ** 2)
        if v_x * v_x + v_y * v_y + v_z * v_z + (reach * turning) ** 2 > RESTING**2:
            moved = t
        elif t - moved > RESTS:  # the body has come to rest and keeps its pose
            t = times[-1]
            continue
        lowest = np.inf
        for k in range(points):
            b = world.balls[k]
            lowest = min(lowest, R[6] * b[0] + R[7] * b[1] + R[8] * b[2])
        # a step in contact is needed if a ball may reach the surface within a flight step
        nearer = FLIGHT * (max(-v_z, 0.0) + reach * turning + 0.02)
        aside = np.sqrt((x - world.bowl[1]) ** 2 + (y - world.bowl[2]) ** 2) + reach
        highest = world.height + 0.5 * max(world.bowl[0], 0.0) * aside**2
        near = z + lowest - world.radius - highest < nearer
        h = min(world.dt if near else FLIGHT, times[row] - t)
        x, y, z = x + 0.5 * h * v_x, y + 0.5 * h * v_y, z + 0.5 * h * v_z
        q = _attitude(world, q, L, 0.5 * h)
        R = _matrix(q)
        spin = _spin(world, R, L)
        f_x, f_y, f_z = _flight(world, (v_x, v_y, v_z), spin)
        n_x, n_y, n_z = -world.spin_damping * L[0], -world.spin_damping * L[1], -world.spin_damping * L[2]
        pressing = 0
        for k in range(points if near else 0):
            b = world.balls[k]
            r[k, 0], r[k, 1], r[k, 2] = _rotated(R, b[0], b[1], b[2])
            p_x, p_y, _ = _slope(world, x + r[k, 0], y + r[k, 1])
            wider = 1.0 - world.bowl[0] * world.radius  # the normal at the contact passes through the ball's centre
            p_x, p_y = p_x / wider, p_y / wider
            steep = np.sqrt(1.0 + p_x * p_x + p_y * p_y)
            u_x, u_y, u_z = -p_x / steep, -p_y / steep, 1.0 / steep
            normal[k, 0], normal[k, 1], normal[k, 2] = u_x, u_y, u_z
            r[k, 0], r[k, 1] = r[k, 0] - world.radius * u_x, r[k, 1] - world.radius * u_y
            r[k, 2] -= world.radius * u_z
            _, _, over = _slope(world, x + r[k, 0], y + r[k, 1])
            depth = (world.height + over - z - r[k, 2]) * u_z
            rate = -(v_z + spin[0] * r[k, 1] - spin[1] * r[k, 0]) * u_z
            rate -= (v_x + spin[1] * r[k, 2] - spin[2] * r[k, 1]) * u_x
            rate -= (v_y + spin[2] * r[k, 0] - spin[0] * r[k, 2]) * u_y
            share = 1.0  # part of the step during which the ball touches
            if not touching[k]:
                if rate > SLOWEST:
                    share = min(0.5 + depth / (rate * h), 1.0)
                elif depth <= 0.0:
                    share = 0.0
                if share > 0.0:
                    touching[k] = True
                    first = t if first < 0.0 else first
                    hit = t if rate > world.times[2] else hit
                    later = t - first > world.times[0]
                    spring[k], damper[k], mu[k] = _lands(world, R, x + r[k, 0], y + r[k, 1], rate, later)
                    depth = 0.5 * share * h * rate if share < 1.0 else depth
            elif depth <= 0.0:
                touching[k] = False
            pushes[k] = share * max(spring[k] * depth + damper[k] * rate, 0.0) if touching[k] else 0.0
            if pushes[k] > 0.0:
                pressing += 1
                p_x, p_y, p_z = u_x * pushes[k], u_y * pushes[k], u_z * pushes[k]
                f_x, f_y, f_z = f_x + p_x, f_y + p_y, f_z + p_z
                n_x, n_y = n_x + (r[k, 1] * p_z - r[k, 2] * p_y), n_y - (r[k, 0] * p_z - r[k, 2] * p_x)
                n_z += r[k, 0] * p_y - r[k, 1] * p_x
        v_x, v_y, v_z = v_x + h * f_x / world.mass, v_y + h * f_y / world.mass, v_z + h * f_z / world.mass
        L = (L[0] + h * n_x, L[1] + h * n_y, L[2] + h * n_z)
        if pressing:  # friction and couples act on the motion after the normal forces of the step
            spin = _spin(world, R, L)
        f_x, f_y, f_z, n_x, n_y, n_z = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for k in range(points if pressing else 0):
            push = pushes[k]
            if push <= 0.0:
                continue
            u_x, u_y, u_z = normal[k]
            s_x = v_x + spin[1] * r[k, 2] - spin[2] * r[k, 1] - world.moving[0]
            s_y = v_y + spin[2] * r[k, 0] - spin[0] * r[k, 2] - world.moving[1]
            away = s_x * u_x + s_y * u_y + (v_z + spin[0] * r[k, 1] - spin[1] * r[k, 0]) * u_z
            s_x, s_y = s_x - away * u_x, s_y - away * u_y
            turning = spin[0] * u_x + spin[1] * u_y + spin[2] * u_z
            own = max(mu[k] + world.sliding, 0.0) if t - hit > world.times[1] else mu[k]
            steps = h * pressing
            held = steps * _mobility(world, R, r[k])
            g_x, g_y, couple = _friction(world, s_x, s_y, turning, push, own, held, steps * world.easiest)
            g_z = -(g_x * u_x + g_y * u_y) / u_z  # keeps the force along the surface
            f_x, f_y, f_z = f_x + g_x, f_y + g_y, f_z + g_z
            n_x += r[k, 1] * g_z - r[k, 2] * g_y + couple * u_x
            n_y += r[k, 2] * g_x - r[k, 0] * g_z + couple * u_y
            n_z += r[k, 0] * g_y - r[k, 1] * g_x + couple * u_z
            if world.lever > 0.0:
                rolling = np.sqrt(spin[0] ** 2 + spin[1] ** 2) + SLOWEST
                most = min(world.lever * push, rolling / (steps * world.easiest)) / rolling
                n_x, n_y = n_x - most * spin[0], n_y - most * spin[1]
        v_x, v_y, v_z = v_x + h * f_x / world.mass, v_y + h * f_y / world.mass, v_z + h * f_z / world.mass
        L = (L[0] + h * n_x, L[1] + h * n_y, L[2] + h * n_z)
        x, y, z = x + 0.5 * h * v_x, y + 0.5 * h * v_y, z + 0.5 * h * v_z
        q = _attitude(world, q, L, 0.5 * h)
        t += h
