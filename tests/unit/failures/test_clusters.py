import pytest

from risk_sac.failures.clusters import overview, vendi
from risk_sac.records import Collision, EpisodeRecord, Grade, Outcome
from tests.builders import collision, episode_record, judgement


def failure(signature: str, grade: Grade, **changes: float) -> Collision:
    return collision(verdicts={"ego_moving": True}, judgement=judgement(grade, signature=signature), **changes)


def found(*collisions: Collision) -> list[tuple[str, EpisodeRecord]]:
    return [
        (f"e{i}", episode_record(i, Outcome.FAILURE, steps=90 - i, collision=each)) for i, each in enumerate(collisions)
    ]


def test_failures_of_a_signature_are_a_cluster_with_the_most_preventable_and_shortest_first() -> None:
    cut_in = [
        failure("cut-in", grade)
        for grade in (Grade.UNAVOIDABLE, Grade.PREVENTABLE, Grade.FULL_BRAKING, Grade.PREVENTABLE)
    ]
    overviewed = overview(found(*cut_in, *[failure("leader", Grade.FULL_BRAKING)] * 9))
    first, second = overviewed.clusters
    assert (first.name, first.failures, first.preventable, first.distinct) == ("cut-in", 4, 2, 1)
    assert (first.representative, first.grade) == ("e3", Grade.PREVENTABLE)
    assert (second.name, second.failures, second.preventable) == ("leader", 9, 0)
    assert overviewed.covered == 1  # the signature is no part of the taxonomy
    assert overviewed.cells == 1872


def test_the_vendi_score_counts_what_has_nothing_in_common() -> None:
    one = failure("cut-in", Grade.PREVENTABLE)
    assert vendi([]) == 0.0
    assert vendi([[one] * 7]) == pytest.approx(1.0)
    assert vendi([[one], [one], [one]]) == pytest.approx(3.0)
    near, far = (failure("cut-in", Grade.PREVENTABLE, relative_speed_mps=speed) for speed in (7.5, 20.0))
    assert 1.0 < vendi([[one, near]]) < vendi([[one, far]]) < 2.0
