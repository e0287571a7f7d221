"""The one order of a campaign's events."""

from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from threading import Barrier, Event

import pytest
from hypothesis import given
from hypothesis import strategies as st

from risk_sac.config import CampaignSpec
from risk_sac.execution.messages import Finished
from risk_sac.records import Episode, Outcome, State, StateChange
from service.errors import StorageError, TransitionError
from service.store.reading import Revisions
from service.store.stored import TRANSITIONS, advance, campaign_state


@pytest.fixture
def done(metrics):
    return Finished(finished=True, metrics=metrics, evaluation=None, digest="d", versions={}, wall_s=1.0)


@pytest.fixture
def campaign(ledger, episode, done):
    """Campaign of two interleaved runs of five episodes, one begun twice."""
    campaign = ledger.create(CampaignSpec(families=("low",), methods=("random",), seeds=(0, 1)))
    first, second = numbers = [run.number for run in campaign.runs]
    for number in numbers:
        ledger.start_run(number)
    for index in range(5):
        for number in numbers:
            ledger.add_episodes([(number, episode(index, Outcome.FAILURE if index == 2 else Outcome.SAFE))])
        if index == 1:
            ledger.requeue_run(first, "worker was killed by SIGKILL")
            ledger.start_run(first)
    ledger.end_run(first, State.SUCCEEDED, result=done)
    ledger.end_run(second, State.SUCCEEDED, result=done)
    return campaign


def story(store, campaign, position=0, limit=100):
    """Returns all events after a position, page by page, and their positions."""
    told, positions = [], []
    while True:
        page = store.events(campaign.id, after=position, limit=limit)
        assert page.items, "a page that ends nothing must tell something"
        assert len(page.items) <= limit
        told += map(short, page.items)
        positions += range(position + 1, position + 1 + len(page.items))
        position = positions[-1]
        if ends(page.items[-1]):
            assert page.last is None
            return told, positions


def ends(event):
    return isinstance(event, StateChange) and event.ends_campaign


def short(event):
    if isinstance(event, Episode):
        return event.id
    return f"{event.run_id or 'campaign'} {event.state}"


def test_all_is_told_in_the_order_in_which_it_was_written(store, campaign):
    told, positions = story(store, campaign)
    episodes = [f"low-random-{run}-search-{index}" for index in range(5) for run in (0, 1)]
    begins = ["low-random-0 running", "campaign running", "low-random-1 running"]
    again = ["low-random-0 queued", "low-random-0 running"]
    ends = ["low-random-0 succeeded", "low-random-1 succeeded", "campaign succeeded"]
    assert told == begins + episodes[:4] + again + episodes[4:] + ends
    assert positions == list(range(1, len(told) + 1))
    requeued = store.events(campaign.id, limit=100).items[told.index("low-random-0 queued")]
    assert requeued.reason == "worker was killed by SIGKILL"


@pytest.mark.parametrize("limit", [1, 2, 3, 7, 100])
def test_whoever_comes_back_is_told_exactly_the_rest(store, campaign, limit):
    told, positions = story(store, campaign)
    for index, position in enumerate([0, *positions[:-1]]):
        assert story(store, campaign, position, limit) == (told[index:], positions[index:])


def test_many_writers_and_readers_agree_on_one_order(store, ledger, episode, done):
    """Each run begins, loses its worker, begins again and ends, all concurrently."""
    campaign = ledger.create(CampaignSpec(families=("low",), methods=("random",), seeds=(0, 1, 2, 3)))
    together, failed = Barrier(len(campaign.runs)), Event()

    def work(number):
        together.wait()
        ledger.start_run(number)
        for index in range(20):
            if index % 7 == 6:
                ledger.requeue_run(number)
                ledger.start_run(number)
            ledger.add_episodes([(number, episode(index))])
        ledger.end_run(number, State.SUCCEEDED, result=done)

    def read(limit):
        """What a client is told that always asks for news."""
        told, ended = [], False
        while not ended and not failed.is_set():
            told += store.events(campaign.id, after=len(told), limit=limit).items
            ended = bool(told) and ends(told[-1])
        return told

    with ThreadPoolExecutor(7) as pool:
        readers = [pool.submit(read, limit) for limit in (1, 5, 100)]
        try:
            for writer in [pool.submit(work, run.number) for run in campaign.runs]:
                writer.result()
        except BaseException:
            failed.set()
            raise
        heard = [reader.result() for reader in readers]
    told, positions = story(store, campaign)
    assert positions == list(range(1, len(told) + 1))
    assert sum("search" in each for each in told) == 80
    assert len(set(pairwise("search" in each for each in told))) > 2, "episodes and changes lie among one another"
    for mine in heard:
        assert [short(each) for each in mine] == told
    for index, position in enumerate(positions[:-1], 1):
        assert story(store, campaign, position, 30)[0] == told[index:]


def test_an_episode_that_comes_out_otherwise_keeps_its_place(store, ledger, episode):
    campaign = ledger.create(CampaignSpec(families=("low",), methods=("random",)))
    number = campaign.runs[0].number
    ledger.start_run(number)
    for index in range(2):
        ledger.add_episodes([(number, episode(index))])
    before = store.events(campaign.id, limit=100).items
    ledger.add_episodes([(number, episode(0, Outcome.FAILURE))])
    ledger.add_episodes([(number, episode(2))])
    after = store.events(campaign.id, limit=100).items
    assert [short(each) for each in after] == [*map(short, before), "low-random-0-search-2"]


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


def test_a_page_of_events_ends_where_it_says(store, ledger, episode):
    campaign = ledger.create(CampaignSpec(families=("low",), methods=("random",)))
    ledger.start_run(campaign.runs[0].number)
    for index in range(3):
        ledger.add_episodes([(campaign.runs[0].number, episode(index))])
    assert store.events(campaign.id, limit=4).last == 4
    assert store.events(campaign.id, limit=5).last is None
    assert len(store.events(campaign.id, limit=4, after=3).items) == 2
    for after in (5, 6, 1 << 62):
        assert store.events(campaign.id, limit=4, after=after).items == ()


@pytest.mark.parametrize("damage", ["DELETE FROM changes", "UPDATE changes SET sequence = 9"])
def test_an_event_that_is_missing_is_noticed(store, ledger, damage):
    campaign = ledger.create(CampaignSpec(families=("low",), methods=("random",)))
    ledger.start_run(campaign.runs[0].number)
    with store.engine.begin() as connection:
        connection.exec_driver_sql(f"{damage} WHERE number = 2")
    with pytest.raises(StorageError, match="events 1 to 2 of campaign"):
        store.events(campaign.id, limit=9)


def test_a_refused_write_takes_no_number(store, ledger, episode):
    campaign = ledger.create(CampaignSpec(families=("low",), methods=("random",)))
    number = campaign.runs[0].number
    ledger.start_run(number)
    with pytest.raises(TransitionError):
        ledger.start_run(number)
    ledger.add_episodes([(number, episode(0))])
    ledger.add_episodes([(number, episode(0))])  # told again by a run that was taken up
    ledger.requeue_run(number)
    assert len(store.events(campaign.id, limit=9).items) == 5
    assert store.campaign(campaign.id).state is State.QUEUED


Q, R, P, X, C, S, F = State
states = st.sampled_from(State)


@given(states, states)
def test_advance_follows_the_table(current, new):
    if new in TRANSITIONS[current]:
        assert advance(current, new) is new
    else:
        with pytest.raises(TransitionError, match=f"state is {current}; got {new}"):
            advance(current, new)


@pytest.mark.parametrize(
    ("current", "runs", "wanted"),
    [
        (Q, [Q, Q], Q),
        (Q, [R, Q], R),
        (R, [S, Q], R),
        (R, [F, R], R),
        (R, [S, S], S),
        (R, [S, F], F),
        (R, [Q, Q], Q),  # the server stopped
        (R, [P, Q], P),
        (P, [Q, Q], Q),
        (P, [P, S], P),
        (X, [P, C], X),
        (X, [X, C], X),
        (X, [C, S], C),
        (X, [S, S], S),
        (X, [F, C], C),
        (Q, [C, C], C),
        (F, [R, S], F),  # a failed campaign stays failed while its workers leave
    ],
)
def test_campaign_state_follows_from_its_runs(current, runs, wanted):
    assert campaign_state(current, runs) is wanted


@given(states, st.lists(states, min_size=1, max_size=6))
def test_a_campaign_ends_exactly_when_all_its_runs_have(current, runs):
    ended = campaign_state(current, runs).final
    assert ended == (current.final or all(run.final for run in runs))
