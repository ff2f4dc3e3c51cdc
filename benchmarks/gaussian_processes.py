"""Training of a wrench learner at 450 impacts: ours, scikit-learn and plain GPyTorch, in one run.

    python -m benchmarks.gaussian_processes [--data DIR] [-n N] [--starts S] [--quick] [-o FILE.csv]

The same task for all: three exact Gaussian processes (c_t, c_n, τ) with ARD squared-exponential kernels on the features
X1 of N impacts (the measured planar impacts if they are here, else simulated ones), hyperparameters by the marginal
likelihood on the same standardised data.  CPU seconds on one core, the log marginal likelihood reached (sum over the
outputs, nats), and the least for any output that another method reached above it (`behind`).

- ours: L-BFGS-B on the written-out gradient, S starts; without priors and robust rounds, so that all climb the same
  hill;
- scikit-learn: GaussianProcessRegressor with S starts, its own L-BFGS-B and gradient;
- GPyTorch: ExactGP with automatic differentiation and Adam at a rate of 0.1, 100 steps, one start, all outputs in one
  batch: the way of its own tutorial.
"""

import time
import warnings
from collections.abc import Callable

import numpy as np

from benchmarks.impacts import add_impact_options, chosen_impacts
from benchmarks.results import Results, benchmark_parser
from thesis_lib.learners.features import features, impulse_of
from thesis_lib.learners.gaussian_process import GaussianProcessSettings, fit_gaussian_process
from thesis_lib.learners.marginal_likelihood import BOUNDS

STEPS, RATE = 100, 0.1
Trainer = Callable[[np.ndarray, np.ndarray, int], np.ndarray]


def ours(x: np.ndarray, y: np.ndarray, starts: int) -> np.ndarray:
    """Log marginal likelihood of each output."""
    settings = GaussianProcessSettings(restarts=starts, prior=False, robust_rounds=0, device="cpu")
    return fit_gaussian_process(x, y, np.random.default_rng(0), settings).log_likelihood


def scikit_learn(x: np.ndarray, y: np.ndarray, starts: int) -> np.ndarray:
    """The same by scikit-learn."""
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

    found = []
    for one in y.T:
        kernel = ConstantKernel(1.0, BOUNDS["signal"]) * RBF([2.0] * x.shape[1], BOUNDS["lengthscale"])
        kernel += WhiteKernel(0.1, BOUNDS["noise"])
        process = GaussianProcessRegressor(kernel, alpha=0.0, n_restarts_optimizer=starts - 1, random_state=0)
        found.append(process.fit(x, one).log_marginal_likelihood_value_)
    return np.array(found)


def gpytorch_adam(x: np.ndarray, y: np.ndarray, starts: int) -> np.ndarray:
    """The same by GPyTorch and Adam, one start."""
    import gpytorch
    import torch

    inputs = torch.as_tensor(x).expand(y.shape[1], -1, -1).contiguous()
    targets = torch.as_tensor(np.ascontiguousarray(y.T))
    batch = torch.Size([y.shape[1]])

    class Plain(gpytorch.models.ExactGP):
        def __init__(self) -> None:
            super().__init__(inputs, targets, gpytorch.likelihoods.GaussianLikelihood(batch_shape=batch))
            self.mean_module = gpytorch.means.ZeroMean(batch_shape=batch)
            kernel = gpytorch.kernels.RBFKernel(ard_num_dims=x.shape[1], batch_shape=batch)
            self.covar_module = gpytorch.kernels.ScaleKernel(kernel, batch_shape=batch)

        def forward(self, at: torch.Tensor) -> object:
            return gpytorch.distributions.MultivariateNormal(self.mean_module(at), self.covar_module(at))

    model = Plain().double()
    model.train()
    likelihood = gpytorch.mlls.ExactMarginalLogLikelihood(model.likelihood, model)
    optimiser = torch.optim.Adam(model.parameters(), lr=RATE)
    for _ in range(STEPS + 1):
        optimiser.zero_grad()
        values = likelihood(model(inputs), targets)
        (-values.sum()).backward()
        optimiser.step()
    return (values.detach() * len(x)).numpy()


METHODS: dict[str, Trainer] = {"ours": ours, "scikit-learn": scikit_learn, "GPyTorch, Adam": gpytorch_adam}


def measure(x: np.ndarray, y: np.ndarray, starts: int) -> dict[str, dict[str, float]]:
    """CPU seconds and likelihood of every method for standardised x (n, d), y (n, p)."""
    reached, results = {}, {}
    for name, train in METHODS.items():
        train(x[:30], y[:30], 1)  # imports and first calls
        start = time.process_time()
        reached[name] = train(x, y, starts)
        results[name] = {"cpu_s": round(time.process_time() - start, 2)}
    best = np.max(list(reached.values()), axis=0)
    for name, value in reached.items():
        results[name] |= {
            "log_likelihood": round(float(value.sum()), 2),
            "behind": round(float(np.max(best - value)), 2),
        }
    return results


def main(arguments: list[str] | None = None) -> None:
    parser = benchmark_parser("gaussian_processes", "Training of Gaussian processes.")
    add_impact_options(parser, 450)
    parser.add_argument("--starts", type=int, default=2)
    options = parser.parse_args(arguments)
    rng = np.random.default_rng(0)
    if options.quick:
        options.n, options.simulated, options.starts = 30, True, 1
    impacts, source = chosen_impacts(parser, options, rng)
    impacts = impacts.sample(options.n, rng)
    print(f"{len(impacts)} {source} impacts, {options.starts} starts")
    x, y = features(impacts, "X1"), impulse_of(impacts.dv, impacts, wrench=True)
    x, y = ((a - a.mean(axis=0)) / a.std(axis=0) for a in (x, y))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # lengths at their bounds
        reached = measure(x, y, options.starts)
    results = Results("gaussian_processes")
    print(f"{'':18s}{'CPU s':>8s}{'times ours':>12s}{'log likelihood':>16s}{'behind':>9s}")
    for name, row in reached.items():
        ratio = row["cpu_s"] / max(reached["ours"]["cpu_s"], 0.01)
        results.add(f"{name}: CPU time", row["cpu_s"], "s", f"{len(impacts)} impacts")
        results.add(f"{name}: log likelihood behind the best", row["behind"], "nats", "the worst of three outputs")
        print(f"{name:18s}{row['cpu_s']:8.2f}{ratio:12.1f}{row['log_likelihood']:16.2f}{row['behind']:9.2f}")
    results.write(options.out)


if __name__ == "__main__":
    main()
