"""Whether a failure shows the defects of its ego, and nothing else.

Source: Magma (Hazimeh et al. 2020) tells reached, triggered and detected bugs apart.
"""

from contextlib import closing

import numpy as np

from risk_sac.config import RunSpec
from risk_sac.env import RiskSacEnv
from risk_sac.errors import InfeasibleScene
from risk_sac.failures.play import AFTER_S, Played, play
from risk_sac.failures.recording import Series, actions_of
from risk_sac.records import NO_CONTACT, Collision, EpisodeRecord, Violation
from risk_sac.types import STEP_S, Scene


def candidates(episode: EpisodeRecord) -> list[Collision | Violation]:
    """Returns the preventable contacts of an episode, any of which may show its ego's defects."""
    return [each for each in episode.valid_violations if each.preventable and each.requirement == NO_CONTACT]


def detected(spec: RunSpec, episode: EpisodeRecord, series: Series) -> Collision | Violation | None:
    """Returns the failure of an episode that detects its ego's defects; None without one.

    A reference driver would have prevented it, and the same ego without its defects does not violate the requirement
    validly when the adversaries repeat their recorded motions. Blind as these are, they may run into an ego that is
    elsewhere by then, from behind or while it stands: that is none of its failures. An artefact tells nothing.

    Raises:
      SimulationError: SUMO failed in the repetition.
    """
    failures = candidates(episode)
    if not failures:
        return None
    try:
        found = without_defects(spec, episode, series).found
    except InfeasibleScene:
        return None
    violated = {each.requirement for each in found if each.valid or each.artefact}
    return next((each for each in failures if each.requirement not in violated), None)


def without_defects(spec: RunSpec, episode: EpisodeRecord, series: Series) -> Played:
    """Plays the recorded motions of an episode against its ego without the defects, and `AFTER_S` without an attack.

    Raises:
      InfeasibleScene: without the defects, traffic is in danger when the adversaries are released.
      SimulationError: SUMO failed.
    """
    sound = spec.ego.model_copy(update={"defects": (), "version": None})
    with closing(RiskSacEnv.of(spec.model_copy(update={"ego": sound}))) as env:
        actions = np.zeros_like(actions_of(series))
        steps = min(len(actions) + round(AFTER_S / STEP_S), env.problem.family.horizon_steps)
        after = np.pad(actions, ((0, steps - len(actions)), (0, 0)))
        scene = Scene(env.problem.family.name, episode.scene)
        return play(env, scene, episode.seed, after, motions=series)
