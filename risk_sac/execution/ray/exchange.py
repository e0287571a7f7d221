"""The server's end of the storage: what an attempt begins with, what it writes, and what is left when it has ended."""

import logging
import threading
from pathlib import Path

from risk_sac.errors import RiskSacError
from risk_sac.execution.ray.storage import BESIDE, FENCE, MANIFEST, SEED, Place, adopt, files_in, root_of, sow
from risk_sac.execution.ray.words import Order

logger = logging.getLogger(__name__)


class Exchange:
    """Files of one attempt. A run's folder is written by its latest attempt alone: the others' are closed."""

    def __init__(self, storage: str | None, order: Order) -> None:
        self._storage, self._order = storage, order
        self._folder = Path(order.folder)
        self._lock = threading.Lock()
        self._closed = False
        self._root: Place | None = None  # of all attempts at the run, and of this one; None: nothing is there
        self._own: Place | None = None
        self._known: dict[str, str] = {}

    def begin(self) -> str | None:
        """Takes over what the attempts of a server that was killed have left, and gives this one what the run has.

        Returns:
          URL of the attempt's folder; None if it was closed meanwhile.

        Raises:
          OSError: the storage or the disk refuses.
          DamagedError: a file is damaged.
        """
        with self._lock:
            if self._closed:
                return None
            url = root_of(self._storage, self._folder)
            root = Place(url)
            for name in root.names():
                left = Place(f"{url}/{name}")
                adopt(left, MANIFEST, self._folder, {})
                left.remove()
            own = f"{url}/{self._order.attempt:05d}-{self._order.token}"
            self._root, self._own = root, Place(own)
            sow(self._own, SEED, files_in(self._folder))
            sow(self._own, BESIDE, self._beside())
            self._own.write(FENCE, b"")
            return own

    def _beside(self) -> dict[str, Path]:
        found: dict[str, Path] = {}
        for name, text in self._order.beside.items():
            path = Path(text)
            found |= {f"{name}/{each}": at for each, at in files_in(path).items()} if path.is_dir() else {name: path}
        return found

    def take(self) -> bool:
        """Brings what the attempt has published into the run's folder; False if it was closed.

        Raises:
          OSError: the storage or the disk refuses.
          DamagedError: a file is damaged.
        """
        with self._lock:
            if self._closed or self._own is None:
                return False
            adopt(self._own, MANIFEST, self._folder, self._known)
            return True

    def end(self) -> None:
        """Takes the last files, and leaves nothing in the storage; what refuses is left for the next attempt."""
        with self._lock:
            if self._closed or self._own is None or self._root is None:
                return
            try:
                self._own.remove(FENCE)
                adopt(self._own, MANIFEST, self._folder, self._known)
                self._own.remove()
                if not self._root.names():
                    self._root.remove()
            except (OSError, RiskSacError) as error:
                logger.warning("run %d: the last files stay in the storage: %s", self._order.number, error)

    def close(self) -> None:
        """Nothing more is wanted of the attempt: on return this writes no file any more."""
        with self._lock:
            self._closed = True
