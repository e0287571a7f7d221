"""Runs episodes by Algorithm 1, one after the other or in rounds."""

import os
import sys
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Protocol

import numpy as np

from risk_sac.config import RunSpec
from risk_sac.records import Ending, EpisodeRecord, RunMetrics, SeriesFile
from risk_sac.run_folder.crash_guard import CrashGuard
from risk_sac.search.playing import GuardedEnv, PlayedEpisode, Proposal, play
from risk_sac.search.processes import processes_of
from risk_sac.search.rollouts import Rollouts, Terms, processes_elsewhere
from risk_sac.search.run import RunOutcome, RunState

ROLLOUT_FOLDER = "rollouts"  # folder of what rollout processes note
ROUNDS_OUT = 2  # rounds that are asked for and not told
POLL_S = 0.2


class Observer(Protocol):
    """Receives each episode; may stop the run."""

    def episode(self, record: EpisodeRecord, metrics: RunMetrics, series: SeriesFile | None) -> None:
        """Receives an episode, with its file of `failures/` if it has one.

        A resumed run first repeats the episodes of its checkpoint, because the last of them may have been missed.
        """

    def should_stop(self) -> bool:
        """Polled between episodes."""


def execute_run(spec: RunSpec, folder: Path, observer: Observer) -> RunOutcome:
    """Executes a run, or continues the one whose checkpoint lies in `folder`.

    Args:
      spec: what to run.
      folder: gets the checkpoint and, below `failures/`, the time series of every contact.
      observer: receives each episode.

    Raises:
      ConfigError: the spec poses no problem that can be run, or its ego failed in too many episodes in a row.
      CheckpointError: the checkpoint is of another run.
      OSError: the folder cannot be written.
    """
    started, started_cpu = time.monotonic(), time.process_time()
    folder.mkdir(parents=True, exist_ok=True)
    os.environ["OMP_NUM_THREADS"] = "1"  # of torch, where it is loaded later: runs are what is parallel
    if "torch" in sys.modules:
        sys.modules["torch"].set_num_threads(1)
    processes = processes_of(spec)
    with closing(RunState(spec, folder)) as run:
        for record, metrics in run.resume():
            observer.episode(record, metrics, run.series.get(record.index))
        played = rounds(run, folder, observer, processes) if run.in_rounds else episodes(run, folder, observer)
        for metrics in played:
            record = run.latest[-1]
            observer.episode(record, metrics, run.series.get(record.index))
            run.refuse_dead_ego()
            if run.episodes % spec.learner.checkpoint_every == 0:
                run.save()
        run.save()
    used_s = time.process_time() - started_cpu + run.rollouts_cpu_s
    return run.summary(wall_s=time.monotonic() - started, cpu_s=used_s, processes=processes)


def episodes(run: RunState, folder: Path, observer: Observer) -> Iterator[RunMetrics]:
    """Plays the rest of a run here; yields metrics after each episode."""
    with CrashGuard(folder) as guard:
        env = GuardedEnv(run.env, guard)
        while not run.finished and not observer.should_stop():
            yield episode(run, env)  # Alg. 1, l. 3


def episode(run: RunState, env: GuardedEnv) -> RunMetrics:
    """Plays the next episode: Algorithm 1, lines 4 to 22.

    In the evaluation phase the policy is frozen. Choice: scenes keep coming from the method's own sampler then, since
    it is the pair of sampler and policy that generates scenarios.
    """
    env.begin(run.episodes)
    proposal = propose(run)
    actor = run.searchers.begin(proposal.genes)
    return tell(run, proposal, play(env, proposal, actor, run.searchers.agent, run.reward))


def rounds(run: RunState, folder: Path, observer: Observer, processes: int) -> Iterator[RunMetrics]:
    """Plays the rest of a run in rounds; yields metrics per episode.

    Round r + 1 is asked for once round r - 1 is told, and is played while round r is. So no process waits for the
    slowest episode of a round, and the result depends neither on their number nor on their speed. A learner learns from
    an episode when it is told; a round is played with the policy of the moment in which it is asked for.
    """
    batch = run.spec.budget.batch
    elsewhere = processes_elsewhere()
    here = max(1, processes - len(elsewhere))
    with closing(Rollouts(Terms.of(run.spec), folder / ROLLOUT_FOLDER, here, elsewhere=elsewhere)) as rollouts:
        for proposal in run.proposed:  # an earlier process has asked for them
            rollouts.submit(proposal)
        while not observer.should_stop():
            most = (run.episodes // batch + ROUNDS_OUT) * batch
            while not run.spent and not run.waits and run.next_index < most:
                run.proposed.append(propose(run))
                rollouts.submit(run.proposed[-1])
            if not run.proposed:
                return
            played = rollouts.wait_for(run.proposed[0].index, POLL_S)
            if played is not None:
                yield tell(run, run.proposed.popleft(), played)


def propose(run: RunState) -> Proposal:
    """Chooses what to play next: Algorithm 1, line 4."""
    searchers, learning, index = run.searchers, run.learning, run.next_index
    searchers.next(learning=learning, out=len(run.proposed))
    point = searchers.ask(out=[proposal.point for proposal in run.proposed])
    scene, genes = searchers.split(point)
    return Proposal(
        index=index,
        phase=run.phase,
        learning=learning,
        seed=episode_seed(run.spec.stream, index),
        point=point,
        scene=scene,
        genes=genes,
        driven_by=searchers.driven_by(learning=learning),
        guided=searchers.guided,
        origin=searchers.origin if run.in_rounds else None,
        policy=searchers.snapshot() if run.in_rounds else None,
    )


def tell(run: RunState, proposal: Proposal, played: PlayedEpisode) -> RunMetrics:
    """Tells the searchers an episode; adds its record: Alg. 1, l. 21-22."""
    sums, encounter, unplayable = played.sums, played.encounter, played.unplayable
    mean_return = sums.shaped_return / sums.steps if unplayable is None else None
    run.searchers.recall(guided=proposal.guided, origin=proposal.origin)
    if proposal.policy is not None:
        run.searchers.learn(played.transitions, proposal.policy, proposal.seed)
    objective = run.searchers.tell(proposal.point, mean_return, encounter)
    ending = Ending.of(encounter.collision, encounter.violations) if unplayable is None else Ending(*unplayable, ())
    agent = run.searchers.agent
    genes = proposal.genes.tolist() if unplayable is None else []
    record = EpisodeRecord(
        index=proposal.index,
        phase=proposal.phase,
        seed=proposal.seed,
        scene=proposal.scene.values,
        **ending._asdict(),
        steps=sums.steps,
        risk_return=sums.risk_return,
        shaped_return=sums.shaped_return,
        mean_cost=sums.cost / sums.steps if sums.steps else 0.0,
        min_ttc_s=played.min_ttc_s,
        min_robustness=played.min_robustness,
        dual_variable=agent.dual_variable,
        temperature=agent.temperature,
        environment_steps=run.environment_steps + sums.steps,
        objective=objective,
        driven_by=proposal.driven_by,
        script=tuple(genes) or None,
        requirements=played.requirements,
        violations=encounter.violations,
        collision=encounter.collision,
        start_danger=played.start_danger,
        defect_reached_s=played.defect_reached_s,
        deviations=played.deviations,
        avoided_by=encounter.avoided_by or None,
    )
    return run.add(record, played)


def episode_seed(run_seed: int, index: int) -> int:
    """Returns an episode's seed, which all methods share for equal background traffic."""
    return int(np.random.SeedSequence((run_seed, index)).generate_state(1)[0] >> 1)
