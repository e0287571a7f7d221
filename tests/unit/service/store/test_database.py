import sqlite3
from pathlib import Path

import pytest
from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext

from risk_sac.config import CampaignSpec
from risk_sac.records import Grade, Outcome, State
from service.errors import StorageError
from service.store import database
from service.store.finding import Judged
from service.store.reading import Store
from service.store.tables import Base
from service.store.writing import Ledger
from tests.begun import start

SPEC = CampaignSpec(families=("low",), methods=("risk-sac", "random"), seeds=(3, 4))

BEFORE_JUDGEMENTS = Path(__file__).with_name("before_judgements.sql")

BEFORE_VERSIONS = """
CREATE TABLE campaigns (number INTEGER NOT NULL PRIMARY KEY AUTOINCREMENT, id VARCHAR NOT NULL, spec TEXT NOT NULL,
  state VARCHAR NOT NULL, reason VARCHAR, created_at FLOAT NOT NULL, started_at FLOAT, finished_at FLOAT, UNIQUE (id));
CREATE TABLE runs (number INTEGER NOT NULL PRIMARY KEY AUTOINCREMENT, campaign_number INTEGER NOT NULL,
  id VARCHAR NOT NULL, family VARCHAR NOT NULL, method VARCHAR NOT NULL, seed INTEGER NOT NULL,
  spec_digest VARCHAR NOT NULL, state VARCHAR NOT NULL, reason VARCHAR, started_at FLOAT, finished_at FLOAT,
  episodes_total INTEGER NOT NULL,
  episodes_done INTEGER NOT NULL, rejected INTEGER NOT NULL, raw_collisions INTEGER NOT NULL, failures INTEGER NOT NULL,
  busy_s FLOAT NOT NULL, metrics TEXT, evaluation TEXT, digest VARCHAR, versions TEXT NOT NULL,
  UNIQUE (campaign_number, id),
  FOREIGN KEY(campaign_number) REFERENCES campaigns (number));
CREATE INDEX runs_queue ON runs (state, number);
CREATE TABLE episodes (number INTEGER NOT NULL PRIMARY KEY AUTOINCREMENT, campaign_number INTEGER NOT NULL,
  run_number INTEGER NOT NULL, phase VARCHAR NOT NULL, "index" INTEGER NOT NULL, outcome VARCHAR NOT NULL,
  record TEXT NOT NULL, series VARCHAR, wall_s FLOAT NOT NULL, UNIQUE (run_number, phase, "index"),
  FOREIGN KEY(campaign_number) REFERENCES campaigns (number), FOREIGN KEY(run_number) REFERENCES runs (number));
CREATE INDEX episodes_pages ON episodes (campaign_number, number);
CREATE INDEX episodes_outcomes ON episodes (campaign_number, outcome, number);
"""


def test_a_database_from_before_contacts_were_judged_is_brought_up_to_date(tmp_path):
    """Written by the version before: five episodes of one run, whose two phases have one distinct failure each."""
    old = sqlite3.connect(tmp_path / "test.db")
    old.executescript(BEFORE_JUDGEMENTS.read_text(encoding="utf-8"))
    old.close()
    store = Store(f"sqlite:///{tmp_path}/test.db")
    (campaign,) = store.campaigns(limit=2).items
    found, waiting = campaign.runs
    assert (found.failures, found.distinct_failures, found.preventable, found.distinct_preventable) == (2, 2, 0, 0)
    assert (waiting.distinct_failures, waiting.metrics) == (0, None)
    assert (found.metrics.distinct_failures, found.metrics.preventable, found.metrics.signatures) == (1, 0, {})
    episodes = store.episodes(campaign.id, limit=9).items
    assert [each.collision is not None for each in episodes] == [False, True, True, False, True]
    assert {each.funnel for each in episodes} == {None}
    assert episodes[1].collision.judgement is None
    assert store.episodes(campaign.id, limit=9, judged=Judged(grade=Grade.CAREFUL)).items == ()
    store.close()


def test_the_migrations_lead_to_the_tables(store):
    with store.engine.connect() as connection:
        context = MigrationContext.configure(connection, opts={"compare_type": False})  # SQLite forgets them
        assert compare_metadata(context, Base.metadata) == []


def test_a_file_that_is_no_database_is_a_storage_error(tmp_path):
    (tmp_path / "x.db").write_bytes(b"not a database, but long enough to look at" * 100)
    with pytest.raises(StorageError, match="storage failed while opening the database: file is not a database"):
        Store(f"sqlite:///{tmp_path}/x.db")


@pytest.mark.parametrize("url", ["mysql://x/y", "nonsense", "postgresql+nodriver://x/y"])
def test_a_url_that_names_no_database_we_know_is_refused(url):
    with pytest.raises(StorageError, match="database_url"):
        Store(url)


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


def test_a_database_from_before_there_were_versions_is_brought_up_to_date(tmp_path):
    old = sqlite3.connect(tmp_path / "test.db")
    old.executescript(BEFORE_VERSIONS)
    spec = SPEC.model_copy(update={"label": "old"})
    old.execute("INSERT INTO campaigns VALUES (7, 'c1', ?, 'running', NULL, 1.0, 2.0, NULL)", [spec.model_dump_json()])
    old.execute(
        "INSERT INTO runs VALUES (9, 7, 'low-sac-0', 'low', 'sac', 0, 'd', 'running', NULL, 2.0, NULL, 5, 0, 0, 0, 0,"
        " 0.0, NULL, NULL, NULL, '{}')"
    )
    old.commit()
    old.close()
    store = Store(f"sqlite:///{tmp_path}/test.db")
    assert Ledger(store).resume() == 1
    campaign = store.campaign("c1", "default")
    assert (campaign.spec.label, campaign.state, campaign.runs[0].id) == ("old", State.QUEUED, "low-sac-0")
    assert [item.id for item in store.campaigns(limit=2, label="old").items] == ["c1"]
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
