"""Plays failures again, as recorded or as twins with one change."""

from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from risk_sac.config import EgoConfig, RunSpec, method_of
from risk_sac.env.env import RiskSacEnv
from risk_sac.env.problem import Problem
from risk_sac.errors import SimulationError
from risk_sac.failures.question import TwinPlay
from risk_sac.failures.recording import Recording, Series, actions_of, trajectory_digest
from risk_sac.records import Collision, Ending, EpisodeRecord, RequirementResult, Violation
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
    """Plays a recorded failure's twin, to be drawn beside it.

    The twin bears the other ego's name.
    """
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
