"""Writes CommonRoad XML: `python commonroad_writer.py FOLDER < scenario.json`.

`risk_sac.failures.export.commonroad` runs this file with the Python that has commonroad-io, whose pin of protobuf
suits no other package. So it imports nothing of risk_sac.
"""

import json
import sys
from pathlib import Path
from typing import Any

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

DECIMALS = 6  # µm


def write(told: dict[str, Any], file: Path, actors: list[int]) -> None:
    """Writes one scenario, as `commonroad.py` describes it, with some actors as obstacles."""
    name = ScenarioID(map_name="RiskSac", configuration_id=1, obstacle_behavior="T", prediction_id=1)
    scenario = Scenario(told["step_s"], name)
    network = LaneletNetwork()
    for each in told["lights"]:
        network.add_traffic_light(light(each), set())
    lanelets = {each["number"]: lanelet(each) for each in told["lanelets"]}
    for each in lanelets.values():
        network.add_lanelet(each)
    scenario.add_objects(network)
    scenario.add_objects([obstacle(each) for each in told["actors"] if each["number"] in actors])
    writer = CommonRoadFileWriter(
        scenario,
        PlanningProblemSet([problem(told["problem"], lanelets)]),
        author="RISK-SAC",
        affiliation=told["affiliation"],
        source="simulated in SUMO",
        tags={Tag.SIMULATED, Tag.CRITICAL},
        decimal_precision=DECIMALS,
        file_format=FileFormat.XML,
    )
    writer.write_to_file(str(file), OverwriteExistingFile.ALWAYS)


def light(told: dict[str, Any]) -> TrafficLight:
    """Returns a traffic light with its cycle."""
    elements = [TrafficLightCycleElement(TrafficLightState(colour), steps) for steps, colour in told["cycle"]]
    position, direction = np.array(told["position"]), TrafficLightDirection(told["direction"])
    return TrafficLight(told["number"], position, TrafficLightCycle(elements, 0), direction=direction)


def lanelet(told: dict[str, Any]) -> Lanelet:
    """Returns a lanelet."""
    left, centre, right = (np.array(told[line]) for line in ("left", "centre", "right"))
    walks, lights = told["type"] in ("sidewalk", "crosswalk"), set(told["lights"])
    stop = None
    if lights and not walks:
        stop = StopLine(left[-1], right[-1], LineMarking.SOLID, traffic_light_ref=lights)
    return Lanelet(
        left,
        centre,
        right,
        told["number"],
        predecessor=told["predecessor"],
        successor=told["successor"],
        adjacent_left=told["adjacent_left"],
        adjacent_left_same_direction=told["adjacent_left"] and True,
        adjacent_right=told["adjacent_right"],
        adjacent_right_same_direction=told["adjacent_right"] and True,
        stop_line=stop,
        lanelet_type={LaneletType(told["type"])},
        user_one_way=set() if walks else {RoadUser.VEHICLE},
        user_bidirectional={RoadUser.PEDESTRIAN} if walks else set(),
        traffic_lights=lights,
    )


def obstacle(told: dict[str, Any]) -> DynamicObstacle:
    """Returns a road user with its trajectory."""
    shape = RectObstacleShape(length=told["length_m"], width=told["width_m"])
    first, *later = told["states"]
    trajectory = Trajectory(1, [ExtendedPMState(**state(each)) for each in later])
    prediction = TrajectoryPrediction(trajectory, shape)
    return DynamicObstacle(told["number"], ObstacleType(told["type"]), shape, initial(first), prediction)


def state(told: dict[str, Any]) -> dict[str, Any]:
    """Returns the arguments of a state."""
    return told | {"position": np.array(told["position"])}


def initial(told: dict[str, Any]) -> InitialState:
    """Returns the state of the first frame."""
    return InitialState(**state(told), yaw_rate=0.0, slip_angle=0.0)


def problem(told: dict[str, Any], lanelets: dict[int, Lanelet]) -> PlanningProblem:
    """Returns the ego's planning problem."""
    goal = told["goal"]
    reached = CustomState(time_step=Interval(*told["steps"]), position=lanelets[goal].polygon)
    return PlanningProblem(told["number"], initial(told["initial"]), GoalRegion([reached], {0: [goal]}))


if __name__ == "__main__":
    told = json.load(sys.stdin)
    for name, actors in told["files"].items():
        write(told, Path(sys.argv[1]) / name, actors)
