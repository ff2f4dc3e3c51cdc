"""Covariance matrices of Gaussian processes: kernel, Cholesky factor, inverse, on the processor or on a GPU.

    k(x, x') = s exp(−½ |z − z'|²),   z_d = x_d / l_d
    log k    = (z, 1, −½|z|² + log s) · (z', −½|z'|², 1)         one product of matrices, then the exponential
    K_y = L Lᵀ,   K_y⁻¹ = L⁻ᵀ L⁻¹,   κ_i = [K_y⁻¹]_ii = Σ_j [L⁻¹]_ji²

| in code    | shape  | meaning                                                                           |
|------------|--------|-----------------------------------------------------------------------------------|
| `z`        | (n, d) | inputs divided by their lengths                                                   |
| `K`        | (n, m) | covariances                                                                       |
| `L`        | (n, n) | lower triangular factor; on the processor other numbers stand above its diagonal  |

Matrices are tensors of torch in float64.  On the processor LAPACK and BLAS of SciPy work on their memory: MKL, which
torch would call, needs 3 to 8 times as long with the common kernels of `foundation.kernels` (450 points: factor 0.9
instead of 3.7 ms, inverse 2.4 instead of 6.4 ms).  The exponential is torch's, which takes 0.4 of NumPy's time.  LAPACK
stores by columns where torch stores by rows, so that LAPACK's upper triangle is torch's lower one.
"""

import numpy as np
import torch
from scipy.linalg.blas import dsymm, dtrsm
from scipy.linalg.lapack import dpotrf, dpotri, dpotrs, dtrtri


def covariance(z: torch.Tensor, other: torch.Tensor, signal: float) -> torch.Tensor:
    """K (n, m) of points z (n, d) and others (m, d), with the variance s of the function."""
    top = np.log(signal)
    ones = z.new_ones((len(z), 1)), z.new_ones((len(other), 1))
    square, square_other = ((a * a).sum(1, keepdim=True).mul_(-0.5) for a in (z, other))
    left, right = torch.cat([z, ones[0], square.add_(top)], 1), torch.cat([other, square_other, ones[1]], 1)
    # rounding must not make a covariance larger than the variance
    return product(left, right.T).clamp_(max=top).exp_()


def product(A: torch.Tensor, B: torch.Tensor) -> torch.Tensor:
    """A B."""
    return A @ B if A.is_cuda else torch.from_numpy(A.numpy() @ B.numpy())


def symmetric_product(A: torch.Tensor, B: torch.Tensor) -> torch.Tensor:
    """A B (n, k) of a symmetric A (n, n), whose lower triangle is read, and B (n, k)."""
    return A @ B if A.is_cuda else torch.from_numpy(dsymm(1.0, A.numpy().T, B.numpy().T, side=1).T)


def factor(K_y: torch.Tensor) -> torch.Tensor:
    """L (n, n), which overwrites K_y; raises LinAlgError if K_y is not positive definite."""
    if K_y.is_cuda:
        L, failed = torch.linalg.cholesky_ex(K_y)
    else:
        L, failed = K_y, dpotrf(K_y.numpy().T, clean=0, overwrite_a=1)[1]
    if int(failed):
        raise np.linalg.LinAlgError("the covariance matrix is not positive definite")
    return L


def inverse(L: torch.Tensor) -> torch.Tensor:
    """K_y⁻¹ (n, n), valid in its lower triangle, which overwrites L."""
    if L.is_cuda:
        return torch.cholesky_inverse(L)
    dpotri(L.numpy().T, overwrite_c=1)
    return L


def solve(L: torch.Tensor, y: torch.Tensor) -> torch.Tensor:
    """α = K_y⁻¹ y (n,)."""
    if L.is_cuda:
        return torch.cholesky_solve(y[:, None], L)[:, 0]
    return torch.from_numpy(dpotrs(L.numpy().T, y.numpy())[0])


def inverse_diagonal(L: torch.Tensor) -> torch.Tensor:
    """κ (n,), the diagonal of K_y⁻¹, for half the work of the whole inverse; L is overwritten."""
    if L.is_cuda:
        L = torch.linalg.solve_triangular(L, torch.eye(len(L), dtype=L.dtype, device=L.device), upper=False)
    else:
        dtrtri(L.numpy().T, overwrite_c=1)
    return L.tril_().square_().sum(0)


def explained(L: torch.Tensor, k: torch.Tensor) -> torch.Tensor:
    """k_iᵀ K_y⁻¹ k_i (m,) of the rows of k (m, n) as |L⁻¹ k_i|²; k is overwritten."""
    if L.is_cuda:
        return torch.linalg.solve_triangular(L, k.T, upper=False).square_().sum(0)
    dtrsm(1.0, L.numpy().T, k.numpy().T, trans_a=1, overwrite_b=1)
    return k.square_().sum(1)
