"""Decides which failure of an episode detects its ego's defects."""

from contextlib import closing

import numpy as np

from risk_sac.config import RunSpec
from risk_sac.env.env import RiskSacEnv
from risk_sac.errors import InfeasibleScene
from risk_sac.failures.play import AFTER_S, Played, play
from risk_sac.failures.recording import Series, actions_of
from risk_sac.records import NO_CONTACT, Collision, EpisodeRecord, Violation
from risk_sac.verdicts.offences import STANDING_MPS
from risk_sac.world.geometry import corners, frame_view
from risk_sac.world.types import HEADING, LENGTH, STEP_S, WIDTH, Bools, Floats, Scene, X, Y

MARGIN_M = 0.5  # what the sound ego keeps to everything ahead of it or beside it
STOOD_S = 1.0  # what reaches an ego that has stood for so long does not count against it
SUBSTEPS = 5  # of a step, between which bodies move on a straight line
ROWS = 11  # of a frame's state


def candidates(episode: EpisodeRecord) -> list[Collision | Violation]:
    """Returns the contacts of an episode that may show its ego's defects: plausible, preventable and not minor."""
    contacts = [violation for violation in episode.valid_violations if violation.requirement == NO_CONTACT]
    return [contact for contact in contacts if contact.serious and contact.plausible]


def detected(spec: RunSpec, episode: EpisodeRecord, series: Series) -> Collision | Violation | None:
    """Returns the failure of an episode that detects its ego's defects; None without one.

    It is one of `candidates`, and a defect changed a command before the contact. The same ego without its defects
    keeps `MARGIN_M` when the adversaries repeat their recorded motions, see `least_clearance_m`. Then it has no valid
    contact, and no artefact of the simulator.

    Raises:
      SimulationError: SUMO failed in the repetition.
    """
    failures = [failure for failure in candidates(episode) if _reached(spec, episode, failure)]
    if not failures:
        return None
    try:
        sound = without_defects(spec, episode, series)
    except InfeasibleScene:
        return None
    if any(
        violation.artefact or (violation.valid and violation.requirement == NO_CONTACT) for violation in sound.found
    ):
        return None
    return failures[0] if least_clearance_m(sound.series) >= MARGIN_M else None


def _reached(spec: RunSpec, episode: EpisodeRecord, failure: Collision | Violation) -> bool:
    """Whether a defect changed a command before a failure; not known of SUMO's driver, whose defects are settings."""
    if spec.ego.driver is None:
        return True
    return episode.defect_reached_s is not None and episode.defect_reached_s < failure.time_s


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


def least_clearance_m(series: Series) -> float:
    """Computes the least gap of an ego to bodies ahead of it or beside it, m.

    It counts from the release on. A body behind the ego's rear does not count. Nor does one that stays within
    `MARGIN_M`: if it came so near in the ego's own track, from behind, or if the ego had stood for `STOOD_S`.

    Args:
      series: time series of an episode, `T` frames and `n` actors, the ego first; NaN where an actor is absent.
    """
    gap_m, behind, follows = _surroundings(series)
    least, excused = np.inf, follows | _stood(series)[:, None]
    for actor in range(gap_m.shape[1]):
        near = gap_m[:, actor] < MARGIN_M
        begins = np.maximum.accumulate(np.where(near & ~np.roll(near, 1), np.arange(len(near)), 0))
        counts = ~behind[:, actor] & ~(near & excused[begins, actor])
        least = min(least, gap_m[counts, actor].min(initial=np.inf))
    return float(least)


def _surroundings(series: Series) -> tuple[Floats, Bools, Bools]:
    """Returns gap, whether behind the ego's rear, and whether there in its track, of other actors, `t x (n - 1)`."""
    time_s = _times(series)
    bodies = np.zeros((len(time_s), ROWS, len(series["ids"])))
    for actor in range(bodies.shape[2]):
        x, y, heading = (series[name][:, actor] for name in ("x_m", "y_m", "heading_rad"))
        at = [np.interp(time_s, series["time_s"], values) for values in (x, y, np.cos(heading), np.sin(heading))]
        bodies[:, X, actor], bodies[:, Y, actor], bodies[:, HEADING, actor] = *at[:2], np.arctan2(at[3], at[2])
    bodies[:, LENGTH], bodies[:, WIDTH] = series["length_m"], series["width_m"]
    gap_m = np.full((len(time_s), bodies.shape[2] - 1), np.inf)
    behind, follows = np.zeros(gap_m.shape, np.bool_), np.zeros(gap_m.shape, np.bool_)
    for moment, state in enumerate(bodies):
        there = np.flatnonzero(np.isfinite(state[X]))
        view = frame_view(np.ascontiguousarray(state[:, there]))
        gap_m[moment, there[1:] - 1] = view.gap
        ahead, aside = corners(view)
        behind[moment, there[1:] - 1] = ahead.max(axis=0) < -view.ego_half_length
        in_track = (aside.min(axis=0) < view.ego_half_width) & (aside.max(axis=0) > -view.ego_half_width)
        follows[moment, there[1:] - 1] = in_track
    return gap_m, behind, follows & behind


def _times(series: Series) -> Floats:
    since = series["time_s"][series["time_s"] >= series["released_s"]]
    times: Floats = np.linspace(since[0], since[-1], (len(since) - 1) * SUBSTEPS + 1)
    return times


def _stood(series: Series) -> Bools:
    """Whether the ego has stood for `STOOD_S`, at the same moments."""
    frames, time_s = np.arange(len(series["time_s"])), _times(series)
    moved = np.maximum.accumulate(np.where(series["speed_mps"][:, 0] >= STANDING_MPS, frames, 0))
    latest = np.searchsorted(series["time_s"], time_s, side="right") - 1
    stood: Bools = time_s - series["time_s"][moved[latest]] > STOOD_S
    return stood
