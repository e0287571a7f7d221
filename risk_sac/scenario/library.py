"""Library of users' scenarios, a folder.

A scenario is stored as its document and its nets, under a name that holds the digest of all of them.

`RISK_SAC_PLACES` says where it is. Campaigns name these scenarios like shipped ones, so a process that plays or draws
an episode needs the folder that its scenario was kept in.
"""

import hashlib
import io
import json
import os
import re
import shutil
import tempfile
import time
import xml.etree.ElementTree as ET
from collections.abc import Collection, Mapping
from pathlib import Path

import yaml
from defusedxml.ElementTree import fromstring

from risk_sac.config import Scenario
from risk_sac.errors import ConfigError, DamagedError, did_you_mean
from risk_sac.host.machine import UNWRITABLE, user_cache
from risk_sac.scenario.reading import MOST_BYTES, document_from, networks, roads, shipped_names

VARIABLE = "RISK_SAC_PLACES"
DOCUMENT = "scenario.yaml"
DIGITS = 12
KEPT = re.compile(rf"[a-z][a-z0-9_]{{0,46}}_[0-9a-f]{{{DIGITS}}}")
_NET_FILE = re.compile(r"[A-Za-z0-9_-][A-Za-z0-9._-]{0,99}")
_NEW, _GONE = ".new-", ".gone-"
_ELEMENTS = {"net", "location", "type", "edge", "lane", "tlLogic", "phase"}
_ELEMENTS |= {"junction", "request", "connection", "roundabout"}
_ORIGIN = "origId"  # parameter of a lane: the OpenDRIVE road and lane that it was converted from
_SCHEMA = "{http://www.w3.org/2001/XMLSchema-instance}noNamespaceSchemaLocation"


def library() -> Path:
    """Returns the library's folder, which may not exist; raises `ConfigError` if unknown."""
    told = os.environ.get(VARIABLE)
    if told:
        return Path(told)
    cache = user_cache()
    if cache is None:
        raise ConfigError(VARIABLE, "nothing, and this user has no home folder", "a folder for scenarios")
    return cache / "risk-sac" / "places"


def written(document: Scenario) -> str:
    """Writes a document without defaults as YAML, or as JSON if long."""
    fields = document.model_dump(mode="json", exclude_defaults=True)
    as_json = json.dumps(fields)
    if len(as_json) > MOST_BYTES // 2:  # YAML of so much is slow to read
        return as_json
    return yaml.safe_dump(fields, sort_keys=False, allow_unicode=True, width=120, default_flow_style=None)


def own_files(document: Scenario, nets: Mapping[str, str]) -> dict[str, bytes]:
    """Reads a document's own nets and roads by name; `nets` from `nets_of`."""
    own = {name: Path(file) for name, file in nets.items() if Path(file).is_absolute()}
    folders = {file.parent for file in own.values()}
    own |= {name: folder / name for name in roads(document) for folder in folders if (folder / name).is_file()}
    return {name: file.read_bytes() for name, file in own.items()}


def keep(document: Scenario, own: Mapping[str, bytes]) -> str:
    """Puts a scenario into the library; returns its name with a digest.

    `own` has the SUMO nets of its networks, without shipped ones, and the OpenDRIVE files of its roads.

    Raises:
      ConfigError: a net has no name of a file, or the library cannot be written.
    """
    files = {DOCUMENT: written(document).encode(), **own}
    name = f"{document.name}_{_digest(files)}"
    put(name, files)
    return name


def put(name: str, files: Mapping[str, bytes]) -> None:
    """Puts the result of `files_of` into the library, unless already whole there.

    Raises:
      ConfigError: the files are not those of the name, or the library cannot be written.
      ValueError, ParseError: a net has what SUMO must not load. OpenDRIVE files are never given to SUMO.
    """
    document = _check(files)
    for net in files.keys() & set(networks(document)):
        _check_net(files[net])
    if not KEPT.fullmatch(name) or not name.endswith(f"_{_digest(files)}"):
        raise ConfigError("family", f"a scenario {name!r} whose digest is another", "one that was kept under its name")
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
        raise ConfigError(VARIABLE, got, "a folder for scenarios that can be written") from error
    new.chmod(0o755)
    for file, content in files.items():
        (new / file).write_bytes(content)
    try:
        new.rename(folder)
    except OSError:  # another process was quicker
        shutil.rmtree(new)
        if not folder.is_dir():
            raise


def files_of(name: str) -> Mapping[str, bytes]:
    """Reads a kept scenario's files: its document first, then its nets.

    Raises:
      ConfigError: there is none of this name.
      DamagedError: its files are not as they were written.
    """
    folder = library() / name
    try:
        if not KEPT.fullmatch(name):
            raise FileNotFoundError
        paths = sorted(path for path in folder.iterdir() if path.name != DOCUMENT)
        files = {path.name: path.read_bytes() for path in (folder / DOCUMENT, *paths)}
    except OSError:
        known = shipped_names()
        remedy = did_you_mean(name, known) or f"{VARIABLE} names the folder of others, now {library()}"
        wanted = f"one of {', '.join(known)}, or a scenario of {library()}"
        raise ConfigError("family", f"{name!r}, which is no scenario", wanted, remedy) from None
    if not name.endswith(f"_{_digest(files)}"):
        raise DamagedError(f"the scenario {name!r} in {library()} is damaged; keep it once more")
    return files


def kept(name: str) -> tuple[Scenario, Path]:
    """Reads a kept scenario's document, and its folder; raises as `files_of`."""
    return document_from(files_of(name)[DOCUMENT].decode()), (library() / name).absolute()


def listed() -> list[str]:
    """Names of all kept scenarios."""
    return sorted(path.name for path in library().glob("*") if KEPT.fullmatch(path.name))


def prune(folder: Path, named: Collection[str], unused_s: float, started_at: float) -> list[str]:
    """Removes a service's old and unnamed scenarios; returns their names.

    Args:
      folder: the library; never that of a person, whose run folders are unknown.
      named: scenarios that stay.
      unused_s: least time since a scenario was last put there.
      started_at: when the service started, s since the epoch; what was half put there before is removed.
    """
    removed = []
    for path in sorted(folder.glob("*")):
        ours = KEPT.fullmatch(path.name) is not None and path.name not in named
        oldest = started_at if path.name.startswith(_NEW) else time.time() - unused_s
        if (ours or path.name.startswith(_NEW)) and path.stat().st_mtime < oldest:
            path.rename(path.with_name(f"{_GONE}{path.name}"))  # so that no process reads half of it
            removed += [path.name] if ours else []
    for path in folder.glob(f"{_GONE}*"):
        shutil.rmtree(path)
    return removed


def _check(files: Mapping[str, bytes]) -> Scenario:
    """Returns the document of files; raises ConfigError if they do not fit."""
    document = document_from(files[DOCUMENT].decode()) if DOCUMENT in files else None
    if document is None:
        raise ConfigError("family", "a scenario without a document", DOCUMENT)
    for name in files.keys() - {DOCUMENT}:
        if not _NET_FILE.fullmatch(name) or name not in (*networks(document), *roads(document)):
            raise ConfigError("network", repr(name), "a file name that the document names as a network or road")
    return document


def _check_net(net: bytes) -> None:
    """Raises a ValueError or ParseError for more than a map's elements."""
    for element in fromstring(net, forbid_dtd=True).iter():
        if element.tag == "param" and element.get("key") == _ORIGIN:
            continue
        if element.tag not in _ELEMENTS:
            raise ValueError(f"its net has a <{element.tag}>; wanted {', '.join(sorted(_ELEMENTS))} alone")
        if any("$" in value for value in element.attrib.values()):  # which SUMO replaces by what the environment has
            raise ValueError(f"a <{element.tag}> of its net says $; wanted none")


def _digest(files: Mapping[str, bytes]) -> str:
    digest = hashlib.sha256()
    for name in sorted(files):
        content = files[name] if name == DOCUMENT else _canonical(files[name])
        digest.update(f"{name}\0{len(content)}\0".encode() + content)
    return digest.hexdigest()[:DIGITS]


def _canonical(net: bytes) -> bytes:
    """A net without comments, white space and schema.

    netconvert writes the date into a comment. A file that is no XML stays as it is.
    """
    try:
        return ET.canonicalize(from_file=io.BytesIO(net), strip_text=True, exclude_attrs=[_SCHEMA]).encode()
    except (ET.ParseError, LookupError, ValueError):  # the latter two: an encoding that Python lacks
        return net
