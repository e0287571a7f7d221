"""Which failures are refused because one of them does not repeat."""

from risk_sac.records import REPEATS, EpisodeRecord, Grade, Outcome, Repetition
from risk_sac.run_folder.verified import Verified
from tests.builders import collision, episode_record, judgement


def failure(index: int, phase: str = "train", **changes: object) -> EpisodeRecord:
    return episode_record(
        index, Outcome.FAILURE, phase=phase, collision=collision(**({"judgement": judgement()} | changes))
    )


def verified(**same: int) -> Verified:
    """Of replays, two of each; by the index of an episode, how many were the same."""
    episodes = {int(index[1:]): Repetition(times=2, same=count) for index, count in same.items()}
    return Verified(digest="d", code="c", versions={}, episodes=episodes)


def refused(records: tuple[EpisodeRecord, ...]) -> list[int]:
    return [record.index for record in records if REPEATS in record.reason]


def test_what_does_not_repeat_is_refused_and_what_is_like_it_but_repeats_is_not() -> None:
    records = [
        failure(0),
        failure(1),  # like it, and not replayed
        failure(2, judgement=judgement(Grade.IDEAL)),  # like it, and the same when it was replayed
        failure(3, other_speed_mps=20.0),  # of another kind
        failure(4, phase="evaluate"),
        episode_record(5),
    ]
    found = verified(e0=1, e2=2, e3=2, e4=2).judged(records)
    assert refused(found) == [0, 1]
    assert [record.outcome for record in found[:3]] == [Outcome.DEGENERATE, Outcome.DEGENERATE, Outcome.FAILURE]
    assert found[2:] == tuple(records[2:])
    first = found[0].collision
    assert first is not None
    assert first.artefact
    assert first.judgement is not None
    assert (first.judgement.grade, first.judgement.drivers) == (None, {})


def test_where_all_repeat_nothing_is_refused() -> None:
    records = (failure(0), failure(1))
    assert verified(e0=2).judged(records) == records
