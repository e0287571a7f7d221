"""The pretrained policy: a SAC that was trained in many scenarios before many egos.

It drives the attacker of an episode, see `risk_sac.search.prior.attacker`.

prior/weights/policy.npz   plain arrays; README.md says how they were made
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from risk_sac.config import RunMethod, RunSpec, method_of
from risk_sac.env.problem import Problem
from risk_sac.errors import ConfigError
from risk_sac.search.prior.attacker import ACTION_SIZE, INPUT_SIZE
from risk_sac.search.prior.files import DATA, arrays_of, write_arrays

POLICY = "policy.npz"
HIDDEN_LAYERS = 2
Arrays = tuple[NDArray[np.float32], ...]


@dataclass(frozen=True, slots=True)
class PretrainedPolicy:
    """Networks of a SAC that drives an attacker.

    Layers are weights, `count x in x out`, and biases, in turn.
    """

    policy: Arrays  # from input to mean and log σ; count 1
    critics: Arrays  # from input and action to values; count 2
    temperature: float
    card: Mapping[str, object]


def write_policy(path: Path, pretrained: PretrainedPolicy) -> None:
    """Writes a pretrained policy as plain arrays."""
    networks = (("policy", pretrained.policy), ("critics", pretrained.critics))
    arrays = {f"{name}-{i}": layer.astype(np.float16) for name, layers in networks for i, layer in enumerate(layers)}
    write_arrays(path, {"temperature": pretrained.temperature, **pretrained.card}, arrays)


def read_policy(path: Path) -> PretrainedPolicy:
    """Reads what `write_policy` wrote; nothing is unpickled.

    Raises:
      ConfigError: the file is damaged, too large, or its networks are of other sizes.
    """
    with arrays_of(path) as (meta, arrays):
        count = 2 * (HIDDEN_LAYERS + 1)
        policy, critics = (
            tuple(arrays[f"{name}-{i}"].astype(np.float32) for i in range(count)) for name in ("policy", "critics")
        )
        temperature = float(meta.pop("temperature"))
        _check(policy, (1, INPUT_SIZE, 2 * ACTION_SIZE))
        _check(critics, (2, INPUT_SIZE + ACTION_SIZE, 1))
        if not temperature > 0.0:
            raise ValueError(f"a temperature of {temperature}")
    return PretrainedPolicy(policy, critics, temperature, meta)


def _check(layers: Arrays, wanted: tuple[int, int, int]) -> None:
    """Refuses layers that are no network of this count, input and output."""
    count, width, out = wanted
    for weight, bias in zip(layers[::2], layers[1::2], strict=True):
        if weight.ndim != 3 or weight.shape[:2] != (count, width) or bias.shape != (count, 1, weight.shape[2]):
            raise ValueError(f"a layer of {weight.shape} and {bias.shape}, not {count} x {width} x n")
        width = weight.shape[2]
        if not (np.isfinite(weight).all() and np.isfinite(bias).all()):
            raise ValueError("a layer with entries that are no finite numbers")
    if width != out:
        raise ValueError(f"{width} outputs, not {out}")


@cache
def shipped_policy() -> PretrainedPolicy:
    """Returns the shipped policy."""
    return read_policy(DATA / POLICY)


def starts_pretrained(spec: RunSpec, problem: Problem) -> bool:
    """Whether a run's learner starts from the pretrained policy."""
    method = method_of(spec.method)
    return method.learns and "none" not in (method.prior, spec.prior) and bool(problem.family.adversaries)


def check_prior(name: RunMethod, prior: str) -> None:
    """Refuses a method that starts from a prior without one; raises `ConfigError`."""
    if method_of(name).prior in ("library", "policy") and prior == "none":
        raise ConfigError("prior", f"none, and the method {name}", "one", "choose archive or risk-sac instead")
