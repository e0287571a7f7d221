"""Plays failures again, as recorded or as twins with one change.

`python -m risk_sac.failures.play FILE TIMES JOBS FOLDER...` replays the first failures of each variant `TIMES` over,
each time in a process of its own, `JOBS` of them at once. Each appends a line of JSON for each run to the file. They
are forked from a process that has read the libraries, which costs more than playing, but has never started SUMO.
"""

import json
import multiprocessing
import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from risk_sac.config import EgoConfig, RunSpec, method_of
from risk_sac.env.env import RiskSacEnv
from risk_sac.env.problem import Problem
from risk_sac.errors import InfeasibleScene, RiskSacError, SimulationError
from risk_sac.failures.question import TwinPlay
from risk_sac.failures.recording import Recording, Series, actions_of, trajectory_digest
from risk_sac.records import Collision, Ending, EpisodeRecord, RequirementResult, Violation
from risk_sac.risk.measures import soft_min
from risk_sac.run_folder.arrays import read_series
from risk_sac.run_folder.results import FAILURES, RunResults, first_of_variants, read_results, series_name
from risk_sac.world.types import STEP_S, Floats, Scene, Vector

AFTER_S = 3.0  # how long a twin goes on after the end of the failure that it is compared with
Policy = Callable[[Vector], Vector]
"""From an observation to an action."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Played:
    """A played episode, up to a contact or to the end of its actions."""

    series: Series
    signal_heads: NDArray[np.uint8]  # T since the release x heads, SUMO's letters
    requirements: Mapping[str, RequirementResult]  # how far each was kept
    collision: Collision | None
    violations: tuple[Violation, ...]  # without contact
    risk_return: float
    mean_cost: float
    defect_reached_s: float | None

    @property
    def found(self) -> tuple[Collision | Violation, ...]:
        """All violations of requirements that count, a contact first."""
        return (*(() if self.collision is None else (self.collision,)), *self.violations)

    def record(self, episode: EpisodeRecord) -> EpisodeRecord:
        """The record of an episode that went like this and was not trained on, otherwise as another one's."""
        since_release = slice(-len(self.signal_heads), None)
        changes = {
            **Ending.of(self.collision, self.violations)._asdict(),
            "steps": len(self.signal_heads) - 1,
            "risk_return": self.risk_return,
            "shaped_return": self.risk_return,
            "mean_cost": self.mean_cost,
            "min_ttc_s": float(self.series["least_ttc_s"][since_release].min()),
            "min_robustness": float(self.series["soft_min"][since_release].min()),
            "objective": None,
            "requirements": self.requirements,
            "violations": self.violations,
            "collision": self.collision,
            "defect_reached_s": self.defect_reached_s,
        }
        return episode.model_copy(update=changes)


def play(
    env: RiskSacEnv,
    scene: Scene,
    seed: int,
    actions: Floats,
    policy: Policy | None = None,
    motions: Series | None = None,
) -> Played:
    """Plays an episode with actions, `T x a`.

    A policy acts once the actions have ended, up to the horizon; without one the episode ends with them. Where there
    are motions, of an episode's time series, the adversaries repeat these before they act.

    Raises:
      InfeasibleScene, SimulationError, SceneError: it does not begin.
    """
    observation, info = env.reset(seed=seed, options={"scene": scene, "motions": motions})
    heads, rewards, costs = [env.signal_heads()], [0.0], [0.0]
    for step in range(env.problem.family.horizon_steps if policy else len(actions)):
        action = actions[step] if policy is None or step < len(actions) else policy(observation)
        observation, reward, touched, over, info = env.step(action)
        heads.append(env.signal_heads())
        rewards.append(reward)
        costs.append(info["cost"])
        if touched or over:
            break
    requirements = env.requirement_results()
    return Played(
        series=env.trace.series(),
        signal_heads=np.frombuffer(b"".join(heads), dtype=np.uint8).reshape(len(heads), -1),
        requirements=requirements,
        collision=info.get("collision"),
        violations=env.violations(requirements),
        risk_return=sum(rewards),
        mean_cost=sum(costs) / max(len(costs) - 1, 1),
        defect_reached_s=env.defect_reached_s,
    )


def replay(env: RiskSacEnv, episode: EpisodeRecord, recorded: Series) -> Played:
    """Plays an episode again with its recorded actions."""
    return play(env, Scene(env.problem.family.name, episode.scene), episode.seed, actions_of(recorded))


def repeated(env: RiskSacEnv, spec: RunSpec, episode: EpisodeRecord, recorded: Series) -> Played:
    """Plays a failure again; a SimulationError if it is not the same to the bit."""
    played = replay(env, episode, recorded)
    if trajectory_digest(played.series) != trajectory_digest(recorded):
        raise SimulationError(f"{episode.id_in(spec.id)} does not repeat here")
    return played


def twin_recording(spec: RunSpec, recording: Recording, changed: EgoConfig | None, name: str = "") -> Recording:
    """Plays a recorded failure's twin, which bears the other ego's name, to be drawn beside it."""
    played = twin(spec, recording.failure.episode, actions_of(recording.series), changed)
    told = TwinPlay.of(changed, recording.violation, played.found, name)
    return replace(recording, series=played.series, twin=told.title)


def twin(spec: RunSpec, episode: EpisodeRecord, actions: Floats, changed: EgoConfig | None) -> Played:
    """Plays a failure's episode, with its actions since the release, with another ego.

    Without another ego there is no attack: adversaries are left to SUMO, and pedestrians stand.

    Raises:
      ConfigError: the other ego poses no problem that can be run.
      InfeasibleScene: with the other ego, traffic is in danger when the adversaries are released.
    """
    if changed is not None:
        spec = spec.model_copy(update={"ego": changed})
    problem = Problem.from_spec(spec)
    steps = min(len(actions) + round(AFTER_S / STEP_S), problem.family.horizon_steps)
    longer = np.pad(actions, ((0, steps - len(actions)), (0, 0)))
    attacked = changed is not None and method_of(spec.method).agent != "none"
    with closing(RiskSacEnv(problem, spec.learner.reward, controlled=attacked)) as env:
        return play(env, Scene(spec.family, episode.scene), episode.seed, longer)


ATTEMPTS = 3
Prepared = Mapping[Path, tuple[RunResults, RiskSacEnv]]


def _prepared(file: Path, folders: Sequence[Path]) -> Prepared:
    """Opens the runs that can be played here; for each other run a line states why not."""
    prepared = {}
    for folder in folders:
        results = read_results(folder)
        try:
            prepared[folder] = results, RiskSacEnv.of(results.spec)
        except RiskSacError as error:
            _say(file, {"folder": str(folder), "error": f"{type(error).__name__}: {error}"})
    return prepared


def _say(file: Path, *lines: dict[str, object]) -> None:
    """Appends lines in one write, since several processes share the file and any may be killed."""
    with file.open("ab", buffering=0) as output:
        output.write("".join(f"{json.dumps(line)}\n" for line in lines).encode())


def _tell(file: Path, runs: Prepared) -> None:
    lines = list[dict[str, object]]()
    for folder, (results, env) in runs.items():
        try:
            with closing(env):
                same = [each.index for each in first_of_variants(results) if _repeats(folder, each, env)]
            lines.append({"folder": str(folder), "same": same})
        except (RiskSacError, OSError) as error:
            lines.append({"folder": str(folder), "error": f"{type(error).__name__}: {error}"})
    _say(file, *lines)


def _repeats(folder: Path, episode: EpisodeRecord, env: RiskSacEnv) -> bool:
    recorded = read_series(folder / FAILURES / series_name(episode.index))
    try:
        return trajectory_digest(replay(env, episode, recorded).series) == trajectory_digest(recorded)
    except (InfeasibleScene, SimulationError):
        return False


def _main(file: Path, times: int, jobs: int, folders: list[Path]) -> int:
    """The greatest exit status of the processes; one that was killed is replaced, up to `ATTEMPTS` times."""
    runs = _prepared(file, folders)
    soft_min(np.zeros(1), 1.0)  # the first call of any compiled function loads what all of them need
    fork, statuses = multiprocessing.get_context("fork"), [0]
    left, lost = times, 0
    while left:
        processes = [fork.Process(target=_tell, args=(file, runs)) for _ in range(min(jobs, left))]
        for process in processes:
            process.start()
        for process in processes:
            process.join()
            killed = (process.exitcode or 0) < 0 and lost < ATTEMPTS
            lost += killed
            left -= not killed
            statuses.append(0 if killed else abs(process.exitcode or 0))
    return max(statuses)


if __name__ == "__main__":
    file, times, jobs, *folders = sys.argv[1:]
    sys.exit(_main(Path(file), int(times), int(jobs), [Path(folder) for folder in folders]))
