"""The fact that API keys were made, which the database keeps so that it outlives their file.

The file of keys alone cannot tell a service that never had keys from one whose keys are lost. Whoever makes a key notes
it in the database in the same step, and a server notes it when it sees a file that came another way.
"""

from collections.abc import Iterator
from contextlib import contextmanager

from sqlalchemy import Engine

from service.host.data_folder import hold_data_folder
from service.keys.file import KeyFile
from service.settings import ServiceSettings
from service.store.database import connected, held, newest_step, present_step, sqlite_file, step_forward
from service.store.server import keys_were_made, noting_keys


class AuthEnabledFlag:
    """What a running server knows of it.

    Attributes:
      known: whether a key was ever made; this never becomes false again.
    """

    def __init__(self) -> None:
        self.known = self._noted = False

    def settle(self, engine: Engine, file: KeyFile) -> None:
        """Learns from the database or tells it; to be called every now and then."""
        if self._noted:
            return
        if keys_were_made(engine):
            self.known = self._noted = True
        elif self.known or file.path.exists():
            self.known = True
            with noting_keys(engine):
                self._noted = True


def ever_made(settings: ServiceSettings) -> bool:
    """Returns whether the database says that a key was ever made; a missing one says nothing."""
    with _database(settings) as engine:
        return engine is not None and present_step(engine) == newest_step() and keys_were_made(engine)


@contextmanager
def noting(settings: ServiceSettings) -> Iterator[None]:
    """Notes that a key was made, if making it succeeds; makes the database where there is none."""
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
