"""One API key: what is kept of it, and whether a caller holds it.

A key reads `rsk_ID_SECRET`. The id is public and finds the record; of the secret only a hash is kept. A
single SHA-256 is enough: slow hashes make guessable passwords dear to guess, and nobody guesses 256
random bits.
"""

import hashlib
import hmac
import re
import secrets
import time
from enum import StrEnum
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

PROJECT = "[a-z0-9][a-z0-9-]{0,39}"
_TOKEN = re.compile(r"rsk_([0-9a-f]{8})_([A-Za-z0-9_-]{43})")


class Scope(StrEnum):
    """What a key may do; each scope includes those before it."""

    READ = "read"  # look at its project's campaigns
    RUN = "run"  # post, cancel and delete them
    ADMIN = "admin"  # all of that in every project, since somebody has to stop a runaway campaign; and see the metrics

    def includes(self, other: "Scope") -> bool:
        """Whether whoever has this scope may do what `other` allows."""
        order = list(Scope)
        return order.index(self) >= order.index(other)


class Key(BaseModel):
    """What the service knows of a key. Times are seconds since the epoch."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    id: Annotated[str, Field(pattern="^[0-9a-f]{8}$")]
    project: Annotated[str, Field(pattern=f"^{PROJECT}$")]
    name: Annotated[str, Field(max_length=100)]
    scope: Scope
    created_at: float
    revoked_at: float | None = None
    hash: Annotated[str, Field(pattern="^[0-9a-f]{64}$")]

    def opened_by(self, secret: str) -> bool:
        """Whether this is the key's secret and the key still counts."""
        # In constant time, or the time of the answer would tell how much of the hash is right.
        return hmac.compare_digest(self.hash, _hash(secret)) and self.revoked_at is None


def mint(project: str, name: str, scope: Scope) -> tuple[Key, str]:
    """A new key: its record, and the token that is shown once and kept nowhere."""
    key_id, secret = secrets.token_hex(4), secrets.token_urlsafe(32)
    key = Key(id=key_id, project=project, name=name, scope=scope, created_at=round(time.time(), 3), hash=_hash(secret))
    return key, f"rsk_{key_id}_{secret}"


def split(token: str) -> tuple[str, str] | None:
    """Id and secret of a token; None if it has not the shape of one."""
    found = _TOKEN.fullmatch(token)
    return None if found is None else (found[1], found[2])


def _hash(secret: str) -> str:
    return hashlib.sha256(secret.encode("ascii")).hexdigest()
