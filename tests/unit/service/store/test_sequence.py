"""The one order of events, and how it came over what had been numbered apart.

`before_sequences.sql` was written by the version before: three runs of one campaign, the first of which lost its worker
once, and whose second and third waited again when the server stopped; a campaign that ended meanwhile, and one that
waits.
"""

from contextlib import closing
from pathlib import Path
from random import Random

import pytest
from alembic import command
from alembic.config import Config
from sqlalchemy import create_engine

from risk_sac.config import CampaignSpec
from risk_sac.records import Episode, State
from service.errors import StorageError, TransitionError
from service.store.reading import Store
from service.store.writing import Ledger

BEFORE_SEQUENCES = Path(__file__).with_name("before_sequences.sql")
TABLES = ("campaigns", "runs", "episodes", "changes")


@pytest.fixture
def former_url(database_url):
    """A database from before there was one order."""
    engine, config = create_engine(database_url), Config()
    config.set_main_option("script_location", "service.store:migrations")
    with engine.begin() as connection:
        config.attributes["connection"] = connection
        command.upgrade(config, "0003")
        for line in BEFORE_SEQUENCES.read_text(encoding="utf-8").splitlines():
            connection.exec_driver_sql(line)
        if engine.dialect.name == "postgresql":  # which did not give the numbers itself
            for table in TABLES:
                connection.exec_driver_sql(f"SELECT setval(pg_get_serial_sequence('{table}', 'number'), 100)")
    engine.dispose()
    return database_url


@pytest.fixture
def upgraded(former_url):
    store = Store(former_url)
    yield store
    store.close()


def first_id(store):
    return store.campaigns(limit=3).items[-1].id


def read_first(url):
    with closing(Store(url)) as store:
        return store.events(first_id(store), limit=100)


def told(store, campaign_id, after=0):
    events = store.events(campaign_id, limit=100, after=after).items
    return [each.id if isinstance(each, Episode) else f"{each.run_id} {each.state}" for each in events]


def test_what_was_numbered_apart_comes_into_one_order(upgraded):
    posted, ended, running = upgraded.campaigns(limit=3).items
    assert told(upgraded, posted.id) == []
    episodes = ["low-random-0-train-0", "low-random-0-train-1"]
    ends = ["low-random-0 succeeded", "None succeeded"]
    assert told(upgraded, ended.id) == ["low-random-0 running", "None running", *episodes, *ends]
    assert [each.replace("low-random-", "").replace("-train-", ".") for each in told(upgraded, running.id)] == [
        *(
            "0 running",
            "None running",
            "1 running",
            "0 queued",
            "0 running",
        ),  # when it waited, nobody can tell any more
        *("0.0", "1.0", "0.1", "1.1", "1.2", "0.2", "0 succeeded", "2 running", "1.3", "2.0", "1.4", "2.1"),
        *("2 queued", "1.5", "1 queued"),
    ]


def test_what_is_there_goes_on(upgraded, episode):
    campaign_id = first_id(upgraded)
    before = told(upgraded, campaign_id)
    ledger = Ledger(upgraded)
    number = upgraded.waiting()["default"]
    ledger.start_run(number)
    ledger.add_episodes([(number, episode(6))])
    assert told(upgraded, campaign_id) == [*before, "low-random-1 running", "low-random-1-train-6"]


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


@pytest.mark.parametrize("seed", range(3))
def test_what_was_told_as_it_was_written_is_told_again_from_every_position(store, ledger, episode, seed):
    """Three runs that start, report, repeat, wait, pause and end in turns that chance chooses."""
    chance = Random(seed)
    spec = CampaignSpec(families=("low",), methods=("random",), seeds=(0, 1, 2))
    campaign = ledger.create(spec)
    other = ledger.create(spec)  # whose rows come between
    told_first = []

    def hear():
        told_first.extend(store.events(campaign.id, limit=500, after=len(told_first)).items)

    waiting, at_work = [run.number for run in campaign.runs], []
    ledger.start_run(other.runs[0].number)
    for index in range(60):
        ledger.add_episodes([(other.runs[0].number, episode(index))])
        if waiting and (not at_work or chance.random() < 0.4):
            at_work.append(waiting.pop(chance.randrange(len(waiting))))
            ledger.start_run(at_work[-1])
        elif chance.random() < 0.8:
            ledger.add_episodes([(chance.choice(at_work), episode(chance.randrange(30)))])
        else:
            waiting.append(at_work.pop(chance.randrange(len(at_work))))
            ledger.requeue_run(waiting[-1], "its worker died")
        hear()
    ledger.pause(at_work, "the disk is full")
    hear()
    ledger.resume()
    hear()
    ledger.cancel(campaign.id)
    hear()
    assert told_first[-1].state is State.CANCELLED
    for position in range(len(told_first) + 1):
        assert list(store.events(campaign.id, limit=500, after=position).items) == told_first[position:]


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
