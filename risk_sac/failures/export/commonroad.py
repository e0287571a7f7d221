"""CommonRoad XML, version 2020a: lanelets and traffic lights, everybody's trajectory, and the ego's planning problem.

In one file the ego is the planning problem alone; in the other one its recorded trajectory is an obstacle as well.
"""

import tempfile
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
from commonroad.common.common_lanelet import LaneletType, LineMarking, RoadUser, StopLine
from commonroad.common.common_scenario import ScenarioID
from commonroad.common.file_writer import CommonRoadFileWriter
from commonroad.common.util import FileFormat, Interval
from commonroad.common.writer.file_writer_interface import OverwriteExistingFile
from commonroad.geometry.obstacle_shapes.rect_obstacle_shape import RectObstacleShape
from commonroad.planning.goal import GoalRegion
from commonroad.planning.planning_problem import PlanningProblem, PlanningProblemSet
from commonroad.prediction.prediction import TrajectoryPrediction
from commonroad.scenario.lanelet import Lanelet, LaneletNetwork
from commonroad.scenario.obstacle import DynamicObstacle, ObstacleType
from commonroad.scenario.scenario import Scenario, Tag
from commonroad.scenario.state import CustomState, ExtendedPMState, InitialState
from commonroad.scenario.traffic_light import (
    TrafficLight,
    TrafficLightCycle,
    TrafficLightCycleElement,
    TrafficLightDirection,
    TrafficLightState,
)
from commonroad.scenario.trajectory import Trajectory
from lxml.etree import SerialisationError

from risk_sac.failures.export.beside import BESIDE, beside
from risk_sac.failures.export.formats import Files
from risk_sac.failures.export.markup import document
from risk_sac.failures.export.net import Head, Lane, Net, Use, boundaries
from risk_sac.failures.export.recorded import Actor, Recorded
from risk_sac.failures.export.route import goal
from risk_sac.failures.export.signals import colour, cycle
from risk_sac.types import STEP_S

FREE, AS_RECORDED = "failure.xml", "failure-as-recorded.xml"
LACKS = (
    "requirements and how far each was kept",
    "what the ego sees",
    "the areas at corners where pedestrians walk between crossings",
    "friction",
    "the ego's driver",
    "when the adversaries were released",
)
MADE = "2000-01-01"  # a date is required; with a true one the same failure would be another file
DECIMALS = 6  # µm
LAST_STEPS = 200  # that a free ego may take after the recording
LANELETS, LIGHTS, ACTORS, PROBLEM = 1, 100_001, 200_001, 300_001  # where numbers begin
TYPES: dict[Use, LaneletType] = {
    "road": LaneletType.URBAN,
    "inside": LaneletType.INTERSECTION,
    "sidewalk": LaneletType.SIDEWALK,
    "crossing": LaneletType.CROSSWALK,
}
TURNS = {
    "s": TrafficLightDirection.STRAIGHT,
    "l": TrafficLightDirection.LEFT,
    "r": TrafficLightDirection.RIGHT,
}
STATES = {
    "red": TrafficLightState.RED,
    "red_yellow": TrafficLightState.RED_YELLOW,
    "yellow": TrafficLightState.YELLOW,
    "green": TrafficLightState.GREEN,
    "off": TrafficLightState.INACTIVE,
}


def files(failure: Recorded) -> Files:
    """Two scenarios, and what neither can say.

    Raises:
      OSError: the folder for temporary files refuses them.
    """
    return {
        FREE: _scenario(failure, failure.others),
        AS_RECORDED: _scenario(failure, failure.actors),
        BESIDE: beside(failure, LACKS),
    }


def _scenario(failure: Recorded, driven: tuple[Actor, ...]) -> bytes:
    scenario = Scenario(
        STEP_S, ScenarioID(map_name="RiskSac", configuration_id=1, obstacle_behavior="T", prediction_id=1)
    )
    numbers = {id_: LANELETS + place for place, id_ in enumerate(failure.net.lanes)}
    scenario.add_objects(_roads(failure, numbers))
    scenario.add_objects([_obstacle(actor, ACTORS + failure.actors.index(actor)) for actor in driven])
    writer = CommonRoadFileWriter(
        scenario,
        PlanningProblemSet([_problem(failure, numbers)]),
        author="RISK-SAC",
        affiliation=f"failure {failure.name}; {BESIDE} has what is not in this file",
        source="simulated in SUMO",
        tags={Tag.SIMULATED, Tag.CRITICAL},
        decimal_precision=DECIMALS,
        file_format=FileFormat.XML,
    )
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "scenario.xml"
        try:
            writer.write_to_file(str(file), OverwriteExistingFile.ALWAYS)
        except SerialisationError as error:  # as lxml calls a disk that refuses
            raise OSError(f"{folder} cannot be written: {error}") from error
        root = ET.parse(file).getroot()
    root.set("date", MADE)
    tags = root.find("scenarioTags")
    assert tags is not None  # they are given above
    tags[:] = sorted(tags, key=lambda tag: tag.tag)  # they come from a set, in any order
    return document(root)


def _roads(failure: Recorded, numbers: dict[str, int]) -> LaneletNetwork:
    network, net = LaneletNetwork(), failure.net
    lights: dict[Head, int] = {}
    for lane in net.lanes.values():
        for head in lane.heads:
            lights[head] = LIGHTS + len(lights)
            network.add_traffic_light(_light(failure, lane, head, lights[head]), set())
    before: dict[str, list[int]] = {id_: [] for id_ in net.lanes}
    for lane in net.lanes.values():
        for name in lane.next:
            before[name].append(numbers[lane.id])
    for lane in net.lanes.values():
        mine = {lights[head] for head in lane.heads}
        network.add_lanelet(_lanelet(net, lane, numbers, before[lane.id], mine))
    return network


def _lanelet(net: Net, lane: Lane, numbers: dict[str, int], before: list[int], lights: set[int]) -> Lanelet:
    left, right = boundaries(lane.centre, lane.width_m)
    beside_right, beside_left = net.neighbours(lane)
    walks = lane.use in ("sidewalk", "crossing")
    stop = None
    if lights and not walks:
        stop = StopLine(left[-1], right[-1], LineMarking.SOLID, traffic_light_ref=lights)
    return Lanelet(
        left,
        lane.centre,
        right,
        numbers[lane.id],
        predecessor=before,
        successor=[numbers[name] for name in lane.next],
        adjacent_left=beside_left and numbers[beside_left.id],
        adjacent_left_same_direction=beside_left and True,
        adjacent_right=beside_right and numbers[beside_right.id],
        adjacent_right_same_direction=beside_right and True,
        stop_line=stop,
        lanelet_type={TYPES[lane.use]},
        user_one_way=set() if walks else {RoadUser.VEHICLE},
        user_bidirectional={RoadUser.PEDESTRIAN} if walks else set(),
        traffic_lights=lights,
    )


def _light(failure: Recorded, lane: Lane, head: Head, number: int) -> TrafficLight:
    elements = [
        TrafficLightCycleElement(STATES[colour(letters[head.index])], steps)
        for steps, letters in _merged(cycle(failure, head.signal), head.index)
    ]
    where = boundaries(lane.centre, lane.width_m)[1][-1]
    return TrafficLight(
        number, where, TrafficLightCycle(elements, 0), direction=TURNS.get(head.turn, TrafficLightDirection.ALL)
    )


def _merged(phases: list[tuple[int, str]], index: int) -> list[tuple[int, str]]:
    """The phases of one link: those in which it shows the same colour are one."""
    merged: list[tuple[int, str]] = []
    for steps, letters in phases:
        if merged and colour(merged[-1][1][index]) == colour(letters[index]):
            merged[-1] = (merged[-1][0] + steps, letters)
        else:
            merged.append((steps, letters))
    return merged


def _obstacle(actor: Actor, number: int) -> DynamicObstacle:
    shape = RectObstacleShape(length=actor.length_m, width=actor.width_m)
    kind = ObstacleType.PEDESTRIAN
    if not actor.pedestrian:
        kind = ObstacleType.TRUCK if actor.length_m > 6.0 else ObstacleType.CAR
    states = [
        ExtendedPMState(
            time_step=frame,
            position=np.array([actor.x_m[frame], actor.y_m[frame]]),
            orientation=_turned(actor.heading_rad[frame]),
            velocity=float(actor.speed_mps[frame]),
            acceleration=float(actor.accel_mps2[frame]),
        )
        for frame in range(1, len(actor.time_s))
    ]
    return DynamicObstacle(number, kind, shape, _initial(actor), TrajectoryPrediction(Trajectory(1, states), shape))


def _initial(actor: Actor) -> InitialState:
    return InitialState(
        time_step=0,
        position=np.array([actor.x_m[0], actor.y_m[0]]),
        orientation=_turned(actor.heading_rad[0]),
        velocity=float(actor.speed_mps[0]),
        acceleration=float(actor.accel_mps2[0]),
        yaw_rate=0.0,
        slip_angle=0.0,
    )


def _turned(heading_rad: float) -> float:
    """The same angle, within ±π."""
    return float(np.arctan2(np.sin(heading_rad), np.cos(heading_rad)))


def _problem(failure: Recorded, numbers: dict[str, int]) -> PlanningProblem:
    """From the ego's first frame to the lane that it was going to."""
    lane, _ = goal(failure)
    left, right = boundaries(lane.centre, lane.width_m)
    area = Lanelet(left, lane.centre, right, numbers[lane.id]).polygon
    reached = CustomState(time_step=Interval(failure.frames, failure.frames + LAST_STEPS), position=area)
    return PlanningProblem(PROBLEM, _initial(failure.ego), GoalRegion([reached], {0: [numbers[lane.id]]}))
