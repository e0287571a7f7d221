"""The Gaussian process over scenes and its acquisition function; higher values are better here.

All functions are pure, work in float64 and draw no random numbers: fitting goes through `fit_gpytorch_mll_scipy`
because `fit_gpytorch_mll` restarts a failed fit from torch's global generator.

References:
    Ament et al. 2023, Unexpected improvements to expected improvement (LogEI).
    Hvarfner et al. 2024, Vanilla Bayesian optimization performs great in high dimensions (BoTorch's priors).
"""

import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager

import torch
from torch import Tensor

with warnings.catch_warnings():
    # linear_operator compiles its helpers with torch.jit while it is imported.
    warnings.filterwarnings("ignore", message=r"`torch\.jit\.script", category=DeprecationWarning)
    from botorch.acquisition.analytic import LogExpectedImprovement
    from botorch.exceptions.warnings import OptimizationWarning
    from botorch.generation.gen import gen_candidates_scipy
    from botorch.models import SingleTaskGP
    from botorch.optim.fit import fit_gpytorch_mll_scipy
    from gpytorch.mlls import ExactMarginalLogLikelihood
    from linear_operator.settings import max_cholesky_size
    from linear_operator.utils.warnings import NumericalWarning

Hyperparameters = dict[str, Tensor]
"""Raw kernel, mean and noise parameters by their name in the model."""

FIT_ITERATIONS = 50  # a warm start goes on from here at the next refit
REFINED = 4  # best candidates polished by gradient ascent
REFINEMENT_ITERATIONS = 15
# A line search that ends early leaves the best parameters or scene so far, which is all that is needed.
_STOPPED_EARLY = r"(?s).*(status|iterations)"


@contextmanager
def _exact() -> Iterator[None]:
    """Exact linear algebra, and silence about the two warnings that are no news here."""
    # Above its default of 800 points gpytorch turns to conjugate gradients, with probes from the global generator.
    with max_cholesky_size(100_000), warnings.catch_warnings(record=True) as caught:
        warnings.filterwarnings("ignore", category=NumericalWarning, message=".*jitter")
        warnings.filterwarnings("ignore", category=OptimizationWarning, message=_STOPPED_EARLY)
        yield
    for entry in caught:  # BoTorch forces its OptimizationWarning past any filter, so it is filtered here once more
        if not (issubclass(entry.category, OptimizationWarning) and re.match(_STOPPED_EARLY, str(entry.message))):
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
    with _exact():
        fit_gpytorch_mll_scipy(
            ExactMarginalLogLikelihood(model.likelihood, model.train()), options={"maxiter": FIT_ITERATIONS}
        )
    return {name: parameter.detach().clone() for name, parameter in model.named_parameters()}


def propose(model: SingleTaskGP, points: Tensor, candidates: Tensor) -> Tensor:
    """The point of largest log expected improvement.

    Choice: analytic LogEI over the best posterior mean at the observed points. That incumbent is not fooled by one
    lucky noisy value, as the best observation would be, and costs one pass, where (q)LogNEI integrates over the
    incumbent by sampling at more than ten times the price.

    Args:
        model: from `condition`.
        points: `n x d`, the observed points.
        candidates: `k x d`, in [0, 1]; the best few are refined by bounded gradient ascent.

    Returns:
        `d`, in [0, 1].
    """
    with _exact():
        with torch.no_grad():
            incumbent = model.posterior(points).mean.max()
            acquisition = LogExpectedImprovement(model, incumbent)
            scores = acquisition(candidates.unsqueeze(-2))  # k
        starts = candidates[scores.topk(min(REFINED, len(candidates))).indices].unsqueeze(-2)  # REFINED x 1 x d
        refined, refined_scores = gen_candidates_scipy(
            starts, acquisition, 0.0, 1.0, options={"maxiter": REFINEMENT_ITERATIONS}
        )
    best: Tensor = refined[refined_scores.argmax(), 0].detach().clamp(0.0, 1.0)
    return best
