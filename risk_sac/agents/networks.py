"""Tanh-Gaussian policy and twin critics, sized and initialised without torch's global generator.

Source: Haarnoja et al., "Soft actor-critic algorithms and applications", 2018, Sec. 5 and App. C.
"""

import math
from collections.abc import Sequence
from itertools import pairwise

import torch
import torch.nn.functional as F  # noqa: N812  # the name all of torch's users know
from torch import Tensor, nn

# Choice: log σ is squashed smoothly into these bounds; a hard clamp has no gradient outside them.
LOG_STD_MIN = -5.0
LOG_STD_MAX = 2.0


class Policy(nn.Module):
    """Mean and log standard deviation of the Gaussian under the tanh, π_θ."""

    def __init__(
        self, observation_size: int, action_size: int, hidden_sizes: Sequence[int], generator: torch.Generator
    ) -> None:
        super().__init__()
        sizes = (observation_size, *hidden_sizes, 2 * action_size)
        fans = list(pairwise(sizes))
        self.weights = nn.ParameterList(_uniform((fan_in, fan_out), fan_in, generator) for fan_in, fan_out in fans)
        self.biases = nn.ParameterList(_uniform((fan_out,), fan_in, generator) for fan_in, fan_out in fans)

    def forward(self, observation: Tensor) -> tuple[Tensor, Tensor]:
        """Parameters of the Gaussian.

        Args:
          observation: `batch x observation_size`.

        Returns:
          Mean and log standard deviation, each `batch x action_size`.
        """
        layers = list(zip(self.weights, self.biases, strict=True))
        hidden = observation
        for weight, bias in layers[:-1]:
            hidden = torch.addmm(bias, hidden, weight).relu_()
        weight, bias = layers[-1]
        mean, raw = torch.addmm(bias, hidden, weight).chunk(2, dim=-1)
        return mean, bounded_log_std(raw)


class TwinCritics(nn.Module):
    """Two action values Q_ψ1, Q_ψ2 of equal shape, stacked along the first axis of every parameter.

    One batched product serves both, which halves the number of operations that autograd dispatches.
    """

    def __init__(
        self, observation_size: int, action_size: int, hidden_sizes: Sequence[int], generator: torch.Generator
    ) -> None:
        super().__init__()
        sizes = (observation_size + action_size, *hidden_sizes, 1)
        fans = list(pairwise(sizes))
        self.weights = nn.ParameterList(_uniform((2, fan_in, fan_out), fan_in, generator) for fan_in, fan_out in fans)
        self.biases = nn.ParameterList(_uniform((2, 1, fan_out), fan_in, generator) for fan_in, fan_out in fans)

    def forward(self, observation: Tensor, action: Tensor) -> Tensor:
        """Both action values.

        Args:
          observation: `batch x observation_size`.
          action: `batch x action_size`, in [-1, 1].

        Returns:
          `2 x batch`.
        """
        layers = list(zip(self.weights, self.biases, strict=True))
        hidden = torch.cat((observation, action), dim=-1).expand(2, -1, -1)
        for weight, bias in layers[:-1]:
            hidden = torch.baddbmm(bias, hidden, weight).relu_()
        weight, bias = layers[-1]
        return torch.baddbmm(bias, hidden, weight).squeeze(-1)  # 2 x batch


def bounded_log_std(raw: Tensor) -> Tensor:
    """Squash the network's output into [LOG_STD_MIN, LOG_STD_MAX], elementwise and smoothly."""
    return LOG_STD_MIN + 0.5 * (LOG_STD_MAX - LOG_STD_MIN) * (torch.tanh(raw) + 1.0)


def tanh_gaussian(mean: Tensor, log_std: Tensor, noise: Tensor) -> tuple[Tensor, Tensor]:
    """Reparameterised action and its exact log-probability.

    a = tanh(u),  u = μ + σ ε
    log π(a|s) = Σ_k [-ε_k²/2 - log σ_k - log(2π)/2 - log(1 - tanh² u_k)]
    log(1 - tanh² u) = 2 (log 2 - u - softplus(-2u)), which stays finite where 1 - tanh² u rounds to 0.

    Args:
      mean: μ, `batch x action_size`.
      log_std: log σ, `batch x action_size`.
      noise: ε, standard normal, `batch x action_size`.

    Returns:
      Action in [-1, 1], `batch x action_size`, and log π(a|s), `batch`.

    Source: Haarnoja et al. 2018, App. C.
    """
    unsquashed = mean + log_std.exp() * noise
    log_normal = -0.5 * noise.square() - log_std - 0.5 * math.log(2.0 * math.pi)
    log_jacobian = 2.0 * (math.log(2.0) - unsquashed - F.softplus(-2.0 * unsquashed))
    return torch.tanh(unsquashed), (log_normal - log_jacobian).sum(dim=-1)


def _uniform(shape: tuple[int, ...], fan_in: int, generator: torch.Generator) -> nn.Parameter:
    """Entries from U(-1/√fan_in, 1/√fan_in), as `nn.Linear` draws them, but from our own generator."""
    bound = 1.0 / math.sqrt(fan_in)
    return nn.Parameter(torch.empty(shape).uniform_(-bound, bound, generator=generator))
