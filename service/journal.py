"""Whether SQLite has dropped the end of its journal: a commit that a kill cut off, or one that the disk damaged.

SQLite reads its write-ahead log up to the last commit whose checksums hold and says nothing of what follows. Nothing
is lost for good by it, since runs tell again what their checkpoints know; but it should be noticed.

Source: the format of the write-ahead log, sqlite.org/fileformat2.html.
"""

import struct
from pathlib import Path

from sqlalchemy import Engine, text

HEADER = struct.Struct(">8I")  # magic, version, page size, sequence, two salts, two checksums
FRAME = struct.Struct(">6I")  # page, size after a commit, two salts, two checksums


class Journal:
    """The write-ahead log as it lay there before the database was opened.

    Args:
      database: the SQLite file.
    """

    def __init__(self, database: Path) -> None:
        wal = database.with_name(f"{database.name}-wal")
        self._frames = 0  # of the log's present generation
        content = wal.read_bytes() if wal.exists() else b""
        if len(content) < HEADER.size:
            return
        _, _, page_size, _, *salts, _, _ = HEADER.unpack_from(content)
        size = FRAME.size + page_size
        for start in range(HEADER.size, len(content) - size + 1, size):
            _, _, *found, _, _ = FRAME.unpack_from(content, start)
            if found != salts:
                break
            self._frames += 1

    def dropped(self, engine: Engine) -> int:
        """Number of frames that the database, open now, did not take."""
        if not self._frames:
            return 0
        with engine.connect() as connection:
            taken: int = connection.execute(text("PRAGMA wal_checkpoint(PASSIVE)")).one()[1]
        return max(0, self._frames - max(0, taken))
