"""Score tests of all candidate effects at once, and their joint null distribution.

With z the whitened residuals of the fitted model, B their slopes in its parameters, and U_c in those of candidate c,

    gain_c = ½ |P_c z|²,    P_c the projector on U_c after B is projected out

is the first-order rise of the log score when c is switched on and *all* parameters are refitted.  Projecting out B
keeps compensating parameters from hiding an effect.

Under the null z is noise.  Drawing the largest gain of any candidate with the same projectors makes the p-value account
for the number of candidates.  Let s = P z be the shift of a true candidate.  Fitting c instead loses
|s|² (1 − cos²)/2 nats, cos = |P_c s| / |s|.

Source: C. R. Rao, Proc. Camb. Phil. Soc. 44 (1948), doi 10.1017/S0305004100023987 (score test).
"""

from dataclasses import dataclass, replace

import numpy as np

from thesis_lib.critique.selection.world import Slopes

RANK = 1e-8  # of the largest singular value: columns below it depend on others


@dataclass(frozen=True)
class Scan:
    """Score tests of candidates at one fitted model.

    Attributes:
        gain: by effect, nats; null: (draws,) largest gain of any candidate under the null.
        basis: by effect, (N, rank) orthonormal basis of its projected columns.
        shift: by effect, (N,) change of z at the fitted size.
        information: by effect, (n_p, n_p) Fisher information after projection.
    """

    gain: dict[str, float]
    null: np.ndarray
    basis: dict[str, np.ndarray]
    shift: dict[str, np.ndarray]
    information: dict[str, np.ndarray]

    def p_value(self, gain: float) -> float:
        """Share of null draws with a gain at least as large, counting the observed one."""
        return float((1 + np.sum(self.null >= gain)) / (1 + len(self.null)))

    def with_one_of(self, other: "Scan", name: str) -> "Scan":
        """These tests, and that of effect `name` from `other` tests of the same data."""
        tests = ("gain", "basis", "shift", "information")
        return replace(self, **{test: getattr(self, test) | {name: getattr(other, test)[name]} for test in tests})

    def expected_loss(self, truth: str, other: str) -> float:
        """Expected loss in nats on this design if `other` is fitted but `truth` acts."""
        shift = self.shift[truth]
        caught = self.basis[other].T @ shift
        return float(0.5 * (shift @ shift - caught @ caught))

    def cosine(self, truth: str, other: str) -> float:
        """Cosine between the shift of `truth` and the columns of `other`."""
        shift = self.shift[truth]
        return float(np.linalg.norm(self.basis[other].T @ shift) / max(np.linalg.norm(shift), 1e-300))


def scan(slopes: Slopes, draws: int, rng: np.random.Generator) -> Scan:
    """Score tests of all candidates in `slopes`; `draws` draws of the null from `rng`."""
    Q = orthonormal(slopes.fitted)
    residual = slopes.residual - Q @ (Q.T @ slopes.residual)
    gain, basis, shift, information = {}, {}, {}, {}
    for name, U in slopes.candidates.items():
        U = U - Q @ (Q.T @ U)
        basis[name] = orthonormal(U)
        shift[name] = basis[name] @ (basis[name].T @ residual)
        gain[name] = float(0.5 * shift[name] @ shift[name])
        information[name] = U.T @ U
    null = np.zeros(draws)
    if basis:
        # only noise within the span of all columns matters
        joint = orthonormal(np.concatenate(list(basis.values()), axis=1))
        noise = 1.0 if slopes.unit_noise else np.sqrt(np.mean(residual**2))
        z = rng.standard_normal((joint.shape[1], draws)) * noise
        null = np.max([0.5 * ((B.T @ joint @ z) ** 2).sum(axis=0) for B in basis.values()], axis=0)
    return Scan(gain, null, basis, shift, information)


def orthonormal(columns: np.ndarray) -> np.ndarray:
    """Orthonormal basis (N, rank) of the columns (N, p), without rounding directions."""
    scale = np.linalg.norm(columns, axis=0)
    columns = columns[:, scale > 0] / scale[scale > 0]
    if columns.shape[1] == 0:
        return np.zeros((len(columns), 0))
    U, s, _ = np.linalg.svd(columns, full_matrices=False)
    return U[:, s > RANK * s[0]]
