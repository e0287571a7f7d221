"""Remembers in the database that API keys were made, even if their file is lost.

The key file alone cannot distinguish a service without keys from one whose keys are lost. Creating a key sets the flag
in the same step, and a server sets it when it finds a key file that was copied here.
"""

from collections.abc import Iterator
from contextlib import contextmanager

from sqlalchemy import Engine

from service.host.data_folder import hold_data_folder
from service.keys.file import KeyFile
from service.settings import ServiceSettings
from service.store.database import (
    connected,
    held,
    keys_were_made,
    newest_step,
    noting_keys,
    present_step,
    sqlite_file,
    step_forward,
)


class AuthEnabledFlag:
    """Cached flag of a running server.

    Attributes:
      known: whether a key was ever made; this never becomes false again.
    """

    def __init__(self) -> None:
        self.known = self._noted = False

    def settle(self, engine: Engine, file: KeyFile) -> None:
        """Reads the flag from the database or sets it there; call it regularly."""
        if self._noted:
            return
        if keys_were_made(engine):
            self.known = self._noted = True
        elif self.known or file.path.exists():
            self.known = True
            with noting_keys(engine):
                self._noted = True


def ever_made(settings: ServiceSettings) -> bool:
    """Returns whether the database has the flag; false without a database."""
    with _database(settings) as engine:
        return engine is not None and present_step(engine) == newest_step() and keys_were_made(engine)


@contextmanager
def noting(settings: ServiceSettings) -> Iterator[None]:
    """Sets the flag if the body succeeds; makes the database if there is none."""
    with _database(settings, make=True) as engine:
        assert engine is not None
        if present_step(engine) != newest_step():
            with hold_data_folder(settings.data_dir), held(engine):
                step_forward(engine)
        with noting_keys(engine):
            yield


@contextmanager
def _database(settings: ServiceSettings, *, make: bool = False) -> Iterator[Engine | None]:
    file = sqlite_file(settings.url)
    if file is not None and not file.exists():
        if not make:
            yield None
            return
        hold_data_folder(settings.data_dir).close()  # which makes it
    with connected(settings.url, "opening the database") as engine:
        yield engine
