"""Realism cost.

C_real(s, a) = C_hard(s, a) + C_soft(s, a)                                           (5)

Choice: C_hard acts on the whole episode: a scene that breaks one of its rules is rejected before the first step. What
remains is C_soft, in [0, 1], of what adversaries do. Undisturbed traffic costs about 0, or a bound on the cost would
mean nothing.

Source: RISK-SAC, Sec. III-B.
"""

import math
from typing import Literal, Never

from risk_sac.errors import InfeasibleScene
from risk_sac.risk.publish import Assessment, worst_rss_margin
from risk_sac.world.geometry import overlapping_pairs
from risk_sac.world.types import Frame, Scene

MIN_INITIAL_TTC_S = 1.0  # a shorter one leaves a default driver (0.5 s delay) no chance: the scene itself collides
MIN_INITIAL_GAP_M = 0.5  # bodies placed closer than traffic ever stands

HardRule = Literal["initial_overlap", "initial_gap", "initial_ttc", "initial_rss", "initial_conflict"]


def refuse_overlap(frame: Frame, scene: Scene) -> None:
    """C_hard of (5) for every frame up to the release: no two bodies overlap; raises `InfeasibleScene`."""
    if pairs := overlapping_pairs(frame.state):
        first, second = (frame.ids[i] for i in pairs[0])
        _refuse(scene, "initial_overlap", f" by {first!r} and {second!r}")


def danger_of(assessment: Assessment, *, in_conflict: bool) -> HardRule | None:
    """C_hard of (5) for the frame of the release: the rule that it breaks, or None."""
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
    """C_hard of (5): the rule that the frame of the release breaks, or None.

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
