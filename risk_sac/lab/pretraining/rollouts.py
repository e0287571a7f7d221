"""Plays episodes of a policy in random scenes before the training egos."""

from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from risk_sac.config import AgentConfig, EgoConfig, FamilyName, LearnerConfig, RewardConfig, RunSpec
from risk_sac.env.env import RiskSacEnv
from risk_sac.errors import EgoFailed, InfeasibleScene
from risk_sac.scenario.families import Family
from risk_sac.search.agents.controls import Decision, Held, ScriptFollower
from risk_sac.search.agents.snapshot import explored, own_value
from risk_sac.search.agents.transition import Transition
from risk_sac.search.encounter import Encounter
from risk_sac.search.frozen_policy import FrozenPolicy, Layers, respond
from risk_sac.search.prior.attacker import ACTION_SIZE, Attack, AttackerView
from risk_sac.search.scripts import PASSIVE, SIZE, Genes
from risk_sac.verdicts.distinct import variant_name
from risk_sac.world.types import Floats, Vector

DECISION_STEPS, DISCOUNT = AgentConfig().decision_steps, AgentConfig().discount
ACTIVE = Genes._fields.index("active")
COST_WEIGHT = 0.05  # of C_soft in the reward


class Demonstrations(NamedTuple):
    """Points whose scripts failed the ego, in the unit cube; one adversary alone acts by them."""

    points: Sequence[Floats]


Driver = tuple[Layers, Layers] | Demonstrations | None
"""Policy and critic; scripts; or all adversaries by uniformly random actions."""


class Turn(NamedTuple):
    """Episodes to play in one scenario before one ego.

    A turn's random numbers follow from its key alone, so turns may be played in any order and process.
    """

    family: FamilyName
    ego: EgoConfig
    name: str  # of the ego
    key: tuple[int, ...]
    episodes: int
    driver: Driver
    reward: RewardConfig
    exploring: bool = True  # whether a share of the policy's attackers is drawn


@dataclass(frozen=True, slots=True, kw_only=True)
class PolicyEpisode:
    """One episode of an attacker."""

    family: str
    ego: str
    decisions: list[Transition]  # as the policy sees them; the reward in `risk_reward`
    kind: str  # of its worst failure; empty without one
    candidate: bool  # for the headline
    steps: int
    attacker: int  # place among the adversaries; -1: none acted


def play_turn(turn: Turn) -> list[PolicyEpisode]:
    """Plays a turn in this process; scenes that cannot be played are drawn again."""
    return _player(turn.family).play(turn, np.random.default_rng(turn.key))


@lru_cache(maxsize=64)
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
                episode = self._episode(env, turn, random)
                if episode is not None:
                    played.append(episode)
        return played

    def _episode(self, env: RiskSacEnv, turn: Turn, random: np.random.Generator) -> PolicyEpisode | None:
        """Plays an episode in a random scene; None if it cannot be played."""
        problem = env.problem
        size, seed = problem.space.dimension, int(random.integers(1 << 30))
        attack, decision = AttackerView(problem).begin(random), Decision(DECISION_STEPS, DISCOUNT)
        if isinstance(turn.driver, Demonstrations):
            point = turn.driver.points[int(random.integers(len(turn.driver.points)))]
            unit, act = point[:size], _script(problem.family, point[size:], random)
        else:
            held = Held(DECISION_STEPS)
            decide = partial(_decided, turn.driver, env.action_size, attack, random, turn.exploring)
            unit = random.random(size)

            def act(observation: Vector) -> Vector:
                return held.act(partial(decide, observation))

        decisions: list[Transition] = []
        steps, ended = 0, False
        try:
            observation, info = env.reset(seed=seed, options={"scene": problem.space.from_unit(unit)})
            while not ended and steps < problem.family.horizon_steps:
                action, before = act(observation), observation
                observation, risk_reward, terminated, truncated, info = env.step(action)
                steps += 1
                ended = terminated or truncated
                reward = risk_reward - COST_WEIGHT * info["cost"]
                decided = decision.add(_transition(before, action, reward, observation, terminated=terminated))
                seen = None if decided is None else attack.transition(decided)
                if seen is not None:
                    decisions.append(seen)
        except (InfeasibleScene, EgoFailed):
            return None
        violations = env.violations(env.requirement_results())
        met = Encounter(collision=info.get("collision"), violations=violations)
        worst = met.worst
        return PolicyEpisode(
            family=self._family,
            ego=turn.name,
            decisions=decisions,
            kind="" if worst is None else variant_name(worst),
            candidate=worst is not None and worst.headline_candidate,
            steps=steps,
            attacker=-1 if attack.attacker is None else attack.attacker,
        )


def _script(family: Family, genes: Floats, random: np.random.Generator) -> Callable[[Vector], Vector]:
    """Follows the script of one of the adversaries that act by these genes, drawn uniformly."""
    rows = genes.reshape(-1, SIZE).copy()
    acting = np.flatnonzero(rows[:, ACTIVE] >= min(PASSIVE, rows[:, ACTIVE].max()))
    attacker = acting[random.integers(len(acting))]
    rows[:, ACTIVE] = np.arange(len(rows)) == attacker
    follower = ScriptFollower(family)
    follower.begin(rows.ravel())
    return follower.act


def _decided(
    networks: tuple[Layers, Layers] | None,
    size: int,
    attack: Attack,
    random: np.random.Generator,
    exploring: bool,
    observation: Vector,
) -> Vector:
    """Draws a joint action; without networks a uniform one."""
    if networks is None:
        return random.uniform(-1.0, 1.0, size).astype(np.float32)
    layers, critic = networks
    value = partial(own_value, FrozenPolicy(tuple(layers), ACTION_SIZE, normalised=True), critic)
    seen = attack.seen(observation, value, exploring)
    return attack.acted(explored(respond(layers, seen, normalised=True), "squashed", random))


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
