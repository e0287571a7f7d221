"""The Gaussian process over scenes and its acquisition function; higher values are better here.

The model is BoTorch's; its likelihood and posterior are computed here by exact linear algebra. Everything is pure,
works in float64 and draws no random numbers: fitting goes through `fit_gpytorch_mll_scipy`
because `fit_gpytorch_mll` restarts a failed fit from torch's global generator.

References:
    Ament et al. 2023, Unexpected improvements to expected improvement (LogEI).
    Hvarfner et al. 2024, Vanilla Bayesian optimization performs great in high dimensions (BoTorch's priors).
    Rasmussen and Williams 2006, Gaussian processes for machine learning.
"""

import math
import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial

import torch
from torch import Tensor

with warnings.catch_warnings():
    # linear_operator compiles its helpers with torch.jit while it is imported.
    warnings.filterwarnings("ignore", message=r"`torch\.jit\.script", category=DeprecationWarning)
    from botorch.acquisition.analytic import _log_ei_helper
    from botorch.exceptions.warnings import OptimizationWarning
    from botorch.models import SingleTaskGP
    from botorch.optim.closures import ForwardBackwardClosure
    from botorch.optim.fit import fit_gpytorch_mll_scipy
    from gpytorch.mlls import ExactMarginalLogLikelihood

Hyperparameters = dict[str, Tensor]
"""Raw kernel, mean and noise parameters by their name in the model."""

FIT_ITERATIONS = 50  # a warm start goes on from here at the next refit


@contextmanager
def _may_stop_early() -> Iterator[None]:
    """Silence about a line search that ends early: it leaves the best parameters so far, which is all that is needed.

    BoTorch forces its OptimizationWarning past any filter, so warnings are caught and those of other kinds repeated.
    """
    with warnings.catch_warnings(record=True) as caught:
        yield
    for entry in caught:
        expected = re.match(r"(?s).*(status|iterations)", str(entry.message))
        if not (issubclass(entry.category, OptimizationWarning) and expected):
            warnings.warn_explicit(entry.message, entry.category, entry.filename, entry.lineno)


def condition(points: Tensor, values: Tensor, hyperparameters: Hyperparameters | None) -> SingleTaskGP:
    """Gaussian process with inferred noise on standardised values.

    Args:
        points: `n x d`, in [0, 1].
        values: `n`, not all equal.
        hyperparameters: as `fit` returned them; None takes the priors' modes.

    Returns:
        A model in evaluation mode: ARD RBF kernel, BoTorch's dimension-scaled priors.
    """
    model = SingleTaskGP(points, values.unsqueeze(-1))
    if hyperparameters is not None:
        model.load_state_dict(hyperparameters, strict=False)  # priors' buffers and the data's scale stay the model's
    return model.eval()


def fit(points: Tensor, values: Tensor, start: Hyperparameters | None) -> Hyperparameters:
    """Maximise the marginal likelihood from `start`; arguments as for `condition`."""
    model = condition(points, values, start)
    likelihood = ExactMarginalLogLikelihood(model.likelihood, model)
    closure = ForwardBackwardClosure(partial(loss, model), dict(likelihood.named_parameters()))
    with _may_stop_early():
        fit_gpytorch_mll_scipy(likelihood, closure=closure, options={"maxiter": FIT_ITERATIONS})
    return {name: parameter.detach().clone() for name, parameter in model.named_parameters()}


def loss(model: SingleTaskGP) -> Tensor:
    """What `ExactMarginalLogLikelihood` of the model makes of its own data, negated, in half the time.

    -(log N(y; c, K) + Σ log prior) / n,  K = k(X, X) + σ² I,  k(x, x') = exp(-½ Σ_i (x_i - x'_i)² / l_i²)

    Source: Rasmussen and Williams 2006, Eq. 2.30.
    """
    _, factor, residuals = _factorise(model)
    count = len(residuals)
    whitened = torch.linalg.solve_triangular(factor, residuals[:, None], upper=False)
    log_likelihood = -0.5 * (whitened.square().sum() + count * math.log(2 * math.pi)) - factor.diagonal().log().sum()
    log_prior = sum(prior.log_prob(value(module)).sum() for _, module, prior, value, _ in model.named_priors())
    result: Tensor = -(log_likelihood + log_prior) / count
    return result


def _factorise(model: SingleTaskGP) -> tuple[Tensor, Tensor, Tensor]:
    """Scaled points X / l, `n x d`; Cholesky factor of K, `n x n`; residuals y - c of standardised values, `n`."""
    points = model.train_inputs[0] / model.covar_module.lengthscale
    residuals = model.train_targets - model.mean_module.constant
    noise = model.likelihood.noise * torch.eye(len(residuals), dtype=residuals.dtype)  # BoTorch keeps σ² >= 1e-4
    return points, torch.linalg.cholesky(_kernel(points, points) + noise), residuals


def _kernel(a: Tensor, b: Tensor) -> Tensor:
    """exp(-½ |a_i - b_j|²), `n x k`, from scaled points, `n x d` and `k x d`."""
    return (a @ b.T - 0.5 * a.square().sum(1)[:, None] - 0.5 * b.square().sum(1)).exp()


class Posterior:
    """What `model.posterior` says, in a few matrix products: without its generality, and so without its overhead.

    m(x) = c + k(x)ᵀ K⁻¹ (y - c),  s²(x) = 1 - k(x)ᵀ K⁻¹ k(x)

    Source: Rasmussen and Williams 2006, Alg. 2.1.
    """

    @torch.no_grad()
    def __init__(self, model: SingleTaskGP) -> None:
        """Factorise K once, for the model that `condition` returned."""
        self._lengthscales, self._constant = model.covar_module.lengthscale, model.mean_module.constant
        self._location, self._scale = model.outcome_transform.means[0, 0], model.outcome_transform.stdvs[0, 0]
        self._points, self._factor, residuals = _factorise(model)
        self._weights = torch.cholesky_solve(residuals[:, None], self._factor)[:, 0]  # n
        self._incumbent = self(model.train_inputs[0])[0].max()

    @torch.no_grad()
    def __call__(self, x: Tensor) -> tuple[Tensor, Tensor]:
        """Mean and standard deviation without noise, `k` each, at x, `k x d`."""
        cross = _kernel(self._points, x / self._lengthscales)  # n x k
        explained = torch.linalg.solve_triangular(self._factor, cross, upper=False).square().sum(0)
        deviation = (1.0 - explained).clamp_min(1e-12).sqrt()
        return self._location + self._scale * (self._constant + self._weights @ cross), self._scale * deviation

    def log_expected_improvement(self, x: Tensor) -> Tensor:
        """Analytic LogEI at x, `k x d`, over the best posterior mean at the observed points.

        Choice: that incumbent is not fooled by one lucky noisy value, as the best observation would be, and costs one
        pass, where (q)LogNEI integrates over the incumbent by sampling at a hundred times the price.

        Returns:
            `k`.
        """
        mean, deviation = self(x)
        score: Tensor = _log_ei_helper((mean - self._incumbent) / deviation) + deviation.log()
        return score
