"""A judgement to put into collisions: a vehicle that cuts in while the ego drives straight."""

from typing import Any

from risk_sac.types import ConflictType, Grade, Judgement, ReferenceOutcome

AVOIDS = ReferenceOutcome(avoids=True, impact_speed_mps=0.0)
TOUCHES = ReferenceOutcome(avoids=False, impact_speed_mps=6.5)


def judgement(grade: Grade | None = Grade.CAREFUL, conflict_s: float = 2.5, **changes: Any) -> Judgement:
    """Judged so, and in everything else alike."""
    values: dict[str, Any] = {
        "definitions": 1,
        "conflict_type": ConflictType.CUT_IN,
        "conflict_s": conflict_s,
        "conflict_x_m": 301.0,
        "conflict_y_m": -2.5,
        "position": "ahead",
        "hidden": False,
        "ego_manoeuvre": "straight",
        "ego_response": "late_braking",
        "ground": "lane",
        "broke": ("red_light", "speeding"),
        "unresponsive": False,
        "drivers": {
            "careful": AVOIDS if grade is Grade.CAREFUL else TOUCHES,
            "bound": TOUCHES if grade is Grade.UNAVOIDABLE else AVOIDS,
        },
        "signature": "cut-in, straight",
    }
    return Judgement(grade=grade, **(values | changes))
