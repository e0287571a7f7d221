"""Going back to the version before, as service/recovery.md describes it."""

import json
import sqlite3
from collections.abc import Callable

import pytest
from sqlalchemy import create_engine, inspect

from risk_sac.config import CampaignSpec
from risk_sac.execution.messages import EpisodeDone
from risk_sac.records import DrivenBy, Outcome, TriageState
from service.host.data_folder import hold_data_folder
from service.settings import ServiceSettings
from service.store.__main__ import main
from service.store.database import held, newest_step, present_step
from service.store.finding import Judged
from service.store.reading import Store
from service.store.stored import StoredCampaign
from service.store.writing import Ledger

BEFORE = "0011"
SPEC = CampaignSpec(families=("low",), methods=("random",))
FAILURE = "low-random-0-search-0"


@pytest.fixture
def settings(tmp_path, database_url, monkeypatch):
    monkeypatch.setenv("RISK_SAC_DATA_DIR", str(tmp_path / "data"))
    monkeypatch.setenv("RISK_SAC_DATABASE_URL", database_url)
    return ServiceSettings()


def fail(store: Store, campaign: StoredCampaign, episode: Callable[..., EpisodeDone]) -> None:
    """A run at work, and its first failure."""
    number = campaign.runs[0].number
    Ledger(store).start_run(number)
    event = episode(0, Outcome.FAILURE)
    record = event.record.model_copy(update={"driven_by": DrivenBy.SCRIPT})
    Ledger(store).add_episodes([(number, event.model_copy(update={"record": record}))])


def tables(url: str) -> dict[str, object]:
    """All tables with their columns and indexes, and the step."""
    engine = create_engine(url)
    found = inspect(engine)
    tables = {
        name: (
            sorted((column["name"], str(column["type"]), column["nullable"]) for column in found.get_columns(name)),
            sorted((index["name"] or "", index["column_names"], index["unique"]) for index in found.get_indexes(name)),
        )
        for name in found.get_table_names()
    }
    step = present_step(engine)
    engine.dispose()
    return {"step": step, **tables}


def test_one_step_back_leaves_all_rows_to_the_version_before(settings, episode, metrics, capsys):
    store = Store(settings.url)
    campaign = Ledger(store).create(SPEC)
    fail(store, campaign, episode)
    Ledger(store).triage(campaign.id, FAILURE, TriageState.CONFIRMED, "seen")
    told = repr(store.events(campaign.id, limit=9))  # in which a NaN is what it is
    store.close()
    newest = tables(settings.url)
    assert newest["step"] == newest_step()
    assert main(["back"]) == 0
    assert f"is at step {BEFORE}" in capsys.readouterr().out
    before = tables(settings.url)
    assert newest.keys() == before.keys()
    assert newest | {"step": BEFORE} == before, "the newest step changes rows alone"
    engine = create_engine(settings.url)
    with engine.connect() as connection:
        phase, record = connection.exec_driver_sql("SELECT phase, record FROM episodes").one()
    engine.dispose()
    assert (phase, json.loads(record)["phase"]) == ("train", "train")
    assert main(["back"]) == 1, "no further"
    assert f"database is at step {BEFORE}; wanted {newest_step()}" in capsys.readouterr().err
    store = Store(settings.url)  # which steps forward again
    assert tables(settings.url) == newest
    assert repr(store.events(campaign.id, limit=9)) == told
    assert store.triage(campaign.id, FAILURE).comment == "seen"
    (found,) = store.episodes(campaign.id, limit=9, judged=Judged(driven_by=DrivenBy.SCRIPT)).items
    assert found.id == FAILURE
    store.close()


def test_no_step_is_taken_beneath_a_server(settings, capsys):
    store = Store(settings.url)
    with hold_data_folder(settings.data_dir):
        assert main(["back"]) == 1
    assert "is in use by another process" in capsys.readouterr().err
    if store.engine.dialect.name == "postgresql":
        with held(store.engine):
            assert main(["back"]) == 1
        assert "is in use by another server" in capsys.readouterr().err
    assert present_step(store.engine) == newest_step()
    store.close()


def test_a_copy_is_whole_though_the_server_writes(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("RISK_SAC_DATA_DIR", str(tmp_path))
    copy = tmp_path / "copy.db"
    assert main(["copy", str(copy)]) == 1
    assert "is missing" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
    store = Store(ServiceSettings().url)
    spec = CampaignSpec(families=("low",), methods=("random",))
    campaign = Ledger(store).create(spec)
    assert main(["copy", str(copy)]) == 0
    assert copy.stat().st_mode & 0o077 == 0
    Ledger(store).create(spec)
    store.close()
    assert main(["copy", str(copy)]) == 1
    assert "exists" in capsys.readouterr().err
    with sqlite3.connect(copy) as database:
        assert database.execute("SELECT id FROM campaigns").fetchall() == [(campaign.id,)]
    database.close()
    copied = Store(f"sqlite:///{copy}")
    assert [each.id for each in copied.campaigns(limit=9).items] == [campaign.id]
    copied.close()
