"""Gaussian process of scenes, fitted and searched with BoTorch; higher is better.

Everything works in float64. What draws random numbers takes a seed, and leaves torch's global generator as it was.

References:
    Ament et al. 2023, Unexpected improvements to expected improvement (LogEI).
    Hvarfner et al. 2024, Vanilla Bayesian optimization performs great in high dimensions (BoTorch's priors).
"""

import warnings

import torch
from torch import Tensor

with warnings.catch_warnings():
    # linear_operator compiles its helpers with torch.jit while it is imported.
    warnings.filterwarnings("ignore", message=r"`torch\.jit\.script", category=DeprecationWarning)
    from botorch.acquisition import LogExpectedImprovement, PosteriorMean
    from botorch.fit import fit_gpytorch_mll
    from botorch.models import SingleTaskGP
    from botorch.optim import optimize_acqf, optimize_acqf_discrete
    from botorch.utils.sampling import manual_seed
    from gpytorch.mlls import ExactMarginalLogLikelihood
    from gpytorch.settings import fast_pred_var, skip_posterior_variances

Hyperparameters = dict[str, Tensor]
"""Raw kernel, mean and noise parameters by their name in the model."""

FIT_ITERATIONS = 20  # a warm start continues from here at the next fit
ASCENT_ITERATIONS = 3  # within about half a nat of the maximum, which takes five times as long


def condition(points: Tensor, values: Tensor, hyperparameters: Hyperparameters | None) -> SingleTaskGP:
    """Returns a Gaussian process with inferred noise on standardised values.

    Args:
        points: `n x d`, in [0, 1].
        values: `n`, not all equal.
        hyperparameters: as `fit` returned them; None takes the priors' modes.

    Returns:
        A model in evaluation mode: ARD RBF kernel, BoTorch's dimension-scaled priors.
    """
    standardised = (values - values.mean()) / values.std()
    model = SingleTaskGP(points, standardised.unsqueeze(-1), outcome_transform=None)
    if hyperparameters is not None:
        model.load_state_dict(hyperparameters, strict=False)  # the priors' buffers stay the model's
    return model.eval()


def fit(points: Tensor, values: Tensor, start: Hyperparameters | None, seed: int) -> Hyperparameters:
    """Maximises the marginal likelihood from `start`; other arguments as for `condition`."""
    model = condition(points, values, start)
    with manual_seed(seed):  # a fit that fails starts again from a draw of the priors
        fit_gpytorch_mll(
            ExactMarginalLogLikelihood(model.likelihood, model),
            optimizer_kwargs={"options": {"maxiter": FIT_ITERATIONS}},
            warning_handler=lambda warning: True,  # a search that ends early leaves the best parameters so far
        )
    return {name: parameter.detach().clone() for name, parameter in model.named_parameters()}


def believe(
    model: SingleTaskGP, points: Tensor, values: Tensor, out: Tensor, hyperparameters: Hyperparameters
) -> SingleTaskGP:
    """Returns the model with posterior means at points `out`, `m x d`.

    So the next point is elsewhere. Source: the kriging believer of Ginsbourger et al. 2010, Kriging is well-suited to
    parallelize optimization.
    """
    with skip_posterior_variances(), torch.no_grad():
        mean = model.posterior(out).mean[:, 0] * values.std() + values.mean()
    return condition(torch.cat((points, out)), torch.cat((values, mean)), hyperparameters)


def maximise_expected_improvement(model: SingleTaskGP, choices: Tensor) -> Tensor:
    """Returns the point of largest LogEI, `d`.

    A short gradient ascent starts from the best of the choices, `k x d`.

    Choice: the incumbent is the best posterior mean at the observed points. It is not fooled by one lucky noisy value
    as the best observation would be, and costs one pass, where (q)LogNEI integrates over the incumbent by sampling.
    """
    model.requires_grad_(False)
    bounds = torch.tensor([[0.0], [1.0]], dtype=choices.dtype).expand(2, choices.shape[1])
    with skip_posterior_variances():
        incumbent = model.posterior(model.train_inputs[0]).mean.max()
    acquisition = LogExpectedImprovement(model, incumbent)
    with fast_pred_var():
        start, _ = optimize_acqf_discrete(acquisition, q=1, choices=choices)
        ascent = {"maxiter": ASCENT_ITERATIONS}
        point: Tensor
        point, _ = optimize_acqf(
            acquisition, bounds, q=1, num_restarts=1, batch_initial_conditions=start[None], options=ascent
        )
    return point[0]


def best_by_mean(model: SingleTaskGP, choices: Tensor) -> Tensor:
    """Returns the choice of largest posterior mean, `d`, of `k x d`."""
    point: Tensor
    with skip_posterior_variances():
        point, _ = optimize_acqf_discrete(PosteriorMean(model), q=1, choices=choices)
    return point[0]
