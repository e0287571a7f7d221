"""Plays episodes of a policy in random scenes before the training egos."""

from contextlib import closing
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from risk_sac.config import AgentConfig, EgoConfig, FamilyName, LearnerConfig, RewardConfig, RunSpec
from risk_sac.env.env import RiskSacEnv
from risk_sac.errors import EgoFailed, InfeasibleScene
from risk_sac.search.agents.controls import Decision, Held
from risk_sac.search.agents.networks import LOG_STD_HALF, LOG_STD_MIDDLE
from risk_sac.search.agents.transition import Transition
from risk_sac.search.encounter import Encounter
from risk_sac.search.frozen_policy import Layers, respond
from risk_sac.verdicts.distinct import variant_name
from risk_sac.world.types import Vector

DECISION_STEPS, DISCOUNT = AgentConfig().decision_steps, AgentConfig().discount
COST_WEIGHT = 0.05  # of C_soft in the reward


class Turn(NamedTuple):
    """Episodes to play before one ego.

    A turn's random numbers follow from its key alone, so turns may be played in any order and process.
    """

    family: FamilyName
    ego: EgoConfig
    name: str  # of the ego
    key: tuple[int, ...]
    episodes: int
    layers: Layers | None  # of the policy; None: uniformly random actions
    reward: RewardConfig


@dataclass(frozen=True, slots=True, kw_only=True)
class PolicyEpisode:
    """One episode of a policy."""

    ego: str
    decisions: list[Transition]  # the reward in `risk_reward`
    kind: str  # of its worst failure; empty without one
    candidate: bool  # for the headline
    steps: int


def play_turn(turn: Turn) -> list[PolicyEpisode]:
    """Plays a turn in this process; scenes that cannot be played are drawn again."""
    player = _player(turn.family)
    random = np.random.default_rng(turn.key)
    return player.play(turn, random)


@lru_cache(maxsize=1)
def _player(family: FamilyName) -> "Player":
    return Player(family)


class Player:
    """Plays turns of one family; an environment for each ego, prepared when it is first asked for."""

    def __init__(self, family: FamilyName) -> None:
        self._family = family
        self._envs: dict[tuple[str, RewardConfig], RiskSacEnv] = {}

    def play(self, turn: Turn, random: np.random.Generator) -> list[PolicyEpisode]:
        """Plays the episodes of a turn."""
        key = turn.name, turn.reward
        if key not in self._envs:
            learner = LearnerConfig(reward=turn.reward)
            spec = RunSpec(family=self._family, method="sac", seed=turn.key[0], ego=turn.ego, learner=learner)
            self._envs[key] = RiskSacEnv.of(spec)
        played: list[PolicyEpisode] = []
        with closing(self._envs[key]) as env:
            while len(played) < turn.episodes:
                episode = _episode(env, turn, random)
                if episode is not None:
                    played.append(episode)
        return played


def _episode(env: RiskSacEnv, turn: Turn, random: np.random.Generator) -> PolicyEpisode | None:
    """Plays an episode in a random scene; None if it cannot be played."""
    space = env.problem.space
    scene, seed = space.from_unit(random.random(space.dimension)), int(random.integers(1 << 30))
    held, decision = Held(DECISION_STEPS), Decision(DECISION_STEPS, DISCOUNT)
    decisions: list[Transition] = []
    size = env.action_size
    steps, ended = 0, False
    try:
        observation, info = env.reset(seed=seed, options={"scene": scene})
        while not ended and steps < env.problem.family.horizon_steps:
            action = held.act(partial(_decided, turn.layers, observation, size, random))
            before = observation
            observation, risk_reward, terminated, truncated, info = env.step(action)
            steps += 1
            ended = terminated or truncated
            reward = risk_reward - COST_WEIGHT * info["cost"]
            step = _transition(before, action, reward, observation, terminated=terminated)
            decided = decision.add(step)
            if decided is not None:
                decisions.append(decided)
    except (InfeasibleScene, EgoFailed):
        return None
    violations = env.violations(env.requirement_results())
    met = Encounter(collision=info.get("collision"), violations=violations)
    worst = met.worst
    return PolicyEpisode(
        ego=turn.name,
        decisions=decisions,
        kind="" if worst is None else variant_name(worst),
        candidate=worst is not None and worst.headline_candidate,
        steps=steps,
    )


def _decided(layers: Layers | None, observation: Vector, size: int, random: np.random.Generator) -> Vector:
    """Draws an action of a tanh-Gaussian policy; uniform without one."""
    if layers is None:
        return random.uniform(-1.0, 1.0, size).astype(np.float32)
    mean, raw = np.split(respond(layers, observation, normalised=True), 2)
    deviation = np.exp(LOG_STD_HALF * np.tanh(raw) + LOG_STD_MIDDLE)
    return np.tanh(mean + deviation * random.standard_normal(size)).astype(np.float32)


def _transition(
    observation: NDArray[np.float32], action: Vector, reward: float, after: NDArray[np.float32], *, terminated: bool
) -> Transition:
    return Transition(
        observation=observation,
        action=action,
        risk_reward=reward,
        cost=0.0,
        robustness=0.0,
        next_robustness=0.0,
        next_observation=after,
        terminated=terminated,
        accumulated_reward=0.0,
    )
