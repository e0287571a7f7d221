import math

import pytest

from risk_sac.config import CampaignSpec
from risk_sac.records import Fault, Grade, Outcome, PlausibilityClass, Severity, State
from service.errors import NotFoundError
from service.store.queries import Judged
from tests.begun import start
from tests.builders import judgement, plausibility

SPEC = CampaignSpec(families=("low",), methods=("risk-sac", "random"), seeds=(3, 4))


def judged(event, kind):
    collision = event.record.collision.model_copy(update={"judgement": kind})
    return event.model_copy(update={"record": event.record.model_copy(update={"collision": collision})})


def test_a_record_comes_back_with_its_numbers_that_are_not_finite(store, ledger, episode):
    campaign = ledger.create(SPEC)
    ledger.add_episodes([(start(store, ledger), episode(5, Outcome.FAILURE))])
    found = store.failure(campaign.id, "low-risk-sac-3-search-5").episode
    assert found.id == "low-risk-sac-3-search-5"
    assert found.min_ttc_s == math.inf
    assert math.isnan(found.collision.early_min_ttc_s)


def test_pages_continue_where_they_ended_while_more_arrives(store, ledger, episode):
    campaign = ledger.create(SPEC)
    number = start(store, ledger)
    for index in range(5):
        ledger.add_episodes([(number, episode(index, Outcome.FAILURE if index % 2 else Outcome.SAFE))])
    first = store.episodes(campaign.id, limit=3)
    ledger.add_episodes([(number, episode(5))])
    second = store.episodes(campaign.id, limit=3, after=first.last)
    assert [item.index for item in first.items + second.items] == [0, 1, 2, 3, 4, 5]
    assert second.last is None
    failures = store.episodes(campaign.id, limit=10, run_id="low-risk-sac-3", outcomes=[Outcome.FAILURE])
    assert [item.index for item in failures.items] == [1, 3]


def test_a_pause_that_the_disk_refuses_to_note_is_shown_all_the_same(store, ledger):
    campaign, waiting = ledger.create(SPEC), ledger.create(SPEC)
    start(store, ledger)
    before = store.revision(campaign.id)
    store.refusal = "no room"
    shown = store.campaign(campaign.id)
    assert (shown.state, shown.reason) == (State.PAUSED, "no room")
    assert [run.state for run in shown.runs] == [State.PAUSED, State.QUEUED, State.QUEUED, State.QUEUED]
    assert shown.revision == store.revision(campaign.id) != before
    assert store.campaign(waiting.id).state is State.QUEUED
    store.refusal = None
    assert store.campaign(campaign.id).state is State.RUNNING
    assert store.revision(campaign.id) == before


def test_contacts_are_found_by_grade_severity_fault_what_was_broken_and_kind(store, ledger, episode):
    campaign = ledger.create(SPEC)
    numbers = [start(store, ledger) for _ in range(2)]
    kinds = [
        judgement(),
        judgement(
            Grade.FULL_BRAKING,
            plausibility=plausibility(PlausibilityClass.RARE),
            broke=(),
            severity=Severity.MINOR,
            fault=Fault.SHARED,
        ),
        judgement(Grade.UNAVOIDABLE, broke=("wrong_direction",), kind="crossing, 50 % hidden"),
    ]
    for number in numbers:
        told = [judged(episode(index, Outcome.FAILURE), kind) for index, kind in enumerate(kinds)]
        ledger.add_episodes([(number, event) for event in (*told, episode(3))])

    def found(run_id=None, **wanted):
        asked = {"outcomes": (Outcome.FAILURE,), "judged": Judged(**wanted)}
        return [item.index for item in store.episodes(campaign.id, limit=50, run_id=run_id, **asked).items]

    assert found() == [0, 1, 2] * 2
    assert found(grade=Grade.PREVENTABLE, run_id="low-random-3") == [0]
    assert found(fault=Fault.SHARED, severity=Severity.MINOR) == [1, 1]
    assert found(plausibility=PlausibilityClass.RARE) == [1, 1]
    assert found(plausibility=PlausibilityClass.ORDINARY) == [0, 2] * 2
    assert found(broke="red_light", grade=Grade.PREVENTABLE) == [0, 0]
    assert found(broke="red-light") == found(broke="redXlight") == found(broke="red") == []
    assert found(kind="crossing, 50 % hidden") == [2, 2]
    assert found(kind="crossing") == []


def test_the_most_likely_and_severe_failures_come_first_page_by_page(store, ledger, episode):
    campaign = ledger.create(SPEC)
    number = start(store, ledger)
    severities = (Severity.MINOR, Severity.SEVERE, Severity.MODERATE, Severity.SEVERE)
    likely = (0.5, 0.01, 0.5, 0.2)  # weights 0.005, 0.01, 0.05, 0.2
    for index, (severity, joint) in enumerate(zip(severities, likely, strict=True)):
        told = judgement(severity=severity, plausibility=plausibility(joint_probability=joint))
        ledger.add_episodes([(number, judged(episode(index, Outcome.FAILURE), told))])
    asked = {"outcomes": (Outcome.FAILURE,), "weighty": True}
    first = store.episodes(campaign.id, limit=3, **asked)
    second = store.episodes(campaign.id, limit=3, after=first.last, **asked)
    assert [[item.index for item in page.items] for page in (first, second)] == [[3, 2, 1], [0]]
    assert second.last is None


def test_an_id_with_a_nul_is_unknown_on_every_database(store, ledger):
    campaign = ledger.create(SPEC)
    for wrong in ("\0", f"{campaign.id}\0"):
        with pytest.raises(NotFoundError):
            store.campaign(wrong)
        with pytest.raises(NotFoundError):
            store.episodes(campaign.id, limit=1, run_id=wrong)
        with pytest.raises(NotFoundError):
            store.failure(campaign.id, f"{wrong}-search-0")


def test_an_episode_takes_a_slot_the_median_over_runs_times_their_processes(store, ledger, episode):
    ledger.create(SPEC.model_copy(update={"methods": ("random",), "seeds": (1, 2, 3)}))
    for processes, wall_s in ((1, 0.2), (4, 0.25), (None, 0.5)):
        number = start(store, ledger)
        ledger.requeue_run(number)
        ledger.start_run(number, processes)
        ledger.add_episodes([(number, episode(k).model_copy(update={"wall_s": wall_s})) for k in range(3)])
    ledger.create(SPEC.model_copy(update={"families": ("mixed",)}))  # waits
    assert store.episode_times() == {"low": {"random": 0.5}}
