"""Pairs samplers with agents, and learners with the warm-up archive search.

Source: RISK-SAC, Algorithm 1, l. 1-2. Choice: warm start and turns are ours.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from risk_sac.config import RunSpec, method_of
from risk_sac.env.problem import Problem
from risk_sac.records import Collision, DrivenBy, EpisodeRecord, Outcome, Violation
from risk_sac.search.agents.controls import Control, ScriptFollower, control
from risk_sac.search.agents.learner import Learner
from risk_sac.search.agents.snapshot import PolicySnapshot
from risk_sac.search.agents.transition import Transition
from risk_sac.search.encounter import NO_ENCOUNTER, Encounter
from risk_sac.search.prior.coordinates import Coordinates
from risk_sac.search.prior.learner import PretrainedLearner
from risk_sac.search.prior.policy import check_prior, shipped_policy, starts_pretrained
from risk_sac.search.prior.sampler import PriorOptimizer, ReplayOptimizer
from risk_sac.search.prior.start import start_of
from risk_sac.search.scene_optimizer import (
    ArchiveOptimizer,
    BotorchOptimizer,
    BoundarySampler,
    DiscountedBandit,
    GridSampler,
    IidSampler,
    RateSampler,
    RegisteredSampler,
    SceneOptimizer,
    SobolOptimizer,
)
from risk_sac.verdicts.distinct import Finds
from risk_sac.world.types import Floats, Scene

OPTIMIZERS: Mapping[str, type[SceneOptimizer]] = {
    each.kind: each
    for each in (
        BotorchOptimizer,
        ArchiveOptimizer,
        SobolOptimizer,
        IidSampler,
        GridSampler,
        RateSampler,
        BoundarySampler,
        RegisteredSampler,
    )
}
Actor = Learner | Control
"""A joint policy that drives all adversaries."""
GUIDE, OWN = 0, 1  # arms of the bandit that chooses between archive and policy
# Scripts that find a failure in one episode of thirty may find none in fifty and still be worth their time.
DISCOUNT, PRIOR_STEPS = 0.995, 1000.0
POLICY_STEP = 3.0  # processor time of a policy's step and its updates, as a multiple of the guide's
PRIOR_WORTH, LEAST = 0.05, 0.01  # more would be lost on a policy that yields nothing


class Searcher(NamedTuple):
    """A scene sampler and the actor that plays its scenes."""

    sampler: SceneOptimizer
    actor: Actor


class Searchers:
    """Searcher of a method and, beside a learner, its guide: archive search.

    Choice: a learner's memory is filled by an archive search until that has found failures enough, because uniform
    actions hardly find any. All learners are warmed alike.

    Attributes:
      agent: the method's own actor, which learns from all episodes of the search.
    """

    def __init__(self, spec: RunSpec, problem: Problem, observation_size: int, action_size: int) -> None:
        method = method_of(spec.method)
        check_prior(spec.method, spec.prior)
        self._problem, self._space = problem, problem.space
        self._spec = spec
        self._coordinates = Coordinates.of(problem)
        self._start = None if "none" in (method.prior, spec.prior) else start_of(problem, spec.prior)
        pretrained = shipped_policy() if starts_pretrained(spec, problem) else None
        self.agent: Actor  # Alg. 1, l. 2
        if not method.learns:
            self.agent = control(spec.method, problem.family, spec.stream)
        elif pretrained is not None:
            self.agent = PretrainedLearner(pretrained, problem, method, spec.learner, spec.stream)
        else:
            self.agent = Learner(observation_size, action_size, method, spec.learner, spec.stream)
        self._own = self._searcher(self.agent, OPTIMIZERS[method.scenes])  # Alg. 1, l. 1
        guided = method.takes_turns or (method.learns and pretrained is None)
        self._guide = self._searcher(ScriptFollower(problem.family), ArchiveOptimizer) if guided else None
        self._turns = Turns(spec.stream) if method.takes_turns else None
        self._next = self._own
        self._episodes, self._failures = 0, 0  # of the search

    def next(self, *, learning: bool, out: int = 0) -> Searcher:
        """Chooses the searcher of the next episode.

        Args:
          learning: whether the episode is one of the search; in the evaluation the guide takes no part.
          out: number of episodes that are being played.
        """
        if self._guide is None or not learning:
            self._next = self._own
        elif not self._warm(out):
            self._next = self._guide
        else:
            self._next = (self._guide, self._own)[self._turns.draw()] if self._turns else self._own
        return self._next

    def _warm(self, out: int) -> bool:
        """Whether the guide is done; with turns, once it has found enough.

        Args:
          out: number of episodes that are being played.
        """
        warm_start = self._spec.learner.warm_start
        spent = self._episodes + out >= warm_start.episodes and not (self._turns and warm_start.episodes)
        return spent or self._failures >= warm_start.failures

    def driven_by(self, *, learning: bool) -> DrivenBy | None:
        """Returns what drives the adversaries of the latest point, or None."""
        sampler, actor = self._next
        if actor.genes:
            return sampler.driven_by
        frozen = isinstance(actor, Learner) and not learning
        return DrivenBy.POLICY if frozen else actor.driven_by

    def ask(self, out: Sequence[Floats] = ()) -> Floats:
        """Returns the chosen searcher's next point; its scene keeps the constraints.

        A sampler is asked again for a point whose scene does not, so that random scenes stay uniform among those that
        do; after `tries` the nearest scene of a pool takes its place. One without tries has its points refused. `out`
        are the points that are being played.
        """
        (sampler, actor), size = self._next, self._space.dimension
        sampler.out = [played[: size + actor.genes] for played in out]
        point = sampler.ask()
        if not sampler.tries:
            return point
        for _ in range(sampler.tries):
            if self._space.allows(point[:size]):
                return point
            point = sampler.ask()
        return np.concatenate((self._space.nearest_allowed(point[:size]), point[size:]))

    def split(self, point: Floats) -> tuple[Scene, Floats]:
        """Splits a proposed point into its scene and the actor's genes."""
        size, sampler = self._space.dimension, self._next.sampler
        if isinstance(sampler, GridSampler):
            return sampler.scene(point, self._space), point[size:]
        return self._space.from_unit(point[:size]), point[size:]

    @property
    def learns(self) -> bool:
        """Whether the adversaries do."""
        return isinstance(self.agent, Learner)

    def waits(self, out: int) -> bool:
        """Whether the next point depends on episodes out; see `SceneOptimizer.waits`."""
        return self._own.sampler.waits(out)

    @property
    def points(self) -> int | None:
        """Number of scenes of a method that plays each once, or None."""
        return self._own.sampler.points

    @property
    def origin(self) -> Mapping[str, Any]:
        """Origin of the last point, see `SceneOptimizer.origin`."""
        return self._next.sampler.origin

    @property
    def guided(self) -> bool:
        """Whether the searcher chosen last is the guide."""
        return self._next is not self._own

    def snapshot(self) -> PolicySnapshot | None:
        """The policy as it is now; None where nothing learns."""
        return self.agent.snapshot() if isinstance(self.agent, Learner) else None

    def snapshot_of(self, state: dict[str, Any]) -> PolicySnapshot:
        """Returns the policy of an earlier moment; see `PolicySnapshot.state`."""
        assert isinstance(self.agent, Learner)
        return self.agent.snapshot().at(state)

    def recall(self, *, guided: bool, origin: Mapping[str, Any] | None = None) -> None:
        """Chooses the searcher of an episode; `origin` if others were proposed since."""
        self._next = self._guide if guided and self._guide else self._own
        if origin is None:
            return
        self._next.sampler.origin = origin
        if guided:
            self._own.sampler.origin = {}  # it learns the guide's points, too

    def learn(self, transitions: Sequence[Transition], snapshot: PolicySnapshot, seed: int) -> None:
        """Learns from an episode of another process; see `Learner.learn`."""
        assert isinstance(self.agent, Learner)
        self.agent.learn(transitions, snapshot, seed, own=not self.guided)

    def begin(self, genes: Floats) -> Actor:
        """Begins an episode for the observing learner and the returned actor."""
        self._next.actor.begin(genes)
        if self._next is not self._own:
            self.agent.begin(genes)
        return self._next.actor

    def tell(self, point: Floats, mean_return: float | None, encounter: Encounter = NO_ENCOUNTER) -> float | None:
        """Scores an episode's scene; the method's sampler also learns its guide's."""
        if self._next is not self._own:
            self._own.sampler.tell(point[: self._space.dimension], mean_return, encounter)
        return self._next.sampler.tell(point, mean_return, encounter)

    def add(self, record: EpisodeRecord) -> None:
        """Counts the episode that the searcher chosen last has made."""
        if not record.searching:
            return
        self._episodes += 1
        self._failures += record.outcome is Outcome.FAILURE
        if self._turns:
            self._turns.tell(GUIDE if self.guided else OWN, record.steps, record.valid_violations)

    def state(self) -> dict[str, Any]:
        """Returns what the next episode depends on besides records; see `load`."""
        return {
            "optimizer": self._own.sampler.state(),
            "agent": self.agent.state(),
            "guide": self._guide.sampler.state() if self._guide else None,
            "turns": self._turns.state() if self._turns else None,
        }

    def load(self, state: dict[str, Any], records: list[EpisodeRecord]) -> None:
        """Continues from `state()` and the records at that time.

        Raises:
          CheckpointError: the state is of another run.
        """
        self._own.sampler.load(state["optimizer"])
        self.agent.load(state["agent"])
        if self._guide:
            self._guide.sampler.load(state["guide"])
        if self._turns:
            self._turns.load(state["turns"])
        searched = [record for record in records if record.searching]
        self._episodes, self._failures = len(searched), sum(record.outcome is Outcome.FAILURE for record in searched)

    def _searcher(self, actor: Actor, sampler: type[SceneOptimizer]) -> Searcher:
        dimension = self._space.dimension + actor.genes
        arguments = dimension, self._spec.learner.scenes, self._spec.stream
        made: SceneOptimizer
        if sampler is GridSampler:
            made = GridSampler(*arguments, self._problem.grid, self._spec.budget.episodes)
        elif sampler is IidSampler:
            made = IidSampler(*arguments, self._problem.declared)
        elif sampler is RateSampler:
            made = RateSampler(*arguments, self._problem.declared, self._spec.budget.episodes, self._spec.rate)
        elif sampler is RegisteredSampler:
            made = RegisteredSampler(*arguments, self._spec.method)
        elif sampler is BoundarySampler:
            made = BoundarySampler(*arguments, self._problem.slice_of(self._spec))
        elif self._start is None or not actor.genes:
            made = sampler(*arguments)
        else:
            whole, rows = method_of(self._spec.method).prior == "all", len(self._start.library)
            prior = PriorOptimizer if whole else ReplayOptimizer
            made = prior(*arguments, self._start) if whole or rows else sampler(*arguments)
        if isinstance(made, ArchiveOptimizer) and actor.genes and self._coordinates.symmetric:
            made.reflect = self._coordinates.reflected
        return Searcher(made, actor)


class Turns:
    """Chooser between guide and policy by recent finds per processor time.

    So a policy acts often once the scripts' failures run out, and not before. The same episodes in the same order lead
    to the same turns.
    """

    def __init__(self, seed: int) -> None:
        self._random = np.random.default_rng(seed)
        self._bandit = DiscountedBandit(
            discount=DISCOUNT,
            prior_worth=PRIOR_WORTH,
            prior_cost=PRIOR_STEPS,
            least=LEAST,
            unit_costs=(1.0, POLICY_STEP),
        )
        self._finds = Finds()

    def draw(self) -> int:
        """Draws the arm of the next episode."""
        return int(self._random.random() < self._bandit.probability)

    def tell(self, arm: int, steps: int, violations: Sequence[Collision | Violation]) -> None:
        """Counts an episode; violations that either arm has found are not new."""
        self._bandit.tell(arm, self._finds.add(violations), steps)

    def state(self) -> dict[str, Any]:
        """Returns plain values to continue from."""
        return {
            "random": self._random.bit_generator.state,
            "bandit": self._bandit.state(),
            "finds": self._finds.state(),
        }

    def load(self, state: dict[str, Any]) -> None:
        """Continues from `state()`."""
        self._random.bit_generator.state = state["random"]
        self._bandit.load(state["bandit"])
        self._finds.load(state["finds"])
