"""CommonRoad scenarios, read by commonroad-io and put before CommonRoad's checker."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from commonroad.common.file_reader import CommonRoadFileReader
from commonroad.scenario.traffic_light import TrafficLightState

from risk_sac.failures.export.commonroad import ACTORS, LANELETS, STATES
from risk_sac.failures.export.formats import FormatName
from risk_sac.failures.export.recorded import Recorded
from risk_sac.failures.export.signals import colour
from tests.exports.conftest import CM, FAMILIES, ask_checkers, checked

NAMES = {"failure.xml": 1, "failure-as-recorded.xml": 0}


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize("name", NAMES)
def test_it_comes_back_within_a_centimetre(
    family: str, name: str, exported: Callable[..., Path], failure: Callable[[str], Recorded]
) -> None:
    recorded = failure(family)
    scenario, problems = CommonRoadFileReader(str(exported(family, FormatName.COMMONROAD) / name)).open()
    driven = recorded.actors[NAMES[name] :]  # in one of them the ego is free
    assert len(scenario.dynamic_obstacles) == len(driven)
    for actor in driven:
        obstacle = scenario.obstacle_by_id(ACTORS + recorded.actors.index(actor))
        states = [obstacle.initial_state, *obstacle.prediction.trajectory.state_list]
        places = np.array([(*state.position, state.velocity) for state in states])
        assert np.abs(places - np.column_stack((actor.x_m, actor.y_m, actor.speed_mps))).max() < CM
        assert (obstacle.obstacle_shape.length, obstacle.obstacle_shape.width) == (actor.length_m, actor.width_m)
    for number, lane in enumerate(recorded.net.lanes.values(), start=LANELETS):
        lanelet = scenario.lanelet_network.find_lanelet_by_id(number)
        middle = (lanelet.left_vertices + lanelet.right_vertices) / 2
        assert np.abs(middle - lane.centre).max() < CM
        widths = np.linalg.norm(lanelet.left_vertices - lanelet.right_vertices, axis=1)
        assert np.abs(widths - lane.width_m).max() < 0.05  # wider where it bends, so that its sides are not
    (problem,) = problems.planning_problem_dict.values()
    assert np.abs(problem.initial_state.position - (recorded.ego.x_m[0], recorded.ego.y_m[0])).max() < CM
    assert problem.goal.lanelets_of_goal_position is not None


def test_lights_show_what_they_showed_in_every_frame(
    exported: Callable[..., Path], failure: Callable[[str], Recorded]
) -> None:
    recorded = failure("dense")
    scenario, _ = CommonRoadFileReader(str(exported("dense", FormatName.COMMONROAD) / "failure.xml")).open()
    heads = [head for lane in recorded.net.lanes.values() for head in lane.heads]
    lights = sorted(scenario.lanelet_network.traffic_lights, key=lambda light: light.traffic_light_id)
    assert len(lights) == len(heads) == 20
    shown: set[TrafficLightState] = set()
    for light, head in zip(lights, heads, strict=True):
        for frame in range(recorded.frames):
            letter = chr(recorded.heads[head.signal][frame, head.index])
            state = light.get_state_at_time_step(frame)
            assert state == STATES[colour(letter)]
            shown.add(state)
    assert len(shown) >= 2


@checked
@pytest.mark.parametrize("family", FAMILIES)
def test_its_checker_finds_what_ego_and_striker_drove_feasible(
    family: str, exported: Callable[..., Path], failure: Callable[[str], Recorded]
) -> None:
    recorded = failure(family)
    striker = [actor.id for actor in recorded.actors].index(recorded.collision.other_id)
    vehicles = [ACTORS] + [ACTORS + striker] * (not recorded.actors[striker].pedestrian)
    file = exported(family, FormatName.COMMONROAD) / "failure-as-recorded.xml"
    told = json.loads(ask_checkers("ask_commonroad.py", file, *map(str, vehicles)))
    assert told == {str(number): True for number in vehicles}
