"""The one order of a campaign's events."""

import pytest

from risk_sac.config import CampaignSpec
from risk_sac.records import State
from service.errors import StorageError, TransitionError


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
