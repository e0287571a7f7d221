"""Plays variants of a failure and counts which still fail.

A variant has another scene, other actions or other traffic.
"""

from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, replace

import numpy as np

from risk_sac.env.env import RiskSacEnv
from risk_sac.errors import InfeasibleScene, SimulationError
from risk_sac.failures.bundle import Bundle, check_world
from risk_sac.failures.play import play
from risk_sac.failures.recording import actions_of
from risk_sac.failures.studied import Region, Share, valid_failure
from risk_sac.records import Collision, Violation
from risk_sac.scenario.space import SceneSpace
from risk_sac.verdicts.evidence import Evidence
from risk_sac.world.types import STEP_S, Floats, Scene

SCENES, COPIES = (0.01, 0.02, 0.05), 40  # of a region: shares of the scene parameters' ranges, and copies at each
SEEDS = 10  # number of other traffic seeds that are played
ACTIONS = 0.05
TAIL_S = (
    3.0  # of no action after the failure, in which a variant may fail: what is done less, or elsewhere, takes longer
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Variant:
    """All that determines an episode."""

    scene: Floats  # in the order of the space's parameters, d
    actions: Floats  # from the release on, T x two for each adversary; 0 is what SUMO's driver would do anyway
    seed: int

    def perturbed(self, space: SceneSpace, scene: float, actions: float, random: np.random.Generator) -> "Variant":
        """Returns a copy perturbed by shares of the parameters' ranges and actions."""
        shift = random.uniform(-scene, scene, len(self.scene)) * (space.high - space.low)
        factors = 1.0 + random.uniform(-actions, actions, self.actions.shape)
        return replace(
            self,
            scene=np.clip(self.scene + shift, space.low, space.high),
            actions=(self.actions * factors).clip(-1.0, 1.0).astype(self.actions.dtype),
        )


class VariantPlayer:
    """Player for variants of one failure.

    `original` is the failure up to the violation, and a tail of no action.

    Attributes:
      failure: the violation that names it.
      grade: of the failure, as it was played here.
    """

    def __init__(self, bundle: Bundle) -> None:
        """Plays the failure once more; a `SimulationError` if it does not recur."""
        episode = bundle.manifest.episode
        self.failure = valid_failure(bundle.manifest.id, episode)
        check_world(bundle.manifest)
        self.env = RiskSacEnv.of(bundle.manifest.spec)
        self.space = self.env.problem.space
        self.original = Variant(
            scene=np.array([episode.scene[name] for name in self.space.names]),
            actions=_up_to(self.failure, actions_of(bundle.series), self.env.problem.family.horizon_steps),
            seed=episode.seed,
        )
        self.played = 0  # episodes so far
        violation = alike(self.play(self.original), self.failure)
        if violation is None:
            self.env.close()
            raise SimulationError(f"{bundle.manifest.id} does not happen here")
        self.grade = violation.graded

    def scene(self, variant: Variant) -> Scene:
        """Returns the scene of a variant."""
        return Scene(self.space.family, dict(zip(self.space.names, variant.scene.tolist(), strict=True)))

    def play(self, variant: Variant) -> Sequence[Collision | Violation]:
        """Returns a variant's violations, valid ones first; empty if infeasible.

        What begins more than `TAIL_S` after the failure is left out.
        """
        self.played += 1
        try:
            found = play(self.env, self.scene(variant), variant.seed, variant.actions).found
        except (InfeasibleScene, SimulationError):
            return ()
        in_time = [each for each in found if each.time_s <= self.failure.time_s + TAIL_S + STEP_S]
        return sorted(in_time, key=lambda each: not each.valid)

    def evidence(self) -> Evidence:
        """Returns the evidence of the variant that was played last."""
        return self.env.evidence()

    def fails(self, variant: Variant) -> bool:
        """Whether the ego fails as it did."""
        return alike(self.play(variant), self.failure) is not None

    def copies(self, variant: Variant, share: float, count: int, random: np.random.Generator) -> Iterator[Variant]:
        """Yields copies with scene and actions perturbed by up to `share`."""
        for _ in range(count):
            yield variant.perturbed(self.space, share, share, random)


def alike(violations: Sequence[Collision | Violation], wanted: Collision | Violation) -> Collision | Violation | None:
    """Returns a valid violation like the wanted one, or None.

    Contacts that are alike have the same striker and came about in the same type of conflict. Violations without
    contact are of the same requirement. Choice: whatever is near, since that changes from copy to copy where no actor
    makes the ego fail; where one does, the violation goes with what that actor does.
    """
    return next((each for each in violations if each.valid and _alike(each, wanted)), None)


def _alike(violation: Collision | Violation, wanted: Collision | Violation) -> bool:
    if not isinstance(violation, Collision) or not isinstance(wanted, Collision):
        return violation.requirement == wanted.requirement
    same_type = violation.judgement.conflict_type is wanted.judgement.conflict_type
    return same_type and violation.other_id == wanted.other_id


def _up_to(failure: Collision | Violation, actions: Floats, horizon_steps: int) -> Floats:
    """Cuts or pads actions to a failure's end.

    After a contact there are none for a while, else none up to the horizon.
    """
    if isinstance(failure, Collision):
        steps = min(round(TAIL_S / STEP_S), horizon_steps - len(actions))
    else:
        actions = actions[: round(failure.time_s / STEP_S)]
        steps = horizon_steps - len(actions)
    return np.pad(actions, ((0, steps), (0, 0)))


def region(bundle: Bundle) -> Region:
    """Plays a failure in near scenes, other traffic, and with other actions.

    It plays 170 episodes. `alike` decides which of them fail as the failure did.

    Raises:
      ConfigError: the bundle holds no valid failure that can be played here.
      SimulationError: it does not happen here.
    """
    stage = VariantPlayer(bundle)
    with closing(stage.env):
        failed = {what: [stage.fails(variant) for variant in variants] for what, variants in _neighbours(stage)}
    return Region(shares=tuple(Share.of(what, sum(each), len(each)) for what, each in failed.items()))


def _neighbours(stage: VariantPlayer) -> Iterator[tuple[str, list[Variant]]]:
    original, space, random = stage.original, stage.space, np.random.default_rng(0)
    for share in SCENES:
        yield f"scene by {share:.0%}", [original.perturbed(space, share, 0.0, random) for _ in range(COPIES)]
    yield "other traffic", [replace(original, seed=original.seed + 1 + i) for i in range(SEEDS)]
    yield f"actions by {ACTIONS:.0%}", [original.perturbed(space, 0.0, ACTIONS, random) for _ in range(COPIES)]
