import sqlite3
from pathlib import Path

import pytest
from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext

from risk_sac.config import CampaignSpec
from risk_sac.records import Outcome
from service.errors import StorageError
from service.store import database
from service.store.reading import Store
from service.store.tables import Base
from service.store.writing import Ledger
from tests.begun import start

SPEC = CampaignSpec(families=("low",), methods=("risk-sac", "random"), seeds=(3, 4))

STEP_0007 = Path(__file__).with_name("step_0007.sql")


def opened_from_step_0007(file):
    """The store of a database that the version before wrote: two runs, the first of which ended with two contacts."""
    old = sqlite3.connect(file)
    old.executescript(STEP_0007.read_text(encoding="utf-8"))
    old.close()
    return Store(f"sqlite:///{file}")


def test_the_migrations_lead_to_the_tables_of_a_new_database(tmp_path, store):
    upgraded = opened_from_step_0007(tmp_path / "old.db")
    for engine in (upgraded.engine, store.engine):
        with engine.connect() as connection:
            context = MigrationContext.configure(connection, opts={"compare_type": False})  # SQLite forgets them
            assert compare_metadata(context, Base.metadata) == []
    upgraded.close()


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
        list(store.plain_episodes(campaign.number))
