"""Maps of an invented town in real formats, and maps without roads."""

import math
import re

LAT, LON = 48.76, 11.42
M_PER_DEG = 111_320.0
SPACING_M, SIDE = 300.0, 5
TURNED_RAD = math.radians(23.0)


def osm_town() -> str:
    """Returns an OpenStreetMap extract: crooked streets at 23°, signals and crossings."""
    nodes, ways, number = [], [], 1000
    for i in range(SIDE):
        for j in range(SIDE):
            signal = i % 2 == 1 and j % 2 == 1
            tag = '<tag k="highway" v="traffic_signals"/>' if signal else ""
            nodes.append(_node(_id(i, j), i * SPACING_M, j * SPACING_M, tag))
    for along in (True, False):
        for line in range(SIDE):
            refs = []
            for step in range(SIDE):
                refs.append(_id(step, line) if along else _id(line, step))
                if step == SIDE - 1:
                    continue
                for share, tag in ((0.3, ""), (0.5, _CROSSING), (0.7, "")):
                    number += 1
                    s, bow = (step + share) * SPACING_M, 25.0 * math.sin(math.pi * share)
                    x, y = (s, line * SPACING_M + bow) if along else (line * SPACING_M + bow, s)
                    nodes.append(_node(number, x, y, tag))
                    refs.append(number)
            big = line % 2 == 1
            tags = {"highway": "primary" if big else "residential", "name": "A & B <street>"}
            tags |= {"lanes": "4", "maxspeed": "50"} if big else {"maxspeed": "30"}
            ways.append(_way(len(ways) + 1, refs, tags))
    return f'<?xml version="1.0"?><osm version="0.6">{"".join(nodes)}{"".join(ways)}</osm>'


_CROSSING = '<tag k="highway" v="crossing"/><tag k="crossing" v="uncontrolled"/>'


def _id(i: int, j: int) -> int:
    return 1 + i * SIDE + j


def _place(x_m: float, y_m: float) -> tuple[float, float]:
    cos, sin = math.cos(TURNED_RAD), math.sin(TURNED_RAD)
    east, north = x_m * cos - y_m * sin, x_m * sin + y_m * cos
    return LAT + north / M_PER_DEG, LON + east / M_PER_DEG / math.cos(math.radians(LAT))


def _node(id_: int, x_m: float, y_m: float, tags: str) -> str:
    lat, lon = _place(x_m, y_m)
    return f'<node id="{id_}" lat="{lat:.7f}" lon="{lon:.7f}" version="1">{tags}</node>'


def _way(id_: int, refs: list[int], tags: dict[str, str]) -> str:
    inside = "".join(f'<nd ref="{ref}"/>' for ref in refs)
    for key, value in tags.items():
        escaped = value.replace("&", "&amp;").replace("<", "&lt;")
        inside += f'<tag k="{key}" v="{escaped}"/>'
    return f'<way id="{id_}" version="1">{inside}</way>'


def turned(net: str, angle_rad: float) -> str:
    """Rotates a net."""
    cos, sin = math.cos(angle_rad), math.sin(angle_rad)

    def point(x: str, y: str) -> tuple[float, float]:
        return float(x) * cos - float(y) * sin, float(x) * sin + float(y) * cos

    def shape(found: re.Match[str]) -> str:
        points = (point(*each.split(",")[:2]) for each in found[2].split())
        return f'{found[1]}="{" ".join(f"{x:.9f},{y:.9f}" for x, y in points)}"'

    def junction(found: re.Match[str]) -> str:
        x, y = point(found[1], found[2])
        return f' x="{x:.9f}" y="{y:.9f}"'

    net = re.sub(r'(\b(?:shape|outlineShape|customShape))="([^"]+)"', shape, net)
    return re.sub(r' x="([^"]+)" y="([^"]+)"', junction, net)
