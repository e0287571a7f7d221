from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from threading import Barrier, Event

import pytest

from risk_sac.config import CampaignSpec
from risk_sac.execution.messages import Finished
from risk_sac.records import Episode, Outcome, State, StateChange


@pytest.fixture
def done(metrics):
    return Finished(finished=True, metrics=metrics, evaluation=None, digest="d", versions={}, wall_s=1.0)


@pytest.fixture
def campaign(ledger, episode, done):
    """Two runs of five episodes that took turns, the first of which was begun twice."""
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
    """All that is told from a position on, in as many pages as it takes, and the positions."""
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
    """Each run is begun, loses its worker, is begun again and ends while the others are at work, and readers read."""
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
