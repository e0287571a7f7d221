"""Agents that learn nothing: idle, random and scripted ones."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Union

import numpy as np

from risk_sac.config import RunMethod, method_of
from risk_sac.env.observation_layout import PER_ADVERSARY, X_M, Y_M
from risk_sac.records import DrivenBy
from risk_sac.scenario.families import Family
from risk_sac.search.agents.transition import Transition
from risk_sac.search.scripts import PASSIVE, SIZE, Genes, Seen, act, adversaries_seen, cue, is_over
from risk_sac.world.types import STEP_S, Floats, Vector

if TYPE_CHECKING:
    from risk_sac.search.agents.stress import StressPpo, StressSac

REDRAWN = 0.1  # share of steps in which an adversary's action is drawn again: it holds for a second on average
AHEAD_M = 5.0  # between the centres: the ego's length
BRAKING = -0.5  # of the limit
ALONG_COS = 0.9  # headings less than about 25 degrees apart


class NonLearner:
    """Learner's interface for agents that learn nothing; λ and α are 0.

    Attributes:
      driven_by: what chooses the actions; None: nothing does, or, where there are genes, the sampler knows.
    """

    driven_by: DrivenBy | None = None
    device = "cpu"
    dual_variable = 0.0
    temperature = 0.0
    genes = 0
    can_stop_early = False

    def begin(self, genes: Floats) -> None:
        """Begins an episode."""

    def observe(self, transition: Transition, *, own: bool = True) -> None:
        """Ignores it."""

    def update(self) -> None:
        """Nothing to learn."""

    def state(self) -> dict[str, Any]:
        """Returns the state that the next episode depends on."""
        return {}

    def load(self, state: dict[str, Any]) -> None:
        """Continues from `state()`."""


class IdleAgent(NonLearner):
    """No actions: SUMO drives the adversary vehicles, and pedestrians stand."""

    def __init__(self, action_size: int, seed: int) -> None:
        self._action = np.zeros(action_size, dtype=np.float32)

    def act(self, observation: Vector, explore: bool = True) -> Vector:
        """Returns zeros, which the environment ignores."""
        return self._action


class RandomAgent(NonLearner):
    """Uniform actions in [-1, 1], each adversary's held for a while.

    Choice: drawn again in every step they would average out to nothing, since jerk is bounded, and the control would be
    too weak.
    """

    driven_by = DrivenBy.RANDOM

    def __init__(self, action_size: int, seed: int) -> None:
        self._generator = np.random.default_rng(seed)
        self._action = self._draw(action_size // 2)

    def _draw(self, adversaries: int) -> Vector:
        return self._generator.uniform(-1.0, 1.0, (adversaries, 2)).astype(np.float32)

    def act(self, observation: Vector, explore: bool = True) -> Vector:
        """Draws; the observation makes no difference."""
        redrawn = self._generator.random(len(self._action)) < REDRAWN
        self._action = np.where(redrawn[:, None], self._draw(len(self._action)), self._action)
        return self._action.ravel()

    def state(self) -> dict[str, Any]:
        """The generator's position and the action that is held."""
        return {"generator": self._generator.bit_generator.state, "action": self._action.tolist()}

    def load(self, state: dict[str, Any]) -> None:
        """Continues from `state()`."""
        self._generator.bit_generator.state = state["generator"]
        self._action = np.array(state["action"], dtype=np.float32)


class ScriptedAgent(NonLearner):
    """Fixed rule: a vehicle ahead of the ego cuts in and brakes.

    It drives in the ego's direction. All others keep on.
    """

    driven_by = DrivenBy.SCRIPT

    def __init__(self, action_size: int, seed: int) -> None:
        self._adversaries = action_size // 2

    def act(self, observation: Vector, explore: bool = True) -> Vector:
        """Acts on each adversary's part of the observation; nothing is random."""
        seen = observation[: self._adversaries * PER_ADVERSARY].reshape(-1, PER_ADVERSARY)
        x_m, y_m, cos = seen[:, 0] * X_M, seen[:, 1] * Y_M, seen[:, 4]
        ahead = (x_m > AHEAD_M) & (cos > ALONG_COS)
        drive, steer = np.where(ahead, BRAKING, 0.0), np.where(ahead, np.clip(-y_m, -1.0, 1.0), 0.0)
        return np.stack((drive, steer), axis=1).ravel().astype(np.float32)


BEHIND_M, BEHIND_STEPS = 6.0, 8  # so far and so long behind the ego, it no longer strikes
STANDING_MPS, STANDING_STEPS = 0.5, 30  # an ego that stands for so long waits for a signal, or for a queue


class ScriptFollower(NonLearner):
    """Driver of each adversary by genes of its own.

    An episode begins with the genes.

    Attributes:
      can_stop_early: whether the rest of the episode is not worth playing: all adversaries that act have fallen
        behind, or have finished their scripts a while ago, or the ego stands for long. Choice: such an episode is
        truncated; it counts as safe, with its steps.
    """

    def __init__(self, family: Family) -> None:
        """Follows nothing yet; see `begin`."""
        self._pedestrian = [False] * len(family.vehicles) + [True] * len(family.pedestrians)
        self._statics = len(family.statics)
        self.genes = SIZE * len(self._pedestrian)  # number of genes that an episode takes
        self.begin(np.zeros(self.genes))

    def begin(self, genes: Floats) -> None:
        """Begins an episode with genes in [0, 1], `SIZE` for each adversary."""
        rows: list[list[float]] = genes.reshape(-1, SIZE).tolist()
        threshold = min(PASSIVE, max(row[0] for row in rows))
        self._scripts = [Genes(*row) if row[0] >= threshold else None for row in rows]
        self._cued: list[int | None] = [None] * len(rows)
        self._step, self._behind, self._standing = 0, 0, 0
        self.can_stop_early = False

    def act(self, observation: Vector, explore: bool = True) -> Vector:
        """Acts on what `risk_sac.env.observation` says of each adversary; nothing is random."""
        seen = adversaries_seen(observation, len(self._pedestrian), self._step, self._statics)
        actions = np.zeros((len(seen), 2), dtype=np.float32)
        since_cue_s = [self._since_cue_s(i, one) for i, one in enumerate(seen)]
        for i, one in enumerate(seen):
            script = self._scripts[i]
            if script is not None and one is not None:
                actions[i] = act(script, one, since_cue_s[i], self._pedestrian[i])
        self._foresee(seen, since_cue_s)
        self._step += 1
        return actions.ravel()

    def _since_cue_s(self, i: int, seen: Seen | None) -> float:
        """Returns the time since an adversary's cue, s; negative before."""
        script = self._scripts[i]
        if self._cued[i] is None and script and seen and cue(script, seen, self._pedestrian[i]):
            self._cued[i] = self._step
        cued = self._cued[i]
        return -STEP_S if cued is None else (self._step - cued) * STEP_S

    def _foresee(self, seen: Sequence[Seen | None], since_cue_s: Sequence[float]) -> None:
        acting = [
            (script, one, since_s)
            for script, one, since_s in zip(self._scripts, seen, since_cue_s, strict=True)
            if script is not None and one is not None
        ]
        behind = all(one.x_m < -BEHIND_M for _, one, _ in acting)
        self._behind = self._behind + 1 if behind else 0
        standing = all(one.ego_mps < STANDING_MPS for _, one, _ in acting)
        self._standing = self._standing + 1 if standing else 0
        over = all(is_over(script, since_s) for script, _, since_s in acting)
        self.can_stop_early = over or self._behind >= BEHIND_STEPS or self._standing >= STANDING_STEPS


Control = Union[IdleAgent, RandomAgent, ScriptedAgent, ScriptFollower, "StressSac", "StressPpo"]
CONTROLS: Mapping[str, type[IdleAgent | RandomAgent | ScriptedAgent]] = {
    "scripted": ScriptedAgent,
    "random": RandomAgent,
    "none": IdleAgent,
}


def control(method: RunMethod, family: Family, seed: int) -> Control:
    """Makes the agent of a method that has no learner of ours."""
    agent = method_of(method).agent
    if agent in ("stress-sac", "stress-ppo"):
        from risk_sac.search.agents.stress import StressPpo, StressSac  # here, because it is an extra

        return (StressSac if agent == "stress-sac" else StressPpo)(2 * len(family.adversaries), seed)
    return ScriptFollower(family) if agent == "scripts" else CONTROLS[agent](2 * len(family.adversaries), seed)


class Held:
    """An action that is held for a number of steps."""

    def __init__(self, steps: int) -> None:
        self._steps = steps
        self.begin()

    def begin(self) -> None:
        """An episode begins: the next action is a new one."""
        self._action: Vector | None = None
        self._left = 0

    def act(self, decide: Callable[[], Vector]) -> Vector:
        """Returns the held action; asks `decide` once its steps are over."""
        if self._action is None or not self._left:
            self._action, self._left = decide(), self._steps
        self._left -= 1
        return self._action


class Decision:
    """Merges the environment steps of a decision into one transition.

    R = Σ_i γ^i r_i, costs alike, over the k steps of the decision; the following return is discounted by γ^k. So the
    shaping of (6) needs no sum: γ^k φ(s_k) - φ(s_0) equals the sum of the steps' own terms.

    Choice: for a decision of other drivers, which act in every step, the action is the mean of theirs.
    """

    def __init__(self, steps: int, discount: float) -> None:
        """Args: k, and γ of one environment step."""
        self._steps = steps
        self._weights = discount ** np.arange(steps)
        self.begin()

    def begin(self) -> None:
        """Begins an episode; forgets a decision that the last horizon cut off."""
        self._taken: list[Transition] = []

    def add(self, step: Transition) -> Transition | None:
        """Adds a step; returns the transition that it completes, if any.

        It is complete by the number of steps or by the end of the world.
        """
        self._taken.append(step)
        if len(self._taken) < self._steps and not step.terminated:
            return None
        taken, self._taken = self._taken, []
        weights = self._weights[: len(taken)]
        return replace(
            step,
            observation=taken[0].observation,
            action=np.mean([each.action for each in taken], axis=0, dtype=np.float32),
            risk_reward=float(weights @ [each.risk_reward for each in taken]),
            cost=float(weights @ [each.cost for each in taken]),
            robustness=taken[0].robustness,
        )
