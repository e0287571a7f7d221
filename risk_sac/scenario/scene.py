"""Layout of one scene: actors' starts at given values of the parameters."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple, get_args

from risk_sac.config.scenario import EGO, LONGEST_HORIZON_S, Actor, Driven, Moving, Scenario, Start, Stream
from risk_sac.errors import ConfigError, did_you_mean
from risk_sac.scenario.bodies import BODIES, BodyName, Motion
from risk_sac.scenario.ground import ground_of, kerb_of
from risk_sac.scenario.lane_places import Track, Turn, entry_of, lane_line, lane_named, routed, straight_on
from risk_sac.scenario.layout import LEAD_IN_S, Layout, PedestrianStart, StaticStart, StoryPlan, VehicleStart
from risk_sac.scenario.odd import FRICTION
from risk_sac.scenario.space import Value
from risk_sac.scenario.story_scene import StoryScene
from risk_sac.scenario.travel_line import Pose
from risk_sac.world.net import Crossing, Net, NetLane, direction
from risk_sac.world.read_net import DRIVER
from risk_sac.world.types import STEP_S, Point, Role

ROLES = {"adversary": Role.ADVERSARY, "story": Role.STORY, "background": Role.BACKGROUND, "static": Role.STATIC}
CRAWLS_MPS = 1.0  # an ego that starts faster in a story keeps to its first speed, as its file has it; choice
GRID_M = 20.0  # of the places that ground is computed for
UNIT_DIGITS = 12  # of a direction's cosine and sine, so that those of 90 degrees are 0 and 1


class OnTrack(NamedTuple):
    """A place on a track, by the front bumper."""

    track: Track
    lane: NetLane
    before_m: float  # of the track's reference
    lead_in: bool
    begin: bool  # whether the reference is the lane's beginning; else it is its end


def steps_of(horizon_s: float) -> int:
    """Returns an episode's steps; raises `ConfigError` if too few or many."""
    if not 1.0 <= horizon_s <= LONGEST_HORIZON_S:
        raise ConfigError("horizon_s", f"{horizon_s:g}", f"1 to {LONGEST_HORIZON_S:g} s")
    return round(horizon_s / STEP_S)


def body_named(name: str, path: str) -> BodyName:
    """Checks a name against the table of bodies; raises `ConfigError` if unknown."""
    if name not in BODIES:
        raise ConfigError(path, repr(name), f"one of {', '.join(BODIES)}", did_you_mean(name, list(BODIES)))
    return name  # type: ignore[return-value] # mypy narrows no string by a mapping's keys


def motion_of(document: Scenario, name: str, body: BodyName) -> Motion:
    """Returns how an actor of a document moves with a body."""
    actor = document.actors.get(name)
    if actor is None:
        return "lanes"
    return "not" if actor.role == "static" else actor.moves or BODIES[body].moves[0]


def _after(route: tuple[str, ...] | None, lane: str) -> tuple[str, ...]:
    return route[route.index(lane) + 1 :] if route and lane in route else ()


class SceneLayout:
    """One scene of a document while its layout is made."""

    def __init__(self, document: Scenario, value: Value, file: str, net: Net, longest_s: float) -> None:
        """Prepares; roads lead on for `longest_s`, the scenario's longest episode."""
        self._value, self._document, self._file, self._net = value, document, file, net
        self._driven_s = longest_s + LEAD_IN_S
        self._placed: dict[str, OnTrack] = {}
        self._bodies: dict[str, BodyName] = {}
        self._speeds: dict[str, float] = {}
        self._has_lead_in = document.story is None

    @cached_property
    def _story(self) -> StoryScene:
        return StoryScene(self._document, self._value, self._file, self._net)

    def layout(self) -> Layout:
        """Places all actors; raises `ConfigError` with the path of a misfit."""
        document, value = self._document, self._value
        actors = {name: actor for name, actor in document.actors.items() if not actor.when or value.true(actor.when)}
        self._bodies = {EGO: body_named(value.word(document.ego.body), "ego.body")}
        self._bodies |= {name: body_named(value.word(one.body), f"actors.{name}.body") for name, one in actors.items()}
        ego = self._vehicle(EGO, Role.EGO, document.ego)
        vehicles, pedestrians, statics = list[VehicleStart](), list[PedestrianStart](), list[StaticStart]()
        for name, actor in actors.items():
            role = ROLES[actor.role]
            motion = motion_of(document, name, self._bodies[name])
            if motion == "freely":
                pedestrians.append(self._pedestrian(name, role, actor))
            elif motion == "not":
                statics.append(self._static(name, actor))
            else:
                start = self._vehicle(name, role, actor)
                vehicles.append(replace(start, uses_oncoming=actor.uses_oncoming))
        vehicles += [start for name, stream in document.streams.items() for start in self._stream(name, stream)]
        places = [(p.x_m, p.y_m) for p in pedestrians] or [self._placed[EGO].lane.line[-1]]
        ground = ground_of(self._file, tuple(map(_on_grid, places)), walked=bool(pedestrians))
        signal = self._signal()
        return Layout(
            net=self._file,
            ego=ego,
            vehicles=tuple(vehicles),
            pedestrians=tuple(pedestrians),
            statics=tuple(statics),
            **ground._asdict(),
            lane_width_m=self._placed[EGO].lane.width_m,
            signal=signal,
            signal_offset_s=value.of(document.signal.offset_s, "signal.offset_s") if signal else 0.0,
            friction=self._friction(),
            horizon_steps=steps_of(value.of(document.horizon_s, "horizon_s")),
            wary=document.wary,
            set_speed_mps=self._set_speed_mps(ego),
            story=None if document.story is None else self._plan((ego, *vehicles), pedestrians, statics),
        )

    def _plan(
        self, vehicles: Sequence[VehicleStart], pedestrians: Sequence[PedestrianStart], statics: Sequence[StaticStart]
    ) -> StoryPlan:
        """Returns what the document's story needs, without streams."""
        own = {start.id: start for start in vehicles if start.id in self._bodies}
        for vehicle in own.values():
            self._story.put_vehicle(vehicle)
        bodies: list[PedestrianStart | StaticStart] = [*pedestrians, *statics]
        for body in bodies:
            self._story.put(body.id, Pose(body.x_m, body.y_m, body.heading_rad), body.body)
        walking = {start.id: start.speed_mps for start in pedestrians}
        moves = {name: name in walking for name in (*own, *walking)}
        return self._story.plan(self._bodies, self._speeds | walking, moves, own[EGO])

    def _set_speed_mps(self, ego: VehicleStart) -> float:
        """Returns the ego's set speed; infinite if only the limits bound it."""
        document = self._document
        if document.set_speed is not None:
            speed_mps = self._value.of(document.set_speed, "set_speed")
            if speed_mps <= 0.0:
                raise ConfigError("set_speed", f"{speed_mps:g}", "more than 0 m/s", "leave it out")
            return speed_mps
        return ego.speed_mps if document.story is not None and ego.speed_mps > CRAWLS_MPS else math.inf

    def _friction(self) -> float:
        friction = self._value.of(self._document.friction, "friction")
        if not FRICTION.low <= friction <= FRICTION.high:
            wanted = f"{FRICTION.low:g} to {FRICTION.high:g}"
            raise ConfigError("friction", f"{friction:g}", wanted, "bound it with min or max")
        return friction

    def _track(self, lane: str, driven: Driven, path: str, *, begin: bool) -> OnTrack:
        """Returns an actor's track from a lane's beginning or end; `before_m` 0."""
        value, net = self._value, self._net
        route, turn = value.choose(driven.route), value.word(driven.turn)
        if turn is not None and turn not in get_args(Turn):
            known = get_args(Turn)
            raise ConfigError(f"{path}.turn", repr(turn), f"one of {', '.join(known)}", did_you_mean(turn, known))
        field = f"{path}.lane" if isinstance(driven, Stream) else f"{path}.start.lane"
        here = lane_named(net, lane, field, turn or _after(route, lane), self._classes(driven))
        reference_m = 0.0 if begin else here.length_m
        if route is not None:
            track = routed(net, here, reference_m, route, f"{path}.route")
        else:
            metres = here.limit_mps * self._driven_s + reference_m
            track = straight_on(net, here, reference_m, metres, turn, f"{path}.turn")
        return OnTrack(track, here, 0.0, True, begin)

    def _classes(self, driven: Driven) -> tuple[str, ...] | None:
        """Returns SUMO's classes, one of which a start's lane must admit."""
        if isinstance(driven, Actor) and driven.role in ("adversary", "static"):
            return None
        body = self._value.word(driven.body)
        own = DRIVER if driven is self._document.ego or body not in BODIES else BODIES[body].sumo_class
        return tuple(dict.fromkeys((DRIVER, own)))

    def _vehicle(self, name: str, role: Role, moving: Moving) -> VehicleStart:
        path = name if name == EGO else f"actors.{name}"
        start = moving.start
        self._speeds[name] = speed_mps = self._value.of(moving.speed, f"{path}.speed")
        if start.position is not None:
            return self._vehicle_at(name, role, moving, path)
        self._placed[name] = place = self._place(name, moving, path)
        self._refuse(start, ("heading_deg", "setback_m", "offset_m"), path, "write `moves: freely`, or leave it out")
        left_m, width_m = self._value.of(start.left_m, f"{path}.start.left_m"), place.lane.width_m
        if not abs(left_m) <= width_m / 2:
            wanted = f"at most half of {place.lane.id!r}, {width_m / 2:g} m"
            raise ConfigError(f"{path}.start.left_m", f"{left_m:g}", wanted, "lanes_left, or a start on another lane")
        started = _started(name, role, place, speed_mps, self._bodies[name])
        return replace(started, left_m=left_m, size_m=self._size_m(name))

    def _vehicle_at(self, name: str, role: Role, moving: Moving, path: str) -> VehicleStart:
        """A vehicle that starts at a position of the road file."""
        spot = self._story.front_spot(name, self._bodies[name])
        lane, left_m = spot.lane, spot.left_m
        at_m = min(max(spot.at_m * lane.length_m / lane_line(lane).length_m, 0.0), lane.length_m)
        if lane.use == "inside":  # SUMO inserts no vehicle there: it enters before, and the story puts it into place
            entry = entry_of(self._net, lane)
            if role is not Role.STORY or entry is None:
                got = f"a place inside junction {lane.edge!r}"
                raise ConfigError(f"{path}.start.position", got, "a place on a road")
            lane, at_m, left_m = entry, entry.length_m, 0.0
        if moving.route is None and moving.turn is None:
            metres = lane.limit_mps * self._driven_s
            moving = moving.model_copy(update={"route": self._story.route(name, lane, metres)})
        place = self._track(lane.id, moving, path, begin=True)._replace(before_m=-at_m, lead_in=False)
        self._placed[name] = place
        start = _started(name, role, place, self._speeds[name], self._bodies[name])
        return replace(start, left_m=left_m, speed_mps=self._speeds[name], size_m=self._size_m(name))

    def _refuse(self, start: Start, fields: Sequence[str], path: str, remedy: str) -> None:
        """Refuses fields of a start that would have no effect."""
        for field in fields:
            if (stated := self._value.of(getattr(start, field), f"{path}.start.{field}")) != 0.0:
                raise ConfigError(f"{path}.start.{field}", f"{stated:g}", "0 for an actor that moves so", remedy)

    def _place(self, name: str, moving: Moving, path: str) -> OnTrack:
        start, of = moving.start, self._value.of
        if (other := start.reference) is not None:
            if other not in self._placed:
                wanted = "an actor that is there and comes before it"
                raise ConfigError(f"{path}.start", f"a start relative to {other!r}", wanted)
            there = self._placed[other]
            place = self._beside(there, moving, path)
            if start.ahead_of is not None:
                before_m = there.before_m - (of(start.gap_m or 0.0, f"{path}.start.gap_m") + self._length_m(name))
            elif start.behind is not None:
                before_m = there.before_m + (of(start.gap_m or 0.0, f"{path}.start.gap_m") + self._length_m(other))
            else:
                before_m = there.before_m - of(start.ahead_m or 0.0, f"{path}.start.ahead_m")
            lead_in = (there.lead_in if start.lead_in is None else start.lead_in) and self._has_lead_in
            return place._replace(before_m=before_m, lead_in=lead_in)
        if start.lane is None:
            raise ConfigError(f"{path}.start", "no lane", f"a lane, since a {self._bodies[name]} drives on one")
        begin = start.at_m is not None
        place = self._track(self._value.choose(start.lane), moving, path, begin=begin)
        if start.before is not None:
            self._check_reference(place.lane, start.before, f"{path}.start.before")
        if begin:
            before_m = -of(start.at_m or 0.0, f"{path}.start.at_m")
            if not 0.0 <= -before_m <= place.lane.length_m:
                wanted = f"0 to {place.lane.length_m:g}"
                raise ConfigError(f"{path}.start.at_m", f"{-before_m:g} m along {place.lane.id!r}", wanted)
        else:
            before_m = of(start.distance_m or 0.0, f"{path}.start.distance_m")
            if not 0.0 <= before_m <= place.track.room_m:
                got = f"{before_m:g} m before the end of {place.lane.id!r}"
                raise ConfigError(f"{path}.start.distance_m", got, f"0 to {place.track.room_m:g}")
        return place._replace(before_m=before_m, lead_in=start.lead_in is not False and self._has_lead_in)

    def _beside(self, there: OnTrack, moving: Moving, path: str) -> OnTrack:
        """Returns the track from another actor's reference lane, or one beside it."""
        left = round(self._value.of(moving.start.lanes_left, f"{path}.start.lanes_left"))
        lane = self._net.lanes.get(f"{there.lane.edge}_{there.lane.index + left}")
        classes = self._classes(moving)
        if lane is None or not lane.admits(classes):
            got = f"{left} lanes left of {there.lane.id!r}"
            wanted = f"a lane of {there.lane.edge!r} for {' or '.join(classes or ('vehicles',))}"
            raise ConfigError(f"{path}.start.lanes_left", got, wanted)
        if left == 0 and moving.route is None and moving.turn is None:
            return there
        return self._track(lane.id, moving, path, begin=there.begin)

    def _check_reference(self, lane: NetLane, reference: str, path: str) -> None:
        if reference == "crossing":
            self._crossing(lane.edge, path)
        elif reference == "stop_line" and not any(link.signal for link in self._net.onward.get(lane.id, ())):
            raise ConfigError(path, f"the stop line of lane {lane.id!r}, which has no signal", "junction or lane_end")

    def _crossing(self, edge: str, path: str) -> Crossing:
        crossings = self._net.crossings_of.get((self._net.edges[edge].end, edge)) if edge in self._net.edges else None
        if not crossings:
            edges = sorted({edge for crossing in self._net.crossings for edge in crossing.edges})
            wanted = f"an edge that a crossing crosses at its end: {', '.join(edges) or 'there is none'}"
            raise ConfigError(path, repr(edge), wanted)
        return crossings[0]

    def _length_m(self, name: str) -> float:
        return BODIES[self._bodies[name]].sized(self._size_m(name)).length_m

    def _size_m(self, name: str) -> tuple[float, float] | None:
        moving = self._document.ego if name == EGO else self._document.actors[name]
        box = self._value.choose(moving.box)
        return None if box is None else (box.length_m, box.width_m)

    def _pedestrian(self, name: str, role: Role, actor: Moving) -> PedestrianStart:
        path, start = f"actors.{name}", actor.start
        speed_mps = self._value.of(actor.speed, f"{path}.speed")
        if start.position is not None:
            pose, body = self._story.middle(name, self._bodies[name]), self._bodies[name]
            size_m = self._size_m(name)
            return PedestrianStart(id=name, role=role, **pose._asdict(), speed_mps=speed_mps, body=body, size_m=size_m)
        x_m, y_m, along_x, along_y = self._facing(start, path)
        setback_m = self._value.of(start.setback_m, f"{path}.start.setback_m")
        offset_m = self._value.of(start.offset_m, f"{path}.start.offset_m")
        lead_m = LEAD_IN_S * speed_mps if start.lead_in is not False and self._has_lead_in else 0.0
        return PedestrianStart(
            id=name,
            role=role,
            x_m=x_m - along_x * setback_m - along_x * lead_m + along_y * offset_m,
            y_m=y_m - along_y * setback_m - along_y * lead_m - along_x * offset_m,
            heading_rad=math.atan2(along_y, along_x),
            speed_mps=speed_mps,
            body=self._bodies[name],
            size_m=self._size_m(name),
        )

    def _static(self, name: str, actor: Moving) -> StaticStart:
        path, body = f"actors.{name}", self._bodies[name]
        self._refuse(actor.start, ("setback_m", "offset_m"), path, "state left_m or another place")
        if actor.start.position is not None:
            x_m, y_m, heading_rad = self._story.middle(name, body)
        elif actor.start.reference is None:
            x_m, y_m, along_x, along_y = self._facing(actor.start, path)
            heading_rad = math.atan2(along_y, along_x)
        else:
            self._speeds[name], self._placed[name] = 0.0, self._place(name, actor, path)
            _, piece, front_m = self._placed[name].track.start(self._placed[name].before_m)
            lane = self._net.lanes[f"{piece.edge}_{piece.lane}"]
            x_m, y_m, heading_rad = _point_of(lane, max(front_m - self._length_m(name) / 2, 0.0))
            left_m = self._value.of(actor.start.left_m, f"{path}.start.left_m")
            x_m, y_m = x_m - math.sin(heading_rad) * left_m, y_m + math.cos(heading_rad) * left_m
            heading_rad += math.radians(self._value.of(actor.start.heading_deg, f"{path}.start.heading_deg"))
        return StaticStart(id=name, x_m=x_m, y_m=y_m, heading_rad=heading_rad, body=body, size_m=self._size_m(name))

    def _facing(self, start: Start, path: str) -> tuple[float, float, float, float]:
        """Returns a point, and the unit vector that an actor faces there."""
        of, path = self._value.of, f"{path}.start"
        turned = math.radians(of(start.heading_deg, f"{path}.heading_deg"))
        if start.crossing is not None:
            edge = self._value.choose(start.crossing)
            crossing = self._crossing(edge, f"{path}.crossing")
            driven = self._net.edges[edge].drivable[-1].way_out_rad + (math.pi if start.side == "left" else 0.0)
            return kerb_of(self._net, crossing, driven)
        if start.x_m is not None and start.y_m is not None:
            return of(start.x_m, f"{path}.x_m"), of(start.y_m, f"{path}.y_m"), *_unit(turned)
        if start.lane is None:
            raise ConfigError(path, "a start relative to another actor", "a crossing, a point or a lane")
        lane = lane_named(self._net, self._value.choose(start.lane), f"{path}.lane", classes=None)
        if start.at_m is not None:
            at_m = of(start.at_m, f"{path}.at_m")
        else:
            at_m = lane.length_m - of(start.distance_m or 0.0, f"{path}.distance_m")
        if not 0.0 <= at_m <= lane.length_m:
            raise ConfigError(f"{path}.at_m", f"{at_m:g} m along {lane.id!r}", f"0 to {lane.length_m:g}")
        x_m, y_m, along_rad = _point_of(lane, at_m)
        left_m = of(start.left_m, f"{path}.left_m")
        x_m, y_m = x_m - math.sin(along_rad) * left_m, y_m + math.cos(along_rad) * left_m
        return x_m, y_m, *_unit(along_rad + turned)

    def _stream(self, name: str, stream: Stream) -> Iterator[VehicleStart]:
        """Its vehicles, which start clear of each other.

        One too close to another on its lane starts behind that, or is left out without room.
        """
        value, path = self._value, f"streams.{name}"
        body = body_named(value.word(stream.body), f"{path}.body")
        gap_m, speed_mps = value.of(stream.gap_m, f"{path}.gap_m"), value.of(stream.speed, f"{path}.speed")
        from_m, lanes = value.of(stream.from_m, f"{path}.from_m"), value.choose(stream.lane)
        lanes = (lanes,) if isinstance(lanes, str) else lanes
        tracks = [self._track(lane, stream, path, begin=False) for lane in lanes]
        for i in range(stream.count):
            leads_in = stream.lead_in and self._has_lead_in
            place = tracks[i % len(tracks)]._replace(lead_in=leads_in)
            before_m = from_m + (i + 1) * gap_m
            taken = [_taken_m(at_m, mps, speed_mps, stream.clear_m) for at_m, mps in self._on(place.track)]
            while crowded := [last_m for first_m, last_m in taken if first_m < before_m < last_m]:
                before_m = max(crowded)
            lead_m = LEAD_IN_S * speed_mps if leads_in else 0.0
            if before_m + BODIES[body].length_m + lead_m <= place.track.room_m:
                place = place._replace(before_m=before_m)
                self._placed[f"{name}_{i}"], self._speeds[f"{name}_{i}"] = place, speed_mps
                yield _started(f"{name}_{i}", Role.BACKGROUND, place, speed_mps, body)

    def _on(self, track: Track) -> Iterator[tuple[float, float]]:
        """Yields the distance before reference, and speed, of vehicles on a track."""
        reach_m = {(piece.edge, piece.lane): piece.reach_m for piece in track.pieces}
        for name, place in self._placed.items():
            _, piece, _ = place.track.start(place.before_m)
            if (piece.edge, piece.lane) in reach_m:
                yield place.before_m + (reach_m[piece.edge, piece.lane] - piece.reach_m), self._speeds[name]

    def _signal(self) -> str | None:
        named = self._document.signal.id
        if named is not None and named not in self._net.programs:
            known = ", ".join(self._net.programs) or "the net has none"
            raise ConfigError("signal.id", repr(named), "a traffic light of the net", f"known: {known}")
        edges = self._placed[EGO].track.edges
        links = (link for leading in self._net.onward.values() for link in leading)
        lit = {(link.source.edge, link.target.edge): link.signal for link in links if link.signal}
        met = (lit.get(pair) for pair in pairwise(edges))
        only = next(iter(self._net.programs), None) if len(self._net.programs) == 1 else None
        return named or next(filter(None, met), only)


def _started(name: str, role: Role, place: OnTrack, speed_mps: float, body: BodyName) -> VehicleStart:
    lead_m = LEAD_IN_S * speed_mps if place.lead_in else 0.0
    route, piece, position_m = place.track.start(place.before_m, lead_m)
    return VehicleStart(
        id=name,
        role=role,
        route=route,
        lane=piece.lane,
        position_m=position_m,
        speed_mps=min(speed_mps, piece.limit_mps),  # SUMO refuses a faster start
        body=body,
    )


def _taken_m(other_m: float, other_mps: float, speed_mps: float, clear_m: float) -> tuple[float, float]:
    """Returns the range where a stream's vehicle is too close to another."""
    least_m, gains_m = BODIES["car"].length_m + clear_m, LEAD_IN_S * (other_mps - speed_mps)
    return other_m - least_m + min(gains_m, 0.0), other_m + least_m + max(gains_m, 0.0)


def _unit(angle_rad: float) -> tuple[float, float]:
    return round(math.cos(angle_rad), UNIT_DIGITS), round(math.sin(angle_rad), UNIT_DIGITS)


def _point_of(lane: NetLane, at_m: float) -> tuple[float, float, float]:
    """A point of a lane's middle, and the lane's direction there."""
    for a, b in pairwise(lane.line):
        length_m = math.dist(a, b)
        if at_m <= length_m or b == lane.line[-1]:
            share = at_m / length_m
            return a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1]), direction(a, b)
        at_m -= length_m
    raise AssertionError("a lane has two points")


def _on_grid(place: tuple[float, float]) -> Point:
    """So that scenes share their ground."""
    return round(place[0] / GRID_M) * GRID_M, round(place[1] / GRID_M) * GRID_M
