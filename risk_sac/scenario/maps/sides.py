"""On which side people drive on a map in another format, which netconvert does not ask.

In an OpenStreetMap extract, evidence is `driving_side` on a way or a relation, and each roundabout that is one closed
way: it is drawn in the direction of driving, which is clockwise where people drive on the left. A road of OpenDRIVE has
a rule, which is right-hand traffic where it is left out.
Source: https://wiki.openstreetmap.org/wiki/Key:driving_side, https://wiki.openstreetmap.org/wiki/Tag:junction=roundabout,
  ASAM OpenDRIVE, `rule` of `<road>`
"""

from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path
from xml.parsers.expat import ExpatError, ParserCreate

from risk_sac.errors import MapError
from risk_sac.scenario.ground import Point

LEFT, RIGHT = "left", "right"
UNKNOWN = "the map does not say on which side people drive: it is read as right-hand traffic"


def side_remarks(file: Path) -> list[str]:
    """What a user of a map that is read as right-hand traffic should know.

    Choice: where the evidence contradicts itself, as where one road has its sides swapped, most of it decides.

    Raises:
      MapError: people drive on the left; or it is no XML without a document type.
    """
    said = _said(file)
    left = [where for where, side in said if side == LEFT]
    right = [where for where, side in said if side == RIGHT]
    if left and len(left) >= len(right):
        more = f" (and {len(left) - 1} more like it)" if len(left) > 1 else ""
        raise MapError("network", f"left-hand traffic: {left[0]}{more}", "right-hand traffic")
    return [] if right else [UNKNOWN]


def _said(file: Path) -> list[tuple[str, str]]:
    """Each piece of evidence, and the side that it speaks for."""
    ways, nodes = _Ways(), dict[str, Point]()
    _parse(file, ways.start, ways.end)
    wanted = {node for refs in ways.roundabouts.values() for node in refs}

    def note(tag: str, attributes: dict[str, str]) -> None:
        if tag == "node" and attributes.get("id") in wanted:
            nodes[attributes["id"]] = float(attributes["lon"]), float(attributes["lat"])

    if wanted:
        _parse(file, note, lambda _: None)
    found = ways.tagged
    for id_, refs in ways.roundabouts.items():
        area = _area([nodes[ref] for ref in refs]) if nodes.keys() >= set(refs) else 0.0
        if area < 0.0:
            found.append((f"the roundabout way {id_} runs clockwise", LEFT))
        elif area > 0.0:
            found.append((f"the roundabout way {id_} runs counter-clockwise", RIGHT))
    return found


def _area(line: Sequence[Point]) -> float:
    """Twice what a closed line goes round; above 0 where it does so counter-clockwise."""
    x, y = line[0]  # relative to it, so that what is small keeps its digits
    return sum((ax - x) * (by - y) - (bx - x) * (ay - y) for (ax, ay), (bx, by) in pairwise(line))


class _Ways:
    """Ways, relations and roads as far as they say something; told by the parser."""

    def __init__(self) -> None:
        self.tagged: list[tuple[str, str]] = []  # as `_said` has it
        self.roundabouts: dict[str, list[str]] = {}  # the nodes of each way, in the direction of driving
        self._id = ""
        self._nodes: list[str] = []
        self._tags: dict[str, str] = {}

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        match tag:
            case "way" | "relation":
                self._id, self._nodes, self._tags = attributes.get("id", "?"), [], {}
            case "road":
                side = LEFT if attributes.get("rule") == "LHT" else RIGHT
                self.tagged.append((f"road {attributes.get('id', '?')} has rule={attributes.get('rule')}", side))
            case "nd":
                self._nodes.append(attributes.get("ref", ""))
            case "tag":
                self._tags[attributes.get("k", "")] = attributes.get("v", "")

    def end(self, tag: str) -> None:
        if tag not in ("way", "relation"):
            return
        side, oneway = self._tags.get("driving_side"), self._tags.get("oneway", "yes")
        if side in (LEFT, RIGHT):
            self.tagged.append((f"{tag} {self._id} has driving_side={side}", side))
        closed = len(self._nodes) > 3 and self._nodes[0] == self._nodes[-1]
        if tag == "way" and closed and self._tags.get("junction") == "roundabout" and oneway != "no":
            self.roundabouts[self._id] = self._nodes[::-1] if oneway == "-1" else self._nodes


def _parse(file: Path, start: Callable[[str, dict[str, str]], None], end: Callable[[str], None]) -> None:
    parser = ParserCreate()
    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.StartDoctypeDeclHandler = _refuse_doctype
    try:
        with file.open("rb") as stream:
            parser.ParseFile(stream)
    except MapError:
        raise
    except (ExpatError, KeyError, ValueError) as error:
        raise MapError("network", f"{file.name} is no map: {error!r}") from error


def _refuse_doctype(*_: object) -> None:
    raise MapError("network", "a DOCTYPE", "a document without")
