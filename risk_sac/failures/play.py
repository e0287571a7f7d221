"""Plays failures again, or as changed twins; tells which detect a defect.

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
from risk_sac.records import NO_CONTACT, Collision, Ending, EpisodeRecord, RequirementResult, Violation
from risk_sac.risk.measures import soft_min
from risk_sac.run_folder.arrays import read_series
from risk_sac.run_folder.results import FAILURES, RunResults, first_of_variants, read_results, series_name
from risk_sac.verdicts.offences import STANDING_MPS
from risk_sac.world.geometry import corners, frame_view
from risk_sac.world.types import HEADING, LENGTH, STEP_S, WIDTH, Bools, Floats, Scene, Vector, X, Y

AFTER_S = 3.0  # how long a twin goes on after the end of the failure that it is compared with
Policy = Callable[[Vector], Vector]
"""From an observation to an action."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Played:
    """A played episode, up to a contact or its actions' end."""

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
        """Returns this play's record, untrained; other fields are those of `episode`."""
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
    """Plays a failure again; `SimulationError` unless equal to the last bit."""
    played = replay(env, episode, recorded)
    if trajectory_digest(played.series) != trajectory_digest(recorded):
        raise SimulationError(f"{episode.id_in(spec.id)} does not repeat here")
    return played


def twin_recording(spec: RunSpec, recording: Recording, changed: EgoConfig | None, name: str = "") -> Recording:
    """Plays a recorded failure's twin, labelled with the other ego's name."""
    played = twin(spec, recording.failure.episode, actions_of(recording.series), changed)
    told = TwinPlay.of(changed, recording.violation, played.found, name)
    return replace(recording, series=played.series, twin=told.title)


def twin(spec: RunSpec, episode: EpisodeRecord, actions: Floats, changed: EgoConfig | None) -> Played:
    """Plays an episode's actions with another ego; None means without an attack.

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
    """Opens the playable runs; a line per other run states why."""
    prepared = {}
    for folder in folders:
        results = read_results(folder)
        try:
            prepared[folder] = results, RiskSacEnv.of(results.spec)
        except RiskSacError as error:
            _say(file, {"folder": str(folder), "error": f"{type(error).__name__}: {error}"})
    return prepared


def _say(file: Path, *lines: dict[str, object]) -> None:
    """Appends lines in one write, since sharing processes may be killed."""
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
    """Returns the greatest exit status; replaces killed processes up to `ATTEMPTS` times."""
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


MARGIN_M = 0.5  # what the sound ego keeps to everything ahead of it or beside it
STOOD_S = 1.0  # what reaches an ego that has stood for so long does not count against it
SUBSTEPS = 5  # of a step, between which bodies move on a straight line
ROWS = 11  # of a frame's state


def candidates(episode: EpisodeRecord) -> list[Collision | Violation]:
    """Returns contacts that may show defects: plausible, preventable and not minor."""
    contacts = [violation for violation in episode.valid_violations if violation.requirement == NO_CONTACT]
    return [contact for contact in contacts if contact.serious and contact.plausible]


def detected(spec: RunSpec, episode: EpisodeRecord, series: Series) -> Collision | Violation | None:
    """Returns the episode's failure that detects its ego's defects, or None.

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
    """Whether a defect changed an earlier command; assumed of SUMO's driver."""
    if spec.ego.driver is None:
        return True
    return episode.defect_reached_s is not None and episode.defect_reached_s < failure.time_s


def without_defects(spec: RunSpec, episode: EpisodeRecord, series: Series) -> Played:
    """Plays an episode's motions against its ego without defects, then `AFTER_S` unattacked.

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
    """Computes the ego's least gap to bodies ahead or beside, m.

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
    """Returns gap, whether behind the ego, and whether in its track.

    Each is of the other actors, `t x (n - 1)`. Behind is behind the ego's rear; one in its track is behind it, too.
    """
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


if __name__ == "__main__":
    file, times, jobs, *folders = sys.argv[1:]
    sys.exit(_main(Path(file), int(times), int(jobs), [Path(folder) for folder in folders]))
