import math
import sqlite3
from dataclasses import replace
from pathlib import Path

import pytest
from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext

from risk_sac.config import CampaignSpec
from risk_sac.metrics import Funnel
from risk_sac.types import Grade, Outcome
from service import database
from service.campaigns import State
from service.errors import ConflictError, NotFoundError, StorageError, TransitionError
from service.events import Finished
from service.ledger import Ledger
from service.store import Judged, Store
from service.tables import Base
from tests.judged import judgement

BEFORE_JUDGEMENTS = Path(__file__).with_name("before_judgements.sql")
SPEC = CampaignSpec(families=("low",), methods=("risk-sac", "random"), seeds=(3, 4))


def start(store, ledger):
    number = store.waiting()["default"]
    ledger.start_run(number)
    return number


def test_a_campaign_comes_back_as_it_was_posted(store, ledger):
    campaign = ledger.create(SPEC)
    assert store.campaign(campaign.id) == campaign
    assert campaign.spec == SPEC
    assert [run.id for run in campaign.runs] == ["low-risk-sac-3", "low-random-3", "low-risk-sac-4", "low-random-4"]
    assert [campaign.run_spec(run) for run in campaign.runs] == list(SPEC.runs())
    assert [run.spec_digest for run in campaign.runs] == [spec.digest for spec in SPEC.runs()]


def test_runs_leave_the_queue_in_the_order_they_came(store, ledger):
    first, second = ledger.create(SPEC), ledger.create(SPEC)
    left = [start(store, ledger) for _ in range(8)]
    assert left == [run.number for run in first.runs + second.runs]
    assert store.waiting() == {}


def test_an_episode_reported_twice_is_stored_and_counted_once(store, ledger, episode):
    campaign = ledger.create(SPEC)
    number = start(store, ledger)
    reports = (episode(0), episode(1, Outcome.FAILURE), episode(1, Outcome.FAILURE), episode(0), episode(2))
    assert [ledger.add_episode(number, report) for report in reports] == [True, True, False, False, True]
    run = store.campaign(campaign.id).runs[0]
    assert (run.episodes_done, run.failures, run.raw_collisions, run.rejected) == (3, 1, 1, 0)
    assert [item.record.index for item in store.episodes(campaign.id, limit=10).items] == [0, 1, 2]
    assert run.busy_s == 2.5  # the time was spent twice
    assert store.usage("default").cpu_s == 2.5


def test_an_episode_that_comes_out_otherwise_replaces_the_first(store, ledger, episode):
    campaign = ledger.create(SPEC)
    number = start(store, ledger)
    assert ledger.add_episode(number, episode(0, Outcome.FAILURE))
    assert not ledger.add_episode(number, episode(0))
    (stored,) = store.episodes(campaign.id, limit=10).items
    assert stored.record.outcome is Outcome.SAFE
    assert (store.campaign(campaign.id).runs[0].failures, store.campaign(campaign.id).runs[0].episodes_done) == (0, 1)


def test_search_and_evaluation_episodes_of_one_index_are_two(store, ledger, episode):
    campaign = ledger.create(SPEC)
    number = start(store, ledger)
    ledger.add_episode(number, episode(0))
    ledger.add_episode(number, episode(0, phase="evaluate"))
    (run, *_) = store.campaign(campaign.id).runs
    assert run.episodes_done == 2
    assert run.metrics == run.evaluation == episode(0).metrics


def test_a_record_comes_back_with_its_numbers_that_are_not_finite(store, ledger, episode):
    campaign = ledger.create(SPEC)
    ledger.add_episode(start(store, ledger), episode(5, Outcome.FAILURE))
    found = store.failure(campaign.id, "low-risk-sac-3-train-5")
    assert found.id == "low-risk-sac-3-train-5"
    assert found.record.min_ttc_s == math.inf
    assert math.isnan(found.record.collision.min_ttc_s)


def test_pages_continue_where_they_ended_while_more_arrives(store, ledger, episode):
    campaign = ledger.create(SPEC)
    number = start(store, ledger)
    for index in range(5):
        ledger.add_episode(number, episode(index, Outcome.FAILURE if index % 2 else Outcome.SAFE))
    first = store.episodes(campaign.id, limit=3)
    ledger.add_episode(number, episode(5))
    second = store.episodes(campaign.id, limit=3, after=first.last)
    assert [item.record.index for item in first.items + second.items] == [0, 1, 2, 3, 4, 5]
    assert second.last is None
    failures = store.episodes(campaign.id, limit=10, run_id="low-risk-sac-3", outcomes=[Outcome.FAILURE])
    assert [item.record.index for item in failures.items] == [1, 3]


def test_campaigns_are_listed_newest_first(store, ledger):
    ids = [ledger.create(SPEC).id for _ in range(5)]
    first = store.campaigns(limit=2)
    ledger.create(SPEC)
    second = store.campaigns(limit=10, before=first.last)
    assert [item.id for item in first.items + second.items] == ids[::-1]


@pytest.mark.parametrize(
    "failure_id",
    ["", "-", "x", "low-risk-sac-3-train-0", "low-risk-sac-3-train-9", "low-risk-sac-3-train-٣", "a-train-99999999999"],
)
def test_what_does_not_exist_is_not_found(store, ledger, episode, failure_id):
    campaign = ledger.create(SPEC)
    ledger.add_episode(start(store, ledger), episode(0))
    with pytest.raises(NotFoundError):
        store.failure(campaign.id, failure_id)
    with pytest.raises(NotFoundError, match="no run 'x'; its runs are low-risk-sac-3"):
        store.episodes(campaign.id, limit=1, run_id="x")
    with pytest.raises(NotFoundError):
        store.campaign("x")
    with pytest.raises(NotFoundError):
        ledger.cancel("x")


def test_a_campaign_succeeds_with_its_last_run(store, ledger, metrics):
    campaign = ledger.create(SPEC)
    result = Finished(
        finished=True, metrics=metrics, evaluation=metrics, digest="abc", versions={"sumo": "1"}, wall_s=1
    )
    for _ in campaign.runs:
        assert store.campaign(campaign.id).state in (State.QUEUED, State.RUNNING)
        ledger.end_run(start(store, ledger), State.SUCCEEDED, result=result)
    campaign = store.campaign(campaign.id)
    assert campaign.state is State.SUCCEEDED
    assert campaign.created_at <= campaign.started_at <= campaign.finished_at
    assert campaign.runs[0].evaluation == metrics
    assert (campaign.runs[0].digest, campaign.runs[0].versions) == ("abc", {"sumo": "1"})


def test_one_failed_run_fails_the_campaign_once_the_others_have_ended(store, ledger):
    campaign = ledger.create(SPEC)
    ledger.end_run(start(store, ledger), State.FAILED, "worker was killed by SIGKILL")
    assert store.campaign(campaign.id).state is State.RUNNING
    for _ in range(3):
        ledger.end_run(start(store, ledger), State.SUCCEEDED)
    campaign = store.campaign(campaign.id)
    assert campaign.state is State.FAILED
    assert campaign.reason == "run low-risk-sac-3: worker was killed by SIGKILL"


def test_cancel_stops_what_runs_and_drops_what_waits(store, ledger):
    campaign = ledger.create(SPEC)
    number = start(store, ledger)
    assert ledger.cancel(campaign.id) == [number]
    assert ledger.cancel(campaign.id) == [number]
    states = [run.state for run in store.campaign(campaign.id).runs]
    assert states == [State.CANCELLING] + [State.CANCELLED] * 3
    ledger.end_run(number, State.CANCELLED)
    assert store.campaign(campaign.id).state is State.CANCELLED
    assert ledger.cancel(campaign.id) == []


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


def test_a_pause_is_written_with_its_reason_and_can_be_cancelled(store, ledger):
    campaign = ledger.create(SPEC)
    number = start(store, ledger)
    ledger.pause([number], "no room")
    paused = store.campaign(campaign.id)
    assert (paused.state, paused.reason) == (State.PAUSED, "run low-risk-sac-3: no room")
    assert (paused.runs[0].state, paused.runs[0].reason) == (State.PAUSED, "no room")
    assert ledger.cancel(campaign.id) == []
    assert store.campaign(campaign.id).state is State.CANCELLED


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


def test_every_stored_change_has_another_revision(store, ledger, episode, metrics):
    campaign = ledger.create(SPEC)
    seen = [store.revision(campaign.id)]
    number = start(store, ledger)
    seen.append(store.revision(campaign.id))
    ledger.add_episode(number, episode(0))
    seen.append(store.revision(campaign.id))
    ledger.requeue_run(number, "worker was killed by SIGKILL")
    seen.append(store.revision(campaign.id))
    ledger.cancel(campaign.id)
    seen.append(store.revision(campaign.id))
    assert len(set(seen)) == len(seen)
    assert store.campaign(campaign.id).revision == seen[-1]


def test_changes_of_state_come_in_their_order(store, ledger):
    campaign = ledger.create(SPEC)
    number = start(store, ledger)
    ledger.requeue_run(number, "worker was killed by SIGKILL")
    ledger.cancel(campaign.id)
    changes = store.changes(campaign.id)
    assert [(change.run_id, change.state) for change in changes[:4]] == [
        ("low-risk-sac-3", State.RUNNING),
        (None, State.RUNNING),
        ("low-risk-sac-3", State.QUEUED),
        (None, State.QUEUED),
    ]
    assert changes[2].reason == "worker was killed by SIGKILL"
    assert (changes[-1].run_id, changes[-1].state) == (None, State.CANCELLED)
    assert store.changes(campaign.id, after=changes[3].number) == changes[4:]


def test_another_project_sees_nothing(store, ledger, episode):
    ours, theirs = ledger.create(SPEC, "ours"), ledger.create(SPEC, "theirs")
    assert [item.id for item in store.campaigns(limit=5, project="ours").items] == [ours.id]
    assert store.revision(ours.id, "ours") == ours.revision
    for read in (
        store.campaign,
        store.revision,
        lambda id_, project: store.episodes(id_, limit=1, project=project),
        lambda id_, project: store.failure(id_, "x", project),
        ledger.cancel,
    ):
        with pytest.raises(NotFoundError) as foreign:
            read(theirs.id, "ours")
        with pytest.raises(NotFoundError) as unknown:
            read("c123", "ours")
        assert str(foreign.value).replace(theirs.id, "c123") == str(unknown.value)


def test_lists_are_filtered_by_state_family_method_and_label(store, ledger):
    low = ledger.create(SPEC)
    mixed = ledger.create(CampaignSpec(label="night", families=("low", "mixed"), methods=("sac",)))
    ledger.cancel(low.id)

    def found(**wanted):
        return [item.id for item in store.campaigns(limit=5, **wanted).items]

    assert found() == found(family="low") == [mixed.id, low.id]
    assert found(state=State.CANCELLED) == found(method="random") == [low.id]
    assert found(label="night") == found(family="mixed", method="sac") == [mixed.id]
    assert found(label="") == [low.id]
    assert found(family="mixed", method="random") == found(state=State.FAILED) == []


def test_the_same_idempotency_key_finds_the_campaign_or_conflicts(store, ledger):
    campaign = ledger.create(SPEC, "ours", "k1")
    assert ledger.find("ours", "k1", SPEC).id == campaign.id
    assert ledger.find("ours", "k2", SPEC) is None
    assert ledger.find("theirs", "k1", SPEC) is None
    with pytest.raises(ConflictError, match="belongs to campaign"):
        ledger.find("ours", "k1", SPEC.model_copy(update={"label": "other"}))


def test_a_deleted_campaign_leaves_no_row(store, ledger, episode):
    campaign, kept = ledger.create(SPEC), ledger.create(SPEC)
    for _ in range(5):
        ledger.add_episode(start(store, ledger), episode(0))
    ledger.delete(campaign.id)
    with pytest.raises(NotFoundError):
        store.revision(campaign.id)
    assert store.episodes(kept.id, limit=5).items
    with store.engine.connect() as connection:
        for table in ("campaigns", "runs", "episodes", "changes"):
            column = "number" if table == "campaigns" else "campaign_number"
            numbers = connection.exec_driver_sql(f"SELECT DISTINCT {column} FROM {table}").scalars().all()
            assert numbers == [kept.number]


def test_a_value_that_changed_on_the_disk_is_noticed(store, ledger, episode):
    campaign = ledger.create(SPEC)
    ledger.add_episode(start(store, ledger), episode(0, Outcome.FAILURE))
    with store.engine.begin() as connection:
        connection.exec_driver_sql("UPDATE episodes SET wall_s = 0.5000001")
    with pytest.raises(StorageError, match="row 1 of the table 'episodes' is damaged"):
        store.episodes(campaign.id, limit=1)
    assert store.campaign(campaign.id).runs[0].failures == 1
    with store.engine.begin() as connection:
        connection.exec_driver_sql("UPDATE runs SET failures = 3")
    with pytest.raises(StorageError, match="row low-risk-sac-3 of the table 'runs' is damaged"):
        store.campaign(campaign.id)


def test_a_database_that_lost_an_episode_is_not_opened(store, ledger, episode, database_url):
    ledger.create(SPEC)
    ledger.add_episode(start(store, ledger), episode(0))
    with store.engine.begin() as connection:
        connection.exec_driver_sql("DELETE FROM episodes")
    with pytest.raises(StorageError, match="run 'low-risk-sac-3' lacks episodes"):
        Store(database_url)


def test_contacts_are_found_by_grade_by_what_was_broken_and_by_signature(store, ledger, episode):
    campaign = ledger.create(SPEC)
    numbers = [start(store, ledger) for _ in range(2)]
    kinds = [
        judgement(),
        judgement(Grade.IDEAL, broke=()),
        judgement(Grade.UNAVOIDABLE, broke=("wrong_direction",), signature="crossing, 50 % hidden"),
        judgement(Grade.CAREFUL, broke=("speeding",)),
        None,
    ]
    for number in numbers:
        for index, kind in enumerate(kinds):
            ledger.add_episode(number, judged(episode(index, Outcome.FAILURE), kind))
        ledger.add_episode(number, judged(episode(5, Outcome.DEGENERATE), judgement(None)))
        ledger.add_episode(number, episode(6))

    def found(run_id=None, **wanted):
        outcomes = (Outcome.FAILURE, Outcome.DEGENERATE)
        page = store.episodes(campaign.id, limit=50, run_id=run_id, outcomes=outcomes, judged=Judged(**wanted))
        return [item.record.index for item in page.items]

    assert found() == [0, 1, 2, 3, 4, 5] * 2
    assert found(grade=Grade.CAREFUL) == [0, 3] * 2
    assert found(grade=Grade.CAREFUL, run_id="low-random-3") == [0, 3]
    assert found(grade=Grade.UNAVOIDABLE) == [2, 2]
    assert found(broke="speeding") == [0, 3, 5] * 2
    assert found(broke="red_light", grade=Grade.CAREFUL) == [0, 0]
    assert found(broke="red-light") == found(broke="redXlight") == found(broke="red") == []
    assert found(signature="crossing, 50 % hidden") == [2, 2]
    assert found(signature="crossing") == []
    first = store.episodes(campaign.id, limit=1, judged=Judged(grade=Grade.CAREFUL))
    rest = store.episodes(campaign.id, limit=9, after=first.last, judged=Judged(grade=Grade.CAREFUL))
    assert [item.record.index for item in (*first.items, *rest.items)] == [0, 3] * 2


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


def test_a_run_has_the_sums_of_what_its_phases_counted(store, ledger, episode, metrics):
    campaign = ledger.create(SPEC)
    number = start(store, ledger)
    ledger.add_episode(number, episode(0, Outcome.FAILURE))
    assert tallies(store, campaign) == (1, 1, 1)
    counted = replace(metrics, distinct_failures=4, preventable=3, distinct_preventable=2)
    evaluated = episode(0, Outcome.FAILURE, phase="evaluate").model_copy(update={"metrics": counted})
    ledger.add_episode(number, evaluated)
    assert tallies(store, campaign) == (5, 4, 3)
    done = Finished(finished=True, metrics=counted, evaluation=counted, digest="d", versions={}, wall_s=1.0)
    ledger.end_run(number, State.SUCCEEDED, result=done)
    assert tallies(store, campaign) == (8, 6, 4)


def tallies(store, campaign):
    run = store.campaign(campaign.id).runs[0]
    return run.distinct_failures, run.preventable, run.distinct_preventable


def judged(event, kind):
    collision = replace(event.record.collision, judgement=kind)
    return event.model_copy(update={"record": replace(event.record, collision=collision)})


def test_an_episode_comes_with_the_funnel_at_its_time(store, ledger, episode):
    campaign = ledger.create(SPEC)
    ledger.add_episode(start(store, ledger), episode(0))
    (stored,) = store.episodes(campaign.id, limit=10).items
    assert stored.funnel == Funnel(contacts=2, valid=1, distinct=1, preventable=1)


def test_a_database_from_before_contacts_were_judged_is_brought_up_to_date(tmp_path):
    """Written by the version before: five episodes of one run, whose two phases have one distinct failure each."""
    old = sqlite3.connect(tmp_path / "test.db")
    old.executescript(BEFORE_JUDGEMENTS.read_text(encoding="utf-8"))
    old.close()
    store = Store(f"sqlite:///{tmp_path}/test.db")  # which verifies all campaigns and runs
    (campaign,) = store.campaigns(limit=2).items
    found, waiting = campaign.runs
    assert (found.failures, found.distinct_failures, found.preventable, found.distinct_preventable) == (2, 2, 0, 0)
    assert (waiting.distinct_failures, waiting.metrics) == (0, None)
    assert (found.metrics.distinct_failures, found.metrics.preventable, found.metrics.signatures) == (1, 0, {})
    episodes = store.episodes(campaign.id, limit=9).items
    assert [each.record.collision is not None for each in episodes] == [False, True, True, False, True]
    assert {each.funnel for each in episodes} == {None}
    assert episodes[1].record.collision.judgement is None
    assert store.episodes(campaign.id, limit=9, judged=Judged(grade=Grade.CAREFUL)).items == ()
    with store.engine.begin() as connection:
        assert connection.exec_driver_sql("SELECT count(*) FROM episodes WHERE checksum IS NULL").scalar() == 0
        assert connection.exec_driver_sql("SELECT count(*) FROM runs WHERE checksum IS NULL").scalar() == 0
        connection.exec_driver_sql("UPDATE episodes SET grade = 'careful' WHERE number = 2")
    with pytest.raises(StorageError, match="row 2 of the table 'episodes' is damaged"):
        store.episodes(campaign.id, limit=9)
    store.close()


def test_a_run_that_was_damaged_before_is_not_sealed_anew(tmp_path):
    old = sqlite3.connect(tmp_path / "test.db")
    old.executescript(BEFORE_JUDGEMENTS.read_text(encoding="utf-8"))
    old.execute("UPDATE runs SET failures = 3")
    old.commit()
    old.close()
    with pytest.raises(StorageError, match="of the table 'runs' is damaged"):
        Store(f"sqlite:///{tmp_path}/test.db")


@pytest.mark.parametrize("change", ["grade = NULL", "broke = NULL", "signature = 'x'", "funnel = NULL"])
def test_a_judgement_that_changed_on_the_disk_is_noticed(store, ledger, episode, change):
    campaign = ledger.create(SPEC)
    ledger.add_episode(start(store, ledger), episode(0, Outcome.FAILURE))
    with store.engine.begin() as connection:
        connection.exec_driver_sql(f"UPDATE episodes SET {change}")
    with pytest.raises(StorageError, match="row 1 of the table 'episodes' is damaged"):
        store.episodes(campaign.id, limit=1)


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


def test_an_id_with_a_nul_is_unknown_on_every_database(store, ledger):
    campaign = ledger.create(SPEC)
    for wrong in ("\0", f"{campaign.id}\0"):
        with pytest.raises(NotFoundError):
            store.campaign(wrong)
        with pytest.raises(NotFoundError):
            store.episodes(campaign.id, limit=1, run_id=wrong)
        with pytest.raises(NotFoundError):
            store.failure(campaign.id, f"{wrong}-train-0")
