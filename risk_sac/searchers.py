"""Who searches: a method's own sampler and agent, and the archive search that a learner is warmed by.

Source: RISK-SAC, Algorithm 1, l. 1-2; warm start and turns are ours.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

from risk_sac.agents.follower import ScriptFollower
from risk_sac.agents.learner import Learner
from risk_sac.agents.random import RandomAgent
from risk_sac.agents.scripted import ScriptedAgent
from risk_sac.config import RunSpec, method_of
from risk_sac.problem import Problem
from risk_sac.records import EpisodeRecord, Outcome
from risk_sac.scene_optimizer import (
    NOBODY,
    ArchiveOptimizer,
    BotorchOptimizer,
    Encounter,
    IidSampler,
    SceneOptimizer,
    SobolOptimizer,
)
from risk_sac.turns import Turns
from risk_sac.types import Floats

Actor = Learner | RandomAgent | ScriptedAgent | ScriptFollower
CONTROLS: Mapping[str, type[RandomAgent | ScriptedAgent]] = {
    "scripted": ScriptedAgent,
    "random": RandomAgent,
    "none": RandomAgent,
}
Sampler = type[BotorchOptimizer | ArchiveOptimizer | SobolOptimizer | IidSampler]
OPTIMIZERS: Mapping[str, Sampler] = {
    "botorch": BotorchOptimizer,
    "archive": ArchiveOptimizer,
    "sobol": SobolOptimizer,
    "iid": IidSampler,
}
STEP_COSTS = 1.0, 8.0  # processor time: of the guide, and of a policy that learns and makes up for what it has not yet


class Searcher(NamedTuple):
    """Who makes an episode."""

    optimizer: SceneOptimizer  # proposes the scene, and the genes of scripts where the actor follows some
    actor: Actor


class Searchers:
    """A method's own searcher and, beside a learner, its guide.

    Choice: a learner's memory is filled by an archive search that goes on until it has found failures enough, and not
    by uniform actions, which hardly find any. All learners are warmed alike.

    Attributes:
      agent: the method's, which drives the adversaries once it is warm, and learns.
      scene_size: coordinates of a proposed point that say the scene; those behind are the genes of scripts.
    """

    def __init__(self, spec: RunSpec, problem: Problem, observation_size: int, action_size: int) -> None:
        method = method_of(spec.method)
        self.agent: Actor  # Alg. 1, l. 2
        if method.agent in CONTROLS:
            self.agent = CONTROLS[method.agent](action_size, spec.stream)
        elif method.agent == "scripts":
            self.agent = ScriptFollower(problem.family)
        else:
            self.agent = Learner(observation_size, action_size, method, spec.learner, spec.stream)
        self.scene_size = problem.space.dimension
        self._spec = spec
        self._own = self._searcher(self.agent, OPTIMIZERS[method.scenes])  # Alg. 1, l. 1
        self._guide = self._searcher(ScriptFollower(problem.family), ArchiveOptimizer) if method.learns else None
        self._turns = Turns(STEP_COSTS, spec.stream) if method.takes_turns else None
        self._next = self._own
        self._episodes, self._failures = 0, 0  # of the search

    def next(self, *, learning: bool) -> Searcher:
        """Who makes the next episode.

        Args:
          learning: whether it is one of the search; in the evaluation the method's own searcher is on its own.
        """
        if self._guide is None or not learning:
            self._next = self._own
        elif not self._warm:
            self._next = self._guide
        else:
            self._next = (self._guide, self._own)[self._turns.next()] if self._turns else self._own
        return self._next

    @property
    def _warm(self) -> bool:
        """Whether the guide has done its part; one that goes on anyway has time until it has found enough."""
        warm_start = self._spec.learner.warm_start
        spent = self._episodes >= warm_start.episodes and not (self._turns and warm_start.episodes)
        return spent or self._failures >= warm_start.failures

    def tell(self, point: Floats, mean_return: float | None, encounter: Encounter = NOBODY) -> float | None:
        """Tells what came of the scene that the next one was asked for; see `SceneOptimizer.tell`.

        A method's own sampler hears of its guide's scenes too.
        """
        if self._next is not self._own:
            self._own.optimizer.tell(point[: self.scene_size], mean_return, encounter)
        return self._next.optimizer.tell(point, mean_return, encounter)

    def add(self, record: EpisodeRecord) -> None:
        """Takes note of the episode that the next one has made; from then on it is the turn of another."""
        if not record.searching:
            return
        self._episodes += 1
        self._failures += record.outcome is Outcome.FAILURE
        if self._turns:
            self._turns.tell(int(self._next is self._own), record.steps, record.collision)

    def state(self) -> dict[str, Any]:
        """Everything the next episode depends on but the records so far; see `load`."""
        return {
            "optimizer": self._own.optimizer.state(),
            "agent": self.agent.state(),
            "guide": self._guide.optimizer.state() if self._guide else None,
        }

    def load(self, state: dict[str, Any], records: list[EpisodeRecord]) -> None:
        """Goes on from `state()` and the records at that time.

        Raises:
          CheckpointError: the state is of another run.
        """
        self._own.optimizer.load(state["optimizer"])
        self.agent.load(state["agent"])
        if self._guide:
            self._guide.optimizer.load(state["guide"])
        for record in records:
            self.next(learning=record.searching)
            self.add(record)

    def _searcher(self, actor: Actor, optimizer: Sampler) -> Searcher:
        return Searcher(optimizer(self.scene_size + actor.genes, self._spec.learner.scenes, self._spec.stream), actor)
