import pytest

from risk_sac.config import CampaignSpec
from risk_sac.execution.messages import Finished
from risk_sac.records import Outcome, State, TriageState
from service.errors import TransitionError
from service.store.tables import IMPORTED
from tests.begun import start

SPEC = CampaignSpec(families=("low",), methods=("risk-sac", "random"), seeds=(3, 4))


def test_an_episode_reported_twice_is_stored_and_counted_once(store, ledger, episode):
    campaign = ledger.create(SPEC)
    number = start(store, ledger)
    reports = (episode(0), episode(1, Outcome.FAILURE), episode(1, Outcome.FAILURE), episode(0), episode(2))
    assert [bool(ledger.add_episodes([(number, report)])) for report in reports] == [True, True, False, False, True]
    run = store.campaign(campaign.id).runs[0]
    assert (run.episodes_done, run.failures, run.raw_collisions, run.rejected) == (3, 1, 1, 0)
    assert [item.index for item in store.episodes(campaign.id, limit=10).items] == [0, 1, 2]
    assert run.busy_s == 2.5  # the time was spent twice
    assert store.usage("default").cpu_s == 2.5


def test_the_pace_leaves_out_the_start_of_each_attempt_stalls_and_repetitions(store, ledger, episode):
    campaign = ledger.create(SPEC)
    number = start(store, ledger)

    def paced(*took):
        for index, took_s in took:
            ledger.add_episodes([(number, episode(index).model_copy(update={"wall_s": took_s}))])
        return store.campaign(campaign.id).runs[0].pace_s

    assert paced((0, 9.0)) is None
    assert paced((1, 0.5), (2, 0.5), (3, 40.0), (4, 0.5)) == 0.5
    ledger.requeue_run(number)
    ledger.start_run(number)
    assert paced((3, 7.0), (4, 0.0), (5, 0.25), (6, 0.75)) == 0.5
    assert store.campaign(campaign.id).runs[0].busy_s == 58.5


def test_an_episode_that_comes_out_otherwise_replaces_the_first(store, ledger, episode):
    campaign = ledger.create(SPEC)
    number = start(store, ledger)
    assert ledger.add_episodes([(number, episode(0, Outcome.FAILURE))])
    assert not ledger.add_episodes([(number, episode(0))])
    (stored,) = store.episodes(campaign.id, limit=10).items
    assert stored.outcome is Outcome.SAFE
    assert (store.campaign(campaign.id).runs[0].failures, store.campaign(campaign.id).runs[0].episodes_done) == (0, 1)


def test_failures_that_did_not_repeat_are_refused_with_the_end_of_their_run(store, ledger, episode, metrics):
    campaign = ledger.create(SPEC)
    first, second = start(store, ledger), start(store, ledger)
    ledger.add_episodes([(run, episode(index, Outcome.FAILURE)) for run in (first, second) for index in range(3)])
    end = {
        "evaluation": None,
        "digest": "abc",
        "versions": {},
        "wall_s": 1.0,
        "flaky": dict.fromkeys((0, 2), ("no_contact",)),
    }
    ledger.end_run(first, State.SUCCEEDED, result=Finished(finished=True, metrics=metrics, **end))
    runs = store.campaign(campaign.id).runs
    assert [(run.episodes_done, run.raw_collisions, run.failures) for run in runs[:2]] == [(3, 3, 1), (3, 3, 3)]
    found = store.episodes(campaign.id, run_id="low-risk-sac-3", limit=9).items
    assert [(each.outcome, each.reason) for each in found] == [
        (Outcome.DEGENERATE, "repeats"),
        (Outcome.FAILURE, ""),
        (Outcome.DEGENERATE, "repeats"),
    ]


def test_a_state_outside_the_table_is_refused_and_changes_nothing(store, ledger):
    campaign = ledger.create(SPEC)
    with pytest.raises(TransitionError, match="state is queued; got succeeded"):
        ledger.end_run(campaign.runs[0].number, State.SUCCEEDED)
    assert store.campaign(campaign.id) == campaign


def test_what_has_no_worker_any_more_waits_again_or_ends_cancelled(store, ledger):
    kept, dropped = ledger.create(SPEC), ledger.create(SPEC)
    for _ in range(5):
        start(store, ledger)
    ledger.cancel(dropped.id)
    ledger.pause([kept.runs[0].number], "no room")
    assert ledger.resume() == 4
    assert store.campaign(kept.id).state is State.QUEUED
    assert store.campaign(dropped.id).state is State.CANCELLED
    assert ledger.resume() == 0


def test_a_triage_outlives_that_its_run_reports_the_episode_again(store, ledger, episode):
    campaign = ledger.create(SPEC)
    number = start(store, ledger)
    ledger.add_episodes([(number, episode(0, Outcome.FAILURE))])
    noted = ledger.triage(campaign.id, "low-risk-sac-3-search-0", TriageState.DISMISSED, "artefact")
    ledger.add_episodes([(number, episode(0, Outcome.DEGENERATE))])
    assert store.triage(campaign.id, "low-risk-sac-3-search-0") == noted


def test_a_run_at_import_never_waits_for_a_worker(store, ledger):
    at_import, posted = ledger.create(SPEC, key=f"{IMPORTED}1"), ledger.create(SPEC, key="imported")
    for run in (*at_import.runs, *posted.runs):
        ledger.start_run(run.number)
    assert ledger.resume() == len(posted.runs)
    assert store.campaign(at_import.id).state is State.RUNNING
    assert store.begun_imports() == [at_import.id]


def test_tags_are_set_with_a_campaign_and_replaced_later(store, ledger):
    campaign = ledger.create(SPEC.model_copy(update={"tags": ("nightly", "a_b")}))
    ledger.create(SPEC.model_copy(update={"tags": ("nightly-2", "axb")}))

    def tagged(tag):
        return [found.id for found in store.campaigns(10, tag=tag).items]

    assert store.campaign(campaign.id).tags == ("nightly", "a_b")
    assert tagged("nightly") == tagged("a_b") == [campaign.id]
    before = store.revision(campaign.id)
    ledger.tag(campaign.id, ["nightly", "a_b"])
    assert store.revision(campaign.id) == before
    ledger.tag(campaign.id, [])
    assert store.campaign(campaign.id).tags == tuple(tagged("nightly")) == ()
    assert store.revision(campaign.id) != before
