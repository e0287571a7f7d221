"""Plays variants of a failure: in another scene, with other actions, in other traffic; and counts which still fail."""

from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass, replace

import numpy as np

from risk_sac.env import RiskSacEnv
from risk_sac.errors import InfeasibleScene, SimulationError
from risk_sac.failures.bundle import Bundle, check_world
from risk_sac.failures.recording import actions_of
from risk_sac.failures.studied import Region, Share, valid_contact
from risk_sac.records import Collision
from risk_sac.scenario.space import SceneSpace
from risk_sac.types import STEP_S, Floats, Scene

SCENES, COPIES = (0.01, 0.02, 0.05), 40  # of a region: shares of the scene parameters' ranges, and copies at each
SEEDS = 10  # of the traffic
ACTIONS = 0.05
TAIL_S = 3.0  # that is played on without any action: what is done less, or elsewhere, takes longer to end in a contact


@dataclass(frozen=True, slots=True, kw_only=True)
class Variant:
    """All that determines an episode."""

    scene: Floats  # in the order of the space's parameters, d
    actions: Floats  # from the release on, T x two for each adversary; 0 is what SUMO's driver would do anyway
    seed: int

    def perturbed(self, space: SceneSpace, scene: float, actions: float, random: np.random.Generator) -> "Variant":
        """A copy moved by up to a share of each parameter's range, and of each action."""
        shift = random.uniform(-scene, scene, len(self.scene)) * (space.high - space.low)
        factors = 1.0 + random.uniform(-actions, actions, self.actions.shape)
        return replace(
            self,
            scene=np.clip(self.scene + shift, space.low, space.high),
            actions=(self.actions * factors).clip(-1.0, 1.0).astype(self.actions.dtype),
        )


class Stage:
    """Plays variants of one failure; `original` is the failure as it was, and a tail of no action."""

    def __init__(self, bundle: Bundle) -> None:
        """Plays the failure once more; a SimulationError if it does not happen here."""
        episode = bundle.manifest.episode
        self.collision = valid_contact(bundle.manifest.id, episode)
        check_world(bundle.manifest)
        self.env = RiskSacEnv.of(bundle.manifest.spec)
        self.space = self.env.problem.space
        self.original = Variant(
            scene=np.array([episode.scene[name] for name in self.space.names]),
            actions=_with_tail(actions_of(bundle.series), self.env.problem.family.horizon_steps),
            seed=episode.seed,
        )
        self.played = 0  # episodes so far
        if not self.fails(self.original):
            self.env.close()
            raise SimulationError(f"{bundle.manifest.id} does not happen here")

    def scene(self, variant: Variant) -> Scene:
        """Returns the scene of a variant."""
        return Scene(self.space.family, dict(zip(self.space.names, variant.scene.tolist(), strict=True)))

    def play(self, variant: Variant) -> Collision | None:
        """Returns the contact of a variant; None without one, or if its scene is infeasible."""
        self.played += 1
        try:
            self.env.reset(seed=variant.seed, options={"scene": self.scene(variant)})
            for action in variant.actions:
                *_, touched, over, info = self.env.step(action)
                if touched:
                    collision: Collision = info["collision"]
                    return collision
                if over:
                    break
        except (InfeasibleScene, SimulationError):
            pass
        return None

    def fails(self, variant: Variant) -> bool:
        """Whether the ego fails as it did: a valid contact with the same striker, in the same type of conflict."""
        return alike(self.play(variant), self.collision)

    def copies(self, variant: Variant, share: float, count: int, random: np.random.Generator) -> Iterator[Variant]:
        """Yields copies whose scene and actions are perturbed by up to a share."""
        for _ in range(count):
            yield variant.perturbed(self.space, share, share, random)


def alike(found: Collision | None, wanted: Collision) -> bool:
    """Whether a contact is valid, with the same striker, and came about in the same type of conflict."""
    if found is None or not found.valid or found.judgement is None or wanted.judgement is None:
        return False
    same_type = found.judgement.conflict_type is wanted.judgement.conflict_type
    return same_type and found.other_id == wanted.other_id


def _with_tail(actions: Floats, horizon_steps: int) -> Floats:
    steps = min(round(TAIL_S / STEP_S), horizon_steps - len(actions))
    return np.pad(actions, ((0, steps), (0, 0)))


def region(bundle: Bundle) -> Region:
    """Plays a failure in scenes near its own, in other traffic, and with other actions: 170 episodes.

    An episode fails as it did if it ends in a valid contact with the same striker, in the same type of conflict.

    Raises:
      ConfigError: the bundle holds no valid failure that can be played here.
      SimulationError: it does not happen here.
    """
    stage = Stage(bundle)
    with closing(stage.env):
        failed = {what: [stage.fails(variant) for variant in variants] for what, variants in _neighbours(stage)}
    return Region(shares=tuple(Share.of(what, sum(each), len(each)) for what, each in failed.items()))


def _neighbours(stage: Stage) -> Iterator[tuple[str, list[Variant]]]:
    original, space, random = stage.original, stage.space, np.random.default_rng(0)
    for share in SCENES:
        yield f"scene by {share:.0%}", [original.perturbed(space, share, 0.0, random) for _ in range(COPIES)]
    yield "other traffic", [replace(original, seed=original.seed + 1 + i) for i in range(SEEDS)]
    yield f"actions by {ACTIONS:.0%}", [original.perturbed(space, 0.0, ACTIONS, random) for _ in range(COPIES)]
