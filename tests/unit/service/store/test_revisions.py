import pytest

from service.store.revisions import Mark, Revisions


@pytest.fixture
def revisions():
    revisions = Revisions()
    revisions.note("c1", "ours", 1)
    return revisions


def test_what_was_never_read_or_written_is_not_known(revisions):
    assert revisions.get("c2") is None


def test_an_episode_leaves_the_settled_revision_alone_and_all_else_moves_it(revisions):
    revisions.note("c1", "ours", 2, episode=True)
    revisions.note("c1", "ours", 3, episode=True)
    assert revisions.get("c1").mark == Mark(latest=3, settled=1)
    revisions.note("c1", "ours", 4)
    assert revisions.get("c1").mark == Mark(latest=4, settled=4)


def test_the_mark_of_all_campaigns_moves_with_each_of_them(revisions):
    marks = [revisions.all]
    for write in (
        lambda: revisions.note("c1", "ours", 2, episode=True),
        lambda: revisions.note("c2", "ours", 1),
        lambda: revisions.note("c1", "ours", 3),
        lambda: revisions.forget("c2"),
    ):
        write()
        marks.append(revisions.all)
    assert len({mark.latest for mark in marks}) == 5
    assert marks[1].settled == marks[0].settled
    assert len({mark.settled for mark in marks}) == 4


def test_reading_an_older_revision_changes_nothing(revisions):
    revisions.note("c1", "ours", 5)
    before = revisions.all
    assert revisions.learn("c1", "ours", 4).mark.latest == 5
    assert revisions.all == before


def test_a_write_that_a_reader_saw_first_counts_all_the_same(revisions):
    before = revisions.all
    revisions.learn("c2", "ours", 1)
    assert revisions.all == before, "a campaign that is only read is no news"
    revisions.note("c2", "ours", 1)
    assert revisions.all.settled > before.settled


def test_a_deleted_campaign_is_forgotten(revisions):
    revisions.forget("c1")
    assert revisions.get("c1") is None
