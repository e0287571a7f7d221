"""Connections to the database, its tables and the secret of its cursors."""

import secrets
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from sqlite3 import Connection as SqliteConnection

from alembic import command
from alembic.config import Config
from alembic.runtime.migration import MigrationContext
from alembic.util import CommandError
from sqlalchemy import Connection, Engine, create_engine, event, insert, inspect, make_url, text
from sqlalchemy.exc import ArgumentError, DatabaseError, IntegrityError, NoSuchModuleError, ProgrammingError
from sqlalchemy.orm import Session

from risk_sac.execution.messages import without_folders
from service.errors import StorageError
from service.host import create_private, make_private
from service.store.tables import Base, ServerRow

READERS = 8  # requests answered in threads at once; of more, each would only wait longer for the interpreter
ADVISORY_LOCK = 0x5249534B  # any number that all servers of this project agree on

# Options of a connection that will write. On SQLite a transaction that first reads is refused once it writes, without a
# wait, if another one has written meanwhile.
WRITING = {"begin": "BEGIN IMMEDIATE"}
SIDE_FILES = ("-wal", "-shm")  # which SQLite makes with the mode of the database
# Of the pages that it has read each connection keeps 0.5 MB and not 2: the kernel keeps them too, for all of them once.
PRAGMAS = ("journal_mode=WAL", "synchronous=FULL", "foreign_keys=ON", "busy_timeout=5000", "cache_size=-500")


def open_database(url: str) -> Engine:
    """Connects, checks for damage and brings the tables up to date."""
    engine = connect(url)
    try:
        with storage_errors("opening the database"):
            _check(engine)
            _step_forward(engine)
    except BaseException:
        engine.dispose()
        raise
    return engine


def connect(url: str) -> Engine:
    """Connects without checks or migrations; makes a missing SQLite file."""
    try:
        kind = make_url(url).get_backend_name()
        if kind == "sqlite":
            _keep_to_ourselves(sqlite_file(url))
            engine = create_engine(url, pool_size=READERS)
            event.listen(engine, "connect", _set_up)
            event.listen(engine, "begin", _begin)
            return engine
        if kind == "postgresql":
            return create_engine(url, pool_size=READERS, pool_pre_ping=True)
    except (ArgumentError, NoSuchModuleError, ModuleNotFoundError) as error:
        raise StorageError(f"database_url cannot be used: {error}") from error
    raise StorageError("database_url names another kind of database; wanted postgresql+psycopg://… or sqlite:///…")


@contextmanager
def connected(url: str, doing: str) -> Iterator[Engine]:
    """Connects for the body; driver errors become a StorageError that names `doing`."""
    engine = connect(url)
    try:
        with storage_errors(doing):
            yield engine
    finally:
        engine.dispose()


def sqlite_file(url: str) -> Path | None:
    """The file of a SQLite database; None for any other."""
    named = make_url(url)
    return Path(named.database) if named.get_backend_name() == "sqlite" and named.database else None


@contextmanager
def held(engine: Engine) -> Iterator[None]:
    """Locks a PostgreSQL database; for SQLite the data folder's lock suffices."""
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
    """Turns driver errors into StorageError; broken constraints and statements pass as bugs."""
    try:
        yield
    except (IntegrityError, ProgrammingError):
        raise
    except DatabaseError as error:
        raise StorageError(f"storage failed while {doing}: {without_folders(str(error.orig).strip())}") from error


def _keep_to_ourselves(file: Path | None) -> None:
    if file is None:
        return
    create_private(file)
    for path in (file, *(file.with_name(f"{file.name}{end}") for end in SIDE_FILES)):
        make_private(path)


def _set_up(connection: SqliteConnection, _: object) -> None:
    connection.isolation_level = None  # else the driver would commit before each change of a table
    for pragma in PRAGMAS:
        connection.execute(f"PRAGMA {pragma}").close()


def _begin(connection: Connection) -> None:
    connection.exec_driver_sql(connection.get_execution_options().get("begin", "BEGIN"))


def _check(engine: Engine) -> None:
    """Checks every page of a SQLite file; PostgreSQL checks its own."""
    if engine.dialect.name != "sqlite":
        return
    with engine.connect() as connection:
        found = connection.scalars(text("PRAGMA integrity_check(1)")).all()
        orphan = connection.execute(text("PRAGMA foreign_key_check")).first()
    if list(found) != ["ok"]:
        raise StorageError(f"database {engine.url.database!r} is damaged ({found[0]}); restore a copy or move it away")
    if orphan is not None:
        raise StorageError(f"database {engine.url.database!r} is damaged ({orphan[0]!r} lacks its {orphan[2]!r} row)")


def _present_step(engine: Engine) -> str | None:
    """Returns the migration step of the database; None for a new one."""
    with engine.connect() as connection:
        return MigrationContext.configure(connection).get_current_revision()


def _step_forward(engine: Engine) -> None:
    """Creates the tables, or applies all missing steps in one transaction."""
    if _present_step(engine) is None and not inspect(engine).has_table(ServerRow.__tablename__):
        _take(engine, _create)
    else:
        _take(engine, lambda config: command.upgrade(config, "head"))


def _create(config: Config) -> None:
    connection = config.attributes["connection"]
    Base.metadata.create_all(connection)
    connection.execute(insert(ServerRow).values(number=1, cursor_secret=secrets.token_bytes(32).hex()))
    command.stamp(config, "head")


def _take(engine: Engine, steps: Callable[[Config], None]) -> None:
    config = _config()
    with engine.begin() as connection:
        config.attributes["connection"] = connection
        try:
            steps(config)
        except CommandError as error:
            message = f"database cannot be brought up to date: {error}; a newer version wrote it, or a much older one"
            raise StorageError(message) from error


def _config() -> Config:
    config = Config()
    config.set_main_option("script_location", "service.store:migrations")
    return config


ONLY = 1  # number of the one row, which the migration wrote


def cursor_secret(engine: Engine) -> bytes:
    """Returns the key that encrypts cursors."""
    with storage_errors("reading"), Session(engine) as session:
        return bytes.fromhex(session.get_one(ServerRow, ONLY).cursor_secret)
