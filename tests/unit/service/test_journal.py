import os
import sqlite3
import subprocess
import sys

import pytest

from service.store import Store

WRITE_AND_DIE = """
import os, sqlite3, sys
database = sqlite3.connect(sys.argv[1])
database.execute("PRAGMA journal_mode = WAL")
database.execute("CREATE TABLE notes (text)")
for number in range(5):
    database.execute("INSERT INTO notes VALUES (?)", [str(number) * 3000])
    database.commit()
os._exit(0)
"""


@pytest.fixture
def database(tmp_path):
    """A database whose writer was killed after its last commit."""
    path = tmp_path / "test.db"
    subprocess.run([sys.executable, "-c", WRITE_AND_DIE, str(path)], check=True)
    return path


def test_a_whole_journal_is_taken_without_a_word(database, caplog):
    Store(f"sqlite:///{database}").close()
    assert "journal" not in caplog.text
    with sqlite3.connect(database) as found:
        assert found.execute("SELECT count(*) FROM notes").fetchone() == (5,)
    found.close()


@pytest.mark.parametrize("at", [-1, -5000, 4000])
def test_a_journal_with_a_flipped_bit_is_noticed(database, caplog, at):
    wal = database.with_name("test.db-wal")
    content = bytearray(wal.read_bytes())
    content[at] ^= 1
    wal.write_bytes(content)
    Store(f"sqlite:///{database}").close()
    assert "frames of the journal hold no whole commit" in caplog.text


def test_a_journal_that_was_cut_at_a_frame_looks_like_one_that_was_shorter(database, caplog):
    os.truncate(database.with_name("test.db-wal"), 32 + 3 * (24 + 4096))
    Store(f"sqlite:///{database}").close()
    with sqlite3.connect(database) as found:
        assert found.execute("SELECT count(*) FROM notes").fetchone()[0] < 5
    found.close()
