"""The fact that API keys were made, which the database keeps so that it outlives their file.

The file of keys alone cannot tell a service that never had keys from one whose keys are lost. Whoever makes a key notes
it in the database in the same step, and a server notes it when it sees a file that came another way.
"""

import logging
import threading
from collections.abc import Iterator
from contextlib import contextmanager

from sqlalchemy import Engine

from service.errors import StorageError
from service.host.data_folder import hold_data_folder
from service.keys.file import KeyFile
from service.settings import ServiceSettings
from service.store.database import connected, held, newest_step, present_step, sqlite_file, step_forward
from service.store.server import keys_were_made, noting_keys

logger = logging.getLogger(__name__)

LOOK_S = 1.0  # between two looks at the database and the file while no key is known of


class AuthEnabledFlag:
    """What a running server knows of it.

    Attributes:
      known: whether a key was ever made; this never becomes false again.
    """

    def __init__(self) -> None:
        self.known = False

    @contextmanager
    def kept(self, engine: Engine, file: KeyFile) -> Iterator[None]:
        """Keeps this and the database in step."""
        over = threading.Event()
        if self._settle(engine, file):
            yield
            return
        thread = threading.Thread(target=self._watch, args=(engine, file, over), name="keys", daemon=True)
        thread.start()
        try:
            yield
        finally:
            over.set()
            thread.join()

    def _watch(self, engine: Engine, file: KeyFile, over: threading.Event) -> None:
        refusal = ""
        while not over.wait(LOOK_S):
            try:
                if self._settle(engine, file):
                    return
            except StorageError as error:
                if str(error) != refusal:
                    logger.warning("whether there are API keys cannot be noted yet: %s", error)
                refusal = str(error)

    def _settle(self, engine: Engine, file: KeyFile) -> bool:
        """Learn from the database, or tell it; whether there is nothing left to learn."""
        if keys_were_made(engine):
            self.known = True
        elif self.known or file.path.exists():
            self.known = True
            with noting_keys(engine):
                pass
        return self.known


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
