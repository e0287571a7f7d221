"""Going back to the version before, as service/recovery.md describes it."""

import sqlite3

import pytest

from risk_sac.config import CampaignSpec
from service.host.data_folder import hold_data_folder
from service.settings import ServiceSettings
from service.store.__main__ import main
from service.store.database import held, newest_step, present_step
from service.store.reading import Store
from service.store.writing import Ledger


@pytest.fixture
def settings(tmp_path, database_url, monkeypatch):
    monkeypatch.setenv("RISK_SAC_DATA_DIR", str(tmp_path / "data"))
    monkeypatch.setenv("RISK_SAC_DATABASE_URL", database_url)
    return ServiceSettings()


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
