"""Opening the database: SQLite in the data folder, or PostgreSQL by URL; sound, up to date, and ours alone."""

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from sqlite3 import Connection as SqliteConnection

from alembic import command
from alembic.config import Config
from alembic.util import CommandError
from sqlalchemy import Engine, create_engine, event, make_url, text
from sqlalchemy.exc import ArgumentError, DatabaseError, IntegrityError, NoSuchModuleError, ProgrammingError

from service.errors import StorageError
from service.journal import Journal

logger = logging.getLogger(__name__)

READERS = 8  # requests answered in threads at once; of more, each would only wait longer for the interpreter
ADVISORY_LOCK = 0x5249534B  # any number that all servers of this project agree on

PRAGMAS = ("journal_mode=WAL", "synchronous=FULL", "foreign_keys=ON", "busy_timeout=5000")


def open_database(url: str) -> Engine:
    """Connect, check for damage, and bring the tables up to date.

    Raises:
      StorageError: it cannot be opened, is damaged, belongs to a newer version, or is another server's.
    """
    engine = _engine(url)
    journal = Journal(Path(engine.url.database or "")) if engine.dialect.name == "sqlite" else None
    try:
        with storage_errors("opening the database"):
            if journal is not None and (dropped := journal.dropped(engine)):
                logger.warning("the last %d frames of the journal hold no whole commit; runs tell again", dropped)
            _check(engine)
            _upgrade(engine)
    except BaseException:
        engine.dispose()
        raise
    return engine


@contextmanager
def held(engine: Engine) -> Iterator[None]:
    """Be the only server that writes this database; SQLite's is guarded by the lock of the data folder.

    Raises:
      StorageError: another server holds it.
    """
    if engine.dialect.name != "postgresql":
        yield
        return
    with storage_errors("locking the database"):
        connection = engine.connect().execution_options(isolation_level="AUTOCOMMIT")
    with connection:  # the lock lives as long as its connection
        with storage_errors("locking the database"):
            taken = connection.scalar(text("SELECT pg_try_advisory_lock(:number)"), {"number": ADVISORY_LOCK})
        if not taken:
            raise StorageError(f"database {engine.url!r} is in use by another server; stop it or use another")
        yield


@contextmanager
def storage_errors(doing: str) -> Iterator[None]:
    """Turn what the database driver raises into a StorageError with its reason.

    Broken constraints and statements are bugs, not storage, and pass through.
    """
    try:
        yield
    except (IntegrityError, ProgrammingError):
        raise
    except DatabaseError as error:
        raise StorageError(f"storage failed while {doing}: {str(error.orig).strip()}") from error


def _engine(url: str) -> Engine:
    try:
        if make_url(url).get_backend_name() == "sqlite":
            engine = create_engine(url, pool_size=READERS)
            event.listen(engine, "connect", _set_up)
            event.listen(engine, "begin", lambda connection: connection.exec_driver_sql("BEGIN"))
            return engine
        if make_url(url).get_backend_name() == "postgresql":
            return create_engine(url, pool_size=READERS, pool_pre_ping=True)
    except (ArgumentError, NoSuchModuleError, ModuleNotFoundError) as error:
        raise StorageError(f"database_url cannot be used: {error}") from error
    raise StorageError("database_url names another kind of database; wanted postgresql+psycopg://… or sqlite:///…")


def _set_up(connection: SqliteConnection, _: object) -> None:
    connection.isolation_level = None  # else the driver would commit before each change of a table
    for pragma in PRAGMAS:
        connection.execute(f"PRAGMA {pragma}").close()


def _check(engine: Engine) -> None:
    """Look at every page of a SQLite file; PostgreSQL looks after its own."""
    if engine.dialect.name != "sqlite":
        return
    with engine.connect() as connection:
        found = connection.scalars(text("PRAGMA integrity_check(1)")).all()
        orphan = connection.execute(text("PRAGMA foreign_key_check")).first()
    if list(found) != ["ok"]:
        raise StorageError(f"database {engine.url.database!r} is damaged ({found[0]}); restore a copy or move it away")
    if orphan is not None:
        raise StorageError(f"database {engine.url.database!r} is damaged ({orphan[0]!r} lacks its {orphan[2]!r} row)")


def _upgrade(engine: Engine) -> None:
    """All missing steps in one transaction, so that a server that dies in between leaves the old tables."""
    config = Config()
    config.set_main_option("script_location", "service:migrations")
    with engine.begin() as connection:
        config.attributes["connection"] = connection
        try:
            command.upgrade(config, "head")
        except CommandError as error:
            raise StorageError(f"database cannot be brought up to date: {error}; a newer version wrote it") from error
