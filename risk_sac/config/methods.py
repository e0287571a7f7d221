"""Methods as rows: agent × {lagrangian, shaping, replay} × scene sampler.

Samplers are entry points of the group `risk_sac.samplers`, beside those that ship. Nothing of them is imported here.
"""

import re
from collections.abc import Mapping
from importlib.metadata import EntryPoint, entry_points
from importlib.util import find_spec
from typing import Annotated, Any, Literal, get_args

from pydantic import Field, PlainValidator, TypeAdapter, WithJsonSchema
from pydantic_core import PydanticKnownError

from risk_sac.config.base import Settings
from risk_sac.errors import ConfigError, did_you_mean

OwnMethod = Literal[
    "risk-sac",
    "risk-sac-diverse",
    "risk-sac-pretrained",
    "risk-sac-only-rper",
    "risk-sac-only-rs",
    "sac-lag",
    "sac",
    "sb3-sac",
    "ast-sac",
    "ast-ppo",
    "ddpg-lag",
    "ddpg",
    "archive",
    "archive-replay",
    "bo-only",
    "random",
    "no-adversary",
    "story-sweep",
    "story-random",
    "story-bo",
    "rate",
    "boundary",
]
IidName = Literal["iid-undisturbed", "iid-random"]
"""How the runs of a campaign's i.i.d. phase are made, see `Iid`; a spec cannot name them."""
SAMPLER = "sampler-"
SAMPLER_PATTERN = rf"^{SAMPLER}[a-z][a-z0-9-]{{0,39}}$"
SamplerMethod = Annotated[str, Field(pattern=SAMPLER_PATTERN)]
"""Archive search's scripts, whose genes and scenes a registered sampler proposes; see `search/samplers.md`."""


def _named(*methods: str) -> tuple[PlainValidator, WithJsonSchema]:
    """Returns validator and schema of method names; errors list the methods."""

    def check(value: Any) -> Any:
        if isinstance(value, str) and (value in methods or re.fullmatch(SAMPLER_PATTERN, value)):
            return value
        known = ", ".join(map(repr, methods))
        raise PydanticKnownError("literal_error", {"expected": f"{known} or '{SAMPLER}NAME'"})

    schema = TypeAdapter(SamplerMethod).json_schema()
    return PlainValidator(check), WithJsonSchema({"anyOf": [{"enum": list(methods), "type": "string"}, schema]})


MethodName = Annotated[OwnMethod | SamplerMethod, *_named(*get_args(OwnMethod))]
RunMethod = Annotated[OwnMethod | IidName | SamplerMethod, *_named(*get_args(OwnMethod), *get_args(IidName))]


class Method(Settings):
    """One row of the table of methods."""

    agent: Literal["sac", "ddpg", "sb3", "stress-sac", "stress-ppo", "scripts", "scripted", "random", "none"]
    """`scripts`: each adversary follows a script whose genes are searched with the scene; `scripted`: cuts in and
    brakes, or keeps on; `random`: uniform actions, held for a while; `none`: SUMO drives the adversary vehicles,
    pedestrians stand; `stress-…`: adaptive stress testing by an agent of Stable-Baselines3."""
    lagrangian: bool = False
    """Whether λ follows the realism cost; without it λ stays 0."""
    shaping: bool = False
    """Whether robustness shapes the reward (Eq. 6-8)."""
    replay: Literal["uniform", "rper"] = "uniform"
    story: bool = False
    """Whether the scenario is played as it is written: others follow its story, and nothing deviates from it."""
    scenes: Literal["botorch", "archive", "sobol", "iid", "grid", "rate", "boundary", "registered"] = "sobol"
    """`grid`: each point of the grid of the parameters, or of a stratified sample of it; `archive`: bred from
    those that led to distinct failures, together with the scripts' genes; `iid`: drawn one independently of the other,
    by the declared distributions; `rate`: by stages of importance sampling, for a rate under these; `boundary`: where
    an ego goes from passing to failing over a few parameters; `registered`: by the user's sampler."""
    takes_turns: bool = False
    """Whether a learner's warm start goes on beside it: scripts and policy act in turn, by what they yield."""
    prior: Literal["none", "library", "policy", "all"] = "none"
    """What of the prior it starts from: nothing, the library of scripts, the policy, or these and the script model."""
    needs: str = ""
    """A package that is not installed with this one, as it is imported."""
    summary: str

    @property
    def stochastic(self) -> bool:
        """Whether it learns a policy that draws its actions."""
        return self.agent in ("sac", "sb3")

    @property
    def in_rounds(self) -> bool:
        """Whether several processes play its episodes; a peer's policy learns while playing."""
        return not self.agent.startswith("stress")

    @property
    def learns(self) -> bool:
        """Whether its adversaries do; the others are controls."""
        return self.stochastic or self.agent == "ddpg"


# Choice: all learners search scenes with BoTorch, so that their rows differ in the learner alone.
_RISK_SAC: dict[str, Any] = {"agent": "sac", "lagrangian": True, "shaping": True, "replay": "rper"}
_STORY: dict[str, Any] = {"agent": "none", "story": True}
METHODS: dict[OwnMethod, Method] = {
    "risk-sac": Method(
        **_RISK_SAC,
        scenes="botorch",
        summary="The paper's method: SAC with λ, robustness shaping, RPER and BoTorch scenes.",
    ),
    "risk-sac-diverse": Method(
        **_RISK_SAC,
        scenes="archive",
        takes_turns=True,
        prior="all",
        summary="RISK-SAC and archive search in one loop, from the shipped policy, script model and library on.",
    ),
    "risk-sac-pretrained": Method(
        **_RISK_SAC,
        scenes="botorch",
        prior="policy",
        summary="The paper's method, starting from the shipped policy instead of from nothing.",
    ),
    "risk-sac-only-rper": Method(
        agent="sac", lagrangian=True, replay="rper", scenes="botorch", summary="Ablation: no reward shaping."
    ),
    "risk-sac-only-rs": Method(
        agent="sac", lagrangian=True, shaping=True, scenes="botorch", summary="Ablation: uniform replay."
    ),
    "sac-lag": Method(agent="sac", lagrangian=True, scenes="botorch", summary="SAC under the realism constraint."),
    "sac": Method(agent="sac", scenes="botorch", summary="Plain SAC on the risk reward."),
    "sb3-sac": Method(
        agent="sb3",
        scenes="botorch",
        needs="stable_baselines3",
        summary="Control: the update of Stable-Baselines3's SAC in the place of ours; needs the `peers` extra.",
    ),
    "ast-sac": Method(
        agent="stress-sac",
        needs="stable_baselines3",
        summary="Peer: adaptive stress testing by Stable-Baselines3's SAC with its defaults; needs the `peers` extra.",
    ),
    "ast-ppo": Method(
        agent="stress-ppo",
        needs="stable_baselines3",
        summary="Peer: adaptive stress testing by Stable-Baselines3's PPO with its defaults; needs the `peers` extra.",
    ),
    "ddpg-lag": Method(agent="ddpg", lagrangian=True, scenes="botorch", summary="DDPG under the realism constraint."),
    "ddpg": Method(agent="ddpg", scenes="botorch", summary="Plain DDPG on the risk reward."),
    "archive": Method(
        agent="scripts",
        scenes="archive",
        summary="Search without learning: scenes and adversaries' scripts, bred from those that made the ego fail.",
    ),
    "archive-replay": Method(
        agent="scripts",
        scenes="archive",
        prior="library",
        summary="Control: archive search that starts from the shipped library; nothing that was learnt proposes.",
    ),
    "bo-only": Method(
        agent="scripted", scenes="botorch", summary="Control: BoTorch scenes, and adversaries that follow one script."
    ),
    "random": Method(agent="random", summary="Control: Sobol scenes and random actions, held for a second on average."),
    "no-adversary": Method(agent="none", summary="Control without an attack; what remains is the artefact rate."),
    "story-sweep": Method(
        **_STORY,
        scenes="grid",
        summary="The grid of the scenario's parameters, without an attack: all points, or a stratified sample.",
    ),
    "story-random": Method(**_STORY, summary="Sobol scenes of the scenario as it is written, without an attack."),
    "story-bo": Method(
        **_STORY,
        scenes="botorch",
        summary="BoTorch searches the scenario's parameters; others follow its story, without an attack.",
    ),
    "rate": Method(
        agent="none",
        scenes="rate",
        summary="How often the ego fails under the declared distributions, without an attack, by importance sampling.",
    ),
    "boundary": Method(
        **_STORY,
        scenes="boundary",
        summary="Seeks where the ego goes from passing to failing over two to four parameters, without an attack.",
    ),
}

# What a bound may be drawn from: no search, and so none of METHODS.
IID_METHODS: dict[IidName, Method] = {
    "iid-undisturbed": Method(
        agent="none",
        scenes="iid",
        summary="Fresh random scenes without an attack: SUMO drives all vehicles, pedestrians stand.",
    ),
    "iid-random": Method(
        agent="random",
        scenes="iid",
        summary="Fresh random scenes with random adversaries, whose actions are held for a second on average.",
    ),
}

SAMPLER_METHOD = Method(
    agent="scripts", scenes="registered", summary="Scenes and adversaries' scripts, as a registered sampler asks."
)

_ALL: Mapping[str, Method] = dict([*METHODS.items(), *IID_METHODS.items()])


def method_of(name: RunMethod) -> Method:
    """Returns the row of a run's method, search or i.i.d. phase."""
    if name.startswith(SAMPLER):
        return SAMPLER_METHOD
    return _ALL[name]


GROUP = "risk_sac.samplers"
# Name → class, and the package that it needs.
SHIPPED: Mapping[str, tuple[str, str]] = {
    "cma-es": ("risk_sac.lab.peers:CmaEs", "cma"),
    "cross-entropy": ("risk_sac.lab.peers:CrossEntropy", ""),
    "nsga2": ("risk_sac.lab.peers:Nsga2", "pymoo"),
    "tpe": ("risk_sac.lab.peers:Tpe", "optuna"),
    "uniform": ("risk_sac.lab.peers:Uniform", ""),
}


def samplers() -> Mapping[str, EntryPoint]:
    """Returns the samplers that can be named, by name.

    Raises:
      ConfigError: two have the same name.
    """
    points = {
        name: EntryPoint(name=name, value=value, group=GROUP)
        for name, (value, package) in SHIPPED.items()
        if not package or find_spec(package)
    }
    for point in entry_points(group=GROUP):
        if points.setdefault(point.name, point).value != point.value:
            raise ConfigError(GROUP, f"two samplers as {point.name!r}", "names of their own")
    return points


def named_methods() -> tuple[str, ...]:
    """Returns the methods that a campaign can name, registered samplers' last."""
    return (*METHODS, *(f"{SAMPLER}{name}" for name in sorted(samplers())))


def sampler_of(method: str) -> EntryPoint:
    """Returns the sampler that a method `sampler-NAME` names.

    Raises:
      ConfigError: there is none of that name, or its package is missing.
    """
    name, known = method.removeprefix(SAMPLER), samplers()
    if name in known:
        return known[name]
    if name in SHIPPED:
        remedy = "pip install 'risk-sac[peers]', for the service and its workers"
        raise ConfigError("methods", f"{method!r}, which needs {SHIPPED[name][1]}", remedy=remedy)
    registered = sorted(f"{SAMPLER}{each}" for each in known)
    remedy = did_you_mean(method, registered) or "risk_sac/search/samplers.md says how to register another"
    raise ConfigError("methods", f"{method!r}", f"one of {', '.join(registered)}, which are registered", remedy)
