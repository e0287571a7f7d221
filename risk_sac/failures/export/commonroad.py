"""CommonRoad XML 2020a: lanelets, lights, trajectories, and the ego's planning problem.

In one file the ego is the planning problem alone; in the other one its recorded trajectory is an obstacle as well.
Source: https://gitlab.lrz.de/tum-cps/commonroad-scenarios, documentation/XML_commonRoad_2020a.pdf
"""

import xml.etree.ElementTree as ET
from collections import defaultdict
from collections.abc import Mapping, Sequence
from itertools import count, groupby
from operator import itemgetter

import numpy as np

from risk_sac.failures.export.formats import BESIDE, Files, add, beside, document
from risk_sac.failures.export.recorded import ExportedActor, Recorded, cycle, goal
from risk_sac.failures.net import boundaries, colour
from risk_sac.world.net import Head, NetLane
from risk_sac.world.types import STEP_S, Floats

FREE, AS_RECORDED = "failure.xml", "failure-as-recorded.xml"
LACKS = (
    "requirements and how far each was kept",
    "what the ego sees",
    "the areas at corners where pedestrians walk between crossings",
    "heights and friction",
    "the ego's driver",
    "when the adversaries were released",
)
MADE = "2000-01-01"  # a date is required; with a true one the same failure would be another file
LANELET_TYPES = {"lane": "urban", "inside": "intersection", "sidewalk": "sidewalk", "crossing": "crosswalk"}
DIRECTIONS = {"s": "straight", "l": "left", "r": "right"}
STATES = {"red": "red", "red_yellow": "redYellow", "yellow": "yellow", "green": "green", "off": "inactive"}
LAST_STEPS = 200  # that a free ego may take after the recording
LANELETS, LIGHTS, ACTORS, PROBLEM = 1, 100_001, 200_001, 300_001  # where numbers begin
Numbers = dict[str | Head, int]
"""A lane's id, or a head of a signal → its number in the file."""


def files(failure: Recorded) -> Files:
    """Returns two scenarios, and what neither can say."""
    return {
        FREE: _scenario(failure, free=True),
        AS_RECORDED: _scenario(failure, free=False),
        BESIDE: beside(failure, LACKS),
    }


def _scenario(failure: Recorded, *, free: bool) -> bytes:
    root = ET.Element(
        "commonRoad",
        commonRoadVersion="2020a",
        benchmarkID=f"ZAM_RiskSac{failure.manifest.key}-1_1_T-{1 if free else 2}",
        date=MADE,
        author="RISK-SAC",
        affiliation=f"failure {failure.name}; {BESIDE} has what is not in this file",
        source="simulated in SUMO",
        timeStepSize=str(STEP_S),
    )
    location = ET.SubElement(root, "location")
    for name, unknown in (("geoNameId", -999), ("gpsLatitude", 999), ("gpsLongitude", 999)):
        add(location, name, unknown)
    tags = ET.SubElement(root, "scenarioTags")
    add(tags, "critical")
    add(tags, "simulated")
    _add_roads(root, failure)
    numbered = list(enumerate(failure.actors, start=ACTORS))
    for number, actor in numbered[1:] if free else numbered:
        _add_obstacle(root, actor, number)
    _add_problem(root, failure)
    return document(root)


def _add_roads(root: ET.Element, failure: Recorded) -> None:
    lanes = failure.net.lanes
    heads = {head: lane for lane in lanes.values() for head in lane.heads}
    numbers: Numbers = dict(zip(lanes, count(LANELETS), strict=False)) | dict(zip(heads, count(LIGHTS), strict=False))
    before = defaultdict(list)
    for lane in lanes.values():
        for name in lane.next:
            before[name].append(lane.id)
    for lane in lanes.values():
        right, left = failure.net.neighbours(lane)
        links = {"predecessor": before[lane.id], "successor": lane.next}
        sides = {"adjacentLeft": left, "adjacentRight": right}
        _add_lanelet(root, lane, numbers, links, sides)
    for head, lane in heads.items():
        _add_light(root, failure, lane, head, numbers[head])


def _add_lanelet(
    root: ET.Element,
    lane: NetLane,
    numbers: Numbers,
    links: Mapping[str, Sequence[str]],
    sides: Mapping[str, NetLane | None],
) -> None:
    lanelet = add(root, "lanelet", id=numbers[lane.id])
    edges = boundaries(lane.centre, lane.width_m)
    for side, edge in zip(("leftBound", "rightBound"), edges, strict=True):
        bound = add(lanelet, side)
        for point in edge:
            _add_point(bound, point)
        add(bound, "lineMarking", "no_marking")
    for name, ids in links.items():
        for id_ in ids:
            add(lanelet, name, ref=numbers[id_])
    for name, beside_it in sides.items():
        if beside_it is not None:
            add(lanelet, name, ref=numbers[beside_it.id], drivingDir="same")
    walks = lane.use in ("sidewalk", "crossing")
    if lane.heads and not walks:
        stop = add(lanelet, "stopLine")
        for edge in edges:
            _add_point(stop, edge[-1])
        add(stop, "lineMarking", "solid")
        _refer_to_lights(stop, lane, numbers)
    add(lanelet, "laneletType", LANELET_TYPES[lane.use])
    add(lanelet, *(("userBidirectional", "pedestrian") if walks else ("userOneWay", "vehicle")))
    _refer_to_lights(lanelet, lane, numbers)


def _refer_to_lights(parent: ET.Element, lane: NetLane, numbers: Numbers) -> None:
    for head in lane.heads:
        add(parent, "trafficLightRef", ref=numbers[head])


def _add_point(parent: ET.Element, place: Floats) -> None:
    point = add(parent, "point")
    for axis, value in zip("xyz", place.tolist(), strict=False):
        add(point, axis, value)


def _add_light(root: ET.Element, failure: Recorded, lane: NetLane, head: Head, number: int) -> None:
    light = add(root, "trafficLight", id=number)
    phases = add(light, "cycle")
    shown = [(steps, STATES[colour(letters[head.index])]) for steps, letters in cycle(failure, head.signal)]
    for state, run in groupby(shown, itemgetter(1)):
        phase = add(phases, "cycleElement")
        add(phase, "duration", sum(steps for steps, _ in run))
        add(phase, "color", state)
    _add_point(add(light, "position"), boundaries(lane.centre, lane.width_m)[1][-1])
    add(light, "direction", DIRECTIONS.get(head.turn, "all"))
    add(light, "active", "true")


def _add_obstacle(root: ET.Element, actor: ExportedActor, number: int) -> None:
    obstacle = add(root, "dynamicObstacle", id=number)
    add(obstacle, "type", actor.body.export.commonroad)
    box = add(add(obstacle, "shape"), "rectangle")
    add(box, "length", actor.length_m)
    add(box, "width", actor.width_m)
    _add_state(add(obstacle, "initialState"), actor, 0)
    trajectory = add(obstacle, "trajectory")
    for frame in range(1, len(actor.time_s)):
        _add_state(add(trajectory, "state"), actor, frame)


def _add_state(state: ET.Element, actor: ExportedActor, frame: int) -> None:
    values = {
        "orientation": np.remainder(actor.heading_rad[frame] + np.pi, 2 * np.pi) - np.pi,  # within ±π
        "velocity": actor.speed_mps[frame],
        "acceleration": actor.accel_mps2[frame],
    }
    if frame == 0:  # the schema wants them of an initial state
        values |= {"yawRate": 0.0, "slipAngle": 0.0}
    add(add(state, "time"), "exact", frame)
    _add_point(add(state, "position"), np.array((actor.x_m[frame], actor.y_m[frame])))
    for name, value in values.items():
        add(add(state, name), "exact", float(value))


def _add_problem(root: ET.Element, failure: Recorded) -> None:
    problem = add(root, "planningProblem", id=PROBLEM)
    _add_state(add(problem, "initialState"), failure.ego, 0)
    reached = add(problem, "goalState")
    time = add(reached, "time")
    add(time, "intervalStart", failure.frames)
    add(time, "intervalEnd", failure.frames + LAST_STEPS)
    number = LANELETS + list(failure.net.lanes).index(goal(failure)[0].id)
    add(add(reached, "position"), "lanelet", ref=number)
