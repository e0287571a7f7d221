"""The same scene with one thing changed: what was critical beside what is not, as in the paper's Fig. 2."""

from contextlib import closing
from dataclasses import replace

import numpy as np

from risk_sac.config import EgoConfig, RunSpec, method_of
from risk_sac.env import RiskSacEnv
from risk_sac.failures.play import Played, play
from risk_sac.failures.recording import Recording
from risk_sac.failures.trajectory import actions_of
from risk_sac.failures.twin_play import TwinPlay
from risk_sac.problem import Problem
from risk_sac.records import EpisodeRecord
from risk_sac.types import STEP_S, Floats, Scene

AFTER_S = 3.0  # how long a twin goes on after the contact that it is compared with


def twin_recording(spec: RunSpec, recording: Recording, changed: EgoConfig | None, name: str = "") -> Recording:
    """The twin of a recorded failure, to be drawn beside it; see `twin`.

    Args:
      spec: of the run that found it.
      recording: of the failure.
      changed: the other ego, or None.
      name: of the other ego; its profile if not given.
    """
    played = twin(spec, recording.contact.episode, actions_of(recording.series), changed)
    return replace(recording, series=played.series, twin=TwinPlay.of(changed, played.collision, name).title)


def twin(spec: RunSpec, episode: EpisodeRecord, actions: Floats, changed: EgoConfig | None) -> Played:
    """Plays a failure's episode once more with another ego, or with nobody who attacks.

    Args:
      spec: of the run that found it.
      episode: of the failure.
      actions: since the release, `T x a`.
      changed: the other ego; None to leave the adversaries to SUMO and to let pedestrians stand.

    Raises:
      ConfigError: the other ego poses no problem that can be run.
      InfeasibleScene: with the other ego, traffic is in danger already when the adversaries are released.
    """
    if changed is not None:
        spec = spec.model_copy(update={"ego": changed})
    problem = Problem.from_spec(spec)
    steps = min(len(actions) + round(AFTER_S / STEP_S), problem.family.horizon_steps)
    longer = np.zeros((steps, actions.shape[1]), dtype=actions.dtype)
    longer[: len(actions)] = actions[:steps]
    attacked = changed is not None and method_of(spec.method).agent != "none"
    with closing(RiskSacEnv(problem, spec.learner.reward, controlled=attacked)) as env:
        return play(env, Scene(spec.family, episode.scene), episode.seed, longer)
