"""What is exported to OpenSCENARIO is imported to the same start and the same motion."""

import math

import numpy as np
import pytest

from risk_sac.failures.export.formats import FormatName
from risk_sac.openscenario.scenario_file import import_scenario
from risk_sac.scenario.ground import net_of
from risk_sac.scenario.interpret import Interpreter
from risk_sac.scenario.shipped import nets_of
from risk_sac.scenario.story_scene import StoryScene, ahead_of
from tests.exports.make_examples import FAMILIES

NEAR_M, NEAR_RAD = 0.1, math.radians(1.0)


@pytest.mark.parametrize("family", FAMILIES)
def test_starts_and_motion_come_back(family, exported, failure, tmp_path):
    imported = import_scenario(exported(family, FormatName.OPENSCENARIO) / "failure-as-recorded.xosc")
    for name, content in imported.files.items():
        (tmp_path / name).write_bytes(content)
    document = imported.document
    of = Interpreter(document, nets_of(document, tmp_path))
    value = of.value({})
    file, net = of.net(value)
    scene = StoryScene(document, value, file, net)
    names = {given: name for name, given in document.origin.actors.items()}
    shift = np.array(net_of(file).shift_m)
    for actor in failure(family).actors:
        moving = document.ego if names[actor.id] == "ego" else document.actors[names[actor.id]]
        assert moving.body == actor.body.name
        assert (moving.box.length_m, moving.box.width_m) == pytest.approx((actor.length_m, actor.width_m))
        start = scene.middle(names[actor.id], moving.body)
        wanted = np.column_stack((actor.x_m, actor.y_m)) + shift
        assert math.dist((start.x_m, start.y_m), wanted[0]) < NEAR_M
        assert abs(math.remainder(start.heading_rad - actor.heading_rad[0], math.tau)) < NEAR_RAD
        assert value.of(moving.speed) == pytest.approx(actor.speed_mps[0], abs=0.01)
        line = scene.places.trajectory(f"{actor.id} recorded", scene.pose)
        middles = [ahead_of(line.pose(line.station_at(time_s)), moving.box.ahead_m) for time_s in actor.time_s]
        apart_m = np.hypot(*(np.array([(pose.x_m, pose.y_m) for pose in middles]) - wanted).T)
        assert apart_m.max() < NEAR_M
