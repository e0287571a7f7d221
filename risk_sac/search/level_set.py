"""Gaussian-process classifier of passing and failing, with an acquisition for its boundary.

Everything works in float64 and draws no random number but those that a seed names.

References:
    Hensman, Matthews and Ghahramani 2015, Scalable variational Gaussian process classification.
    Bryan et al. 2005, Active learning for identifying function threshold boundaries (straddle).
    Hvarfner et al. 2024, Vanilla Bayesian optimization performs great in high dimensions (priors of lengthscales).
"""

import math
import warnings

import numpy as np
import torch
from torch import Tensor

from risk_sac.world.types import Bools, Floats

with warnings.catch_warnings():
    # linear_operator compiles its helpers with torch.jit while it is imported.
    warnings.filterwarnings("ignore", message=r"`torch\.jit\.script", category=DeprecationWarning)
    from gpytorch.distributions import MultivariateNormal
    from gpytorch.kernels import MaternKernel, ScaleKernel
    from gpytorch.likelihoods import BernoulliLikelihood
    from gpytorch.means import ConstantMean
    from gpytorch.mlls import VariationalELBO
    from gpytorch.models import ApproximateGP
    from gpytorch.optim import NGD
    from gpytorch.priors import LogNormalPrior, NormalPrior
    from gpytorch.settings import cholesky_jitter
    from gpytorch.variational import NaturalVariationalDistribution, VariationalStrategy

STEPS, NATURAL_RATE, RATE = 20, 0.8, 0.2  # of a fit: natural gradient of the posterior, Adam of the kernel; choice
WIDE = 1.96  # standard deviations of the straddle, Bryan et al.
SCALE, SCALE_SPREAD = math.log(20.0), 0.7  # prior of the latent's variance: outcomes hardly vary at one point; choice
JITTER = 1e-5
# Noise that an outcome at a latent of 0 has as an observation of it: 1 / (-∂² log Φ) there.
OUTCOME_VARIANCE = math.pi / 2


class _Latent(ApproximateGP):  # type: ignore[misc]  # gpytorch has no types
    """Latent function of the classifier, with an inducing point at each observation."""

    def __init__(self, points: Tensor) -> None:
        count, dimension = points.shape
        distribution = NaturalVariationalDistribution(count, mean_init_std=0.0)  # else it begins with noise
        super().__init__(VariationalStrategy(self, points, distribution, learn_inducing_locations=False))
        lengths = LogNormalPrior(math.sqrt(2.0) + math.log(dimension) / 2 - 1.5, 1.0)
        self.mean_module = ConstantMean(constant_prior=NormalPrior(0.0, 1.0))
        kernel = MaternKernel(nu=2.5, ard_num_dims=dimension, lengthscale_prior=lengths)
        self.covar_module = ScaleKernel(kernel, outputscale_prior=LogNormalPrior(SCALE, SCALE_SPREAD))
        kernel.lengthscale = 0.5
        self.covar_module.outputscale = math.exp(SCALE)

    def forward(self, points: Tensor) -> MultivariateNormal:
        """The prior at points, `n x d`."""
        return MultivariateNormal(self.mean_module(points), self.covar_module(points))


class FailureClassifier:
    """Probability of failing at points of the unit cube, fitted to outcomes.

    P(fails | x) = Φ(f(x)),  f ~ GP(m, s² Matérn-5/2 with a lengthscale per axis)

    The same outcomes in the same order give the same classifier.
    """

    def __init__(self, points: Floats, fails: Bools) -> None:
        """Fits by maximising the evidence's lower bound.

        Args:
          points: `n x d`, in [0, 1].
          fails: `n`; both classes have to be among them.
        """
        x, y = torch.from_numpy(points), torch.from_numpy(fails.astype(np.float64))
        self._latent, likelihood = _Latent(x).double(), BernoulliLikelihood()
        bound = VariationalELBO(likelihood, self._latent, num_data=len(x))
        kernel = torch.optim.Adam(self._latent.hyperparameters(), lr=RATE)
        posterior = NGD(self._latent.variational_parameters(), num_data=len(x), lr=NATURAL_RATE)
        with cholesky_jitter(double_value=JITTER), torch.random.fork_rng(devices=[]):
            for _ in range(STEPS):
                kernel.zero_grad()
                posterior.zero_grad()
                loss = -bound(self._latent(x), y)
                loss.backward()
                kernel.step()
                posterior.step()
        self._latent.eval()

    def latent(self, points: Floats, out: Floats | None = None) -> tuple[Floats, Floats]:
        """Returns mean and deviation of the latent function; above 0 most fail.

        Args:
          points: `n x d`.
          out: `m x d`, where outcomes are awaited. Each is taken for what the mean says, so that the mean stays and
            the deviation falls around them: σ²(x) - k(x, out) (K(out, out) + s² I)⁻¹ k(out, x).

        Source: Desautels et al. 2014, Parallelizing exploration-exploitation tradeoffs in Gaussian process bandit
        optimization (hallucinated observations).
        """
        with torch.no_grad(), cholesky_jitter(double_value=JITTER):
            if out is None or not len(out):
                at = self._latent(torch.from_numpy(points))
                return at.mean.numpy(), at.variance.clamp_min(0.0).sqrt().numpy()
            count, at = len(points), self._latent(torch.from_numpy(np.concatenate((points, out))))
            covariance = at.covariance_matrix
            awaited = covariance[count:, count:] + OUTCOME_VARIANCE * torch.eye(len(out), dtype=covariance.dtype)
            across = covariance[:count, count:]
            told = (across * torch.linalg.solve(awaited, across.T).T).sum(dim=1)
            variance = covariance.diagonal()[:count] - told
            return at.mean[:count].numpy(), variance.clamp_min(0.0).sqrt().numpy()

    def probability(self, points: Floats) -> Floats:
        """Probability of failing at points, `n`: the latent's uncertainty is integrated out."""
        mean, deviation = self.latent(points)
        return np.asarray(torch.special.ndtr(torch.from_numpy(mean / np.sqrt(1.0 + deviation**2))).numpy())

    def samples(self, points: Floats, count: int, seed: int) -> Floats:
        """Draws latent functions at points, `count x n`, from the joint posterior."""
        with torch.no_grad(), cholesky_jitter(double_value=JITTER):
            at = self._latent(torch.from_numpy(points))
            covariance = at.covariance_matrix
            values, vectors = torch.linalg.eigh((covariance + covariance.T) / 2)
            root = vectors * values.clamp_min(0.0).sqrt()
            noise = torch.randn(count, len(points), generator=torch.Generator().manual_seed(seed), dtype=root.dtype)
            return np.asarray((at.mean + noise @ root.T).numpy())


def straddle(classifier: FailureClassifier, points: Floats, out: Floats | None = None) -> Floats:
    """Ambiguity of points, `n`: largest near the boundary, away from awaited outcomes.

    a(x) = 1.96 σ(x) - |μ(x)|, with the deviation that is left at `out`; see `FailureClassifier.latent`.

    Source: Bryan et al. 2005.
    """
    mean, deviation = classifier.latent(points, out)
    return WIDE * deviation - np.abs(mean)
