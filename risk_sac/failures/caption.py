"""A contact in words: what stands above its picture."""

import textwrap

from risk_sac.config import FamilyName
from risk_sac.failures.recording import Recording
from risk_sac.records import Collision, Grade

WIDTH = 120  # characters that the page holds
PREVENTED = {
    Grade.CAREFUL: "a careful driver would have prevented it",
    Grade.IDEAL: "only full braking at once would have prevented it",
    Grade.UNAVOIDABLE: "not even full braking at once would have prevented it",
}


def caption(family: FamilyName, recording: Recording) -> str:
    """Which contact of which run, what touched what, and what its judgement says; no line is too long for the page."""
    episode, collision = recording.contact.episode, recording.collision
    failed = f" · failed rules: {_words(episode.reason)}" if episode.reason else ""
    lines = [
        f"{family} · episode {recording.contact.id} · {episode.outcome}{failed}",
        f"the ego's {collision.ego_zone}, at {collision.ego_speed_mps:.1f} m/s, touched the {collision.other_zone} of "
        f"{collision.other_role} {collision.other_id!r}, at {collision.other_speed_mps:.1f} m/s, {_seen(collision)}",
        *_judged(collision),
    ]
    return "\n".join(textwrap.fill(line, WIDTH) for line in lines)


def _seen(collision: Collision) -> str:
    seen_s = collision.visible_for_s
    return f"which it had seen for {seen_s:.1f} s" if seen_s > 0 else "which it had not seen"


def _judged(collision: Collision) -> list[str]:
    """Lines with its kind, how it began, who would have prevented it, and whether the striker was in the wrong."""
    judgement = collision.judgement
    if judgement is None:
        return []
    before_s = collision.time_s - judgement.conflict_s
    grade = "" if judgement.grade is None else f" · grade {judgement.grade}: {PREVENTED[judgement.grade]}"
    return [
        judgement.signature,
        f"the conflict began {before_s:.1f} s before the contact{grade}",
        f"broken by the other: {_words(', '.join(judgement.broke)) or 'nothing'}",
    ]


def _words(names: str) -> str:
    return names.replace("_", " ")
