import math
import queue
import time

import pytest

from risk_sac.config import Budget, CampaignSpec
from risk_sac.execution.executor import Cause, Exited
from risk_sac.execution.messages import Failed, Finished
from service.errors import OutdatedError, QuotaError
from service.runs.cleanup import check_quota, exhausted
from service.runs.manager import Manager
from service.settings import ServiceSettings
from service.store.stored import Usage

SPEC = CampaignSpec(families=("low",), methods=("random",))


class Scripted:
    """Executor whose attempts follow the test's script, one after another."""

    slots, cluster = math.inf, None

    def __init__(self, *attempts):
        self._attempts = list(attempts)
        self._told = queue.SimpleQueue()
        self.submitted = []

    def submit(self, number, spec, folder, slots):
        self.submitted.append(number)
        for message in self._attempts.pop(0):
            self._told.put((number, message))

    def events(self, timeout_s):
        try:
            return [self._told.get(timeout=timeout_s)]
        except queue.Empty:
            return []

    def cancel(self, number, grace_s):
        pass

    def wake(self):
        pass

    def silent_s(self, number):
        pass

    def close(self):
        pass


@pytest.fixture
def execute(store, tmp_path):
    """Executes a one-run campaign; returns its end, the executor, the manager."""

    def execute(*attempts):
        executor = Scripted(*attempts)
        manager = Manager(ServiceSettings(data_dir=tmp_path), store, executor)
        manager.start()
        campaign = manager.submit(SPEC)
        deadline = time.monotonic() + 60
        while not (found := store.campaign(campaign.id)).state.final:
            assert time.monotonic() < deadline
            time.sleep(0.02)
        manager.stop()
        return found.runs[0], executor, manager

    return execute


def test_a_lost_run_is_submitted_again_as_its_next_attempt(execute, metrics):
    lost, done = Exited("worker was killed by SIGKILL", Cause.KILLED, -9), Exited(None, Cause.ENDED, 0)
    finished = Finished(finished=True, metrics=metrics, evaluation=None, digest="d", versions={}, wall_s=1.0)
    run, executor, manager = execute([lost], [lost], [finished, done])
    assert (run.state, run.attempts) == ("succeeded", 3)
    assert executor.submitted == [run.number] * 3
    assert manager.restarts == {Cause.KILLED: 2}


def test_a_run_that_loses_its_cluster_again_and_again_has_not_failed(execute, metrics):
    lost, done = Exited("the cluster was lost", Cause.LOST), Exited(None, Cause.ENDED, 0)
    finished = Finished(finished=True, metrics=metrics, evaluation=None, digest="d", versions={}, wall_s=1.0)
    run, _, manager = execute(*[[lost]] * 6, [finished, done])
    assert (run.state, run.attempts) == ("succeeded", 7)
    assert manager.restarts == {Cause.LOST: 6}


def test_a_worker_that_stops_although_nobody_asked_was_told_to_by_somebody_else(execute, metrics):
    stopped = Finished(finished=False, metrics=metrics, evaluation=None, digest="", versions={}, wall_s=1.0)
    run, _, manager = execute([stopped, Exited(None, Cause.ENDED, 0)], [Failed(reason="no"), Exited(None)])
    assert (run.state, run.reason, run.attempts) == ("failed", "no", 2)
    assert manager.restarts == {Cause.KILLED: 1}


def test_what_was_queued_before_it_was_refused_fails_and_holds_nobody_up(store, ledger, execute, metrics):
    learner = SPEC.learner.model_copy(update={"checkpoint_every": 10**9})
    before = ledger.create(SPEC.model_copy(update={"learner": learner}))
    finished = Finished(finished=True, metrics=metrics, evaluation=None, digest="d", versions={}, wall_s=1.0)
    run, _, _ = execute([finished, Exited(None, Cause.ENDED, 0)])
    assert run.state == "succeeded"
    (outdated,) = store.campaign(before.id).runs
    assert (outdated.state, "learner.checkpoint_every" in outdated.reason) == ("failed", True)
    with pytest.raises(OutdatedError, match=r"learner\.checkpoint_every, which this one refuses"):
        store.campaign(before.id).spec  # noqa: B018


SETTINGS = ServiceSettings(quota_queued_runs=10, quota_cpu_hours=2.0)


def usage(queued_runs: int = 0, hours: float = 0.0) -> Usage:
    return Usage(queued_runs=queued_runs, cpu_s=3600.0 * hours)


@pytest.mark.parametrize(("waiting", "new"), [(0, 11), (9, 2), (10, 1)])
def test_one_run_more_is_refused_with_the_figures(waiting, new):
    with pytest.raises(
        QuotaError, match=f"got {new} runs with {waiting} waiting already; wanted at most 10"
    ) as refusal:
        check_quota(usage(waiting), new, SETTINGS)
    assert refusal.value.retry_after_s > 0


def test_worker_hours_are_used_up_when_they_are_reached():
    check_quota(usage(hours=1.999), 1, SETTINGS)
    assert not exhausted(usage(hours=1.999), SETTINGS)
    assert exhausted(usage(hours=2.0), SETTINGS)
    with pytest.raises(QuotaError, match=r"has used 2.00 worker hours within 24; wanted at most 2") as refusal:
        check_quota(usage(hours=2.0), 1, SETTINGS)
    assert refusal.value.retry_after_s > 0


def test_projects_share_the_slots_and_a_run_states_how_many_it_has(store, ledger, tmp_path):
    rounds = SPEC.model_copy(update={"budget": Budget(episodes=100, batch=8)})
    campaigns = [ledger.create(rounds, project) for project in ("ours", "theirs")]
    manager = Manager(ServiceSettings(data_dir=tmp_path, max_workers=8), store, Scripted([], []))
    assert [store.campaign(campaign.id).runs[0].processes for campaign in campaigns] == [None, None]
    manager._tend()
    assert [store.campaign(campaign.id).runs[0].processes for campaign in campaigns] == [4, 4]


@pytest.mark.parametrize(("slots", "wanted"), [(math.inf, 7), (3, 3), (0, 0)])
def test_as_many_are_at_work_as_may_be_and_as_there_is_room_for(store, tmp_path, slots, wanted):
    executor = Scripted()
    executor.slots = slots
    assert Manager(ServiceSettings(data_dir=tmp_path, max_workers=7), store, executor).workers == wanted
