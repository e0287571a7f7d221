"""Trains one policy, a SAC that drives an attacker, over random scenes of many scenarios before many egos.

Rounds: several turns are played at once, each by the policy as it was after the round before last, while the learner
trains on the last round. So the result does not depend on the number of processes.
"""

import math
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor, Future
from dataclasses import asdict
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch

from risk_sac.config import EgoConfig, FamilyName, RewardConfig
from risk_sac.config.learner import AgentConfig, ReplayConfig, SacConfig
from risk_sac.egos.registry import pinned
from risk_sac.errors import ConfigError
from risk_sac.lab.pretraining.episodes import HELD_OUT, drawn_ego, read_episodes, training_egos
from risk_sac.lab.pretraining.fit import held_out_documents
from risk_sac.lab.pretraining.rollouts import (
    DECISION_STEPS,
    DISCOUNT,
    Demonstrations,
    Driver,
    PolicyEpisode,
    Turn,
    play_turn,
)
from risk_sac.run_folder import checkpoint
from risk_sac.scenario.reading import PAPER_FAMILIES, shipped_names
from risk_sac.search.agents.agent import check_device
from risk_sac.search.agents.replay import Batch, UniformReplay
from risk_sac.search.agents.sac import GraphedUpdate, SacAgent
from risk_sac.search.agents.transition import Transition
from risk_sac.search.frozen_policy import Layers, network
from risk_sac.search.prior.attacker import ACTION_SIZE, INPUT_SIZE
from risk_sac.search.prior.policy import PretrainedPolicy
from risk_sac.world.types import Floats

SIZES = INPUT_SIZE, ACTION_SIZE
TURNS, EPISODES = 4, 5  # of a round, and of a turn
DEMONSTRATED = 1  # turns of a round in which scripts act that failed the ego
PAPER_SHARE = 0.4  # of the turns, those in the paper's families
INITIAL_DEVIATION = 1.0  # of the policy; from 0.2 it failed the egos a third as often after 1,200 episodes
UPDATES_PER_DECISION = 1.5
FAILING = 0.25  # share of a batch that comes from failing episodes
EVALUATED_EVERY, EVALUATION_TURNS = 25, 7  # rounds; turns of held-out egos
AGENT = AgentConfig(
    hidden_sizes=(128, 128),
    batch_size=128,
    actor_learning_rate=3e-4,
    critic_learning_rate=3e-4,
    discount=DISCOUNT**DECISION_STEPS,
)
SAC = SacConfig(temperature_learning_rate=3e-4, initial_temperature=0.05, target_entropy_per_action=-0.5)
REPLAY = ReplayConfig(capacity=150_000)


class TrainingStage(NamedTuple):
    """A part of the training, with a memory of its own."""

    begins: float  # share of all episodes
    decisions: int  # before its first update; in the first stage demonstrations make them
    sound: float  # share of its episodes before egos without a defect
    reward: RewardConfig


# Choice: any failure is learnt first, before sound egos; then those that count for the headline, which need weak egos.
# The second alone gave .12 failures per episode after 3,000 episodes instead of .29, and .03 instead of .04 that count.
STAGES = (
    TrainingStage(0.0, 4000, 1.0, RewardConfig()),
    TrainingStage(0.4, 2000, 0.3, RewardConfig(unpreventable=0.25, unavoidable=0.1, minor=0.3)),
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
    """Training of the policy; see `run`."""

    def __init__(
        self,
        scripts: Path,
        seed: int,
        episodes: int,
        device: str = "cpu",
        *,
        families: Sequence[FamilyName] = (),
        agent: AgentConfig = AGENT,
        stages: Sequence[TrainingStage] = STAGES,
    ) -> None:
        """Draws the networks.

        Args:
          scripts: folder of script episodes.
          seed: of all random numbers.
          episodes: to play in all, rounded up to whole rounds.
          device: where the networks are trained, `cpu` or `cuda`; episodes are played on the CPU.
          families: in which it plays; without any all that ship and are not held out.
          agent: settings of the networks and of learning.
          stages: in order; the first begins at 0.

        Raises:
          ConfigError: no device, or no scripts that failed an ego.
        """
        check_device("--device", device)
        torch.set_num_threads(1)
        self.seed, self._stages = seed, stages
        self._rounds = math.ceil(episodes / (TURNS * EPISODES))
        apart = held_out_documents()
        self._families = tuple(families) or tuple(name for name in shipped_names() if name not in apart)
        self._demonstrations = {name: demonstrations(scripts, name) for name in self._families}
        self._evaluated_in = tuple(families) or (*PAPER_FAMILIES, *apart)
        self.agent = SacAgent(*SIZES, agent, SAC, seed, device, normalised=True)
        self.agent.spread(INITIAL_DEVIATION)
        self._graphed = GraphedUpdate(self.agent) if device == "cuda" else None
        self.replay = FailureReplay(*SIZES, REPLAY)
        self._random = np.random.default_rng(seed)
        self._batch_size = agent.batch_size
        self._round, self._due = 0, 0.0
        self._decisions = 0  # of this stage
        self._waiting: list[PolicyEpisode] = []  # of the last round
        self.curve: list[dict[str, Any]] = []

    def run(self, pool: Executor, folder: Path) -> Iterator[dict[str, Any]]:
        """Trains, or goes on from the folder's checkpoint; yields the curve."""
        path = folder / "policy.checkpoint"
        digest = "-".join([*self._families, str(self.seed), str(self._rounds)])
        if checkpoint.exists(path) and (state := checkpoint.load_newest(path, digest)) is not None:
            self._load(state)
        played: list[PolicyEpisode] = []
        while self._round < self._rounds:
            futures = [pool.submit(play_turn, turn) for turn in self._turns()]
            self.learn(self._waiting)
            if self._stage(self._round) is not self._stage(self._round - 1):
                self.replay = FailureReplay(*SIZES, REPLAY)
                self._decisions, self._due = 0, 0.0
            self._waiting = _in_order(futures)
            played += self._waiting[DEMONSTRATED * EPISODES :]  # those of the policy
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
        card = {"episodes": self._round * TURNS * EPISODES, "seed": self.seed, "families": self._families}
        return PretrainedPolicy(policy, critics, self.agent.temperature, card)

    def _stage(self, place: int) -> TrainingStage:
        """Returns the stage of a round."""
        return next(stage for stage in reversed(self._stages) if max(0, place) >= stage.begins * self._rounds)

    def _turns(self) -> Iterator[Turn]:
        stage = self._stage(self._round)
        warm = stage is not self._stages[0] or self._decisions >= stage.decisions
        demonstrated, policy = DEMONSTRATED if warm else TURNS, self._networks()
        paper = [name for name in self._families if name in PAPER_FAMILIES]
        for stream in range(TURNS):
            random = np.random.default_rng((self.seed, self._round, stream))
            among = paper if paper and random.random() < PAPER_SHARE else self._families
            family = among[random.integers(len(among))]
            driver: Driver = policy
            egos, key = egos_of(family, held_out=False), (self.seed, self._round, stream, 1)
            if stream < demonstrated:
                failed = self._demonstrations[family]
                name = list(failed)[random.integers(len(failed))]
                driver = Demonstrations(failed[name])
            else:
                name = drawn_ego(egos, random, stage.sound)
            yield Turn(family, egos[name], name, key, EPISODES, driver, stage.reward)

    def _networks(self) -> tuple[Layers, Layers]:
        """Returns the policy and the first critic as they are now."""
        policy, critics = self.agent.networks()
        return network(policy), network(critics)

    def learn(self, episodes: list[PolicyEpisode]) -> None:
        """Stores episodes, and makes the updates that they call for."""
        before = self._decisions
        for episode in episodes:
            self.replay.extend(episode.decisions, failing=bool(episode.kind))
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

    def _point(self, episodes: list[PolicyEpisode]) -> dict[str, Any]:
        """Returns a point of the training curve."""
        counts = {"episodes": self._round * TURNS * EPISODES, "temperature": self.agent.temperature}
        return counts | _shares(episodes)

    def _evaluated(self, pool: Executor) -> dict[str, Any]:
        """Plays held-out egos in turn; the scenes are the same each time."""
        policy, turns = self._networks(), []
        for i in range(EVALUATION_TURNS):
            family = self._evaluated_in[i % len(self._evaluated_in)]
            egos = egos_of(family, held_out=True)
            name = list(egos)[i % len(egos)]
            key = (self.seed, i, 2)
            turns.append(Turn(family, egos[name], name, key, EPISODES, policy, RewardConfig(), exploring=False))
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


@cache
def egos_of(family: FamilyName, *, held_out: bool) -> dict[str, EgoConfig]:
    """Returns a family's training egos by name: those held out of policies, or the others."""
    egos = training_egos(family)
    return {name: pinned(ego) for name, ego in egos.items() if (name in HELD_OUT) == held_out}


def demonstrations(folder: Path, family: FamilyName) -> dict[str, list[Floats]]:
    """Returns the points that failed a training ego, by its name.

    Raises:
      ConfigError: the folder has none.
    """
    failed: dict[str, list[Floats]] = {}
    for path in sorted(folder.glob(f"{family}-[0-9]*.npz")):
        for episode in read_episodes(path):
            if episode.kind and episode.ego in egos_of(family, held_out=False):
                failed.setdefault(episode.ego, []).append(episode.point)
    if not failed:
        got = f"no script of {family} in {folder} that failed an ego"
        raise ConfigError("--streams", got, remedy="play more scripts first, into the same DIR")
    return failed


def _in_order(futures: list["Future[list[PolicyEpisode]]"]) -> list[PolicyEpisode]:
    return [episode for future in futures for episode in future.result()]


def _shares(episodes: list[PolicyEpisode]) -> dict[str, Any]:
    """Returns what episodes ended in, per episode."""
    failed = [each for each in episodes if each.kind]
    count = max(1, len(episodes))
    by_family = {name: [each for each in episodes if each.family == name] for name in {e.family for e in episodes}}
    return {
        "families": {name: sum(bool(e.kind) for e in of) / len(of) for name, of in sorted(by_family.items())},
        "failing": len(failed) / count,
        "candidates": sum(each.candidate for each in failed) / count,
        "kinds": len({each.kind for each in failed}),
        "candidate_kinds": len({each.kind for each in failed if each.candidate}),
    }
