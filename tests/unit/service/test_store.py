import math
import sqlite3
from dataclasses import replace

import pytest

from risk_sac.config import CampaignSpec
from risk_sac.types import Outcome
from service.campaigns import State
from service.errors import NotFoundError, StorageError, TransitionError
from service.events import Finished
from service.store import Store

SPEC = CampaignSpec(families=("low",), methods=("risk-sac", "random"), seeds=(3, 4))


def start(store, ledger):
    run = store.next_queued()
    ledger.start_run(run.number)
    return run.number


def test_a_campaign_comes_back_as_it_was_posted(store, ledger):
    campaign = ledger.create(SPEC)
    assert store.campaign(campaign.id) == campaign
    assert campaign.spec == SPEC
    assert [run.id for run in campaign.runs] == ["low-risk-sac-3", "low-random-3", "low-risk-sac-4", "low-random-4"]
    assert [campaign.run_spec(run) for run in campaign.runs] == list(SPEC.runs())
    assert [run.spec_digest for run in campaign.runs] == [spec.digest for spec in SPEC.runs()]


def test_runs_leave_the_queue_in_the_order_they_came(store, ledger):
    first, second = ledger.create(SPEC), ledger.create(SPEC)
    left = [start(store, ledger) for _ in range(8)]
    assert left == [run.number for run in first.runs + second.runs]
    assert store.next_queued() is None


def test_an_episode_reported_twice_is_stored_and_counted_once(store, ledger, episode):
    campaign = ledger.create(SPEC)
    number = start(store, ledger)
    for report in (episode(0), episode(1, Outcome.FAILURE), episode(1, Outcome.FAILURE), episode(0)):
        ledger.add_episode(number, report)
    run = store.campaign(campaign.id).runs[0]
    assert (run.episodes_done, run.failures, run.raw_collisions, run.rejected) == (2, 1, 1, 0)
    assert [item.record.index for item in store.episodes(campaign.id, limit=10).items] == [0, 1]
    assert run.busy_s == 2.0  # the time was spent twice


def test_search_and_evaluation_episodes_of_one_index_are_two(store, ledger, episode):
    campaign = ledger.create(SPEC)
    number = start(store, ledger)
    ledger.add_episode(number, episode(0))
    ledger.add_episode(number, episode(0, phase="evaluate"))
    (run, *_) = store.campaign(campaign.id).runs
    assert run.episodes_done == 2
    assert run.metrics == run.evaluation == episode(0).metrics


def test_a_record_comes_back_with_its_numbers_that_are_not_finite(store, ledger, episode):
    campaign = ledger.create(SPEC)
    ledger.add_episode(start(store, ledger), episode(5, Outcome.FAILURE))
    found = store.failure(campaign.id, "low-risk-sac-3-train-5")
    assert found.id == "low-risk-sac-3-train-5"
    assert found.record.min_ttc_s == math.inf
    assert math.isnan(found.record.collision.min_ttc_s)


def test_pages_continue_where_they_ended_while_more_arrives(store, ledger, episode):
    campaign = ledger.create(SPEC)
    number = start(store, ledger)
    for index in range(5):
        ledger.add_episode(number, episode(index, Outcome.FAILURE if index % 2 else Outcome.SAFE))
    first = store.episodes(campaign.id, limit=3)
    ledger.add_episode(number, episode(5))
    second = store.episodes(campaign.id, limit=3, after=first.last)
    assert [item.record.index for item in first.items + second.items] == [0, 1, 2, 3, 4, 5]
    assert second.last is None
    failures = store.episodes(campaign.id, limit=10, run_id="low-risk-sac-3", outcomes=[Outcome.FAILURE])
    assert [item.record.index for item in failures.items] == [1, 3]


def test_campaigns_are_listed_newest_first(store, ledger):
    ids = [ledger.create(SPEC).id for _ in range(5)]
    first = store.campaigns(limit=2)
    ledger.create(SPEC)
    second = store.campaigns(limit=10, before=first.last)
    assert [item.id for item in first.items + second.items] == ids[::-1]


@pytest.mark.parametrize(
    "failure_id",
    ["", "-", "x", "low-risk-sac-3-train-0", "low-risk-sac-3-train-9", "low-risk-sac-3-train-٣", "a-train-99999999999"],
)
def test_what_does_not_exist_is_not_found(store, ledger, episode, failure_id):
    campaign = ledger.create(SPEC)
    ledger.add_episode(start(store, ledger), episode(0))
    with pytest.raises(NotFoundError):
        store.failure(campaign.id, failure_id)
    with pytest.raises(NotFoundError, match="no run 'x'; its runs are low-risk-sac-3"):
        store.episodes(campaign.id, limit=1, run_id="x")
    with pytest.raises(NotFoundError):
        store.campaign("x")
    with pytest.raises(NotFoundError):
        ledger.cancel("x")


def test_a_campaign_succeeds_with_its_last_run(store, ledger, metrics):
    campaign = ledger.create(SPEC)
    result = Finished(
        finished=True, metrics=metrics, evaluation=metrics, digest="abc", versions={"sumo": "1"}, wall_s=1
    )
    for _ in campaign.runs:
        assert store.campaign(campaign.id).state in (State.QUEUED, State.RUNNING)
        ledger.end_run(start(store, ledger), State.SUCCEEDED, result=result)
    campaign = store.campaign(campaign.id)
    assert campaign.state is State.SUCCEEDED
    assert campaign.created_at <= campaign.started_at <= campaign.finished_at
    assert campaign.runs[0].evaluation == metrics
    assert (campaign.runs[0].digest, campaign.runs[0].versions) == ("abc", {"sumo": "1"})


def test_one_failed_run_fails_the_campaign_once_the_others_have_ended(store, ledger):
    campaign = ledger.create(SPEC)
    ledger.end_run(start(store, ledger), State.FAILED, "worker was killed by SIGKILL")
    assert store.campaign(campaign.id).state is State.RUNNING
    for _ in range(3):
        ledger.end_run(start(store, ledger), State.SUCCEEDED)
    campaign = store.campaign(campaign.id)
    assert campaign.state is State.FAILED
    assert campaign.reason == "run low-risk-sac-3: worker was killed by SIGKILL"


def test_cancel_stops_what_runs_and_drops_what_waits(store, ledger):
    campaign = ledger.create(SPEC)
    number = start(store, ledger)
    assert ledger.cancel(campaign.id) == [number]
    assert ledger.cancel(campaign.id) == [number]
    states = [run.state for run in store.campaign(campaign.id).runs]
    assert states == [State.CANCELLING] + [State.CANCELLED] * 3
    ledger.end_run(number, State.CANCELLED)
    assert store.campaign(campaign.id).state is State.CANCELLED
    assert ledger.cancel(campaign.id) == []


def test_a_state_outside_the_table_is_refused_and_changes_nothing(store, ledger):
    campaign = ledger.create(SPEC)
    with pytest.raises(TransitionError, match="state is queued; got succeeded"):
        ledger.end_run(campaign.runs[0].number, State.SUCCEEDED)
    assert store.campaign(campaign.id) == campaign


def test_recovery_puts_interrupted_runs_back_and_ends_cancelled_ones(store, ledger):
    kept, dropped = ledger.create(SPEC), ledger.create(SPEC)
    for _ in range(5):
        start(store, ledger)
    ledger.cancel(dropped.id)
    assert ledger.recover() == 4
    assert store.campaign(kept.id).state is State.QUEUED
    assert store.campaign(dropped.id).state is State.CANCELLED
    assert ledger.recover() == 0


def test_a_failure_that_the_disk_refuses_is_told_and_written_later(store, ledger, episode, monkeypatch):
    campaign, other = ledger.create(SPEC), ledger.create(SPEC)
    ledger.add_episode(start(store, ledger), episode(0))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ledger, "_fail", _full_disk)
        ledger.fail(campaign.id, "the disk is full")
        ledger.save_failures()
        told = store.campaign(campaign.id)
        assert store.campaigns(limit=5).items[1] == told
        assert store.next_queued().campaign_id == other.id
        assert store.episodes(campaign.id, limit=5).items
    ledger.save_failures()
    assert not store.unsaved
    for snapshot in (told, store.campaign(campaign.id)):
        assert (snapshot.state, snapshot.reason) == (State.FAILED, "the disk is full")
        assert {run.state for run in snapshot.runs} == {State.FAILED}


def _full_disk(*_):
    raise StorageError("still full")


def test_a_file_that_is_no_database_is_a_storage_error(tmp_path):
    (tmp_path / "x.db").write_bytes(b"not a database, but long enough to look at" * 100)
    with pytest.raises(StorageError, match="storage failed while opening the database: file is not a database"):
        Store(tmp_path / "x.db")


def test_what_is_written_is_on_the_disk_before_the_answer(store, ledger, tmp_path):
    ledger.create(SPEC)
    with store.engine.connect() as connection:
        assert connection.exec_driver_sql("PRAGMA journal_mode").scalar() == "wal"
        assert connection.exec_driver_sql("PRAGMA synchronous").scalar() == 2  # FULL
    other = sqlite3.connect(tmp_path / "test.db")
    assert other.execute("SELECT count(*) FROM runs").fetchone() == (4,)
    other.close()


def test_failed_marks_only_what_has_not_ended(ledger):
    campaign = ledger.create(SPEC)
    done = replace(campaign.runs[0], state=State.SUCCEEDED)
    failed = replace(campaign, runs=(done, *campaign.runs[1:])).failed("no")
    assert failed.runs[0] == done
    assert {(run.state, run.reason) for run in failed.runs[1:]} == {(State.FAILED, "no")}
