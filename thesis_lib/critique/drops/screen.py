"""Score tests of all candidate effects at once, and their joint null distribution.

With z the whitened residuals of the fitted model, B its columns ∂z/∂(fitted parameters) and U_c those of candidate c,

    gain_c = ½ |P_c z|²,    P_c the projector on U_c after B is projected out

is the rise of the log score, to first order, when c is switched on and *all* parameters are refitted: what compensating
parameters would have hidden is projected out, not fitted away.  Columns are secants over a parameter's `scale`, because
some effects have no slope at their null.

Under the null z is unit noise; the largest gain of any candidate is then drawn by the same projectors from random z.
So the p-value of the best candidate counts how many were tried.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from thesis_lib.critique.drops.fit import NU, Fit, Whitening
from thesis_lib.critique.drops.model import residual_covariance
from thesis_lib.critique.drops.observations import Observations
from thesis_lib.effects.effect import Effect

RESAMPLES = 999
_RANK = 1e-8  # of the largest singular value: columns below it are combinations of others


@dataclass(frozen=True)
class Scan:
    """Score tests of candidates at one fitted model.

    Attributes:
        gain: by effect, nats; null: (RESAMPLES,) largest gain of any candidate under the null.
        columns: by effect, orthonormal basis of its columns after projection, for overlaps.
        shift: by effect, the change of z that the fitted size makes, (N,).
        size: by effect, the first-order estimate of its parameters.
        information: by effect, Fisher information of its parameters after projection.
    """

    gain: dict[str, float]
    null: np.ndarray
    columns: dict[str, np.ndarray]
    shift: dict[str, np.ndarray]
    size: dict[str, dict[str, float]]
    information: dict[str, np.ndarray]

    def p_value(self, gain: float) -> float:
        """Share of null draws with a gain at least as large, with the draw itself counted."""
        return float((1 + np.sum(self.null >= gain)) / (1 + len(self.null)))


def stacked(whitening: Whitening, values: Mapping[str, float]) -> np.ndarray:
    """All whitened residuals as one vector (N,), impacts first."""
    return np.concatenate([part.ravel() for part in whitening(values)])


def scan(
    fitted: Fit, observations: Observations, candidates: Sequence[Effect], rng: np.random.Generator
) -> Scan:
    """Score tests of `candidates` at `fitted`; effects that are on or off are tested at their other value."""
    S = residual_covariance(fitted.model, fitted.values, observations)
    here = Whitening(fitted.model, observations, S, fitted.sigma_m)
    z, f = here(fitted.values)
    # the t distribution's weights: a bad impact counts as little here as in the fit
    weight = np.concatenate([_weights(z), _weights(f)])
    base = np.concatenate([z.ravel(), f.ravel()])
    residual = weight * base

    own = []
    for name, p in fitted.model.parameters.items():
        if p.discrete is None:
            step = 1e-3 * p.scale
            step = step if fitted.values[name] + step <= p.high else -step
            values = {**fitted.values, name: fitted.values[name] + step}
            own.append(weight * (stacked(here, values) - base) / step)
    Q = _basis(np.stack(own, axis=1))
    residual = residual - Q @ (Q.T @ residual)

    gain, columns, shift, size, information = {}, {}, {}, {}, {}
    for effect in candidates:
        with_it = Whitening(fitted.model.with_effect(effect), observations, S, fitted.sigma_m)
        full = {**fitted.values} | {f"{effect.name}.{p.name}": p.null for p in effect.parameters}
        U = []
        for p in effect.parameters:
            name = f"{effect.name}.{p.name}"
            step = p.scale if p.null + p.scale <= p.high else -p.scale
            step = step if p.discrete is None else p.discrete - p.null
            values = {**full, name: p.null + step}
            U.append(weight * (stacked(with_it, values) - base) / step)
        U = np.stack(U, axis=1)
        U = U - Q @ (Q.T @ U)
        basis = _basis(U)
        part = basis @ (basis.T @ residual)
        gain[effect.name] = float(0.5 * part @ part)
        columns[effect.name], shift[effect.name] = basis, part
        information[effect.name] = U.T @ U
        solved = -np.linalg.lstsq(U, residual, rcond=_RANK)[0]
        size[effect.name] = {p.name: float(x) for p, x in zip(effect.parameters, solved)}
    null = np.zeros(RESAMPLES)
    if columns:
        # normal draws matter only in the space of all columns together
        joint = _basis(np.concatenate(list(columns.values()), axis=1))
        draws = rng.standard_normal((joint.shape[1], RESAMPLES)) * np.sqrt(np.mean(residual**2))
        best = [0.5 * ((basis.T @ joint @ draws) ** 2).sum(axis=0) for basis in columns.values()]
        null = np.max(best, axis=0)
    return Scan(gain, null, columns, shift, size, information)


def expected_difference(scan: Scan, truth: str, other: str) -> float:
    """Expected loss of log score in nats, on this design, if `other` is fitted where `truth` is at work."""
    shift = scan.shift[truth]
    caught = scan.columns[other].T @ shift
    return float(0.5 * (shift @ shift - caught @ caught))


def _weights(z: np.ndarray) -> np.ndarray:
    if not len(z):
        return np.zeros(0)
    m = z.shape[1]
    d2 = np.einsum("nm,nm->n", z, z)
    return np.repeat(np.sqrt((NU + m) / (NU + d2)), m)


def _basis(columns: np.ndarray) -> np.ndarray:
    """Orthonormal basis of the columns, without directions that are rounding."""
    scale = np.linalg.norm(columns, axis=0)
    columns = columns[:, scale > 0] / scale[scale > 0]
    if columns.shape[1] == 0:
        return np.zeros((len(columns), 0))
    U, s, _ = np.linalg.svd(columns, full_matrices=False)
    return U[:, s > _RANK * s[0]] if s[0] > _RANK else np.zeros((len(columns), 0))
