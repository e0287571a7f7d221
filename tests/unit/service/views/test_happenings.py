import pytest

from risk_sac.config import CampaignSpec
from risk_sac.types import Outcome
from service.errors import NotFoundError
from service.store.records import StoredEpisode
from service.store.states import State
from service.views.happenings import Position, knows, read_batch
from service.workers.messages import Finished

START = Position()


@pytest.fixture
def campaign(ledger, episode, metrics):
    """Two runs of five episodes that took turns, and ended one after the other."""
    campaign = ledger.create(CampaignSpec(families=("low",), methods=("random",), seeds=(0, 1)))
    numbers = [run.number for run in campaign.runs]
    for number in numbers:
        ledger.start_run(number)
    for index in range(5):
        for number in numbers:
            ledger.add_episode(number, episode(index, Outcome.FAILURE if index == 2 else Outcome.SAFE))
    done = Finished(finished=True, metrics=metrics, evaluation=None, digest="d", versions={}, wall_s=1.0)
    for number in numbers:
        ledger.end_run(number, State.SUCCEEDED, result=done)
    return campaign


def story(store, campaign, position=START, limit=100):
    """All that is told from a position on, in as many batches as it takes, and the positions."""
    told, positions = [], []
    while True:
        batch = read_batch(store, campaign.id, position, limit)
        assert batch.happenings, "a batch that ends nothing must tell something"
        told += [_short(happening.what) for happening in batch.happenings]
        positions += [happening.position for happening in batch.happenings]
        position = batch.position
        if batch.ended:
            return told, positions


def _short(what):
    if isinstance(what, StoredEpisode):
        return what.id
    return f"{what.run_id or 'campaign'} {what.state}"


def test_a_run_starts_before_its_episodes_and_ends_after_them(store, campaign):
    told, _ = story(store, campaign)
    episodes = [f"low-random-{run}-train-{index}" for index in range(5) for run in (0, 1)]
    begins = ["low-random-0 running", "campaign running", "low-random-1 running"]
    ends = ["low-random-0 succeeded", "low-random-1 succeeded", "campaign succeeded"]
    assert told == begins + episodes + ends


@pytest.mark.parametrize("limit", [1, 2, 3, 7])
def test_small_batches_tell_the_same_but_for_the_order_of_episodes_and_beginnings(store, campaign, limit):
    told, positions = story(store, campaign, limit=limit)
    whole, _ = story(store, campaign)
    assert sorted(told) == sorted(whole)
    assert told[-1] == whole[-1]
    assert len(set(positions)) == len(positions)


@pytest.mark.parametrize("limit", [1, 2, 100])
def test_whoever_comes_back_is_told_exactly_the_rest(store, campaign, limit):
    told, positions = story(store, campaign)
    for index, position in enumerate(positions[:-1]):
        rest, _ = story(store, campaign, position, limit)
        assert sorted(rest) == sorted(told[index + 1 :])
        assert rest[-1] == "campaign succeeded"


def test_what_goes_on_has_not_ended(store, ledger, episode):
    campaign = ledger.create(CampaignSpec(families=("low",), methods=("random",)))
    assert read_batch(store, campaign.id, Position()).happenings == ()
    ledger.start_run(campaign.runs[0].number)
    ledger.add_episode(campaign.runs[0].number, episode(0))
    batch = read_batch(store, campaign.id, Position())
    assert [_short(each.what) for each in batch.happenings][-1] == "low-random-0-train-0"
    assert not batch.ended
    assert not batch.more


def test_a_campaign_knows_only_positions_of_its_own(store, ledger, campaign):
    other = ledger.create(CampaignSpec(families=("low",), methods=("random",)))
    _, positions = story(store, campaign)
    assert all(knows(store, campaign.id, position) for position in [Position(), *positions])
    assert knows(store, other.id, Position())
    assert not any(knows(store, other.id, position) for position in positions)
    last = positions[-1]
    for wrong in (Position(last.episode + 1, last.change), Position(last.episode, last.change + 1), Position(-1, 0)):
        assert not knows(store, campaign.id, wrong)


def test_a_campaign_that_is_gone_has_no_feed(store):
    with pytest.raises(NotFoundError):
        read_batch(store, "none", Position())
