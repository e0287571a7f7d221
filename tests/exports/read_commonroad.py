"""In the checkers' environment: validates a scenario and prints it, as JSON."""

import json
import sys
from pathlib import Path

import commonroad
from commonroad.common.file_reader import CommonRoadFileReader
from lxml import etree

file, frames = sys.argv[1], int(sys.argv[2])
schema = next(Path(commonroad.__file__).parent.rglob("XML_commonRoad_XSD.xsd"))
etree.XMLSchema(etree.parse(str(schema))).assertValid(etree.parse(file))
scenario, problems = CommonRoadFileReader(file).open()
(problem,) = problems.planning_problem_dict.values()
obstacles = {
    obstacle.obstacle_id: {
        "states": [
            [*state.position, state.velocity]
            for state in [obstacle.initial_state, *obstacle.prediction.trajectory.state_list]
        ],
        "size": [obstacle.obstacle_shape.length, obstacle.obstacle_shape.width],
    }
    for obstacle in scenario.dynamic_obstacles
}
lanelets = {
    lanelet.lanelet_id: {"left": lanelet.left_vertices.tolist(), "right": lanelet.right_vertices.tolist()}
    for lanelet in scenario.lanelet_network.lanelets
}
lights = {
    light.traffic_light_id: [light.get_state_at_time_step(frame).value for frame in range(frames)]
    for light in scenario.lanelet_network.traffic_lights
}
told = {"start": problem.initial_state.position.tolist(), "goal": problem.goal.lanelets_of_goal_position}
print(json.dumps({"obstacles": obstacles, "lanelets": lanelets, "lights": lights, "problem": told}))
