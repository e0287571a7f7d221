"""A contact in words: what stands above its picture."""

from risk_sac.config import FamilyName
from risk_sac.failures.recording import Recording
from risk_sac.records import Collision


def caption(family: FamilyName, recording: Recording) -> str:
    """Which contact of which run, what touched what, and what its judgement says."""
    collision = recording.collision
    reason = f" ({recording.contact.episode.reason})" if recording.contact.episode.reason else ""
    return (
        f"{family} · episode {recording.contact.id} · {recording.contact.episode.outcome}{reason}\n"
        f"the ego's {collision.ego_zone} at {collision.ego_speed_mps:.1f} m/s, the {collision.other_zone} of "
        f"{collision.other_role} {collision.other_id!r} at {collision.other_speed_mps:.1f} m/s; "
        f"visible for {collision.visible_for_s:.1f} s" + _judged(collision)
    )


def _judged(collision: Collision) -> str:
    """Lines with who would have prevented it, how and where it began, and whether the striker was in the wrong."""
    judgement = collision.judgement
    if judgement is None:
        return ""
    grade = f"grade {judgement.grade}" if judgement.grade else "no grade"
    broke = ", ".join(judgement.broke) or "nothing"
    before_s = collision.time_s - judgement.conflict_s
    return (
        f"\n{grade} · {judgement.conflict_type} from {before_s:.1f} s before the contact, {judgement.conflict_s:.1f} s "
        f"after the release, at ({judgement.conflict_x_m:.1f}, {judgement.conflict_y_m:.1f}) m\n"
        f"the striker broke {broke}".replace("_", " ")
    )
