"""Writes ASAM OpenSCENARIO XML 1.2 on an OpenDRIVE road.

A vehicle's place is that of its rear axle's middle on the ground. All actors but the ego follow their trajectory by the
clock; the ego is free, and is asked to drive where it was going. In the other file the ego follows its trajectory too.
"""

import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from datetime import datetime
from typing import Any

import numpy as np
from scenariogeneration import xosc

from risk_sac.failures.export.formats import BESIDE, Files, beside, document
from risk_sac.failures.export.opendrive import opendrive
from risk_sac.failures.export.recorded import ExportedActor, Recorded, cycle, goal
from risk_sac.failures.net import colour
from risk_sac.scenario import library
from risk_sac.scenario.bodies import Body
from risk_sac.scenario.interpret import Interpreter
from risk_sac.scenario.reading import nets_of
from risk_sac.world.types import STEP_S, Point

VERSION = 2  # of OpenSCENARIO 1
FREE, AS_RECORDED, ROADS = "failure.xosc", "failure-as-recorded.xosc", "roads.xodr"
LACKS = (
    "requirements and how far each was kept",
    "what the ego sees",
    "signals of pedestrian crossings",
    "friction",
    "the ego's driver",
)
MADE = datetime(2000, 1, 1)  # a date is required; with a true one the same failure would be another file
REAR_AXLE, FRONT_AXLE = 0.3, 0.3  # of a body's length, from its middle
# Diameter of the wheels and width between them, m.
WHEELS_M = {"car": (0.7, 1.6), "two_wheels": (0.6, 0.1), "other": (1.0, 2.0)}
FASTEST_MPS, ACCEL_MPS2, DECEL_MPS2 = 60.0, 10.0, 12.0  # a body's; players check what they drive against it
LAST_S = 20.0  # that a free ego may take


@dataclass(frozen=True)
class World:
    """Road file of a failure, and names of its actors and bodies."""

    road: str
    content: bytes
    shift_m: Point = (0.0, 0.0)
    """The net's coordinates less those of the road file."""
    names: Mapping[str, str] = field(default_factory=dict)
    """Actor → its name; another keeps its id."""
    entries: Mapping[str, str] = field(default_factory=dict)
    """Actor → name of its body; another has that of the table."""

    def moved(self, actor: ExportedActor) -> ExportedActor:
        """Returns an actor with its name and place in the file."""
        x, y = self.shift_m
        return replace(actor, id=self.names.get(actor.id, actor.id), x_m=actor.x_m - x, y_m=actor.y_m - y)


def files(failure: Recorded) -> Files:
    """Two scenarios, the roads, and what neither can say."""
    world = own_world(failure) or World(ROADS, opendrive(failure.net, failure.name))
    return {
        FREE: _scenario(failure, world, free=True),
        AS_RECORDED: _scenario(failure, world, free=False),
        world.road: world.content,
        BESIDE: beside(failure, LACKS),
    }


def own_world(failure: Recorded) -> World | None:
    """Returns road and names of an imported scenario's file; None for others."""
    family = failure.manifest.spec.family
    if not library.KEPT.fullmatch(family):
        return None
    document, folder = library.kept(family)
    if document.origin is None or document.road is None:
        return None
    value = Interpreter(document, nets_of(document, folder)).value(failure.manifest.episode.scene)
    road = str(value.word(document.road))
    entries = {name: entry.rpartition("/")[2] for name, entry in document.origin.entries.items()}
    content = (folder / road).read_bytes()
    return World(road, content, failure.net.shift_m, document.origin.actors, entries)


def _scenario(failure: Recorded, world: World, *, free: bool) -> bytes:
    end_s = failure.time_s[-1] + (LAST_S if free else 0.0)
    entities, init = xosc.Entities(), xosc.Init()
    actors = [world.moved(actor) for actor in failure.actors]
    for actor, own in zip(actors, failure.actors, strict=True):
        entities.add_scenario_object(actor.id, _body(actor, world.entries.get(own.id, actor.body.name)))
        init.add_init_action(actor.id, xosc.TeleportAction(_place(actor, 0)))
        init.add_init_action(actor.id, _speed(actor))
    if free:
        x, y, heading = goal(failure)[1]
        (z,) = failure.net.heights_m(np.array([(x, y)]))
        there = xosc.WorldPosition(x - world.shift_m[0], y - world.shift_m[1], z, heading, 0, 0)
        init.add_init_action(actors[0].id, xosc.AcquirePositionAction(there))
    act = xosc.Act("recorded", _at("begins", 0.0))
    for actor in actors[1:] if free else actors:
        act.add_maneuver_group(_group(actor, leaves=len(actor.time_s) < failure.frames))
    board = xosc.StoryBoard(init, _at("ends", end_s, "stop"))
    board.add_act(act)
    scenario = xosc.Scenario(
        f"{failure.name}, the ego {'free' if free else 'as recorded'}; {BESIDE} has what is not in this file",
        "RISK-SAC",
        xosc.ParameterDeclarations(),
        entities,
        board,
        _roads(failure, world),
        xosc.Catalog(),
        osc_minor_version=VERSION,
        creation_date=MADE,
    )
    return document(scenario.get_element())


def _roads(failure: Recorded, world: World) -> xosc.RoadNetwork:
    network = xosc.RoadNetwork(world.road)
    drawn = set[str | None]()
    if world.road == ROADS:  # signals of another file have other names
        drawn = {signal.get("id") for signal in ET.fromstring(world.content).iter("signal")}
    for id_ in failure.heads if drawn else ():
        controller = xosc.TrafficSignalController(id_)
        for number, (steps, letters) in enumerate(cycle(failure, id_)):
            phase = xosc.Phase(f"{id_}-{number}", steps * STEP_S)
            for index, letter in enumerate(letters):
                if f"{id_}_{index}" in drawn:
                    phase.add_signal_state(f"{id_}_{index}", colour(letter))
            controller.add_phase(phase)
        network.add_traffic_signal_controller(controller)
    return network


def _body(actor: ExportedActor, name: str) -> xosc.Vehicle | xosc.Pedestrian | xosc.MiscObject:
    body, height = actor.body, actor.body.height_m
    if body.shape in ("person", "block"):
        box = xosc.BoundingBox(actor.width_m, actor.length_m, height, 0, 0, height / 2)
        if body.shape == "block":
            return xosc.MiscObject(name, body.mass_kg, _category(xosc.MiscObjectCategory, body), box)
        return xosc.Pedestrian(name, body.mass_kg, _category(xosc.PedestrianCategory, body), box)
    box = xosc.BoundingBox(actor.width_m, actor.length_m, height, REAR_AXLE * actor.length_m, 0, height / 2)
    wheel_m, track_m = WHEELS_M["two_wheels" if body.rides else "car" if body.name == "car" else "other"]
    base_m = (REAR_AXLE + FRONT_AXLE) * actor.length_m
    return xosc.Vehicle(
        name,
        _category(xosc.VehicleCategory, body),
        box,
        xosc.Axle(0.5, wheel_m, track_m, base_m, wheel_m / 2),
        xosc.Axle(0.0, wheel_m, track_m, 0.0, wheel_m / 2),
        FASTEST_MPS,
        ACCEL_MPS2,
        DECEL_MPS2,
    )


def _category(categories: Any, body: Body) -> Any:
    return getattr(categories, body.export.openscenario)


def _place(actor: ExportedActor, frame: int) -> xosc.WorldPosition:
    """Returns the rear axle's middle; of a pedestrian, its own place."""
    heading = float(actor.heading_rad[frame])
    back_m = 0.0 if actor.body.shape in ("person", "block") else REAR_AXLE * actor.length_m
    x, y = actor.x_m[frame] - back_m * np.cos(heading), actor.y_m[frame] - back_m * np.sin(heading)
    return xosc.WorldPosition(float(x), float(y), float(actor.z_m[frame]), heading, 0, 0)


def _speed(actor: ExportedActor) -> xosc.AbsoluteSpeedAction:
    at_once = xosc.TransitionDynamics(xosc.DynamicsShapes.step, xosc.DynamicsDimension.time, 0)
    return xosc.AbsoluteSpeedAction(float(actor.speed_mps[0]), at_once)


def _group(actor: ExportedActor, *, leaves: bool) -> xosc.ManeuverGroup:
    """Returns maneuvers: following the trajectory, and deletion where the actor left."""
    trajectory = xosc.Trajectory(f"{actor.id} recorded", closed=False)
    times = [float(t) for t in actor.time_s]
    trajectory.add_shape(xosc.Polyline(times, [_place(actor, frame) for frame in range(len(times))]))
    follow = xosc.FollowTrajectoryAction(
        trajectory, xosc.FollowingMode.position, xosc.ReferenceContext.absolute, scale=1, offset=0
    )
    maneuver = xosc.Maneuver(f"{actor.id} drives")
    maneuver.add_event(_event(f"{actor.id} follows", follow, 0.0))
    if leaves:
        maneuver.add_event(_event(f"{actor.id} leaves", xosc.DeleteEntityAction(actor.id), times[-1]))
    group = xosc.ManeuverGroup(f"{actor.id} alone")
    group.add_actor(actor.id)
    group.add_maneuver(maneuver)
    return group


def _event(name: str, action: object, from_s: float) -> xosc.Event:
    event = xosc.Event(name, xosc.Priority.parallel)
    event.add_action(name, action)
    event.add_trigger(_at(name, from_s))
    return event


def _at(name: str, time_s: float, point: str = "start") -> xosc.ValueTrigger:
    condition = xosc.SimulationTimeCondition(time_s, xosc.Rule.greaterOrEqual)
    return xosc.ValueTrigger(name, 0, xosc.ConditionEdge.none, condition, triggeringpoint=point)
