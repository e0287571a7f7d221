"""Which failures are refused because one of them does not repeat."""

import pytest

from risk_sac.config import RunSpec
from risk_sac.records import REPEATS, DrivenBy, EpisodeRecord, Grade, Outcome, PlausibilityClass, Repetition, Severity
from risk_sac.run_folder.results import RecordedFailure, RunResults, Verified, with_headline
from tests.builders import collision, episode_record, judgement, plausibility, run_metrics, violation


def failure(index: int, phase: str = "search", driven_by: DrivenBy | None = None, **changes: object) -> EpisodeRecord:
    struck = collision(**({"judgement": judgement()} | changes))
    return episode_record(index, Outcome.FAILURE, phase=phase, driven_by=driven_by, collision=struck)


def verified(**same: int) -> Verified:
    """Verified results: by episode, how many of two replays were the same."""
    episodes = {int(index[1:]): Repetition(times=2, same=count) for index, count in same.items()}
    return Verified(digest="d", code="c", versions={}, episodes=episodes)


def refused(records: tuple[EpisodeRecord, ...]) -> list[int]:
    return [record.index for record in records if REPEATS in record.reason]


def test_what_does_not_repeat_is_refused_and_what_is_like_it_but_repeats_is_not():
    records = [
        failure(0),
        failure(1),  # like it, and not replayed
        failure(2, judgement=judgement(Grade.FULL_BRAKING)),  # like it, and the same when it was replayed
        failure(3, judgement=judgement(variant="alongside")),  # of another variant
        failure(4, phase="evaluation"),
        episode_record(5),
    ]
    found = verified(e0=1, e2=2, e3=2, e4=2).judged(records)
    assert refused(found) == [0, 1]
    assert [record.outcome for record in found[:3]] == [Outcome.DEGENERATE, Outcome.DEGENERATE, Outcome.FAILURE]
    assert found[2:] == tuple(records[2:])
    first = found[0].collision
    assert first.artefact
    assert (first.judgement.grade, first.judgement.drivers) == (None, {})


def test_a_violation_is_refused_by_its_kind_and_what_else_the_episode_violates_stays():
    contact, broken = collision(judgement=judgement()), violation()
    records = [
        episode_record(0, Outcome.FAILURE, violations=(broken,)),
        episode_record(
            1, Outcome.FAILURE, violations=(broken,), collision=contact, failed=("no_contact", "never_fast")
        ),
        episode_record(
            2, Outcome.FAILURE, violations=(violation(requirement="gentle", kind="gentle violated; straight"),)
        ),
    ]
    found = verified(e0=1).judged(records)
    assert [record.refused_by(REPEATS) for record in found] == [("never_fast",), ("never_fast",), ()]
    assert [record.outcome for record in found] == [Outcome.DEGENERATE, Outcome.FAILURE, Outcome.FAILURE]
    assert found[1].failed == ("no_contact",)
    assert found[1].collision == contact


def results_of(*episodes: EpisodeRecord) -> RunResults:
    spec = RunSpec(family="low", method="random", seed=0)
    failures = tuple(RecordedFailure.of(spec.id, each) for each in episodes)
    return RunResults(spec=spec, spec_digest="", finished=True, metrics=run_metrics(), failures=failures)


MINOR = judgement(severity=Severity.MINOR)
HEADLINE = ("cut-in, straight", "never_fast violated; straight")
IMPLAUSIBLE = judgement(kind="crossing", plausibility=plausibility(PlausibilityClass.IMPLAUSIBLE))


def test_the_headline_has_each_kind_once_if_it_is_preventable_plausible_not_minor_and_repeats():
    results = results_of(
        failure(0, judgement=MINOR),
        failure(1),
        failure(2),  # like it
        failure(3, judgement=judgement(Grade.FULL_BRAKING, kind="leader")),
        failure(4, judgement=judgement(kind="merge")),  # does not repeat
        episode_record(6, Outcome.FAILURE, violations=(violation(grade=Grade.PREVENTABLE),)),
        failure(7, phase="evaluation"),
        failure(8, judgement=IMPLAUSIBLE),
    )
    found = with_headline(results, verified(e0=2, e1=2, e3=2, e4=1, e6=2, e7=2, e8=2)).metrics
    assert (found.headline, found.headline_kinds) == (2, HEADLINE)
    assert found.headline_kinds_published == HEADLINE[:1]
    assert results.metrics.headline is None, "before a replay"


MINOR_CONTACT = collision(judgement=MINOR)
IMPLAUSIBLE_CONTACT = collision(judgement=IMPLAUSIBLE)
UNAVOIDABLE = collision(judgement=judgement(Grade.UNAVOIDABLE))
REFUSED = collision(verdicts={"inside_limits": False})
KEPT, PREVENTED = violation(grade=Grade.UNAVOIDABLE), violation(grade=Grade.PREVENTABLE)


@pytest.mark.parametrize(
    ("contact", "violations", "worst"),
    [
        (MINOR_CONTACT, (PREVENTED,), PREVENTED),  # the headline counts it
        (MINOR_CONTACT, (KEPT,), MINOR_CONTACT),
        (IMPLAUSIBLE_CONTACT, (PREVENTED,), PREVENTED),  # the headline counts it
        (IMPLAUSIBLE_CONTACT, (KEPT,), IMPLAUSIBLE_CONTACT),
        (UNAVOIDABLE, (KEPT,), UNAVOIDABLE),
        (None, (KEPT, PREVENTED), PREVENTED),
        (REFUSED, (KEPT,), KEPT),
        (REFUSED, (), REFUSED),
        (None, (), None),
    ],
)
def test_the_violation_that_counts_most_names_the_episode(contact, violations, worst):
    assert episode_record(collision=contact, violations=violations).worst_violation is worst
