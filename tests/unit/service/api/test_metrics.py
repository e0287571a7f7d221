import pytest
from prometheus_client import generate_latest
from prometheus_client.parser import text_string_to_metric_families

from risk_sac.config import CampaignSpec
from risk_sac.execution.local import LocalExecutor
from risk_sac.execution.messages import Finished
from risk_sac.metrics.requirements import STEPS
from risk_sac.records import Outcome, RequirementCounts, State
from service.api.metrics import MOST_OWN, OTHERS, registry, request_latencies
from service.runs.manager import Manager, worker_program
from service.settings import ServiceSettings

SPEC = CampaignSpec(families=("low",), methods=("random", "sac"), seeds=(0, 1))


@pytest.fixture
def manager(store, tmp_path):
    settings = ServiceSettings(data_dir=tmp_path)
    return Manager(settings, store, LocalExecutor(worker_program(settings)))


@pytest.fixture
def scrape(store, manager):
    """Scrapes the service: samples by name and labels."""
    latencies = request_latencies()
    metrics = registry(latencies, store, manager)

    def read():
        families = text_string_to_metric_families(generate_latest(metrics).decode())
        samples = (sample for family in families for sample in family.samples)
        return {(sample.name, *sorted(sample.labels.values())): sample.value for sample in samples}

    read.latencies = latencies
    return read


def test_what_is_stored_is_counted(store, ledger, episode, scrape):
    campaign = ledger.create(SPEC)
    first, second, *_ = campaign.runs
    for run in (first, second):
        ledger.start_run(run.number)
    for index in range(4):
        ledger.add_episodes([(first.number, episode(index, Outcome.FAILURE if index % 2 else Outcome.REJECTED))])
    seen = scrape()
    assert seen["risk_sac_episodes_total", "low", "random"] == 4
    assert seen["risk_sac_episodes_total", "low", "sac"] == 0
    assert seen["risk_sac_failures_total", "low", "random"] == 2
    assert seen["risk_sac_contacts_total", "low", "random"] == 2
    for name in ("distinct", "preventable", "distinct_preventable"):  # as its metrics say
        assert seen[f"risk_sac_{name}_failures_total", "low", "random"] == 1
        assert seen[f"risk_sac_{name}_failures_total", "low", "sac"] == 0
    assert seen["risk_sac_run_ecr", *sorted([campaign.id, first.id, "low", "random"])] == 0.25  # as its metrics say
    assert seen["risk_sac_run_pcr", *sorted([campaign.id, first.id, "low", "random"])] == 0.25
    for gauge in ("risk_sac_run_ecr", "risk_sac_run_pcr"):
        assert not [key for key in seen if key[0] == gauge and second.id in key]  # no episode yet
    assert (seen["risk_sac_runs", "running"], seen["risk_sac_runs", "queued"]) == (2, 2)
    assert (seen["risk_sac_campaigns", "running"], seen["risk_sac_campaigns", "failed"]) == (1, 0)
    assert seen[("risk_sac_storage_available",)] == 1
    assert seen[("process_resident_memory_bytes",)] > 0


def test_headline_failures_count_once_a_run_was_replayed(store, ledger, metrics, scrape):
    run = ledger.create(SPEC).runs[0]
    ledger.start_run(run.number)
    assert scrape()["risk_sac_headline_failures_total", "low", "random"] == 0
    told = {"headline": 2, "headline_kinds": ("a", "b"), "headline_candidates": 3}
    evaluation = metrics.model_copy(update={"headline": 1, "headline_kinds": ("b",)})
    searched = metrics.model_copy(update=told)
    result = Finished(finished=True, metrics=searched, evaluation=evaluation, digest="", versions={}, wall_s=1.0)
    ledger.end_run(run.number, State.SUCCEEDED, result=result)
    seen = scrape()
    assert seen["risk_sac_headline_failures_total", "low", "random"] == 2
    assert seen["risk_sac_headline_candidates_total", "low", "random"] == 3


def test_a_run_from_before_contacts_were_judged_has_an_ecr_alone(store, ledger, episode, scrape):
    run = ledger.create(SPEC).runs[0]
    ledger.start_run(run.number)
    ledger.add_episodes([(run.number, episode(0))])
    with store.engine.begin() as connection:
        connection.exec_driver_sql("UPDATE runs SET metrics = '{\"ecr\": 0.5}' WHERE metrics IS NOT NULL")
    rates = {key[0]: value for key, value in scrape().items() if key[0].startswith("risk_sac_run_")}
    assert rates == {"risk_sac_run_ecr": 0.5}


def test_counters_do_not_fall_when_a_campaign_is_deleted(store, ledger, episode, scrape):
    kept, deleted = ledger.create(SPEC), ledger.create(SPEC)
    for campaign in (kept, deleted):
        ledger.start_run(campaign.runs[0].number)
        for index in range(3):
            ledger.add_episodes([(campaign.runs[0].number, episode(index))])
    assert scrape()["risk_sac_episodes_total", "low", "random"] == 6
    ledger.delete(deleted.id)
    assert scrape()["risk_sac_episodes_total", "low", "random"] == 6
    ledger.add_episodes([(kept.runs[0].number, episode(3))])
    assert scrape()["risk_sac_episodes_total", "low", "random"] == 7
    ledger.delete(kept.id)
    assert scrape()["risk_sac_episodes_total", "low", "random"] == 7


def test_lost_workers_and_a_refusing_disk_are_told(store, manager, scrape):
    manager.restarts["killed"] += 2
    store.refusal = "no space left on device"
    seen = scrape()
    assert seen["risk_sac_worker_restarts_total", "killed"] == 2
    assert seen[("risk_sac_storage_available",)] == 0


def test_latencies_are_those_of_one_app(scrape):
    scrape.latencies.labels("/v1/campaigns", "GET", "200").observe(0.02)
    seen = scrape()
    assert seen["risk_sac_request_seconds_count", "/v1/campaigns", "200", "GET"] == 1
    assert request_latencies().collect()[0].samples == []


def test_every_state_has_a_figure(scrape):
    seen = scrape()
    assert all(seen["risk_sac_runs", state] == 0 for state in State)


def test_each_requirement_has_its_funnel(ledger, episode, scrape):
    first, second, *_ = ledger.create(SPEC).runs
    for run in (first, second):
        ledger.start_run(run.number)
        funnels = {
            "never_fast": RequirementCounts(counts="failure", violated=3, valid=2, distinct=1),
            "safe_ttc": RequirementCounts(counts="report", violated=2),
        }
        ledger.add_episodes([(run.number, told(episode(0), funnels))])
    seen = scrape()
    steps = [seen[f"risk_sac_requirement_{step}_total", "never_fast"] for step in STEPS]
    assert steps == [6, 4, 2, 0]
    assert seen["risk_sac_requirement_violated_total", "safe_ttc"] == 4
    ledger.add_episodes(
        [(first.number, told(episode(1), {"never_fast": RequirementCounts(counts="failure", violated=4)}))]
    )
    assert scrape()["risk_sac_requirement_violated_total", "never_fast"] == 7


def test_names_of_users_requirements_do_not_make_endless_labels(ledger, episode, scrape):
    campaign = ledger.create(SPEC)
    ledger.start_run(campaign.runs[0].number)
    names = [f"mine_{i}" for i in range(MOST_OWN + 3)]
    funnels = {name: RequirementCounts(counts="failure", violated=2) for name in names}
    ledger.add_episodes([(campaign.runs[0].number, told(episode(0), funnels))])
    counted = {key: value for key, value in scrape().items() if key[0] == "risk_sac_requirement_violated_total"}
    assert len(counted) == MOST_OWN + 1
    assert counted["risk_sac_requirement_violated_total", OTHERS] == 2 * 3
    ledger.delete(campaign.id)
    assert {key: value for key, value in scrape().items() if key in counted} == counted


def told(event, funnels):
    """A worker's message, as if its run had counted these funnels."""
    return event.model_copy(update={"metrics": event.metrics.model_copy(update={"requirements": funnels})})
