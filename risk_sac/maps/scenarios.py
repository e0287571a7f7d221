"""Parts of the documents that finders write: parameters, lanes and routes."""

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from risk_sac.config import Scenario
from risk_sac.errors import ConfigError
from risk_sac.maps.found import NoFit, Spot
from risk_sac.scenario.reading import document_from_fields
from risk_sac.scenario.tracks import Piece, Track
from risk_sac.world.net import Net

NET = "net.xml"  # network of a document of a place
LONGEST_NAME, LONGEST_SUMMARY = 40, 300
WALK_OFFSET_M = 1.9  # of a pedestrian from the middle of its way, along the road, at most
Fields = dict[str, Any]


def scenario_of(spot: Spot, summary: str, tags: Sequence[str], like: Mapping[str, Any], fields: Fields) -> Scenario:
    """Makes the document of a place.

    Args:
      spot: of the place; it names the document.
      summary: of the place, cut off if it is too long.
      tags: of the document.
      like: the shipped family whose prior fits.
      fields: parameters, ego, actors and whatever else the document has.

    Raises:
      NoFit: a document may not have the net's names.
    """
    try:
        return document_from_fields(
            {
                "name": _name_of(spot),
                "summary": summary[:LONGEST_SUMMARY],
                "tags": list(tags),
                "network": NET,
                "like": dict(like),
                "friction": "friction",
                **fields,
            }
        )
    except ConfigError as error:
        raise NoFit(f"no scenario can be written of it: {error}") from error


def _name_of(spot: Spot) -> str:
    words = re.sub("[^a-z0-9]+", "_", re.sub("^-", "minus_", spot.id.lower()))  # of two directions of a road
    return f"{spot.pattern}_{words.strip('_')}"[:LONGEST_NAME].strip("_")


def number(range_: tuple[float, float], unit: str, meaning: str, odd: str | None = None) -> Fields:
    """States a parameter of the scene space; raises `NoFit` if its range is empty."""
    if range_[0] > range_[1]:
        raise NoFit(f"there is no room for the {meaning}: it would be {range_[0]:g} to {range_[1]:g} {unit}")
    return {"unit": unit, "range": range_, "meaning": meaning} | ({"odd": odd} if odd else {})


def friction() -> Fields:
    """States the parameter of the road's surface."""
    return {"friction": number((0.6, 1.0), "1", "tyre-road friction coefficient", "environment.friction")}


def initial_speed(name: str, low: float, limit_mps: float, meaning: str) -> Fields:
    """States the parameter of a vehicle's initial speed.

    It begins at `low`, or at half the road's limit if that is lower.
    """
    odd = "dynamic.ego_speed_mps" if name.startswith("ego") else "dynamic.vehicle_speed_mps"
    high = top_speed(limit_mps)
    return {name: number((at_most(low, high / 2), at_most(high, high)), "m/s", meaning, odd)}


def walking(offset: str) -> Fields:
    """States the parameters of a pedestrian: along the road, from the kerb, and how fast."""
    speed = number((0.0, 2.0), "m/s", "initial walking speed", "dynamic.pedestrian_speed_mps")
    return {
        "pedestrian_offset_m": number((-WALK_OFFSET_M, WALK_OFFSET_M), "m", offset),
        "pedestrian_setback_m": number((0.3, 5.0), "m", "pedestrian's distance from the kerb"),
        "pedestrian_speed_mps": speed,
    }


def pedestrian(edge: str, side: str = "right") -> Fields:
    """States the actor that is about to walk over the crossing at the end of an edge."""
    return {
        "body": "pedestrian",
        "start": {
            "crossing": edge,
            "side": side,
            "setback_m": "pedestrian_setback_m",
            "offset_m": "pedestrian_offset_m",
        },
        "speed": "pedestrian_speed_mps",
    }


def signal_parts(net: Net, ids: Iterable[str | None]) -> tuple[Fields, Fields]:
    """States the parameter of the first signal's offset, and the document's `signal`."""
    cycles_s = ((id_, net.programs[id_].cycle_s) for id_ in ids if id_ in net.programs)
    for id_, cycle_s in cycles_s:
        if cycle_s > 0.0:
            offset = number((0.0, cycle_s), "s", "position in the signal's cycle at the start")
            return {"signal_offset_s": offset}, {"signal": {"id": id_, "offset_s": "signal_offset_s"}}
    return {}, {}


def at_most(usual: float, room: float) -> float:
    """Computes the usual bound, or what a place has room for, to a tenth."""
    return usual if usual <= room else math.floor(room * 10 + 1e-9) / 10


def top_speed(limit_mps: float) -> float:
    """Computes the highest initial speed, the limit rounded down to 0.1 m/s."""
    return math.floor(limit_mps * 10 + 1e-9) / 10


def own_piece(track: Track) -> Piece:
    """Returns the lane with the track's reference."""
    return next(piece for piece in reversed(track.pieces) if piece.reach_m >= 0.0)


def lane_of(net: Net, track: Track) -> str:
    """Names the lane with the track's reference; raises `NoFit` if an edge has that name."""
    return _lane(net, own_piece(track))


def route_of(net: Net, track: Track) -> list[str]:
    """Writes a track as a route: its lanes, and the edges after these; raises as `lane_of`."""
    return [*(_lane(net, piece) for piece in track.pieces), *track.onward]


def _lane(net: Net, piece: Piece) -> str:
    name = f"{piece.edge}_{piece.lane}"
    if name in net.edges:
        raise NoFit(f"the net has an edge and a lane {name!r}; wanted different names")
    return name
