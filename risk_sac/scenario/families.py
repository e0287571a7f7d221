"""Scenario families by name: those shipped, and those at places that the library keeps."""

from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from pathlib import Path

from risk_sac.config import SHIPPED
from risk_sac.scenario import car_following, hidden_pedestrian, junction
from risk_sac.scenario.family import Family
from risk_sac.scenario.library import kept
from risk_sac.scenario.place import PLACES, CrossingPlace, JunctionPlace, Place, Stretch


def family_at(name: str, place: Place) -> Family:
    """Returns the family of a place's pattern under this name."""
    match place:
        case Stretch():
            return car_following.family(name, place)
        case CrossingPlace():
            return hidden_pedestrian.family(name, place)
        case JunctionPlace():
            return junction.family(name, place)


def _shipped(name: str) -> Family:
    return family_at(name, PLACES.validate_json((Path(str(files("sumo_nets"))) / name / "place.json").read_bytes()))


FAMILIES: dict[str, Family] = {name: _shipped(name) for name in SHIPPED}


ALIKE: Mapping[str, str] = {"car_following": "low", "crossing": "mixed", "junction": "dense"}


def shipped_alike(name: str) -> str:
    """Returns the shipped family of a family's pattern."""
    return name if name in FAMILIES else next(shipped for pattern, shipped in ALIKE.items() if name.startswith(pattern))


def family_named(name: str) -> Family:
    """Returns a family, shipped or of the library; raises `ConfigError` if none has this name."""
    return FAMILIES[name] if name in FAMILIES else _kept(name)


@cache  # a name holds a digest of what it stands for
def _kept(name: str) -> Family:
    return family_at(name, kept(name))
