"""An episode played with given actions: as it was recorded, or as it might have been."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from risk_sac.config import RunSpec
from risk_sac.env import RiskSacEnv
from risk_sac.errors import ConfigError, SimulationError
from risk_sac.failures.trajectory import Series, actions_of, trajectory_digest
from risk_sac.records import Collision, EpisodeRecord
from risk_sac.types import Floats, Scene, Vector

Policy = Callable[[Vector], Vector]
"""From an observation to an action."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Played:
    """How an episode went, up to a contact or to where the actions ended."""

    series: Series
    signal_heads: NDArray[np.uint8]  # T since the release x heads, SUMO's letters
    collision: Collision | None
    risk_return: float
    mean_cost: float


def play(env: RiskSacEnv, scene: Scene, seed: int, actions: Floats, policy: Policy | None = None) -> Played:
    """Plays an episode, and keeps all of it.

    Args:
      env: of the problem.
      scene: where it begins.
      seed: of the traffic.
      actions: `T x a`.
      policy: acts once the actions have ended, up to the horizon; without one the episode ends with them.

    Raises:
      InfeasibleScene, SimulationError, SceneError: it does not even begin.
    """
    observation, info = env.reset(seed=seed, options={"scene": scene})
    heads, rewards, costs = [env.signal_heads()], [0.0], [0.0]
    for step in range(env.problem.family.horizon_steps if policy else len(actions)):
        action = actions[step] if policy is None or step < len(actions) else policy(observation)
        observation, reward, touched, _, info = env.step(action)
        heads.append(env.signal_heads())
        rewards.append(reward)
        costs.append(info["cost"])
        if touched:
            break
    return Played(
        series=env.trace.series(),
        signal_heads=np.frombuffer(b"".join(heads), dtype=np.uint8).reshape(len(heads), -1),
        collision=info.get("collision"),
        risk_return=sum(rewards),
        mean_cost=sum(costs) / max(len(costs) - 1, 1),
    )


def check_release(spec: RunSpec, episode: EpisodeRecord, recorded: Series) -> None:
    """Refuses what was recorded before there was a release.

    Raises:
      ConfigError: it was.
    """
    if "released_s" not in recorded:
        message = f"the series of {episode.id_in(spec.id)} is older than the release of adversaries"
        raise ConfigError("FAILURE", message)


def repeated(env: RiskSacEnv, spec: RunSpec, episode: EpisodeRecord, recorded: Series) -> Played:
    """A contact played again, the same to the bit.

    Raises:
      SimulationError: it does not repeat.
      ConfigError: its series is from before there was a release.
    """
    check_release(spec, episode, recorded)
    played = play(env, Scene(spec.family, episode.scene), episode.seed, actions_of(recorded))
    if trajectory_digest(played.series) != trajectory_digest(recorded):
        raise SimulationError(f"{episode.id_in(spec.id)} does not repeat here")
    return played
