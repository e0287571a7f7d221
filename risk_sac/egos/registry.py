"""Which egos there are. The operator registers them, by entry points and by a file; a request can only name one.

Python egos are entry points of the group `risk_sac.egos`, beside those that are shipped. Remote ones are tables of the
TOML file that `RISK_SAC_EGOS` names:

    [pilot]                       # what campaigns name
    address = "127.0.0.1:50051"
    version = "1.4.0+3f2a"        # which it has to say of itself, or its episodes are invalid
    response_time_s = 0.3
    deadline_s = 0.5              # for each answer
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
    """Of its server, `host:port` or `unix:///path`; the operator's business, and shown to nobody."""


def cards() -> tuple[EgoCard, ...]:
    """All registered egos, by name.

    Raises:
      ConfigError: one of them cannot be used, or two have the same name.
    """
    points, remotes = _points(), _remotes()
    if twice := points.keys() & remotes.keys():
        raise ConfigError(FILE, f"the names {sorted(twice)}, which entry points have too", "others")
    found = (*map(python_card, points.values()), *remotes.values())
    return tuple(sorted(found, key=lambda card: card.name))


def installed() -> dict[str, str]:
    """Versions of the Python egos of this machine, by name; where one cannot be used, why.

    Raises:
      ConfigError: two have the same name.
    """
    found = {}
    for name, point in _points().items():
        try:
            found[name] = python_card(point).version
        except ConfigError as error:
            found[name] = str(error)
    return found


def card_of(name: str) -> EgoCard:
    """The card of one ego.

    Raises:
      ConfigError: there is none of this name, or it cannot be used.
    """
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
    """The ego with the version and the response time of the registered driver that it names.

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
    """The driver that an ego names, ready to drive; None for SUMO's.

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
    """What makes a registered Python ego, and its card.

    Raises:
      ConfigError: there is none of this name, or it cannot be loaded.
    """
    card, points = card_of(name), _points()
    if name not in points:
        raise ConfigError("ego.driver", f"the ego {name!r} is no Python ego, but {card.kind}")
    return _loaded(points[name]), card


def make_unregistered(source: str, name: str) -> tuple[Callable[[], Ego], EgoCard]:
    """What makes an ego that no entry point names, and its card.

    Args:
      source: `module:Class`.
      name: that it is to have.

    Raises:
      ConfigError: there is no such class, it does not declare what it has to, or it cannot be loaded.
    """
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
