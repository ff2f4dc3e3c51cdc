"""Tangential compliance: the contact is a tangential spring with a Coulomb slider beside the normal spring.

Lumped planar model, in the phase s = Ω t of the normal spring (Ω² = k_n K_nn), f = force / Ω:

    f_n = A sin s   in compression, A cos(s'/ε) in restitution (duration ε π/2), A = c_n / (1 + ε)
    dv_t/ds = K_tt f_t + K_tn f_n,    df_t/ds = −(χ / K_nn) v_t,    |f_t| ≤ μ f_n
    c_t ← (1 − e_c) c_t,law + e_c ∫ f_t ds

A contact that never slips is an oscillator of frequency w = √(χ K_tt / K_nn): v_t⁺ = v_t cos(w π) for ε = 1.  So
κ = c_t / c_t,stick depends on ψ = v_t / (μ v_n) and on K_tt / K_nn, where tangential restitution has it constant.

| on paper   | in code | unit | shape |                                                                     |
|------------|---------|------|-------|---------------------------------------------------------------------|
| e_c        | `e_c`   | 1    |       | share of the spring in the impulse: 0 rigid (the law), 1 elastic     |
| χ = k_t/k_n | `chi`  | 1    |       | stiffness ratio; 2(1 − ν)/(2 − ν) ≈ 0.8 for smooth elastic bodies    |

Sources: Maw, Barber and Fawcett 1976, doi:10.1016/0043-1648(76)90201-5; Stronge 1994,
doi:10.1016/0734-743X(94)80027-7.
"""

import numpy as np

from thesis_lib.effects.effect import Effect, Impulse, Parameter

STEPS = 32  # in each phase; the impulse is then within 1 % for w < 3
_NODES = np.linspace(0.0, np.pi / 2.0, STEPS + 1)
_STEP = _NODES[1]
# mean of sin s in compression and of cos s in restitution over each step
_SHAPE = np.concatenate([-np.diff(np.cos(_NODES)), np.diff(np.sin(_NODES))]) / _STEP


class TangentialCompliance(Effect):
    """Impulse of a contact that stores tangential energy while it sticks."""

    name = "tangential_compliance"
    family = "contact_law"
    title = "tangential compliance"
    equation = "v_t' = K_tt f_t + K_tn f_n, f_t' = −(χ / K_nn) v_t, |f_t| ≤ μ f_n"
    parameters = (
        Parameter("e_c", "1", null=0.0, low=0.0, high=1.5, scale=0.5, starts=(1.0,)),
        Parameter("chi", "1", null=0.8, low=0.1, high=5.0, scale=0.2, starts=(0.4, 1.6)),
    )
    reference = "Maw, Barber and Fawcett 1976, doi:10.1016/0043-1648(76)90201-5; Stronge 1994"

    def impulse(self, impulse, space, mu, epsilon, r, state, p, rig):
        if p["e_c"] == 0.0:
            return impulse
        spring = p["chi"] / space.K_nn
        amplitude = np.maximum(impulse.c_n, 0.0) / (1.0 + epsilon)
        # leapfrog: v_t at the nodes, f_t in the middle of the steps, so that a stuck contact keeps its energy
        v_t, f_t, c_t = space.v_t, np.zeros_like(amplitude), np.zeros_like(amplitude)
        last = 0.0
        for step, shape in enumerate(_SHAPE):
            ds = _STEP if step < STEPS else _STEP * epsilon
            f_n = shape * amplitude
            f_t = np.clip(f_t - spring * v_t * (0.5 * (last + ds)), -mu * f_n, mu * f_n)
            c_t = c_t + f_t * ds
            v_t = v_t + (space.K_tt * f_t + space.K_tn * f_n) * ds
            last = ds
        return Impulse((1.0 - p["e_c"]) * impulse.c_t + p["e_c"] * c_t, impulse.c_n, impulse.tau)


EFFECT = TangentialCompliance()
