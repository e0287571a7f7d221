"""In the checkers' environment: prints whether trajectories are feasible, as JSON."""

import json
import sys
import warnings

import numpy as np
from commonroad.common.file_reader import CommonRoadFileReader
from commonroad.common.solution import VehicleModel, VehicleType
from commonroad.scenario.state import PMState
from commonroad.scenario.trajectory import Trajectory
from commonroad_dc.feasibility.feasibility_checker import trajectory_feasibility
from commonroad_dc.feasibility.vehicle_dynamics import VehicleDynamics

DT_S = 0.1
warnings.simplefilter("ignore")


def feasible(obstacle) -> bool:
    states = [obstacle.initial_state, *obstacle.prediction.trajectory.state_list]
    places = np.array([state.position for state in states])
    speeds = np.gradient(places, axis=0) / DT_S
    told = [
        PMState(time_step=k, position=place, velocity=speed[0], velocity_y=speed[1])
        for k, (place, speed) in enumerate(zip(places, speeds, strict=True))
    ]
    car = VehicleDynamics.from_model(VehicleModel.PM, VehicleType.BMW_320i)
    return bool(trajectory_feasibility(Trajectory(0, told), car, DT_S)[0])


file, *asked = sys.argv[1:]
scenario, _ = CommonRoadFileReader(file).open()
print(json.dumps({number: feasible(scenario.obstacle_by_id(int(number))) for number in asked}))
