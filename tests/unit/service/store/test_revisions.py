import pytest

from service.store.revisions import Revisions


@pytest.fixture
def revisions():
    revisions = Revisions()
    revisions.note("c1", "ours", 1)
    return revisions


def test_the_revision_of_all_campaigns_moves_with_each_of_them(revisions):
    seen = [revisions.all]
    for write in (
        lambda: revisions.note("c1", "ours", 2),
        lambda: revisions.note("c2", "ours", 1),
        lambda: revisions.note("c1", "ours", 3),
        lambda: revisions.forget("c2"),
    ):
        write()
        seen.append(revisions.all)
    assert len(set(seen)) == 5


def test_reading_an_older_revision_changes_nothing(revisions):
    revisions.note("c1", "ours", 5)
    before = revisions.all
    assert revisions.learn("c1", "ours", 4) == 5
    assert revisions.all == before


def test_a_write_that_a_reader_saw_first_counts_all_the_same(revisions):
    before = revisions.all
    revisions.learn("c2", "ours", 1)
    assert revisions.all == before, "a campaign that is only read is no news"
    revisions.note("c2", "ours", 1)
    assert revisions.all > before
