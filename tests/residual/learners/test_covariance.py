"""Covariance matrices of Gaussian processes: against NumPy's plain equations, on the processor and on a GPU."""

import numpy as np
import pytest

from thesis_lib.learners import covariance

ROUNDING = 1e-10  # relative; the matrices' condition number is about 1e3


@pytest.fixture(params=["cpu", "cuda"])
def device(request):
    import torch

    if request.param == "cuda" and not torch.cuda.is_available():
        pytest.skip("no CUDA GPU here")
    return request.param


def _points(n, d=3):
    return np.random.default_rng(n).normal(size=(n, d))


def _kernel(z, other, signal=2.0):
    return signal * np.exp(-0.5 * ((z[:, None] - other[None]) ** 2).sum(-1))


def _noisy(n):
    z = _points(n)
    return _kernel(z, z) + 0.1 * np.eye(n)


def _tensor(values, device):
    import torch

    return torch.as_tensor(values.copy(), device=device)


def _near(found, expected):
    np.testing.assert_allclose(found.cpu().numpy(), expected, rtol=ROUNDING, atol=ROUNDING * np.abs(expected).max())


def test_covariance_is_the_kernel_and_never_above_the_variance(device):
    z, other = _points(40), _points(7)
    _near(covariance.covariance(_tensor(z, device), _tensor(other, device), 2.0), _kernel(z, other))
    far = 1e4 + z  # where squares of 1e8 cancel
    K = covariance.covariance(_tensor(far, device), _tensor(far, device), 2.0)
    assert float(K.max()) <= 2.0 * (1.0 + 1e-15)


@pytest.mark.parametrize("n", [1, 2, 37, 130])
def test_factor_solution_and_inverse_are_those_of_the_matrix(n, device):
    K_y, y = _noisy(n), _points(n, 1)[:, 0]
    L = covariance.factor(_tensor(K_y, device))
    _near(L.tril(), np.linalg.cholesky(K_y))
    expected = np.linalg.inv(K_y)
    _near(covariance.solve(L, _tensor(y, device)), expected @ y)
    k = _points(11, n)
    _near(covariance.explained(L, _tensor(k, device)), np.einsum("ij,jk,ik->i", k, expected, k))
    _near(covariance.inverse_diagonal(L.clone()), np.diag(expected))
    whole = covariance.inverse(L)
    _near(whole.tril(), np.tril(expected))
    B = _points(n, 4)
    _near(covariance.symmetric_product(whole, _tensor(B, device)), expected @ B)
    _near(covariance.product(_tensor(K_y, device), _tensor(B, device)), K_y @ B)


def test_a_matrix_that_is_not_positive_definite_is_refused(device):
    with pytest.raises(np.linalg.LinAlgError, match="not positive definite"):
        covariance.factor(_tensor(-_noisy(5), device))


def test_torch_is_left_out_of_the_work_on_the_processor(monkeypatch):
    # with the common kernels its MKL needs several times as long as the BLAS of NumPy and SciPy
    import torch

    def refused(*args, **kwargs):
        raise AssertionError("torch multiplies or factorises")

    for name in ("cholesky", "cholesky_ex", "solve_triangular", "inv"):
        monkeypatch.setattr(torch.linalg, name, refused)
    for name in ("cholesky_inverse", "cholesky_solve", "matmul", "addmm"):
        monkeypatch.setattr(torch, name, refused)
    monkeypatch.setattr(torch.Tensor, "__matmul__", refused)
    z = _tensor(_points(20), "cpu")
    K = covariance.covariance(z, z, 1.0)
    K.diagonal().add_(0.1)
    L = covariance.factor(K)
    covariance.solve(L, z[:, 0].contiguous())
    covariance.explained(L, _tensor(_points(5, 20), "cpu"))
    covariance.inverse_diagonal(L.clone())
    covariance.symmetric_product(covariance.inverse(L), z)
