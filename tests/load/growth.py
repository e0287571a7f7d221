"""Growth of a run with its episodes: time, memory and files.

    python -m tests.load.growth archive 100000 FOLDER

plays so many episodes, of which nothing is simulated: what was played is drawn, and all else is a real run. It prints
ten lines per tenfold number of episodes. The same command again goes on with the run in the folder, as any run does.
"""

import argparse
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import psutil

from risk_sac.config import Budget, RunSpec
from risk_sac.execution.recorder import Recorder
from risk_sac.records import EpisodeRecord, Grade, RunMetrics, SeriesFile
from risk_sac.search import loop
from risk_sac.search.agents.transition import Transition
from risk_sac.search.encounter import Encounter
from risk_sac.search.playing import EpisodeActor, EpisodeSums, GuardedEnv, PlayedEpisode, Proposal
from tests.builders import collision, judgement

FAILS, STEPS = 0.2, 10  # share of episodes, and transitions of each
LINES = 10 ** np.arange(2.0, 7.0, 0.1)
MANOEUVRES = ("follows", "turns left", "turns right", "changes lanes")
ZONES = ("front", "left", "right", "rear")


def drawn(
    guarded: GuardedEnv, proposal: Proposal, actor: EpisodeActor, agent: EpisodeActor, reward: Any
) -> PlayedEpisode:
    """In the place of `risk_sac.search.playing.play`: what the episode's seed says."""
    random = np.random.default_rng(proposal.seed)
    env, sums = guarded.env, EpisodeSums()
    observation = random.random(env.observation_size, dtype=np.float32)
    for step in range(STEPS):
        action = actor.act(observation, explore=proposal.learning)
        robustness, following = random.random(2).tolist()
        sums.add(robustness, 0.1, robustness)
        agent.observe(
            Transition(
                observation=observation,
                action=action,
                risk_reward=robustness,
                cost=0.1,
                robustness=robustness,
                next_robustness=following,
                next_observation=observation,
                terminated=step == STEPS - 1,
                accumulated_reward=sums.shaped_return,
            ),
            own=actor is agent,
        )
    return PlayedEpisode(sums=sums, encounter=_encounter(random), min_ttc_s=float(random.random()))


def _encounter(random: np.random.Generator) -> Encounter:
    margins = {"no_contact": 1.0, "on_carriageway": float(random.random())}
    if random.random() > FAILS:
        return Encounter(margins=margins, encounters_s={"lead": float(random.random())})
    struck = collision(
        ego_zone=str(random.choice(ZONES)),
        relative_speed_mps=float(random.uniform(0.0, 15.0)),
        ego_peak_braking_mps2=float(random.uniform(0.0, 9.0)),
        judgement=judgement(list(Grade)[random.integers(len(Grade))], ego_manoeuvre=str(random.choice(MANOEUVRES))),
    )
    return Encounter(collision=struck, margins=margins)


class Gauge:
    """Prints a line now and then; never stops the run."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._process = folder, psutil.Process()
        self._last, self._last_s = 0, time.process_time()

    def episode(self, record: EpisodeRecord, metrics: RunMetrics, series: SeriesFile | None) -> None:
        """See `Observer.episode`."""
        done = record.index + 1
        if done not in LINES.astype(int):
            return
        spent_s = time.process_time() - self._last_s
        sizes = " ".join(f"{name} {_kib(self._folder / name):,.0f} KiB" for name in ("checkpoint", "results.json"))
        print(
            f"{done:7,} episodes: {spent_s / (done - self._last) * 1e3:6.2f} ms each, "
            f"memory {self._process.memory_info().rss / 2**20:,.0f} MiB, {sizes}",
            flush=True,
        )
        self._last, self._last_s = done, time.process_time()

    def should_stop(self) -> bool:
        """See `Observer.should_stop`."""
        return False


def _kib(file: Path) -> float:
    return file.stat().st_size / 2**10 if file.exists() else 0.0


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("method")
    parser.add_argument("episodes", type=int)
    parser.add_argument("folder", type=Path)
    options = parser.parse_args()
    loop.play = drawn
    spec = RunSpec(family="low", method=options.method, seed=0, budget=Budget(episodes=options.episodes))
    recorder = Recorder(spec, options.folder, Gauge(options.folder))
    recorder.finish(loop.execute_run(spec, options.folder, recorder))
    return 0


if __name__ == "__main__":
    sys.exit(main())
