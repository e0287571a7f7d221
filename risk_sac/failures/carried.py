"""Packs and unpacks the place that a bundle carries, so that it can be played without the map.

It reaches the simulator only if it has the elements that `risk_sac.scenario.maps.cut` writes and no others: SUMO writes
files that a parameter of a signal names, and reads those that XML includes.
"""

from collections.abc import MutableMapping
from typing import Any
from xml.etree.ElementTree import ParseError

import numpy as np
from defusedxml.ElementTree import fromstring
from numpy.typing import NDArray

from risk_sac.config import SHIPPED, FamilyName
from risk_sac.errors import ConfigError
from risk_sac.scenario import library
from risk_sac.scenario.place import PLACES

PLACE, NET = "place", "place_net"  # names of the arrays
ELEMENTS = {"net", "location", "type", "edge", "lane", "tlLogic", "phase"}
ELEMENTS |= {"junction", "request", "connection", "roundabout"}


def carried(family: FamilyName) -> dict[str, NDArray[np.uint8]]:
    """Returns the arrays of a family's place; none for a shipped one."""
    if family in SHIPPED:
        return {}
    place, net = library.files_of(family)
    return {PLACE: np.frombuffer(place, dtype=np.uint8), NET: np.frombuffer(net, dtype=np.uint8)}


def unpack(family: FamilyName, arrays: MutableMapping[str, NDArray[Any]]) -> None:
    """Moves a bundle's place into this machine's library of places.

    Raises:
      ValueError: the arrays are no such place.
    """
    text, net = arrays.pop(PLACE, None), arrays.pop(NET, None)
    if text is None or net is None or family in SHIPPED:
        return
    try:
        PLACES.validate_json(text.tobytes())
        check_net(net.tobytes())
        library.put(family, text.tobytes(), net.tobytes())
    except (ValueError, ConfigError, ParseError) as error:
        raise ValueError(f"the place that it carries cannot be played at: {error}") from error


def check_net(net: bytes) -> None:
    """Raises a ValueError, or a ParseError, for a net that has more than a piece of a map."""
    for element in fromstring(net, forbid_dtd=True).iter():
        if element.tag not in ELEMENTS:
            raise ValueError(f"its net has a <{element.tag}>; wanted {', '.join(sorted(ELEMENTS))} alone")
        if any("$" in value for value in element.attrib.values()):  # which SUMO replaces by what the environment has
            raise ValueError(f"a <{element.tag}> of its net says $; wanted none")
