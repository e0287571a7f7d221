"""The folder of places on nets of users': each with a piece of its net, under a name that holds both's digest.

`RISK_SAC_PLACES` says where it is. Campaigns name the places of maps like families, so whoever plays or draws an
episode needs the folder that its place was kept in.
"""

import hashlib
import os
import shutil
import tempfile
import time
from collections.abc import Collection
from pathlib import Path

from risk_sac.config import FAMILY_NAME
from risk_sac.errors import ConfigError
from risk_sac.scenario.place import PLACES, Place

VARIABLE = "RISK_SAC_PLACES"
NET, PLACE = "net.xml", "place.json"
DIGITS = 12
_NEW, _GONE = ".new-", ".gone-"


def library() -> Path:
    """The folder; it may not be there yet."""
    told = os.environ.get(VARIABLE)
    if told:
        return Path(told)
    cache = os.environ.get("XDG_CACHE_HOME")
    return (Path(cache) if cache else Path.home() / ".cache") / "risk-sac" / "places"


def keep(place: Place, net: bytes) -> str:
    """Puts a place into the library, unless it is there.

    Args:
      place: to be kept; the file that it names is not.
      net: the piece of a net around it, which takes that file's place.

    Returns:
      The name of the family that it is.

    Raises:
      OSError: the folder cannot be written.
    """
    text = place.model_copy(update={"net": NET}).model_dump_json().encode()
    name = f"{place.pattern}_{_digest(text, net)}"
    put(name, text, net)
    return name


def put(name: str, text: bytes, net: bytes) -> None:
    """Puts what `files_of` has told of a place into the library, unless it is there.

    Raises:
      ConfigError: it is not what its name says.
      OSError: the folder cannot be written.
    """
    if not name.endswith(f"_{_digest(text, net)}"):
        raise ConfigError("family", f"the place {name!r} is not what its name says")
    folder = library() / name
    if folder.is_dir():
        os.utime(folder)  # it is wanted again: see `prune`
        return
    folder.parent.mkdir(parents=True, exist_ok=True)
    new = Path(tempfile.mkdtemp(prefix=_NEW, dir=folder.parent))
    new.chmod(0o755)
    (new / NET).write_bytes(net)
    (new / PLACE).write_bytes(text)
    try:
        new.rename(folder)
    except OSError:  # somebody else was quicker
        shutil.rmtree(new)
        if not folder.is_dir():
            raise


def files_of(name: str) -> tuple[bytes, bytes]:
    """A place of the library and the piece of net around it, as they are kept.

    Raises:
      ConfigError: it keeps none of this name, or what it keeps is not what was put there.
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
        raise ConfigError("family", f"the place {name!r} in {library()} is damaged", remedy="find it on its map anew")
    return text, net


def kept(name: str) -> Place:
    """A place of the library; raises what `files_of` does."""
    text, _ = files_of(name)
    return PLACES.validate_json(text).model_copy(update={"net": str((library() / name / NET).absolute())})


def prune(folder: Path, named: Collection[str], unused_s: float) -> list[str]:
    """Removes the places that nobody names; returns their names.

    Args:
      folder: the library; never that of a person, whose run folders nobody knows.
      named: families that stay.
      unused_s: how long ago a place must have been put there last, so that whoever is about to name it can.

    Raises:
      OSError: the folder cannot be written.
    """
    removed = []
    for path in sorted(folder.glob("*")):
        ours = FAMILY_NAME.fullmatch(path.name) is not None and path.name not in named
        if (ours or path.name.startswith(_NEW)) and path.stat().st_mtime < time.time() - unused_s:
            path.rename(path.with_name(f"{_GONE}{path.name}"))  # nobody may find half of it
            removed += [path.name] if ours else []
    for path in folder.glob(f"{_GONE}*"):
        shutil.rmtree(path)
    return removed


def _digest(text: bytes, net: bytes) -> str:
    digest = hashlib.sha256(text)
    digest.update(b"\0")
    digest.update(net)
    return digest.hexdigest()[:DIGITS]
