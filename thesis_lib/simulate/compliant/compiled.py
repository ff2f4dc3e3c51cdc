"""Falls of planar bodies with compliant contact, compiled: flight, touch, contact, and flight again.

numba compiles this file at the first call, within seconds, and caches the result beside it.  All compiled functions
must be in this file, since numba does not notice changes of functions in other files.  No code is shared with the
contacts of the critique (`contact.compliant`): these drops are the ground truth by which the critique is judged.

The forces are described in `forces`, the time steps of a fall in `drops`.  States q, v (5,) are those of `Mechanics`.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

EPSILON_LOW, EPSILON_HIGH, SOFTEST = 0.05, 1.0, 0.1  # limits of ε, and lowest share of k, under slopes and patches
SPOT = 0.3  # 1 − cos of the angle at which a soft spot has decayed to 1/e: 46°; it covers one corner of a square

V_SLOW = 0.05  # m/s; rebounds of slower contacts are below the noise of the rig
SLOW_TOUCHES = 3  # this number of slow contacts in a row ends a recording
MAX_CONTACTS = 25
BISECTIONS = 34  # of a flight step: 1e-3 / 2^34 = 6e-14 s
STAGES = ((1.0, 0.5), (2.0, 0.5), (2.0, 1.0), (1.0, 0.0))  # Runge-Kutta stages: weight, and time of the next stage

# quantity that a hidden law acts on, and its φ (`hidden_laws`)
NONE, ON_EPSILON, ON_MU, COUPLE, DIRECTION = range(5)
SLIP, THRESHOLD, SPIN, ROOT_OF_SPIN, TURNING, LEVER, QUARTERS, ENDS, RELEASE = range(9)
NO_LAW = (NONE, SLIP, 0.0)
SLOWEST = 1e-3  # m/s, lower bound on the impact speed in φ; slower impacts are invisible to a camera

compiled = njit(cache=True, error_model="numpy")


class World(NamedTuple):
    """A body over a plate: its outline, masses, contact and hidden causes, in SI units."""

    vertices: np.ndarray  # (p, 2) from the true centre of mass; empty for a smooth body
    axes: tuple[float, float]  # semi-axes of a smooth body
    com: tuple[float, float]  # from the body's origin to the true centre of mass, in its frame
    gravity: tuple[float, float]
    mass: float  # without the loose mass
    inertia: float
    mu: float
    stiffness: float
    exponent: float
    dt: float  # step in contact
    law: tuple[int, int, float]  # hidden law: quantity that it acts on, φ, and size
    causes: np.void  # the hidden causes, with the names and units of `HiddenCauses`


@compiled
def place(world, theta, x, r_x, r_y):
    """Write the contact points (p,), from the true centre of mass at angle θ and place x, into r_x and r_y in m."""
    cos, sin = np.cos(theta), np.sin(theta)
    if len(world.vertices):
        for k in range(len(world.vertices)):
            x, y = world.vertices[k, 0], world.vertices[k, 1]
            r_x[k], r_y[k] = cos * x - sin * y, sin * x + cos * y - world.causes.corner_radius
        return
    a2, b2 = world.axes[0] ** 2, world.axes[1] ** 2
    larger, (c_x, c_y) = 1.0 + world.causes.size_error, _origin(world, theta)
    r_x[0], curvature = 0.0, world.causes.plate_curvature
    for _ in range(5 if curvature else 1):
        # point closest to the plate, with the plate's slope at the contact point itself
        psi = np.arctan(curvature * (x + r_x[0]))
        cos, sin = np.cos(theta - psi), np.sin(theta - psi)
        h = np.sqrt(a2 * sin**2 + b2 * cos**2)
        along, across = -(a2 - b2) * sin * cos / h * larger, -h * larger
        if psi:
            along, across = np.cos(psi) * along - np.sin(psi) * across, np.sin(psi) * along + np.cos(psi) * across
        r_x[0], r_y[0] = along - c_x, across - c_y


@compiled
def _origin(world, theta):
    cos, sin = np.cos(theta), np.sin(theta)
    return cos * world.com[0] - sin * world.com[1], sin * world.com[0] + cos * world.com[1]


@compiled
def _lowest(r_y):
    lowest = 0
    for k in range(1, len(r_y)):
        if r_y[k] < r_y[lowest]:
            lowest = k
    return lowest


@compiled
def _rise(world, x):
    """Height in m of a curved plate at x above its middle, and its slope there."""
    return 0.5 * world.causes.plate_curvature * x * x, world.causes.plate_curvature * x


@compiled
def lowest_points(world, theta, x):
    """Contact point (n, 2) closest to the plate, in m from the true centre of mass, at angles θ and places x (n,)."""
    (r_x, r_y), r = np.empty((2, max(len(world.vertices), 1))), np.empty((len(theta), 2))
    for i in range(len(theta)):
        place(world, theta[i], x[i], r_x, r_y)
        k = 0
        for j in range(1, len(r_y)):
            if r_y[j] - _rise(world, x[i] + r_x[j])[0] < r_y[k] - _rise(world, x[i] + r_x[k])[0]:
                k = j
        r[i, 0], r[i, 1] = r_x[k], r_y[k]
    return r


@compiled
def plate(causes, t, phase):
    """Height in m and vertical velocity in m/s of the plate at the time t in s."""
    w, a = 2.0 * np.pi * causes.plate_frequency, causes.plate_amplitude
    return causes.surface_height + a * np.sin(w * t + phase), a * w * np.cos(w * t + phase)


@compiled
def accelerate(world, q, v, a):
    """Write the acceleration (5,) without contact into `a`."""
    m, drag = world.causes, world.causes.linear_drag
    (a[0], a[1]), a[2], (a[3], a[4]) = world.gravity, 0.0, world.gravity
    if m.quadratic_drag:
        drag += m.quadratic_drag * np.hypot(v[0], v[1])
    a[0] -= drag * v[0] + m.magnus * v[2] * v[1]
    a[1] -= drag * v[1] - m.magnus * v[2] * v[0]
    a[2] -= m.spin_damping * v[2]
    if m.loose_mass:
        w = 2.0 * np.pi * m.loose_frequency
        for k in range(2):
            pull = -(w**2) * (q[3 + k] - q[k]) - 2.0 * m.loose_damping * w * (v[3 + k] - v[k])
            a[3 + k] += pull
            a[k] -= pull * m.loose_mass / (1.0 - m.loose_mass)


@compiled
def touch(world, q, restitution, r_x, r_y, epsilon, mu, stiffness):
    """Write ε, μ and k in N/mⁿ (p,) of the contact points r of a touching body into the last three arguments."""
    m, (c_x, c_y) = world.causes, _origin(world, q[2])
    for k in range(len(r_x)):
        x, beta = q[0] + r_x[k], np.arctan2(r_y[k] + c_y, r_x[k] + c_x) - q[2] - m.orientation_axis
        u = (x - m.patch_centre) / (0.5 * m.patch_width)
        patch, bump, step = (1.0 if abs(u) < 1.0 else 0.0), np.exp(-(u**2)), np.tanh(u)
        by_place = m.restitution_patch * patch + m.restitution_bump * bump + m.restitution_step * step
        of_body = restitution * (1.0 + m.orientation_restitution * np.cos(2.0 * beta))
        epsilon[k] = min(max(of_body * (1.0 + m.restitution_slope * x + by_place), EPSILON_LOW), EPSILON_HIGH)
        by_place = m.friction_patch * patch + m.friction_bump * bump + m.friction_step * step
        mu[k] = max(world.mu * (1.0 + m.friction_slope * x + by_place), 0.0)
        by_place = max(1.0 + m.stiffness_slope * x + m.stiffness_patch * patch, SOFTEST)
        stiffness[k] = world.stiffness * by_place * (1.0 - m.soft_spot * np.exp(-(1.0 - np.cos(beta)) / SPOT))


@compiled
def _phi(world, q, v, speed, trial, r_x, r_y):
    """φ of the hidden law for a body that touches at r after an approach at `speed` in m/s, and r_y of its contact."""
    form, low = world.law[1], _lowest(r_y)
    k, (c_x, c_y) = np.sqrt(world.inertia / world.mass), _origin(world, q[2])
    beta = np.arctan2(r_y[low] + c_y, r_x[low] + c_x) - q[2]
    slip, spin = abs(v[0] - r_y[low] * v[2]) / speed, v[2] * k / speed
    by_spin = (abs(spin), np.sqrt(abs(spin)), spin)
    if form <= THRESHOLD:
        return (slip if form == SLIP else 1.0 / (1.0 + np.exp((0.5 - slip) / 0.05))), r_y[low]
    if form <= TURNING:
        return by_spin[form - SPIN], r_y[low]
    return (r_x[low] / k, np.cos(4.0 * beta), np.cos(2.0 * beta), trial / 100.0)[form - LEVER], r_y[low]


@compiled
def _normal(world, depth, rate, deepest, epsilon, stiffness):
    """Repulsion and adhesion in N at a contact point, and whether it neither touches nor adheres."""
    m, share = world.causes, epsilon**2
    lift = (1.0 - share) * deepest - depth  # distance beyond δ_0; negative while the contact pushes
    push = 0.0
    if deepest > 0.0 and lift < 0.0:
        part = deepest * (-lift / (share * deepest))
        push = stiffness * (part if world.exponent == 1.0 else part**world.exponent)
    if m.hunt_crossley:
        push *= max(1.0 + m.hunt_crossley * rate, 0.0)
    reach, pull = 0.0, 0.0
    if m.adhesion_energy:
        reach = m.adhesion_range
        if deepest > 0.0 and 0.0 <= lift < reach:
            pull = 2.0 * m.adhesion_energy / reach * (1.0 - lift / reach)
    return push, pull, depth <= 0.0 and lift >= reach


@compiled
def _friction(world, slip, mobility, push, pressing, mu, stiffness, deepest, bristle):
    """Friction force in N at a contact point, given its slip after the kick of the normal forces, and bristle in m."""
    h, m = world.dt, world.causes
    if m.stribeck:
        mu *= 1.0 + m.stribeck * np.exp(-((slip / m.stribeck_speed) ** 2))
    if m.friction_anisotropy:
        mu *= 1.0 + m.friction_anisotropy * np.sign(slip)
    limit = mu * push
    if m.tangential_compliance == 0.0:
        # points that touch at the same time share the force; otherwise their sum would overshoot
        return min(max(-slip / (mobility * h * max(pressing, 1)), -limit), limit), bristle
    k = stiffness / m.tangential_compliance
    if world.exponent != 1.0:
        # the area of a Hertz contact grows with depth; both stiffnesses grow with its width
        k *= world.exponent * max(deepest, 1e-12) ** (world.exponent - 1.0)
    damping = 2.0 * m.tangential_damping * np.sqrt(k / mobility)
    force = min(max(-k * (bristle + h * slip) - damping * slip, -limit), limit)
    # spring and damper in parallel carry the force, sliding or not: k s + c ṡ = −force
    return force, (damping / h * bristle - force) / (k + damping / h)


@compiled
def _step(world, phase, q, v, t, r, memory, a, speed, trial):
    """One time step in contact: half a drift, a kick, half a drift; q, v and `memory` change.

    `r` (3, p): workspace for r_x, r_y, push; `memory` (5, p): δ_m, s, ε, μ, k; `a` (5,): workspace.  Returns the
    impulse (c_t, c_n) in N s, and whether no point touches or adheres.
    """
    h, w, (r_x, r_y, pushes) = world.dt, 1.0 / world.inertia, r
    deepest, bristle, epsilon, mu, stiffness = memory
    acts_on, lever, size = world.law[0], 0.0, 0.0
    if acts_on > ON_EPSILON:
        place(world, q[2], q[0], r_x, r_y)
        phi, lever = _phi(world, q, v, speed, trial, r_x, r_y)
        size = world.law[2] * phi
        if acts_on == ON_MU:
            mu[:] = world.mu * max(1.0 + size, 0.0)
    _drift(q, v, 0.5 * h, q)
    place(world, q[2], q[0], r_x, r_y)
    height, rise = plate(world.causes, t + 0.5 * h, phase)
    accelerate(world, q, v, a)
    total = aside = turning = pushed = 0.0
    pressing, free = 0, True
    for k in range(len(r_x)):
        over_middle, slope = _rise(world, q[0] + r_x[k])
        cos = 1.0 / np.sqrt(1.0 + slope * slope)
        depth = cos * (height + over_middle - q[1] - r_y[k])
        rate = cos * (rise - v[1] - r_x[k] * v[2] + slope * (v[0] - r_y[k] * v[2]))
        deepest[k] = max(deepest[k], depth)
        pushes[k], pull, over = _normal(world, depth, rate, deepest[k], epsilon[k], stiffness[k])
        if over:
            deepest[k] = bristle[k] = 0.0
        free &= over
        pressing += pushes[k] > 0.0
        pushed += pushes[k]
        force = cos * (pushes[k] - pull)
        total += force
        aside -= slope * force
        turning += (r_x[k] + slope * r_y[k]) * force
    _drift(v, a, h, v)
    v[0] += h / world.mass * aside
    v[1] += h / world.mass * total
    v[2] += h * w * turning
    dragged = lifted = turning = 0.0
    for k in range(len(r_x)):
        slope = _rise(world, q[0] + r_x[k])[1]
        cos = 1.0 / np.sqrt(1.0 + slope * slope)
        arm = cos * (r_y[k] - slope * r_x[k])
        slip = cos * (v[0] + slope * v[1]) - arm * v[2] - world.causes.plate_velocity
        mobility = 1.0 / world.mass + arm**2 * w
        force, bristle[k] = _friction(
            world, slip, mobility, pushes[k], pressing, mu[k], stiffness[k], deepest[k], bristle[k]
        )
        dragged += cos * force
        lifted += slope * cos * force
        turning += arm * force
    v[0] += h / world.mass * dragged
    v[1] += h / world.mass * lifted
    v[2] -= h * w * turning
    dragged, total = dragged + aside, total + lifted
    if world.causes.rolling_lever:
        v[2] -= np.sign(v[2]) * min(h * w * world.causes.rolling_lever * pushed, abs(v[2]))
    _drift(q, v, 0.5 * h, q)
    if acts_on == COUPLE:
        v[2] += size * h * total * np.sqrt(w / world.mass)
    if acts_on == DIRECTION:
        dragged += size * total
        v[0] += size * h * total / world.mass
        v[2] -= size * h * total * lever * w
    return h * dragged, h * total, free


@compiled
def _copy(q, v, to_q, to_v):
    for k in range(len(q)):
        to_q[k], to_v[k] = q[k], v[k]


@compiled
def _drift(q, v, h, out):
    for k in range(len(q)):
        out[k] = q[k] + h * v[k]


@compiled
def _fly(world, q, v, h, room, ahead, faster):
    """Write position and velocity after a Runge-Kutta step of h s into `ahead`, `faster`; `room`: workspace (5, 5)."""
    at, fast, a, mean_v, mean_a = room
    _copy(q, v, at, fast)
    mean_v[:], mean_a[:] = 0.0, 0.0
    for weight, part in STAGES:
        accelerate(world, at, fast, a)
        for k in range(len(q)):
            mean_v[k] += weight * fast[k]
            mean_a[k] += weight * a[k]
            at[k], fast[k] = q[k] + part * h * fast[k], v[k] + part * h * a[k]
    _drift(q, mean_v, h / 6.0, ahead)
    _drift(v, mean_a, h / 6.0, faster)


@compiled
def _gap(world, q, t, phase, r_x, r_y):
    place(world, q[2], q[0], r_x, r_y)
    least = np.inf
    for k in range(len(r_x)):
        least = min(least, q[1] + r_y[k] - _rise(world, q[0] + r_x[k])[0])
    return least - plate(world.causes, t, phase)[0]


@compiled
def _seen(world, q, pose):
    c_x, c_y = _origin(world, q[2])
    pose[0], pose[1], pose[2] = q[0] - c_x, q[1] - c_y, q[2]


@compiled
def falls(world, steps, q0, v0, ticks, phases, epsilons):
    """Simulate the falls of n bodies from q0, v0 (n, 5) at ticks[0] = 0; `phases` of the plate and `epsilons` (n,).

    A contact that lasts for `steps` time steps ends the recording.

    Returns:
        Poses (n, len(ticks), 3) of the origin, NaN after the end of a recording; times (n,) of these ends in s; numbers
        (n,) of contacts; and for each contact (n, most) the states q, v before and after (4, 5), their times (2,) in s,
        the impulse (2,) in N s and whether the body left the plate.
    """
    n, p = len(q0), max(len(world.vertices), 1)
    poses, ends, counts = np.full((n, len(ticks), 3), np.nan), np.zeros(n), np.zeros(n, np.int64)
    states, (times, impulses) = np.zeros((n, MAX_CONTACTS, 4, 5)), np.zeros((2, n, MAX_CONTACTS, 2))
    left = np.zeros((n, MAX_CONTACTS), np.bool_)
    r, memory, room, h = np.zeros((3, p)), np.zeros((5, p)), np.zeros((5, 5)), world.dt
    r_x, r_y, q, v, ahead, faster = r[0], r[1], np.zeros(5), np.zeros(5), np.zeros(5), np.zeros(5)
    for i in range(n):
        t, phase = 0.0, phases[i]
        _copy(q0[i], v0[i], q, v)
        _seen(world, q, poses[i, 0])
        tick, slow = 1, 0
        while True:
            while tick < len(ticks):
                _fly(world, q, v, ticks[tick] - t, room, ahead, faster)
                if _gap(world, ahead, ticks[tick], phase, r_x, r_y) < 0.0:
                    break
                t = ticks[tick]
                _copy(ahead, faster, q, v)
                _seen(world, q, poses[i, tick])
                tick += 1
            if tick == len(ticks):
                break
            low, high = 0.0, ticks[tick] - t
            for _ in range(BISECTIONS):
                middle = 0.5 * (low + high)
                _fly(world, q, v, middle, room, ahead, faster)
                below = _gap(world, ahead, t + middle, phase, r_x, r_y) < 0.0
                low, high = (low, middle) if below else (middle, high)
            _fly(world, q, v, high, room, ahead, faster)
            t += high
            _copy(ahead, faster, q, v)
            place(world, q[2], q[0], r_x, r_y)
            memory[:2] = 0.0
            touch(world, q, epsilons[i], r_x, r_y, memory[2], memory[3], memory[4])
            low = _lowest(r_y)
            speed = max(np.hypot(v[0] - r_y[low] * v[2], v[1] + r_x[low] * v[2]), SLOWEST)
            if world.law[0] == ON_EPSILON:
                factor = 1.0 + world.law[2] * _phi(world, q, v, speed, i, r_x, r_y)[0]
                for k in range(p):
                    memory[2, k] = min(max(memory[2, k] * factor, EPSILON_LOW), EPSILON_HIGH)
            number = counts[i]
            approach = plate(world.causes, t, phase)[1] - v[1] - r_x[low] * v[2]
            times[i, number, 0] = t
            _copy(q, v, states[i, number, 0], states[i, number, 1])
            for _ in range(steps):
                _copy(q, v, ahead, faster)
                c_t, c_n, free = _step(world, phase, q, v, t, r, memory, room[0], speed, i)
                if tick < len(ticks) and t + h >= ticks[tick]:
                    for k in range(5):
                        ahead[k] += (ticks[tick] - t) / h * (q[k] - ahead[k])
                    _seen(world, ahead, poses[i, tick])
                    tick += 1
                t += h
                impulses[i, number, 0] += c_t
                impulses[i, number, 1] += c_n
                if free:
                    left[i, number] = True
                    break
            times[i, number, 1] = t
            _copy(q, v, states[i, number, 2], states[i, number, 3])
            slow = slow + 1 if approach < V_SLOW else 0
            counts[i] += 1
            if not left[i, number] or slow >= SLOW_TOUCHES or counts[i] >= MAX_CONTACTS:
                break
        ends[i] = t
    return poses, ends, counts, states, times, impulses, left
