"""Library of places on users' nets, a folder.

A place is stored with a piece of its net, under a name that holds the digest of both.

`RISK_SAC_PLACES` says where it is. Campaigns name the places of maps like families, so a process that plays or draws an
episode needs the folder that its place was kept in.
"""

import hashlib
import os
import re
import shutil
import tempfile
import time
from collections.abc import Collection
from pathlib import Path

from risk_sac.config import FAMILY_NAME
from risk_sac.errors import ConfigError, DamagedError
from risk_sac.host.machine import UNWRITABLE, user_cache
from risk_sac.scenario.place import PLACES, Place

VARIABLE = "RISK_SAC_PLACES"
NET, PLACE = "net.xml", "place.json"
DIGITS = 12
LONGEST_ID = 40  # of it in a name
_NEW, _GONE = ".new-", ".gone-"


def library() -> Path:
    """The folder; it may not be there yet. Raises `ConfigError` where nothing says where it is."""
    told = os.environ.get(VARIABLE)
    if told:
        return Path(told)
    cache = user_cache()
    if cache is None:
        raise ConfigError(VARIABLE, "nothing, and this user has no home folder", "a folder for places on maps")
    return cache / "risk-sac" / "places"


def keep(place: Place, net: bytes, id_: str = "") -> str:
    """Puts a place and its piece of net into the library.

    Args:
      place: on the piece.
      net: the piece, as SUMO reads it.
      id_: the map's name of the place; its letters and digits become part of the family's name.

    Returns:
      The name of its family.
    """
    text = place.model_copy(update={"net": NET}).model_dump_json().encode()
    words = re.sub("^-", "minus_", id_.lower())  # of two directions of a road
    told = re.sub("[^a-z0-9]+", "_", words).strip("_")[:LONGEST_ID].strip("_")
    name = "_".join(filter(None, (place.pattern, told, _digest(text, net))))
    put(name, text, net)
    return name


def put(name: str, text: bytes, net: bytes) -> None:
    """Puts what `files_of` returned into the library, unless it is there and whole.

    Raises:
      ConfigError: it is not what its name says.
    """
    if not name.endswith(f"_{_digest(text, net)}"):
        raise ConfigError("family", f"the place {name!r} is not what its name says")
    folder = library() / name
    if folder.is_dir():
        try:
            files_of(name)
        except (ConfigError, DamagedError):
            shutil.rmtree(folder)
        else:
            os.utime(folder)  # it is wanted again: see `prune`
            return
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        new = Path(tempfile.mkdtemp(prefix=_NEW, dir=folder.parent))
    except OSError as error:
        if error.errno not in UNWRITABLE:
            raise
        got = f"{folder.parent}, which cannot be written ({error.strerror})"
        raise ConfigError(VARIABLE, got, "a folder for places on maps that can be written") from error
    new.chmod(0o755)
    (new / NET).write_bytes(net)
    (new / PLACE).write_bytes(text)
    try:
        new.rename(folder)
    except OSError:  # another process was quicker
        shutil.rmtree(new)
        if not folder.is_dir():
            raise


def files_of(name: str) -> tuple[bytes, bytes]:
    """A place and the piece of net around it, as they are kept.

    Raises:
      ConfigError: there is none of this name.
      DamagedError: its files are not as they were written.
    """
    folder = library() / name
    try:
        if not FAMILY_NAME.fullmatch(name):
            raise FileNotFoundError
        text, net = (folder / PLACE).read_bytes(), (folder / NET).read_bytes()
    except OSError:
        remedy = f"name low, mixed, dense, or one that lies in {library()} ({VARIABLE} names another folder)"
        raise ConfigError("family", f"there is no place {name!r}", remedy=remedy) from None
    if not name.endswith(f"_{_digest(text, net)}"):
        raise DamagedError(f"the place {name!r} in {library()} is damaged; name the place on its map once more")
    return text, net


def kept(name: str) -> Place:
    """A place of the library; raises what `files_of` does."""
    text, _ = files_of(name)
    return PLACES.validate_json(text).model_copy(update={"net": str((library() / name / NET).absolute())})


def prune(folder: Path, named: Collection[str], unused_s: float, started_at: float) -> list[str]:
    """Removes a service's places that are old and not named.

    Returns their names.

    Args:
      folder: the library; never that of a person, whose run folders are unknown.
      named: families that stay.
      unused_s: least time since a place was last put there.
      started_at: when the service started, s since the epoch; what was half put there before is removed.
    """
    removed = []
    for path in sorted(folder.glob("*")):
        ours = FAMILY_NAME.fullmatch(path.name) is not None and path.name not in named
        oldest = started_at if path.name.startswith(_NEW) else time.time() - unused_s
        if (ours or path.name.startswith(_NEW)) and path.stat().st_mtime < oldest:
            path.rename(path.with_name(f"{_GONE}{path.name}"))  # so that half of it is never found
            removed += [path.name] if ours else []
    for path in folder.glob(f"{_GONE}*"):
        shutil.rmtree(path)
    return removed


def _digest(text: bytes, net: bytes) -> str:
    return hashlib.sha256(text + b"\0" + net).hexdigest()[:DIGITS]
