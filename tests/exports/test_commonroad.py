"""CommonRoad scenarios, read by commonroad-io and put before CommonRoad's checker."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from risk_sac.failures.export.commonroad import ACTORS, LANELETS, STATES
from risk_sac.failures.export.formats import FormatName
from risk_sac.failures.net import colour
from tests.exports.conftest import CM, ask_checkers, checked
from tests.exports.make_examples import FAMILIES

NAMES = {"failure.xml": 1, "failure-as-recorded.xml": 0}


def read(file: Path, frames: int) -> Any:
    return json.loads(ask_checkers("read_commonroad.py", file, str(frames)))


@checked
@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize("name", NAMES)
def test_it_comes_back_within_a_centimetre(family, name, exported, failure):
    recorded = failure(family)
    scenario = read(exported(family, FormatName.COMMONROAD) / name, recorded.frames)
    driven = recorded.actors[NAMES[name] :]  # in one of them the ego is free
    assert len(scenario["obstacles"]) == len(driven)
    for actor in driven:
        obstacle = scenario["obstacles"][str(ACTORS + recorded.actors.index(actor))]
        wanted = np.column_stack((actor.x_m, actor.y_m, actor.speed_mps))
        assert np.abs(np.array(obstacle["states"]) - wanted).max() < CM
        assert obstacle["size"] == [actor.length_m, actor.width_m]
    for number, lane in enumerate(recorded.net.lanes.values(), start=LANELETS):
        left, right = (np.array(scenario["lanelets"][str(number)][side]) for side in ("left", "right"))
        assert np.abs((left + right) / 2 - lane.centre).max() < CM
        widths = np.linalg.norm(left - right, axis=1)
        assert np.abs(widths - lane.width_m).max() < 0.05  # wider where it bends, so that its sides are not
    problem = scenario["problem"]
    assert np.abs(np.subtract(problem["start"], (recorded.ego.x_m[0], recorded.ego.y_m[0]))).max() < CM
    assert problem["goal"] is not None


@checked
def test_lights_show_what_they_showed_in_every_frame(exported, failure):
    recorded = failure("dense")
    lights = read(exported("dense", FormatName.COMMONROAD) / "failure.xml", recorded.frames)["lights"]
    heads = [head for lane in recorded.net.lanes.values() for head in lane.heads]
    assert len(lights) == len(heads) == 20
    shown = [lights[number] for number in sorted(lights, key=int)]
    wanted = [[STATES[colour(chr(row[head.index]))] for row in recorded.heads[head.signal]] for head in heads]
    assert shown == wanted
    assert len({state for light in shown for state in light}) >= 2


@checked
@pytest.mark.parametrize("family", FAMILIES)
def test_its_checker_finds_what_ego_and_striker_drove_feasible(family, exported, failure):
    recorded = failure(family)
    striker = [actor.id for actor in recorded.actors].index(recorded.violation.other_id)
    vehicles = [ACTORS] + [ACTORS + striker] * (not recorded.actors[striker].pedestrian)
    file = exported(family, FormatName.COMMONROAD) / "failure-as-recorded.xml"
    told = json.loads(ask_checkers("ask_commonroad.py", file, *map(str, vehicles)))
    assert told == {str(number): True for number in vehicles}
