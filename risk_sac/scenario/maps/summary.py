"""Summarises a net, with remarks for finding places on it."""

from collections import defaultdict
from collections.abc import Set
from dataclasses import dataclass

from risk_sac.scenario.maps.net import Net


@dataclass(frozen=True, slots=True)
class Summary:
    """Contents of a net; edges and lanes are those outside junctions."""

    edges: int
    junctions: int
    lanes: int
    length_m: float  # of the edges, each counted once however many lanes it has
    bounding_box: tuple[float, float, float, float]  # of the lanes: west, south, east, north, m


def summary(net: Net) -> Summary:
    """Counts and extent of a net that has an edge at least."""
    lanes = [lane for edge in net.edges.values() for lane in edge.lanes]
    x, y = zip(*(point for lane in lanes for point in lane.line), strict=True)
    return Summary(
        edges=len(net.edges),
        junctions=len(net.junctions),
        lanes=len(lanes),
        length_m=round(sum(edge.lanes[0].length_m for edge in net.edges.values() if edge.lanes), 3),
        bounding_box=(min(x), min(y), max(x), max(y)),
    )


def net_remarks(net: Net) -> list[str]:
    """Reasons why no pattern fits on a net, or only few places can be found."""
    found = []
    driven = {edge.id for edge in net.edges.values() if edge.drivable}
    if not driven:
        found.append("no edge has a lane for passenger cars: no pattern will fit")
    if net.keeps_left:
        found.append("traffic keeps to the left: no pattern will fit")
    if not net.cycles_s:
        found.append("there are no traffic lights")
    if not net.onward and _roads_meet(net):
        found.append("there are no connections, although roads meet: no lane leads on to another")
    elif (largest := _largest_part(driven, net)) < len(driven):
        found.append(f"roads are disconnected: the largest part has {largest} of {len(driven)} edges for cars")
    return found


def _roads_meet(net: Net) -> bool:
    """Tells whether any road leads to another, except back from a dead end."""
    leaving = defaultdict(set)
    for edge in net.edges.values():
        if edge.drivable:
            leaving[edge.start].add(edge.end)
    return any(leaving[edge.end] - {edge.start} for edge in net.edges.values() if edge.drivable)


def _largest_part(driven: Set[str], net: Net) -> int:
    """Edges in the largest part whose edges are connected, whichever way, or are two directions of one road."""
    pairs = [(link.source.edge, link.target.edge) for links in net.onward.values() for link in links]
    directions = {(net.edges[id_].start, net.edges[id_].end): id_ for id_ in driven}
    pairs += [(id_, directions[b, a]) for (a, b), id_ in directions.items() if (b, a) in directions]
    beside = defaultdict(list)
    for one, other in pairs:
        beside[one].append(other)
        beside[other].append(one)
    largest, left = 0, set(driven)
    while left:
        part = [left.pop()]
        for id_ in part:  # grows meanwhile
            new = left.intersection(beside[id_])
            left -= new
            part += new
        largest = max(largest, len(part))
    return largest
