"""Rewards of RISK-SAC, one pure function per equation, and rules of C_hard.

Every function works elementwise on floats, numpy arrays and torch tensors alike. Masks are 0 or 1,
in the same kind of container as the values beside them.

C_real(s, a) = C_hard(s, a) + C_soft(s, a)                                           (5)

Choice: C_hard acts on the whole episode: a scene that breaks one of its rules is rejected before the first step. What
remains is C_soft, in [0, 1], of what adversaries do. Undisturbed traffic costs about 0, or a bound on the cost would
mean nothing.

Source: RISK-SAC, Sec. III-B and III-C; shaping after Ng, Harada, Russell, "Policy invariance under
reward transformations", ICML 1999.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, Never, TypeVar

from risk_sac.config import LearnerConfig, Method, Requirement, RewardConfig
from risk_sac.errors import InfeasibleScene
from risk_sac.records import NO_CONTACT, Collision, Severity
from risk_sac.risk.publish import Assessment, worst_rss_margin
from risk_sac.world.geometry import overlapping_pairs
from risk_sac.world.types import Floats, Frame, Scene

if TYPE_CHECKING:
    from torch import Tensor

Value = TypeVar("Value", float, Floats, "Tensor")


def risk_reward(
    ttc_s: Value,
    rss_margin: Value,
    valid_collision: Value,
    degenerate_collision: Value,
    violated: Value,
    config: RewardConfig,
) -> Value:
    """Risk reward of one step.

    R_risk(s, a) = bonus · valid - penalty · [degenerate] + w_v · violated
                   + w_ttc · exp(-TTC / scale) + w_rss · [RSS violated]                                            (1)

    Deviation: the paper pays all valid collisions alike. A user wants to know which of them a reference driver would
    have prevented.
    Choice: the paper only filters degenerate contacts out. Without a price on them the policy settles for sideswipes,
    which are far easier to reach than a failure of the ego.

    Args:
      ttc_s: time to collision after the step, s, at least 0; its cap where there is none.
      rss_margin: the smallest after the step of the larger of both RSS margins, scaled; below 0 both are violated.
      valid_collision: what the valid collision is worth in which the step ended, in (0, 1]; else 0.
      degenerate_collision: 1 if it ended in contact that a validity rule refuses.
      violated: scales by which other requirements that count were violated for the first time; see `ViolationDepth`.
      config: sizes of the four terms.

    Source of the third term: Shalev-Shwartz et al., "On a formal model of safe and scalable self-driving cars", 2017.
    """
    sparse = config.valid_collision * valid_collision - config.degenerate_collision * degenerate_collision
    sparse += config.violation * violated
    near_miss = config.ttc_weight * math.e ** (-ttc_s / config.ttc_scale_s)  # `**` works on all three containers
    reward: Value = sparse + (near_miss + config.rss_weight * (rss_margin < 0))
    return reward


class ViolationDepth:
    """Measures how deeply an episode has violated requirements without contact.

    Choice: each requirement that counts pays for its depth once, up to a scale. So nothing is gained by staying in a
    violation, nor by one from before the adversaries' release.
    """

    def __init__(self, requirements: Sequence[Requirement]) -> None:
        """Looks at the requirements, `M`, in the order of their robustness."""
        self._counting = [
            i for i, each in enumerate(requirements) if each.counts == "failure" and each.name != NO_CONTACT
        ]

    def begin(self, robustness: Floats) -> None:
        """Begins an episode with the robustness at the release, `M`."""
        self._least = [min(robustness.item(i), 0.0) for i in self._counting]

    def gained(self, robustness: Floats) -> float:
        """Computes by how many scales, in sum, this step deepens the violations."""
        gained = 0.0
        for k, i in enumerate(self._counting):
            now, least = max(robustness.item(i), -1.0), self._least[k]
            if now < least:
                gained += least - now
                self._least[k] = now
        return gained


def worth(collision: Collision, config: RewardConfig) -> float:
    """Share of the valid-collision bonus that a collision earns, in [0, 1].

    Choice: a minor one is paid less, since no headline counts it.
    """
    if not collision.valid:
        return 0.0
    share = config.minor if collision.severity is Severity.MINOR else 1.0
    if collision.preventable:
        return share
    return share * (config.unpreventable if collision.avoidable else config.unavoidable)


def penalised_reward(risk_reward: Value, cost: Value, dual_variable: float) -> Value:
    """Penalised reward.

    R(s, a) = R_risk(s, a) - λ C_real(s, a)                                          (3)

    Args:
      risk_reward: R_risk.
      cost: realism cost C_real, at least 0.
      dual_variable: λ ≥ 0, the current one: a stored R would keep a stale λ.
    """
    return risk_reward - dual_variable * cost


def shaped_reward(
    reward: Value, robustness: Value, next_robustness: Value, discount: float, terminated: Value
) -> Value:
    """Computes the policy's shaped reward; the potential is φ(s) = -ρ(Φ, s).

    F(s, a, s') = γ φ(s') - φ(s)                                                     (6)
    R'(s, a) = R(s, a) + F(s, a, s') = R(s, a) - γ ρ(Φ, s') + ρ(Φ, s)                (8)

    Deviation: φ(s') = 0 where `terminated` is 1. Ng et al. need it for policy invariance: otherwise
    γ φ(s_T) is paid out once per episode and never taken back, so an episode that ends early at low
    robustness earns more than its risk reward says. Pass 0 everywhere for (8) to the letter, and pass 0
    for time-limit truncation in any case, since the value of s' is still bootstrapped there.

    Args:
      reward: penalised reward R of (3).
      robustness: ρ(Φ, s), the soft minimum (7), in units of the requirements' scales.
      next_robustness: ρ(Φ, s').
      discount: γ in (0, 1).
      terminated: 1 where s' is terminal and its potential is to be 0, else 0.
    """
    potential, next_potential = -robustness, -next_robustness * (1.0 - terminated)
    return reward + (discount * next_potential - potential)


@dataclass(frozen=True, slots=True)
class TrainingReward:
    """Training reward: R of (3), or R' of (8) with shaping.

    Alg. 1, l. 9-10.
    """

    method: Method
    config: LearnerConfig

    def __call__(
        self,
        risk_reward: Value,
        cost: Value,
        robustness: Value,
        next_robustness: Value,
        terminated: Value,
        dual_variable: float,
    ) -> Value:
        """The reward of one step, or of each of a batch.

        Args:
          risk_reward: R_risk.
          cost: C_soft.
          robustness: ρ(Φ, s).
          next_robustness: ρ(Φ, s').
          terminated: 1 where s' is terminal.
          dual_variable: λ, today's.
        """
        reward = penalised_reward(risk_reward, cost, dual_variable)  # Alg. 1, l. 9
        if not self.method.shaping:
            return reward
        without_potential = terminated * float(self.config.reward.zero_terminal_potential)
        return shaped_reward(  # Alg. 1, l. 10
            reward, robustness, next_robustness, self.config.agent.discount, without_potential
        )


MIN_INITIAL_TTC_S = 1.0  # a shorter one leaves a default driver (0.5 s delay) no chance: the scene itself collides
MIN_INITIAL_GAP_M = 0.5  # bodies placed closer than traffic ever stands

HardRule = Literal["initial_overlap", "initial_gap", "initial_ttc", "initial_rss", "initial_conflict"]


def refuse_overlap(frame: Frame, scene: Scene) -> None:
    """Applies C_hard of (5) up to the release; raises `InfeasibleScene` on overlap."""
    if pairs := overlapping_pairs(frame.state):
        first, second = (frame.ids[i] for i in pairs[0])
        _refuse(scene, "initial_overlap", f" by {first!r} and {second!r}")


def danger_of(assessment: Assessment, *, in_conflict: bool) -> HardRule | None:
    """Finds the C_hard rule of (5) that the release frame breaks."""
    least_gap_m, margin_m = float(assessment.gap_m.min(initial=math.inf)), worst_rss_margin(assessment)
    return broken_hard_rule(least_gap_m, assessment.least.ttc_s, margin_m, in_conflict=in_conflict)


def refuse_danger(rule: HardRule | None, scene: Scene) -> None:
    """Refuses a start that breaks a rule; raises `InfeasibleScene`."""
    if rule is not None:
        _refuse(scene, rule)


def _refuse(scene: Scene, rule: HardRule, details: str = "") -> Never:
    message = f"scene of {scene.family!r} breaks {rule}{details}: {dict(scene.values)}"
    raise InfeasibleScene(message, reason=rule)


def broken_hard_rule(gap_m: float, ttc_s: float, rss_margin: float, *, in_conflict: bool) -> HardRule | None:
    """Finds the rule of C_hard (5) that a release breaks, if any.

    `in_conflict` holds for R157's driver in the ego's place; the rest are the ego's smallest measures. The rule
    of `initial_overlap` is asked of every frame up to the release.
    """
    if gap_m < MIN_INITIAL_GAP_M:
        return "initial_gap"
    if ttc_s < MIN_INITIAL_TTC_S:
        return "initial_ttc"
    if rss_margin < 0.0:
        return "initial_rss"
    if in_conflict:
        return "initial_conflict"
    return None
