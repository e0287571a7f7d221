"""OpenDRIVE junction: road A along x, B beyond, C to its left.

B runs in the other direction. Road D lies apart, so that netconvert shifts the coordinates.
"""

import math
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

from risk_sac.maps.convert import present_net
from risk_sac.world.net import Net
from risk_sac.world.read_net import parse_net, read_tree
from risk_sac.world.road_geometry import RoadFile
from tests.opendrive import ARC, LINE, Lanes, file_xml, road_xml

W = [3.5]
BOTH = {1: W, -1: W}


def _through(lanes: dict[int, tuple[int, int]]) -> list[Lanes]:
    return [Lanes(0.0, dict.fromkeys(lanes, W), lanes)]


def _end(name: str, kind: str, id_: str, contact: str = "") -> str:
    return f'<{name} elementType="{kind}" elementId="{id_}"' + (f' contactPoint="{contact}"/>' if contact else "/>")


def _connection(id_: int, incoming: str, road: str, contact: str, lanes: dict[int, int]) -> str:
    links = "".join(f'<laneLink from="{a}" to="{b}"/>' for a, b in lanes.items())
    head = f'id="{id_}" incomingRoad="{incoming}" connectingRoad="{road}" contactPoint="{contact}"'
    return f"<connection {head}>{links}</connection>"


MAP = file_xml(
    road_xml(
        "A",
        [(LINE, 100.0, ())],
        [
            Lanes(0.0, BOTH, {1: (None, 1), -1: (None, -1)}),
            Lanes(60.0, {**BOTH, -2: W}, {1: (1, None), -1: (-1, None)}),
        ],
        links=_end("successor", "junction", "J"),
    ),
    road_xml(
        "B",
        [(LINE, 100.0, ())],
        [Lanes(0.0, BOTH)],
        begin=(220 + 0j, math.pi),
        links=_end("successor", "junction", "J"),
    ),
    road_xml(
        "C",
        [(LINE, 80.0, ())],
        [Lanes(0.0, BOTH)],
        begin=(120 + 20j, math.pi / 2),
        links=_end("predecessor", "junction", "J"),
    ),
    road_xml(
        "10",
        [(LINE, 20.0, ())],
        _through({1: (1, -1), -1: (-1, 1)}),
        begin=(100 + 0j, 0.0),
        links=_end("predecessor", "road", "A", "end") + _end("successor", "road", "B", "end"),
        junction="J",
    ),
    road_xml(
        "11",
        [(ARC, 10 * math.pi, (0.05,))],
        _through({1: (1, 1), -1: (-1, -1)}),
        begin=(100 + 0j, 0.0),
        links=_end("predecessor", "road", "A", "end") + _end("successor", "road", "C", "start"),
        junction="J",
    ),
    road_xml("D", [(LINE, 50.0, ())], [Lanes(0.0, BOTH)], begin=(-300 - 200j, 0.0)),
    '<junction id="J" name="J">',
    _connection(0, "A", "10", "start", {-1: -1, 1: 1}),
    _connection(1, "B", "10", "end", {-1: 1, 1: -1}),
    _connection(2, "A", "11", "start", {-1: -1, 1: 1}),
    _connection(3, "C", "11", "end", {1: 1, -1: -1}),
    "</junction>",
)


@cache
def net_file() -> Path:
    """Returns the net converted from the road file `junction.xodr` beside it."""
    folder = Path(mkdtemp())
    file = folder / "junction.xodr"
    file.write_text(MAP)
    return present_net(file, folder).file


@cache
def roads_and_net() -> tuple[RoadFile, Net]:
    """The road file, and the net that it is converted to."""
    return RoadFile.read(net_file().with_name("junction.xodr")), parse_net(read_tree(net_file()))
