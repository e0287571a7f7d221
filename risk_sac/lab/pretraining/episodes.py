"""Plays script episodes before the egos that the prior trains on.

Planners and the test set of the catalogue are not among these egos. Choice: weak egos are, since they give the first
failures, and what is learnt on them carries over.
"""

import io
from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import torch

from risk_sac.config import EgoConfig, RunSpec
from risk_sac.egos.defects.catalogue import DEFECTS
from risk_sac.env.env import RiskSacEnv
from risk_sac.errors import EgoFailed, InfeasibleScene
from risk_sac.run_folder.durable import replace_file
from risk_sac.scenario.reading import PAPER_FAMILIES
from risk_sac.search.agents.controls import ScriptFollower
from risk_sac.search.encounter import Encounter
from risk_sac.search.prior.coordinates import Coordinates
from risk_sac.search.prior.shipped import GRID
from risk_sac.search.scene_optimizer.archive import REFLECTED, mutated
from risk_sac.verdicts.distinct import variant_name
from risk_sac.world.types import Floats, Scene

SOUND: dict[str, EgoConfig] = {
    "default": EgoConfig(),
    "slow": EgoConfig(reaction_time_s=1.0),
    "fast": EgoConfig(reaction_time_s=0.1),
    "careful": EgoConfig(profile="careful"),
    "defensive": EgoConfig(profile="defensive"),
    "idm-aeb": EgoConfig(driver="idm-aeb"),
    "r157": EgoConfig(driver="r157"),
    "rss": EgoConfig(driver="rss"),
}

HELD_OUT = ("r157", "latency", "late-tracks", "tailgates")
"""Egos that policies are not trained on, so that their curves can be drawn on egos never met."""


def training_egos(family: str) -> dict[str, EgoConfig]:
    """Returns a family's egos by name: sound, and with training defects.

    The catalogue says which defects matter in the paper's families; in any other family all may.
    """
    faulty = {
        name: EgoConfig(driver="idm-aeb", defects=(name,))
        for name, defect in DEFECTS.items()
        if not defect.test_set and defect.kind != "sumo" and (family in defect.families or family not in PAPER_FAMILIES)
    }
    return SOUND | faulty


def drawn_ego(egos: Mapping[str, EgoConfig], random: np.random.Generator, sound: float) -> str:
    """Draws an ego's name; a share of the draws, `sound`, has no defect."""
    faulty = [name for name, ego in egos.items() if ego.defects]
    others = [name for name, ego in egos.items() if not ego.defects]
    names = others if random.random() < sound else faulty
    return names[random.integers(len(names))]


CHUNK, TURN = 250, 10  # episodes: of a chunk, and in a row before one ego, since libsumo runs one simulation
UNIFORM_SCENES, SCENE_DEVIATION = 0.6, 0.08
RANDOM_SCRIPTS, UNCHANGED, FAITHFUL = 0.3, 0.3, 0.5  # of the bred ones: not mutated; put before their own scene
SOUND_SHARE = 0.5  # of the draws, egos without a defect
CANDIDATES = 0.7  # of the parents, those that led to a candidate for the headline; without one a point is random


def play_stream(family: str, seed: int, stream: int, folder: Path, chunks: int) -> None:
    """Plays a stream in this process, see `Stream.play`."""
    torch.set_num_threads(1)
    EpisodeStream(family, seed, stream).play(folder, chunks)


@dataclass(frozen=True, slots=True, kw_only=True)
class ScriptEpisode:
    """One script in one scene before one ego."""

    point: Floats  # scene, then genes, in the unit cube
    ego: str
    steps: int
    kind: str = ""  # of the valid violation; empty without one
    preventable: bool = False
    candidate: bool = False  # for the headline: preventable, plausible and not minor


@dataclass(slots=True)
class Parents:
    """Points that led to failures: those of the headline and the others, by kind."""

    candidates: dict[str, list[Floats]] = field(default_factory=dict)
    others: dict[str, list[Floats]] = field(default_factory=dict)

    def add(self, episode: ScriptEpisode) -> None:
        """Adds the episode's point if it is a failure."""
        if episode.kind:
            kinds = self.candidates if episode.candidate else self.others
            kinds.setdefault(episode.kind, []).append(episode.point)

    def draw(self, random: np.random.Generator) -> Floats | None:
        """Draws a kind, and then one of its points.

        Returns None where there is none of the drawn sort: candidates or others.
        """
        kinds = self.candidates if random.random() < CANDIDATES else self.others
        if not kinds:
            return None
        points = kinds[sorted(kinds)[random.integers(len(kinds))]]
        return points[random.integers(len(points))]


class EpisodeStream:
    """Plays the episodes of one stream in this process."""

    def __init__(self, family: str, seed: int, stream: int) -> None:
        """Prepares an environment for each training ego."""
        self._egos = training_egos(family)
        self._envs = {
            name: RiskSacEnv.of(RunSpec(family=family, method="archive", seed=seed, ego=ego))
            for name, ego in self._egos.items()
        }
        problem = next(iter(self._envs.values())).problem
        self._space, self._coordinates = problem.space, Coordinates.of(problem)
        self._follower = ScriptFollower(problem.family)
        self._horizon = problem.family.horizon_steps
        self._family, self._key = family, (seed, stream)
        self._parents = Parents()

    def play(self, folder: Path, chunks: int) -> None:
        """Plays chunks up to this number; those that lie in the folder are taken from there."""
        for chunk in range(chunks):
            path = folder / f"{self._family}-{self._key[1]:02d}-{chunk:04d}.npz"
            if not path.exists():
                write_episodes(path, self._chunk(chunk))
            for episode in read_episodes(path):
                self._parents.add(episode)

    def _chunk(self, chunk: int) -> list[ScriptEpisode]:
        random = np.random.default_rng((*self._key, chunk))
        episodes: list[ScriptEpisode] = []
        while len(episodes) < CHUNK:
            ego = drawn_ego(self._egos, random, SOUND_SHARE)
            with closing(self._envs[ego]):
                for _ in range(TURN):
                    episode = self._episode(ego, self._point(random), int(random.integers(1 << 30)))
                    if episode is not None:
                        episodes.append(episode)
        return episodes[:CHUNK]

    def _point(self, random: np.random.Generator) -> Floats:
        """Draws a scene and a script, on the grid that files keep."""
        drawn = self._drawn(random)
        if self._coordinates.symmetric and random.random() < REFLECTED:
            drawn = self._coordinates.reflected(drawn[None])[0]
        rounded: Floats = np.round(drawn * GRID) / GRID
        return rounded

    def _drawn(self, random: np.random.Generator) -> Floats:
        size, parent = self._space.dimension, self._parents.draw(random)
        if parent is None:
            return random.random(size + self._follower.genes)
        scene, genes = random.random(size), random.random(self._follower.genes)
        if random.random() >= UNIFORM_SCENES:
            scene = np.clip(parent[:size] + random.normal(0.0, SCENE_DEVIATION, size), 0.0, 1.0)
        if random.random() >= RANDOM_SCRIPTS:
            own, drawn = parent, self._parents.draw(random)
            other = parent if drawn is None else drawn
            if random.random() >= FAITHFUL:
                own, other = other, own
            genes = own[size:] if random.random() < UNCHANGED else mutated(own[size:], other[size:], random)
        return np.concatenate([scene, genes])

    def _episode(self, ego: str, point: Floats, seed: int) -> ScriptEpisode | None:
        """Plays a point before an ego; None if it cannot be played."""
        env, size = self._envs[ego], self._space.dimension
        scene = self._space.from_unit(point[:size])
        try:
            encounter, steps = play(env, self._follower, scene, point[size:], seed, self._horizon)
        except (InfeasibleScene, EgoFailed):
            return None
        return outcome_of(encounter, point, ego, steps)


def play(
    env: RiskSacEnv, follower: ScriptFollower, scene: Scene, genes: Floats, seed: int, horizon_steps: int
) -> tuple[Encounter, int]:
    """Plays a script in a scene; returns what the ego met, and the steps.

    Raises:
      InfeasibleScene: the scene breaks a rule of C_hard.
      EgoFailed: the ego cannot drive.
    """
    observation, info = env.reset(seed=seed, options={"scene": scene})
    follower.begin(genes)
    steps, ended = 0, False
    while not ended and steps < horizon_steps:
        observation, _, terminated, truncated, info = env.step(follower.act(observation))
        steps += 1
        ended = terminated or truncated or follower.can_stop_early
    kept = env.requirement_results()
    return Encounter(collision=info.get("collision"), violations=env.violations(kept)), steps


def outcome_of(encounter: Encounter, point: Floats, ego: str, steps: int) -> ScriptEpisode:
    """Returns an episode's row; of several valid violations the one that is worth most counts."""
    worst = encounter.worst
    return ScriptEpisode(
        point=point,
        ego=ego,
        steps=steps,
        kind="" if worst is None else variant_name(worst),
        preventable=worst is not None and worst.preventable,
        candidate=worst is not None and worst.headline_candidate,
    )


def write_episodes(path: Path, episodes: list[ScriptEpisode]) -> None:
    """Writes episodes as plain arrays."""
    buffer = io.BytesIO()
    np.savez_compressed(
        buffer,
        point=np.round([each.point * GRID for each in episodes]).astype(np.uint16),
        ego=np.array([each.ego for each in episodes]),
        steps=np.array([each.steps for each in episodes], np.int16),
        kind=np.array([each.kind for each in episodes]),
        flags=np.array([(each.preventable, each.candidate) for each in episodes]),
    )
    replace_file(path, buffer.getvalue())


def read_episodes(path: Path) -> list[ScriptEpisode]:
    """Reads what `write_episodes` wrote."""
    with np.load(path, allow_pickle=False) as arrays:
        columns = [arrays[name].tolist() for name in ("ego", "steps", "kind", "flags")]
        points = arrays["point"] / GRID
    return [
        ScriptEpisode(point=point, ego=ego, steps=steps, kind=kind, preventable=flags[0], candidate=flags[1])
        for point, ego, steps, kind, flags in zip(points, *columns, strict=True)
    ]
