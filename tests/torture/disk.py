"""Disk that refuses on command, for processes started with its environment."""

import errno
import mmap
import shutil
import struct
import subprocess
from pathlib import Path

SOURCE = Path(__file__).with_name("faults.c")
FIELDS = struct.Struct("6i")  # armed, count, first, last, error, failed: struct control of faults.c
FOREVER = 2**31 - 1


def compiler() -> str | None:
    """A C compiler, if there is one."""
    return next((path for name in ("cc", "gcc", "clang") if (path := shutil.which(name))), None)


class Disk:
    """Refuses calls that would change a folder's files, over all processes.

    Attributes:
      environment: what to start a process with that is to meet this disk.
    """

    def __init__(self, folder: Path, root: Path) -> None:
        library, control = folder / "faults.so", folder / "faults.control"
        command = [compiler() or "cc", "-shared", "-fPIC", "-O1", "-Wall", "-o", library, SOURCE, "-ldl"]
        subprocess.run(command, check=True)
        control.write_bytes(bytes(FIELDS.size))
        with control.open("r+b") as file:
            self._map = mmap.mmap(file.fileno(), FIELDS.size)
        self.environment = {
            "LD_PRELOAD": str(library),
            "FAULTS_CONTROL": str(control),
            "FAULTS_ROOT": str(root),
        }

    def fill(self, after: int) -> None:
        """From the write number `after` on, there is no room."""
        self._set(1, 0, after, FOREVER, errno.ENOSPC, 0)

    def fail_once(self, number: int) -> None:
        """One write comes back with an I/O error."""
        self._set(1, 0, number, number, errno.EIO, 0)

    def heal(self) -> None:
        """Nothing is refused any more."""
        _, count, _, _, _, failed = self._get()
        self._set(0, count, 0, 0, 0, failed)

    @property
    def refused(self) -> int:
        """How many of them."""
        return self._get()[5]

    def close(self) -> None:
        """Give back the mapped file."""
        self._map.close()

    def _get(self) -> tuple[int, ...]:
        return FIELDS.unpack(self._map[:])

    def _set(self, *values: int) -> None:
        self._map[:] = FIELDS.pack(*values)
