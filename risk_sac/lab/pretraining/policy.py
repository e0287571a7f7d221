"""Trains one policy, a SAC, over random scenes before many egos.

Rounds: several turns are played at once, each by the policy as it was after the round before last, while the learner
trains on the last round. So the result does not depend on the number of processes.
"""

import math
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor, Future
from dataclasses import asdict
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch

from risk_sac.config import FamilyName, RewardConfig, RunSpec
from risk_sac.config.learner import AgentConfig, ReplayConfig, SacConfig
from risk_sac.egos.registry import pinned
from risk_sac.env.problem import Problem
from risk_sac.lab.pretraining.episodes import HELD_OUT, drawn_ego, training_egos
from risk_sac.lab.pretraining.rollouts import DECISION_STEPS, DISCOUNT, PolicyEpisode, Turn, play_turn
from risk_sac.run_folder import checkpoint
from risk_sac.search.agents.agent import check_device
from risk_sac.search.agents.replay import Batch, UniformReplay
from risk_sac.search.agents.sac import GraphedUpdate, SacAgent
from risk_sac.search.agents.transition import Transition
from risk_sac.search.prior.mirror import Mirror
from risk_sac.search.prior.policy import PolicyLayout, PretrainedPolicy

TURNS, EPISODES = 4, 5  # of a round, and of a turn
INITIAL_DEVIATION = 1.0  # of the policy; from 0.2 it failed the egos a third as often after 1,200 episodes
UPDATES_PER_DECISION = 0.7
FAILING = 0.25  # share of a batch that comes from failing episodes
EVALUATED_EVERY, EVALUATION_TURNS = 50, 8  # rounds; turns of held-out egos
AGENT = AgentConfig(
    hidden_sizes=(256, 256),
    actor_learning_rate=3e-4,
    critic_learning_rate=3e-4,
    discount=DISCOUNT**DECISION_STEPS,
)
SAC = SacConfig(temperature_learning_rate=3e-4, initial_temperature=0.05, target_entropy_per_action=-0.5)
REPLAY = ReplayConfig(capacity=600_000)


class TrainingStage(NamedTuple):
    """A part of the training, with a memory of its own."""

    begins: float  # share of all episodes
    decisions: int  # before its first update; in the first stage they are random
    sound: float  # share of its episodes before egos without a defect
    reward: RewardConfig


# Choice: any failure is learnt first, before sound egos; then those that count for the headline, which need weak egos.
# The second alone gave .12 failures per episode after 3,000 episodes instead of .29, and .03 instead of .04 that count.
STAGES = (
    TrainingStage(0.0, 6000, 1.0, RewardConfig()),
    TrainingStage(0.25, 2000, 0.3, RewardConfig(unpreventable=0.25, unavoidable=0.1, minor=0.3)),
)


class FailureReplay(UniformReplay):
    """Memory that takes a fixed share of each batch from episodes that failed."""

    def __init__(self, observation_size: int, action_size: int, config: ReplayConfig) -> None:
        super().__init__(observation_size, action_size, config)
        self._failing = np.zeros(config.capacity, np.bool_)

    def extend(self, transitions: list[Transition], *, failing: bool) -> None:
        """Stores an episode."""
        for transition in transitions:
            self._failing[self.add(transition)] = failing

    def sample(self, batch_size: int, generator: np.random.Generator) -> Batch:
        """See `UniformReplay.sample`."""
        indices = generator.integers(len(self), size=batch_size)
        failing = np.flatnonzero(self._failing[: len(self)])
        if len(failing):
            share = int(FAILING * batch_size)
            indices[:share] = generator.choice(failing, share)
        return self.gather(indices, np.ones(batch_size))

    def state(self) -> dict[str, Any]:
        """See `UniformReplay.state`."""
        return super().state() | {"failing": torch.from_numpy(self._failing[: len(self)].copy())}

    def load(self, state: dict[str, Any]) -> None:
        """See `UniformReplay.load`."""
        super().load(state)
        self._failing[: len(self)] = state["failing"].numpy()


class PolicyTraining:
    """Training of one family's policy; see `run`."""

    def __init__(
        self,
        family: FamilyName,
        seed: int,
        episodes: int,
        device: str = "cpu",
        *,
        agent: AgentConfig = AGENT,
        stages: Sequence[TrainingStage] = STAGES,
    ) -> None:
        """Draws the networks.

        Args:
          family: whose adversaries it drives.
          seed: of all random numbers.
          episodes: to play in all, rounded up to whole rounds.
          device: where the networks are trained, `cpu` or `cuda`; episodes are played on the CPU.
          agent: settings of the networks and of learning.
          stages: in order; the first begins at 0.
        """
        check_device("--device", device)
        torch.set_num_threads(1)
        self.family, self.seed, self._stages = family, seed, stages
        self._rounds = math.ceil(episodes / (TURNS * EPISODES))
        self._layout = PolicyLayout.of(Problem.from_spec(RunSpec(family=family, method="sac", seed=seed)))
        self._mirror = Mirror.of(self._layout)
        egos = {name: pinned(ego) for name, ego in training_egos(family).items()}
        self._egos = {name: ego for name, ego in egos.items() if name not in HELD_OUT}
        self._unseen = {name: ego for name, ego in egos.items() if name in HELD_OUT}
        observation_size, action_size = self._layout.observation_size, self._layout.action_size
        self.agent = SacAgent(observation_size, action_size, agent, SAC, seed, device, normalised=True)
        self.agent.spread(INITIAL_DEVIATION)
        self._graphed = GraphedUpdate(self.agent) if device == "cuda" else None
        self.replay = FailureReplay(observation_size, action_size, REPLAY)
        self._random = np.random.default_rng(seed)
        self._sizes, self._batch_size = (observation_size, action_size), agent.batch_size
        self._round, self._due = 0, 0.0
        self._decisions = 0  # of this stage
        self._waiting: list[PolicyEpisode] = []  # of the last round
        self.curve: list[dict[str, Any]] = []

    def run(self, pool: Executor, folder: Path) -> Iterator[dict[str, Any]]:
        """Trains, or goes on from the folder's checkpoint; yields the curve."""
        path = folder / f"{self.family}.checkpoint"
        digest = f"{self.family}-{self.seed}-{self._rounds}"
        if checkpoint.exists(path) and (state := checkpoint.load_newest(path, digest)) is not None:
            self._load(state)
        played: list[PolicyEpisode] = []
        while self._round < self._rounds:
            futures = [pool.submit(play_turn, turn) for turn in self._turns()]
            self.learn(self._waiting)
            if self._stage(self._round) is not self._stage(self._round - 1):
                self.replay = FailureReplay(*self._sizes, REPLAY)
                self._decisions, self._due = 0, 0.0
            self._waiting = _in_order(futures)
            played += self._waiting
            self._round += 1
            if self._round % EVALUATED_EVERY == 0:
                self.curve.append(self._point(played) | {"held_out": self._evaluated(pool)})
                played = []
                checkpoint.save(path, self._state(), digest)
                yield self.curve[-1]
        self.learn(self._waiting)
        self._waiting = []

    def pretrained(self) -> PretrainedPolicy:
        """Returns the policy as it is now."""
        policy, critics = (tuple(layers) for layers in self.agent.networks())
        card = {"episodes": self._round * TURNS * EPISODES, "seed": self.seed, "egos": sorted(self._egos)}
        return PretrainedPolicy(self.family, self._layout, policy, critics, self.agent.temperature, card)

    def _stage(self, place: int) -> TrainingStage:
        """Returns the stage of a round."""
        return next(stage for stage in reversed(self._stages) if max(0, place) >= stage.begins * self._rounds)

    def _turns(self) -> Iterator[Turn]:
        stage = self._stage(self._round)
        warm = stage is not self._stages[0] or self._decisions >= stage.decisions
        layers = list(self.agent.frozen().layers) if warm else None
        for stream in range(TURNS):
            random = np.random.default_rng((self.seed, self._round, stream))
            name = drawn_ego(self._egos, random, stage.sound)
            key = (self.seed, self._round, stream, 1)
            yield Turn(self.family, self._egos[name], name, key, EPISODES, layers, stage.reward)

    def learn(self, episodes: list[PolicyEpisode]) -> None:
        """Stores episodes, and makes the updates that they call for."""
        before = self._decisions
        for episode in episodes:
            self._store(episode.decisions, failing=bool(episode.kind))
            self._decisions += len(episode.decisions)
        if before >= self._stage(self._round - 1).decisions:
            self._due += UPDATES_PER_DECISION * (self._decisions - before)
        while self._due >= 1.0:
            batch = self.replay.sample(self._batch_size, self._random)
            if self._graphed is None:
                self.agent.update(batch, batch.risk_reward)
            else:
                self._graphed(batch)
            self._due -= 1.0

    def _store(self, decisions: list[Transition], *, failing: bool) -> None:
        """Stores decisions, and their mirror image where the family has one."""
        self.replay.extend(decisions, failing=failing)
        if self._mirror is not None:
            self.replay.extend([self._mirror.transition(each) for each in decisions], failing=failing)

    def _point(self, episodes: list[PolicyEpisode]) -> dict[str, Any]:
        """Returns a point of the training curve."""
        return {"episodes": self._round * TURNS * EPISODES, "temperature": self.agent.temperature, **_shares(episodes)}

    def _evaluated(self, pool: Executor) -> dict[str, Any]:
        """Plays held-out egos in turn; the scenes are the same each time."""
        layers = list(self.agent.frozen().layers)
        names = list(self._unseen)
        turns = []
        for i in range(EVALUATION_TURNS):
            name = names[i % len(names)]
            key = (self.seed, i, 2)
            turns.append(Turn(self.family, self._unseen[name], name, key, EPISODES, layers, RewardConfig()))
        return _shares(_in_order([pool.submit(play_turn, turn) for turn in turns]))

    def _state(self) -> dict[str, Any]:
        return {
            "agent": self.agent.state(),
            "replay": self.replay.state(),
            "random": self._random.bit_generator.state,
            "round": self._round,
            "due": self._due,
            "decisions": self._decisions,
            "waiting": [asdict(each) for each in self._waiting],
            "curve": self.curve,
        }

    def _load(self, state: dict[str, Any]) -> None:
        self.agent.load(state["agent"])
        self._graphed = self._graphed and GraphedUpdate(self.agent)
        self.replay.load(state["replay"])
        self._random.bit_generator.state = state["random"]
        self._round, self._due, self.curve = state["round"], state["due"], state["curve"]
        self._decisions = state["decisions"]
        self._waiting = [
            PolicyEpisode(**each | {"decisions": [Transition(**step) for step in each["decisions"]]})
            for each in state["waiting"]
        ]


def _in_order(futures: list["Future[list[PolicyEpisode]]"]) -> list[PolicyEpisode]:
    return [episode for future in futures for episode in future.result()]


def _shares(episodes: list[PolicyEpisode]) -> dict[str, Any]:
    """Returns what episodes ended in, per episode."""
    failed = [each for each in episodes if each.kind]
    count = max(1, len(episodes))
    return {
        "failing": len(failed) / count,
        "candidates": sum(each.candidate for each in failed) / count,
        "kinds": len({each.kind for each in failed}),
        "candidate_kinds": len({each.kind for each in failed if each.candidate}),
    }
