"""Lists the egos that the operator has registered; a request can only name one.

Python egos are entry points of the group `risk_sac.egos`, beside the shipped ones. Remote ones are tables of the TOML
file that `RISK_SAC_EGOS` names; README.md shows one.
"""

import os
import tomllib
from collections.abc import Callable, Mapping
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, ValidationError

from risk_sac.config import EgoConfig
from risk_sac.config.invalid import field_error
from risk_sac.egos.cards import EgoCard, python_card
from risk_sac.egos.guard import Guarded
from risk_sac.egos.seam import Ego
from risk_sac.errors import ConfigError

GROUP, FILE = "risk_sac.egos", "RISK_SAC_EGOS"
SHIPPED = {
    "r157": "risk_sac.egos.careful:Careful",
    "rss": "risk_sac.egos.rss_responder:RssResponder",
    "idm-aeb": "risk_sac.egos.idm_aeb:IdmAeb",
    "broken": "risk_sac.egos.broken:Broken",
}


class RemoteCard(EgoCard):
    """An ego in another process."""

    kind: Literal["remote"] = "remote"
    deadline_s: Annotated[float, Field(gt=0, le=600)] = 1.0
    address: Annotated[str, Field(min_length=1, max_length=500, exclude=True)]
    """Of its server, `host:port` or `unix:///path`; never shown."""


def cards() -> tuple[EgoCard, ...]:
    """Returns all registered egos by name; a ConfigError if one cannot be used, or two have the same name."""
    points, remotes = _points(), _remotes()
    if twice := points.keys() & remotes.keys():
        raise ConfigError(FILE, f"the names {sorted(twice)}, which entry points have too", "others")
    found = (*map(python_card, points.values()), *remotes.values())
    return tuple(sorted(found, key=lambda card: card.name))


def installed() -> dict[str, str]:
    """Returns the versions of this machine's Python egos by name; for one that cannot be used, the reason."""
    found = {}
    for name, point in _points().items():
        try:
            found[name] = python_card(point).version
        except ConfigError as error:
            found[name] = str(error)
    return found


def card_of(name: str) -> EgoCard:
    """Returns the card of an ego; a ConfigError if it does not exist or cannot be used."""
    points, remotes = _points(), _remotes()
    if name in points:
        return python_card(points[name])
    if name in remotes:
        return remotes[name]
    raise ConfigError(
        "ego.driver",
        f"{name!r}",
        f"one of {', '.join(sorted((*points, *remotes)))}, which are registered",
    )


def pinned(ego: EgoConfig) -> EgoConfig:
    """Returns the ego with version and response time of the registered driver that it names.

    Raises:
      ConfigError: there is no such driver, or it has another version than the ego says.
    """
    if ego.driver is None:
        return ego
    card = card_of(ego.driver)
    if ego.version not in (None, card.version):
        raise ConfigError(
            "ego.version",
            f"{ego.version!r}",
            f"{card.version!r}, of which the registered {card.name!r} is",
            "register the one that is wanted, or leave version out",
        )
    response_s = card.response_time_s if ego.response_time_s is None else ego.response_time_s
    return ego.model_copy(update={"version": card.version, "response_time_s": response_s})


def load(ego: EgoConfig) -> Guarded | None:
    """Returns the driver that an ego names, ready to drive; None for SUMO's.

    Raises:
      ConfigError: there is no such driver or no such version, or it cannot be loaded.
    """
    if ego.driver is None:
        return None
    card = card_of(pinned(ego).driver or "")
    if isinstance(card, RemoteCard):
        from risk_sac.egos.remote.client import RemoteEgo  # here, because not everybody has grpc

        return Guarded(RemoteEgo(card.name, card.address, card.version, card.deadline_s), card.deadline_s)
    return Guarded(make(card.name)[0](), card.deadline_s, interrupted=True)


def make(name: str) -> tuple[Callable[[], Ego], EgoCard]:
    """Returns the class of a registered Python ego and its card; a ConfigError if it cannot be loaded."""
    card, points = card_of(name), _points()
    if name not in points:
        raise ConfigError("ego.driver", f"the ego {name!r} is no Python ego, but {card.kind}")
    return _loaded(points[name]), card


def make_unregistered(source: str, name: str) -> tuple[Callable[[], Ego], EgoCard]:
    """Returns the class `module:Class` that no entry point names, and its card under a name."""
    point = EntryPoint(name=name, value=source, group=GROUP)
    return _loaded(point), python_card(point)


def _loaded(point: EntryPoint) -> Callable[[], Ego]:
    try:
        made: Callable[[], Ego] = point.load()
    except Exception as error:
        raise ConfigError(
            "ego.driver", f"the ego {point.name!r} ({point.value}) cannot be loaded: {type(error).__name__}: {error}"
        ) from error
    return made


def _points() -> Mapping[str, EntryPoint]:
    found = {name: EntryPoint(name=name, value=value, group=GROUP) for name, value in SHIPPED.items()}
    for point in entry_points(group=GROUP):
        if found.setdefault(point.name, point).value != point.value:
            raise ConfigError(GROUP, f"two egos as {point.name!r}", "names of their own")
    return found


def _remotes() -> Mapping[str, RemoteCard]:
    name = os.environ.get(FILE)
    if not name:
        return {}
    try:
        tables = tomllib.loads(Path(name).read_text(encoding="utf-8"))
        return {key: RemoteCard.model_validate({"name": key, **table}) for key, table in tables.items()}
    except OSError as error:
        raise ConfigError(FILE, f"{name} cannot be read: {error.strerror}") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, TypeError) as error:
        raise ConfigError(FILE, f"{name} is no TOML of one table for each ego: {error}") from error
    except ValidationError as error:
        raise ConfigError(FILE, str(field_error(error.errors()[0]))) from error
