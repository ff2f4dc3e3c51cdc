"""Models without physics that learn what happens from its numbers: sparse regression (PySINDy) and Gaussian processes.

Both take inputs X (n, d), targets Y (n, p) and one weight a row, and return a predictor.  Inputs and targets are scaled
to unit spread; nothing else is told to them.

- `sindy`: sequentially thresholded least squares on polynomials of the inputs; degree and threshold by 5-fold
  cross-validation over trials, which PySINDy leaves to its user;
- `gaussian_process`: one a target, a squared-exponential kernel with a length scale an input, by scikit-learn.

Source: S. Brunton, J. Proctor, N. Kutz, PNAS 113 (2016) 3932, doi 10.1073/pnas.1517384113 (SINDy).
"""

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

DEGREES = (1, 2, 3)
THRESHOLDS = (0.03, 0.1, 0.3)  # of a coefficient in units of the spreads of target and term
RIDGE = 1e-3
FOLDS = 5
NUGGET = 1e-6  # of the variance, for the Cholesky factor; the kernel learns the noise
EXCESS = 0.1  # of the variance: typical noise of a flight's acceleration
RESTARTS = 2
MOST = 400  # impacts for a Gaussian process, whose cost grows with the third power


@dataclass(frozen=True)
class Trained:
    """A trained model.

    Attributes:
        predict: inputs (n, d) to targets (n, p).
        terms: for each target the terms with a coefficient in units of the spreads; empty where it has none.
    """

    predict: Callable[[np.ndarray], np.ndarray]
    terms: tuple[dict[str, float], ...] = ()


def sindy(X: np.ndarray, Y: np.ndarray, weight: np.ndarray, trial: np.ndarray, names: Sequence[str]) -> Trained:
    """PySINDy's STLSQ on its polynomial library; weight (n,) multiplies the rows, trial (n,) is the unit of folds."""
    X, x_scale = _standardised(X, weight)
    folds = np.unique(trial, return_inverse=True)[1] % FOLDS
    best = min(
        ((_validated(X, Y, weight, folds, d, t), d, t) for d in DEGREES for t in THRESHOLDS), key=lambda found: found[0]
    )
    _, degree, threshold = best
    fit = _stlsq(X, Y, weight, degree, threshold)
    labels = fit.library.get_feature_names(list(names))
    terms = tuple({labels[i]: float(row[i]) for i in np.flatnonzero(row)} for row in fit.coefficients)
    return Trained(lambda new: fit.predict((new - x_scale[0]) / x_scale[1]), terms)


@dataclass(frozen=True)
class _Sparse:
    library: object
    centre: np.ndarray
    spread: np.ndarray
    y_centre: np.ndarray
    y_spread: np.ndarray
    coefficients: np.ndarray

    def predict(self, X: np.ndarray) -> np.ndarray:
        terms = (np.asarray(self.library.transform(X)) - self.centre) / self.spread
        return self.y_centre + terms @ self.coefficients.T * self.y_spread


def _stlsq(X: np.ndarray, Y: np.ndarray, weight: np.ndarray, degree: int, threshold: float) -> _Sparse:
    import pysindy

    library = pysindy.PolynomialLibrary(degree=degree, include_bias=False)
    terms = np.asarray(library.fit_transform(X))
    terms, (centre, spread) = _standardised(terms, weight)
    targets, (y_centre, y_spread) = _standardised(Y, weight)
    optimizer = pysindy.STLSQ(threshold=threshold, alpha=RIDGE)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # all terms fell below the threshold: an answer here
        optimizer.fit(terms * weight[:, None], targets * weight[:, None])
    return _Sparse(library, centre, spread, y_centre, y_spread, np.atleast_2d(optimizer.coef_))


def _validated(X, Y, weight, folds, degree: int, threshold: float) -> float:
    squares = 0.0
    for k in range(FOLDS):
        rest, own = folds != k, folds == k
        fit = _stlsq(X[rest], Y[rest], weight[rest], degree, threshold)
        misses = (Y[own] - fit.predict(X[own])) * weight[own, None]
        squares += float(np.sum((misses / Y.std(axis=0)) ** 2))
    return squares


def gaussian_process(
    X: np.ndarray, Y: np.ndarray, weight: np.ndarray, trial: np.ndarray, names: Sequence[str]
) -> Trained:
    """A Gaussian process a target; arguments as for `sindy`; trial and names are not used."""
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

    X, Y, weight = X[:MOST], Y[:MOST], weight[:MOST]
    X, (x_centre, x_spread) = _standardised(X, weight)
    Y, (centre, spread) = _standardised(Y, weight)
    # rows with more noise than the best count less; what noise the best have, the kernel learns
    alpha = NUGGET + EXCESS * (weight**-2 - np.min(weight**-2)) / np.mean(weight**-2)
    processes = []
    for y in Y.T:
        kernel = ConstantKernel(1.0, (1e-4, 1e3)) * RBF(np.full(X.shape[1], 2.0), (0.1, 1e3))
        kernel += WhiteKernel(0.3, (1e-6, 10.0))
        process = GaussianProcessRegressor(kernel, alpha=alpha, n_restarts_optimizer=RESTARTS, random_state=0)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # a length scale at its bound: an input that does not matter
            processes.append(process.fit(X, y))

    def predict(new: np.ndarray) -> np.ndarray:
        inputs = (new - x_centre) / x_spread
        return centre + spread * np.stack([process.predict(inputs) for process in processes], axis=1)

    return Trained(predict)


def _standardised(a: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, tuple[np.ndarray, np.ndarray]]:
    """(a − weighted mean) over weighted spread, and the two; a column without spread stays as it is, centred."""
    w = weight**2 / np.sum(weight**2)
    centre = w @ a
    spread = np.sqrt(w @ (a - centre) ** 2)
    spread = np.where(spread > 1e-12, spread, 1.0)
    return (a - centre) / spread, (centre, spread)
