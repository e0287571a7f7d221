"""Positions, and the routes and trajectories that they and actions name."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from itertools import pairwise
from typing import Any

from risk_sac.config import story_actions as places
from risk_sac.config.base import Chosen
from risk_sac.openscenario.entities import Alternatives, Catalogs, Entities, parametrised
from risk_sac.openscenario.scope import At, Text

DEEPEST = 8  # trajectories whose points lie on others
_READ = "LanePosition, RoadPosition, WorldPosition, RoutePosition, TrajectoryPosition or one relative to an entity"


class Positions:
    """Reads positions, and collects routes and trajectories by name."""

    def __init__(self, catalogs: Catalogs, entities: Entities) -> None:
        """Prepares to read."""
        self.routes: dict[str, places.RoutePath] = {}
        self.trajectories: dict[str, places.Trajectory] = {}
        self._catalogs, self._entities = catalogs, entities
        self._depth = 0
        self._readers: Mapping[str, tuple[type[Any], Callable[[At], dict[str, Any]]]] = {
            "WorldPosition": (places.WorldPosition, self._world),
            "LanePosition": (places.LanePosition, _lane),
            "RoadPosition": (places.RoadPosition, lambda at: {"road": at.text("roadId")} | _along(at)),
            "RelativeLanePosition": (places.RelativeLanePosition, self._relative_lane),
            "RelativeRoadPosition": (
                places.RelativeRoadPosition,
                lambda at: {"to": entities.named(at), "ds_m": at.number("ds"), "dt_m": at.number("dt")},
            ),
            "RelativeObjectPosition": (places.RelativePosition, self._relative),
            "RelativeWorldPosition": (places.RelativePosition, self._relative),
            "RoutePosition": (places.RoutePosition, self._on_route),
            "TrajectoryPosition": (
                places.TrajectoryPosition,
                lambda at: {"trajectory": self.trajectory(at.one("TrajectoryRef"))} | _along(at),
            ),
        }
        """Element → model, and what reads its fields but the heading."""

    def position(self, at: At) -> places.Position:
        """Reads the only child of a `Position` or an equivalent element.

        Raises:
          ConfigError: it is wrong.
          Unread: it is of a kind that is not read.
        """
        if not at.element.children:
            raise at.refusal("no position", _READ)
        if not any(child.tag in self._readers for child in at.element.children):
            at.element.children[0].use_all()
            raise At(at.element.children[0], at.scope).unread(_READ, "the place is unknown")
        here = at.one(*self._readers)
        model, fields = self._readers[here.tag]
        turned = {} if model is places.WorldPosition else _turned(here)
        position: places.Position = here.build(model, **fields(here), **turned)
        return position

    def _world(self, at: At) -> dict[str, Any]:
        for name in ("z", "p", "r"):
            at.number_or(name, 0.0)
        heading = at.number_or("h", None if self._depth else 0.0)  # along a path it may be the path's
        return {"x_m": at.number("x"), "y_m": at.number("y"), "heading_rad": heading}

    def _relative_lane(self, at: At) -> dict[str, Any]:
        along_lane = "ds" not in at.element.attributes and "dsLane" in at.element.attributes
        return {
            "to": self._entities.named(at),
            "lanes": at.number("dLane"),
            "ds_m": at.number("dsLane" if along_lane else "ds"),
            "along": "lane" if along_lane else "road",
            "offset_m": at.number_or("offset", 0.0),
        }

    def _relative(self, at: At) -> dict[str, Any]:
        at.number_or("dz", 0.0)
        axes = "actor" if at.tag == "RelativeObjectPosition" else "world"
        return {"to": self._entities.named(at), "dx_m": at.number("dx"), "dy_m": at.number("dy"), "axes": axes}

    def _on_route(self, at: At) -> dict[str, Any]:
        route = {"route": self.route(at.one("RouteRef"))}
        place = at.one("InRoutePosition", "InRoute")
        if (lane := place.maybe("FromLaneCoordinates", "LaneCoordinates")) is not None:
            offset = lane.number_or("laneOffset", 0.0)
            return route | {"s_m": lane.number("pathS"), "lane": lane.number("laneId"), "offset_m": offset}
        if (road := place.maybe("FromRoadCoordinates", "RoadCoordinates")) is not None:
            return route | {"s_m": road.number("pathS"), "t_m": road.number("t")}
        raise place.unread("FromLaneCoordinates or FromRoadCoordinates", "the place is unknown")

    # Routes

    def route(self, holder: At) -> Text:
        """Collects an element's child route or named route; returns its name."""
        return self._collected(holder, "Route", self.routes, self._route)

    def _route(self, at: At) -> places.RoutePath:
        waypoints = []
        for waypoint in at.all("Waypoint"):
            waypoint.constant("routeStrategy", "shortest")
            waypoints.append(self.position(waypoint.one("Position")))
        return at.build(places.RoutePath, waypoints=tuple(waypoints), closed=at.flag("closed", False))

    # Trajectories

    def trajectory(self, holder: At) -> Text:
        """Collects an element's child trajectory or named trajectory; returns its name."""
        return self._collected(holder, "Trajectory", self.trajectories, self._trajectory)

    def _trajectory(self, at: At) -> places.Trajectory:
        closed = at.flag("closed", False)
        shape = at.one("Shape")
        if (line := shape.maybe("Polyline")) is not None:
            vertices = [self._vertex(vertex) for vertex in line.all("Vertex")]
            _check_times(line, vertices)
            return line.build(places.Polyline, vertices=tuple(vertices), closed=closed)
        if (spline := shape.maybe("ClothoidSpline")) is not None:
            end = spline.number_or("timeEnd", None)
            segments = [self._segment(segment) for segment in spline.all("ClothoidSplineSegment", "Segment")]
            return spline.build(places.ClothoidSpline, segments=tuple(segments), end_time_s=end)
        if (clothoid := shape.maybe("Clothoid")) is not None:
            return self._clothoid(clothoid)
        for child in shape.element.children:
            child.use_all()
        raise shape.unread("Polyline, Clothoid or ClothoidSpline", "the trajectory is unknown")

    def _vertex(self, at: At) -> places.Vertex:
        return at.build(places.Vertex, position=self.position(at.one("Position")), time_s=at.number_or("time", None))

    def _segment(self, at: At) -> places.ClothoidSegment:
        start = at.maybe("PositionStart")
        return at.build(
            places.ClothoidSegment,
            curvature_start=at.number("curvatureStart"),
            curvature_end=at.number("curvatureEnd"),
            length_m=at.number("length"),
            position=self.position(start) if start is not None else None,
            turned_rad=at.number_or("hOffset", 0.0),
            time_s=at.number_or("timeStart", None),
        )

    def _clothoid(self, at: At) -> places.ClothoidSpline:
        """Reads a clothoid, whose curvature changes by `curvaturePrime` per metre."""
        curvature, length = at.number("curvature"), at.number("length")
        prime = at.number("curvatureDot" if "curvatureDot" in at.element.attributes else "curvaturePrime")
        segment = at.build(
            places.ClothoidSegment,
            curvature_start=curvature,
            curvature_end=at.combined(curvature, "+", at.combined(prime, "*", length)),
            length_m=length,
            position=self.position(at.one("Position")),
            time_s=at.number_or("startTime", None),
        )
        end = at.number_or("stopTime", None)
        return at.build(places.ClothoidSpline, segments=(segment,), end_time_s=end)

    def _collected(self, holder: At, tag: str, into: dict[str, Any], read: Callable[[At], Any]) -> Text:
        if (inline := holder.maybe(tag)) is not None:
            with self._deeper(inline):
                return _kept(into, inline.constant("name", tag.lower()), read(parametrised(inline, {})))
        reference = holder.one("CatalogReference")
        entries = self._catalogs.alternatives(reference, tag)
        with self._deeper(reference):
            if isinstance(entries, Alternatives):
                names = {word: _kept(into, entry.constant("name"), read(entry)) for word, entry in entries.of.items()}
                return Chosen[str](by=entries.by, of=names)
            return _kept(into, entries.constant("name"), read(entries))

    @contextmanager
    def _deeper(self, at: At) -> Iterator[None]:
        if self._depth >= DEEPEST:
            raise at.refusal(f"more than {DEEPEST} routes and trajectories within each other", "at most that")
        self._depth += 1
        try:
            yield
        finally:
            self._depth -= 1


def _turned(at: At) -> dict[str, Any]:
    if (turn := at.maybe("Orientation")) is None:
        return {}
    for name in ("p", "r"):
        turn.number_or(name, 0.0)
    kinds = {"relative": "relative", "absolute": "absolute"}
    return {"heading_rad": turn.number_or("h", 0.0), "heading": turn.one_of("type", kinds, "absolute")}


def _along(at: At) -> dict[str, Any]:
    return {"s_m": at.number("s"), "t_m": at.number_or("t", 0.0)}


def _lane(at: At) -> dict[str, Any]:
    place = {"lane": at.number("laneId"), "s_m": at.number("s"), "offset_m": at.number_or("offset", 0.0)}
    return {"road": at.text("roadId")} | place


def _kept(into: dict[str, Any], name: str, path: Any) -> str:
    """Keeps a path under its name or a free one; returns that."""
    number, unique = 2, name[:190] or "unnamed"
    while unique in into and into[unique] != path:
        unique, number = f"{name[:190]} {number}", number + 1
    into[unique] = path
    return unique


def _check_times(at: At, vertices: list[places.Vertex]) -> None:
    """Refuses constant times that go backwards, and times of only some points."""
    times = [vertex.time_s for vertex in vertices]
    if any(time is None for time in times) and any(time is not None for time in times):
        raise at.refusal("times at some vertices", "a time at each vertex, or at none")
    for before, after in pairwise(times):
        if isinstance(before, float) and isinstance(after, float) and after < before:
            raise at.refusal(f"the time {after:g} s after {before:g} s", "times that do not go backwards")
