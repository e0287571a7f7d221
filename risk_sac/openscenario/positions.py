"""Positions, and the routes and trajectories that they and actions name."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from itertools import pairwise
from typing import Any

from risk_sac.config.base import Chosen
from risk_sac.config.story_actions import (
    ClothoidSegment,
    ClothoidSpline,
    LanePosition,
    Polyline,
    Position,
    RelativeLanePosition,
    RelativePosition,
    RelativeRoadPosition,
    RoadPosition,
    RoutePath,
    RoutePosition,
    Trajectory,
    TrajectoryPosition,
    Vertex,
    WorldPosition,
)
from risk_sac.openscenario.catalogs import Alternatives, Catalogs, parametrised
from risk_sac.openscenario.entities import Entities
from risk_sac.openscenario.scope import At, Text

DEEPEST = 8  # trajectories whose points lie on others
_READ = "LanePosition, RoadPosition, WorldPosition, RoutePosition, TrajectoryPosition or one relative to an entity"


class Positions:
    """Reads positions, and collects routes and trajectories by name."""

    def __init__(self, catalogs: Catalogs, entities: Entities) -> None:
        """Prepares to read.

        Args:
          catalogs: of routes and trajectories.
          entities: that positions are relative to.
        """
        self.routes: dict[str, RoutePath] = {}
        self.trajectories: dict[str, Trajectory] = {}
        self._catalogs, self._entities = catalogs, entities
        self._depth = 0
        self._readers: Mapping[str, tuple[type[Any], str, Callable[[At], dict[str, Any]]]] = {
            "WorldPosition": (WorldPosition, "world", self._world),
            "LanePosition": (LanePosition, "lane", _lane),
            "RoadPosition": (RoadPosition, "road", lambda at: {"road": at.text("roadId")} | _along(at)),
            "RelativeLanePosition": (RelativeLanePosition, "relative_lane", self._relative_lane),
            "RelativeRoadPosition": (RelativeRoadPosition, "relative_road", self._relative_road),
            "RelativeObjectPosition": (RelativePosition, "relative", self._relative),
            "RelativeWorldPosition": (RelativePosition, "relative", self._relative),
            "RoutePosition": (RoutePosition, "on_route", self._on_route),
            "TrajectoryPosition": (TrajectoryPosition, "on_trajectory", self._on_trajectory),
        }
        """Element → model, its kind, and what reads its fields but the heading."""

    def position(self, at: At) -> Position:
        """Reads the only child of an element `Position`, or of one that takes its place.

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
        model, kind, fields = self._readers[here.tag]
        turned = {} if model is WorldPosition else _turned(here)
        position: Position = here.build(model, kind=kind, **fields(here), **turned)
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

    def _relative_road(self, at: At) -> dict[str, Any]:
        return {"to": self._entities.named(at), "ds_m": at.number("ds"), "dt_m": at.number("dt")}

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

    def _on_trajectory(self, at: At) -> dict[str, Any]:
        return {"trajectory": self.trajectory(at.one("TrajectoryRef"))} | _along(at)

    # Routes

    def route(self, holder: At) -> Text:
        """Collects the route that an element has as a child or names; returns its name."""
        return self._collected(holder, "Route", self.routes, self._route)

    def _route(self, at: At) -> RoutePath:
        waypoints = []
        for waypoint in at.all("Waypoint"):
            waypoint.constant("routeStrategy", "shortest")
            waypoints.append(self.position(waypoint.one("Position")))
        return at.build(RoutePath, waypoints=tuple(waypoints), closed=at.flag("closed", False))

    # Trajectories

    def trajectory(self, holder: At) -> Text:
        """Collects the trajectory that an element has as a child or names; returns its name."""
        return self._collected(holder, "Trajectory", self.trajectories, self._trajectory)

    def _trajectory(self, at: At) -> Trajectory:
        closed = at.flag("closed", False)
        shape = at.one("Shape")
        if (line := shape.maybe("Polyline")) is not None:
            vertices = [self._vertex(vertex) for vertex in line.all("Vertex")]
            _check_times(line, vertices)
            return line.build(Polyline, kind="polyline", vertices=tuple(vertices), closed=closed)
        if (spline := shape.maybe("ClothoidSpline")) is not None:
            end = spline.number_or("timeEnd", None)
            segments = [self._segment(segment) for segment in spline.all("ClothoidSplineSegment", "Segment")]
            return spline.build(ClothoidSpline, kind="clothoids", segments=tuple(segments), end_time_s=end)
        if (clothoid := shape.maybe("Clothoid")) is not None:
            return self._clothoid(clothoid)
        for child in shape.element.children:
            child.use_all()
        raise shape.unread("Polyline, Clothoid or ClothoidSpline", "the trajectory is unknown")

    def _vertex(self, at: At) -> Vertex:
        return at.build(Vertex, position=self.position(at.one("Position")), time_s=at.number_or("time", None))

    def _segment(self, at: At) -> ClothoidSegment:
        start = at.maybe("PositionStart")
        return at.build(
            ClothoidSegment,
            curvature_start=at.number("curvatureStart"),
            curvature_end=at.number("curvatureEnd"),
            length_m=at.number("length"),
            position=self.position(start) if start is not None else None,
            turned_rad=at.number_or("hOffset", 0.0),
            time_s=at.number_or("timeStart", None),
        )

    def _clothoid(self, at: At) -> ClothoidSpline:
        """Reads a clothoid, whose curvature changes by `curvaturePrime` per metre."""
        curvature, length = at.number("curvature"), at.number("length")
        prime = at.number("curvatureDot" if "curvatureDot" in at.element.attributes else "curvaturePrime")
        segment = at.build(
            ClothoidSegment,
            curvature_start=curvature,
            curvature_end=at.combined(curvature, "+", at.combined(prime, "*", length)),
            length_m=length,
            position=self.position(at.one("Position")),
            time_s=at.number_or("startTime", None),
        )
        end = at.number_or("stopTime", None)
        return at.build(ClothoidSpline, kind="clothoids", segments=(segment,), end_time_s=end)

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
    """The heading of an element with a child `Orientation`."""
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
    """Keeps a route or trajectory under its name, or a free one; returns the name."""
    number, unique = 2, name[:190] or "unnamed"
    while unique in into and into[unique] != path:
        unique, number = f"{name[:190]} {number}", number + 1
    into[unique] = path
    return unique


def _check_times(at: At, vertices: list[Vertex]) -> None:
    """Refuses times that go backwards, as far as they are constants, or that only some points have."""
    times = [vertex.time_s for vertex in vertices]
    if any(time is None for time in times) and any(time is not None for time in times):
        raise at.refusal("times at some vertices", "a time at each vertex, or at none")
    for before, after in pairwise(times):
        if isinstance(before, float) and isinstance(after, float) and after < before:
            raise at.refusal(f"the time {after:g} s after {before:g} s", "times that do not go backwards")
