"""Server state in the database: the cursor secret, and whether API keys were made."""

import time
from collections.abc import Iterator
from contextlib import contextmanager

from sqlalchemy import Engine
from sqlalchemy.orm import Session

from service.store.database import WRITING, storage_errors
from service.store.tables import ServerRow

ONLY = 1  # number of the one row, which the migration wrote


def cursor_secret(engine: Engine) -> bytes:
    """Returns the key that encrypts cursors."""
    with storage_errors("reading"), Session(engine) as session:
        return bytes.fromhex(session.get_one(ServerRow, ONLY).cursor_secret)


def keys_were_made(engine: Engine) -> bool:
    """Whether an API key was ever made; this never becomes false again."""
    with storage_errors("reading"), Session(engine) as session:
        return session.get_one(ServerRow, ONLY).keys_made_at is not None


@contextmanager
def noting_keys(engine: Engine) -> Iterator[None]:
    """Notes that keys were made, if what is done meanwhile succeeds."""
    doing = "noting that there are API keys"
    with (
        storage_errors(doing),
        Session(engine.execution_options(**WRITING)) as session,
        session.begin(),
    ):
        row = session.get_one(ServerRow, ONLY, with_for_update=True)
        if row.keys_made_at is None:
            row.keys_made_at = time.time()
            session.flush()  # so that a database that refuses does so first
        yield
