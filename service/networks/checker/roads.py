"""What a net says about its roads, and whether its parts refer to each other."""

from collections.abc import Sequence, Set
from dataclasses import dataclass

from service.errors import UploadError
from service.networks.checker.document import Attributes
from service.networks.checker.values import points
from service.networks.limits import MAX_EDGES, MAX_LANES
from service.networks.report import Summary

_DRIVEN = ("normal", "connector")


@dataclass(slots=True)
class _Edge:
    """An edge as far as it has been read."""

    function: str
    ends: tuple[str, ...]
    lanes: int = 0


class Net:
    """Observes the document of a net."""

    def __init__(self) -> None:
        self.edges: dict[str, _Edge] = {}
        self.lanes: set[str] = set()
        self.junctions: dict[str, str] = {}  # id -> type
        self._open = ""  # the edge whose lanes are being read
        self._references: list[tuple[str, str, str]] = []  # what is named, how it is called, by whom
        self._connections: list[Attributes] = []
        self._length_m = 0.0
        self._cars = self._left = False
        self._box = [float("inf"), float("inf"), float("-inf"), float("-inf")]

    def element(self, tag: str, attributes: Attributes, parent: str) -> None:
        """See `Observer.element`."""
        match tag:
            case "net":
                self._left = attributes.get("lefthand", "false").lower() in ("true", "1")
            case "edge":
                self._edge(attributes)
            case "lane":
                self._lane(attributes)
            case "junction":
                self._junction(attributes)
            case "connection":
                self._connections.append(attributes)
            case "neigh":
                self._references.append(("lane", attributes["lane"], f"<neigh> in edge {self._open!r}"))
            case "roundabout":
                self._refer("edge", attributes["edges"], "<roundabout>")
                self._refer("junction", attributes["nodes"], "<roundabout>")

    def finish(self) -> Summary:
        """Checks what could not be checked before all was read; returns what there is."""
        known = {"edge": self.edges, "lane": self.lanes, "junction": self.junctions}
        for what, name, where in self._references:
            if name not in known[what]:
                raise UploadError(f"{where} names the {what} {name!r}; wanted one that the net has")
        for name, edge in self.edges.items():
            if not edge.lanes:
                raise UploadError(f"edge {name!r} has no lane; wanted one")
        for connection in self._connections:
            self._check_connection(connection)
        driven = [edge for edge in self.edges.values() if edge.function in _DRIVEN]
        if not driven:
            raise UploadError("the net has no edge outside junctions; wanted roads")
        return Summary(
            edges=len(driven),
            junctions=sum(1 for kind in self.junctions.values() if kind != "internal"),
            lanes=sum(edge.lanes for edge in driven),
            length_m=round(self._length_m, 3),
            bounding_box=(self._box[0], self._box[1], self._box[2], self._box[3]),
        )

    def remarks(self) -> list[str]:
        """What whoever wants to drive here should know."""
        found = []
        driven = {name for name, edge in self.edges.items() if edge.function in _DRIVEN}
        if not self._cars:
            found.append("no edge has a lane for passenger cars: no pattern will fit")
        if self._left:
            found.append("traffic keeps to the left: no pattern will fit")
        if not any("tl" in connection for connection in self._connections):
            found.append("there are no traffic lights")
        if not self._connections and len(driven) > 1:
            found.append("there are no connections: no lane leads on to another")
        elif (largest := _largest_part(driven, self._connections)) < len(driven):
            found.append(f"roads are disconnected: the largest part has {largest} of {len(driven)} edges")
        return found

    def _edge(self, attributes: Attributes) -> None:
        name = attributes["id"]
        function = attributes.get("function", "normal")
        if name in self.edges:
            raise UploadError(f"edge {name!r} is there twice; wanted each id once")
        if len(self.edges) == MAX_EDGES:
            raise UploadError(
                f"there are more than {MAX_EDGES} edges, those in junctions included; wanted at most that"
            )
        self._open = name
        ends = tuple(attributes[end] for end in ("from", "to") if end in attributes)
        if function in _DRIVEN and len(ends) != 2:
            raise UploadError(f"edge {name!r} goes from and to {ends}; wanted two junctions")
        self.edges[name] = _Edge(function, ends)
        self._references += [("junction", end, f"edge {name!r}") for end in ends]
        self._refer("edge", attributes.get("crossingEdges", ""), f"edge {name!r}")

    def _lane(self, attributes: Attributes) -> None:
        edge = self.edges[self._open]
        name, shape = attributes["id"], points(attributes["shape"])
        if name in self.lanes:
            raise UploadError(f"lane {name!r} is there twice; wanted each id once")
        if int(attributes["index"]) != edge.lanes or edge.lanes == MAX_LANES:
            raise UploadError(
                f"lane {name!r} has the index {attributes['index']}; wanted {edge.lanes}, the next of its edge"
            )
        if len(shape) < 2:
            raise UploadError(f"lane {name!r} has a shape of {len(shape)} points; wanted two at least")
        if not edge.lanes and edge.function in _DRIVEN:
            self._length_m += float(attributes["length"])
        edge.lanes += 1
        self._cars |= edge.function in _DRIVEN and _admits_cars(attributes)
        self.lanes.add(name)
        for x, y in shape:
            box = self._box
            self._box = [min(box[0], x), min(box[1], y), max(box[2], x), max(box[3], y)]

    def _junction(self, attributes: Attributes) -> None:
        name = attributes["id"]
        if name in self.junctions:
            raise UploadError(f"junction {name!r} is there twice; wanted each id once")
        self.junctions[name] = attributes["type"]
        self._refer("lane", attributes["incLanes"], f"junction {name!r}")
        self._refer("lane", attributes["intLanes"], f"junction {name!r}")

    def _check_connection(self, connection: Attributes) -> None:
        where = f"the connection from {connection['from']!r} to {connection['to']!r}"
        for end in ("from", "to"):
            edge = self.edges.get(connection[end])
            if edge is None:
                raise UploadError(f"{where} names an edge that the net does not have; wanted one that it has")
            index = int(connection[f"{end}Lane"])
            if index >= edge.lanes:
                raise UploadError(f"{where} has {end}Lane {index}; wanted less than {edge.lanes}, the edge's lanes")
        via = connection.get("via")
        if via is not None and via not in self.lanes:
            raise UploadError(f"{where} goes via the lane {via!r}; wanted one that the net has")

    def _refer(self, what: str, names: str, where: str) -> None:
        self._references += [(what, name, where) for name in names.split()]


def _admits_cars(lane: Attributes) -> bool:
    if "allow" in lane:
        return bool({"passenger", "all"} & set(lane["allow"].split()))
    return not {"passenger", "all"} & set(lane.get("disallow", "").split())


def _largest_part(edges: Set[str], connections: Sequence[Attributes]) -> int:
    """Edges in the largest part whose edges are connected, whichever way."""
    beside: dict[str, list[str]] = {name: [] for name in edges}
    for connection in connections:
        one, other = connection["from"], connection["to"]
        if one in beside and other in beside:
            beside[one].append(other)
            beside[other].append(one)
    largest, left = 0, set(edges)
    while left:
        part = [left.pop()]
        for name in part:  # grows meanwhile
            for other in beside[name]:
                if other in left:
                    left.remove(other)
                    part.append(other)
        largest = max(largest, len(part))
    return largest


class Demand:
    """Observes a route or additional file: it may speak only of what the net has."""

    def __init__(self, net: Net) -> None:
        self._known = {
            **dict.fromkeys(("edges", "from", "to", "via", "edge"), ("edge", net.edges)),
            "lane": ("lane", net.lanes),
            **dict.fromkeys(("fromJunction", "toJunction", "viaJunctions"), ("junction", net.junctions)),
        }

    def element(self, tag: str, attributes: Attributes, parent: str) -> None:
        """See `Observer.element`."""
        for name in self._known.keys() & attributes.keys():
            what, known = self._known[name]
            for part in attributes[name].split():
                if part not in known:
                    raise UploadError(f"{name} of <{tag}> names the {what} {part!r}; wanted one that the net has")
