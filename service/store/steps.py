"""The steps of `service.store.migrations`: forwards to the newest one, and back where a step can be taken back.

All of them are taken in one transaction, so that whoever dies in between leaves the old tables.
"""

from collections.abc import Callable

from alembic import command
from alembic.config import Config
from alembic.runtime.migration import MigrationContext
from alembic.script import ScriptDirectory
from alembic.util import CommandError
from sqlalchemy import Engine

from service.errors import StorageError


def present_step(engine: Engine) -> str | None:
    """The step that the database is at; None before the first one."""
    with engine.connect() as connection:
        return MigrationContext.configure(connection).get_current_revision()


def newest_step() -> str:
    """The step that this version of the service works with."""
    newest = ScriptDirectory.from_config(_config()).get_current_head()
    assert newest is not None
    return newest


def step_forward(engine: Engine) -> None:
    """Take all steps that are missing.

    Raises:
      StorageError: a newer version wrote the database.
    """
    _take(engine, lambda config: command.upgrade(config, "head"))


def step_back(engine: Engine) -> None:
    """Take the newest step back.

    Raises:
      StorageError: it cannot be taken back, or was never taken.
    """
    step, newest = present_step(engine), newest_step()
    if step != newest:
        raise StorageError(f"database is at step {step}; wanted {newest}, the newest: nothing else is taken back")
    _take(engine, lambda config: command.downgrade(config, "-1"))


def _take(engine: Engine, steps: Callable[[Config], None]) -> None:
    config = _config()
    with engine.begin() as connection:
        config.attributes["connection"] = connection
        try:
            steps(config)
        except CommandError as error:
            raise StorageError(f"database cannot be brought up to date: {error}; a newer version wrote it") from error


def _config() -> Config:
    config = Config()
    config.set_main_option("script_location", "service.store:migrations")
    return config
