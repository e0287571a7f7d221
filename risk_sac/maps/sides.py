"""On which side people drive on a map in another format, which netconvert does not ask.

Evidence in an OpenStreetMap extract: `driving_side` of ways, relations and nodes; roundabouts, which are drawn in the
direction of driving, in one way or in several, and mini-roundabouts that tell theirs; and the two carriageways of one
road. A road of OpenDRIVE has a rule, which is right-hand traffic where it is left out.
Source: https://wiki.openstreetmap.org/wiki/Key:driving_side, https://wiki.openstreetmap.org/wiki/Tag:junction=roundabout,
  ASAM OpenDRIVE, `rule` of `<road>`
"""

import math
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from xml.parsers.expat import ExpatError, ParserCreate

import numpy as np
from scipy.spatial import KDTree

from risk_sac.errors import MapError
from risk_sac.world.types import Floats

LEFT, RIGHT = "left", "right"
UNKNOWN = "the map does not say on which side people drive: it is read as right-hand traffic"
RINGS = ("roundabout", "circular")
MINI = {"clockwise": LEFT, "anticlockwise": RIGHT, "anti-clockwise": RIGHT, "counterclockwise": RIGHT}
APART_M = (4.0, 40.0)  # of the carriageways of one road
LEAST_AREA_M2 = 1.0
M_PER_DEG = 111_320.0


def side_remarks(file: Path) -> list[str]:
    """Returns remarks on a map that is read as right-hand traffic.

    Choice: where the evidence contradicts itself, as where one road has its sides swapped, most of it decides.

    Raises:
      MapError: people drive on the left.
    """
    found = _Map(file)
    evidence = list(found.evidence())
    left, right = ([where for where, side in evidence if side == each] for each in (LEFT, RIGHT))
    if left and len(left) >= len(right):
        raise MapError("network", f"left-hand traffic: {_listed(left, right)}", "right-hand traffic")
    return [f"right-hand traffic: {_listed(right, left)}"] if right else [UNKNOWN]


def _listed(found: Sequence[str], against: Sequence[str]) -> str:
    more = f" (and {len(found) - 1} more like it)" if len(found) > 1 else ""
    return found[0] + more + (f", although {against[0]}" if against else "")


class _Map:
    """Ways, nodes and roads of a map as far as they tell a side."""

    def __init__(self, file: Path) -> None:
        self._told: list[tuple[str, str]] = []  # what tells a side, and which
        self._rings: dict[str, list[str]] = {}  # nodes of each way of a roundabout, in the direction of driving
        self._carriageways = defaultdict[str, list[list[str]]](list)  # nodes of ways in one direction, by their road
        self._nodes: dict[str, tuple[float, float]] = {}
        self._element: tuple[str, str] = ("", "?")
        self._refs: list[str] = []
        self._tags: dict[str, str] = {}
        parser = ParserCreate()
        parser.StartElementHandler, parser.EndElementHandler = self._start, self._end
        try:
            with file.open("rb") as stream:
                parser.ParseFile(stream)
        except (ExpatError, ValueError) as error:
            raise MapError("network", f"the map is broken: {error!r}") from error

    def evidence(self) -> Iterator[tuple[str, str]]:
        """Each piece of evidence, and the side that it speaks for."""
        yield from self._told
        for ways in self._roundabouts():
            if around := _around([self._points(refs) for refs in ways.values()]):
                way, side = ("clockwise", LEFT) if around < 0.0 else ("counter-clockwise", RIGHT)
                yield f"the roundabout way {next(iter(ways))} runs {way}", side
        for name, roads in self._carriageways.items():
            beside = _beside([self._points(refs) for refs in roads if self._nodes.keys() >= set(refs)])
            if beside:
                side = RIGHT if beside > 0 else LEFT
                yield f"the carriageways of {name} are driven on the {side}", side

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        match tag:
            case "way" | "relation" | "node":
                self._element, self._refs, self._tags = (tag, attributes.get("id", "?")), [], {}
                if tag == "node" and attributes.keys() >= {"lat", "lon"}:
                    lat, lon = float(attributes["lat"]), float(attributes["lon"])
                    east_m = lon * M_PER_DEG * math.cos(math.radians(lat))
                    self._nodes[attributes.get("id", "?")] = east_m, lat * M_PER_DEG
            case "road":
                rule = attributes.get("rule", "RHT")
                self._told.append(
                    (f"road {attributes.get('id', '?')} has rule={rule}", LEFT if rule == "LHT" else RIGHT)
                )
            case "nd":
                self._refs.append(attributes.get("ref", ""))
            case "tag":
                self._tags[attributes.get("k", "")] = attributes.get("v", "")

    def _end(self, tag: str) -> None:
        if tag not in ("way", "relation", "node"):
            return
        name, tags = " ".join(self._element), self._tags
        if tags.get("driving_side") in (LEFT, RIGHT):
            self._told.append((f"{name} has driving_side={tags['driving_side']}", tags["driving_side"]))
        if tag == "node" and tags.get("highway") == "mini_roundabout" and tags.get("direction") in MINI:
            self._told.append((f"the mini-roundabout {name} runs {tags['direction']}", MINI[tags["direction"]]))
        if tag == "way" and len(self._refs) > 1:
            self._way(self._element[1], tags)

    def _way(self, id_: str, tags: Mapping[str, str]) -> None:
        ring = tags.get("junction") in RINGS
        oneway = tags.get("oneway", "yes" if ring or tags.get("highway") == "motorway" else "no")
        refs = self._refs[::-1] if oneway == "-1" else self._refs
        if oneway not in ("yes", "true", "1", "-1"):
            return
        if ring:
            self._rings[id_] = refs
        elif road := tags.get("ref") or tags.get("name"):
            self._carriageways[road].append(refs)

    def _roundabouts(self) -> list[dict[str, list[str]]]:
        """The ways of each roundabout: those that have an end in common."""
        found: list[tuple[set[str], dict[str, list[str]]]] = []
        for id_, refs in self._rings.items():
            if self._nodes.keys() >= set(refs):
                ends, ways = {refs[0], refs[-1]}, {id_: refs}
                for other in [each for each in found if each[0] & ends]:
                    found.remove(other)
                    ends, ways = ends | other[0], other[1] | ways
                found.append((ends, ways))
        return [ways for _, ways in found]

    def _points(self, refs: Sequence[str]) -> Floats:
        return np.array([self._nodes[ref] for ref in refs])


def _around(lines: Sequence[Floats]) -> float:
    """Computes the signed area that lines sweep about their middle, m².

    It is above 0 counter-clockwise.
    """
    middle = np.concatenate(lines).mean(axis=0)
    found = 0.0
    for line in lines:
        x, y = (line - middle).T
        found += float((x[:-1] * y[1:] - x[1:] * y[:-1]).sum())
    return found if abs(found) > LEAST_AREA_M2 else 0.0


def _beside(ways: Sequence[Floats]) -> int:
    """Pieces with another one in the other direction on their left, less those with one on their right."""
    pieces = [(a, b) for way in ways for a, b in pairwise(way) if 0.0 < math.dist(a, b) < 500.0]
    if len(pieces) < 2:
        return 0
    start, end = (np.array(each) for each in zip(*pieces, strict=True))
    middle, along = (start + end) / 2, (end - start) / np.linalg.norm(end - start, axis=1, keepdims=True)
    balance = 0
    for i, j in KDTree(middle).query_pairs(APART_M[1]):
        across = middle[j] - middle[i]
        left_m = float(along[i, 0] * across[1] - along[i, 1] * across[0])
        if along[i] @ along[j] < -0.9 and abs(left_m) >= APART_M[0]:
            balance += 1 if left_m > 0.0 else -1
    return balance
