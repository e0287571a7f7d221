import pytest
from prometheus_client import generate_latest
from prometheus_client.parser import text_string_to_metric_families

from risk_sac.config import CampaignSpec
from risk_sac.execution.local import LocalExecutor
from risk_sac.records import RequirementCounts
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
