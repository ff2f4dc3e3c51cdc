"""Compiled compliant contacts of finite duration in the plane: normal forces, and the motion of bodies in contact.

numba compiles this file at the first call, caches the result next to it and recompiles it after a change.  All
compiled functions must be in this file, because numba does not detect changes to functions in other files.

Units are those of `normal_force`: depth x in L, rate x' in v₀, force per mass in v₀²/L.  A step of the motion is half a
drift, a kick and half a drift.  Dampers and springs act at the velocity in the middle of the step.  Friction of at most
μ f_n, shared by the corners that press, ends the slip within the step or reverses with it.  Errors decrease with
the square of the step.  The forces of convex contacts are found together by sweeps over the contacts.  If the contact
is compliant along the surface, a spring of stiffness k_n/η and a damper of ratio ζ carry the friction, at most μ f_n;
k_n is the slope of the loading force.  A pressure field acts on the whole chord where the surface cuts the body, with a
pressure that grows with the distance from the body's outline; its friction is at most (2/π) arctan(|s|/v_s) μ f_n at
the slip s, half of Coulomb's at v_s.
"""

import numpy as np
from numba import njit

HYSTERESIS, LINEAR_DAMPER, HUNT_CROSSLEY, CONVEX, PRESSURE_FIELD, PYRAMID = range(6)
SPEED = 1.0  # m/s, v₀
SWEEPS, SETTLED = 50, 1e-7  # sweeps over simultaneous convex contacts, and the relative change at which they end
RESOLVED = 0.25  # (ω h)² below which a step resolves a tangential spring
NODES, WEIGHTS = np.polynomial.legendre.leggauss(12)
THIN = 1e-9  # depth over L of a contact that has just begun

compiled = njit(cache=True, error_model="numpy")
# allocates nothing, so it counts no references to arrays
kernel = njit(cache=True, error_model="numpy", _nrt=False)  # pyright: ignore[reportCallIssue]


@compiled
def _power(depth, exponent):
    if exponent == 1.0:
        return depth
    return depth * np.sqrt(depth) if exponent == 1.5 else depth**exponent


@compiled
def _push(kind, exponent, depth, rate, deepest, loss):
    """f and ∂f/∂x' of one contact, from x, x', x_m and D; for convex contacts, in the case of sticking."""
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
def _cone(normal, both, along, c_n, c_t, mu):
    """(f_n, f_t) that minimise ½ fᵀ Q f − fᵀ c on a side of the cone |f_t| ≤ μ f_n or at its apex; `normal`, `both` and
    `along` are the entries of Q."""
    best, f_n, f_t = 0.0, 0.0, 0.0
    for side in (-mu, mu):
        c = c_n + side * c_t
        square = normal + 2.0 * side * both + side * side * along
        if c > 0.0 and c * c > best * square:
            best, f_n, f_t = c * c / square, c / square, side * c / square
    return f_n, f_t


@compiled
def _convex(h, w, rho, ratio, velocity, falls, points, f_n, f_t):
    """Replace in f_n and f_t (p,) the forces per mass of convex contacts in the previous step by those of this step.

    The forces belong to velocities in the middle of a step h; `velocity` is the velocity at its start, `falls` (3,) the
    acceleration of the body without contact, and `points` holds r_x, r_y, depth, μ, B and K of each contact point.
    """
    r_xs, r_ys, depths, mus, Bs, Ks = points
    v_x, v_y, omega = velocity
    a_x, a_y, alpha = falls
    p = len(depths)
    pressing = 0
    for k in range(p):
        if depths[k] <= 0.0:
            f_n[k] = f_t[k] = 0.0
        pressing += depths[k] > 0.0
        a_x, a_y = a_x + f_t[k], a_y + f_n[k]
        alpha += w * (r_xs[k] * f_n[k] - r_ys[k] * f_t[k])
    for _ in range(SWEEPS if pressing > 1 else 1):
        moved = 0.0
        for k in range(p):
            if depths[k] <= 0.0:
                continue
            r_x, r_y, mu, B = r_xs[k], r_ys[k], mus[k], Bs[k]
            A_n, A_t, A = 1.0 + r_x * r_x * w, 1.0 + r_y * r_y * w, -r_x * r_y * w
            u_n = a_y + r_x * alpha - A_n * f_n[k] - A * f_t[k]
            u_t = a_x - r_y * alpha - A_t * f_t[k] - A * f_n[k]
            half = 1.0 + 0.5 * B * h
            slip = v_x - r_y * omega
            c_n = Ks[k] * depths[k] - B * (v_y + r_x * omega) - half * u_n
            normal, along, both = half * A_n + rho, half * A_t + rho / ratio, half * A
            # sticking: evaluated in the middle of a step that resolves it, else at the end to avoid oscillation
            late = half if B * h * A_t < along else 1.0 + B * h
            c_t, holds = -B * slip - late * u_t, late * A_t + rho / ratio
            det = normal * holds - both * late * A
            n = (c_n * holds - both * c_t) / det
            t = (normal * c_t - late * A * c_n) / det
            if n < 0.0 or abs(t) > mu * n:
                n, t = _cone(normal, both, along, c_n, -B * slip - half * u_t, mu)
            d_n, d_t = n - f_n[k], t - f_t[k]
            a_x, a_y, alpha = a_x + d_t, a_y + d_n, alpha + w * (r_x * d_n - r_y * d_t)
            f_n[k], f_t[k] = n, t
            moved = max(moved, abs(d_n) + abs(d_t))
        if moved <= SETTLED * (np.sum(f_n) + 1e-12):
            break


@compiled
def _lowest(axes, vertices, theta):
    """Lowest point (x, y) in m of a body at the angle θ: a polygon with vertices (k, 2) or, without them, an ellipse
    whose squared semi-axes are `axes`."""
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
    """Ends (x_1, x_2) in m of the horizontal chord at `height` in m above the centre of a body at the angle θ."""
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
    """Depth of (x, y) inside a body: 1 at the centre of an ellipse; distance in m to the nearest side of a polygon."""
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
    """∫ p dx and ∫ x p dx over the chord at `height`, of p = eᵐ (1 − d (v_y + x ω))₊ with e from `_inside`, and their
    derivatives: −∂/∂v_y of the first, −∂/∂ω of the first (equal to −∂/∂v_y of the second), −∂/∂ω of the second.

    m is 1 for a prism and 3/2 for an ellipsoid, because the pressure is also integrated across the plane.
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
    """∫ p dx over the chord, divided by depth², of a body at rest at the angle θ that penetrates by `depth` in m."""
    height = _lowest(axes, vertices, theta)[1] + depth
    return _pressed(axes, vertices, theta, height, 0.0, 0.0, 0.0, 0.0)[0] / depth**2


@compiled
def integrate(force, points, body, outline, spring, chord, velocity, step, most):
    """Integrate the motion of n bodies from first contact until none of their p contact points penetrates the surface.

    A contact that unloads before it leaves its dent keeps its greatest depth, because the body may press again.

    Args:
        force: kind; exponent; ratio (n,) of tangential to normal damping of a convex contact, or the slip v_s (n,) in
            m/s of a pressure field; R m (n,) of a convex contact; `central_pressure` of a pressure field.
        points: r_x, r_y, gap in m, μ, D and L in m of each point, (6, p, n).
        body: 1/k² (n,) in 1/m², acceleration in flight (n, 3) in m/s² and rad/s², angle θ (n,) in rad.
        outline: whether the lowest point moves over the body as it turns, squared semi-axes (2,) in m², vertices
            (k, 2) in m.
        spring: η and ζ (n,) of the spring along the surface; η = 0 is rigid.
        chord: fraction (n,) of the depth by which the body yields, which raises the point of the force by as much, and
            shift (p, n) of this point along the surface, relative to that rise.
        velocity: (n, 3) in m/s and rad/s.
        step: (n,) in s.
        most: greatest number of steps (n,).

    Returns:
        Shift (n, 3) in m and rad, velocity (n, 3), time (n,) in s, and for each point (p, n) the tangential and normal
        impulses per mass, in m/s.
    """
    kind, exponent, ratios, rhos, central = force
    r_xs, r_ys, gaps, mus, losses, lengths = points
    ws, accelerations, thetas = body
    smooth, axes, vertices = outline
    etas, zetas = spring
    shares, leans = chord
    p, n = gaps.shape
    shift, after, elapsed = np.zeros((n, 3)), velocity.copy(), np.zeros(n)
    c_t, c_n = np.zeros((p, n)), np.zeros((p, n))
    r_x, r_y, push, depths, deepest = np.zeros(p), np.zeros(p), np.zeros(p), np.zeros(p), np.zeros(p)
    stretch, share, f_n, f_t, convex = np.zeros(p), np.zeros(p), np.zeros(p), np.zeros(p), np.zeros((6, p))
    for i in range(n):
        h, w, ratio, rho = step[i], ws[i], ratios[i], rhos[i]
        a_x, a_y, a_omega = accelerations[i]
        x = y = turn = t = 0.0
        v_x, v_y, omega = velocity[i]
        deepest[:], stretch[:], share[:], f_n[:], f_t[:] = 0.0, 0.0, 0.0, 0.0, 0.0
        # the contact point is given relative to the lowest point of a smooth body
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
                # the force acts within the chord where the surface cuts the body
                inside = shares[i] * max(depth, 0.0)
                r_x[k] += leans[k, i] * inside
                r_y[k] += inside
                deepest[k] = max(deepest[k], depth)
                length, loss = lengths[k, i], losses[k, i]
                if kind == CONVEX:
                    depths[k] = max(depth, 0.0)
                    convex[:, k] = r_x[k], r_y[k], depths[k], mus[k, i], loss * SPEED / length, (SPEED / length) ** 2
                    convex[4:, k] *= 1.0 + rho
                    continue
                if depth < 0.0:  # contacts above the surface do not push
                    push[k] = 0.0
                    continue
                deep, fast = depth / length, -(v_y + r_x[k] * omega) / SPEED
                f, slope = _push(kind, exponent, deep, fast, deepest[k] / length, loss)
                # effect of the force at its point until the middle of the step, with the friction of the previous step
                turns = (r_x[k] - share[k] * r_y[k]) * w
                mobility = 1.0 + r_x[k] * turns
                kick = h * SPEED**2 / length
                push[k] = kick * f / (1.0 + 0.5 * kick * slope * mobility)
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
            if kind == CONVEX:
                _convex(h, w, rho, ratio, (v_x, v_y, omega), (a_x, a_y, a_omega), convex, f_n, f_t)
                for k in range(p):
                    push[k] = h * f_n[k]
                    pressing += push[k] > 0.0
                    gained += push[k]
                    turned += r_x[k] * push[k]
            before = omega
            v_x, v_y = v_x + h * a_x, v_y + gained + h * a_y
            omega += w * turned + h * a_omega
            dragged, turned = 0.0, 0.0
            for k in range(p):
                if push[k] == 0.0 and kind != CONVEX:
                    stretch[k] = share[k] = 0.0
                    continue
                mobility, slip, limit = 1.0 + r_y[k] * r_y[k] * w, v_x - r_y[k] * omega, mus[k, i] * push[k]
                slid = v_x - r_y[k] * before
                if kind == PRESSURE_FIELD and ratio > 0.0:
                    limit *= 2.0 / np.pi * np.arctan(abs(slid) / ratio)
                pulled = slip - slid  # by the normal forces
                if kind == CONVEX:
                    drag = h * f_t[k]
                elif etas[i] > 0.0 and push[k] > 0.0:
                    thick = exponent * _power(max(deepest[k] / lengths[k, i], THIN), exponent - 1.0)
                    stiffness = (SPEED / lengths[k, i]) ** 2 * thick / etas[i]
                    damping = 2.0 * zetas[i] * np.sqrt(stiffness / mobility)
                    # both evaluated in the middle of a step that resolves them, else at its end; the end adds damping
                    part = 0.5 if stiffness * mobility * h * h < RESOLVED else 1.0
                    carries = h * (part * h * stiffness + damping)
                    drag = h * stiffness * stretch[k] + carries * (slip - (1.0 - part) * pulled)
                    drag /= -(1.0 + part * carries * mobility)
                    drag = min(max(drag, -limit), limit)
                    # spring and damper carry the drag together, whether the contact slides or not
                    stretch[k] -= (h * stiffness * stretch[k] + drag) * h / carries
                else:
                    stretch[k] = 0.0
                    ends = 1.0 / (mobility * max(pressing, 1))
                    # friction first opposes the initial slip, then, if too weak to stop it, the reversed slip
                    most_change = limit / ends
                    turns_round = slid * pulled < 0.0 and most_change < abs(pulled) > abs(slid) - most_change
                    if turns_round:
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
