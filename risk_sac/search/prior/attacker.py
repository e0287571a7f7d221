"""What the pretrained policy sees and does: it drives one adversary of an episode, the attacker.

Its input has the same size in every scenario and no names: tokens of the release and motion of the attacker, of the
ego and of all others pooled. All other adversaries act 0, as those do that a script leaves passive. The policy sees
each episode from the side on which the attacker is at the ego's left at first; so it attacks from both sides alike.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from risk_sac.env.observation_layout import (
    LATERAL_ADVERSARY,
    LATERAL_EGO,
    PER_ADVERSARY,
    PER_EGO,
)
from risk_sac.env.problem import Problem
from risk_sac.search.agents.transition import Transition
from risk_sac.search.frozen_policy import FrozenPolicy
from risk_sac.search.prior.tokens import ACTOR_EVEN, ACTOR_ODD, SCENE_EVEN, SCENE_ODD, Tokenizer
from risk_sac.world.types import Floats, Vector

PER_ACTOR = ACTOR_EVEN + ACTOR_ODD + PER_ADVERSARY
INPUT_SIZE = 3 * PER_ACTOR + PER_EGO + SCENE_EVEN + SCENE_ODD + 2  # attacker, sum and maximum; robustness, time left
ACTION_SIZE = 2
OTHER_ATTACKERS = 0.25  # share of the search's episodes whose attacker is drawn uniformly; choice
ASIDE = 1  # entry of an adversary's part of the observation: how far left of the ego it is

_MIRROR = np.ones(PER_ACTOR, np.float32)
_MIRROR[ACTOR_EVEN : ACTOR_EVEN + ACTOR_ODD] = -1.0
_MIRROR[[ACTOR_EVEN + ACTOR_ODD + entry for entry in LATERAL_ADVERSARY]] = -1.0
_EGO_MIRROR, _SCENE_MIRROR = np.ones(PER_EGO, np.float32), np.ones(SCENE_EVEN + SCENE_ODD, np.float32)
_EGO_MIRROR[LATERAL_EGO], _SCENE_MIRROR[SCENE_EVEN:] = -1.0, -1.0
INPUT_MIRROR = np.concatenate([_MIRROR, _EGO_MIRROR, _SCENE_MIRROR, _MIRROR, _MIRROR, np.ones(2, np.float32)])
ACTION_MIRROR = np.array([1.0, -1.0], np.float32)  # acceleration; lateral velocity or heading rate


class AttackerView:
    """Translates a problem's observations and actions to those of an attacker."""

    def __init__(self, problem: Problem) -> None:
        self.adversaries = len(problem.family.adversaries)
        self._tokenizer = Tokenizer(problem)
        ego = PER_ADVERSARY * self.adversaries
        scene = ego + PER_EGO
        robustness = scene + problem.space.dimension
        self._ego, self._scene = slice(ego, scene), slice(scene, robustness)
        self._robustness = slice(robustness, robustness + len(problem.requirements))

    def begin(self, random: np.random.Generator) -> "Attack":
        """Begins an episode; the generator is of what it draws at its start."""
        return Attack(self, float(random.random()), float(random.random()))

    def motion(self, observation: Vector) -> Vector:
        """Returns each adversary's part of an observation, `adversaries x PER_ADVERSARY`."""
        return observation[: self._ego.start].reshape(-1, PER_ADVERSARY)

    def on_the_right(self, observation: Vector, attacker: int) -> bool:
        """Whether an adversary is at the ego's right."""
        return bool(self.motion(observation)[attacker, ASIDE] < 0.0)

    def seen(self, observation: Vector, attacker: int, mirrored: bool) -> Vector:
        """Returns the policy's input, `INPUT_SIZE`."""
        tokens = self._tokenizer.of_scene(np.clip(observation[self._scene].astype(np.float64), 0.0, 1.0))
        live = np.zeros((len(tokens.actors), PER_ADVERSARY), np.float32)
        live[: self.adversaries] = self.motion(observation)
        actors = np.concatenate([tokens.actors, live], 1)
        others = np.delete(actors, attacker, 0)
        most, least = others.max(0), others.min(0)
        peak = np.where(most >= -least, most, least)  # the greatest magnitude, with its sign
        rest = np.array([observation[self._robustness].min(initial=1.0), observation[-1]], np.float32)
        parts = actors[attacker], observation[self._ego], tokens.scene, others.sum(0), peak, rest
        seen: Vector = np.concatenate(parts, dtype=np.float32)
        return seen * INPUT_MIRROR if mirrored else seen


class Attack:
    """An episode as its attacker's policy sees it."""

    def __init__(self, view: AttackerView, luck: float = 1.0, place: float = 0.0, attacker: int | None = None) -> None:
        """Begins an episode.

        Args:
          view: of the problem.
          luck: draw from [0, 1) that decides whether the attacker is drawn.
          place: draw from [0, 1) that decides which it is then.
          attacker: place among the adversaries; None: not chosen yet.
        """
        self._view, self._luck, self._place = view, luck, place
        self.attacker = attacker
        self._mirrored: bool | None = None

    def seen(self, observation: Vector, value: Callable[[Vector], float], explore: bool) -> Vector:
        """Returns the policy's input; chooses the attacker at the first decision.

        Args:
          observation: the problem's.
          value: of the policy's own action at an input, by a critic.
          explore: whether a share of the attackers is drawn uniformly.
        """
        if self.attacker is None:
            self.attacker = self._chosen(observation, value, explore)
        return self._seen(observation)

    def acted(self, action: Vector) -> Vector:
        """Returns the joint action of a policy's action."""
        joint = np.zeros((self._view.adversaries, ACTION_SIZE), np.float32)
        joint[self.attacker] = action * ACTION_MIRROR if self._mirrored else action
        return joint.ravel()

    def transition(self, step: Transition) -> Transition | None:
        """Returns a decision as the policy sees it; None before any adversary has acted.

        Where a script or another process drives, the attacker is the one that acts most in the first decision in which
        any acts.
        """
        if self.attacker is None:
            if not step.action.any():
                return None
            self.attacker = most_active(step.action)
        seen = self._seen(step.observation)
        own = step.action.reshape(-1, ACTION_SIZE)[self.attacker]
        action = own * ACTION_MIRROR if self._mirrored else own
        return replace(step, observation=seen, action=action, next_observation=self._seen(step.next_observation))

    def _chosen(self, observation: Vector, value: Callable[[Vector], float], explore: bool) -> int:
        """Returns the adversary of the greatest value, or a drawn one, among those on the net."""
        present: list[int] = np.flatnonzero(self._view.motion(observation).any(1)).tolist() or [0]
        if explore and self._luck < OTHER_ATTACKERS:
            return present[int(self._place * len(present))]
        sides = [self._view.on_the_right(observation, each) for each in present]
        inputs = [self._view.seen(observation, *each) for each in zip(present, sides, strict=True)]
        return present[int(np.argmax([value(each) for each in inputs]))]

    def _seen(self, observation: Vector) -> Vector:
        assert self.attacker is not None
        if self._mirrored is None:
            self._mirrored = self._view.on_the_right(observation, self.attacker)
        return self._view.seen(observation, self.attacker, self._mirrored)


def most_active(actions: Floats | Vector) -> int:
    """Returns the adversary that acts most in joint actions."""
    return int(np.abs(actions).reshape(-1, actions.shape[-1] // ACTION_SIZE, ACTION_SIZE).sum((0, 2)).argmax())


def going_on(policy: FrozenPolicy, problem: Problem, actions: Floats) -> Callable[[Vector], Vector]:
    """Returns what lets a frozen policy drive on after recorded joint actions, `T x a`."""
    attack = Attack(AttackerView(problem), attacker=most_active(actions))
    return lambda observation: attack.acted(policy(attack.seen(observation, lambda seen: 0.0, explore=False)))
