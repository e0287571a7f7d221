"""PostgreSQL server on a free loopback port in a temporary folder."""

import os
import pwd
import shutil
import signal
import subprocess
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import count
from pathlib import Path
from typing import Any

import psycopg

from tests.ports import free_port

DEBIAN = Path("/usr/lib/postgresql")  # its package leaves initdb off the PATH
QUIET: dict[str, Any] = {"stdout": subprocess.DEVNULL, "stderr": subprocess.STDOUT, "cwd": "/"}


class PostgreSql:
    """A server on a cluster of its own."""

    def __init__(self, command: Sequence[str | Path], port: int, user: str | None) -> None:
        self.port = port
        self._command, self._user = command, user
        self._numbers = count()
        self.start()

    def start(self) -> None:
        """Start it, and wait until it answers."""
        self._process = subprocess.Popen(self._command, user=self._user, **QUIET)
        for _ in range(300):
            assert self._process.poll() is None, "postgres did not start"
            try:
                self._connect().close()
            except psycopg.OperationalError:
                time.sleep(0.1)
            else:
                return
        raise TimeoutError("postgres did not answer")

    def stop(self) -> None:
        """Stops it at once, open connections included."""
        self._process.send_signal(signal.SIGINT)
        self._process.wait(30)

    def new_database(self) -> str:
        """URL of an empty database."""
        name = f"test{next(self._numbers)}"
        with self._connect() as admin:
            admin.execute(f"CREATE DATABASE {name}")
        return f"postgresql+psycopg://tests@127.0.0.1:{self.port}/{name}"

    def _connect(self) -> psycopg.Connection:
        return psycopg.connect(host="127.0.0.1", port=self.port, user="tests", dbname="postgres", autocommit=True)


def binaries() -> Path | None:
    """Folder of initdb and postgres, if they are installed."""
    candidates = sorted(DEBIAN.glob("*/bin"), key=lambda path: float(path.parent.name), reverse=True)
    on_path = shutil.which("initdb")
    candidates += [Path(on_path).resolve().parent] if on_path else []
    return next((path for path in candidates if (path / "initdb").exists() and (path / "postgres").exists()), None)


@contextmanager
def running(bin_: Path) -> Iterator[PostgreSql]:
    """Starts a server; as root under another user, as PostgreSQL requires.

    Its folder is none of pytest's, which are closed to other users.
    """
    user = "nobody" if os.geteuid() == 0 else None
    with tempfile.TemporaryDirectory(prefix="postgresql-") as data:
        if user:
            os.chown(data, pwd.getpwnam(user).pw_uid, -1)
        port = free_port()
        initdb = [bin_ / "initdb", "-D", data, "-U", "tests", "-A", "trust", "-E", "UTF8", "--locale=C", "--no-sync"]
        subprocess.run(initdb, check=True, user=user, **QUIET)
        options = ["-D", data, "-p", str(port), "-h", "127.0.0.1", "-k", "", "-c", "fsync=off"]
        server = PostgreSql([bin_ / "postgres", *options], port, user)
        try:
            yield server
        finally:
            server.stop()
