"""The digest by which results are compared. Pure."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from typing import Any

from risk_sac.records import EpisodeRecord, Record


def results_digest(records: Sequence[EpisodeRecord]) -> str:
    """SHA-256 over one line of canonical JSON per record; equal digests mean equal results.

    Keys are sorted and floats written so that they read back exactly. Records hold no wall-clock values.
    """
    digest = hashlib.sha256()
    for record in records:
        line = json.dumps(record, default=_plain, sort_keys=True, separators=(",", ":"))
        digest.update(line.encode() + b"\n")
    return digest.hexdigest()


# Fields that records have had since they were first digested. Those from before, which lack them, keep their digests.
FIELDS_ADDED_LATER = frozenset({"judgement", "noticed_s", "script"})


def _plain(value: object) -> dict[str, Any]:
    """Records and mappings as dicts, shallowly; `json` comes back for what they contain."""
    if isinstance(value, Record):
        return {name: each for name, each in value if each is not None or name not in FIELDS_ADDED_LATER}
    if isinstance(value, Mapping):
        return dict(value)
    raise TypeError(f"{value!r} of {type(value).__name__} has no canonical JSON; wanted a record of plain values")
