"""Lists the egos that the operator registers; requests can only name them.

Python egos are entry points of the group `risk_sac.egos`, beside the shipped ones. Remote ones are tables of the TOML
file that `RISK_SAC_EGOS` names; remote/README.md shows one. A Python ego's card is read from its source, so that none
of its code runs in the server.
"""

import ast
import hashlib
import os
import re
import threading
import tomllib
from collections.abc import Callable, Mapping
from importlib.metadata import EntryPoint, entry_points
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Any, Literal, NoReturn

from pydantic import AfterValidator, Field, ValidationError

from risk_sac.config import EgoConfig, Settings
from risk_sac.config.base import field_error, read_text
from risk_sac.config.ego import EgoName
from risk_sac.egos.defects.catalogue import Planted, planted, version_of
from risk_sac.egos.equipment import version_of_equipment
from risk_sac.egos.guard import Guarded
from risk_sac.egos.seam import Ego
from risk_sac.errors import ConfigError, EgoFailed, did_you_mean

MOST_SERVERS = 1024
ADDRESSES = "host:port, host:first-last or unix:path, or several of them with commas between"
EXAMPLE = "write for example 127.0.0.1:7000-7015"
_PORTS = re.compile(r"(?P<host>[\w.-]+|\[[0-9A-Fa-f:.%\w]+\]):(?P<first>\d{1,5})(?:-(?P<last>\d{1,5}))?", re.ASCII)
_UNIX = re.compile(r"unix:[^,\s]+")
_parsing = threading.Lock()  # CPython counts the depth of all threads' syntax trees together, and may find it wrong


def addresses_of(text: str) -> tuple[str, ...]:
    """Returns the addresses that a text names, one per server.

    `host:first-last` names consecutive ports. An address that is named twice is of a server that plays two episodes at
    a time.

    Raises:
      ConfigError: the text names no address, or more than `MOST_SERVERS`; its field is empty.
    """
    addresses = []
    for part in text.split(","):
        addresses += _addresses(part.strip(), text)
    if len(addresses) > MOST_SERVERS:
        raise ConfigError("", f"{len(addresses)} addresses", f"at most {MOST_SERVERS}", "name fewer ports")
    return tuple(addresses)


def _addresses(part: str, text: str) -> list[str]:
    if _UNIX.fullmatch(part):
        return [part]
    named = _PORTS.fullmatch(part)
    if named is None:
        inside = "" if part == text else f" in {text!r}"
        raise ConfigError("", f"{part!r}{inside}", ADDRESSES, EXAMPLE)
    first, last = int(named["first"]), int(named["last"] or named["first"])
    if not 1 <= first <= last <= 65535:
        raise ConfigError("", f"{part!r}", "ports from 1 to 65535, the first not beyond the last", EXAMPLE)
    return [f"{named['host']}:{port}" for port in range(first, last + 1)]


GROUP, FILE = "risk_sac.egos", "RISK_SAC_EGOS"
SHIPPED = {
    "r157": "risk_sac.egos.shipped:R157",
    "rss": "risk_sac.egos.shipped:RssResponder",
    "idm-aeb": "risk_sac.egos.shipped:IdmAeb",
    "broken": "risk_sac.egos.shipped:Broken",
}
PLANNERS = {  # shipped only where the extra `planners` is installed
    "fop": "risk_sac.egos.planners.fiss:Fop",
    "fiss": "risk_sac.egos.planners.fiss:Fiss",
    "fiss-plus": "risk_sac.egos.planners.fiss:FissPlus",
}
PLANNERS_PACKAGE = "fiss_planner"
HASH_DIGITS = 12
PYTHON_DEADLINE_S = 60.0  # generous: in our own process the first answer waits for a compiler


class EgoCard(Settings):
    """A registered ego."""

    name: EgoName
    """What `ego.driver` of a campaign names."""
    kind: Literal["python", "remote"]
    """python: in the worker's own process; remote: a process that speaks the protocol of `risk_sac.egos.remote`."""
    version: Annotated[str, Field(min_length=1, max_length=100)]
    """As it declares it; of a Python ego followed by a hash of its source."""
    response_time_s: Annotated[float, Field(ge=0, le=5)]
    """Within which it responds to a danger, s."""
    deadline_s: Annotated[float, Field(gt=0, le=600)]
    """For each of its answers, s of real time; an episode in which it misses it is invalid."""
    instances: Annotated[int, Field(ge=1, le=10_000)] | None = None
    """How many processes of one run may play it at a time; null: any number. A remote ego has one for each server."""
    summary: Annotated[str, Field(max_length=500)] = ""
    """In a sentence."""


def _checked_addresses(text: str) -> str:
    addresses_of(text)
    return text


class RemoteCard(EgoCard):
    """An ego in another process."""

    kind: Literal["remote"] = "remote"
    deadline_s: Annotated[float, Field(gt=0, le=600)] = 1.0
    address: Annotated[str, Field(max_length=10_000, exclude=True), AfterValidator(_checked_addresses)]
    """Of its servers, see `addresses_of`; each plays one episode at a time. Never shown."""

    @property
    def addresses(self) -> tuple[str, ...]:
        """Addresses of its servers, one each."""
        return addresses_of(self.address)


def python_card(point: EntryPoint) -> EgoCard:
    """Returns the card of the class that an entry point names.

    Raises:
      ConfigError: the class does not declare all of it.
    """
    file = _source(point)
    try:
        declared = _declared(file.read_bytes(), point.attr)
        if declared.get("version"):
            declared["version"] = f"{declared['version']}+{_hash(file, '.' in point.module)}"
        return EgoCard(name=point.name, kind="python", **{"deadline_s": PYTHON_DEADLINE_S} | declared)
    except (OSError, SyntaxError, UnicodeDecodeError) as error:
        raise _wrong(point, f"{file.name}: {error}") from error
    except ValidationError as error:
        raise _wrong(point, str(field_error(error.errors()[0]))) from error


def cards() -> tuple[EgoCard, ...]:
    """Returns all registered egos by name.

    Raises:
      ConfigError: one cannot be used, or two have the same name.
    """
    points, remotes = _points(), _remotes()
    if twice := points.keys() & remotes.keys():
        raise ConfigError(FILE, f"the names {sorted(twice)}, which entry points have too", "others")
    found = (*map(python_card, points.values()), *remotes.values())
    return tuple(sorted(found, key=lambda card: card.name))


def installed() -> dict[str, str]:
    """Returns versions of this machine's Python egos, or why one is unusable."""
    versions = {}
    for name, point in _points().items():
        try:
            versions[name] = python_card(point).version
        except ConfigError as error:
            versions[name] = str(error)
    return versions


def card_of(name: str) -> EgoCard:
    """Returns an ego's card; raises a ConfigError if absent or unusable."""
    points, remotes = _points(), _remotes()
    if name in points:
        return python_card(points[name])
    if name in remotes:
        return remotes[name]
    if name in PLANNERS:
        remedy = "pip install 'risk-sac[planners]', for the service and its workers"
        raise ConfigError("ego.driver", f"{name!r}, whose planner is not installed", "an ego that is installed", remedy)
    registered = sorted((*points, *remotes))
    expected = f"one of {', '.join(registered)}, which are registered"
    remedy = did_you_mean(name, registered) or "risk_sac/egos/README.md says how to register another"
    raise ConfigError("ego.driver", f"{name!r}", expected, remedy)


def pinned(ego: EgoConfig) -> EgoConfig:
    """Returns the ego with its driver's response time and all parts' version.

    Raises:
      ConfigError: there is no such driver or defect, a defect does not fit it, or it has another version than the ego
        says.
    """
    defects = planted(ego)
    if ego.driver is None and not defects:
        return ego
    card = None if ego.driver is None else card_of(ego.driver)
    if defects and isinstance(card, RemoteCard):
        got = f"{list(ego.defects)} for the ego {card.name!r}, which runs in a process of its own"
        raise ConfigError("ego.defects", got, "a Python ego")
    versions = ([card.version] if card else []) + ([version_of(ego)] if defects else [])
    version = "+".join(filter(None, (*versions, version_of_equipment(ego))))
    if ego.version not in (None, version):
        raise ConfigError(
            "ego.version",
            f"{ego.version!r}",
            f"{version!r}, of which {card.name if card else 'the defects'!r} are here",
            "register the one that is wanted, or leave version out",
        )
    response_s = card.response_time_s if card and ego.response_time_s is None else ego.response_time_s
    return ego.model_copy(update={"version": version, "response_time_s": response_s})


def instances_of(ego: EgoConfig) -> int | None:
    """Returns how many processes may play an ego at once; None: unlimited.

    Raises:
      ConfigError: there is no such driver.
    """
    card = None if ego.driver is None else card_of(ego.driver)
    if card is None:
        return None
    return len(card.addresses) if isinstance(card, RemoteCard) else card.instances


def load(ego: EgoConfig, server: int = 0) -> Guarded | None:
    """Returns an ego's driver, ready to drive; None for SUMO's.

    Args:
      ego: names the driver.
      server: number of the process that asks; it counts through the servers of a remote ego.

    Raises:
      ConfigError: there is no such driver or no such version, or it cannot be loaded.
    """
    if ego.driver is None:
        return None
    card = card_of(pinned(ego).driver or "")
    if isinstance(card, RemoteCard):
        from risk_sac.egos.remote.client import RemoteEgo  # here, because not everybody has grpc

        address = card.addresses[server % len(card.addresses)]
        remote = RemoteEgo(card.name, address, card.version, card.deadline_s)
        return Guarded(lambda: remote, card.deadline_s)
    point = _points()[card.name]
    defects = planted(ego)

    try:
        return Guarded(
            lambda: Planted(point.load(), defects) if defects else point.load()(),
            card.deadline_s,
            foreign=point.value not in SHIPPED.values(),
        )
    except EgoFailed as failed:
        raise _wrong(point, str(failed)) from failed


def check(ego: EgoConfig) -> None:
    """Loads an ego and closes it; raises a ConfigError if that fails."""
    loaded = load(ego)
    if loaded is not None:
        loaded.close()


def refuse_class(source: str) -> NoReturn:
    """Raises a ConfigError: `module:Class` names no registered ego."""
    got = f"the class {source}, which is not registered"
    serve = f"run `python -m risk_sac.egos.serve {source} --register NAME`"
    remedy = f"{serve} and put what it prints into the file of RISK_SAC_EGOS, or make it an entry point of {GROUP!r}"
    raise ConfigError("ego.driver", got, "the name of a registered ego", remedy)


def make(source: str, name: str) -> tuple[Callable[[], Ego], EgoCard]:
    """Returns a Python ego's class and card; raises a ConfigError otherwise.

    Args:
      source: name of a registered ego, or `module:Class`.
      name: that the latter gets in its card.
    """
    if ":" in source:
        point = EntryPoint(name=name, value=source, group=GROUP)
    elif isinstance(card_of(source), RemoteCard):
        raise ConfigError("ego.driver", f"the ego {source!r} is no Python ego, but remote")
    else:
        point = _points()[source]
    try:
        made: Callable[[], Ego] = point.load()
    except (Exception, SystemExit) as error:
        raise _wrong(point, f"{type(error).__name__}: {error}") from error
    return made, python_card(point)


def _points() -> Mapping[str, EntryPoint]:
    shipped = SHIPPED | (PLANNERS if find_spec(PLANNERS_PACKAGE) else {})
    points = {name: EntryPoint(name=name, value=value, group=GROUP) for name, value in shipped.items()}
    for point in entry_points(group=GROUP):
        if points.setdefault(point.name, point).value != point.value:
            raise ConfigError(GROUP, f"two egos as {point.name!r}", "names of their own")
    return points


def _remotes() -> Mapping[str, RemoteCard]:
    name = os.environ.get(FILE)
    if not name:
        return {}
    try:
        tables = tomllib.loads(read_text(Path(name), FILE))
        return {key: _remote_card(key, table) for key, table in tables.items()}
    except (tomllib.TOMLDecodeError, TypeError) as error:
        raise ConfigError(FILE, f"{name} is no TOML of one table for each ego: {error}") from error


def _remote_card(name: str, table: Mapping[str, Any]) -> RemoteCard:
    try:
        return RemoteCard.model_validate({"name": name, **table})
    except ValidationError as error:
        raise ConfigError(FILE, f"{name}.{field_error(error.errors()[0])}") from error


def _source(point: EntryPoint) -> Path:
    try:
        module_spec = find_spec(point.module)
    except ImportError as error:
        raise _wrong(point, str(error)) from error
    if module_spec is None or not module_spec.origin or not module_spec.origin.endswith(".py"):
        raise _wrong(point, f"there is no module {point.module!r} with a source")
    return Path(module_spec.origin)


def _declared(source: bytes, name: str) -> dict[str, Any]:
    names = "version", "response_time_s", "deadline_s", "instances"
    with _parsing:
        tree = ast.parse(source)
    for node in tree.body:
        if isinstance(node, ast.ClassDef) and node.name == name:
            return {"summary": (ast.get_docstring(node) or "").partition("\n")[0]} | {
                target.id: each.value.value
                for each in node.body
                if isinstance(each, ast.Assign) and isinstance(each.value, ast.Constant)
                for target in each.targets
                if isinstance(target, ast.Name) and target.id in names
            }
    raise SyntaxError(f"it has no class {name!r}")


def _hash(file: Path, in_package: bool) -> str:
    """Returns the hash of a module's source and its package's other modules."""
    digest = hashlib.sha256()
    for each in sorted(file.parent.glob("*.py")) if in_package else [file]:
        digest.update(each.name.encode() + b"\0" + each.read_bytes() + b"\0")
    return digest.hexdigest()[:HASH_DIGITS]


def _wrong(point: EntryPoint, why: str) -> ConfigError:
    got = f"{point.value}, which cannot be used: {why}"
    return ConfigError("ego.driver", got, "a class that can be imported", "mend or install its package")
