"""Going back to the version before, as service/recovery.md describes it."""

import sqlite3

import pytest

from risk_sac.config import CampaignSpec
from risk_sac.records import Outcome
from service.errors import StorageError
from service.settings import ServiceSettings
from service.store import database
from service.store.__main__ import main
from service.store.reading import Store
from service.store.writing import Ledger
from tests.begun import start

SPEC = CampaignSpec(families=("low",), methods=("risk-sac", "random"), seeds=(3, 4))


def test_a_file_that_is_no_database_is_a_storage_error(tmp_path):
    (tmp_path / "x.db").write_bytes(b"not a database, but long enough to look at" * 100)
    with pytest.raises(StorageError, match="storage failed while opening the database: file is not a database"):
        Store(f"sqlite:///{tmp_path}/x.db")


def test_what_is_written_is_on_the_disk_before_the_answer(tmp_path):
    store = Store(f"sqlite:///{tmp_path}/test.db")
    Ledger(store).create(SPEC)
    with store.engine.connect() as connection:
        assert connection.exec_driver_sql("PRAGMA journal_mode").scalar() == "wal"
        assert connection.exec_driver_sql("PRAGMA synchronous").scalar() == 2  # FULL
    other = sqlite3.connect(tmp_path / "test.db")
    assert other.execute("SELECT count(*) FROM runs").fetchone() == (4,)
    other.close()
    store.close()


def test_a_database_is_brought_up_to_date_in_one_step_or_not_at_all(tmp_path):
    full = "PRAGMA max_page_count = 20"  # room for some of the tables only
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(database, "PRAGMAS", (*database.PRAGMAS, full.removeprefix("PRAGMA ")))
        with pytest.raises(StorageError, match="full"):
            Store(f"sqlite:///{tmp_path}/test.db")
    with sqlite3.connect(tmp_path / "test.db") as found:
        assert found.execute("SELECT name FROM sqlite_master").fetchall() == []
    found.close()
    Store(f"sqlite:///{tmp_path}/test.db").close()


def test_runs_of_the_version_before_are_kept(tmp_path):
    store = Store(f"sqlite:///{tmp_path}/test.db")
    campaign = Ledger(store).create(SPEC)
    store.close()
    with sqlite3.connect(tmp_path / "test.db") as older:
        older.execute("ALTER TABLE runs DROP COLUMN processes")
        older.execute("DROP TABLE notices")
        older.execute("ALTER TABLE campaigns DROP COLUMN tags")
        older.execute("UPDATE alembic_version SET version_num = '0002'")
    older.close()
    store = Store(f"sqlite:///{tmp_path}/test.db")
    Ledger(store).start_run(campaign.runs[0].number, 3)
    assert [run.processes for run in store.campaign(campaign.id).runs] == [3, None, None, None]
    store.close()


def test_a_database_of_a_newer_version_is_refused(tmp_path):
    Store(f"sqlite:///{tmp_path}/test.db").close()
    with sqlite3.connect(tmp_path / "test.db") as newer:
        newer.execute("UPDATE alembic_version SET version_num = '9999'")
    newer.close()
    with pytest.raises(StorageError, match="a newer version wrote it"):
        Store(f"sqlite:///{tmp_path}/test.db")


def test_a_database_with_a_damaged_page_is_not_opened(tmp_path):
    path = tmp_path / "test.db"
    Store(f"sqlite:///{path}").close()
    content = bytearray(path.read_bytes())
    content[4096:4200] = bytes(104)  # the head of its second page
    path.write_bytes(content)
    with pytest.raises(StorageError, match=r"damaged|malformed"):
        Store(f"sqlite:///{path}")


def test_a_record_that_cannot_be_read_is_a_storage_error(store, ledger, episode):
    campaign = ledger.create(SPEC)
    ledger.add_episodes([(start(store, ledger), episode(0, Outcome.FAILURE))])
    with store.engine.begin() as connection:
        connection.exec_driver_sql("UPDATE episodes SET record = substr(record, 2)")
    with pytest.raises(StorageError, match="a row is damaged"):
        store.episodes(campaign.id, limit=1)
    with pytest.raises(StorageError, match="a row is damaged"):
        list(store.records(campaign.number))


def test_failures_of_an_older_database_get_their_weight(tmp_path, episode):
    url = f"sqlite:///{tmp_path}/test.db"
    store = Store(url)
    ledger = Ledger(store)
    ledger.create(SPEC)
    ledger.add_episodes([(start(store, ledger), episode(0, Outcome.FAILURE))])
    asked = "SELECT weight FROM episodes"
    with store.engine.begin() as connection:
        before = connection.exec_driver_sql(asked).scalar()
        connection.exec_driver_sql("ALTER TABLE episodes DROP COLUMN weight")
        connection.exec_driver_sql("ALTER TABLE runs DROP COLUMN processes")
        connection.exec_driver_sql("DROP TABLE notices")
        connection.exec_driver_sql("ALTER TABLE campaigns DROP COLUMN tags")
        connection.exec_driver_sql("UPDATE alembic_version SET version_num = '0001'")
    store.close()
    opened = Store(url)
    with opened.engine.connect() as connection:
        assert connection.exec_driver_sql(asked).scalar() == before > 0.0
    opened.close()


@pytest.fixture
def settings(tmp_path, database_url, monkeypatch):
    monkeypatch.setenv("RISK_SAC_DATA_DIR", str(tmp_path / "data"))
    monkeypatch.setenv("RISK_SAC_DATABASE_URL", database_url)
    return ServiceSettings()


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
