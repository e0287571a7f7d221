"""Keys as a running server sees them, their shares, and the addresses that it may listen on."""

import logging
import os
from collections.abc import Mapping
from pathlib import Path

from risk_sac.errors import ConfigError
from risk_sac.host.machine import is_loopback
from service.errors import KeysError
from service.keys.file import Document, Key, KeyFile, missing, split
from service.keys.made import AuthEnabledFlag
from service.settings import ServiceSettings

logger = logging.getLogger(__name__)

_Signature = tuple[int, ...]


class KeyRing:
    """Finds keys; changes of the file count from the next request on.

    A request costs one stat of the file. An unreadable file is not an empty one, and a missing file is not a service
    without keys: each look-up raises until the file is intact again.
    """

    def __init__(self, path: Path, made: AuthEnabledFlag) -> None:
        self._path = path
        self._made = made
        self._signature: _Signature | None = None
        self._document: Document | None = None
        self._keys: Mapping[str, Key] = {}
        self._problem = ""

    @property
    def open(self) -> bool:
        """Whether local processes need no key: none was ever made, or an administrator opened the service."""
        self.keys()
        return self._document is None or self._document.open

    def keys(self) -> Mapping[str, Key]:
        """All keys by id, revoked ones too; raises KeysError if the file is unreadable, damaged or lost."""
        # Before the file is looked at, since it is there before anybody can know of its keys; and before it is read: a
        # change that comes between shows as another signature the next time.
        made = self._made.known
        signature = _signature(self._path)
        try:
            if signature != self._signature:
                self._signature = None  # and stays so if the file cannot be read: the next request tries again
                self._document = self._read()
                self._signature = signature
            if made and self._document is None:
                raise missing(self._path)
        except KeysError as error:
            if str(error) != self._problem:  # once, not with every request
                logger.error("%s; until then every request is refused", error)
            self._problem = str(error)
            raise
        self._problem = ""
        return self._keys

    def find(self, token: str) -> Key | None:
        """Returns the valid key of a token, else None."""
        keys = self.keys()
        parts = split(token)
        if parts is None:
            return None
        key = keys.get(parts[0])
        return key if key is not None and key.opened_by(parts[1]) else None

    def _read(self) -> Document | None:
        document = KeyFile(self._path).load()
        self._keys = {} if document is None else {key.id: key for key in document.keys}
        if document is None:
            return None
        self._made.known = True
        revoked = sum(key.revoked_at is not None for key in document.keys)
        if document.open:
            logger.warning("an administrator allows every local process to call without an API key")
        elif revoked == len(document.keys):
            logger.warning("all %d API keys are revoked: every request is refused until one is created", revoked)
        else:
            logger.info("%d API keys, %d of them revoked", len(document.keys), revoked)
        return document


def _signature(path: Path) -> _Signature:
    """Returns metadata that changes with each replacement of the file, or the error number."""
    try:
        status = os.stat(path)
    except OSError as error:
        return (error.errno or 0,)
    return status.st_ino, status.st_mtime_ns, status.st_ctime_ns, status.st_size


def fair_share(places: int, keys: int) -> int:
    """Returns how many places each of some keys may hold, with one share left for a new key."""
    return max(1, places // (keys + 1))


def check_exposure(settings: ServiceSettings) -> None:
    """Refuses to serve other machines without keys, and anyone if the keys are unreadable."""
    keys = KeyFile(settings.keys_file).read()
    if is_loopback(settings.host) or any(key.revoked_at is None for key in keys):
        return
    remedy = "create one with `risk-sac keys create`"
    raise ConfigError("host", repr(settings.host), "a loopback address, or API keys", remedy)
