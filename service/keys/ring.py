"""The keys as a running server sees them."""

import logging
import os
from collections.abc import Mapping
from pathlib import Path

from service.errors import KeysError
from service.keys.file import KeyFile
from service.keys.key import Key, split

logger = logging.getLogger(__name__)

_Signature = tuple[int, ...]


class KeyRing:
    """Finds keys; what a command changes in the file counts from the next request on.

    A request costs one look at the file's metadata. A file that cannot be read is never taken for one
    without keys: `keys` raises until it can.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._signature: _Signature | None = None
        self._keys: Mapping[str, Key] = {}
        self._problem = ""

    def keys(self) -> Mapping[str, Key]:
        """All keys by id, revoked ones too.

        Raises:
          KeysError: the file cannot be read, or is damaged.
        """
        # Before it is read: a change that comes between shows as another signature the next time.
        signature = _signature(self._path)
        if signature != self._signature:
            self._signature = None  # and stays so if the file cannot be read: the next request tries again
            self._keys = self._read()
            self._signature = signature
        return self._keys

    def find(self, token: str) -> Key | None:
        """The key that this is the token of; None if there is none that still counts.

        Raises:
          KeysError: the file cannot be read, or is damaged.
        """
        keys = self.keys()
        parts = split(token)
        if parts is None:
            return None
        key = keys.get(parts[0])
        return key if key is not None and key.opened_by(parts[1]) else None

    def _read(self) -> Mapping[str, Key]:
        try:
            keys = {key.id: key for key in KeyFile(self._path).read()}
        except KeysError as error:
            if str(error) != self._problem:  # once, not with every request
                logger.error("%s; until then every request is refused", error)
            self._problem = str(error)
            raise
        self._problem = ""
        revoked = sum(key.revoked_at is not None for key in keys.values())
        if keys and revoked == len(keys):
            logger.warning("all %d API keys are revoked: every request is refused until one is created", revoked)
        elif keys:
            logger.info("%d API keys, %d of them revoked", len(keys), revoked)
        return keys


def _signature(path: Path) -> _Signature:
    """What differs after each replacement of the file; the error's number where it cannot be looked at."""
    try:
        status = os.stat(path)
    except OSError as error:
        return (error.errno or 0,)
    return status.st_ino, status.st_mtime_ns, status.st_ctime_ns, status.st_size
