"""The pretrained policy: a SAC that was trained before many egos.

Its networks read the observation of a shipped family. `Folded`
rewrites their first layers, so that they read the observation of a problem whose actors, scene parameters and
requirements may be others.

prior/weights/<family>-policy.npz   plain arrays; README.md says how they were made
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from risk_sac.config import FamilyName, RunMethod, method_of
from risk_sac.env.observation_layout import MOTION_PER_ADVERSARY, PER_ADVERSARY, PER_EGO, observation_size
from risk_sac.env.problem import Problem
from risk_sac.errors import ConfigError
from risk_sac.scenario.families import Family, family_named
from risk_sac.search.prior.files import DATA, arrays_of, write_arrays

ABSENT_SCENE, ABSENT_REQUIREMENT = 0.5, 1.0  # entries of an observation for what a problem lacks; 0 for an adversary's
HIDDEN_LAYERS = 2
Arrays = tuple[NDArray[np.float32], ...]


@dataclass(frozen=True, slots=True)
class PolicyLayout:
    """Meaning of the entries of an observation and of an action."""

    adversaries: tuple[str, ...]  # those of the shipped family that they stand for
    scene: tuple[tuple[str, float, float], ...]  # name, least and greatest value of each parameter
    requirements: tuple[str, ...]
    per_adversary: int = PER_ADVERSARY  # entries of each adversary; its motion comes first
    statics: int = 0

    @classmethod
    def of(cls, problem: Problem) -> "PolicyLayout":
        """Returns the layout of a problem's observations and actions."""
        space = problem.space
        scene = zip(space.names, space.low.tolist(), space.high.tolist(), strict=True)
        requirements = tuple(requirement.name for requirement in problem.requirements)
        return cls(problem.family.stand_ins, tuple(scene), requirements, statics=len(problem.family.statics))

    @property
    def observation_size(self) -> int:
        """Entries of an observation."""
        size = observation_size(len(self.adversaries), len(self.scene), len(self.requirements), self.statics)
        return size - (PER_ADVERSARY - self.per_adversary) * len(self.adversaries)

    @property
    def action_size(self) -> int:
        """Entries of an action."""
        return 2 * len(self.adversaries)


@dataclass(frozen=True, slots=True)
class PretrainedPolicy:
    """Networks of a SAC for one shipped family.

    Layers are weights, `count x in x out`, and biases, in turn.
    """

    family: str
    layout: PolicyLayout
    policy: Arrays  # from observation to mean and log σ; count 1
    critics: Arrays  # from observation and action to values; count 2
    temperature: float
    card: Mapping[str, object]


def write_policy(path: Path, pretrained: PretrainedPolicy) -> None:
    """Writes a pretrained policy as plain arrays."""
    layout = pretrained.layout
    meta = {
        "family": pretrained.family,
        "adversaries": layout.adversaries,
        "scene": layout.scene,
        "requirements": layout.requirements,
        "per_adversary": layout.per_adversary,
        "temperature": pretrained.temperature,
        **pretrained.card,
    }
    networks = (("policy", pretrained.policy), ("critics", pretrained.critics))
    arrays = {f"{name}-{i}": layer.astype(np.float16) for name, layers in networks for i, layer in enumerate(layers)}
    write_arrays(path, meta, arrays)


def read_policy(path: Path) -> PretrainedPolicy:
    """Reads what `write_policy` wrote; nothing is unpickled.

    Raises:
      ConfigError: the file is damaged, too large, or its networks do not fit its layout.
    """
    with arrays_of(path) as (meta, arrays):
        count = 2 * (HIDDEN_LAYERS + 1)
        policy, critics = (
            tuple(arrays[f"{name}-{i}"].astype(np.float32) for i in range(count)) for name in ("policy", "critics")
        )
        scene = tuple((str(name), float(low), float(high)) for name, low, high in meta.pop("scene"))
        per_adversary = int(meta.pop("per_adversary", MOTION_PER_ADVERSARY))  # the shipped ones know motion alone
        layout = PolicyLayout(tuple(meta.pop("adversaries")), scene, tuple(meta.pop("requirements")), per_adversary)
        family, temperature = meta.pop("family"), float(meta.pop("temperature"))
        seen, acted = layout.observation_size, layout.action_size
        _check(policy, (1, seen, 2 * acted))
        _check(critics, (2, seen + acted, 1))
        if not temperature > 0.0:
            raise ValueError(f"a temperature of {temperature}")
    return PretrainedPolicy(family, layout, policy, critics, temperature, meta)


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
def shipped_policy(family: str) -> PretrainedPolicy | None:
    """Returns the pretrained policy of a shipped family; None if it has none."""
    path = DATA / f"{family}-policy.npz"
    return read_policy(path) if path.exists() else None


def pretrained_for(family: Family) -> PretrainedPolicy | None:
    """Returns the pretrained policy of the family that one is like.

    None without one, and if the family is mirrored.
    """
    return None if family.like is None or family.like.mirrored else shipped_policy(family.like.family)


def check_prior(name: RunMethod, family: FamilyName, prior: str) -> None:
    """Refuses a method whose prior is missing.

    A family that is like no other one needs none.

    Raises:
      ConfigError: the method starts from a prior, and none is wanted or there is none of this family.
    """
    wanted = method_of(name).prior
    if wanted in ("library", "policy") and prior == "none":
        raise ConfigError("prior", f"none, and the method {name}", "one", "choose archive or risk-sac instead")
    searched = family_named(family)
    if wanted == "policy" and searched.like is not None and pretrained_for(searched) is None:
        got = f"{name} at {family}, which has no pretrained policy"
        raise ConfigError("method", got, "a family that has one", "choose risk-sac there")


@dataclass(frozen=True, slots=True)
class Folded:
    """Networks that read a problem's own observation and return its own action."""

    policy: Arrays
    critics: Arrays
    temperature: float

    @classmethod
    def of(cls, pretrained: PretrainedPolicy, layout: PolicyLayout) -> "Folded":
        """Rewrites the first and last layers for another layout.

        An observation of the shipped family is affine in the problem's own, s = T o + c, and so is the first layer:
        W s + b = (W T) o + (W c + b).
        """
        matrix, constant = _translation(pretrained.layout, layout)
        size = pretrained.layout.observation_size
        columns = _action_columns(pretrained.layout, layout)

        def folded(weight: NDArray[np.float32], bias: NDArray[np.float32]) -> Arrays:
            """Args: `count x in x out`, the rows of the observation first, and the first bias."""
            seen = weight[:, :size]
            return matrix.T @ seen, bias + (constant @ seen)[:, None]

        weight, bias, *rest = pretrained.policy
        first, out = folded(weight, bias), len(pretrained.layout.adversaries) * 2
        halves = [slice(0, out), slice(out, 2 * out)]
        last = tuple(np.concatenate([_taken(layer[..., half], columns) for half in halves], -1) for layer in rest[-2:])
        critic_weight, critic_bias, *critic_rest = pretrained.critics
        critic_seen, critic_bias = folded(critic_weight, critic_bias)
        acted = np.swapaxes(_taken(np.swapaxes(critic_weight[:, size:], 1, 2), columns), 1, 2)
        critics = (np.concatenate([critic_seen, acted], 1), critic_bias, *critic_rest)
        return cls((*first, *rest[:-2], *last), critics, pretrained.temperature)


def _translation(shipped: PolicyLayout, own: PolicyLayout) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Returns T and c of `Folded.of`, by the names of actors, scene parameters and requirements."""
    matrix = np.zeros((shipped.observation_size, own.observation_size), np.float32)
    constant = np.zeros(shipped.observation_size, np.float32)
    for slot, name in enumerate(shipped.adversaries):
        if name in own.adversaries:
            at, source = slot * shipped.per_adversary, own.adversaries.index(name) * own.per_adversary
            known_entries = min(shipped.per_adversary, own.per_adversary)
            matrix[at : at + known_entries, source : source + known_entries] = np.eye(known_entries)
    at, source = len(shipped.adversaries) * shipped.per_adversary, len(own.adversaries) * own.per_adversary
    matrix[at : at + PER_EGO, source : source + PER_EGO] = np.eye(PER_EGO)
    at, source = at + PER_EGO, source + PER_EGO
    known = {name: (source + i, low, high) for i, (name, low, high) in enumerate(own.scene)}
    for i, (name, low, high) in enumerate(shipped.scene):
        place, own_low, own_high = known.get(name, (0, 0.0, 0.0))
        if name in known and high > low:
            matrix[at + i, place] = (own_high - own_low) / (high - low)
            constant[at + i] = (own_low - low) / (high - low)
        else:
            constant[at + i] = ABSENT_SCENE
    at, source = at + len(shipped.scene), source + len(own.scene)
    for i, name in enumerate(shipped.requirements):
        if name in own.requirements:
            matrix[at + i, source + own.requirements.index(name)] = 1.0
        else:
            constant[at + i] = ABSENT_REQUIREMENT
    matrix[-1, -1] = 1.0  # the time left
    return matrix, constant


def _action_columns(shipped: PolicyLayout, own: PolicyLayout) -> list[int]:
    """Returns the place of each own action entry in the shipped action; -1 without one."""
    places = {name: 2 * i for i, name in enumerate(shipped.adversaries)}
    return [column for name in own.adversaries for column in _pair(places.get(name))]


def _pair(place: int | None) -> tuple[int, int]:
    return (-1, -1) if place is None else (place, place + 1)


def _taken(array: NDArray[np.float32], columns: list[int]) -> NDArray[np.float32]:
    """Takes columns of the last axis; -1 gives zeros."""
    padded = np.concatenate([array, np.zeros((*array.shape[:-1], 1), np.float32)], -1)
    return padded[..., columns]
