import pytest

from risk_sac.config import CampaignSpec
from risk_sac.records import Outcome
from service.errors import StorageError
from tests.begun import start

SPEC = CampaignSpec(families=("low",), methods=("risk-sac", "random"), seeds=(3, 4))


def test_a_value_that_changed_on_the_disk_is_noticed(store, ledger, episode):
    campaign = ledger.create(SPEC)
    ledger.add_episodes([(start(store, ledger), episode(0, Outcome.FAILURE))])
    with store.engine.begin() as connection:
        connection.exec_driver_sql("UPDATE episodes SET wall_s = 0.5000001")
    with pytest.raises(StorageError, match="row 1 of the table 'episodes' is damaged"):
        store.episodes(campaign.id, limit=1)
    assert store.campaign(campaign.id).runs[0].failures == 1
    with store.engine.begin() as connection:
        connection.exec_driver_sql("UPDATE runs SET failures = 3")
    with pytest.raises(StorageError, match="row low-risk-sac-3 of the table 'runs' is damaged"):
        store.campaign(campaign.id)


def test_a_filter_by_grade_or_signature_uses_its_index(store):
    if store.engine.dialect.name != "sqlite":
        pytest.skip("PostgreSQL plans by the size of its tables")
    with store.engine.connect() as connection:
        for column in ("grade", "signature"):
            query = (
                f"SELECT * FROM episodes WHERE campaign_number = 1 AND {column} = 'x' AND number > 3 ORDER BY number"
            )
            (plan,) = connection.exec_driver_sql(f"EXPLAIN QUERY PLAN {query}").all()
            assert f"USING INDEX episodes_{column}s (campaign_number=? AND {column}=? AND number>?)" in plan[-1]


@pytest.mark.parametrize("change", ["grade = NULL", "broke = NULL", "signature = 'x'", "funnel = NULL"])
def test_a_judgement_that_changed_on_the_disk_is_noticed(store, ledger, episode, change):
    campaign = ledger.create(SPEC)
    ledger.add_episodes([(start(store, ledger), episode(0, Outcome.FAILURE))])
    with store.engine.begin() as connection:
        connection.exec_driver_sql(f"UPDATE episodes SET {change}")
    with pytest.raises(StorageError, match="row 1 of the table 'episodes' is damaged"):
        store.episodes(campaign.id, limit=1)
