from dataclasses import replace

from risk_sac.failures.recording import Recording
from risk_sac.failures.show import CAPTION_WIDTH, caption
from risk_sac.records import Grade, Outcome
from tests.unit.failures.staged import JUDGED, synthetic_contact, with_release


def lines(**judged: object) -> list[str]:
    contact = synthetic_contact(JUDGED.model_copy(update=judged))
    return caption("mixed", Recording(contact, with_release())).splitlines()


def test_the_title_says_who_would_have_prevented_it_and_what_the_striker_broke() -> None:
    assert lines() == [
        "mixed · episode low-random-0-train-7 · failure",
        "the ego's front, at 10.0 m/s, touched the left of adversary 'pedestrian', at 1.0 m/s, "
        "which it had seen for 1.0 s",
        JUDGED.signature,
        "the conflict began 1.2 s before the contact · grade careful: a careful driver would have prevented it",
        "broken by the other: pedestrian on red",
    ]
    assert lines(grade=None, broke=())[-2:] == [
        "the conflict began 1.2 s before the contact",
        "broken by the other: nothing",
    ]
    assert lines(grade=Grade.UNAVOIDABLE)[-2].endswith(
        "grade unavoidable: not even full braking at once would have prevented it"
    )


def test_rules_that_the_contact_failed_are_named_in_full_on_lines_that_the_page_holds() -> None:
    contact = synthetic_contact()
    rules = "conflict_after_release, inside_limits, inside_grip, solid_bodies, ego_model_saw, ego_moving, no_sideswipe"
    failed = contact.episode.model_copy(update={"outcome": Outcome.DEGENERATE, "reason": rules})
    title = caption("mixed", Recording(replace(contact, episode=failed), with_release()))
    assert max(map(len, title.splitlines())) <= CAPTION_WIDTH
    assert rules.replace("_", " ") in title.replace("\n", " ")
