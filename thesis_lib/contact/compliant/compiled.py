"""Contacts that take time, compiled: the normal forces, and the motion of bodies on them.

numba compiles this file at the first call and keeps the result beside it.  A change of the file compiles it anew;
what is compiled must stand here, since numba does not see changes of functions in other files.

Units are those of `normal_force`: depth x in L, rate x' in v₀, force per mass in v₀²/L.  Steps of the motion are half a
drift, a kick and half a drift.  Dampers and springs act at the velocity in the middle of the step; friction ends the
slip within the step, or turns with it, at most μ f_n, shared by the corners that press.  So errors fall with the square
of the step.  In a convex contact friction is a damper, at most μ f_n, and both forces hold a little against the
acceleration, too.  Where the contact gives way along the surface, a spring of stiffness k_n/η and a damper of ratio ζ
carry the friction, at most μ f_n; k_n is the slope of the loading force.  A pressure field presses on the whole chord
that the surface cuts off, with a pressure that grows with the distance from the body's outline; its friction is at most
(2/π) arctan(|s|/v_s) μ f_n at the slip s, half of Coulomb's at v_s.
"""

import numpy as np
from numba import njit

HYSTERESIS, LINEAR_DAMPER, HUNT_CROSSLEY, CONVEX, PRESSURE_FIELD = range(5)
SPEED = 1.0  # m/s, v₀
# of a convex contact: the weight of the acceleration in b v + k x + a = −R f, over R across the surface (d = 0.01)
IMPEDANCE = 0.01 / 0.99
RESOLVED = 0.25  # (ω h)² of a tangential spring
NODES, WEIGHTS = np.polynomial.legendre.leggauss(12)
THIN = 1e-9  # depth over L of a contact that has just begun

compiled = njit(cache=True, error_model="numpy")


@compiled
def _power(depth, exponent):
    if exponent == 1.0:
        return depth
    return depth * np.sqrt(depth) if exponent == 1.5 else depth**exponent


@compiled
def _push(kind, exponent, depth, rate, deepest, loss):
    """f and ∂f/∂x' of one contact, from x, x', x_m and D; of a convex contact that sticks."""
    if kind == HYSTERESIS:
        if depth < deepest:
            return _power(max(depth - (1.0 - loss) * deepest, 0.0) / loss, exponent), 0.0
        return _power(max(depth, 0.0), exponent), 0.0
    if kind in (HUNT_CROSSLEY, PRESSURE_FIELD):
        elastic, factor = _power(max(depth, 0.0), exponent), 1.0 + loss * rate
        return (elastic * factor, loss * elastic) if factor > 0.0 else (0.0, 0.0)
    force = depth + loss * rate
    return (force, loss) if depth >= 0.0 and force > 0.0 else (0.0, 0.0)


@compiled
def pushes(kind, exponent, depth, rate, deepest, loss):
    """f and ∂f/∂x' (n,) of n contacts, from x, x', x_m and D (n,)."""
    force, slope = np.empty(len(depth)), np.empty(len(depth))
    for i in range(len(depth)):
        force[i], slope[i] = _push(kind, exponent, depth[i], rate[i], deepest[i], loss[i])
    return force, slope


@compiled
def _lifted(force, depth, rate, loss, slip, mu, ratio):
    """f of a convex contact, from that of its damper and the slip |s| in v₀."""
    if depth >= 0.0 and ratio * loss * slip > mu * force:
        return max(depth + loss * (rate + mu * slip), 0.0) / (1.0 + mu * mu / ratio)
    return force


@compiled
def _lowest(axes, vertices, theta):
    """The lowest point (x, y) in m of a body at the angle θ: of vertices (k, 2), or of an ellipse with squares `axes`
    of its semi-axes."""
    sin, cos = np.sin(theta), np.cos(theta)
    if len(vertices) == 0:
        h = np.sqrt(axes[0] * sin * sin + axes[1] * cos * cos)
        return -(axes[0] - axes[1]) * sin * cos / h, -h
    best, lowest = 0, np.inf
    for i in range(len(vertices)):
        height = vertices[i, 0] * sin + vertices[i, 1] * cos
        if height < lowest:
            best, lowest = i, height
    return cos * vertices[best, 0] - sin * vertices[best, 1], lowest


@compiled
def _chord(axes, vertices, theta, height):
    """Ends (x_1, x_2) in m of the chord of a body, at the angle θ and at `height` in m above its centre."""
    sin, cos = np.sin(theta), np.cos(theta)
    if len(vertices) == 0:
        a = cos * cos / axes[0] + sin * sin / axes[1]
        b = cos * sin * (1.0 / axes[0] - 1.0 / axes[1]) * height
        c = (sin * sin / axes[0] + cos * cos / axes[1]) * height * height - 1.0
        root = np.sqrt(max(b * b - a * c, 0.0))
        return (-b - root) / a, (-b + root) / a
    left, right = np.inf, -np.inf
    for i in range(len(vertices)):
        p, q = vertices[i], vertices[(i + 1) % len(vertices)]
        y_p, y_q = sin * p[0] + cos * p[1] - height, sin * q[0] + cos * q[1] - height
        if (y_p < 0.0) != (y_q < 0.0):
            part = y_p / (y_p - y_q)
            x = cos * p[0] - sin * p[1]
            x += part * (cos * q[0] - sin * q[1] - x)
            left, right = min(left, x), max(right, x)
    return (left, right) if right > left else (0.0, 0.0)


@compiled
def _inside(axes, vertices, theta, x, y):
    """How far (x, y) is inside a body: 1 in the middle of an ellipse, m from the nearest side of a polygon."""
    sin, cos = np.sin(theta), np.cos(theta)
    u, v = cos * x + sin * y, cos * y - sin * x
    if len(vertices) == 0:
        return max(1.0 - np.sqrt(u * u / axes[0] + v * v / axes[1]), 0.0)
    nearest = np.inf
    for i in range(len(vertices)):
        p, q = vertices[i], vertices[(i + 1) % len(vertices)]
        along_x, along_y = q[0] - p[0], q[1] - p[1]
        away = (along_x * (v - p[1]) - along_y * (u - p[0])) / np.sqrt(along_x * along_x + along_y * along_y)
        nearest = min(nearest, away)
    return max(nearest, 0.0)


@compiled
def _pressed(axes, vertices, theta, height, damping, v_y, omega, aside):
    """∫ p dx and ∫ x p dx over the chord at `height`, of p = eᵐ (1 − d (v_y + x ω))₊ with e of `_inside`, and their
    derivatives: −∂/∂v_y of the first, −∂/∂ω of the first (which is −∂/∂v_y of the second), −∂/∂ω of the second.

    m is 1 of a prism; of an ellipsoid 3/2, as the pressure is also integrated across the plane.
    """
    left, right = _chord(axes, vertices, theta, height)
    total = moment = slope = across = turning = 0.0
    half, middle = 0.5 * (right - left), 0.5 * (right + left)
    for i in range(len(NODES)):
        x = middle + half * NODES[i]
        e = _inside(axes, vertices, theta, x, height)
        pressure = e if len(vertices) else e * np.sqrt(e)
        pressure *= half * WEIGHTS[i]
        x += aside
        factor = 1.0 - damping * (v_y + x * omega)
        if factor > 0.0:
            total += pressure * factor
            moment += x * pressure * factor
            damped = damping * pressure
            slope += damped
            across += x * damped
            turning += x * x * damped
    return total, moment, slope, across, turning


@compiled
def central_pressure(axes, vertices, theta, depth):
    """∫ p dx over the chord, over depth², of a body at rest at the angle θ that has sunk in by `depth` in m."""
    height = _lowest(axes, vertices, theta)[1] + depth
    return _pressed(axes, vertices, theta, height, 0.0, 0.0, 0.0, 0.0)[0] / depth**2


@compiled
def integrate(force, points, body, outline, spring, chord, velocity, step, most):
    """The motion of n bodies from their first touch until none of their p contact points is in the surface any more.

    A contact that has unloaded before the body is out of its dent remembers how deep it was: the body may press again.

    Args:
        force: kind, exponent, damping along the surface over that across it (n,) of a convex contact or the slip
            v_s (n,) in m/s of a pressure field, and its `central_pressure`.
        points: r_x, r_y, gap in m, μ, D and L in m of each point, (6, p, n).
        body: 1/k² (n,) in 1/m², acceleration in flight (n, 3) in m/s² and rad/s², angle θ (n,) in rad.
        outline: whether the lowest point moves over the body as it turns, squares (2,) of its semi-axes in m², vertices
            (k, 2) in m.
        spring: η and ζ (n,) of the spring along the surface; η = 0 is rigid.
        chord: share (n,) of the depth by which the body gives way, so that the force acts higher, and by how much
            further along the surface (p, n), over that height.
        velocity: (n, 3) in m/s and rad/s.
        step: (n,) in s.
        most: steps (n,).

    Returns:
        Shift (n, 3) in m and rad, velocity (n, 3), time (n,) in s, and of each point (p, n) the impulses along the
        surface and across it, per mass, in m/s.
    """
    kind, exponent, ratios, central = force
    r_xs, r_ys, gaps, mus, losses, lengths = points
    ws, accelerations, thetas = body
    smooth, axes, vertices = outline
    etas, zetas = spring
    shares, leans = chord
    p, n = gaps.shape
    shift, after, elapsed = np.zeros((n, 3)), velocity.copy(), np.zeros(n)
    c_t, c_n = np.zeros((p, n)), np.zeros((p, n))
    r_x, r_y, push, depths, deepest = np.zeros(p), np.zeros(p), np.zeros(p), np.zeros(p), np.zeros(p)
    stretch, share = np.zeros(p), np.zeros(p)
    for i in range(n):
        h, w, ratio = step[i], ws[i], ratios[i]
        a_x, a_y, a_omega = accelerations[i]
        x = y = turn = t = 0.0
        v_x, v_y, omega = velocity[i]
        deepest[:], stretch[:], share[:] = 0.0, 0.0, 0.0
        # where the contact point is beside the lowest one of a smooth body
        beside = _lowest(axes, vertices, thetas[i]) if smooth else (0.0, 0.0)
        for _ in range(most[i]):
            x, y, turn = x + 0.5 * h * v_x, y + 0.5 * h * v_y, turn + 0.5 * h * omega
            sin, cos = np.sin(turn), np.cos(turn)
            under = _lowest(axes, vertices, thetas[i] + turn) if smooth else (0.0, 0.0)
            pressing = 0
            gained, turned = 0.0, 0.0
            for k in range(p):
                at_x, at_y = r_xs[k, i] - beside[0], r_ys[k, i] - beside[1]
                r_x[k], r_y[k] = under[0] + cos * at_x - sin * at_y, under[1] + sin * at_x + cos * at_y
                depth = -(gaps[k, i] + y + r_y[k] - r_ys[k, i])
                depths[k] = depth
                # the force acts in the chord that the surface cuts off
                inside = shares[i] * max(depth, 0.0)
                r_x[k] += leans[k, i] * inside
                r_y[k] += inside
                deepest[k] = max(deepest[k], depth)
                length, loss = lengths[k, i], losses[k, i]
                deep, fast = depth / length, -(v_y + r_x[k] * omega) / SPEED
                f, slope = _push(kind, exponent, deep, fast, deepest[k] / length, loss)
                # what the force changes at its point until the middle of the step, with friction as in the step before
                turns = (r_x[k] - share[k] * r_y[k]) * w
                mobility = 1.0 + r_x[k] * turns
                yields = 0.0
                if kind == CONVEX:
                    yields = IMPEDANCE
                    slip = v_x - r_y[k] * omega
                    lifted = _lifted(f, deep, fast, loss, abs(slip) / SPEED, mus[k, i], ratio)
                    if lifted != f:
                        slope /= 1.0 + mus[k, i] ** 2 / ratio
                        yields /= 1.0 + mus[k, i] ** 2 / ratio
                        mobility -= mus[k, i] * np.sign(slip) * (share[k] - r_y[k] * turns)
                    f = lifted * (1.0 + IMPEDANCE)
                kick = h * SPEED**2 / length
                push[k] = kick * f / (1.0 + (0.5 * kick * slope + yields) * mobility)
                if kind == PRESSURE_FIELD and depth > 0.0:
                    r_y[k] += depth
                    aside, angle = r_x[k] - under[0], thetas[i] + turn
                    height = under[1] + depth
                    total, moment, slope, across, turning = _pressed(
                        axes, vertices, angle, height, loss / SPEED, v_y, omega, aside
                    )
                    # with the velocities in the middle of the step
                    kick, friction = h * SPEED**2 / length**3 / central, share[k] * r_y[k]
                    a, b = 1.0 + 0.5 * kick * (slope - across * w * friction), 0.5 * kick * across * w
                    c, d = 0.5 * kick * (across - turning * w * friction), 1.0 + 0.5 * kick * turning * w
                    push[k] = max(kick * (total * d - moment * b) / (a * d - b * c), 0.0)
                    if push[k] > 0.0:
                        r_x[k] = (kick * moment - c * push[k]) / (d * push[k])
                pressing += push[k] > 0.0
                gained += push[k]
                turned += r_x[k] * push[k]
            before = omega
            v_x, v_y = v_x + h * a_x, v_y + gained + h * a_y
            omega += w * turned + h * a_omega
            dragged, turned = 0.0, 0.0
            for k in range(p):
                mobility, slip, limit = 1.0 + r_y[k] * r_y[k] * w, v_x - r_y[k] * omega, mus[k, i] * push[k]
                slid = v_x - r_y[k] * before
                if kind == PRESSURE_FIELD and ratio > 0.0:
                    limit *= 2.0 / np.pi * np.arctan(abs(slid) / ratio)
                pulled = slip - slid  # by the forces across the surface
                if etas[i] > 0.0 and push[k] > 0.0:
                    thick = exponent * _power(max(deepest[k] / lengths[k, i], THIN), exponent - 1.0)
                    stiffness = (SPEED / lengths[k, i]) ** 2 * thick / etas[i]
                    damping = 2.0 * zetas[i] * np.sqrt(stiffness / mobility)
                    # both at the middle of a step that resolves them, or it would damp; else at its end
                    part = 0.5 if stiffness * mobility * h * h < RESOLVED else 1.0
                    carries = h * (part * h * stiffness + damping)
                    drag = h * stiffness * stretch[k] + carries * (slip - (1.0 - part) * pulled)
                    drag /= -(1.0 + part * carries * mobility)
                    drag = min(max(drag, -limit), limit)
                    # spring and damper carry the drag together, sliding or not
                    stretch[k] -= (h * stiffness * stretch[k] + drag) * h / carries
                else:
                    stretch[k] = 0.0
                    ends = 1.0 / (mobility * max(pressing, 1))
                    # friction first holds against the slip, then, where it is too weak, in the other direction
                    most_change = limit / ends
                    turns_round = slid * pulled < 0.0 and most_change < abs(pulled) > abs(slid) - most_change
                    if kind == CONVEX:
                        slows = (1.0 + IMPEDANCE) * ratio * losses[k, i] * h * SPEED / lengths[k, i]
                        # at the middle of a step that resolves it, or it would swing; else at its end
                        weight = (0.5 if slows < ends else 1.0) * slows + ratio * IMPEDANCE
                        drag = -(slows * slid + weight * pulled) / (1.0 + weight / ends)
                        drag = min(max(drag, -limit), limit)
                    elif turns_round:
                        drag = np.sign(slid) * limit * (1.0 - 2.0 * abs(slid) / (abs(pulled) + most_change))
                    else:
                        drag = min(max(-slip * ends, -limit), limit)
                share[k] = drag / push[k] if push[k] > 0.0 else 0.0
                dragged += drag
                turned += r_y[k] * drag
                c_t[k, i] += drag
                c_n[k, i] += push[k]
            v_x += dragged
            omega -= w * turned
            x, y, turn, t = x + 0.5 * h * v_x, y + 0.5 * h * v_y, turn + 0.5 * h * omega, t + h
            deep = False
            for k in range(p):
                deep |= depths[k] > 0.0
                if depths[k] <= 0.0:  # a corner that has left the surface may press again
                    deepest[k] = 0.0
            if not pressing and not deep:
                break
        shift[i, 0], shift[i, 1], shift[i, 2] = x, y, turn
        after[i, 0], after[i, 1], after[i, 2] = v_x, v_y, omega
        elapsed[i] = t
    return shift, after, elapsed, c_t, c_n
